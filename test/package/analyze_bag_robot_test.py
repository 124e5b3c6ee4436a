"""A robot's links in a bag: the URDF comes from a file, tf from the bag."""
import unittest

import genpy
from geometry_msgs.msg import Point
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

from bag_messages import transform, write_bag
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
