#include "support/margin_predicates.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "elementary/exact_tiers.h"
#include "obstacle/axis_predicates.h"
#include "obstacle/static_filters.h"
#include "obstacle/voxel_surface_impl.h"
#include "oracle/oracle.h"
#include "simd/cluster_bounds.h"
#include "simd/face_filter.h"
#include "step/start/segment_triangle.h"
#include "support/margin_numbers.h"
#include "support/margin_pairs.h"

namespace dccd {
namespace test {
namespace margins {
namespace {

/// Moves a point into the plane of three others, as exactly as doubles can say.
void flattenPoint(std::vector<double>& x, int moved, int o, int a, int b) {
  for (int round = 0; round < 3; ++round) {
    std::array<std::array<Rational, 3>, 3> d;
    V3 about[3];
    const int to[3] = {a, b, moved};
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) {
        d[i][k] = exact(x[3 * to[i] + k]) - exact(x[3 * o + k]);
        about[i][k] = static_cast<double>(d[i][k]);
      }
    }
    const V3 normal = about[0].cross(about[1]);
    const double away = static_cast<double>(determinant(d)) / normal.squaredNorm();
    for (int k = 0; k < 3; ++k) x[3 * moved + k] -= away * normal[k];
  }
}

}  // namespace

MarginInput segmentInput(RandomSource& random, bool flat) {
  V3 u = heavyVector(random), v = heavyVector(random);
  if (flat) u[2] = v[2] = 0;
  double a, b;
  weights(random, PairKind::VERTEX_FACE, flat || random() % 2, a, b);
  const V3 at = a * u + b * v, far = flat ? V3(uniform(random) * u + uniform(random) * v) : heavyVector(random);
  const double before = random() % 2 ? 0 : share(random);
  const V3 origin = originOf(random, at), p = at - before * far, q = at + far;
  MarginInput input;
  for (const V3& x : {p, q, V3(V3::Zero()), u, v}) {
    for (int k = 0; k < 3; ++k) input.x.push_back(origin[k] + x[k]);
  }
  if (flat) {  // p on the line of two corners
    std::vector<double>& y = input.x;
    const int a = 2 + static_cast<int>(random() % 3), b = a == 4 ? 2 : a + 1;
    const Rational slope = (exact(y[3 * b + 1]) - exact(y[3 * a + 1])) / (exact(y[3 * b]) - exact(y[3 * a]));
    y[1] = static_cast<double>(exact(y[3 * a + 1]) + slope * (exact(y[0]) - exact(y[3 * a])));
  } else if (before == 0) {
    flattenPoint(input.x, 0, 2, 3, 4);
  } else {  // the line pq through that of two corners
    const int a = 2 + static_cast<int>(random() % 3), b = a == 4 ? 2 : a + 1;
    flattenPoint(input.x, 0, 1, a, b);
  }
  // Differences are taken to p: what is exact there is rounded at q.
  if (random() % 4) std::swap_ranges(input.x.begin(), input.x.begin() + 3, input.x.begin() + 3);
  return input;
}

/// The segment meets the triangle where a vertex that moves along it meets the resting triangle.
IsWrong judgeSegment(const MarginInput& input) {
  PairMotion motion;
  for (int k = 0; k < 3; ++k) {
    motion.x[0][0][k] = input.x[k];
    motion.x[1][0][k] = input.x[3 + k];
    for (int i = 1; i < 4; ++i) motion.x[0][i][k] = motion.x[1][i][k] = input.x[3 + 3 * i + k];
  }
  const bool meets = firstContact(PairKind::VERTEX_FACE, motion).has_value();
  const std::vector<double> x = input.x;
  return [x, meets] {
    if (segmentMeetsTriangle(x.data(), x.data() + 3, x.data() + 6, x.data() + 9, x.data() + 12) != meets) return true;
    // The segment as an edge of a face, of which the filter of faces keeps what meets the other.
    alignas(64) double points[6][8] = {};
    for (int i = 0; i < 5; ++i) std::copy_n(x.data() + 3 * i, 3, points[i < 2 ? i : i + 1]);
    for (int k = 0; k < 3; ++k) points[2][k] = x[k] + x[3 + k] - x[6 + k];
    // Two faces of one group: corner k of face j at [GROUP * k + j].
    static constexpr std::uint32_t CORNERS[2 * simd::GROUP + 2] = {0, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1,
                                                                   4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 5};
    static constexpr std::uint8_t ALL_EDGES[2] = {7, 7};
    static constexpr std::uint32_t SLOTS[2] = {0, 1};
    double middle[4] = {}, largest = 0;
    for (int k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax({x[k], x[3 + k], x[6 + k], x[9 + k], x[12 + k], points[2][k]});
      middle[k] = low / 2 + high / 2;
      largest = std::max({largest, high - middle[k], middle[k] - low});
    }
    float near[6 * 4];
    simd::moveNear(points[0], 6, middle, near);
    std::uint32_t edges[1 + simd::PAIRS_BEHIND] = {};
    simd::facePairFilter({near, simd::largestNear(largest)}, {CORNERS, ALL_EDGES}, {CORNERS, ALL_EDGES}, SLOTS, nullptr,
                         1, edges);
    return meets ? (edges[0] & 1) == 0 : (edges[0] >> simd::MEETS_SHIFT & 1) != 0;
  };
}

MarginInput orientation2dInput(RandomSource& random) {
  MarginInput input;
  // The last point is near the origin, as close to the line of the others as doubles can say.
  const double ax = 0.5 * heavy(random), ay = 0.5 * heavy(random), s = std::ldexp(1.0, static_cast<int>(random() % 3));
  const double bx = -s * ax * (1 + 0.1 * share(random)), by = -s * ay * (1 + 0.1 * share(random));
  const double qx = uniform(random) * 0x1p-10;
  const Rational slope = (exact(by) - exact(ay)) / (exact(bx) - exact(ax));
  input.x = {ax, ay, bx, by, qx, static_cast<double>(exact(ay) + slope * (exact(qx) - exact(ax)))};
  return input;
}
IsWrong judgeOrientation2d(const MarginInput& input) {
  const std::vector<double> x = input.x;
  const Rational truth = (exact(x[2]) - exact(x[0])) * (exact(x[5]) - exact(x[1])) -
                         (exact(x[3]) - exact(x[1])) * (exact(x[4]) - exact(x[0]));
  const int sign = signOf(truth);
  // The edge of the first two, and one at rest from the last one away to the left: they meet unless that is left, too.
  PairMotion edges = {};
  for (auto& points : edges.x) {
    for (int i = 0; i < 3; ++i) std::copy_n(&x[2 * i], 2, points[i]);
    points[3][0] = x[4] - 0.25 * (x[3] - x[1]), points[3][1] = x[5] + 0.25 * (x[2] - x[0]);
  }
  return [x, sign, edges] {
    if (orientation2d(x[0], x[1], x[2], x[3], x[4], x[5]) != sign) return true;
    const Verdict verdict = exact::decideInPlane(PairKind::EDGE_EDGE, edges, 32).verdict;
    return verdict != Verdict::UNDECIDED && (verdict == Verdict::CONTACT) != (sign <= 0);
  };
}

MarginInput orientation3dInput(RandomSource& random) {
  MarginInput input;
  const V3 u = heavyVector(random), v = heavyVector(random), w = uniform(random) * u + uniform(random) * v;
  const V3 o = originOf(random, w);
  for (const V3& x : {V3(V3::Zero()), u, v, w}) {
    for (int k = 0; k < 3; ++k) input.x.push_back(o[k] + x[k]);
  }
  return input;
}
IsWrong judgeOrientation3d(const MarginInput& input) {
  const std::vector<double> x = input.x;
  std::array<std::array<Rational, 3>, 3> d;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) d[i][k] = exact(x[3 + 3 * i + k]) - exact(x[k]);
  }
  const int sign = signOf(determinant(d));
  return [x, sign] { return orientation3d(x.data(), x.data() + 3, x.data() + 6, x.data() + 9) != sign; };
}

