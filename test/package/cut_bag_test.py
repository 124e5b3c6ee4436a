"""Ranges of a bag come to the bytes of one run, wherever it is cut."""
import collections
import copy
import csv
import json
import shutil
import unittest

import genpy
import rosbag
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from checkout import TOOLS, FolderTestCase
from fleet_support import TABLES, make_scene, messages_of, run


def write_harsh(path, messages):
    """The cloth in a camera's frame that moves, transforms that come late, another map, none and one again, a gap in the
    stamps, frames twice and out of turn, and a message that is no mesh."""
    cloths = [(topic, message, at) for topic, message, at in messages if topic == '/cloth']
    octomap = next(message for topic, message, _ in messages if topic == '/octomap_binary')
    n, shift = len(cloths), genpy.Duration(2)
    with rosbag.Bag(str(path), 'w') as bag:
        bag.write('/octomap_binary', octomap, cloths[0][2])
        for i, (topic, message, at) in enumerate(cloths):
            cloth, moving = copy.deepcopy(message), TransformStamped()
            if i >= n // 2:
                at, cloth.header.stamp = at + shift, cloth.header.stamp + shift
            cloth.header.frame_id = 'camera'
            moving.header.stamp, moving.header.frame_id, moving.child_frame_id = cloth.header.stamp, 'world', 'camera'
            moving.transform.rotation.w, moving.transform.translation.x = 1, 1e-4 * i
            bag.write('/tf', TFMessage([moving]), at + genpy.Duration.from_sec(0.35 if i % 5 else 0.0))
            if i == n // 3:
                other = copy.deepcopy(octomap)
                other.header.stamp = cloth.header.stamp
                bag.write('/octomap_binary', other, at)
            if i == n - 9:
                bag.write('/octomap_binary', MarkerArray(), at)
            if i == n - 6:
                bag.write('/octomap_binary', octomap, at)
            if i in (5, n - 4):
                bag.write(topic, cloth, at)
            if i != n // 4:
                bag.write(topic, cloth, at)
    return path


