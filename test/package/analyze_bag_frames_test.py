"""Frames of a bag find their place: late, long and repeated transforms, static bodies, parts of one message."""
import collections
import copy
import unittest

import genpy
import rosbag
from geometry_msgs.msg import Point, TransformStamped
from sensor_msgs import point_cloud2
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from analyze_bag_support import AnalyzeBagTestCase


def write_moving(bag, cloth, stamp, at, transform_at):
    """A frame of the cloth in a frame that moves, and the transform that it needs."""
    message, moving = copy.deepcopy(cloth), TransformStamped()
    message.header.stamp, message.header.frame_id = stamp, 'camera'
    bag.write('/cloth', message, at)
    moving.header.stamp, moving.header.frame_id, moving.child_frame_id = stamp, 'world', 'camera'
    moving.transform.rotation.w = 1
    bag.write('/tf', TFMessage([moving]), transform_at)


class AnalyzeBagFramesTest(AnalyzeBagTestCase):
    def test_transforms_of_a_long_bag(self):
        """Ten minutes between the halves of the bag, the cloth in a frame that moves: each frame finds its transform."""
        long_bag, frames = self.folder / 'long.bag', 0
        with rosbag.Bag(str(long_bag), 'w') as bag:
            for topic, message, at in self.messages:
                if topic != '/cloth':
                    bag.write(topic, message, at)
                    continue
                frames += 1
                if frames > 12:
                    at = at + genpy.Duration(600)
                write_moving(bag, message, at, at, at + genpy.Duration(1))  # recorded after the frame that needs it
        self.assertEqual(self.statuses(long_bag), {'FIRST_FRAME': 1, 'OK': frames - 2, 'GAP': 1})

    def test_transforms_of_a_bag_of_a_loop(self):
        """Two rounds of 24 s, whose stamps are the same: at the seam none of the frames loses its transform, whether tf is
        recorded before or after the frames that need it."""
        cloth = [message for topic, message, _ in self.messages if topic == '/cloth']
        others = [(topic, message) for topic, message, _ in self.messages if topic != '/cloth']
        start, pause_s = self.messages[0][2] + genpy.Duration(10), 0.6
        for early_s in (-0.3, 0.7):
            with self.subTest(early_s=early_s):
                looped = self.folder / 'looped.bag'
                with rosbag.Bag(str(looped), 'w') as bag:
                    for topic, message in others:
                        bag.write(topic, message, start)
                    for i in range(2 * len(cloth)):
                        stamp = start + genpy.Duration.from_sec(pause_s * (i % len(cloth)))
                        at = start + genpy.Duration.from_sec(pause_s * i)
                        write_moving(bag, cloth[i % len(cloth)], stamp, at, at - genpy.Duration.from_sec(early_s))
                self.assertEqual(self.statuses(looped), {'FIRST_FRAME': 1, 'OK': 2 * len(cloth) - 2, 'TIME_JUMP': 1})

    def with_hand(self, name, stamps_and_heights, static_height=None):
        """What becomes of a cloth that rests, and a large triangle in the frame 'hand' at these heights above it."""
        cloth = [message for topic, message, _ in self.messages if topic == '/cloth'][0]
        top, start = max(vertex.z for vertex in cloth.vertices), self.messages[0][2]
        bag_file, hand = self.folder / (name + '.bag'), self.folder / 'hand.obj'
        hand.write_text('v -9 -9 0\nv 9 -9 0\nv 0 9 0\nf 1 2 3\n')
        with rosbag.Bag(str(bag_file), 'w') as bag:
            for k, (stamp_s, height) in enumerate(stamps_and_heights):
                stamp, at = start + genpy.Duration.from_sec(stamp_s), start + genpy.Duration.from_sec(0.1 * k)
                place = TransformStamped(child_frame_id='hand')
                place.header.stamp, place.header.frame_id, place.transform.rotation.w = stamp, 'world', 1
                if k == 0 and static_height is not None:
                    place.transform.translation.z = top + static_height
                    bag.write('/tf_static', TFMessage([copy.deepcopy(place)]), at)
                place.transform.translation.z = top + height
                bag.write('/tf', TFMessage([place]), at)
                message = copy.deepcopy(cloth)
                message.header.stamp = stamp
                bag.write('/cloth', message, at)
        bodies = '{cloth: {topic: /cloth, self_collision: false}, hand: {rigid: {mesh: %s, frame: hand}}}' % hand
        statuses = self.analyzed(name, bag_file, *self.params('bodies: %s\n' % bodies))[-1]
        return statuses, {int(row.split(',')[0]) for row in (self.folder / name / 'contacts.csv').read_text().splitlines()[1:]}

    def test_a_simulation_that_is_reset_soon(self):
        """Two rounds of half a second with the same stamps, and the hand elsewhere in the second one, where it goes through the cloth."""
        rounds = [(0.1 * (k % 6), 5 if k < 6 else 0.35 - 0.1 * (k - 6)) for k in range(12)]
        statuses, steps = self.with_hand('reset', rounds)
        self.assertEqual(statuses, {'FIRST_FRAME': 1, 'OK': 10, 'TIME_JUMP': 1})
        self.assertTrue(steps)
        self.assertGreater(min(steps), 7)

    def test_a_frame_that_is_static_and_moves(self):
        """It goes through the cloth, and has no place; one that stays where it is static has one."""
        path = [(0.1 * k, 0.35 - 0.1 * k) for k in range(6)]
        self.assertEqual(self.with_hand('both', path, 5), ({'NO_TRANSFORM': 6}, set()))
        self.assertEqual(self.with_hand('same', [(0.1 * k, 5) for k in range(6)], 5), ({'FIRST_FRAME': 1, 'OK': 5}, set()))

    def test_a_static_transform_that_changes(self):
        """The first one holds before it was recorded, the second one from then on: the cloth is elsewhere, once."""
        changed, cloths = self.folder / 'changed.bag', [m for m in self.messages if m[0] == '/cloth']
        with rosbag.Bag(str(changed), 'w') as bag:
            for k, (topic, message, at) in enumerate(cloths):
                message = copy.deepcopy(message)
                message.header.frame_id = 'camera'
                bag.write(topic, message, at)
                if k in (1, len(cloths) // 2):
                    static = TransformStamped(child_frame_id='camera')
                    static.header.frame_id, static.transform.rotation.w, static.transform.translation.x = 'world', 1, 5.0 * k
                    bag.write('/tf_static', TFMessage([static]), at)
        self.assertEqual(self.statuses(changed), {'FIRST_FRAME': 1, 'OK': len(cloths) - 2, 'TELEPORT': 1})

    def test_a_static_body_that_was_recorded_before_the_first_frame(self):
        """Without fixed_frame it has no place before the cloth's first message, and it is sent only once."""
        cloths = [(topic, message, at) for topic, message, at in self.messages if topic == '/cloth']
        table = copy.deepcopy(cloths[0][1])
        table.header.stamp = cloths[0][2] - genpy.Duration(5)
        tabled = self.folder / 'tabled.bag'
        with rosbag.Bag(str(tabled), 'w') as bag:
            bag.write('/table', table, table.header.stamp)
            for topic, message, at in cloths:
                bag.write(topic, message, at)
        params = self.folder / 'tabled.yaml'
        params.write_text('bodies: {cloth: {topic: /cloth}, table: {topic: /table, motion: static, against_bodies: false, '
                          'self_collision: false}}\neffects: {octomap: "off"}\nsync_timeout_s: 0.0\n')
        report = self.analyze('tabled', tabled, '--params', params)
        steps = [line.split(',') for line in (report / 'steps.csv').read_text().splitlines()]
        statuses = collections.Counter(row[steps[0].index('status')] for row in steps[1:])
        self.assertEqual(statuses, {'FIRST_FRAME': 1, 'OK': len(cloths) - 1})

    def test_bodies_that_share_a_topic(self):
        """Parts of one MarkerArray, told apart by their namespaces: each has its frames."""
        shared = self.folder / 'shared.bag'
        with rosbag.Bag(str(shared), 'w') as bag:
            for frame in range(5):
                at, array = genpy.Time(100 + 0.1 * frame), MarkerArray()
                for height, name in enumerate(('lower', 'upper')):
                    marker = Marker(ns=name, type=Marker.TRIANGLE_LIST)
                    marker.header.stamp, marker.header.frame_id = at, 'world'
                    marker.pose.orientation.w = marker.scale.x = marker.scale.y = marker.scale.z = 1
                    marker.points = [Point(0, 0, height), Point(1, 0, height), Point(0, 1, height)]
                    array.markers.append(marker)
                bag.write('/parts', array, at)
        params = self.folder / 'shared.yaml'
        params.write_text('effects: {octomap: "off"}\nbodies:\n'
                          '  lower: {topic: /parts, marker: {namespace: lower}}\n'
                          '  upper: {topic: /parts, marker: {namespace: upper}}\n')
        report = self.analyze('shared', shared, '--params', params)
        self.assertEqual(self.statuses_of(report), {'FIRST_FRAME': 1, 'OK': 4})


if __name__ == '__main__':
    unittest.main()
