"""The files that visitors and services look for: the citation, how to contribute and report."""
import re
import unittest
import xml.etree.ElementTree as ElementTree

import yaml

from checkout import CHECKOUT, tracked_files


class CitationTest(unittest.TestCase):
    def test_it_says_what_the_package_says(self):
        citation = yaml.safe_load((CHECKOUT / 'CITATION.cff').read_text())
        package = ElementTree.parse(CHECKOUT / 'package.xml').getroot()
        for key in ('version', 'license'):
            self.assertEqual(citation[key], package.find(key).text, key)
        self.assertEqual([author['name'] for author in citation['authors']], [element.text for element in package.findall('author')])
        self.assertIn('VERSION %s ' % citation['version'], (CHECKOUT / 'CMakeLists.txt').read_text())


class ReportingTest(unittest.TestCase):
    def test_no_address_is_invented(self):
        """The one in package.xml, which its format asks for, says itself that it is none."""
        for path in tracked_files():
            if path.suffix in ('.md', '.cff', '.yml', '.rst'):
                self.assertEqual(re.findall(r'[\w.+-]+@[\w-]+\.[a-z]{2,}\b', path.read_text()), [], path)
        self.assertIn('private reporting', (CHECKOUT / 'SECURITY.md').read_text())


if __name__ == '__main__':
    unittest.main()
