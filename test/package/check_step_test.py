"""check_step says "nothing touches" only where that is proved, else why not, and its exit status tells the two apart."""
import json
import math
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

from checkout import CHECKOUT

NOT_PROVED = 3


def tool():
    for prefix in os.environ['CMAKE_PREFIX_PATH'].split(':'):
        path = pathlib.Path(prefix) / 'lib/deformable_ccd/check_step'
        if path.exists():
            return str(path)
    raise AssertionError('check_step was not built')


def write(path, points, faces):
    lines = ['ply', 'format ascii 1.0', 'element vertex %d' % len(points)]
    lines += ['property double ' + axis for axis in 'xyz']
    lines += ['element face %d' % len(faces), 'property list uchar int vertex_indices', 'end_header']
    lines += ['%r %r %r' % point for point in points] + ['3 %d %d %d' % face for face in faces]
    path.write_text('\n'.join(lines) + '\n')


def sheet(z, n=24):
    return [(0.01 * c, 0.01 * r, z) for r in range(n) for c in range(n)]


def faces_of(n=24, first=0):
    faces = []
    for r in range(n - 1):
        for c in range(n - 1):
            a = first + r * n + c
            faces += [(a, a + 1, a + n), (a + 1, a + n + 1, a + n)]
    return faces


class CheckStepTest(unittest.TestCase):
    """Two sheets of 576 vertices; the upper one comes down."""

    FACES = faces_of() + faces_of(first=576)

    def check(self, t0, t1, *flags):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            write(folder / '0.ply', t0, self.FACES)
            write(folder / '1.ply', t1, self.FACES)
            done = subprocess.run([tool(), str(folder / '0.ply'), str(folder / '1.ply'), '--stats', str(folder / 'stats.json'),
                                   *flags], capture_output=True, text=True)
            self.assertEqual(done.stderr, '')
            self.stats = json.loads((folder / 'stats.json').read_text())
        self.said = done.stdout
        return done.returncode

    def test_nothing_touches(self):
        self.assertEqual(self.check(sheet(0) + sheet(0.1), sheet(0) + sheet(0.05)), 0)
        self.assertIn('exact: proved, nothing touches', self.said)
        self.assertTrue(self.stats['proved'])
        self.assertEqual(self.stats['touching'], 'NONE')

    def test_contacts_are_proved_too(self):
        self.assertEqual(self.check(sheet(0) + sheet(0.1), sheet(0) + sheet(-0.1)), 0)
        self.assertIn('exact: proved, something touches anew', self.said)

    def refused(self, words, *arguments):
        self.assertEqual(self.check(*arguments), NOT_PROVED, self.said)
        self.assertIn('not proved', self.said)
        self.assertIn(words, self.said)
        self.assertNotIn('nothing touches', self.said)
        self.assertFalse(self.stats['proved'])
        self.assertTrue(any(words in sentence for sentence in self.stats['missing']))

    def test_a_vertex_that_is_nan(self):
        lost = sheet(0) + sheet(0.05)
        lost[700] = (float('nan'), 0.0, 0.0)
        self.refused('1 vertices are not finite', sheet(0) + sheet(0.1), lost)

    def test_an_edge_through_a_face_at_the_start(self):
        through = [(x, y, 0.3 * (x - 0.111)) for x, y, _ in sheet(0)]
        self.assertEqual(self.check(sheet(0) + through, sheet(0) + through), 0)
        self.assertEqual(self.stats['start_state'], 'INTERSECTING')
        self.assertNotIn('nothing touches', self.said)
        self.refused('at the start was not checked', sheet(0) + through, sheet(0) + through, '--no-start-state')

    def test_a_budget_that_was_cut(self):
        self.refused('the step budget ran out', sheet(0) + sheet(0.1), sheet(0) + sheet(-0.1), '--budget', '0.001')

    def test_fast(self):
        self.refused('accuracy fast', sheet(0) + sheet(0.1), sheet(0) + sheet(0.05), '--accuracy', 'fast')
        self.assertEqual(self.check(sheet(0) + sheet(0.1), sheet(0) + sheet(0.05), '--accuracy', 'all'), 0, 'exact decides')
        self.assertIn('fast: not proved', self.said)

    def obj(self, points, polygons, ends=None):
        """The step of an OBJ from the points to the ends."""
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            for name, at in (('0.obj', points), ('1.obj', ends or points)):
                (folder / name).write_text(''.join('v %r %r %r\n' % p for p in at) +
                                           ''.join('f ' + ' '.join(str(v + 1) for v in polygon) + '\n' for polygon in polygons))
            done = subprocess.run([tool(), str(folder / '0.obj'), str(folder / '1.obj'), '--stats', str(folder / 'stats.json')],
                                  capture_output=True, text=True)
            self.assertEqual(done.stderr, '')
            self.stats = json.loads((folder / 'stats.json').read_text())
        self.said = done.stdout
        return done.returncode

    def test_a_chip_falls_through_the_notch_of_an_l(self):
        outline = [(3, 0), (3, 1), (1, 1), (1, 3), (0, 3), (0, 0)]
        polygons = [(0, 1, 2, 3, 4, 5), (6, 7, 8)]

        def falls(chip):
            return [[(x, y, 0.0) for x, y in outline] + [(x, y, z) for x, y in chip] for z in (1.0, -1.0)]
        start, end = falls([(1.2, 1.2), (1.6, 1.2), (1.2, 1.6)])
        self.assertEqual(self.obj(start, polygons, end), 0)
        self.assertIn('proved, nothing touches', self.said)
        start, end = falls([(0.2, 0.2), (0.6, 0.2), (0.2, 0.6)])
        self.obj(start, polygons, end)
        self.assertIn('something touches anew', self.said)

    def test_a_dart_at_rest_touches_nothing(self):
        self.assertEqual(self.obj([(0, 0, 0), (2, 1, 0), (0, 2, 0), (1.5, 1, 0)], [(0, 1, 2, 3)]), 0)
        self.assertIn('proved, nothing touches', self.said)

    def test_faces_that_cannot_be_used(self):
        square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        self.assertEqual(self.obj(square, [(0, 1, 2), (0, 2, 3), (0, 1, 1)]), 0, 'the edge of a face')
        for face in ((1, 3, 3), (0, 2, 1, 3)):
            self.assertEqual(self.obj(square, [(0, 1, 2), (0, 2, 3), face]), NOT_PROVED)
            self.assertIn('1 faces were sent that cannot be used', self.said)
            self.assertNotIn('nothing touches', self.said)

    def test_errors_are_told_from_what_is_not_proved(self):
        done = subprocess.run([tool(), 'nowhere.ply', 'nowhere.ply'], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertEqual(subprocess.run([tool(), '--no-such-flag'], capture_output=True).returncode, 1)


class SequenceTest(unittest.TestCase):
    """A sheet that is rolled up, turns and is rolled tighter, slowly, then until its layers meet: more than two frames are steps."""

    N = 40
    TIGHTER = (0, 1e-6, 2e-6, 3e-6, 4e-6, 5e-6, 2.4e-3)

    def frame(self, k):
        points = []
        for r in range(self.N):
            for c in range(self.N):
                angle = 10.0 * c / self.N
                radius = 0.2 + (0.002 - self.TIGHTER[k]) * angle + 0.0001 * math.sin(5 * r + 3 * c)
                turned = angle + 0.01 * k
                points.append((radius * math.cos(turned), radius * math.sin(turned), r / self.N))
        return points

    def test_each_step_has_the_answer_that_it_has_alone(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            frames = [str(folder / ('%d.ply' % k)) for k in range(7)]
            for k, path in enumerate(frames):
                write(pathlib.Path(path), self.frame(k), faces_of(self.N))

            def run(frames, *flags):
                done = subprocess.run([tool(), *frames, '--contacts', str(folder / 'out.csv'), '--stats', str(folder / 'out.json'),
                                       *flags], capture_output=True, text=True)
                self.assertEqual(done.stderr, '')
                return (folder / 'out.csv').read_text(), json.loads((folder / 'out.json').read_text())

            kept, stats = run(frames)
            forgot, without = run(frames, '--forget')
            self.assertEqual(kept, forgot)
            self.assertEqual(kept, run(frames, '--threads', '2')[0])
            self.assertGreater(stats['pairs_known_apart'], 0)
            self.assertEqual(without['pairs_known_apart'], 0)
            counters = re.findall(r'  COUNTER\((\w+), ', (CHECKOUT / 'include/dccd/outcome.h').read_text())
            self.assertGreater(len(counters), 10)
            self.assertLessEqual(set(counters), set(stats))
            self.assertEqual(stats['steps'], 6)
            self.assertEqual(set(stats['ms']['total']), {'best', 'median', 'mean'})
            header, *rows = kept.splitlines()
            self.assertEqual(header, 'step,kind,v0,v1,v2,v3,toc_lower,toc_upper,certainty')
            alone = []
            for k in range(6):
                first, *of_step = run(frames[k:k + 2])[0].splitlines()
                self.assertEqual('step,' + first, header)
                alone += ['%d,%s' % (k, row) for row in of_step]
            self.assertEqual(rows, alone)
            self.assertGreater(len(rows), 10)

    def test_a_frame_of_another_mesh_is_named(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            for k in range(3):
                n = self.N if k < 2 else 8
                write(folder / ('%d.ply' % k), self.frame(k) if k < 2 else sheet(0, 8), faces_of(n))
            done = subprocess.run([tool(), *(str(folder / ('%d.ply' % k)) for k in range(3))], capture_output=True, text=True)
            self.assertEqual(done.returncode, 1)
            self.assertIn('2.ply: not the topology of', done.stderr)


if __name__ == '__main__':
    unittest.main()
