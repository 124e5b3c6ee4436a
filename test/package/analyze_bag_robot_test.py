"""A robot's links in a bag: the URDF comes from a file, tf from the bag."""
import json
import unittest

import genpy
from geometry_msgs.msg import Point
from geometry_msgs.msg import TwistStamped
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from visualization_msgs.msg import Marker

from bag_messages import by_topic, transform, write_bag
from checkout import CHECKOUT, TOOLS, FolderTestCase, run

URDF = CHECKOUT / 'test/ros/robot.urdf'


class AnalyzeBagRobotTest(FolderTestCase):
    def bag(self, lift):
        """A triangle sinks from 0.3 m to the ground in 0.3 s; the plate is held at 0.1 m, where tf carries it."""
        messages = []
        for frame in range(4):
            at, height = genpy.Time(100 + 0.1 * frame), 0.3 - 0.1 * frame
            marker = Marker(ns='cloth', type=Marker.TRIANGLE_LIST)
            marker.header.stamp, marker.header.frame_id = at, 'world'
            marker.pose.orientation.w = marker.scale.x = marker.scale.y = marker.scale.z = 1
            marker.points = [Point(0, 0, height), Point(0.1, 0, height), Point(0, 0.1, height)]
            messages.append(('/cloth', marker, at))
            if lift:
                messages.append(('/tf', TFMessage([transform('plate', at, z=0.1)]), at))
        return write_bag(self.folder / 'robot.bag', messages)

    def analyze(self, bag, *words):
        return run(TOOLS / 'analyze_bag', bag, '--report', self.folder / 'report', '--quiet', *words)

    def test_the_links_are_bodies(self):
        ran = self.analyze(self.bag(True), '--robot', URDF)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        self.assertIn('plate', ran.stdout, 'the first contact names the link')
        self.assertIn('plate', (self.folder / 'report/contacts.csv').read_text())
        without = self.analyze(self.bag(True))
        self.assertEqual(without.returncode, 0, without.stderr)
        self.assertNotIn('plate', without.stdout)

    def intended(self, name, *motions):
        """The plate at 0.1 m stays, a triangle 0.2 m above it, too, for 8 frames; what is intended comes with its stamp."""
        messages = [(self.topic, motion, motion.header.stamp + genpy.Duration(0, 1000)) for motion in motions]
        for frame in range(8):
            at = genpy.Time(100 + frame / 10)
            marker = Marker(ns='cloth', type=Marker.TRIANGLE_LIST)
            marker.header.stamp, marker.header.frame_id = at, 'world'
            marker.pose.orientation.w = marker.scale.x = marker.scale.y = marker.scale.z = 1
            marker.points = [Point(0, 0, .3), Point(0.1, 0, .3), Point(0, 0.1, .3)]
            messages += [('/tf', TFMessage([transform('plate', at, z=0.1)]), at), ('/cloth', marker, at)]
        params, out = self.folder / 'intent.yaml', self.folder / (name + '_out.bag')
        params.write_text('topic: /cloth\nfixed_frame: world\neffects: {octomap: "off"}\nmax_speed_m_s: 0.1\nrobot: {max_speed_m_s: 0.5}\n'
                          'speed_scale: {reaction_time_s: 0.3, stopping_time_s: 0.3, uncertainty_m: 0.02}\n'
                          'intent: {horizon_s: 1.0, deviation_m: 0.01, deviation_rate_m_s: 0.01}\n')
        bag = write_bag(self.folder / (name + '.bag'), sorted(messages, key=lambda one: one[2]))
        return out, self.analyze(bag, '--robot', URDF, '--params', params, '-o', out, '--intended', self.topic)

    topic = '/collision_monitor/intended'

    @staticmethod
    def stays(at, joint='lift'):
        motion = JointTrajectory(joint_names=[joint], points=[JointTrajectoryPoint(positions=[.1], time_from_start=genpy.Duration(t)) for t in (0, 5)])
        motion.header.stamp = genpy.Time(at)
        return motion

    def test_what_is_intended_counts_as_in_the_node(self):
        for self.topic in ('/collision_monitor/intended', '/arm/planned'):
            out, ran = self.intended('stays', self.stays(100.25))
            self.assertEqual(ran.returncode, 0, ran.stderr)
            self.assertNotIn(self.topic, ran.stderr)
            messages = by_topic(out)
            used = [m.used for m in messages['/collision_monitor/along_path']]
            self.assertEqual(used, [False] * 4 + [True] * 5, 'from its begin on: that of frame 2 once more, when it came, and not begun')
            self.assertEqual(len(messages[self.topic]), 1, 'an input')
            rests = [m.seconds for m in messages['/collision_monitor/safe_until'] if any('along the intended path' in one for one in m.assumed)]
            self.assertEqual(len(rests), 5)
            for seconds in rests:  # the triangle at 0.1 m/s, in a tube of 0.01 m and 0.01 m/s
                self.assertTrue(.97 * .189 / .11 <= seconds <= .189 / .11 or seconds >= .98, seconds)
            rows = json.loads((self.folder / 'report/report.json').read_text())['steps']
            scales = [row['scales'] for row in rows]
            self.assertEqual(scales[0], [0, 0], 'a first frame')
            for said, by_bounds in scales[1:3]:
                self.assertEqual(said, by_bounds)
                self.assertTrue(0 < said < 1)
            self.assertEqual(scales[3:], [[1, scales[1][1]]] * 5)
            self.assertEqual([m.scale for m in messages['/collision_monitor/speed_scale']], [s for s, _ in scales[:3] + scales[2:]])

    def test_what_is_wrong_with_it_is_said_and_ends_it(self):
        out, ran = self.intended('wrong', self.stays(100.25), *(self.stays(100.45 + .1 * k, 'elbow%d' % k) for k in range(3)))
        self.assertEqual(ran.returncode, 0, ran.stderr)
        self.assertEqual(ran.stderr.count('/collision_monitor/intended: '), 1, 'of each kind the first')
        self.assertIn("/collision_monitor/intended: joint_names[0] 'elbow0' is no joint", ran.stderr)
        self.assertFalse(by_topic(out)['/collision_monitor/along_path'][-1].used)
        broken = [m.broken for m in by_topic(out)['/collision_monitor/safe_until'] if m.broken]
        self.assertEqual(broken, ['something else is intended now'])
        twist = TwistStamped()
        twist.header.stamp, twist.header.frame_id = genpy.Time(100.35), 'elsewhere'
        self.assertIn("/collision_monitor/intended: header/frame_id 'elsewhere' has no place", self.intended('twist', twist)[1].stderr)
        self.assertIn('has type geometry_msgs/TransformStamped', self.intended('other', transform('plate', genpy.Time(100.5)))[1].stderr)
        self.assertIn('the bag has nothing on /collision_monitor/intended, to which intent listens', self.intended('none')[1].stderr)

    def test_a_link_without_tf_is_not_proved(self):
        ran = self.analyze(self.bag(False), '--robot', URDF)
        self.assertEqual(ran.returncode, 3, ran.stderr)
        self.assertIn("body 'plate': not watched meanwhile: no transform", ran.stderr)
        self.assertRegex(ran.stderr, r"PARTIAL: where body 'plate' was is not known for all of this step \(no transform of its frame at \d+\.\d{9} s")

    def test_what_is_no_robot_is_not_proved(self):
        (self.folder / 'bad.urdf').write_text('<robot name="a"><link/></robot>')
        ran = self.analyze(self.bag(True), '--robot', self.folder / 'bad.urdf')
        self.assertEqual(ran.returncode, 3, ran.stderr)
        self.assertIn('nothing of the robot is watched: %s ' % (self.folder / 'bad.urdf'), ran.stderr)

    def test_there_is_no_parameter_server(self):
        (self.folder / 'params.yaml').write_text('topic: /cloth\nrobot: robot_description\n')
        ran = self.analyze(self.bag(True), '--params', self.folder / 'params.yaml')
        self.assertEqual(ran.returncode, 1)
        self.assertIn("robot names 'robot_description', but there is no parameter server", ran.stderr)


if __name__ == '__main__':
    unittest.main()
