"""The wheel that scripts/wheel makes: of the built module at once, and with --long of nothing, in bare roots, installed where there is nothing of ours."""
import base64
import csv
import hashlib
import json
import os
import pathlib
import re
import shutil
import sys
import unittest
import zipfile

from checkout import CHECKOUT, TOOLS, FolderTestCase, run
from bare_root import INSIDE, BareRoot, CannotMake

TREE = TOOLS.parents[2] / 'build/deformable_ccd'
EXAMPLE = CHECKOUT / 'examples/python/two_frames.py'
SYSTEM = {'libc.so.6', 'libm.so.6', 'libstdc++.so.6', 'libgcc_s.so.1', 'libpthread.so.0', 'libdl.so.2', 'librt.so.1',
          'ld-linux-x86-64.so.2', 'ld-linux-aarch64.so.1'}
# What a reader does in a virtual environment.
ASKS = '''import dccd, json
lines = [line.split()[-1] for line in open('/proc/self/maps')]
print(json.dumps([dccd.__version__, dccd.__file__, sorted({l for l in lines if any(n in l for n in ('tbb', 'gmp', 'hwy', 'dccd', 'deformable'))})]))'''


def version():
    return re.search('<version>(.*)</version>', (CHECKOUT / 'package.xml').read_text()).group(1)


@unittest.skipIf(os.environ.get('DEFORMABLE_CCD_SANITIZED'), 'a module with a sanitizer is not built')
@unittest.skipUnless(list(TREE.glob('python_module/_dccd*.so')), 'the module is not built')
@unittest.skipUnless(shutil.which('patchelf'), 'patchelf is not installed')
class WheelTest(FolderTestCase):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        ran = run(CHECKOUT / 'scripts/wheel', '--python', sys.executable, '--tree', TREE, env={**os.environ, 'DEFORMABLE_CCD_WORKSPACE': str(cls.folder)})
        assert ran.returncode == 0, ran.stderr
        cls.wheel = pathlib.Path(ran.stdout.strip())

    def test_its_name_says_for_whom_it_is(self):
        python = 'cp%d%d' % sys.version_info[:2]
        glibc = os.confstr('CS_GNU_LIBC_VERSION').split()[1].replace('.', '_')
        self.assertEqual(self.wheel.name, 'dccd-%s-%s-%s-manylinux_%s_%s.whl' % (version(), python, python, glibc, os.uname().machine))

    def test_its_record_names_every_file_with_its_hash(self):
        with zipfile.ZipFile(self.wheel) as archive:
            names = set(archive.namelist())
            record = next(name for name in names if name.endswith('/RECORD'))
            rows = list(csv.reader(archive.read(record).decode().splitlines()))
            self.assertEqual({row[0] for row in rows}, names)
            for name, digest, size in rows:
                if name != record:
                    data = archive.read(name)
                    self.assertEqual((digest, int(size)), ('sha256=' + base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b'=').decode(), len(data)))
        self.assertFalse([name for name in names if '__pycache__' in name])

    def test_it_has_a_licence_of_each_library_in_it(self):
        with zipfile.ZipFile(self.wheel) as archive:
            names = archive.namelist()
            texts = {name.rsplit('/', 1)[1]: archive.read(name).decode() for name in names if '/licenses/' in name}
        self.assertIn('BSD 3-Clause', texts['LICENSE'])
        bundled = [re.match(r'dccd/lib(\w+?)-', name).group(1) for name in names if re.match(r'dccd/lib', name)]
        self.assertIn('deformable_ccd', bundled)
        for library in set(bundled) - {'deformable_ccd'}:
            self.assertTrue([name for name in texts if library in name], library)
        self.assertTrue([name for name in texts if re.match('libhwy|highway', name)])

    def test_its_libraries_need_each_other_and_the_systems_alone(self):
        with zipfile.ZipFile(self.wheel) as archive:
            libraries = [name for name in archive.namelist() if '.so' in name]
            archive.extractall(self.folder / 'unpacked', libraries)
        own = {pathlib.Path(name).name for name in libraries}
        self.assertGreaterEqual(len(own), 3)
        for name in libraries:
            dynamic = run('readelf', '-d', self.folder / 'unpacked' / name).stdout
            needed = set(re.findall(r'\(NEEDED\).*\[(.*)\]', dynamic))
            self.assertEqual(needed - SYSTEM - own, set(), name)
            self.assertEqual(re.findall(r'\(RU?N?PATH\).*\[(.*)\]', dynamic), ['$ORIGIN'], name)

    def test_pip_installs_it_in_an_environment_without_ros(self):
        place = self.folder / 'venv'
        made = run(sys.executable, '-m', 'venv', '--system-site-packages', place)
        if made.returncode != 0:
            self.skipTest('no venv: ' + (made.stdout + made.stderr).strip().splitlines()[-1])
        clean = {'PATH': '/usr/bin:/bin', 'HOME': str(self.folder), 'LANG': 'C.UTF-8'}
        installed = run(place / 'bin/pip', 'install', '--no-index', self.wheel, env=clean)
        self.assertEqual(installed.returncode, 0, installed.stderr)
        said = run(place / 'bin/python', EXAMPLE, env=clean, cwd=self.folder)
        self.assertRegex(said.stdout, r'(?m)^5 contacts, starts CLEAR; proved', said.stderr)
        ran = run(place / 'bin/python', '-c', ASKS, env=clean, cwd=self.folder)
        found, file, loaded = json.loads(ran.stdout)
        self.assertEqual(found, version())
        self.assertEqual([path for path in [file] + loaded if not path.startswith(str(place))], [])
        self.assertGreaterEqual(len(loaded), 4)

    def test_of_another_pythons_module_there_is_none(self):
        (self.folder / 'other/python_module').mkdir(parents=True)
        (self.folder / 'other/python_module/_dccd.cpython-37m-x86_64-linux-gnu.so').touch()
        ran = run(CHECKOUT / 'scripts/wheel', '--python', sys.executable, '--tree', self.folder / 'other')
        self.assertEqual(ran.returncode, 1)
        self.assertIn('build the target deformable_ccd_python for ' + sys.executable, ran.stderr)


