"""analyze_fleet: ranges of a bag come to the bytes of one run, and many bags to one database and page, whatever happens to the
jobs."""
import collections
import copy
import csv
import json
import os
import pathlib
import shutil
import signal
import socket
import sqlite3
import subprocess
import tempfile
import time
import unittest

import genpy
import rosbag
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from checkout import CHECKOUT, TOOLS, FolderTestCase

TABLES = ('contacts.csv', 'steps.csv', 'patches.csv', 'events.csv')
LONG = bool(os.environ.get('DEFORMABLE_CCD_LONG'))
FLEET = CHECKOUT / 'fleet'


def run(*words, environment=None):
    return subprocess.run([str(word) for word in words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False,
                          env=environment)


def messages_of(path):
    with rosbag.Bag(str(path)) as bag:
        return list(bag.read_messages())


def make_scene(folder, name, scene, *words):
    """Bag and parameters."""
    bag, params = folder / (name + '.bag'), folder / (name + '.yaml')
    ran = run(TOOLS / 'make_scene_bag', CHECKOUT / 'config/scenes' / (scene + '.yaml'), bag, '--quiet', '--monitor-config', params, *words)
    assert ran.returncode == 0, ran.stderr
    return bag, params


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
        """Of the whole: tables, and all of the report but milliseconds."""
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
        (ranges[1] / 'range.cbor').unlink()
        ran = run(TOOLS / 'analyze_bag', self.bag, '--report', self.folder / 'no', '--merge', *ranges, '--params', self.params)
        self.assertIn('it is no finished range', ran.stderr)
        for words in (['--from', '2', '--to', '1'], ['--from', '1', '-o', self.folder / 'o.bag'], ['--to', '1', '--merge', ranges[0]]):
            self.assertEqual(run(TOOLS / 'analyze_bag', self.bag, '--report', self.folder / 'no', *words).returncode, 1, words)


def fleet(*words, environment=None):
    # By the Python that ROS is installed for, whatever stands first in PATH.
    return run('/usr/bin/python3', TOOLS / 'analyze_fleet', *words, environment=environment)


def rows_of(out, query):
    with sqlite3.connect(str(out / 'fleet.sqlite')) as database:
        return database.execute(query).fetchall()


class FleetTest(FolderTestCase):
    """On the cores of this machine."""

    @classmethod
    def setUpClass(cls):
        if shutil.which('snakemake') is None:
            raise unittest.SkipTest('no snakemake; apt install snakemake')
        super().setUpClass()
        cls.first, cls.params = make_scene(cls.folder, 'first', 'table_edge', '--frames', 40)
        cls.second, _ = make_scene(cls.folder, 'second', 'table_edge', '--frames', 30, '--seed', 2)
        cls.corrupt = cls.folder / 'corrupt.bag'
        cls.corrupt.write_bytes(cls.first.read_bytes()[:20000])
        cls.out = cls.folder / 'results'
        cls.ran = fleet(cls.first, cls.second, cls.corrupt, '--params', cls.params, '--out', cls.out, '--chunk', '0.4', '--cores', 2)

    def test_what_comes_out(self):
        self.assertEqual(self.ran.returncode, 4, self.ran.stderr)
        self.assertRegex(self.ran.stderr, r'(?m)^analyze_fleet: corrupt: all: analyze_bag: .*read')
        self.assertRegex(self.ran.stderr, r'\d+ of \d+ jobs, about \d+:\d\d:\d\d left')
        states = dict(rows_of(self.out, 'SELECT name, state FROM recordings'))
        self.assertEqual(set(states), {'first', 'second', 'corrupt'})
        self.assertEqual(states['corrupt'], 'failed')
        self.assertGreater(rows_of(self.out, "SELECT ranges FROM recordings WHERE name = 'first'")[0][0], 2)
        for name, bag in (('first', self.first), ('second', self.second)):
            whole = self.folder / ('whole_' + name)
            run(TOOLS / 'analyze_bag', bag, '--report', whole, '--no-accuracy-table', '--quiet', '--params', self.params)
            for table in TABLES:
                self.assertEqual((self.out / 'recordings' / name / 'report' / table).read_bytes(), (whole / table).read_bytes(), table)
            events = list(csv.DictReader((whole / 'events.csv').read_text().splitlines()))
            self.assertEqual(rows_of(self.out, "SELECT count(*) FROM events WHERE recording = '%s'" % name)[0][0], len(events))
            new = [float(e['earliest_s']) for e in events if (e['event'], e['beginning'], e['expected']) == ('BEGAN', 'NEW', '0')]
            self.assertEqual(rows_of(self.out, "SELECT first_new_contact_s FROM recordings WHERE name = '%s'" % name)[0][0], min(new))
            steps = list(csv.DictReader((whole / 'steps.csv').read_text().splitlines()))
            durations = {s['step']: int(s['stamp_ns']) - int(s['start_ns']) for s in steps}
            touched = {p['step'] for p in csv.DictReader((whole / 'patches.csv').read_text().splitlines())
                       if p['body_1'] == 'octomap'}
            self.assertAlmostEqual(
                rows_of(self.out, "SELECT in_contact_s FROM partners WHERE recording = '%s' AND body_1 = 'octomap'" % name)[0][0],
                sum(durations[s] for s in touched) * 1e-9, places=9)
        self.assertEqual(rows_of(self.out, "SELECT version FROM versions WHERE component = 'snakemake'"),
                         [(run('snakemake', '--version').stdout.strip(),)])
        page = (self.out / 'index.html').read_text()
        self.assertIn('recordings/first/report/report.html', page)
        self.assertNotIn('http', page.replace('<!doctype html>', ''), 'it loads nothing')
        self.assertFalse(list(self.out.glob('**/*.part')))

    def test_again_and_with_changes(self):
        def stamps():
            return {p: p.stat().st_mtime_ns for p in self.out.glob('recordings/*/**/re*.json')}
        same = [self.first, self.second, self.corrupt, '--out', self.out, '--chunk', '0.4', '--cores', 2, '--params']
        before = stamps()
        self.assertGreater(len(before), 5)
        self.assertEqual(fleet(*same, self.params).returncode, 4)
        self.assertEqual(stamps(), before, 'nothing is computed twice')
        other = self.folder / 'other.yaml'
        other.write_text(self.params.read_text())
        refused = fleet(*same, other)
        self.assertEqual(refused.returncode, 1)
        self.assertIn('holds results of another configuration', refused.stderr)
        self.assertEqual(stamps(), before)

        # One bag changed: its jobs alone. Then the parameters' text: everything.
        text, bag = self.params.read_text(), self.second.read_bytes()
        try:
            make_scene(self.folder, 'second', 'table_edge', '--frames', 25, '--seed', 3)
            self.params.write_text(text)
            self.assertEqual(fleet(*same, self.params).returncode, 4)
            changed = {p for p, stamp in stamps().items() if before.get(p) != stamp}
            self.assertTrue(changed)
            self.assertEqual({p.relative_to(self.out).parts[1] for p in changed}, {'second'})
            between = stamps()
            self.params.write_text(text + '\npatch_gap_s: 0.0\n')
            self.assertEqual(fleet(*same, self.params).returncode, 4)
            self.assertTrue(all(between.get(p) != stamp for p, stamp in stamps().items()))
        finally:
            self.second.write_bytes(bag)
            self.params.write_text(text)
            fleet(*same, self.params)  # the other tests look at these results

    def wrapped(self, name, script):
        """An analyze_fleet that has a line of a script run before each analyze_bag."""
        folder = self.folder / name
        folder.mkdir()
        shutil.copy(str(FLEET / 'analyze_fleet'), str(folder / 'analyze_fleet'))
        for file in ('Snakefile', 'profile', 'fleet_job.py', 'fleet_tables.py', 'fleet_database.py', 'page.html', 'progress.py'):
            (folder / file).symlink_to(FLEET / file)
        (folder / 'analyze_bag').write_text('#!/bin/bash\n%s\nexec %s "$@"\n' % (script, TOOLS / 'analyze_bag'))
        (folder / 'analyze_bag').chmod(0o755)
        return folder / 'analyze_fleet'

    def test_a_worker_that_is_killed(self):
        out = self.folder / 'killed'
        # As if the system had ended the worker of the second range.
        wrapper = self.wrapped('bin', '[[ " $* " != *" --from 0."[1-9]* || -e %s ]] || kill -KILL $$' % (self.folder / 'healed'))
        words = ['/usr/bin/python3', wrapper, self.first, '--params', self.params, '--out', out, '--cores', 2,
                 '--chunk', self.half_length()]
        ran = run(*words)
        self.assertEqual(ran.returncode, 4, ran.stderr)
        self.assertRegex(ran.stderr, r'(?m)^analyze_fleet: first: from .* s to .*: is missing$')
        self.assertEqual(rows_of(out, 'SELECT state FROM recordings'), [('partial',)])
        kept = (out / 'recordings/first/ranges' / self.first_range(out) / 'record.json').stat().st_mtime_ns
        contacts = (out / 'recordings/first/report/contacts.csv').read_bytes()
        (self.folder / 'healed').touch()
        ran = run(*words)
        self.assertNotEqual(ran.returncode, 4, ran.stderr)
        self.assertEqual((out / 'recordings/first/ranges' / self.first_range(out) / 'record.json').stat().st_mtime_ns, kept, 'it goes on where it was')
        self.assertGreater(len((out / 'recordings/first/report/contacts.csv').read_bytes()), len(contacts))
        self.assertEqual((out / 'recordings/first/report/patches.csv').read_bytes(),
                         (self.out / 'recordings/first/report/patches.csv').read_bytes())

    def test_stopped_and_started_again(self):
        """By a signal that asks, and by one that does not: what was done stays done."""
        out = self.folder / 'stopped'
        words = ['/usr/bin/python3', str(TOOLS / 'analyze_fleet'), str(self.first), str(self.second), '--params', str(self.params),
                 '--out', str(out), '--chunk', '0.1', '--cores', '1']
        done = {}
        for number in (signal.SIGTERM, signal.SIGKILL):
            process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True)
            with process:
                self.wait_for_records(out, len(done) + 2)
                second = run(*words)
                self.assertEqual((second.returncode, 'is being computed by another' in second.stderr), (1, True), second.stderr)
                if number == signal.SIGKILL:
                    os.killpg(process.pid, number)
                else:
                    process.send_signal(number)
                said = process.stderr.read()
            if number == signal.SIGTERM:
                self.assertEqual(process.returncode, 1)
                self.assertIn('stopped; the same command goes on where it was', said)
            now = {p: p.stat().st_mtime_ns for p in out.glob('recordings/*/ranges/*/record.json')}
            self.assertGreaterEqual(sum(now[p] == done[p] for p in done), len(done) - 1, 'all but what was cut off')
            done = now
        ran = run(*words)
        self.assertIn(ran.returncode, (0, 3), ran.stderr)
        now = {p: p.stat().st_mtime_ns for p in done}
        self.assertGreaterEqual(sum(now[p] == done[p] for p in done), len(done) - 1, 'all but what was cut off')
        for table in TABLES:
            self.assertEqual((out / 'recordings/first/report' / table).read_bytes(),
                             (self.out / 'recordings/first/report' / table).read_bytes(), table)

    @staticmethod
    def wait_for_records(out, count):
        end = time.time() + 120
        while len(list(out.glob('recordings/*/ranges/*/record.json'))) < count:
            assert time.time() < end
            time.sleep(0.02)

    @staticmethod
    def first_range(out):
        return next(p.name for p in (out / 'recordings/first/ranges').iterdir() if p.name.startswith('0-'))

    def half_length(self):
        with rosbag.Bag(str(self.first)) as bag:
            return repr(round((bag.get_end_time() - bag.get_start_time()) / 2 + 1e-3, 3))

    def test_bad_input(self):
        active = self.folder / 'now.bag.active'
        active.touch()
        inside = self.folder / 'inside'
        inside.mkdir()
        shutil.copy(str(self.first), str(inside / 'first.bag'))
        braces, link = self.folder / '{a}.bag', self.folder / 'link.bag'
        shutil.copy(str(self.first), str(braces))
        link.symlink_to(self.first)
        full = self.folder / 'full'
        full.mkdir()
        (full / 'thesis.txt').write_text('mine')
        for bags, words, said in (
                ([], [], 'no bags'),
                ([self.first, self.first], [], 'first.bag is given twice'),
                ([self.first, inside / 'first.bag'], [], 'have one name'),
                ([active], [], 'is still being written'),
                ([self.folder / 'none.bag'], [], 'none.bag cannot be read: no such file'),
                ([braces], [], 'braces in a path'),
                ([self.first, link], [], 'link.bag is the same bag as .*first.bag'),
                ([self.folder], [], 'is no file'),
                ([self.first], ['--params', self.folder / 'none.yaml'], 'none.yaml cannot be read'),
                ([self.first], ['--chunk', '-1'], '--chunk must be above 0'),
                ([self.first], ['--cores', '0'], '--threads, --cores and --jobs must be 1 or more'),
                ([self.first], ['--out', full / 'thesis.txt'], 'thesis.txt is no folder'),
                ([self.first], ['--out', full], 'holds no fleet')):
            out = self.folder / 'bad'
            ran = fleet(*bags, '--out', out, *words)
            self.assertEqual(ran.returncode, 1, ran.stderr)
            self.assertRegex(ran.stderr, r'(?m)^analyze_fleet: .*%s' % said)
            self.assertFalse(out.exists())
        self.assertEqual([p.name for p in full.iterdir()], ['thesis.txt'])
        without = self.folder / 'without.bag'
        with rosbag.Bag(str(without), 'w') as bag:
            bag.write('/tf', TFMessage([TransformStamped()]), genpy.Time(1))
        changes = self.folder / 'changes.bag'
        frames = [m for m in messages_of(self.first) if m[0] == '/cloth']
        with rosbag.Bag(str(changes), 'w') as bag:
            for i, (topic, message, at) in enumerate(frames[:12]):
                if i >= 6:
                    message = copy.deepcopy(message)
                    message.triangles = message.triangles[:-1]
                bag.write(topic, message, at)
        ran = fleet(without, changes, '--params', self.params, '--out', self.folder / 'odd')
        self.assertEqual(ran.returncode, 4)
        self.assertRegex(ran.stderr, r'without: all: .*no topic /cloth; the bag has /tf')
        self.assertRegex(ran.stderr, r'changes: the mesh has another topology from frame 7 on')

    def test_bags_that_may_not_be_read(self):
        """By somebody who is not root, whom nothing is closed to."""
        place = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, place, True)
        place.chmod(0o755)
        other = {'user': 65534, 'group': 65534} if os.getuid() == 0 else {}
        if subprocess.run(['test', '-r', str(TOOLS / 'analyze_fleet')], check=False, **other).returncode != 0:
            self.skipTest('nobody but root may read %s' % TOOLS)
        closed, folder = place / 'closed.bag', place / 'folder'
        shutil.copy(str(self.first), str(closed))
        closed.chmod(0)
        folder.mkdir()
        folder.chmod(0)
        for bag in (closed, folder / 'inside.bag'):
            ran = subprocess.run(['/usr/bin/python3', str(TOOLS / 'analyze_fleet'), str(bag), '--out', str(place / 'out')],
                                 stderr=subprocess.PIPE, text=True, check=False, **other)
            self.assertEqual((ran.returncode, ran.stderr),
                             (1, 'analyze_fleet: %s cannot be read: permission denied\n' % bag))

    def test_without_or_with_an_old_snakemake(self):
        path = self.folder / 'path'
        path.mkdir()
        environment = {**os.environ, 'PATH': str(path)}
        ran = fleet(self.first, '--out', self.folder / 'none', environment=environment)
        self.assertIn('no snakemake', ran.stderr)
        (path / 'snakemake').write_text('#!/bin/sh\necho 5.24.1\n')
        (path / 'snakemake').chmod(0o755)
        ran = fleet(self.first, '--out', self.folder / 'none', '--slurm', environment=environment)
        self.assertEqual(ran.returncode, 1)
        self.assertIn('--slurm needs snakemake 7.19 or newer, and this is 5.24.1', ran.stderr)

    def test_no_space_left(self):
        """Before anything is computed, and in the middle of it, when there are good results already."""
        if os.getuid() != 0 or run('unshare', '--mount', 'true').returncode != 0:
            self.skipTest('a small file system needs root')
        small, bag, full = self.folder / 'small', self.folder / 'copy.bag', self.folder / 'is_full'
        small.mkdir()
        shutil.copy(str(self.first), str(bag))
        wrapper = self.wrapped('filled', '[[ ! -e %s ]] || cat /dev/zero >%s/zeros 2>/dev/null' % (full, small))
        script = '''
            compute() { /usr/bin/python3 %s %s --params %s --out out >/dev/null 2>said; echo $? $(grep -c 'no space left on the disk of' said); }
            results() { sha256sum out/index.html out/fleet.sqlite out/recordings/copy/report/* | sha256sum; }
            mount -t tmpfs -o size=1m tmpfs %s && cd %s && compute
            mount -o remount,size=80m . && compute && results
            touch %s %s && compute && results
            rm zeros %s && compute''' % (wrapper, bag, self.params, small, small, full, bag, full)
        ran = run('unshare', '--mount', 'bash', '-c', script)
        tight, good, before, filled, after, again = ran.stdout.splitlines()
        self.assertEqual((tight, filled), ('1 1', '1 1'), ran.stderr)
        self.assertEqual((good, again), ('0 0', '0 0'))
        self.assertEqual(before, after, 'nothing good is overwritten')

    def test_comparison(self):
        one, other, params = (self.folder / name for name in ('one', 'two', 'compared.yaml'))
        for out, gap in ((one, '0.25'), (other, '0.0')):
            params.write_text(self.params.read_text() + '\npatch_gap_s: %s\n' % gap)
            fleet(self.first, '--params', params, '--out', out)
        same = fleet('--compare', one, '--out', one)
        self.assertEqual((same.returncode, same.stdout.count('new patch')), (0, 0), same.stdout)
        changed = fleet('--compare', one, '--out', other)
        patches = [rows_of(out, 'SELECT body_0, body_1, first_s, last_s FROM patches') for out in (one, other)]
        self.assertEqual(changed.returncode, 2 if sorted(patches[0]) != sorted(patches[1]) else 0, changed.stdout)
        text = self.params.read_text().replace('{topic: /cloth}', '{topic: /cloth, vertex_mask: %s}' % list(range(0, 1089, 2)))
        self.assertIn('vertex_mask', text)
        params.write_text(text)
        masked = self.folder / 'masked'
        fleet(self.first, '--params', params, '--out', masked)
        changed = fleet('--compare', one, '--out', masked)
        self.assertEqual(changed.returncode, 2, changed.stdout)
        self.assertRegex(changed.stdout, r'first: contacts: \d+ new, [1-9]\d* gone, \d+ moved')
        self.assertIn('1 of 1 recordings changed', (masked / 'compare.html').read_text())
        nothing = fleet('--compare', self.folder / 'nowhere', '--out', one)
        self.assertEqual(nothing.returncode, 1)
        self.assertIn('holds no results of a fleet', nothing.stderr)


