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
from deformable_ccd.msg import ContactArray
from geometry_msgs.msg import TransformStamped
from live_node import Cloud, bytes_of
from octomap_msgs.msg import Octomap
from sensor_msgs.msg import PointCloud2, PointField
from tf2_msgs.msg import TFMessage

START = 1700000000
FINGER = pathlib.Path(__file__).resolve().parents[1] / 'ros/finger.stl'


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

    def test_a_frame_waits_for_the_map_that_came_before_it(self):
        self.start_with_map('ordered', max_map_mb=2048, transform_timeout_s=20.0, answer_timeout_s=20.0)
        self.maps.publish(octomap(checkerboard(1), at(0)))
        time.sleep(0.5)
        for t in (0.0, 0.03):
            self.step_of(at(t), 5)
        message = octomap(checkerboard(6), at(0.04))
        self.maps.publish(message)
        time.sleep(0.1)
        _, state = self.step_of(at(0.06), 5)
        self.assertEqual(state.map_stamp, message.header.stamp)
        self.assertTrue(state.clear, state.reason)

    def step_of(self, stamp, z=0.0):
        """The cloth's frame; its outcome and the first state that is of it."""
        said = len(self.states)
        [outcome] = self.outcomes_of(self.to['cloth'], [sheet(stamp, z)])
        wait_for(lambda: len(self.states) > said, 20, 'a state')
        return outcome, self.states[said]

    def test_a_finger_that_dips_through_between_two_frames(self):
        self.start_bodies('dips', {'cloth/topic': '/dips/cloth', 'finger/rigid/frame': 'finger', 'finger/rigid/mesh': str(FINGER)}, ['cloth'])
        for k in range(-5, 6):
            self.tf.publish(transform(at(0.01 * k), 'finger', 0.5))
        self.step_of(at(0))
        _, state = self.step_of(at(0.05))
        self.assertTrue(state.clear, state.reason)
        for k, z in enumerate((0, -0.5, -1, 0, 0.5)):
            self.tf.publish(transform(at(0.06 + 0.01 * k), 'finger', z))
        outcome, state = self.step_of(at(0.1))
        self.assertEqual(outcome.status, ContactArray.PARTIAL)
        self.assertFalse(state.proved)
        self.assertIn("body 'finger' was seen up to", state.reason)

    def test_another_body_that_jumps_back_by_a_nanosecond(self):
        self.start_bodies('jumps', {'cloth/topic': '/jumps/cloth', 'other/topic': '/jumps/other', 'cloth/topology/rows': 4,
                                    'cloth/topology/cols': 5, 'other/topology/rows': 4, 'other/topology/cols': 5}, ['cloth', 'other'])
        for t in (0.0, 0.05):
            self.to['other'].publish(sheet(at(t), -1))
            _, state = self.step_of(at(t))
        self.assertTrue(state.clear, state.reason)
        self.to['other'].publish(sheet(at(0.05) - rospy.Duration(0, 1), 1))
        self.to['other'].publish(sheet(at(0.1), 1))
        outcome, state = self.step_of(at(0.1))
        self.assertEqual(outcome.status, ContactArray.TIME_JUMP)
        self.assertFalse(outcome.answered or state.proved)
        self.assertIn("body 'other'", outcome.reason)
        self.to['other'].publish(sheet(at(0.15), 1))
        _, state = self.step_of(at(0.15))
        self.assertTrue(state.clear, state.reason)

    def test_a_static_body_whose_newest_frame_is_refused(self):
        self.start_bodies('static', {'cloth/topic': '/static/cloth', 'table/topic': '/static/table', 'table/motion': 'static'},
                          ['cloth', 'table'])
        self.to['table'].publish(sheet(at(0), -1))
        for t in (0.0, 0.05):
            _, state = self.step_of(at(t))
        self.assertTrue(state.clear, state.reason)
        bad = sheet(at(0.06), -0.5)
        bad.data = bad.data[:50]
        self.to['table'].publish(bad)
        time.sleep(0.3)
        outcome, state = self.step_of(at(0.1))
        self.assertEqual(outcome.status, ContactArray.NO_BODY)
        self.assertFalse(state.proved)
        self.assertIn("the newest frame of body 'table' was refused", outcome.reason)
        self.to['table'].publish(sheet(at(0.12), -1))
        time.sleep(0.3)
        _, state = self.step_of(at(0.15))
        self.assertTrue(state.clear, state.reason)

    def start_with_map(self, name, **parameters):
        self.start_bodies(name, {'cloth/topic': '/%s/cloth' % name}, ['cloth'],
                          **{'effects/octomap': 'on', 'octomap_topic': '/%s/map' % name, **parameters})
        self.maps = self.advertise('/%s/map' % name, Octomap, 100)

    def test_a_map_whose_frame_moves(self):
        """It lies half a metre below the sheet, and its frame is raised through the sheet."""
        self.start_with_map('lifts')
        for k in range(11):
            self.tf.publish(transform(at(0.01 * k), 'odom', -0.5))
        self.maps.publish(octomap(checkerboard(1), at(0), 'odom'))
        time.sleep(0.5)
        for t in (0.0, 0.05, 0.1):
            _, state = self.step_of(at(t))
        self.assertTrue(state.clear, state.reason)
        for k in range(11):
            self.tf.publish(transform(at(0.11 + 0.01 * k), 'odom', -0.5 + 0.1 * k))
        for t in (0.15, 0.2):
            outcome, state = self.step_of(at(t))
            self.assertEqual(outcome.status, ContactArray.PARTIAL)
            self.assertFalse(state.proved)
            self.assertIn("the octomap's frame 'odom' was seen up to", state.reason)

    def test_a_latched_map_that_is_older_than_tf(self):
        self.start_with_map('latched')
        self.maps.publish(octomap(checkerboard(1), at(-60), 'odom'))
        time.sleep(0.3)
        for k in range(11):
            self.tf.publish(transform(at(0.01 * k), 'odom', -0.5))
        time.sleep(0.3)
        for t in (0.0, 0.05, 0.1):
            outcome, state = self.step_of(at(t))
        self.assertEqual(outcome.status, ContactArray.OK, outcome.reason)
        self.assertTrue(state.clear, state.reason)
        self.assertTrue(state.checked_map)
        wait_for(lambda: any('placed by the first' in line for line in self.log_lines()), 10, 'a line that says so')

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

    def test_more_noise_is_not_more_clear(self):
        """A sheet that is known to a kilometre; one whose own field says 1e30."""
        for name, radius, clear in (('exactly', 1e-4, True), ('vaguely', 1e3, False)):
            self.start_bodies(name, {'cloth/topic': '/%s/cloth' % name, 'cloth/topology/rows': 4, 'cloth/topology/cols': 5,
                                     'cloth/uncertainty/radius_m': radius}, ['cloth'], accuracy='conservative')
            for t in (0.0, 0.05):
                _, state = self.step_of(at(t))
            self.assertEqual(state.clear, clear, state.reason)
        self.assertFalse(state.proved)
        self.assertIn('uncertainty', state.reason)
        rospy.set_param('/beyond/bodies/cloth', {'topic': '/beyond/cloth', 'topology': {'rows': 4, 'cols': 5}, 'uncertainty': {'field': 'sigma'}})
        self.start_bodies('beyond', {}, ['cloth'], accuracy='conservative')
        message = sheet(at(0), 0)
        message.fields.append(PointField(name='sigma', offset=24, datatype=PointField.FLOAT64, count=1))
        points = [message.data[24 * i:24 * (i + 1)] for i in range(20)]
        message.data = b''.join(point + struct.pack('<d', 1e30) for point in points)
        message.point_step, message.row_step = 32, 160
        [outcome] = self.outcomes_of(self.to['cloth'], [message])
        self.assertEqual(outcome.status, ContactArray.BAD_MESSAGE)
        self.assertIn('1e+30', outcome.reason)

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
