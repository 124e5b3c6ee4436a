// The complete decision procedure over integers (tiers FIXED_INTEGER and BIG_INTEGER): one template for both.
#pragma once

#include <algorithm>
#include <cstdint>

#include "dccd/elementary.h"
#include "elementary/exact_roots.h"

namespace dccd {
namespace exact {

/// A pair's coordinates as integers: mantissa * 2^shift, all below 2^bits in magnitude. Each axis is multiplied by a
/// power of two of its own, which changes neither the answer nor the TOC: each term of f has one factor of each axis,
/// each term of a minor one of each of its two. A dot product is asked for where a point p is on the line through a and
/// b, p = a + s (b - a), and there each axis's share of (p - a).(p - b) is s (s - 1) times a square: all have one sign.
struct IntegerMotion {
  std::int64_t mantissa[2][4][3] = {};
  int shift[2][4][3] = {};
  int bits = 0;

  explicit IntegerMotion(const PairMotion& pair);
};

/// Limbs' bits that decide() needs for coordinates of `bits` bits. Differences have b+1 bits, their change over the
/// step b+2; the quadratics' coefficients at most 2b+6, those of f 3b+10. The longest number is the square of
/// 2 g2 b - a g1 in QuadraticRoots::signAt, with (a, b) = f reduced modulo a quadratic (7b+24): 18b+64; for a grid of
/// 2^52 cells f at a grid point takes 3b+10+156+2, a quadratic on a cell less.
constexpr int workingBits(int bits) { return std::max(18 * bits + 66, 3 * bits + 170); }

/// The answer: contact or not, and the TOC's cell of the 2^-toc_bits grid (2^toc_bits for a TOC of exactly 1).
struct Answer {
  bool contact = false;
  std::int64_t cell = 0;
};

template <class Z>
class Decision {
 public:
  Decision(PairKind kind, const IntegerMotion& motion, int toc_bits)
      : vertex_face_(kind == PairKind::VERTEX_FACE), toc_bits_(toc_bits), grid_bits_(std::max(toc_bits, 40)) {
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < 3; ++k) {
        for (int time = 0; time < 2; ++time) {
          points_[time][i][k] = Z::shifted(motion.mantissa[time][i][k], motion.shift[time][i][k]);
        }
      }
    }
  }

  Answer decide() {
    // VF p a b c: f = ((b-a) x (c-a)) . (p-a).  EE a b c d: f = ((b-a) x (d-c)) . (c-a).
    const Line u = vertex_face_ ? between(1, 2) : between(0, 1);
    const Line v = vertex_face_ ? between(1, 3) : between(2, 3);
    const Line w = vertex_face_ ? between(1, 0) : between(0, 2);
    for (int k = 0; k < 3; ++k) normal_[k] = cross(u, v, k);
    const Cubic<Z> f = tripleProduct(w);
    if (bernsteinExcludesRoot(f)) return {};
    if (f.degree() < 0) return decideCoplanar();
    PolynomialRoots<Z> roots(f, grid_bits_);
    for (int i = 0; i < roots.count(); ++i) {
      if (touchesAt(Moment(roots, i))) return contactInCell(roots.cell(i));
    }
    return {};
  }

 private:
  struct Line {  // start + t change, per axis
    Z start[3], change[3];
  };

  /// A time at which signs are asked for: root `index` of some polynomial, or t = 0 where there is none.
  class Moment {
   public:
    Moment() = default;
    Moment(PolynomialRoots<Z>& roots, int index) : roots_(&roots), index_(index) {}
    int sign(const Quadratic<Z>& q) const { return roots_ == nullptr ? q.c[0].sign() : roots_->signAt(index_, q); }

   private:
    PolynomialRoots<Z>* roots_ = nullptr;
    int index_ = 0;
  };

  Line between(int from, int to) const {
    Line line;
    for (int k = 0; k < 3; ++k) {
      line.start[k] = points_[0][to][k] - points_[0][from][k];
      line.change[k] = points_[1][to][k] - points_[1][from][k] - line.start[k];
    }
    return line;
  }

  static Quadratic<Z> cross(const Line& u, const Line& v, int k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    Quadratic<Z> result;
    result.c[0] = u.start[i] * v.start[j] - u.start[j] * v.start[i];
    result.c[1] =
        (u.start[i] * v.change[j] + u.change[i] * v.start[j]) - (u.start[j] * v.change[i] + u.change[j] * v.start[i]);
    result.c[2] = u.change[i] * v.change[j] - u.change[j] * v.change[i];
    return result;
  }

  static Quadratic<Z> dot(const Line& u, const Line& v) {
    Quadratic<Z> result;
    for (int k = 0; k < 3; ++k) {
      result.c[0] = result.c[0] + u.start[k] * v.start[k];
      result.c[1] = result.c[1] + (u.start[k] * v.change[k] + u.change[k] * v.start[k]);
      result.c[2] = result.c[2] + u.change[k] * v.change[k];
    }
    return result;
  }

  Cubic<Z> tripleProduct(const Line& w) const {
    Cubic<Z> f;
    for (int k = 0; k < 3; ++k) {
      const Quadratic<Z>& n = normal_[k];
      f.c[0] = f.c[0] + n.c[0] * w.start[k];
      f.c[1] = f.c[1] + (n.c[0] * w.change[k] + n.c[1] * w.start[k]);
      f.c[2] = f.c[2] + (n.c[1] * w.change[k] + n.c[2] * w.start[k]);
      f.c[3] = f.c[3] + n.c[2] * w.change[k];
    }
    return f;
  }

