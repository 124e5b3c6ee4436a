"""Each margin of tolerances.h at a tenth of its size, one at a time: a test must fail then (`--long`).

The core is built once, with margins that are variables, in a folder of its own; test/margins/cut_margins.cpp cuts them; its table:

    build/margins/cut_margins
"""
import os
import re
import subprocess
import unittest

from checkout import CHECKOUT

TOLERANCES = (CHECKOUT / 'include' / 'dccd' / 'tolerances.h').read_text()
# What covers rounding is declared as such, and is a variable where it is cut.
MARGINS = set(re.findall(r'^DCCD_MARGIN (?:double|float) (\w+) =', TOLERANCES, re.M))


def run(command):
    return subprocess.run([str(c) for c in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


class Margins(unittest.TestCase):
    def test_each_margin_has_a_check(self):
        checks = (CHECKOUT / 'test' / 'support' / 'margin_checks.cpp').read_text()
        self.assertGreater(len(MARGINS), 20)
        self.assertEqual([m for m in sorted(MARGINS) if '{"%s",' % m not in checks], [])

    @unittest.skipUnless(os.environ.get('DEFORMABLE_CCD_LONG'), 'builds the core anew: --long')
    def test_each_margin_is_held(self):
        build = CHECKOUT / 'build' / 'margins'
        for command in (['cmake', '-S', CHECKOUT, '-B', build, '-DDEFORMABLE_CCD_CORE_ONLY=ON', '-DDEFORMABLE_CCD_VARIABLE_MARGINS=ON',
                         '-DCMAKE_BUILD_TYPE=Release'],
                        ['cmake', '--build', build, '--target', 'cut_margins']):
            done = run(command)
            self.assertEqual(done.returncode, 0, done.stdout[-3000:])
        done = run([build / 'cut_margins'])
        rows = dict(re.findall(r'^\| `(\w+)` \|.*\| (\S+) \|$', done.stdout, re.M))
        self.assertEqual(set(rows), MARGINS, done.stdout)
        self.assertEqual(done.returncode, 0, done.stdout)


if __name__ == '__main__':
    unittest.main()
