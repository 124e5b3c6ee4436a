#include "support/margin_checks.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>

#include "culling/unfolded.h"
#include "dccd/elementary.h"
#include "elementary/exact_double_double.h"
#include "elementary/exact_tiers.h"
#include "obstacle/axis_predicates.h"
#include "obstacle/static_filters.h"
#include "obstacle/voxel_surface_impl.h"
#include "oracle/exact_distance.h"
#include "oracle/oracle.h"
#include "oracle/promises.h"
#include "projection/toc_bound.h"
#include "simd/exact_batch.h"
#include "simd/fused_filter.h"
#include "step/start_state.h"

namespace dccd {
namespace test {
namespace {

// --- numbers ---------------------------------------------------------------------------------------------------------

double uniform(RandomSource& random) { return 2 * (static_cast<double>(random() >> 11) * 0x1p-53) - 1; }
double share(RandomSource& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }
double power(RandomSource& random, int from, int to) {
  return std::ldexp(1 + share(random), from + static_cast<int>(random() % static_cast<unsigned>(to - from + 1)));
}
/// Where roundings weigh most: a little more than a power of two.
double heavy(RandomSource& random) { return (random() % 2 ? 1 : -1) * (1 + 0.125 * share(random)); }

Rational exact(double x) { return Rational(x); }
int signOf(const Rational& x) { return x.sign(); }

/// One number to a neighbour, or a little further.
void changeOne(MarginInput& input, RandomSource& random) {
  double& x = input.x[random() % input.x.size()];
  const int scale = static_cast<int>(random() % 6);
  if (scale == 5) {
    x += uniform(random) * std::ldexp(1.0, -static_cast<int>(random() % 80));
  } else if (scale < 3) {
    const int steps = 1 + static_cast<int>(random() % (scale == 0 ? 1 : scale == 1 ? 8 : 1000));
    const double to = random() % 2 ? HUGE_VAL : -HUGE_VAL;
    for (int i = 0; i < steps; ++i) x = std::nextafter(x, to);
  } else {
    x += uniform(random) * std::ldexp(std::fabs(x), -static_cast<int>(random() % 48));
  }
}

// --- pairs -----------------------------------------------------------------------------------------------------------

using V3 = Eigen::Vector3d;

PairKind kindOf(const MarginInput& input) {
  return input.variant % 2 == 0 ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE;
}
PairMotion motionOf(const MarginInput& input) {
  PairMotion motion;
  std::copy(input.x.begin(), input.x.begin() + 24, &motion.x[0][0][0]);
  return motion;
}
MarginInput inputOf(PairKind kind, const PairMotion& motion) {
  MarginInput input;
  input.variant = kind == PairKind::EDGE_EDGE;
  input.x.assign(&motion.x[0][0][0], &motion.x[0][0][0] + 24);
  return input;
}

PairKind anyKind(RandomSource& random) { return random() % 2 ? PairKind::EDGE_EDGE : PairKind::VERTEX_FACE; }
V3 heavyVector(RandomSource& random) { return {heavy(random), heavy(random), heavy(random)}; }
V3 anyVector(RandomSource& random) { return {uniform(random), uniform(random), uniform(random)}; }
/// Where a pair lies: anywhere, or so that the place where it meets is at the origin, whose neighbours are so close
/// that a pair can be nearly exactly at a bound, while all that is far from there is rounded.
V3 originOf(RandomSource& random, const V3& meeting_place) {
  return random() % 4 ? V3(-meeting_place) : V3(anyVector(random));
}

/// The pair with these differences (u, v, w as everywhere) at both ends, its first point at `origin`.
MarginInput pairOf(PairKind kind, const V3 (&u)[2], const V3 (&v)[2], const V3 (&w)[2], RandomSource& random) {
  const V3 origin = originOf(random, w[0]);
  PairMotion motion;
  for (int t = 0; t < 2; ++t) {
    std::array<V3, 4> x;
    if (kind == PairKind::VERTEX_FACE) {
      x = {origin + w[t], origin, origin + u[t], origin + v[t]};
    } else {
      x = {origin, origin + u[t], origin + w[t], origin + w[t] + v[t]};
    }
    for (int i = 0; i < 4; ++i) std::copy(x[i].data(), x[i].data() + 3, motion.x[t][i]);
  }
  return inputOf(kind, motion);
}

/// Weights of a point within both features, on a border of one for `border`.
void weights(RandomSource& random, PairKind kind, bool border, double& a, double& b) {
  a = share(random);
  b = share(random);
  if (kind == PairKind::VERTEX_FACE && a + b > 1) a = 1 - a, b = 1 - b;
  if (!border) return;
  switch (random() % 4) {
    case 0:
      a = 0;
      break;
    case 1:
      b = 0;
      break;
    case 2:
      a = kind == PairKind::VERTEX_FACE ? 1 - b : 1;
      break;
    default:
      b = kind == PairKind::VERTEX_FACE ? 1 - a : 1;
  }
}
/// w for the features to meet at these weights.
V3 meeting(PairKind kind, const V3& u, const V3& v, double a, double b) {
  return kind == PairKind::VERTEX_FACE ? V3(a * u + b * v) : V3(a * u - b * v);
}

Rational determinant(const std::array<std::array<Rational, 3>, 3>& x) {
  const auto minor = [&](int i, int j) { return x[0][i] * x[1][j] - x[0][j] * x[1][i]; };
  return minor(1, 2) * x[2][0] + minor(2, 0) * x[2][1] + minor(0, 1) * x[2][2];
}

/// Moves the point that meets (VF the vertex, EE the second edge's first end), at both ends of the step, until the four
/// are in one plane at t as exactly as doubles can say.
void flatten(MarginInput& input, double t) {
  const bool vertex_face = input.variant % 2 == 0;
  const int ends[3][2] = {
      {vertex_face ? 1 : 0, vertex_face ? 2 : 1}, {vertex_face ? 1 : 2, 3}, {vertex_face ? 1 : 0, vertex_face ? 0 : 2}};
  const int moved = vertex_face ? 0 : 2;
  for (int round = 0; round < 3; ++round) {
    std::array<std::array<Rational, 3>, 3> x;
    V3 about[3];
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) {
        const int to = 3 * ends[i][1] + k, from = 3 * ends[i][0] + k;
        x[i][k] = (exact(input.x[to]) - exact(input.x[from])) * exact(1 - t) +
                  (exact(input.x[12 + to]) - exact(input.x[12 + from])) * exact(t);
        about[i][k] = static_cast<double>(x[i][k]);
      }
    }
    const V3 normal = about[0].cross(about[1]);
    const double away = static_cast<double>(determinant(x)) / normal.squaredNorm();
    for (int k = 0; k < 3; ++k) {
      input.x[3 * moved + k] -= away * normal[k];
      input.x[12 + 3 * moved + k] -= away * normal[k];
    }
  }
}

/// Coplanar at t = 0 up to rounding, where they meet, and then apart, slowly.
MarginInput partingPair(RandomSource& random, int slowest) {
  const PairKind kind = anyKind(random);
  double a, b;
  weights(random, kind, random() % 4 == 0, a, b);
  V3 u[2], v[2], w[2];
  u[0] = u[1] = heavyVector(random);
  v[0] = v[1] = heavyVector(random);
  w[0] = meeting(kind, u[0], v[0], a, b);
  const V3 normal = u[0].cross(v[0]);
  w[1] = w[0] + (random() % 2 ? 1 : -1) * power(random, slowest, -2) * normal;
  MarginInput input = pairOf(kind, u, v, w, random);
  flatten(input, 0);
  return input;
}

/// The same, and at the end of the step a vertex is exactly where one of the other feature is.
MarginInput returningPair(RandomSource& random) {
  MarginInput input = partingPair(random, -20);
  const int face[2] = {1, 4};
  for (int i = face[0]; i < face[1]; ++i) {
    for (int k = 0; k < 3; ++k) input.x[12 + 3 * i + k] = heavy(random);
  }
  const int to = input.variant == 0 ? 0 : 2, from = input.variant == 0 ? 1 : 0;
  for (int k = 0; k < 3; ++k) input.x[12 + 3 * to + k] = input.x[12 + 3 * from + k];
  return input;
}

/// Coplanar all the time up to rounding, at a border of a feature at some time, and slow or at rest.
MarginInput restingPair(RandomSource& random) {
  const PairKind kind = anyKind(random);
  double a, b;
  weights(random, kind, true, a, b);
  V3 u[2], v[2], w[2];
  u[0] = heavyVector(random);
  v[0] = heavyVector(random);
  if (random() % 2) {  // exactly coplanar: x + y + z = 0, or z = 0
    const bool tilted = random() % 2;
    u[0][2] = tilted ? -(u[0][0] + u[0][1]) : 0;
    v[0][2] = tilted ? -(v[0][0] + v[0][1]) : 0;
  }
  w[0] = meeting(kind, u[0], v[0], a, b);
  u[1] = u[0], v[1] = v[0], w[1] = w[0];
  MarginInput input = pairOf(kind, u, v, w, random);
  if (random() % 2) {
    const V3 shift = power(random, -30, 0) * anyVector(random);
    for (int i = 0; i < 12; ++i) input.x[12 + i] += shift[i % 3];
  }
  return input;
}

/// Meets at a border at some time in mid-step, or misses it narrowly, everything moving as fast as it is large.
MarginInput crossingPair(RandomSource& random, int closest) {
  const PairKind kind = anyKind(random);
  double a, b;
  weights(random, kind, true, a, b);
  const double away = random() % 8 == 0 ? 0 : power(random, closest, -4) * (random() % 2 ? 1 : -1);
  (random() % 2 ? a : b) += away;
  const double t = random() % 2 ? share(random) : std::ldexp(static_cast<double>(1 + random() % 31), -5);
  const double speed = random() % 2 ? 2 : power(random, -20, 0);
  V3 u[2], v[2], w[2];
  const V3 at_u = heavyVector(random), at_v = heavyVector(random), at_w = meeting(kind, at_u, at_v, a, b);
  const V3 along_u = speed * anyVector(random), along_v = speed * anyVector(random),
           along_w = speed * anyVector(random);
  for (int end = 0; end < 2; ++end) {
    u[end] = at_u + (end - t) * along_u;
    v[end] = at_v + (end - t) * along_v;
    w[end] = at_w + (end - t) * along_w;
  }
  return pairOf(kind, u, v, w, random);
}

/// In one plane but for a height that makes f nearly a third power of t - r, so that its root is known badly, while the
/// features sweep over each other's border in that plane.
MarginInput flatPair(RandomSource& random) {
  const PairKind kind = anyKind(random);
  const double r = random() % 2 ? 0.02 + 0.2 * share(random) : share(random);
  double a, b;
  weights(random, kind, true, a, b);
  V3 x[3][2];
  for (auto& vector : x) {
    for (V3& end : vector) end = V3(heavy(random), heavy(random), 0);
    if (random() % 2) {
      for (int k = 0; k < 2; ++k) vector[1][k] = -vector[0][k] * share(random);
    }
  }
  const V3 u = (1 - r) * x[0][0] + r * x[0][1], v = (1 - r) * x[1][0] + r * x[1][1];
  const double near = power(random, -40, -3) * (random() % 2 ? 1 : -1);
  const V3 w = meeting(kind, u, v, a + (random() % 2 ? near : 0), b + (random() % 2 ? near : 0));
  const int moved = random() % 2;
  x[2][moved] = moved ? V3((w - (1 - r) * x[2][0]) / r) : V3((w - r * x[2][1]) / (1 - r));
  if (!(x[2][moved].lpNorm<Eigen::Infinity>() < 4)) return flatPair(random);
  // f = sum over k of height_k(t) * minor_k(t), linear in the six heights; wanted: the Bernstein coefficients of (t -
  // r)^3 + c (t - r).
  Eigen::Matrix<double, 4, 6> f;
  for (int k = 0; k < 3; ++k) {
    const V3 *p = x[(k + 1) % 3], *q = x[(k + 2) % 3];
    const double m0 = p[0].cross(q[0]).z(), m1 = p[0].cross(q[1]).z() + p[1].cross(q[0]).z(), m2 = p[1].cross(q[1]).z();
    f.col(2 * k) << m0, m1, m2, 0;
    f.col(2 * k + 1) << 0, m0, m1, m2;
  }
  const double c = random() % 2 ? 0 : power(random, -20, -3), s = 1 - r;
  Eigen::Vector4d wanted(-r * r * r - c * r, 3 * r * r * s + c * (s - 2 * r), -3 * r * s * s + c * (2 * s - r),
                         s * s * s + c * s);
  const Eigen::Matrix<double, 6, 1> heights =
      power(random, -46, -20) * f.completeOrthogonalDecomposition().solve(wanted);
  if (!(heights.lpNorm<Eigen::Infinity>() < 0.5)) return flatPair(random);
  for (int k = 0; k < 3; ++k) {
    x[k][0].z() = heights[2 * k];
    x[k][1].z() = heights[2 * k + 1];
  }
  return pairOf(kind, x[0], x[1], x[2], random);
}

/// Whether the batched tier is wrong about a pair: verdict, cell or bracket.
IsWrong judgeBatch(const MarginInput& input) {
  const PairKind kind = kindOf(input);
  const PairMotion motion = motionOf(input);
  std::optional<Root> toc = firstContact(kind, motion);
  return [kind, motion, toc]() mutable {
    VertexMotion vertices[4] = {};
    for (int i = 0; i < 4; ++i) {
      std::copy_n(motion.x[0][i], 3, vertices[i].t0);
      std::copy_n(motion.x[1][i], 3, vertices[i].t1);
    }
    const std::uint32_t quads[1][4] = {{0, 1, 2, 3}};
    simd::BatchInput batch;
    batch.vertices = vertices[0].t0;
    batch.quads = quads;
    batch.count = 1;
    batch.kind = kind == PairKind::VERTEX_FACE ? simd::BatchKind::VERTEX_FACE : simd::BatchKind::EDGE_EDGE;
    std::uint8_t verdict;
    std::uint64_t cell;
    double lo, hi;
    simd::exactBatch(batch, {&verdict, &cell, &lo, &hi});
    if (verdict == simd::BATCH_UNDECIDED) return false;
    if (verdict == simd::BATCH_NO) return toc.has_value();
    if (!toc) return true;
    if (verdict == simd::BATCH_YES && toc->cell(32) != Integer(cell)) return true;
    return toc->compareWith(Dyadic::fromDouble(lo)) <= 0 || toc->compareWith(Dyadic::fromDouble(hi)) >= 0;
  };
}

/// Whether one tier of exact is wrong about a pair.
std::function<IsWrong(const MarginInput&)> judgeTier(
    std::function<ElementaryResult(PairKind, const PairMotion&, int)> tier, int toc_bits) {
  return [tier, toc_bits](const MarginInput& input) -> IsWrong {
    Query query;
    query.kind = kindOf(input);
    query.motion = motionOf(input);
    std::optional<Root> toc = firstContact(query.kind, query.motion);
    return [query, toc, tier, toc_bits]() mutable {
      const ElementaryResult result = tier(query.kind, query.motion, toc_bits);
      if (result.verdict == Verdict::UNDECIDED) return false;
      AccuracyOptions options;
      options.toc_bits = toc_bits;
      return !brokenPromise(options, query, toc, result).empty();
    };
  };
}

IsWrong judgePlanarFilter(const MarginInput& input) {
  const PairKind kind = kindOf(input);
  const PairMotion motion = motionOf(input);
  const bool contact = firstContact(kind, motion).has_value();
  return [kind, motion, contact] {
    alignas(64) VertexMotion vertices[4] = {};
    for (int i = 0; i < 4; ++i) {
      std::copy_n(motion.x[0][i], 3, vertices[i].t0);
      std::copy_n(motion.x[1][i], 3, vertices[i].t1);
    }
    const std::uint32_t quad[4] = {0, 1, 2, 3};
    std::uint32_t kept[16];
    return contact &&
           simd::fusedFilter(vertices[0].t0, quad, 1, kind == PairKind::EDGE_EDGE, simd::FusedPlanes::ALL, kept) == 0;
  };
}

/// To one beside it at the accuracy of float, of which that filter's margins are made, still coplanar at t = 0.
void changeInFloat(MarginInput& input, RandomSource& random) {
  const std::size_t i = random() % 12;
  const double change = uniform(random) * std::ldexp(std::fabs(input.x[i]), -static_cast<int>(random() % 28));
  input.x[i] += change;
  input.x[12 + i] += change;
  flatten(input, 0);
}

// --- f in pairs of doubles -------------------------------------------------------------------------------------------

/// u, v, w at t = 0 and what they change by, exactly.
void exactDifferences(PairKind kind, const PairMotion& motion, Rational (&start)[3][3], Rational (&change)[3][3]) {
  static constexpr int ENDS[2][3][2] = {{{1, 2}, {1, 3}, {1, 0}}, {{0, 1}, {2, 3}, {0, 2}}};
  const auto& ends = ENDS[kind == PairKind::VERTEX_FACE ? 0 : 1];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      start[i][k] = exact(motion.x[0][ends[i][1]][k]) - exact(motion.x[0][ends[i][0]][k]);
      change[i][k] = exact(motion.x[1][ends[i][1]][k]) - exact(motion.x[1][ends[i][0]][k]) - start[i][k];
    }
  }
}

