"""scripts/setup on machines where something is wrong: one line that says what, and what to do; nothing half installed.

Most machines are made of fakes: a PATH of nothing but the programs below and false apt-get, dpkg, id and sudo. As root
there are real ones, too: no network (a network namespace), a full disk (a tmpfs), no Python with ROS (a bind mount).
"""
import os
import pathlib
import shutil
import subprocess
import tempfile
import textwrap
import unittest

from checkout import CHECKOUT

# What scripts/setup may call of a minimal system.
PROGRAMS = ['awk', 'basename', 'bash', 'cat', 'chown', 'cmake', 'cut', 'df', 'dirname', 'env', 'find', 'grep', 'head',
            'mkdir', 'mv', 'ninja', 'nproc', 'realpath', 'rm', 'sed', 'sh', 'sleep', 'sort', 'tail', 'tar', 'touch', 'tr']
FAKES = {
    # Every package is installed but those in $MISSING.
    'dpkg-query': 'for last; do :; done; case " $MISSING " in *" $last "*) exit 1 ;; esac; echo -n installed',
    'dpkg': '''
        echo "dpkg $*" >>"$STATE/calls"
        case $1 in
          --audit) [ ! -e "$STATE/interrupted" ] || echo "The following packages are only half configured" ;;
          --configure) rm -f "$STATE/interrupted" ;;
        esac''',
    # $APT names what goes wrong.
    'apt-get': '''
        echo "apt-get $*" >>"$STATE/calls"
        offline="Temporary failure resolving 'packages.example'"
        case "$APT $*" in
          'offline '*update) echo "W: Failed to fetch http://packages.example/InRelease  $offline" ;;
          'offline '*--download-only*) echo "E: Failed to fetch http://packages.example/a.deb  $offline"; exit 100 ;;
          'locked '*update) echo "E: Could not get lock /var/lib/apt/lists/lock. It is held by process 1"; exit 100 ;;
          'locked '*--download-only*) echo "E: Could not get lock /var/lib/dpkg/lock-frontend."; exit 100 ;;
          'small '*--download-only*)
            echo "E: You don't have enough free space in /var/cache/apt/archives/."; exit 100 ;;
          *--download-only*) echo "After this operation, ${UNPACKED:-123 kB} of additional disk space will be used." ;;
          'full '*' install -y --no-install-recommends '[!-]*)
            touch "$STATE/interrupted"
            echo "dpkg: error processing archive a.deb: failed to write (No space left on device)"; exit 100 ;;
          'broken '*' install -y --no-install-recommends '[!-]*) echo "E: something that nobody foresaw"; exit 100 ;;
          *' indextargets '*) ;;
          *' source '*) exit 100 ;;
        esac''',
    'apt-cache': '''
        case " $LACKING " in *" $2 "*) candidate='(none)' ;; *) candidate=1.0 ;; esac
        printf '%s:\\n  Installed: (none)\\n  Candidate: %s\\n' "$2" "$candidate"''',
    'id': 'echo "${USER_ID:-0}"',
}
OS_RELEASES = {
    'bullseye': 'PRETTY_NAME="Debian GNU/Linux 11 (bullseye)"\nID=debian\nVERSION_CODENAME=bullseye\n',
    'bookworm': 'PRETTY_NAME="Debian GNU/Linux 12 (bookworm)"\nID=debian\nVERSION_CODENAME=bookworm\n',
    'focal': 'PRETTY_NAME="Ubuntu 20.04.6 LTS"\nID=ubuntu\nVERSION_CODENAME=focal\n',
    'testing': 'PRETTY_NAME="Debian GNU/Linux forky/sid"\nID=debian\n',
}


def can_make_namespaces():
    """Root can; but not where the root folder is none of a file system's, as in a chroot."""
    if os.geteuid() != 0 or not shutil.which('unshare'):
        return False
    return subprocess.run(['unshare', '--mount', '--net', 'true'], capture_output=True, check=False).returncode == 0


