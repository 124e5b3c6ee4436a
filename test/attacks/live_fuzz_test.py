"""Random sequences of messages of all types, maps, transforms, parameters, services, stamps and resets at a live node, and what must hold
at any time: it lives, its memory and its log are bounded, frames add up, nothing is clear without its list and its inputs, and good
frames are answered within two steps.

DEFORMABLE_CCD_LIVE_FUZZ_SECONDS: how long, 20 s unless told, with --long 300 s; _SEED: where it begins, 1 unless told. What was sent is
in the seed; the last actions are printed when something does not hold."""
import collections
import os
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
from attack import SLOW, AttackTest, cloud_of, peak_kb, resident_kb, wait_for
from deformable_ccd.msg import ContactArray, State, StepStats
from fuzz_source import COLS, MESHES, ODD, ROWS, Source
from live_node import bytes_of, raw
from node_watch import NodeWatch
from octomap_msgs.msg import Octomap
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

SECONDS = float(os.environ.get('DEFORMABLE_CCD_LIVE_FUZZ_SECONDS', 300 if os.environ.get('DEFORMABLE_CCD_LONG') else 20))
SEED = int(os.environ.get('DEFORMABLE_CCD_LIVE_FUZZ_SEED', 1))
NODE_SECONDS = 30  # then the next node, with other parameters
LIMIT_MB = 64  # of memory and of maps, each
ANSWER_S = 60  # for an answer of a node that is not stuck, on a machine that is busy


class LiveFuzzTest(AttackTest):
    def parameters(self):
        r = self.source.random
        chosen = {'max_memory_mb': LIMIT_MB, 'max_map_mb': LIMIT_MB, 'record_steps': r.choice([0, 1, 20]),
                  'num_threads': r.choice([1, 2]), 'queue_policy': r.choice(['newest', 'oldest']), 'queue_size': r.choice([1, 8, 50]),
                  'effects/octomap': r.choice(['on', 'on', 'off']), 'octomap_topic': '/fuzz_map', 'look_ahead_s': r.choice([0.0, 0.1]),
                  'markers/mesh': r.choice(['true', 'false']), 'markers/obstacle_m': r.choice([0.0, 0.5]),
                  'fixed_frame': r.choice(['world', '']), 'transform_timeout_s': r.choice([0.0, 0.1]),
                  'step_budget_ms': r.choice([200.0, 200.0, 5.0]), 'uncertainty/radius_m': r.choice([0.0, 0.0, 0.001]),
                  'unknown_space': r.choice(['free', 'free', 'occupied'])}
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
        self.node = self.start_node(self.name, process={'env': {**os.environ, 'ROS_HOME': str(self.folder)}}, publishes=False, **parameters)
        self.watch = NodeWatch(parameters['effects/octomap'] == 'on')
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
