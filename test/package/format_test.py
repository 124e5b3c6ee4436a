"""The C++ tree is formatted as .clang-format says: 120 columns, sorted includes."""
import re
import shutil
import subprocess
import tempfile
import unittest

from checkout import CHECKOUT, tracked_files

VERSION = '14'  # Debian 12's; other versions break lines differently


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


if __name__ == '__main__':
    unittest.main()