class Machine(unittest.TestCase):
    """A folder with the checkout's scripts, a PATH of fakes and a place for what they remember."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.checkout = self.folder / 'checkout'
        for part in ['scripts', 'dependencies']:
            shutil.copytree(CHECKOUT / part, self.checkout / part)
        self.bin = self.folder / 'bin'
        self.bin.mkdir()
        for program in PROGRAMS:
            if shutil.which(program):
                (self.bin / program).symlink_to(shutil.which(program))
        for name, body in FAKES.items():
            self.add_program(name, body)
        self.os_release = self.folder / 'os-release'
        self.os_release.write_text(OS_RELEASES['bookworm'])
        self.state = self.folder / 'state'
        self.state.mkdir()

    def add_program(self, name, body):
        path = self.bin / name
        path.unlink(missing_ok=True)
        path.write_text('#!/bin/bash\n' + textwrap.dedent(body) + '\n')
        path.chmod(0o755)

    def other_ros(self, distribution='noetic', package='roscpp'):
        other = self.folder / 'opt/ros' / distribution
        (other / 'share' / package).mkdir(parents=True)
        (other / 'share' / package / 'package.xml').touch()
        return str(other)

    def calls(self):
        path = self.state / 'calls'
        return path.read_text().splitlines() if path.exists() else []

    def installing_calls(self):
        return [c for c in self.calls() if ' install ' in c and '--download-only' not in c]

    def setup_script(self, *arguments, **environment):
        """Runs the copy of scripts/setup; by default one package is missing."""
        settings = {'PATH': str(self.bin), 'STATE': str(self.state), 'MISSING': 'catkin', 'APT': 'works',
                    'DEFORMABLE_CCD_OS_RELEASE': str(self.os_release), **environment}
        return subprocess.run([str(self.checkout / 'scripts/setup'), *arguments], env=settings, capture_output=True,
                              text=True, timeout=120, stdin=subprocess.DEVNULL, check=False)

    def expect_one_line(self, ran, *texts):
        lines = ran.stderr.splitlines()
        self.assertEqual(len(lines), 1, ran.stderr)
        self.assertTrue(lines[0].startswith('setup: '), lines[0])
        self.assertNotEqual(ran.returncode, 0)
        for text in texts:
            self.assertIn(text, lines[0])


class SetupTest(Machine):
    def test_nothing_is_missing(self):
        ran = self.setup_script(MISSING='')
        self.assertEqual((ran.returncode, ran.stdout, ran.stderr, self.calls()), (0, '', '', []))

    def test_what_is_missing_is_downloaded_first_and_then_installed(self):
        ran = self.setup_script(MISSING='catkin libhwy-dev doxygen')
        self.assertEqual((ran.returncode, ran.stderr), (0, ''))
        self.assertIn('catkin libhwy-dev', ran.stdout)
        installs = [c for c in self.calls() if ' install -y ' in c]
        self.assertEqual(['--download-only' in c for c in installs], [True, False])
        self.assertTrue(installs[1].endswith(' catkin libhwy-dev'))  # doxygen is for the tests

    def test_unknown_argument(self):
        self.expect_one_line(self.setup_script('--fast'), "'--fast'", 'usage: scripts/setup')

    def test_what_keeps_apt_from_it_is_told_and_nothing_is_installed(self):
        for settings, told in [
                ({'APT': 'offline'}, ('no network', 'packages.example', 'nothing was installed')),
                ({'APT': 'locked'}, ('another program is installing packages',)),
                ({'APT': 'small'}, ('the disk is full', '/var/cache/apt/archives', 'make room')),
                ({'UNPACKED': '98,765 GB'}, ('the disk is full', '98765', '/usr', 'make room'))]:
            with self.subTest(settings):
                self.expect_one_line(self.setup_script(**settings), *told)
                self.assertEqual(self.installing_calls(), [])
        self.assertEqual(self.setup_script().returncode, 0)

    def test_no_network_and_no_package_lists(self):
        """Without lists every package seems to be lacking; that must not be said of the release."""
        ran = self.setup_script(APT='offline', LACKING='catkin')
        self.expect_one_line(ran, 'no network')
        self.assertNotIn('Debian', ran.stderr)

    def test_disk_full_in_the_middle_and_again(self):
        self.expect_one_line(self.setup_script(APT='full'), 'interrupted', 'the disk is full', 'the next run goes on')
        self.assertTrue((self.state / 'interrupted').exists())
        again = self.setup_script()
        self.assertEqual((again.returncode, again.stderr), (0, ''))
        self.assertIn('dpkg --configure -a', self.calls())
        self.assertFalse((self.state / 'interrupted').exists())

    def test_a_failure_that_nobody_foresaw(self):
        self.expect_one_line(self.setup_script(APT='broken'), 'something that nobody foresaw', 'build/setup.log')

    def test_no_root_and_no_sudo(self):
        ran = self.setup_script('--tests', USER_ID='1000', MISSING='catkin cmake')
        self.expect_one_line(ran, '2 packages are missing', 'no sudo', 'run as root', 'scripts/setup --tests')
        self.assertEqual(self.calls(), [])

    def test_sudo_refuses(self):
        self.add_program('sudo', 'echo "user is not in the sudoers file" >&2; exit 1')
        self.expect_one_line(self.setup_script(USER_ID='1000'), 'sudo refuses', 'run as root')
        self.assertEqual(self.calls(), [])

    def test_sudo(self):
        self.add_program('sudo', '[ "$1" = -v ] || { echo sudo >>"$STATE/calls"; exec "$@"; }')
        self.assertEqual(self.setup_script(USER_ID='1000').returncode, 0)
        self.assertIn('sudo', self.calls())

    def test_unknown_release(self):
        for name, told in [('focal', 'Ubuntu 20.04.6 LTS'), ('testing', 'forky/sid')]:
            self.os_release.write_text(OS_RELEASES[name])
            self.expect_one_line(self.setup_script('--tests'), told, 'nobody has tried',
                                 'scripts/setup --any-release --tests')
        self.os_release.unlink()
        self.expect_one_line(self.setup_script(), 'this system', '--any-release')
        self.assertEqual(self.calls(), [])
        self.assertEqual(self.setup_script('--any-release').returncode, 0)
        self.assertEqual(len(self.installing_calls()), 1)

    def test_another_ros_is_sourced(self):
        other = self.other_ros()
        for variables in [{'CMAKE_PREFIX_PATH': '/nowhere:' + other}, {'ROS_ROOT': other + '/share/ros'}]:
            self.expect_one_line(self.setup_script(**variables), other, 'does not mix', 'catkin_make')
            # Neither goes the build on when everything happens to be installed.
            self.expect_one_line(self.setup_script(MISSING='', **variables), other)
        self.assertEqual(self.calls(), [])

    def test_a_wheel_takes_nothing_of_ros_and_no_other_ros_is_in_its_way(self):
        ran = self.setup_script('--wheel', '--list', MISSING='patchelf catkin rviz', CMAKE_PREFIX_PATH=self.other_ros())
        self.assertEqual((ran.returncode, ran.stdout.split()), (0, ['patchelf']))
        self.assertEqual(self.setup_script('--wheel', MISSING='patchelf', CMAKE_PREFIX_PATH=str(self.folder / 'opt/ros/noetic')).returncode, 0)
        self.assertTrue(self.installing_calls())

    def test_ros_2_is_sourced(self):
        other = self.other_ros('humble', 'rclcpp')
        self.expect_one_line(self.setup_script(AMENT_PREFIX_PATH=other), other, 'does not mix')

    def test_a_workspace_on_the_systems_ros_is_no_other_ros(self):
        overlay = self.folder / 'catkin_ws/devel'
        (overlay / 'share/my_tracker').mkdir(parents=True)
        ran = self.setup_script(CMAKE_PREFIX_PATH='%s:/usr' % overlay, ROS_ROOT='/usr/share/ros', ROS_DISTRO='debian')
        self.assertEqual(ran.returncode, 0)

    def test_checkout_that_cannot_be_written(self):
        (self.checkout / 'build').write_text('a file where the folder should be')
        self.expect_one_line(self.setup_script(), 'cannot write', 'run it as the owner')


class FromSourceTest(Machine):
    """A release that has no package of something."""

    def setUp(self):
        super().setUp()
        self.os_release.write_text(OS_RELEASES['bullseye'])
        self.prefix = self.checkout / 'build/dependencies'

    def lacking(self, *arguments, **environment):
        return self.setup_script(*arguments, MISSING='catkin libhwy-dev libcli11-dev',
                                 LACKING='libhwy-dev libcli11-dev', **environment)

    def give_sources(self):
        """A project of CMake's without a compiler in place of each library."""
        for name in ['highway', 'cli11']:
            folder = self.prefix / 'source' / name
            folder.mkdir(parents=True)
            (folder / 'CMakeLists.txt').write_text(
                'cmake_minimum_required(VERSION 3.16)\nproject(%s NONE)\n'
                'install(FILES CMakeLists.txt DESTINATION share/%s)\n' % (name, name))

    def test_it_says_what_is_lacking_and_installs_nothing(self):
        ran = self.lacking('--rviz')
        self.expect_one_line(ran, 'Debian GNU/Linux 11', 'libcli11-dev libhwy-dev',
                             "'scripts/setup --rviz --from-source'")
        self.assertEqual(self.installing_calls(), [])

    def test_what_cannot_be_built_either(self):
        ran = self.setup_script('--from-source', LACKING='catkin')
        self.expect_one_line(ran, 'has no package catkin')
        self.assertEqual(self.installing_calls(), [])

    def test_it_is_built_once(self):
        self.give_sources()
        ran = self.lacking('--from-source')
        self.assertEqual((ran.returncode, ran.stderr), (0, ''))
        self.assertIn('building highway from source (2 of 2)', ran.stdout)
        self.assertTrue((self.prefix / 'share/highway/CMakeLists.txt').exists())
        self.assertTrue(self.installing_calls()[0].endswith(' catkin'))
        again = self.setup_script(MISSING='libhwy-dev libcli11-dev', LACKING='libhwy-dev libcli11-dev')
        self.assertEqual((again.returncode, again.stdout, again.stderr), (0, '', ''))

    def test_it_is_forgotten_when_the_system_has_moved_on(self):
        self.give_sources()
        self.assertEqual(self.lacking('--from-source').returncode, 0)
        self.os_release.write_text(OS_RELEASES['bookworm'])
        ran = self.setup_script('--from-source', MISSING='libhwy-dev')
        self.assertEqual(ran.returncode, 0)
        self.assertFalse(self.prefix.exists())
        self.assertTrue(self.installing_calls()[-1].endswith(' libhwy-dev'))

    def test_never_where_the_system_has_it(self):
        self.give_sources()
        ran = self.setup_script('--from-source', MISSING='libhwy-dev libcli11-dev')
        self.assertEqual(ran.returncode, 0)
        self.assertFalse((self.prefix / 'built').exists())
        self.assertTrue(self.installing_calls()[0].endswith(' libcli11-dev libhwy-dev'))

    def test_no_source_to_be_had(self):
        self.expect_one_line(self.lacking('--from-source'), 'no source of', 'vcs')

    def test_source_that_does_not_build(self):
        self.give_sources()
        (self.prefix / 'source/highway/CMakeLists.txt').write_text('message(FATAL_ERROR "broken")\n')
        self.expect_one_line(self.lacking('--from-source'), 'highway could not be built', 'from_source.log')
        # The next run goes on with what is left.
        shutil.rmtree(self.prefix / 'source')
        self.give_sources()
        self.assertEqual(self.lacking('--from-source').returncode, 0)

    def test_another_ros_brings_all_but_these(self):
        self.give_sources()
        self.os_release.write_text(OS_RELEASES['focal'])
        ran = self.lacking('--from-source', CMAKE_PREFIX_PATH=self.other_ros())
        self.assertEqual((ran.returncode, ran.stderr), (0, ''))
        self.assertTrue((self.prefix / 'share/cli11/CMakeLists.txt').exists())
        self.assertEqual(self.installing_calls(), [])

    def test_both_ways_to_the_source_know_the_same_libraries(self):
        rows = [line.split() for line in (CHECKOUT / 'dependencies/from-source.txt').read_text().splitlines()
                if not line.startswith('#')]
        repositories = (CHECKOUT / 'dependencies/noetic.repos').read_text()
        packages = (CHECKOUT / 'scripts/debian-packages.txt').read_text().split()
        self.assertEqual(len(rows), 3)
        for package, source, *_ in rows:
            self.assertIn(package, packages)
            self.assertIn('\n  %s:' % source, repositories)


