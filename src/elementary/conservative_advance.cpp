// How it works. Let w_ij(t) be the differences between a point of the one feature and a point of the other (VF: p-a,
// p-b, p-c; EE: c-a, c-b, d-a, d-b), linear in t. For any fixed vector n, n.(y-x) with x, y in the features is a convex
// combination of the n.w_ij(t), so the distance is at least min_ij n.w_ij(t) / |n|. Each n.w_ij is linear in t: if it
// exceeds d|n| at t and at t', it does so in between. From t, with n the shortest vector between the features at t,
// this allows a step that for translating features ends at the contact itself, and for others converges like Newton's
// method, from the safe side. (Advancement by speed alone needs millions of steps where features slide past each
// other; this one step.)
//
// Rounding. eps = 2^-53, M = the largest absolute component of any difference vector at either end of the step. Times
// are multiples of 2^-52, so that 1-t is exact.
//   w_ij(t) = fl(fl(w0 (1-t)) + fl(w1 t)), w0 and w1 rounded differences: 3 factors (1+eps) on each term, so the error
//   is at most 3 eps M
//   n.w_ij(t), n taken as exact: 3 more factors: error <= 6 eps |n|_1 M             (SEPARATION_ERROR, rounded up)
//   |n|: sqrt of a sum of three squares, at most 3 eps relative                     (LENGTH_ERROR, rounded up)
//   The connecting vectors n = w - beta u - gamma v and (w - u) - s (v - u), for exact beta, gamma, s: at most 6
//   factors on each of at most four terms: 24 eps M a component; a second correction of s, and beta + gamma beyond 1,
//   are worth a few eps M more. So the true vector between those two points is at most |n| (1 + 3 eps) +
//   sqrt(3) 30 eps M long
//                                                                                   (POINT_ERROR, rounded up)
// Underflow: lengths below SMALLEST are not trusted, and far above what underflowing products add.
#include "elementary/conservative_advance.h"

#include <algorithm>
#include <cmath>

#include "dccd/tolerances.h"

