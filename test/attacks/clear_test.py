"""What once left `clear` standing without proof, each on a live node, at stamps of today."""
import math
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import time
import unittest

import rosbag
import rospy
from attack import TODAY, AttackTest, checkerboard, octomap, wait_for
from geometry_msgs.msg import TransformStamped
from live_node import Cloud, bytes_of
from octomap_msgs.msg import Octomap
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import SetBool
from tf2_msgs.msg import TFMessage

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / 'storm'))
from worlds import octree

def at(seconds):
    return rospy.Time(TODAY) + rospy.Duration.from_sec(seconds)


def grid(stamp, points, frame='world', rows=4):
    cloud = Cloud(1, 1)
    cloud.rows, cloud.cols = rows, len(points) // rows
    cloud.variants = [b''.join(struct.pack('<3d', *point) for point in points)]
    message = cloud.message()
    message.header.stamp, message.header.frame_id = stamp, frame
    return message


def sheet(stamp, z, frame='world', rows=4, cols=5):
    """A level sheet, 0.3 m by 0.4 m around the origin."""
    return grid(stamp, [(0.1 * c - 0.2, 0.1 * r - 0.15, z) for r in range(rows) for c in range(cols)], frame, rows)


def transform(stamp, child, z=0.0, turn=0.0):
    one = TransformStamped(child_frame_id=child)
    one.header.frame_id, one.header.stamp = 'world', stamp
    one.transform.translation.z = z
    one.transform.rotation.x, one.transform.rotation.w = math.sin(turn / 2), math.cos(turn / 2)
    return TFMessage([one])


