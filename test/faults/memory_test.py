"""max_memory_mb against messages that are large, or small and make much: resident size of the node, asserted."""
import pathlib
import sys
import time
import unittest

from deformable_ccd.msg import ContactArray
from pcl_msgs.msg import PolygonMesh

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / 'scripts/lib'))
from ros_process import SLOW, wait_for
from live_node import Cloud, LiveNodeTest, bytes_of, raw, resident_kb

LIMIT_MB = 64


class MemoryTest(LiveNodeTest):
    def watch(self, node, seconds, until=lambda: False):
        """The largest resident size [MB] above that of the start, while messages come."""
        most, end = 0, time.monotonic() + seconds * SLOW
        while time.monotonic() < end and not until():
            most = max(most, resident_kb(node.pid))
            time.sleep(0.005)
        return (most - self.started_kb) / 1024

    def start(self, name, **parameters):
        node = self.start_node(name, max_memory_mb=LIMIT_MB, **parameters)
        self.started_kb = resident_kb(node.pid)
        return node

    def assert_bounded(self, grown_mb, message_mb):
        """Beyond the limit roscpp holds a message that it reads, and the one that it hands over."""
        if SLOW == 1:
            self.assertLess(grown_mb, 1.1 * LIMIT_MB + 2 * message_mb)

    def recovers(self, node, cloud):
        seen = len(self.contacts)
        for _ in range(3):
            cloud.count += 1
            self.step(cloud.message())
        self.assertTrue(self.contacts[-1].answered, self.contacts[-1].reason)
        self.assertGreater(len(self.contacts), seen)
        self.assertIsNone(node.poll())

    def test_large_frames_behind_one_that_waits_for_tf(self):
        node = self.start('tf', transform_timeout_s=4, queue_size=100)
        padding = 100000
        cloud = Cloud(10, 12, padding=padding)  # 12 MB a frame
        for _ in range(12):
            message = cloud.message()
            message.header.frame_id = 'nowhere'
            self.publisher.publish(message)
        grown = self.watch(node, 30, lambda: len(self.contacts) >= 1)
        self.assert_bounded(grown, 12)
        wait_for(lambda: self.stats and self.stats[-1].frames_received >= 12 and self.stats[-1].frames_waiting == 0, 60,
                 'all frames')
        self.assertGreater(self.stats[-1].skipped_queue_full, 0)
        self.recovers(node, Cloud(10, 12))
        self.assert_adds_up(self.stats[-1])

    def test_polygons_without_corners(self):
        node = self.start('empty')
        publisher = self.retype('empty', PolygonMesh)
        message = PolygonMesh(cloud=Cloud(10, 12).message(100))
        message.header = message.cloud.header
        for count, words in ((3000000, 'polygons has 3000000 entries'), (6000000, 'a message of 240')):
            seen = len(self.contacts)
            data = bytes_of(message)[:-4] + count.to_bytes(4, 'little') + bytes(4 * count)  # as objects it would take minutes
            publisher.publish(raw(PolygonMesh, data))
            grown = self.watch(node, 20, lambda: len(self.contacts) > seen)
            self.assertEqual(self.contacts[-1].status, ContactArray.BAD_MESSAGE)
            self.assertIn(words, self.contacts[-1].reason)
            self.assertIn('max_memory_mb', self.contacts[-1].reason)
            self.assert_bounded(grown, 24)


if __name__ == '__main__':
    unittest.main()
