#!/usr/bin/env python3
"""A client of the monitor in a page: slows an arm down instead of stopping it. As slow_the_arm.cpp, which says more.

Publishes ~scale (std_msgs/Float64) fifty times a second: the monitor's ~speed_scale, 0 when that is old; it falls at once and
rises evenly. This is no safety function.
"""
import time

import rospy
from deformable_ccd.msg import SpeedScale
from std_msgs.msg import Float64

PERIOD_S = 0.02


class SlowRule:
    """What was said when, and what follows from it; `now` is any clock in seconds that only goes forward."""

    def __init__(self, max_age_s=0.2, rise_per_s=2.0):
        self.max_age_s = max_age_s
        self.rise_per_s = rise_per_s
        self.scale = 0.0
        # (time of receipt of the first with its frame, message); replaced as a whole, so that no lock is needed.
        self.said = (float('-inf'), None)

    def on_speed(self, now, message):
        # What is latched may be as old as its frame; that it came just now says nothing.
        at, before = self.said
        self.said = (now if before is None or message.holds_until != before.holds_until else at, message)

    def next_scale(self, now):
        at, message = self.said
        allowed = min(1.0, max(0.0, message.scale)) if now - at <= self.max_age_s else 0.0
        self.scale = min(allowed, self.scale + self.rise_per_s * PERIOD_S)
        return self.scale

    def reason(self, now):
        at, message = self.said
        return message.reason if now - at <= self.max_age_s else 'no news from the monitor'


def main():
    rospy.init_node('slow_the_arm')
    rule = SlowRule(rospy.get_param('~max_age_s', 0.2), rospy.get_param('~rise_per_s', 2.0))
    scale = rospy.Publisher('~scale', Float64, queue_size=1, latch=True)
    monitor = rospy.get_param('~monitor', '/collision_monitor')
    rospy.Subscriber(monitor + '/speed_scale', SpeedScale, lambda m: rule.on_speed(time.monotonic(), m), queue_size=1)
    while not rospy.is_shutdown():
        now = time.monotonic()
        scale.publish(rule.next_scale(now))
        rospy.loginfo_throttle(1, 'scale %.2f %s' % (rule.scale, rule.reason(now)))
        time.sleep(PERIOD_S)  # steady, unlike rospy.Rate under simulated time


if __name__ == '__main__':
    main()
