"""audit_bag, the judge that shares nothing: truths hold, and a claim that lies about any of them is refuted."""
import ast
import copy
import json
import os
import pathlib
import re
import sys
import unittest
from fractions import Fraction

import genpy

from analyze_bag_support import OWN, AnalyzeBagTestCase
import rospy
from octomap_msgs.msg import Octomap
from tf2_msgs.msg import TFMessage

from bag_messages import cloud, messages_of, transform, write_bag
from checkout import CHECKOUT, TOOLS, FolderTestCase, run

AUDIT = CHECKOUT / 'audit'
FILES = [AUDIT / name for name in ('audit_bag', 'came.py', 'owned.py', 'placed.py', 'touches.py')]
QUERIES = pathlib.Path(os.environ.get('DEFORMABLE_CCD_DATA', CHECKOUT.parent / 'shared/data')) / 'ccd_queries'
sys.path.insert(0, str(AUDIT))
import touches  # noqa: E402  (it lies beside the tool)
sys.path.insert(0, str(CHECKOUT / 'test/storm'))
import worlds  # noqa: E402


class AuditTest(AnalyzeBagTestCase):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.config = cls.folder / 'given.yaml'
        cls.config.write_text('fixed_frame: world\noctomap_topic: /octomap_binary\nbodies: {cloth: {topic: /cloth}}\n')
        cls.out = cls.folder / 'out.bag'
        cls.analyze('said', cls.bag, '--params', cls.config, '-o', cls.out)
        cls.said = messages_of(cls.out)

    def audit(self, *words):
        ran = run(TOOLS / 'audit_bag', *words, '--params', self.config, '--json', self.folder / 'verdict.json')
        verdict = json.loads((self.folder / 'verdict.json').read_text()) if ran.returncode in (0, 1, 3) else {}
        return ran.returncode, verdict, ran.stdout + ran.stderr

    def lies(self, change, came=None):
        """The verdict on what was said, each message as `change(topic, message)` leaves it (None: left out)."""
        told = [(topic, change(topic, copy.deepcopy(message)), at) for topic, message, at in self.said if topic.startswith(OWN)]
        claims = self.write('claims.bag', [row for row in told if row[1] is not None])
        status, verdict, said = self.audit(came or self.bag, claims)
        self.assertEqual(status, 1, said)
        return verdict['refuted']

    def test_what_is_true_holds(self):
        status, verdict, said = self.audit(self.out)
        self.assertEqual((status, verdict['refuted'], verdict['not_covered']), (0, [], []), said)
        self.assertGreater(verdict['held'], 35)
        self.assertEqual(self.audit(self.bag)[0], 0, 'it asks analyze_bag where nothing was said')

    def test_a_contact_that_is_hidden(self):
        hidden = []

        def hide(topic, message):
            if topic == OWN + 'contacts' and message.contacts:
                hidden.append(message.header.stamp.to_sec())
                message.contacts, message.total_contacts = [], 0
            return message
        refuted = self.lies(hide)
        self.assertGreater(len(hidden), 3)
        self.assertEqual([round(r['stamp'], 6) for r in refuted], [round(s, 6) for s in hidden])

    def test_clear_where_something_touches(self):
        def clear(topic, message):
            if topic == OWN + 'state':
                message.touching, message.clear = 0, message.proved
            return message
        self.assertRegex(self.lies(clear)[0]['reason'], 'of cloth and .* of octomap meet at 0')

    def test_a_frame_that_never_came_and_one_that_is_passed_over(self):
        def later(topic, message):
            if topic == OWN + 'state' and message.proved:
                message.holds_until += genpy.Duration(0, 1000)
            return message
        self.assertRegex(self.lies(later)[0]['reason'], 'no frame came for')
        starts = [m.start for t, m, _ in self.said if t == OWN + 'state' and m.proved]

        def longer(topic, message):
            if topic == OWN + 'state' and message.proved and message.start in starts[1:]:
                message.start = starts[starts.index(message.start) - 1]
            return message
        self.assertRegex(self.lies(longer)[0]['reason'], 'a frame of cloth came for .* passes over it')

    def test_a_map_that_was_passed_over(self):
        map_, begin = self.octomap(), self.cloths[0][2]
        newer = copy.deepcopy(map_)
        newer.header.stamp += genpy.Duration(0, 1)
        came = self.write('maps.bag', [('/octomap_binary', m, begin) for m in (map_, newer)] + self.cloths)
        self.assertRegex(self.lies(lambda topic, message: message, came)[0]['reason'], 'a newer map came')

    def test_what_is_not_whole(self):
        cloths = copy.deepcopy(self.cloths)
        cloths[5][1].vertices[7].x = float('nan')
        begin = self.cloths[0][2]
        came = self.write('hole.bag', [('/octomap_binary', self.octomap(), begin)] + cloths)
        self.assertRegex(self.lies(lambda topic, message: message, came)[0]['reason'], 'cannot be checked')

    def test_what_it_has_no_rules_for_is_not_covered(self):
        self.config.write_text(self.config.read_text() + 'max_acceleration_m_s2: 2\naccuracy: conservative\n')
        try:
            status, verdict, said = self.audit(self.out)
        finally:
            self.config.write_text(self.config.read_text().replace('max_acceleration_m_s2: 2\naccuracy: conservative\n', ''))
        self.assertEqual((status, verdict['refuted']), (3, []), said)
        self.assertIn('max_acceleration_m_s2', verdict['not_covered'][0]['reason'])

    def test_what_cannot_be_read_is_no_verdict(self):
        status, _, said = self.audit(self.folder / 'none.bag')
        self.assertEqual(status, 2, said)
        self.assertRegex(said, r'^audit_bag: .*none\.bag')

    def test_it_shares_nothing_and_is_read_in_an_hour(self):
        allowed = {'argparse', 'bisect', 'dataclasses', 'fractions', 'json', 'math', 'os', 'random', 're', 'struct', 'subprocess', 'sys',
                   'tempfile', 'time', 'xml.etree.ElementTree', 'numpy', 'rosbag', 'yaml', 'came', 'owned', 'placed', 'touches'}
        for path in FILES:
            for node in ast.walk(ast.parse(path.read_text())):
                names = [a.name for a in node.names] if isinstance(node, ast.Import) else \
                    [node.module] if isinstance(node, ast.ImportFrom) else []
                self.assertLessEqual(set(names), allowed, path)
        self.assertLessEqual(sum(p.read_text().count('\n') for p in FILES), 2475)


