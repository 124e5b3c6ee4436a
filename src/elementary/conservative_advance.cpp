// How it works. Let w_ij(t) be the differences between a point of the one feature and a point of the other (VF: p-a,
// p-b, p-c; EE: c-a, c-b, d-a, d-b), linear in t. For any fixed vector n, n.(y-x) with x, y in the features is a convex
// combination of the n.w_ij(t), so the distance is at least min_ij n.w_ij(t) / |n|. Each n.w_ij is linear in t: if it
// exceeds d|n| at t and at t', it does so in between. From t, with n the shortest vector between the features at t,
// this allows a step that for translating features ends at the contact itself, and for others converges like Newton's
// method, from the safe side. (Advancement by speed alone needs millions of steps where features slide past each
// other; this one step.)
//
// Where a contact begins, with d > 0. As soon as the features are within the tolerance of the minimum separation d, a
// certain upper end is looked for. The two points that are nearest at t stay points of the features, so that the
// distance is at most that of the points, V(t) = w - a u - b v for fixed a, b. V is linear in t and its length convex:
// between two times it is at most what it is at one of them. The first time at which it has come down to d is the
// interval's end, if the bound from below says that nothing came closer than d - tolerance before; otherwise the
// nearest points are taken anew where it might have. So the distance is within the tolerance of d during the whole
// interval, or the interval is short. Features that part again, and were more than d apart all the while, have missed
// each other, and the search goes on.
//
// Rounding. eps = 2^-53, M = the largest absolute component of any difference vector at either end of the step. Times
// are multiples of 2^-52, so that 1-t is exact.
//   w_ij(t) = fl(fl(w0 (1-t)) + fl(w1 t)), w0 and w1 rounded differences: 3 factors (1+eps) on each term, so the error
//   is at most 3 eps M
//   n.w_ij(t), n taken as exact: 3 more factors: error <= 6 eps |n|_1 M
//   d |n| + margin: a sum of three squares and its root, 2.5 eps, a product and a sum: 4.5 eps d |n|. Where that
//   decides anything, d |n| is not above |n|_1 M, since no n.w_ij is. So n.w_ij > d |n| is certain beyond 10.5 eps
//   |n|_1 M
//                                                                                   (ADVANCE_SEPARATION, rounded up)
//   The connecting vectors w - beta u - gamma v, for exact beta, gamma in [0, 1] with a sum of 1: 3 eps M in w, 4 in
//   the products, one of M for each of two differences, which are vectors between points of the features again: 9 eps M
//   a component, 13 for edges. The dearest is (w - u) - s (v - u): 3 + 3 + 1 eps M, s times 3 + 3 + 2 + 2, and 2 for
//   the last two operations: 19. A second correction of s, and beta + gamma beyond 1 by a rounding, are worth 2 more.
//   So the true vector between those two points is at most sqrt(3) 21 eps M longer, and its computed length is off
//   by 2.5 eps sqrt(3) M: 40.8 eps M in all. The same holds for V at another time                   (ADVANCE_POINT,
//   rounded up)
// Underflow: lengths below SMALLEST are not trusted, and far above what underflowing products add.
#include "elementary/conservative_advance.h"

#include <algorithm>
#include <cmath>

#include "dccd/tolerances.h"

