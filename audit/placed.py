"""Where it was: each body over a step, from the samples that had come when the claim was made.

A mesh goes straight from frame to frame in the frame that carries it, and that goes as tf has it: each joint of the chain
by itself, its translation straight, its rotation about one axis, between the two samples around the time. Nothing is
known before the first sample of a moving joint or after its last one. A static frame has one place, from when it came.
"""
import bisect
from dataclasses import dataclass, replace

import numpy as np

from came import NotCovered, rotation

NS = 1000000000


class Unknown(Exception):
    """Nobody saw where it was; a claim that says so is refuted."""


class NotSent(Unknown):
    """No sample of it came for that time."""


def once(question):
    """Is asked once, as long as what is judged stays the same."""
    def asked(self, *words):
        key = self, question, words
        if key not in self.memory:
            self.memory[key] = question(self, *words)
        return self.memory[key]
    return asked


@dataclass
class Sample:
    stamp: int
    parent: str
    translation: np.ndarray
    rotation: np.ndarray  # x, y, z, w
    static: bool
    came: int
    sender: str = ''

    def off(self, other):
        """How far the two are apart: metres, and the angle."""
        if other is self:
            return 0.0, 0.0
        p, q = (s.rotation / np.linalg.norm(s.rotation) for s in (self, other))
        turn = 2 * np.arcsin(min(1.0, min(np.linalg.norm(p - q), np.linalg.norm(p + q)) / 2)) * 2
        return np.abs(self.translation - other.translation).max(), turn


def matrix(translation, quaternion):
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = rotation(quaternion), translation
    return m


def between(a, b, share):
    """The pose of a joint at a share of the time between two samples: straight, and about one axis the shorter way."""
    p, q = a.rotation / np.linalg.norm(a.rotation), b.rotation / np.linalg.norm(b.rotation)
    if p @ q < 0:
        q = -q
    angle = np.arccos(min(1.0, p @ q))
    if angle > 1e-9:
        p = (np.sin((1 - share) * angle) * p + np.sin(share * angle) * q) / np.sin(angle)
    return matrix(a.translation + share * (b.translation - a.translation), p)


