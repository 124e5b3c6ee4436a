"""Random sequences of messages of all types, maps, transforms, parameters, services, stamps and resets at a live node, and what must hold
at any time: it lives, its memory and its log are bounded, frames add up, nothing is clear without its list and its inputs, and good
frames are answered within two steps.

DEFORMABLE_CCD_LIVE_FUZZ_SECONDS: how long, 20 s unless told, with --long 300 s; _SEED: where it begins, 1 unless told. What was sent is
in the seed; the last actions are printed when something does not hold."""
import collections
import io
import os
import random
import signal
import struct
import time
import unittest
import xmlrpc.client

import dynamic_reconfigure.msg
import dynamic_reconfigure.srv
import genpy
import rosgraph
import rospy
from attack import SLOW, AttackTest, checkerboard, cloud_of, peak_kb, resident_kb, wait_for
from deformable_ccd.msg import ContactArray, MeshStamped
from geometry_msgs.msg import Point, TransformStamped
from octomap_msgs.msg import Octomap
from pcl_msgs.msg import PolygonMesh, Vertices
from sensor_msgs.msg import PointCloud2
from shape_msgs.msg import Mesh, MeshTriangle
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

SECONDS = float(os.environ.get('DEFORMABLE_CCD_LIVE_FUZZ_SECONDS', 300 if os.environ.get('DEFORMABLE_CCD_LONG') else 20))
SEED = int(os.environ.get('DEFORMABLE_CCD_LIVE_FUZZ_SEED', 1))
NODE_SECONDS = 30  # then the next node, with other parameters
LIMIT_MB = 64  # of memory and of maps, each
ANSWER_S = 60  # for an answer of a node that is not stuck, on a machine that is busy
ROWS, COLS = 8, 10
ODD = [0.0, -0.0, 1.0, 1e-320, 1e-30, 1e-9, 1e9, 1e30, 1e150, 1e300, float('inf'), float('-inf'), float('nan')]
NAMES = ['world', 'world', 'world', 'world', 'camera', 'nowhere', '', '/', '//cam', 'a b\n', '\x01', 'y' * 3000]
MESHES = [PointCloud2, MeshStamped, PolygonMesh, Mesh, Marker, MarkerArray]


def bytes_of(message):
    buff = io.BytesIO()
    message.serialize(buff)
    return buff.getvalue()


def raw(kind, data):
    """A message of a type whose bytes are these."""
    class Raw(kind):
        def serialize(self, buff):
            buff.write(data)

        def _check_types(self, exc=None):
            pass
    return Raw()