enum class CubicBound { VALUE, VALUE_PAIRS, SLOPE };

/// A time is the last number of the input.
MarginInput cubicInput(RandomSource& random) {
  V3 u[2], v[2], w[2];
  for (V3* vector : {u, v, w}) {
    for (int t = 0; t < 2; ++t) vector[t] = heavyVector(random);
  }
  MarginInput input = pairOf(anyKind(random), u, v, w, random);
  if (random() % 2) {  // nearly at rest: all of the size counts at every time
    for (int i = 0; i < 12; ++i) input.x[12 + i] = input.x[i] * (1 + 0x1p-20 * uniform(random));
  }
  const double t = (share(random) + 1) - 1;
  flatten(input, t);
  input.x.push_back(t);
  return input;
}

IsWrong judgeCubic(const MarginInput& input, CubicBound bound) {
  const PairKind kind = kindOf(input);
  const PairMotion motion = motionOf(input);
  const double t = (std::min(1.0, std::max(0.0, input.x[24])) + 1) - 1;
  Rational start[3][3], change[3][3];
  exactDifferences(kind, motion, start, change);
  std::array<std::array<Rational, 3>, 3> at;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) at[i][k] = start[i][k] + exact(t) * change[i][k];
  }
  Rational truth = bound == CubicBound::SLOPE ? Rational(0) : determinant(at);
  if (bound == CubicBound::SLOPE) {
    for (int i = 0; i < 3; ++i) {
      auto one = at;
      for (int k = 0; k < 3; ++k) one[i][k] = change[i][k];
      truth += determinant(one);
    }
  }
  return [=] {
    const exact::CoplanarityCubic f(kind, motion);
    if (bound == CubicBound::VALUE) {
      return abs(exact(f.roughValueAt(t)) - truth) > exact(f.roughError());
    }
    if (bound == CubicBound::SLOPE) return abs(exact(f.slopeAt(t)) - truth) > exact(f.slopeError());
    const double value = f.valueAt(t);  // rounded once more, which changes no sign
    return abs(exact(value) - truth) > exact(f.error()) + exact(0x1p-53 * std::fabs(value));
  };
}

