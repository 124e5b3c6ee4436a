"""analyze_bag as people use it: the same output for any number of threads, maps wherever they are, a bag of results."""
import collections
import copy
import csv
import io
import json
import re
import subprocess
import unittest

import genpy
import rosbag
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point, TransformStamped
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from checkout import CHECKOUT, TOOLS, FolderTestCase

OWN = '/collision_monitor/'


def bytes_of(message):
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def messages_of(path):
    with rosbag.Bag(str(path)) as bag:
        return list(bag.read_messages())


def write_moving(bag, cloth, stamp, at, transform_at):
    """A frame of the cloth in a frame that moves, and the transform that it needs."""
    message, moving = copy.deepcopy(cloth), TransformStamped()
    message.header.stamp, message.header.frame_id = stamp, 'camera'
    bag.write('/cloth', message, at)
    moving.header.stamp, moving.header.frame_id, moving.child_frame_id = stamp, 'world', 'camera'
    moving.transform.rotation.w = 1
    bag.write('/tf', TFMessage([moving]), transform_at)


class AnalyzeBagTest(FolderTestCase):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.bag = cls.folder / 'scene.bag'
        cls.tool('make_scene_bag', CHECKOUT / 'config/scenes/table_edge.yaml', cls.bag, '--frames', 40, '--quiet')
        cls.messages = messages_of(cls.bag)
        cls.plain = cls.analyze('plain', cls.bag)

    @classmethod
    def tool(cls, name, *words):
        ran = subprocess.run([str(TOOLS / name)] + [str(w) for w in words], capture_output=True, text=True, check=False)
        assert ran.returncode == 0, ran.stderr
        return ran

    @classmethod
    def analyze(cls, name, bag, *words):
        """The folder of the report, which has the contacts of some steps."""
        report = cls.folder / name
        cls.tool('analyze_bag', bag, '--report', report, '--no-accuracy-table', '--quiet', *words)
        return report

    def analyzed(self, name, bag, *words):
        """Exit status, standard output and error, and the statuses of the steps; whatever comes of it."""
        report = self.folder / name
        command = [TOOLS / 'analyze_bag', bag, '--report', report, '--no-accuracy-table', '--quiet', *words]
        ran = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
        self.assertIn(ran.returncode, (0, 3), ran.stderr)
        return ran.returncode, ran.stdout, ran.stderr, self.statuses_of(report)

    def params(self, text):
        path = self.folder / 'given.yaml'
        path.write_text('fixed_frame: world\n' + text)
        return ['--params', path]

    def bag_with(self, name, *maps):
        """The scene's cloth and, at the bag's beginning, other messages: (topic, message)."""
        path, start = self.folder / name, self.messages[0][2]
        with rosbag.Bag(str(path), 'w') as bag:
            for topic, message in maps:
                bag.write(topic, message, start)
            for topic, message, at in self.messages:
                if topic == '/cloth':
                    bag.write(topic, message, at)
        return path

    def octomap(self):
        return next(message for topic, message, _ in self.messages if topic == '/octomap_binary')

    def statuses(self, bag):
        return self.analyzed('statuses', bag, *self.params('max_step_s: 1.0\n'))[-1]

    @staticmethod
    def statuses_of(report):
        steps = [line.split(',') for line in (report / 'steps.csv').read_text().splitlines()]
        return collections.Counter(row[steps[0].index('status')] for row in steps[1:])

    def expect_same(self, report, names=('contacts.csv', 'steps.csv')):
        for name in names:
            expected = (self.plain / name).read_bytes()
            self.assertGreater(expected.count(b'\n'), 20, 'too little to mean anything')
            self.assertEqual((report / name).read_bytes(), expected, name)

    def test_any_number_of_threads(self):
        contents = []
        for threads in (1, 3):
            out = self.folder / ('threads_%d.bag' % threads)
            self.expect_same(self.analyze('threads_%d' % threads, self.bag, '--threads', threads, '-o', out))
            contents.append([(topic, bytes_of(message), at) for topic, message, at in messages_of(out)
                             if topic != OWN + 'stats'])  # these carry milliseconds
        self.assertEqual(contents[0], contents[1])

    def test_a_map_that_was_recorded_last(self):
        late = self.folder / 'late.bag'
        with rosbag.Bag(str(late), 'w') as bag:
            for topic, message, at in self.messages:
                bag.write(topic, message, at if topic == '/cloth' else self.messages[-1][2] + genpy.Duration(1))
        self.expect_same(self.analyze('late', late))

    def test_a_map_from_a_file(self):
        octomap = self.octomap()
        self.assertEqual((octomap.id, octomap.binary), ('OcTree', True))
        data = bytes(b & 0xff for b in octomap.data)
        # Two bits for each child of a node that has children, 0 for none; the header counts the root, too.
        nodes = 1 + sum((byte >> shift) & 3 != 0 for byte in data for shift in (0, 2, 4, 6))
        header = '# Octomap OcTree binary file\nid OcTree\nsize %d\nres %r\ndata\n' % (nodes, octomap.resolution)
        tree = self.folder / 'map.bt'
        tree.write_bytes(header.encode() + data)
        bare = self.bag_with('bare.bag')
        self.expect_same(self.analyze('file', bare, '--octomap', tree))

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

    def test_a_map_without_a_stamp_is_as_old_as_its_message(self):
        unstamped, frames = self.folder / 'unstamped.bag', 0
        octomap = copy.deepcopy(self.octomap())
        octomap.header.stamp = genpy.Time()
        with rosbag.Bag(str(unstamped), 'w') as bag:
            start = next(at for topic, _, at in self.messages if topic == '/cloth')
            bag.write('/octomap_binary', octomap, start)
            for topic, message, at in self.messages:
                if topic == '/cloth':
                    bag.write(topic, message, at)
                    frames += message.header.stamp - start > genpy.Duration.from_sec(0.31)
        self.assertGreater(frames, 2)
        statuses = self.analyzed('unstamped', unstamped, *self.params('max_step_s: 1.0\noctomap_timeout_s: 0.31\n'))[-1]
        self.assertEqual(statuses['NO_MAP'], frames, statuses)
        self.assertGreater(statuses['OK'], 2)

    def test_a_named_map_that_the_bag_does_not_have(self):
        for words in (self.params('octomap_topic: /octomap_binray\n'), self.params('octomap_topic: octomap\n')):
            topic = '/octomap_binray' if 'binray' in words[1].read_text() else '/octomap'
            status, _, said, steps = self.analyzed('misspelt', self.bag, *words)
            self.assertEqual(status, 3, said)
            self.assertIn('the bag has no octomap on %s, which octomap_topic names; it has them on /octomap_binary' % topic,
                          said)
            self.assertEqual(set(steps), {'FIRST_FRAME', 'NO_MAP'})
            status, _, said, steps = self.analyzed('without', self.bag, *words, '--without-map')
            self.assertEqual((status, set(steps)), (0, {'FIRST_FRAME', 'OK'}), said)
            self.assertNotIn('octomap', said)

    def test_a_named_map_of_which_nothing_is_usable(self):
        broken = copy.deepcopy(self.octomap())
        broken.resolution = -1
        bag = self.bag_with('broken.bag', ('/table', broken))
        status, _, said, steps = self.analyzed('broken', bag, *self.params('octomap_topic: /table\n'))
        self.assertEqual((status, set(steps)), (3, {'FIRST_FRAME', 'NO_MAP'}), said)
        self.assertIn('octomap refused', said)
        self.assertIn('no octomap on /table could be used', said)
        nothing = self.bag_with('nothing.bag')
        status, _, said, steps = self.analyzed('nothing', nothing, *self.params('effects: {octomap: "on"}\n'))
        self.assertEqual((status, set(steps)), (3, {'FIRST_FRAME', 'NO_MAP'}), said)
        self.assertIn('the bag has no octomap on /octomap_binary, which effects/octomap calls for; it has none', said)
        status, _, said, steps = self.analyzed('nothing', nothing)
        self.assertEqual((status, set(steps)), (0, {'FIRST_FRAME', 'OK'}), 'nobody called for one: ' + said)

    def test_a_refused_map_makes_the_one_before_void(self):
        start = self.messages[0][2]
        bag = self.folder / 'void.bag'
        with rosbag.Bag(str(bag), 'w') as written:
            written.write('/octomap_binary', self.octomap(), start)
            for i, (topic, message, at) in enumerate(self.messages):
                if i == len(self.messages) // 2:
                    written.write('/octomap_binary', MarkerArray(), at)
                if topic == '/cloth':
                    written.write(topic, message, at)
        status, _, said, steps = self.analyzed('void', bag)
        self.assertEqual(status, 3)
        self.assertGreater(steps['OK'], 10)
        self.assertGreater(steps['NO_MAP'], 10, 'no map is better than an old one')
        self.assertIn('octomap refused', said)

    def test_the_map_that_nobody_named(self):
        """The default's topic where the bag has it, else the bag's first one; what else there is is not passed over."""
        other = copy.deepcopy(self.octomap())
        table = self.bag_with('table.bag', ('/table', other), ('/later', other))
        status, said, complaints, steps = self.analyzed('table', table)
        self.assertEqual((status, set(steps)), (0, {'FIRST_FRAME', 'OK'}), complaints)
        self.assertIn('octomap: /table (the first of the bag; nobody named one)\n', said)
        self.assertIn(['octomap', '/table (the first of the bag; nobody named one)'],
                      json.loads((self.folder / 'table/report.json').read_text())['facts'])
        self.assertIn('nobody listens to the octomaps on /later', complaints)
        self.assertEqual((self.folder / 'table/contacts.csv').read_bytes(), (self.plain / 'contacts.csv').read_bytes())

        both = self.bag_with('both.bag', ('/another', other), ('/octomap_binary', other))
        status, said, complaints, _ = self.analyzed('both', both)
        self.assertEqual(complaints.count('analyze_bag: '), 1, complaints)
        self.assertIn('octomap: /octomap_binary (default)\n', said)
        self.assertIn('nobody listens to the octomaps on /another', complaints)
        self.assertEqual(self.analyzed('both', both, '--without-map')[2], '')

    def test_a_bag_in_which_no_frame_is_answered(self):
        short = self.folder / 'short.bag'
        with rosbag.Bag(str(short), 'w') as bag:
            for topic, message, at in [m for m in self.messages if m[0] == '/cloth'][:1]:
                bag.write(topic, message, at)
        status, _, said, steps = self.analyzed('short', short)
        self.assertEqual((status, steps), (3, {'FIRST_FRAME': 1}))
        self.assertIn('no frame was answered', said)
        lost = self.bag_with('lost.bag')
        params = self.params('')
        params[1].write_text('fixed_frame: moon\n')
        status, _, said, steps = self.analyzed('lost', lost, *params)
        self.assertEqual((status, set(steps)), (3, {'NO_TRANSFORM'}))
        self.assertRegex(said, r'no frame was answered: (\d+) of \1 frames: NO_TRANSFORM: no transform .*moon.*\(\1\)\n')

    def test_the_help_lists_the_exit_statuses(self):
        said = self.tool('analyze_bag', '--help').stdout
        for line in ('0', '1', '3'):
            self.assertRegex(said, r'(?m)^ *%s +\w' % line)

    def test_the_bag_of_results(self):
        out = self.folder / 'out.bag'
        params = self.folder / 'markers.yaml'
        params.write_text('markers: {mesh: true, obstacle_m: 0.3}\nlook_ahead_s: 0.1\n')
        self.analyze('out', self.bag, '--params', params, '-o', out)
        by_topic = collections.defaultdict(list)
        for topic, message, _ in messages_of(out):
            by_topic[topic].append(message)
        frames = len(by_topic['/cloth'])
        self.assertEqual(frames, sum(topic == '/cloth' for topic, _, _ in self.messages))
        # Beside a step's markers come those of the prediction after it, where it has anything to show.
        foreseen = sum(any(not c.initial for c in array.contacts) for array in by_topic[OWN + 'predicted_contacts'])
        self.assertGreater(foreseen, 10)
        for name, count in (('contacts', frames), ('first_contact', frames), ('clear', frames), ('stats', frames),
                            ('markers', frames + foreseen), ('predicted_contacts', frames), ('time_to_contact', frames)):
            self.assertEqual(len(by_topic[OWN + name]), count, name)
        self.assertEqual([m.answered for m in by_topic[OWN + 'time_to_contact']], [False] + [True] * (frames - 1))
        listed = sum(len(array.contacts) for array in by_topic[OWN + 'contacts'])
        self.assertEqual(listed, (self.plain / 'contacts.csv').read_text().count('\n') - 1)
        # The last frame with contacts of both kinds: those that the step began with, and new ones.
        initial = [{c.initial for c in array.contacts} for array in by_topic[OWN + 'contacts']]
        both = [i for i, kinds in enumerate(initial) if len(kinds) == 2]
        steps = [array for array in by_topic[OWN + 'markers'] if array.markers[:1] and array.markers[0].action == Marker.DELETEALL]
        self.assertEqual(len(steps), frames)
        drawn = {marker.ns: marker for marker in steps[both[-1]].markers[1:]}
        self.assertLessEqual({'mesh/mesh', 'obstacle', 'contacts', 'initial', 'normals', 'voxels', 'legend', 'began'}, set(drawn))
        patches = by_topic[OWN + 'patches'][both[-1]].patches
        self.assertEqual(len(drawn['normals'].points), 2 * len(patches), 'one of each patch')
        self.assertEqual(len(drawn['voxels'].points) % 24, 0, 'the twelve edges of each, which hide nothing')
        self.assertEqual(drawn['voxels'].type, Marker.LINE_LIST)
        self.assertRegex(drawn['began'].text, r'^mesh and octomap, \d\.\d\d s ago$')
        self.assertTrue(all(0 < marker.lifetime.to_sec() < 2 for marker in drawn.values()), 'nothing stays of a node that is gone')
        ahead = {marker.ns: marker for array in by_topic[OWN + 'markers'] for marker in array.markers if array not in steps}
        self.assertEqual(set(ahead), {'predicted', 'predicted first'})
        self.assertNotEqual(ahead['predicted'].type, drawn['contacts'].type, 'a style of their own')
        self.assertRegex(ahead['predicted first'].text, r'^mesh and (octomap|itself) in 0\.\d\d s$')
        # What the statistics say beyond the step.
        stats = by_topic[OWN + 'stats']
        self.assertEqual([s.markers_built for s in stats], list(range(1, frames + 1)))
        self.assertEqual({(s.maps_received, s.maps_refused) for s in stats}, {(1, 0)})
        score = json.loads((self.folder / 'out/report.json').read_text())['look_ahead']
        self.assertGreater(score['compared'], 0)
        self.assertEqual(stats[-1].look_ahead_compared, min(score['compared'], 1000))
        self.assertLess(stats[0].look_ahead_compared, stats[-1].look_ahead_compared)

    def test_a_rope_is_drawn_as_a_tube_and_what_is_expected_apart(self):
        rope, params, out = self.folder / 'rope.bag', self.folder / 'rope.yaml', self.folder / 'rope_out.bag'
        self.tool('make_scene_bag', CHECKOUT / 'config/scenes/rope_through_ring.yaml', rope, '--monitor-config', params, '--quiet')
        params.write_text(params.read_text() + '\nmarkers: {mesh: true}\nexpected_contacts:\n  - {between: [rope, octomap]}\n')
        self.analyze('rope', rope, '--params', params, '--no-accuracy-table', '-o', out)
        drawn = [{m.ns: m for m in message.markers} for topic, message, _ in messages_of(out) if topic == OWN + 'markers']
        meshes = [markers['mesh/rope'] for markers in drawn if 'mesh/rope' in markers]
        self.assertEqual({m.type for m in meshes}, {Marker.TRIANGLE_LIST})
        self.assertEqual({len(m.points) % 36 for m in meshes}, {0}, 'six sides of two triangles an edge')
        self.assertTrue(any('expected' in markers for markers in drawn))
        self.assertFalse(any('contacts' in markers or 'initial' in markers for markers in drawn))

    def test_the_bag_of_results_has_every_topic_of_the_node(self):
        out, params = self.folder / 'all.bag', self.folder / 'all.yaml'
        params.write_text('accuracy: conservative\nminimum_separation_m: 0.03\nlook_ahead_s: 0.1\n')  # more than the cloth's edges
        self.analyze('all', self.bag, '--params', params, '--no-accuracy-table', '-o', out)
        by_topic = collections.defaultdict(list)
        for topic, message, _ in messages_of(out):
            by_topic[topic].append(message)
        topics = {topic for source in ('output/outputs.cpp', 'node/state_reporter.cpp')
                  for topic in re.findall(r'advertise<.*>\("(\w+)"', (CHECKOUT / 'src' / source).read_text())}
        self.assertGreater(len(topics), 10)
        self.assertEqual({OWN + topic for topic in topics} - set(by_topic), set())
        effects = by_topic[OWN + 'effects']
        self.assertEqual({e.name for e in effects[-1].effects if e.running} & {'look_ahead', 'minimum_separation'},
                         {'look_ahead', 'minimum_separation'})
        self.assertLess(len(effects), 10, 'when the plan changes, and not in each step')
        listed = len((self.folder / 'all/left_out.csv').read_text().splitlines()) - 1
        self.assertEqual(len(by_topic[OWN + 'left_out'][-1].pairs), listed)

    def test_the_bag_of_results_is_diagnosed_once_a_second_of_its_time(self):
        """What a monitor said when the bag was recorded is not in it; what others said is."""
        slow, out = self.folder / 'slow.bag', self.folder / 'slow_out.bag'
        start, own = self.messages[0][2], DiagnosticStatus(name='/collision_monitor: steps', message='of before')
        seconds = 8
        stretch = seconds / (self.messages[-1][2] - start).to_sec()
        with rosbag.Bag(str(slow), 'w') as bag:
            for array in ([own, DiagnosticStatus(name='camera')], [own], [DiagnosticStatus(name='arm')]):
                bag.write('/diagnostics', DiagnosticArray(status=array), start)
            for topic, message, at in self.messages:
                bag.write(topic, message, start + genpy.Duration.from_sec((at - start).to_sec() * stretch))
        self.expect_same(self.analyze('slow', slow, '-o', out))
        arrays = [(message, at) for topic, message, at in messages_of(out) if topic == '/diagnostics']
        others = [status.name for array, _ in arrays for status in array.status if status.name != own.name]
        self.assertEqual(others, ['camera', 'arm'])
        said = [(array.status[0], array.header.stamp, at) for array, at in arrays if array.status[0].name == own.name]
        self.assertTrue(all(stamp == at for _, stamp, at in said), 'of the time of the bag')
        self.assertIn(len(said), (seconds, seconds + 1))
        self.assertNotIn('of before', [status.message for status, _, _ in said])
        self.assertEqual(said[0][0].message, 'no frames arrive', 'yet')
        last = said[-1][0]
        self.assertEqual((last.level, last.message), (DiagnosticStatus.OK, 'OK'))
        values = {pair.key: pair.value for pair in last.values}
        rows = re.findall(r'put\(status, "([^"]+)"', (CHECKOUT / 'src/output/diagnostics.cpp').read_text())
        self.assertEqual(set(values), {row for row in rows if 'latency' not in row}, 'the rows of the node; nobody waited')
        frames = sum(topic == '/cloth' for topic, _, _ in self.messages)
        self.assertGreater(int(values['frames received']), frames // 2)
        self.assertAlmostEqual(float(values['answers [Hz]']), frames / seconds, delta=1.5)
        self.assertEqual((values['maps received'], values['maps refused'], values['frames dropped']), ('1', '0', '0'))

    def test_contacts_that_are_expected_in_the_phase_of_the_bag(self):
        """The cloth on its map: found as before, marked, and no alarm; in another phase it is one."""
        expected = 'expected_contacts: [{between: [mesh, octomap], phase: lay}, {between: [mesh, self], phase: fold}]\n'
        found = {}
        for phase in ('lay', 'fold'):
            out = self.folder / (phase + '.bag')
            self.analyze(phase, self.bag, *self.params(expected + 'phase: %s\n' % phase), '-o', out)
            marks, plain = (list(csv.DictReader((folder / 'contacts.csv').read_text().splitlines()))
                            for folder in (self.folder / phase, self.plain))
            partner = 'octomap' if phase == 'lay' else 'mesh'
            self.assertEqual([c['expected'] == '1' for c in marks], [c['body_1'] == partner for c in marks])
            self.assertEqual([{**c, 'expected': '0'} for c in marks], plain, 'nothing changes but the mark')
            states, firsts = [], []
            for topic, message, _ in messages_of(out):
                if topic == OWN + 'state':
                    states.append(message)
                elif topic == OWN + 'first_contact':
                    firsts.append(message)
            self.assertTrue(all(len(s.expected) == 1 for s in states[1:]), 'said of each answer')
            self.assertEqual(sum(f.expected_contacts for f in firsts), sum(c['expected'] == '1' for c in marks))
            found[phase] = sum(f.contact for f in firsts), sum(s.touching == s.EXPECTED for s in states)
        self.assertGreater(found['fold'][0], found['lay'][0], 'steps with an alarm')
        self.assertGreater(found['lay'][1], found['fold'][1], 'steps in which all that touches is expected')
        ran = subprocess.run([str(TOOLS / 'analyze_bag'), str(self.bag), '--report', str(self.folder / 'no'), '--quiet',
                              *map(str, self.params(expected + 'phase: lie\n'))], capture_output=True, text=True, check=False)
        self.assertEqual(ran.returncode, 1)
        self.assertIn("phase is 'lie', which expected_contacts does not name; known phases are 'fold', 'lay'", ran.stderr)

    def test_a_bag_that_was_recorded_beside_monitors(self):
        """As `rosbag record -a` does: their markers, of a mesh type, come before the tracker's topic."""
        once, recorded, again = (self.folder / name for name in ('once.bag', 'recorded.bag', 'again.bag'))
        self.analyze('once', self.bag, '-o', once)
        results = messages_of(once)
        with rosbag.Bag(str(recorded), 'w') as bag:
            for own in (OWN, '/guard/'):
                for topic, message, at in results:
                    if topic.startswith(OWN):
                        bag.write(topic.replace(OWN, own), message, at - genpy.Duration(1))
            for topic, message, at in self.messages:
                bag.write(topic, message, at)
        self.expect_same(self.analyze('recorded', recorded, '-o', again))
        # Of diagnostics there is one a second, and the recording is longer.
        count, found = (collections.Counter(topic for topic, _, _ in messages if topic != '/diagnostics')
                        for messages in (results, messages_of(again)))
        self.assertGreater(count[OWN + 'markers'], 20)
        self.assertEqual({t: n for t, n in found.items() if not t.startswith('/guard/')}, count, 'nothing twice')
        self.assertEqual(found['/guard/contacts'], count[OWN + 'contacts'], 'of others, everything')

    def test_the_report_comes_before_the_accuracy_table(self):
        """That replays the bag for each rung, which may go wrong."""
        early = self.folder / 'early'
        command = [str(TOOLS / 'analyze_bag'), str(self.bag), '--report', str(early)]
        process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        with process:
            first = next(line for line in process.stderr if line.startswith('accuracy table'))
            process.kill()
        self.assertEqual(first, 'accuracy table: exact\n', 'what the others are held against')
        self.expect_same(early)
        self.assertIn('First contact', json.loads((early / 'report.json').read_text())['headline'])
        self.assertIn('</html>', (early / 'report.html').read_text())

        full = self.folder / 'full'
        self.tool('analyze_bag', self.bag, '--report', full, '--quiet')
        self.expect_same(full)
        rungs = {r['rung']: r for r in json.loads((full / 'report.json').read_text())['rungs']}
        self.assertEqual(list(rungs), ['fast', 'conservative', 'exact'])
        self.assertEqual((rungs['exact']['missed'], rungs['exact']['false'], rungs['exact']['undecided']), (0, 0, 0))
        self.assertEqual(rungs['exact']['contacts'], (full / 'contacts.csv').read_text().count('\n') - 1)
        self.assertEqual([rungs[r]['missed'] for r in rungs], [0, 0, 0])


if __name__ == '__main__':
    unittest.main()
