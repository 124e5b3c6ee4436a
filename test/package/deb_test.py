"""The Debian packages: what they ask for; and in a bare root: installed by apt, used, removed, nothing left."""
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree

from checkout import CHECKOUT, tracked_files
from dependencies_test import debian_list
from ros_process import free_port

PACKAGES = CHECKOUT / 'build/packages'
# By Debian's custom for messages (ros-pcl-msgs, ...): what a Debian with octomap_msgs would call them.
SYSTEMS_OWN = ['liboctomap-msgs-dev', 'python3-octomap-msgs', 'ros-octomap-msgs']
# Of the list of scripts/setup, what every build of packages has (build-essential).
NOT_FOR_THE_BUILD = {'g++'}

INSTALL = r'''
mkdir before after
find / -xdev \( -path /tmp -o -path /proc -o -path /dev \) -prune -o -print | sort >before/files
apt-get update
apt install -y ./build/packages/*.deb
'''
# What a user does in the root after `apt install`; each command of the page "Debian packages" is one of these.
STORY = r'''
# Not grep -q: what writes to a pipe that is closed fails.
share=/usr/share/deformable_ccd
[ "$(rospack find deformable_ccd)" = $share ]
for tool in make_scene_bag analyze_bag check_step replay_step; do
  rosrun deformable_ccd $tool --help >/dev/null
done
rosmsg show deformable_ccd/ContactArray | grep 'Contact\[\] contacts' >/dev/null
rosmsg show octomap_msgs/Octomap | grep 'int8\[\] data' >/dev/null
python3 -c 'import deformable_ccd.cfg.CollisionMonitorConfig, deformable_ccd.msg, octomap_msgs.msg, octomap_msgs.srv'
python3 $share/examples/python/two_frames.py | grep '5 contacts, starts CLEAR' >/dev/null

rosrun deformable_ccd make_scene_bag $share/config/scenes/table_edge.yaml scene.bag --frames 30 --quiet
rosrun deformable_ccd analyze_bag scene.bag --report report --quiet
[ "$(wc -l <report/contacts.csv)" -gt 20 ]

# The demo, as recorded in the build of the packages; and the clients of the page that read it.
roslaunch deformable_ccd demo.launch >demo.log 2>&1 &
launch=$!
timeout 60 bash -c 'until rostopic list >/dev/null 2>&1; do sleep 0.2; done'
timeout 60 python3 - <<'END'
import rospy
from deformable_ccd.msg import ContactArray
rospy.init_node('reader')
while not rospy.wait_for_message('/collision_monitor/contacts', ContactArray, 60).contacts:
    pass
END
timeout 60 rostopic echo -n 1 /collision_monitor/first_contact/answered
rosrun deformable_ccd stop_the_arm.py __name:=guard _max_age_s:=5.0 >guard.log 2>&1 &
guard=$!
timeout 60 bash -c 'until rostopic echo -n 1 /guard/stop | grep True >/dev/null; do sleep 0.2; done'
rosrun dynamic_reconfigure dynparam get /collision_monitor/live | grep accuracy >/dev/null
rosservice call /collision_monitor/reset
kill $guard $launch
wait $guard $launch || true

# The nodelet, by ROS's own program.
roscore -p "$PORT" >core.log 2>&1 &
core=$!
rosrun nodelet nodelet standalone deformable_ccd/CollisionMonitor __name:=collision_monitor \
  mesh:=/cloth octomap:=/octomap_binary >nodelet.log 2>&1 &
nodelet=$!
timeout 60 bash -c 'until rostopic list 2>/dev/null | grep /collision_monitor/clear >/dev/null; do sleep 0.2; done'
rosbag play --quiet --delay 2 scene.bag </dev/null >play.log 2>&1 &
timeout 60 rostopic echo -n 5 /collision_monitor/first_contact | grep 'answered: True' >/dev/null
kill $nodelet $core
wait || true

# The library, by its CMake package; the compiler and CMake are the reader's.
apt-get install -y --no-install-recommends cmake g++ make
cmake -S $share/examples/library -B library >library.log
cmake --build library >>library.log
library/two_frames | grep 'contacts, starts CLEAR' >/dev/null
'''
# A system that gets octomap_msgs of its own: a package of that name takes the place of ours, and nothing else goes.
GIVE_WAY = r'''
for name in ros-octomap-msgs python3-octomap-msgs; do
  mkdir -p $name/DEBIAN
  printf '%s\n' "Package: $name" 'Version: 1' 'Architecture: all' 'Maintainer: nobody <nobody@example.invalid>' \
    'Description: stands for the package of the system' >$name/DEBIAN/control
  dpkg-deb --build $name . >/dev/null
done
# Not upstream's files, but the same place: neither package may overwrite the other's.
apt install -y ./ros-octomap-msgs_1_all.deb ./python3-octomap-msgs_1_all.deb
dpkg-query -W -f '${Package} ${db:Status-Status}\n' >packages
grep -q '^deformable-ccd installed' packages
grep -q '^ros-octomap-msgs installed' packages
if grep -q '^deformable-ccd-octomap-msgs installed' packages; then exit 1; fi
apt-get check
apt install -y ./build/packages/deformable-ccd-octomap-msgs_*.deb
'''
REMOVE = r'''
apt purge -y deformable-ccd libdeformable-ccd-dev deformable-ccd-octomap-msgs
apt-get purge -y cmake g++ make
# What another installed package merely recommends or suggests would stay, and says nothing about ours.
apt-get -o APT::AutoRemove::RecommendsImportant=0 -o APT::AutoRemove::SuggestsImportant=0 autoremove -y --purge
find / -xdev \( -path /tmp -o -path /proc -o -path /dev \) -prune -o -print | sort >after/files
'''
# Where apt, dpkg and ldconfig keep their own books; and what Debian's own packages forget when they are purged.
OF_THE_TOOLS = ('/var/cache/', '/var/lib/apt/', '/var/lib/dpkg/', '/var/log/',
                '/etc/gshadow-', '/etc/shadow-', '/etc/xml', '/run/adduser')


