"""The fuzzers of decoders build: what of ours their files call is in one of these files. They are built by --long alone."""
import re
import subprocess
import unittest

from checkout import CHECKOUT, TOOLS

OBJECTS = TOOLS.parents[2] / 'build/deformable_ccd/CMakeFiles'


def symbols(path, *flags):
    """Names of ours, as nm lists them: undefined ones, or defined ones."""
    listed = subprocess.run(['nm', '-C', *flags, str(path)], capture_output=True, text=True, check=True).stdout
    return set(re.findall(r' \w ((?:typeinfo for |vtable for )?dccd::.*)$', listed, re.M))


class FuzzersTest(unittest.TestCase):
    def test_the_list_of_their_files_is_whole(self):
        page = (CHECKOUT / 'cmake/fuzz.cmake').read_text()
        files = set(re.findall(r'src/[\w/]+\.cpp', page[page.index('add_library(deformable_ccd_decoders'):]))
        files |= {str(path.relative_to(CHECKOUT)) for path in (CHECKOUT / 'src/input/message_types').glob('*.cpp')}
        self.assertGreater(len(files), 15)
        core = list(OBJECTS.glob('deformable_ccd_objects.dir/src/**/*.o'))
        self.assertGreater(len(core), 50, 'objects of the core')
        objects = []
        for file in sorted(files):
            found = list(OBJECTS.glob('*/' + file + '.o'))
            self.assertTrue(found, file + ' was not built')
            objects.append(found[0])
        needed = {}
        for path in objects:
            for name in symbols(path, '-u'):
                needed.setdefault(name, path.name)
        for path in objects + core:
            for name in symbols(path, '--defined-only'):
                needed.pop(name, None)
        self.assertEqual(needed, {}, 'called, and in no file that cmake/fuzz.cmake lists')


if __name__ == '__main__':
    unittest.main()
