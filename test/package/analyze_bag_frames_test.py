"""Frames of a bag find their place: late, long and repeated transforms, static bodies, parts of one message."""
import copy
import json
import unittest

import genpy
from geometry_msgs.msg import Point
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from analyze_bag_support import AnalyzeBagTestCase
from bag_messages import transform
from checkout import TOOLS, run


def moving(cloth, stamp, at, transform_at):
    """A frame of the cloth in a frame that moves, and the transform that it needs."""
    message = copy.deepcopy(cloth)
    message.header.stamp, message.header.frame_id = stamp, 'camera'
    return [('/cloth', message, at), ('/tf', TFMessage([transform('camera', stamp)]), transform_at)]


class AnalyzeBagFramesTest(AnalyzeBagTestCase):
    def test_transforms_of_a_long_bag(self):
        """Ten minutes between the halves of the bag, the cloth in a frame that moves: each frame finds its transform."""
        messages = [message for message in self.messages if message[0] != '/cloth']
        for number, (_, message, at) in enumerate(self.cloths):
            at += genpy.Duration(600 if number >= 12 else 0)
            messages += moving(message, at, at, at + genpy.Duration(1))  # recorded after the frame that needs it
        self.assertEqual(self.statuses(self.write('long.bag', messages)), {'FIRST_FRAME': 1, 'OK': len(self.cloths) - 2, 'GAP': 1})

    def test_transforms_of_a_bag_of_a_loop(self):
        """Two rounds of 24 s, whose stamps are the same: at the seam none of the frames loses its transform, whether tf is
        recorded before or after the frames that need it. The step in which tf began anew is the seam itself."""
        count, start, pause_s = len(self.cloths), self.messages[0][2] + genpy.Duration(10), 0.6
        for early_s in (-0.3, 0.7):
            with self.subTest(early_s=early_s):
                messages = [(topic, message, start) for topic, message, _ in self.messages if topic != '/cloth']
                for i in range(2 * count):
                    stamp, at = (start + genpy.Duration.from_sec(pause_s * k) for k in (i % count, i))
                    messages += moving(self.cloths[i % count][1], stamp, at, at - genpy.Duration.from_sec(early_s))
                self.assertEqual(self.statuses(self.write('looped.bag', messages)),
                                 {'FIRST_FRAME': 1, 'OK': 2 * count - 2, 'TIME_JUMP': 1})

    def with_hand(self, name, stamps_and_heights, static_height=None):
        """What becomes of a cloth that rests, and a large triangle in the frame 'hand' at these heights above it."""
        cloth, start, hand = self.cloths[0][1], self.messages[0][2], self.folder / 'hand.obj'
        hand.write_text('v -9 -9 0\nv 9 -9 0\nv 0 9 0\nf 1 2 3\n')
        top, messages = max(vertex.z for vertex in cloth.vertices), []
        if static_height is not None:
            messages.append(('/tf_static', TFMessage([transform('hand', start, z=top + static_height)]), start))
        for k, (stamp_s, height) in enumerate(stamps_and_heights):
            stamp, at = (start + genpy.Duration.from_sec(seconds) for seconds in (stamp_s, 0.1 * k))
            messages.append(('/tf', TFMessage([transform('hand', stamp, z=top + height)]), at))
            message = copy.deepcopy(cloth)
            message.header.stamp = stamp
            messages.append(('/cloth', message, at))
        bodies = '{cloth: {topic: /cloth, self_collision: false}, hand: {rigid: {mesh: %s, frame: hand}}}' % hand
        statuses = self.analyzed(name, self.write(name + '.bag', messages), *self.params('bodies: %s\n' % bodies))[-1]
        return statuses, {int(row.split(',')[0]) for row in (self.folder / name / 'contacts.csv').read_text().splitlines()[1:]}

    def test_a_simulation_that_is_reset_soon(self):
        """Two rounds of half a second with the same stamps, and the hand elsewhere in the second one, where it goes through the cloth. Up
        to the last stamp of the first round frames may only have come late, so that no step is proved."""
        rounds = [(0.1 * (k % 6), 5 if k < 6 else 0.35 - 0.1 * (k - 6)) for k in range(12)]
        statuses, steps = self.with_hand('reset', rounds)
        self.assertEqual(statuses, {'FIRST_FRAME': 1, 'OK': 5, 'PARTIAL': 5, 'TIME_JUMP': 1})
        self.assertTrue(steps)
        self.assertGreater(min(steps), 7)

    def test_a_frame_that_is_static_and_moves(self):
        """It goes through the cloth, and has no place; one that stays where it is static has one."""
        path = [(0.1 * k, 0.35 - 0.1 * k) for k in range(6)]
        self.assertEqual(self.with_hand('both', path, 5), ({'NO_TRANSFORM': 6}, set()))
        self.assertEqual(self.with_hand('same', [(0.1 * k, 5) for k in range(6)], 5), ({'FIRST_FRAME': 1, 'OK': 5}, set()))

    def test_a_static_transform_that_changes(self):
        """The first one holds before it was recorded, the second one from then on: the cloth is elsewhere, once. The step
        in which the second one comes is the seam."""
        messages = copy.deepcopy(self.cloths)
        for _, message, _ in messages:
            message.header.frame_id = 'camera'
        count = len(messages)
        for k in (count // 2, 1):
            messages.insert(k + 1, ('/tf_static', TFMessage([transform('camera', x=5.0 * k)]), messages[k][2]))
        self.assertEqual(self.statuses(self.write('changed.bag', messages)), {'FIRST_FRAME': 1, 'OK': count - 2, 'TELEPORT': 1})

    def test_a_static_body_that_was_recorded_before_the_first_frame(self):
        """Without fixed_frame it has no place before the cloth's first message, and it is sent only once."""
        table = copy.deepcopy(self.cloths[0][1])
        table.header.stamp = self.cloths[0][2] - genpy.Duration(5)
        tabled = self.write('tabled.bag', [('/table', table, table.header.stamp)] + self.cloths)
        params = self.folder / 'tabled.yaml'
        params.write_text('bodies: {cloth: {topic: /cloth}, table: {topic: /table, motion: static, against_bodies: false, '
                          'self_collision: false}}\neffects: {octomap: "off"}\nsync_timeout_s: 0.0\n')
        report = self.analyze('tabled', tabled, '--params', params)
        self.assertEqual(self.statuses_of(report), {'FIRST_FRAME': 1, 'OK': len(self.cloths) - 1})

    def test_bodies_that_share_a_topic(self):
        """Parts of one MarkerArray, told apart by their namespaces: each has its frames."""
        messages = []
        for frame in range(5):
            at, array = genpy.Time(100 + 0.1 * frame), MarkerArray()
            for height, name in enumerate(('lower', 'upper')):
                marker = Marker(ns=name, type=Marker.TRIANGLE_LIST)
                marker.header.stamp, marker.header.frame_id = at, 'world'
                marker.pose.orientation.w = marker.scale.x = marker.scale.y = marker.scale.z = 1
                marker.points = [Point(0, 0, height), Point(1, 0, height), Point(0, 1, height)]
                array.markers.append(marker)
            messages.append(('/parts', array, at))
        params = self.folder / 'shared.yaml'
        params.write_text('effects: {octomap: "off"}\nbodies:\n'
                          '  lower: {topic: /parts, marker: {namespace: lower}}\n'
                          '  upper: {topic: /parts, marker: {namespace: upper}}\n')
        report = self.analyze('shared', self.write('shared.bag', messages), '--params', params)
        self.assertEqual(self.statuses_of(report), {'FIRST_FRAME': 1, 'OK': 4})

    def test_a_rope_that_repeats_a_point(self):
        """Once or twice: it does not touch itself there, and all of it is looked at. The judge that shares nothing says so, too."""
        for repeats in (1, 2):
            messages, places = [], [0, 1, 2] + [2] * repeats + [3]
            for frame in range(5):
                marker = Marker(type=Marker.LINE_STRIP, points=[Point(x, 0.01 * frame * x, 0) for x in places])
                marker.header.stamp, marker.header.frame_id = genpy.Time(100 + 0.1 * frame), 'world'
                marker.pose.orientation.w = marker.scale.x = 1
                messages.append(('/rope', marker, marker.header.stamp))
            bag = self.write('rope_%d.bag' % repeats, messages)
            self.assertEqual(self.analyzed('rope', bag)[0], 0, self.said)
            self.assertIn('No contact in 4 answered steps; all of it proved', self.said)
            judged = run(TOOLS / 'audit_bag', bag)
            self.assertEqual(judged.returncode, 0, judged.stdout)

    def test_ropes_of_one_message(self):
        """Three of them, numbered backwards; the last goes over the first. The judge that shares nothing says the same as the monitor."""
        messages = []
        for frame in range(5):
            at, array = genpy.Time(100 + 0.1 * frame), MarkerArray()
            for number, (x, height) in enumerate(((2, 0), (1, 0.5), (0, 0.25 - 0.1 * frame))):
                marker = Marker(ns='rope', id=2 - number, type=Marker.LINE_STRIP)
                marker.points = [Point(x + 1.2 * k * (number == 2), k * (number < 2) - 0.4, height) for k in range(3 + number)]
                marker.header.stamp, marker.header.frame_id = at, 'world'
                marker.pose.orientation.w = marker.scale.x = 1
                array.markers.append(marker)
            messages.append(('/ropes', array, at))
        bag = self.write('ropes.bag', messages)
        self.assertEqual(self.analyzed('ropes', bag)[0], 0, self.said)
        self.assertRegex(self.said, 'contacts in 1 of 4 answered steps; all of it proved')
        judged = run(TOOLS / 'audit_bag', bag)
        self.assertEqual(judged.returncode, 0, judged.stdout)
        self.assertIn('4 claims hold', judged.stdout)

    def ended(self, name, others, bodies):
        """Exit status and last line of a cloth that rests for a second, and of what else moves in the world."""
        start, cloths = self.messages[0][2], []
        for k in range(11):
            message, at = copy.deepcopy(self.cloths[0][1]), start + genpy.Duration.from_sec(0.1 * k)
            message.header.stamp = at
            cloths.append(('/cloth', message, at))
        bag = self.write(name + '.bag', sorted(cloths + others, key=lambda one: one[2]))
        status, _, said, _ = self.analyzed(name, bag, *self.params('bodies: {cloth: {topic: /cloth, self_collision: false}, %s}\n' % bodies))
        return status, said

    def test_the_clock_body_ends_before_others(self):
        """What moves on by itself is looked at by nobody: that is no recording of which all is proved."""
        start, expected = self.messages[0][2], "not proved: the frames of body 'cloth', each of which ends a step, end %s s before those of body '%s'"
        hand = self.folder / 'tool.obj'
        hand.write_text('v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n')

        def until(end_s):
            times = [start + genpy.Duration.from_sec(0.1 * k) for k in range(int(10 * end_s) + 1)]
            others = []
            for at in times:
                message = copy.deepcopy(self.cloths[0][1])
                message.header.stamp = at
                for v in message.vertices:
                    v.z += 9
                others.append(('/other', message, at))
            return others, [('/tf', TFMessage([transform('tool', at, z=9)]), at) for at in times]
        other, rigid = 'other: {topic: /other%s}', 'tool: {rigid: {mesh: %s, frame: tool}}' % hand
        for end_s, status in ((1.4, 0), (3, 3)):
            frames, transforms = until(end_s)
            for name, messages, bodies in (('other', frames, other % ''), ('tool', transforms, rigid)):
                with self.subTest(name, end_s=end_s):
                    got, said = self.ended(name, messages, bodies)
                    self.assertEqual(got, status, said)
                    self.assertEqual(expected % ('2.000', name) in said.splitlines()[-1] if said else False, status == 3, said)
            self.assertEqual(self.ended('still', frames, other % ', motion: static')[0], 0, 'its newest frame holds at all times')
        self.assertIn(expected % ('2.000', 'other'), json.loads((self.folder / 'other/report.json').read_text())['headline'])


if __name__ == '__main__':
    unittest.main()