class CutTest(FolderTestCase):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.bag, cls.params = make_scene(cls.folder, 'scene', 'table_edge', '--frames', 60)
        cls.messages = messages_of(cls.bag)
        with rosbag.Bag(str(cls.bag)) as bag:
            cls.start, cls.length = bag.get_start_time(), bag.get_end_time() - bag.get_start_time()

    def analyze(self, bag, name, *words):
        folder = self.folder / name
        shutil.rmtree(folder, True)
        ran = run(TOOLS / 'analyze_bag', bag, '--report', folder, '--no-accuracy-table', '--quiet', *words)
        self.assertIn(ran.returncode, (0, 3), ran.stderr)
        return folder, ran

    def ranges(self, bag, cuts, *words):
        ends = [0.0, *cuts, None]
        return [self.analyze(bag, 'range_%d' % i, '--from', repr(ends[i]), *([] if ends[i + 1] is None else ['--to', repr(ends[i + 1])]),
                             *words)[0] for i in range(len(ends) - 1)]

    def merged(self, bag, ranges, *words):
        return self.analyze(bag, 'merged', '--merge', *ranges, *words)

    def expect_same(self, bag, cuts, *words):
        """Of the whole: tables, and all of the report but milliseconds and what earlier steps saved."""
        whole, once = self.analyze(bag, 'whole', *words)
        merged, joined = self.merged(bag, self.ranges(bag, cuts, *words), *words)
        for table in TABLES:
            self.assertEqual((merged / table).read_bytes(), (whole / table).read_bytes(), '%s, cut at %s' % (table, cuts))
        reports = []
        for folder in (whole, merged):
            report = json.loads((folder / 'report.json').read_text())
            report['facts'] = [fact for fact in report['facts'] if fact[0] not in ('joined from', 'command')]
            for steps in (report['steps'], report['stages'], report['effects']):
                for step in steps:
                    for key in ('ms', 'median_ms', 'p95_ms'):
                        step.pop(key, None)
            for key in ('histogram', 'total'):
                report.pop(key)
            report['step_counters'].pop('map_answers_kept')  # a range knows no more than the step before it
            reports.append(report)
        for key, value in reports[0].items():
            self.assertEqual(reports[1][key], value, '%s, cut at %s' % (key, cuts))
        self.assertEqual((once.returncode, once.stderr), (joined.returncode, joined.stderr))
        return whole

    def even(self, count, length=None):
        return [i * (length or self.length) / count for i in range(1, count)]

    def test_any_number_of_cuts(self):
        for count in (1, 2, 7, 40):
            whole = self.expect_same(self.bag, self.even(count), '--params', self.params, '--look-ahead', '0.1')
        contacts = (whole / 'contacts.csv').read_text().count('\n')
        events = list(csv.DictReader((whole / 'events.csv').read_text().splitlines()))
        self.assertGreater(contacts, 100, 'too little to mean anything')
        self.assertGreater(len(events), 3)
        self.assertGreater(json.loads((whole / 'report.json').read_text())['look_ahead']['compared'], 10)

    def test_in_the_middle_of_a_patch(self):
        """One that began before the cut and ends after it, or lasts, has one identity."""
        whole, _ = self.analyze(self.bag, 'whole', '--params', self.params)
        rows = list(csv.DictReader((whole / 'patches.csv').read_text().splitlines()))
        steps = collections.Counter(row['patch'] for row in rows)
        longest = [int(row['stamp_ns']) for row in rows if row['patch'] == steps.most_common(1)[0][0]]
        self.assertGreater(len(longest), 10)
        at = longest[len(longest) // 2] * 1e-9 - self.start
        self.expect_same(self.bag, [at], '--params', self.params)
        tail = (self.folder / 'range_1/contacts.csv').read_text().count('\n')
        self.assertGreater(tail, 1, 'there is something on the other side')

    def test_maps_transforms_and_seams_across_cuts(self):
        harsh = write_harsh(self.folder / 'harsh.bag', self.messages)
        with rosbag.Bag(str(harsh)) as bag:
            start, length = bag.get_start_time(), bag.get_end_time() - bag.get_start_time()
            times = [at.to_sec() - start for _, _, at in bag.read_messages(['/octomap_binary'], raw=True)]
            clock = [at.to_sec() - start for _, _, at in bag.read_messages(['/cloth'])]
        gap = max(range(1, len(clock)), key=lambda i: clock[i] - clock[i - 1])
        seams = [clock[gap - 1], clock[gap], clock[gap] + 1e-6, (clock[gap] + clock[gap - 1]) / 2]
        world = self.folder / 'world.yaml'
        world.write_text('fixed_frame: world\noctomap_topic: /octomap_binary\n')
        learnt = self.expect_same(harsh, self.even(7, length))
        whole = self.expect_same(harsh, self.even(7, length), '--params', world)
        for folder, expected in ((learnt, {'OK', 'GAP', 'NO_MAP', 'DUPLICATE'}), (whole, {'OK', 'GAP', 'NO_MAP', 'DUPLICATE'})):
            statuses = {row['status'] for row in csv.DictReader((folder / 'steps.csv').read_text().splitlines())}
            self.assertLessEqual(expected, statuses)
        for cuts in [[t] for t in (*times[1:], *seams)] + [sorted({*times[1:], *seams}), self.even(40, length)]:
            self.expect_same(harsh, cuts, '--params', world)

    def test_bodies_that_turn_and_triangle_soups(self):
        for scene, words in (('felt_and_finger', ()), ('rope_through_ring', ()), ('table_edge', ('--output', 'marker'))):
            bag, params = make_scene(self.folder, 'other', scene, '--frames', 40, *words)
            with rosbag.Bag(str(bag)) as opened:
                length = opened.get_end_time() - opened.get_start_time()
            self.expect_same(bag, self.even(7, length), '--params', params)

    def test_a_range_that_is_missing(self):
        ranges = self.ranges(self.bag, self.even(4), '--params', self.params)
        merged, ran = self.merged(self.bag, [ranges[0], ranges[2]], '--params', self.params)
        self.assertEqual(ran.returncode, 3)
        for words in ('the range from %.3f s to %.3f s is missing' % (self.length / 4, self.length / 2),
                      'the range from %.3f s to the end is missing' % (3 * self.length / 4)):
            self.assertIn(words, ran.stderr)
            self.assertIn(words, json.loads((merged / 'report.json').read_text())['headline'])
        whole, _ = self.analyze(self.bag, 'whole', '--params', self.params)
        there = set((merged / 'contacts.csv').read_text().splitlines())
        self.assertLess(there, set((whole / 'contacts.csv').read_text().splitlines()))

    def test_what_does_not_belong_together(self):
        ranges = self.ranges(self.bag, self.even(2), '--params', self.params)
        other, _ = make_scene(self.folder, 'else', 'table_edge', '--frames', 10)
        for bag, words, said in ((other, ['--params', self.params], 'is a range of scene.bag'),
                                 (self.bag, ['--without-map'], 'was computed with other parameters'),
                                 (self.bag, ['--params', self.params, '--merge', ranges[0]], 'holds frames that ')):
            ran = run(TOOLS / 'analyze_bag', bag, '--report', self.folder / 'no', '--merge', *ranges, *words)
            self.assertEqual(ran.returncode, 1, said)
            self.assertIn(said, ran.stderr)
        written = ranges[1] / 'range.cbor'
        whole = written.read_bytes()
        self.assertEqual(whole.count(b'hleft_out\x80'), 1, 'an empty list by that name')
        written.write_bytes(whole.replace(b'hleft_out\x80', b'hleft_out\x81\x83\x05\x00\x84\x00\x01\x02\x03'))
        ran = run(TOOLS / 'analyze_bag', self.bag, '--report', self.folder / 'no', '--merge', *ranges, '--params', self.params)
        self.assertEqual((ran.returncode, ran.stderr), (1, 'analyze_bag: %s: left_out: 5 is no kind of pair\n' % written))
        written.write_bytes(whole)
        table = ranges[1] / 'contacts.csv'
        table.rename(ranges[1] / 'moved.csv')
        ran = run(TOOLS / 'analyze_bag', self.bag, '--report', self.folder / 'no', '--merge', *ranges, '--params', self.params)
        self.assertEqual((ran.returncode, ran.stderr), (1, 'analyze_bag: %s: cannot be opened: No such file or directory\n' % table))
        (ranges[1] / 'range.cbor').unlink()
        ran = run(TOOLS / 'analyze_bag', self.bag, '--report', self.folder / 'no', '--merge', *ranges, '--params', self.params)
        self.assertIn('it is no finished range', ran.stderr)
        for words in (['--from', '2', '--to', '1'], ['--from', '1', '-o', self.folder / 'o.bag'], ['--to', '1', '--merge', ranges[0]]):
            self.assertEqual(run(TOOLS / 'analyze_bag', self.bag, '--report', self.folder / 'no', *words).returncode, 1, words)


if __name__ == '__main__':
    unittest.main()
