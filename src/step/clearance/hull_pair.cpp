#include "step/clearance/hull_pair.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dccd/tolerances.h"

namespace dccd {
namespace {

constexpr int MOST_ROUNDS = 48;
/// [m] More than underflow takes from a distance in all operations.
constexpr double UNDERFLOW_M = tolerance::CLEARANCE_UNDERFLOW_M;

/// The edges and triangles of a hull of so many corners.
struct Shape {
  int edges, triangles;
  std::array<std::array<std::uint8_t, 2>, 12> edge;
  std::array<std::array<std::uint8_t, 3>, 12> triangle;
};
constexpr Shape POINT{0, 0, {}, {}};
constexpr Shape SEGMENT{1, 0, {{{0, 1}}}, {}};
constexpr Shape TRIANGLE{3, 1, {{{0, 1}, {1, 2}, {2, 0}}}, {{{0, 1, 2}}}};
constexpr Shape BOX{12,
                    12,
                    {{{0, 1}, {2, 3}, {4, 5}, {6, 7}, {0, 2}, {1, 3}, {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}}},
                    {{{0, 1, 3},
                      {0, 3, 2},
                      {4, 5, 7},
                      {4, 7, 6},
                      {0, 1, 5},
                      {0, 5, 4},
                      {2, 3, 7},
                      {2, 7, 6},
                      {0, 2, 6},
                      {0, 6, 4},
                      {1, 3, 7},
                      {1, 7, 5}}}};
const Shape& shapeOf(std::size_t corners) {
  return corners == 1 ? POINT : corners == 2 ? SEGMENT : corners == 3 ? TRIANGLE : BOX;
}

/// Across a triangle, be it a needle: of its longest edge and the way to it, and no rounding along that edge stays. So
/// it is wrong about that edge alone, where a needle is too thin for it to matter.
Vec3 normalOf(const Vec3& a, const Vec3& b, const Vec3& c) {
  const std::array<Vec3, 3> edge{b - a, c - b, a - c};
  std::size_t longest = 0;
  for (std::size_t k = 1; k < 3; ++k) longest = edge[k].squaredNorm() > edge[longest].squaredNorm() ? k : longest;
  const Vec3 &e = edge[longest], &next = edge[(longest + 1) % 3];
  const double ee = e.squaredNorm();
  if (!(ee > 0)) return Vec3::Zero();
  const Vec3 n = e.cross(next - e * (e.dot(next) / ee));
  return n - e * (e.dot(n) / ee);
}

}  // namespace

/// Of the differences of a simplex.
struct HullPair::Combination {
  double norm2 = std::numeric_limits<double>::infinity();
  std::array<double, 4> weight{};
  Vec3 direction = Vec3::Zero();  // across what it is a mean of; zero where that goes through the origin
};

/// Some differences of a corner of the first and one of the second.
struct HullPair::Simplex {
  int count = 0;
  std::array<Vec3, 4> w;
  std::array<std::array<std::uint8_t, 2>, 4> corner;

  static void takeNearer(const Combination& one, Combination& best) {
    if (one.norm2 < best.norm2) best = one;
  }

  bool holds(std::size_t a, std::size_t b) const {
    for (int i = 0; i < count; ++i) {
      if (corner[i][0] == a && corner[i][1] == b) return true;
    }
    return false;
  }

  Combination pointAt(int i) const {
    Combination c;
    c.norm2 = w[i].squaredNorm();
    c.weight[i] = 1;
    c.direction = w[i];
    return c;
  }

  Combination onSegment(int i, int j) const {
    const Vec3 e = w[j] - w[i];
    const double ee = e.squaredNorm(), s = -w[i].dot(e);
    if (!(s > 0) || !(ee > 0)) return pointAt(i);
    if (!(s < ee)) return pointAt(j);
    Combination c;
    c.weight[j] = s / ee;
    c.weight[i] = 1 - c.weight[j];
    const Vec3 v = w[i] + c.weight[j] * e;
    c.norm2 = v.squaredNorm();
    c.direction = v - e * (e.dot(v) / ee);
    return c;
  }

