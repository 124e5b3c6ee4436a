"""What happens to processes around the node: overload, a subscriber that never reads, SIGTERM in mid-step, a master that
goes away. Each test starts a master and a node of its own."""
import os
import pathlib
import random
import shutil
import signal
import socket
import struct
import subprocess
import tempfile
import time
import unittest
import warnings
import xmlrpc.client

import rosgraph
import rospy
from deformable_ccd.msg import StepStats
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Bool

CHECKOUT = pathlib.Path(__file__).resolve().parents[2]
SLOW = 20 if os.environ.get('DEFORMABLE_CCD_SANITIZED') else 1


def free_port():
    with socket.socket() as s:
        s.bind(('localhost', 0))
        return s.getsockname()[1]


def wait_for(done, seconds, what):
    end = time.monotonic() + seconds * SLOW
    while not done():
        if time.monotonic() > end:
            raise AssertionError('waited %g s for %s' % (seconds * SLOW, what))
        time.sleep(0.01)


def resident_kb(pid):
    for line in pathlib.Path('/proc/%d/status' % pid).read_text().splitlines():
        if line.startswith('VmRSS:'):
            return int(line.split()[1])
    raise AssertionError('no VmRSS')


class Cloud:
    """A grid of points that is crumpled anew in each frame, so that a step has much to do."""

    def __init__(self, rows, cols):
        self.rows, self.cols = rows, cols
        noise = random.Random(1)
        self.variants = [b''.join(struct.pack('<3d', 0.01 * c + noise.uniform(-0.02, 0.02),
                                              0.01 * r + noise.uniform(-0.02, 0.02), noise.uniform(-0.02, 0.02))
                                  for r in range(rows) for c in range(cols)) for _ in range(4)]
        self.count = 0

    def message(self, stamp_s=None):
        self.count += 1
        m = PointCloud2(height=self.rows, width=self.cols, point_step=24, row_step=24 * self.cols, is_dense=True,
                        data=self.variants[self.count % len(self.variants)])
        m.fields = [PointField(name=n, offset=8 * i, datatype=PointField.FLOAT64, count=1) for i, n in enumerate('xyz')]
        m.header.frame_id = 'world'
        m.header.stamp = rospy.Time.from_sec(stamp_s if stamp_s is not None else 100 + 0.01 * self.count)
        return m


