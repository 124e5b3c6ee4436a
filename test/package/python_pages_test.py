"""What people and their tools read of the Python module, and its examples."""
import ast
import inspect
import pathlib
import pydoc
import sys
import unittest

import meshio
import numpy as np

from checkout import CHECKOUT, TOOLS, run
from python_test import FACES, SANITIZED, PythonTestCase, two_triangles

if not SANITIZED:
    import dccd

EXAMPLES = CHECKOUT / 'examples/python'


class PagesTest(PythonTestCase):
    """What people and their tools read."""

    def test_every_name_has_a_docstring(self):
        for name in dccd.__all__:
            value = getattr(dccd, name)
            if inspect.isclass(value) or inspect.isfunction(value):
                self.assertGreater(len(value.__doc__), 40, name)
                for member, inner in vars(value).items() if value in vars(dccd._dccd).values() else []:
                    if not member.startswith('_'):
                        self.assertTrue(inner.__doc__, '%s.%s' % (name, member))

    def test_pydoc_reads_well(self):
        text = pydoc.render_doc(dccd, renderer=pydoc.plaintext)
        self.assertNotRegex(text, r'_dccd\.|handle|std::|<object object')
        self.assertLess(text.count('\n'), 1200)

    def test_detect_names_every_option(self):
        options = dccd.replay(CHECKOUT / 'test/fuzz/corpus/recording/one_body').options
        said = dccd.detect.__doc__.split('Returns')[0].replace(',', ' ').split()
        self.assertEqual([name for name in options if name not in said], [])
        header = (CHECKOUT / 'include/dccd/detect.h').read_text().split('struct Options {')[1].split('};')[0]
        fields = [line.split('//')[0].split('=')[0].split(';')[0].split()[-1] for line in header.splitlines()
                  if line.startswith('  ') and not line.strip().startswith('//') and ';' in line]
        self.assertGreater(len(fields), 15)
        self.assertEqual(set(fields) - set(options), set(), 'what has no name there')

    def test_stubs_are_those_of_the_module(self):
        tree = ast.parse((CHECKOUT / 'python/dccd/_dccd.pyi').read_text())
        module = dccd._dccd

        def arguments(function, skip_self):
            a = function.args
            names = [x.arg for x in a.posonlyargs + a.args][skip_self:] + ['*' + x.arg for x in a.kwonlyargs]
            return names + (['**' + a.kwarg.arg] if a.kwarg else [])

        def parameters(callable_, skip_self):
            found = list(inspect.signature(callable_).parameters.values())[skip_self:]
            marks = {inspect.Parameter.KEYWORD_ONLY: '*', inspect.Parameter.VAR_KEYWORD: '**'}
            return [marks.get(p.kind, '') + p.name for p in found]

        names = set()
        for node in tree.body:
            if isinstance(node, ast.AnnAssign):
                names.add(node.target.id)
            elif isinstance(node, ast.FunctionDef):
                names.add(node.name)
                self.assertEqual(arguments(node, 0), parameters(getattr(module, node.name), 0), node.name)
            elif isinstance(node, ast.ClassDef):
                names.add(node.name)
                value, members = getattr(module, node.name), set()
                for inner in node.body:
                    members.add(inner.name)
                    words = {getattr(d, 'id', getattr(d, 'attr', '')) for d in inner.decorator_list}
                    if words & {'property', 'setter'}:
                        self.assertIsInstance(vars(value)[inner.name], property)
                        self.assertEqual('setter' in words, vars(value)[inner.name].fset is not None and 'setter' in words)
                    elif inner.name != '__iter__':
                        skip = 0 if words else 1
                        self.assertEqual(arguments(inner, skip), parameters(getattr(value, inner.name), skip), inner.name)
                public = {m for m in vars(value) if not m.startswith('_') or m == '__iter__'}
                self.assertEqual(members - {'__init__'}, public, node.name)
        public = {n for n in vars(module) if not n.startswith('_')} | {'__version__'}
        self.assertEqual(names, public)

    def test_it_is_marked_as_typed(self):
        installed = pathlib.Path(dccd.__file__).parent
        self.assertTrue((installed / 'py.typed').exists() and (installed / '_dccd.pyi').exists())

    def test_the_version_is_the_packages(self):
        self.assertIn('<version>%s</version>' % dccd.__version__, (CHECKOUT / 'package.xml').read_text())


