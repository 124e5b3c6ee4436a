"""Every command in README.md and doc/*.md works as it stands there.

Commands are taken from code blocks and from inline code that begins with one of the words below. Each is run, or its options
are held against the tool's own help, or it is in NOT_RUN with the reason. A command that is none of these fails the test.
"""
import os
import pathlib
import re
import shlex
import subprocess
import tempfile
import unittest

from checkout import CHECKOUT, TOOLS
from ros_process import SLOW, free_port, stop, wait_for

PAGES = [CHECKOUT / 'README.md'] + sorted((CHECKOUT / 'doc').glob('*.md'))
TOOL_NAMES = {'analyze_bag', 'check_step', 'make_scene_bag', 'replay_step', 'run_queries'}
WORDS = {'roslaunch', 'rosrun', 'rostopic', 'rosservice', 'rosbag', 'rosparam', 'cmake', 'catkin_make', 'doxygen', 'git',
         'apt-get'} | TOOL_NAMES
# Words of a command -> why it is not run here. A command that begins with them is excused.
NOT_RUN = {
    'scripts/demo': 'installs packages and takes minutes; its parts are run by the scene test and by hand on a fresh machine',
    'scripts/setup': 'installs packages',
    'scripts/benchmark': 'takes half an hour of a quiet machine',
    'scripts/test': 'is what runs this test',
    'scripts/package': 'installs packages and takes minutes; deb_test.py does it',
    'roslaunch deformable_ccd demo.launch': 'plays what scripts/demo recorded, or the recording in a package: deb_test.py does',
    'scripts/build': 'was run before this test, or there would be nothing to test',
    'doxygen': 'doxygen_test.py does it, in a folder of its own',
    'cmake -S . -B build-core': 'takes minutes; install_test.py configures it, scripts/test --aarch64 and --long build it',
    'rosbag play --rate-control-topic': "needs the reader's own bag",
}
if os.environ.get('DEFORMABLE_CCD_SANITIZED'):
    NOT_RUN['rosrun nodelet'] = "a library built with a sanitizer cannot be loaded by ROS's own program; nodelet.test loads it"


def code_of(page):
    """Commands of a page: lines of code blocks, without comments, and inline code."""
    fenced, found = False, []
    for line in page.read_text().splitlines():
        if line.lstrip().startswith('```'):
            fenced = not fenced
        elif fenced or re.match(r'    +\S', line):
            found.append(re.split(r'\s{2,}#|\s#\s', line.strip())[0].strip())
        else:
            found += re.findall(r'`([^`]+)`', line)
    for text in found:
        first = text.split()[0] if text.split() else ''
        if re.fullmatch(r'scripts/\w+', first) or (first in WORDS and ' ' in text):
            yield text


def commands():
    return sorted({text for page in PAGES for text in code_of(page)})


def excuse(command):
    words = command.split()
    return next((why for start, why in NOT_RUN.items() if words[:len(start.split())] == start.split()), None)


class CommandsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.home = pathlib.Path(cls.folder.name)
        cls.port = free_port()
        cls.environment = {**os.environ, 'ROS_MASTER_URI': 'http://localhost:%d' % cls.port, 'ROS_HOSTNAME': 'localhost',
                           'ROS_HOME': str(cls.home / 'ros'), 'PATH': '%s:%s' % (TOOLS, os.environ['PATH'])}
        cls.start(['roscore', '-p', str(cls.port)])
        # The bag of the pages' stories, and a monitor that works on it.
        subprocess.run(['make_scene_bag', str(CHECKOUT / 'config/scenes/table_edge.yaml'), str(cls.home / 'last_week.bag'),
                        '--frames', '20'], env=cls.environment, check=True, capture_output=True)
        wait_for(lambda: cls.run_command('rostopic list').returncode == 0, 30, 'the master')

    @classmethod
    def start(cls, words):
        process = subprocess.Popen(words, env=cls.environment, cwd=cls.home, stdin=subprocess.DEVNULL,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        cls.addClassCleanup(stop, process)
        return process

    @classmethod
    def run_command(cls, command, timeout=60):
        return subprocess.run(shlex.split(command), env=cls.environment, cwd=cls.home, capture_output=True, text=True,
                              timeout=timeout * SLOW, stdin=subprocess.DEVNULL, check=False)

    def expect_service(self, name):
        wait_for(lambda: name in self.run_command('rosservice list').stdout, 30, name)

    # One method for each kind of command.
    def run_forever(self, command, topic):
        """A node or a launch file: it comes up, and its topic is there."""
        process = self.start(shlex.split(command))
        try:
            wait_for(lambda: topic in self.run_command('rostopic list').stdout, 30, topic)
            self.assertIsNone(process.poll(), 'it ended')
        finally:
            stop(process)
            wait_for(lambda: topic not in self.run_command('rostopic list').stdout, 30, 'the end of ' + topic)

    def hold_against_help(self, command):
        """A synopsis: the tool knows every option in it."""
        tool = command.split()[0]
        text = self.run_command(tool + ' --help').stdout
        for option in re.findall(r'(?<![\w-])(--?[a-z][\w-]*)', command):
            self.assertRegex(text, r'(?<![\w-])%s(?![\w-])' % re.escape(option))

    def with_a_monitor(self, command, answers=True):
        """What asks a running monitor: against one that works on the bag in a loop."""
        if not hasattr(type(self), 'monitor'):
            type(self).monitor = self.start(['rosrun', 'deformable_ccd', 'collision_monitor_node', 'mesh:=/cloth',
                                             'octomap:=/octomap_binary'])
            self.start(['rosbag', 'play', '-l', '--quiet', 'last_week.bag'])
            self.expect_service('/collision_monitor/reset')
        words = shlex.split(command)
        once = ' '.join(words[:2] + ['-n', '1'] + words[2:]) if words[:2] == ['rostopic', 'echo'] else command
        ran = self.run_command(once)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        self.assertTrue(ran.stdout.strip() or not answers)

    def one(self, command):
        words = command.split()
        if words[0] in TOOL_NAMES:
            return self.hold_against_help(command)
        if words[:2] == ['rosrun', 'nodelet'] or words[:2] == ['roslaunch', 'deformable_ccd']:
            return self.run_forever(command, '/collision_monitor/clear')
        if words[:2] == ['rosrun', 'dynamic_reconfigure']:
            return self.with_a_monitor(command, answers=False)
        if words[:2] == ['rosrun', 'deformable_ccd'] and words[2] in TOOL_NAMES:
            ran = self.run_command(command, 300)
            return self.assertEqual(ran.returncode, 0, ran.stderr)
        if words[:2] == ['rosrun', 'deformable_ccd'] and words[2].startswith('stop_the_arm'):
            return self.run_forever(command, '/stop_the_arm/stop')
        if words[:2] == ['rosrun', 'deformable_ccd']:
            return self.run_forever(command, '/collision_monitor/clear')
        if words[0] in ('rostopic', 'rosservice'):
            return self.with_a_monitor(command)
        return self.fail('nobody knows how to run this; teach test/package/commands_test.py, or give a reason in NOT_RUN')

    def test_every_command_runs(self):
        found = [c for c in commands() if not excuse(c)]
        self.assertGreater(len(found), 8, 'the search found too little to mean anything')
        # Those that bring up a monitor first: the last kind keeps one running.
        last = ('rostopic', 'rosservice', 'rosrun dynamic_reconfigure')
        for command in sorted(found, key=lambda c: c.startswith(last)):
            with self.subTest(command):
                self.one(command)

    def test_scripts_know_the_options(self):
        for command in commands():
            words = command.split()
            if not words[0].startswith('scripts/'):
                continue
            with self.subTest(command):
                text = (CHECKOUT / words[0]).read_text()
                for option in re.findall(r'(?<!\S)(--[a-z][\w-]*)', command):
                    self.assertIn(option, text)


class TroubleshootingTest(unittest.TestCase):
    def test_every_tested_mistake_is_on_the_page(self):
        page = (CHECKOUT / 'doc/troubleshooting.md').read_text()
        test = (CHECKOUT / 'test/ros/mistakes_test.cpp').read_text()
        calls = re.findall(r'expectTold\("/\w+",\s*"((?:[^"\\]|\\.)*)",\s*"((?:[^"\\]|\\.)*)"', test)
        self.assertGreaterEqual(len(calls), 10)
        # Names of topics are the test's own.
        same = [re.sub(r'/\w+/(octomap|cloth)', r'/\1', text) for call in calls for text in call]
        page = page.replace('/octomap_binary', '/octomap')
        self.assertEqual([text for text in same if text not in page], [])


if __name__ == '__main__':
    unittest.main()