// --- subdivision -----------------------------------------------------------------------------------------------------

/// A vertex meets a corner of a face at a dyadic time, on its left along one axis before, along another one after.
MarginInput cornerPair(RandomSource& random) {
  PairMotion motion;
  const int steps = 1 + static_cast<int>(random() % 127);  // the time times 128
  for (int k = 0; k < 3; ++k) {
    const double corner0 = heavy(random), corner1 = -corner0 * (1 + 0.125 * share(random));
    // Ahead by 3 (1 - t) - ... : zero at the time, of either sign before and after.
    const double unit = std::ldexp(static_cast<double>(1 + random() % 7), -50 + static_cast<int>(random() % 10));
    const double side = k == 0 ? 1 : k == 1 ? -1 : 0;
    motion.x[0][1][k] = corner0;
    motion.x[1][1][k] = corner1;
    motion.x[0][0][k] = corner0 + side * unit * steps;
    motion.x[1][0][k] = corner1 - side * unit * (128 - steps);
    for (int i = 2; i < 4; ++i) {  // the other corners lie further left
      motion.x[0][i][k] = corner0 - 0.25 * share(random);
      motion.x[1][i][k] = corner1 - 0.25 * share(random);
    }
  }
  return inputOf(PairKind::VERTEX_FACE, motion);
}

