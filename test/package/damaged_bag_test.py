"""Bags that analyze_bag cannot open: one line with the file's name and the remedy, exit status 1; and the remedy helps."""
import shutil
import unittest

import genpy
import rosbag
from tf2_msgs.msg import TFMessage

from bag_messages import cloud, transform, write_bag
from checkout import TOOLS, FolderTestCase, run


def frame_of(number, frame='world'):
    """Four points, flat, ten times a second."""
    at = genpy.Time.from_sec(100 + 0.1 * number)
    return '/cloth', cloud([(0.1 * (i % 2), 0.1 * (i // 2), 0.0) for i in range(4)], at, frame, rows=2), at


class DamagedBagTest(FolderTestCase):
    def setUp(self):
        self.whole, self.unindexed = self.folder / 'whole.bag', self.folder / 'unindexed.bag'
        bag = rosbag.Bag(str(self.whole), 'w', chunk_threshold=4096)  # what of it is whole can be saved
        for k in range(200):
            bag.write(*frame_of(k))
        bag.flush()
        shutil.copy(self.whole, self.unindexed)
        bag.close()

    def analyze(self, bag, *words):
        return run(TOOLS / 'analyze_bag', bag, '--mesh', '/cloth', '--report', self.folder / 'report', '--quiet', *words, timeout=60)

    def refused(self, bag):
        """The one line that is said, with --mesh or without."""
        ran = self.analyze(bag)
        self.assertEqual(ran.returncode, 1, ran.stderr)
        self.assertEqual(ran.stderr.count('\n'), 1, ran.stderr)
        self.assertIn(str(bag) + ': ', ran.stderr)
        plain = run(TOOLS / 'analyze_bag', bag, '--report', self.folder / 'report', timeout=60)
        self.assertEqual((plain.returncode, plain.stderr), (1, ran.stderr))
        return ran.stderr

    def cut(self, size):
        path = self.folder / 'cut.bag'
        path.write_bytes(self.whole.read_bytes()[:size])
        return path

    def test_a_whole_one(self):
        self.assertEqual(self.analyze(self.whole).returncode, 0)

    def test_a_recording_that_was_not_ended(self):
        said = self.refused(self.unindexed)
        self.assertIn('the bag has no index, as its recording was not ended; run: rosbag reindex %s\n' % self.unindexed, said)
        self.assertEqual(run('rosbag', 'reindex', self.unindexed).returncode, 0)
        self.assertEqual(self.analyze(self.unindexed).returncode, 0, 'the remedy')

    def test_one_that_is_cut(self):
        size = self.whole.stat().st_size
        for keep in (size - 1, size - 100, size // 2, 4096 + 13, 4096, 100, 13, 9):
            with self.subTest(kept=keep):
                path = self.cut(keep)
                self.assertRegex(self.refused(path), r'the bag is cut or damaged \(.*\); run: rosbag reindex %s\n' % path)
        half = self.cut(size // 2)
        self.assertEqual(run('rosbag', 'reindex', half).returncode, 0)
        self.assertEqual(self.analyze(half).returncode, 0, 'the remedy')

    def test_what_is_no_bag(self):
        self.assertIn('the file is empty: nothing was recorded', self.refused(self.cut(0)))
        other = self.folder / 'other.bag'
        other.write_text('v 0 0 0\n' * 1000)
        self.assertIn("the file is no bag: it does not begin with '#ROSBAG V'", self.refused(other))

    def test_a_quaternion_that_is_none(self):
        """The reason of the frame without a place, and the complaint, name it."""
        start = genpy.Time.from_sec(100)
        path = write_bag(self.folder / 'turned.bag', [('/tf_static', TFMessage([transform('camera', start, w=1.2)]), start),
                                                      frame_of(0, 'camera'), frame_of(1, 'camera')])
        params = self.folder / 'world.yaml'
        params.write_text('fixed_frame: world\n')
        ran = self.analyze(path, '--params', params)
        self.assertEqual(ran.returncode, 3, ran.stderr)
        words = "transforms of 'camera' are left out: its rotation x y z w (0 0 0 1.2) has the length 1.2; publish a quaternion"
        self.assertIn('tf: ' + words, ran.stderr)
        self.assertRegex(ran.stderr, r'NO_TRANSFORM: no transform from .camera. to .world.: .*; transforms of .camera. are left out')


if __name__ == '__main__':
    unittest.main()
