#!/usr/bin/env python3
"""A tracker that is not there: publishes a waving cloth at 30 Hz, as the trackers of launch/presets send theirs.

usage: emulated_tracker.py cloud|grid|markers|camera TOPIC ROWS COLS FRAME [RIGID_FRAME...]
  cloud    PointCloud2 of height 1, row by row    grid  an organised PointCloud2    markers  a TRIANGLE_LIST in a MarkerArray
  camera   a grid, and at 10 Hz the organised cloud of a depth camera that sees a wall behind it, with lost pixels
Each RIGID_FRAME is sent on /tf, as a child of FRAME.
"""
import math
import signal
import struct
import sys

import rospy
from geometry_msgs.msg import Point, TransformStamped
from sensor_msgs.msg import PointCloud2, PointField
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray


def points(rows, cols, t):
    return [(0.02 * c, 0.02 * r, 2.0 + 0.01 * math.sin(6 * t + 0.5 * c)) for r in range(rows) for c in range(cols)]


def cloud(rows, cols, t, organised):
    message = PointCloud2(height=rows if organised else 1, width=cols if organised else rows * cols, point_step=12,
                          is_dense=True, data=b''.join(struct.pack('<fff', *p) for p in points(rows, cols, t)))
    message.row_step = 12 * message.width
    message.fields = [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate('xyz')]
    return message


def wall():
    """48 x 64 pixels at a depth of 3 m, 6 mm apart; every seventh is lost."""
    lost = float('nan')
    seen = [(0.006 * c, 0.006 * r, 3.0) if (r * 64 + c) % 7 else (lost, lost, lost) for r in range(48) for c in range(64)]
    message = PointCloud2(height=48, width=64, point_step=16, row_step=16 * 64, is_dense=False,
                          data=b''.join(struct.pack('<fffI', *p, 0xff8040) for p in seen))
    message.fields = [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate(('x', 'y', 'z', 'rgb'))]
    return message


def markers(rows, cols, t):
    at = [Point(*p) for p in points(rows, cols, t)]
    marker = Marker(ns='', id=2, type=Marker.TRIANGLE_LIST, action=Marker.ADD)
    marker.scale.x = marker.scale.y = marker.scale.z = marker.color.a = marker.pose.orientation.w = 1.0
    for corner in (r * cols + c for r in range(rows - 1) for c in range(cols - 1)):
        marker.points += [at[corner + i] for i in (0, 1, cols, 1, cols + 1, cols)]
    return marker


def pose(frame, child, stamp):
    transform = TransformStamped(child_frame_id=child)
    transform.header.stamp, transform.header.frame_id = stamp, frame
    transform.transform.rotation.w, transform.transform.translation.z = 1.0, 3.0
    return transform


def main():
    kind, topic, rows, cols, frame = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), sys.argv[5]
    # By name, since whoever starts the tests in the background has them inherit a SIGINT that is ignored.
    signal.signal(signal.SIGINT, lambda *_: sys.exit(0))
    rospy.init_node('emulated_tracker', anonymous=True, disable_signals=True)
    publisher = rospy.Publisher(topic, MarkerArray if kind == 'markers' else PointCloud2, queue_size=3)
    poses = rospy.Publisher('/tf', TFMessage, queue_size=3)
    camera = rospy.Publisher('/camera/depth_registered/points', PointCloud2, queue_size=3) if kind == 'camera' else None
    seen, frames = wall(), 0
    while not rospy.is_shutdown():
        now = rospy.Time.now()
        message = markers(rows, cols, now.to_sec()) if kind == 'markers' else cloud(rows, cols, now.to_sec(), kind in ('grid', 'camera'))
        message.header.stamp, message.header.frame_id = now, frame
        publisher.publish(MarkerArray([message]) if kind == 'markers' else message)
        if camera and frames % 3 == 0:
            seen.header = message.header
            camera.publish(seen)
        frames += 1
        poses.publish([pose(frame, child, now) for child in sys.argv[6:]])
        rospy.sleep(1 / 30)


if __name__ == '__main__':
    main()
