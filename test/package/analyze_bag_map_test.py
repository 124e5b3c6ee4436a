"""Which map a bag is analysed against: wherever it was recorded, of a file, named, missing, refused, or named by nobody."""
import copy
import csv
import json
import struct
import unittest

import genpy
from geometry_msgs.msg import Pose, PoseArray
from sensor_msgs.msg import CameraInfo, Image
from visualization_msgs.msg import MarkerArray

from analyze_bag_support import AnalyzeBagTestCase
from bag_messages import cloud


class AnalyzeBagMapTest(AnalyzeBagTestCase):
    def test_a_map_that_was_recorded_last(self):
        end = self.messages[-1][2] + genpy.Duration(1)
        late = [(topic, message, at if topic == '/cloth' else end) for topic, message, at in self.messages]
        self.expect_same(self.analyze('late', self.write('late.bag', late)))

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

    def test_a_map_without_a_stamp_is_as_old_as_its_message(self):
        octomap = copy.deepcopy(self.octomap())
        octomap.header.stamp = genpy.Time()
        start = self.cloths[0][2]
        unstamped = self.write('unstamped.bag', [('/octomap_binary', octomap, start)] + self.cloths)
        frames = sum(message.header.stamp - start > genpy.Duration.from_sec(0.31) for _, message, _ in self.cloths)
        self.assertGreater(frames, 2)
        statuses = self.analyzed('unstamped', unstamped, *self.params('max_step_s: 1.0\noctomap_timeout_s: 0.31\n'))[-1]
        self.assertEqual(statuses['NO_MAP'], frames, statuses)
        self.assertGreater(statuses['OK'], 2)

    def test_a_map_that_came_at_the_time_of_the_first_one(self):
        """As by a simulated clock, which stands while two are sent: the later one holds."""
        start = self.cloths[0][2]
        empty = copy.deepcopy(self.octomap())
        empty.data = []
        twins = [('/octomap_binary', empty, start), ('/octomap_binary', self.octomap(), start)]
        self.expect_same(self.analyze('twins', self.write('twins.bag', twins + self.cloths)))

    def test_maps_that_are_stamped_ahead_of_the_frames(self):
        """By a clock that is ahead: where things were at the map's stamp is then not where they were when it was made."""
        for ahead_s, expected in ((0.1, 0), (5, 3)):
            octomap = copy.deepcopy(self.octomap())
            octomap.header.stamp = self.cloths[0][2] + genpy.Duration.from_sec(ahead_s)
            status, _, said, _ = self.analyzed('ahead', self.bag_with('ahead.bag', ('/octomap_binary', octomap)))
            self.assertEqual(status, expected, said)
        self.assertRegex(said.splitlines()[-1], 'not proved: .*stamps of maps on /octomap_binary are up to 5 s later than they come')

    def test_a_map_that_is_made_of_clouds(self):
        """A plate that a sensor at the world's origin sees below the cloth, which sinks onto it."""
        height = sum(min(v.z for v in cloth.vertices) for _, cloth, _ in (self.cloths[0], self.cloths[-1])) / 2
        plate = cloud([(0.02 * i - 1, 0.02 * k - 1, height) for i in range(100) for k in range(100)], self.cloths[0][2])
        messages = []
        for frame in self.cloths:
            messages += [('/points', plate, frame[2] - genpy.Duration.from_sec(0.001)), frame]
        clouded = self.write('clouded.bag', messages)
        given = 'obstacle_cloud_topics: [{topic: points, sensor_frame: world}]\nobstacle_resolution_m: 0.02\n'
        words = self.params(given)
        status, said, complaints, statuses = self.analyzed('clouded', clouded, *words)
        self.assertEqual((status, set(statuses)), (0, {'FIRST_FRAME', 'OK'}), complaints)
        self.assertIn('octomap: /points (named)', said)
        with open(self.folder / 'clouded/contacts.csv') as file:
            self.assertIn('octomap', {row['body_1'] for row in csv.DictReader(file)})
        # The same as depth pictures, whose CameraInfo comes late.
        info = CameraInfo(height=100, width=100, R=[1, 0, 0, 0, 1, 0, 0, 0, 1], P=[49.5 * height, 0, 49.5, 0, 0, 49.5 * height, 49.5, 0, 0, 0, 1, 0])
        info.header.frame_id = plate.header.frame_id
        pictures = []
        for frame in self.cloths:
            picture = Image(height=100, width=100, encoding='32FC1', step=400, data=struct.pack('<f', height) * 10000)
            picture.header = plate.header
            at = frame[2] - genpy.Duration.from_sec(0.001)
            pictures += [('/depth/image', picture, at), ('/depth/camera_info', info, at), frame]
        seen = self.params('obstacle_cloud_topic: depth/image\nobstacle_resolution_m: 0.02\n')
        status, _, complaints, statuses = self.analyzed('pictured', self.write('pictured.bag', pictures), *seen)
        self.assertEqual((status, set(statuses)), (0, {'FIRST_FRAME', 'OK'}), complaints)
        with open(self.folder / 'pictured/contacts.csv') as file:
            self.assertIn('octomap', {row['body_1'] for row in csv.DictReader(file)})
        own = copy.deepcopy(info)
        own.header.stamp, own.P[0] = plate.header.stamp, 2 * info.P[0]
        pictures.insert(-1, ('/depth/camera_info', own, pictures[-2][2]))  # it comes after its picture
        status, _, complaints, statuses = self.analyzed('zoomed', self.write('zoomed.bag', pictures), *seen)
        self.assertEqual((status, statuses['NO_MAP']), (3, 1), complaints)
        self.assertIn('came after that was used, and differs from those before', complaints)
        words = self.params(given)
        status, _, complaints, statuses = self.analyzed('cloudless', self.bag, *words)
        self.assertEqual((status, set(statuses)), (3, {'FIRST_FRAME', 'NO_MAP'}))
        self.assertIn('the bag has no cloud on /points, which is to make the map', self.said)
        flat = copy.deepcopy(plate)
        flat.fields.pop()
        messages.append(('/points', flat, self.messages[-1][2] - genpy.Duration.from_sec(0.0001)))
        status, _, complaints, statuses = self.analyzed('refused', self.write('refused.bag', messages), *words)
        self.assertEqual((status, statuses['NO_MAP']), (3, 1))
        self.assertIn("the cloud was refused: there is no field 'z'", complaints)

    def test_a_named_map_that_the_bag_does_not_have(self):
        for words in (self.params('octomap_topic: /octomap_binray\n'), self.params('octomap_topic: octomap\n')):
            topic = '/octomap_binray' if 'binray' in words[1].read_text() else '/octomap'
            status, _, said, steps = self.analyzed('misspelt', self.bag, *words)
            self.assertEqual(status, 3, said)
            self.assertIn('the bag has no octomap on %s, which octomap_topic names; it has them on /octomap_binary' % topic,
                          self.said)
            self.assertEqual(set(steps), {'FIRST_FRAME', 'NO_MAP'})
            status, _, said, steps = self.analyzed('without', self.bag, *words, '--without-map')
            self.assertEqual((status, set(steps)), (0, {'FIRST_FRAME', 'OK'}), said)
            self.assertNotIn('octomap', said)
            self.expect_mapless('without', 'nothing was checked against a map: effects/octomap is off')

    def expect_mapless(self, name, sentence):
        """In the headline, the facts and the last line: nobody shall take the run for one with a map."""
        report = json.loads((self.folder / name / 'report.json').read_text())
        self.assertIn('; %s' % sentence, report['headline'])
        self.assertIn(['not looked at', sentence], report['facts'])
        self.assertRegex(dict(report['facts'])['octomap'], '^(none on |off)')
        self.assertEqual(report['proof']['not_looked_at'], [sentence])
        self.assertIn(sentence, self.said.splitlines()[0])
        self.assertEqual(self.said.splitlines()[-1], 'note: ' + sentence)

    def test_what_else_the_bag_has_is_named(self):
        rope = PoseArray(poses=[Pose(), Pose()])
        status, said, _, _ = self.analyzed('rope', self.bag_with('rope.bag', ('/octomap_binary', self.octomap()), ('/rope', rope)), '--mesh', '/cloth')
        self.assertEqual(status, 0)
        self.assertEqual(said.splitlines()[-1], 'note: nothing was checked against what is on /rope')

    def test_a_named_map_of_which_nothing_is_usable(self):
        broken = copy.deepcopy(self.octomap())
        broken.resolution = -1
        bag = self.bag_with('broken.bag', ('/table', broken))
        status, _, said, steps = self.analyzed('broken', bag, *self.params('octomap_topic: /table\n'))
        self.assertEqual((status, set(steps)), (3, {'FIRST_FRAME', 'NO_MAP'}), said)
        self.assertRegex(said, 'octomap (was )?refused')
        self.assertIn('no octomap on /table could be used', self.said)
        nothing = self.bag_with('nothing.bag')
        status, _, said, steps = self.analyzed('nothing', nothing, *self.params('effects: {octomap: "on"}\n'))
        self.assertEqual((status, set(steps)), (3, {'FIRST_FRAME', 'NO_MAP'}), said)
        self.assertIn('the bag has no octomap on /octomap_binary, which effects/octomap calls for; it has none', self.said)
        status, _, said, steps = self.analyzed('nothing', nothing)
        self.assertEqual((status, set(steps)), (0, {'FIRST_FRAME', 'OK'}), 'nobody called for one: ' + said)
        self.expect_mapless('nothing', 'nothing was checked against a map: the bag has none')

    def test_a_refused_map_makes_the_one_before_void(self):
        refused = ('/octomap_binary', MarkerArray(), self.messages[len(self.messages) // 2][2])
        messages = [('/octomap_binary', self.octomap(), self.messages[0][2]), refused, *self.cloths]
        status, _, said, steps = self.analyzed('void', self.write('void.bag', messages))
        self.assertEqual(status, 3)
        self.assertGreater(steps['OK'], 10)
        self.assertGreater(steps['NO_MAP'], 10, 'no map is better than an old one')
        self.assertRegex(said, 'octomap (was )?refused')

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


if __name__ == '__main__':
    unittest.main()