  Combination onTriangle(int i, int j, int k) const {
    const Vec3 n = (w[j] - w[i]).cross(w[k] - w[i]);
    const double nn = n.squaredNorm();
    const double a = n.dot(w[j].cross(w[k])), b = n.dot(w[k].cross(w[i])), c = n.dot(w[i].cross(w[j]));
    if (nn > 0 && a > 0 && b > 0 && c > 0) {
      Combination inside;
      const double sum = a + b + c;
      inside.weight[i] = a / sum;
      inside.weight[j] = b / sum;
      inside.weight[k] = c / sum;
      inside.norm2 = (inside.weight[i] * w[i] + inside.weight[j] * w[j] + inside.weight[k] * w[k]).squaredNorm();
      inside.direction = n.dot(w[i]) < 0 ? Vec3(-n) : n;
      return inside;
    }
    Combination best = onSegment(i, j);
    takeNearer(onSegment(j, k), best);
    takeNearer(onSegment(k, i), best);
    return best;
  }

  /// Of a triangle, be it a needle: the point within it, once more along its longest edge, and those of its edges. The
  /// first alone is wrong by the rounding of a normal that is nearly nothing.
  std::array<Combination, 4> onNeedle() const {
    std::array<Combination, 4> points{onTriangle(0, 1, 2), onSegment(0, 1), onSegment(1, 2), onSegment(2, 0)};
    int i = 0;
    for (int k = 1; k < 3; ++k) i = (w[(k + 1) % 3] - w[k]).norm() > (w[(i + 1) % 3] - w[i]).norm() ? k : i;
    const int j = (i + 1) % 3;
    const Vec3 e = w[j] - w[i];
    const double ee = e.squaredNorm();
    if (!(ee > 0)) return points;
    Combination& inside = points[0];
    const Vec3 v = inside.weight[0] * w[0] + inside.weight[1] * w[1] + inside.weight[2] * w[2];
    const double s = std::clamp(e.dot(v) / ee, -inside.weight[i], inside.weight[j]);
    inside.weight[i] += s;
    inside.weight[j] -= s;
    inside.direction -= e * (e.dot(inside.direction) / ee);
    return points;
  }

  Combination onTetrahedron() const {
    static constexpr int FACES[4][4] = {{0, 1, 2, 3}, {0, 1, 3, 2}, {0, 2, 3, 1}, {1, 2, 3, 0}};
    Combination best;
    double volume[4], sum = 0;
    bool inside = true;
    for (const auto& f : FACES) {
      const Vec3 n = (w[f[1]] - w[f[0]]).cross(w[f[2]] - w[f[0]]);
      const double origin = -n.dot(w[f[0]]), other = n.dot(w[f[3]] - w[f[0]]);
      if (origin * other > 0) {
        volume[f[3]] = std::abs(origin);
        sum += volume[f[3]];
        continue;
      }
      inside = false;
      takeNearer(onTriangle(f[0], f[1], f[2]), best);
    }
    if (!inside) return best;
    best.norm2 = 0;
    for (int i = 0; i < 4; ++i) best.weight[i] = volume[i] / sum;
    return best;
  }

  /// The point nearest to the origin.
  Combination nearest() const {
    return count == 1 ? pointAt(0) : count == 2 ? onSegment(0, 1) : count == 3 ? onTriangle(0, 1, 2) : onTetrahedron();
  }

