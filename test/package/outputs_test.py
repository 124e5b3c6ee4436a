"""No tool writes over what it reads, and what a full disk does not take is an error."""
import resource
import signal
import subprocess
import unittest

from checkout import CHECKOUT, TOOLS, FolderTestCase

MESH = 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n'
RECORD = ('make_scene_bag', str(CHECKOUT / 'config/scenes/table_edge.yaml'), '--frames', '2', '--quiet')


def no_room():
    """A disk that is full after 20 kB of a file, in what runs after this."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))


class OutputsTest(FolderTestCase):
    def setUp(self):
        (self.folder / 'in').write_text(MESH)
        (self.folder / 'mesh.obj').write_text(MESH)
        if not (self.folder / 'link').exists():
            (self.folder / 'link').symlink_to('in')
            (self.folder / 'mesh').symlink_to('mesh.obj')

    def refused(self, name, *words, preexec_fn=None):
        ran = subprocess.run([str(TOOLS / name), *words], cwd=self.folder, capture_output=True, text=True, check=False,
                             preexec_fn=preexec_fn)
        self.assertEqual(ran.returncode, 1, ran.stdout + ran.stderr)
        self.assertEqual((self.folder / 'in').read_text(), MESH)
        self.assertEqual((self.folder / 'mesh.obj').read_text(), MESH)
        return ran.stderr

    def test_no_input_is_written_over(self):
        for name, *words in (('analyze_bag', 'in', '--report', 'report', '-o', 'in'),
                             ('analyze_bag', 'in', '--report', 'report', '-o', './link'),
                             ('analyze_bag', 'mesh.obj', '--report', 'report', '--params', 'in', '-o', 'link'),
                             ('make_scene_bag', 'in', 'link'), ('make_scene_bag', 'in', 'o', '--monitor-config', 'in'),
                             ('check_step', 'mesh.obj', 'mesh.obj', '--contacts', 'mesh'),
                             ('check_step', 'mesh.obj', 'mesh.obj', '--stats', 'mesh.obj')):
            self.assertIn('is the input', self.refused(name, *words), [name, *words])

    def test_a_full_disk_is_an_error(self):
        for option in ('--contacts', '--stats'):
            self.assertIn('/dev/full: cannot be written', self.refused('check_step', 'mesh.obj', 'mesh.obj', option, '/dev/full'))
        subprocess.run([str(TOOLS / RECORD[0]), *RECORD[1:], 'scene.bag'], cwd=self.folder, check=True, capture_output=True)
        for tool, *words in (RECORD + ('out.bag',), ('analyze_bag', 'scene.bag', '--report', 'report', '--quiet', '-o', 'out.bag')):
            self.assertRegex(self.refused(tool, *words, preexec_fn=no_room), '%s: out.bag: cannot be written: ' % tool)


if __name__ == '__main__':
    unittest.main()
