"""The margins of the elementary tests at a tenth of their size, one at a time, and which tests fail then.

Only the sources that use the margins are compiled anew, for the baseline instruction set alone, and linked before the core's
archive with test/property/margins_test.cpp. Run directly, it prints the table of doc/accuracy.md:
test/package/margins_test.py BUILD_DIR [MARGIN...].
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

from checkout import CHECKOUT

TOLERANCES = 'include/dccd/tolerances.h'
# Margin -> file, its text, the text at a tenth.
MARGINS = {name: (TOLERANCES, r'(\b%s = )([^;]+);' % name, r'\g<1>0.1 * (\g<2>);') for name in (
    'BATCH_VALUE', 'BATCH_VALUE_ROUNDING', 'BATCH_MINOR', 'BATCH_MINOR_SLOPE', 'BATCH_SEPARATION', 'INSIDE_MINOR',
    'ADVANCE_SEPARATION', 'ADVANCE_LENGTH', 'ADVANCE_POINT')}
MARGINS.update({
    'of a projection (exact_subdivision.cpp)': ('src/elementary/exact_subdivision.cpp', r'largest \* 0x1p-50', '0.1 * largest * 0x1p-50'),
    'of f in pairs of doubles (exact_double_double.cpp)': ('src/elementary/exact_double_double.cpp', r'0x1p-97 \* volume', '0.1 * 0x1p-97 * volume'),
    'of f in double (exact_double_double.cpp)': ('src/elementary/exact_double_double.cpp', r'0x1p-46 \* volume', '0.1 * 0x1p-46 * volume'),
    'of f\' in double (exact_double_double.cpp)': ('src/elementary/exact_double_double.cpp', r'0x1p-43 \* volume', '0.1 * 0x1p-43 * volume'),
    'of a quadratic in double (exact_roots.h)': ('src/elementary/exact_roots.h', r'0x1p-49 \+ 2\.5 \* enclosure\.radius',
                                                 '0.1 * 0x1p-49 + 0.25 * enclosure.radius'),
})
# Each of these two makes room for the other's errors; at a tenth both are cut.
TOGETHER = 'ADVANCE_SEPARATION and ADVANCE_LENGTH'
MARGINS[TOGETHER] = (TOLERANCES, r'(\bADVANCE_(?:SEPARATION|LENGTH) = )([^;]+);', r'\g<1>0.1 * (\g<2>);')
# Those that some test holds. The others' worst cases are rarer than the generators of margins_test.cpp find.
HELD = [TOGETHER]
FLAGS = ['-std=c++17', '-O2', '-ffp-contract=off', '-DHWY_COMPILE_ONLY_STATIC', '-I/usr/include/eigen3']


def run(command, **more):
    return subprocess.run([str(c) for c in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **more)


class Mutants:
    def __init__(self, build, folder):
        self.build, self.folder = pathlib.Path(build), pathlib.Path(folder)
        self.sources = sorted((CHECKOUT / 'src' / 'elementary').glob('*.cpp')) + [CHECKOUT / 'src' / 'simd' / 'exact_batch.cpp']
        self.test = self.compiled(CHECKOUT / 'test' / 'property' / 'margins_test.cpp', CHECKOUT, 'test.o')
        self.objects = {source.name: self.compiled(source, CHECKOUT, source.stem + '.o') for source in self.sources}

    def compiled(self, source, tree, name):
        out = self.folder / name
        done = run(['g++', *FLAGS, '-I', tree / 'src', '-I', tree / 'include', '-I', CHECKOUT / 'src', '-I', CHECKOUT / 'include',
                    '-I', CHECKOUT, '-I', CHECKOUT / 'test', '-c', source, '-o', out])
        if done.returncode:
            sys.exit(done.stdout)
        return out

    def failed(self, objects):
        """The tests that fail with these objects."""
        program = self.folder / 'margins'
        done = run(['g++', self.test, *objects, '-o', program, self.build / 'libdeformable_ccd_test_support.a',
                    self.build / 'libdeformable_ccd_oracle.a', self.build / 'libdeformable_ccd_archive.a',
                    '-lrapidcheck', '-lgtest', '-lgtest_main', '-lhwy', '-ltbb', '-lgmp', '-lz', '-lpthread'])
        if done.returncode:
            sys.exit(done.stdout)
        done = run([program], timeout=3600, cwd=self.folder)
        return sorted(set(re.findall(r'\[  FAILED  \] (Margins\.\w+) \(', done.stdout)))

    def without(self, name):
        """The tests that fail with the margin at a tenth."""
        file, pattern, replacement = MARGINS[name]
        tree = self.folder / 'tree'
        shutil.rmtree(tree, ignore_errors=True)
        (tree / file).parent.mkdir(parents=True)
        text, count = re.subn(pattern, replacement, (CHECKOUT / file).read_text())
        if count == 0:
            sys.exit('%s: no margin "%s"' % (file, name))
        (tree / file).write_text(text)
        word = name.split()[0] if file == TOLERANCES else None
        objects = dict(self.objects)
        for source in self.sources:
            mutated = tree / source.relative_to(CHECKOUT)
            if file.endswith('.cpp') and mutated.exists():
                objects[source.name] = self.compiled(mutated, tree, 'mutant_' + source.stem + '.o')
            elif file.endswith('exact_roots.h') and source.stem == 'exact_integer_tiers':
                # What a file includes beside itself is found beside it: the copy must stand there as well.
                for header in (CHECKOUT / 'src' / 'elementary').glob('exact_*.h'):
                    if not (tree / 'src' / 'elementary' / header.name).exists():
                        shutil.copy(header, tree / 'src' / 'elementary')
                objects[source.name] = self.compiled(source, tree, 'mutant_' + source.stem + '.o')
            elif word and uses(source, word):
                objects[source.name] = self.compiled(source, tree, 'mutant_' + source.stem + '.o')
        return self.failed(objects.values())


def uses(source, margin):
    """Whether a source uses a margin, itself or in the files of its kernels."""
    texts = [source.read_text()]
    if source.name == 'exact_batch.cpp':
        texts += [p.read_text() for p in source.parent.glob('exact_batch*.h')]
    return any('tolerance::' + margin in text for text in texts)


def table(build, names=tuple(MARGINS)):
    with tempfile.TemporaryDirectory() as folder:
        mutants = Mutants(build, folder)
        whole = mutants.failed(mutants.objects.values())
        if whole:
            sys.exit('without a mutation these fail: ' + ', '.join(whole))
        found = {}
        for name in names:
            found[name] = mutants.without(name)
            print('| %s | %s |' % (name, ', '.join(found[name]) or 'none'), flush=True)
        return found


@unittest.skipUnless(os.environ.get('DEFORMABLE_CCD_LONG'), 'builds the core anew: --long')
class Margins(unittest.TestCase):
    def test_each_margin_is_held(self):
        build = CHECKOUT / 'build' / 'margins'
        for command in (['cmake', '-S', CHECKOUT, '-B', build, '-DDEFORMABLE_CCD_CORE_ONLY=ON', '-DCMAKE_BUILD_TYPE=Release'],
                        ['cmake', '--build', build, '--target', 'deformable_ccd_test_support', 'deformable_ccd_archive']):
            done = run(command)
            self.assertEqual(done.returncode, 0, done.stdout[-3000:])
        found = table(build)
        self.assertEqual([name for name in HELD if not found[name]], [])


if __name__ == '__main__':
    if len(sys.argv) > 1 and os.path.isdir(sys.argv[1]):
        table(sys.argv[1], sys.argv[2:] or tuple(MARGINS))
    else:
        unittest.main()
