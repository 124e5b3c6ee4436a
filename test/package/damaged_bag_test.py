"""Bags that analyze_bag cannot open: one line with the file's name and the remedy, exit status 1; and the remedy helps."""
import io
import os
import resource
import shutil
import struct
import subprocess
import unittest

import rosbag
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import PointCloud2, PointField
from tf2_msgs.msg import TFMessage

from checkout import TOOLS, FolderTestCase


def cloud(stamp_s, frame='world'):
    """Four points, flat."""
    message = PointCloud2(height=2, width=2, point_step=12, row_step=24)
    message.header.frame_id, message.header.stamp = frame, rospy.Time.from_sec(stamp_s)
    message.fields = [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate('xyz')]
    message.data = b''.join(struct.pack('<3f', 0.1 * (i % 2), 0.1 * (i // 2), 0.0) for i in range(4))
    return message


def limited():
    if not os.environ.get('DEFORMABLE_CCD_SANITIZED'):  # sanitizers map more at the start
        resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))


class DamagedBagTest(FolderTestCase):
    def setUp(self):
        self.whole, self.unindexed = self.folder / 'whole.bag', self.folder / 'unindexed.bag'
        bag = rosbag.Bag(str(self.whole), 'w', chunk_threshold=4096)  # what of it is whole can be saved
        for k in range(200):
            bag.write('/cloth', cloud(100 + 0.1 * k), rospy.Time.from_sec(100 + 0.1 * k))
        bag.flush()
        shutil.copy(self.whole, self.unindexed)
        bag.close()

    def analyze(self, bag):
        command = [str(TOOLS / 'analyze_bag'), str(bag), '--mesh', '/cloth', '--report', str(self.folder / 'report'), '--quiet']
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)

    def refused(self, bag):
        """The one line that is said, with --mesh or without."""
        ran = self.analyze(bag)
        self.assertEqual(ran.returncode, 1, ran.stderr)
        self.assertEqual(ran.stderr.count('\n'), 1, ran.stderr)
        self.assertIn(str(bag) + ': ', ran.stderr)
        plain = subprocess.run([str(TOOLS / 'analyze_bag'), str(bag), '--report', str(self.folder / 'report')],
                               capture_output=True, text=True, check=False, timeout=60)
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
        subprocess.run(['rosbag', 'reindex', str(self.unindexed)], check=True, capture_output=True)
        self.assertEqual(self.analyze(self.unindexed).returncode, 0, 'the remedy')

    def test_one_that_is_cut(self):
        size = self.whole.stat().st_size
        for keep in (size - 1, size - 100, size // 2, 4096 + 13, 4096, 100, 13, 9):
            with self.subTest(kept=keep):
                path = self.cut(keep)
                self.assertRegex(self.refused(path), r'the bag is cut or damaged \(.*\); run: rosbag reindex %s\n' % path)
        half = self.cut(size // 2)
        subprocess.run(['rosbag', 'reindex', str(half)], check=True, capture_output=True)
        self.assertEqual(self.analyze(half).returncode, 0, 'the remedy')

    def test_lengths_and_places_that_are_wrong(self):
        """rosbag trusts them: it read past its buffers, and was ended by a signal."""
        whole = self.whole.read_bytes()
        damages = {'index_pos': whole.index(b'index_pos=') + 10, 'chunk_pos': whole.rindex(b'chunk_pos=') + 10}
        for op in (2, 3, 4, 5, 6, 7):  # message, file, index, chunk, chunk's info, connection
            damages['length of the field op %d' % op] = whole.rindex(b'op=%c' % op) - 4
        index_end, stamp = whole.index(b'op=\x06'), rospy.Time.from_sec(100 + 0.1 * 199)
        damages['count of an index'] = whole.rindex(b'count=', 0, index_end) + 6
        damages['place of a message'] = whole.rindex(struct.pack('<II', stamp.secs, stamp.nsecs), 0, index_end) + 8
        for what, at in damages.items():
            with self.subTest(what=what):
                path = self.folder / 'wrong.bag'
                path.write_bytes(whole[:at] + struct.pack('<I', 999999) + whole[at + 4:])
                self.assertRegex(self.refused(path), r'the bag is cut or damaged \(the record at byte \d+ is none\)')

    def test_what_is_no_bag(self):
        self.assertIn('the file is empty: nothing was recorded', self.refused(self.cut(0)))
        other = self.folder / 'other.bag'
        other.write_text('v 0 0 0\n' * 1000)
        self.assertIn("the file is no bag: it does not begin with '#ROSBAG V'", self.refused(other))

    def test_transforms_that_are_none(self):
        """A damaged message is left out, whatever it claims to hold: not the run, nor all of the memory."""
        params, bytes_of_one = self.folder / 'world.yaml', io.BytesIO()
        params.write_text('fixed_frame: world\n')
        placed = TransformStamped(child_frame_id='camera')
        placed.header.frame_id, placed.header.stamp, placed.transform.rotation.w = 'world', rospy.Time.from_sec(100), 1
        TFMessage([placed]).serialize(bytes_of_one)
        for topic in ('/tf', '/tf_static'):
            for count in (2, 0x4000001, 0xffffffff):
                path, damaged = self.folder / 'tf.bag', struct.pack('<I', count) + bytes_of_one.getvalue()[4:]
                with rosbag.Bag(str(path), 'w') as bag:
                    for k in range(3):
                        bag.write('/cloth', cloud(100 + 0.1 * k, 'camera'), rospy.Time.from_sec(100 + 0.1 * k))
                    bag.write('/tf_static', TFMessage([placed]), rospy.Time.from_sec(100))
                    for data in (damaged, damaged[:2]):
                        bag.write(topic, ('tf2_msgs/TFMessage', data, TFMessage._md5sum, TFMessage), rospy.Time.from_sec(100.05), raw=True)
                command = [str(TOOLS / 'analyze_bag'), str(path), '--mesh', '/cloth', '--params', str(params), '--report',
                           str(self.folder / 'report'), '--quiet']
                ran = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, preexec_fn=limited)
                with self.subTest(topic=topic, count=count):
                    self.assertEqual(ran.returncode, 0, ran.stderr)
                    self.assertIn('tf: a message on %s is damaged and left out' % topic, ran.stderr)

    def test_diagnostics_that_are_none(self):
        path, result, damaged = self.folder / 'diagnostics.bag', self.folder / 'result.bag', 12 * b'\0' + struct.pack('<II', 0, 7)
        with rosbag.Bag(str(path), 'w') as bag:
            for k in range(3):
                bag.write('/cloth', cloud(100 + 0.1 * k), rospy.Time.from_sec(100 + 0.1 * k))
            bag.write('/diagnostics', ('diagnostic_msgs/DiagnosticArray', damaged, DiagnosticArray._md5sum, DiagnosticArray),
                      rospy.Time.from_sec(100.05), raw=True)
        ran = subprocess.run([str(TOOLS / 'analyze_bag'), str(path), '--mesh', '/cloth', '-o', str(result), '--report',
                              str(self.folder / 'report'), '--quiet'],
                             capture_output=True, text=True, check=False, timeout=60)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        with rosbag.Bag(str(result)) as bag:
            self.assertIn(damaged, [m[1] for _, m, _ in bag.read_messages(topics=['/diagnostics'], raw=True)])

    def test_a_quaternion_that_is_none(self):
        """The reason of the frame without a place, and the complaint, name it."""
        path, turned = self.folder / 'turned.bag', TransformStamped(child_frame_id='camera')
        turned.header.frame_id, turned.header.stamp, turned.transform.rotation.w = 'world', rospy.Time.from_sec(100), 1.2
        with rosbag.Bag(str(path), 'w') as bag:
            bag.write('/tf_static', TFMessage([turned]), rospy.Time.from_sec(100))
            for k in range(2):
                bag.write('/cloth', cloud(100 + 0.1 * k, 'camera'), rospy.Time.from_sec(100 + 0.1 * k))
        params = self.folder / 'world.yaml'
        params.write_text('fixed_frame: world\n')
        ran = subprocess.run([str(TOOLS / 'analyze_bag'), str(path), '--mesh', '/cloth', '--params', str(params), '--report',
                              str(self.folder / 'report'), '--quiet'],
                             capture_output=True, text=True, check=False, timeout=60)
        self.assertEqual(ran.returncode, 3, ran.stderr)
        words = "transforms of 'camera' are left out: its rotation x y z w (0 0 0 1.2) has the length 1.2; publish a quaternion"
        self.assertIn('tf: ' + words, ran.stderr)
        self.assertRegex(ran.stderr, r'NO_TRANSFORM: no transform from .camera. to .world.: .*; transforms of .camera. are left out')


if __name__ == '__main__':
    unittest.main()
