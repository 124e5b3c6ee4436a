"""What touches: do two features that move on straight lines meet?

Every decision is made in whole numbers. Floating point only rejects, with room of 2^-40 of the coordinates' size: a
pair that a direction separates by more, at both ends of a straight piece, is apart in between, since along a fixed
direction the gap of two points that move on lines is a line.

A feature is a vertex, an edge or a face; what is closed counts, borders included, and so do both ends of the time.
"""
from fractions import Fraction

import numpy as np

ROOM = 2.0 ** -40

# -- polynomials in t with whole coefficients, lowest first -----------------------------------------------------------


def trimmed(p):
    while p and p[-1] == 0:
        p = p[:-1]
    return p


def minus(p, q):
    n = max(len(p), len(q))
    return trimmed([(p[i] if i < len(p) else 0) - (q[i] if i < len(q) else 0) for i in range(n)])


def plus(p, q):
    return minus(p, [-c for c in q])


def times(p, q):
    product = [0] * max(0, len(p) + len(q) - 1)
    for i, a in enumerate(p):
        for j, b in enumerate(q):
            product[i + j] += a * b
    return trimmed(product)


def at(p, t):
    value = Fraction(0)
    for c in reversed(p):
        value = value * t + c
    return value


def sign(x):
    return (x > 0) - (x < 0)


def remainder(p, q):
    p = [Fraction(c) for c in p]
    while len(p) >= len(q):
        factor, shift = p[-1] / q[-1], len(p) - len(q)
        p = trimmed([c - factor * q[i - shift] if i >= shift else c for i, c in enumerate(p[:-1])])
    return p


def common(p, q):
    """The greatest common divisor, up to a factor."""
    while q:
        p, q = q, remainder(p, q)
    return [c / p[-1] for c in map(Fraction, p)]


def quotient(p, q):
    result, p = [Fraction(0)] * (len(p) - len(q) + 1), [Fraction(c) for c in p]
    while len(p) >= len(q):
        factor, shift = p[-1] / q[-1], len(p) - len(q)
        result[shift] = factor
        p = trimmed([c - factor * q[i - shift] if i >= shift else c for i, c in enumerate(p[:-1])])
    return result


def derivative(p):
    return trimmed([i * c for i, c in enumerate(p)][1:])


def square_free(p):
    d = derivative(p)
    return quotient(p, common(p, d)) if d else [Fraction(c) for c in p]


class Sturm:
    """Counts the distinct roots of a polynomial without double roots in (low, high]."""

    def __init__(self, p):
        self.chain = [p, derivative(p)]
        while self.chain[-1]:
            self.chain.append([-c for c in remainder(self.chain[-2], self.chain[-1])])
        self.chain.pop()

    def changes(self, t):
        signs = [s for s in (sign(at(p, t)) for p in self.chain) if s]
        return sum(a != b for a, b in zip(signs, signs[1:]))

    def count(self, low, high):
        return self.changes(low) - self.changes(high)


class Root:
    """A root of `p` in [low, high]: low = high, or the only one in (low, high], and not high."""

    def __init__(self, p, low, high):
        self.p, self.low, self.high = p, low, high

    def halve(self):
        middle = (self.low + self.high) / 2
        if at(self.p, middle) == 0:
            self.low = self.high = middle
        elif sign(at(self.p, middle)) == sign(at(self.p, self.high)):
            self.high = middle
        else:
            self.low = middle

    def sign_of(self, q):
        """The exact sign of the polynomial q here."""
        if not q:
            return 0
        if self.low == self.high:
            return sign(at(q, self.low))
        shared = common(self.p, q)
        if len(shared) > 1 and Sturm(shared).count(self.low, self.high) > 0:
            return 0
        counter = Sturm(square_free(q))
        while self.low != self.high and (at(q, self.low) == 0 or counter.count(self.low, self.high) > 0):
            self.halve()
        return sign(at(q, self.high))


def roots(p):
    """All roots of p in [0, 1], in order; p is not zero everywhere."""
    p = square_free(p)
    if len(p) < 2:
        return []
    found = [Root(p, Fraction(0), Fraction(0))] if at(p, Fraction(0)) == 0 else []
    counter = Sturm(p)
    open_intervals = [(Fraction(0), Fraction(1))]
    inner = []
    while open_intervals:
        low, high = open_intervals.pop()
        count = counter.count(low, high)
        if count == 1 and at(p, high) == 0:
            inner.append(Root(p, high, high))
        elif count == 1 and at(p, low) != 0:
            inner.append(Root(p, low, high))
        elif count > 0:
            middle = (low + high) / 2
            open_intervals += [(low, middle), (middle, high)]
    return found + sorted(inner, key=lambda root: root.high)


