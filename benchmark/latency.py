#!/usr/bin/env python3
"""Latency of the live node, from a mesh message to published contacts: small meshes as trackers send them, then under load.

Starts a master. First a cloth of 400 vertices and a rope of 50 points come at 30 Hz and touch a map of 50,176 voxels on an
otherwise idle machine. Then one busy process runs for each core but one, and a cloth waves through itself. `latency` is the node's own (arrival of the message to contacts published, steady clock); `round trip` goes from just
before publishing here to the contacts back here, with Python on both ends. A last, shorter run has a step budget of a
third of the median step: what does not fit must come undecided, not late.
"""
import argparse
import json
import math
import multiprocessing
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import time

import rosgraph
import rospy
from deformable_ccd.msg import ContactArray, StepStats
from octomap_msgs.msg import Octomap
from sensor_msgs.msg import PointCloud2, PointField

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / 'scripts/lib'))
from ros_process import free_port, wait_for

DEADLINE = ContactArray.DEADLINE
SINK = ['rosrun', 'topic_tools', 'drop']  # in C++: taking the contacts costs next to nothing


def burn():
    while True:
        sum(i * i for i in range(10000))


def cloth(rows, cols, phase):
    """Two folded halves that wave against each other."""
    out = bytearray()
    for r in range(rows):
        for c in range(cols):
            fold = min(c, cols - 1 - c) * 0.01
            layer = 0.004 if 2 * c < cols else -0.004
            out += struct.pack('<3d', fold, 0.01 * r, layer + 0.006 * math.sin(phase + 0.3 * r + (2 * layer / 0.004) * fold * 30))
    return bytes(out)


def tracked(rows, cols, spacing, phase):
    """A grid or a rope that dips into the map below z = 0, never flat."""
    out = bytearray()
    for r in range(rows):
        for c in range(cols):
            z = 0.005 + 0.005 * math.sin(phase) + 0.01 * math.sin(0.7 * c + 0.4 * r)
            out += struct.pack('<3d', spacing * (c - cols / 2), spacing * (r - rows / 2), z)
    return bytes(out)