class Transforms:
    def __init__(self):
        self.samples, self.static, self.unusable = {}, {}, {}  # of each child frame
        self.order, self.went_back = [], []  # child and sample, as they came; when a frame of a body came that was stamped before one that it had
        self.said = None  # only what came until then counts

    def add(self, message, static, came, sender):
        for t in message.transforms:
            v, q = t.transform.translation, t.transform.rotation
            sample = Sample(t.header.stamp.to_nsec(), t.header.frame_id.lstrip('/'), np.array([v.x, v.y, v.z]),
                            np.array([q.x, q.y, q.z, q.w]), static, came, sender)
            child = t.child_frame_id.lstrip('/')
            kept, named = self.unusable, child and sample.parent and child != sample.parent
            if named and np.isfinite(sample.translation).all() and abs(np.linalg.norm(sample.rotation) - 1) <= 0.005:
                kept = self.static if static else self.samples
            kept.setdefault(child, []).append(sample)
            self.order += [(child, sample)] * (kept is self.samples)

    def finish(self):
        self.contradicted = list(self.contradictions())
        for samples in self.samples.values():
            samples.sort(key=lambda s: s.stamp)
        self.stamps = {child: [s.stamp for s in samples] for child, samples in self.samples.items()}

    def contradictions(self):
        """When samples came that contradict what their publisher sent: at a stamp of more than a second before, or elsewhere at one that it had."""
        newest, sent = {}, {}
        for child, s in self.order:
            mine, last = sent.setdefault(child, {}), newest.get((child, s.sender), 0)
            first = mine.setdefault(s.stamp, s)
            elsewhere = first.sender == s.sender and s.stamp < last and (first.parent != s.parent or max(s.off(first)) > 1e-6)
            if last > s.stamp + NS or elsewhere:
                yield s.came
                for key in [key for key in newest if key[1] == s.sender]:  # what it sent counts no more
                    newest[key], sent[key[0]] = 0, {}
            newest[child, s.sender] = max(s.stamp, newest.get((child, s.sender), 0))

    def seen_ahead(self, said):
        """How far ahead analyze_bag reads /tf: ten seconds, or up to a contradiction, whose turn comes early where the bodies' stamps went back."""
        ends = (came for came in self.contradicted if said < came and not any(back <= said and came <= back + NS for back in self.went_back))
        return min([10 * NS, *(came - 1 - said for came in ends)])

    def judge(self, said, ahead, begun):
        """What is judged was said then, of a step whose first frame had come at `begun`, by somebody who knew /tf so far ahead."""
        self.said, self.read, self.begun, self.memory = said, said + ahead, begun, {}

    def known(self, samples):
        return [s for s in samples if s.came <= (self.said if s.static else self.read)]

    @once
    def around(self, child, stamp):
        """The two samples that a joint's place at a stamp rests on, or twice the one that it is."""
        fixed, moving = self.known(self.static.get(child, [])), self.samples.get(child, [])
        if fixed:
            for a, b in zip(fixed, fixed[1:]):
                if max(a.off(b)) > 1e-6 and self.begun < b.came < self.said:
                    raise Unknown('the static frame %s was sent at another place within the step' % child)
            for other in self.known(moving):
                metres, angle = fixed[-1].off(other)
                if other.parent != fixed[-1].parent or metres > 1e-3:
                    raise Unknown('frame %s is at two places, on /tf and on /tf_static' % child)
                if metres > 1e-6 or angle > 1e-6:
                    raise NotCovered('frame %s is on /tf and on /tf_static at places near to each other' % child)
            return fixed[-1], fixed[-1]
        stamps = self.stamps.get(child, [])
        i, j = bisect.bisect_right(stamps, stamp) - 1, bisect.bisect_left(stamps, stamp)
        while i >= 0 and moving[i].came > self.read:
            i -= 1
        while j < len(moving) and moving[j].came > self.read:
            j += 1
        if i < 0 or j == len(moving):
            raise NotSent('no transform of %s at %.9f s' % (child, stamp / NS))
        i, j = (bisect.bisect_left(stamps, stamps[k]) for k in (i, j))  # of one stamp the first that came
        for k in (i, j):
            for other in moving[k:bisect.bisect_right(stamps, stamps[k])]:
                if other.came < self.said and max(other.off(moving[k])) > 1e-6:
                    raise Unknown('frame %s was at two places at the stamp %.9f s' % (child, stamps[k] / NS))
        if stamps[j] - stamps[i] > 2 * NS:
            raise Unknown('no transform of %s came for more than 2 s around %.9f s' % (child, stamp / NS))
        if moving[i].parent != moving[j].parent:
            raise Unknown('frame %s changes its parent at %.9f s' % (child, stamp / NS))
        return moving[i], moving[j]

    @once
    def chain(self, frame, fixed, stamp):
        """Joints from `frame` up to where it meets the way of the fixed one, and those of the fixed one: (child, a, b)."""
        ways = []
        for name in (frame, fixed):
            way = []
            while name in self.samples or self.known(self.static.get(name, [])):
                way.append((name,) + self.around(name, stamp))
                name = way[-1][1].parent
                if len(way) > 1000:
                    raise NotCovered('a ring of frames')
            ways.append((way, [w[0] for w in way] + [name]))
        (up, names), (down, others) = ways
        meet = next((n for n in names if n in others), None)
        if meet is None:
            raise Unknown('no transform from %s to %s' % (frame, fixed))
        return up[:names.index(meet)], down[:others.index(meet)]

    @once
    def pose(self, frame, fixed, stamp):
        """4 x 4, or None where the frame is the fixed one."""
        if frame == fixed:
            return None
        ways = []
        for way in self.chain(frame, fixed, stamp):
            m = np.eye(4)
            for _, a, b in way:
                share = (stamp - a.stamp) / (b.stamp - a.stamp) if a.stamp != b.stamp else 0.0
                m = (between(a, b, share) if share else matrix(a.translation, a.rotation)) @ m
            ways.append(m)
        return np.linalg.inv(ways[1]) @ ways[0]

    @once
    def knots(self, frame, fixed, start, end):
        """Stamps of the samples within the step; one that cannot be used, around it, is a place that nobody knows."""
        if frame == fixed:
            return []
        first, last = (sum(self.chain(frame, fixed, s), []) for s in (start, end))
        if [(c, a.parent) for c, a, _ in first] != [(c, a.parent) for c, a, _ in last]:
            raise Unknown('what carries %s has another parent within the step' % frame)
        found = set()
        for (child, a, _), (_, _, b) in zip(first, last):
            for sample in self.unusable.get(child, []):
                if not a.static and a.stamp < sample.stamp < b.stamp and sample.came < self.read:
                    raise Unknown('a transform of %s that cannot be used came for %.9f s' % (child, sample.stamp / NS))
            within = [s for s in self.samples.get(child, []) if start < s.stamp < end and s.came < self.read and not a.static]
            if any(s.parent != a.parent for s in within):
                raise Unknown('frame %s changes its parent within the step' % child)
            found |= {s.stamp for s in within}
        return sorted(found)

    def moved(self, frame, fixed, stamp, start, end):
        """Within the step, or since the stamp: what is held in the frame may be where it was then, within rigid_tolerance_m."""
        try:
            return not self.still(frame, fixed, min(stamp, start), max(stamp, end))
        except Unknown:
            return True

    def latest(self, frame, stamp):
        """The last stamp up to this one for which a sample of each joint above the frame has come."""
        while frame in self.samples and self.known(self.samples[frame]):
            newest = self.known(self.samples[frame])[-1]
            frame, stamp = newest.parent, min(stamp, newest.stamp)
        return stamp

    @once
    def still(self, frame, fixed, start, end):
        """Does the chain not move in the step? Only then is a straight way in it a straight way."""
        if frame == fixed:
            return True
        poses = [self.pose(frame, fixed, s) for s in halves([start] + self.knots(frame, fixed, start, end) + [end])]
        return all((p == poses[0]).all() for p in poses)


