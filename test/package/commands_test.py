"""Every command in README.md, the pages beside it and doc/*.md works as it stands there.

Commands are the lines of code blocks and the inline code that begin with a program. Each is run by a shell that knows no more
than a user's: it has sourced what the README says to source. A synopsis is held against the tool's own help. What is not run
is in NOT_RUN with the reason, and a command that nobody knows how to run fails the test. scripts/test runs this file in a bare
root, too (scripts/lib/bare_root.py), where nothing is installed but what the README's first command installed.
"""
import concurrent.futures
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import tempfile
import time
import unittest

import yaml

from checkout import CHECKOUT, TOOLS
from ros_process import SLOW, free_port, stop, wait_for

PAGES = sorted(CHECKOUT.glob('*.md')) + sorted((CHECKOUT / 'doc').glob('*.md'))
WORKSPACE = TOOLS.parents[2]
TRACKER = pathlib.Path(__file__).with_name('emulated_tracker.py')
# Programs that need not be installed here to be known for commands.
WORDS = {'source', '.', 'cd', 'echo', 'roslaunch', 'rosrun', 'rostopic', 'rosservice', 'rosbag', 'rosparam', 'rosmsg', 'roscore', 'cmake',
         'catkin_make', 'doxygen', 'git', 'apt', 'apt-get', 'sudo', 'dpkg-buildpackage', 'vcs', 'rosdep', 'clang-format',
         'qemu-x86_64-static', 'analyze_bag', 'check_step', 'make_scene_bag', 'replay_step'}
# Words that are programs too, but stand on the pages as what they mean in English or in a file.
PROSE = {'file', 'link', 'test', 'map', 'time', 'at', 'find', 'look', 'of', 'more', 'if', 'for', 'while', 'case', 'then', 'true', 'false',
         'size', 'head', 'as', 'cut', 'sort', 'split', 'join', 'type', 'who', 'which', 'last', 'read', 'set', 'c++', 'watch', 'bc',
         'import', 'see'}
# Words that a command begins with -> why it is not run here.
NOT_RUN = {
    'scripts/demo': 'is the first command in the bare root (scripts/lib/newcomer.sh)',
    'scripts/setup': 'installs packages; the demo and the tests call it',
    'scripts/benchmark': 'takes half an hour of a quiet machine',
    'scripts/test': 'is what runs this test; --fresh and --long are run by hand',
    'scripts/pictures': 'needs a browser and RViz, and takes minutes',
    'scripts/wheel': 'installs packages and takes minutes; wheel_test.py does it',
    'python3 -m venv': 'is for what scripts/wheel makes; wheel_test.py does it',
    'scripts/package': 'installs packages and takes minutes; deb_test.py does it',
    'apt': 'installs or removes what scripts/package makes; deb_test.py does it',
    'scripts/build': 'was run before this test, or there would be nothing to test',
    'doxygen': 'doxygen_test.py does it, in a folder of its own',
    'cmake -S . -B build-core': 'installs into the system: it is run in the bare root alone',
    'cmake -G Ninja': 'takes minutes and another compiler',
    'qemu-x86_64-static': 'takes minutes and an emulator',
    'catkin_make': 'builds all of it once more; scripts/build is a catkin_make',
    'git clone': 'needs the place that the reader cloned from',
    'rosbag play --rate-control-topic': "needs the reader's own bag",
    'rosbag reindex': 'needs a damaged bag; damaged_bag_test.py runs it on one',
}
if os.environ.get('DEFORMABLE_CCD_IN_BARE_ROOT'):
    del NOT_RUN['cmake -S . -B build-core']
if os.environ.get('DEFORMABLE_CCD_SANITIZED'):
    NOT_RUN['rosrun nodelet'] = "a library built with a sanitizer cannot be loaded by ROS's own program; nodelet.test loads it"
# Of each example that follows the monitor: a topic of its own, and what it says there.
CLIENTS = {'stop_the_arm': ('/stop_the_arm/stop', 'data: (True|False)'), 'slow_the_arm': ('/slow_the_arm/scale', r'data: [\d.]+'),
           'guard_twist': ('/guard_twist/twist', r'x: -?0\.0')}
# What stands for a value of the reader's in a command, and what is put there.
PLACEHOLDERS = {'FILE': None, 'v,a,b,c': '100,0,1,30', 'v,x,y,z': '0,32768,32768,32768'}


