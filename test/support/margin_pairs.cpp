#include "support/margin_pairs.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "oracle/exact_distance.h"

namespace dccd {
namespace test {
namespace margins {
namespace {

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

/// w for the features to meet at these weights.
V3 meeting(PairKind kind, const V3& u, const V3& v, double a, double b) {
  return kind == PairKind::VERTEX_FACE ? V3(a * u + b * v) : V3(a * u - b * v);
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

}  // namespace

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

void changeInFloat(MarginInput& input, RandomSource& random) {
  const std::size_t i = random() % 12;
  const double change = uniform(random) * std::ldexp(std::fabs(input.x[i]), -static_cast<int>(random() % 28));
  input.x[i] += change;
  input.x[12 + i] += change;
  flatten(input, 0);
}

MarginInput pairAndTime(RandomSource& random) {
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

}  // namespace margins
}  // namespace test
}  // namespace dccd
