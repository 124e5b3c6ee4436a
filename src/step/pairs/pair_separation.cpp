#include "step/pairs/pair_separation.h"

#include <cmath>
#include <limits>

#include "step/pairs/closest_points.h"

namespace dccd {
namespace {

double segmentDistance(const Vec3& a0, const Vec3& a1, const Vec3& b0, const Vec3& b1) {
  const Closest closest = closestOnSegments(a0, a1, b0, b1);
  return (closest.on_first - closest.on_second).norm();
}

}  // namespace

double restDistance(PairKind kind, const std::array<Vec3, 4>& x) {
  if (kind == PairKind::EDGE_EDGE) return segmentDistance(x[0], x[1], x[2], x[3]);
  const std::array<double, 3> w = barycentric(x[0], x[1], x[2], x[3]);
  return std::min({(w[0] * x[1] + w[1] * x[2] + w[2] * x[3] - x[0]).norm(), segmentDistance(x[0], x[0], x[1], x[2]),
                   segmentDistance(x[0], x[0], x[2], x[3]), segmentDistance(x[0], x[0], x[3], x[1])});
}

void SeparationRule::leaveOut(PairKind kind, const Quad& pair, PairSeparation& s) const {
  std::array<Vec3, 4> at;
  for (std::size_t i = 0; i < 4; ++i) {
    at[i] = (*own->setup.reference)[own->slot_vertex[pair[i] - own->internal_begin]];
  }
  double corners_m = std::numeric_limits<double>::infinity(), apart_m = -1;  // below 0: not asked for
  const std::size_t firsts = factsOf(kind).vertices[0];
  for (std::size_t i = 0; i < firsts; ++i) {
    for (std::size_t j = firsts; j < 4; ++j) corners_m = std::min(corners_m, (at[i] - at[j]).squaredNorm());
  }
  corners_m = std::sqrt(corners_m);
  const auto isWithin = [&](double m) {  // most neighbours are so by two corners
    if (corners_m <= m) return true;
    if (apart_m < 0) apart_m = restDistance(kind, at);
    return apart_m <= m;
  };
  s.left_out = bodies_m > 0 && isWithin(bodies_m + tolerance_m);
  if (s.left_out) {
    s.total_m = s.noise_m = 0;
  } else if (s.noise_m > 0 && isWithin(s.total_m + tolerance_m)) {
    s.unsure_m = s.total_m;
    s.total_m = bodies_m;
    s.noise_m = 0;
  }
}

}  // namespace dccd
