// Closest points of segments and triangles in plain double, for display and control. Decided with them is only what is
// left out of a separation: wherever the points lie, the features are no farther apart.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "dccd/types.h"

namespace dccd {

struct Closest {
  double u = 0, v = 0;  // along the first and the second segment
  Vec3 on_first = Vec3::Zero(), on_second = Vec3::Zero();
};

/// Closest points of segments a and b by alternating projection onto the closed segments: for two segments, solving for
/// u, clamping, projecting and clamping again is exact (Ericson, Real-Time Collision Detection, 5.1.9).
inline Closest closestOnSegments(const Vec3& a0, const Vec3& a1, const Vec3& b0, const Vec3& b1) {
  const Vec3 da = a1 - a0, db = b1 - b0, between = a0 - b0;
  const double aa = da.squaredNorm(), bb = db.squaredNorm(), ab = da.dot(db);
  const double denominator = aa * bb - ab * ab;
  const auto unit = [](double x) { return std::isfinite(x) ? std::clamp(x, 0.0, 1.0) : 0.0; };
  Closest out;
  out.u = unit((ab * db.dot(between) - bb * da.dot(between)) / denominator);
  out.v = unit((ab * out.u + db.dot(between)) / bb);
  out.u = unit((ab * out.v - da.dot(between)) / aa);
  out.on_first = a0 + out.u * da;
  out.on_second = b0 + out.v * db;
  return out;
}

/// Barycentric weights of p's projection onto the triangle's plane, clamped into the triangle.
inline std::array<double, 3> barycentric(const Vec3& p, const Vec3& f0, const Vec3& f1, const Vec3& f2) {
  const Vec3 e1 = f1 - f0, e2 = f2 - f0, d = p - f0;
  const double d11 = e1.dot(e1), d12 = e1.dot(e2), d22 = e2.dot(e2), dp1 = d.dot(e1), dp2 = d.dot(e2);
  const double denominator = d11 * d22 - d12 * d12;
  double w1 = (d22 * dp1 - d12 * dp2) / denominator, w2 = (d11 * dp2 - d12 * dp1) / denominator;
  if (!std::isfinite(w1) || !std::isfinite(w2)) w1 = w2 = 1.0 / 3;
  w1 = std::clamp(w1, 0.0, 1.0);
  w2 = std::clamp(w2, 0.0, 1.0 - w1);
  return {1 - w1 - w2, w1, w2};
}

inline Vec3 unitOr(const Vec3& v, const Vec3& fallback) {
  const double n = v.norm();
  return n > 0 && std::isfinite(n) ? Vec3(v / n) : fallback;
}

}  // namespace dccd
