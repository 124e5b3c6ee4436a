// Separating axes (Gottschalk et al. 1996) with exact signs. Two convex polytopes that are apart are separated by a
// plane parallel to a face of one or to an edge of each, and one such plane contains the face or the edges of the
// mesh's side, so for each product of a mesh edge with a box axis only the side away from the triangle needs a look.
#include "obstacle/start_contact.h"

#include <algorithm>

#include "obstacle/axis_predicates.h"

namespace dccd {
namespace {

/// Where a rectangle lies relative to the line through p0 and p1 in the plane of two axes.
struct LineSides {
  int lowest = 0;   ///< sign of the smallest orientation over the rectangle's corners
  int highest = 0;  ///< sign of the largest
};

/// p0 and p1 must differ in both axes b and c: along an axis the bounds already say the same.
LineSides sidesOfLine(const double* p0, const double* p1, const LeafBox& box, int b, int c) {
  // Orientation (p1-p0) x (q-p0) grows with q_c where p1_b > p0_b, and falls with q_b where p1_c > p0_c.
  const bool right = p1[b] > p0[b], up = p1[c] > p0[c];
  const double b_low = up ? box.hi[b] : box.lo[b], b_high = up ? box.lo[b] : box.hi[b];
  const double c_low = right ? box.lo[c] : box.hi[c], c_high = right ? box.hi[c] : box.lo[c];
  LineSides sides;
  sides.lowest = orientation2d(p0[b], p0[c], p1[b], p1[c], b_low, c_low);
  sides.highest = sides.lowest > 0 ? 1 : orientation2d(p0[b], p0[c], p1[b], p1[c], b_high, c_high);
  return sides;
}

bool boundsMeet(const double* p0, const double* p1, const LeafBox& box) {
  for (int axis = 0; axis < 3; ++axis) {
    if (std::max(p0[axis], p1[axis]) < box.lo[axis] || std::min(p0[axis], p1[axis]) > box.hi[axis]) return false;
  }
  return true;
}

/// Does the triangle's plane pass through the closed box, which its bounds overlap? A degenerate one's does everywhere.
bool planeMeetsBox(const double* p0, const double* p1, const double* p2, const LeafBox& box) {
  for (int axis = 0; axis < 3; ++axis) {
    // A triangle that is level in an axis: its bounds, which overlap the box, are its plane.
    if (p0[axis] == p1[axis] && p0[axis] == p2[axis]) return true;
  }
  bool below = false, above = false;
  for (int corner = 0; corner < 8; ++corner) {
    const double q[3] = {corner & 1 ? box.hi[0] : box.lo[0], corner & 2 ? box.hi[1] : box.lo[1],
                         corner & 4 ? box.hi[2] : box.lo[2]};
    const int side = orientation3d(p0, p1, p2, q);
    below = below || side <= 0;
    above = above || side >= 0;
    if (below && above) return true;
  }
  return false;
}

}  // namespace

bool segmentMeetsBox(const double* p0, const double* p1, const LeafBox& box) {
  if (!boundsMeet(p0, p1, box)) return false;
  for (int axis = 0; axis < 3; ++axis) {
    const int b = (axis + 1) % 3, c = (axis + 2) % 3;
    if (p0[b] == p1[b] || p0[c] == p1[c]) continue;
    const LineSides sides = sidesOfLine(p0, p1, box, b, c);
    if (sides.lowest > 0 || sides.highest < 0) return false;
  }
  return true;
}

TriangleStart triangleMeetsBox(const double* p0, const double* p1, const double* p2, const LeafBox& box) {
  const double* points[3] = {p0, p1, p2};
  for (int axis = 0; axis < 3; ++axis) {
    const double lo = std::min(p0[axis], std::min(p1[axis], p2[axis]));
    const double hi = std::max(p0[axis], std::max(p1[axis], p2[axis]));
    if (hi < box.lo[axis] || lo > box.hi[axis]) return TriangleStart::APART;
  }
  for (const double* point : points) {
    if (pointInBox(point, box)) return TriangleStart::BOUNDARY;
  }
  for (int side = 0; side < 3; ++side) {
    const double *a = points[side], *b = points[(side + 1) % 3], *third = points[(side + 2) % 3];
    bool apart = !boundsMeet(a, b, box);
    for (int axis = 0; axis < 3; ++axis) {
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      if (a[u] == b[u] || a[v] == b[v]) continue;
      const LineSides sides = sidesOfLine(a, b, box, u, v);
      if (sides.lowest <= 0 && sides.highest >= 0) continue;
      apart = true;
      const int inner = orientation2d(a[u], a[v], b[u], b[v], third[u], third[v]);
      if ((inner >= 0 && sides.highest < 0) || (inner <= 0 && sides.lowest > 0)) return TriangleStart::APART;
    }
    if (!apart) return TriangleStart::BOUNDARY;
  }
  return planeMeetsBox(p0, p1, p2, box) ? TriangleStart::INTERIOR : TriangleStart::APART;
}

}  // namespace dccd
