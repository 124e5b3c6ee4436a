"""analyze_bag as people use it: the same output for any number of threads, maps wherever they are, a bag of results."""
import collections
import copy
import io
import pathlib
import shutil
import subprocess
import tempfile
import unittest

import genpy
import rosbag

from checkout import CHECKOUT, TOOLS

OWN = '/collision_monitor/'


def bytes_of(message):
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def messages_of(path):
    with rosbag.Bag(str(path)) as bag:
        return list(bag.read_messages())


class AnalyzeBagTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder, True)
        cls.bag = cls.folder / 'scene.bag'
        cls.tool('make_scene_bag', CHECKOUT / 'config/scenes/table_edge.yaml', cls.bag, '--frames', 25, '--quiet')
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
        octomap = next(m for t, m, _ in self.messages if t == '/octomap_binary')
        self.assertEqual((octomap.id, octomap.binary), ('OcTree', True))
        data = bytes(b & 0xff for b in octomap.data)
        # Two bits for each child of a node that has children, 0 for none; the header counts the root, too.
        nodes = 1 + sum((byte >> shift) & 3 != 0 for byte in data for shift in (0, 2, 4, 6))
        header = '# Octomap OcTree binary file\nid OcTree\nsize %d\nres %r\ndata\n' % (nodes, octomap.resolution)
        tree = self.folder / 'map.bt'
        tree.write_bytes(header.encode() + data)
        bare = self.folder / 'bare.bag'
        with rosbag.Bag(str(bare), 'w') as bag:
            for topic, message, at in self.messages:
                if topic == '/cloth':
                    bag.write(topic, message, at)
        self.expect_same(self.analyze('file', bare, '--octomap', tree))

    def test_transforms_of_a_long_bag(self):
        """Ten minutes between the halves of the bag, the cloth in a frame that moves: each frame finds its transform."""
        from geometry_msgs.msg import TransformStamped
        from tf2_msgs.msg import TFMessage
        long_bag, frames = self.folder / 'long.bag', 0
        with rosbag.Bag(str(long_bag), 'w') as bag:
            for topic, message, at in self.messages:
                if topic != '/cloth':
                    bag.write(topic, message, at)
                    continue
                frames += 1
                if frames > 12:
                    at = at + genpy.Duration(600)
                message.header.stamp, message.header.frame_id = at, 'camera'
                bag.write(topic, message, at)
                moving = TransformStamped()
                moving.header.stamp, moving.header.frame_id, moving.child_frame_id = at, 'world', 'camera'
                moving.transform.rotation.w = 1
                bag.write('/tf', TFMessage([moving]), at + genpy.Duration(1))  # recorded after the frame that needs it
        params = self.folder / 'long.yaml'
        params.write_text('fixed_frame: world\n')
        report = self.analyze('long', long_bag, '--params', params)
        steps = [line.split(',') for line in (report / 'steps.csv').read_text().splitlines()]
        statuses = collections.Counter(row[steps[0].index('status')] for row in steps[1:])
        self.assertEqual(statuses, {'FIRST_FRAME': 1, 'OK': frames - 2, 'GAP': 1})

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
        for name, count in (('contacts', frames), ('first_contact', frames), ('clear', frames), ('stats', frames),
                            ('markers', frames), ('predicted_contacts', frames - 1), ('time_to_contact', frames - 1)):
            self.assertEqual(len(by_topic[OWN + name]), count, name)
        listed = sum(len(array.contacts) for array in by_topic[OWN + 'contacts'])
        self.assertEqual(listed, (self.plain / 'contacts.csv').read_text().count('\n') - 1)
        drawn = by_topic[OWN + 'markers'][-1].markers
        self.assertEqual(drawn[0].action, drawn[0].DELETEALL)
        points = {marker.ns: len(marker.points) for marker in drawn[1:]}
        self.assertLessEqual({'mesh/mesh', 'obstacle', 'contacts', 'initial', 'normals', 'voxels'}, set(points))
        self.assertGreater(points['obstacle'], points['voxels'])
        self.assertEqual(points['normals'], 2 * points['contacts'])


if __name__ == '__main__':
    unittest.main()
