"""Where it is meant to go: what ~intended says, as matrices that carry bodies from where they are at a step's end."""
import xml.etree.ElementTree as xml

import numpy as np

import came
from placed import NS, Unknown, carried, matrix

KINDS = ('trajectory_msgs/JointTrajectory', 'geometry_msgs/TwistStamped')


def turn(by):
    """The matrix that turns about an axis by its length [rad]."""
    angle = np.linalg.norm(by)
    return matrix(np.zeros(3), np.append(np.sin(angle / 2) * by / (angle or 1), np.cos(angle / 2)))


def screw(linear, angular, seconds):
    """What goes by a constant twist, in its own frame."""
    speed = np.linalg.norm(angular)
    m = turn(angular * seconds)
    if speed * seconds == 0:
        m[:3, 3] = linear * seconds
    else:
        axis = angular / speed
        to_axis = np.cross(axis, linear) / speed
        m[:3, 3] = to_axis - m[:3, :3] @ to_axis + axis * (axis @ linear) * seconds
    return m


class Joints:
    """A robot's joints, of its URDF."""

    def __init__(self, path):
        tree = xml.parse(path).getroot()
        self.above = {joint.find('child').get('link'): joint for joint in tree.findall('joint')}
        self.root = next(link.get('name') for link in tree.findall('link') if link.get('name') not in self.above)
        self.links = {link.get('name') for link in tree.findall('link')}

    def way(self, link):
        return self.way(self.above[link].find('parent').get('link')) + [self.above[link]] if link in self.above else []

    @staticmethod
    def follows(joint):
        """The joint that sets its position, times and plus what."""
        mimic = joint.find('mimic')
        return (joint.get('name'), 1, 0) if mimic is None else (mimic.get('joint'), float(mimic.get('multiplier', 1)), float(mimic.get('offset', 0)))

    def moving(self, link):
        return [joint for joint in self.way(link) if joint.get('type') != 'fixed']

    def pose(self, link, positions):
        m = np.eye(4)
        for joint in self.way(link):
            m = m @ came.origin(joint.find('origin'))
            if joint.get('type') != 'fixed':
                name, times, plus = self.follows(joint)
                axis = joint.find('axis')
                axis = np.array([float(w) for w in (axis.get('xyz') if axis is not None else '1 0 0').split()])
                by = (times * positions[name] + plus) * axis / np.linalg.norm(axis)
                m = m @ (matrix(by, [0, 0, 0, 1]) if joint.get('type') == 'prismatic' else turn(by))
        return m


class Motion:
    """One message; `bad` where it cannot be used: it then ends what was in force."""

    def __init__(self, message, horizon):
        self.message, self.twist = message, hasattr(message, 'twist')
        self.begin = message.header.stamp.to_nsec()
        if self.twist:
            self.velocity = [np.array([v.x, v.y, v.z]) for v in (message.twist.linear, message.twist.angular)]
            self.frame, self.seconds, numbers = message.header.frame_id.lstrip('/'), horizon, self.velocity
        else:
            numbers = [x for p in message.points for x in (p.positions, p.velocities, p.accelerations)]
            self.times = [p.time_from_start.to_sec() for p in message.points]
            self.frame, self.seconds = 'joints', max(self.times, default=0)
        self.end = self.begin + int(NS * self.seconds)
        whole = self.twist or len(message.points) > 1 and all(len(p.positions) == len(message.joint_names) for p in message.points)
        self.bad = not (whole and self.begin and self.frame and all(np.isfinite(n).all() for n in numbers))

    def positions(self, seconds):
        """Straight from point to point, or as a spline where both have velocities, or accelerations as well."""
        k = min(max(1, int(np.searchsorted(self.times, seconds))), len(self.times) - 1)
        a, b, h = self.message.points[k - 1], self.message.points[k], self.times[k] - self.times[k - 1]
        p, q, t = np.array(a.positions), np.array(b.positions), np.clip(seconds - self.times[k - 1], 0, h)
        d, v, w = q - p, *((np.array(x.velocities) if a.velocities and b.velocities else (q - p) / h) for x in (a, b))
        if a.velocities and b.velocities and a.accelerations and b.accelerations:
            e, f = np.array(a.accelerations), np.array(b.accelerations)
            c = [p, v, e / 2, (20 * d - (8 * w + 12 * v) * h - (3 * e - f) * h ** 2) / (2 * h ** 3),
                 (-30 * d + (14 * w + 16 * v) * h + (3 * e - 2 * f) * h ** 2) / (2 * h ** 4),
                 (12 * d - 6 * (w + v) * h - (e - f) * h ** 2) / (2 * h ** 5)]
        else:
            c = [p, v, (3 * d - (2 * v + w) * h) / h ** 2, (-2 * d + (v + w) * h) / h ** 3]
        return dict(zip(self.message.joint_names, sum(x * t ** n for n, x in enumerate(c))))


