"""audit_bag, the judge that shares nothing: truths hold, and a claim that lies about any of them is refuted."""
import ast
import copy
import json
import math
import os
import pathlib
import re
import struct
import sys
import unittest
from fractions import Fraction

import genpy
from geometry_msgs.msg import TwistStamped

from analyze_bag_support import OWN, AnalyzeBagTestCase
import rospy
from octomap_msgs.msg import Octomap
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from bag_messages import cloud, messages_of, transform, write_bag
from checkout import CHECKOUT, TOOLS, FolderTestCase, run

AUDIT = CHECKOUT / 'audit'
FILES = [AUDIT / name for name in ('audit_bag', 'came.py', 'intended.py', 'owned.py', 'placed.py', 'touches.py')]
QUERIES = pathlib.Path(os.environ.get('DEFORMABLE_CCD_DATA', CHECKOUT.parent / 'shared/data')) / 'ccd_queries'
sys.path.insert(0, str(AUDIT))
import came  # noqa: E402  (it lies beside the tool)
import touches  # noqa: E402
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
        status, verdict, said = self.audit(self.bag)  # it asks analyze_bag where nothing was said
        self.assertEqual(status, 0, said)

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
        odd = self.folder / 'odd.urdf'
        for shape, status in (('<collision/>', 2), ('<collision><geometry><capsule radius="1" length="1"/></geometry></collision>', 3)):
            odd.write_text('<robot name="odd"><link name="tool">%s</link></robot>' % shape)
            config = self.folder / 'odd.yaml'
            config.write_text(self.config.read_text() + 'robot: %s\n' % odd)
            ran = run(TOOLS / 'audit_bag', self.out, '--params', config)
            self.assertEqual(ran.returncode, status, ran.stdout + ran.stderr)

    def test_a_face_that_lies_in_another_one_is_checked_with_it(self):
        for odd, lost in (((1, 1, 1), 0), ((1, 1, 2), 0), ((3, 3, 3), 1), ((0, 0, 3), 1), ((0, 1, 0, 2), 1)):
            faces, count = came.fans([(0, 1, 2), odd], None)
            self.assertEqual((faces.tolist(), count), ([[0, 1, 2]], lost))

    def test_it_shares_nothing_and_is_read_in_an_hour(self):
        allowed = {'argparse', 'bisect', 'dataclasses', 'fractions', 'json', 'math', 'os', 'random', 're', 'struct', 'subprocess', 'sys',
                   'tempfile', 'time', 'xml.etree.ElementTree', 'numpy', 'rosbag', 'yaml', 'came', 'intended', 'owned', 'placed', 'touches'}
        for path in FILES:
            for node in ast.walk(ast.parse(path.read_text())):
                names = [a.name for a in node.names] if isinstance(node, ast.Import) else \
                    [node.module] if isinstance(node, ast.ImportFrom) else []
                self.assertLessEqual(set(names), allowed, path)
        self.assertLessEqual(sum(p.read_text().count('\n') for p in FILES), 3060)


