"""Long work says how far it is: on a terminal a bar with the time that is left, elsewhere plain lines, and nothing of short work."""
import os
import pty
import re
import subprocess
import threading
import unittest

from checkout import CHECKOUT, TOOLS, FolderTestCase, run


def on_a_terminal(command):
    """What it writes to standard error, a terminal."""
    own, its = pty.openpty()
    process = subprocess.Popen([str(c) for c in command], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=its)
    os.close(its)
    said = []

    def read():
        try:
            while True:
                said.append(os.read(own, 65536).decode())
        except OSError:  # it has ended
            pass

    reader = threading.Thread(target=read)
    reader.start()
    status = process.wait(timeout=300)
    reader.join()
    os.close(own)
    return status, ''.join(said)


@unittest.skipIf(os.environ.get('DEFORMABLE_CCD_SANITIZED'), "OctoMap's headers say what they write where assertions are on")
class ProgressTest(FolderTestCase):
    def setUp(self):
        self.record = [TOOLS / 'make_scene_bag', CHECKOUT / 'config/scenes/rope_through_ring.yaml', self.folder / 'scene.bag']

    def test_on_a_terminal_a_bar_with_the_time_that_is_left(self):
        status, said = on_a_terminal([*self.record, '--frames', 8000])
        self.assertEqual(status, 0, said)
        self.assertRegex(said, r'\rrope_through_ring \[#+ +\] +\d+ %, about 0:\d\d:\d\d left')
        shares = [int(share) for share in re.findall(r'(\d+) %', said)]
        self.assertEqual(shares, sorted(shares))
        self.assertEqual(shares[-1], 100)
        self.assertTrue(said.endswith('100 %\x1b[K\r\n'), said[-80:])
        self.assertEqual(on_a_terminal([*self.record, '--frames', 8000, '--quiet'])[1], '')

    def test_short_work_says_nothing(self):
        ran = run(*self.record, '--frames', 3)
        self.assertEqual((ran.returncode, ran.stderr), (0, ''))


if __name__ == '__main__':
    unittest.main()