class RealMachineTest(Machine):
    """The system's own apt and disks, in namespaces of their own."""

    def real(self, preparation, namespace):
        """scripts/setup with the system's programs, for a package that is not installed, after `preparation`."""
        (self.checkout / 'scripts/debian-packages.txt').write_text('[build]\nsl tool:test\n')
        script = '%s\nexec "$0"' % preparation
        once = self.folder / 'apt.conf'
        once.write_text('Acquire::Retries "0";')
        of_this_build = ('CMAKE_PREFIX_PATH', 'ROS_ROOT', 'DEFORMABLE_CCD_WORKSPACE')
        environment = {k: v for k, v in os.environ.items() if k not in of_this_build}
        environment['APT_CONFIG'] = str(once)
        command = ['unshare', '--mount', *namespace, 'bash', '-e', '-c', script + ' --any-release',
                   str(self.checkout / 'scripts/setup')]
        return subprocess.run(command, capture_output=True, text=True, timeout=300, env=environment,
                              stdin=subprocess.DEVNULL, check=False)

    def setUp(self):
        super().setUp()
        if not can_make_namespaces() or not shutil.which('apt-get'):
            self.skipTest('needs root, apt and namespaces')
        if subprocess.run(['dpkg-query', '-W', 'sl'], capture_output=True, check=False).returncode == 0:
            self.skipTest('the package that this test does not install is installed')

    def test_no_network(self):
        ran = self.real('', ['--net'])
        self.expect_one_line(ran, 'no network')
        self.assertNotEqual(subprocess.run(['dpkg-query', '-W', 'sl'], capture_output=True, check=False).returncode, 0)

    def test_full_disk_where_the_checkout_is(self):
        build = self.checkout / 'build'
        build.mkdir()
        ran = self.real('mount -t tmpfs -o size=1m tmpfs %s' % build, [])
        self.expect_one_line(ran, 'the disk is full', str(build))

    def test_full_disk_where_packages_go(self):
        if subprocess.run(['apt-cache', 'show', 'sl'], capture_output=True, check=False).returncode != 0:
            self.skipTest('no package lists here')
        archives = '/var/cache/apt/archives'
        ran = self.real('mount -t tmpfs -o size=8k tmpfs {0}; mkdir {0}/partial'.format(archives), ['--net'])
        self.expect_one_line(ran, 'the disk is full', archives)


