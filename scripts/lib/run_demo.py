#!/usr/bin/env python3
"""Plays a recorded scene to the monitor (launch/demo.launch) under a ROS master of its own, and says what it found."""
import argparse
import csv
import json
import os
import pathlib
import statistics
import subprocess
import sys
import threading
import time
from xml.etree import ElementTree

import rosbag
import rosgraph
import rospy
import yaml
from deformable_ccd.msg import Contact, ContactArray, StepStats

import scene_story
from ros_process import free_port, stop

CHECKOUT = pathlib.Path(__file__).resolve().parents[2]
NODE = '/collision_monitor'
START_STATE = {ContactArray.CLEAR: 'CLEAR', ContactArray.INTERSECTING: 'INTERSECTING',
               ContactArray.NOT_CHECKED: 'NOT_CHECKED'}
STATUS_NAMES = ['OK', 'FIRST_FRAME', 'TOPOLOGY_CHANGED', 'GAP', 'TIME_JUMP', 'NO_TRANSFORM', 'NO_MAP', 'NO_BODY', 'PARTIAL',
                'DEADLINE', 'TRUNCATED', 'DUPLICATE', 'TELEPORT', 'VERTEX_COUNT', 'BAD_MESSAGE', 'QUEUE_FULL', 'DISABLED',
                'RESET', 'INTERNAL_ERROR']


class Listener:
    """Collects what the node publishes for every step."""

    def __init__(self):
        self.lock = threading.Lock()
        self.stats, self.contacts = [], []
        rospy.Subscriber(NODE + '/stats', StepStats, self.add_stats, queue_size=None)
        rospy.Subscriber(NODE + '/contacts', ContactArray, self.add_contacts, queue_size=None)

    def add_stats(self, message):
        with self.lock:
            self.stats.append(message)

    def add_contacts(self, message):
        with self.lock:
            self.contacts.append(message)


def start_launch(arguments, environment, extra):
    log = open(arguments.folder / 'roslaunch.log', 'w')
    return subprocess.Popen(['roslaunch', '--port', str(arguments.port), 'deformable_ccd', 'demo.launch',
                             'bag:=%s' % arguments.bag, 'params:=%s' % arguments.params] + extra, env=environment, stdout=log, stderr=subprocess.STDOUT,
                            stdin=subprocess.DEVNULL, start_new_session=True)


def kind_of(contact):
    return {Contact.VERTEX_FACE: 'mesh vertex - mesh face', Contact.EDGE_EDGE: 'mesh edge - mesh edge',
            Contact.VERTEX_VOXEL_FACE: 'mesh vertex - octomap face', Contact.EDGE_VOXEL_EDGE: 'mesh edge - octomap edge',
            Contact.FACE_VOXEL_CORNER: 'mesh face - octomap corner'}[contact.kind]


def links_of(robot):
    """How many rigid bodies the robot's links are: one for each collision element."""
    if not robot:
        return 0
    urdf = robot['description'].replace('package://deformable_ccd', str(CHECKOUT))
    return len(ElementTree.parse(urdf).findall('link/collision'))


def frames_of(bag, params):
    """Frames that the monitor gets: the mesh messages, and one of each rigid body with each of those. And when the first one comes:
    a camera may have been there before."""
    parameters = yaml.safe_load(params.read_text()) or {}
    bodies = parameters.get('bodies', {})
    rigid = sum('rigid' in (body or {}) for body in bodies.values()) + links_of(parameters.get('robot'))
    meshes = {(body or {}).get('topic', '/' + name) for name, body in bodies.items() if 'rigid' not in (body or {})}
    with rosbag.Bag(str(bag)) as opened:
        at_s = [at.to_sec() for _, _, at in opened.read_messages(topics=sorted(meshes), raw=True)]
    return len(at_s) * (1 + rigid), min(at_s)


def story_steps(arrays, start):
    """The node's answers as the steps of a story; a first frame makes none, and what has no answer is not clear."""
    steps = []
    for array in arrays:
        if array.status == ContactArray.FIRST_FRAME:
            continue
        contacts = []
        for c in array.contacts:
            bodies = [None if b == Contact.OBSTACLE else array.bodies[b] for b in c.body]
            contacts.append(scene_story.StoryContact(c.time_of_contact.to_sec() - start, c.initial,
                                                     scene_story.what_met(*bodies)))
        start_clear = array.answered and array.start_state == ContactArray.CLEAR
        steps.append(scene_story.StoryStep(array.start.to_sec() - start, array.header.stamp.to_sec() - start,
                                           start_clear, start_clear and not contacts, contacts))
    return steps


