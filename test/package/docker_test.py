"""The Dockerfiles: each line of those on Debian is run in a bare root in a container's place, and what the images start answers there."""
import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from checkout import CHECKOUT
from bare_root import BareRoot, CannotMake, checkout_files
from ros_process import free_port

MONITOR, DEMO, NOETIC = (CHECKOUT / 'docker' / name for name in ('Dockerfile', 'demo.Dockerfile', 'noetic.Dockerfile'))
DISPLAY = ':%d' % (os.getpid() % 10000 + 100)
# As in Debian's own images: no waiting for the disk; and what the slim one does not unpack.
DPKG = 'force-unsafe-io\n'
SLIM = ''.join('path-exclude /usr/share/%s/*\n' % name for name in ('doc', 'info', 'locale', 'man'))


def until(command):
    return "timeout 120 bash -c 'until %s; do sleep 0.5; done'" % command


def instructions(path):
    """Word and rest of each instruction."""
    text = re.sub(r'\\\n\s*', '', re.sub(r'(?m)^#.*\n', '', path.read_text()))
    return [line.split(None, 1) for line in text.splitlines() if line]


class Image(BareRoot):
    """A root with what the instructions after its FROM say."""

    def __init__(self, folder, base):
        super().__init__(folder, 'bookworm')
        self.place, self.environment, self.command = '/', {}, None
        if isinstance(base, Image):
            subprocess.run(['cp', '-a', str(base.folder), str(self.folder)], check=True)
            self.environment.update(base.environment)
        else:
            assert re.fullmatch(r'debian:12(-slim)?', base), base
            self.make(include=())
            (self.folder / 'etc/dpkg/dpkg.cfg.d/image').write_text(DPKG + (SLIM if base.endswith('slim') else ''))

    def follow(self, word, rest, images):
        if word == 'ENV':
            self.environment.update([rest.split('=', 1)])
        elif word == 'WORKDIR':
            self.place = rest
            self.outside(rest).mkdir(parents=True)
        elif word == 'COPY':
            self.copy(rest, images)
        elif word == 'CMD':
            self.command = json.loads(rest)
        else:
            assert word == 'RUN', word
            self.shell(rest)

    def outside(self, path):
        return pathlib.Path(str(self.folder) + path)

    def copy(self, rest, images):
        if rest == '. .':
            for name in checkout_files():
                target = self.outside(self.place) / name
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(CHECKOUT / name, target, follow_symlinks=False)
            return
        stage, pattern, place = re.fullmatch(r'--from=(\w+) (/\S+) (/\S+/)', rest).groups()
        self.outside(place).mkdir(parents=True)
        for path in sorted(images[stage].folder.glob(pattern.lstrip('/'))):
            shutil.copy2(path, self.outside(place))

    def shell(self, command, **environment):
        ran = self.run('cd %s; %s' % (self.place, command), environment={**self.environment, **environment}, capture_output=True, text=True,
                       errors='replace')
        assert ran.returncode == 0, '%s\n%s\n%s' % (command, ran.stdout[-3000:], ran.stderr[-3000:])
        return ran.stdout


def build(folder, path, images):
    """Adds each stage to `images`, by its name, and the last one by `path`."""
    image = None
    for word, rest in instructions(path):
        if word == 'FROM':
            base, _, name = rest.partition(' AS ')
            image = images[name or path] = Image(folder / ('%s-%d' % (path.name, len(images))), images.get(base, base))
        else:
            image.follow(word, rest, images)


def missing():
    """Why there can be no roots here; empty where there can be."""
    if not os.environ.get('DEFORMABLE_CCD_LONG'):
        return 'takes minutes: DEFORMABLE_CCD_LONG=1, or scripts/test --long'
    if os.environ.get('DEFORMABLE_CCD_SANITIZED') or os.environ.get('DEFORMABLE_CCD_IN_BARE_ROOT'):
        return 'images are made of the ordinary build, not within a root'
    return ''


class LinesTest(unittest.TestCase):
    """What linters of Dockerfiles ask for."""

    def test_lines(self):
        for path in (MONITOR, DEMO, NOETIC):
            found = instructions(path)
            self.assertEqual(found[0][0], 'FROM')
            self.assertEqual(found[-1][0], 'CMD')
            self.assertIsInstance(json.loads(found[-1][1]), list)  # no shell between the container and its program
            for word, rest in found:
                with self.subTest('%s: %s %s' % (path.name, word, rest)):
                    self.assertIn(word, ('FROM', 'ENV', 'WORKDIR', 'COPY', 'RUN', 'ENTRYPOINT', 'CMD'))
                    if word == 'FROM':
                        self.assertRegex(rest, r'^\w+:(?!latest)\S+')
                    if 'apt-get' in rest:
                        self.assertRegex(rest, r'^apt-get update && apt-get install -y --no-install-recommends .* && rm -rf .*/var/lib/apt/lists/\*$')


@unittest.skipIf(missing(), missing())
class ImagesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = pathlib.Path(tempfile.mkdtemp(prefix='deformable_ccd_docker_', dir=os.environ.get('DEFORMABLE_CCD_ROOTS')))
        cls.addClassCleanup(shutil.rmtree, folder)
        cls.images = {}
        try:
            build(folder, MONITOR, cls.images)
        except CannotMake as why:
            raise unittest.SkipTest(str(why))
        cls.images['deformable_ccd:local'] = cls.images[MONITOR]
        build(folder, DEMO, cls.images)

    def answers(self, path, arguments, before='', beside='', also='true'):
        """Starts the image's command and what runs beside it, and waits for a proved step and for what is to hold also."""
        started = '%s %s >/tmp/launch.log 2>&1 & %s' % (before, ' '.join(self.images[path].command + arguments), beside)
        self.images[path].shell(started + until('rostopic echo -n 1 /collision_monitor/state | grep "^proved: True"') + ' && ' + until(also),
                                HOME='/tmp', ROS_MASTER_URI='http://localhost:%d' % free_port(), ROS_HOSTNAME='localhost', DISPLAY=DISPLAY)

    def test_the_monitor_answers_a_tracker(self):
        self.answers(MONITOR, ['mesh:=/tracker/cloth', 'rows:=20', 'cols:=30'], beside='rosrun deformable_ccd publish_cloth.py >/tmp/cloth.log 2>&1 & ')

    def test_the_demo_answers_and_rviz_listens(self):
        self.images[DEMO].shell('apt-get update && apt-get install -y --no-install-recommends xvfb')
        self.answers(DEMO, [], before='Xvfb %s >/tmp/xvfb.log 2>&1 & ' % DISPLAY + until('[ -e /tmp/.X11-unix/X%s ]' % DISPLAY[1:]) + ';',
                     also='rostopic info /collision_monitor/markers | grep " /rviz"')


if __name__ == '__main__':
    unittest.main()
