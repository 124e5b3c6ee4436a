"""The files that visitors and services look for: the citation, the workflow, how to contribute and report."""
import re
import unittest
import xml.etree.ElementTree as ElementTree

import yaml

from checkout import CHECKOUT, tracked_files

# What version 1.2.0 of the Citation File Format knows, as far as it concerns this file: it refuses any other key.
CITATION_KEYS = {'abstract', 'authors', 'cff-version', 'commit', 'contact', 'date-released', 'doi', 'identifiers',
                 'keywords', 'license', 'license-url', 'message', 'preferred-citation', 'references', 'repository',
                 'repository-artifact', 'repository-code', 'title', 'type', 'url', 'version'}
NAME_KEYS = {'name'}, {'family-names', 'given-names'}  # of a group, of a person
REFERENCE_KEYS = {'authors', 'doi', 'issue', 'journal', 'title', 'type', 'volume', 'year'}


class CitationTest(unittest.TestCase):
    def setUp(self):
        self.citation = yaml.safe_load((CHECKOUT / 'CITATION.cff').read_text())
        self.package = ElementTree.parse(CHECKOUT / 'package.xml').getroot()

    def expect_authors(self, entry):
        self.assertTrue(entry['authors'])
        for author in entry['authors']:
            self.assertIn(set(author), NAME_KEYS)
            self.assertTrue(all(isinstance(part, str) and part for part in author.values()), author)

    def test_it_is_valid(self):
        citation = self.citation
        self.assertEqual(set(citation) - CITATION_KEYS, set())
        for key in ('cff-version', 'message', 'title', 'version', 'abstract', 'license'):
            self.assertIsInstance(citation[key], str, key)
        self.assertEqual((citation['cff-version'], citation['type']), ('1.2.0', 'software'))
        self.assertEqual(len(citation['keywords']), len(set(citation['keywords'])))
        self.expect_authors(citation)
        for reference in citation['references']:
            self.assertEqual(set(reference) - REFERENCE_KEYS, set())
            self.assertEqual((reference['type'], type(reference['year'])), ('article', int))
            self.assertRegex(reference['doi'], r'^10\.\d{4,9}/\S+$')
            self.expect_authors(reference)

    def test_it_says_what_the_package_says(self):
        for key, element in (('version', 'version'), ('license', 'license')):
            self.assertEqual(self.citation[key], self.package.find(element).text, key)
        authors = [element.text for element in self.package.findall('author')]
        self.assertEqual([author['name'] for author in self.citation['authors']], authors)
        self.assertIn('VERSION %s ' % self.citation['version'], (CHECKOUT / 'CMakeLists.txt').read_text())


class WorkflowTest(unittest.TestCase):
    """On a service the container is the bare machine: the demo comes before anything that the tests install."""

    def setUp(self):
        self.job, = yaml.safe_load((CHECKOUT / '.github/workflows/ci.yml').read_text())['jobs'].values()

    def test_the_demo_runs_first_in_a_plain_container(self):
        self.assertEqual(self.job['container'], 'debian:12', 'a mapping could ask for more than a container may do')
        steps = [step.get('run') or step['uses'] for step in self.job['steps']]
        wanted = ['apt-get', 'actions/checkout', 'git config', 'scripts/demo', '.ci/run', 'actions/upload-artifact']
        self.assertEqual([re.match(start, step) is not None for start, step in zip(wanted, steps)], [True] * len(steps))
        self.assertEqual(len(steps), len(wanted))

    def test_it_installs_nothing_but_git(self):
        words = self.job['steps'][0]['run'].split('--no-install-recommends')[1].split()
        self.assertEqual(words, ['git', 'ca-certificates'])

    def test_its_scripts_are_there(self):
        for script in ('scripts/demo', '.ci/run'):
            self.assertTrue((CHECKOUT / script).stat().st_mode & 0o100, script)


class ReportingTest(unittest.TestCase):
    def test_no_address_is_invented(self):
        """The one in package.xml, which its format asks for, says itself that it is none."""
        for path in tracked_files():
            if path.suffix in ('.md', '.cff', '.yml', '.rst'):
                self.assertEqual(re.findall(r'[\w.+-]+@[\w-]+\.[a-z]{2,}\b', path.read_text()), [], path)
        self.assertIn('private reporting', (CHECKOUT / 'SECURITY.md').read_text())


if __name__ == '__main__':
    unittest.main()
