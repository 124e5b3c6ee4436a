// Positions in the map's frame: one rounding for the step and for the trace of a pair.
#pragma once

#include "dccd/types.h"

namespace dccd {

/// `fixed` itself where the frames are the same, else `moved`, filled with the positions in the map's frame [m].
inline const Positions& inMapFrame(const Eigen::Isometry3d& map_from_fixed, const Positions& fixed, Positions& moved) {
  if (map_from_fixed.matrix() == Eigen::Isometry3d::Identity().matrix()) return fixed;
  moved.resize(fixed.size());
  const Eigen::Matrix3d rotation = map_from_fixed.linear();
  const Vec3 translation = map_from_fixed.translation();
  for (std::size_t i = 0; i < fixed.size(); ++i) moved[i] = rotation * fixed[i] + translation;
  return moved;
}

}  // namespace dccd
