"""What must not hold the node up: a master that hangs, and a step or a map that is computed while it is told to end."""
import os
import signal
import subprocess
import time
import unittest

import rospy
from attack import COLS, ROWS, SLOW, AttackTest, checkerboard_file, cloud_of, flat_cloud, wait_for

# The promise is a second; what is asserted is that nothing hangs.
HANGS_S = 10


class EndingTest(AttackTest):
    def ends(self, node, number, what):
        begin = time.monotonic()
        node.send_signal(number)
        self.assertEqual(node.wait(HANGS_S * SLOW), 0)
        took = time.monotonic() - begin
        print('%s: ended after %.2f s' % (what, took))
        self.assertLess(took, HANGS_S * SLOW)

    def test_a_frozen_master_and_a_silent_body(self):
        for key, value in {'cloth/topic': '/frozen/mesh', 'table/topic': '/frozen/table', 'cloth/topology/rows': ROWS,
                           'cloth/topology/cols': COLS}.items():
            rospy.set_param('/frozen/bodies/' + key, value)
        node = self.start_node('frozen', clock_body='cloth')
        self.publisher.publish(flat_cloud(0))
        wait_for(lambda: self.contacts, 20, 'the first outcome')
        self.master.send_signal(signal.SIGSTOP)
        try:
            slowest, index = 0, 1
            end = time.monotonic() + 8  # the node looks into silence every three seconds
            while time.monotonic() < end:
                begin = time.monotonic()
                self.outcomes_of(self.publisher, [flat_cloud(index)])
                slowest = max(slowest, time.monotonic() - begin)
                index += 1
                time.sleep(0.03)
            print('a frozen master: the slowest outcome after %.2f s' % slowest)
            self.assertLess(slowest, 3 * SLOW)
            self.ends(node, signal.SIGTERM, 'a frozen master')
        finally:
            self.master.send_signal(signal.SIGCONT)
        wait_for(lambda: 'stopped' in self.states[-1].reason, 5, 'the last word')

    def test_a_step_of_seconds(self):
        """A tracker that collapses to one point: every pair of features meets."""
        for number in (signal.SIGINT, signal.SIGTERM):
            name = 'collapsed_%d' % number
            node = self.start_node(name)
            side = 30
            self.outcomes_of(self.publisher, [flat_cloud(0, side, side)])
            self.publisher.publish(cloud_of(1, [(0.1, 0.1, 0.1)] * (side * side), side, side))
            time.sleep(0.4)
            self.ends(node, number, 'a step of seconds')
            wait_for(lambda: 'stopped' in self.states[-1].reason, 5, 'the last word')
            self.assertFalse(self.clear[-1].data)

    def test_a_map_that_is_being_decoded(self):
        """A checkerboard: 8.4 million leaves in 4.8 MB; a file, so that it is there at once."""
        path = os.path.join(self.folder, 'board.bt')
        checkerboard_file(path, 7)
        node = subprocess.Popen([str(self.tool('collision_monitor_node')), '__name:=board', '_fixed_frame:=world',
                                 '_octomap_file:=' + path])
        self.addCleanup(self.end, node)
        # Until then a signal is not the node's to answer.
        begun = time.monotonic()
        while not self.catches(node.pid, signal.SIGINT) and time.monotonic() - begun < 10 * SLOW:
            time.sleep(0.01)
        self.assertIsNone(node.poll())
        self.ends(node, signal.SIGINT, 'a map that is being decoded')

    @staticmethod
    def catches(pid, number):
        """Whether the process has a handler of its own for the signal."""
        with open('/proc/%d/status' % pid, encoding='ascii') as status:
            mask = next(line.split()[1] for line in status if line.startswith('SigCgt:'))
        return int(mask, 16) >> (number - 1) & 1 == 1


if __name__ == '__main__':
    unittest.main()
