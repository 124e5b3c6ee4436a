"""Messages that tests of bags make, and bags of them."""
import collections
import struct

import rosbag
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import PointCloud2, PointField


def write_bag(path, messages):
    """Of (topic, message, time)."""
    with rosbag.Bag(str(path), 'w') as bag:
        for topic, message, at in messages:
            bag.write(topic, message, at)
    return path


def messages_of(path):
    with rosbag.Bag(str(path)) as bag:
        return list(bag.read_messages())


def by_topic(path):
    found = collections.defaultdict(list)
    for topic, message, _ in messages_of(path):
        found[topic].append(message)
    return found


def transform(child, stamp=None, w=1, **translation):
    """From the world."""
    one = TransformStamped(child_frame_id=child)
    one.header.frame_id = 'world'
    if stamp is not None:
        one.header.stamp = stamp
    one.transform.rotation.w = w
    for axis, value in translation.items():
        setattr(one.transform.translation, axis, value)
    return one


def cloud(points, stamp=None, frame='world', rows=1):
    columns = len(points) // rows
    message = PointCloud2(height=rows, width=columns, point_step=12, row_step=12 * columns, is_dense=True)
    message.header.frame_id = frame
    if stamp is not None:
        message.header.stamp = stamp
    message.fields = [PointField(name=n, offset=4 * i, datatype=PointField.FLOAT32, count=1) for i, n in enumerate('xyz')]
    message.data = b''.join(struct.pack('<3f', *p) for p in points)
    return message
