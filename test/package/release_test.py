"""A release: one version everywhere, and the files for forges and other package managers, held to package.xml by their keys."""
import base64
import csv
import gzip
import re
import shutil
import socket
import unittest
import xml.etree.ElementTree as ElementTree

import yaml

from checkout import CHECKOUT, FolderTestCase, run
from dependencies_test import FROM_OVERLAY, debian_list, package_keys

KEYS, RECIPE = 'dependencies/keys.csv', 'dependencies/conda/recipe.yaml'
REPORT = CHECKOUT / 'doc/reports/grasp_and_lay.html'


def text(name):
    return (CHECKOUT / name).read_text()


def rows():
    with open(CHECKOUT / KEYS, newline='') as file:
        return {row['key']: row for row in csv.DictReader(file)}


class VersionTest(unittest.TestCase):
    # Where a version stands -> what is around it; the first group is the version.
    PLACES = {'package.xml': r'<version>(.*)</version>', 'CMakeLists.txt': r'project\(deformable_ccd VERSION (\S+) ', 'CITATION.cff': r'(?m)^version: (.*)$',
              'CHANGELOG.rst': r'(?m)^(\d\S*) \(\d{4}-\d\d-\d\d\)\n-+\n', 'debian/changelog': r'^deformable-ccd \((.*?)\) ', RECIPE: r'(?m)^  version: "(.*)"$'}

    def test_it_is_one_everywhere(self):
        found = {}
        for name, pattern in self.PLACES.items():
            match = re.search(pattern, text(name))
            self.assertIsNotNone(match, '%s names no version' % name)
            found[name] = match.group(1)
        self.assertEqual(set(found.values()), {found['package.xml']}, found)
        self.assertRegex(found['package.xml'], r'^\d+\.\d+\.\d+$')

    def test_the_contributor_is_told_where_it_stands(self):
        release = re.search(r'To release:.*?\n\n', text('CONTRIBUTING.md'), re.S).group(0)
        self.assertEqual([name for name in self.PLACES if '`%s`' % name not in release], [])


class KeysTest(unittest.TestCase):
    def test_each_key_of_package_xml_has_its_row(self):
        found = rows()
        self.assertEqual(set(found), package_keys())
        for key, row in found.items():
            self.assertIn(row['public'], ('yes', 'no'), key)
            self.assertNotIn(None, row, '%s: a comma too many' % key)

    def test_the_debian_packages_are_those_of_the_setup(self):
        listed = {}
        for packages in debian_list().values():
            for package, keys in packages.items():
                for key in keys:
                    listed.setdefault(key, set()).add(package)
        self.assertEqual({key: set(row['debian'].split()) for key, row in rows().items()}, {key: listed.get(key, set()) for key in package_keys()})
        self.assertEqual({key for key, row in rows().items() if not row['debian']}, FROM_OVERLAY)

    def test_what_ubuntu_lacks_is_built_from_source_or_named(self):
        built = {line.split()[0] for line in text('dependencies/from-source.txt').splitlines() if line and not line.startswith('#')}
        lacking = {key: row for key, row in rows().items() if not row['ubuntu_20.04']}
        self.assertTrue(lacking)
        for key, row in lacking.items():
            self.assertTrue(row['debian'] in built or 'Ubuntu 20.04 has none' in row['note'], key)
            self.assertEqual('built from source' in row['note'], row['debian'] in built, key)

    def test_noetics_own_packages_are_named_for_their_keys(self):
        for key, row in rows().items():
            for column in ('ubuntu_20.04', 'conda'):
                if row[column].startswith('ros-noetic-') and key != 'libdynamicedt3d-dev':
                    self.assertEqual(row[column], 'ros-noetic-' + key.replace('_', '-'))