def program_of(text):
    """The program of a command line, or nothing where the text is no command."""
    words = re.sub(r'^(\w+=\S+\s+)+', '', text).split()
    if not words:
        return None
    first = words[0]
    if first in WORDS or re.match(r'(scripts|build|examples)/[\w/]+$', first):
        return first
    known = re.fullmatch(r'[a-z][\w.+-]*', first) and first not in PROSE and shutil.which(first)
    return first if known else None


def code_of(page):
    """Commands of a page in their order: lines of code blocks without comments, and inline code."""
    language, found = None, []
    for line in page.read_text().splitlines():
        fence = re.match(r'\s*```(\w*)', line)
        if fence:
            language = None if language is not None else fence.group(1)
        elif language in ('', 'sh', 'bash', 'shell') or (language is None and re.match(r'    +\S', line)):
            found.append(re.split(r'\s{2,}#|\s#\s', line.strip())[0].strip())
        elif language is None:
            found += [text for text in re.findall(r'`([^`]+)`', line) if ' ' in text or text.startswith('scripts/')]
    return [text for text in found if program_of(text)]


def commands():
    return list(dict.fromkeys(text for page in PAGES for text in code_of(page)))


def excuse(command):
    words = re.sub(r'^(\w+=\S+\s+)+', '', command).split()
    return next((why for start, why in NOT_RUN.items() if words[:len(start.split())] == start.split()), None)


def synopsis(command):
    """Whether it shows what can be given instead of being something to type."""
    return bool(re.search(r'\[--?\w|\bDIR\b|…|\b(IN|OUT|SCENE|FRAME_0|FRAMES)\b', command))


class CommandsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        # The reader types in the checkout; what that writes shall not stay there, so that here it is a folder of links.
        cls.home = pathlib.Path(folder.name)
        for entry in CHECKOUT.iterdir():
            (cls.home / entry.name).symlink_to(WORKSPACE if entry.name == 'build' else entry)
        port = free_port()
        cls.environment = {'PATH': '/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin', 'HOME': str(cls.home),
                           'LANG': 'C.UTF-8', 'ROS_MASTER_URI': 'http://localhost:%d' % port, 'ROS_HOSTNAME': 'localhost',
                           'ROS_HOME': str(cls.home / 'ros')}
        cls.environment.update({k: v for k, v in os.environ.items() if k.endswith('SAN_OPTIONS')})
        sourced = re.search(r'^ +(source build/\S+)', (CHECKOUT / 'README.md').read_text(), re.M)
        cls.source = sourced.group(1) if sourced else 'false'
        cls.start('roscore -p %d' % port)
        # The bag of the pages' stories: the demo's cloth as a tracker would send it, 20 x 30 points row by row.
        scene = yaml.safe_load((CHECKOUT / 'config/scenes/table_edge.yaml').read_text())
        scene['bodies'][0]['topic'] = scene['monitor']['bodies']['cloth']['topic'] = '/tracker/cloth'
        scene['bodies'][0]['sheet'].update(rows=20, cols=30)
        scene['bodies'][0]['grippers'][-1]['col'] = 29
        (cls.home / 'tracked.yaml').write_text(yaml.safe_dump(scene))
        ran = cls.shell('rosrun deformable_ccd make_scene_bag tracked.yaml last_week.bag --output point_cloud_grid')
        if ran.returncode != 0:
            raise RuntimeError(ran.stderr)
        # Files that a page shows under a name, to be saved as that.
        for page in PAGES:
            for name, block in re.findall(r'As\s`([\w.]+)`:\n\n```\w*\n(.*?)```', page.read_text(), re.S):
                (cls.home / name).write_text(block)
        wait_for(lambda: cls.shell('rostopic list').returncode == 0, 30, 'the master')
        cls.monitor = None

    @classmethod
    def line(cls, command):
        return ['bash', '-c', 'set -e; %s; set +e; %s' % (cls.source, command)]

    @classmethod
    def start(cls, command):
        """What runs until it is stopped."""
        path = cls.home / ('%02d.log' % len(list(cls.home.glob('*.log'))))
        with open(path, 'w') as log:
            process = subprocess.Popen(cls.line('exec ' + command), env=cls.environment, cwd=cls.home,
                                       stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, start_new_session=True)
        process.log = path
        cls.addClassCleanup(stop, process)
        return process

    @classmethod
    def shell(cls, command, timeout=60):
        return subprocess.run(cls.line(command), env=cls.environment, cwd=cls.home, capture_output=True, text=True,
                              timeout=timeout * SLOW, stdin=subprocess.DEVNULL, check=False)

    def runs(self, command, timeout=300):
        ran = self.shell(command, timeout)
        self.assertEqual(ran.returncode, 0, ran.stdout[-2000:] + ran.stderr[-2000:])
        return ran.stdout

    def test_the_readme_says_what_to_source(self):
        self.assertNotEqual(self.source, 'false', 'no line "source build/…" in a code block of README.md')
        self.assertIn('deformable_ccd', self.runs('rospack find deformable_ccd'))

    def test_the_tracker_says_that_it_takes_no_arguments(self):
        ran = self.shell('timeout 30 rosrun deformable_ccd publish_cloth.py --help', 60)
        self.assertEqual(ran.returncode, 1, 'it published until it was stopped')
        self.assertIn('It takes no arguments', ran.stderr)

    # One method for each kind of command.
    def tracker_of(self, command):
        """The emulated publisher that a launched monitor is meant for."""
        given = dict(re.findall(r'(\w+):=(\S+)', command))
        preset = re.search(r'(cdcpd|trackdlo|fabric_simulator|octomap_server|depth_camera)\.launch', command)
        kind, topic, rows, cols, frame = {
            'cdcpd': ('cloud', '/cdcpd/tracker_points', 20, 20, 'world'), 'trackdlo': ('cloud', '/trackdlo/results_pc', 1, 40, 'world'),
            'fabric_simulator': ('markers', '/fabric_markers', 8, 8, 'world'),
            'octomap_server': ('grid', '/mesh', 10, 10, 'map'),
            'depth_camera': ('camera', '/mesh', 10, 10, 'world')}.get(preset and preset.group(1), ('grid', '/mesh', 10, 10, 'world'))
        children = []
        if 'params' in given:
            bodies = yaml.safe_load((self.home / given['params']).read_text())['bodies']
            tracked = next(body for body in bodies.values() if 'topic' in body)
            given.update(tracked['topology'], mesh=tracked['topic'])
            children = [body['rigid']['frame'] for body in bodies.values() if 'rigid' in body]
        if 'rows' in given:
            kind, rows, cols = 'cloud', given['rows'], given['cols']
        elif given.get('topology') == 'polyline':
            kind, rows, cols = 'cloud', 1, 40
        return ' '.join(map(str, ['/usr/bin/env python3', TRACKER, kind, given.get('mesh', topic), rows, cols,
                                  given.get('fixed_frame', frame), *children]))

    def answers(self, monitor):
        """Waits until a monitor has answered a step."""
        def answered():
            self.assertIsNone(monitor.poll(), 'it ended: ' + monitor.log.read_text()[-2000:])
            return 'True' in self.shell('timeout 5 rostopic echo -n 1 /collision_monitor/first_contact/answered').stdout
        try:
            wait_for(answered, 40, 'an answer')
        except TimeoutError as late:
            self.fail('%s\n%s' % (late, monitor.log.read_text()[-3000:]))

    def gone(self, topic):
        """A reader's master ends with his roslaunch and takes its parameters along; this one stays."""
        wait_for(lambda: topic not in self.shell('rostopic list').stdout.split(), 30, 'the end of ' + topic)
        self.shell('rosparam delete /collision_monitor; rosparam delete /use_sim_time')

    def run_monitor(self, command):
        """A node, nodelet or launch file: an emulated tracker sends, and it answers."""
        self.stop_monitor()
        tracker, monitor = self.start(self.tracker_of(command)), self.start(command)
        try:
            self.answers(monitor)
        finally:
            stop(monitor)
            stop(tracker)
            self.gone('/collision_monitor/clear')

    @classmethod
    def stop_monitor(cls):
        for process in cls.monitor or ():
            stop(process)
        cls.monitor = None

    def with_a_monitor(self):
        """The README's own monitor stays for all commands that ask one."""
        if not type(self).monitor:
            command = next(c for c in commands() if 'monitor.launch mesh:=' in c and 'rows:=' in c)
            # One message, latched: looping over it would keep a core busy.
            maps = self.start('rosbag play --keep-alive --quiet last_week.bag --topics /octomap_binary')
            tracker = self.start(self.tracker_of(command))
            type(self).monitor = (self.start(command), tracker, maps)
            self.answers(self.monitor[0])

    def ask(self, command, answers=True):
        self.with_a_monitor()
        once = re.sub(r'^rostopic echo(?! -n)', 'timeout 40 rostopic echo -n 1', command)
        said = self.runs(once, 90)
        self.assertTrue(said.strip() or not answers)

    def record(self, command):
        """Ctrl-C ends it. The bag of the pages' stories is another one from then on."""
        self.with_a_monitor()
        bag = self.home / re.search(r'-O (\S+)', command).group(1)
        kept = bag.rename(bag.with_suffix('.kept'))
        process = self.start(command)
        try:
            wait_for(lambda: bag.with_suffix('.bag.active').exists(), 30, 'the recording')
            time.sleep(3 * SLOW)
        finally:
            stop(process)
        wait_for(bag.exists, 30, 'the recorder, a child of rosbag, to give the bag its name')
        topics = yaml.safe_load(self.runs('rosbag info -y -k topics ' + bag.name))
        kept.rename(bag)
        self.assertLessEqual({'/tracker/cloth', '/octomap_binary'}, {entry['topic'] for entry in topics})

    def recorded_step(self):
        self.with_a_monitor()
        said = self.runs('rosservice call /collision_monitor/record_step')
        return re.search(r'[^\s",]+\.step', said).group(0)

    def run_tool(self, command):
        """With values for what the page leaves to the reader."""
        words = []
        for word in shlex.split(command):
            kind, _, value = word.rpartition(':')
            if word == 'FILE':
                word = self.recorded_step()
            elif value in PLACEHOLDERS:
                word = kind + ':' + PLACEHOLDERS[value]
            words.append(word)
        said = self.runs(' '.join(map(shlex.quote, words)))
        if '--report' in words:
            self.assertRegex(said, '(?m)^First contact ', 'frames without an answer only')
            self.assertTrue((self.home / words[words.index('--report') + 1] / 'report.html').stat().st_size > 1000)

    def hold_against_help(self, command):
        """A synopsis: the tool is there under the name that rosrun knows, and knows every option in it."""
        start = re.match(r'(rosrun \S+ )?\S+', command).group(0)
        text = self.runs(start + ' --help')
        for option in re.findall(r'(?<![\w-])(--?[a-z][\w-]*)', command):
            self.assertRegex(text, r'(?<![\w-])%s(?![\w-])' % re.escape(option))

    def compile(self, command):
        """On the checkout itself, without optimising, in half the time. It lets go first what else runs: that has deadlines."""
        line = 'cd %s && %s && ls /usr/local/lib/libdeformable_ccd.so' % (CHECKOUT, command)
        return self.runs('CMAKE_BUILD_TYPE=Debug nice -n 19 bash -c ' + shlex.quote(line), 900)

    def one(self, command):
        words = command.split()
        if synopsis(command):
            return self.hold_against_help(command)
        if words[0] == 'source':
            return self.runs(command)
        if words[0] == 'echo':
            self.runs(command)
            return self.assertTrue((self.home / words[-1]).read_text())
        if words[0] == 'python3':  # Debian's, which the modules are for, whatever else stands first in PATH
            return self.assertTrue(self.runs('/usr/bin/' + command).strip())
        if words[:2] == ['rosbag', 'record']:
            return self.record(command)
        if words[:2] == ['rosrun', 'nodelet'] or (words[0] == 'roslaunch' and 'demo' not in words[2] and 'replay' not in words[2]):
            return self.run_monitor(command)
        if words[:3] == ['rosrun', 'deformable_ccd', 'collision_monitor_node']:
            return self.run_monitor(command)
        if words[0] == 'roslaunch':  # brings what it plays
            if 'bag:=' not in command and not (WORKSPACE / 'demo/table_edge.bag').exists():
                return self.skipTest('scripts/demo has not been run here')
            self.stop_monitor()
            launched = self.start(command)
            try:
                return self.answers(launched)
            finally:
                stop(launched)
                self.gone('/collision_monitor/clear')
        client = CLIENTS.get(words[2].replace('.py', '')) if words[:2] == ['rosrun', 'deformable_ccd'] else None
        if client:
            topic, said = client
            self.with_a_monitor()
            process = self.start(command)
            try:
                return self.assertRegex(self.runs('timeout 40 rostopic echo -n 1 ' + topic, 60), said)
            finally:
                stop(process)
                self.gone(topic)
        if words[:3] == ['rosrun', 'deformable_ccd', 'publish_cloth.py']:
            tracker = self.start(command)
            try:
                return self.assertIn('600', self.runs('timeout 40 rostopic echo -n 1 /tracker/cloth/width', 60))
            finally:
                stop(tracker)
                self.gone('/tracker/cloth')
        if words[:3] == ['rosrun', 'deformable_ccd', 'watch']:
            self.with_a_monitor()
            view = self.start(command)
            try:
                return wait_for(lambda: re.search(r'(?m)^[\d:]+ .*PROVED, ', view.log.read_text()), 40, 'a line of the view')
            finally:
                stop(view)
        if words[:2] == ['rosrun', 'dynamic_reconfigure']:
            return self.ask(command, answers=False)
        if words[0] in ('rostopic', 'rosservice', 'rosparam', 'rosmsg'):
            return self.ask(command)
        if words[:2] == ['rosrun', 'deformable_ccd'] or words[0].startswith('build/devel/lib/deformable_ccd/'):
            return self.run_tool(command)
        return self.fail('nobody knows how to run this; teach test/package/commands_test.py, or give a reason in NOT_RUN')

    def test_every_command_runs(self):
        found = [c for c in commands() if not excuse(c)]
        self.assertGreater(len(found), 12, 'the search found too little to mean anything')
        # First what writes files for others; those that ask a monitor come last, so that it is started once.
        first = ('echo', 'source')
        last = ('rosbag record', 'rostopic', 'rosservice', 'rosrun dynamic_reconfigure', 'rosrun deformable_ccd stop', 'rosrun deformable_ccd replay',
                'rosrun deformable_ccd watch')
        with concurrent.futures.ThreadPoolExecutor(1) as beside:
            compiled = {c: beside.submit(self.compile, c) for c in found if c.startswith('cmake')}
            rest = [c for c in found if c not in compiled]
            for command in sorted(rest, key=lambda c: (not c.startswith(first), c.startswith(last))) + list(compiled):
                started = time.monotonic()
                with self.subTest(command):
                    compiled[command].result() if command in compiled else self.one(command)
                print('%5.1f s  %s' % (time.monotonic() - started, command), flush=True)

    def test_scripts_know_the_options(self):
        for command in commands():
            words = command.split()
            if not words[0].startswith('scripts/'):
                continue
            with self.subTest(command):
                text = (CHECKOUT / words[0]).read_text()
                for option in re.findall(r'(?<!\S)(--[a-z][\w-]*)', command):
                    self.assertIn(option, text)