@unittest.skipUnless(os.environ.get('DEFORMABLE_CCD_LONG'), 'builds the core anew, in bare roots: --long')
@unittest.skipIf(os.environ.get('DEFORMABLE_CCD_IN_BARE_ROOT'), 'this is a bare root')
class BareWheelTest(FolderTestCase):
    """Made in one root of each release, and installed in another that has python3-venv and python3-numpy."""
    INSTALL = 'export DEBIAN_FRONTEND=noninteractive; apt-get update -qq && apt-get install -y -qq --no-install-recommends %s >/dev/null && '

    def check(self, release, *options):
        try:
            roots = [BareRoot(self.folder / (release + use), release) for use in ('-made', '-used')]
            for root in roots:
                root.make()
                root.copy_checkout()
        except CannotMake as why:
            self.skipTest(str(why))
        made = roots[0].run(' '.join(('scripts/wheel',) + options), capture_output=True, text=True)
        self.assertEqual(made.returncode, 0, made.stdout[-2000:] + made.stderr[-2000:])
        inside = made.stdout.strip().splitlines()[-1]
        wheel = pathlib.Path(str(roots[0].folder) + inside)
        shutil.copy(wheel, roots[1].path(wheel.name))
        used = roots[1].run(self.INSTALL % 'python3-venv python3-numpy' + 'python3 -m venv --system-site-packages /tmp/venv && '
                            '/tmp/venv/bin/pip install --no-index %s && cd / && /tmp/venv/bin/python %s/examples/python/two_frames.py'
                            % (wheel.name, INSIDE), capture_output=True, text=True)
        self.assertRegex(used.stdout, r'(?m)^5 contacts, starts CLEAR; proved', used.stdout[-2000:] + used.stderr[-2000:])

    def test_debian_11(self):
        self.check('bullseye', '--from-source')

    def test_debian_12(self):
        self.check('bookworm')

    def test_debian_13(self):
        self.check('trixie')


if __name__ == '__main__':
    unittest.main()
