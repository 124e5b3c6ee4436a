#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "dccd/tolerances.h"
#include "elementary/exact_integer.h"
#include "step/start/start_state.h"

namespace dccd {
namespace {

enum class Answer : std::uint8_t { APART, MEET, UNKNOWN };

// --- Floating-point filter -------------------------------------------------------------------------------------------
// With p as the origin, let a, b, c, q be differences to it. Their cross products bc = b x c, ca, ab give every sign:
//   the face's plane has p on the side of -a.bc and q on that of q.(bc + ca + ab) - a.bc (up to one common sign);
//   where the line pq meets the face at u a + v b + w c (u + v + w = 1, none negative), with some K
//   (q.bc, q.ca, q.ab) = K (u, v, w), so two of these with opposite strict signs show the line to miss the face,
//   degenerate or not.
// Rounding, u = 2^-53, M = largest |difference|, differences rounded once: a component of a cross product errs by
// 2 * 3u M^2 + 2u M^2 = 8u M^2 and is at most 2 M^2; a dot product with one by 3 (8 + 2 + 2)u M^3 + (4 + 6)u M^3 =
// 46u M^3 and is at most 6 M^3; the sum of three of these and a fourth by 4 * 46u M^3 + (12 + 18 + 24)u M^3 = 238u M^3.
// The margins 47u M^3 and 240u M^3 cover the terms in u^2 and their own rounding. Underflow: fewer than 100 operations
// lose at most 2^-1075 each, times factors of at most M^2 <= 2^60: below 2^-1000.
using tolerance::SEGMENT_LARGEST_M, tolerance::SEGMENT_UNDERFLOW;

struct V {
  double x, y, z;
};
inline V difference(const double* a, const double* b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline V operator+(const V& a, const V& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline V cross(const V& a, const V& b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline double dot(const V& a, const V& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline double largest(const V& a) { return std::max(std::max(std::abs(a.x), std::abs(a.y)), std::abs(a.z)); }

// In the projection onto a coordinate plane: is the triangle strictly on one side of the line pq, or the segment
// strictly beyond the line of one of the triangle's edges? The 2D cross products are components of the 3D ones. The
// longest sums have three terms, such as (b - q) x (c - q) = bc + (qb - qc), and err by at most (3 * 8 + 4 + 6)u M^2;
// 35u M^2 is used.
inline bool apartInPlane(double bc, double ca, double ab, double qa, double qb, double qc, double margin) {
  const auto beyond = [margin](double x) { return x > margin; };
  if (beyond(std::min(std::min(qa, qb), qc)) || beyond(-std::max(std::max(qa, qb), qc))) return true;
  const double area = bc + ca + ab;
  if (!(std::abs(area) > margin)) return false;
  const double s = area > 0 ? 1 : -1;
  // On which side of an edge's line p is, then q.
  return (beyond(-s * bc) && beyond(-s * (bc + (qb - qc)))) || (beyond(-s * ca) && beyond(-s * (ca + (qc - qa)))) ||
         (beyond(-s * ab) && beyond(-s * (ab + (qa - qb))));
}

inline bool apartOnAxis(const double* p, const double* q, const double* a, const double* b, const double* c) {
  for (int k = 0; k < 3; ++k) {
    const double lo = std::min(p[k], q[k]), hi = std::max(p[k], q[k]);
    if (lo > std::max(std::max(a[k], b[k]), c[k]) || hi < std::min(std::min(a[k], b[k]), c[k])) return true;
  }
  return false;
}

Answer filter(const double* p, const double* q, const double* a, const double* b, const double* c) {
  const V pa = difference(a, p), pb = difference(b, p), pc = difference(c, p), pq = difference(q, p);
  const double M = std::max(std::max(largest(pa), largest(pb)), std::max(largest(pc), largest(pq)));
  if (!(M <= SEGMENT_LARGEST_M)) return apartOnAxis(p, q, a, b, c) ? Answer::APART : Answer::UNKNOWN;
  const double cubed = M * M * M;
  const double line_margin = tolerance::SEGMENT_LINE * cubed + SEGMENT_UNDERFLOW;
  const double plane_margin = tolerance::SEGMENT_PLANE * cubed + SEGMENT_UNDERFLOW;
  const V bc = cross(pb, pc);
  const double side_p = -dot(pa, bc);
  const V ca = cross(pc, pa), ab = cross(pa, pb);
  const double u = dot(pq, bc), v = dot(pq, ca), w = dot(pq, ab);
  const double side_q = ((u + v) + w) + side_p;
  if (std::min(side_p, side_q) > plane_margin || std::max(side_p, side_q) < -plane_margin) return Answer::APART;
  const double lo = std::min(std::min(u, v), w), hi = std::max(std::max(u, v), w);
  if (lo < -line_margin && hi > line_margin) return Answer::APART;
  if (std::min(side_p, side_q) < -plane_margin && std::max(side_p, side_q) > plane_margin &&
      (lo > line_margin || hi < -line_margin)) {
    return Answer::MEET;
  }
  if (apartOnAxis(p, q, a, b, c)) return Answer::APART;
  const double margin = tolerance::SEGMENT_PROJECTED * (M * M) + SEGMENT_UNDERFLOW;
  const V qa = cross(pq, pa), qb = cross(pq, pb), qc = cross(pq, pc);
  const bool apart = apartInPlane(bc.x, ca.x, ab.x, qa.x, qb.x, qc.x, margin) ||
                     apartInPlane(bc.y, ca.y, ab.y, qa.y, qb.y, qc.y, margin) ||
                     apartInPlane(bc.z, ca.z, ab.z, qa.z, qb.z, qc.z, margin);
  return apart ? Answer::APART : Answer::UNKNOWN;
}

// --- Exact decision --------------------------------------------------------------------------------------------------

template <class Z>
struct Exact {
  using Point = std::array<Z, 3>;

  static Point minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
  static Point cross(const Point& a, const Point& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  }
  static Z dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
  static bool isZero(const Point& a) { return a[0].sign() == 0 && a[1].sign() == 0 && a[2].sign() == 0; }
  static int orientation(const Point& a, const Point& b, const Point& c, const Point& d) {
    return dot(minus(a, d), cross(minus(b, d), minus(c, d))).sign();
  }
  /// Component `axis` of (b - a) x (c - a): the orientation of the projections along the axis.
  static int orientation(const Point& a, const Point& b, const Point& c, int axis) {
    return cross(minus(b, a), minus(c, a))[axis].sign();
  }
  static int axisOf(const Point& normal) { return normal[0].sign() != 0 ? 0 : normal[1].sign() != 0 ? 1 : 2; }

  static bool onSegment(const Point& x, const Point& p, const Point& q) {
    return isZero(cross(minus(q, p), minus(x, p))) && dot(minus(x, p), minus(x, q)).sign() <= 0;
  }

  static bool segmentsMeet(const Point& p, const Point& q, const Point& a, const Point& b) {
    if (orientation(p, q, a, b) != 0) return false;
    const Point normal = cross(minus(q, p), minus(b, a));
    if (isZero(normal)) {  // parallel, or one is a point: they meet only where one has an end on the other
      return onSegment(a, p, q) || onSegment(b, p, q) || onSegment(p, a, b) || onSegment(q, a, b);
    }
    // In one plane, and not parallel. A projection along an axis that the normal is not orthogonal to loses nothing.
    const int axis = axisOf(normal);
    return orientation(p, q, a, axis) * orientation(p, q, b, axis) <= 0 &&
           orientation(a, b, p, axis) * orientation(a, b, q, axis) <= 0;
  }

  static bool meet(const Point& p, const Point& q, const Point& a, const Point& b, const Point& c) {
    const int side_p = orientation(a, b, c, p), side_q = orientation(a, b, c, q);
    if (side_p * side_q > 0) return false;
    if (side_p != 0 || side_q != 0) {  // the line crosses the plane in a point of the segment
      const int u = orientation(p, q, b, c), v = orientation(p, q, c, a), w = orientation(p, q, a, b);
      return std::min(std::min(u, v), w) >= 0 || std::max(std::max(u, v), w) <= 0;
    }
    if (segmentsMeet(p, q, a, b) || segmentsMeet(p, q, b, c) || segmentsMeet(p, q, c, a)) return true;
    // Without touching the boundary: in the plane and inside altogether.
    const Point normal = cross(minus(b, a), minus(c, a));
    if (isZero(normal)) return false;
    const int axis = axisOf(normal), turn = normal[axis].sign();
    return orientation(a, b, p, axis) == turn && orientation(b, c, p, axis) == turn &&
           orientation(c, a, p, axis) == turn;
  }
};

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
bool decide(const Scaled& s) {
  std::array<typename Exact<Z>::Point, 5> x;
  for (int i = 0; i < 5; ++i) {
    for (int k = 0; k < 3; ++k) x[i][k] = Z::shifted(s.mantissa[i][k], s.shift[i][k]);
  }
  return Exact<Z>::meet(x[0], x[1], x[2], x[3], x[4]);
}

inline bool same(const double* a, const double* b) { return a[0] == b[0] && a[1] == b[1] && a[2] == b[2]; }

}  // namespace

bool segmentMeetsTriangle(const double* p, const double* q, const double* a, const double* b, const double* c) {
  const Answer answer = filter(p, q, a, b, c);
  if (answer != Answer::UNKNOWN) return answer == Answer::MEET;
  // Coincident vertices are the most frequent contact of meshes that are not welded.
  for (const double* x : {a, b, c}) {
    if (same(p, x) || same(q, x)) return true;
  }
  const Scaled scaled = scale({p, q, a, b, c});
  // A difference has a bit more than a coordinate, a determinant is a sum of six products of three; a product is formed
  // in whole limbs of both factors.
  using Short = StackInteger<10>;
  return 3 * (scaled.bits + 2) + 3 * 64 <= Short::CAPACITY_BITS ? decide<Short>(scaled) : decide<BigInteger>(scaled);
}

}  // namespace dccd