class Source:
    """What is sent: all of it from one random generator."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.stamp_s = 1000.0

    def stamp(self):
        step = self.random.choices([0.03, 0, -0.03, 5.0, -100.0, 1e6], [80, 4, 4, 4, 4, 1])[0]
        self.stamp_s = min(max(self.stamp_s + step, 1.0), 4e9)
        return rospy.Time() if self.random.random() < 0.03 else rospy.Time.from_sec(self.stamp_s)

    def frame_id(self):
        return self.random.choice(NAMES) if self.random.random() < 0.3 else 'world'

    def points(self, count):
        r = self.random
        kind = r.random()
        if kind < 0.1:
            return [(0.1, 0.1, 0.1)] * count  # a tracker that collapsed
        if kind < 0.2:
            return [tuple(r.choice(ODD) for _ in range(3)) for _ in range(count)]
        size = r.choice([0.0, 0.001, 0.01, 0.1])
        at = r.choice([(0, 0, 0), (0.1, 0, 0.2), (10, 10, 10)])
        points = [(at[0] + 0.01 * (i % COLS) + r.uniform(-size, size), at[1] + 0.01 * (i // COLS) + r.uniform(-size, size),
                   at[2] + r.uniform(-size, size)) for i in range(count)]
        if kind < 0.3:
            points[r.randrange(count)] = tuple(r.choice(ODD) for _ in range(3))
        return points

    def triangles(self, points, count):
        top = points if self.random.random() < 0.95 else 2 ** 32 - 1
        return [tuple(self.random.randrange(top) for _ in range(3)) for _ in range(count)]

    def mesh(self, kind):
        r = self.random
        rows, cols = r.choice([(ROWS, COLS), (ROWS, COLS), (2, 2), (1, 7), (20, 30), (1, 1)])
        points = self.points(rows * cols)
        if kind is PointCloud2 or kind is PolygonMesh:
            message = cloud_of(0, points, rows, cols)
            message.header.frame_id, message.header.stamp = self.frame_id(), self.stamp()
            if r.random() < 0.05:
                message.fields = message.fields[:r.randrange(3)]
            if r.random() < 0.05:
                message.point_step = r.choice([0, 1, 23, 2 ** 32 - 1])
            if kind is PointCloud2:
                return message
            faces = self.triangles(len(points), r.choice([0, 1, 50, 500]))
            return PolygonMesh(header=message.header, cloud=message, polygons=[Vertices(f[:r.choice([3, 3, 3, 0, 2])]) for f in faces])
        corners = [Point(*p) for p in points]
        faces = self.triangles(len(points), r.choice([1, 50, 500]))
        if kind is Mesh:
            return Mesh(vertices=corners, triangles=[MeshTriangle(f) for f in faces])
        if kind is MeshStamped:
            message = MeshStamped(vertices=corners, triangles=[MeshTriangle(f) for f in faces])
        else:
            message = Marker(type=r.choice([11, 11, 11, 0, 7]), points=(corners * 3)[:r.choice([3, 30, 31, 90])])
            message.pose.orientation.w = r.choice([1, 1, 1, 0, float('nan')])
        message.header.frame_id, message.header.stamp = self.frame_id(), self.stamp()
        return MarkerArray([message] * r.choice([0, 1, 1, 3])) if kind is MarkerArray else message

    def damaged(self, kind, message):
        """The message with bytes changed, cut or added, or none of its bytes."""
        data = bytearray(bytes_of(message))
        r = self.random
        how = r.random()
        if how < 0.4:
            for _ in range(r.choice([1, 4, 100])):
                data[r.randrange(len(data))] = r.choice([0, 1, 0x7f, 0x80, 0xff, r.randrange(256)])
        elif how < 0.6:
            data = data[:r.randrange(len(data))]
        elif how < 0.8:
            data += bytes(r.choice([1, 1000, 3000000]))
        elif how < 0.9:
            at = 4 * r.randrange(max(1, len(data) // 4 - 1))
            data[at:at + 4] = struct.pack('<I', r.choice([2 ** 31, 2 ** 32 - 1, 1000000, 500000000]))
        else:
            data = r.randbytes(r.choice([0, 3, 100, 1000000]))
        return raw(kind, bytes(data))

    def map(self):
        r = self.random
        data = checkerboard(r.choice([0, 2, 4, 5, 5, 6, 7]))
        if r.random() < 0.2:
            data = r.randbytes(r.choice([0, 2, 100, 100000]))
        if r.random() < 0.1:
            data = data[:r.randrange(len(data) + 1)]
        if r.random() < 0.1:
            data = struct.pack('<H', r.choice([0xaaaa, 0x5555, 0xa5a5, 0xffff])) + data
        whole = Octomap(binary=r.random() < 0.8, id=r.choice(['OcTree'] * 8 + ['ColorOcTree', 'x' * 5000]),
                        resolution=r.choice([0.01, 0.01, 0.05, 1e-5] + ODD))
        whole.header.frame_id, whole.header.stamp = self.frame_id(), rospy.Time()
        # rospy packs int8[] one by one, which takes seconds.
        return raw(Octomap, bytes_of(whole)[:-4] + struct.pack('<I', len(data)) + data)

    def transform(self):
        r = self.random
        t = TransformStamped(child_frame_id=r.choice(['camera', 'camera', 'camera', 'world', '', '//a', 'z' * 1000]))
        t.header.frame_id = r.choice(['world', 'world', 'camera', '', 'nowhere'])
        t.header.stamp = rospy.Time.from_sec(max(0, self.stamp_s + r.choice([0, 0, 0.1, -0.1, -1000, 1e6])))
        t.transform.translation.x = r.choice([0.0, 0.1] + ODD)
        t.transform.rotation.w = r.choice([1.0, 1.0, 1.0, 0.5, 0.0, float('nan')])
        return TFMessage([t] * r.choice([0, 1, 1, 1, 200]))


class Watch:
    """What the node says, judged as it comes."""

    def __init__(self, wants_map):
        self.wants_map = wants_map
        self.wrong, self.outcomes = [], collections.OrderedDict()
        self.clear_ones = collections.deque(maxlen=200)  # states, with when they came
        self.steps = 0

    def contacts(self, message):
        self.steps += 1
        self.outcomes.setdefault(message.header.stamp, []).append(message)
        if len(self.outcomes) > 300:
            self.outcomes.popitem(last=False)
        if len(message.reason) > 2000:
            self.wrong.append('a reason of %d characters' % len(message.reason))

    def counts(self, s):
        if s.frames_received != s.frames_processed + s.frames_started + s.frames_skipped + s.frames_waiting:
            self.wrong.append('%d received, %d processed, %d started, %d skipped, %d waiting' % (
                s.frames_received, s.frames_processed, s.frames_started, s.frames_skipped, s.frames_waiting))
        if s.frames_skipped != (s.skipped_duplicate + s.skipped_vertex_count + s.skipped_bad_message + s.skipped_no_transform +
                                s.skipped_no_body + s.skipped_queue_full + s.skipped_disabled + s.skipped_reset + s.skipped_error):
            self.wrong.append('skipped frames do not add up')
        if s.skipped_error:
            self.wrong.append('%d frames were lost to an error of the monitor' % s.skipped_error)

    def state(self, s):
        said = 'proved %s, touching %d, clear %s, missing %s' % (s.proved, s.touching, s.clear, s.missing)
        if s.proved != (not s.missing) or s.clear != (s.proved and s.touching == s.NONE):
            self.wrong.append(said)
        if s.clear and (s.holds_until.is_zero() or not (s.checked_self or s.checked_map or s.checked_bodies)):
            self.wrong.append('nothing was looked at: ' + said)
        if s.clear and self.wants_map and not s.checked_map:
            self.wrong.append('no map: ' + said)
        if s.clear:
            self.clear_ones.append((time.monotonic(), s))

    def compare(self):
        """Each clear state has an outcome of its stamp that says the same. They come by other connections, in any order, and a stamp
        may come again."""
        while self.clear_ones and time.monotonic() - self.clear_ones[0][0] > 1:
            said = self.outcomes.get(self.clear_ones.popleft()[1].holds_until, [])
            if said and not any(o.answered and o.complete and not o.contacts for o in said):
                self.wrong.append('clear beside statuses %s and %s contacts' % ([o.status for o in said], [len(o.contacts) for o in said]))


class LiveFuzzTest(AttackTest):
    def parameters(self):
        r = self.source.random
        chosen = {'max_memory_mb': LIMIT_MB, 'max_map_mb': LIMIT_MB, 'record_folder': self.folder, 'record_steps': r.choice([0, 1, 20]),
                  'num_threads': r.choice([1, 2]), 'queue_policy': r.choice(['newest', 'oldest']), 'queue_size': r.choice([1, 8, 50]),
                  'effects/octomap': r.choice(['on', 'on', 'off']), 'octomap_topic': '/fuzz_map', 'look_ahead_s': r.choice([0.0, 0.1]),
                  'markers/mesh': r.choice(['true', 'false']), 'markers/obstacle_m': r.choice([0.0, 0.5]),
                  'fixed_frame': r.choice(['world', '']), 'transform_timeout_s': r.choice([0.0, 0.1]),
                  'step_budget_ms': r.choice([0.0, 0.0, 5.0]), 'max_compute_s': 0.2, 'uncertainty/radius_m': r.choice([0.0, 0.0, 0.001]),
                  'unknown_space': r.choice(['free', 'free', 'report', 'occupied']), 'weld': r.choice(['on', 'off'])}
        self.lists = {'unknown_box': [-1, -1, -1, 1, 1, 1]}
        if r.random() < 0.4:
            self.lists['exclude_boxes'] = [[-0.5, -0.5, -0.5, 0.5003, 0.5, 0.5]]
        return chosen

    def begin(self):
        """The next node."""
        self.count = getattr(self, 'count', 0) + 1
        self.name = 'fuzz_%d' % self.count
        parameters = self.parameters()
        for key, value in self.lists.items():
            rospy.set_param('/%s/%s' % (self.name, key), value)
        self.kind = None
        self.node = self.start_node(self.name, publishes=False, **parameters)
        self.watch = Watch(parameters['effects/octomap'] == 'on')
        from deformable_ccd.msg import State, StepStats
        self.subscribers = [rospy.Subscriber('/%s/%s' % (self.name, topic), kind, into) for topic, kind, into in (
            ('contacts', ContactArray, self.watch.contacts), ('stats', StepStats, self.watch.counts), ('state', State, self.watch.state),
            ('markers', MarkerArray, lambda m: None), ('prediction/contacts', ContactArray, lambda m: None))]
        wait_for(lambda: all(s.get_num_connections() for s in self.subscribers[:3]), 30, 'the topics of ' + self.name)
        for service in ('reset', 'live/set_parameters'):
            rospy.wait_for_service('/%s/%s' % (self.name, service), 30)
        self.started_kb, self.started = resident_kb(self.node.pid), time.monotonic()
        self.largest = 0
        self.said = ['%s: %s %s' % (self.name, parameters, self.lists)]

    def publish_as(self, kind):
        if self.kind is kind:
            return
        if self.kind:
            self.meshes.unregister()
        self.kind = kind
        self.meshes = rospy.Publisher('/%s/mesh' % self.name, kind, queue_size=None, tcp_nodelay=True)

    def send(self, publisher, message):
        self.largest = max(self.largest, len(bytes_of(message)))
        try:
            publisher.publish(message)
        except (rospy.ROSException, genpy.SerializationError, struct.error):
            pass  # one that its own publisher cannot write

    def some_meshes(self, count):
        for _ in range(count):
            message = self.source.mesh(self.kind)
            if self.source.random.random() < 0.2:
                message = self.source.damaged(self.kind, message)
            self.send(self.meshes, message)

    def call(self, name, kind, *arguments):
        try:
            rospy.ServiceProxy('/%s/%s' % (self.name, name), kind)(*arguments)
        except (rospy.ServiceException, genpy.SerializationError) as error:
            self.watch.wrong.append('service %s: %s' % (name, error))

    def configure(self):
        r = self.source.random
        config = dynamic_reconfigure.msg.Config()
        for name in r.sample(['step_budget_ms', 'max_step_s', 'max_vertex_step_m', 'marker_point_size_m', 'marker_obstacle_m'], 2):
            config.doubles.append(dynamic_reconfigure.msg.DoubleParameter(name, r.choice([0.1, 5.0, -1.0] + ODD)))
        config.ints.append(dynamic_reconfigure.msg.IntParameter('max_contacts', r.choice([1, 100, 1000000, -5])))
        config.ints.append(dynamic_reconfigure.msg.IntParameter('accuracy', r.choice([0, 1, 2, 3, 99])))
        self.call('live/set_parameters', dynamic_reconfigure.srv.Reconfigure, config)

    def act(self):
        r = self.source.random
        action = r.choices(['meshes', 'burst', 'map', 'tf', 'type', 'reset', 'check', 'record', 'enable', 'configure', 'parameter', 'large',
                            'wrong map', 'pause'], [300, 10, 40, 60, 6, 10, 10, 4, 8, 15, 5, 4, 3, 10])[0]
        self.said.append(action)
        if action == 'meshes':
            self.some_meshes(r.choice([1, 1, 3]))
        elif action == 'burst':
            self.some_meshes(40)
        elif action == 'map':
            self.send(self.maps, self.source.map())
        elif action == 'tf':
            self.send(r.choice([self.tf, self.tf, self.tf_static]), self.source.transform())
        elif action == 'type':
            self.publish_as(r.choice(MESHES + [String]) if r.random() < 0.9 else String)
            if self.kind is String:
                self.send(self.meshes, String('none'))
                self.publish_as(PointCloud2)
        elif action == 'enable':
            self.call('enable', SetBool, r.random() < 0.5)
        elif action == 'configure':
            self.configure()
        elif action == 'parameter':
            key = r.choice(['max_contacts', 'accuracy', 'odd', 'bodies/x/topic'])
            rospy.set_param('/%s/%s' % (self.name, key), r.choice([1, 'x', -1.5, []]))
        elif action == 'large':
            self.send(self.meshes, raw(self.kind, bytes_of(self.source.mesh(self.kind)) + bytes(r.choice([5, 20, 40]) * 1000000)))
        elif action == 'wrong map':
            wrong = rospy.Publisher('/fuzz_map', String, queue_size=1)
            wrong.publish(String('map'))
            wrong.unregister()
        elif action == 'pause':
            time.sleep(r.choice([0.1, 0.5]))
        else:
            self.call({'reset': 'reset', 'check': 'check_now', 'record': 'record_step'}[action], Trigger)

    def look(self):
        self.assertIsNone(self.node.poll(), 'the node has ended')
        grown = (peak_kb(self.node.pid) - self.started_kb) / 1024
        self.most = max(self.most, grown)
        if SLOW == 1:
            # Beyond both limits roscpp holds the message that it reads, the one that it hands over, and one for the map's topic.
            self.assertLess(grown, 1.1 * 2 * LIMIT_MB + 3 * self.largest / 1e6)
        self.watch.compare()
        self.assertEqual(self.watch.wrong, [])

    def look_into_the_log(self):
        lines, seconds = self.log_lines(), time.monotonic() - self.started
        self.lines = max(self.lines, len(lines) / max(1, seconds))
        by_kind = collections.Counter(line.split(' [')[0][:9] + ' '.join(line.split(': ')[1:3])[:40] for line in lines)
        # About 40 kinds of things there are to say, each at most once in five seconds.
        self.assertLessEqual(len(lines), 40 * (2 + seconds / 5), by_kind.most_common(10))
        self.assertLess(max(len(line) for line in lines) if lines else 0, 2500)

    def recover(self):
        """Good frames after whatever was sent: the first may begin anew, the second is answered."""
        self.publish_as(PointCloud2)
        self.call('enable', SetBool, True)
        config = dynamic_reconfigure.msg.Config(doubles=[dynamic_reconfigure.msg.DoubleParameter('max_step_s', 0.5),
                                                         dynamic_reconfigure.msg.DoubleParameter('max_vertex_step_m', 0.0)])
        self.call('live/set_parameters', dynamic_reconfigure.srv.Reconfigure, config)
        wait_for(lambda: self.meshes.get_num_connections() >= 1, ANSWER_S, 'the node to take another type')
        self.quiet()
        self.call('reset', Trigger)
        self.source.stamp_s += 1000
        begin = time.monotonic()
        while not self.good_frame(0.5):  # the first ones may meet a subscription that is just being renewed
            if time.monotonic() - begin > ANSWER_S:
                node = xmlrpc.client.ServerProxy(rosgraph.Master('/fuzz').lookupNode('/' + self.name))
                self.fail('locked out; connections here: %d, of the node: %s' % (
                    self.meshes.get_num_connections(), [c for c in node.getBusInfo('/fuzz')[2] if c[4].endswith('/mesh')]))
        second = self.good_frame(ANSWER_S)
        self.slowest = max(self.slowest, time.monotonic() - begin)
        self.assertTrue(second and second.answered, second and (second.status, second.reason))

    def good_frame(self, seconds):
        """Its outcome, or None."""
        self.source.stamp_s += 0.03
        message = cloud_of(0, [(0.01 * (k % COLS), 0.01 * (k // COLS), 5.0) for k in range(ROWS * COLS)], ROWS, COLS)
        message.header.stamp = rospy.Time.from_sec(round(self.source.stamp_s, 3))
        self.meshes.publish(message)
        end = time.monotonic() + seconds
        while message.header.stamp not in self.watch.outcomes and time.monotonic() < end:
            time.sleep(0.005)
        return self.watch.outcomes.get(message.header.stamp, [None])[-1]

    def quiet(self):
        """What waits has been worked on."""
        end = time.monotonic() + ANSWER_S
        while time.monotonic() < end:
            steps = self.watch.steps
            time.sleep(0.7)
            if self.watch.steps == steps:
                return
        self.fail('steps do not end')

    def finish(self):
        self.quiet()
        self.look_into_the_log()
        self.node.send_signal(signal.SIGINT)
        self.assertEqual(self.node.wait(10 * SLOW), 0)
        for subscriber in self.subscribers:
            subscriber.unregister()
        self.meshes.unregister()
        print('%s: %d steps, %.1f MB above the start at most, %.1f lines a second, slowest recovery %.2f s' % (
            self.name, self.watch.steps, self.most, self.lines, self.slowest), flush=True)

    def test_whatever_comes(self):
        self.source = Source(SEED)
        self.most = self.lines = self.slowest = 0.0
        self.maps = rospy.Publisher('/fuzz_map', Octomap, queue_size=None, tcp_nodelay=True)
        self.tf = rospy.Publisher('/tf', TFMessage, queue_size=None)
        self.tf_static = rospy.Publisher('/tf_static', TFMessage, queue_size=None)
        end = time.monotonic() + SECONDS
        actions = 0
        while time.monotonic() < end:
            self.begin()
            try:
                self.publish_as(PointCloud2)
                node_end = min(end, time.monotonic() + NODE_SECONDS)
                while time.monotonic() < node_end:
                    for _ in range(100):
                        self.act()
                        actions += 1
                        self.look()
                    self.recover()
                    self.look()
                self.finish()
            except BaseException:
                print('seed %d: %s\n%s' % (SEED, self.said[0], self.said[-150:]), flush=True)
                print('\n'.join(line[:300] for line in self.log_lines()[-40:]), flush=True)
                raise
        print('seed %d: %d nodes, %d actions in %.0f s' % (SEED, self.count, actions, SECONDS))


if __name__ == '__main__':
    unittest.main()
