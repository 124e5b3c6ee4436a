"""The launch files' arguments against a parameter file: it is honoured, what is given on the command line wins over it."""
import os
import pathlib
import subprocess
import tempfile
import unittest

import rosgraph
import yaml

from checkout import CHECKOUT
from ros_process import free_port, stop, wait_for

NODE = '/collision_monitor/'
BODIES = '''
fixed_frame: world
minimum_separation_m: 0.012
look_ahead_s: 0.5
octomap_topic: /table
bodies:
  felt: {topic: /felt, topology: {rows: 3, cols: 4}}
  finger: {topic: /finger}
'''
EVERYTHING = '''
topic: /from_file
fixed_frame: from_file
octomap_topic: /map_from_file
octomap_file: /map/from_file.bt
topology: {source: grid, rows: 3, cols: 4}
accuracy: conservative
num_threads: 3
step_budget_ms: 7.5
look_ahead_s: 0.5
'''


class LaunchTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.home = pathlib.Path(folder.name)
        self.environment = {**os.environ, 'ROS_HOME': str(self.home), 'ROS_LOG_DIR': str(self.home)}

    def file(self, text):
        path = self.home / 'params.yaml'
        path.write_text(text)
        return 'params:=%s' % path

    def words(self, launch, *arguments):
        """The monitor's command line."""
        ran = subprocess.run(['roslaunch', '--args', NODE[:-1], str(CHECKOUT / 'launch' / launch), *arguments],
                             env=self.environment, capture_output=True, text=True, check=False)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        return set(ran.stdout.split())

    def parameters(self, launch, *arguments):
        """Those of the monitor that roslaunch would set, topology/rows and the like as they stand there."""
        ran = subprocess.run(['roslaunch', '--dump-params', str(CHECKOUT / 'launch' / launch), *arguments],
                             env=self.environment, capture_output=True, text=True, check=False)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        return {name[len(NODE):]: value for name, value in yaml.safe_load(ran.stdout).items() if name.startswith(NODE)}

    def test_a_file_alone(self):
        for launch in ('monitor.launch', 'replay.launch'):
            for text in (BODIES, EVERYTHING):
                with self.subTest(launch, text=text):
                    expected = {}

                    def flatten(tree, prefix=''):
                        for name, value in tree.items():
                            if isinstance(value, dict):
                                flatten(value, prefix + name + '/')
                            else:
                                expected[prefix + name] = value

                    flatten(yaml.safe_load(text))
                    self.assertEqual(self.parameters(launch, self.file(text)), expected, 'and nothing else')

    def test_arguments_win_over_the_file(self):
        given = {'fixed_frame': ('fixed_frame', 'mine'), 'octomap_file': ('octomap_file', '/mine.bt'), 'topology': ('topology/source', 'auto'),
                 'rows': ('topology/rows', 0), 'cols': ('topology/cols', 0), 'accuracy': ('accuracy', 'exact'),
                 'num_threads': ('num_threads', 1), 'step_budget_ms': ('step_budget_ms', 0.0),
                 'look_ahead_s': ('look_ahead_s', 0.0)}
        for launch in ('monitor.launch', 'replay.launch'):
            with self.subTest(launch):
                arguments = [self.file(EVERYTHING), 'mesh:=/mine', 'octomap:=/my_map']
                arguments += ['%s:=%s' % (argument, value) for argument, (_, value) in given.items()]
                found = self.parameters(launch, *arguments)
                # The default names, which the node is told to take for those that were given.
                self.assertEqual(found, {**dict(given.values()), 'topic': 'mesh', 'octomap_topic': 'octomap'})
                self.assertLessEqual({'mesh:=/mine', 'octomap:=/my_map'}, self.words(launch, *arguments))
                self.assertEqual({type(found[name]) for name in ('step_budget_ms', 'look_ahead_s')}, {float})

    def test_a_topic_for_the_map_wins_over_its_file(self):
        found = self.parameters('monitor.launch', self.file(EVERYTHING), 'octomap:=/my_map')
        self.assertEqual((found['octomap_topic'], found['octomap_file']), ('octomap', ''))

    def test_neither(self):
        for launch in ('monitor.launch', 'replay.launch'):
            found = self.parameters(launch)
            defaults = yaml.safe_load((CHECKOUT / 'config/monitor.yaml').read_text())
            self.assertEqual({name.split('/')[0] for name in found}, set(defaults))
            self.assertIn('octomap:=octomap_binary', self.words(launch))
        self.assertIn('mesh:=/cloth', self.words('replay.launch'))

    def test_demo(self):
        shown = {'markers/mesh': True, 'markers/obstacle_m': 1.0}
        found = self.parameters('demo.launch')
        self.assertLessEqual(set(shown.items()) | {('fixed_frame', 'world')}, set(found.items()))
        found = self.parameters('demo.launch', self.file(BODIES), 'accuracy:=screen')
        self.assertLessEqual(set(shown.items()) | {('bodies/felt/topic', '/felt'), ('accuracy', 'screen')}, set(found.items()))
        self.assertNotIn('topic', found)

    def test_a_monitor_starts_with_bodies_from_a_file(self):
        """And without what an earlier launch left on the same master."""
        port = free_port()
        self.environment.update(ROS_MASTER_URI='http://localhost:%d' % port, ROS_HOSTNAME='localhost')

        def start(*words):
            log = open(self.home / (words[0] + '.txt'), 'w')
            self.addCleanup(log.close)
            process = subprocess.Popen(words, env=self.environment, stdin=subprocess.DEVNULL, stdout=log,
                                       stderr=subprocess.STDOUT, start_new_session=True)
            self.addCleanup(stop, process)
            return process

        master = rosgraph.Master('/launch_test', self.environment['ROS_MASTER_URI'])
        start('roscore', '-p', str(port))
        wait_for(master.is_online, 30, 'the master')
        master.setParam(NODE + 'topology', {'rows': 5})
        start('roslaunch', '--wait', str(CHECKOUT / 'launch/monitor.launch'), self.file(BODIES))

        def subscribed():
            return {topic for topic, nodes in master.getSystemState()[1] if NODE[:-1] in nodes}

        try:
            wait_for(lambda: subscribed() >= {'/felt', '/finger'}, 30, 'the monitor')
        except TimeoutError:
            self.fail((self.home / 'roslaunch.txt').read_text())
        self.assertFalse(master.hasParam(NODE + 'topology'), 'an earlier launch shows through')


if __name__ == '__main__':
    unittest.main()