// --- conservative ----------------------------------------------------------------------------------------------------

/// The numbers: a pair, a distance, a tolerance.
MarginInput distancePair(RandomSource& random, bool near) {
  const PairKind kind = anyKind(random);
  V3 u[2], v[2], w[2];
  double a, b;
  weights(random, kind, random() % 4 == 0, a, b);
  u[0] = heavyVector(random);
  v[0] = heavyVector(random);
  const double thin = random() % 3 == 0 ? power(random, -10, 0) : 1;
  v[0] *= thin;
  const double distance = random() % 2 ? power(random, -20, 0) : power(random, -2, 1);
  w[0] = meeting(kind, u[0], v[0], a, b) + distance * u[0].cross(v[0]).normalized();
  if (random() % 4 == 0) w[0] = distance * heavyVector(random);
  const auto motion = random() % 3;
  for (V3* vector : {u, v, w}) {
    vector[1] = motion == 0 ? vector[0] : motion == 1 ? V3(vector[0]) : V3(heavyVector(random));
  }
  if (motion == 1) w[1] += anyVector(random);
  MarginInput input = pairOf(kind, u, v, w, random);
  const PairMotion pair = motionOf(input);
  double d = approximateDistanceAt(kind, pair, 0);
  if (!(d > 1e-9)) return distancePair(random, near);
  if (near) {
    const double part = d * (random() % 2 ? 0.5 : share(random));
    input.x.push_back(part);
    input.x.push_back((d - part) + static_cast<double>(random() % 64) * 0x1p-54);
  } else {
    for (auto i = random() % 8; i > 0; --i) d = std::nextafter(d, random() % 2 ? HUGE_VAL : 0);
    input.x.push_back(d);
    input.x.push_back(d * std::ldexp(1.0, -8 - static_cast<int>(random() % 34)));
  }
  return input;
}

