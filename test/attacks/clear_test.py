"""What once left `clear` standing without proof, each on a live node, at stamps of today."""
import math
import os
import pathlib
import struct
import subprocess
import tempfile
import time
import unittest

import rosbag
import rospy
from attack import AttackTest, checkerboard, octomap, wait_for
from geometry_msgs.msg import TransformStamped
from live_node import Cloud, bytes_of
from octomap_msgs.msg import Octomap
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage

START = 1700000000


def at(seconds):
    return rospy.Time(START) + rospy.Duration.from_sec(seconds)


def sheet(stamp, z, frame='world', rows=4, cols=5):
    """A level sheet, 0.3 m by 0.4 m around the origin."""
    cloud = Cloud(1, 1)
    cloud.rows, cloud.cols = rows, cols
    cloud.variants = [b''.join(struct.pack('<3d', 0.1 * c - 0.2, 0.1 * r - 0.15, z) for r in range(rows) for c in range(cols))]
    message = cloud.message()
    message.header.stamp, message.header.frame_id = stamp, frame
    return message


def transform(stamp, child, z=0.0, turn=0.0):
    one = TransformStamped(child_frame_id=child)
    one.header.frame_id, one.header.stamp = 'world', stamp
    one.transform.translation.z = z
    one.transform.rotation.x, one.transform.rotation.w = math.sin(turn / 2), math.cos(turn / 2)
    return TFMessage([one])


class ClearTest(AttackTest):
    def start_bodies(self, name, bodies, topics, **parameters):
        for key, value in bodies.items():
            rospy.set_param('/%s/bodies/%s' % (name, key), value)
        self.start_node(name, publishes=False, clock_body='cloth', **parameters)
        self.to = {topic: self.advertise('/%s/%s' % (name, topic), PointCloud2, 100) for topic in topics}
        self.tf = self.advertise('/tf', TFMessage, 100)

    def step_of(self, stamp, z=0.0):
        """The cloth's frame; its outcome and the first state that is of it."""
        said = len(self.states)
        [outcome] = self.outcomes_of(self.to['cloth'], [sheet(stamp, z)])
        wait_for(lambda: len(self.states) > said, 20, 'a state')
        return outcome, self.states[said]

    def start_with_map(self, name, **parameters):
        self.start_bodies(name, {'cloth/topic': '/%s/cloth' % name}, ['cloth'],
                          **{'effects/octomap': 'on', 'octomap_topic': '/%s/map' % name, **parameters})
        self.maps = self.advertise('/%s/map' % name, Octomap, 100)

    def test_a_newer_map_that_waits(self):
        """Half a megabyte, of which a million leaves become: no step is clear that was answered without it."""
        self.start_with_map('waits', max_map_mb=2048, transform_timeout_s=0.0)
        self.maps.publish(octomap(checkerboard(1), at(0)))
        time.sleep(0.5)
        for t in (0.0, 0.03, 0.06):
            _, state = self.step_of(at(t), 5)
        self.assertTrue(state.clear, state.reason)
        message = octomap(checkerboard(6), at(0.07))
        self.maps.publish(message)
        time.sleep(0.02)  # on its way
        t, passed_over = 0.06, 0
        while t < 30:
            t += 0.03
            outcome, state = self.step_of(at(t), 5)
            if state.map_stamp == message.header.stamp:
                break
            passed_over += 1
            self.assertFalse(state.clear, '%.2f s after the map came: %s' % (t - 0.06, state.reason))
            time.sleep(0.03)
        self.assertEqual(state.map_stamp, message.header.stamp)
        self.assertGreater(passed_over, 0, 'the map is too small for this machine')
        _, state = self.step_of(at(t + 0.03), 5)
        self.assertTrue(state.clear, state.reason)

    def test_live_and_from_a_bag(self):
        """A crumpled cloth in a frame that turns; live the newest transform is the frame's own, in a bag later ones are known."""
        crumpled, messages = Cloud(12, 12), []
        for k in range(20):
            cloud = crumpled.message()
            cloud.header.stamp, cloud.header.frame_id = at(0.03 * k), 'camera'
            messages.append((transform(cloud.header.stamp, 'camera', 0.1 * k, 0.7 * k), cloud))
        self.start_bodies('both', {'cloth/topic': '/both/cloth', 'cloth/topology/rows': 12, 'cloth/topology/cols': 12}, ['cloth'],
                          max_contacts=10000)
        live = []
        for tf, cloud in messages:
            self.tf.publish(tf)
            live += self.outcomes_of(self.to['cloth'], [cloud])
        folder = tempfile.mkdtemp(dir=self.folder)
        bag, out, params = (os.path.join(folder, name) for name in ('in.bag', 'out.bag', 'params.yaml'))
        with rosbag.Bag(bag, 'w') as file:
            for tf, cloud in messages:
                file.write('/tf', tf, cloud.header.stamp)
                file.write('/both/cloth', cloud, cloud.header.stamp + rospy.Duration(0, 1000))
        pathlib.Path(params).write_text(
            'fixed_frame: world\nmax_vertex_step_m: 0.0\neffects: {octomap: "off"}\nmax_contacts: 10000\n'
            'bodies: {cloth: {topic: /both/cloth, topology: {rows: 12, cols: 12}}}\n')
        run = subprocess.run([str(self.tool('analyze_bag')), bag, '-o', out, '--report', os.path.join(folder, 'report'), '--params', params],
                             capture_output=True, text=True, timeout=120)
        self.assertTrue(os.path.exists(out), run.stderr)
        with rosbag.Bag(out) as file:
            replayed = [m for topic, m, _ in file.read_messages() if topic.endswith('/contacts')]
        self.assertEqual(len(replayed), len(live))
        self.assertGreater(sum(len(o.contacts) for o in live), 1000)
        for one, other in zip(live, replayed):
            self.assertEqual(one.header.stamp, other.header.stamp)
            self.assertEqual(one.status, other.status)
            self.assertEqual([bytes_of(c) for c in one.contacts], [bytes_of(c) for c in other.contacts])


if __name__ == '__main__':
    unittest.main()
