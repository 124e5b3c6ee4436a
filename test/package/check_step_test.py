"""check_step says "nothing touches" only where that is proved, else why not, and its exit status tells the two apart."""
import json
import math
import re
import unittest

import numpy as np

from checkout import CHECKOUT, TOOLS, FolderTestCase, run

NOT_PROVED = 3
TOOL = TOOLS / 'check_step'


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


class CheckStepTest(FolderTestCase):
    """Two sheets of 576 vertices; the upper one comes down."""

    FACES = faces_of() + faces_of(first=576)

    def run_on(self, ending, write_frame, frames, *flags):
        """write_frame(path, frame) for each of two frames, then the tool."""
        paths = [self.folder / (name + ending) for name in '01']
        for path, frame in zip(paths, frames):
            write_frame(path, frame)
        stats = self.folder / 'stats.json'
        done = run(TOOL, *paths, '--stats', stats, *flags)
        self.stats = json.loads(stats.read_text())
        self.said, self.remarked = done.stdout, done.stderr
        return done.returncode

    def check(self, t0, t1, *flags):
        status = self.run_on('.ply', lambda path, points: write(path, points, self.FACES), (t0, t1), *flags)
        self.assertEqual(self.remarked, '')
        return status

    def test_nothing_touches(self):
        self.assertEqual(self.check(sheet(0) + sheet(0.1), sheet(0) + sheet(0.05)), 0)
        self.assertIn('exact: proved, nothing touches', self.said)
        self.assertTrue(self.stats['proved'])
        self.assertEqual(self.stats['touching'], 'NONE')

    def test_contacts_are_proved_too(self):
        self.assertEqual(self.check(sheet(0) + sheet(0.1), sheet(0) + sheet(-0.1)), 0)
        self.assertIn('exact: proved, something touches anew', self.said)

    def test_the_order_of_a_shell_is_refused(self):
        for name, z in (('1', 0.3), ('2', 0.2), ('10', 0.1)):
            write(self.folder / (name + '.ply'), sheet(0) + sheet(z), self.FACES)
        one, two, ten = (self.folder / (name + '.ply') for name in ('1', '2', '10'))
        done = run(TOOL, one, ten, two)
        self.assertEqual(done.returncode, 1)
        self.assertIn('10.ply stands before %s: the numbers in the names go neither up nor down' % two, done.stderr)
        for order in ((one, two, ten), (ten, two, one), (one, two, one)):
            self.assertEqual(run(TOOL, *order).returncode, 0, order)

    def test_an_array_is_what_its_frames_are_as_files(self):
        frames = [sheet(0) + sheet(z) for z in (0.3, 0.1, -0.1)]
        files = [self.folder / ('frame_%d.ply' % k) for k in range(3)]
        for file, points in zip(files, frames):
            write(file, points, self.FACES)
        array, tables = self.folder / 'frames.npy', [self.folder / (name + '.csv') for name in ('files', 'array')]
        np.save(array, np.array(frames))
        self.assertEqual(run(TOOL, *files, '--contacts', tables[0]).returncode, 0)
        done = run(TOOL, array, '--topology', files[0], '--contacts', tables[1])
        self.assertEqual((done.returncode, done.stderr), (0, ''))
        self.assertGreater(len(tables[0].read_text().splitlines()), 100, 'too little to mean anything')
        self.assertEqual(tables[0].read_text(), tables[1].read_text())
        lost = np.array(frames)
        lost[1, 700] = np.nan
        np.save(array, lost)
        self.assertEqual(run(TOOL, array, '--topology', files[0]).returncode, NOT_PROVED)
        one, few = self.folder / 'one.npy', self.folder / 'few.npy'
        np.save(one, np.array(frames[0]))
        np.save(few, np.zeros((2, 5, 3)))
        for words, said in (([array], 'an array has no faces; name a mesh file of these vertices by --topology'),
                            ([one, '--topology', files[0]], 'one.npy: is one frame; a step needs two'),
                            ([few, '--topology', files[0]], 'few.npy: has 5 vertices, and .*frame_0.ply has 1152'),
                            ([*files, '--topology', files[0]], 'frame_0.ply: is no .npy')):
            done = run(TOOL, *words)
            self.assertEqual(done.returncode, 1)
            self.assertRegex(done.stderr, said)
        self.assertEqual(run(TOOL, one, one, '--topology', files[0]).returncode, 0, 'frames one by one')

    def test_a_rope_has_no_faces_to_tell_of(self):
        ropes = [self.folder / (name + '.obj') for name in 'ab']
        for rope, n in zip(ropes, (3, 4)):
            rope.write_text(''.join('v %d 0 0\n' % k for k in range(n)) + 'l ' + ' '.join(map(str, range(1, n + 1))) + '\n')
        self.assertIn('(4 vertices and 3 edges of lines, expected 3 vertices and 2 edges of lines, the same ones)',
                      run(TOOL, *ropes).stderr)

    def test_a_rope_that_repeats_a_point(self):
        """What is one point in every frame does not touch itself, and none of it is left unchecked; what comes apart later does."""
        frames = [self.folder / (name + '.obj') for name in 'ab']
        for last, said in ((1, 'exact: proved, nothing touches'), (2, 'exact: proved, what touches lasts')):
            for frame, heights in zip(frames, ((0, 0, 0), (1, 1, last))):
                frame.write_text('v 0 0 0\nv 1 0 %d\nv 1 0 %d\nv 1 0 %d\nv 2 0 0\nl 1 2 3 4 5\n' % heights)
            done = run(TOOL, *frames)
            self.assertEqual((done.returncode, done.stdout.splitlines()[-1]), (0, said), done.stderr)

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
        self.refused('1 vertex is not finite', sheet(0) + sheet(0.1), lost)

    def test_what_is_not_proved_stays_so_in_later_steps(self):
        lost = sheet(0) + sheet(0.1)
        lost[700] = (float('nan'), 0.0, 0.0)
        files = [self.folder / ('%d.ply' % k) for k in range(3)]
        for file, points in zip(files, (lost, *2 * [sheet(0) + sheet(0.1)])):
            write(file, points, self.FACES)
        self.assertEqual(run(TOOL, *files).returncode, NOT_PROVED)

    def test_an_edge_through_a_face_at_the_start(self):
        through = [(x, y, 0.3 * (x - 0.111)) for x, y, _ in sheet(0)]
        self.assertEqual(self.check(sheet(0) + through, sheet(0) + through), 0)
        self.assertEqual(self.stats['start_state'], 'INTERSECTING')
        self.assertNotIn('nothing touches', self.said)
        self.refused('at the start was not checked', sheet(0) + through, sheet(0) + through, '--no-start-state')

    def obj(self, points, polygons, ends=None):
        """The step of an OBJ from the points to the ends."""
        faces = ''.join('f ' + ' '.join(str(v + 1) for v in polygon) + '\n' for polygon in polygons)
        return self.run_on('.obj', lambda path, at: path.write_text(''.join('v %r %r %r\n' % p for p in at) + faces),
                           (points, ends or points))

    def test_faces_that_cannot_be_used(self):
        square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        self.assertEqual(self.obj(square, [(0, 1, 2), (0, 2, 3), (0, 1, 1)]), 0, 'the edge of a face')
        for face in ((1, 3, 3), (0, 2, 1, 3)):
            self.assertEqual(self.obj(square, [(0, 1, 2), (0, 2, 3), face]), NOT_PROVED)
            self.assertIn('1 face was sent that cannot be used', self.said)
            self.assertIn('0.obj: 1 polygons cannot be used and are unchecked, the first is in line 7', self.remarked)
            self.assertNotIn('nothing touches', self.said)

    def test_errors_are_told_from_what_is_not_proved(self):
        self.assertEqual(run(TOOL, 'nowhere.ply', 'nowhere.ply').returncode, 1)
        self.assertEqual(run(TOOL, '--no-such-flag').returncode, 1)


