"""Where it was: each body over a step, from the samples that came.

A mesh goes straight from frame to frame in the frame that carries it, and that goes as tf has it: each joint of the chain
by itself, its translation straight, its rotation about one axis, between the two samples around the time. Nothing is
known before the first sample of a moving joint or after its last one.
"""
import bisect
from dataclasses import dataclass

import numpy as np

from came import NotCovered

NS = 1000000000


class Unknown(Exception):
    """Nobody saw where it was; a claim that says so is refuted."""


@dataclass
class Sample:
    stamp: int
    parent: str
    translation: np.ndarray
    rotation: np.ndarray  # x, y, z, w
    static: bool
    came: int

    def usable(self):
        numbers = np.concatenate([self.translation, self.rotation])
        return bool(np.isfinite(numbers).all()) and abs(np.linalg.norm(self.rotation) - 1) <= 0.005


def matrix(translation, rotation):
    x, y, z, w = rotation / np.linalg.norm(rotation)
    m = np.eye(4)
    m[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                 [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                 [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    m[:3, 3] = translation
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
        self.samples = {}  # of each child frame
        self.unusable = []

    def add(self, message, static, came):
        for t in message.transforms:
            v, q = t.transform.translation, t.transform.rotation
            sample = Sample(t.header.stamp.to_nsec(), t.header.frame_id.lstrip('/'), np.array([v.x, v.y, v.z]),
                            np.array([q.x, q.y, q.z, q.w]), static, came)
            child = t.child_frame_id.lstrip('/')
            if sample.usable() and child and sample.parent and child != sample.parent:
                self.samples.setdefault(child, []).append(sample)
            else:
                self.unusable.append((child, sample))

    def finish(self):
        for child, samples in self.samples.items():
            samples.sort(key=lambda s: s.stamp)

    def chain(self, frame, fixed):
        """Frames from `frame` up to the fixed one, and from the fixed one up to where they meet."""
        ways = []
        for name in (frame, fixed):
            way = [name]
            while way[-1] in self.samples:
                parents = {s.parent for s in self.samples[way[-1]]}
                if len(parents) > 1:
                    raise NotCovered('frame %s has had several parents' % way[-1])
                way.append(parents.pop())
                if len(way) > 1000:
                    raise NotCovered('a ring of frames')
            ways.append(way)
        up, down = ways
        meet = next((f for f in up if f in down), None)
        if meet is None:
            raise Unknown('no transform from %s to %s' % (frame, fixed))
        return up[:up.index(meet)], down[:down.index(meet)]

    def joint(self, child, stamp):
        samples = self.samples[child]
        if any(s.static for s in samples):
            first = samples[0]
            if any((s.translation != first.translation).any() or (s.rotation != first.rotation).any() for s in samples):
                raise NotCovered('the static frame %s was sent at several places' % child)
            return matrix(first.translation, first.rotation)
        i = bisect.bisect_left([s.stamp for s in samples], stamp)
        if i < len(samples) and samples[i].stamp == stamp:
            twice = samples[i:i + 2]
            if len(twice) == 2 and twice[1].stamp == stamp and (
                    (twice[0].translation != twice[1].translation).any() or (twice[0].rotation != twice[1].rotation).any()):
                raise Unknown('frame %s was at two places at the stamp %d' % (child, stamp))
            return matrix(samples[i].translation, samples[i].rotation)
        if i == 0 or i == len(samples):
            raise Unknown('no transform of %s at %.9f s' % (child, stamp / NS))
        a, b = samples[i - 1], samples[i]
        return between(a, b, (stamp - a.stamp) / (b.stamp - a.stamp))

    def pose(self, frame, fixed, stamp):
        """4 x 4, or None where the frame is the fixed one."""
        if frame == fixed:
            return None
        up, down = self.chain(frame, fixed)
        m = np.eye(4)
        for child in up:
            m = self.joint(child, stamp) @ m
        other = np.eye(4)
        for child in down:
            other = self.joint(child, stamp) @ other
        return np.linalg.inv(other) @ m

    def knots(self, frame, fixed, start, end):
        """Stamps of the samples within the step; an unusable one there is a place that nobody knows."""
        if frame == fixed:
            return []
        up, down = self.chain(frame, fixed)
        found = set()
        for child in up + down:
            for name, sample in self.unusable:
                if name == child and start < sample.stamp < end:
                    raise Unknown('a transform of %s that cannot be used came for %.9f s' % (child, sample.stamp / NS))
            found |= {s.stamp for s in self.samples[child] if start < s.stamp < end and not s.static}
        return sorted(found)

    def still(self, frame, fixed, start, end):
        """Does the chain not move in the step? Only then is a straight way in it a straight way."""
        if frame == fixed:
            return True
        stamps = [start] + self.knots(frame, fixed, start, end) + [end]
        poses = [self.pose(frame, fixed, s) for s in stamps]
        return all((p == poses[0]).all() for p in poses)


def carried(pose, points):
    return points if pose is None else points @ pose[:3, :3].T + pose[:3, 3]


class Stream:
    """A body whose frames came as messages."""

    def __init__(self, name, frames, refused, transforms, fixed, max_step_ns):
        self.name, self.frames, self.refused = name, frames, refused
        self.transforms, self.fixed, self.max_step_ns = transforms, fixed, max_step_ns
        self.stamps = [f.stamp for f in frames]

    def around(self, start, end):
        """The frames that a step from start to end rests on."""
        i, j = bisect.bisect_right(self.stamps, start) - 1, bisect.bisect_left(self.stamps, end)
        if i < 0 or j == len(self.stamps):
            raise Unknown('%s has no frames around the step' % self.name)
        frames = self.frames[i:j + 1]
        for a, b in zip(frames, frames[1:]):
            if not a.surface.same_as(b.surface):
                raise Unknown('%s became another mesh within the step' % self.name)
            if b.stamp - a.stamp > self.max_step_ns:
                raise Unknown('%s has a gap of %.3f s within the step' % (self.name, (b.stamp - a.stamp) / NS))
        for stamp, why in self.refused:
            if frames[0].stamp < stamp < frames[-1].stamp:
                raise Unknown('a frame of %s came for %.9f s and cannot be used: %s' % (self.name, stamp / NS, why))
        return frames

    def surface(self, start, end):
        return self.around(start, end)[0].surface

    def unchecked(self, start, end):
        return max(f.unchecked for f in self.around(start, end))

    def knots(self, start, end):
        frames = self.around(start, end)
        return [f.stamp for f in frames if start < f.stamp < end] + self.transforms.knots(frames[0].frame, self.fixed, start, end)

    def at(self, stamp, start, end):
        frames = self.around(start, end)
        i = bisect.bisect_left([f.stamp for f in frames], stamp)
        b = frames[i]
        points = b.positions
        if b.stamp != stamp:
            a = frames[i - 1]
            points = a.positions + (stamp - a.stamp) / (b.stamp - a.stamp) * (b.positions - a.positions)
        return carried(self.transforms.pose(b.frame, self.fixed, stamp), points)

    def exact(self, start, end):
        """Are the positions at the step's ends the doubles of the messages, and the way straight?"""
        frames = self.around(start, end)
        return frames[0].stamp == start and frames[-1].stamp == end and len(frames) == 2 and frames[0].frame == self.fixed

    def turns(self, start, end):
        return not self.transforms.still(self.around(start, end)[0].frame, self.fixed, start, end)


class Rigid:
    """A mesh that a tf frame carries."""

    def __init__(self, name, positions, surface, lost, frame, transforms, fixed):
        self.name, self.positions, self.mesh, self.lost = name, positions, surface, lost
        self.frame, self.transforms, self.fixed = frame, transforms, fixed

    def surface(self, start, end):
        return self.mesh

    def unchecked(self, start, end):
        return self.lost

    def knots(self, start, end):
        return self.transforms.knots(self.frame, self.fixed, start, end)

    def at(self, stamp, start, end):
        return carried(self.transforms.pose(self.frame, self.fixed, stamp), self.positions)

    def exact(self, start, end):
        return self.frame == self.fixed

    def turns(self, start, end):
        return not self.transforms.still(self.frame, self.fixed, start, end)


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