class ClearTest(AttackTest):
    def start_bodies(self, name, bodies, topics, **parameters):
        for key, value in bodies.items():
            rospy.set_param('/%s/bodies/%s' % (name, key), value)
        self.start_node(name, publishes=False, clock_body='cloth', **parameters)
        self.to = {topic: self.advertise('/%s/%s' % (name, topic), PointCloud2, 100) for topic in topics}
        self.tf = self.advertise_transforms(name, '/tf')

    def advertise_transforms(self, name, topic):
        """To this node: one of before may still listen, and what is sent until this one does is lost to it."""
        publisher = self.advertise(topic, TFMessage, 100)
        wait_for(lambda: any(c.endpoint_id == '/' + name for c in publisher.impl.connections), 20, '%s to listen to %s' % (name, topic))
        return publisher

    def step_of(self, stamp, z=0.0):
        """The cloth's frame; its outcome and the first state that is of it."""
        said = len(self.states)
        [outcome] = self.outcomes_of(self.to['cloth'], [sheet(stamp, z)])
        wait_for(lambda: len(self.states) > said, 20, 'a state')
        return outcome, self.states[said]

    def start_with_map(self, name, **parameters):
        self.start_bodies(name, {'cloth/topic': '/%s/cloth' % name}, ['cloth'],
                          **{'effects/octomap': 'on', 'octomap_topic': '/%s/map' % name, **parameters})
        self.maps = self.advertise('/%s/map' % name, Octomap, 100)

    def test_a_newer_map_that_waits(self):
        """Half a megabyte, of which a million leaves become: no step is clear that was answered without it."""
        self.start_with_map('waits', max_map_mb=2048, transform_timeout_s=0.0)
        self.maps.publish(octomap(checkerboard(1), at(0)))
        time.sleep(0.5)
        for t in (0.0, 0.03, 0.06):
            _, state = self.step_of(at(t), 5)
        self.assertTrue(state.clear, state.reason)
        message = octomap(checkerboard(6), at(0.07))
        self.maps.publish(message)
        time.sleep(0.02)  # on its way
        t, passed_over = 0.06, 0
        while t < 30:
            t += 0.03
            outcome, state = self.step_of(at(t), 5)
            if state.map_stamp == message.header.stamp:
                break
            passed_over += 1
            self.assertFalse(state.clear, '%.2f s after the map came: %s' % (t - 0.06, state.reason))
            time.sleep(0.03)
        self.assertEqual(state.map_stamp, message.header.stamp)
        self.assertGreater(passed_over, 0, 'the map is too small for this machine')
        _, state = self.step_of(at(t + 0.03), 5)
        self.assertTrue(state.clear, state.reason)

    def start_with_finger(self, name, **parameters):
        """A cloth at 0, a finger 3 m above, and a cloud of another body at 1."""
        bodies = {'cloth/topic': '/%s/cloth' % name, 'other/topic': '/%s/other' % name,
                  'finger/rigid': {'frame': 'finger', 'mesh': str(pathlib.Path(__file__).resolve().parents[1] / 'ros/finger.stl')}}
        self.start_bodies(name, bodies, ['cloth', 'other'], **parameters)

    def step_of_all(self, seconds, z=0.0):
        self.tf.publish(transform(at(seconds), 'finger', 3))
        self.to['other'].publish(sheet(at(seconds), 1))
        return self.step_of(at(seconds), z)

    def assert_unknown(self, outcome, state, body, why):
        self.assertTrue(outcome.answered, outcome.reason)
        self.assertFalse(state.clear)
        self.assertIn("where body '%s' was is not known for all of this step" % body, state.reason)
        self.assertIn(why, state.reason)

    def assert_recovers(self, seconds):
        """Two steps later at the latest."""
        self.step_of_all(seconds)
        _, state = self.step_of_all(seconds + 0.04)
        self.assertTrue(state.clear, state.reason)

    def test_bursts_at_a_full_queue(self):
        """Twelve frames come at once, before the transform of the first; of those that are dropped two are beyond the other sheet."""
        for policy in ('newest', 'thin'):
            name = 'burst_' + policy
            self.start_bodies(name, {'cloth/topic': '/%s/cloth' % name}, ['cloth'], queue_size=8, queue_policy=policy,
                              transform_timeout_s=60.0, answer_timeout_s=60.0, max_step_s=60.0)
            burst = [at(0.04 * k) for k in range(14)]
            for t in burst[:2]:
                self.tf.publish(transform(t, 'camera'))
                self.outcomes_of(self.to['cloth'], [sheet(t, 0, 'camera')])
            seen = len(self.contacts)
            for k, t in enumerate(burst[2:]):
                self.to['cloth'].publish(sheet(t, 2 if k in (1, 2) else 0, 'camera'))
                time.sleep(0.5 if k == 0 else 0)  # the first has left the queue when the others come
            time.sleep(0.5)
            self.assertEqual(len(self.contacts), seen)
            said = len(self.states)
            self.tf.publish(TFMessage([transform(t, 'camera').transforms[0] for t in burst[2:]]))
            wait_for(lambda: len(self.contacts) >= seen + 9, 20, 'nine of the twelve')
            after = next(s for s in self.states[said:] if s.holds_until > burst[2])
            if policy == 'newest':
                self.assert_unknown(self.contacts[seen + 1], after, 'cloth', 'QUEUE_FULL')
            else:
                self.assertTrue(after.clear, after.reason)
                self.assertIn("3 frames of body 'cloth' by queue_policy: thin", after.excluded)
            self.assertTrue(self.states[-1].clear, self.states[-1].reason)

    def another_process(self, *arguments):
        """Of another node, which sends transforms, too."""
        process = subprocess.Popen([sys.executable, str(pathlib.Path(__file__).resolve().parent / 'attack.py'), *arguments])
        self.addCleanup(self.end, process)
        return process

    def transforms_of(self, frame):
        """A list into which those of the frame come, each with the name of the node that sent it."""
        came = []

        def hear(message):
            came.extend((message._connection_header['callerid'], t) for t in message.transforms if t.child_frame_id == frame)
        subscriber = rospy.Subscriber('/tf', TFMessage, hear)
        self.addCleanup(subscriber.unregister)
        return came

    def test_two_publishers_of_a_frame_that_carries_the_finger(self):
        """With equal stamps, 0.4 m apart: nothing is clear while both send, and all of it is once one of them is gone."""
        self.start_with_finger('torn', max_step_s=30.0)
        came = self.transforms_of('finger')
        self.step_of_all(0)
        _, state = self.step_of_all(0.04)
        self.assertTrue(state.clear, state.reason)
        other, ours = self.another_process('shifted', 'finger', '0.4'), transform(at(0.04), 'finger', 3)
        wait_for(lambda: self.tf.publish(ours) or len({sender for sender, _ in came}) == 2, 20, 'the other one', 0.2)
        time.sleep(0.5)
        for k in range(2, 7):
            seen = len(came)
            self.tf.publish(transform(at(0.04 * k), 'finger', 3))
            wait_for(lambda: len(came) == seen + 2, 20, 'the other one')
            self.assertEqual(*(t.header.stamp for _, t in came[-2:]))
            self.assertAlmostEqual(abs(came[-1][1].transform.translation.z - came[-2][1].transform.translation.z), 0.4)
            time.sleep(0.2)  # until the node has both
            self.to['other'].publish(sheet(at(0.04 * k), 1))
            outcome, state = self.step_of(at(0.04 * k))
            self.assert_unknown(outcome, state, 'finger', "a transform of frame 'finger' came")
        other.kill()
        other.wait()
        self.assert_recovers(0.04 * (k + 1))

    def test_a_cloth_that_is_carried_while_the_monitor_is_not_enabled(self):
        """Its own voxels are followed for those two seconds: maps that show it where it rests then show no obstacle."""
        self.start_with_map('rests', own_voxels_m=0.1, max_step_s=30.0)
        floor = [(i, j, -10) for i in range(-4, 5) for j in range(-4, 5)]
        seen = {(i, j, k) for i in range(-4, 5) for j in range(-4, 5) for k in range(-9, 15)}

        def map_at(seconds, z=None):
            cloth = [] if z is None else [(i, j, math.floor(z / 0.1)) for i in range(-2, 2) for j in range(-2, 2)]
            keys, free = ([tuple(32768 + x for x in cell) for cell in cells] for cells in (floor + cloth, seen.difference(cloth)))
            self.maps.publish(octomap(bytes(b & 255 for b in octree(keys, free)), at(seconds), resolution=0.1))
        map_at(-0.1)  # the place, before the cloth came
        time.sleep(0.5)
        self.step_of(at(0), 0.55)
        _, state = self.step_of(at(0.04), 0.55)
        self.assertTrue(state.clear, state.reason)
        map_at(0.06, 0.55)
        time.sleep(0.5)
        self.step_of(at(0.08), 0.55)
        _, state = self.step_of(at(0.12), 0.55)
        self.assertTrue(state.clear, state.reason)
        self.assertIn("as own of body 'cloth'", ' '.join(state.excluded))
        enable = rospy.ServiceProxy('/rests/enable', SetBool)
        enable(False)
        wait_for(lambda: not self.states[-1].clear, 20, 'a state that is not clear')
        answered = len(self.contacts)
        for k in range(60):
            t, z = 0.12 + (k + 1) / 30, 0.55 + 0.3 * min(1, k / 45)
            self.to['cloth'].publish(sheet(at(t), z))
            if k % 6 == 5:
                map_at(t, z)
            time.sleep(1 / 30)
        time.sleep(0.5)
        self.assertEqual(len(self.contacts), answered)
        enable(True)
        for k in range(4):
            t += 0.04
            map_at(t, z)
            time.sleep(0.3)
            outcome, state = self.step_of(at(t + 0.02), z)
        self.assertTrue(outcome.answered)
        self.assertTrue(state.clear, state.reason)
        self.assertIn("as own of body 'cloth'", ' '.join(state.excluded))

    def test_live_and_from_a_bag(self):
        """A crumpled cloth in a frame that turns; live the newest transform is the frame's own, in a bag later ones are known."""
        crumpled, messages = Cloud(12, 12), []
        for k in range(20):
            cloud = crumpled.message()
            cloud.header.stamp, cloud.header.frame_id = at(0.03 * k), 'camera'
            messages.append((transform(cloud.header.stamp, 'camera', 0.1 * k, 0.7 * k), cloud))
        self.start_bodies('both', {'cloth/topic': '/both/cloth', 'cloth/topology/rows': 12, 'cloth/topology/cols': 12}, ['cloth'],
                          max_contacts=10000)
        live = []
        for tf, cloud in messages:
            self.tf.publish(tf)
            live += self.outcomes_of(self.to['cloth'], [cloud])
        folder = tempfile.mkdtemp(dir=self.folder)
        bag, out, params = (os.path.join(folder, name) for name in ('in.bag', 'out.bag', 'params.yaml'))
        with rosbag.Bag(bag, 'w') as file:
            for tf, cloud in messages:
                file.write('/tf', tf, cloud.header.stamp)
                file.write('/both/cloth', cloud, cloud.header.stamp + rospy.Duration(0, 1000))
        pathlib.Path(params).write_text(
            'fixed_frame: world\nmax_vertex_step_m: 0.0\neffects: {octomap: "off"}\nmax_contacts: 10000\n'
            'bodies: {cloth: {topic: /both/cloth, topology: {rows: 12, cols: 12}}}\n')
        run = subprocess.run([str(self.tool('analyze_bag')), bag, '-o', out, '--report', os.path.join(folder, 'report'), '--params', params],
                             capture_output=True, text=True, timeout=120)
        self.assertTrue(os.path.exists(out), run.stderr)
        with rosbag.Bag(out) as file:
            replayed = [m for topic, m, _ in file.read_messages() if topic.endswith('/contacts')]
        self.assertEqual(len(replayed), len(live))
        self.assertGreater(sum(len(o.contacts) for o in live), 1000)
        for one, other in zip(live, replayed):
            self.assertEqual(one.header.stamp, other.header.stamp)
            self.assertEqual(one.status, other.status)
            self.assertEqual([bytes_of(c) for c in one.contacts], [bytes_of(c) for c in other.contacts])


if __name__ == '__main__':
    unittest.main()
