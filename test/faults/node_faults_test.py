"""What happens to processes around the node: overload, a subscriber that never reads, a master that goes away, a clock that
jumps, a disk that is full. Each test starts a node of its own."""
import os
import pathlib
import signal
import socket
import struct
import subprocess
import sys
import time
import unittest
import xmlrpc.client

import rosgraph
import rospy
from deformable_ccd.msg import ContactArray
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / 'scripts/lib'))
from ros_process import SLOW, free_port, wait_for
from live_node import Cloud, LiveNodeTest, resident_kb, simulated_time


class NodeFaultsTest(LiveNodeTest):
    def overload(self, name, policy, size, factor):
        """Frames at `factor` times the rate at which steps are done; returns the newest stamps and the last statistics."""
        node = self.start_node(name, queue_size=size, queue_policy=policy)
        cloud = Cloud(24, 24, padding=152)  # 101 kB a frame
        for _ in range(6):
            self.step(cloud.message())
        step_s = max(s.total_ms for s in self.stats[2:]) * 1e-3
        sent, pause_s = cloud.count, step_s / factor
        memory_kb = []
        frames = 300
        due = time.monotonic()
        for i in range(frames):
            self.publisher.publish(cloud.message())
            if i % 100 == 99:
                memory_kb.append(resident_kb(node.pid))
            due += pause_s
            time.sleep(max(0, due - time.monotonic()))
        sent += frames
        wait_for(lambda: self.stats[-1].frames_received == sent and self.stats[-1].frames_waiting == 0, 60,
                 'all %d frames; %d were received' % (sent, self.stats[-1].frames_received))
        last = self.stats[-1]
        self.assert_adds_up(last)
        self.assertEqual(last.frames_processed + last.frames_started + last.skipped_queue_full, sent)
        self.assertGreater(last.skipped_queue_full, 0, 'it was no overload')
        # A frame waits for those before it in the queue and for the step that runs, however long the overload lasts.
        longest_s = max(s.total_ms for s in self.stats) * 1e-3
        self.assertLess(max(s.latency for s in self.stats), (size + 3) * longest_s + 0.5 * SLOW)
        # Between the two, 200 frames came: 20 MB, had they been kept. Under sanitizers what is freed stays a while.
        if SLOW == 1:
            self.assertLess(memory_kb[-1], memory_kb[0] + 10000, 'memory grows: %s kB' % memory_kb)
        return cloud, last

    def test_overload_newest_first(self):
        for factor in (2, 10):
            with self.subTest(factor=factor):
                cloud, last = self.overload('newest_%d' % factor, 'newest', 3, factor)
                self.assertAlmostEqual(last.header.stamp.to_sec(), 100 + 0.01 * cloud.count, 6, 'the newest frame is answered')

    def test_overload_oldest_first(self):
        for factor in (2, 10):
            with self.subTest(factor=factor):
                self.overload('oldest_%d' % factor, 'oldest', 3, factor)  # which frames are kept: InputQueue's test

    def test_a_subscriber_that_never_reads(self):
        node = self.start_node('unread', queue_size=100)
        master = rosgraph.Master('/live_node_test')
        proxy = xmlrpc.client.ServerProxy(master.lookupNode('/unread'))
        sockets = []
        for topic in ('contacts', 'stats', 'markers'):
            kind = {'contacts': 'deformable_ccd/ContactArray', 'stats': 'deformable_ccd/StepStats',
                    'markers': 'visualization_msgs/MarkerArray'}[topic]
            code, why, protocol = proxy.requestTopic('/never_reads', '/unread/' + topic, [['TCPROS']])
            self.assertEqual(code, 1, why)
            s = socket.create_connection((protocol[1], protocol[2]))
            self.addCleanup(s.close)
            fields = ['callerid=/never_reads', 'topic=/unread/' + topic, 'type=' + kind, 'md5sum=*']
            header = b''.join(struct.pack('<I', len(f)) + f.encode() for f in fields)
            s.sendall(struct.pack('<I', len(header)) + header)
            sockets.append(s)
        cloud = Cloud(10, 10)
        memory_kb = []
        for i in range(1500):
            self.step(cloud.message())
            if i % 500 == 499:
                memory_kb.append(resident_kb(node.pid))
        # Queues towards subscribers have a length; the first third fills them and the socket's buffers. Under sanitizers
        # what is freed stays a while.
        if SLOW == 1:
            self.assertLess(memory_kb[2], memory_kb[1] + 8000, 'memory grows: %s kB' % memory_kb)
        self.assertEqual(self.stats[-1].frames_received, 1500)
        self.assert_adds_up(self.stats[-1])
        self.assertIsNone(node.poll())

    def test_the_clock_jumps_both_ways(self):
        """Frames without a stamp, so that they are taken at the time that /clock says."""
        with simulated_time():
            self.start_node('clocked')
        clock = self.advertise('/clock', Clock, 10, latch=True)
        cloud = Cloud(4, 4)

        def step_at(now_s):
            """The frame is sent again while the node has not seen the clock, which comes on a connection of its own."""
            clock.publish(Clock(rospy.Time.from_sec(now_s)))
            end = time.monotonic() + 20 * SLOW
            while time.monotonic() < end:
                outcome = self.step(cloud.message(0))
                if outcome.header.stamp.to_sec() == now_s and outcome.status != ContactArray.DUPLICATE:
                    return outcome
                time.sleep(0.01)
            raise AssertionError('the node never saw %g s' % now_s)

        # A gap where a frame came before the clock did, at a time of 0.
        self.assertIn(step_at(1000).status, (ContactArray.FIRST_FRAME, ContactArray.GAP))
        self.assertIn(step_at(1000.125).status, (ContactArray.OK, ContactArray.PARTIAL))
        for jump_to_s, status in ((500, ContactArray.TIME_JUMP), (90000, ContactArray.GAP), (89999.875, ContactArray.TIME_JUMP)):
            jumped = step_at(jump_to_s)
            self.assertEqual(jumped.status, status, jumped.reason)
            self.assertFalse(jumped.answered)
            # PARTIAL where a frame was sent once more for a stamp, with another content: the clock had not come yet.
            self.assertIn(step_at(jump_to_s + 0.125).status, (ContactArray.OK, ContactArray.PARTIAL), 'recovered within two')
        self.assertEqual(self.stats[-1].receipt_stamps, cloud.count)
        self.assertEqual(self.stats[-1].frames_received, cloud.count)
        self.assert_adds_up(self.stats[-1])

    def test_a_full_disk_while_recording(self):
        folder = pathlib.Path(self.folder) / 'deformable_ccd'
        folder.mkdir()
        self.start_node('full', process={'env': {**os.environ, 'ROS_HOME': str(self.folder)}}, record_steps=1)
        cloud = Cloud(4, 4)
        for _ in range(2):
            self.step(cloud.message())
        # The file that comes next lies on a device without space.
        part = folder / ('step_full_2_%d.step.part' % self.contacts[-1].header.stamp.to_nsec())
        part.symlink_to('/dev/full')
        record = rospy.ServiceProxy('/full/record_step', Trigger)
        answer = record()
        self.assertFalse(answer.success)
        self.assertIn('No space left on device', answer.message)
        self.assertEqual(list(folder.iterdir()), [], 'nothing is left behind')
        self.assertEqual(self.step(cloud.message()).status, ContactArray.OK, 'and goes on')
        answer = record()
        self.assertTrue(answer.success, answer.message)
        self.assertEqual([str(p) for p in folder.iterdir()], [answer.message])
        self.assertEqual(subprocess.run([str(self.tool('replay_step')), answer.message], stdout=subprocess.DEVNULL).returncode, 0)
        self.assertEqual(self.stats[-1].frames_received, 3)
        self.assert_adds_up(self.stats[-1])

    def test_what_waits_for_a_master_ends(self):
        for sent in (signal.SIGINT, signal.SIGTERM):
            node = subprocess.Popen([str(self.tool('collision_monitor_node'))], stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                                    env=dict(os.environ, ROS_MASTER_URI='http://localhost:%d' % free_port()))
            self.addCleanup(node.stderr.close)
            self.addCleanup(node.kill)
            self.assertIn('Failed to contact master', node.stderr.readline())
            node.send_signal(sent)
            self.assertEqual(node.wait(timeout=5 * SLOW), 0)

    def test_the_master_goes_and_comes_back(self):
        node = self.start_node('masterless')
        cloud = Cloud(5, 5)

        def step():
            self.step(cloud.message())
            return self.stats[-1]

        step()
        self.assertTrue(step().answered)
        self.stop_master()
        try:
            for _ in range(5):
                self.assertTrue(step().answered, 'connections that are there need no master')
        finally:
            self.start_master()
        last = step()
        self.assertTrue(last.answered)
        self.assertEqual(last.frames_received, 8)
        self.assert_adds_up(last)
        self.assertIsNone(node.poll())


if __name__ == '__main__':
    unittest.main()
