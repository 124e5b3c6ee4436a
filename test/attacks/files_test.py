"""Files: special ones where a mesh, a step, a bag or parameters are asked for, a folder that two monitors record into, a disk that is
full."""
import itertools
import os
import pathlib
import re
import resource
import subprocess
import tempfile
import unittest

import rosbag
import rospy
from attack import SLOW, AttackTest, flat_cloud
from std_srvs.srv import Trigger



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

    def test_two_monitors_in_one_folder(self):
        folder = pathlib.Path(self.folder) / 'shared'
        names = ('left', 'right')
        answers = {}
        for name in names:
            self.start_node(name, record_folder=folder, record_steps=2)
            self.outcomes_of(self.publisher, [flat_cloud(i) for i in range(4)])
            for _ in range(2):
                answer = rospy.ServiceProxy('/%s/record_step' % name, Trigger)()
                self.assertTrue(answer.success, answer.message)
                answers.setdefault(name, []).append(answer.message.split('\n'))
        files = [f for said in answers.values() for files in said for f in files]
        self.assertEqual(len(files), 8)
        self.assertEqual(sorted(files), sorted(str(p) for p in folder.iterdir()), 'each name is another file')
        for name in names:
            for said in answers[name]:
                self.assertTrue(all(name in pathlib.Path(f).name for f in said), said)
                stamps = [int(re.search(r'_(\d{10,})', f).group(1)) for f in said]
                self.assertEqual(stamps, sorted(stamps, reverse=True), 'the newest first')

    def test_a_disk_that_gets_full(self):
        folder = pathlib.Path(self.folder) / 'filling'
        folder.mkdir()
        self.start_node('filling', record_folder=folder, record_steps=3)
        self.outcomes_of(self.publisher, [flat_cloud(i) for i in range(4)])
        oldest = self.contacts[-3].header.stamp.to_nsec()
        (folder / ('step_filling_2_%d.step.part' % oldest)).symlink_to('/dev/full')
        answer = rospy.ServiceProxy('/filling/record_step', Trigger)()
        self.assertFalse(answer.success)
        self.assertIn('No space left on device', answer.message)
        written = sorted(str(p) for p in folder.iterdir())
        self.assertEqual(len(written), 2, 'the two newest')
        for path in written:
            self.assertIn(path, answer.message)
        self.assertTrue(any(str(self.contacts[-1].header.stamp.to_nsec()) in path for path in written))

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
