"""An attack from outside on a live node: what it may cost, in memory and in lines of log."""
import pathlib
import struct
import sys
import time

import rospy
from geometry_msgs.msg import Point
from deformable_ccd.msg import MeshStamped
from octomap_msgs.msg import Octomap
from sensor_msgs.msg import PointCloud2
from shape_msgs.msg import MeshTriangle
from tf2_msgs.msg import TFMessage

sys.path += [str(pathlib.Path(__file__).resolve().parents[1] / 'faults'),
             str(pathlib.Path(__file__).resolve().parents[2] / 'scripts/lib')]
from live_node import Cloud, LiveNodeTest, grid_faces, resident_kb  # noqa: F401
from ros_process import SLOW, wait_for  # noqa: F401

ROWS, COLS = 20, 30
TODAY = 1700000000  # [s]


def peak_kb(pid):
    """The largest resident size that the process ever had."""
    return resident_kb(pid, 'VmHWM:')


class AttackTest(LiveNodeTest):
    """A node whose log is read. What follows an attack is asserted in outcomes: the status within one step, recovery within two."""

    def start_node(self, name, process=None, publishes=True, **parameters):
        self.log_path = pathlib.Path(self.folder) / (name + '.log')
        with open(self.log_path, 'w') as log:
            return super().start_node(name, {**(process or {}), 'stdout': log, 'stderr': log}, publishes, **parameters)

    def log_lines(self):
        return self.log_path.read_text(errors='replace').splitlines()

    def assert_quiet(self, seconds, kinds):
        """Each kind of line at most once in five seconds, none of them long."""
        lines = self.log_lines()
        self.assertLessEqual(len(lines), kinds * (2 + seconds / 5), '\n'.join(line[:200] for line in lines[-20:]))
        self.assertLess(max([len(line) for line in lines] or [0]), 2000)


def stamped(index):
    return rospy.Time.from_sec(1000 + 0.03 * index)


def sheet_mesh(index, rows=ROWS, cols=COLS):
    """A flat sheet as a message with a topology of its own."""
    message = MeshStamped()
    message.header.frame_id = 'world'
    message.header.stamp = stamped(index)
    message.vertices = [Point(0.01 * c, 0.01 * r, 0) for r in range(rows) for c in range(cols)]
    message.triangles = [MeshTriangle(face) for face in grid_faces(rows, cols)]
    return message


def flat_cloud(index, rows=ROWS, cols=COLS):
    return cloud_of(index, [(0.01 * c, 0.01 * r, 0.0) for r in range(rows) for c in range(cols)], rows, cols)


def cloud_of(index, points, rows, cols):
    cloud = Cloud(1, 1)
    cloud.rows, cloud.cols = rows, cols
    cloud.variants = [b''.join(struct.pack('<3d', *p) for p in points)]
    return cloud.message(1000 + 0.03 * index)


def checkerboard(depth):
    """An octree's bytes in which every other voxel of a cube of 2^(depth + 1) is occupied and the rest is free."""
    # Two bits a child: 00 unknown, 01 free, 10 occupied, 11 has children.
    leaves = sum((0b10 if bin(child).count('1') % 2 else 0b01) << (2 * child) for child in range(8))
    data = struct.pack('<H', leaves)
    for _ in range(depth):
        data = struct.pack('<H', 0xffff) + 8 * data
    # From the root down to the cube one child each: the tree is 16 levels deep.
    return (15 - depth) * struct.pack('<H', 0b11) + data


def octomap(data, stamp=rospy.Time(), frame='world', resolution=0.01):
    message = Octomap(binary=True, id='OcTree', resolution=resolution, data=struct.unpack('<%db' % len(data), data))
    message.header.frame_id, message.header.stamp = frame, stamp
    return message


def checkerboard_file(path, depth):
    with open(path, 'wb') as file:
        file.write(b'# Octomap OcTree binary file\nid OcTree\nsize 1\nres 0.01\ndata\n' + checkerboard(depth))


def publish_stream(topic, make, kind, rate=30.0):
    """The main of a publisher's process: publishes until it is killed."""
    rospy.init_node('publisher', anonymous=True)
    publisher = rospy.Publisher(topic, kind, queue_size=10)
    index = 0
    while not rospy.is_shutdown():
        publisher.publish(make(index))
        index += 1
        time.sleep(1 / rate)


def be_silent(topic, kind):
    """A publisher that says nothing."""
    rospy.init_node('silent', anonymous=True)
    publisher = rospy.Publisher(topic, kind, queue_size=10)
    while not rospy.is_shutdown():
        time.sleep(0.1)
    return publisher


def publish_shifted(frame, by_m):
    """Each transform of a frame that another one sends, once more, higher."""
    rospy.init_node('shifted', anonymous=True)
    publisher = rospy.Publisher('/tf', TFMessage, queue_size=10)

    def shift(message):
        if message._connection_header['callerid'] == rospy.get_name():
            return
        for one in message.transforms:
            if one.child_frame_id == frame:
                one.transform.translation.z += by_m
                publisher.publish(TFMessage([one]))
    rospy.Subscriber('/tf', TFMessage, shift)
    rospy.spin()


KINDS = {'cloud': (PointCloud2, flat_cloud), 'mesh': (MeshStamped, sheet_mesh)}


def main(arguments):
    """PROGRAM publish|silent KIND TOPIC, shifted FRAME BY_M"""
    from std_msgs.msg import String
    what, kind, topic = arguments
    if what == 'shifted':
        return publish_shifted(kind, float(topic))
    message, make = KINDS.get(kind, (String, None))
    if what == 'publish':
        publish_stream(topic, make, message)
    else:
        be_silent(topic, message)


if __name__ == '__main__':
    main(sys.argv[1:])
