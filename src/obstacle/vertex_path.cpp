#include "obstacle/vertex_path.h"

#include <algorithm>

namespace dccd {
namespace {

/// The crossings of one axis: the planes at which the path enters and leaves the slab, if it does within the step.
struct SlabPath {
  bool enters = false, leaves = false;
  FeatureMask enter_face = 0, leave_face = 0;
  FeatureMask slide_faces = 0;  ///< faces whose plane holds the whole path
  CrossingTime enter, leave;
};

/// False where the path misses the slab.
bool clipToSlab(double from, double to, double lo, double hi, int axis, SlabPath& path) {
  const FeatureMask lo_face = 1u << (2 * axis), hi_face = 2u << (2 * axis);
  if ((from < lo && to < lo) || (from > hi && to > hi)) return false;
  if (from == to) {
    path.slide_faces = (from == lo ? lo_face : 0) | (from == hi ? hi_face : 0);
    return true;
  }
  const bool up = to > from;
  if (from < lo || from > hi) {
    path.enters = true;
    path.enter_face = up ? lo_face : hi_face;
    path.enter = CrossingTime(up ? lo : hi, from, to);
  }
  if (up ? to >= hi : to <= lo) {
    path.leaves = true;
    path.leave_face = up ? hi_face : lo_face;
    path.leave = CrossingTime(up ? hi : lo, from, to);
  }
  return true;
}

/// The faces whose planes the path touches: no others can be hit.
FeatureMask touchedPlanes(const double* p0, const double* p1, const LeafBox& box) {
  FeatureMask touched = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double low = std::min(p0[axis], p1[axis]), high = std::max(p0[axis], p1[axis]);
    const bool lo = low <= box.lo[axis] && box.lo[axis] <= high, hi = low <= box.hi[axis] && box.hi[axis] <= high;
    touched |= static_cast<FeatureMask>(lo | hi << 1) << (2 * axis);
  }
  return touched;
}

}  // namespace

FaceHit firstFaceHit(const double* p0, const double* p1, const LeafBox& box, FeatureMask faces) {
  FaceHit hit;
  if (!(touchedPlanes(p0, p1, box) & faces)) return hit;
  SlabPath paths[3];
  for (int axis = 0; axis < 3; ++axis) {
    if (!clipToSlab(p0[axis], p1[axis], box.lo[axis], box.hi[axis], axis, paths[axis])) return hit;
  }
  const CrossingTime* enter = nullptr;
  const CrossingTime* leave = nullptr;
  FeatureMask enter_faces = 0, leave_faces = 0;
  for (const SlabPath& path : paths) {
    enter_faces |= path.slide_faces;
    if (path.leaves) {
      const int order = leave == nullptr ? -1 : compare(path.leave, *leave);
      if (order < 0) leave_faces = 0;
      if (order <= 0) leave_faces |= path.leave_face;
      if (order < 0) leave = &path.leave;
    }
  }
  FeatureMask entered = 0;
  for (const SlabPath& path : paths) {
    if (!path.enters) continue;
    const int order = enter == nullptr ? 1 : compare(path.enter, *enter);
    if (order > 0) entered = 0;
    if (order >= 0) entered |= path.enter_face;
    if (order > 0) enter = &path.enter;
  }
  enter_faces |= entered;
  const int span = leave == nullptr ? -1 : compare(*enter, *leave);
  if (span > 0) return hit;
  if (span == 0) enter_faces |= leave_faces;  // the path only grazes the box: the point is on all these faces
  if (enter_faces & faces) {
    hit.hit = true;
    hit.time = *enter;
  } else if (leave != nullptr && (leave_faces & faces)) {
    hit.hit = hit.outward = true;
    hit.time = *leave;
  }
  return hit;
}

}  // namespace dccd