OBJ_TRIANGLES = 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0.2 0.2 %(z)s\nv 0.3 0.2 %(z)s\nv 0.2 0.3 %(z)s\n%(faces)s'


class Files(FolderTestCase):
    """Steps of two small files, of which the contacts are known."""

    TOC = 0.5

    def check(self, ending, first, second):
        frames = [self.folder / (name + ending) for name in '01']
        for frame, text in zip(frames, (first, second)):
            frame.write_text(text)
        csv = self.folder / 'contacts.csv'
        csv.unlink(missing_ok=True)
        done = run(TOOL, *frames, '--contacts', csv)
        self.said, self.remarks = done.stdout, done.stderr.replace('%s/' % self.folder, '')
        rows = csv.read_text().splitlines()[1:] if csv.exists() else []
        self.contacts = []
        for row in rows:
            kind, *vertices, lower, upper, certainty = row.split(',')
            self.assertEqual(certainty, 'certain')
            self.assertLessEqual(float(lower), self.TOC)
            self.assertLess(self.TOC, float(upper))
            self.contacts.append((kind, *map(int, vertices)))
        return done.returncode


class FilesTest(Files):
    """Odd but legal form."""

    THROUGH = [('VF', v, 0, 1, 2) for v in (3, 4, 5)]

    def obj(self, faces):
        return self.check('.obj', *(OBJ_TRIANGLES % {'z': z, 'faces': faces} for z in ('0.5', '-0.5')))

    def test_what_is_not_known_is_said(self):
        self.assertEqual(self.obj('face 1 2 3\nf 1 2 3\nf 4 5 6\n'), 3)
        self.assertEqual(self.contacts, self.THROUGH)
        for frame in '01':
            self.assertIn("check_step: %s.obj: 1 lines with unknown keywords are unchecked, the first is 'face' in line 7" % frame,
                          self.remarks)

    def test_ropes(self):
        text = 'v 0 0 0\nv 0.5 0 0\nv 1 0 0\nv 0.3 -0.2 %(z)s\nv 0.3 0.2 %(z)s\nl 1 2 3\nl 4 5\n'
        self.assertEqual(self.check('.obj', text % {'z': '0.4'}, text % {'z': '-0.4'}), 0, self.said)
        self.assertEqual(self.contacts, [('EE', 0, 1, 3, 4)])
        apart = self.check('.obj', text % {'z': '0.4'}, text.replace('l 4 5', 'l 5 4 3') % {'z': '0.4'})
        self.assertEqual(apart, 1)
        self.assertIn('not the topology of', self.remarks)