# -- moving points: three polynomials of degree 1 ----------------------------------------------------------------------


def moving(starts, ends):
    """Points as polynomials in t, in whole numbers: all coordinates times one power of two."""
    pairs = [[(float(a).as_integer_ratio(), float(b).as_integer_ratio()) for a, b in zip(s, e)]
             for s, e in zip(starts, ends)]
    scale = max(ratio[1] for point in pairs for pair in point for ratio in pair)
    whole = lambda ratio: ratio[0] * (scale // ratio[1])
    return [[trimmed([whole(a), whole(b) - whole(a)]) for a, b in point] for point in pairs]


def way(a, b):
    return [minus(b[i], a[i]) for i in range(3)]


def cross(u, v):
    return [minus(times(u[(i + 1) % 3], v[(i + 2) % 3]), times(u[(i + 2) % 3], v[(i + 1) % 3])) for i in range(3)]


def dot(u, v):
    return plus(plus(times(u[0], v[0]), times(u[1], v[1])), times(u[2], v[2]))


def on_segment(root, p, a, b):
    u, v = way(a, p), way(b, p)
    return all(root.sign_of(c) == 0 for c in cross(u, v)) and root.sign_of(dot(u, v)) <= 0


def in_face(root, p, a, b, c):
    """At a time at which the four lie in one plane."""
    for axis, n in enumerate(cross(way(a, b), way(a, c))):
        turn = root.sign_of(n)
        if turn:
            sides = [root.sign_of(cross(way(p, x), way(p, y))[axis]) for x, y in ((a, b), (b, c), (c, a))]
            return all(s in (0, turn) for s in sides)
    return on_segment(root, p, a, b) or on_segment(root, p, b, c) or on_segment(root, p, c, a)


def edges_meet(root, a, b, c, d):
    for axis, m in enumerate(cross(way(a, b), way(c, d))):
        if root.sign_of(m):
            side = lambda p, q, r: root.sign_of(cross(way(p, q), way(p, r))[axis])
            return side(a, b, c) * side(a, b, d) <= 0 and side(c, d, a) * side(c, d, b) <= 0
    return on_segment(root, a, c, d) or on_segment(root, b, c, d) or on_segment(root, c, a, b) or on_segment(root, d, a, b)


def first_touch(kind, starts, ends):
    """The first time in [0, 1] at which the two meet, as a Root, or None. kind 'vf': vertex, then the face's three; 'ee'."""
    p = moving(starts, ends)
    meets = in_face if kind == 'vf' else edges_meet
    if kind == 'vf':
        plane = dot(cross(way(p[1], p[2]), way(p[1], p[3])), way(p[1], p[0]))
    else:
        plane = dot(cross(way(p[0], p[1]), way(p[2], p[3])), way(p[0], p[2]))
    if plane:
        times_ = roots(plane)
    else:
        # In one plane at all times: they begin to meet at the start, or where an end comes upon an edge.
        if kind == 'vf':
            ends_on = [(p[0], p[1], p[2]), (p[0], p[2], p[3]), (p[0], p[3], p[1])]
        else:
            ends_on = [(p[0], p[2], p[3]), (p[1], p[2], p[3]), (p[2], p[0], p[1]), (p[3], p[0], p[1])]
        events = [q for v, a, b in ends_on for q in cross(way(a, v), way(b, v)) + [dot(way(a, v), way(b, v))] if q]
        times_ = [Root([Fraction(0), Fraction(1)], Fraction(0), Fraction(0))]
        times_ += sorted((r for q in events for r in roots(q)), key=lambda r: r.high)
        hits = [r for r in times_ if meets(r, *p)]
        return min(hits, key=narrow, default=None)
    return next((r for r in times_ if meets(r, *p)), None)


def narrow(root, bits=64):
    """The root, to 2^-64: to be said, and to put roots into an order."""
    while root.high - root.low > Fraction(1, 1 << bits):
        root.halve()
    return root.high


def edge_through_face(edge, face):
    """Do they meet at rest?"""
    p = moving(list(edge) + list(face), list(edge) + list(face))
    value = lambda q: q[0] if q else 0
    side = lambda a, b, c, d: sign(value(dot(cross(way(a, b), way(a, c)), way(a, d))))
    e, f, a, b, c = p
    below, above = side(a, b, c, e), side(a, b, c, f)
    still = Root([Fraction(0), Fraction(1)], Fraction(0), Fraction(0))
    if below == 0 and in_face(still, e, a, b, c) or above == 0 and in_face(still, f, a, b, c):
        return True
    if below * above > 0 or below == above:
        return any(below == above == 0 and edges_meet(still, e, f, x, y) for x, y in ((a, b), (b, c), (c, a)))
    turns = {side(e, f, x, y) for x, y in ((a, b), (b, c), (c, a))}
    return not {-1, 1} <= turns


# -- what floating point rejects ---------------------------------------------------------------------------------------


def overlapping(low_a, high_a, low_b, high_b, same=False):
    """Index pairs of closed boxes that meet, by comparisons alone; with `same` each pair of the one list once."""
    axis = int(np.argmax(high_b.max(0) - low_b.min(0))) if len(low_b) else 0
    order_a, order_b = np.argsort(low_a[:, axis], kind='stable'), np.argsort(low_b[:, axis], kind='stable')
    longest = (high_b[:, axis] - low_b[:, axis]).max() if len(low_b) else 0
    keys, found = low_b[order_b, axis], []
    for begin in range(0, len(order_a), 256):
        mine = order_a[begin:begin + 256]
        first = np.searchsorted(keys, low_a[mine, axis].min() - longest * (1 + 1e-9) - 1e-300, 'left')
        last = np.searchsorted(keys, high_a[mine, axis].max(), 'right')
        for at_ in range(first, last, 8192):
            theirs = order_b[at_:min(at_ + 8192, last)]
            meet = np.ones((len(mine), len(theirs)), bool)
            for k in (axis, (axis + 1) % 3, (axis + 2) % 3):
                meet &= low_a[mine, k][:, None] <= high_b[theirs, k]
                meet &= low_b[theirs, k] <= high_a[mine, k][:, None]
            i, j = np.nonzero(meet)
            found.append(np.stack([mine[i], theirs[j]], 1))
    pairs = np.concatenate(found) if found else np.empty((0, 2), int)
    return pairs[pairs[:, 0] < pairs[:, 1]] if same else pairs


def unit(v):
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.divide(v, length, out=np.zeros_like(v), where=length > 1e-200)


def apart(a0, a1, b0, b1, distance=0.0):
    """Of n pairs of features (n x corners x 3 each, at both ends): which are certainly further apart than `distance`."""
    if not len(a0):
        return np.zeros(0, bool)
    directions = [np.broadcast_to(axis, (len(a0), 3)) for axis in np.eye(3)]
    a, b = (a0 + a1) / 2, (b0 + b1) / 2
    between = b.mean(1) - a.mean(1)
    sides = []
    for f in (a, b):
        sides += [f[:, i] - f[:, i - 1] for i in range(f.shape[1] if f.shape[1] > 2 else f.shape[1] - 1)]
    normals = []
    if a.shape[1] == 3 or b.shape[1] == 3:
        f = a if a.shape[1] == 3 else b
        normals.append(np.cross(f[:, 1] - f[:, 0], f[:, 2] - f[:, 0]))
    if a.shape[1] == 2 and b.shape[1] == 2:
        normals.append(np.cross(sides[0], sides[1]))
    directions += normals + sides + [between]
    for side in sides:
        along = unit(side)
        directions.append(between - (between * along).sum(1, keepdims=True) * along)
        directions += [np.cross(n, side) for n in normals]
    size = max(np.abs(x).max() for x in (a0, a1, b0, b1))
    result = np.zeros(len(a0), bool)
    left = np.arange(len(a0))
    for d in directions:
        if not len(left):
            break
        n = unit(np.asarray(d, float)[left])
        gap = None
        for pa, pb in ((a0, b0), (a1, b1)):
            u, v = np.einsum('nij,nj->ni', pa[left], n), np.einsum('nij,nj->ni', pb[left], n)
            one = np.stack([v.min(1) - u.max(1), u.min(1) - v.max(1)], 1)
            gap = one if gap is None else np.minimum(gap, one)
        away = (gap > distance * (1 + ROOM) + ROOM * size).any(1)
        result[left[away]] = True
        left = left[~away]
    return result


# -- how near, in doubles: of n pairs at rest (n x corners x 3) --------------------------------------------------------


def point_to_line(p, a, b):
    u = b - a
    square = np.einsum('ni,ni->n', u, u)
    t = np.clip(np.einsum('ni,ni->n', p - a, u) / np.where(square > 0, square, 1), 0, 1)
    return np.linalg.norm(p - a - t[:, None] * u, axis=1)


def point_to_face(p, f):
    best = np.minimum(point_to_line(p, f[:, 0], f[:, 1]), point_to_line(p, f[:, 1], f[:, 2]))
    best = np.minimum(best, point_to_line(p, f[:, 2], f[:, 0]))
    n = np.cross(f[:, 1] - f[:, 0], f[:, 2] - f[:, 0])
    sides = [np.einsum('ni,ni->n', np.cross(f[:, (i + 1) % 3] - f[:, i], p - f[:, i]), n) for i in range(3)]
    above = np.abs(np.einsum('ni,ni->n', unit(n), p - f[:, 0]))
    return np.where((np.min(sides, 0) > 0), np.minimum(above, best), best)


def line_to_line(p, q):
    best = np.min([point_to_line(p[:, 0], q[:, 0], q[:, 1]), point_to_line(p[:, 1], q[:, 0], q[:, 1]),
                   point_to_line(q[:, 0], p[:, 0], p[:, 1]), point_to_line(q[:, 1], p[:, 0], p[:, 1])], 0)
    u, v, w = p[:, 1] - p[:, 0], q[:, 1] - q[:, 0], p[:, 0] - q[:, 0]
    dot_ = lambda x, y: np.einsum('ni,ni->n', x, y)
    a, b, c, d, e = dot_(u, u), dot_(u, v), dot_(v, v), dot_(u, w), dot_(v, w)
    area = a * c - b * b
    some = np.where(area > 1e-12 * a * c, area, 1)
    s, t = (b * e - c * d) / some, (a * e - b * d) / some
    within = (area > 1e-12 * a * c) & (s > 0) & (s < 1) & (t > 0) & (t < 1)
    return np.where(within, np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=1), best)


