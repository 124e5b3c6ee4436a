"""package.xml, the CMake files and scripts/debian-packages.txt say the same."""
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree

from checkout import CHECKOUT, TOOLS

# In no Debian package: scripts/build links the definitions in dependencies/ where the system has none.
FROM_OVERLAY = {'octomap_msgs'}


def package_keys():
    root = ElementTree.parse(CHECKOUT / 'package.xml').getroot()
    return {e.text.strip() for e in root if e.tag.endswith('depend')}


def debian_list():
    """Debian package -> set of keys, for every group."""
    groups, group = {}, None
    for line in (CHECKOUT / 'scripts/debian-packages.txt').read_text().splitlines():
        if line.startswith('['):
            group = groups.setdefault(line.strip('[] '), {})
        elif line.strip() and not line.startswith('#'):
            package, *keys = line.split()
            group[package] = set(keys)
    return groups


class DependenciesTest(unittest.TestCase):
    def setUp(self):
        self.groups = debian_list()
        self.packages = {name: keys for group in self.groups.values() for name, keys in group.items()}
        self.served = {key for keys in self.packages.values() for key in keys if not key.startswith('tool:')}

    def test_every_key_of_package_xml_has_a_debian_package(self):
        self.assertEqual(package_keys() - self.served - FROM_OVERLAY, set())

    def test_every_key_of_the_list_is_in_package_xml(self):
        self.assertEqual(self.served - package_keys(), set())

    def test_every_listed_package_says_what_it_is_for(self):
        self.assertEqual([name for name, keys in self.packages.items() if not keys], [])

    def test_test_dependencies_are_in_the_test_group(self):
        root = ElementTree.parse(CHECKOUT / 'package.xml').getroot()
        only_tests = {e.text for e in root.findall('test_depend')}
        others = {e.text for e in root if e.tag.endswith('depend') and e.tag != 'test_depend'}
        in_build = {key for keys in self.groups['build'].values() for key in keys}
        in_rviz = {key for keys in self.groups['rviz'].values() for key in keys}
        self.assertEqual((only_tests - others) & in_build, set())
        self.assertEqual(others - in_build - in_rviz - FROM_OVERLAY, set())

    def test_overlay_is_what_package_xml_asks_for(self):
        root = ElementTree.parse(CHECKOUT / 'dependencies/octomap_msgs/package.xml').getroot()
        self.assertEqual({root.find('name').text}, FROM_OVERLAY)

    def test_nothing_is_missing_here(self):
        if not shutil.which('dpkg-query'):
            self.skipTest('not a Debian system')
        listing = subprocess.run([str(CHECKOUT / 'scripts/setup'), '--tests', '--list'], capture_output=True, text=True,
                                 check=True)
        self.assertEqual(listing.stdout.split(), [])

    def test_octomap_message_is_the_upstream_one(self):
        from octomap_msgs.msg import Octomap
        self.assertEqual(Octomap._md5sum, '9a45536b45c5e409cd49f04bb2d9999f')

    def test_catkin_lint_is_clean(self):
        if not shutil.which('catkin_lint'):
            self.skipTest('catkin_lint is not installed')
        # Notices included. The name of the checkout's folder is its owner's business, and the lint wants the package's:
        # it gets links of that name.
        with tempfile.TemporaryDirectory() as folder:
            for name, package in [('deformable_ccd', '.'), ('octomap_msgs', 'dependencies/octomap_msgs')]:
                with self.subTest(name):
                    link = pathlib.Path(folder) / name
                    link.symlink_to(CHECKOUT / package)
                    result = subprocess.run(['catkin_lint', '--offline', '-W2', '--strict', str(link)],
                                            capture_output=True, text=True, check=False)
                    self.assertEqual((result.returncode, result.stdout.strip()), (0, ''), result.stderr)
                    self.assertIn('checked 1 packages and found 0 problems', result.stderr)


class CalledTest(unittest.TestCase):
    """What sentences and pages have people call is installed by scripts/setup. `rosrun tf tf_echo` was not."""
    HAS = {'tf2_tools': 'tf2-tools', 'nodelet': 'libnodeletlib-tools', 'dynamic_reconfigure': 'python3-dynamic-reconfigure',
           'deformable_ccd': None}

    def test_every_rosrun(self):
        texts = [*(CHECKOUT / 'src').rglob('*.cpp'), *(CHECKOUT / 'doc').glob('*.md'), *CHECKOUT.glob('*.md')]
        called = {(found, path.name) for path in texts for found in re.findall(r'rosrun (\w+) ', path.read_text())}
        self.assertIn(('tf2_tools', 'advice.cpp'), called)
        self.assertEqual([one for one in sorted(called) if one[0] not in self.HAS], [])
        installed = debian_list()['build']
        self.assertEqual([package for package in self.HAS.values() if package and package not in installed], [])


class LibraryTest(unittest.TestCase):
    def test_it_shows_its_interface_and_nothing_within(self):
        library = TOOLS.parent / 'libdeformable_ccd.so'
        if not library.is_file():
            self.skipTest('%s is not built' % library.name)
        shown = subprocess.run(['nm', '-DC', '--defined-only', str(library)], capture_output=True, text=True, check=True).stdout
        self.assertIn('dccd::detect(', shown)
        self.assertEqual([line for line in shown.splitlines() if '::Impl::' in line], [])

    def test_its_soname_counts_with_its_interface(self):
        """So that a program is never run with a library that it was not built for (doc/interface.md)."""
        library = TOOLS.parent / 'libdeformable_ccd.so'
        if not library.is_file():
            self.skipTest('%s is not built' % library.name)
        version = re.search(r'define DCCD_API_VERSION (\d+)', (CHECKOUT / 'include/dccd/export.h').read_text()).group(1)
        dynamic = subprocess.run(['readelf', '-d', str(library)], capture_output=True, text=True, check=True).stdout
        self.assertIn('soname: [libdeformable_ccd.so.%s]' % version, dynamic)

    def test_no_program_loads_vtk(self):
        """Thirty libraries and more, for which every program and the nodelet would take three times as long to start."""
        found = [path for path in (TOOLS / 'check_step', TOOLS / 'analyze_bag', TOOLS.parent / 'libdeformable_ccd_ros.so') if path.is_file()]
        if not found:
            self.skipTest('nothing is built')
        for path in found:
            loaded = subprocess.run(['ldd', str(path)], capture_output=True, text=True, check=True).stdout
            self.assertIn('libdeformable_ccd.so', loaded)
            self.assertNotIn('libvtk', loaded, path)


if __name__ == '__main__':
    unittest.main()