def stl(*triangles):
    facets = ['facet normal 0 0 0\nouter loop\n' + ''.join('vertex %r %r %r\n' % corner for corner in triangle) +
              'endloop\nendfacet\n' for triangle in triangles]
    return 'solid a\n' + ''.join(facets) + 'endsolid a\n'


def dae(*triangles):
    corners = [corner for triangle in triangles for corner in triangle]
    numbers = ' '.join('%r %r %r' % corner for corner in corners)
    return ('<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/><library_geometries>'
            '<geometry id="g"><mesh><source id="p"><float_array id="a" count="%d">%s</float_array><technique_common>'
            '<accessor source="#a" count="%d" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>'
            '<param name="Z" type="float"/></accessor></technique_common></source><vertices id="v"><input semantic="POSITION" '
            'source="#p"/></vertices><triangles count="%d"><input semantic="VERTEX" source="#v" offset="0"/><p>%s</p></triangles>'
            '</mesh></geometry></library_geometries><library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry '
            'url="#g"/></node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>'
            % (3 * len(corners), numbers, len(corners), len(triangles), ' '.join(map(str, range(len(corners))))))


class SoupsTest(Files):
    """Frames whose vertices have no numbers: a quadrilateral of two triangles, a small triangle that falls through it."""

    FLOOR = [[(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 0), (1, 0, 0), (1, 1, 0)]]
    THROUGH = [('VF', v, 0, 1, 2) for v in (4, 5, 6)]

    def falling(self, z):
        return [(0.25, 0.25, z), (0.375, 0.25, z), (0.25, 0.375, z)]

    def test_a_step(self):
        for ending, write_frame in (('.stl', stl), ('.dae', dae)):
            frames = [write_frame(*self.FLOOR, self.falling(z)) for z in (0.5, -0.5)]
            self.assertEqual(self.check(ending, *frames), 0, self.said)
            self.assertEqual(self.remarks, '')
            self.assertEqual(self.contacts, self.THROUGH)

    def test_what_meets_in_a_later_frame_is_contact(self):
        lower = [(0, 0, -1), (1, 0, -1), (0, 1, -1)]
        self.assertEqual(self.check('.stl', stl(*self.FLOOR, [(x, y, 1) for x, y, _ in lower]), stl(*self.FLOOR, lower)), 0)
        self.assertIn(('VF', 4, 0, 1, 2), self.contacts, 'it comes to lie on the floor, corner on corner, at half the step')
        self.assertEqual(self.remarks, '')

    def test_what_comes_apart_is_said(self):
        away = [(x, y, z + 1) for x, y, z in self.FLOOR[1]]
        self.TOC = 0
        self.assertEqual(self.check('.stl', stl(*self.FLOOR), stl(self.FLOOR[0], away)), 0)
        self.assertIn('what touches lasts', self.said)
        self.assertIn('0.stl: 2 vertices come apart in a later frame', self.remarks)

    def test_what_is_no_sequence(self):
        self.assertEqual(self.check('.stl', stl(*self.FLOOR), stl(self.FLOOR[0])), 1)
        self.assertIn('1.stl: not the topology of', self.remarks)
        write(self.folder / '1.ply', [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], [(0, 1, 2), (2, 1, 3)])
        done = run(TOOL, self.folder / '0.stl', self.folder / '1.ply')
        self.assertEqual(done.returncode, 1)
        self.assertIn('write all frames in one format', done.stderr)


