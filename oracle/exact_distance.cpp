#include "oracle/exact_distance.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace dccd {
namespace test {
namespace {

// The same formulas in rationals, where they are exact, and in doubles, where they guide a search.
template <typename Number>
using Point = std::array<Number, 3>;

template <typename Number>
Point<Number> operator-(const Point<Number>& a, const Point<Number>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
template <typename Number>
Number dot(const Point<Number>& a, const Point<Number>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
template <typename Number>
Point<Number> cross(const Point<Number>& a, const Point<Number>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

template <typename Number>
Number pointSegment(const Point<Number>& p, const Point<Number>& a, const Point<Number>& b) {
  const Point<Number> direction = b - a, offset = p - a;
  const Number length = dot(direction, direction), along = dot(offset, direction);
  if (along <= 0) return dot(offset, offset);
  if (along >= length) return dot(p - b, p - b);
  return dot(offset, offset) - along * along / length;
}

template <typename Number>
Number pointTriangle(const Point<Number>& p, const Point<Number>& a, const Point<Number>& b, const Point<Number>& c) {
  const Point<Number> normal = cross(b - a, c - a);
  const Number area = dot(normal, normal);
  const bool above = area > 0 && dot(cross(b - a, p - a), normal) >= 0 && dot(cross(c - b, p - b), normal) >= 0 &&
                     dot(cross(a - c, p - c), normal) >= 0;
  if (above) {
    const Number height = dot(p - a, normal);
    return height * height / area;
  }
  return std::min<Number>({pointSegment(p, a, b), pointSegment(p, b, c), pointSegment(p, c, a)});
}

template <typename Number>
Number segmentSegment(const Point<Number>& a, const Point<Number>& b, const Point<Number>& c, const Point<Number>& d) {
  const Number ends =
      std::min<Number>({pointSegment(a, c, d), pointSegment(b, c, d), pointSegment(c, a, b), pointSegment(d, a, b)});
  // The lines come closest at a + s (b-a) and c + r (d-c); that counts where both lie on the segments.
  const Point<Number> u = b - a, v = d - c, w = a - c;
  const Number uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), uw = dot(u, w), vw = dot(v, w);
  const Number denominator = uu * vv - uv * uv;
  if (denominator == 0) return ends;
  const Number s = (uv * vw - vv * uw) / denominator, r = (uu * vw - uv * uw) / denominator;
  if (s < 0 || s > 1 || r < 0 || r > 1) return ends;
  Point<Number> gap;
  for (int axis = 0; axis < 3; ++axis) gap[axis] = w[axis] + s * u[axis] - r * v[axis];
  return std::min(ends, dot(gap, gap));
}

template <typename Number>
Number squaredDistance(PairKind kind, const PairMotion& pair, double t) {
  const Number time(t);
  std::array<Point<Number>, 4> p;
  for (int point = 0; point < 4; ++point) {
    for (int axis = 0; axis < 3; ++axis) {
      const Number start(pair.x[0][point][axis]);
      p[point][axis] = start + time * (Number(pair.x[1][point][axis]) - start);
    }
  }
  return kind == PairKind::VERTEX_FACE ? pointTriangle<Number>(p[0], p[1], p[2], p[3])
                                       : segmentSegment<Number>(p[0], p[1], p[2], p[3]);
}

}  // namespace

Rational squaredDistanceAt(PairKind kind, const PairMotion& pair, double t) {
  return squaredDistance<Rational>(kind, pair, t);
}

double approximateDistanceAt(PairKind kind, const PairMotion& pair, double t) {
  return std::sqrt(std::max(0.0, squaredDistance<double>(kind, pair, t)));
}

bool isWithin(PairKind kind, const PairMotion& pair, double t, double bound) {
  const Rational exact(bound);
  return squaredDistanceAt(kind, pair, t) <= exact * exact;
}

}  // namespace test
}  // namespace dccd
