#include "stream/rigid_shape.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "step/start/inside.h"

namespace dccd {
namespace {

// Each way. Cells in each of which all that is half a voxel from the surface is on the same side of it: their diagonal
// is 0.43 voxels.
constexpr int CELLS_A_VOXEL = 4;
// [voxels] How far a cell's points are from its middle at the most, and what rounding can be.
constexpr double HALF_CELL = 0.2166;
// Of cells that are remembered, a power of two: some 3 MB a body.
constexpr std::size_t CELLS = std::size_t{1} << 17;

}  // namespace

bool isInside(const Positions& positions, const std::vector<Face>& faces, const Vec3& point) {
  bool is_inside = false;
  for (const Face& f : faces) {
    const Sight sight = sightOf(point.data(), positions[f[0]].data(), positions[f[1]].data(), positions[f[2]].data());
    if (sight == Sight::TOUCHED) return true;
    is_inside ^= sight == Sight::ABOVE;
  }
  return is_inside;
}

Vec3 closestOn(const std::array<Vec3, 3>& t, const Vec3& p) {
  const Vec3 ab = t[1] - t[0], ac = t[2] - t[0], ap = p - t[0], bp = p - t[1], cp = p - t[2];
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp), d6 = ac.dot(cp);
  const auto along = [](const Vec3& from, const Vec3& way, double u) -> Vec3 {
    return from + (std::isfinite(u) ? std::clamp(u, 0.0, 1.0) : 0.0) * way;
  };
  if (d1 <= 0 && d2 <= 0) return t[0];
  if (d3 >= 0 && d4 <= d3) return t[1];
  if (d6 >= 0 && d5 <= d6) return t[2];
  const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return along(t[0], ab, d1 / (d1 - d3));
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return along(t[0], ac, d2 / (d2 - d6));
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return along(t[1], t[2] - t[1], (d4 - d3) / ((d4 - d3) + (d5 - d6)));
  const double v = vb / (va + vb + vc), w = vc / (va + vb + vc);
  if (!(v >= 0 && w >= 0 && v + w <= 1)) return t[0];
  return t[0] + v * ab + w * ac;
}

bool RigidShape::isOf(const MeshFrame& frame, double resolution_m) {
  const Eigen::Isometry3d to_body = frame.pose.inverse();
  const auto isSame = [&] {
    if (topology_ != frame.topology || resolution_m_ != resolution_m) return false;
    const double slack_m = SLACK * resolution_m;
    for (std::size_t v = 0; v < points_.size(); ++v) {
      if (!((to_body * frame.positions[v] - points_[v]).squaredNorm() <= slack_m * slack_m)) return false;
    }
    return true;
  };
  if (isSame()) return true;
  for (const Vec3& p : frame.positions) {
    if (!p.allFinite()) return false;
  }
  if (!to_body.matrix().allFinite()) return false;
  build(frame, resolution_m);
  return true;
}

void RigidShape::build(const MeshFrame& frame, double resolution_m) {
  topology_ = nullptr;  // until all is made
  const Eigen::Isometry3d to_body = frame.pose.inverse();
  points_.clear();
  for (const Vec3& p : frame.positions) points_.push_back(to_body * p);
  bounds_.setEmpty();
  for (const Index v : frame.topology->usedVertices()) bounds_.extend(points_[v]);
  boxes_.clear();
  for (const Face& f : frame.topology->faces()) {
    Eigen::AlignedBox3d& box = boxes_.emplace_back(points_[f[0]]);
    box.extend(points_[f[1]]).extend(points_[f[2]]);
  }
  struct Box {
    Vec3 lo, hi;
  };
  faces_.build(boxes_.size(), 2 * resolution_m, [&](std::size_t f) { return Box{boxes_[f].min(), boxes_[f].max()}; });
  asked_.assign(boxes_.size(), 0);
  question_ = 0;
  cells_.clear();
  resolution_m_ = resolution_m;
  topology_ = frame.topology;
}

RigidShape::Cell* RigidShape::cellOf(const Vec3& point, Vec3& middle) {
  constexpr std::int64_t HALF = std::int64_t{1} << 20;
  const double cell_m = resolution_m_ / CELLS_A_VOXEL;
  const Vec3 cell = ((point - bounds_.min()) / cell_m).array().floor();
  if (!(cell.array().abs() < static_cast<double>(HALF)).all()) return nullptr;
  middle = bounds_.min() + cell_m * (cell.array() + 0.5).matrix();
  std::uint64_t number = 0;
  for (const double c : cell) number = number << 21 | static_cast<std::uint64_t>(static_cast<std::int64_t>(c) + HALF);
  if (cells_.empty()) cells_.resize(CELLS);
  Cell& found = cells_[number * 0x9e3779b97f4a7c15U >> 32 & (CELLS - 1)];
  if (found.number != number) {
    found = Cell();
    found.number = number;
  }
  return &found;
}

bool RigidShape::holds(const Vec3& point) {
  if (!bounds_.contains(point)) return false;
  Vec3 middle;
  Cell* const cell = cellOf(point, middle);
  if (!cell) return isInside(points_, topology_->faces(), point);
  if (cell->inside < 0) cell->inside = isInside(points_, topology_->faces(), middle) ? 1 : 0;
  return cell->inside > 0;
}

RigidShape::Away RigidShape::away(const Vec3& point, double far_m) {
  constexpr double INF = std::numeric_limits<double>::infinity();
  constexpr double FLOAT = 0x1p-23;  // of a float's size, what it may be off
  const double half_m = HALF_CELL * resolution_m_;
  Vec3 middle;
  Cell* const cell = cellOf(point, middle);
  if (!cell) return {0, INF};
  if (cell->least_m < 0) {
    const double asked_m = far_m + half_m;
    double found2 = asked_m * asked_m;
    bool any = false;
    anyNear(middle, asked_m, [&](std::uint32_t number) {
      if (boxes_[number].squaredExteriorDistance(middle) > found2) return false;
      const double away2 = (closestOn(face(number), middle) - middle).squaredNorm();
      any = any || away2 <= found2;
      found2 = std::min(found2, away2);
      return false;
    });
    const double found_m = std::sqrt(found2);
    cell->least_m = static_cast<float>(found_m * (1 - FLOAT));
    cell->most_m = any ? static_cast<float>(found_m * (1 + FLOAT)) : std::numeric_limits<float>::infinity();
  }
  return {cell->least_m - half_m, cell->most_m + half_m};
}

}  // namespace dccd