IsWrong judgeDistance(const MarginInput& input) {
  Query query;
  query.kind = kindOf(input);
  query.motion = motionOf(input);
  const double d = input.x[24], tolerance = input.x[25];
  const Rational squared_now = squaredDistanceAt(query.kind, query.motion, 0), within = exact(d) + exact(tolerance);
  const bool is_far = squared_now > within * within, is_within = squared_now <= exact(d) * exact(d);
  return [=] {
    if (!(d > 0 && tolerance > 0 && std::isfinite(d + tolerance))) return false;
    AccuracyOptions options;
    options.rung = Accuracy::CONSERVATIVE;
    options.tolerance_m = tolerance;
    const ElementaryResult result = testQuery(*makeRung(options), query, d);
    if (result.verdict == Verdict::CONTACT && result.toc_lower == 0) return is_far;
    return is_within && (result.verdict == Verdict::NO_CONTACT || result.toc_lower > 0);
  };
}

// --- start state, maps, bounds ---------------------------------------------------------------------------------------

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

/// p, q, a, b, c: the segment ends in the face's plane or passes its border, as exactly as doubles can say; flat: all
/// of it in one plane.
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
    return segmentMeetsTriangle(x.data(), x.data() + 3, x.data() + 6, x.data() + 9, x.data() + 12) != meets;
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
  return [x, sign] { return orientation2d(x[0], x[1], x[2], x[3], x[4], x[5]) != sign; };
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