  /// All Bernstein coefficients over [0,1] of one strict sign.
  static bool bernsteinExcludesRoot(const Cubic<Z>& f) {
    const int sign = f.c[0].sign();
    if (sign == 0) return false;
    const Z last = f.c[0] + f.c[1] + f.c[2] + f.c[3];
    if (last.sign() != sign) return false;
    const Z three = f.c[0] * 3;
    return (three + f.c[1]).sign() == sign && (three + f.c[1] * 2 + f.c[2]).sign() == sign;
  }

  Answer contactInCell(std::int64_t grid_cell) const { return {true, grid_cell >> (grid_bits_ - toc_bits_)}; }

  // ---- static contact at a moment at which the four points are coplanar

  bool touchesAt(const Moment& moment) const {
    for (int k = 0; k < 3; ++k) {
      const int sign = moment.sign(normal_[k]);
      if (sign != 0) return vertex_face_ ? vertexInFace(moment, k, sign) : edgesCross(moment, k);
    }
    // Zero area; or parallel edges, or one of zero length: then contact needs an end point on an edge.
    if (vertex_face_) return onEdge(moment, 0, 1, 2) || onEdge(moment, 0, 2, 3) || onEdge(moment, 0, 3, 1);
    return onEdge(moment, 0, 2, 3) || onEdge(moment, 1, 2, 3) || onEdge(moment, 2, 0, 1) || onEdge(moment, 3, 0, 1);
  }

  /// The face seen along axis k, in which its normal has the sign given.
  bool vertexInFace(const Moment& moment, int k, int sign) const {
    const Line a = between(0, 1), b = between(0, 2), c = between(0, 3);
    return moment.sign(cross(b, c, k)) != -sign && moment.sign(cross(c, a, k)) != -sign &&
           moment.sign(cross(a, b, k)) != -sign;
  }

  /// Edges that are not parallel, seen along axis k: each one's ends are not strictly on one side of the other.
  bool edgesCross(const Moment& moment, int k) const {
    const Line ab = between(0, 1), ac = between(0, 2), cd = between(2, 3), ad = between(0, 3);
    if (moment.sign(cross(ab, ac, k)) * moment.sign(cross(ab, ad, k)) > 0) return false;
    const Line ca = between(2, 0), cb = between(2, 1);
    return moment.sign(cross(cd, ca, k)) * moment.sign(cross(cd, cb, k)) <= 0;
  }

  /// Point p on the closed segment ab, which may have zero length.
  bool onEdge(const Moment& moment, int p, int a, int b) const {
    const Line ap = between(a, p), ab = between(a, b), bp = between(b, p);
    for (int k = 0; k < 3; ++k) {
      if (moment.sign(cross(ap, ab, k)) != 0) return false;
    }
    return moment.sign(dot(ap, bp)) <= 0;
  }

  // ---- f = 0 throughout: the first touch, if not at t = 0, has an end point on an edge

  Answer decideCoplanar() {
    if (touchesAt(Moment())) return contactInCell(0);
    static constexpr int FACE[3][3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}};
    static constexpr int EDGES[4][3] = {{0, 2, 3}, {1, 2, 3}, {2, 0, 1}, {3, 0, 1}};
    std::int64_t first = -1;
    for (int i = 0; i < (vertex_face_ ? 3 : 4); ++i) {
      const int* points = vertex_face_ ? FACE[i] : EDGES[i];
      const std::int64_t cell = firstOnEdge(points[0], points[1], points[2]);
      if (cell >= 0 && (first < 0 || cell < first)) first = cell;
    }
    return first < 0 ? Answer() : contactInCell(first);
  }

  static Cubic<Z> asCubic(const Quadratic<Z>& q) { return {{q.c[0], q.c[1], q.c[2], Z()}}; }

  /// Grid cell of the first time at which p is on the closed segment ab, or -1. Not on it at t = 0 is not assumed.
  std::int64_t firstOnEdge(int p, int a, int b) const {
    const Line ap = between(a, p), ab = between(a, b), bp = between(b, p);
    const Quadratic<Z> beside[3] = {cross(ap, ab, 0), cross(ap, ab, 1), cross(ap, ab, 2)};
    const Quadratic<Z> beyond = dot(ap, bp);
    const auto nonzero = std::find_if(beside, beside + 3, [](const Quadratic<Z>& q) { return q.degree() >= 0; });
    if (nonzero == beside + 3) {  // collinear throughout
      if (beyond.c[0].sign() <= 0) return 0;
      PolynomialRoots<Z> roots(asCubic(beyond), grid_bits_);
      return roots.count() > 0 ? roots.cell(0) : -1;
    }
    PolynomialRoots<Z> roots(asCubic(*nonzero), grid_bits_);
    for (int i = 0; i < roots.count(); ++i) {
      const bool collinear =
          std::all_of(beside, beside + 3, [&](const Quadratic<Z>& q) { return roots.signAt(i, q) == 0; });
      if (collinear && roots.signAt(i, beyond) <= 0) return roots.cell(i);
    }
    return -1;
  }

  bool vertex_face_;
  int toc_bits_;
  int grid_bits_;
  Z points_[2][4][3];
  Quadratic<Z> normal_[3];
};

}  // namespace exact
}  // namespace dccd