def plate(resolution, side):
    """A binary octomap of side x side x 1 occupied voxels below z = 0, centred on the z axis."""
    low = [32768 - side // 2, 32768 - side // 2, 32767]
    high = [low[0] + side, low[1] + side, 32768]
    data = bytearray()

    def encode(corner, size):
        half = size // 2
        bits, inner = 0, []
        for child in range(8):
            at = [corner[axis] + half * (child >> axis & 1) for axis in range(3)]
            if any(at[a] + half <= low[a] or at[a] >= high[a] for a in range(3)):
                continue  # 00: unknown
            if all(low[a] <= at[a] and at[a] + half <= high[a] for a in range(3)):
                bits |= 0b10 << 2 * child  # an occupied leaf
            else:
                bits |= 0b11 << 2 * child
                inner.append(at)
        data.extend(struct.pack('<H', bits))
        for at in inner:
            encode(at, half)

    encode([0, 0, 0], 65536)
    message = Octomap(binary=True, id='OcTree', resolution=resolution)
    message.header.frame_id = 'world'
    message.data = [b if b < 128 else b - 256 for b in data]
    return message


class Run:
    def __init__(self, name, tools, rows, cols, rate, parameters, sink=None):
        """sink: a command that takes the contacts off the node; None: they come back here."""
        self.name, self.rows, self.cols, self.rate = name, rows, cols, rate
        self.stats, self.back = {}, {}
        command = [os.path.join(tools, 'collision_monitor_node'), '__name:=' + name, 'mesh:=/%s/mesh' % name,
                   'octomap:=/%s/map' % name, '_fixed_frame:=world', '_max_vertex_step_m:=0.0', *parameters]
        self.node = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.subscribers = [
            rospy.Subscriber('/%s/stats' % name, StepStats, lambda m: self.stats.setdefault(m.header.stamp.to_nsec(), m),
                             tcp_nodelay=True)]
        self.sink = None
        if sink:
            self.sink = subprocess.Popen(sink + ['/%s/contacts' % name, '1', '1', '__name:=sink_of_' + name],
                                         stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            master = rosgraph.Master('latency')
            wait_for(lambda: any(topic == '/%s/contacts' % name for topic, _ in master.getSystemState()[1]), 30, 'the sink')
            time.sleep(1)
        else:
            self.subscribers.append(rospy.Subscriber(
                '/%s/contacts' % name, ContactArray,
                lambda m: self.back.setdefault(m.header.stamp.to_nsec(), time.monotonic()), tcp_nodelay=True))
        self.publisher = rospy.Publisher('/%s/mesh' % name, PointCloud2, queue_size=None, tcp_nodelay=True)
        wait_for(lambda: self.publisher.get_num_connections() == 1 and
                 all(s.get_num_connections() == 1 for s in self.subscribers), 30, 'the node')

    def measure(self, frames, shapes):
        message = PointCloud2(height=self.rows, width=self.cols, point_step=24, row_step=24 * self.cols, is_dense=True)
        message.fields = [PointField(name=n, offset=8 * i, datatype=PointField.FLOAT64, count=1) for i, n in enumerate('xyz')]
        message.header.frame_id = 'world'
        sent = {}
        due = time.monotonic()
        for i in range(frames):
            stamp = rospy.Time.from_sec(1000 + i / self.rate)
            message.header.stamp = stamp
            message.data = shapes[i % len(shapes)]
            sent[stamp.to_nsec()] = time.monotonic()
            self.publisher.publish(message)
            due += 1 / self.rate
            time.sleep(max(0, due - time.monotonic()))
        wait_for(lambda: len(self.stats) >= 1 and
                 max(self.stats.values(), key=lambda m: m.header.stamp).frames_waiting == 0, 30, 'the last frames')
        time.sleep(0.5)
        answered = {k: m for k, m in self.stats.items() if m.answered}
        last = max(self.stats.values(), key=lambda m: m.header.stamp)
        return {
            'name': self.name, 'vertices': self.rows * self.cols, 'rate_hz': self.rate, 'frames': frames,
            'answered': len(answered),
            'received': last.frames_received, 'dropped': last.skipped_queue_full,
            'adds_up': last.frames_received == last.frames_processed + last.frames_started + last.frames_skipped +
            last.frames_waiting,
            'deadline': sum(m.status == DEADLINE for m in answered.values()),
            'contacts_median': sorted(m.contacts for m in answered.values())[len(answered) // 2],
            'step_ms': sorted(m.total_ms for m in answered.values()),
            'latency_ms': sorted(1e3 * m.latency for m in answered.values()),
            'round_trip_ms': sorted(1e3 * (self.back[k] - sent[k]) for k in answered if k in self.back and k in sent),
        }

    def close(self):
        for s in self.subscribers:
            s.unregister()
        self.publisher.unregister()
        for process in (self.node, self.sink):
            if process:
                process.terminate()
                process.wait(20)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--tools', required=True, help='folder of collision_monitor_node')
    parser.add_argument('--out', required=True, help='JSON file')
    parser.add_argument('--frames', type=int, default=10000)
    parser.add_argument('--rate', type=float, default=60, help='frames a second')
    parser.add_argument('--rows', type=int, default=30)
    parser.add_argument('--cols', type=int, default=40)
    parser.add_argument('--small-only', action='store_true', help='only the small tracked meshes')
    arguments = parser.parse_args()
    port = free_port()
    folder = tempfile.TemporaryDirectory(prefix='latency_')
    os.environ.update(ROS_MASTER_URI='http://localhost:%d' % port, ROS_HOSTNAME='localhost', ROS_HOME=folder.name,
                      ROS_LOG_DIR=folder.name)
    master = subprocess.Popen(['rosmaster', '--core', '-p', str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    busy = [multiprocessing.Process(target=burn, daemon=True) for _ in range(max(1, (os.cpu_count() or 1) - 1))]
    try:
        wait_for(rosgraph.is_master_online, 20, 'the master')
        rospy.init_node('latency', disable_signals=True)
        results = []
        small = [('tracked_cloth', 20, 20, []), ('tracked_rope', 1, 50, ['_topology/source:=polyline'])]
        for name, rows, cols, parameters in small:
            run = Run(name, arguments.tools, rows, cols, 30, ['_effects/octomap:=on', *parameters], SINK)
            obstacle = rospy.Publisher('/%s/map' % name, Octomap, queue_size=1, latch=True)
            obstacle.publish(plate(0.02, 224))
            results.append(run.measure(max(300, arguments.frames // 10),
                                       [tracked(rows, cols, 0.021, 2 * math.pi * i / 90) for i in range(90)]))
            run.close()
            obstacle.unregister()
        for process in [] if arguments.small_only else busy:
            process.start()
        shapes = [cloth(arguments.rows, arguments.cols, 2 * math.pi * i / 60) for i in range(60)]
        for name, budget_ms in () if arguments.small_only else (('without_budget', 0), ('with_budget', None)):
            frames = arguments.frames
            if budget_ms is None:  # a third of the median step
                budget_ms = results[-1]['step_ms'][len(results[-1]['step_ms']) // 2] / 3
                frames = max(200, arguments.frames // 10)
            run = Run(name, arguments.tools, arguments.rows, arguments.cols, arguments.rate,
                      ['_effects/octomap:=off', '_step_budget_ms:=%g' % budget_ms])
            results.append(run.measure(frames, shapes))
            run.close()
        if not arguments.small_only:
            results[-1]['budget_ms'] = budget_ms
    finally:
        for process in busy:
            if process.is_alive():
                process.terminate()
        rospy.signal_shutdown('done')
        master.terminate()
        master.wait(20)
    pathlib.Path(arguments.out).write_text(json.dumps(
        {'busy_processes': len(busy), 'cores': os.cpu_count(), 'runs': results}))


if __name__ == '__main__':
    main()
