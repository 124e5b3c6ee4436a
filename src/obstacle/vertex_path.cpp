#include "obstacle/vertex_path.h"

#include <algorithm>
#include <optional>

namespace dccd {
namespace {

/// One axis of the way from p0 to p1, and the box's planes there.
struct Slab {
  double from, to, lo, hi;
  FeatureMask lo_face, hi_face;

  Slab(const double* p0, const double* p1, const LeafBox& box, int axis)
      : from(p0[axis]),
        to(p1[axis]),
        lo(box.lo[axis]),
        hi(box.hi[axis]),
        lo_face(1u << (2 * axis)),
        hi_face(2u << (2 * axis)) {}

  bool misses() const { return (from < lo && to < lo) || (from > hi && to > hi); }
  /// The faces whose planes the path touches: no others can be hit.
  FeatureMask touched() const {
    const double low = std::min(from, to), high = std::max(from, to);
    return (low <= lo && lo <= high ? lo_face : 0) | (low <= hi && hi <= high ? hi_face : 0);
  }
  bool moves() const { return from != to; }
  bool up() const { return to > from; }
  bool enters() const { return moves() && (from < lo || from > hi); }
  bool leaves() const { return moves() && (up() ? to >= hi : to <= lo); }
  CrossingTime enterTime() const { return {up() ? lo : hi, from, to}; }
  CrossingTime leaveTime() const { return {up() ? hi : lo, from, to}; }
};

}  // namespace

FaceHit firstFaceHit(const double* p0, const double* p1, const LeafBox& box, FeatureMask faces) {
  FaceHit hit;
  const Slab slabs[3] = {{p0, p1, box, 0}, {p0, p1, box, 1}, {p0, p1, box, 2}};
  FeatureMask touched = 0;
  for (const Slab& slab : slabs) {
    if (slab.misses()) return hit;
    touched |= slab.touched();
  }
  if (!(touched & faces)) return hit;
  FeatureMask enter_faces = 0, leave_faces = 0, entered = 0;
  std::optional<CrossingTime> enter, leave;  // the last plane by which the path enters, the first by which it leaves
  for (const Slab& slab : slabs) {
    if (!slab.moves()) enter_faces |= slab.touched();  // the whole path slides in that plane
    if (slab.leaves()) {
      const CrossingTime time = slab.leaveTime();
      const int order = leave ? compare(time, *leave) : -1;
      if (order < 0) leave_faces = 0;
      if (order <= 0) leave_faces |= slab.up() ? slab.hi_face : slab.lo_face;
      if (order < 0) leave = time;
    }
    if (slab.enters()) {
      const CrossingTime time = slab.enterTime();
      const int order = enter ? compare(time, *enter) : 1;
      if (order > 0) entered = 0;
      if (order >= 0) entered |= slab.up() ? slab.lo_face : slab.hi_face;
      if (order > 0) enter = time;
    }
  }
  enter_faces |= entered;
  const int span = leave ? compare(*enter, *leave) : -1;
  if (span > 0) return hit;
  if (span == 0) enter_faces |= leave_faces;  // the path only grazes the box: the point is on all these faces
  if (enter_faces & faces) {
    hit.hit = true;
    hit.time = *enter;
  } else if (leave && (leave_faces & faces)) {
    hit.hit = hit.outward = true;
    hit.time = *leave;
  }
  return hit;
}

}  // namespace dccd
