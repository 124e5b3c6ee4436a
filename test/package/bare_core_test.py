"""The core library in a bare root (scripts/lib/bare_root.py) that has a compiler, Eigen, oneTBB, Highway, GMP and nothing else of ours: it is
built and installed there, and examples/library is built against it and finds its contacts."""
import os
import re
import unittest

import checkout  # noqa: F401 (it puts scripts/lib on the path)
from bare_root import CannotMake, bare_root, host_release

TOOLS = 'cmake g++ make pkg-config'
LIBRARIES = 'libeigen3-dev libtbb-dev libhwy-dev libgmp-dev'
# What the library may load: of these packages, and of the compiler and the C library.
MAY_LOAD = ('libtbb.so', 'libhwy.so', 'libgmp.so', 'libstdc++.so', 'libm.so', 'libgcc_s.so', 'libc.so', 'ld-linux')
STORY = '''
export DEBIAN_FRONTEND=noninteractive
apt-get update -qq && apt-get install -y -qq --no-install-recommends %s %s >/dev/null
cmake -S . -B build-core -DDEFORMABLE_CCD_CORE_ONLY=ON -DDEFORMABLE_CCD_TESTS=OFF -DCMAKE_INSTALL_PREFIX=/opt/core
cmake --build build-core -j"$(nproc)"
cmake --install build-core >/dev/null
cmake -S examples/library -B build-example -DCMAKE_PREFIX_PATH=/opt/core
cmake --build build-example
readelf -d "$(find /opt/core -name 'libdeformable_ccd.so')"
./build-example/two_frames
find /opt/core -type f
''' % (TOOLS, LIBRARIES)


@unittest.skipUnless(os.environ.get('DEFORMABLE_CCD_LONG'), 'builds the core anew, in a bare root: --long')
@unittest.skipIf(os.environ.get('DEFORMABLE_CCD_IN_BARE_ROOT'), 'this is a bare root')
class BareCoreTest(unittest.TestCase):
    def test_eigen_tbb_highway_and_gmp_are_enough(self):
        try:
            with bare_root(host_release()) as root:
                ran = root.run('set -e; ' + STORY, capture_output=True, text=True, check=False)
        except CannotMake as why:
            self.skipTest(str(why))
        self.assertEqual(ran.returncode, 0, ran.stdout[-3000:] + ran.stderr[-3000:])
        loads = re.findall(r'\(NEEDED\).*\[(.*)\]', ran.stdout)
        self.assertGreater(len(loads), 4)
        self.assertEqual([name for name in loads if not name.startswith(MAY_LOAD)], [])
        self.assertRegex(ran.stdout, r'(?m)^[1-9]\d* contacts, starts CLEAR$')
        # Without CLI11 and nlohmann-json there are no tools and no report.
        self.assertNotRegex(ran.stdout, r'/opt/core/(bin|share)/')


if __name__ == '__main__':
    unittest.main()
