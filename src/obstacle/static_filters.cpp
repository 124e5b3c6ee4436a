#include "obstacle/static_filters.h"

#include <algorithm>
#include <cmath>

#include "dccd/tolerances.h"

namespace dccd {
namespace {

struct Planar {
  double b, c;
};

/// A vertex at both times, seen from the static point, in the plane of two axes.
struct PlanarPath {
  Planar t0, t1;
};

PlanarPath seenFrom(const VertexMotion& vertex, const double* point, int b, int c) {
  return {{vertex.t0[b] - point[b], vertex.t0[c] - point[c]}, {vertex.t1[b] - point[b], vertex.t1[c] - point[c]}};
}

double magnitude(const PlanarPath& path) {
  return std::max(std::max(std::abs(path.t0.b), std::abs(path.t0.c)),
                  std::max(std::abs(path.t1.b), std::abs(path.t1.c)));
}

double cross(const Planar& u, const Planar& v) { return u.b * v.c - u.c * v.b; }

/// Below and above this the margin might underflow or a product overflow; nothing is proved there.
constexpr double SMALLEST = tolerance::SIDE_SMALLEST_M, LARGEST = tolerance::SIDE_LARGEST_M;

/// The rounding margin of side(), given M = the largest rounded difference. A difference carries one rounding, a
/// product of two three, a cross product 2 * 3 + 2 of M^2 * 2^-53, the sum of two twice that plus 4: 20.1 in all.
double sideMargin(double largest) { return tolerance::SIDE * largest * largest; }

/// +1 or -1 where the point is certainly strictly left or right of the moving segment u v during the whole step, by the
/// strict common sign of the three Bernstein coefficients of u x v (the middle one doubled); 0 otherwise.
int side(const PlanarPath& u, const PlanarPath& v, double margin) {
  const double a = cross(u.t0, v.t0), c = cross(u.t1, v.t1);
  const double b = cross(u.t0, v.t1) + cross(u.t1, v.t0);
  if (a > margin && b > margin && c > margin) return 1;
  if (a < -margin && b < -margin && c < -margin) return -1;
  return 0;
}

}  // namespace

bool edgeMissesLine(const VertexMotion& p, const VertexMotion& q, const double* point, int axis) {
  const int b = (axis + 1) % 3, c = (axis + 2) % 3;
  const PlanarPath u = seenFrom(p, point, b, c), v = seenFrom(q, point, b, c);
  const double largest = std::max(magnitude(u), magnitude(v));
  return largest > SMALLEST && largest < LARGEST && side(u, v, sideMargin(largest)) != 0;
}

bool triangleMissesPoint(const VertexMotion& p, const VertexMotion& q, const VertexMotion& r, const double* point) {
  for (int axis = 0; axis < 3; ++axis) {
    const int b = (axis + 1) % 3, c = (axis + 2) % 3;
    const PlanarPath u = seenFrom(p, point, b, c), v = seenFrom(q, point, b, c), w = seenFrom(r, point, b, c);
    const double largest = std::max(magnitude(u), std::max(magnitude(v), magnitude(w)));
    if (!(largest > SMALLEST && largest < LARGEST)) continue;
    // A point of a closed triangle, degenerate or not, is never strictly left of one side and strictly right of
    // another.
    const double margin = sideMargin(largest);
    const int sides[3] = {side(u, v, margin), side(v, w, margin), side(w, u, margin)};
    if (std::max(sides[0], std::max(sides[1], sides[2])) > 0 && std::min(sides[0], std::min(sides[1], sides[2])) < 0) {
      return true;
    }
  }
  return false;
}

double firstMeeting(const double* min, const double* max, int stride, double lo, double hi, double reach) {
  if (reach > 0) {  // rounded once, and outward by more than that
    lo -= reach;
    hi += reach;
    lo -= tolerance::MAP_BOUND * std::abs(lo);
    hi += tolerance::MAP_BOUND * std::abs(hi);
  }
  const double gap_t0 = std::max(lo - max[0], min[0] - hi);
  if (!(gap_t0 > 0)) return 0;
  const double gap_t1 = lo - max[0] > 0 ? lo - max[stride] : min[stride] - hi;
  if (gap_t1 > 0) return 2;
  // Four roundings, each at most 2^-53 relative where nothing overflows; otherwise the bound is 0.
  const double time = gap_t0 / (gap_t0 - gap_t1) * (1 - tolerance::SEPARATION_SUM);
  return time >= 0 && time <= 1 ? time : 0;
}

}  // namespace dccd