/// Two crossings: plane, from, to of each, nearly at the same time.
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

/// A moving edge that passes a resting line at its border, or parts from it; variant: the axis.
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

/// A resolution and a coordinate on a plane of such a map, or beside it.
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

/// A range that comes within reach of another one: its end at both times, that one's, and the reach.
MarginInput meetingInput(RandomSource& random) {
  MarginInput input;
  const double hi = uniform(random), reach = random() % 2 ? 0 : power(random, -30, -1);
  input.x = {hi + reach + power(random, -40, 1), hi + reach - power(random, -40, 1), hi - 1, hi, reach};
  return input;
}
IsWrong judgeMeeting(const MarginInput& input) {
  const std::vector<double> x = input.x;
  const Rational gap0 = exact(x[0]) - exact(x[3]) - exact(x[4]), gap1 = exact(x[1]) - exact(x[3]) - exact(x[4]);
  return [=] {
    if (!(x[4] >= 0 && x[2] < x[3]) || gap0.sign() <= 0 || gap1.sign() > 0) return false;
    const double min[2] = {x[0], x[1]}, max[2] = {x[0] + 1, x[1] + 1};
    const double bound = firstMeeting(min, max, 1, x[2], x[3], x[4]);
    return exact(bound) * (gap0 - gap1) > gap0;
  };
}

