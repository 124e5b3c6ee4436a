"""The bag of results that analyze_bag writes: every topic of the node, markers, diagnostics, beside what monitors recorded."""
import collections
import csv
import json
import math
import re
import unittest

import genpy
from deformable_ccd.msg import ClearanceDistance, Contact
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from visualization_msgs.msg import Marker

from analyze_bag_support import OWN, AnalyzeBagTestCase
from bag_messages import by_topic, messages_of
from checkout import CHECKOUT


class ResultsBagTest(AnalyzeBagTestCase):
    def test_the_bag_of_results(self):
        out = self.folder / 'out.bag'
        params = self.folder / 'markers.yaml'
        params.write_text('markers: {mesh: true, obstacle_m: 0.3}\nlook_ahead_s: 0.1\n')
        self.analyze('out', self.bag, '--params', params, '-o', out)
        messages = by_topic(out)
        frames = len(messages['/cloth'])
        self.assertEqual(frames, sum(topic == '/cloth' for topic, _, _ in self.messages))
        # Beside a step's markers come those of the prediction after it, where it has anything to show.
        foreseen = sum(any(not c.initial for c in array.contacts) for array in messages[OWN + 'predicted_contacts'])
        self.assertGreater(foreseen, 10)
        for name, count in (('contacts', frames), ('first_contact', frames), ('clear', frames), ('stats', frames),
                            ('markers', frames + foreseen), ('predicted_contacts', frames), ('time_to_contact', frames)):
            self.assertEqual(len(messages[OWN + name]), count, name)
        self.assertEqual([m.answered for m in messages[OWN + 'time_to_contact']], [False] + [True] * (frames - 1))
        listed = sum(len(array.contacts) for array in messages[OWN + 'contacts'])
        self.assertEqual(listed, (self.plain / 'contacts.csv').read_text().count('\n') - 1)
        # The last frame with contacts of both kinds: those that the step began with, and new ones.
        initial = [{c.initial for c in array.contacts} for array in messages[OWN + 'contacts']]
        both = [i for i, kinds in enumerate(initial) if len(kinds) == 2]
        steps = [array for array in messages[OWN + 'markers'] if array.markers[:1] and array.markers[0].action == Marker.DELETEALL]
        self.assertEqual(len(steps), frames)
        drawn = {marker.ns: marker for marker in steps[both[-1]].markers[1:]}
        self.assertLessEqual({'mesh/mesh', 'obstacle', 'contacts', 'initial', 'normals', 'voxels', 'began'}, set(drawn))
        patches = messages[OWN + 'patches'][both[-1]].patches
        self.assertEqual(len(drawn['normals'].points), 2 * len(patches), 'one of each patch')
        self.assertEqual(len(drawn['voxels'].points) % 24, 0, 'the twelve edges of each, which hide nothing')
        self.assertEqual(drawn['voxels'].type, Marker.LINE_LIST)
        self.assertRegex(drawn['began'].text, r'^mesh and octomap, \d\.\d\d s ago$')
        self.assertTrue(all(0 < marker.lifetime.to_sec() < 2 for marker in drawn.values()), 'nothing stays of a node that is gone')
        ahead = {marker.ns: marker for array in messages[OWN + 'markers'] for marker in array.markers if array not in steps}
        self.assertEqual(set(ahead), {'predicted', 'predicted first'})
        self.assertNotEqual(ahead['predicted'].type, drawn['contacts'].type, 'a style of their own')
        self.assertRegex(ahead['predicted first'].text, r'^mesh and (octomap|itself) in 0\.\d\d s$')
        # What the statistics say beyond the step.
        stats = messages[OWN + 'stats']
        self.assertEqual({(s.maps_received, s.maps_refused) for s in stats}, {(1, 0)})
        self.assertGreater(json.loads((self.folder / 'out/report.json').read_text())['look_ahead']['came_true'], 0)

    def test_a_rope_is_drawn_by_lines_and_what_is_expected_apart(self):
        rope, params, out = self.folder / 'rope.bag', self.folder / 'rope.yaml', self.folder / 'rope_out.bag'
        self.tool('make_scene_bag', CHECKOUT / 'config/scenes/rope_through_ring.yaml', rope, '--monitor-config', params, '--quiet')
        params.write_text(params.read_text() + '\nmarkers: {mesh: true}\nexpected_contacts:\n  - {between: [rope, octomap]}\n')
        self.analyze('rope', rope, '--params', params, '-o', out)
        lists = [message.markers for topic, message, _ in messages_of(out) if topic == OWN + 'markers']
        drawn = [{m.ns: m for m in markers} for markers in lists]
        meshes = [m for markers in lists for m in markers if m.ns == 'mesh/rope' and m.id == 0]
        self.assertEqual({m.type for m in meshes}, {Marker.LINE_LIST})
        self.assertEqual({m.text for markers in lists for m in markers if m.ns == 'mesh/rope' and m.id == 1}, {'rope'})
        self.assertEqual({len(m.points) % 2 for m in meshes}, {0}, 'two ends an edge')
        self.assertGreater(min(len(m.points) for m in meshes), 20)
        self.assertTrue(any('expected' in markers for markers in drawn))
        self.assertFalse(any('contacts' in markers or 'initial' in markers for markers in drawn))

    def test_the_bag_of_results_has_every_topic_of_the_node(self):
        out, params = self.folder / 'all.bag', self.folder / 'all.yaml'
        params.write_text('accuracy: conservative\nminimum_separation_m: 0.03\nlook_ahead_s: 0.1\neffects: {clearance: on}\n'  # more than the cloth's edges
                          'max_speed_m_s: 1\nspeed_scale: {reaction_time_s: 0.1, stopping_time_s: 0.1}\nlimits: {max_m: 0.3, horizon_s: 0.1}\n'
                          'intent: {horizon_s: 1, deviation_m: 0.01}\n')
        self.analyze('all', self.bag, '--params', params, '-o', out)
        messages = by_topic(out)
        topics = {topic for source in ('output/outputs.cpp', 'node/state_reporter.cpp')
                  for topic in re.findall(r'advertise<.*>\("(\w+)"', (CHECKOUT / 'src' / source).read_text())}
        self.assertGreater(len(topics), 10)
        self.assertEqual({OWN + topic for topic in topics} - set(messages), set())
        effects = messages[OWN + 'effects']
        self.assertEqual({e.name for e in effects[-1].status if {v.key: v.value for v in e.values}['running'] == 'true'} & {'look_ahead', 'minimum_separation'},
                         {'look_ahead', 'minimum_separation'})
        self.assertLess(len(effects), 10, 'when the plan changes, and not in each step')
        self.assertGreater(max(m.left_out_met for m in messages[OWN + 'stats']), 0)

    def test_distances_are_zero_exactly_where_something_touches(self):
        out, params = self.folder / 'apart.bag', self.folder / 'apart.yaml'
        params.write_text('effects: {clearance: on}\nclearance: {self_m: 0.1}\nexpected_contacts:\n  - {between: [mesh, self]}\n')
        report = self.analyze('apart', self.bag, '--params', params, '-o', out)
        messages = by_topic(out)
        rows, touched, apart = [], 0, 0
        self.assertEqual(len(messages[OWN + 'clearance']), len(messages[OWN + 'contacts']))
        for contacts, distances, state in zip(*(messages[OWN + name] for name in ('contacts', 'clearance', 'state'))):
            self.assertEqual((distances.header.stamp, distances.answered), (contacts.header.stamp, contacts.answered))
            if not contacts.answered:
                self.assertEqual((distances.pairs, math.isnan(state.clearance_lower)), ([], True))
                continue
            names = {Contact.OBSTACLE: 'octomap', **dict(enumerate(contacts.bodies))}
            touching = {frozenset(names[b] for b in found.body) for found in contacts.contacts + contacts.intersections}
            undecided = {frozenset(names[b] for b in c.body) for c in contacts.contacts if c.certainty == Contact.UNDECIDED}
            self.assertEqual({frozenset(p.bodies) for p in distances.pairs if p.over_step.status == ClearanceDistance.TOUCHING}, touching)
            self.assertEqual([p.bodies for p in distances.pairs], [['mesh', 'mesh'], ['mesh', 'octomap']])
            self.assertEqual([p.expected for p in distances.pairs], [True, False])
            self.assertEqual(state.clearance_between, 'mesh and octomap')
            for p in distances.pairs:
                rows.append(p)
                least, end = p.over_step, p.at_end
                if frozenset(p.bodies) in touching:
                    self.assertEqual((least.lower, least.upper), (0, 0))
                    touched += 1
                elif least.status == ClearanceDistance.FARTHER:
                    self.assertNotIn(frozenset(p.bodies), undecided)
                    self.assertGreaterEqual(least.lower, 0.025 if p.bodies[1] == 'mesh' else 0.5)
                else:
                    self.assertEqual(least.status, ClearanceDistance.MEASURED)
                    self.assertTrue(0 < least.lower <= least.upper <= least.lower + 1e-4, p)
                    self.assertTrue(math.isnan(end.upper) or least.lower <= end.upper, p)
                    apart += 1
            self.assertEqual(state.clearance_lower, distances.pairs[1].over_step.lower)
        self.assertTrue(touched > 5 and apart > 5, 'too little to mean anything')
        with open(report / 'clearance.csv', encoding='utf-8') as file:
            table = list(csv.DictReader(file))
        self.assertEqual([float(row['step_lower_m']) for row in table], [p.over_step.lower for p in rows])
        self.assertEqual([(row['body_0'], row['body_1'], row['expected']) for row in table],
                         [(*p.bodies, str(int(p.expected))) for p in rows])
        self.assertEqual(len(json.loads((report / 'report.json').read_text())['clearance']['curves']), 2)
        self.assertFalse((self.plain / 'clearance.csv').exists(), 'where nobody asked for distances')

    def test_the_bag_of_results_is_diagnosed_once_a_second_of_its_time(self):
        """What a monitor said when the bag was recorded is not in it; what others said is."""
        out = self.folder / 'slow_out.bag'
        start, own = self.messages[0][2], DiagnosticStatus(name='/collision_monitor: steps', message='of before')
        seconds = 8
        stretch = seconds / (self.messages[-1][2] - start).to_sec()
        messages = [('/diagnostics', DiagnosticArray(status=array), start)
                    for array in ([own, DiagnosticStatus(name='camera')], [own], [DiagnosticStatus(name='arm')])]
        messages += [(topic, message, start + genpy.Duration.from_sec((at - start).to_sec() * stretch))
                     for topic, message, at in self.messages]
        self.expect_same(self.analyze('slow', self.write('slow.bag', messages), '-o', out))
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
        rows = re.findall(r'putValue\(status, "([^"]+)"', (CHECKOUT / 'src/output/diagnostics.cpp').read_text())
        self.assertEqual(set(values), {row for row in rows if 'latency' not in row}, 'the rows of the node; nobody waited')
        frames = sum(topic == '/cloth' for topic, _, _ in self.messages)
        self.assertGreater(int(values['frames received']), frames // 2)
        self.assertAlmostEqual(float(values['answers [Hz]']), frames / seconds, delta=1.5)
        self.assertEqual((values['maps received'], values['maps refused'], values['frames dropped']), ('1', '0', '0'))

    def test_a_bag_that_was_recorded_beside_monitors(self):
        """As `rosbag record -a` does: their markers, of a mesh type, come before the tracker's topic."""
        once, again = (self.folder / name for name in ('once.bag', 'again.bag'))
        self.analyze('once', self.bag, '-o', once)
        results = messages_of(once)
        own = [(topic.replace(OWN, own), message, at - genpy.Duration(1)) for own in (OWN, '/guard/')
               for topic, message, at in results if topic.startswith(OWN)]
        self.expect_same(self.analyze('recorded', self.write('recorded.bag', own + self.messages), '-o', again))
        # Of diagnostics there is one a second, and the recording is longer.
        count, found = (collections.Counter(topic for topic, _, _ in messages if topic != '/diagnostics')
                        for messages in (results, messages_of(again)))
        self.assertGreater(count[OWN + 'markers'], 20)
        self.assertEqual({t: n for t, n in found.items() if not t.startswith('/guard/')}, count, 'nothing twice')
        self.assertEqual(found['/guard/contacts'], count[OWN + 'contacts'], 'of others, everything')


if __name__ == '__main__':
    unittest.main()
