"""Files: special ones where a mesh, a step, a bag or parameters are asked for, and text that is no UTF-8."""
import itertools
import os
import pathlib
import resource
import subprocess
import tempfile
import unittest

import rosbag
from attack import SLOW, AttackTest, flat_cloud


def limited():
    resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))


class FilesTest(AttackTest):
    def special_files(self, ending):
        folder = pathlib.Path(tempfile.mkdtemp(dir=self.folder))
        zero, pipe = folder / ('zero' + ending), folder / ('pipe' + ending)
        zero.symlink_to('/dev/zero')
        os.mkfifo(pipe)
        large = folder / ('large' + ending)
        with open(large, 'wb') as file:
            file.truncate(8 << 30)
        return [zero, pipe, large]

    def refused(self, command, words):
        done = subprocess.run([str(c) for c in command], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=30,
                              preexec_fn=None if SLOW > 1 else limited)  # sanitizers map more than that at the start
        self.assertNotEqual(done.returncode, 0, command)
        self.assertGreater(done.returncode, 0, 'ended by a signal: %s' % command)
        said = done.stdout + done.stderr
        self.assertRegex(said, words)
        self.assertLess(len(said), 4000)

    def test_special_files_are_refused(self):
        words = 'no regular file|at most'
        numbers = itertools.count()  # what one was given stays on the parameter server
        for ending in ('.stl', '.obj', '.ply', '.dae'):
            for path in self.special_files(ending):
                with self.subTest(path=path.name):
                    self.refused([self.tool('collision_monitor_node'), '__name:=reader_%d' % next(numbers), '_fixed_frame:=world',
                                  '_bodies/cloth/topic:=cloth', '_bodies/hand/rigid/frame:=hand',
                                  '_bodies/hand/rigid/mesh:=%s' % path], words)
        for path in self.special_files('.stl'):
            self.refused([self.tool('collision_monitor_node'), '__name:=reader_%d' % next(numbers), '_topology/file:=%s' % path], words)
        for path in self.special_files('.step'):
            self.refused([self.tool('replay_step'), path], words)
        bag = self.folder + '/some.bag'
        with rosbag.Bag(bag, 'w') as file:
            file.write('/mesh', flat_cloud(0))
        for path in self.special_files('.yaml'):
            self.refused([self.tool('analyze_bag'), bag, '--report', self.folder + '/report', '--params', path], words)
        for path in self.special_files('.bag')[:2]:
            self.refused([self.tool('analyze_bag'), path, '--report', self.folder + '/report'], words)
        for path in self.special_files('.bt')[:2]:  # a tool has no limit for a map that is not given
            self.refused([self.tool('analyze_bag'), bag, '--report', self.folder + '/report', '--octomap', path], words)
        for path in self.special_files('.yaml'):
            self.refused([self.tool('make_scene_bag'), path, self.folder + '/scene.bag'], words)

    def test_a_frame_id_that_is_no_utf8(self):
        folder = pathlib.Path(tempfile.mkdtemp(dir=self.folder))
        bag = folder / 'odd.bag'
        with rosbag.Bag(str(bag), 'w') as file:
            for i in range(4):
                message = flat_cloud(i)
                message.header.frame_id = 'world'
                file.write('/mesh', message, message.header.stamp)
        # rospy writes UTF-8 only: the byte is put there afterwards, where the length stays.
        data = bag.read_bytes()
        self.assertEqual(data.count(b'\x05\x00\x00\x00world'), 4)
        bag.write_bytes(data.replace(b'\x05\x00\x00\x00world', b'\x05\x00\x00\x00w\xffrld'))
        done = subprocess.run([str(self.tool('analyze_bag')), str(bag), '--report', str(folder / 'report')], timeout=60,
                              stdin=subprocess.DEVNULL, capture_output=True)
        self.assertEqual(done.returncode, 0, done.stderr[-500:])
        for name in ('report.json', 'report.html'):
            (folder / 'report' / name).read_text(encoding='utf-8')
            self.assertGreater((folder / 'report' / name).stat().st_size, 1000, name)


if __name__ == '__main__':
    unittest.main()