class ExamplesTest(PythonTestCase):
    def run_example(self, name, *arguments):
        ran = run(sys.executable, EXAMPLES / name, *arguments)
        self.assertEqual((ran.returncode, ran.stderr), (0, ''))
        return ran.stdout.splitlines()

    def test_every_example_is_run_here(self):
        self.assertEqual({p.name for p in EXAMPLES.iterdir() if p.suffix == '.py'},
                         {'two_frames.py', 'contacts_over_time.py', 'valid_step.py', 'read_tables.py', 'bag_from_arrays.py'})

    def test_two_frames_say_what_the_cpp_example_says(self):
        lines = self.run_example('two_frames.py')
        self.assertIn('vertex-face 5 2 8 3  at 0.500000000', lines)
        self.assertEqual(lines[-1], '5 contacts, starts CLEAR; proved, something touches anew')

    def test_a_step_is_not_valid_and_two_thirds_of_it_are(self):
        self.assertEqual(self.run_example('valid_step.py'), ['not valid', 'the largest valid step: 0.666666666'])

    def test_the_largest_step_is_the_largest(self):
        """Against the time that the geometry has, on random heights, and starts that touch."""
        sys.path.insert(0, str(EXAMPLES))
        self.addCleanup(sys.path.remove, str(EXAMPLES))
        from valid_step import is_valid, largest_valid_step
        random = np.random.default_rng(2)
        for _ in range(50):
            before, after = two_triangles()
            top, bottom = random.uniform(.1, 3), random.uniform(-3, .05)
            before[3:, 2], after[3:, 2] = top, bottom
            part = largest_valid_step(before, after, FACES)
            self.assertTrue(is_valid(before, before + part * (after - before), FACES))
            self.assertAlmostEqual(part, min(1, top / (top - bottom)), delta=1e-8)
        before[3:, 2] = 0
        self.assertEqual(largest_valid_step(before, after, FACES), 0)

    def test_tables_of_a_report(self):
        bag = self.folder / 'scene.bag'
        run(TOOLS / 'make_scene_bag', CHECKOUT / 'config/scenes/table_edge.yaml', bag, '--frames', 45, '--quiet')
        run(TOOLS / 'analyze_bag', bag, '--report', self.folder / 'report', '--quiet')
        lines = self.run_example('read_tables.py', self.folder / 'report')
        self.assertRegex(lines[0], r'^\d+ of \d+ steps are clear$')
        self.assertRegex(lines[-1], r'^mesh +octomap +\d+ +\d+ +\d')

    def test_contacts_over_time(self):
        frames = self.folder / 'frames'
        frames.mkdir()
        t0, _ = two_triangles()
        for i in range(5):
            t0[3:, 2] = 1 - .4 * i
            meshio.write(frames / ('%d.ply' % (8 + i)), meshio.Mesh(t0, [('triangle', FACES.astype('i4'))]))
        lines = self.run_example('contacts_over_time.py', frames, self.folder / 'contacts.png', 10)
        self.assertEqual(len(lines), 4)
        self.assertEqual(lines[0], '0.100 s: proved, nothing touches')
        self.assertEqual(lines[2], '0.300 s: proved, something touches anew')
        self.assertEqual((self.folder / 'contacts.png').read_bytes()[1:4], b'PNG')

    def recorded(self, *arguments, contacts=True, params='{}', answered=4):
        """The bag of the example is read and proved by analyze_bag."""
        bag, report, given = self.folder / 'arrays.bag', self.folder / 'report', self.folder / 'given.yaml'
        lines = self.run_example('bag_from_arrays.py', arguments[0], bag, *arguments[1:])
        given.write_text(params)
        ran = run(TOOLS / 'analyze_bag', bag, '--report', report, '--quiet', '--params', given)
        self.assertEqual((ran.returncode, ran.stderr), (0, ''), ran.stdout)
        self.assertIn('in %d answered steps' % answered if not contacts else 'of %d answered steps' % answered, ran.stdout)
        self.assertEqual(ran.stdout.startswith('First contact '), contacts, ran.stdout)
        return lines[-1]

    def falling(self, dtype=float):
        """Five frames of the two triangles, of which the upper one is at the lower one's height in the middle of the third step."""
        frames = np.repeat(two_triangles(dtype)[0][np.newaxis], 5, axis=0)
        frames[:, 3:, 2] = .25 - .1 * np.arange(5)[:, np.newaxis]
        return frames

    def test_bag_from_arrays(self):
        frames, mesh = self.falling(np.float32), self.folder / 'mesh.ply'
        meshio.write(mesh, meshio.Mesh(frames[0], [('triangle', FACES.astype('i4'))]))
        np.save(self.folder / 'a.npy', frames)
        self.assertRegex(self.recorded(self.folder / 'a.npy', '--topology', mesh), '5 frames of 6 vertices, 2 faces and 0 lines')
        np.savez(self.folder / 'a.npz', positions=1000 * self.falling(), faces=FACES, times=np.arange(5) / 10, about=np.array({}))
        self.recorded(self.folder / 'a.npz', '--scale', 0.001, '--topic', '/cloth', '--frame', 'camera')
        rows = (self.folder / 'report/steps.csv').read_text().splitlines()
        self.assertIn('1300000000', rows[4].split(',')[2], 'the times of the archive, after a second')
        frames_folder = self.folder / 'meshes'
        frames_folder.mkdir()
        for i, positions in enumerate(self.falling()):
            meshio.write(frames_folder / ('%d.obj' % (8 + i)), meshio.Mesh(positions, [('triangle', FACES.astype('i4'))]))
        self.recorded(frames_folder)

    def test_bag_from_arrays_of_ropes(self):
        """Two pieces of rope that cross; as lines of a file, and as points in their order."""
        frames = np.zeros((5, 4, 3))
        frames[:, :2] = [[-1, 0, 0], [1, 0, 0]]
        frames[:, 2:] = [[0, -1, .25], [0, 1, .25]]
        frames[:, 2:, 2] -= .1 * np.arange(5)[:, np.newaxis]
        rope = self.folder / 'rope.obj'
        rope.write_text('v 0 0 0\n' * 4 + 'l 1 2\nl 3 4\n')
        meshio.write(self.folder / 'rope.vtk', meshio.Mesh(frames[0], [('line', np.array([[0, 1], [2, 3]]))]))
        np.save(self.folder / 'rope.npy', frames)
        self.assertRegex(self.recorded(self.folder / 'rope.npy', '--topology', self.folder / 'rope.vtk'), '0 faces and 2 lines')
        self.recorded(self.folder / 'rope.npy', params='topology: {source: file, file: %s}' % rope)
        # A branched cable, as on doc/messages.md: where three segments meet they do not touch.
        cable = np.repeat([[[0., 0, 0], [1, 0, 0], [2, 0, 0], [1, .5, 0], [1, 1, 0]]], 5, axis=0)
        np.save(self.folder / 'cable.npy', cable)
        rope.write_text('v 0 0 0\n' * 5 + 'l 1 2 3\nl 2 4 5\n')
        self.recorded(self.folder / 'cable.npy', params='topology: {source: file, file: %s}' % rope, contacts=False)
        cable[3:, 4] = [2, -.5, 0]  # the branch's end goes over to the other side, through the cable
        np.save(self.folder / 'cable.npy', cable)
        self.recorded(self.folder / 'cable.npy', params='topology: {source: file, file: %s}\nmax_vertex_step_m: 0.0' % rope)
        np.savez(self.folder / 'cable.npz', positions=cable, edges=[[0, 1], [1, 2], [1, 3], [3, 4]], time=np.arange(5) / 10)
        said = self.recorded(self.folder / 'cable.npz', params='max_vertex_step_m: 0.0')
        self.assertIn('0 faces and 4 lines', said)
        self.assertEqual((self.folder / 'report/steps.csv').read_text().splitlines()[2].split(',')[2], '1100000000')
        # A joint that is lost at first and seen again: nothing of it is claimed before, and the judge says so.
        lost = cable.copy()
        lost[0, 1] = np.nan
        np.savez(self.folder / 'lost.npz', positions=lost, edges=[[0, 1], [1, 2], [1, 3], [3, 4]])
        self.run_example('bag_from_arrays.py', self.folder / 'lost.npz', self.folder / 'lost.bag')
        self.assertEqual(run(TOOLS / 'audit_bag', self.folder / 'lost.bag', '--params', self.folder / 'given.yaml').returncode, 0)
        said = self.recorded(self.folder / 'cable.npy', '--topology', rope, params='max_vertex_step_m: 0.0')
        self.assertIn('0 faces and 4 lines', said, 'an OBJ has lines, which meshio does not read')
        judged = run(TOOLS / 'audit_bag', self.folder / 'arrays.bag', '--params', self.folder / 'given.yaml')
        self.assertEqual(judged.returncode, 0, judged.stdout)
        self.assertIn('4 claims hold', judged.stdout)
        rope.write_text('v 0 0 0\n' * 5)
        refused = run(sys.executable, CHECKOUT / 'examples/python/bag_from_arrays.py', self.folder / 'cable.npy', self.folder / 'no.bag',
                      '--topology', rope)
        self.assertRegex(refused.stderr, 'rope.obj: has neither triangles nor lines')

    def test_bag_from_arrays_refuses_what_makes_no_frames(self):
        np.save(self.folder / 'flat.npy', np.zeros((5, 6)))
        np.savez(self.folder / 'none.npz', a=np.zeros(3))
        np.save(self.folder / 'few.npy', np.zeros((5, 2, 3)))
        np.save(self.folder / 'objects.npy', np.array([{}]), allow_pickle=True)
        np.savez(self.folder / 'quads.npz', positions=np.zeros((5, 4, 3)), faces=[[0, 1, 2, 3]])
        mesh = self.folder / 'larger.ply'
        meshio.write(mesh, meshio.Mesh(two_triangles()[0], [('triangle', FACES.astype('i4'))]))
        for words, said in (([self.folder / 'flat.npy'], 'is an array of 5 x 6; frames x vertices x 3 is needed'),
                            ([self.folder / 'none.npz'], 'has no array of frames x vertices x 3'),
                            ([self.folder / 'objects.npy'], 'objects.npy: is no array of numbers'),
                            ([self.folder / 'quads.npz'], 'quads.npz: faces are whole numbers of faces x 3'),
                            ([self.folder / 'few.npy', '--topology', mesh], 'a face names vertex 5, and there are 2')):
            ran = run(sys.executable, EXAMPLES / 'bag_from_arrays.py', words[0], self.folder / 'no.bag', *words[1:])
            self.assertEqual(ran.returncode, 1)
            self.assertIn(said, ran.stderr)


if __name__ == '__main__':
    unittest.main()
