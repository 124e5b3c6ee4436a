"""The launch files' arguments against a parameter file: it is honoured, what is given on the command line wins over it."""
import contextlib
import io
import os
import pathlib
import subprocess
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree

import rosgraph
import roslaunch
import roslaunch.arg_dump
import yaml

from checkout import CHECKOUT, TOOLS, run
from ros_process import SLOW, free_port, stop, wait_for

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
robot: {description: robot_from_file, semantic: semantic_from_file}
'''
# What the launch files set where the file does not.
DEFAULTS = {'monitor.launch': {}, 'replay.launch': {'default_topic': '/cloth'}}
LAUNCH_FILES = sorted((CHECKOUT / 'launch').rglob('*.launch'))
PRESETS = [path for path in LAUNCH_FILES if path.parent.name == 'presets']
# What a launch file has another default for than monitor.launch: of the presets, two call for a map.
OWN_DEFAULTS = {'octomap_server.launch': {'octomap': '/octomap_full'},
                'realsense.launch': {'obstacle_cloud': '/camera/depth/color/points'}, 'demo.launch': {'params', 'default_mesh'},
                'replay.launch': {'default_mesh'}}
# A cloth among several bodies: its file has it under bodies/cloth.
UNDER_BODIES = {'mesh', 'topology', 'rows', 'cols'}


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
        """The monitor's command line, as `roslaunch --args` has it, without a process for each."""
        return set(roslaunch.node_args.get_node_args(NODE[:-1], [(str(CHECKOUT / 'launch' / launch), list(arguments))]))

    def parameters(self, launch, *arguments):
        """Those of the monitor that roslaunch would set, topology/rows and the like as they stand there."""
        config = roslaunch.config.ROSLaunchConfig()
        roslaunch.xmlloader.XmlLoader().load(str(CHECKOUT / 'launch' / launch), config, argv=list(arguments), verbose=False)
        return {name[len(NODE):]: param.value for name, param in config.params.items() if name.startswith(NODE)}

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
                 'look_ahead_s': ('look_ahead_s', 0.0), 'robot': ('robot/description', '/r'),
                 'semantic': ('robot/semantic', '/s')}
        for launch in DEFAULTS:
            with self.subTest(launch):
                arguments = [self.file(EVERYTHING), 'mesh:=/mine', 'octomap:=/my_map']
                arguments += ['%s:=%s' % (argument, value) for argument, (_, value) in given.items()]
                found = self.parameters(launch, *arguments)
                # The default names, which the node is told to take for those that were given.
                self.assertEqual(found, {**dict(given.values()), 'topic': 'mesh', 'octomap_topic': 'octomap_binary'})
                self.assertLessEqual({'mesh:=/mine', 'octomap_binary:=/my_map'}, self.words(launch, *arguments))
                self.assertEqual({type(found[name]) for name in ('step_budget_ms', 'look_ahead_s')}, {float})

    def test_rviz_draws_bodies_and_map(self):
        """An empty view looks like a monitor that does not run."""
        found = self.parameters('monitor.launch', 'rviz:=true')
        self.assertEqual((found['markers/mesh'], found['markers/obstacle_m']), (True, 1.0))
        self.assertEqual(self.parameters('monitor.launch')['markers/mesh'], False)

    def test_a_topic_for_the_map_wins_over_its_file(self):
        found = self.parameters('monitor.launch', self.file(EVERYTHING), 'octomap:=/my_map')
        self.assertEqual((found['octomap_topic'], found['octomap_file']), ('octomap_binary', ''))

    def test_clouds_for_the_map(self):
        for launch, defaults in DEFAULTS.items():
            arguments = self.file('obstacle_resolution_m: 0.02\n'), 'obstacle_cloud:=/my_cloud'
            self.assertEqual(self.parameters(launch, *arguments),
                             {**defaults, 'obstacle_resolution_m': 0.02, 'obstacle_cloud_topic': 'obstacle_cloud'})
            self.assertIn('obstacle_cloud:=/my_cloud', self.words(launch, *arguments))

    def test_no_argument_is_called_required(self):
        """What `roslaunch --ros-args` says of each."""
        for path in LAUNCH_FILES:
            with self.subTest(path.name), contextlib.redirect_stdout(io.StringIO()) as said:
                roslaunch.arg_dump.dump_args([str(path)])
                self.assertIn('Optional Arguments:\n', said.getvalue())
                self.assertNotIn('Required', said.getvalue())

    def test_neither(self):
        for launch, defaults in DEFAULTS.items():
            found = self.parameters(launch)
            file = yaml.safe_load((CHECKOUT / 'config/monitor.yaml').read_text())
            self.assertEqual({name.split('/')[0] for name in found}, set(file) | set(defaults))
            self.assertEqual({name: found[name] for name in defaults}, defaults)

    def test_nobody_names_a_map_but_the_presets_that_do(self):
        """A remapping names a topic, and it holds for the resolved name, too: what the file calls /mesh would be sent
        elsewhere."""
        named = {'octomap_server.launch': ({'octomap_topic': 'octomap_binary'}, {'octomap_binary:=/octomap_full'}),
                 'realsense.launch': ({'obstacle_cloud_topic': 'obstacle_cloud'}, {'obstacle_cloud:=/camera/depth/color/points'}),
                 'sensor.launch': ({'obstacle_cloud_topic': '/camera/depth/image_raw'}, set())}
        for path in LAUNCH_FILES:
            with self.subTest(path.name):
                parameters = self.parameters(path)
                found = {name: parameters[name] for name in ('octomap_topic', 'octomap_file', 'obstacle_cloud_topic') if parameters.get(name)}
                words = {word for word in self.words(path) if word.startswith(('octomap', 'obstacle_cloud:=', 'mesh:='))}
                self.assertEqual((found, words), named.get(path.name, ({}, set())))

    def test_a_preset_keeps_what_is_its_own_under_a_file(self):
        for preset in PRESETS:
            own = CHECKOUT / 'config/presets' / (preset.stem + '.yaml')
            with self.subTest(preset.name):
                plain = self.parameters(preset, 'accuracy:=conservative', 'num_threads:=2')
                self.assertLessEqual({'accuracy': 'conservative', 'num_threads': 2}.items(), plain.items())
                self.assertIn('config/presets/' + own.name, preset.read_text())
                added = self.parameters(preset, self.file('max_step_s: 7.0\n'), 'accuracy:=conservative', 'num_threads:=2')
                self.assertEqual(added, {**plain, 'max_step_s': 7.0})

    def test_the_readme_says_which_frame_a_preset_sets(self):
        """A user with another one has NO_TRANSFORM, and has typed nothing of `map`."""
        readme = (CHECKOUT / 'README.md').read_text()
        frames = {preset.name: self.parameters(preset).get('fixed_frame') for preset in PRESETS}
        self.assertEqual(frames['octomap_server.launch'], 'map')
        for name, frame in frames.items():
            if frame and name in readme:
                self.assertIn('`%s` (its `fixed_frame` is `%s`;' % (name, frame), readme)

    def test_a_rope_of_cdcpd_has_no_rows(self):
        found = self.parameters('presets/cdcpd.launch', 'topology:=polyline')
        self.assertEqual(found['topology/source'], 'polyline')
        self.assertNotIn('topology/rows', found)
        self.assertEqual(self.parameters('presets/cdcpd.launch', 'topology:=grid')['topology/rows'], 20)

    def test_demo(self):
        shown = {'markers/mesh': True, 'markers/obstacle_m': 1.0}
        found = self.parameters('demo.launch')
        self.assertLessEqual(set(shown.items()) | {('fixed_frame', 'world')}, set(found.items()))
        found = self.parameters('demo.launch', self.file(BODIES), 'accuracy:=conservative')
        self.assertLessEqual(set(shown.items()) | {('bodies/felt/topic', '/felt'), ('accuracy', 'conservative')}, set(found.items()))
        self.assertNotIn('topic', found)

    def test_a_monitor_starts_with_bodies_from_a_file(self):
        """And without what an earlier launch left on the same master."""
        master = self.start_master()
        master.setParam(NODE + 'topology', {'rows': 5})
        self.launch_until_subscribed(master, {'/felt', '/finger'}, 'monitor.launch', self.file(BODIES))
        self.assertFalse(master.hasParam(NODE + 'topology'), 'an earlier launch shows through')
        stop(self.started)  # which flushes what it said
        self.expect_said('listens to felt: /felt (named), finger: /finger (named), octomap: /table (named), tf; publishes under '
                         '/collision_monitor')

    def test_a_monitor_listens_to_the_topics_that_the_file_names(self):
        """Also where they are those that the node has by default."""
        master = self.start_master()
        topics = self.launch_until_subscribed(master, {'/octomap', '/mesh'}, 'monitor.launch',
                                              self.file('{octomap_topic: /octomap, topic: /mesh}'))
        self.assertFalse(topics & {'/octomap_binary', '/cloth'})

    def test_a_replay_listens_to_the_topics_that_the_file_names(self):
        master = self.start_master()
        topics = self.launch_until_subscribed(
            master, {'/octomap', '/mesh'}, 'replay.launch', 'bag:=%s' % self.scene(), 'start_paused:=true',
            self.file('{octomap_topic: octomap, bodies: {mesh: {self_collision: true}}}'))
        self.assertFalse(topics & {'/octomap_binary', '/cloth'})

    def test_an_unknown_key_of_a_file_ends_a_preset_with_an_error(self):
        self.start_master()
        launched = self.start('roslaunch', '--wait', str(PRESETS[0]), self.file('acuracy: exact\n'))
        self.expect_said('cannot start: parameter ~acuracy')
        launched.wait(30)
        self.assertNotIn('earlier start', self.log_of('roslaunch').read_text(), 'the file has set it')

    def test_an_earlier_start_is_named_where_nothing_else_set_it(self):
        master = self.start_master()
        node = str(TOOLS / 'collision_monitor_node')
        self.start(node, '__name:=collision_monitor', '_acuracy:=exact').wait(30)
        self.expect_said('cannot start: parameter ~acuracy', node)
        self.assertNotIn('earlier start', self.log_of(node).read_text(), 'this one has set it')
        self.assertTrue(master.hasParam(NODE + 'acuracy'))
        self.start(node, '__name:=collision_monitor').wait(30)
        self.expect_said('(an earlier start may have left it: rosparam delete /collision_monitor)', node)

    def test_everybody_looks_for_the_map_in_the_same_place(self):
        """Node, nodelet, launch file and analyze_bag, where nobody named it."""
        default = 'octomap: /octomap_binary (default)'
        master = self.start_master()
        scene = self.scene()
        starts = [('roslaunch', '--wait', str(CHECKOUT / 'launch/demo.launch'), 'bag:=%s' % scene, self.file('{}')),
                  (str(TOOLS / 'collision_monitor_node'), '__name:=collision_monitor')]
        if SLOW == 1:  # a library built with a sanitizer cannot be loaded by ROS's own program
            starts.append(('rosrun', 'nodelet', 'nodelet', 'standalone', 'deformable_ccd/CollisionMonitor', '__name:=collision_monitor'))
        for words in starts:
            with self.subTest(words[0]):
                started = self.start(*words)
                wait_for(lambda: '/octomap_binary' in self.subscribed(master), 30, 'the monitor')
                # It answers once it stands. What is stopped before may be held up by roscpp, and is killed with what it said.
                subprocess.run(['rosservice', 'call', NODE + 'check_now'], env=self.environment, stdout=subprocess.DEVNULL, timeout=60, check=True)
                stop(started)  # which flushes what it said
                self.expect_said(default, words[0])
                wait_for(lambda: not self.subscribed(master), 30, 'its end')
                for parameter in ('/collision_monitor', '/use_sim_time'):
                    if master.hasParam(parameter):
                        master.deleteParam(parameter)
        self.assertIn(default + '\n', run(TOOLS / 'analyze_bag', scene, '--report', self.home / 'report', '--quiet').stdout)

    def scene(self):
        scene = self.home / 'scene.bag'
        run(TOOLS / 'make_scene_bag', CHECKOUT / 'config/scenes/table_edge.yaml', scene, '--frames', 2, '--quiet')
        return scene

    def log_of(self, program):
        return self.home / (pathlib.Path(program).name + '.txt')

    def expect_said(self, text, program='roslaunch'):
        try:
            wait_for(lambda: text in self.log_of(program).read_text(), 30, text)
        except TimeoutError:
            self.fail('%s: not said in\n%s' % (text, self.log_of(program).read_text()))

    def start(self, *words):
        log = open(self.log_of(words[0]), 'w')
        self.addCleanup(log.close)
        process = subprocess.Popen(words, env=self.environment, stdin=subprocess.DEVNULL, stdout=log,
                                   stderr=subprocess.STDOUT, start_new_session=True)
        self.addCleanup(stop, process)
        self.started = process
        return process

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
        try:
            wait_for(lambda: self.subscribed(master) >= topics, 30, 'the monitor')
        except TimeoutError:
            self.fail('%s\n%s' % (self.subscribed(master), self.log_of('roslaunch').read_text()))
        return self.subscribed(master)

    @staticmethod
    def subscribed(master):
        return {topic for topic, nodes in master.getSystemState()[1] if NODE[:-1] in nodes}


def arguments_of(path):
    """Those that can be given, with their defaults."""
    return {arg.get('name'): arg.get('default') for arg in ElementTree.parse(path).getroot().findall('arg')
            if arg.get('value') is None}


class ArgumentsTest(unittest.TestCase):
    """roslaunch passes over an argument that the file on its command line does not have: all of them have all."""

    def test_all_launch_files_pass_all_arguments_on(self):
        monitor = arguments_of(CHECKOUT / 'launch/monitor.launch')
        self.assertGreater(len(monitor), 12)
        self.assertEqual(len(PRESETS), 7)
        for path in LAUNCH_FILES:
            for include in ElementTree.parse(path).getroot().findall('include'):
                included = CHECKOUT / 'launch' / pathlib.Path(include.get('file')).name
                needed = set(arguments_of(included))
                if path.name == 'depth_camera.launch':
                    needed -= UNDER_BODIES | {'default_mesh'}
                    self.assertLessEqual(UNDER_BODIES, set(arguments_of(path)))
                    for name in UNDER_BODIES:
                        self.assertGreaterEqual(path.read_text().count("arg('%s')" % name), 1, name)
                with self.subTest(path.name):
                    self.assertEqual({arg.get('name'): arg.get('value') for arg in include.findall('arg')},
                                     {name: '$(arg %s)' % name for name in needed})
                    self.assertLessEqual(needed, set(arguments_of(path)))

    def test_the_defaults_are_the_same(self):
        monitor = arguments_of(CHECKOUT / 'launch/monitor.launch')
        for path in LAUNCH_FILES:
            own = set(OWN_DEFAULTS.get(path.name, {'default_mesh', 'params'} if path in PRESETS else ()))
            if path.name in ('octomap_server.launch', 'realsense.launch'):
                own |= {'params'}
            given = arguments_of(path)
            differing = {name for name in set(given) & set(monitor) if given[name] != monitor[name]}
            with self.subTest(path.name):
                self.assertLessEqual(differing, own)
                self.assertEqual(given.get('octomap'),
                                 '/octomap_full' if path.name == 'octomap_server.launch' else '-')


if __name__ == '__main__':
    unittest.main()
