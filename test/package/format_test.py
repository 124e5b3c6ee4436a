"""The C++ tree is formatted as .clang-format says: 120 columns, sorted includes."""
import re
import shutil
import subprocess
import tempfile
import unittest

from checkout import CHECKOUT, code_under, tracked_files

VERSION = '14'  # Debian 12's; other versions break lines differently
MOST_LINES = 60  # of a function's body, which a reader can see at once


def clang_format():
    """The program of that version, or None."""
    for name in ('clang-format-' + VERSION, 'clang-format'):
        program = shutil.which(name)
        if program:
            said = subprocess.run([program, '--version'], capture_output=True, text=True, check=True).stdout
            if re.search(r'version %s\.' % VERSION, said):
                return program
    return None


@unittest.skipUnless(clang_format(), 'clang-format %s is not installed' % VERSION)
class FormatTest(unittest.TestCase):
    def check(self, files):
        return subprocess.run([clang_format(), '--dry-run', '-Werror', '--style=file:%s' % (CHECKOUT / '.clang-format'),
                               *map(str, files)], capture_output=True, text=True, check=False)

    def test_every_source_file(self):
        files = [p for p in tracked_files() if p.suffix in ('.h', '.cpp')]
        self.assertGreater(len(files), 200, 'the scan found too little to mean anything')
        ran = self.check(files)
        wrong = sorted(set(re.findall(r'^(\S+?):\d+:\d+: error', ran.stderr, re.M)))
        self.assertEqual(wrong, [], 'run clang-format -i on these files')
        self.assertEqual(ran.returncode, 0, ran.stderr[:2000])

    def test_what_is_not_formatted_is_seen(self):
        with tempfile.NamedTemporaryFile('w', suffix='.cpp', dir=CHECKOUT / 'test') as file:
            file.write('#include <vector>\n#include <string>\nint  f( ) ;\n')
            file.flush()
            self.assertNotEqual(self.check([file.name]).returncode, 0)


def functions(text):
    """The line and the length of each body. Of formatted code: what begins at a column is closed there."""
    lines = text.split('\n')
    for first, line in enumerate(lines):
        head = re.match(r'(?:  )?(?!namespace|class|struct|union|enum|extern|#|/)[\w~]', line)
        if head is None or '(' not in line:
            continue
        opens = next((n for n in range(first, len(lines)) if lines[n].endswith(('{', ';', '}')) or not lines[n]), None)
        if opens is None or not lines[opens].endswith('{'):
            continue
        last = next(n for n in range(opens + 1, len(lines)) if lines[n].startswith(line[:head.end() - 1] + '}'))
        yield first + 1, last - opens - 1


class LengthTest(unittest.TestCase):
    def test_no_function_is_longer_than_a_screen(self):
        found = [(path, line, length) for folder in ('src', 'include', 'scenes', 'paper', 'oracle') for path in code_under(folder)
                 for line, length in functions(path.read_text())]
        self.assertGreater(len(found), 1500, 'the scan found too little to mean anything')
        self.assertEqual(['%s:%d: %d lines' % (path.relative_to(CHECKOUT), line, length)
                          for path, line, length in found if length > MOST_LINES], [])

    def test_a_long_one_is_seen(self):
        body = '  f();\n' * (MOST_LINES + 1)
        for head in ('void g() {', 'int C::g(int a,\n         int b) const {', 'struct S {\n  void g() {'):
            self.assertIn(MOST_LINES + 1, [length for _, length in functions(head + '\n' + body + '  }\n' * ('S' in head) + '}\n')])


if __name__ == '__main__':
    unittest.main()
