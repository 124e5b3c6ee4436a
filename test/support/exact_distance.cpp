#include "support/exact_distance.h"

#include <algorithm>
#include <array>

namespace deformable_ccd {
namespace test {
namespace {

using Point = std::array<Rational, 3>;

Point operator-(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Rational dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Point cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Rational pointSegment(const Point& p, const Point& a, const Point& b) {
  const Point direction = b - a, offset = p - a;
  const Rational length = dot(direction, direction), along = dot(offset, direction);
  if (along <= 0) return dot(offset, offset);
  if (along >= length) return dot(p - b, p - b);
  return dot(offset, offset) - along * along / length;
}

Rational pointTriangle(const Point& p, const Point& a, const Point& b, const Point& c) {
  const Point normal = cross(b - a, c - a);
  const Rational area = dot(normal, normal);
  const bool above = area > 0 && dot(cross(b - a, p - a), normal) >= 0 && dot(cross(c - b, p - b), normal) >= 0 &&
                     dot(cross(a - c, p - c), normal) >= 0;
  if (above) {
    const Rational height = dot(p - a, normal);
    return height * height / area;
  }
  return std::min({pointSegment(p, a, b), pointSegment(p, b, c), pointSegment(p, c, a)});
}

Rational segmentSegment(const Point& a, const Point& b, const Point& c, const Point& d) {
  const Rational ends =
      std::min({pointSegment(a, c, d), pointSegment(b, c, d), pointSegment(c, a, b), pointSegment(d, a, b)});
  // The lines come closest at a + s (b-a) and c + r (d-c); that counts where both lie on the segments.
  const Point u = b - a, v = d - c, w = a - c;
  const Rational uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), uw = dot(u, w), vw = dot(v, w);
  const Rational denominator = uu * vv - uv * uv;
  if (denominator == 0) return ends;
  const Rational s = (uv * vw - vv * uw) / denominator, r = (uu * vw - uv * uw) / denominator;
  if (s < 0 || s > 1 || r < 0 || r > 1) return ends;
  Point gap;
  for (int axis = 0; axis < 3; ++axis) gap[axis] = w[axis] + s * u[axis] - r * v[axis];
  return std::min(ends, dot(gap, gap));
}

}  // namespace

Rational squaredDistanceAt(PairKind kind, const PairMotion& pair, double t) {
  const Rational time(t);
  std::array<Point, 4> p;
  for (int point = 0; point < 4; ++point) {
    for (int axis = 0; axis < 3; ++axis) {
      const Rational start(pair.x[0][point][axis]);
      p[point][axis] = start + time * (Rational(pair.x[1][point][axis]) - start);
    }
  }
  return kind == PairKind::VERTEX_FACE ? pointTriangle(p[0], p[1], p[2], p[3]) : segmentSegment(p[0], p[1], p[2], p[3]);
}

bool isWithin(PairKind kind, const PairMotion& pair, double t, double bound) {
  const Rational exact(bound);
  return squaredDistanceAt(kind, pair, t) <= exact * exact;
}

}  // namespace test
}  // namespace deformable_ccd
