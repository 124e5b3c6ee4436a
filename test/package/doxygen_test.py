"""The public headers' documentation builds without a warning."""
import pathlib
import shutil
import subprocess
import tempfile
import unittest

from checkout import CHECKOUT


class DoxygenTest(unittest.TestCase):
    @unittest.skipUnless(shutil.which('doxygen'), 'doxygen is not installed')
    def test_no_warnings(self):
        with tempfile.TemporaryDirectory() as folder:
            settings = (CHECKOUT / 'Doxyfile').read_text() + '\nOUTPUT_DIRECTORY = %s\n' % folder
            ran = subprocess.run(['doxygen', '-'], input=settings, cwd=CHECKOUT, capture_output=True, text=True, check=False)
            self.assertEqual((ran.returncode, ran.stdout, ran.stderr), (0, '', ''))
            pages = list(pathlib.Path(folder, 'html').glob('class*Monitor.html'))
            self.assertTrue(pages, 'the monitor has no page')


if __name__ == '__main__':
    unittest.main()
