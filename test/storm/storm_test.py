"""The storm: worlds from seeds are answered by analyze_bag and judged by audit_bag. What is refuted is of a kind that expected.txt names, or the
test fails. A tenth of the worlds is tame, and there all that must be proved is proved. Of one in twenty the live node is asked. DEFORMABLE_CCD_LONG=1 runs 20,000 worlds, and goes on
from its log (build/storm.log) where it was ended."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
LONG = os.environ.get('DEFORMABLE_CCD_LONG')
LIVE = 10 ** 6  # the first of their seeds
WORLDS = int(os.environ.get('DEFORMABLE_CCD_STORM_WORLDS', 20000 if LONG else 300))


def known():
    """Pairs of a seed, or a case, and the kind of refutation that it shows."""
    return [tuple(line.split(' ', 1)) for line in (HERE / 'expected.txt').read_text().splitlines() if line and line[0] != '#']


class StormTest(unittest.TestCase):
    maxDiff = None

    def run_storm(self, folder, *calls):
        """Each call with a log of its own, at the same time."""
        logs = [folder / ('%d.log' % number) for number in range(len(calls))]
        running = [subprocess.Popen([sys.executable, '-W', 'ignore', str(HERE / 'storm.py'), '--log', str(log), *map(str, call)],
                                    stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) for call, log in zip(calls, logs)]
        for one in running:
            said = one.communicate()[0]
            self.assertEqual(one.returncode, 0, said[-3000:])
        return [json.loads(line) for log in logs for line in log.read_text().splitlines()]

    def test_worlds(self):
        with tempfile.TemporaryDirectory() as temporary:
            folder = HERE.parents[1] / 'build/storm' if LONG else pathlib.Path(temporary)
            folder.mkdir(parents=True, exist_ok=True)
            half = WORLDS // 2
            rows = self.run_storm(folder, ('--from', 1, '--worlds', half), ('--from', half + 1, '--worlds', WORLDS - half),
                                  ('--from', LIVE, '--worlds', WORLDS // 20, '--live'))
        live = [row for row in rows if row['seed'] >= LIVE]
        self.assertEqual((len(rows), len(live)), (WORLDS + WORLDS // 20, WORLDS // 20))
        self.assertEqual([(row['seed'], row['problem']) for row in rows if row['problem']], [], 'no answers')
        self.assertGreater(sum(row['statuses'].get('proved', 0) for row in live), 3 * len(live), 'too little is proved to mean anything')
        kinds = {kind for _, kind in known()}
        news = sorted((kind, row['seed']) for row in rows for kind in row['kinds'] if kind not in kinds)
        self.assertEqual(news, [], 'kinds of refutation that expected.txt does not name')
        tame = [row for row in rows if row['tame'] and row not in live]  # a live one has states before its first step
        self.assertEqual([row['seed'] for row in tame if row['statuses'].get('not') or not row['statuses'].get('proved')], [],
                         'tame worlds in which something is not proved')
        proved = sum(row['statuses'].get('proved', 0) for row in rows)
        self.assertGreater(proved, 3 * WORLDS, 'too little is proved to mean anything')
        known_best = sorted(rows, key=lambda row: len(row['not_covered']))[:len(rows) * 95 // 100]
        unknown = sum(len(row['not_covered']) for row in known_best)
        self.assertLess(unknown, 0.02 * sum(row['held'] for row in known_best), 'a judge that does not know')

    def test_what_is_expected_is_still_refuted(self):
        seeds = sorted({int(seed) for seed, _ in known() if seed.isdigit()})
        with tempfile.TemporaryDirectory() as folder:
            rows = self.run_storm(pathlib.Path(folder), ['--cases'], *(['--from', seed, '--worlds', 1] for seed in seeds))
        shown = {(str(row['seed']), kind) for row in rows for kind in row['kinds']}
        self.assertEqual(sorted(set(known()) - shown), [], 'mended: take these out of expected.txt')
        self.assertEqual([(row['seed'], row['statuses']) for row in rows if str(row['seed']).startswith('all_proved_') and (
            row['statuses'].get('not', 0) > 2 or row['statuses'].get('proved', 0) < 19)], [], 'what was proved is not')
        of_cases = {(seed, kind) for seed, kind in shown if not seed.isdigit()}
        self.assertEqual(sorted(of_cases - set(known())), [], 'refutations that expected.txt does not name')


if __name__ == '__main__':
    unittest.main()
