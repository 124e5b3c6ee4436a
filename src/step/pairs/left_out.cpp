#include "step/pairs/left_out.h"

#include <algorithm>

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
  double distance = std::min({segmentDistance(x[0], x[0], x[1], x[2]), segmentDistance(x[0], x[0], x[2], x[3]),
                              segmentDistance(x[0], x[0], x[3], x[1])});
  const Vec3 normal = (x[2] - x[1]).cross(x[3] - x[1]);
  const auto inside = [&](const Vec3& a, const Vec3& b) { return (b - a).cross(x[0] - a).dot(normal) >= 0; };
  if (normal.squaredNorm() > 0 && inside(x[1], x[2]) && inside(x[2], x[3]) && inside(x[3], x[1])) {
    distance = std::min(distance, std::abs((x[0] - x[1]).dot(normal)) / normal.norm());
  }
  return distance;
}

void LeftOutOfBody::set(PairKind kind, const std::vector<LeftOutKey>& keys, Index first_rank, std::size_t count) {
  Table& table = tables_[static_cast<int>(kind)];
  table.first_rank = first_rank;
  table.begin.assign(keys.empty() ? 0 : count + 1, 0);
  table.partners.clear();
  table.partners.reserve(keys.size());
  table.distances_m.clear();
  table.distances_m.reserve(keys.size());
  for (const LeftOutKey& one : keys) {
    ++table.begin[static_cast<std::size_t>(one.key >> 32) - first_rank + 1];
    table.partners.push_back(static_cast<Index>(one.key));
    table.distances_m.push_back(one.distance_m);
  }
  for (std::size_t i = 1; i < table.begin.size(); ++i) table.begin[i] += table.begin[i - 1];
}

}  // namespace dccd
