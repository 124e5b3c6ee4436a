#include "oracle/oracle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace dccd {
namespace test {
namespace {

using PolynomialVector = std::array<Polynomial, 3>;

Polynomial dot(const PolynomialVector& a, const PolynomialVector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

PolynomialVector cross(const PolynomialVector& a, const PolynomialVector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

PolynomialVector plus(const PolynomialVector& a, const PolynomialVector& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}

/// The paths of the four points, all coordinates multiplied by one integer that leaves no fractions.
std::array<PolynomialVector, 4> integerPaths(const PairMotion& pair) {
  Integer scale = 1;
  for (const auto& points : pair.x) {
    for (const auto& point : points) {
      for (double value : point) scale = std::max(scale, denominator(Rational(value)));  // all are powers of two
    }
  }
  std::array<PolynomialVector, 4> paths;
  for (int point = 0; point < 4; ++point) {
    for (int axis = 0; axis < 3; ++axis) {
      const Integer at_t0 = numerator(Rational(Rational(pair.x[0][point][axis]) * scale));
      const Integer at_t1 = numerator(Rational(Rational(pair.x[1][point][axis]) * scale));
      paths[point][axis] = Polynomial({at_t0, at_t1 - at_t0});
    }
  }
  return paths;
}

PolynomialVector minus(const PolynomialVector& a, const PolynomialVector& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

std::vector<PolynomialVector> minkowskiDifference(PairKind kind, const PairMotion& pair) {
  const std::array<PolynomialVector, 4> p = integerPaths(pair);
  if (kind == PairKind::VERTEX_FACE) return {minus(p[1], p[0]), minus(p[2], p[0]), minus(p[3], p[0])};
  if (kind != PairKind::EDGE_EDGE) throw std::invalid_argument("the oracle knows vertex-face and edge-edge only");
  return {minus(p[0], p[2]), minus(p[0], p[3]), minus(p[1], p[2]), minus(p[1], p[3])};
}

/// Is the origin on the side uv of the hull?
struct SideTest {
  Polynomial collinear, between;  // |u x v|^2 and u.v
  SideTest(const PolynomialVector& u, const PolynomialVector& v) : between(dot(u, v)) {
    const PolynomialVector normal = cross(u, v);
    collinear = dot(normal, normal);
  }
  bool holdsAt(Root& time) const { return time.signOf(between) <= 0 && time.signOf(collinear) == 0; }
  void appendTo(std::vector<Polynomial>& events) const { events.insert(events.end(), {collinear, between}); }
};

/// Is the origin in the triangle uvw, the triangle's area not being zero?
struct TriangleTest {
  Polynomial coplanar, area, turns[3];
  TriangleTest(const PolynomialVector& u, const PolynomialVector& v, const PolynomialVector& w) {
    const PolynomialVector uv = cross(u, v), vw = cross(v, w), wu = cross(w, u);
    const PolynomialVector normal = plus(plus(uv, vw), wu);
    coplanar = dot(u, vw);
    area = dot(normal, normal);
    turns[0] = dot(uv, vw);
    turns[1] = dot(vw, wu);
    turns[2] = dot(wu, uv);
  }
  bool holdsAt(Root& time) const {
    return time.signOf(coplanar) == 0 && time.signOf(area) != 0 &&
           std::all_of(turns, turns + 3, [&time](const Polynomial& turn) { return time.signOf(turn) >= 0; });
  }
  void appendTo(std::vector<Polynomial>& events) const {
    events.insert(events.end(), {coplanar, area, turns[0], turns[1], turns[2]});
  }
};

/// The convex hull of moving points, asked for the origin.
class MovingHull {
 public:
  explicit MovingHull(std::vector<PolynomialVector> points)
      : points_(std::move(points)), coplanar_(dot(points_[0], cross(points_[1], points_[2]))) {}

  bool hasOriginAt(Root& time) {
    makeTests();
    const auto holds = [&time](const auto& test) { return test.holdsAt(time); };
    return std::any_of(triangles_.begin(), triangles_.end(), holds) || std::any_of(sides_.begin(), sides_.end(), holds);
  }

  /// Zero where the points stay coplanar with the origin; without a zero, at no time is there a contact. (EE: the four
  /// differences are the corners of a parallelogram, so that this holds for all of them when it holds for three.)
  const Polynomial& coplanar() const { return coplanar_; }

  /// All polynomials whose signs decide.
  std::vector<Polynomial> events() {
    makeTests();
    std::vector<Polynomial> result;
    for (const SideTest& side : sides_) side.appendTo(result);
    for (const TriangleTest& triangle : triangles_) triangle.appendTo(result);
    return result;
  }

 private:
  /// Most pairs are never coplanar, so that the tests are made when they are asked for.
  void makeTests() {
    if (!sides_.empty()) return;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      for (std::size_t j = i + 1; j < points_.size(); ++j) {
        sides_.emplace_back(points_[i], points_[j]);
        for (std::size_t k = j + 1; k < points_.size(); ++k)
          triangles_.emplace_back(points_[i], points_[j], points_[k]);
      }
    }
  }

  std::vector<PolynomialVector> points_;
  Polynomial coplanar_;
  std::vector<SideTest> sides_;
  std::vector<TriangleTest> triangles_;
};

/// The distinct roots of all polynomials in ascending order.
std::vector<Root> mergedRoots(const std::vector<Polynomial>& polynomials) {
  std::vector<Root> merged;
  for (const Polynomial& polynomial : polynomials) {
    if (polynomial.isZero()) continue;
    for (Root& root : rootsInUnitInterval(polynomial)) {
      auto place = merged.begin();
      int order = 1;
      while (place != merged.end() && (order = root.compareWith(*place)) > 0) ++place;
      if (place == merged.end() || order != 0) merged.insert(place, root);
    }
  }
  return merged;
}

}  // namespace

std::optional<Root> firstContact(PairKind kind, const PairMotion& pair) {
  MovingHull hull(minkowskiDifference(kind, pair));
  Root start(Dyadic{0, 0});
  if (start.signOf(hull.coplanar()) == 0 && hull.hasOriginAt(start)) return start;
  const bool always_coplanar = hull.coplanar().isZero();
  for (Root& root : always_coplanar ? mergedRoots(hull.events()) : rootsInUnitInterval(hull.coplanar())) {
    if (hull.hasOriginAt(root)) return root;
  }
  return std::nullopt;
}

std::optional<Root> firstContactThorough(PairKind kind, const PairMotion& pair) {
  MovingHull hull(minkowskiDifference(kind, pair));
  std::vector<Polynomial> events = hull.events();
  events.push_back(Polynomial({0, 1}));   // the time 0
  events.push_back(Polynomial({-1, 1}));  // the time 1
  std::vector<Root> times = mergedRoots(events);
  std::optional<Root> first;
  for (std::size_t i = 0; i < times.size() && !first; ++i) {
    if (i > 0) {
      Root between(strictlyBetween(times[i - 1], times[i]));
      if (hull.hasOriginAt(between)) throw std::logic_error("a contact that begins between two events");
    }
    if (hull.hasOriginAt(times[i])) first = times[i];
  }
  std::optional<Root> quick = firstContact(kind, pair);
  if (quick.has_value() != first.has_value() || (first && first->compareWith(*quick) != 0)) {
    throw std::logic_error("the oracle's shortcuts change its answer");
  }
  return first;
}

double tocError(Root& true_toc, double reported) {
  constexpr unsigned BITS = 70;
  true_toc.refineTo(BITS);
  const Rational middle = (true_toc.lo().rational() + true_toc.hi().rational()) / 2;
  const double error = static_cast<double>(Rational(middle - Rational(reported)));
  const int sign = reported < 0 ? 1 : true_toc.compareWith(Dyadic::fromDouble(reported));
  // The sign is exact even where the distance is less than the interval's width.
  if (sign == 0) return 0;
  return sign * std::max(std::abs(error), std::ldexp(1.0, -static_cast<int>(BITS)));
}

bool isCellOf(Root& true_toc, const ElementaryResult& result, int bits) {
  const double width = std::ldexp(1.0, -bits);
  const double lower = static_cast<double>(static_cast<long long>(true_toc.cell(bits))) * width;  // exact: bits <= 52
  const double upper = std::min(1.0, lower + width);
  return result.toc_lower == lower && result.toc_upper == upper;
}

}  // namespace test
}  // namespace dccd
