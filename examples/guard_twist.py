#!/usr/bin/env python3
"""A client of the monitor in a page: changes a wanted twist least so that it keeps to ~limits. As guard_twist.cpp, which says more.

It knows no turning: what is wanted of ~wanted/twist/angular is left out, and ~links all move with the twist. No safety function.
"""
import re
import time

import numpy as np
import rospy
from deformable_ccd.msg import Limits
from geometry_msgs.msg import TwistStamped

PERIOD_S = 0.02


class GuardRule:
    """What was said, what was sent since, and the velocity that follows [m/s]; times are of the stamps' clock [s]."""

    def __init__(self, links=(), stopping_time_s=0.1):
        self.links, self.stopping_time_s = set(links), stopping_time_s
        self.said, self.sent, self.reason = None, [], ''

    def on_limits(self, message):
        self.said = message

    def velocity(self, now, wanted):
        velocity, self.reason = self._change(now, np.asarray(wanted, float))
        self.sent = [one for one in self.sent if one[0] > now - 10] + [(now, velocity)]
        return velocity

    def _change(self, now, wanted):
        said, still = self.said, np.zeros(3)
        if said is None:
            return still, 'no news from the monitor'
        if said.unknown:
            return still, said.unknown[0]
        begin = said.header.stamp.to_sec()
        left = begin + said.horizon - now
        if not (begin <= now and left > self.stopping_time_s + PERIOD_S) or not np.isfinite(wanted).all():
            return still, 'the limits are %.2f s old' % (now - begin)
        ends = [at for at, _ in self.sent[1:]] + [now]
        gone = sum((max(0, end - max(begin, at)) * v for (at, v), end in zip(self.sent, ends)), np.zeros(3))
        link_of = {body: re.sub(r'/\d+$', '', body) for body in said.links}  # the second body of `arm` is `arm/2`
        unknown = self.links - set(link_of) - set(link_of.values())
        if unknown:
            return still, 'the limits do not speak of %s' % ', '.join(sorted(unknown))
        moved = {body for body, link in link_of.items() if not self.links or self.links & {body, link}}
        rows = [((n.x, n.y, n.z), speed) for n, speed, link, partner in zip(said.normals, said.speeds, said.link, said.partners)
                if said.links[link] in moved and partner not in moved]
        normals = np.array([n for n, _ in rows]).reshape(-1, 3)
        most = (np.array([speed for _, speed in rows]) * said.horizon - normals @ gone) / left
        velocity, held = wanted.copy(), np.zeros(len(rows))
        for _ in range(200):  # Hildreth's rule; of one half-space its closed form
            for k, normal in enumerate(normals):
                step = max(-held[k], normal @ velocity - most[k] + 1e-9)
                held[k] += step
                velocity -= step * normal
            if (normals @ velocity <= most).all():
                break
        for share in np.append(np.linspace(1, 0, 21), 0):
            slower = share * velocity * min(1, said.most_speed / max(1e-12, share * np.linalg.norm(velocity)))
            if (normals @ slower <= most).all():
                return slower, ''
        return still, 'no motion that it knows keeps to the limits'


def main():
    rospy.init_node('guard_twist')
    rule = GuardRule(rospy.get_param('~links', []), rospy.get_param('~stopping_time_s', 0.1))
    max_age_s = rospy.get_param('~max_age_s', 0.2)
    twist = rospy.Publisher('~twist', TwistStamped, queue_size=1)
    monitor, wanted = rospy.get_param('~monitor', '/collision_monitor'), [TwistStamped()]
    rospy.Subscriber(monitor + '/limits', Limits, rule.on_limits, queue_size=1)
    rospy.Subscriber('~wanted', TwistStamped, lambda m: wanted.__setitem__(0, m), queue_size=1)
    while not rospy.is_shutdown():
        now, asked = rospy.Time.now().to_sec(), wanted[0]
        v = asked.twist.linear
        fresh = abs(now - asked.header.stamp.to_sec()) <= max_age_s
        out = TwistStamped()
        out.header.stamp = rospy.Time.from_sec(now)
        out.twist.linear.x, out.twist.linear.y, out.twist.linear.z = rule.velocity(now, (v.x, v.y, v.z) if fresh else (0, 0, 0))
        twist.publish(out)
        time.sleep(PERIOD_S)  # steady, unlike rospy.Rate under simulated time


if __name__ == '__main__':
    main()