MarginInput crossingInput(RandomSource& random) {
  const double from = heavy(random), to = from - heavy(random) * std::copysign(1, from),
               plane = uniform(random) * 0x1p-6;
  const double s = power(random, -1, 1), from2 = s * from, to2 = s * to * (1 + 0.01 * uniform(random));
  // The second plane, near the origin, so that both times are the same as exactly as doubles can say.
  const Rational time = (exact(plane) - exact(from)) / (exact(to) - exact(from));
  const double plane2 = static_cast<double>(exact(from2) + time * (exact(to2) - exact(from2)));
  MarginInput input;
  input.x = {plane, from, to, plane2, from2, to2};
  return input;
}
IsWrong judgeCrossing(const MarginInput& input) {
  const std::vector<double> x = input.x;
  if (x[1] == x[2] || x[4] == x[5]) return [] { return false; };
  const Rational first = (exact(x[0]) - exact(x[1])) / (exact(x[2]) - exact(x[1]));
  const Rational second = (exact(x[3]) - exact(x[4])) / (exact(x[5]) - exact(x[4]));
  if (first.sign() < 0 || second.sign() < 0) return [] { return false; };
  const int sign = signOf(first - second);
  return [x, sign] { return compare(CrossingTime(x[0], x[1], x[2]), CrossingTime(x[3], x[4], x[5])) != sign; };
}

