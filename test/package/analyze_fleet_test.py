"""analyze_fleet: many bags come to one database and page, whatever happens to the jobs."""
import contextlib
import csv
import html
import os
import pathlib
import re
import shutil
import signal
import sqlite3
import subprocess
import tempfile
import time
import unittest

import genpy
from tf2_msgs.msg import TFMessage

from bag_messages import messages_of, transform, write_bag
from checkout import CHECKOUT, TOOLS, FolderTestCase, run
from fleet_support import TABLES, fleet, make_scene, rows_of

FLEET = CHECKOUT / 'fleet'


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
        cls.ran = fleet(cls.first, cls.second, cls.corrupt, '--params', cls.params, '--out', cls.out, '--cores', 2)

    def test_what_comes_out(self):
        self.assertEqual(self.ran.returncode, 4, self.ran.stderr)
        self.assertRegex(self.ran.stderr, r'(?m)^analyze_fleet: corrupt: .*cut or damaged')
        self.assertRegex(self.ran.stderr, r'\d+ of \d+ jobs, about \d+:\d\d:\d\d left')
        states = dict(rows_of(self.out, 'SELECT name, state FROM recordings'))
        self.assertEqual(set(states), {'first', 'second', 'corrupt'})
        self.assertEqual(states['corrupt'], 'failed')
        for name, bag in (('first', self.first), ('second', self.second)):
            whole = self.folder / ('whole_' + name)
            run(TOOLS / 'analyze_bag', bag, '--report', whole, '--quiet', '--params', self.params)
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
        self.assertIn(rows_of(self.out, "SELECT said FROM recordings WHERE name = 'corrupt'")[0][0], html.unescape(page))
        self.assertNotIn('http', page.replace('<!doctype html>', ''), 'it loads nothing')
        self.assertFalse(list(self.out.glob('**/*.part')))

    def test_pieces_of_one_recording_are_one(self):
        messages, out = messages_of(self.first), self.folder / 'pieces_out'
        half = len(messages) // 2
        pieces = [write_bag(self.folder / ('cut_2026-01-31-12-00-0%d_%d.bag' % (k, k)), part)
                  for k, part in enumerate((messages[:half], messages[half:]))]
        ran = fleet(pieces[1], self.second, pieces[0], '--params', self.params, '--out', out)
        self.assertIn(ran.returncode, (0, 3), ran.stderr)
        self.assertEqual(rows_of(out, 'SELECT name, bag FROM recordings ORDER BY name'),
                         [('cut_2026-01-31-12-00-00', '\n'.join(map(str, pieces))), ('second', str(self.second))])
        for table in TABLES:
            self.assertEqual((out / 'recordings/cut_2026-01-31-12-00-00/report' / table).read_bytes(),
                             (self.out / 'recordings/first/report' / table).read_bytes(), table)
        self.assertEqual(rows_of(out, "SELECT bag_bytes FROM recordings WHERE name LIKE 'cut%'"),
                         [(sum(piece.stat().st_size for piece in pieces),)])
        alone = fleet(pieces[1], '--params', self.params, '--out', self.folder / 'alone_out')
        self.assertEqual(rows_of(self.folder / 'alone_out', 'SELECT name FROM recordings'), [(pieces[1].stem,)])
        self.assertEqual(alone.returncode, 3, 'the map is in the first')

    def test_again_and_with_changes(self):
        def stamps():
            return {p: p.stat().st_mtime_ns for p in self.out.glob('recordings/*/**/re*.json')}
        same = [self.first, self.second, self.corrupt, '--out', self.out, '--cores', 2, '--params']
        before = stamps()
        self.assertEqual(len(before), 5, 'three results, and the reports of two')
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
            self.params.write_text(text + '\nqueue_size: 9\n')
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
        # As if the system had ended the worker of the second bag.
        wrapper = self.wrapped('bin', '[[ $1 != */second.bag || -e %s ]] || kill -KILL $$' % (self.folder / 'healed'))
        words = ['/usr/bin/python3', wrapper, self.first, self.second, '--params', self.params, '--out', out, '--cores', 2]
        ran = run(*words)
        self.assertEqual(ran.returncode, 4, ran.stderr)
        self.assertRegex(ran.stderr, r'(?m)^analyze_fleet: second: is missing$')
        self.assertEqual(rows_of(out, "SELECT state FROM recordings WHERE name = 'second'"), [('missing',)])
        kept = (out / 'recordings/first/result.json').stat().st_mtime_ns
        (self.folder / 'healed').touch()
        ran = run(*words)
        self.assertIn(ran.returncode, (0, 3), ran.stderr)
        self.assertEqual((out / 'recordings/first/result.json').stat().st_mtime_ns, kept, 'it goes on where it was')
        for table in TABLES:
            self.assertEqual((out / 'recordings/second/report' / table).read_bytes(),
                             (self.out / 'recordings/second/report' / table).read_bytes(), table)

    def test_stopped_and_started_again(self):
        """By a signal that asks, and by one that does not: what was done stays done."""
        out = self.folder / 'stopped'
        bags = []
        for i in range(8):
            bags.append(self.folder / ('copy_%d.bag' % i))
            shutil.copy(str(self.first), str(bags[-1]))
        words = [str(w) for w in ('/usr/bin/python3', TOOLS / 'analyze_fleet', *bags, '--params', self.params, '--out', out, '--cores', 1)]
        done = {}
        for number in (signal.SIGTERM, signal.SIGKILL):
            process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True)
            with process:
                self.wait_for_results(out, len(done) + 2)
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
            now = {p: p.stat().st_mtime_ns for p in out.glob('recordings/*/result.json')}
            # What was cut off is taken away by the next call, which may be stopped before it has made it anew.
            self.assertGreaterEqual(sum(now.get(p) == done[p] for p in done), len(done) - 1, 'all but what was cut off')
            done = now
        ran = run(*words)
        self.assertIn(ran.returncode, (0, 3), ran.stderr)
        now = {p: p.stat().st_mtime_ns for p in done}
        self.assertGreaterEqual(sum(now[p] == done[p] for p in done), len(done) - 1, 'all but what was cut off')
        for table in TABLES:
            for bag in bags:
                self.assertEqual((out / 'recordings' / bag.stem / 'report' / table).read_bytes(),
                                 (self.out / 'recordings/first/report' / table).read_bytes(), table)

    @staticmethod
    def wait_for_results(out, count):
        end = time.time() + 120
        while len(list(out.glob('recordings/*/result.json'))) < count:
            assert time.time() < end
            time.sleep(0.02)

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
                ([self.first], ['--cores', '0'], '--threads, --cores and --jobs must be 1 or more'),
                ([self.first], ['--out', full / 'thesis.txt'], 'thesis.txt is no folder'),
                ([self.first], ['--out', full], 'holds no fleet')):
            out = self.folder / 'bad'
            ran = fleet(*bags, '--out', out, *words)
            self.assertEqual(ran.returncode, 1, ran.stderr)
            self.assertRegex(ran.stderr, r'(?m)^analyze_fleet: .*%s' % said)
            self.assertFalse(out.exists())
        self.assertEqual([p.name for p in full.iterdir()], ['thesis.txt'])
        without = write_bag(self.folder / 'without.bag', [('/tf', TFMessage([transform('tool')]), genpy.Time(1))])
        frames = [message for message in messages_of(self.first) if message[0] == '/cloth'][:12]
        for _, message, _ in frames[6:]:
            message.triangles = message.triangles[:-1]
        changes = write_bag(self.folder / 'changes.bag', frames)
        ran = fleet(without, changes, '--params', self.params, '--out', self.folder / 'odd')
        self.assertEqual(ran.returncode, 4)
        self.assertRegex(ran.stderr, r'without: .*no topic /cloth; the bag has /tf')
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

    def test_the_page_says_how_to_compare_results(self):
        one, masked, params = (self.folder / name for name in ('one', 'masked', 'compared.yaml'))
        fleet(self.first, '--params', self.params, '--out', one)
        text = self.params.read_text().replace('{topic: /cloth}', '{topic: /cloth, vertex_mask: %s}' % list(range(0, 1089, 2)))
        self.assertIn('vertex_mask', text)
        params.write_text(text)
        fleet(self.first, '--params', params, '--out', masked)
        attach, query = re.search(r'(ATTACH [^;]*);\n(SELECT [^;]*);', (CHECKOUT / 'doc/fleet.md').read_text()).groups()
        for other, names in ((one, []), (masked, ['first'])):
            with contextlib.closing(sqlite3.connect(one / 'fleet.sqlite')) as database:
                database.execute(attach.replace('OTHER_RESULTS', str(other)))
                self.assertEqual([row[0] for row in database.execute(query)], names)


if __name__ == '__main__':
    unittest.main()
