"""`watch` as a person has it: on a terminal and without one, beside a node that is fed, starves and ends."""
import fcntl
import os
import pathlib
import pty
import re
import runpy
import shutil
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import unittest

from deformable_ccd.msg import SafeUntil, State, StepStats

from checkout import CHECKOUT, TOOLS
from ros_process import SLOW, free_port, stop, wait_for

WATCH = CHECKOUT / 'src/apps/watch'


class Terminal:
    """A program on a terminal, and what it shows."""

    def __init__(self, command, environment, rows=40, columns=120):
        own, its = pty.openpty()
        fcntl.ioctl(its, termios.TIOCSWINSZ, struct.pack('HHHH', rows, columns, 0, 0))
        self.process = subprocess.Popen(command, env={**environment, 'TERM': 'xterm-256color'}, stdin=its, stdout=its,
                                        stderr=its, start_new_session=True)
        os.close(its)
        self.file, self.text = own, ''
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        try:
            while True:
                self.text += os.read(self.file, 65536).decode(errors='replace')
        except OSError:  # the program has ended
            pass

    def screen(self):
        """The newest whole screen: the view begins each at the upper left corner."""
        screens = self.text.split('\x1b[H')
        return re.sub(r'\x1b\[[?\d;]*[A-Za-z]', '', screens[-2] if len(screens) > 2 else '')


class NearestTest(unittest.TestCase):
    """The line of the two partners that came nearest, of what ~state says."""

    def lines_of(self, **fields):
        seen = object.__new__(runpy.run_path(str(WATCH))['Seen'])  # which no master knows
        seen.last, seen.diagnostics = {'state': (0, State(**fields))}, (0, None)
        return {name: (words, colour) for name, words, colour in seen.lines()}

    def test_it_is_there_where_distances_are_measured(self):
        nan = float('nan')
        self.assertNotIn('nearest', self.lines_of(clearance_lower=nan, clearance_upper=nan))
        for lower, upper, words in ((0.01234, 0.01239, '0.0123 to 0.0124 m apart'), (0.5, nan, 'more than 0.5000 m apart'),
                                    (nan, nan, 'how near is not known')):
            said, colour = self.lines_of(clearance_lower=lower, clearance_upper=upper, clearance_between='cloth and octomap')['nearest']
            self.assertEqual(said, 'cloth and octomap, ' + words)
            self.assertEqual(colour, 'yellow' if 'not known' in words else None)


class PromisedTest(unittest.TestCase):
    """The line of the promises of ~safe_until."""

    def test_for_how_long_and_whether_they_were_kept(self):
        promised, stats = runpy.run_path(str(WATCH))['promised'], StepStats(promises=92, promises_kept=86, promises_broken=5)
        promise = SafeUntil(seconds=0.14, bodies=['cloth', 'octomap'])
        self.assertEqual(promised(promise, stats), '140 ms from the frame on, by cloth and octomap; 86 kept, 5 void, 1 not looked at')
        promise = SafeUntil(reason='something touches', broken="body 'cloth' was faster than 1 m/s")
        self.assertEqual(promised(promise, stats),
                         "no promise: something touches; 86 kept, 5 void, 1 not looked at; body 'cloth' was faster than 1 m/s")
        promise = SafeUntil(seconds=2, bodies=['', ''])
        self.assertEqual(promised(promise, stats), '2.0 s from the frame on; 86 kept, 5 void, 1 not looked at', 'no pair limits it')