FINGER = 'v -.02 -.02 -.02\nv .02 -.02 -.02\nv 0 .02 -.02\nv 0 0 .02\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 3 1 4\n'
ARM = """<robot name="arm"><link name="tool"><collision><origin xyz="0 0 0.05" rpy="0.1 0 0"/>
<geometry><cylinder radius="0.03" length="0.1"/></geometry></collision></link>
<link name="palm"><collision><geometry><box size="0.06 0.04 0.02"/></geometry></collision></link>
<joint name="wrist" type="fixed"><parent link="palm"/><child link="tool"/></joint></robot>"""
CELL = """
fixed_frame: world
clock_body: cloth
max_speed_m_s: 1.5
speed_scale: {reaction_time_s: 0.15, stopping_time_s: 0.2, uncertainty_m: 0.01}
effects: {clearance: "on"}
bodies:
  cloth: {topic: /cloth, topology: {rows: 4, cols: 4}, against_obstacle: OBSTACLE}
  finger: {rigid: {mesh: FOLDER/finger.obj, frame: finger}, against_obstacle: false}
  plate: {topic: /plate, motion: static, topology: {rows: 2, cols: 2}, against_obstacle: false}
"""


class CellTest(FolderTestCase):
    """A cloth comes down upon a static plate, a finger of tf, a robot, or a voxel, in eleven frames at 10 Hz."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        (cls.folder / 'finger.obj').write_text(FINGER)
        (cls.folder / 'arm.urdf').write_text(ARM)

    def cell(self, name, words='', down=0.03, lowest=-0.01, obstacle='false', maps=(), more=lambda at: []):
        """The bag, its parameters, and what analyze_bag says of it."""
        at = lambda k: rospy.Time(100 + k // 10, k % 10 * 10 ** 8 + 1)
        rows = [('/plate', cloud([(x, y, 0) for x in (-.1, .1) for y in (-.1, .1)], at(0), rows=2), at(0))]
        rows += [('/octomap_binary', m, at(0)) for m in maps] + more(at)
        for k in range(11):
            tool, finger = transform('tool', at(k), x=0.3), transform('finger', at(k), w=0.6, x=0.2 + 0.002 * k, z=0.05)
            finger.transform.rotation.z = 0.8
            palm = transform('palm', at(k), x=0.3, z=-0.1)
            rows.append(('/tf', TFMessage([tool, finger, palm]), at(k)))
            z = max(lowest, 0.25 - down * k)
            rows.append(('/cloth', cloud([(0.05 * i - 0.08, 0.05 * j - 0.07, z + 0.001 * i * j) for i in range(4) for j in range(4)],
                                         at(k)), at(k)))
        self.params = self.folder / 'cell.yaml'
        self.params.write_text(CELL.replace('FOLDER', str(self.folder)).replace('OBSTACLE', obstacle) + words)
        self.bag, out = write_bag(self.folder / 'cell.bag', rows), self.folder / (name + '.bag')
        ran = run(TOOLS / 'analyze_bag', self.bag, '--params', self.params, '-o', out, '--report', self.folder / name, '--quiet')
        self.assertIn(ran.returncode, (0, 3), ran.stderr)
        self.said = [row for row in messages_of(out) if row[0].startswith(OWN)]

    def judged(self, change=lambda topic, message: message):
        told = [(topic, change(topic, copy.deepcopy(message)), at) for topic, message, at in self.said]
        claims = write_bag(self.folder / 'claims.bag', [row for row in told if row[1] is not None])
        ran = run(TOOLS / 'audit_bag', self.bag, claims, '--params', self.params, '--json', self.folder / 'verdict.json')
        return ran.returncode, json.loads((self.folder / 'verdict.json').read_text()), ran.stdout + ran.stderr

    def holds(self, least=8):
        status, verdict, said = self.judged()
        self.assertEqual((status, verdict['refuted'], verdict['not_covered']), (0, [], []), said)
        self.assertGreaterEqual(sum(m.proved for t, m, _ in self.said if t == OWN + 'state'), least, said)

    def refuted(self, topic, change, claim, reason):
        changed = []

        def lie(at, message):
            if at == OWN + topic and (topic != 'state' or message.proved):
                changed.append(change(message))
            return None if changed and changed[-1] == 'left out' and at == OWN + topic else message
        status, verdict, said = self.judged(lie)
        self.assertEqual(status, 1, said)
        self.assertEqual({row['claim'] for row in verdict['refuted']}, {claim}, said)
        self.assertRegex(' '.join(row['reason'] for row in verdict['refuted']), reason)

    @staticmethod
    def nothing_touches(message):
        message.touching, message.clear = 0, True

    def rows(self, message, change):
        for row in message.pairs:
            for distance in (row.at_end, row.over_step):
                if distance.status in (0, 1) and 'finger' in row.bodies:
                    change(distance)

    def test_distances(self):
        self.cell('distances')
        self.holds()

        def farther(distance):
            distance.lower += 1e-3

        def nearer(distance):
            distance.upper -= 1e-3
        self.refuted('clearance', lambda m: self.rows(m, farther), 'clearance', 'and not .* or more')
        self.refuted('clearance', lambda m: self.rows(m, nearer), 'clearance', 'what the row names')

    def test_promises(self):
        self.cell('promises')
        self.holds()

        def longer(message):
            if message.seconds > 0:
                message.until += genpy.Duration(0, 100000)
                message.others_until += genpy.Duration(0, 100000)
        self.refuted('safe_until', longer, 'safe_until', 'are promised at')

    def test_scale(self):
        self.cell('scale')
        self.holds()

        def faster(message):
            message.scale *= 1 + 1e-6 if message.scale < 1 else 1
        self.refuted('speed_scale', faster, 'speed_scale', 'and a scale of .* needs')

    def test_a_static_body(self):
        self.cell('static')
        self.holds()
        self.refuted('state', self.nothing_touches, 'clear', 'of cloth and .* of plate meet')

    def test_a_robot(self):
        robot = 'robot: {description: %s/arm.urdf, own_voxels_m: 0}\n' % self.folder
        self.cell('robot', robot, lowest=0.2)
        self.holds()
        (self.folder / 'low.urdf').write_text(ARM.replace('0 0 0.05', '-0.3 0 0.1'))
        self.cell('robot', robot.replace('arm', 'low'), lowest=0.12)
        self.holds(3)
        self.refuted('state', self.nothing_touches, 'clear', 'of cloth and .* of tool meet')

    def test_a_separation(self):
        words = 'accuracy: conservative\nminimum_separation_m: 0.004\n'
        self.cell('separation', words, lowest=0.003)
        self.holds()
        self.refuted('state', self.nothing_touches, 'clear', 'of cloth and .* of plate meet')

    def test_boxes_that_are_left_out(self):
        # One leaf below the root, of all eight octants in turn down to a cube of 4 voxels of 0.05 m around the origin's corner.
        tree, depth = b'', 14
        tree += (3 << 14).to_bytes(2, 'little')  # the octant of keys from 32768 on
        for level in range(1, depth):
            tree += (2 if level == depth - 1 else 3).to_bytes(2, 'little')
        message = Octomap(binary=True, id='OcTree', resolution=0.05, data=[b - 256 if b > 127 else b for b in tree])
        message.header.frame_id, message.header.stamp = 'world', rospy.Time(100)
        self.cell('boxes', 'exclude_boxes: [[0, 0, 0, 0.3, 0.3, 0.3]]\noctomap_topic: /octomap_binary\n', lowest=0.1, obstacle='true',
                  maps=[message])
        self.holds()
        self.params.write_text(self.params.read_text().replace('0.3, 0.3, 0.3', '0.3, 0.3, 0.12'))
        status, verdict, said = self.judged()
        self.assertEqual(status, 1, said)
        self.assertRegex(' '.join(row['reason'] for row in verdict['refuted']), 'of cloth and .* of octomap meet')

    @staticmethod
    def voxels(keys, at):
        message = Octomap(binary=True, id='OcTree', resolution=0.05, data=worlds.octree([tuple(32768 + k for k in key) for key in keys]))
        message.header.frame_id, message.header.stamp = 'world', at
        return '/octomap_binary', message, at - rospy.Duration(0, 1000)

    def test_own_voxels(self):
        words = 'octomap_topic: /octomap_binary\nown_voxels_m: 0.02\n'
        second = lambda when: lambda at: [self.voxels([(9, 9, 9)], at(0)), self.voxels([(9, 9, 9), (0, 0, 1)], at(when))]
        self.cell('obstacle', words, lowest=0.08, obstacle='true', more=second(2))
        self.holds()
        self.refuted('state', self.nothing_touches, 'clear', 'of cloth and .* of octomap meet')
        self.cell('own', words, lowest=0.08, obstacle='true', more=second(7))
        self.holds()
        self.assertTrue([m.clear for t, m, _ in self.said if t == OWN + 'state'][-1], 'a voxel that appears where the cloth is')

    def test_clouds(self):
        points = lambda at: [('/points', cloud([(0.012, 0.013, 0.08), (0.4, 0.4, 0.4)], at(k)), at(k)) for k in range(11)]
        self.cell('clouds', 'obstacle_cloud_topics: [{topic: /points, sensor_frame: finger}]\n', lowest=0.08, obstacle='true', more=points)
        self.holds()
        self.refuted('state', self.nothing_touches, 'clear', 'of cloth and .* of octomap meet')

    def test_alarms(self):
        self.cell('alarms')
        self.holds()

        def old(message):
            for patch in message.patches:
                patch.is_new = False
        self.refuted('patches', old, 'proved', 'no patch of the two is new')
        self.refuted('events', lambda message: 'left out', 'proved', 'no event says')


class TouchesTest(unittest.TestCase):
    def test_hard_queries_with_exact_truth(self):
        if not QUERIES.is_dir():
            self.skipTest('no ' + str(QUERIES))
        asked, met = 0, 0
        for kind, folder in (('vf', 'vertex-face'), ('ee', 'edge-edge')):
            for path in sorted(QUERIES.glob('*/%s/*.csv' % folder)):
                rows = [line.split(',') for line in path.read_text().splitlines()[:8 * 80]]
                for i in range(0, len(rows), 8):
                    points = [[float(Fraction(int(r[2 * k]), int(r[2 * k + 1]))) for k in range(3)] for r in rows[i:i + 8]]
                    found = touches.first_touch(kind, points[:4], points[4:]) is not None
                    self.assertEqual(found, rows[i][6] == '1', '%s, line %d' % (path, i))
                    asked, met = asked + 1, met + found
        self.assertGreater(min(met, asked - met), 100)

    def test_what_floating_point_rejects_does_not_meet(self):
        import numpy
        random = numpy.random.default_rng(7)
        rejected = 0
        for kind, one in (('vf', 1), ('ee', 2)):
            points = numpy.round(random.normal(size=(2, 400, 4, 3)), 1)
            apart = touches.apart(points[0][:, :one], points[1][:, :one], points[0][:, one:], points[1][:, one:])
            for i in numpy.nonzero(apart)[0]:
                self.assertIsNone(touches.first_touch(kind, points[0][i], points[1][i]))
                rejected += 1
        self.assertGreater(rejected, 100)


if __name__ == '__main__':
    unittest.main()
