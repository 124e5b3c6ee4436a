"""Bags that analyze_bag cannot open: one line with the file's name and the remedy, exit status 1; and the remedy helps."""
import io
import os
import resource
import shutil
import struct
import unittest

import genpy
import rosbag
from diagnostic_msgs.msg import DiagnosticArray
from tf2_msgs.msg import TFMessage

from bag_messages import cloud, transform, write_bag
from checkout import TOOLS, FolderTestCase, run


def frame_of(number, frame='world'):
    """Four points, flat, ten times a second."""
    at = genpy.Time.from_sec(100 + 0.1 * number)
    return '/cloth', cloud([(0.1 * (i % 2), 0.1 * (i // 2), 0.0) for i in range(4)], at, frame, rows=2), at


def limited():
    if not os.environ.get('DEFORMABLE_CCD_SANITIZED'):  # sanitizers map more at the start
        resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))


class DamagedBagTest(FolderTestCase):
    def setUp(self):
        self.whole, self.unindexed = self.folder / 'whole.bag', self.folder / 'unindexed.bag'
        bag = rosbag.Bag(str(self.whole), 'w', chunk_threshold=4096)  # what of it is whole can be saved
        for k in range(200):
            bag.write(*frame_of(k))
        bag.flush()
        shutil.copy(self.whole, self.unindexed)
        bag.close()

    def analyze(self, bag, *words, **more):
        return run(TOOLS / 'analyze_bag', bag, '--mesh', '/cloth', '--report', self.folder / 'report', '--quiet', *words, timeout=60,
                   **more)

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

    def test_zeros_where_an_older_reindex_cut_it(self):
        """ros_comm 1.15.9 goes on behind where it cut."""
        half = self.cut(self.whole.stat().st_size // 2)
        self.assertEqual(run('rosbag', 'reindex', '--force', half).returncode, 0)
        read = bytearray(half.read_bytes())
        at = read.index(b'index_pos=') + 10
        index = struct.unpack_from('<Q', read, at)[0]
        few = 0 if read[:index].endswith(bytes(8)) else 1  # where that version is, its own lie there already
        for zeros, wrong, expected in ((0, b'', 0), (2000, b'', 0), (3, b'', few), (2000, b'x', 1)):
            with self.subTest(zeros=zeros, wrong=wrong):
                struct.pack_into('<Q', read, at, index + zeros + len(wrong))
                half.write_bytes(read[:index] + zeros * b'\0' + wrong + read[index:])
                ran = self.analyze(half)
                self.assertEqual(ran.returncode, expected, ran.stderr)

    def test_zeros_beyond_all_memory(self):
        read = bytearray(self.whole.read_bytes())
        at = read.index(b'index_pos=') + 10
        index = struct.unpack_from('<Q', read, at)[0]
        struct.pack_into('<Q', read, at, 5 << 30)
        with open(self.folder / 'sparse.bag', 'wb') as sparse:
            sparse.write(read[:index])
            sparse.truncate((5 << 30) + 100)
        ran = self.analyze(self.folder / 'sparse.bag', preexec_fn=limited)
        self.assertEqual(ran.returncode, 1)
        self.assertIn('(the record at byte %d is none)' % index, ran.stderr)

    def test_lengths_and_places_that_are_wrong(self):
        """rosbag trusts them: it read past its buffers, and was ended by a signal."""
        whole = self.whole.read_bytes()
        damages = {'index_pos': whole.index(b'index_pos=') + 10, 'chunk_pos': whole.rindex(b'chunk_pos=') + 10}
        for op in (2, 3, 4, 5, 6, 7):  # message, file, index, chunk, chunk's info, connection
            damages['length of the field op %d' % op] = whole.rindex(b'op=%c' % op) - 4
        index_end, stamp = whole.index(b'op=\x06'), genpy.Time.from_sec(100 + 0.1 * 199)
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
        params, bytes_of_one, start = self.folder / 'world.yaml', io.BytesIO(), genpy.Time.from_sec(100)
        params.write_text('fixed_frame: world\n')
        placed = TFMessage([transform('camera', start)])
        placed.serialize(bytes_of_one)
        for topic in ('/tf', '/tf_static'):
            for count in (2, 0x4000001, 0xffffffff):
                path, damaged = self.folder / 'tf.bag', struct.pack('<I', count) + bytes_of_one.getvalue()[4:]
                with rosbag.Bag(str(path), 'w') as bag:
                    bag.write('/tf_static', placed, start)
                    for k in range(3):
                        bag.write(*frame_of(k, 'camera'))
                    for data in (damaged, damaged[:2]):
                        bag.write(topic, ('tf2_msgs/TFMessage', data, TFMessage._md5sum, TFMessage), start, raw=True)
                with self.subTest(topic=topic, count=count):
                    ran = self.analyze(path, '--params', params, preexec_fn=limited)
                    self.assertEqual(ran.returncode, 0, ran.stderr)
                    self.assertIn('tf: a message on %s is damaged and left out' % topic, ran.stderr)

    def test_diagnostics_that_are_none(self):
        path, result, damaged = self.folder / 'diagnostics.bag', self.folder / 'result.bag', 12 * b'\0' + struct.pack('<II', 0, 7)
        with rosbag.Bag(str(path), 'w') as bag:
            for k in range(3):
                bag.write(*frame_of(k))
            bag.write('/diagnostics', ('diagnostic_msgs/DiagnosticArray', damaged, DiagnosticArray._md5sum, DiagnosticArray),
                      genpy.Time.from_sec(100.05), raw=True)
        ran = self.analyze(path, '-o', result)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        with rosbag.Bag(str(result)) as bag:
            self.assertIn(damaged, [m[1] for _, m, _ in bag.read_messages(topics=['/diagnostics'], raw=True)])

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
