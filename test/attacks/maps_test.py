"""max_map_mb against maps that are small as messages and large as what is made of them: resident size of the node, asserted."""
import os
import struct
import time
import unittest

import rospy
from attack import SLOW, AttackTest, checkerboard, flat_cloud, octomap, peak_kb, resident_kb, wait_for
from deformable_ccd.msg import ContactArray
from octomap_msgs.msg import Octomap

MAP_MB, MEMORY_MB = 64, 64


class MapsTest(AttackTest):
    def start(self, name, **parameters):
        """A node with a topic for its map."""
        limits = {'max_map_mb': MAP_MB, 'max_memory_mb': MEMORY_MB, 'effects/octomap': 'on', 'octomap_topic': '/%s/map' % name}
        # The allocator gives back what is freed, instead of keeping twice the largest block for each thread that freed one:
        # what is left is what the node holds.
        process = {'env': {**os.environ, 'MALLOC_MMAP_THRESHOLD_': str(1 << 17), 'MALLOC_TRIM_THRESHOLD_': str(1 << 17)}}
        self.node = self.start_node(name, process, **{**limits, **parameters})
        self.maps = self.advertise('/%s/map' % name, Octomap, 10)
        self.index = self.given = 0
        self.started_kb = resident_kb(self.node.pid)

    def most_mb(self):
        return (peak_kb(self.node.pid) - self.started_kb) / 1024

    def frame(self):
        self.index += 1
        return self.outcomes_of(self.publisher, [flat_cloud(self.index)])[0]

    def give(self, data, resolution=0.01):
        """Publishes a map and steps on until it is in use or refused; the last outcome."""
        refused = self.stats[-1].maps_refused if self.stats else 0
        self.given += 1
        message = octomap(data, rospy.Time(1000 + self.given), resolution=resolution)
        self.maps.publish(message)
        end = time.monotonic() + 60 * SLOW
        while time.monotonic() < end:
            outcome = self.frame()
            wait_for(lambda: self.stats and self.stats[-1].header.stamp == outcome.header.stamp, 20, 'its statistics')
            if self.stats[-1].maps_refused > refused and 'refused' in outcome.reason:
                return outcome
            if any(s.map_stamp == message.header.stamp for s in self.states[-3:]):
                return self.frame()
            time.sleep(0.03)
        self.fail('the map is neither used nor refused: %s' % outcome.reason)

    def assert_bounded(self, message_mb=0.0, map_mb=MAP_MB):
        """Beyond the limits roscpp holds the message that it reads and the one that it hands over."""
        print('%s: %.1f MB above the start' % (self.id().split('.')[-1], self.most_mb()))
        if SLOW == 1:
            self.assertLess(self.most_mb(), 1.1 * (map_mb + MEMORY_MB) + 2 * message_mb)

    def assert_given_back(self):
        self.give(checkerboard(1))
        self.assertTrue(self.contacts[-1].answered, self.contacts[-1].reason)

        def left_mb():
            return (resident_kb(self.node.pid) - self.started_kb) / 1024

        if SLOW == 1:  # on a busy machine it may take a moment
            wait_for(lambda: left_mb() < 6, 5, 'memory to be given back')
        print('%s: %.1f MB left' % (self.id().split('.')[-1], left_mb()))

    def assert_refused(self, outcome):
        self.assertEqual(outcome.status, ContactArray.NO_MAP, outcome.reason)
        for words in ('octomap', 'max_map_mb', '%d MB' % MAP_MB, 'leaves'):
            self.assertIn(words, outcome.reason)
        self.assertTrue(any('/map' in line and 'max_map_mb' in line for line in self.log_lines()), 'named with its topic')

    def test_a_checkerboard(self):
        """16.8 million leaves in 4.8 MB."""
        self.start('board')
        self.give(checkerboard(1))
        board = checkerboard(7)
        begin = time.monotonic()
        outcome = self.give(board)
        self.assert_refused(outcome)
        self.assert_bounded(len(board) / 1e6)
        self.assertEqual(self.stats[-1].maps_refused, 1)
        for _ in range(3):
            self.give(board)
        self.assert_given_back()
        self.assert_quiet(time.monotonic() - begin, 4)

    def test_the_unknown_between_known_voxels(self):
        box = [-3, -3, -3, 3, 3, 3]
        rospy.set_param('/unknown/unknown_box', box)
        self.start('unknown', unknown_space='occupied')
        for depth in (3, 6, 4, 7):
            data = checkerboard(depth)
            self.give(data)
            self.assertIsNone(self.node.poll())
        self.assert_bounded(len(data) / 1e6)

    def test_voxels_that_boxes_cut(self):
        """Cubes of 33 m, cut by the faces of a box that lies askew to no voxel."""
        rospy.set_param('/cut/exclude_boxes', [[-10, -10, -10, 10.0003, 10.0003, 10.0003]])
        self.start('cut', max_map_mb=256)
        self.give(struct.pack('<H', 0xaaaa), 0.001)
        self.assert_bounded(map_mb=256)

    def test_maps_that_are_kept_by_recordings(self):
        """Each step has a map of its own, of 17 MB, and a hundred steps are kept."""
        self.start('kept', record_steps=100, max_map_mb=256)
        board = checkerboard(6)
        for _ in range(25):
            outcome = self.give(board)
            self.assertTrue(outcome.answered, outcome.reason)
        self.assert_bounded(len(board) / 1e6, map_mb=256)

    def test_an_ordinary_map_fits(self):
        """Half a million occupied voxels under the default."""
        self.start('ordinary', max_map_mb=512)
        for depth in (6, 6):
            outcome = self.give(checkerboard(depth))
            self.assertTrue(outcome.answered, outcome.reason)
        print('an ordinary map: %.1f MB above the start' % self.most_mb())


if __name__ == '__main__':
    unittest.main()