SLURM = '''ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
CryptoType=crypto/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=8000 State=UNKNOWN
PartitionName=test Nodes={host} Default=YES State=UP
'''


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for one in sockets:
        one.bind(('127.0.0.1', 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


@unittest.skipUnless(LONG, 'a cluster of its own takes minutes; scripts/test --long')
class SlurmTest(FolderTestCase):
    """On a real Slurm: one node on loopback, without slurmdbd and without USER."""

    @classmethod
    def setUpClass(cls):
        missing = [tool for tool in ('snakemake', 'slurmctld', 'slurmd', 'munged', 'sbatch') if shutil.which(tool) is None]
        if missing:
            raise unittest.SkipTest('no ' + ', '.join(missing))
        if os.getuid() != 0:
            raise unittest.SkipTest('Slurm is started by root')
        super().setUpClass()
        cls.folder.chmod(0o755)
        host = socket.gethostname().split('.')[0]
        (cls.folder / 'munge.key').write_bytes(os.urandom(1024))
        (cls.folder / 'munge.key').chmod(0o400)
        config = cls.folder / 'slurm.conf'
        config.write_text(SLURM.format(host=host, folder=cls.folder, ports=free_ports(2)))
        cls.environment = {k: v for k, v in os.environ.items() if k not in ('USER', 'LOGNAME')}
        cls.environment['SLURM_CONF'] = str(config)
        cls.start('munged', '--foreground', '--force', '--key-file', cls.folder / 'munge.key', '--socket', cls.folder / 'munge.socket',
                  '--pid-file', cls.folder / 'munge.pid', '--log-file', cls.folder / 'munge.log', '--seed-file', cls.folder / 'seed')
        (cls.folder / 'spool').mkdir()
        (cls.folder / 'state').mkdir()
        cls.start('slurmctld', '-D', '-f', config)
        cls.start('slurmd', '-D', '-f', config, '-N', host)
        end = time.time() + 30
        while run('srun', '-t', '1', 'true', environment={**cls.environment, 'SLURM_WAIT': '1'}).returncode != 0:
            if time.time() > end:
                raise unittest.SkipTest('Slurm does not start here: ' + cls.log()[-600:])
            time.sleep(0.5)

    @classmethod
    def start(cls, *words):
        output = open(cls.folder / (words[0] + '.out'), 'w')
        process = subprocess.Popen([str(w) for w in words], env=cls.environment, stdout=output, stderr=subprocess.STDOUT)
        cls.addClassCleanup(output.close)
        cls.addClassCleanup(process.wait)
        cls.addClassCleanup(process.terminate)
        return process

    @classmethod
    def log(cls):
        return '\n'.join(path.read_text(errors='replace') for path in sorted(cls.folder.glob('*.out')))

    def test_twelve_recordings(self):
        """Of two scenes, one of them corrupt, one worker killed in the middle."""
        made = [make_scene(self.folder, 'scene_%d' % i, ('table_edge', 'flag_in_wind')[i % 2], '--frames', 25 + i, '--seed', i)
                for i in range(11)]
        params = self.folder / 'all.yaml'
        params.write_text('max_step_s: 0.5\n')
        corrupt = self.folder / 'corrupt.bag'
        corrupt.write_bytes(made[0][0].read_bytes()[:20000])
        bags = [bag for bag, _ in made] + [corrupt]
        out = self.folder / 'results'
        words = [str(w) for w in ('/usr/bin/python3', TOOLS / 'analyze_fleet', *bags, '--params', params, '--out', out, '--slurm',
                                  '--jobs', 4, '--chunk', '0.5')]
        with open(self.folder / 'fleet.err', 'w+') as said:
            process = subprocess.Popen(words, env=self.environment, stdout=subprocess.DEVNULL, stderr=said)
            killed = self.kill_a_worker(process)
            self.assertEqual(process.wait(timeout=1500), 4)
            said.seek(0)
            text = said.read()
        self.assertTrue(killed)
        self.assertIn('corrupt: all: ', text)
        states = collections.Counter(state for state, in rows_of(out, 'SELECT state FROM recordings'))
        self.assertEqual(sum(states.values()), 12)
        self.assertEqual((states['failed'], states['partial'] + states['missing']), (1, 1), (states, text))
        again = run(*words, environment=self.environment)
        states = collections.Counter(state for state, in rows_of(out, 'SELECT state FROM recordings'))
        self.assertEqual((states['failed'], states['partial'] + states['missing']), (1, 0), (states, again.stderr))
        whole = self.folder / 'whole'
        for bag, _ in made[:3]:
            run(TOOLS / 'analyze_bag', bag, '--report', whole, '--no-accuracy-table', '--quiet', '--params', params)
            for table in TABLES:
                self.assertEqual((out / 'recordings' / bag.stem / 'report' / table).read_bytes(), (whole / table).read_bytes(), table)

    def kill_a_worker(self, process):
        """An analyze_bag that Slurm has started, once some are done."""
        while process.poll() is None:
            if len(list((self.folder / 'results').glob('recordings/*/ranges/*/record.json'))) > 3:
                for pid in filter(str.isdigit, os.listdir('/proc')):
                    try:
                        command = pathlib.Path('/proc', pid, 'cmdline').read_bytes().split(b'\0')
                        if command[0].endswith(b'/analyze_bag') and any(str(self.folder).encode() in word for word in command):
                            os.kill(int(pid), signal.SIGKILL)
                            return True
                    except (OSError, IndexError):
                        continue
            time.sleep(0.002)
        return False


if __name__ == '__main__':
    unittest.main()
