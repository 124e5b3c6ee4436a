"""Publishers that are killed, that come first and say nothing, that change their type: what is published next must be taken as if the
node were new."""
import pathlib
import signal
import subprocess
import sys
import time
import unittest

import rospy
from attack import AttackTest, sheet_mesh, wait_for
from deformable_ccd.msg import ContactArray, MeshStamped

PROGRAM = str(pathlib.Path(__file__).resolve().parent / 'attack.py')
# Ten times what is promised, for a machine that is busy.
SOON = 20


class PublishersTest(AttackTest):
    def process(self, *arguments):
        process = subprocess.Popen([sys.executable, PROGRAM, *arguments])
        self.addCleanup(self.end, process)
        return process

    def wait_answers(self, what):
        seen, begin = len(self.contacts), time.monotonic()
        wait_for(lambda: any(c.answered for c in self.contacts[seen:]), SOON, what)
        print('%s: %.2f s' % (what, time.monotonic() - begin))

    def test_killed_and_followed_by_another_type(self):
        self.start_node('successor', publishes=False, max_step_s=1e6)
        for kind in ('cloud', 'mesh', 'cloud'):
            publisher = self.process('publish', kind, '/successor/mesh')
            self.wait_answers('the first answer to a %s' % kind)
            publisher.send_signal(signal.SIGKILL)
            publisher.wait()
        self.assert_quiet(SOON, 4)

    def test_a_silent_publisher_of_a_wrong_type_comes_first(self):
        for kind in ('text', 'mesh'):
            self.start_node('locked_by_' + kind, publishes=False)
            self.process('silent', kind, '/locked_by_%s/mesh' % kind)
            time.sleep(1.5)
            self.process('publish', 'cloud', '/locked_by_%s/mesh' % kind)
            self.wait_answers('clouds behind a silent publisher of %s' % kind)

    def test_a_silent_publisher_that_was_there_before_the_node(self):
        """Whichever of the two registered last, so that the master cannot say which type is the right one."""
        for order in (('silent', 'mesh'), ('publish', 'cloud')), (('publish', 'cloud'), ('silent', 'mesh')):
            name = 'before_' + order[0][0]
            both = []
            for what, kind in order:
                both.append(self.process(what, kind, '/%s/mesh' % name))
                time.sleep(1)
            self.start_node(name, publishes=False)
            self.wait_answers('clouds beside a silent publisher, %s first' % order[0][0])
            for process in both:
                process.kill()
                process.wait()

    def test_one_that_comes_and_goes_without_a_word(self):
        """Between two looks at who publishes."""
        self.start_node('brief', publishes=False)
        for _ in range(5):
            brief = rospy.Publisher('/brief/mesh', MeshStamped, queue_size=1)
            time.sleep(0.02)
            brief.unregister()
            time.sleep(0.02)
        self.process('publish', 'cloud', '/brief/mesh')
        self.wait_answers('clouds after brief visits')

    def test_a_latched_mesh_is_taken_once(self):
        """The topic is silent from then on, which is no reason to ask for it again."""
        self.start_node('latched', publishes=False)
        latched = rospy.Publisher('/latched/mesh', MeshStamped, queue_size=1, latch=True)
        self.addCleanup(latched.unregister)
        latched.publish(sheet_mesh(0))
        wait_for(lambda: len(self.contacts) == 1, SOON, 'its outcome')
        time.sleep(6)
        self.assertEqual([c.status for c in self.contacts], [ContactArray.FIRST_FRAME])


if __name__ == '__main__':
    unittest.main()
