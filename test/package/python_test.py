"""The Python module: its answers are those of C++ bit for bit, it takes what numpy users have, and refuses the rest with a sentence."""
import gc
import math
import os
import pathlib
import pickle
import re
import subprocess
import unittest
from fractions import Fraction

import meshio
import numpy as np

from checkout import CHECKOUT, TOOLS, FolderTestCase

SANITIZED = os.environ.get('DEFORMABLE_CCD_SANITIZED')
if not SANITIZED:
    import dccd

DATA = pathlib.Path(os.environ.get('DEFORMABLE_CCD_DATA', CHECKOUT.parent / 'shared/data'))
WRITE_STEPS = TOOLS.parents[2] / 'build/deformable_ccd/gtest/write_steps'
FACES = np.array([[0, 1, 2], [3, 4, 5]])
ALL_RESULTS = ['status', 'reason', 'start_state', 'start_state_complete', 'complete', 'unchecked_toc_lower', 'earliest_toc',
               'earliest_unexpected_toc', 'total_contacts', 'substeps', 'excluded_voxels', 'proved', 'missing', 'touching', 'expected']


def two_triangles(dtype=float):
    """One triangle falls through another one: its three vertices are there in the middle of the step."""
    t0 = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [.25, .25, 1], [.5, .25, 1], [.25, .5, 1]], dtype=dtype)
    t1 = t0.copy()
    t1[3:, 2] = -1
    return t0, t1


def sheet(size, z=0.0):
    x, y = np.meshgrid(np.arange(size), np.arange(size))
    return np.stack([0.01 * x, 0.01 * y, np.full(x.shape, z)], axis=2).reshape(-1, 3)


@unittest.skipIf(SANITIZED, 'the module is not built with sanitizers: the interpreter does not load them')
class PythonTestCase(FolderTestCase):
    def assert_same_rows(self, a, b):
        self.assertEqual((len(a), a.dtype), (len(b), b.dtype))
        self.assertEqual(a.tobytes(), b.tobytes())

    def assert_same_answer(self, a, b):
        for rows in ('contacts', 'intersections', 'patches'):
            self.assert_same_rows(getattr(a, rows), getattr(b, rows))
        self.assertEqual(a.patch_of.tolist(), b.patch_of.tolist())
        for name in ALL_RESULTS:
            self.assertEqual(getattr(a, name), getattr(b, name), name)