namespace dccd {
namespace conservative {
namespace {

constexpr double SMALLEST = tolerance::ADVANCE_SMALLEST_M, LARGEST = tolerance::ADVANCE_LARGEST_M;
using tolerance::ADVANCE_POINT, tolerance::ADVANCE_SEPARATION, tolerance::SEPARATION_SUM;

struct Vec {
  double x, y, z;
};
Vec operator-(const Vec& a, const Vec& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec cross(const Vec& a, const Vec& b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
Vec operator+(const Vec& a, const Vec& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vec operator*(double s, const Vec& a) { return {s * a.x, s * a.y, s * a.z}; }
double dot(const Vec& a, const Vec& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
double length(const Vec& a) { return std::sqrt(dot(a, a)); }
double sumOfAbs(const Vec& a) { return std::fabs(a.x) + std::fabs(a.y) + std::fabs(a.z); }
double largestOf(const Vec& a) { return std::max({std::fabs(a.x), std::fabs(a.y), std::fabs(a.z)}); }

/// A vector that moves linearly.
struct Moving {
  Vec t0, t1;
  Vec at(double t) const { return (1 - t) * t0 + t * t1; }
  double largest() const { return std::max(largestOf(t0), largestOf(t1)); }
};

Moving difference(const VertexMotion& to, const VertexMotion& from) {
  return {{to.t0[0] - from.t0[0], to.t0[1] - from.t0[1], to.t0[2] - from.t0[2]},
          {to.t1[0] - from.t1[0], to.t1[1] - from.t1[1], to.t1[2] - from.t1[2]}};
}

/// The pair as differences: u, v span the features, w[0] connects their origins, w[0..corners) are the w_ij.
struct Differences {
  Moving u, v, w[4];
  int corners;
  double largest;  ///< M
};

Differences differencesOf(PairKind kind, const Corners& x) {
  Differences r;
  if (kind == PairKind::VERTEX_FACE) {
    r.u = difference(*x[2], *x[1]);
    r.v = difference(*x[3], *x[1]);
    r.corners = 3;
    for (int i = 0; i < 3; ++i) r.w[i] = difference(*x[0], *x[i + 1]);
  } else {
    r.u = difference(*x[1], *x[0]);
    r.v = difference(*x[3], *x[2]);
    r.corners = 4;
    for (int i = 0; i < 4; ++i) r.w[i] = difference(*x[2 + i / 2], *x[i % 2]);
  }
  r.largest = std::max(r.u.largest(), r.v.largest());
  for (int i = 0; i < r.corners; ++i) r.largest = std::max(r.largest, r.w[i].largest());
  return r;
}

/// About the shortest vector from the one feature to the other: `vector` connects points of theirs (see ADVANCE_POINT).
/// `direction`, of length about 1, is the same, but as nearly perpendicular to what it connects as doubles allow: where
/// the features are close, the vector itself is mostly rounding error. The points are those for which it is w - a u - b
/// v.
struct Connection {
  Vec vector, direction;
  double square;
  double a, b;
};

Connection connection(const Vec& vector, const Vec& direction, double a, double b) {
  const double length_of_direction = length(direction);
  return {vector, length_of_direction > 0 ? (1 / length_of_direction) * direction : vector, dot(vector, vector), a, b};
}

/// From the segment 0..u to the point w; the place on the segment is left in `a`.
Connection fromSegment(const Vec& w, const Vec& u) {
  const double uu = dot(u, u), s = dot(u, w) / uu;
  if (!(s > 0)) return connection(w, w, 0, 0);  // also where u = 0
  if (s >= 1) return connection(w - u, w - u, 1, 0);
  const Vec n = w - s * u;
  const double correction = dot(n, u) / uu;
  const Vec corrected = n - correction * u;
  return connection(corrected, corrected, s + correction, 0);
}

Connection at(double a, double b, Connection c) {
  c.a = a;
  c.b = b;
  return c;
}

Connection shorter(const Connection& a, const Connection& b) { return b.square < a.square ? b : a; }

/// Inside both features: perpendicular to u and v, on the side of w.
Connection inside(const Vec& vector, const Vec& normal, const Vec& w, double a, double b) {
  return connection(vector, dot(normal, w) < 0 ? -1 * normal : normal, a, b);
}

/// Cross products of vectors at less than this angle squared are mostly rounding error.
using tolerance::ADVANCE_PARALLEL;

/// From the triangle 0, u, v to the point w.
Connection fromTriangle(const Vec& u, const Vec& v, const Vec& w) {
  const Vec n = cross(u, v);  // not the Gram matrix: its determinant loses twice as many digits
  const double nn = dot(n, n), beta = dot(cross(w, v), n) / nn, gamma = dot(cross(u, w), n) / nn;
  const bool is_inside = beta >= 0 && gamma >= 0 && beta + gamma <= 1;
  const Connection face = inside((w - beta * u) - gamma * v, n, w, beta, gamma);
  if (is_inside && nn > ADVANCE_PARALLEL * (dot(u, u) * dot(v, v))) return face;
  const Connection on_u = fromSegment(w, u), on_v = fromSegment(w, v), across = fromSegment(w - u, v - u);
  const Connection border = shorter(shorter(on_u, at(0, on_v.a, on_v)), at(1 - across.a, across.a, across));
  return is_inside ? shorter(border, face) : border;
}

Connection reversed(const Connection& c) { return {-1 * c.vector, -1 * c.direction, c.square, c.a, c.b}; }

/// From the segment 0..u to the segment w..w+v.
Connection betweenSegments(const Vec& u, const Vec& v, const Vec& w) {
  const Vec n = cross(u, v);
  const double nn = dot(n, n), s = dot(cross(w, v), n) / nn, r = dot(cross(w, u), n) / nn;
  const bool is_inside = s >= 0 && s <= 1 && r >= 0 && r <= 1;
  const Connection crossing = inside((w - s * u) + r * v, n, w, s, -r);
  if (is_inside && nn > ADVANCE_PARALLEL * (dot(u, u) * dot(v, v))) return crossing;
  const Connection c = fromSegment(w, u), d = fromSegment(w + v, u);
  const Connection a = reversed(fromSegment(-1 * w, v)), b = reversed(fromSegment(u - w, v));
  const Connection border = shorter(shorter(c, at(d.a, -1, d)), shorter(at(0, -a.a, a), at(1, -b.a, b)));
  return is_inside ? shorter(border, crossing) : border;
}

/// The n.w_ij: at some time and at the end of the step.
struct Separations {
  double now[4], end[4];
  int corners;
  double least() const { return *std::min_element(now, now + corners); }
};

Separations separationsAt(const Differences& pair, const Vec& n, double t) {
  Separations r;
  r.corners = pair.corners;
  for (int i = 0; i < pair.corners; ++i) {
    r.now[i] = dot(n, pair.w[i].at(t));
    r.end[i] = dot(n, pair.w[i].t1);
  }
  return r;
}

/// min_ij n.w_ij(t).
double leastSeparation(const Differences& pair, const Vec& n, double t) {
  double least = dot(n, pair.w[0].at(t));
  for (int i = 1; i < pair.corners; ++i) least = std::min(least, dot(n, pair.w[i].at(t)));
  return least;
}

double onGrid(double t) { return std::floor(t / tolerance::TIME_GRID) * tolerance::TIME_GRID; }

/// About the time, not after 1, at which the first n.w_ij falls to `target`, going on from t.
double timeOf(const Separations& from, double t, double target) {
  double share = 1;  // of what is left of the step
  for (int i = 0; i < from.corners; ++i) {
    if (from.end[i] < target) {
      share = std::min(share, std::max(0.0, (from.now[i] - target) / (from.now[i] - from.end[i])));
    }
  }
  return share < 1 ? onGrid(t + share * (1 - t)) : 1;
}

/// The vector between two points of the features that are the nearest at some time, as it moves from then on.
struct Path {
  Vec start, change;  ///< at that time; from then to the end of the step

  /// About the share of what is left of the step after which it is first (`first`) or last of `length` long; 1 where it
  /// is not within the step.
  double shareAt(double length, bool first) const {
    const double a = dot(change, change), b = dot(start, change), c = dot(start, start) - length * length;
    const double discriminant = b * b - a * c;
    if (!(discriminant >= 0)) return 1;
    const double root = std::sqrt(discriminant);
    // c / (-b + root) is the smaller root without cancellation where b < 0, -c / (b + root) the larger where b > 0.
    const double share = first ? (b < 0 ? c / (root - b) : 1) : (b > 0 ? -c / (b + root) : (root - b) / a);
    return share >= 0 && share < 1 ? share : 1;
  }
};

ElementaryResult resultOf(Verdict verdict, double lower, double upper) {
  return {lower, upper, verdict, Tier::BERNSTEIN};
}

constexpr int STEPS_PER_LOOK_AT_THE_CLOCK = 64;

class Advancement {
 public:
  Advancement(PairKind kind, const Corners& corners, const Limits& limits)
      : vertex_face_(kind == PairKind::VERTEX_FACE),
        limits_(limits),
        near_((limits.minimum_separation_m + limits.tolerance_m) * (1 - SEPARATION_SUM)),
        pair_(differencesOf(kind, corners)),
        point_error_(ADVANCE_POINT * pair_.largest + SMALLEST) {}

  ElementaryResult run() {
    if (!(pair_.largest <= LARGEST) || !(near_ <= LARGEST)) return resultOf(Verdict::UNDECIDED, 0, 1);
    double t = 0, missed_until = -1;
    while (goesOn()) {
      const Connection shortest = connectionAt(t);
      if (t > missed_until && isNear(shortest.vector)) {
        if (limits_.minimum_separation_m == 0) return resultOf(Verdict::CONTACT, t, 1);
        const Approach approach = follow(t, shortest);
        if (approach.verdict == Verdict::UNDECIDED) break;
        if (approach.verdict == Verdict::CONTACT) return resultOf(Verdict::CONTACT, t, approach.end);
        if (approach.end >= 1) return resultOf(Verdict::NO_CONTACT, 1, 1);
        missed_until = t = approach.end;
        continue;
      }
      if (!(length(shortest.vector) > SMALLEST)) break;
      const Bound bound = boundAlong(shortest.direction, limits_.minimum_separation_m);
      // Strictly more than d|n| for certain, at t and at the next time, and so in between.
      const Separations from = separationsAt(pair_, shortest.direction, t);
      if (!(from.least() > bound.least)) break;
      const double next =
          timeOf(from, t, bound.least + std::max(0.25 * limits_.tolerance_m * bound.length, 3 * bound.error));
      if (!(next > t) || !(leastSeparation(pair_, shortest.direction, next) > bound.least)) break;
      if (next >= 1) return resultOf(Verdict::NO_CONTACT, 1, 1);
      t = next;
    }
    return resultOf(Verdict::UNDECIDED, t, 1);
  }

 private:
  /// What came of features that are within the tolerance of d. CONTACT: they come certainly within d at the end, or
  /// doubles cannot tell until then. NO_CONTACT: they were certainly more than d apart to the end, where they part.
  struct Approach {
    double end;
    Verdict verdict;
  };

  bool goesOn() {
    const bool late = limits_.deadline && steps_ % STEPS_PER_LOOK_AT_THE_CLOCK == 0 && limits_.deadline->isOver();
    return steps_++ < limits_.max_steps && !late;
  }

  /// What n.w_ij must exceed for the features to be certainly more than some distance apart.
  struct Bound {
    double least, length, error;
  };

  Bound boundAlong(const Vec& n, double distance) const {
    const double n_length = length(n), error = ADVANCE_SEPARATION * sumOfAbs(n) * pair_.largest;
    return {distance * n_length + error, n_length, error};
  }

  Connection connectionAt(double t) const {
    const Vec u = pair_.u.at(t), v = pair_.v.at(t), w = pair_.w[0].at(t);
    return vertex_face_ ? fromTriangle(u, v, w) : betweenSegments(u, v, w);
  }

  Vec pathAt(const Connection& points, double t) const {
    return (pair_.w[0].at(t) - points.a * pair_.u.at(t)) - points.b * pair_.v.at(t);
  }

  /// What the distance between two points is certainly not above.
  double atMost(const Vec& vector) const { return length(vector) + point_error_; }
  bool isNear(const Vec& vector) const { return atMost(vector) <= near_; }

  /// Goes on from `t`, at which the features are near, as long as they certainly stay so and are not within d.
  Approach follow(double t, Connection points) {
    const double d = limits_.minimum_separation_m;
    const double floor = std::max(0.0, (d - limits_.tolerance_m) * (1 + SEPARATION_SUM));
    const double slack = 2 * point_error_ + 4 * SEPARATION_SUM * near_;
    bool apart = true;
    const auto parted = [&] { return Approach{t, apart ? Verdict::NO_CONTACT : Verdict::CONTACT}; };
    do {  // the first step is that of run()
      if (atMost(points.vector) <= d) return {t, Verdict::CONTACT};
      const Path path = {points.vector, pathAt(points, 1) - points.vector};
      if (!isNear(points.vector)) return parted();
      if (dot(path.start, path.change) >= 0 && atMost(points.vector) > near_ - 2 * slack) return parted();
      const Separations from = separationsAt(pair_, points.direction, t);
      const Bound d_bound = boundAlong(points.direction, d), floor_bound = boundAlong(points.direction, floor);
      // The points come within d, part, or others may come too close: whichever is first.
      const double reach = d > slack ? path.shareAt(d - slack, true) : 1, leave = path.shareAt(near_ - slack, false);
      const double fall = floor > 0 ? timeOf(from, t, 0.5 * (d_bound.least + floor_bound.least)) : 1;
      const double next = std::min(onGrid(t + std::min(reach, leave) * (1 - t)), fall);
      const double separation = leastSeparation(pair_, points.direction, next);
      const Vec vector = pathAt(points, next);
      if (!(next > t) || !isNear(vector) || (floor > 0 && !(separation > floor_bound.least))) break;
      apart = apart && from.least() > d_bound.least && separation > d_bound.least;
      t = next;
      if (atMost(vector) <= d) return {t, Verdict::CONTACT};
      if (t >= 1) return parted();
      points = connectionAt(t);
    } while (goesOn());
    return {t, Verdict::UNDECIDED};
  }

  bool vertex_face_;
  Limits limits_;
  double near_;
  Differences pair_;
  double point_error_;
  int steps_ = 0;
};

}  // namespace

ElementaryResult advance(PairKind kind, const Corners& corners, const Limits& limits) {
  return Advancement(kind, corners, limits).run();
}

double closingSpeed(PairKind kind, const Corners& corners) {
  const Differences pair = differencesOf(kind, corners);
  double speed = 0;
  for (int i = 0; i < pair.corners; ++i) speed = std::max(speed, length(pair.w[i].t1 - pair.w[i].t0));
  return speed + ADVANCE_POINT * pair.largest + SMALLEST;
}

}  // namespace conservative
}  // namespace dccd
