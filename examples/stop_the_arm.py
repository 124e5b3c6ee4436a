#!/usr/bin/env python3
"""A client of the monitor in a page: says when an arm must stop. As stop_the_arm.cpp, which says more.

Publishes ~stop (std_msgs/Bool) twenty times a second: true when the predicted contact is nearer in time than the arm
needs to stand still, when ~state is not proved or something touches that is not expected to, and when either is old.
This is no safety function.
"""
import time

import rospy
from deformable_ccd.msg import State, TimeToContact
from std_msgs.msg import Bool


class StopTheArm:
    def __init__(self):
        # From the moment at which the camera looked to the arm standing still; look_ahead_s must be longer.
        self.stopping_time_s = rospy.get_param('~stopping_time_s', 0.3)
        self.max_age_s = rospy.get_param('~max_age_s', 0.2)
        monitor = rospy.get_param('~monitor', '/collision_monitor')
        # (steady time of receipt, message); a pair is replaced as a whole, so that no lock is needed.
        self.state = self.prediction = (float('-inf'), None)
        self.told = None
        self.stop = rospy.Publisher('~stop', Bool, queue_size=1, latch=True)
        rospy.Subscriber(monitor + '/state', State, self.on_state, queue_size=1)
        rospy.Subscriber(monitor + '/time_to_contact', TimeToContact, self.on_prediction, queue_size=1)

    def on_state(self, message):
        # What is latched may be as old as the frame that it ends with; that it came just now says nothing.
        at, before = self.state
        newer = before is None or message.holds_until != before.holds_until
        self.state = (time.monotonic() if newer else at, message)

    def on_prediction(self, message):
        self.prediction = (time.monotonic(), message)

    def reason_to_stop(self):
        """Empty: the arm may move."""
        now = time.monotonic()
        state_at, state = self.state
        predicted_at, prediction = self.prediction
        if now - state_at > self.max_age_s:
            return 'no news from the monitor'
        if not state.proved:
            return 'nothing is proved'
        # What is expected to touch in this phase of the task is no reason to stop.
        if state.touching not in (State.NONE, State.EXPECTED):
            return 'something touches'
        if now - predicted_at > self.max_age_s:
            return 'no prediction; is look_ahead_s set?'
        if not prediction.answered:
            return 'a prediction without an answer'
        # Beyond the horizon nothing is known: it counts as the time of a contact.
        contact_in_s = min(prediction.seconds, prediction.horizon) if prediction.contact else prediction.horizon
        if contact_in_s - (now - predicted_at) <= self.stopping_time_s:
            return 'contact within the stopping time'
        return ''

    def spin(self):
        while not rospy.is_shutdown():
            reason = self.reason_to_stop()
            if reason != self.told:
                rospy.loginfo('stop: ' + reason if reason else 'go')
            self.told = reason
            self.stop.publish(bool(reason))
            time.sleep(0.05)  # steady, unlike rospy.Rate under simulated time


if __name__ == '__main__':
    rospy.init_node('stop_the_arm')
    StopTheArm().spin()