def halves(stamps):
    """With those in the middle: joints that turn against each other are elsewhere there."""
    return sorted(stamps + [(a + b) // 2 for a, b in zip(stamps, stamps[1:])])


def carried(pose, points):
    return points if pose is None else points @ pose[:3, :3].T + pose[:3, 3]


class Stream:
    """A body whose frames came as messages: at(stamp, start, end) is where its vertices are within a step, knots() are the stamps of what was seen."""
    moves = True
    memory = property(lambda self: self.transforms.memory)

    def __init__(self, name, frames, refused, transforms, fixed, max_step_ns):
        self.name, self.refused, self.transforms, self.fixed = name, refused, transforms, fixed
        self.every, self.max_step_ns = frames, max_step_ns  # in the order in which they came
        self.taken, self.until, self.held, self.voided, self.latest = 0, -1, [], [], None

    def known(self):
        """What had come when it was said, by stamp. One that goes back voids all that has a later stamp."""
        until = min(self.transforms.said, self.latest or self.transforms.said)
        if until < self.until:
            self.taken, self.held, self.voided = 0, [], []
        self.until = until
        while self.taken < len(self.every) and self.every[self.taken].came <= self.until:
            frame = self.every[self.taken]
            if self.held and self.held[-1].stamp > frame.stamp + NS:
                self.held, self.voided = [], []  # time begins anew
            while self.held and self.held[-1].stamp > frame.stamp:
                self.voided.append(self.held.pop().stamp)
            self.held.append(frame)
            self.taken += 1
        return self.held

    @once
    def around(self, start, end):
        """The frames that a step from start to end rests on."""
        said, every = self.transforms.said, self.known()
        stamps = [f.stamp for f in every]
        i, j = bisect.bisect_right(stamps, start) - 1, bisect.bisect_left(stamps, end)
        if i < 0 or j >= len(every):
            raise Unknown('%s has no frames around the step' % self.name)
        came = every[bisect.bisect_left(stamps, stamps[i]):bisect.bisect_right(stamps, stamps[j])]
        frames = came[:1]
        for a, b in zip(came, came[1:]):
            if a.stamp != b.stamp:
                frames.append(b)
            elif b.came < said and not (b.frame == a.frame and np.array_equal(a.positions, b.positions, equal_nan=True)):
                raise Unknown('%s was at two places at the stamp %.9f s' % (self.name, a.stamp / NS))
        for a, b in zip(frames, frames[1:]):
            if not a.surface.same_as(b.surface):
                raise Unknown('%s became another mesh within the step' % self.name)
            if b.stamp - a.stamp > self.max_step_ns:
                raise Unknown('%s has a gap of %.3f s within the step' % (self.name, (b.stamp - a.stamp) / NS))
        if any(frames[0].stamp < stamp < frames[-1].stamp for stamp in self.voided):
            raise Unknown('a frame of %s within the step came before its stamps went back' % self.name)
        for stamp, why, at in self.refused:
            if frames[0].stamp < stamp < frames[-1].stamp and at < said:
                raise Unknown('a frame of %s came for %.9f s and cannot be used: %s' % (self.name, stamp / NS, why))
        return frames

    def surface(self, start, end):
        return self.around(start, end)[0].surface

    def unchecked(self, start, end, mask):
        """How much of it cannot be looked at, but for these vertices."""
        return sum(f.unchecked + np.delete(f.unseen, [v for v in mask if v < len(f.unseen)]).sum() for f in self.around(start, end))

    @once
    def knots(self, start, end):
        frames = self.around(start, end)
        if len({f.frame for f in frames}) > 1:
            raise Unknown('%s comes in another frame within the step, and nobody says how it went' % self.name)
        return [f.stamp for f in frames if start < f.stamp < end] + self.transforms.knots(frames[0].frame, self.fixed, start, end)

    @once
    def at(self, stamp, start, end):
        frames = self.around(start, end)
        i = min(len(frames) - 1, bisect.bisect_left([f.stamp for f in frames], stamp))
        a, b = frames[max(0, i - 1)], frames[i]
        points = b.positions
        if a is not b and b.stamp != stamp:
            points = a.positions + (stamp - a.stamp) / (b.stamp - a.stamp) * (b.positions - a.positions)
        return carried(self.transforms.pose(b.frame, self.fixed, stamp), points)

    def exact(self, start, end):
        """Are the positions at the step's ends the doubles of the messages, and the way straight?"""
        frames = self.around(start, end)
        return frames[0].stamp == start and frames[-1].stamp == end and len(frames) == 2 and frames[0].frame == self.fixed

    def turns(self, start, end):
        return not self.transforms.still(self.carrier(start, end), self.fixed, start, end)

    def loose(self, start, end):
        """May the monitor take another path for its, within rigid_tolerance_m?"""
        return bool(self.knots(start, end)) or self.turns(start, end)

    def loose_at_end(self, start, end):
        """The same of the place at the end."""
        return self.around(start, end)[-1].stamp != end and self.turns(start, end)

    def carrier(self, start, end):
        return self.around(start, end)[0].frame


class Rigid(Stream):
    """A mesh that a tf frame carries."""

    def __init__(self, name, frame, transforms, fixed):
        super().__init__(name, [], [], transforms, fixed, 0)
        self.mesh = frame

    def around(self, start, end):
        return [self.mesh]

    def exact(self, start, end):
        return self.carrier(start, end) == self.fixed

    def loose_at_end(self, start, end):
        return False


class LetGo(Rigid):
    """What a frame carried, where it was let go."""
    moves = False

    def __init__(self, track, stamp):
        super().__init__(track.name, replace(track.mesh, frame=track.fixed), track.transforms, track.fixed)
        self.held, self.stamp = track, stamp

    def at(self, stamp, start, end):
        return self.held.at(self.stamp, start, end)

    def exact(self, start, end):
        return False


class Held(Stream):
    """A static body: its newest frame holds at all times, and goes along with the frame of reference that it came in."""
    moves = False

    def __init__(self, *words, timeout):
        super().__init__(*words)
        self.timeout = timeout

    @once
    def around(self, start, end):
        said = self.transforms.said
        came = [f for f in self.every if f.came <= said]
        if not came:
            raise Unknown('%s has not come' % self.name)
        if any(at > came[-1].came and at < said for _, _, at in self.refused):
            raise Unknown('the newest frame of %s was refused' % self.name)
        if any(0 < f.stamp - came[-1].stamp <= NS for f in came):
            raise Unknown('the newest frame of %s is stamped before one that came before it' % self.name)
        if any(b.came - a.came <= self.max_step_ns and b.came >= said - self.timeout for a, b in zip(came, came[1:])):
            raise NotCovered('%s comes more often than each max_step_s, and came anew within answer_timeout_s' % self.name)
        return came[-1:]

    @once
    def knots(self, start, end):
        try:
            return self.transforms.knots(self.carrier(start, end), self.fixed, start, end)
        except NotSent:
            return []  # what is not sent any more counts as at rest

    @once
    def at(self, stamp, start, end):
        frame, t = self.around(start, end)[0], self.transforms
        try:
            pose = t.pose(frame.frame, self.fixed, stamp)
        except NotSent:
            pose = t.pose(frame.frame, self.fixed, max(frame.stamp, t.latest(frame.frame, stamp)))
        return carried(pose, frame.positions)

    exact = Rigid.exact

    def turns(self, start, end):
        frame = self.around(start, end)[0]
        return self.transforms.moved(frame.frame, self.fixed, frame.stamp, start, end)

    def loose(self, start, end):
        return not self.exact(start, end)

    loose_at_end = turns


class OnMap:
    """A body as it is seen from the map's frame, which may move."""

    def __init__(self, track, frame):
        self.track, self.transforms, self.frame, self.fixed = track, track.transforms, frame, track.fixed

    def knots(self, start, end):
        return self.track.knots(start, end) + self.transforms.knots(self.frame, self.fixed, start, end)

    def turns(self, start, end):
        return self.track.turns(start, end) or not self.transforms.still(self.frame, self.fixed, start, end)

    def at(self, stamp, start, end):
        return carried(self.transforms.pose(self.fixed, self.frame, stamp), self.track.at(stamp, start, end))


class Ahead:
    """A body where a path has carried it after the step's end."""

    def __init__(self, track, pose, rough):
        self.track, self.pose, self.rough = track, pose, rough

    def __getattr__(self, name):
        return getattr(self.track, name)

    def at(self, stamp, start, end):
        return carried(self.pose, self.track.at(end, start, end))

    def exact(self, start, end):
        return False

    def loose_at_end(self, start, end):
        return self.track.loose_at_end(start, end) + self.rough


def pieces(tracks, start, end, tolerance):
    """Stamps that cut the step into pieces, each straight for all of the tracks to within the tolerance [m]."""
    stamps = sorted({start, end} | {k for t in tracks for k in t.knots(start, end)})
    cut = [start]
    for a, b in zip(stamps, stamps[1:]):
        many = 1
        for track in tracks:
            if not track.turns(start, end):
                continue
            first, middle, last = (track.at(s, start, end) for s in (a, (a + b) // 2, b))
            off = np.abs(middle - (first + last) / 2).max()
            many = max(many, int(np.ceil(np.sqrt(off / tolerance))) if off > tolerance else 1)
        many = min(many, max(1, b - a))
        cut += [a + (b - a) * i // many for i in range(1, many + 1)]
    return cut