MarginInput sideInput(RandomSource& random) {
  MarginInput input;
  input.variant = static_cast<int>(random() % 3);
  // The point is near the origin, as close to the edge as it is at one end of the step as doubles can say.
  const double away = (random() % 2 ? 1 : -1) * power(random, -50, -2);
  const MarginInput line = orientation2dInput(random);
  const double dx = line.x[2] - line.x[0], dy = line.x[3] - line.x[1];
  const bool at_end = random() % 2;
  for (int t = 0; t < 2; ++t) {
    const double off = (t == 1) == at_end ? 0 : away;
    for (int i = 0; i < 4; ++i) input.x.push_back(line.x[i] + (i % 2 ? -off * dx : off * dy));
  }
  input.x.push_back(line.x[4]);
  input.x.push_back(line.x[5]);
  return input;
}
IsWrong judgeSide(const MarginInput& input) {
  const int axis = input.variant, b = (axis + 1) % 3, c = (axis + 2) % 3;
  VertexMotion p{}, q{};
  double point[3] = {};
  const std::vector<double>& x = input.x;
  p.t0[b] = x[0], p.t0[c] = x[1], q.t0[b] = x[2], q.t0[c] = x[3];
  p.t1[b] = x[4], p.t1[c] = x[5], q.t1[b] = x[6], q.t1[c] = x[7];
  point[b] = x[8], point[c] = x[9];
  PairMotion motion = {};  // the line, as far as the edge, which lies in the plane where the axis is 0
  for (int k = 0; k < 3; ++k) {
    motion.x[0][0][k] = p.t0[k], motion.x[1][0][k] = p.t1[k], motion.x[0][1][k] = q.t0[k], motion.x[1][1][k] = q.t1[k];
    for (int i = 2; i < 4; ++i) motion.x[0][i][k] = motion.x[1][i][k] = k == axis ? (i == 2 ? -1 : 1) : point[k];
  }
  const bool contact = firstContact(PairKind::EDGE_EDGE, motion).has_value();
  const std::array<double, 3> at = {point[0], point[1], point[2]};
  return [=] { return contact && edgeMissesLine(p, q, at.data(), axis); };
}

MarginInput keyInput(RandomSource& random) {
  MarginInput input;
  const double resolution = power(random, -6, 0);
  const double plane = (static_cast<double>(random() % 65537) - 32768) * resolution;
  input.x = {resolution, plane};
  return input;
}
IsWrong judgeKey(const MarginInput& input) {
  const double resolution = std::fabs(input.x[0]), x = input.x[1];
  return [=] {
    if (!(resolution > 0x1p-7 && resolution < 2 && std::fabs(x) <= 32768 * resolution)) return false;
    const double inverse = 1 / resolution;
    const std::int32_t low = outwardKey(x, inverse, -1), high = outwardKey(x, inverse, +1);
    const bool below = low > 0 && x <= voxelPlane(low, resolution);  // the voxel below reaches up to x
    const bool above = high < 65535 && x >= voxelPlane(std::int64_t{high} + 1, resolution);
    return below || above;
  };
}

}  // namespace margins
}  // namespace test
}  // namespace dccd
