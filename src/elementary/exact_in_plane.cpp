// Pairs in a plane across an axis, or at 45 degrees to two: layers on a table, a towel that is drawn over another one.
// The four points have one coordinate in common, or two that are equal but for a sign: f is 0, and all happens in
// two others, where these doubles tell what meets, and when.
//
// Sides. On which side of the line ab a point p is, is the sign of (b - a) x (p - a) = c0 s^2 + c1 s t + c2 t^2, with
// s = 1 - t. At t = 0, when all sides are certain:
//   VF  no side of an edge's line is strictly opposite to another one: the vertex is in the face. If all were 0 and the
//       face not flat, its area, their sum, would be 0.
//   EE  each edge's ends are not strictly on one side of the other's line: edges that are not parallel meet. Both ends
//       of one of two parallel edges are equally far to one side, so that all sides are 0.
//   all 0: points on one line, or in one place. They meet where their bounds do.
// Later. What first meets in a plane, if not at t = 0, does so with a vertex on an edge: each vertex is asked for each
// edge. c0 > 0 > c2 has one root by Descartes' rule of signs, c0, c1 > 0 = c2 the root 1, c0, c1, c2 > 0 none; so has
// c0 = 0 < c1, c2 after t = 0, where the vertex was beside the edge. The root's cell is certain where the sides at its
// ends are opposite. The vertex is then on the edge where along one axis it certainly keeps between the edge's ends.
//
// Rounding, u = 2^-53. A difference of coordinates has one factor (1 + d), |d| <= u, and is 0 only where they are
// equal. A coefficient has at most 5 on each of its products: 2 differences, the product, at most 2 sums. c0 s^2 + c1 s
// t + c2 t^2 has at most 9, for s is exact: 2 more products, at most 2 sums. So an error is at most 9u (1 + 2^-40)
// times the sum of the terms' absolute values, which is off by less. Twice ORIENTATION_2D, 10u, covers it. Fewer than
// 40 operations underflow by at most 2^-1075 each, later multiplied by at most 1. What overflows compares with nothing.
#include <algorithm>
#include <cmath>

#include "dccd/tolerances.h"
#include "elementary/exact_tiers.h"

namespace dccd {
namespace exact {
namespace {

constexpr std::int64_t NEVER = -1, NOT_KNOWN = -2;
constexpr int UNCERTAIN = 2;  ///< beside the signs -1, 0, 1

/// A number, and the sum of the absolute values of the terms that it was made of.
struct Sum {
  double value = 0, size = 0;

  int sign() const {
    const double error = 2 * tolerance::ORIENTATION_2D * size + tolerance::QUADRATIC_UNDERFLOW;
    return value > error ? 1 : value < -error ? -1 : UNCERTAIN;
  }
};

struct Vector {
  double x, y;
};

/// a x b. `more`: a sum to which it is added.
Sum cross(const Vector& a, const Vector& b, const Sum& more = {}) {
  const double one = a.x * b.y, other = a.y * b.x;
  return {more.value + (one - other), more.size + (std::fabs(one) + std::fabs(other))};
}

/// Whether a x b is 0 because factors are.
bool vanishes(const Vector& a, const Vector& b) { return (a.x == 0 || b.y == 0) && (a.y == 0 || b.x == 0); }

struct Corners {
  int p, a, b;  ///< a point, and the ends of an edge
};
constexpr Corners FACE[3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}};
constexpr Corners EDGES[4] = {{0, 2, 3}, {1, 2, 3}, {2, 0, 1}, {3, 0, 1}};

/// The pair as it is seen along an axis.
class FlatPair {
 public:
  FlatPair(PairKind kind, const PairMotion& pair, int axis)
      : vertex_face_(kind == PairKind::VERTEX_FACE), corners_(vertex_face_ ? FACE : EDGES) {
    const int i = axis == 0 ? 1 : 0, j = axis == 2 ? 1 : 2;
    for (int time = 0; time < 2; ++time) {
      for (int p = 0; p < 4; ++p) x_[time][p] = {pair.x[time][p][i], pair.x[time][p][j]};
    }
  }

