"""A message type stands in one source file: its row, in src/input/message_types. All else asks the table."""
import re
import unittest

from checkout import CHECKOUT, code_under, tracked_files

ROWS = CHECKOUT / 'src/input/message_types'
# These write messages for others to read: the recorder of scenes, the bag of results, and what RViz shows.
WRITERS = {'src/apps/analyze_bag/result_bag.cpp', 'scenes/messages.cpp',
           'scenes/messages.h', 'src/output/marker_drawing.h',
           'src/output/markers.cpp', 'src/output/markers.h', 'src/output/outputs.cpp', 'src/output/scene_markers.cpp'}
# This one knows the types that make the map, a cloud among them.
MAPS = {'src/input/known_types.cpp'}
TESTS = {'cmake/tests.cmake'}  # precompiles headers of messages that tests make


def registered():
    """Package, name and file of each type that has a row."""
    return [(package, name, path) for path in sorted(ROWS.glob('*.cpp'))
            for package, name in re.findall(r'meshType<(\w+)::(\w+),', path.read_text())]


def sources():
    scripts = [p for p in tracked_files() if p.relative_to(CHECKOUT).parts[0] in ('scripts', 'cmake', 'CMakeLists.txt')]
    return {str(p.relative_to(CHECKOUT)): p.read_text(errors='replace') for p in
            code_under('include') + code_under('src') + scripts}


class MessageTypesTest(unittest.TestCase):
    def test_every_type_stands_in_its_own_file_alone(self):
        texts = {name: text for name, text in sources().items() if name not in WRITERS | MAPS | TESTS}
        rows = registered()
        self.assertGreaterEqual(len(rows), 6, 'the search found too little to mean anything')
        for package, name, path in rows:
            with self.subTest(name):
                word = re.compile(r'\b%s(/|::)%s\b' % (package, name))
                found = [file for file, text in sorted(texts.items()) if word.search(text)]
                self.assertEqual(found, [str(path.relative_to(CHECKOUT))])

    def test_every_type_is_on_the_pages(self):
        for page, start in (('doc/interface.md', '| `mesh` (or'), ('launch/monitor.launch', '  <arg name="mesh"')):
            line = next(one for one in (CHECKOUT / page).read_text().splitlines() if one.startswith(start))
            for _, name, _ in registered():
                with self.subTest(page + ': ' + name):
                    self.assertIn(name, line)


if __name__ == '__main__':
    unittest.main()