def summarize(arguments, listener, start):
    arrays = sorted(listener.contacts, key=lambda a: a.header.stamp)
    stats = sorted(listener.stats, key=lambda s: s.header.stamp)
    kinds, first = {}, {}
    for array in arrays:
        for contact in array.contacts:
            name = kind_of(contact) + (', already there at the start of the step' if contact.initial else '')
            kinds[name] = kinds.get(name, 0) + 1
            at = contact.time_of_contact.to_sec() - start
            if not contact.initial and (name not in first or at < first[name][0]):
                first[name] = (at, contact)
    last = stats[-1] if stats else None
    steps = story_steps(arrays, start)
    expect = yaml.safe_load(arguments.scene.read_text())['expect']
    summary = {
        'frames_expected': arguments.frames, 'contacts': {k: kinds[k] for k in sorted(kinds)},
        'first_contact_s': {k: first[k][0] for k in sorted(first)},
        'statuses': {}, 'start_states': {},
        'latency_ms': {}, 'step_ms': {},
        'story': scene_story.lines(scene_story.tell(steps)),
        'broken_facts': scene_story.broken_facts(expect, steps, {name for array in arrays for name in array.bodies}),
    }
    for array in arrays:
        for key, name in (('statuses', STATUS_NAMES[array.status]), ('start_states', START_STATE[array.start_state])):
            summary[key][name] = summary[key].get(name, 0) + 1
    if last:
        for name in ('frames_received', 'frames_processed', 'frames_started', 'frames_skipped', 'frames_waiting'):
            summary[name] = getattr(last, name)
        steps = [s for s in stats if s.answered]
        for key, values in (('latency_ms', [1e3 * s.latency for s in steps]), ('step_ms', [s.total_ms for s in steps])):
            if values:
                summary[key] = {'median': statistics.median(values), 'max': max(values)}
    return summary, arrays, stats


def write_report(folder, summary, arrays, stats, start):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / 'summary.json').write_text(json.dumps(summary, indent=2) + '\n')
    with open(folder / 'contacts.csv', 'w', newline='') as stream:
        writer = csv.writer(stream)
        writer.writerow(['step_end_s', 'contact_s', 'kind', 'initial', 'leaving', 'certain', 'v0', 'v1', 'v2', 'v3',
                         'x_m', 'y_m', 'z_m'])
        for array in arrays:
            for c in array.contacts:
                writer.writerow(['%.6f' % (array.header.stamp.to_sec() - start),
                                 '%.9f' % (c.time_of_contact.to_sec() - start), kind_of(c), int(c.initial),
                                 int(c.leaving), int(c.certainty == Contact.CERTAIN)] +
                                ['' if v == Contact.NO_VERTEX else v for v in c.vertex] +
                                ['%.6f' % v for v in (c.point.x, c.point.y, c.point.z)])
    with open(folder / 'steps.csv', 'w', newline='') as stream:
        writer = csv.writer(stream)
        names = [n for n in StepStats.__slots__ if n not in ('header', 'stages')]
        parts = {'in': 'count_in', 'out': 'count_out', 'ms': 'ms'}
        writer.writerow(['stamp_s'] + names + [row.name + '_' + part for row in (stats[0].stages if stats else []) for part in parts])
        for s in stats:
            writer.writerow(['%.6f' % (s.header.stamp.to_sec() - start)] + [getattr(s, n) for n in names] +
                            [getattr(row, field) for row in s.stages for field in parts.values()])


def print_summary(summary, folder):
    print('Frames: %d recorded, %d received: %d ended a step, %d started anew, %d skipped, %d waiting' % tuple(
        [summary['frames_expected']] + [summary.get('frames_' + n, 0)
                                      for n in ('received', 'processed', 'started', 'skipped', 'waiting')]))
    print('Status: ' + ', '.join('%s %d' % item for item in summary['statuses'].items()) +
          '; start of the step: ' + ', '.join('%s %d' % item for item in summary['start_states'].items()))
    print('Contacts: %d' % sum(summary['contacts'].values()))
    for kind, count in summary['contacts'].items():
        first = summary['first_contact_s'].get(kind)
        print('  %6d  %s%s' % (count, kind, '' if first is None else ', first at %.4f s' % first))
    print('Story, in seconds from the first frame:')
    for line in summary['story']:
        print('  ' + line)
    for key, name in (('step_ms', 'Step'), ('latency_ms', 'Frame to answer')):
        if summary[key]:
            print('%s: median %.2f ms, longest %.2f ms' % (name, summary[key]['median'], summary[key]['max']))
    print('Report: %s' % os.path.relpath(folder))