class SequenceTest(FolderTestCase):
    """A sheet that is rolled up, turns, rests and is rolled tighter until its layers meet: more than two frames are steps."""

    N = 40
    TIGHTER = (0, 1e-6, 2e-6, 2.4e-3)
    ORDER = (0, 1, 1, 1, 1, 2, 3)

    def frame(self, k):
        points = []
        for r in range(self.N):
            for c in range(self.N):
                angle = 10.0 * c / self.N
                radius = 0.2 + (0.002 - self.TIGHTER[k]) * angle + 0.0001 * math.sin(5 * r + 3 * c)
                turned = angle + 0.01 * k
                points.append((radius * math.cos(turned), radius * math.sin(turned), r / self.N))
        points[25] = points[0]  # a turn further out: what touches is looked at where it rests, too
        return points

    def test_each_step_has_the_answer_that_it_has_alone(self):
        for k in range(4):
            write(self.folder / ('%d.ply' % k), self.frame(k), faces_of(self.N))
        frames = [self.folder / ('%d.ply' % k) for k in self.ORDER]
        csv, json_file = self.folder / 'out.csv', self.folder / 'out.json'

        def answer(frames, *flags):
            self.assertEqual(run(TOOL, *frames, '--contacts', csv, '--stats', json_file, *flags).stderr, '')
            return csv.read_text(), json.loads(json_file.read_text())

        kept, stats = answer(frames)
        forgot, without = answer(frames, '--forget')
        self.assertEqual(kept, forgot)
        self.assertEqual(kept, answer(frames, '--threads', '2')[0])
        self.assertGreater(stats['bodies_kept'], 0)
        self.assertEqual(without['bodies_kept'], 0)
        counters = re.findall(r'  COUNTER\((\w+), ', (CHECKOUT / 'include/dccd/outcome.h').read_text())
        self.assertGreater(len(counters), 10)
        self.assertLessEqual(set(counters), set(stats))
        self.assertEqual(stats['steps'], 6)
        self.assertEqual(set(stats['ms']['total']), {'best', 'median', 'mean'})
        header, *rows = kept.splitlines()
        self.assertEqual(header, 'step,kind,v0,v1,v2,v3,toc_lower,toc_upper,certainty')
        alone = []
        for k in range(6):
            first, *of_step = answer(frames[k:k + 2])[0].splitlines()
            self.assertEqual('step,' + first, header)
            alone += ['%d,%s' % (k, row) for row in of_step]
        self.assertEqual(rows, alone)
        self.assertGreater(len(rows), 10)

    def test_what_touches_in_any_step_is_said(self):
        frames = [self.folder / ('%d.obj' % k) for k in range(4)]
        for path, z in zip(frames, (1, 1, -1, -2)):
            path.write_text(OBJ_TRIANGLES % {'z': z, 'faces': 'f 1 2 3\nf 4 5 6\n'})
        done = run(TOOL, *frames, '--stats', self.folder / 'out.json')
        self.assertEqual(done.returncode, 0)
        self.assertIn('exact: proved, something touches anew\n', done.stdout)
        self.assertEqual(done.stdout.splitlines()[1].split()[:4], ['exact', '3', '0', '1.5'])
        self.assertEqual(json.loads((self.folder / 'out.json').read_text())['touching'], 'NEW')

    def test_a_frame_of_another_mesh_is_named(self):
        files = [self.folder / name for name in ('0.ply', '1.ply', 'other.ply')]
        for k, file in enumerate(files):
            n = self.N if k < 2 else 8
            write(file, self.frame(k) if k < 2 else sheet(0, 8), faces_of(n))
        done = run(TOOL, *files)
        self.assertEqual(done.returncode, 1)
        self.assertIn('other.ply: not the topology of', done.stderr)


if __name__ == '__main__':
    unittest.main()