  /// Leaves out what the point does not need.
  void reduce(Combination& point) {
    int kept = 0;
    for (int i = 0; i < count; ++i) {
      if (!(point.weight[i] > 0)) continue;
      w[kept] = w[i];
      corner[kept] = corner[i];
      point.weight[kept++] = point.weight[i];
    }
    count = kept;
  }
};

void HullPair::set(const MovingHull& a, const MovingHull& b) {
  origin_ = a.t0[0];
  time_ = -1;
  double largest = 0;
  const std::array<const MovingHull*, 2> hulls{&a, &b};
  for (int side = 0; side < 2; ++side) {
    count_[side] = hulls[side]->count;
    for (std::size_t i = 0; i < count_[side]; ++i) {
      t0_[side][i] = hulls[side]->t0[i] - origin_;
      t1_[side][i] = hulls[side]->t1[i] - origin_;
      largest = std::max({largest, t0_[side][i].cwiseAbs().maxCoeff(), t1_[side][i].cwiseAbs().maxCoeff()});
    }
  }
  // Not less, whose reciprocal would overflow.
  const int exponent = largest > 0 ? std::max(std::ilogb(largest), -1000) : -1000;
  const double up = std::ldexp(1.0, -exponent);
  scale_m_ = std::ldexp(1.0, exponent);
  for (int side = 0; side < 2; ++side) {
    for (std::size_t i = 0; i < count_[side]; ++i) {
      t0_[side][i] *= up;
      t1_[side][i] *= up;
    }
  }
}

double HullPair::lowerInMetres(double lower) const { return std::max(0.0, lower * scale_m_ - UNDERFLOW_M); }
double HullPair::upperInMetres(double upper) const { return upper * scale_m_ + UNDERFLOW_M; }

void HullPair::goTo(double t) {
  if (t == time_) return;
  time_ = t;
  for (int side = 0; side < 2; ++side) {
    for (std::size_t i = 0; i < count_[side]; ++i) now_[side][i] = (1 - t) * t0_[side][i] + t * t1_[side][i];
  }
}

/// min n.a - max n.b, and which corners these are.
double HullPair::along(const Vec3& n, std::size_t& a, std::size_t& b) const {
  double least = n.dot(now_[0][0]), most = n.dot(now_[1][0]);
  a = b = 0;
  for (std::size_t i = 1; i < count_[0]; ++i) {
    const double x = n.dot(now_[0][i]);
    if (x < least) least = x, a = i;
  }
  for (std::size_t i = 1; i < count_[1]; ++i) {
    const double x = n.dot(now_[1][i]);
    if (x > most) most = x, b = i;
  }
  return least - most;
}

double HullPair::lowerOver(const std::array<Vec3, 2>& direction, double from, double to) const {
  constexpr double FAR = std::numeric_limits<double>::infinity();
  const auto& [n0, n1] = direction;
  std::array<double, 5> least{FAR, FAR, FAR, FAR, FAR}, most{-FAR, -FAR, -FAR, -FAR, -FAR};
  for (int side = 0; side < 2; ++side) {
    for (std::size_t i = 0; i < count_[side]; ++i) {
      const Vec3 p = (1 - from) * t0_[side][i] + from * t1_[side][i], q = (1 - to) * t0_[side][i] + to * t1_[side][i];
      const double first = n0.dot(p), last = n1.dot(q), later = n0.dot(q), earlier = n1.dot(p);
      const std::array<double, 5> along{first, last, later, earlier, (later + earlier) / 2};
      for (std::size_t k = 0; k < along.size(); ++k) {
        least[k] = side == 0 ? std::min(least[k], along[k]) : least[k];
        most[k] = side == 1 ? std::max(most[k], along[k]) : most[k];
      }
    }
  }
  const auto gap = [&](std::size_t k) { return least[k] - most[k]; };
  const double both = std::min({gap(0), gap(1), gap(4)});
  return std::max({both, std::min(gap(0), gap(2)), std::min(gap(1), gap(3))}) - tolerance::CLEARANCE;
}

void HullPair::takeMeans(const Simplex& simplex, const Combination& of, Nearest& nearest) const {
  Vec3 on_a = Vec3::Zero(), on_b = Vec3::Zero();
  double sum = 0;
  for (int i = 0; i < simplex.count; ++i) sum += of.weight[i];
  for (int i = 0; i < simplex.count; ++i) {
    on_a += (of.weight[i] / sum) * now_[0][simplex.corner[i][0]];
    on_b += (of.weight[i] / sum) * now_[1][simplex.corner[i][1]];
  }
  const double upper = (on_a - on_b).norm() + tolerance::CLEARANCE;
  if (!(upper < nearest.upper)) return;
  nearest.upper = upper;
  nearest.point = {on_a, on_b};
}

/// The length of a direction, which is made longer where the square of its length loses digits. 0: it is none.
static double lengthOf(Vec3& direction) {
  double length = direction.norm();
  if (length < tolerance::CLEARANCE_DIRECTION_M) {
    const double largest = direction.cwiseAbs().maxCoeff();
    if (!(largest > 0)) return 0;
    direction /= largest;
    length = direction.norm();
  }
  return length;
}

void HullPair::tryDirection(Vec3 direction, Nearest& nearest) const {
  const double norm = lengthOf(direction);
  if (!(norm > 0)) return;
  for (const double sign : {1.0, -1.0}) {
    const Vec3 n = direction * (sign / norm);
    std::size_t a, b;
    const double lower = along(n, a, b) - tolerance::CLEARANCE;
    if (lower > nearest.lower) nearest.lower = lower, nearest.direction = n;
  }
}

Nearest HullPair::at(double t, double wide_m) {
  goTo(t);
  Nearest nearest;
  nearest.upper = std::numeric_limits<double>::infinity();
  const double wide = std::max(wide_m / scale_m_, 4 * tolerance::CLEARANCE);
  const auto isNarrow = [&] {
    return nearest.upper - nearest.lower <= std::max(wide / 2, tolerance::CLEARANCE_RELATIVE / 2 * nearest.upper);
  };
  Simplex simplex;
  std::size_t a = 0, b = 0;
  double before = std::numeric_limits<double>::infinity();
  for (int round = 0; round < MOST_ROUNDS; ++round) {
    simplex.w[simplex.count] = now_[0][a] - now_[1][b];
    simplex.corner[simplex.count++] = {static_cast<std::uint8_t>(a), static_cast<std::uint8_t>(b)};
    Combination point = simplex.nearest();
    simplex.reduce(point);
    takeMeans(simplex, point, nearest);
    const double norm = lengthOf(point.direction);
    if (!(norm > 0)) break;
    const Vec3 n = point.direction / norm;
    const double lower = along(n, a, b) - tolerance::CLEARANCE;
    if (lower > nearest.lower) nearest.lower = lower, nearest.direction = n;
    if (isNarrow() || simplex.count == 4 || simplex.holds(a, b) || !(point.norm2 < before)) break;
    before = point.norm2;
  }
  if (!isNarrow()) improve(nearest);
  return nearest;
}

/// Where an edge of one side goes through a triangle of the other.
void HullPair::tryThrough(std::size_t side, const std::array<std::uint8_t, 2>& edge,
                          const std::array<std::uint8_t, 3>& triangle, Nearest& nearest) const {
  const auto &on = now_[side], &of = now_[1 - side];
  const std::array<Vec3, 3> t{of[triangle[0]], of[triangle[1]], of[triangle[2]]};
  const Vec3 n = normalOf(t[0], t[1], t[2]);
  const double from = n.dot(on[edge[0]] - t[0]), to = n.dot(on[edge[1]] - t[0]);
  const bool goes_through = from < to ? from <= 0 && to >= 0 : from > to && from >= 0 && to <= 0;
  if (!goes_through) return;
  const double s = from / (from - to);
  const Vec3 through = (1 - s) * on[edge[0]] + s * on[edge[1]];
  Simplex seen;
  seen.count = 3;
  for (int k = 0; k < 3; ++k) seen.w[k] = t[k] - through;
  for (const Combination& c : seen.onNeedle()) {
    const Vec3 point = c.weight[0] * t[0] + c.weight[1] * t[1] + c.weight[2] * t[2];
    const double upper = (through - point).norm() + tolerance::CLEARANCE;
    if (!(upper < nearest.upper)) continue;
    nearest.upper = upper;
    nearest.point[side] = through;
    nearest.point[1 - side] = point;
  }
}

/// What the search may have missed for rounding: every direction that can tell two hulls apart, and every pair of
/// features: a corner and a triangle, two edges, whose differences make two triangles, or an edge and a triangle that
/// it goes through.
void HullPair::improve(Nearest& nearest) const {
  const std::array<const Shape*, 2> shape{&shapeOf(count_[0]), &shapeOf(count_[1])};
  const auto tryTriangle = [&](std::array<std::array<std::uint8_t, 2>, 3> corners) {
    Simplex s;
    for (int k = 0; k < 3; ++k) {
      s.corner[k] = corners[k];
      s.w[k] = now_[0][corners[k][0]] - now_[1][corners[k][1]];
    }
    s.count = 3;
    for (const Combination& c : s.onNeedle()) {
      tryDirection(c.direction, nearest);
      takeMeans(s, c, nearest);
    }
  };
  for (std::size_t side = 0; side < 2; ++side) {
    for (int f = 0; f < shape[side]->triangles; ++f) {
      const auto& t = shape[side]->triangle[f];
      tryDirection(normalOf(now_[side][t[0]], now_[side][t[1]], now_[side][t[2]]), nearest);
      for (std::uint8_t i = 0; i < count_[1 - side]; ++i) {
        const auto pairOf = [&](std::uint8_t corner) {
          return side == 0 ? std::array<std::uint8_t, 2>{corner, i} : std::array<std::uint8_t, 2>{i, corner};
        };
        tryTriangle({pairOf(t[0]), pairOf(t[1]), pairOf(t[2])});
      }
      for (int e = 0; e < shape[1 - side]->edges; ++e) tryThrough(1 - side, shape[1 - side]->edge[e], t, nearest);
    }
  }
  for (int e = 0; e < shape[0]->edges; ++e) {
    for (int f = 0; f < shape[1]->edges; ++f) {
      const auto [a0, a1] = shape[0]->edge[e];
      const auto [b0, b1] = shape[1]->edge[f];
      tryDirection((now_[0][a1] - now_[0][a0]).cross(now_[1][b1] - now_[1][b0]), nearest);
      tryTriangle({{{a0, b0}, {a0, b1}, {a1, b1}}});
      tryTriangle({{{a0, b0}, {a1, b0}, {a1, b1}}});
    }
  }
}

}  // namespace dccd
