"""What a node says of itself, judged as it comes: sums, states and answers that must agree whatever was sent."""
import collections
import time

from live_node import wrong_sums


class NodeWatch:
    """What the node says, judged as it comes."""

    def __init__(self, wants_map):
        self.wants_map = wants_map
        self.wrong, self.outcomes = [], collections.OrderedDict()
        self.clear_ones = collections.deque(maxlen=200)  # states, with when they came
        self.steps = 0

    def contacts(self, message):
        self.steps += 1
        self.outcomes.setdefault(message.header.stamp, []).append(message)
        if len(self.outcomes) > 300:
            self.outcomes.popitem(last=False)
        if len(message.reason) > 2000:
            self.wrong.append('a reason of %d characters' % len(message.reason))

    def counts(self, s):
        self.wrong += wrong_sums(s)
        if s.skipped_error:
            self.wrong.append('%d frames were lost to an error of the monitor' % s.skipped_error)

    def state(self, s):
        said = 'proved %s, touching %d, clear %s, missing %s' % (s.proved, s.touching, s.clear, s.missing)
        if s.proved != (not s.missing) or s.clear != (s.proved and s.touching == s.NONE):
            self.wrong.append(said)
        if s.clear and (s.holds_until.is_zero() or not (s.checked_self or s.checked_map or s.checked_bodies)):
            self.wrong.append('nothing was looked at: ' + said)
        if s.clear and self.wants_map and not s.checked_map:
            self.wrong.append('no map: ' + said)
        if s.clear:
            self.clear_ones.append((time.monotonic(), s))

    def compare(self):
        """Each clear state has an outcome of its stamp that says the same. They come by other connections, in any order, and a stamp
        may come again."""
        while self.clear_ones and time.monotonic() - self.clear_ones[0][0] > 1:
            said = self.outcomes.get(self.clear_ones.popleft()[1].holds_until, [])
            if said and not any(o.answered and o.complete and not o.contacts for o in said):
                self.wrong.append('clear beside statuses %s and %s contacts' % ([o.status for o in said], [len(o.contacts) for o in said]))
