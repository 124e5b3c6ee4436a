"""A step budget is kept as a time, live: latency is printed, and asserted only against a hang, ten times what is promised."""
import math
import time
import unittest

import rospy
from attack import SLOW, AttackTest, checkerboard, cloud_of, flat_cloud, octomap, wait_for
from deformable_ccd.msg import ContactArray
from octomap_msgs.msg import Octomap


class BudgetTest(AttackTest):
    def run_frames(self, budget_ms, messages):
        """All are answered, the steps cut; the longest step [ms]."""
        outcomes = self.outcomes_of(self.publisher, messages)
        wait_for(lambda: self.stats[-1].header.stamp == messages[-1].header.stamp, 20, 'the last statistics')
        steps = [s for s in self.stats if s.header.stamp >= messages[0].header.stamp]
        longest = max(s.total_ms for s in steps)
        print('%s: at most %.1f ms with a budget of %g ms, statuses %s' % (
            self.id().split('.')[-1], longest, budget_ms, sorted({o.status for o in outcomes})))
        self.assertLessEqual(longest, 10 * (budget_ms + max(1, 0.1 * budget_ms)))
        self.assertTrue(all(o.answered for o in outcomes[1:]))
        return outcomes

    def recovers(self, first, rows, cols):
        outcomes = self.outcomes_of(self.publisher, [flat_cloud(first + i, rows, cols) for i in range(3)])
        self.assertEqual(outcomes[2].status, ContactArray.OK, outcomes[2].reason)
        self.assert_adds_up(self.stats[-1])

    def test_doubles_from_denormal_to_a_decimetre(self):
        budget_ms = 10 * SLOW
        self.start_node('doubles', step_budget_ms=budget_ms)
        rows, cols = 28, 28  # three and a half million pairs: more than any machine decides in the budget
        messages = []
        for i in range(20):
            points = [tuple(math.ldexp(((7 * k + 13 * a + i) % 31 - 15) / 16, -3 - (k * 37 + a * 11 + i * 5) % 1070) for a in range(3))
                      for k in range(rows * cols)]
            messages.append(cloud_of(i, points, rows, cols))
        outcomes = self.run_frames(budget_ms, messages)
        self.assertFalse(any(s.clear for s in self.states[1:]))
        # A fast machine comes to the limit of what a step may find before it comes to the end of the budget.
        self.assertTrue(all(o.status in (ContactArray.DEADLINE, ContactArray.TRUNCATED) for o in outcomes[1:]),
                        [(o.status, o.reason) for o in outcomes])
        self.assertFalse(any(o.complete for o in outcomes[1:]))
        self.recovers(30, rows, cols)


if __name__ == '__main__':
    unittest.main()
