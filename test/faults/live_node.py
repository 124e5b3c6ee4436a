"""A node of its own for each test, started as a process, with a publisher and what it says collected."""
import contextlib
import io
import os
import pathlib
import random
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import warnings
import xmlrpc.client

import rosgraph
import rospy
from deformable_ccd.msg import ContactArray, State, StepStats
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Bool

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / 'scripts/lib'))
from ros_process import free_port, wait_for


def resident_kb(pid, what='VmRSS:'):
    for line in pathlib.Path('/proc/%d/status' % pid).read_text().splitlines():
        if line.startswith(what):
            return int(line.split()[1])
    raise AssertionError('no ' + what)


def bytes_of(message):
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def raw(kind, data):
    """A message of a type whose bytes are these."""
    class Raw(kind):
        def serialize(self, buff):
            buff.write(data)

        def _check_types(self, exc=None):
            pass
    return Raw()


def grid_faces(rows, cols):
    faces = []
    for r in range(rows - 1):
        for c in range(cols - 1):
            a = r * cols + c
            faces += [(a, a + 1, a + cols), (a + 1, a + cols + 1, a + cols)]
    return faces


@contextlib.contextmanager
def simulated_time():
    """For the nodes that start meanwhile."""
    rospy.set_param('/use_sim_time', True)
    try:
        yield
    finally:
        rospy.delete_param('/use_sim_time')


def wrong_sums(s):
    """What of the frames of a StepStats does not add up."""
    wrong = []
    # What waits is reckoned as what is left: no more can wait than 64 steps and a frame of each body.
    if s.frames_waiting > 80 or s.frames_received != s.frames_processed + s.frames_started + s.frames_skipped + s.frames_waiting:
        wrong.append('%d received, %d processed, %d started, %d skipped, %d waiting' % (
            s.frames_received, s.frames_processed, s.frames_started, s.frames_skipped, s.frames_waiting))
    if s.frames_skipped != (s.skipped_duplicate + s.skipped_vertex_count + s.skipped_bad_message + s.skipped_no_transform +
                            s.skipped_no_body + s.skipped_queue_full + s.skipped_disabled + s.skipped_reset + s.skipped_error):
        wrong.append('skipped frames do not add up')
    return wrong


class Cloud:
    """A grid of points that is crumpled anew in each frame, so that a step has much to do; `padding` bytes a point are no
    field's, so that frames that are kept show in the memory."""

    def __init__(self, rows, cols, padding=0):
        self.rows, self.cols, self.point_step = rows, cols, 24 + padding
        noise = random.Random(1)
        self.variants = [b''.join(struct.pack('<3d%dx' % padding, 0.01 * c + noise.uniform(-0.02, 0.02),
                                              0.01 * r + noise.uniform(-0.02, 0.02), noise.uniform(-0.02, 0.02))
                                  for r in range(rows) for c in range(cols)) for _ in range(4)]
        self.count = 0

    def message(self, stamp_s=None):
        self.count += 1
        m = PointCloud2(height=self.rows, width=self.cols, point_step=self.point_step, row_step=self.point_step * self.cols, is_dense=True,
                        data=self.variants[self.count % len(self.variants)])
        m.fields = [PointField(name=n, offset=8 * i, datatype=PointField.FLOAT64, count=1) for i, n in enumerate('xyz')]
        m.header.frame_id = 'world'
        m.header.stamp = rospy.Time.from_sec(stamp_s if stamp_s is not None else 100 + 0.01 * self.count)
        return m


class LiveNodeTest(unittest.TestCase):
    """rospy initialises once a process, so one master's address serves all tests; each node has a name of its own."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix='live_node_')
        cls.port = free_port()
        os.environ.update(ROS_MASTER_URI='http://localhost:%d' % cls.port, ROS_HOSTNAME='localhost', ROS_HOME=cls.folder,
                          ROS_LOG_DIR=cls.folder)
        cls.start_master()
        rospy.init_node('live_node_test', disable_signals=True)

    @classmethod
    def tearDownClass(cls):
        try:
            rospy.signal_shutdown('done')
        except AttributeError:
            pass  # Debian 11: rospy ends with a call that its Python 3.9 does not know, when all the rest is shut down
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

    def start_node(self, name, process=None, publishes=True, **parameters):
        """`publishes`: with `self.publisher`, to which the node has then subscribed."""
        arguments = ['__name:=' + name, 'mesh:=/%s/mesh' % name, '_fixed_frame:=world', '_max_vertex_step_m:=0.0',
                     '_effects/octomap:=off', '_max_contacts:=100']
        arguments += ['_%s:=%s' % item for item in parameters.items()]
        node = subprocess.Popen([str(self.tool('collision_monitor_node'))] + arguments, **(process or {}))
        self.addCleanup(self.end, node)
        subscribers = self.listen_to(name)
        if publishes:
            self.publisher = self.advertise('/%s/mesh' % name, PointCloud2, tcp_nodelay=True)
        for last in (False, False, True):
            try:
                wait_for(lambda: all(s.get_num_connections() == 1 for s in subscribers), 20 if last else 7, 'its topics')
                break
            except TimeoutError:  # rospy now and then loses a connection, or makes two: it is asked again
                for subscriber in subscribers:
                    subscriber.unregister()
                if last:
                    raise
                subscribers = self.listen_to(name)
        for subscriber in subscribers:
            self.addCleanup(subscriber.unregister)
        # A listener is connected a moment before the node knows of it, and what is published in between is lost.
        asked = xmlrpc.client.ServerProxy(rosgraph.Master('/live_node_test').lookupNode('/' + name))
        topics = {subscriber.resolved_name for subscriber in subscribers}
        wait_for(lambda: topics <= {row[4] for row in asked.getBusInfo('/live_node_test')[2] if row[2] == 'o'}, 20, 'the node to know of them')
        return node

    def listen_to(self, name):
        self.stats, self.clear, self.contacts, self.states = [], [], [], []
        return [rospy.Subscriber('/%s/%s' % (name, topic), kind, into.append)
                for topic, kind, into in (('stats', StepStats, self.stats), ('clear', Bool, self.clear),
                                          ('contacts', ContactArray, self.contacts), ('state', State, self.states))]

    def advertise(self, topic, kind, queue_size=None, **options):
        """A publisher to which the node has then subscribed."""
        publisher = rospy.Publisher(topic, kind, queue_size=queue_size, **options)
        self.addCleanup(publisher.unregister)
        wait_for(lambda: publisher.get_num_connections() >= 1, 20, 'the node to listen to ' + topic)
        return publisher

    def retype(self, name, kind):
        """From now on the node's mesh is of another type."""
        self.publisher.unregister()
        self.publisher = self.advertise('/%s/mesh' % name, kind)
        return self.publisher

    def outcomes_of(self, publisher, messages):
        """Publishes each after the one before has its outcome; the outcomes."""
        outcomes = []
        for message in messages:
            seen = len(self.contacts)
            publisher.publish(message)
            wait_for(lambda: len(self.contacts) > seen, 20, 'an outcome')
            outcomes.append(self.contacts[seen])
        return outcomes

    def step(self, message):
        """Publishes one frame; returns the outcome that it leads to, after its statistics have come, too."""
        seen, counted = len(self.contacts), len(self.stats)
        self.publisher.publish(message)
        wait_for(lambda: len(self.contacts) > seen and len(self.stats) > counted, 20, 'a step')
        return self.contacts[-1]

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
        self.assertEqual(wrong_sums(s), [])