def control():
    """Package name, or 'source', -> its fields."""
    found = {}
    for paragraph in (CHECKOUT / 'debian/control').read_text().split('\n\n'):
        fields = dict(re.findall(r'^([\w-]+):((?:.*\n?)(?:^ .*\n?)*)', paragraph, re.M))
        found[fields.get('Package', 'source').strip()] = fields
    return found


def names(field):
    """Packages of a relation; of alternatives, all."""
    return [re.split(r'[\s(]', name.strip())[0] for name in re.split(r'[,|]', field) if re.match(r'\s*[a-z]', name)]


class ControlTest(unittest.TestCase):
    def test_build_dependencies_are_those_of_scripts_setup(self):
        own, packages = control(), set(debian_list()['build'])
        self.assertGreater(len(packages), 30)
        build = set(names(own['source']['Build-Depends']))
        self.assertEqual({n for n in build - packages if not n.startswith(('debhelper', 'dh-'))}, set())
        running = set(names(own['deformable-ccd']['Depends'] + ',' + own['deformable-ccd']['Recommends']))
        # What runs only once it is built: Python's messages for bags and clients.
        later = {n for n in packages if n.startswith('python3-')}
        self.assertEqual(packages - build - running - later - NOT_FOR_THE_BUILD, set())

    def test_versions_agree(self):
        changelog = (CHECKOUT / 'debian/changelog').read_text()
        version = ElementTree.parse(CHECKOUT / 'package.xml').getroot().find('version').text
        self.assertEqual(re.match(r'deformable-ccd \((.*?)\)', changelog).group(1), version)
        self.assertIn('project(deformable_ccd VERSION %s ' % version, (CHECKOUT / 'CMakeLists.txt').read_text())

    def test_octomap_msgs_gives_way_to_the_systems(self):
        own = control()
        for relation in ('Conflicts', 'Replaces'):
            self.assertEqual(names(own['deformable-ccd-octomap-msgs'][relation]), SYSTEMS_OWN)
        self.assertIn('ros-octomap-msgs | deformable-ccd-octomap-msgs', own['deformable-ccd']['Depends'])

    def test_launch_files_and_clients_find_what_they_start_and_import(self):
        own = control()['deformable-ccd']
        depends = set(names(own['Depends']))
        text = ''.join(p.read_text() for p in (CHECKOUT / 'launch').rglob('*.launch'))
        serves = {'deformable_ccd': 'rosbash', 'rosbag': 'python3-rosbag'}
        started = set(re.findall(r'<node[^>]* pkg="([a-z]\w*)"', text)) - {'rviz', 'nodelet'}
        self.assertIn('deformable_ccd', started)
        self.assertEqual({serves.get(name, name) for name in started} - depends, set())
        self.assertIn('rviz', names(own['Suggests']))
        clients = ''.join((CHECKOUT / 'examples' / name).read_text() for name in ('stop_the_arm.py', 'publish_cloth.py'))
        imported = set(re.findall(r'^(?:import|from) (\w+)', clients, re.M))
        modules = {'python3-' + name.replace('_', '-') for name in imported - {'deformable_ccd', 'math', 'struct', 'sys', 'time'}}
        self.assertIn('python3-rospy', modules)
        self.assertEqual(modules - depends, set())

    def test_the_image_has_the_packages_and_what_they_recommend_for_a_terminal(self):
        """docker/Dockerfile installs without recommended packages what the story installs with them."""
        text = (CHECKOUT / 'docker/Dockerfile').read_text()
        self.assertIn('RUN scripts/package\n', text)
        self.assertRegex(text, r'COPY --from=build /source/build/packages/deformable-ccd\*\.deb /packages/\n')
        added = set(re.findall(r'python3-\w+', text))
        recommended = {n for n in names(control()['deformable-ccd']['Recommends']) if n.startswith('python3-')}
        self.assertEqual(added, recommended)

    def test_every_command_of_the_page_is_in_the_story(self):
        page = (CHECKOUT / 'doc/development.md').read_text()
        section = re.search(r'^## Debian packages\n(.*?)(?=^## |\Z)', page, re.M | re.S).group(1)
        commands = [re.split(r'\s{2,}#', line.strip())[0] for line in re.findall(r'^    (.*)', section, re.M)]
        self.assertGreater(len(commands), 3)
        # No question is answered in a test.
        story = (INSTALL + STORY + REMOVE).replace(' -y ', ' ') + 'scripts/package\n'
        self.assertEqual([command for command in commands if command not in story], [])