namespace dccd {
namespace conservative {
namespace {

constexpr double SMALLEST = tolerance::ADVANCE_SMALLEST_M, LARGEST = tolerance::ADVANCE_LARGEST_M;
constexpr double SEPARATION_ERROR = tolerance::ADVANCE_SEPARATION, LENGTH_ERROR = tolerance::ADVANCE_LENGTH,
                 POINT_ERROR = tolerance::ADVANCE_POINT;

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

/// About the shortest vector from the one feature to the other: `vector` connects points of theirs (see POINT_ERROR).
/// `direction`, of length about 1, is the same, but as nearly perpendicular to what it connects as doubles allow: where
/// the features are close, the vector itself is mostly rounding error.
struct Connection {
  Vec vector, direction;
  double square;
};

Connection connection(const Vec& vector, const Vec& direction) {
  const double length_of_direction = length(direction);
  return {vector, length_of_direction > 0 ? (1 / length_of_direction) * direction : vector, dot(vector, vector)};
}

/// From the segment 0..u to the point w.
Connection fromSegment(const Vec& w, const Vec& u) {
  const double uu = dot(u, u), s = dot(u, w) / uu;
  if (!(s > 0)) return connection(w, w);  // also where u = 0
  if (s >= 1) return connection(w - u, w - u);
  Vec n = w - s * u;
  n = n - (dot(n, u) / uu) * u;
  return connection(n, n);
}

Connection shorter(const Connection& a, const Connection& b) { return b.square < a.square ? b : a; }

/// Inside both features: perpendicular to u and v, on the side of w.
Connection inside(const Vec& vector, const Vec& normal, const Vec& w) {
  return connection(vector, dot(normal, w) < 0 ? -1 * normal : normal);
}

/// Cross products of vectors at less than this angle squared are mostly rounding error.
using tolerance::ADVANCE_PARALLEL;

/// From the triangle 0, u, v to the point w.
Connection fromTriangle(const Vec& u, const Vec& v, const Vec& w) {
  const Vec n = cross(u, v);  // not the Gram matrix: its determinant loses twice as many digits
  const double nn = dot(n, n), beta = dot(cross(w, v), n) / nn, gamma = dot(cross(u, w), n) / nn;
  const bool is_inside = beta >= 0 && gamma >= 0 && beta + gamma <= 1;
  const Connection face = inside((w - beta * u) - gamma * v, n, w);
  if (is_inside && nn > ADVANCE_PARALLEL * (dot(u, u) * dot(v, v))) return face;
  const Connection border = shorter(shorter(fromSegment(w, u), fromSegment(w, v)), fromSegment(w - u, v - u));
  return is_inside ? shorter(border, face) : border;
}

Connection reversed(const Connection& c) { return {-1 * c.vector, -1 * c.direction, c.square}; }

/// From the segment 0..u to the segment w..w+v.
Connection betweenSegments(const Vec& u, const Vec& v, const Vec& w) {
  const Vec n = cross(u, v);
  const double nn = dot(n, n), s = dot(cross(w, v), n) / nn, r = dot(cross(w, u), n) / nn;
  const bool is_inside = s >= 0 && s <= 1 && r >= 0 && r <= 1;
  const Connection crossing = inside((w - s * u) + r * v, n, w);
  if (is_inside && nn > ADVANCE_PARALLEL * (dot(u, u) * dot(v, v))) return crossing;
  const Connection border = shorter(shorter(fromSegment(w, u), fromSegment(w + v, u)),
                                    reversed(shorter(fromSegment(-1 * w, v), fromSegment(u - w, v))));
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

/// About the time, not after 1, at which the first n.w_ij falls to `target`, going on from t.
double timeOf(const Separations& from, double t, double target) {
  double share = 1;  // of what is left of the step
  for (int i = 0; i < from.corners; ++i) {
    if (from.end[i] < target) {
      share = std::min(share, std::max(0.0, (from.now[i] - target) / (from.now[i] - from.end[i])));
    }
  }
  return share < 1 ? std::floor((t + share * (1 - t)) * 0x1p52) * 0x1p-52 : 1;
}

ElementaryResult resultOf(Verdict verdict, double t) {
  ElementaryResult result;
  result.verdict = verdict;
  result.toc_lower = t;
  result.tier = Tier::BERNSTEIN;
  return result;
}

}  // namespace

constexpr int STEPS_PER_LOOK_AT_THE_CLOCK = 64;

ElementaryResult advance(PairKind kind, const Corners& corners, const Limits& limits) {
  const Differences pair = differencesOf(kind, corners);
  const double near = limits.minimum_separation_m + limits.tolerance_m;
  if (!(pair.largest <= LARGEST) || !(near <= LARGEST)) return resultOf(Verdict::UNDECIDED, 0);
  double t = 0;
  for (int step = 0; step < limits.max_steps; ++step) {
    if (limits.deadline && step % STEPS_PER_LOOK_AT_THE_CLOCK == 0 && limits.deadline->isOver()) break;
    const Vec u = pair.u.at(t), v = pair.v.at(t), w = pair.w[0].at(t);
    const Connection shortest = kind == PairKind::VERTEX_FACE ? fromTriangle(u, v, w) : betweenSegments(u, v, w);
    const double distance = length(shortest.vector) * (1 + LENGTH_ERROR);
    if (distance + (POINT_ERROR * pair.largest + SMALLEST) <= near * (1 - LENGTH_ERROR)) {
      return resultOf(Verdict::CONTACT, t);
    }
    if (!(distance > SMALLEST)) break;
    const Vec& n = shortest.direction;
    const double n_length = length(n) * (1 + LENGTH_ERROR);
    // Strictly more than d|n| for certain, at t and at the next time, and so in between.
    const double error = SEPARATION_ERROR * sumOfAbs(n) * pair.largest * (1 + LENGTH_ERROR);
    const double bound = limits.minimum_separation_m * n_length * (1 + LENGTH_ERROR) + error;
    const Separations from = separationsAt(pair, n, t);
    if (!(from.least() > bound)) break;
    const double aim = bound + std::max(0.25 * limits.tolerance_m * n_length, 3 * error);
    const double next = timeOf(from, t, aim);
    if (!(next > t) || !(leastSeparation(pair, n, next) > bound)) break;
    if (next >= 1) return resultOf(Verdict::NO_CONTACT, 1);
    t = next;
  }
  return resultOf(Verdict::UNDECIDED, t);
}

double closingSpeed(PairKind kind, const Corners& corners) {
  const Differences pair = differencesOf(kind, corners);
  double speed = 0;
  for (int i = 0; i < pair.corners; ++i) speed = std::max(speed, length(pair.w[i].t1 - pair.w[i].t0));
  return speed * (1 + LENGTH_ERROR) + POINT_ERROR * pair.largest + SMALLEST;
}

}  // namespace conservative
}  // namespace dccd
