"""What touches: do two features that move on straight lines meet?

Every decision is made in whole numbers. Floating point only rejects, with room of 2^-40 of the coordinates' size: a
pair that a direction separates by more, at both ends of a straight piece, is apart in between, since along a fixed
direction the gap of two points that move on lines is a line.

A feature is a vertex, an edge or a face; what is closed counts, borders included, and so do both ends of the time.
"""
import math
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


def times(p, q):
    product = [0] * max(0, len(p) + len(q) - 1)
    for i, a in enumerate(p):
        for j, b in enumerate(q):
            product[i + j] += a * b
    return trimmed(product)


def at(p, t):
    value, power = 0, 1
    for c in reversed(p):
        value, power = value * t.numerator + c * power, power * t.denominator
    return Fraction(value * t.denominator, power)


def sign(x):
    return (x > 0) - (x < 0)


def divided(p, q):
    """Quotient and remainder, each times some number above 0."""
    quotient = [0] * max(0, len(p) - len(q) + 1)
    while len(p) >= len(q):
        by, factor, shift = abs(q[-1]), sign(q[-1]) * p[-1], len(p) - len(q)
        quotient = [c * by for c in quotient]
        quotient[shift] = factor
        p = trimmed([c * by - factor * q[i - shift] if i >= shift else c * by for i, c in enumerate(p[:-1])])
    return [[c // (math.gcd(*r) or 1) for c in r] for r in (quotient, p)]


def common(p, q):
    """The greatest common divisor, up to a factor."""
    while q:
        p, q = q, divided(p, q)[1]
    return p


def derivative(p):
    return trimmed([i * c for i, c in enumerate(p)][1:])


def square_free(p):
    d = derivative(p)
    return divided(p, common(p, d))[0] if d else p


def sturm(p):
    """The chain of a polynomial without double roots."""
    chain = [p, derivative(p)]
    while chain[-1]:
        chain.append([-c for c in divided(chain[-2], chain[-1])[1]])
    return chain[:-1]


def count(chain, low, high):
    """How many distinct roots there are in (low, high]."""
    signs = [[s for s in (sign(at(p, t)) for p in chain) if s] for t in (low, high)]
    before, after = (sum(a != b for a, b in zip(s, s[1:])) for s in signs)
    return before - after


class Root:
    """A root of `p` in [low, high]: low = high, or the only one in (low, high], and not high."""

    def __init__(self, p, low, high):
        self.p, self.low, self.high, self.after = p, low, high, sign(at(p, high))

    def halve(self):
        middle = (self.low + self.high) / 2
        here = sign(at(self.p, middle))
        if here == 0:
            self.low = self.high = middle
        elif here == self.after:
            self.high = middle
        else:
            self.low = middle

    def sign_of(self, q):
        """The exact sign of the polynomial q here."""
        for bits in (8, 40):
            narrow(self, bits)
            value = at(q, self.high)
            if abs(value) > (self.high - self.low) * sum(i * abs(c) for i, c in enumerate(q)) or self.low == self.high:
                return sign(value)  # between low and high it changes by less
        if not q or count(sturm(common(self.p, q)), self.low, self.high) > 0:
            return 0
        chain = sturm(square_free(q))
        while self.low != self.high and (at(q, self.low) == 0 or count(chain, self.low, self.high) > 0):
            self.halve()
        return sign(at(q, self.high))


def roots(p):
    """All roots of p in [0, 1], in order; p is not zero everywhere."""
    p = square_free(p)
    if len(p) < 2:
        return []
    found = [Root(p, Fraction(0), Fraction(0))] if p[0] == 0 else []
    chain, left, inner = sturm(p), [(Fraction(0), Fraction(1))], []
    while left:
        low, high = left.pop()
        many = count(chain, low, high)
        if many == 1 and (at(p, high) == 0 or at(p, low) != 0):
            inner.append(Root(p, high if at(p, high) == 0 else low, high))
        elif many > 0:
            middle = (low + high) / 2
            left += [(low, middle), (middle, high)]
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
    back = [[-c for c in p] for p in u]
    return minus(minus(times(u[0], v[0]), times(back[1], v[1])), times(back[2], v[2]))


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
        times_ = [Root([0, 1], Fraction(0), Fraction(0))]
        times_ += sorted((r for q in events for r in roots(q)), key=lambda r: r.high)
        hits = [r for r in times_ if meets(r, *p)]
        return min(hits, key=narrow, default=None)
    return next((r for r in times_ if meets(r, *p)), None)


def narrow(root, bits=40):
    """The root, to 2^-40: to be said, and to put roots into an order."""
    while root.high - root.low > Fraction(1, 1 << bits):
        root.halve()
    return root.high


def edge_through_face(edge, face):
    """Do they meet at rest?"""
    p = moving(list(edge) + list(face), list(edge) + list(face))
    still = Root([0, 1], Fraction(0), Fraction(0))
    side = lambda a, b, c, d: still.sign_of(dot(cross(way(a, b), way(a, c)), way(a, d)))
    e, f, a, b, c = p
    below, above = side(a, b, c, e), side(a, b, c, f)
    if below == 0 and in_face(still, e, a, b, c) or above == 0 and in_face(still, f, a, b, c):
        return True
    if below * above > 0 or below == above:
        return any(below == above == side(e, f, x, y) == 0 and edges_meet(still, e, f, x, y) for x, y in ((a, b), (b, c), (c, a)))
    turns = {side(e, f, x, y) for x, y in ((a, b), (b, c), (c, a))}
    return not {-1, 1} <= turns


# -- what floating point rejects: features are arrays, their corners x 3 last ------------------------------------------


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
            for la, ha, lb, hb in zip(low_a[mine].T, high_a[mine].T, low_b[theirs].T, high_b[theirs].T):
                meet &= (la[:, None] <= hb) & (lb <= ha[:, None])
            i, j = np.nonzero(meet)
            found.append(np.stack([mine[i], theirs[j]], 1))
    pairs = np.concatenate(found) if found else np.empty((0, 2), int)
    return pairs[pairs[:, 0] < pairs[:, 1]] if same else pairs


def crossed(u, v):
    return u[..., [1, 2, 0]] * v[..., [2, 0, 1]] - u[..., [2, 0, 1]] * v[..., [1, 2, 0]]


def dots(u, v):
    return np.einsum('...i,...i', u, v)


def length(v):
    return np.sqrt(dots(v, v))


def unit(v):
    size = length(v)[..., None]
    return np.divide(v, size, out=np.zeros_like(v), where=size > 1e-200)


def apart(a0, a1, b0, b1, distance=0.0):
    """Of n pairs of features (n x corners x 3 each, at both ends): which are certainly further apart than `distance`."""
    if not len(a0):
        return np.zeros(0, bool)
    a, b = (a0 + a1) / 2, (b0 + b1) / 2
    between = b.mean(1) - a.mean(1)
    sides = [f[:, i] - f[:, i - 1] for f in (a, b) for i in range(f.shape[1] if f.shape[1] > 2 else f.shape[1] - 1)]
    normals = [crossed(f[:, 1] - f[:, 0], f[:, 2] - f[:, 0]) for f in (a, b) if f.shape[1] == 3][:1]
    if a.shape[1] == 2 and b.shape[1] == 2:
        normals = [crossed(*sides)]
    likely = [*np.broadcast_to(np.eye(3)[:, None], (3, *between.shape)), *normals, between]
    along = [unit(side) for side in sides]
    others = sides + [between - dots(between, s)[:, None] * s for s in along] + [crossed(n, s) for n in normals for s in sides]
    limit = distance * (1 + ROOM) + ROOM * max(np.abs(x).max() for x in (a0, a1, b0, b1))
    result, left = np.zeros(len(a0), bool), np.arange(len(a0))
    for directions in (likely, others):
        n, gaps = unit(np.stack(directions, 1)[left]), []
        for pa, pb in ((a0, b0), (a1, b1)):
            u, v = (np.einsum('ndj,nij->ndi', n, p[left]) for p in (pa, pb))
            gaps.append(np.stack([v.min(2) - u.max(2), u.min(2) - v.max(2)]))
        result[left] = (np.minimum(*gaps) > limit).any((0, 2))
        left = left[~result[left]]
    return result


# -- how near, in doubles ----------------------------------------------------------------------------------------------


def point_to_line(p, a, b):
    u, v = b - a, p - a
    square = dots(u, u)
    t = dots(v, u) / np.where(square > 0, square, 1)
    return length(v - np.minimum(1, np.maximum(0, t))[..., None] * u)


def point_to_face(p, f):
    q, sides = p[..., None, :] - f, f[..., [1, 2, 0], :] - f
    best = point_to_line(p[..., None, :], f, f[..., [1, 2, 0], :]).min(-1)
    n = crossed(sides[..., 0, :], sides[..., 1, :])
    above = np.abs(dots(unit(n), q[..., 0, :]))
    within = (dots(crossed(sides, q), n[..., None, :]) > 0).all(-1)
    return np.where(within, np.minimum(above, best), best)


def line_to_line(p, q):
    best = np.minimum(*(point_to_line(x, y[..., :1, :], y[..., 1:, :]).min(-1) for x, y in ((p, q), (q, p))))
    u, v, w = p[..., 1, :] - p[..., 0, :], q[..., 1, :] - q[..., 0, :], p[..., 0, :] - q[..., 0, :]
    a, b, c, d, e = dots(u, u), dots(u, v), dots(v, v), dots(u, w), dots(v, w)
    area = a * c - b * b
    some = np.where(area > 1e-12 * a * c, area, 1)
    s, t = (b * e - c * d) / some, (a * e - b * d) / some
    within = (area > 1e-12 * a * c) & (s > 0) & (s < 1) & (t > 0) & (t < 1)
    return np.where(within, length(w + s[..., None] * u - t[..., None] * v), best)


def point_to_box(p, low, high):
    return length(np.maximum(0, np.maximum(low - p, p - high)))


def box_gap(a0, a1, b0, b1):
    """How far apart the boxes of all that the two sweep are."""
    (la, ha), (lb, hb) = ((np.concatenate(p, 1).min(1), np.concatenate(p, 1).max(1)) for p in ((a0, a1), (b0, b1)))
    return length(np.maximum(0, np.maximum(la - hb, lb - ha)))


def nearest(distance, starts, ends, reach):
    """Of pairs that move: which come nearer than the reach, the least distance found on the way, and when. It may be less, never more, in truth."""
    at_ = lambda t: distance(*[s[left] + t[..., None, None] * (e[left] - s[left]) for s, e in zip(starts, ends)])
    far = sum(length(e - s).max(1) for s, e in zip(starts, ends))  # a distance changes by no more
    left, when, room = np.arange(len(far)), np.full(len(far), 0.5), 0.5
    best = at_(when)
    for half in (1 / 2, 1 / 8, 1 / 32, 1 / 128, 1 / 512):
        near = best - room * far[left] < reach
        left, best, when = left[near], best[near], when[near]
        if not far[left].any():
            break
        t = np.clip(when + half * np.linspace(-1, 1, 9)[:, None], 0, 1)
        d = at_(t)
        least = d.argmin(0), np.arange(len(left))
        best, when, room = d[least], t[least], 1 / 16
    return left, best, when