def in_force(world, end, until, newest):
    """The motions that count at a step's end, the first of them begun, of those that came until then. newest(came): the newest answer's
    stamp then."""
    motions, first = [], world.intended[0][1]._type if world.intended else None
    for at, message in world.intended:
        if at <= until and message._type == first:
            motion = Motion(message, world.params['intent']['horizon_s'])
            if motion.bad or motion.end <= newest(at) or motions and motion.begin < motions[-1].begin:
                motions = []
            else:
                motions = [m for m in motions if m.begin != motion.begin] + [motion]
    begun = [m for m in motions if m.begin <= end]
    return [m for m in motions[len(begun) - 1:] if m.end > end] if begun and begun[-1].end > end else []


class Path:
    """moved(body, seconds): the matrix that carries it from where it is at the step's end; it is known for `ends` seconds. rough: within
    rigid_tolerance_m alone."""

    def __init__(self, ends, frames, poses, begin, rough=0.0):
        self.ends, self.frames, self.poses, self.rough = ends, frames, poses, rough  # of each body its frame
        self.begin = {frame: np.linalg.inv(begin(frame)) for frame in set(frames.values())}

    def moved(self, name, seconds):
        return self.poses(self.frames[name], seconds) @ self.begin[self.frames[name]]


def paths(world, step, motions):
    """The paths on which the monitor may say that the bodies are, from the step's end on."""
    tf, first, end = world.transforms, motions[0], step.end
    joints = Joints(world.files.path(world.robot_file)) if world.robot_file else None
    frames = {n: world.carrier(n) for n in world.settings}
    frames = {n: world.tracks[c].mesh.frame for n, c in frames.items() if 'rigid' in world.settings[c]}
    frames = {n: f for n, f in frames.items() if f != world.fixed}
    if first.twist:
        in_tree = joints is not None and first.frame in joints.links and joints.moving(first.frame)
        with_it = lambda f: in_tree and f in joints.links and joints.moving(f)[-1:] == in_tree[-1:]
        frames = {n: f for n, f in frames.items() if f == first.frame or with_it(f)}
        at, parts, spent = tf.pose(first.frame, world.fixed, end), [], 0.0
        for motion, following in zip(motions, motions[1:] + [None]):
            if not motion.twist or motion.frame != first.frame:
                break
            until = min(motion.end, following.begin if following else motion.end)
            parts.append(((until - end) / NS - spent, motion.velocity))
            spent = (until - end) / NS
            if until == motion.end:
                break

        def twisted(_, seconds):
            m = at
            for lasts, velocity in parts:
                m = m @ screw(*velocity, min(lasts, max(0.0, seconds)))
                seconds -= lasts
            return m
        yield Path(spent, frames, twisted, lambda _: at)
    elif joints is not None:
        yield from along_joints(world, step, motions, joints, frames)


def along_joints(world, step, motions, joints, frames):
    """From each place on it that is nearest to where the bodies are, of those around it, and within the tube."""
    first, end, intent = motions[0], step.end, world.params['intent']
    leaders = lambda f: {joints.follows(j)[0] for j in joints.moving(f)}
    frames = {n: f for n, f in frames.items() if f in joints.links and leaders(f) <= set(first.message.joint_names)}
    if not frames:
        return
    try:
        base = world.transforms.pose(joints.root, world.fixed, end)
    except Unknown:
        return
    base, now = np.eye(4) if base is None else base, (end - first.begin) / NS
    pose = lambda f, s: base @ joints.pose(f, first.positions(s))
    actual = {f: world.transforms.pose(f, world.fixed, end) for f in set(frames.values())}
    points = []
    for n, f in frames.items():
        p = world.tracks[n].at(end, step.start, end)
        box = np.array([[p[:, i].min() if k >> i & 1 else p[:, i].max() for i in range(3)] for k in range(8)])
        points.append((f, box, carried(np.linalg.inv(actual[f]), box)))
    off = lambda s: np.concatenate([np.linalg.norm(carried(pose(f, s), local) - box, axis=1) for f, box, local in points])
    times = np.linspace(0, now, 101)
    sums, most = np.array([(off(s) ** 2).sum() for s in times]), np.array([off(s).max() for s in times])
    tube = intent['deviation_m'] + intent.get('deviation_rate_m_s', 0) * now
    last = max(times[most <= intent['deviation_m']], default=None)
    until = min([m.begin for m in motions[1:2]] + [first.end])
    for k in np.nonzero(sums <= np.minimum(np.append(sums[1:], np.inf), np.insert(sums[:-1], 0, np.inf)))[0]:
        low, high = times[max(0, k - 1)], times[min(100, k + 1)]
        for _ in range(30):  # to a billionth
            thirds = low + (high - low) / 3, high - (high - low) / 3
            low, high = (low, thirds[1]) if (off(thirds[0]) ** 2).sum() < (off(thirds[1]) ** 2).sum() else (thirds[0], high)
        if off(low).max() <= tube + world.params.get('rigid_tolerance_m', 1e-3):
            from_s, by_s = low, max(low, last or 0)
            yield Path(min(intent['horizon_s'], (until - end) / NS), frames, lambda f, s, by=by_s: pose(f, min(first.seconds, by + s)),
                       lambda f, by=from_s: pose(f, by), 1.0)
