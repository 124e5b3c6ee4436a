#include "stream/rigid_shape.h"

#include <algorithm>
#include <cmath>

#include "step/start/inside.h"

namespace dccd {
namespace {

// Each way. Cells in each of which all that is half a voxel from the surface is on the same side of it: their diagonal
// is 0.43 voxels.
constexpr int CELLS_A_VOXEL = 4;
// Cells that are remembered: some 8 MB.
constexpr std::size_t MOST_REMEMBERED_CELLS = std::size_t{1} << 18;

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
  inside_.clear();
  resolution_m_ = resolution_m;
  topology_ = frame.topology;
}

bool RigidShape::holds(const Vec3& point) {
  if (!bounds_.contains(point)) return false;
  const double cell_m = resolution_m_ / CELLS_A_VOXEL;
  const Vec3 cell = ((point - bounds_.min()) / cell_m).array().floor();
  const bool has_number = (cell.array() < double{1 << 20}).all();
  const Vec3 middle = bounds_.min() + cell_m * (cell.array() + 0.5).matrix();
  if (!has_number) return isInside(points_, topology_->faces(), point);
  const std::uint64_t number = static_cast<std::uint64_t>(cell.x()) | static_cast<std::uint64_t>(cell.y()) << 20 |
                               static_cast<std::uint64_t>(cell.z()) << 40;
  const auto known = inside_.find(number);
  if (known != inside_.end()) return known->second;
  if (inside_.size() >= MOST_REMEMBERED_CELLS) inside_.clear();
  return inside_[number] = isInside(points_, topology_->faces(), middle);
}

}  // namespace dccd