def sources():
    """Files of the host's apt configuration that name its own release, and the name."""
    release = pathlib.Path('/etc/os-release')
    found = re.search(r'^VERSION_CODENAME=(\w+)', release.read_text() if release.exists() else '', re.M)
    apt = pathlib.Path('/etc/apt')
    files = [apt / 'sources.list', *sorted(apt.glob('sources.list.d/*.list')),
             *sorted(apt.glob('sources.list.d/*.sources'))]
    return found and found.group(1), [p for p in files if found and p.exists() and found.group(1) in p.read_text()]


def missing():
    """Why there can be no root here; empty where there can be one."""
    if not os.environ.get('DEFORMABLE_CCD_LONG'):
        return 'takes minutes: DEFORMABLE_CCD_LONG=1, or scripts/test --long'
    if os.environ.get('DEFORMABLE_CCD_SANITIZED'):
        return 'only the ordinary build is packaged'
    if os.geteuid() != 0:
        return 'only root can make a root'
    absent = [tool for tool in ('mmdebstrap', 'dpkg-buildpackage', 'unshare') if not shutil.which(tool)]
    if absent:
        return 'not installed: ' + ' '.join(absent)
    if not sources()[1]:
        return "no file of /etc/apt names this system's release"
    if subprocess.run(['unshare', '--mount', '--pid', '--fork', 'true'], capture_output=True, check=False).returncode:
        return 'no namespaces of its own for the root (unshare --mount --pid)'
    return ''


