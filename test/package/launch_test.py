"""The launch files' arguments against a parameter file: it is honoured, what is given on the command line wins over it."""
import os
import pathlib
import subprocess
import tempfile
import unittest

import rosgraph
import yaml

from checkout import CHECKOUT, TOOLS
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
# What the launch files set where the file does not.
DEFAULTS = {'monitor.launch': {'octomap_topic': 'octomap_binary'},
            'replay.launch': {'octomap_topic': 'octomap_binary', 'default_topic': '/cloth'}}


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
        for launch, defaults in DEFAULTS.items():
            for text in (BODIES, EVERYTHING):
                with self.subTest(launch, text=text):
                    expected = dict(defaults)

                    def flatten(tree, prefix=''):
                        for name, value in tree.items():
                            if isinstance(value, dict):
                                flatten(value, prefix + name + '/')
                            else:
                                expected[prefix + name] = value

                    flatten(yaml.safe_load(text))  # over the launch file's defaults
                    self.assertEqual(self.parameters(launch, self.file(text)), expected, 'and nothing else')

    def test_arguments_win_over_the_file(self):
        given = {'fixed_frame': ('fixed_frame', 'mine'), 'octomap_file': ('octomap_file', '/mine.bt'), 'topology': ('topology/source', 'auto'),
                 'rows': ('topology/rows', 0), 'cols': ('topology/cols', 0), 'accuracy': ('accuracy', 'exact'),
                 'num_threads': ('num_threads', 1), 'step_budget_ms': ('step_budget_ms', 0.0),
                 'look_ahead_s': ('look_ahead_s', 0.0)}
        for launch in DEFAULTS:
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
        for launch, defaults in DEFAULTS.items():
            found = self.parameters(launch)
            file = yaml.safe_load((CHECKOUT / 'config/monitor.yaml').read_text())
            self.assertEqual({name.split('/')[0] for name in found}, set(file) | set(defaults))
            self.assertEqual({name: found[name] for name in defaults}, defaults)

    def test_names_that_are_not_given_are_not_remapped(self):
        """A remapping holds for the resolved name, too: what the file calls /octomap or /mesh would be sent elsewhere."""
        for launch in DEFAULTS:
            self.assertFalse([word for word in self.words(launch) if word.startswith(('octomap:=', 'mesh:='))], launch)

    def test_demo(self):
        shown = {'markers/mesh': True, 'markers/obstacle_m': 1.0}
        found = self.parameters('demo.launch')
        self.assertLessEqual(set(shown.items()) | {('fixed_frame', 'world')}, set(found.items()))
        found = self.parameters('demo.launch', self.file(BODIES), 'accuracy:=screen')
        self.assertLessEqual(set(shown.items()) | {('bodies/felt/topic', '/felt'), ('accuracy', 'screen')}, set(found.items()))
        self.assertNotIn('topic', found)

    def test_a_monitor_starts_with_bodies_from_a_file(self):
        """And without what an earlier launch left on the same master."""
        master = self.start_master()
        master.setParam(NODE + 'topology', {'rows': 5})
        self.launch_until_subscribed(master, {'/felt', '/finger'}, 'monitor.launch', self.file(BODIES))
        self.assertFalse(master.hasParam(NODE + 'topology'), 'an earlier launch shows through')

    def test_a_monitor_listens_to_the_topics_that_the_file_names(self):
        """Also where they are those that the node has by default."""
        master = self.start_master()
        topics = self.launch_until_subscribed(master, {'/octomap', '/mesh'}, 'monitor.launch',
                                              self.file('{octomap_topic: /octomap, topic: /mesh}'))
        self.assertFalse(topics & {'/octomap_binary', '/cloth'})

    def test_a_replay_listens_to_the_topics_that_the_file_names(self):
        master = self.start_master()
        scene = self.home / 'scene.bag'
        subprocess.run([str(TOOLS / 'make_scene_bag'), str(CHECKOUT / 'config/scenes/table_edge.yaml'), str(scene),
                        '--frames', '2', '--quiet'], check=True, stdin=subprocess.DEVNULL)
        topics = self.launch_until_subscribed(
            master, {'/octomap', '/mesh'}, 'replay.launch', 'bag:=%s' % scene, 'start_paused:=true',
            self.file('{octomap_topic: octomap, bodies: {mesh: {self_collision: true}}}'))
        self.assertFalse(topics & {'/octomap_binary', '/cloth'})

    def start(self, *words):
        log = open(self.home / (words[0] + '.txt'), 'w')
        self.addCleanup(log.close)
        process = subprocess.Popen(words, env=self.environment, stdin=subprocess.DEVNULL, stdout=log,
                                   stderr=subprocess.STDOUT, start_new_session=True)
        self.addCleanup(stop, process)

    def start_master(self):
        port = free_port()
        self.environment.update(ROS_MASTER_URI='http://localhost:%d' % port, ROS_HOSTNAME='localhost')
        master = rosgraph.Master('/launch_test', self.environment['ROS_MASTER_URI'])
        self.start('roscore', '-p', str(port))
        wait_for(master.is_online, 30, 'the master')
        return master

    def launch_until_subscribed(self, master, topics, launch, *arguments):
        """All that the monitor listens to, as soon as these topics are among it."""
        self.start('roslaunch', '--wait', str(CHECKOUT / 'launch' / launch), *arguments)

        def subscribed():
            return {topic for topic, nodes in master.getSystemState()[1] if NODE[:-1] in nodes}

        try:
            wait_for(lambda: subscribed() >= topics, 30, 'the monitor')
        except TimeoutError:
            self.fail('%s\n%s' % (subscribed(), (self.home / 'roslaunch.txt').read_text()))
        return subscribed()


if __name__ == '__main__':
    unittest.main()