class RecipeTest(unittest.TestCase):
    def setUp(self):
        self.recipe = yaml.safe_load(text(RECIPE))

    def test_its_requirements_are_those_of_package_xml(self):
        found, wanted = rows(), {'host': set(), 'run': {'python'}}
        for element in ElementTree.fromstring(text('package.xml').encode()):
            for part, tags in (('host', ('buildtool_depend', 'build_depend', 'depend')), ('run', ('exec_depend', 'depend'))):
                if element.tag in tags:
                    self.assertTrue(found[element.text]['conda'], element.text)
                    wanted[part].add(found[element.text]['conda'])
        for part, names in wanted.items():
            self.assertEqual(sorted(names), self.recipe['requirements'][part])

    def test_its_keys(self):
        self.assertEqual(set(self.recipe), {'schema_version', 'context', 'package', 'source', 'build', 'requirements', 'tests', 'about'})
        self.assertEqual(self.recipe['package'], {'name': 'ros-noetic-deformable-ccd', 'version': '${{ version }}'})
        self.assertEqual(self.recipe['about']['license'], re.search('<license>(.*)</license>', text('package.xml')).group(1))
        self.assertTrue(((CHECKOUT / RECIPE).parent / self.recipe['source']['path'] / 'package.xml').is_file())
        self.assertTrue((CHECKOUT / self.recipe['about']['license_file']).is_file())
        for platform in ('linux', 'x86_64', 'aarch64'):
            self.assertIn(platform, self.recipe['build']['skip'][0])
        # What it gives CMake, somebody reads.
        for option in re.findall(r'-D(DEFORMABLE_CCD_\w+)=', ' '.join(self.recipe['build']['script'])):
            self.assertIn('option(%s ' % option, text('CMakeLists.txt'))


class WorkflowTest(unittest.TestCase):
    def setUp(self):
        self.jobs = yaml.safe_load(text('.github/workflows/ci.yml'))['jobs']

    def test_the_systems_that_it_runs_on(self):
        machines = {(one['release'], one['architecture']) for one in self.jobs['debian']['strategy']['matrix']['include']}
        self.assertEqual(machines, {(11, 'amd64'), (12, 'amd64'), (13, 'amd64'), (12, 'arm64')})
        self.assertIn('ros:noetic', text('docker/noetic.Dockerfile'))

    def test_what_it_calls_is_there(self):
        scripts = set()
        for job in self.jobs.values():
            lines = [step.get('run', '') for step in job['steps']] + [one['first'] for one in job.get('strategy', {}).get('matrix', {}).get('include', [])]
            for line in lines:
                self.assertEqual(run('bash', '-n', '-c', re.sub(r'\$\{\{.*?\}\}', 'true', line)).returncode, 0, line)
                scripts.update(re.findall(r'(?:^|[\s\'])((?:scripts|docker|config|\.ci)/[\w./-]+)', line))
        self.assertGreater(len(scripts), 6)
        self.assertEqual([name for name in scripts if not (CHECKOUT / name).is_file()], [])


class ReportTest(FolderTestCase):
    """The finished report (scripts/pictures)."""

    def setUp(self):
        packed = re.search(r'(?s)<script id="packed" type="text/plain">(.*?)</script>', REPORT.read_text()).group(1)
        self.page = gzip.decompress(base64.b64decode(packed)).decode()

    def test_it_is_small_and_names_no_place_of_the_machine_that_made_it(self):
        self.assertLessEqual(REPORT.stat().st_size, 2_000_000)
        self.assertEqual(re.findall(r'.{,30}(?:/(?:work|home|root|tmp|srv|opt)/|/usr/lib/|file://).{,30}', self.page), [])
        host = socket.gethostname()
        if len(host) > 3:  # a shorter one may be a word of the page
            self.assertEqual(re.findall(r'.{,30}(?<![\w.])%s(?![\w.]).{,30}' % re.escape(host), self.page), [])

    def test_what_is_in_it(self):
        wanted = ['towel', 'front_finger', '/octomap_full', 'player_data', '"own":', 'three.js authors']
        self.assertEqual([what for what in wanted if what not in self.page], [])

    def test_a_browser_unpacks_it(self):
        browser = shutil.which('chromium')
        if not browser:
            self.skipTest('no chromium')
        shown = run(browser, '--headless=new', '--no-sandbox', '--disable-gpu', '--virtual-time-budget=20000', '--user-data-dir=%s' % self.folder,
                    '--dump-dom', REPORT.as_uri(), timeout=180).stdout
        self.assertTrue('Contacts of a recorded run' in shown, shown[:500])
        self.assertTrue(re.search(r'<div id="verdict">.*towel', shown), 'the verdict is empty')

    def test_the_readmes_picture_leads_to_it(self):
        self.assertRegex(text('README.md'), r'\[!\[[^]]*\]\(doc/demo\.gif\)\]\(doc/reports/grasp_and_lay\.html\)')


if __name__ == '__main__':
    unittest.main()