class PythonTest(Machine):
    """scripts/build and the rest take the Python that has the ROS modules, whichever comes first in PATH."""

    def use_ros_python(self, prefix=()):
        own = self.folder / 'own'
        own.mkdir()
        (own / 'python3').write_text('#!/bin/sh\necho "No module named catkin_pkg" >&2; exit 1\n')
        (own / 'python3').chmod(0o755)
        script = '. scripts/lib/common.sh; use_ros_python; echo "$PYTHON"'
        return subprocess.run([*prefix, 'bash', '-c', script, 'build'], env={'PATH': '%s:/usr/bin:/bin' % own},
                              cwd=CHECKOUT, capture_output=True, text=True, check=False)

    def test_one_without_the_ros_modules_comes_first(self):
        ran = self.use_ros_python()
        self.assertEqual((ran.returncode, ran.stdout, ran.stderr), (0, '/usr/bin/python3\n', ''))

    def test_none_has_the_ros_modules(self):
        if not can_make_namespaces():
            self.skipTest('needs root and namespaces')
        hide = 'mount --bind "$0" /usr/bin/python3 2>/dev/null && exec "$@"'
        ran = self.use_ros_python(['unshare', '--mount', 'bash', '-c', hide, str(self.folder / 'own/python3')])
        self.assertEqual(ran.returncode, 1)
        self.assertEqual(len(ran.stderr.splitlines()), 1, ran.stderr)
        self.assertIn('no python3 with the ROS modules', ran.stderr)
        self.assertIn('scripts/setup', ran.stderr)


if __name__ == '__main__':
    unittest.main()
