#include "paper/non_penetration.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace dccd {
namespace {

template <class Real>
struct Vector {
  Real x, y, z;
  Real largest() const { return std::max(std::abs(x), std::max(std::abs(y), std::abs(z))); }
};
template <class Real>
Vector<Real> operator-(const Vector<Real>& a, const Vector<Real>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class Real>
Vector<Real> operator+(const Vector<Real>& a, const Vector<Real>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class Real>
Vector<Real> cross(const Vector<Real>& a, const Vector<Real>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class Real>
Real dot(const Vector<Real>& a, const Vector<Real>& b) {
  return (a.x * b.x + a.y * b.y) + a.z * b.z;
}

/// x[time][point]. half_ulp: the unit roundoff of Real.
template <class Real>
CoplanarityCoefficients<Real> coefficients(PairKind kind, const Vector<Real> (&x)[2][4], Real error, Real half_ulp) {
  Vector<Real> u[2], v[2], w[2];
  Real m = 0;
  for (int t = 0; t < 2; ++t) {
    const bool vf = kind == PairKind::VERTEX_FACE;
    u[t] = vf ? x[t][2] - x[t][1] : x[t][1] - x[t][0];
    v[t] = vf ? x[t][3] - x[t][1] : x[t][3] - x[t][2];
    w[t] = vf ? x[t][0] - x[t][1] : x[t][2] - x[t][0];
    m = std::max(m, std::max(u[t].largest(), std::max(v[t].largest(), w[t].largest())));
  }
  const Vector<Real> n00 = cross(u[0], v[0]), n11 = cross(u[1], v[1]);
  const Vector<Real> n01 = cross(u[0], v[1]) + cross(u[1], v[0]);
  CoplanarityCoefficients<Real> c;
  c.b[0] = dot(n00, w[0]);
  c.b[1] = dot(n00, w[1]) + dot(n01, w[0]);
  c.b[2] = dot(n01, w[1]) + dot(n11, w[0]);
  c.b[3] = dot(n11, w[1]);
  const Real e = 2 * error + m * (2 * half_ulp);
  c.margin = ((128 * e) * (m + e)) * (m + e);
  if (error == 0 && !(m >= Real(0x1p-300) && m <= Real(0x1p300))) c.margin = std::numeric_limits<Real>::infinity();
  return c;
}

template <class Real>
bool oneStrictSign(const CoplanarityCoefficients<Real>& c) {
  return (c.b[0] > c.margin && c.b[1] > c.margin && c.b[2] > c.margin && c.b[3] > c.margin) ||
         (c.b[0] < -c.margin && c.b[1] < -c.margin && c.b[2] < -c.margin && c.b[3] < -c.margin);
}

}  // namespace

CoplanarityCoefficients<double> coplanarityCoefficients(PairKind kind, const VertexMotion* vertices, const Quad& pair) {
  Vector<double> x[2][4];
  for (std::size_t i = 0; i < 4; ++i) {
    const VertexMotion& v = vertices[pair[i]];
    x[0][i] = {v.t0[0], v.t0[1], v.t0[2]};
    x[1][i] = {v.t1[0], v.t1[1], v.t1[2]};
  }
  return coefficients<double>(kind, x, 0.0, 0x1p-53);
}

CoplanarityCoefficients<float> coplanarityCoefficients(PairKind kind, const PaperRecord* records, const Quad& pair,
                                                       float error) {
  Vector<float> x[2][4];
  for (std::size_t i = 0; i < 4; ++i) {
    const PaperRecord& r = records[pair[i]];
    x[0][i] = {r.t0[PAPER_AXIS_LANE[0]], r.t0[PAPER_AXIS_LANE[1]], r.t0[PAPER_AXIS_LANE[2]]};
    x[1][i] = {r.t1[PAPER_AXIS_LANE[0]], r.t1[PAPER_AXIS_LANE[1]], r.t1[PAPER_AXIS_LANE[2]]};
  }
  return coefficients<float>(kind, x, error, 0x1p-24f);
}

bool nonPenetrationSeparated(PairKind kind, const VertexMotion* vertices, const Quad& pair) {
  return oneStrictSign(coplanarityCoefficients(kind, vertices, pair));
}

bool nonPenetrationSeparated(PairKind kind, const PaperRecord* records, const Quad& pair, float error) {
  return oneStrictSign(coplanarityCoefficients(kind, records, pair, error));
}

}  // namespace dccd