/// Features that meet first in one point; the numbers: a pair and a separation.
MarginInput boundInput(RandomSource& random) {
  PairMotion motion;
  const PairKind kind = anyKind(random);
  const V3 direction =
      random() % 2 ? V3(V3::Unit(static_cast<int>(random() % 3))) : V3(1, random() % 2 ? 1 : 0, random() % 2);
  const double separation = random() % 2 ? 0 : power(random, -20, -1);
  const int first = kind == PairKind::VERTEX_FACE ? 1 : 2;
  const V3 meeting_point = anyVector(random);
  const double t = share(random), before = power(random, -30, 1), after = power(random, -30, 1);
  for (int i = 0; i < 4; ++i) {
    const bool corner = i == 0 || i == first;
    const V3 offset = corner ? V3(V3::Zero()) : V3(0.5 * share(random) * (i < first ? 1 : -1) * direction);
    const double size = i < first ? 1 : 0;
    for (int end = 0; end < 2; ++end) {
      V3 x = meeting_point + offset + size * (end == 0 ? before * t : -after * (1 - t)) * direction;
      if (i < first) x += separation * direction.normalized();
      for (int k = 0; k < 3; ++k) motion.x[end][i][k] = x[k];
    }
  }
  MarginInput input = inputOf(kind, motion);
  input.x.push_back(separation);
  return input;
}
IsWrong judgeBound(const MarginInput& input) {
  const PairKind kind = kindOf(input);
  const PairMotion motion = motionOf(input);
  const double separation = input.x[24];
  if (!(separation >= 0)) return [] { return false; };
  std::optional<Root> toc = separation == 0 ? firstContact(kind, motion) : std::nullopt;
  return [=]() mutable {
    const double bound = linearTocBound(kind, motion, separation);
    if (separation == 0) {
      return toc && (bound > 1 || toc->compareWith(Dyadic::fromDouble(bound)) < 0);
    }
    // Just before the bound the features are certainly further apart.
    const double t = std::min(1.0, bound) * (1 - 0x1p-53);
    return bound > 0 && isWithin(kind, motion, t, separation);
  };
}

// --- no fold ---------------------------------------------------------------------------------------------------------

/// What the plane lies across, and a point near where both coordinates are small, so that the terms cancel.
MarginInput viewInput(RandomSource& random) {
  const V3 along = heavyVector(random);
  const V3 point = random() % 2 ? V3(power(random, -20, 20) * along) : V3(power(random, -20, 20) * heavyVector(random));
  MarginInput input;
  input.x = {along[0], along[1], along[2], point[0], point[1], point[2]};
  return input;
}

/// Whether a projected coordinate is further off than its margin.
IsWrong judgeView(const MarginInput& input) {
  return [input] {
    const ViewPlane plane(V3(input.x[0], input.x[1], input.x[2]));
    const double* point = input.x.data() + 3;
    const std::array<double, 2> seen = plane.coordinates(point);
    const Rational error = exact(ViewPlane::error(V3(point[0], point[1], point[2]).lpNorm<1>()));
    const auto isOff = [&](const V3& axis, double coordinate) {
      Rational truth;
      for (int k = 0; k < 3; ++k) truth += exact(axis[k]) * exact(point[k]);
      return abs(exact(coordinate) - truth) > error;
    };
    return isOff(plane.u, seen[0]) || isOff(plane.w, seen[1]);
  };
}

