"""The installed tree works without the source: tools, messages, nodelet and a launch file, with the checkout out of sight."""
import os
import pathlib
import shutil
import subprocess
import tempfile
import textwrap
import unittest

from checkout import CHECKOUT
from ros_process import free_port

# What a user does with the installed tree, in a shell that knows nothing else.
STORY = r'''
set -eo pipefail
mount -t tmpfs none "$CHECKOUT"
[ -z "$(ls "$CHECKOUT")" ]
. "$INSTALLED/setup.bash"
share=$(rospack find deformable_ccd)
case $share in "$INSTALLED"/*) ;; *) echo "found in $share"; exit 1 ;; esac
for tool in make_scene_bag analyze_bag check_step replay_step; do
  rosrun deformable_ccd $tool --help >/dev/null
done
rosrun deformable_ccd make_scene_bag "$share/config/scenes/table_edge.yaml" scene.bag --frames 45 --quiet
rosrun deformable_ccd analyze_bag scene.bag --report report --quiet
[ -s report/report.html ]
grep -q '"headline": *"First contact' report/report.json
rosmsg show deformable_ccd/ContactArray >/dev/null
python3 -c 'from deformable_ccd.msg import ContactArray, FirstContact'
python3 "$share/examples/python/two_frames.py" | grep -q '5 contacts, starts CLEAR'
[ -e "$share/examples/stop_the_arm.py" ] && [ -e "$share/config/rviz/monitor.rviz" ]
rospack plugins --attrib=plugin nodelet | grep -q "deformable_ccd $INSTALLED"

roslaunch -p "$PORT" deformable_ccd monitor.launch mesh:=/cloth octomap:=/octomap_binary >launch.log 2>&1 &
launch=$!
trap 'kill -INT $launch 2>/dev/null; wait $launch || true' EXIT
for i in $(seq 60); do rostopic list 2>/dev/null | grep -q /collision_monitor/clear && break; sleep 0.5; done
rosrun deformable_ccd stop_the_arm.py __name:=guard _max_age_s:=5.0 >guard.log 2>&1 &
guard=$!
(sleep 2; rosbag play --quiet scene.bag </dev/null >/dev/null 2>&1) &
timeout 30 rostopic echo -n 3 /collision_monitor/first_contact >first_contact.txt
timeout 10 rostopic echo -n 1 /guard/stop >stop.txt
kill -INT $guard
cmake -S "$share/examples/library" -B library -DCMAKE_PREFIX_PATH="$INSTALLED" >library.log
cmake --build library >>library.log
library/two_frames | grep -q 'contacts, starts CLEAR'

grep -q 'answered: True' first_contact.txt
grep -q 'data: True' stop.txt
echo finished
'''


def may_hide():
    """Whether this user may mount over the checkout in a namespace of its own."""
    if not shutil.which('unshare'):
        return False
    tried = subprocess.run(['unshare', '--mount', 'mount', '-t', 'tmpfs', 'none', '/mnt'], capture_output=True, check=False)
    return tried.returncode == 0


class InstallTest(unittest.TestCase):
    @unittest.skipIf(os.environ.get('DEFORMABLE_CCD_SANITIZED'), 'only the ordinary build is installed')
    @unittest.skipUnless(may_hide(), 'only root may hide the checkout (unshare --mount)')
    def test_the_installed_tree_works_alone(self):
        home = pathlib.Path(tempfile.mkdtemp(prefix='deformable_ccd_install_'))
        self.addCleanup(shutil.rmtree, home)
        # catkin decides when it configures where the setup files go, so the whole tree is staged and then moved.
        subprocess.run(['cmake', '--install', str(CHECKOUT / 'build/build')], check=True, capture_output=True,
                       env=dict(os.environ, DESTDIR=str(home / 'stage')))
        installed = home / 'installed'
        shutil.move(str(home / 'stage') + str(CHECKOUT / 'build/install'), installed)
        links = [p for p in installed.rglob('*') if p.is_symlink() and str(CHECKOUT) in str(p.resolve())]
        self.assertEqual(links, [], 'links into the checkout')
        port = free_port()
        environment = {'PATH': '/usr/local/bin:/usr/bin:/bin', 'HOME': str(home), 'ROS_HOME': str(home / 'ros'),
                       'CHECKOUT': str(CHECKOUT), 'INSTALLED': str(installed), 'PORT': str(port),
                       'ROS_MASTER_URI': 'http://localhost:%d' % port, 'ROS_HOSTNAME': 'localhost'}
        ran = subprocess.run(['unshare', '--mount', 'bash', '-c', textwrap.dedent(STORY)], cwd=home, env=environment,
                             capture_output=True, text=True, timeout=240, check=False)
        logs = ''.join(p.read_text(errors='replace')[-2000:] for p in home.glob('*.log'))
        self.assertEqual((ran.returncode, ran.stdout.splitlines()[-1:]), (0, ['finished']), ran.stdout + ran.stderr + logs)

    @unittest.skipIf(os.environ.get('DEFORMABLE_CCD_SANITIZED'), 'only the ordinary build is installed')
    def test_the_core_alone_configures_with_a_target_to_export(self):
        """Its build takes minutes; scripts/test --aarch64 and --long build it, for their own ends."""
        with tempfile.TemporaryDirectory() as tree:
            ran = subprocess.run(['cmake', '-S', str(CHECKOUT), '-B', tree, '-DDEFORMABLE_CCD_CORE_ONLY=ON',
                                  '-DDEFORMABLE_CCD_TESTS=OFF'], capture_output=True, text=True, check=False)
            self.assertEqual(ran.returncode, 0, ran.stdout + ran.stderr)
            exported = list(pathlib.Path(tree).rglob('deformable_ccd-targets.cmake'))
            self.assertEqual(len(exported), 1)
            self.assertIn('add_library(deformable_ccd::deformable_ccd SHARED IMPORTED)', exported[0].read_text())


if __name__ == '__main__':
    unittest.main()
