#!/usr/bin/env python3
"""Latency of the live node, from a mesh message to published contacts, while all other cores are busy.

Starts a master, a node and one busy process for each core but one; publishes a cloth that waves through itself at a fixed
rate. `latency` is the node's own (arrival of the message to contacts published, steady clock); `round trip` goes from just
before publishing here to the contacts back here, with Python on both ends. A second, shorter run has a step budget of a
third of the median step: what does not fit must come undecided, not late.
"""
import argparse
import json
import math
import multiprocessing
import os
import pathlib
import socket
import struct
import subprocess
import sys
import tempfile
import time

import rosgraph
import rospy
from deformable_ccd.msg import ContactArray, StepStats
from sensor_msgs.msg import PointCloud2, PointField

DEADLINE = ContactArray.DEADLINE


def free_port():
    with socket.socket() as s:
        s.bind(('localhost', 0))
        return s.getsockname()[1]


def wait_for(done, seconds, what):
    end = time.monotonic() + seconds
    while not done():
        if time.monotonic() > end:
            sys.exit('latency: waited %g s for %s' % (seconds, what))
        time.sleep(0.01)


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


class Run:
    def __init__(self, name, tools, arguments, budget_ms):
        self.name, self.arguments = name, arguments
        self.stats, self.back = {}, {}
        command = [os.path.join(tools, 'collision_monitor_node'), '__name:=' + name, 'mesh:=/%s/mesh' % name,
                   '_fixed_frame:=world', '_max_vertex_step_m:=0.0', '_effects/octomap:=off', '_step_budget_ms:=%g' % budget_ms]
        self.node = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.subscribers = [
            rospy.Subscriber('/%s/stats' % name, StepStats, lambda m: self.stats.setdefault(m.header.stamp.to_nsec(), m),
                             tcp_nodelay=True),
            rospy.Subscriber('/%s/contacts' % name, ContactArray,
                             lambda m: self.back.setdefault(m.header.stamp.to_nsec(), time.monotonic()), tcp_nodelay=True)]
        self.publisher = rospy.Publisher('/%s/mesh' % name, PointCloud2, queue_size=None, tcp_nodelay=True)
        wait_for(lambda: self.publisher.get_num_connections() == 1 and
                 all(s.get_num_connections() == 1 for s in self.subscribers), 30, 'the node')

    def measure(self, frames, shapes):
        a = self.arguments
        message = PointCloud2(height=a.rows, width=a.cols, point_step=24, row_step=24 * a.cols, is_dense=True)
        message.fields = [PointField(name=n, offset=8 * i, datatype=PointField.FLOAT64, count=1) for i, n in enumerate('xyz')]
        message.header.frame_id = 'world'
        sent = {}
        due = time.monotonic()
        for i in range(frames):
            stamp = rospy.Time.from_sec(1000 + i / a.rate)
            message.header.stamp = stamp
            message.data = shapes[i % len(shapes)]
            sent[stamp.to_nsec()] = time.monotonic()
            self.publisher.publish(message)
            due += 1 / a.rate
            time.sleep(max(0, due - time.monotonic()))
        wait_for(lambda: len(self.stats) >= 1 and
                 max(self.stats.values(), key=lambda m: m.header.stamp).frames_waiting == 0, 30, 'the last frames')
        time.sleep(0.5)
        answered = {k: m for k, m in self.stats.items() if m.answered}
        last = max(self.stats.values(), key=lambda m: m.header.stamp)
        return {
            'name': self.name, 'frames': frames, 'answered': len(answered),
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
        self.node.terminate()
        self.node.wait(20)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--tools', required=True, help='folder of collision_monitor_node')
    parser.add_argument('--out', required=True, help='JSON file')
    parser.add_argument('--frames', type=int, default=10000)
    parser.add_argument('--rate', type=float, default=60, help='frames a second')
    parser.add_argument('--rows', type=int, default=30)
    parser.add_argument('--cols', type=int, default=40)
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
        shapes = [cloth(arguments.rows, arguments.cols, 2 * math.pi * i / 60) for i in range(60)]
        for process in busy:
            process.start()
        results = []
        run = Run('without_budget', arguments.tools, arguments, 0)
        results.append(run.measure(arguments.frames, shapes))
        run.close()
        budget_ms = results[0]['step_ms'][len(results[0]['step_ms']) // 2] / 3
        run = Run('with_budget', arguments.tools, arguments, budget_ms)
        results.append(run.measure(max(200, arguments.frames // 10), shapes))
        run.close()
        results[1]['budget_ms'] = budget_ms
    finally:
        for process in busy:
            if process.is_alive():
                process.terminate()
        rospy.signal_shutdown('done')
        master.terminate()
        master.wait(20)
    pathlib.Path(arguments.out).write_text(json.dumps(
        {'rate_hz': arguments.rate, 'vertices': arguments.rows * arguments.cols, 'busy_processes': len(busy),
         'cores': os.cpu_count(), 'runs': results}))


if __name__ == '__main__':
    main()
