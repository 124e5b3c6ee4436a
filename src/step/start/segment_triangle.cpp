#include "step/start/segment_triangle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "elementary/exact_integer.h"
#include "elementary/exact_short_integer.h"
#include "simd/segment_filter.h"

namespace dccd {
namespace {

/// What is asked for are signs of terms with one factor of each axis, or of each of two, and which of two points is
/// further along an axis: each axis may have a scale of its own.
template <class Z>
using Point = std::array<Z, 3>;

template <class Z>
Point<Z> minus(const Point<Z>& a, const Point<Z>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
/// Component k of a cross product.
template <class Z>
auto minor(const Point<Z>& a, const Point<Z>& b, int k) {
  const int i = k == 2 ? 0 : k + 1, j = k == 0 ? 2 : k - 1;
  return a[i] * b[j] - a[j] * b[i];
}
template <class Z>
auto cross(const Point<Z>& a, const Point<Z>& b) {
  return Point<decltype(minor(a, b, 0))>{minor(a, b, 0), minor(a, b, 1), minor(a, b, 2)};
}
template <class Z>
bool isZero(const Point<Z>& a) {
  return a[0].sign() == 0 && a[1].sign() == 0 && a[2].sign() == 0;
}
/// On which side of the plane abc d is.
template <class Z>
int orientation(const Point<Z>& a, const Point<Z>& b, const Point<Z>& c, const Point<Z>& d) {
  const Point<Z> x = minus(a, d);
  const auto n = cross(minus(b, d), minus(c, d));
  return (n[0] * x[0] + n[1] * x[1] + n[2] * x[2]).sign();
}
/// The turn abc as it is seen along an axis.
template <class Z>
int orientation(const Point<Z>& a, const Point<Z>& b, const Point<Z>& c, int axis) {
  return minor(minus(b, a), minus(c, a), axis).sign();
}
template <class Z>
int axisOf(const Point<Z>& normal) {
  return normal[0].sign() != 0 ? 0 : normal[1].sign() != 0 ? 1 : 2;
}

template <class Z>
bool onSegment(const Point<Z>& x, const Point<Z>& p, const Point<Z>& q) {
  for (int k = 0; k < 3; ++k) {
    if ((x[k] - p[k]).sign() * (x[k] - q[k]).sign() > 0) return false;
  }
  return isZero(cross(minus(q, p), minus(x, p)));
}

template <class Z>
bool segmentsMeet(const Point<Z>& p, const Point<Z>& q, const Point<Z>& a, const Point<Z>& b) {
  if (orientation(p, q, a, b) != 0) return false;
  const auto normal = cross(minus(q, p), minus(b, a));
  if (isZero(normal)) {  // parallel, or one is a point: they meet only where one has an end on the other
    return onSegment(a, p, q) || onSegment(b, p, q) || onSegment(p, a, b) || onSegment(q, a, b);
  }
  // In one plane, and not parallel. A projection along an axis that the normal is not orthogonal to loses nothing.
  const int axis = axisOf(normal);
  return orientation(p, q, a, axis) * orientation(p, q, b, axis) <= 0 &&
         orientation(a, b, p, axis) * orientation(a, b, q, axis) <= 0;
}

/// All in one plane, in which the triangle has an area, as they are seen along an axis. They are apart where a line of
/// one of their sides is strictly between them: what separates them by most is a side of their Minkowski difference.
template <class Z>
bool meetInPlane(const Point<Z>& p, const Point<Z>& q, const Point<Z>& a, const Point<Z>& b, const Point<Z>& c,
                 int axis) {
  const int turn = orientation(a, b, c, axis);
  const auto isBeyond = [&](const Point<Z>& from, const Point<Z>& to) {
    return orientation(from, to, p, axis) == -turn && orientation(from, to, q, axis) == -turn;
  };
  if (isBeyond(a, b) || isBeyond(b, c) || isBeyond(c, a)) return false;
  const int side = orientation(p, q, a, axis);
  return side == 0 || orientation(p, q, b, axis) != side || orientation(p, q, c, axis) != side;
}

template <class Z>
bool meet(const std::array<Point<Z>, 5>& x) {
  const auto& [p, q, a, b, c] = x;
  const auto normal = cross(minus(b, a), minus(c, a));
  if (isZero(normal)) {  // all of it is on its edges; an edge that stands for a triangle has the last corner twice
    if (segmentsMeet(p, q, a, b)) return true;
    return !isZero(minus(b, c)) && (segmentsMeet(p, q, b, c) || segmentsMeet(p, q, c, a));
  }
  const int side_p = orientation(a, b, c, p), side_q = orientation(a, b, c, q);
  if (side_p * side_q > 0) return false;
  if (side_p == 0 && side_q == 0) return meetInPlane(p, q, a, b, c, axisOf(normal));
  // The line crosses the plane in a point of the segment.
  const int u = orientation(p, q, b, c), v = orientation(p, q, c, a), w = orientation(p, q, a, b);
  return std::min(std::min(u, v), w) >= 0 || std::max(std::max(u, v), w) <= 0;
}

using Points = std::array<const double*, 5>;

/// Coordinates below 2^(64 N - 3) in magnitude: differences are below 2^(64 N - 2), their minors below 2^(128 N - 3),
/// and sums of three of these times a difference below 2^(192 N - 3). False where they are no such integers on any
/// common scale.
template <int N>
bool takeShort(const Points& points, std::array<Point<exact::ShortInteger<N>>, 5>& x) {
  for (int k = 0; k < 3; ++k) {
    double largest = 0;
    for (const double* point : points) largest = std::max(largest, std::fabs(point[k]));
    const int exponent = largest > 0 ? 64 * N - 4 - std::ilogb(largest) : 0;
    if (exponent > 1000 || exponent < -1000) return false;
    const double scale = std::ldexp(1.0, exponent);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double value = points[i][k] * scale;
      // What vanishes in the product is no integer, and neither is what has a fraction.
      if (value != std::floor(value) || (value == 0) != (points[i][k] == 0)) return false;
      x[i][k] = exact::shortInteger<N>(value);
    }
  }
  return true;
}

/// The coordinates as integers, multiplied by one common power of two.
struct Scaled {
  std::int64_t mantissa[5][3];
  int shift[5][3];
  int bits = 0;  ///< of the longest
};

Scaled scale(const std::array<const double*, 5>& points) {
  Scaled s;
  int smallest = 0;
  bool any = false;
  for (int i = 0; i < 5; ++i) {
    for (int k = 0; k < 3; ++k) {
      int exponent = 0;
      s.mantissa[i][k] = static_cast<std::int64_t>(std::ldexp(std::frexp(points[i][k], &exponent), 53));
      s.shift[i][k] = exponent - 53;
      if (s.mantissa[i][k] == 0) continue;
      while (s.mantissa[i][k] % 2 == 0) {
        s.mantissa[i][k] /= 2;
        ++s.shift[i][k];
      }
      smallest = any ? std::min(smallest, s.shift[i][k]) : s.shift[i][k];
      any = true;
    }
  }
  for (auto& point : s.shift) {
    for (int& shift : point) shift -= smallest;
  }
  for (int i = 0; i < 5; ++i) {
    for (int k = 0; k < 3; ++k) {
      if (s.mantissa[i][k] == 0) s.shift[i][k] = 0;
      s.bits = std::max(s.bits, s.shift[i][k] + 53);
    }
  }
  return s;
}

template <class Z>
bool decideLong(const Scaled& s) {
  std::array<Point<Z>, 5> x;
  for (int i = 0; i < 5; ++i) {
    for (int k = 0; k < 3; ++k) x[i][k] = Z::shifted(s.mantissa[i][k], s.shift[i][k]);
  }
  return meet(x);
}

bool same(const double* a, const double* b) { return a[0] == b[0] && a[1] == b[1] && a[2] == b[2]; }

bool decide(const Points& x) {
  // Coincident vertices are the most frequent contact of meshes that are not welded.
  for (std::size_t i = 2; i < x.size(); ++i) {
    if (same(x[0], x[i]) || same(x[1], x[i])) return true;
  }
  if (std::array<Point<exact::ShortInteger<1>>, 5> one_word; takeShort(x, one_word)) return meet(one_word);
  if (std::array<Point<exact::ShortInteger<2>>, 5> two_words; takeShort(x, two_words)) return meet(two_words);
  const Scaled scaled = scale(x);
  // A difference has a bit more than a coordinate, a determinant is a sum of six products of three; a product is formed
  // in whole limbs of both factors.
  using Stack = StackInteger<10>;
  return 3 * (scaled.bits + 2) + 3 * 64 <= Stack::CAPACITY_BITS ? decideLong<Stack>(scaled)
                                                                : decideLong<BigInteger>(scaled);
}

}  // namespace

void segmentsMeetTriangles(const double* positions, const std::array<std::uint32_t, 5>* pairs, std::size_t count,
                           std::uint8_t* meet) {
  if (count == 0) return;  // of no pairs there may be no array
  simd::segmentFilter(positions, pairs->data(), count, meet);
  for (std::size_t i = 0; i < count; ++i) {
    if (meet[i] != simd::SEGMENT_UNDECIDED) continue;
    Points x;
    for (std::size_t k = 0; k < x.size(); ++k) x[k] = positions + std::size_t{pairs[i][k]} * 8;
    meet[i] = decide(x);
  }
}

bool segmentMeetsTriangle(const double* p, const double* q, const double* a, const double* b, const double* c) {
  static constexpr std::array<std::uint32_t, 5> PAIR = {0, 1, 2, 3, 4};
  alignas(64) double positions[5][8] = {};
  const Points x = {p, q, a, b, c};
  for (std::size_t i = 0; i < x.size(); ++i) std::copy_n(x[i], 3, positions[i]);
  std::uint8_t meet;
  segmentsMeetTriangles(positions[0], &PAIR, 1, &meet);
  return meet != 0;
}

}  // namespace dccd
