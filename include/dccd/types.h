// Basic types shared by every part of the package. Free of ROS, PCL and OctoMap.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace dccd {

using Vec3 = Eigen::Vector3d;  ///< metres, in the fixed frame unless a name says otherwise
using Index = std::uint32_t;   ///< vertex, edge or face index
constexpr Index NO_INDEX = std::numeric_limits<Index>::max();

using Edge = std::array<Index, 2>;  ///< vertex indices, the smaller one first
using Face = std::array<Index, 3>;  ///< vertex indices in the order of the input
using Positions = std::vector<Vec3>;
using StampNs = std::int64_t;  ///< nanoseconds; the stamp of a mesh, never the wall clock
inline double secondsBetween(StampNs from_ns, StampNs to_ns) {
  // Unsigned, for two stamps can be further apart than the largest of them.
  const auto from = static_cast<std::uint64_t>(from_ns), to = static_cast<std::uint64_t>(to_ns);
  return (to_ns < from_ns ? -static_cast<double>(from - to) : static_cast<double>(to - from)) * 1e-9;
}

/// A closed axis-aligned box.
struct Box {
  Vec3 min = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 max = Vec3::Constant(-std::numeric_limits<double>::infinity());
  bool empty() const { return !(min.array() <= max.array()).all(); }
  friend bool operator==(const Box& a, const Box& b) { return a.min == b.min && a.max == b.max; }
};

}  // namespace dccd