class AnswersTest(PythonTestCase):
    def rebuilt(self, body):
        """The same body from arrays of ours."""
        mesh = dccd.Mesh(body.mesh.vertex_count, np.array(body.mesh.triangles)) if len(body.mesh.triangles) else \
            dccd.Mesh(body.mesh.vertex_count, edges=np.array(body.mesh.edges))
        return dccd.Body(np.array(body.t0), np.array(body.t1), mesh=mesh, name=body.name, rigid=body.rigid, static=body.static,
                         self_collision=body.self_collision, against_bodies=body.against_bodies,
                         against_obstacle=body.against_obstacle, shell=body.shell, vertex_mask=body.vertex_mask,
                         minimum_separation_m=body.minimum_separation_m, separations_m=body.separations_m,
                         reference=body.reference, radius_m=body.radius_m,
                         pose_t0=body.pose_t0, pose_t1=body.pose_t1)

    def answer(self, step):
        voxels = step.voxels and dccd.Voxels(step.voxels.resolution_m, keys=step.voxels.keys, sizes=step.voxels.sizes,
                                             map_from_fixed=step.voxels.map_from_fixed)
        return dccd.detect([self.rebuilt(body) for body in step.bodies], voxels=voxels, **step.options)

    def test_random_steps_are_answered_as_by_the_library(self):
        count = 4000 if os.environ.get('DEFORMABLE_CCD_LONG') else 400
        subprocess.run([WRITE_STEPS, self.folder, '1', str(count)], check=True)
        seen = {'contacts': 0, 'intersections': 0, 'with voxels': 0, 'expected': 0, 'undecided': 0}
        for seed in range(1, count + 1):
            step = dccd.replay(self.folder / ('%d.step' % seed))
            with self.subTest(seed=seed):
                self.assertEqual(step.differences, [])
                self.assert_same_answer(self.answer(step), step.recorded)
            contacts = step.recorded.contacts
            seen['contacts'] += len(contacts)
            seen['intersections'] += len(step.recorded.intersections)
            seen['with voxels'] += np.count_nonzero(contacts['bodies'][:, 1] == dccd.OBSTACLE_BODY)
            seen['expected'] += np.count_nonzero(contacts['expected'])
            seen['undecided'] += np.count_nonzero(~contacts['certain'])
        self.assertTrue(all(seen.values()), seen)

    def test_recordings_of_the_node_are_answered_again(self):
        """Bodies that turn, separations, radii, expected contacts."""
        for name in ('everything', 'distances', 'conservative_without_map'):
            step = dccd.replay(CHECKOUT / 'test/fuzz/corpus/recording' / name)
            self.assertEqual(step.differences, [])
            self.assert_same_rows(self.answer(step).contacts, step.recorded.contacts)
            self.assertGreater(len(step.recorded.contacts), 0)

    @unittest.skipUnless((DATA / 'scenes').is_dir(), 'no public data')
    def test_real_scenes_are_answered_as_by_check_step(self):
        for scene in ('cloth-ball', 'n-body'):
            frames = [DATA / 'scenes' / scene / ('frame_%d.ply' % i) for i in (0, 1)]
            csv = self.folder / 'contacts.csv'
            subprocess.run([TOOLS / 'check_step', *frames, '--contacts', csv], stdout=subprocess.DEVNULL, check=True)
            t0, t1 = map(meshio.read, frames)
            outcome = dccd.detect(dccd.Body(t0.points, t1.points, t0.cells_dict['triangle']), num_threads=2)
            self.assertTrue(outcome.proved)
            lines = csv.read_text().splitlines()[1:]
            self.assertEqual(len(outcome.contacts), len(lines))
            names = ['VF', 'EE']
            contacts = outcome.contacts
            columns = [contacts[name].tolist() for name in ('kind', 'vertices', 'toc_lower', 'toc_upper')]
            for line, kind, vertices, lower, upper in zip(lines, *columns):
                words = line.split(',')
                self.assertEqual((names[kind], vertices), (words[0], [int(v) for v in words[1:5]]))
                self.assertEqual((lower, upper), (float(words[5]), float(words[6])))

    @unittest.skipUnless((DATA / 'ccd_queries').is_dir(), 'no public data')
    def test_pairs_of_the_benchmark_are_decided_right(self):
        number = 0
        for family in ('unit-tests', 'erleben-spikes'):
            for kind in ('vertex-face', 'edge-edge'):
                for path in sorted((DATA / 'ccd_queries' / family / kind).glob('*.csv')):
                    rows = [list(map(int, line.split(','))) for line in path.read_text().split()][:8 * 4000]
                    points = np.array([[float(Fraction(r[i], r[i + 1])) for i in (0, 2, 4)] for r in rows]).reshape(-1, 2, 4, 3)
                    truth = np.array([r[6] for r in rows[::8]], dtype=bool)
                    found = dccd.pairs(kind, points[:, 0], points[:, 1])
                    self.assertEqual((found['contact'] != truth).sum(), 0, path)
                    self.assertFalse(found['undecided'].any())
                    number += len(truth)
        self.assertGreater(number, 100)

    def test_equal_answers_of_pairs_have_equal_bytes(self):
        """Also between the fields, and whatever the memory held before."""
        t0, t1 = (np.random.default_rng(seed).normal(size=(500, 4, 3)) for seed in (1, 2))
        answers = []
        for filled in (0, 255):
            before = [np.full(500 * 24, filled, 'u1') for _ in range(8)]
            del before
            answers.append(dccd.pairs('VF', t0, t1))
        self.assertEqual(answers[0].dtype.itemsize, 24)
        self.assertEqual(answers[0].tobytes(), answers[1].tobytes())
        self.assertFalse(answers[1].view('u1').reshape(500, 24)[:, 18:].any())

    def test_what_can_be_worked_out(self):
        outcome = dccd.detect(dccd.Body(*two_triangles(), FACES, name='both'))
        self.assertEqual(outcome.contacts['kind'].tolist(), [dccd.VERTEX_FACE] * 3)
        self.assertEqual(outcome.contacts['vertices'].tolist(), [[v, 0, 1, 2] for v in (3, 4, 5)])
        self.assertTrue((outcome.contacts['toc_lower'] == .5).all() and (outcome.contacts['toc_upper'] == .5 + 2**-32).all())
        self.assertTrue(outcome.contacts['certain'].all() and not outcome.contacts['initial'].any())
        self.assertEqual((outcome.status, outcome.start_state, outcome.proved, outcome.touching, outcome.clear, outcome.body_names),
                         ('OK', 'CLEAR', True, 'NEW', False, ['both']))
        geometry = outcome.geometry([0])[0]
        np.testing.assert_allclose(geometry['point'], [.25, .25, 0], atol=1e-12)
        np.testing.assert_allclose(geometry['normal'], [0, 0, 1], atol=1e-12)
        self.assertEqual((len(outcome.geometry()), geometry['approach_speed']), (3, 2))
        with self.assertRaisesRegex(IndexError, 'there is no contact 3; there are 3'):
            outcome.geometry([3])
        self.assertEqual(outcome.stats['vf_candidates'], 3)
        self.assertEqual(outcome.counts['certain'], 3)

    def test_nothing_touches(self):
        t0, _ = two_triangles()
        outcome = dccd.detect(dccd.Body(t0, t0, FACES))
        self.assertTrue(outcome.clear)
        self.assertEqual((len(outcome.contacts), outcome.earliest_toc, outcome.missing), (0, math.inf, []))
        self.assertTrue(dccd.detect(dccd.Body(t0, triangles=FACES)).clear, 'without t1 it rests')
        outcome = dccd.detect(dccd.Body(t0, t0, FACES), check_start_state=False)
        self.assertFalse(outcome.proved)
        self.assertTrue(outcome.missing)

    def test_a_body_in_the_way_of_another(self):
        t0, t1 = two_triangles()
        still, falls = (dccd.Body(t0[i:i + 3], t1[i:i + 3], [[0, 1, 2]], name=name) for i, name in ((0, 'table'), (3, 'cloth')))
        contacts = dccd.detect((still, falls)).contacts
        self.assertEqual(contacts['bodies'].tolist(), [[1, 0]] * 3)
        expected = dccd.detect([still, falls], expected=[{'between': ['cloth', 'table'], 'vertices': {'cloth': [0, 1]}}])
        self.assertEqual(expected.contacts['expected'].tolist(), [True, True, False])
        alone = dccd.Body(t0[3:], t1[3:], [[0, 1, 2]], against_bodies=False)
        self.assertEqual(len(dccd.detect([still, alone]).contacts), 0)
        self.assertEqual(dccd.detect([still, dccd.Body(t0[3:], t1[3:], [[0, 1, 2]])]).body_names, ['table', 'body_1'])
        # Next step: it goes on to fall.
        falls.move_to(t1[3:] - [0, 0, 1])
        self.assertEqual((falls.t0.tolist(), falls.t1[0].tolist()), (t1[3:].tolist(), [.25, .25, -2]))
        self.assertTrue(dccd.detect([still, falls]).clear)

    def test_voxels(self):
        drop = dccd.Body([[.01, .01, 1]] + [[.01, .02, 1]], [[.01, .01, -1]] + [[.01, .02, -1]], edges=[[0, 1]])
        by_centre = dccd.Voxels(.5, [[.1, .1, .1], [.4, .4, .4], [5, 5, 5]])
        self.assertEqual(by_centre.keys.tolist(), [[32768] * 3, [32778] * 3])
        self.assertEqual((by_centre.resolution_m, by_centre.sizes.tolist()), (.5, [1, 1]))
        by_key = dccd.Voxels(.5, keys=by_centre.keys)
        answers = [dccd.detect(drop, voxels=v).contacts for v in (by_centre, by_key)]
        self.assert_same_rows(*answers)
        c = answers[0]
        self.assertEqual(set(c['kind'].tolist()), {dccd.VERTEX_VOXEL_FACE})
        self.assertEqual((c['bodies'][0].tolist(), c['voxel'][0].tolist(), c['voxel_size'][0]), ([0, dccd.OBSTACLE_BODY], [32768] * 3, 1))
        self.assertEqual(c['toc_lower'].tolist(), [.25, .25])
        large = dccd.Voxels(.25, keys=[[32768] * 3], sizes=[2])
        self.assertEqual(dccd.detect(drop, voxels=large).contacts['voxel_size'].tolist(), [2, 2])
        lower = np.eye(4)
        lower[2, 3] = .5  # the map's origin is half a metre below the bodies'
        moved = dccd.Voxels(.5, [[.1, .1, .1]], map_from_fixed=lower)
        self.assertEqual(dccd.detect(drop, voxels=moved).contacts['toc_lower'].tolist(), [.5, .5])
        self.assertEqual(moved.map_from_fixed.tolist(), lower.tolist())
        self.assertTrue(dccd.detect(drop, voxels=dccd.Voxels(.5, np.empty((0, 3)))).clear)
        self.assertTrue(dccd.detect(drop, voxels=by_key, exclude_boxes=[[[0, 0, 0], [.5, .5, .5]]]).clear)
        self.assertEqual(dccd.detect(drop, obstacle_expected=True).status, 'NO_MAP')
        # On a plane that two voxels share, to the last bit.
        for resolution in (.1, .3, 1 / 3):
            for k in range(-50, 50):
                plane = k * resolution
                keys = dccd.Voxels(resolution, [[plane] * 3, [np.nextafter(plane, -math.inf)] * 3]).keys
                self.assertEqual(sorted(keys[:, 0].tolist()), [32767 + k, 32768 + k])

    def test_a_pair(self):
        face = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
        t0, t1 = [[.25, .25, 1]] + face, [[.25, .25, -1]] + face
        for kind in (dccd.VERTEX_FACE, 'VF', 'vertex-face'):
            self.assertEqual(dccd.pair(kind, t0, t1), dccd.PairResult(True, False, .5, .5 + 2**-32))
        self.assertEqual(dccd.pair('VF', t0, t0), dccd.PairResult(False, False, math.inf, math.inf))
        self.assertEqual(dccd.pair('EE', t0, t1, toc_bits=52).contact, False)
        self.assertTrue(dccd.pair('VF', t0, t0, accuracy='conservative', minimum_separation_m=1).contact)
        for arguments, error, sentence in [
                (('VV', t0, t1), ValueError, "kind is 'VV'; expected one of vertex-face"),
                ((7, t0, t1), ValueError, 'kind is 7'),
                (('VF', t0[:3], t1), ValueError, r't0 has shape \(1, 3, 3\), expected \(n, 4, 3\)'),
                (('VF', t0, [[.25, math.nan, 0]] + face), ValueError, 'pair 0, vertex 0 is not finite'),
                (('vertex-voxel-face', t0, t1), ValueError, 'is not vertex-face or edge-edge')]:
            with self.assertRaisesRegex(error, sentence):
                dccd.pair(*arguments)
        with self.assertRaisesRegex(ValueError, 'toc_bits'):
            dccd.pair('VF', t0, t1, toc_bits=9)
        with self.assertRaisesRegex(ValueError, 'needs the rung conservative'):
            dccd.pair('VF', t0, t1, minimum_separation_m=1)

    def test_why_a_pair_is_a_contact(self):
        body = dccd.Body(*two_triangles(), FACES)
        row = dccd.detect(body).contacts[1]
        lines = dccd.explain(body, row)
        self.assertEqual(lines, dccd.explain(body, 'VF', [4, 0, 1, 2]))
        self.assertEqual([line.says for line in lines if line.stage == 'exact'], ['contact'])
        voxels = dccd.Voxels(.5, [[.25, .25, -.25]])
        on_map = dccd.detect(body, voxels=voxels)
        row = on_map.contacts[on_map.contacts['bodies'][:, 1] == dccd.OBSTACLE_BODY][0]
        self.assertIn('contact', [line.says for line in dccd.explain(body, row, voxels=voxels)])
        with self.assertRaisesRegex(ValueError, "body 'body_0' has no face 0 1 3"):
            dccd.explain(body, 'VF', [4, 0, 1, 3])
        with self.assertRaisesRegex(ValueError, 'vertices has 2; vertex-face has 4'):
            dccd.explain(body, 'VF', [4, 0])

    def test_a_history_changes_no_answer(self):
        body, history = dccd.Body(sheet(20), triangles=dccd.Mesh.grid(20, 20).triangles), dccd.History()
        floor = dccd.Voxels(.05, [[.02 * i, .02 * j, -.03] for i in range(10) for j in range(10)])
        random = np.random.default_rng(1)
        kept = 0
        for _ in range(12):
            body.move_to(body.t1 + random.normal(0, .004, (400, 3)) - [0, 0, .003])
            outcome = dccd.detect(body, voxels=floor, history=history)
            self.assert_same_answer(outcome, dccd.detect(body, voxels=floor))
            kept += outcome.start_state == 'INTERSECTING'
        self.assertGreater(kept, 0)
        history.clear()