  /// Whether the features meet at t = 0: 1, 0, or UNCERTAIN.
  int meetAtStart() const {
    int side[4] = {};
    for (int i = 0; i < count(); ++i) {
      const Vector ab = between(0, corners_[i].a, corners_[i].b), ap = between(0, corners_[i].a, corners_[i].p);
      side[i] = vanishes(ab, ap) ? 0 : cross(ab, ap).sign();
    }
    const auto opposite = [&](int i, int j) { return side[i] == -side[j] && side[i] != 0; };
    const auto same = [&](int i, int j) { return side[i] == side[j] && (side[i] == 1 || side[i] == -1); };
    if (vertex_face_ ? opposite(0, 1) || opposite(1, 2) || opposite(2, 0) : same(0, 1) || same(2, 3)) return 0;
    if (std::count(side, side + count(), UNCERTAIN) != 0) return UNCERTAIN;
    return std::count(side, side + count(), 0) < count() || boundsMeetAtStart();
  }

  /// The cell of the first contact, given that the features are apart at t = 0; 2^toc_bits for t = 1.
  std::int64_t cellOfContact(int toc_bits) const {
    std::int64_t first = NEVER;
    for (int i = 0; i < count(); ++i) {
      const std::int64_t cell = cellOnEdge(corners_[i], toc_bits);
      if (cell == NOT_KNOWN) return NOT_KNOWN;
      if (cell != NEVER && (first == NEVER || cell < first)) first = cell;
    }
    return first;
  }

 private:
  int count() const { return vertex_face_ ? 3 : 4; }
  Vector between(int time, int from, int to) const {
    return {x_[time][to].x - x_[time][from].x, x_[time][to].y - x_[time][from].y};
  }

  bool boundsMeetAtStart() const {
    const Vector* x = x_[0];
    const int first_points = vertex_face_ ? 1 : 2;
    const auto meet = [&](double Vector::*axis) {
      const auto less = [&](const Vector& a, const Vector& b) { return a.*axis < b.*axis; };
      const auto [low, high] = std::minmax_element(x, x + first_points, less);
      const auto [other_low, other_high] = std::minmax_element(x + first_points, x + 4, less);
      return *low.*axis <= *other_high.*axis && *other_low.*axis <= *high.*axis;
    };
    return meet(&Vector::x) && meet(&Vector::y);
  }

  std::int64_t cellOnEdge(const Corners& of, int toc_bits) const {
    const Vector ab[2] = {between(0, of.a, of.b), between(1, of.a, of.b)};
    const Vector ap[2] = {between(0, of.a, of.p), between(1, of.a, of.p)};
    const Sum c[3] = {cross(ab[0], ap[0]), cross(ab[0], ap[1], cross(ab[1], ap[0])), cross(ab[1], ap[1])};
    const int start = vanishes(ab[0], ap[0]) ? 0 : c[0].sign(), end = vanishes(ab[1], ap[1]) ? 0 : c[2].sign();
    const int middle = c[1].sign();
    if (start == UNCERTAIN || end == UNCERTAIN) return NOT_KNOWN;
    if (start * end < 0) return cellOfRoot(of, c, start, toc_bits);
    if (middle == UNCERTAIN || middle != (start == 0 ? end : start)) return NOT_KNOWN;
    return end == 0 && isBetweenAtEnd(of) ? std::int64_t{1} << toc_bits : NEVER;
  }

  /// Point p being on the line ab at t = 1.
  bool isBetweenAtEnd(const Corners& of) const {
    const Vector* x = x_[1];
    const auto between = [&](double Vector::*axis) {
      const auto [low, high] = std::minmax(x[of.a].*axis, x[of.b].*axis);
      return x[of.p].*axis >= low && x[of.p].*axis <= high;
    };
    return between(&Vector::x) && between(&Vector::y);
  }

