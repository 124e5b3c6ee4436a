"""The storm: worlds from seeds are answered by analyze_bag and judged by audit_bag. What is refuted is of a kind that expected.txt names, or the
test fails. A tenth of the worlds is tame, and there all that must be proved is proved. DEFORMABLE_CCD_LONG=1 runs 20,000 worlds, and goes on
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
WORLDS = int(os.environ.get('DEFORMABLE_CCD_STORM_WORLDS', 20000 if LONG else 300))


def known():
    """Kind by kind a seed that shows it."""
    rows = [line.split(' ', 1) for line in (HERE / 'expected.txt').read_text().splitlines() if line and line[0] != '#']
    return {kind: int(seed) for seed, kind in rows}


class StormTest(unittest.TestCase):
    def run_worlds(self, ranges, folder):
        logs = [folder / ('%d.log' % first) for first, _ in ranges]
        running = [subprocess.Popen([sys.executable, '-W', 'ignore', str(HERE / 'storm.py'), '--from', str(first), '--worlds', str(count),
                                     '--log', str(log)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
                   for (first, count), log in zip(ranges, logs)]
        for one in running:
            said = one.communicate()[0]
            self.assertEqual(one.returncode, 0, said[-3000:])
        return [json.loads(line) for log in logs for line in log.read_text().splitlines()]

    def test_worlds(self):
        with tempfile.TemporaryDirectory() as temporary:
            folder = HERE.parents[1] / 'build/storm' if LONG else pathlib.Path(temporary)
            folder.mkdir(parents=True, exist_ok=True)
            half = WORLDS // 2
            rows = self.run_worlds([(1, half), (half + 1, WORLDS - half)], folder)
        self.assertEqual(len(rows), WORLDS)
        self.assertEqual([row['seed'] for row in rows if row['problem']], [], 'analyze_bag failed')
        news = sorted({(kind, row['seed']) for row in rows for kind in row['kinds']} - {(kind, row['seed']) for row in rows
                                                                                     for kind in row['kinds'] if kind in known()})
        self.assertEqual(news, [], 'kinds of refutation that expected.txt does not name')
        tame = [row for row in rows if row['tame']]
        self.assertEqual([row['seed'] for row in tame if row['statuses'].get('not') or not row['statuses'].get('proved')], [],
                         'tame worlds in which something is not proved')
        proved = sum(row['statuses'].get('proved', 0) for row in rows)
        self.assertGreater(proved, 3 * WORLDS, 'too little is proved to mean anything')
        judged = sum(len(row['not_covered']) for row in rows)
        self.assertLess(judged, 0.02 * sum(row['held'] for row in rows), 'a judge that does not know')

    def test_what_is_expected_is_still_refuted(self):
        with tempfile.TemporaryDirectory() as temporary:
            seeds = sorted(set(known().values()))
            rows = [row for seed in seeds for row in self.run_worlds([(seed, 1)], pathlib.Path(temporary))]
        shown = {kind for row in rows for kind in row['kinds']}
        self.assertEqual(sorted(set(known()) - shown), [], 'mended: take these kinds out of expected.txt')


if __name__ == '__main__':
    unittest.main()