FINGER = 'v -.02 -.02 -.02\nv .02 -.02 -.02\nv 0 .02 -.02\nv 0 0 .02\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 3 1 4\n'
ARM = """<robot name="arm"><link name="tool"><collision><origin xyz="0 0 0.05" rpy="0.1 0 0"/>
<geometry><cylinder radius="0.03" length="0.1"/></geometry></collision></link>
<link name="palm"><collision><geometry><box size="0.06 0.04 0.02"/></geometry></collision></link>
<joint name="wrist" type="fixed"><parent link="palm"/><child link="tool"/></joint></robot>"""
ELBOW = """<robot name="arm"><link name="base"/><link name="elbow"><collision><origin xyz="0.1 0 0"/><geometry><box size="0.1 0.04 0.02"/></geometry>
</collision></link><link name="world"/><joint name="foot" type="fixed"><parent link="world"/><child link="base"/></joint>
<joint name="elbow" type="revolute"><parent link="base"/><child link="elbow"/><origin xyz="0.05 0 0.15"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="1" velocity="9"/></joint></robot>"""
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

    def cell(self, name, words='', down=0.03, lowest=-0.01, obstacle='false', maps=(), more=lambda at: [], finger_at=(0.2, 0.05), cell=CELL):
        """The bag, its parameters, and what analyze_bag says of it."""
        at = lambda k: rospy.Time(100 + k // 10, k % 10 * 10 ** 8 + 1)
        rows = [('/plate', cloud([(x, y, 0) for x in (-.1, .1) for y in (-.1, .1)], at(0), rows=2), at(0))]
        rows += [('/octomap_binary', m, at(0)) for m in maps] + more(at)
        for k in range(11):
            tool, finger = transform('tool', at(k), x=0.3), transform('finger', at(k), w=0.6, x=finger_at[0] + 0.002 * k, z=finger_at[1])
            finger.transform.rotation.z = 0.8
            palm = transform('palm', at(k), x=0.3, z=-0.1)
            rows.append(('/tf', TFMessage([tool, finger, palm]), at(k)))
            z = max(lowest, 0.25 - down * k)
            rows.append(('/cloth', cloud([(0.05 * i - 0.08, 0.05 * j - 0.07, z + 0.001 * i * j) for i in range(4) for j in range(4)],
                                         at(k)), at(k)))
        self.params = self.folder / 'cell.yaml'
        self.params.write_text(cell.replace('FOLDER', str(self.folder)).replace('OBSTACLE', obstacle) + words)
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

    def told(self, topic, change):
        """The verdict where each message of a topic is changed, of ~state each that is proved; or left out."""
        changed = []

        def lie(at, message):
            if at == OWN + topic and (topic != 'state' or message.proved):
                changed.append(change(message))
            return None if changed and changed[-1] == 'left out' and at == OWN + topic else message
        return self.judged(lie)

    def refuted(self, topic, change, claim, reason):
        status, verdict, said = self.told(topic, change)
        self.assertEqual(status, 1, said)
        self.assertEqual({row['claim'] for row in verdict['refuted']}, {claim}, said)
        self.assertRegex(' '.join(row['reason'] for row in verdict['refuted']), reason)

    def not_covered(self, reason, topic='state', change=lambda message: None):
        status, verdict, said = self.told(topic, change)
        self.assertEqual((status, verdict['refuted']), (3, []), said)
        self.assertRegex(' '.join(row['reason'] for row in verdict['not_covered']), reason)

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
        self.refuted('safe_until', self.much_longer, 'safe_until', 'are promised at')

    INTENT = 'intent: {horizon_s: 1.0, deviation_m: 0.01, deviation_rate_m_s: 0.01}\n'

    @staticmethod
    def longer(message):
        """Promises that rest on the path, by a tenth."""
        if any('along the intended path' in one for one in message.assumed):
            more = genpy.Duration(0, 10 ** 7 + int(1e8 * message.others_seconds))
            message.until += more
            message.others_until += more

    def on_the_path(self, least):
        """What was said by the path: it holds, and lies about it are refuted."""
        self.holds()
        said = {kind: [m for t, m, _ in self.said if t == OWN + kind] for kind in ('along_path', 'safe_until', 'speed_scale')}
        self.assertGreaterEqual(sum(m.used for m in said['along_path']), least)
        self.assertGreaterEqual(sum(any('along the intended path' in one for one in m.assumed) for m in said['safe_until']), least)
        self.refuted('safe_until', self.longer, 'safe_until', 'are promised at')
        for field, lie, reason in (('ahead', lambda x: x + .01, 'a path is known for'), ('bodies', lambda x: x[1:], 'nobody said that they are to go')):
            self.refuted('along_path', lambda m: m.used and setattr(m, field, lie(getattr(m, field))), 'along_path', reason)

    def test_along_a_path(self):
        """The finger slides above the plate, whose distance does not limit it then, or says that it goes down."""
        def twist(at, k, **linear):
            message = TwistStamped()
            message.header.stamp, message.header.frame_id = at(k), 'finger'
            for axis, speed in linear.items():
                setattr(message.twist.linear, axis, speed)
            return '/collision_monitor/intended', message, at(k)
        slow = CELL.replace('against_obstacle: OBSTACLE', 'against_obstacle: OBSTACLE, max_speed_m_s: 0.4')
        self.cell('along', self.INTENT, more=lambda at: [twist(at, k, x=-.0056, y=-.0192) for k in range(1, 10)], cell=slow, down=0, finger_at=(0, .05))
        self.on_the_path(5)
        self.assertGreater(sum(m.scale == 1 for t, m, _ in self.said if t == OWN + 'speed_scale'), 5)

        def scaled(message):
            message.scale = min(1, 1.05 * message.scale)
        self.cell('down', self.INTENT, more=lambda at: [twist(at, k, z=-.2) for k in range(1, 10)], cell=slow, down=0, finger_at=(0, .05))  # it says so, and stays
        self.holds()
        self.refuted('speed_scale', scaled, 'speed_scale', 'of finger and .* of plate are .* on the path, and a scale of')
        self.cell('elsewhere', self.INTENT, more=lambda at: [twist(at, k, x=math.nan) for k in range(1, 10)])
        self.refuted('along_path', lambda m: [setattr(m, 'used', True), m.bodies.append('finger')], 'along_path', 'nobody said that they are to go')

    def test_along_a_trajectory(self):
        """Of joints, straight and by splines; where the robot is on it tf says."""
        def swing(at, n, joint='elbow'):
            message = JointTrajectory(joint_names=[joint])
            message.header.stamp = at(1)
            for t in (0, .8):
                message.points.append(JointTrajectoryPoint(positions=[.6 * t ** n], velocities=[.6 * n * t ** (n - 1)] * (n > 1),
                                                           accelerations=[12 * t ** 3] * (n > 2), time_from_start=rospy.Duration(t)))
            return '/collision_monitor/intended', message, at(1)

        def elbow(at, k, n):
            turned, half = transform('elbow', at(k), x=.05, z=.15), .3 * max(0, (k - 1) / 10) ** n
            turned.transform.rotation.y, turned.transform.rotation.w = math.sin(half), math.cos(half)
            return '/tf', TFMessage([turned]), at(k)
        (self.folder / 'elbow.urdf').write_text(ELBOW)
        for n in (1, 2, 5):  # the angle goes by this power of the time
            self.cell('joints', self.INTENT + 'robot: %s/elbow.urdf\n' % self.folder,
                      more=lambda at: [elbow(at, k, n) for k in range(11)] + [swing(at, n)])
            self.holds()
        self.on_the_path(5)
        self.cell('nobody', self.INTENT + 'robot: %s/elbow.urdf\n' % self.folder,
                  more=lambda at: [elbow(at, k, 1) for k in range(11)] + [swing(at, 1, 'nobody')])
        self.refuted('along_path', lambda m: [setattr(m, 'used', True), m.bodies.append('elbow')], 'along_path', 'nobody said that they are to go')

    def test_what_is_carried(self):
        """The cloth leaves the finger no faster than is said, and both go their way."""
        cell = CELL.replace('against_obstacle: OBSTACLE', 'against_obstacle: OBSTACLE, carried_by: finger, max_relative_speed_m_s: 0.4')
        self.cell('carried', cell=cell)
        self.holds()
        self.refuted('safe_until', self.much_longer, 'safe_until', 'are promised at')

    @staticmethod
    def much_longer(message):
        if message.seconds > 0:
            message.until += genpy.Duration(0, 100000)
            message.others_until += genpy.Duration(0, 100000)

    def test_limits(self):
        self.cell('limits', 'limits: {max_m: 0.4, horizon_s: 0.1}\n')
        self.holds()
        said = [m for t, m, _ in self.said if t == OWN + 'limits' and m.speeds and not m.unknown]
        self.assertGreater(len(said), 4)

        def faster(message):
            message.speeds = [speed + 0.5 for speed in message.speeds]

        def fewer(message):
            message.link, message.partners, message.speeds = message.link[1:], message.partners[1:], message.speeds[1:]
            message.corners, message.normals = message.corners[8:], message.normals[1:]
        for lie in (faster, fewer):
            self.refuted('limits', lie, 'limits', 'on either side of no half-space')
        self.cell('near_limits', 'limits: {max_m: 0.05, horizon_s: 0.01}\n')
        self.holds()
        self.refuted('limits', lambda m: setattr(m, 'most_speed', 5 * m.most_speed), 'limits', 'on either side of no half-space')

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
        second = lambda when: lambda at: [*(self.voxels([(9, 9, 9)], at(k)) for k in range(when)), self.voxels([(9, 9, 9), (0, 0, 1)], at(when))]
        self.cell('obstacle', words, lowest=0.08, obstacle='true', more=second(2))
        self.holds()
        self.refuted('state', self.nothing_touches, 'clear', 'of cloth and .* of octomap meet')
        self.cell('own', words, lowest=0.08, obstacle='true', more=second(7))
        self.holds()
        self.assertTrue([m.clear for t, m, _ in self.said if t == OWN + 'state'][-1], 'a voxel that appears where the cloth is')

    def test_what_appears_while_a_body_has_a_seam(self):
        """Is in doubt wherever it is: no distance is held to it."""
        def more(at):
            rags = [('/rag', cloud([(-0.3 - 0.7 * (k > 4), -0.2, 0.1), (-0.3, -0.3, 0.1), (-0.2, -0.3, 0.1)], at(k)), at(k)) for k in range(11)]
            return rags + [self.voxels([(9, 9, 9)], at(1)), self.voxels([(9, 9, 9), (0, 0, 9)], at(6))]
        body = CELL + '  rag: {topic: /rag, topology: {source: polyline}, against_obstacle: false}\n'
        self.cell('seam', 'octomap_topic: /octomap_binary\nown_voxels_m: 0.02\n', obstacle='true', lowest=0.08, more=more, cell=body)
        self.holds(3)
        points = lambda at: [('/points', cloud([(0.4, 0.4, 0.4)] + [(0.012, 0.013, 0.47)] * (k > 4), at(k)), at(k)) for k in range(11)]
        self.cell('seam and clouds', 'obstacle_cloud_topics: [{topic: /points, sensor_frame: finger}]\nown_voxels_m: 0.02\n', obstacle='true', lowest=0.08,
                  more=lambda at: [*points(at), *more(at)[:11]], cell=body)
        self.holds(3)

    def test_what_came_after_a_contradiction(self):
        """Of tf: after the answer, elsewhere at a stamp that its publisher had sent, and then between that one and the next."""
        def more(at):
            sent = [(transform('hand', at(k) + rospy.Duration(0, 5 * 10 ** 7), x=0.2, z=0.05), at(k) + rospy.Duration(0, 6 * 10 ** 7)) for k in range(-1, 11)]
            again = [(transform('hand', at(2) + rospy.Duration(0, ns), x=0.2, z=0.2), at(6) + rospy.Duration(0, 7 * 10 ** 7 + ns)) for ns in (
                5 * 10 ** 7, 9 * 10 ** 7)]
            return [('/tf', TFMessage([t]), when) for t, when in sent + again]
        self.cell('contradiction', more=more, cell=CELL.replace('frame: finger', 'frame: hand'))
        self.holds(3)

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


    # -- what is not looked at does not hold ---------------------------------------------------------------------------

    def test_what_was_attached(self):
        self.cell('attached', lowest=0.1)

        def hold(message):
            message.bodies.append('rod')
        self.not_covered('~attach: rod', 'contacts', hold)
        self.said = [(topic, message, at + rospy.Duration(0, 1)) for topic, message, at in self.said]  # as recorded live
        self.not_covered('~contacts says, was not recorded', 'contacts', lambda message: 'left out')

    def call(self, at, service, name, link='', mesh=''):
        """As something that calls the node may record it."""
        words = {'service': service, 'name': name, 'link': link, 'mesh': str(mesh), 'at': at.to_nsec()}
        self.said.append((OWN + 'called', String(json.dumps(words)), at))
        self.said.sort(key=lambda row: row[2])

    def test_objects_that_a_call_brings_and_takes(self):
        self.cell('called', lowest=0.1)
        rod, far = self.folder / 'rod.obj', self.folder / 'far.obj'
        rod.write_text(worlds.tetrahedron((0.056, 0.192, 0.05)))  # in the cloth, when that has come down
        far.write_text(worlds.tetrahedron((0.056, 0.192, 1)))
        at = lambda k: rospy.Time(100 + k // 10, k % 10 * 10 ** 8 + 1)
        listed = lambda message: message.bodies.append('rod') if message.header.stamp > at(8) else None
        before = list(self.said)
        for mesh, service, status, reason in ((far, 'attach', 0, '^$'), (rod, 'attach', 1, 'rod'),
                                              (far, 'detach', 0, '^$'), (rod, 'detach', 1, 'rod')):
            self.said = [(t, m, when) for t, m, when in before if not at(7) < when <= at(8)]
            self.call(at(7), 'attach', 'rod', 'finger', mesh)
            if service == 'detach':
                self.call(at(8), 'detach', 'rod')
            given, verdict, said = self.told('contacts', listed)
            self.assertEqual((given, verdict['not_covered']), (status, []), said)
            self.assertRegex(' '.join(row['reason'] for row in verdict['refuted'] if row['claim'] == 'clear'), reason)
        self.said = list(before)
        self.call(at(7), 'attach', 'rod', 'finger', far)
        self.refuted('state', lambda message: None, 'clear', 'rod, which came or went by a call')
        self.call(at(7) + rospy.Duration(0, 1), 'remove', 'rod')
        self.holds()
        self.call(at(8), 'set_hold', 'cloth')
        self.not_covered('~set_hold was called')

    def test_the_phase_that_a_call_sets(self):
        self.cell('phase', 'expected_contacts: [{between: [cloth, plate], phase: lay}]\n')

        def expected(message):
            message.touching = 3 if message.touching else 0
        self.refuted('state', expected, 'proved', 'is not expected')
        self.call(rospy.Time(100), 'set_phase', 'lay')
        status, verdict, said = self.told('state', expected)
        self.assertEqual((status, verdict['refuted']), (0, []), said)

    def test_parameters_that_it_does_not_know(self):
        self.cell('unknown', lowest=0.1)
        for words in ('queue_policy: thin\n', 'look_behind_s: 1\n'):
            whole = self.params.read_text()
            self.params.write_text(whole + words)
            self.not_covered(words.split(':')[0])
            self.params.write_text(whole)
        self.params.write_text(whole.replace('topic: /cloth,', 'topic: /cloth, max_acceleration_m_s2: 2,'))
        self.not_covered('max_acceleration_m_s2')

    def test_words_that_no_state_covers(self):
        self.cell('bits', lowest=-0.004)

        def true(message):
            message.data = True
        self.refuted('clear', true, 'left over', '~clear is true, and ~state is not')
        first = min(m.holds_until for t, m, _ in self.said if t == OWN + 'state' and m.clear)

        def silent(message):
            return 'left out' if message.holds_until == first else None
        status, verdict, said = self.told('state', silent)
        self.assertEqual(status, 1, said)
        self.assertIn('~safe_until says something of a step, and no ~state tells of that', [row['reason'] for row in verdict['refuted']])

    def test_a_state_without_a_step(self):
        self.cell('stepless', lowest=0.1)

        def stepless(message):
            message.start = message.holds_until = rospy.Time()
        status, verdict, said = self.told('state', stepless)
        self.assertEqual((status, verdict['refuted'][0]['reason']), (1, 'no frame came for 0.000000000 s'), said)

    def test_what_is_said_again_when_more_has_come(self):
        self.cell('again', lowest=0.1)
        first = next(row for row in self.said if row[0] == OWN + 'state' and row[1].proved)
        again = copy.deepcopy(first[1])
        again.header.stamp = first[2] + rospy.Duration(0, 750000000)
        self.said.append((OWN + 'state', again, again.header.stamp))
        status, verdict, said = self.judged()
        self.assertEqual(status, 1, said)
        self.assertRegex(verdict['refuted'][0]['reason'], 'a frame of cloth came .* before this was said, and it has no answer')

    def test_what_claims_nothing_does_not_count(self):
        self.cell('silent', lowest=0.1)
        status, verdict, said = self.judged(lambda topic, message: message if topic in (OWN + 'state', OWN + 'contacts') else None)
        proved = [m for t, m, _ in self.said if t == OWN + 'state' and m.proved]
        nearest = [m for m in proved if m.clearance_lower > 0]
        self.assertEqual((status, verdict['held']), (0, len(proved) + len(nearest)), said)
        self.cell('no map', 'octomap_topic: /octomap_binary\n', lowest=0.1, obstacle='true')
        status, verdict, said = self.judged(lambda topic, message: message if topic in (OWN + 'state', OWN + 'contacts', OWN + 'clearance') else None)
        self.assertEqual((status, verdict['held'], verdict['refuted']), (3, 0, []), said)
        self.assertRegex(said, '[1-9][0-9]* steps of which nothing is claimed')

    def test_a_mask_and_another_vertex(self):
        nan = float('nan')
        lost = lambda at: [('/plate', cloud([(x, y, nan if x > 0 and y > 0 else 0) for x in (-.1, .1) for y in (-.1, .1)], at(0), rows=2),
                            at(0) + rospy.Duration(0, 1000))]
        words = CELL.replace('motion: static,', 'motion: static, vertex_mask: [0],')
        self.cell('mask', lowest=0.1, more=lost, cell=words)

        def prove(topic, message):
            if topic == OWN + 'state' and message.holds_until.to_nsec():
                message.proved, message.clear, message.touching = True, True, 0
            return message
        status, verdict, said = self.judged(prove)
        self.assertEqual(status, 1, said)
        self.assertIn('plate has vertices or faces that cannot be checked', [row['reason'] for row in verdict['refuted']])

    def test_an_edge_that_stands_through_a_face_all_the_time(self):
        self.cell('through', down=1, lowest=0.05, finger_at=(-0.02, 0.05))
        self.holds()
        last = [m for t, m, _ in self.said if t == OWN + 'state'][-1]
        self.assertEqual((last.proved, last.touching), (True, 1))

        def clear(message):
            if message.holds_until == last.holds_until:
                self.nothing_touches(message)
        self.refuted('state', clear, 'clear', 'meet at 0|goes through face')

        def hide(message):
            message.intersections = []
        self.refuted('contacts', hide, 'proved', 'goes through face .* and that is not listed')

        def apart(distance):
            distance.status, distance.lower, distance.upper = 1, 1e-4, float('nan')

        def row_apart(message):
            for row in message.pairs:
                if set(row.bodies) == {'cloth', 'finger'} and row.at_end.status == 2:
                    apart(row.at_end)
        self.refuted('clearance', row_apart, 'clearance', 'goes through face .* apart at the end')

    def test_distances_that_are_cut_or_none(self):
        self.cell('cut', lowest=0.1)

        def touch(distance):
            distance.status, distance.lower, distance.upper = 2, 0, 0
        still = lambda m: [touch(row.over_step) for row in m.pairs if set(row.bodies) == {'cloth', 'plate'}]
        self.refuted('clearance', still, 'clearance', 'are said to touch over the step, and nothing')

        def late(distance):
            distance.status = 3
            distance.upper -= 1e-3
        self.refuted('clearance', lambda m: self.rows(m, late), 'clearance', 'what the row names')

    def test_the_nearest_two(self):
        self.cell('nearest', lowest=0.1)

        def farther(message):
            message.clearance_lower += 1e-3
        self.refuted('state', farther, 'nearest', 'the nearest two are said to be')

    def test_a_body_and_itself(self):
        self.cell('itself', 'clearance: {self_m: 0.06}\n', lowest=0.1, cell=CELL.replace('"on"', '"on", body_body: "off"'))
        self.holds()

        def farther(message):
            for row in message.pairs:
                if row.bodies[0] == row.bodies[1]:
                    row.at_end.lower *= 10
        self.refuted('clearance', farther, 'clearance', 'cloth and self are .* apart at the end')

        def longer(message):
            if message.seconds > 0:
                message.until += genpy.Duration(0, 100000000)
        self.refuted('safe_until', longer, 'safe_until', 'of cloth and .* of self are .* are promised')

    def test_lists_of_links_and_patches_that_are_not_there(self):
        (self.folder / 'low.urdf').write_text(ARM.replace('0 0 0.05', '-0.3 0 0.1'))
        self.cell('hidden', 'robot: {description: %s/low.urdf, own_voxels_m: 0}\n' % self.folder, lowest=0.12)

        def hide(message):
            message.contacts, message.total_contacts = [], 0
        self.refuted('contacts', hide, 'proved', 'cloth and tool meet, and no contact of the two is listed')
        first = next(m.header.stamp for t, m, _ in self.said if t == OWN + 'patches' and any(p.is_new for p in m.patches))
        self.not_covered('patches of this step were not recorded', 'patches', lambda m: 'left out' if m.header.stamp == first else None)

    def test_own_voxels_and_a_static_frame_that_is_sent_elsewhere(self):
        """Of two voxels that appear, one lies at a plate that is elsewhere later: it is the plate's own."""
        words = 'octomap_topic: /octomap_binary\nown_voxels_m: 0.02\n'

        def more(keys, at):
            plate = cloud([(x, y, 0) for x in (-.1, .1) for y in (-.1, .1)], at(0), rows=2)
            plate.header.frame_id = 'mount'
            mounts = [('/tf_static', TFMessage([transform('mount', at(0), x=x)]), when) for x, when in ((0, at(0)), (0.5, at(4)))]
            return [*mounts, ('/table', plate, at(0)), self.voxels([(9, 9, 9)], at(0)), self.voxels([(9, 9, 9), *keys], at(2))]
        body = CELL.replace('/plate', '/table').replace('cloth: {', 'cloth: {own_voxels_m: 0, ')
        self.cell('own of a plate', words, down=1, lowest=0.03, obstacle='true', more=lambda at: more([(0, 0, 0)], at), cell=body)
        self.holds(3)
        self.assertIn((True, rospy.Time(100, 200000001)), [(m.clear, m.map_stamp) for t, m, _ in self.said if t == OWN + 'state'])
        self.cell('elsewhere', words, down=1, lowest=0.08, obstacle='true', more=lambda at: more([(0, 0, 1)], at), cell=body)
        self.holds(3)
        self.refuted('state', self.nothing_touches, 'clear', 'of cloth and .* of octomap meet')

    def test_what_an_older_cloud_shows(self):
        """A point of the first cloud alone, to which no ray comes again."""
        points = lambda at: [('/points', cloud([(0.012, 0.013, 0.08)] * (k == 0) + [(0.4, 0.4, 0.4)], at(k)), at(k)) for k in range(11)]
        self.cell('older', 'obstacle_cloud_topics: [{topic: /points, sensor_frame: finger}]\n', lowest=0.08, obstacle='true', more=points)
        self.holds(7)
        self.refuted('state', self.nothing_touches, 'clear', 'of cloth and .* of octomap meet')

    def test_clouds_that_say_where_they_were_seen_from(self):
        def seen(at, places):
            message = PointCloud2(height=1, width=2, point_step=24, row_step=48, is_dense=True)
            message.header.frame_id, message.header.stamp = 'world', at
            message.fields = [PointField(name=n, offset=4 * i, datatype=7, count=1) for i, n in enumerate(('x', 'y', 'z', 'vp_x', 'vp_y', 'vp_z'))]
            message.data = struct.pack('<12f', 0.012, 0.013, 0.08, *places[0], 0.4, 0.4, 0.4, *places[1])
            return '/points', message, at
        one, two = (0.2, 0, 0.05), (0.2, 0, 0.06)
        self.cell('seen from', 'obstacle_cloud_topic: /points\n', lowest=0.08, obstacle='true',
                  more=lambda at: [seen(at(k), (one, one)) for k in range(11)])
        self.holds(7)
        self.refuted('state', self.nothing_touches, 'clear', 'of cloth and .* of octomap meet')
        self.cell('seen from two', 'obstacle_cloud_topic: /points\n', lowest=0.08, obstacle='true',
                  more=lambda at: [seen(at(k), (one, one if k < 6 else two)) for k in range(11)])
        self.assertEqual(self.judged()[0], 0)

        def prove(topic, message):
            if topic == OWN + 'state' and message.holds_until.to_nsec():
                message.proved, message.clear, message.map_stamp = True, message.touching == 0, message.holds_until
            return message
        self.assertRegex(str(self.judged(prove)[1]['refuted']), 'seen from different places')


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

    def test_an_edge_beside_a_face_without_an_area(self):
        face = [(8, 0, -2), (11, -5, 1), (8, 0, -2)]
        self.assertFalse(touches.edge_through_face([(9, -6, 0), (13, 0, 6)], face))
        self.assertTrue(touches.edge_through_face([(8, -5, 1), (14, -5, 1)], face))

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