class DemoTest(unittest.TestCase):
    def test_it_builds_what_the_readme_types(self):
        """A reader of it alone has built nothing else."""
        built = re.search(r'for target in (.*); do', (CHECKOUT / 'scripts/demo').read_text()).group(1).split()
        typed = [command.split() for command in code_of(CHECKOUT / 'README.md')]
        names = {words[2] for words in typed if words[:2] == ['rosrun', 'deformable_ccd']} | {'collision_monitor_node' for words in typed if words[0] == 'roslaunch'}
        programs = [name for name in names if not any((CHECKOUT / folder / name).is_file() for folder in ('src/apps', 'examples'))]
        self.assertGreater(len(names), len(programs), 'scripts need no build')
        self.assertGreaterEqual(len(programs), 2)
        self.assertEqual([name for name in programs if name not in built], [])


class TroubleshootingTest(unittest.TestCase):
    def test_every_tested_mistake_is_on_the_page(self):
        page = (CHECKOUT / 'doc/troubleshooting.md').read_text()
        test = (CHECKOUT / 'test/ros/mistakes_test.cpp').read_text()
        calls = re.findall(r'\{"/\w+",\s*"((?:[^"\\]|\\.)*)",(?:\s*//.*)?\s*"((?:[^"\\]|\\.)*)"', test)
        self.assertGreaterEqual(len(calls), 10)
        # Names of topics are the test's own.
        same = [re.sub(r'/\w+/(octomap|cloth)', r'/\1', text).replace('/a_tracker/', '/tracker/').replace('/octomap_binary', '/octomap') for call in calls for text in call]
        page = page.replace('/octomap_binary', '/octomap')
        self.assertEqual([text for text in same if text not in page], [])


if __name__ == '__main__':
    unittest.main()