@unittest.skipIf(missing(), missing())
class LifeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix='deformable_ccd_deb_'))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.root = cls.folder / 'root'
        made = sorted(PACKAGES.glob('*.deb'))
        # Packages that are newer than all that goes into them are not made again.
        inputs = [p for p in tracked_files() if p.relative_to(CHECKOUT).parts[0] not in ('doc', 'scripts', 'test')]
        if not made or made[0].stat().st_mtime < max(p.stat().st_mtime for p in inputs):
            subprocess.run([str(CHECKOUT / 'scripts/package')], check=True)
        # How the host reaches its registry, beyond the sources themselves.
        dumped = subprocess.run(['apt-config', 'dump', 'Acquire'], capture_output=True, text=True, check=True).stdout
        options = cls.folder / 'apt.conf'
        reach = re.findall(r'^Acquire::(?:https?|Check-Date|Check-Valid-Until|Retries)\b.*\n', dumped, re.M)
        options.write_text(''.join(reach))
        release, files = sources()
        ran = subprocess.run(['mmdebstrap', '--variant=minbase', '--aptopt=%s' % options, release, str(cls.root),
                              *map(str, files)], capture_output=True, text=True, check=False)
        if ran.returncode and re.search('Could not (resolve|connect)|Failed to fetch|Unable to fetch', ran.stderr):
            raise unittest.SkipTest('no registry: ' + ran.stderr.strip().splitlines()[-1])
        assert ran.returncode == 0, ran.stderr
        cls.home = cls.root / 'tmp/home'
        (cls.home / 'build').mkdir(parents=True)
        shutil.copytree(PACKAGES, cls.home / 'build/packages')
        if pathlib.Path('/etc/resolv.conf').exists():
            shutil.copy('/etc/resolv.conf', cls.root / 'etc/resolv.conf')
        # What the installer of a system writes, and mmdebstrap does not.
        (cls.root / 'etc/hosts').write_text('127.0.0.1 localhost\n')
        cls.port = free_port()

    def run_inside(self, script):
        """In the root, with /proc and /dev, and nothing else of the host but its network."""
        enter = ('mount --make-rprivate / && mount -t proc proc "$0/proc" && mount --rbind /dev "$0/dev" && '
                 'exec chroot "$0" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 '
                 'HOME=/tmp/home ROS_HOME=/tmp/home/.ros DEBIAN_FRONTEND=noninteractive '
                 'ROS_MASTER_URI=http://localhost:%d ROS_HOSTNAME=localhost PORT=%d '
                 'bash -c "cd /tmp/home; $1"' % (self.port, self.port))
        command = ['unshare', '--mount', '--pid', '--fork', '--kill-child', 'bash', '-c', enter, str(self.root),
                   'set -xeo pipefail\n' + script]
        ran = subprocess.run(command, capture_output=True, text=True, timeout=1800, check=False)
        logs = ''.join('%s:\n%s' % (p, p.read_text(errors='replace')[-2000:]) for p in self.home.glob('*.log'))
        self.assertEqual(ran.returncode, 0, ran.stdout[-4000:] + ran.stderr[-4000:] + logs)
        return ran.stdout

    def test_life(self):
        self.run_inside(INSTALL)
        self.run_inside(STORY)
        self.run_inside(GIVE_WAY)
        self.run_inside(REMOVE)
        before, after = (set((self.home / when / 'files').read_text().splitlines()) for when in ('before', 'after'))
        self.assertGreater(len(before), 1000)
        left = {name for name in after - before if not name.startswith(OF_THE_TOOLS)}
        self.assertEqual(sorted(left), [])


if __name__ == '__main__':
    unittest.main()
