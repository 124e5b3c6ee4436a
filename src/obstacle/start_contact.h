// What touches a closed box at t=0: exact tests of a static point, segment and triangle against an axis-aligned box.
#pragma once

#include "obstacle/voxel_surface_impl.h"

namespace dccd {

inline bool pointInBox(const double* p, const LeafBox& box) {
  return p[0] >= box.lo[0] && p[0] <= box.hi[0] && p[1] >= box.lo[1] && p[1] <= box.hi[1] && p[2] >= box.lo[2] &&
         p[2] <= box.hi[2];
}

/// Does the closed segment meet the closed box?
bool segmentMeetsBox(const double* p0, const double* p1, const LeafBox& box);

enum class TriangleStart : std::uint8_t {
  APART,     ///< the closed triangle misses the closed box
  BOUNDARY,  ///< the box meets a side or a corner of the triangle
  INTERIOR   ///< the box meets the triangle, but none of its sides: it pierces the triangle
};

TriangleStart triangleMeetsBox(const double* p0, const double* p1, const double* p2, const LeafBox& box);

}  // namespace dccd