std::vector<MarginCheck> makeChecks() {
  const auto tier = [](ElementaryResult (*decide)(PairKind, const PairMotion&, int)) { return decide; };
  std::vector<MarginCheck> checks = {
      {"BATCH_VALUE", [](RandomSource& random) { return partingPair(random, -48); }, changeOne, judgeBatch, 4000},
      {"BATCH_MINOR", flatPair, changeOne, judgeBatch, 4000},
      {"BATCH_SEPARATION", restingPair, changeOne, judgeBatch, 4000},
      {"SIMPLE_TIME", returningPair, changeOne, judgeTier(tier(exact::decideAtSimpleTime), 32), 4000},
      {"INSIDE_MINOR", [](RandomSource& random) { return crossingPair(random, -54); }, changeOne,
       judgeTier(tier(exact::decideByDoubleDouble), 52), 4000},
      {"QUADRATIC_SIGN", [](RandomSource& random) { return crossingPair(random, -44); }, changeOne,
       judgeTier(tier(exact::decideByFixedIntegers), 10), 4000},
      {"SUBDIVISION", cornerPair, changeOne,
       judgeTier([](PairKind kind, const PairMotion& pair, int) { return exact::decideBySubdivision(kind, pair); }, 32),
       4000},
      {"CUBIC_VALUE", cubicInput, changeOne,
       [](const MarginInput& input) { return judgeCubic(input, CubicBound::VALUE); }, 4000},
      {"CUBIC_VALUE_PAIRS", cubicInput, changeOne,
       [](const MarginInput& input) { return judgeCubic(input, CubicBound::VALUE_PAIRS); }, 4000},
      {"CUBIC_SLOPE", cubicInput, changeOne,
       [](const MarginInput& input) { return judgeCubic(input, CubicBound::SLOPE); }, 4000},
      {"ADVANCE_SEPARATION", [](RandomSource& random) { return distancePair(random, false); }, changeOne, judgeDistance,
       1500},
      {"ADVANCE_POINT", [](RandomSource& random) { return distancePair(random, true); }, changeOne, judgeDistance,
       1500},
      {"FUSED_CUBIC", [](RandomSource& random) { return partingPair(random, -18); }, changeInFloat, judgePlanarFilter,
       4000},
      {"FUSED_PLANAR", restingPair, changeOne, judgePlanarFilter, 4000},
      {"SEGMENT_LINE", [](RandomSource& random) { return segmentInput(random, false); }, changeOne, judgeSegment, 4000},
      {"SEGMENT_PLANE", [](RandomSource& random) { return segmentInput(random, false); }, changeOne, judgeSegment,
       4000},
      {"SEGMENT_PROJECTED", [](RandomSource& random) { return segmentInput(random, true); }, changeOne, judgeSegment,
       4000},
      {"ORIENTATION_2D", orientation2dInput, changeOne, judgeOrientation2d, 20000},
      {"ORIENTATION_3D", orientation3dInput, changeOne, judgeOrientation3d, 20000},
      {"CROSSING_TIME", crossingInput, changeOne, judgeCrossing, 20000},
      {"SIDE", sideInput, changeOne, judgeSide, 4000},
      {"VOXEL_KEY", keyInput, changeOne, judgeKey, 20000},
      {"MAP_BOUND", meetingInput, changeOne, judgeMeeting, 20000},
      {"SEPARATION_SUM", meetingInput, changeOne, judgeMeeting, 20000},
      {"TOC_BOUND", boundInput, changeOne, judgeBound, 4000},
      {"UNFOLDED_COORDINATE", viewInput, changeOne, judgeView, 4000},
  };
  // So small that what the margins are made of vanishes. What covers that is large, to be a normal number: an input
  // goes wrong only where it is gone.
  const auto tiny = [](MarginInput input, int exponent) {
    for (double& x : input.x) x = std::ldexp(x, exponent);
    return input;
  };
  checks.push_back({"FUSED_UNDERFLOW",
                    [tiny](RandomSource& random) {
                      const bool planar = random() % 2;
                      return tiny(planar ? restingPair(random) : partingPair(random, -18), planar ? -74 : -49);
                    },
                    changeOne, judgePlanarFilter, 4000, 0});
  checks.push_back({"SEGMENT_UNDERFLOW",
                    [tiny](RandomSource& random) {
                      const bool flat = random() % 2;
                      return tiny(segmentInput(random, flat), flat ? -537 : -358);
                    },
                    changeOne, judgeSegment, 4000, 0});
  // These bounds add up what dozens of roundings can do at once, or one margin serves several quantities, of which the
  // others need less: f's outer coefficients beside its middle ones (FUSED_CUBIC), minors beside their sums
  // (FUSED_PLANAR). Search has found no input that needs a tenth of them.
  static const std::map<std::string, double> LESS = {
      {"ADVANCE_POINT", 0.01}, {"BATCH_MINOR", 0.05},       {"CUBIC_VALUE_PAIRS", 0.03},
      {"FUSED_CUBIC", 0.01},   {"FUSED_PLANAR", 0.01},      {"SEGMENT_LINE", 0.03},
      {"SEGMENT_PLANE", 0.01}, {"SEGMENT_PROJECTED", 0.03}, {"SIMPLE_TIME", 0.03},
  };
  for (MarginCheck& check : checks) {
    const auto less = LESS.find(check.margin);
    if (less != LESS.end()) check.held_at = less->second;
  }
  return checks;
}

}  // namespace

const std::vector<MarginCheck>& marginChecks() {
  static const std::vector<MarginCheck> checks = makeChecks();
  return checks;
}

std::vector<MarginInput> marginWitnesses(const std::string& margin) {
  const std::string path = std::string(DEFORMABLE_CCD_SOURCE_DIR) + "/test/margins/witnesses.txt";
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path);
  std::vector<MarginInput> witnesses;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string name, number;
    MarginInput input;
    words >> name >> input.variant;
    while (words >> number) input.x.push_back(std::strtod(number.c_str(), nullptr));
    if (name == margin) witnesses.push_back(input);
  }
  return witnesses;
}

std::string witnessLine(const std::string& margin, const MarginInput& input) {
  std::string line = margin + " " + std::to_string(input.variant);
  char text[40];
  for (const double x : input.x) {
    std::snprintf(text, sizeof text, " %a", x);
    line += text;
  }
  return line;
}

}  // namespace test
}  // namespace dccd