class NodeFaultsTest(unittest.TestCase):
    """rospy initialises once a process, so one master's address serves all tests; each node has a name of its own."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix='node_faults_')
        cls.port = free_port()
        os.environ.update(ROS_MASTER_URI='http://localhost:%d' % cls.port, ROS_HOSTNAME='localhost', ROS_HOME=cls.folder,
                          ROS_LOG_DIR=cls.folder)
        cls.start_master()
        rospy.init_node('node_faults_test', disable_signals=True)

    @classmethod
    def tearDownClass(cls):
        rospy.signal_shutdown('done')
        cls.stop_master()
        shutil.rmtree(cls.folder, ignore_errors=True)

    @classmethod
    def start_master(cls):
        cls.master = subprocess.Popen(['rosmaster', '--core', '-p', str(cls.port)], stdout=subprocess.DEVNULL,
                                      stderr=subprocess.DEVNULL)
        wait_for(lambda: rosgraph.is_master_online(), 20, 'the master')

    @classmethod
    def stop_master(cls):
        cls.master.terminate()
        cls.master.wait(20)

    def setUp(self):
        warnings.simplefilter('ignore', ResourceWarning)  # rospy leaves sockets to the collector

    def start_node(self, name, **parameters):
        arguments = ['__name:=' + name, 'mesh:=/%s/mesh' % name, '_fixed_frame:=world', '_max_vertex_step_m:=0.0',
                     '_effects/octomap:=off', '_max_contacts:=100']
        arguments += ['_%s:=%s' % item for item in parameters.items()]
        node = subprocess.Popen([str(self.tool('collision_monitor_node'))] + arguments)
        self.addCleanup(self.end, node)
        self.stats, self.clear = [], []
        for topic, kind, into in (('stats', StepStats, self.stats), ('clear', Bool, self.clear)):
            subscriber = rospy.Subscriber('/%s/%s' % (name, topic), kind, into.append)
            self.addCleanup(subscriber.unregister)
        self.publisher = rospy.Publisher('/%s/mesh' % name, PointCloud2, queue_size=None, tcp_nodelay=True)
        self.addCleanup(self.publisher.unregister)
        wait_for(lambda: self.publisher.get_num_connections() == 1, 20, 'the node to subscribe')
        return node

    @staticmethod
    def tool(name):
        for prefix in os.environ['CMAKE_PREFIX_PATH'].split(':'):
            path = pathlib.Path(prefix) / 'lib/deformable_ccd' / name
            if path.exists():
                return path
        raise AssertionError(name + ' was not built')

    @staticmethod
    def end(node):
        if node.poll() is None:
            node.kill()
        node.wait()

    def assert_adds_up(self, s):
        self.assertEqual(s.frames_received, s.frames_processed + s.frames_started + s.frames_skipped + s.frames_waiting)
        self.assertEqual(s.frames_skipped, s.skipped_duplicate + s.skipped_vertex_count + s.skipped_bad_message +
                         s.skipped_no_transform + s.skipped_no_body + s.skipped_queue_full + s.skipped_disabled +
                         s.skipped_reset + s.skipped_error)

    def overload(self, name, policy, size, factor):
        """Frames at `factor` times the rate at which steps are done; returns the newest stamps and the last statistics."""
        node = self.start_node(name, queue_size=size, queue_policy=policy)
        cloud = Cloud(24, 24)
        for _ in range(6):
            seen = len(self.stats)
            self.publisher.publish(cloud.message())
            wait_for(lambda: len(self.stats) > seen, 20, 'a step')
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
        self.assertLess(memory_kb[-1], memory_kb[0] + 20000, 'memory grows: %s kB' % memory_kb)
        return cloud, last

    def test_overload_newest_first(self):
        for factor in (2, 10):
            with self.subTest(factor=factor):
                cloud, last = self.overload('newest_%d' % factor, 'newest', 3, factor)
                self.assertAlmostEqual(last.header.stamp.to_sec(), 100 + 0.01 * cloud.count, 6, 'the newest frame is answered')

    def test_overload_oldest_first(self):
        for factor in (2, 10):
            with self.subTest(factor=factor):
                cloud, last = self.overload('oldest_%d' % factor, 'oldest', 3, factor)
                self.assertLessEqual(last.header.stamp.to_sec(), 100 + 0.01 * cloud.count)

    def test_a_subscriber_that_never_reads(self):
        node = self.start_node('unread', queue_size=100)
        master = rosgraph.Master('/node_faults_test')
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
            seen = len(self.stats)
            self.publisher.publish(cloud.message())
            wait_for(lambda: len(self.stats) > seen, 20, 'a step while others do not read')
            if i % 500 == 499:
                memory_kb.append(resident_kb(node.pid))
        # Queues towards subscribers have a length; the first third fills them and the socket's buffers.
        self.assertLess(memory_kb[2], memory_kb[1] + 8000, 'memory grows: %s kB' % memory_kb)
        self.assertEqual(self.stats[-1].frames_received, 1500)
        self.assert_adds_up(self.stats[-1])
        self.assertIsNone(node.poll())

    def test_sigterm_in_mid_step(self):
        node = self.start_node('ended', queue_size=100)
        cloud = Cloud(60, 60)
        for _ in range(2):
            seen = len(self.stats)
            self.publisher.publish(cloud.message())
            wait_for(lambda: len(self.stats) > seen, 60, 'a step')
        step_s = self.stats[-1].total_ms * 1e-3
        for _ in range(20):  # far more than it does before the signal
            self.publisher.publish(cloud.message())
        time.sleep(0.3 * step_s)
        node.send_signal(signal.SIGTERM)
        begin = time.monotonic()
        self.assertEqual(node.wait((10 + 3 * step_s) * SLOW), 0)
        self.assertLess(time.monotonic() - begin, (5 + 3 * step_s) * SLOW)

    def test_the_master_goes_and_comes_back(self):
        node = self.start_node('masterless')
        cloud = Cloud(5, 5)

        def step():
            seen = len(self.stats)
            self.publisher.publish(cloud.message())
            wait_for(lambda: len(self.stats) > seen, 20, 'a step')
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
