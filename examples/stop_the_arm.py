#!/usr/bin/env python3
"""A client of the monitor in a page: says when an arm must stop. As stop_the_arm.cpp, which says more.

Publishes ~stop (std_msgs/Bool) twenty times a second: true when a new contact is predicted nearer in time than the arm
needs to stand still, when one has begun, when ~state is not proved, and when either is old. What is expected to touch,
and what lasts, is no reason to stop. This is no safety function.
"""
import time

import rospy
from deformable_ccd.msg import FirstContact, State
from std_msgs.msg import Bool


class StopRule:
    """What was said when, and what follows from it; `now` is any clock in seconds that only goes forward."""

    def __init__(self, stopping_time_s=0.3, max_age_s=0.2, hold_s=0.5):
        # From the moment at which the camera looked to the arm standing still; look_ahead_s must be longer.
        self.stopping_time_s = stopping_time_s
        self.max_age_s = max_age_s
        self.hold_s = hold_s  # after a new contact, or the threat of one
        # (time of receipt, message); a pair is replaced as a whole, so that no lock is needed.
        self.state = self.prediction = (float('-inf'), None)
        self.held = (float('-inf'), '')

    def on_state(self, now, message):
        # What is latched may be as old as the frame that it ends with; that it came just now says nothing.
        at, before = self.state
        newer = before is None or message.holds_until != before.holds_until
        self.state = (now if newer else at, message)
        if message.touching == State.NEW:
            self.held = (now, 'something touches anew')

    def on_prediction(self, now, message):
        self.prediction = (now, message)

    def reason_to_stop(self, now):
        """Empty: the arm may move."""
        state_at, state = self.state
        predicted_at, prediction = self.prediction
        if now - state_at > self.max_age_s:
            return 'no news from the monitor'
        if not state.proved:
            return 'nothing is proved'
        if now - predicted_at > self.max_age_s:
            return 'no prediction; is look_ahead_s set?'
        if not prediction.answered:
            return 'a prediction without an answer'
        # Beyond the horizon nothing is known: it counts as the time of a contact.
        contact_in_s = min(prediction.seconds, prediction.horizon) if prediction.contact else prediction.horizon
        if contact_in_s - (now - predicted_at) <= self.stopping_time_s:
            self.held = (now, 'a new contact within the stopping time')
        held_at, reason = self.held
        return reason if now - held_at <= self.hold_s else ''


class StopTheArm:
    def __init__(self):
        self.rule = StopRule(rospy.get_param('~stopping_time_s', 0.3), rospy.get_param('~max_age_s', 0.2),
                             rospy.get_param('~hold_s', 0.5))
        monitor = rospy.get_param('~monitor', '/collision_monitor')
        self.told = None
        self.stop = rospy.Publisher('~stop', Bool, queue_size=1, latch=True)
        rospy.Subscriber(monitor + '/state', State, lambda m: self.rule.on_state(time.monotonic(), m), queue_size=1)
        rospy.Subscriber(monitor + '/time_to_contact', FirstContact,
                         lambda m: self.rule.on_prediction(time.monotonic(), m), queue_size=1)

    def spin(self):
        while not rospy.is_shutdown():
            reason = self.rule.reason_to_stop(time.monotonic())
            if reason != self.told:
                rospy.loginfo('stop: ' + reason if reason else 'go')
            self.told = reason
            self.stop.publish(bool(reason))
            time.sleep(0.05)  # steady, unlike rospy.Rate under simulated time


if __name__ == '__main__':
    rospy.init_node('stop_the_arm')
    StopTheArm().spin()
