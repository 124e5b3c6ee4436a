// A pair at one rational time, in integers of one or two words.
//
// Coordinates. Each axis is multiplied by a power of two of its own, which changes no sign that is asked for: the terms
// of f have one factor of each axis, a minor's one of each of its two, and whether a point of a line is between two
// others each axis tells alone. A position at p/q, times q, is x0 (q - p) + x1 p. With 64 N bits and coordinates below
// 2^(64 N - 3 - log2 q) in magnitude these are below 2^(64 N - 3), differences below 2^(64 N - 2), minors of two words
// times two below 2^(128 N - 3), and f, a sum of three, below 2^(192 N - 3).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "dccd/elementary.h"
#include "elementary/exact_short_integer.h"

namespace dccd {
namespace exact {

struct SimpleTime {
  std::int64_t p = 0, q = 1;
  double rounded() const { return static_cast<double>(p) / static_cast<double>(q); }
};

/// The pair at one time, as differences: u, v, w as everywhere (VF: b-a, c-a, p-a; EE: b-a, d-c, c-a).
template <int N>
class Frozen {
  using Number = ShortInteger<N>;
  using Minor = ShortInteger<2 * N>;

 public:
  /// False where the coordinates are no integers of N words on any common scale.
  bool set(PairKind kind, const PairMotion& pair, const SimpleTime& time) {
    vertex_face_ = kind == PairKind::VERTEX_FACE;
    const int room = 64 * N - 3 - std::ilogb(static_cast<double>(2 * time.q - 1));
    for (int k = 0; k < 3; ++k) {
      if (!setAxis(pair, k, time, room)) return false;
    }
    const auto between = [&](int i, int from, int to) {
      for (int k = 0; k < 3; ++k) difference_[i][k] = x_[to][k] - x_[from][k];
    };
    between(0, vertex_face_ ? 1 : 0, vertex_face_ ? 2 : 1);
    between(1, vertex_face_ ? 1 : 2, 3);
    between(2, vertex_face_ ? 1 : 0, vertex_face_ ? 0 : 2);
    for (int k = 0; k < 3; ++k) normal_[k] = minor(0, 1, k);
    return true;
  }

  /// f, scaled.
  ShortInteger<3 * N> volume() const {
    const auto& w = difference_[2];
    return (normal_[0] * w[0] + normal_[1] * w[1]) + normal_[2] * w[2];
  }

  int normalSign(int k) const { return normal_[k].sign(); }

  /// Whether the features meet as they are seen along axis k, along which the normal is not 0.
  bool meetAlong(int k) const {
    const int sign = normal_[k].sign();
    const Minor b = minor(2, 1, k), c = vertex_face_ ? minor(0, 2, k) : minor(2, 0, k);
    if (b.sign() == -sign || c.sign() == -sign) return false;
    if (vertex_face_) return ((normal_[k] - b) - c).sign() != -sign;
    return (normal_[k] - b).sign() != -sign && (normal_[k] - c).sign() != -sign;
  }

  /// Edges: whether they are seen along axis k as parts of two parallel lines.
  bool areBesideAlong(int k) const { return minor(2, 1, k).sign() != 0 || minor(2, 0, k).sign() != 0; }

  /// Whether points a and b are seen as one along axis k.
  bool coincideAlong(int k, int a, int b) const {
    const int i = k == 2 ? 0 : k + 1, j = k == 0 ? 2 : k - 1;
    return (x_[a][i] - x_[b][i]).sign() == 0 && (x_[a][j] - x_[b][j]).sign() == 0;
  }

  /// Whether p is seen along axis k between a and b, or as one of them, given that all are seen on one line.
  bool isBetweenAlong(int k, int p, int a, int b) const {
    for (int i = 0; i < 3; ++i) {
      if (i != k && (x_[p][i] - x_[a][i]).sign() * (x_[p][i] - x_[b][i]).sign() > 0) return false;
    }
    return true;
  }

  /// How high p is above the line ab along axis k, times the positive or negative extent of ab along axis i.
  Minor heightAbove(int k, int i, int p, int a, int b) const {
    return (x_[p][k] - x_[a][k]) * (x_[b][i] - x_[a][i]) - (x_[b][k] - x_[a][k]) * (x_[p][i] - x_[a][i]);
  }

  /// An axis other than k along which a and b differ.
  int extentBeside(int k, int a, int b) const {
    const int i = k == 2 ? 0 : k + 1, j = k == 0 ? 2 : k - 1;
    return (x_[a][i] - x_[b][i]).sign() != 0 ? i : j;
  }

  /// Whether the features meet, being coplanar.
  bool meet() const {
    for (int k = 0; k < 3; ++k) {
      if (normal_[k].sign() != 0) return meetAlong(k);
    }
    if (vertex_face_) return isOnEdge(0, 1, 2) || isOnEdge(0, 2, 3) || isOnEdge(0, 3, 1);
    return isOnEdge(0, 2, 3) || isOnEdge(1, 2, 3) || isOnEdge(2, 0, 1) || isOnEdge(3, 0, 1);
  }

 private:
  bool setAxis(const PairMotion& pair, int k, const SimpleTime& time, int room) {
    double largest = 0;
    for (const auto& points : pair.x) {
      for (const auto& point : points) largest = std::max(largest, std::fabs(point[k]));
    }
    const int exponent = largest > 0 ? room - 1 - std::ilogb(largest) : 0;
    if (exponent > 1000 || exponent < -1000) return false;
    const double scale = std::ldexp(1.0, exponent);
    for (int i = 0; i < 4; ++i) {
      const double start = pair.x[0][i][k] * scale, end = pair.x[1][i][k] * scale;
      // What vanishes in the product is no integer, and neither is what has a fraction.
      if (start != std::floor(start) || end != std::floor(end)) return false;
      if ((start == 0) != (pair.x[0][i][k] == 0) || (end == 0) != (pair.x[1][i][k] == 0)) return false;
      x_[i][k] = time.p == 0 ? shortInteger<N>(start)
                             : shortInteger<N>(start) * (time.q - time.p) + shortInteger<N>(end) * time.p;
    }
    return true;
  }

  static Minor minorOf(const Number (&x)[3], const Number (&y)[3], int k) {
    const int i = k == 2 ? 0 : k + 1, j = k == 0 ? 2 : k - 1;
    return x[i] * y[j] - x[j] * y[i];
  }
  Minor minor(int x, int y, int k) const { return minorOf(difference_[x], difference_[y], k); }

  /// Point p on the closed segment ab, which may have zero length.
  bool isOnEdge(int p, int a, int b) const {
    Number ap[3], ab[3];
    for (int k = 0; k < 3; ++k) {
      const Number bp = x_[p][k] - x_[b][k];
      ap[k] = x_[p][k] - x_[a][k];
      ab[k] = x_[b][k] - x_[a][k];
      if (ap[k].sign() * bp.sign() > 0) return false;
    }
    return minorOf(ap, ab, 0).sign() == 0 && minorOf(ap, ab, 1).sign() == 0 && minorOf(ap, ab, 2).sign() == 0;
  }

  bool vertex_face_ = true;
  Number x_[4][3], difference_[3][3];
  Minor normal_[3];
};

}  // namespace exact
}  // namespace dccd