class StreamTest(PythonTestCase):
    def stream(self, **options):
        return dccd.Stream(dccd.Body(mesh=dccd.Mesh(6, FACES), name='cloth'), max_vertex_step_m=0, **options)

    def test_frames_become_steps(self):
        t0, t1 = two_triangles()
        stream = self.stream(patches=True)
        self.assertEqual([stream.push(t0, 10.0), stream.push(t0, 10.1), stream.push(t1, 10.2, 'cloth')], ['FIRST_FRAME', 'OK', 'OK'])
        outcomes = list(stream)
        self.assertEqual([(o.status, o.sequence) for o in outcomes], [('FIRST_FRAME', 1), ('OK', 2), ('OK', 3)])
        self.assertFalse(outcomes[0].proved)
        self.assertTrue(outcomes[1].clear)
        self.assert_same_rows(outcomes[2].contacts, dccd.detect(dccd.Body(t0, t1, FACES)).contacts)
        self.assertEqual((outcomes[2].start_ns, outcomes[2].stamp_ns), (10100000000, 10200000000))
        self.assertEqual((outcomes[2].patches['id'].tolist(), outcomes[2].patches['is_new'].tolist()), ([1], [True]))
        self.assertEqual(outcomes[2].patch_events[0]['kind'], 'BEGAN')
        self.assertIsNone(stream.next())

    def test_seams_and_frames_that_cannot_be_used(self):
        t0, t1 = two_triangles()
        stream = self.stream()
        self.assertEqual([stream.push(t0, 0.0), stream.push(t0, 0.0), stream.push(t0, 3.0), stream.push(t0, 2.9),
                          stream.push(t0[:5], 3.0)], ['FIRST_FRAME', 'DUPLICATE', 'GAP', 'TIME_JUMP', 'VERTEX_COUNT'])
        self.assertEqual([o.status for o in stream], ['FIRST_FRAME', 'DUPLICATE', 'GAP', 'TIME_JUMP', 'VERTEX_COUNT'])
        stream.reset()
        self.assertEqual(stream.push(t0[:3], 3.1, mesh=dccd.Mesh(3, [[0, 1, 2]])), 'FIRST_FRAME')

    def test_other_bodies_are_interpolated(self):
        """The table comes up to where the cloth rests, in a frame that ends after the cloth's."""
        t0, _ = two_triangles()
        bodies = [dccd.Body(mesh=dccd.Mesh(3, [[0, 1, 2]]), name=name) for name in ('cloth', 'table')]
        stream = dccd.Stream(bodies, max_vertex_step_m=0)
        for body, first in (('cloth', 3), ('table', 0)):
            stream.push(t0[first:first + 3], 0.0, body)
        stream.push(t0[3:], 0.1, 'cloth')
        self.assertEqual([o.status for o in stream], ['FIRST_FRAME'])
        self.assertIsNone(stream.next(), 'the table is not known at 0.1 s')
        stream.push(t0[:3] + [0, 0, 4], 0.2, 1)
        outcome = stream.next()
        self.assertEqual((outcome.status, outcome.contacts['toc_lower'].tolist()), ('OK', [.5] * 3))

    def test_what_will_be_and_what_is(self):
        t0, _ = two_triangles()
        stream = self.stream(look_ahead_s=0.2)
        self.assertEqual(stream.predict().status, 'NO_BODY')
        stream.push(t0, 0.0)
        stream.push(np.where(t0 == 1, [1, 1, .9], t0), 0.1)
        self.assertEqual(len(list(stream)), 2)
        self.assertEqual(len(stream.predict().contacts), 0)
        stream.push(np.where(t0 == 1, [1, 1, .15], t0), 0.2)
        list(stream)
        self.assertEqual(len(stream.predict().contacts), 3)
        self.assertTrue(stream.check_now().clear)
        stream.set_voxels(dccd.Voxels(1, [[.5, .5, .5]]))
        self.assertFalse(stream.check_now().clear)
        stream.finish()

    def test_refusals(self):
        with self.assertRaisesRegex(TypeError, "there is no option 'max_steps'"):
            self.stream(max_steps=1)
        with self.assertRaisesRegex(ValueError, 'max_step_s must be above 0 and at most 1e9'):
            self.stream(max_step_s=0)
        with self.assertRaisesRegex(ValueError, "no body is called 'rope'"):
            self.stream().push(two_triangles()[0], 0, 'rope')
        with self.assertRaisesRegex(ValueError, 'there is no body 1; there are 1'):
            self.stream().push(two_triangles()[0], 0, 1)
        with self.assertRaisesRegex(ValueError, 'stamp_s is'):
            self.stream().push(two_triangles()[0], math.nan)