class WatchTest(unittest.TestCase):
    def setUp(self):
        self.home = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.home, True)
        self.port = free_port()
        self.environment = {**os.environ, 'ROS_MASTER_URI': 'http://localhost:%d' % self.port, 'ROS_HOSTNAME': 'localhost',
                            'ROS_HOME': str(self.home), 'ROS_LOG_DIR': str(self.home), 'PYTHONUNBUFFERED': '1'}

    def start(self, *command):
        process = subprocess.Popen([str(c) for c in command], env=self.environment, stdin=subprocess.DEVNULL,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        self.addCleanup(stop, process)
        return process

    def refused(self, *arguments):
        ran = subprocess.run([sys.executable, WATCH, *arguments], env=self.environment, capture_output=True, text=True,
                             timeout=60 * SLOW, check=False)
        self.assertEqual((ran.returncode, ran.stdout), (1, ''))
        return ran.stderr

    def test_a_run_from_its_begin_to_the_end_of_the_node(self):
        self.assertRegex(self.refused(), r'^watch: there is no master at \S+; ')
        self.start('roscore', '-p', self.port)
        wait_for(lambda: 'no monitor runs: nobody publishes' in self.refused(), 30, 'the master')

        scene, bag, params = CHECKOUT / 'config/scenes/table_edge.yaml', self.home / 'scene.bag', self.home / 'scene.yaml'
        subprocess.run([TOOLS / 'make_scene_bag', scene, bag, '--monitor-config', params, '--quiet'], check=True)
        subprocess.run(['rosparam', 'load', params, '/cloth_monitor'], env=self.environment, check=True)
        subprocess.run(['rosparam', 'set', '/cloth_monitor/look_ahead_s', '0.1'], env=self.environment, check=True)
        node = self.start(TOOLS / 'collision_monitor_node', '__name:=cloth_monitor')
        wait_for(lambda: 'no monitor runs as /other; these do: /cloth_monitor' in self.refused('other'), 30, 'the node')

        lines = open(self.home / 'lines.txt', 'w+')
        self.addCleanup(lines.close)
        plain = subprocess.Popen([sys.executable, WATCH, 'cloth_monitor'], env=self.environment, stdout=lines, start_new_session=True)
        self.addCleanup(stop, plain)
        view = Terminal([sys.executable, str(WATCH)], self.environment)
        self.addCleanup(stop, view.process)
        narrow = Terminal([sys.executable, str(WATCH)], self.environment, 24, 80)
        self.addCleanup(stop, narrow.process)

        def shows(pattern, seconds=40):
            try:
                wait_for(lambda: re.search(pattern, view.screen()), seconds, pattern)
            except TimeoutError as late:
                self.fail('%s on\n%s' % (late, view.screen()))
            return re.search(pattern, view.screen())

        shows('/cloth_monitor')
        shows(r'STALE|no step since')
        player = self.start('rosbag', 'play', '--quiet', bag)
        # Patches, contacts, expected ones, area, how long, the next one and the newest one.
        shows(r'cloth and octomap +[1-9]\d* +[1-9]\d* +\d+ +\d+\.\d{4} +[\d.]+ m?s +(?:in -?\d+ m?s)? +[\d.]+ m?s ago')
        wait_for(lambda: 'octomap' in narrow.screen().split('partners')[-1], 20, 'the view of 80 x 24')
        self.assertRegex(narrow.screen(), r'partners +patches +contacts')
        self.assertNotIn('…', narrow.screen(), 'nothing of the table is cut off')
        self.assertIn('Ctrl-C ends this view', narrow.screen(), 'nor is the end')
        self.assertNotIn('STALE', view.screen())
        screen = view.screen()
        for pattern in (r'PROVED, ', r'reason +\S', r'steps +\d+\.\d a second; from frame to answer \d+\.\d ms',
                        r'frames +\d+ received, \d+ waiting, \d+ skipped', r'map +\d+ leaves', r'running .*octomap', r'off +\S'):
            self.assertRegex(screen, pattern)
        self.assertGreater(float(re.search(r'steps +([\d.]+) a second', screen).group(1)), 0)

        wait_for(lambda: player.poll() is not None, 60, 'the end of the recording')
        shows(r'STALE: no step for [\d.]+ s, but the node lives')
        stop(node)
        shows('the node is gone; what follows is the last')
        wait_for(lambda: 'the node is gone' in (self.home / 'lines.txt').read_text(), 20, 'a line of it')
        stop(view.process)
        stop(plain)
        self.assertEqual((view.process.returncode, plain.returncode), (0, 0), view.text[-500:])
        said = (self.home / 'lines.txt').read_text()
        self.assertNotIn('\x1b', said)
        self.assertRegex(said, r'(?m)^\d\d:\d\d:\d\d PROVED, .*; cloth and octomap: (?:1 patch|[2-9]\d* patches|1\d+ patches); ')
        self.assertLess(len(said.splitlines()), 200, 'a line for each change, not for each look')


if __name__ == '__main__':
    unittest.main()