def problems(summary):
    """What must hold of a run and does not: each frame accounted for, and each fact that the scene's page states."""
    found = []
    total = sum(summary.get('frames_' + n, 0) for n in ('processed', 'started', 'skipped', 'waiting'))
    if summary.get('frames_received', 0) != summary['frames_expected']:
        found.append('the monitor received %d of %d frames' % (summary.get('frames_received', 0), summary['frames_expected']))
    if total != summary.get('frames_received', 0):
        found.append('the counters account for %d of %d frames' % (total, summary.get('frames_received', 0)))
    return found + summary['broken_facts']


def wait_for_node(launch, environment, limit_s=30):
    master = rosgraph.Master('/run_demo', environment['ROS_MASTER_URI'])
    deadline = time.monotonic() + limit_s
    while time.monotonic() < deadline and launch.poll() is None:
        if master.is_online():
            return True
        time.sleep(0.05)
    return False


def play(arguments, environment):
    """Plays the bag once; the listener, or None when the launch failed."""
    launch = start_launch(arguments, environment, ['loop:=false'])
    try:
        if not wait_for_node(launch, environment):
            return None
        rospy.init_node('run_demo', anonymous=True, disable_signals=True, disable_rosout=True)
        listener = Listener()
        # The player ends the launch when the bag is over; the node may still be at the last frames just before that.
        deadline = time.monotonic() + 60 + arguments.duration_s
        while launch.poll() is None and time.monotonic() < deadline:
            time.sleep(0.1)
        time.sleep(0.5)
        return listener
    finally:
        stop(launch)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument('--scene', type=pathlib.Path, required=True)
    parser.add_argument('--bag', type=pathlib.Path, required=True)
    parser.add_argument('--params', type=pathlib.Path, required=True)
    parser.add_argument('--folder', type=pathlib.Path, required=True)
    parser.add_argument('--tools', type=pathlib.Path, required=True)
    parser.add_argument('--rviz', action='store_true')
    arguments = parser.parse_args()
    arguments.port = free_port()
    arguments.frames, start = frames_of(arguments.bag, arguments.params)
    with rosbag.Bag(str(arguments.bag)) as opened:
        arguments.duration_s = opened.get_end_time() - opened.get_start_time()
    environment = dict(os.environ, ROS_MASTER_URI='http://localhost:%d' % arguments.port, ROS_HOSTNAME='localhost',
                       ROS_HOME=str(arguments.folder / 'ros_home'), ROS_LOG_DIR=str(arguments.folder / 'ros_log'))
    os.environ.update(environment)
    if arguments.rviz:
        return subprocess.call(['roslaunch', '--port', str(arguments.port), 'deformable_ccd', 'demo.launch',
                                'bag:=%s' % arguments.bag, 'params:=%s' % arguments.params, 'rviz:=true'], env=environment)

    print('Playing %s (%.1f s) to the monitor' % (arguments.bag.name, arguments.duration_s), flush=True)
    listener = play(arguments, environment)
    if listener is None or not listener.stats:
        print((arguments.folder / 'roslaunch.log').read_text()[-4000:], file=sys.stderr)
        print('demo: the monitor published nothing; see %s' % (arguments.folder / 'roslaunch.log'), file=sys.stderr)
        return 1
    summary, arrays, stats = summarize(arguments, listener, start)
    report = arguments.folder / 'report'
    write_report(report / 'live', summary, arrays, stats, start)
    analyze = arguments.tools / 'analyze_bag'
    if analyze.exists():
        subprocess.run([str(analyze), str(arguments.bag), '--report', str(report), '--params',
                        str(arguments.params), '--quiet'], check=True)
    print_summary(summary, report)
    found = problems(summary)
    for problem in found:
        print('demo: ' + problem, file=sys.stderr)
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