class ArraysTest(PythonTestCase):
    """What numpy users have is taken, or refused with a sentence."""

    def setUp(self):
        self.t0, self.t1 = two_triangles()
        self.wanted = dccd.detect(dccd.Body(self.t0, self.t1, FACES)).contacts

    def test_a_mask_that_hides_nothing_is_none(self):
        self.assertEqual(dccd.Body(np.ma.array(self.t0), self.t1, np.ma.array(FACES)).t0.tolist(), self.t0.tolist())

    def test_any_layout_gives_the_same(self):
        padded = np.zeros((6, 5))
        padded[:, 1:4] = self.t0
        for name, t0 in {'float32': self.t0.astype('f4'), 'big-endian': self.t0.astype('>f8'), 'Fortran': np.asfortranarray(self.t0),
                         'a slice': padded[:, 1:4], 'backwards': self.t0[::-1].copy()[::-1], 'a list': self.t0.tolist()}.items():
            with self.subTest(name):
                self.assert_same_rows(dccd.detect(dccd.Body(t0, self.t1, FACES)).contacts, self.wanted)
        for faces in (FACES.astype('u1'), FACES.astype('>i8'), np.asfortranarray(FACES), FACES.tolist(), [tuple(f) for f in FACES]):
            self.assert_same_rows(dccd.detect(dccd.Body(self.t0, self.t1, faces)).contacts, self.wanted)

    def test_read_only_arrays_are_taken_and_nothing_is_written(self):
        faces = FACES.copy()
        for array in (self.t0, self.t1, faces):
            array.flags.writeable = False
        before = [array.tobytes() for array in (self.t0, self.t1, faces)]
        self.assert_same_rows(dccd.detect(dccd.Body(self.t0, self.t1, faces)).contacts, self.wanted)
        self.assertEqual(before, [array.tobytes() for array in (self.t0, self.t1, faces)])

    def test_a_body_does_not_change_with_the_callers_array(self):
        body = dccd.Body(self.t0, self.t1, FACES)
        self.t1[:] = 7
        self.assert_same_rows(dccd.detect(body).contacts, self.wanted)

    def test_results_are_read_only_and_outlive_their_outcome(self):
        body = dccd.Body(self.t0, self.t1, FACES)
        outcome = dccd.detect(body, patches=True)
        arrays = [outcome.contacts, outcome.patches, outcome.patch_of, body.t0, body.mesh.triangles, body.mesh.edges]
        for array in arrays:
            with self.assertRaises(ValueError):
                array[0] = array[0]
        self.assertIs(outcome.contacts.base, outcome, 'a view')
        copies = [array.copy() for array in arrays]
        del body, outcome
        gc.collect()
        junk = [np.full(1000, 9.) for _ in range(1000)]
        for array, copy in zip(arrays, copies):
            np.testing.assert_array_equal(array, copy)
        del junk

    def test_results_are_arrays_like_others(self):
        outcome = dccd.detect(dccd.Body(self.t0, self.t1, FACES), patches=True)
        for rows in (outcome.contacts, outcome.intersections, outcome.patches, outcome.geometry()):
            np.save(self.folder / 'rows.npy', rows)
            again = np.load(self.folder / 'rows.npy')
            for name in rows.dtype.names:
                np.testing.assert_array_equal(again[name], rows[name])
        self.assertEqual(np.sort(outcome.contacts, order='vertices').dtype, outcome.contacts.dtype)
        self.assertEqual(pickle.loads(pickle.dumps(outcome.contacts)).tolist()[0][0], .5)

    def test_between_the_fields_are_zeros(self):
        """So that equal answers have equal bytes, in memory and in files."""
        bodies = [dccd.Body(sheet(9), sheet(9, end), mesh=dccd.Mesh.grid(9, 9), name=str(end)) for end in (.02, -.01)]
        outcome = dccd.detect(bodies, patches=True, clearance=True)
        for rows in (outcome.contacts, outcome.patches, outcome.clearances):
            between = np.ones(rows.dtype.itemsize, bool)
            for field, offset in rows.dtype.fields.values():
                between[offset:offset + field.itemsize] = False
            self.assertGreater(len(rows) * np.count_nonzero(between), 0)
            self.assertFalse(np.frombuffer(rows.tobytes(), 'u1').reshape(len(rows), -1)[:, between].any())

    def test_distances_are_bounds_of_the_truth(self):
        """Two sheets, one above the other, the upper one sinks from 0.5 m to 0.25 m; and one voxel below both."""
        low = dccd.Body(sheet(5), sheet(5), mesh=dccd.Mesh.grid(5, 5), name='low')
        high = dccd.Body(sheet(5, .5), sheet(5, .25), mesh=dccd.Mesh.grid(5, 5), name='high')
        voxels = dccd.Voxels(.25, centres=[[.125, .125, -.375]])
        outcome = dccd.detect([low, high], voxels=voxels, clearance=True, clearance_tolerance_m=1e-6,
                              clearance_max_m=.45)
        rows = outcome.clearances
        self.assertEqual(rows['bodies'].tolist(), [[0, 1], [0, dccd.OBSTACLE_BODY], [1, dccd.OBSTACLE_BODY]])
        self.assertEqual(rows['end_status'].tolist(), [0, 0, 1], 'the upper one is farther than 0.45 m from the map')
        for row, truth in ((rows[0], .25), (rows[1], .25)):
            for when in ('end_', 'step_'):
                self.assertLessEqual(row[when + 'lower_m'], truth)
                self.assertGreaterEqual(row[when + 'upper_m'], truth)
                self.assertLess(row[when + 'upper_m'] - row[when + 'lower_m'], 1e-6)
                self.assertAlmostEqual(np.linalg.norm(row[when + 'points'][1] - row[when + 'points'][0]), truth, 6)
        self.assertEqual((rows[0]['end_t'], rows[0]['step_t']), (1, 1))
        self.assertEqual(rows[1]['end_voxel_size'], 1)
        self.assertEqual(rows['end_vertices'].shape, (3, 2, 3))
        words = dccd.Outcome.clearances.__doc__
        for name in rows.dtype.names:
            self.assertRegex(words, r'\b%s\b' % re.sub('^(end|step)_', '', name))
        self.assertEqual(len(dccd.detect([low, high], voxels=voxels).clearances), 0)
        itself = dccd.detect(low, clearance=True, clearance_self_m=.1).clearances
        self.assertEqual(itself['bodies'].tolist(), [[0, 0]])

    def test_each_field_has_its_words(self):
        outcome = dccd.detect(dccd.Body(self.t0, self.t1, FACES), patches=True)
        for rows, words in ((outcome.contacts, dccd.Outcome.__doc__), (outcome.patches, dccd.Outcome.patches.__doc__)):
            self.assertEqual(set(rows.dtype.names) - set(re.findall(r'\w+', words)), set())
        self.assertEqual(outcome.patches.dtype['began_from_ns'], np.int64)

    def test_what_is_not_finite_is_unchecked_and_said(self):
        for value in (math.nan, math.inf):
            self.t1[4, 1] = value
            outcome = dccd.detect(dccd.Body(self.t0, self.t1, FACES))
            self.assertEqual((outcome.status, outcome.proved, outcome.stats['unchecked_vertices']), ('PARTIAL', False, 1))
            self.assertRegex(outcome.missing[0], '1 vert')

    def test_bodies_are_refused_with_a_sentence(self):
        t0, t1 = self.t0, self.t1
        for arguments, error, sentence in [
                ((t0.astype(complex), t1, FACES), TypeError, 't0 has dtype complex128; expected real numbers'),
                ((t0.astype(np.longdouble), t1, FACES), TypeError, 't0 has dtype float128'),
                ((t0.astype(str), t1, FACES), TypeError, 't0 has dtype <U'),
                (([['a', None, {}]], t1, FACES), TypeError, 't0 has dtype object'),
                (([[1, 2, 3], [1, 2]], t1, FACES), TypeError, 't0 is no array|t0 has dtype object'),
                ((np.ma.masked_equal(t0, t0[4, 1]), t1, FACES), ValueError, 't0 has masked elements'),
                ((t0, t1, np.ma.masked_equal(FACES, 5)), ValueError, 'triangles has masked elements'),
                ((t0[:, :2], t1, FACES), ValueError, r't0 has shape \(6, 2\), expected \(n, 3\)'),
                ((t0.ravel(), t1, FACES), ValueError, r't0 has shape \(18,\), expected \(n, 3\)'),
                ((t0, t1[:5], FACES), ValueError, 't1 has 5 positions; the mesh has 6 vertices'),
                ((t0, t1, [[0, 1, 6]]), ValueError, r'triangles\[0, 2\] is 6; expected 0 to 5'),
                ((t0, t1, [[0, 1, 2], [3, -1, 5]]), ValueError, r'triangles\[1, 1\] is -1; expected 0 to 5'),
                ((t0, t1, [[0, 1, 2**32]]), ValueError, r'triangles\[0, 2\] is 4294967296'),
                ((t0, t1, [[0, 1, 1]]), ValueError, r'face 0 \(0, 1, 1\) repeats a vertex'),
                ((t0, t1, [[0, 1, 2, 3]]), ValueError, r'triangles has shape \(1, 4\), expected \(n, 3\)'),
                ((t0, t1, FACES.astype(float)), TypeError, 'triangles has dtype float64; expected integers'),
                ((t0, t1), TypeError, 'expected either triangles or edges'),
                ((None, t1, FACES), TypeError, 'a body without t0 needs mesh')]:
            with self.subTest(sentence), self.assertRaisesRegex(error, sentence):
                dccd.Body(*arguments)
        turned = np.eye(4)
        turned[0, 0] = 2
        for options, error, sentence in [
                ({'vertex_mask': [6]}, ValueError, "vertex_mask of body 'body_0' names vertex 6, but the mesh has 6"),
                ({'vertex_mask': [[1]]}, ValueError, r'vertex_mask has shape \(1, 1\), expected \(n,\)'),
                ({'radius_m': [-1.] * 6}, ValueError, r'radius_m\[0\] is -1'),
                ({'radius_m': [1.]}, ValueError, 'radius_m has 1 radii; the mesh has 6 vertices'),
                ({'minimum_separation_m': math.nan}, ValueError, 'minimum_separation_m = nan'),
                ({'reference': t0[:2]}, ValueError, 'needs 6 positions in its reference frame, got 2'),
                ({'pose_t0': np.eye(4)}, TypeError, 'pose_t0 and pose_t1 go together'),
                ({'pose_t0': np.eye(4), 'pose_t1': turned}, ValueError, 'pose_t1 is no pose'),
                ({'pose_t0': np.diag([1., 1, -1, 1]), 'pose_t1': np.eye(4)}, ValueError, 'pose_t0 is no pose'),
                ({'pose_t0': np.eye(4), 'pose_t1': np.eye(3)}, ValueError, r'pose_t1 has shape \(3, 3\), expected \(4, 4\)'),
                ({'pose_t0': np.eye(4), 'pose_t1': np.diag([-1., -1, 1, 1])}, ValueError, r't1\[\d\] is not where the poses take it'),
                ({'mesh': dccd.Mesh(6, FACES)}, TypeError, 'expected a mesh, or triangles, or edges'),
                ({'colour': 1}, TypeError, r"^a body has no option 'colour'; help\(dccd.Body\) names all$"),
                ({'step_budget_ms': 3}, TypeError, r"^'step_budget_ms' is no option of a body but of a call: dccd.detect\(..., step_budget_ms=...\)$")]:
            with self.subTest(sentence), self.assertRaisesRegex(error, sentence):
                dccd.detect(dccd.Body(t0, t1, FACES, **options))

    def test_a_pose_that_contradicts_the_positions_is_refused(self):
        stream = dccd.Stream(dccd.Body(mesh=dccd.Mesh(6, FACES), name='tool', rigid=True))
        below = np.eye(4)
        below[2, 3] = -1
        stream.push(self.t0, 0, pose=np.eye(4))
        stream.push(self.t0 + below[:3, 3], 0.1, pose=below)
        with self.assertRaisesRegex(ValueError, r'positions\[0\] is not where the poses take it'):
            stream.push(self.t0 + below[:3, 3], 0.2, pose=np.eye(4))

    def test_options_and_steps_are_refused_with_a_sentence(self):
        body = dccd.Body(self.t0, self.t1, FACES, name='cloth')
        for options, error, sentence in [
                ({'acuracy': 'exact'}, TypeError, "there is no option 'acuracy'; there are accuracy, tolerance_m"),
                ({'minimum_separation_m': .01}, TypeError, r"'minimum_separation_m' is no option of a call but of a body: dccd.Body\("),
                ({'accuracy': 'best'}, ValueError, 'accuracy: "best" is none of conservative, exact'),
                ({'accuracy': 1}, TypeError, 'accuracy is 1; expected a str'),
                ({'toc_bits': 60}, ValueError, 'toc_bits'), ({'toc_bits': 'all'}, TypeError, "toc_bits is 'all'; expected an integer"),
                ({'num_threads': 0}, ValueError, 'num_threads = 0 is out of range; 1 to 1024'),
                ({'num_threads': 1.5}, TypeError, 'num_threads is 1.5; expected an integer'),
                ({'max_contacts': -1}, ValueError, 'max_contacts is -1, which is out of range'),
                ({'step_budget_ms': -1}, ValueError, 'step_budget_ms = -1'),
                ({'step_budget_ms': None}, TypeError, 'step_budget_ms is None; expected a number'),
                ({'patches': 'yes'}, TypeError, "patches is 'yes'; expected True or False"),
                ({'exclude_boxes': [[0, 0, 0, 1, 1, 1]]}, ValueError, r'exclude_boxes has shape \(1, 6\), expected \(n, 2, 3\)'),
                ({'exclude_boxes': [[[1, 1, 1], [0, 0, 0]]]}, ValueError, "a box's min exceeds its max"),
                ({'expected': [{'between': ['cloth', 'table']}]}, ValueError, "no body is called 'table'"),
                ({'expected': [{'between': ['cloth']}]}, ValueError, r"expected\[0\]\['between'\] has to name two"),
                ({'expected': [{'with': 1}]}, ValueError, "'with' is neither"),
                ({'expected': [{'between': ['cloth', 'self'], 'vertices': {'cloth': [9]}}]}, ValueError, 'name vertex 9')]:
            with self.subTest(sentence), self.assertRaisesRegex(error, sentence):
                dccd.detect(body, **options)
        for bodies, error, sentence in [
                ([], ValueError, 'there is no body'),
                (self.t0, TypeError, 'expected a dccd.Body or a list of them'), ([body, 3], TypeError, r'bodies\[1\] is no dccd.Body'),
                ([body, body], ValueError, "another body is called 'cloth', too"),
                (dccd.Body(self.t0, self.t1, FACES, name='octomap'), ValueError, "'octomap' is the map, or the body itself; give it another name"),
                ([dccd.Body(self.t0, self.t1, FACES, name=name, separations_m={other: distance}) for name, other, distance in (
                    ('cloth', 'table', .6), ('table', 'cloth', .1))], ValueError, 'name two separations, 0.600000 and 0.100000 m'),
                (dccd.Body(mesh=body.mesh), ValueError, "body 'body_0' needs 6 positions at t0 and t1, got 0 and 0")]:
            with self.subTest(sentence), self.assertRaisesRegex(error, sentence):
                dccd.detect(bodies)
        for what in ('voxels', 'history'):
            with self.assertRaisesRegex(TypeError, what + ': expected dccd.'):
                dccd.detect(body, **{what: 3})
        self.assertEqual(len(dccd.detect(body, max_contacts=math.inf).contacts), 3)
        # What was refused left no trace.
        self.assert_same_rows(dccd.detect(body).contacts, self.wanted)

    def test_voxels_are_refused_with_a_sentence(self):
        for arguments, options, error, sentence in [
                ((0,), {'centres': [[0, 0, 0]]}, ValueError, 'resolution_m'), ((.1,), {}, TypeError, 'either centres or keys'),
                ((.1, [[0, 0]]), {}, ValueError, r'centres has shape \(1, 2\), expected \(n, 3\)'),
                ((.1, [[0, math.nan, 0]]), {}, ValueError, r'centres\[0, 1\] is nan'),
                ((.1, [[0, 0, 1e9]]), {}, ValueError, r'centres\[0, 2\] is 1000000000'),
                ((.1,), {'keys': [[0, 0, 65536]]}, ValueError, r'keys\[0, 2\] is 65536; expected 0 to 65535'),
                ((.1,), {'keys': [[1, 0, 0]], 'sizes': [2]}, ValueError, 'multiple'),
                ((.1,), {'keys': [[0, 0, 0]], 'sizes': [1, 1]}, ValueError, r'sizes has shape \(2,\), expected \(1,\)'),
                ((.1,), {'keys': [[0, 0, 0], [0, 0, 0]]}, ValueError, 'overlap')]:
            with self.subTest(sentence), self.assertRaisesRegex(error, sentence):
                dccd.Voxels(*arguments, **options)

    def test_files_are_refused_with_a_sentence(self):
        with self.assertRaises(FileNotFoundError):
            dccd.replay(self.folder / 'no.step')
        bad = self.folder / 'bad.step'
        bad.write_bytes((CHECKOUT / 'test/fuzz/corpus/recording/one_body').read_bytes()[:-9])
        with self.assertRaisesRegex(ValueError, r'bad.step: byte \d+: '):
            dccd.replay(bad)


if __name__ == '__main__':
    unittest.main()
