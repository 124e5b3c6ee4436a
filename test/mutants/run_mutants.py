#!/usr/bin/env python3
"""Makes each error of mutants.txt, one at a time, in a copy of the checkout, and demands that the named tests fail.

usage: test/mutants/run_mutants.py [--in COPY] [--witnesses | NAME...]
  NAME      only these mutants
  --witnesses  instead: each witness of a proof left out, one at a time, which must cost a test its proof. They are found
            in the code: what answers a question of a Claim, and what says that something was looked at
  --in      a copy of the checkout that is built with its tests already; its files are changed, and changed back.
            Else build/mutants, which is copied and built first
Exit status: 1 where a mutant survives, or its tests fail without it, too.
"""
import argparse
import dataclasses
import os
import pathlib
import re
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
CHECKOUT = HERE.parents[1]
TIME_LIMIT_S = 900  # a test that hangs has found something


@dataclasses.dataclass
class Mutant:
    name: str
    file: str
    old: str
    new: str
    targets: list
    tests: str


def read_mutants(text):
    mutants = []
    for block in re.split(r'\n\n+', re.sub(r'(?m)^#.*\n?', '', text).strip()):
        head, *lines, last = block.split('\n')
        name, file = head.split(': ')
        changes = {sign: [line[1:] for line in lines if line.startswith(sign)] for sign in '-+'}
        assert len(changes['-']) + len(changes['+']) == len(lines) and changes['-'], block
        targets, tests = last.split(' ', 1)
        mutants.append(Mutant(name, file, '\n'.join(changes['-']), '\n'.join(changes['+']), targets.split(','), tests))
    return mutants


ALL = read_mutants((HERE / 'mutants.txt').read_text())


# A statement of its own, with the condition on its line, that answers a question or says what was looked at.
WITNESS = re.compile(r'^ *(?:if \([^;]*?\) )?(?:(?:outcome\.)?claim\.answer\(|answer\(Question::|looked\.(?:at|compared)\w*\()'
                     r'(?s:.*?);\n', re.M)
# By folder: what is built, and what takes all the answers of that folder.
PROVED = {'src/step': ('unit_tests', 'Spared.*:Assurance.HoldsWhereNothingIsMissing'), 'src/node': ('ros_tests', 'CellsClaim.*')}


def witnesses():
    """A mutant for each."""
    found = []
    for folder, (target, tests) in PROVED.items():
        for path in sorted((CHECKOUT / folder).rglob('*.cpp')):
            text = path.read_text()
            for number, match in enumerate(WITNESS.finditer(text)):
                start = match.start()
                while text.count(text[start:match.end()]) > 1:  # with the lines before it, there just once
                    start = text.rindex('\n', 0, start - 1) + 1
                name = '%s-%d' % (path.stem, number + 1)
                found.append(Mutant(name, str(path.relative_to(CHECKOUT)), text[start:match.end()],
                                    text[start:match.start()], [target], tests))
    return found


class Copy:
    """A copy of the checkout that is built."""

    def __init__(self, folder):
        self.folder = folder
        # What the caller's workspace put there is of another build.
        self.environment = {name: ':'.join(part for part in value.split(':') if not part.startswith(str(CHECKOUT / 'build')))
                            if name.endswith('PATH') else value for name, value in os.environ.items()}
        self.environment.pop('DEFORMABLE_CCD_WORKSPACE', None)

    def run(self, command, time_limit_s=None):
        """Exit status, None: out of time; and what it printed."""
        try:
            done = subprocess.run(['bash', '-c', command], cwd=self.folder, env=self.environment, stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, timeout=time_limit_s, check=False)
        except subprocess.TimeoutExpired:
            return None, ''
        return done.returncode, done.stdout.decode(errors='replace')

    def make(self):
        """Copies what git knows and builds it; files that are the same stay, so that little is built the next time."""
        listed = subprocess.run(['git', '-C', str(CHECKOUT), 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
                                stdout=subprocess.PIPE, check=True).stdout.decode()
        for name in filter(None, listed.split('\0')):
            source, target = CHECKOUT / name, self.folder / name
            if not source.is_file() or (target.exists() and target.read_bytes() == source.read_bytes()):
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(source.read_bytes())
            target.chmod(source.stat().st_mode)
        status, said = self.run('scripts/build --tests')
        if status != 0:
            sys.exit('the copy %s cannot be built: %s' % (self.folder, said[-3000:]))

    def build(self, targets):
        return self.run('ninja -C build/build %s' % ' '.join(targets))

    def test(self, mutant):
        """Whether its tests pass, and which of them fail."""
        if '.py' in mutant.tests:
            file, *names = mutant.tests.split()
            command = 'cd %s && %s -m unittest %s -v %s' % (
                os.path.dirname(file), sys.executable, ' '.join('-k ' + n for n in names), os.path.basename(file))
        else:
            command = "build/build/deformable_ccd/gtest/%s --gtest_filter='%s'" % (mutant.targets[0], mutant.tests)
        status, said = self.run('. build/devel/setup.bash && ' + command, TIME_LIMIT_S)
        ran = re.search(r'^\[==========\] Running [1-9]|^Ran [1-9]', said, re.M)
        failed = re.findall(r'^\[  FAILED  \] ([\w./]+)(?:, where.*)? \(|^(?:FAIL|ERROR): (\w+)', said, re.M)
        names = sorted({one or other for one, other in failed})
        return status == 0 and ran is not None, ', '.join(names) or ('out of time' if status is None else 'exit status %d' % status)

    def run_mutant(self, mutant):
        """Whether it is killed, and how."""
        path = self.folder / mutant.file
        text = path.read_text()
        assert text.count(mutant.old) == 1, mutant.file + ' holds the old text %d times' % text.count(mutant.old)
        path.write_text(text.replace(mutant.old, mutant.new))
        try:
            status, said = self.build(mutant.targets)
            if status != 0:
                return False, 'is not built: ' + said[-1500:]
            passes, failed = self.test(mutant)
            return not passes, failed
        finally:
            path.write_text(text)  # a newer file, which the next build compiles


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('names', nargs='*', metavar='NAME')
    parser.add_argument('--in', dest='copy', type=pathlib.Path)
    parser.add_argument('--witnesses', action='store_true')
    arguments = parser.parse_args()
    known = witnesses() if arguments.witnesses else ALL
    unknown = set(arguments.names) - {mutant.name for mutant in known}
    if unknown:
        parser.error('no mutant is named ' + ', '.join(sorted(unknown)))
    chosen = [mutant for mutant in known if not arguments.names or mutant.name in arguments.names]
    copy = Copy(arguments.copy or CHECKOUT / 'build' / 'mutants')
    if not arguments.copy:
        copy.make()
    status, said = copy.build(sorted({target for mutant in chosen for target in mutant.targets}))
    if status != 0:
        sys.exit('the copy cannot be built: ' + said[-3000:])
    # What the tests say without a mutant: before the first one, which the next build takes back.
    whole = {}
    for mutant in chosen:
        key = mutant.targets[0], mutant.tests
        whole[key] = whole.get(key) or copy.test(mutant)
    bad = 0
    for mutant in chosen:
        passes, failed = whole[mutant.targets[0], mutant.tests]
        killed, how = copy.run_mutant(mutant) if passes else (False, 'its tests fail without it: ' + failed)
        bad += not killed
        print('%-8s %-36s %s' % ('killed' if killed else 'SURVIVES', mutant.name, how), flush=True)
    print('%d of %d mutants are killed' % (len(chosen) - bad, len(chosen)))
    return 1 if bad else 0


if __name__ == '__main__':
    sys.exit(main())