def point_to_box(p, low, high):
    return np.linalg.norm(np.maximum(0, np.maximum(low - p, p - high)), axis=1)


def box_gap(a0, a1, b0, b1):
    """How far apart the boxes of all that the two sweep are."""
    (la, ha), (lb, hb) = ((np.concatenate(p, 1).min(1), np.concatenate(p, 1).max(1)) for p in ((a0, a1), (b0, b1)))
    return np.linalg.norm(np.maximum(0, np.maximum(la - hb, lb - ha)), axis=1)


def nearest(distance, starts, ends, reach, rounds=12):
    """Of pairs that move: which come nearer than the reach, the least distance found on the way, and when. It may be less, never more, in truth."""
    at_ = lambda t, which: distance(*[s[which] + t[:, None, None] * (e[which] - s[which]) for s, e in zip(starts, ends)])
    far = sum(np.linalg.norm(e - s, axis=2).max(1) for s, e in zip(starts, ends))  # a distance changes by no more
    left = np.arange(len(far))
    best, when = at_(np.full(len(left), 0.5), left), np.full(len(left), 0.5)
    near = best - far / 2 < reach
    left, best, when = left[near], best[near], when[near]
    if rounds and len(left):
        grid = [at_(np.full(len(left), t), left) for t in np.linspace(0, 1, 9)]
        best, when = np.min(grid, 0), np.argmin(grid, 0) / 8
        near = best - far[left] / 16 < reach
        left, best, when = left[near], best[near], when[near]
        low, high = np.maximum(0, when - 0.125), np.minimum(1, when + 0.125)
        for _ in range(rounds if len(left) else 0):
            x, y = low + (high - low) * 0.382, low + (high - low) * 0.618
            dx, dy = at_(x, left), at_(y, left)
            low, high = np.where(dx > dy, x, low), np.where(dx > dy, high, y)
            for t, d in ((x, dx), (y, dy)):
                when, best = np.where(d < best, t, when), np.minimum(best, d)
    return left, best, when
