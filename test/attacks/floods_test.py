"""Much of what is small: points that coincide, frames of tf, topologies, maps, services, connections. Memory and log stay, and what is
good afterwards is answered."""
import os
import struct
import time
import unittest

import rospy
from attack import SLOW, AttackTest, checkerboard, cloud_of, flat_cloud, octomap, peak_kb, resident_kb, wait_for
from deformable_ccd.msg import ContactArray, MeshStamped
from geometry_msgs.msg import TransformStamped
from live_node import bytes_of, raw
from octomap_msgs.msg import Octomap
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage

LIMIT_MB = 64
LONG = bool(os.environ.get('DEFORMABLE_CCD_LONG'))


class FloodsTest(AttackTest):
    def start(self, name, **parameters):
        self.node = self.start_node(name, max_memory_mb=LIMIT_MB, max_map_mb=LIMIT_MB, **parameters)
        self.outcomes_of(self.publisher, [flat_cloud(0), flat_cloud(1)])
        self.started_kb, self.began = resident_kb(self.node.pid), time.monotonic()

    def holds(self, first, limit_mb=LIMIT_MB):
        """Good frames are answered, and neither memory nor log had grown."""
        grown = (peak_kb(self.node.pid) - self.started_kb) / 1024
        outcomes = self.outcomes_of(self.publisher, [flat_cloud(first + i) for i in range(3)])
        self.assertTrue(outcomes[1].answered or outcomes[2].answered, [(o.status, o.reason) for o in outcomes])
        print('%s: at most %.1f MB above the start' % (self.id().split('.')[-1], grown))
        if SLOW == 1:
            self.assertLess(grown, 1.1 * limit_mb)
        self.assert_quiet(time.monotonic() - self.began, 8)
        self.assert_adds_up(self.stats[-1])

    def test_points_that_coincide(self):
        for rows, cols in ((20, 20), (30, 30), (40, 40)):
            self.start('point_%d' % rows)
            begin = time.monotonic()
            point = [(0.1, 0.1, 0.1)] * (rows * cols)
            outcomes = self.outcomes_of(self.publisher, [flat_cloud(2, rows, cols)] + [cloud_of(i, point, rows, cols) for i in (3, 4)])
            print('%d points: %.2f s, statuses %s' % (rows * cols, time.monotonic() - begin, [o.status for o in outcomes]))
            self.assertIn(outcomes[1].status, (ContactArray.TRUNCATED, ContactArray.DEADLINE))
            self.assertIn(outcomes[2].status, (ContactArray.TRUNCATED, ContactArray.DEADLINE))
            self.assertFalse(any(s.clear for s in self.states[-2:]))
            self.holds(5)

    def test_names_of_frames(self):
        """Names that tf2 never forgets."""
        self.start('frame_names')
        tf = self.advertise('/tf', TFMessage)
        one = TransformStamped()
        one.header.frame_id, one.transform.rotation.w = 'world', 1.0
        for i in range(100 if LONG else 20):  # 16,384 are taken
            batch = []
            for k in range(1000):
                other = TransformStamped(one.header, 'frame_%d_%d_%s' % (i, k, 'x' * 100), one.transform)
                batch.append(other)
            tf.publish(TFMessage(batch))
        time.sleep(1)
        self.holds(2)

    def test_stamps_of_transforms(self):
        """With --long 600,000 of them, a nanosecond apart."""
        self.start('tf_stamps')
        tf = self.advertise('/tf', TFMessage)
        for i in range(200 if LONG else 10):  # of 524,288 all are forgotten
            batch = []
            for k in range(3000):
                one = TransformStamped(child_frame_id='camera')
                one.header.frame_id, one.transform.rotation.w = 'world', 1.0
                one.header.stamp = rospy.Time(1000, 3000 * i + k)
                batch.append(one)
            tf.publish(TFMessage(batch))
        time.sleep(1)
        self.holds(2)

    def test_transforms_that_are_none(self):
        """Few bytes that claim to be 16 million transforms, which would take 2 GB."""
        self.start('no_tf')
        whole = TransformStamped(child_frame_id='camera')
        whole.header.frame_id, whole.transform.rotation.w = 'world', 1.0
        for topic in ('/tf', '/tf_static'):
            tf = self.advertise(topic, TFMessage)
            for _ in range(20):
                tf.publish(raw(TFMessage, struct.pack('<I', 0x1000001) + bytes_of(TFMessage([whole]))[4:]))
        wait_for(lambda: sum('is damaged and left out' in line for line in self.log_lines()) == 2, 60, 'a line for each topic')
        self.holds(2)

    def test_a_topology_a_frame(self):
        self.start('topologies')
        sizes = [(10 + i % 17, 10 + i % 23) for i in range(200 if LONG else 50)]
        outcomes = self.outcomes_of(self.publisher, [flat_cloud(2 + i, *size) for i, size in enumerate(sizes)])
        self.assertEqual({o.status for o in outcomes}, {ContactArray.TOPOLOGY_CHANGED})
        self.holds(300)

    def test_maps_one_after_the_other(self):
        """Of those that wait only the newest is decoded; each is counted."""
        self.start('maps', **{'effects/octomap': 'on', 'octomap_topic': '/maps/map'})
        maps = self.advertise('/maps/map', Octomap)
        message = octomap(checkerboard(4))
        for _ in range(100):
            maps.publish(message)
        index = 2
        end = time.monotonic() + 30 * SLOW
        while self.stats[-1].maps_received < 1 or not self.contacts[-1].status == ContactArray.OK:
            self.assertLess(time.monotonic(), end, self.contacts[-1].reason)
            self.outcomes_of(self.publisher, [flat_cloud(index)])
            index += 1
            time.sleep(0.02)
        self.assertEqual(self.stats[-1].maps_refused, 0)
        self.holds(index)

    def test_services_without_a_pause(self):
        self.start('services')
        reset, enable = rospy.ServiceProxy('/services/reset', Trigger), rospy.ServiceProxy('/services/enable', SetBool)
        check = rospy.ServiceProxy('/services/check_now', Trigger)
        for i in range(100):
            self.publisher.publish(flat_cloud(2 + i))
            enable(i % 3 == 0)
            reset()
            check()
        enable(True)
        self.holds(200)

    def test_connections_that_come_and_go(self):
        self.start('connections')
        self.publisher.unregister()
        for i in range(60):
            kind = (PointCloud2, MeshStamped)[i % 2]
            one = rospy.Publisher('/connections/mesh', kind, queue_size=1)
            time.sleep(0.01)
            one.unregister()
        self.publisher = rospy.Publisher('/connections/mesh', PointCloud2, queue_size=None)
        self.addCleanup(self.publisher.unregister)
        seen, index, end = len(self.contacts), 2, time.monotonic() + 60 * SLOW
        while len(self.contacts) == seen:
            self.assertLess(time.monotonic(), end, 'locked out')
            self.publisher.publish(flat_cloud(index))
            index += 1
            time.sleep(0.2)
        self.holds(index)


if __name__ == '__main__':
    unittest.main()