  /// c has the sign `start` at t = 0, the opposite one at t = 1, and one root.
  std::int64_t cellOfRoot(const Corners& of, const Sum (&c)[3], int start, int toc_bits) const {
    const auto cells = static_cast<double>(std::int64_t{1} << toc_bits);
    const double q0 = std::fabs(c[0].value), q1 = start * c[1].value, q2 = std::fabs(c[2].value);
    const double root = std::sqrt(q1 * q1 + 4 * q0 * q2);
    const double estimate = q1 >= 0 ? (q1 + root) / ((q1 + root) + 2 * q2) : 2 * q0 / (2 * q0 + (root - q1));
    if (!(estimate >= 0 && estimate <= 1)) return NOT_KNOWN;
    double k = std::min(std::floor(estimate * cells), cells - 1);
    for (int i = 0; i < 4 && k >= 0 && k < cells; ++i) {
      const int low = sideAt(c, k / cells), high = sideAt(c, (k + 1) / cells);
      if (low == start && high == -start)
        return isBetween(of, k / cells, (k + 1) / cells, static_cast<std::int64_t>(k));
      if (low == UNCERTAIN || high == UNCERTAIN) return NOT_KNOWN;
      k += high == start ? 1 : -1;
    }
    return NOT_KNOWN;
  }

  /// At multiples of 2^-52.
  static int sideAt(const Sum (&c)[3], double t) {
    const double s = 1 - t;
    const auto at = [&](double c0, double c1, double c2) { return (c0 * s * s + c1 * (s * t)) + c2 * t * t; };
    return Sum{at(c[0].value, c[1].value, c[2].value), at(c[0].size, c[1].size, c[2].size)}.sign();
  }

  /// `cell` where p, on the line ab at some time from `low` to `high`, is certainly on the edge ab then.
  std::int64_t isBetween(const Corners& of, double low, double high, std::int64_t cell) const {
    for (const auto axis : {&Vector::x, &Vector::y}) {
      const auto side = [&](int from) {  // of p
        const double start = between(0, from, of.p).*axis, end = between(1, from, of.p).*axis;
        const auto at = [&](double t) {
          const double one = start * (1 - t), other = end * t;
          return Sum{one + other, std::fabs(one) + std::fabs(other)}.sign();
        };
        const int sign = at(low);
        return sign == at(high) ? sign : UNCERTAIN;
      };
      const int a = side(of.a), b = side(of.b);
      if (a != UNCERTAIN && b != UNCERTAIN) return a == b ? NEVER : cell;
    }
    return NOT_KNOWN;
  }

  bool vertex_face_;
  const Corners* corners_;
  Vector x_[2][4];
};

/// Across an axis; or, where `other` is not -1, where two coordinates are equal but for a sign.
struct Plane {
  int axis, other;  ///< seen along `axis` nothing of it is lost
  double sign;

  bool holds(const PairMotion& pair, int time) const {
    const auto& x = pair.x[time];
    return std::all_of(
        x, x + 4, [&](const double(&p)[3]) { return other < 0 ? p[axis] == x[0][axis] : p[axis] == sign * p[other]; });
  }
};
constexpr Plane PLANES[] = {{0, -1, 0}, {1, -1, 0}, {2, -1, 0}, {0, 1, 1}, {0, 1, -1},
                            {0, 2, 1},  {0, 2, -1}, {1, 2, 1},  {1, 2, -1}};

}  // namespace

ElementaryResult decideInPlane(PairKind kind, const PairMotion& pair, int toc_bits) {
  int axis = -1;
  bool stays = false;
  for (const Plane& plane : PLANES) {
    if (stays || !plane.holds(pair, 0)) continue;
    axis = plane.axis;
    stays = plane.holds(pair, 1);
  }
  if (axis < 0) return undecided(Tier::DOUBLE_DOUBLE);
  const FlatPair flat(kind, pair, axis);
  const int meet = flat.meetAtStart();
  if (meet == 1) return contactInCell(0, toc_bits, Tier::DOUBLE_DOUBLE);
  if (meet == UNCERTAIN || !stays) return undecided(Tier::DOUBLE_DOUBLE);
  const std::int64_t cell = flat.cellOfContact(toc_bits);
  if (cell == NOT_KNOWN) return undecided(Tier::DOUBLE_DOUBLE);
  return cell == NEVER ? noContact(Tier::DOUBLE_DOUBLE) : contactInCell(cell, toc_bits, Tier::DOUBLE_DOUBLE);
}

}  // namespace exact
}  // namespace dccd
