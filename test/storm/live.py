#!/usr/bin/env python3
"""What the live node says of a world: live.py FOLDER, which has world.bag, params.yaml and calls.yaml, and gets out.bag.

The messages come in their order, each on a /clock that stands at the bag's time of it until the node has taken it: what it says then was said with all
that had come by that time, and with nothing else."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import rosbag
import rospy
import yaml
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import Trigger

HERE = pathlib.Path(__file__).resolve().parent
CHECKOUT = HERE.parents[1]
TOOLS = pathlib.Path(os.environ.get('DEFORMABLE_CCD_WORKSPACE', CHECKOUT / 'build')) / 'devel/lib/deformable_ccd'
sys.path.insert(0, str(CHECKOUT / 'scripts/lib'))
from ros_process import free_port, stop, wait_for  # noqa: E402

NODE = '/collision_monitor'
PATIENCE_S, TAKEN_S, AFTER_NS, TICK_NS = 30, .002, 10 ** 9, 20 * 10 ** 6


def said_topics():
    from deformable_ccd.msg import AlongPath, ClearanceArray, ContactArray, Limits, PatchArray, PatchEvent, SafeUntil, SpeedScale, State
    from std_msgs.msg import Bool
    return {'state': State, 'clear': Bool, 'contacts': ContactArray, 'clearance': ClearanceArray, 'safe_until': SafeUntil, 'speed_scale': SpeedScale,
            'patches': PatchArray, 'events': PatchEvent, 'along_path': AlongPath, 'limits': Limits}


def called(service, name, link, mesh):
    """Whether the node did what it was called for."""
    from deformable_ccd.srv import AttachObject, AttachObjectRequest, Named
    from geometry_msgs.msg import Pose, Quaternion, Vector3
    if service == 'attach':
        request = AttachObjectRequest(name=name, link=link, mesh=mesh, scale=Vector3(1, 1, 1), pose=Pose(orientation=Quaternion(w=1)))
        return rospy.ServiceProxy(NODE + '/attach', AttachObject)(request).success
    if service == 'reset':
        return rospy.ServiceProxy(NODE + '/reset', Trigger)().success
    return rospy.ServiceProxy(NODE + '/' + service, Named)(name).success


def play(folder):
    with rosbag.Bag(str(folder / 'world.bag')) as bag:
        rows = [(topic, message, at.to_nsec()) for topic, message, at in bag.read_messages()]
    calls = [(None, call, call.pop('at')) for call in yaml.safe_load((folder / 'calls.yaml').read_text())]
    said, now = [], [rows[0][2]]
    rospy.init_node('world', anonymous=True, disable_signals=True, disable_rostime=True)
    clock = rospy.Publisher('/clock', Clock, queue_size=10, latch=True)
    publishers = {topic: rospy.Publisher(topic, type(message), queue_size=100) for topic, message, _ in rows}
    heard = [clock, *(one for topic, one in publishers.items() if not topic.endswith('camera_info'))]  # for that it asks at the first picture
    wait_for(lambda: all(one.get_num_connections() > 0 for one in heard), PATIENCE_S, 'the node to listen')
    offered = {topic for topic, _ in rospy.get_published_topics(NODE)}
    hears = [rospy.Subscriber(topic, kind, lambda message, topic=topic: said.append((topic, message, now[0])), queue_size=1000)
             for topic, kind in ((NODE + '/' + name, kind) for name, kind in said_topics().items()) if topic in offered]
    wait_for(lambda: all(one.get_num_connections() > 0 for one in hears), PATIENCE_S, 'what the node says')
    taken = rospy.ServiceProxy(NODE + '/check_now', Trigger, persistent=True)

    def tell(at_ns):
        now[0] = at_ns
        clock.publish(Clock(clock=rospy.Time(at_ns // 10 ** 9, at_ns % 10 ** 9)))

    def wait():
        time.sleep(TAKEN_S)
        taken()  # by the worker, once it has nothing else to do
        time.sleep(TAKEN_S)

    for topic, message, at_ns in sorted(rows + calls, key=lambda row: row[2]):
        while at_ns - now[0] > 2 * TICK_NS:  # what waits in vain is given up in between
            tell(now[0] + TICK_NS)
            wait()
        tell(at_ns)
        wait()
        if topic:
            publishers[topic].publish(message)
        else:
            now[0] += 10  # what was said before is not taken for what was said after
            if called(**message):
                said.append((NODE + '/called', String(json.dumps({**message, 'at': at_ns})), now[0] - 1))
        wait()
    for at_ns in range(rows[-1][2] + TICK_NS, rows[-1][2] + AFTER_NS, TICK_NS):
        tell(at_ns)
        wait()
    time.sleep(PATIENCE_S / 100)  # until the last of it is here
    with rosbag.Bag(str(folder / 'out.bag'), 'w') as out:
        for topic, message, at_ns in said:  # after it was said, as a recorder hears it
            out.write(topic, message, rospy.Time(at_ns // 10 ** 9, at_ns % 10 ** 9 + 1))


def main():
    folder = pathlib.Path(sys.argv[1])
    os.environ.update(ROS_MASTER_URI='http://localhost:%d' % free_port(), ROS_HOSTNAME='localhost')  # a bare root may not know its own name
    processes = []

    def start(*command):
        processes.append(subprocess.Popen(command, stdout=log, stderr=log, start_new_session=True))

    with tempfile.TemporaryDirectory() as home, open(folder / 'live.log', 'wb') as log:
        os.environ['ROS_HOME'] = home
        try:
            start('rosmaster', '--core', '-p', os.environ['ROS_MASTER_URI'].rsplit(':', 1)[1])
            import rosgraph
            wait_for(rosgraph.is_master_online, PATIENCE_S, 'the master')
            import rosparam
            rosparam.upload_params('/', {'use_sim_time': True, NODE[1:]: yaml.safe_load((folder / 'params.yaml').read_text())})
            start(str(TOOLS / 'collision_monitor_node'), '__name:=' + NODE[1:])
            play(folder)
        finally:
            for process in reversed(processes):
                stop(process)


if __name__ == '__main__':
    main()
