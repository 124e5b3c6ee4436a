// The border of a surface, seen along a direction during a whole step.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <vector>

#include "dccd/elementary.h"
#include "dccd/tolerances.h"
#include "dccd/types.h"

namespace dccd {

/// The plane that a surface is seen in: (u . x, w . x), for which the certificate holds with these very doubles. It is
/// seen along u x w.
struct ViewPlane {
  /// Along a line of components -1, 0 and 1, exactly: u and w have components 0, 1/2 and 1, or their opposites.
  explicit ViewPlane(const Vec3& line);
  std::array<double, 2> coordinates(const double* x) const {
    const Eigen::Map<const Vec3> p(x);
    return {u.dot(p), w.dot(p)};
  }
  /// What a coordinate is off by for points with |x| + |y| + |z| <= size: three products and two sums with components
  /// of at most 1 + 2^-50, below 4 * 2^-53 size.
  static double error(double size) { return tolerance::UNFOLDED_COORDINATE * size; }

  Vec3 u, w;
};

/// Points in a plane, as they come: what their coordinates, and products of two of their differences, are off by.
class PlanarSpan {
 public:
  /// A vertex in the plane at both times [m].
  struct Point {
    double x0, y0, x1, y1;
  };
  Point add(const ViewPlane& plane, const VertexMotion& vertex);
  /// Nothing is so small or large that the bounds below would not hold.
  bool isGuarded() const { return size_ > tolerance::UNFOLDED_SMALLEST_M && size_ < tolerance::UNFOLDED_LARGEST_M; }
  double error() const { return ViewPlane::error(size_); }
  /// Differences are at most L = extent, and off by 2 error + 2^-53 L <= 2.5 error; so a product of two by 5 L error
  /// and 7 error^2, twice for two products, and their three roundings add less than 3 L error: below 20 error (L +
  /// error).
  double productError() const;

 private:
  double size_ = 0;  // largest |x| + |y| + |z|
  std::array<double, 2> low_{HUGE_VAL, HUGE_VAL}, high_{-HUGE_VAL, -HUGE_VAL};
};

/// A cycle of edges that comes to each of its vertices once, and whether any two of these edges meet at any time of a
/// step but in the vertices that they have in common.
class Contour {
 public:
  /// One edge goes from each vertex to the next, the last one to the first. At least three.
  explicit Contour(std::vector<Index> vertices) : vertices_(std::move(vertices)) {}
  /// True: they do not, so that it is a simple polygon at every time.
  bool isSimple(const ViewPlane& plane, const VertexMotion* vertices);

 private:
  static constexpr std::size_t DIRECTIONS = 8;  ///< of the plane, 22.5 degrees apart
  struct Corner {
    PlanarSpan::Point point;
    std::array<double, 2 * DIRECTIONS> projections;  ///< at t=0, then at t=1
  };
  /// An edge and what it sweeps, along a direction and across it.
  struct Swept {
    double low, high, across_low, across_high;
    std::size_t edge;
  };

  std::size_t next(std::size_t i) const { return i + 1 < vertices_.size() ? i + 1 : 0; }
  std::size_t widestDirection() const;
  bool areApart(std::size_t a, std::size_t b, double margin) const;
  bool turnsEverywhere(double margin) const;
  bool staysApart(double margin);

  std::vector<Index> vertices_;
  std::vector<Corner> corners_;  // per vertex, where its edge begins
  std::vector<Swept> swept_;
};

}  // namespace dccd
