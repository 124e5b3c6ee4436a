#!/usr/bin/env python3
"""A tracker that is not there: a cloth of 20 x 30 points falls on the box of box.yaml, is folded onto itself, unfolded and lifted
off, every ten seconds. Publishes sensor_msgs/PointCloud2 on /tracker/cloth, row by row, 30 times a second, in the frame world.
"""
import math
import struct
import sys
import time

import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import PointCloud2, PointField
from tf2_msgs.msg import TFMessage

ROWS, COLS, APART_M, BOX_M, TOP_M = 20, 30, 0.02, 0.2, 0.4


def point(row, col, t):
    """Over the box it lies 3 mm below the box's top, so that it is found to touch; beyond the edges it hangs, but not what is folded."""
    up = max(0.0, 0.3 * (abs(t - 5) - 3))  # down in 2 s, there for 6 s, up again
    s, y = APART_M * (col - (COLS - 1) / 2), APART_M * (row - (ROWS - 1) / 2)
    fold = 1.003 * math.pi * math.sin(math.pi * (t - 3) / 4) if 3 < t < 7 and y > 0 else 0.0
    hangs = max(0.0, abs(s) - BOX_M) * max(0.0, 1 - 5 * up) * max(0.0, math.cos(fold))
    return math.copysign(abs(s) - hangs, s), y * math.cos(fold), TOP_M - 0.003 + up - hangs + y * math.sin(fold)


if len(rospy.myargv()) > 1:
    sys.exit(__doc__ + 'It takes no arguments but those of ROS.')
rospy.init_node('publish_cloth')
# RViz warns until tf knows its fixed frame.
box = TransformStamped(child_frame_id='box')
box.header.frame_id, box.transform.rotation.w = 'world', 1
tf = rospy.Publisher('/tf_static', TFMessage, queue_size=1, latch=True)
tf.publish(TFMessage([box]))
publisher = rospy.Publisher('/tracker/cloth', PointCloud2, queue_size=3)
cloud = PointCloud2(height=1, width=ROWS * COLS, point_step=12, row_step=12 * ROWS * COLS)
cloud.header.frame_id, cloud.fields = 'world', [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate('xyz')]
while not rospy.is_shutdown():
    cloud.header.stamp = rospy.Time.now()
    t = cloud.header.stamp.to_sec() % 10
    cloud.data = b''.join(struct.pack('<3f', *point(row, col, t)) for row in range(ROWS) for col in range(COLS))
    publisher.publish(cloud)
    time.sleep(1 / 30)
