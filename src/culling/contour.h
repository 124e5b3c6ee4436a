// The border of a part of a surface, seen along a direction during a whole step.
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

/// Whether a border meets itself at any time of a step but in the vertices that its edges have in common, and winds
/// around no point of the plane more than once.
///
/// At each vertex as many edges begin as end. So the border falls into cycles that come to each of their vertices once.
/// If no two edges meet but in common vertices, each cycle is a simple polygon at every t, which winds around a point
/// once or not at all, always the same way round. If just one of them is counter-clockwise, the border winds around a
/// point once, or not at all, or the other way round.
class Contour {
 public:
  struct Side {
    Index from, to;
  };
  /// Vertices have numbers from first_vertex on.
  explicit Contour(Index first_vertex = 0, std::size_t vertex_count = 0);
  /// True: so it is. Else bad() says of each side whether it is one of those that stand against it; all sides where
  /// that is not known.
  bool isSimple(const std::vector<Side>& sides, const ViewPlane& plane, const VertexMotion* vertices);
  const std::vector<std::uint8_t>& bad() const { return bad_; }

 private:
  static constexpr std::size_t DIRECTIONS = 8;  ///< of the plane, 22.5 degrees apart
  /// Of a vertex of the border: its sides are listed, one after another.
  struct Corner {
    PlanarSpan::Point point;
    Index vertex;
    std::uint32_t first_out, first_in;  ///< sides that begin and end here
    std::uint32_t next_out;             ///< of the walk
    std::uint32_t on_path;
    std::array<double, 2 * DIRECTIONS> projections;  ///< at t=0, then at t=1
  };
  struct Ends {
    std::uint32_t from, to;           ///< corners
    std::uint32_t next_out, next_in;  ///< sides with the same one
  };
  /// A side and what it sweeps, along a direction and across it.
  struct Swept {
    double low, high, across_low, across_high;
    std::uint32_t side;
  };

  std::uint32_t cornerAt(Index vertex, const ViewPlane& plane, const VertexMotion* vertices, PlanarSpan& span);
  void findCycles();
  void testVertices();
  std::size_t widestDirection() const;
  bool areApart(const Ends& a, const Ends& b, double margin) const;
  bool testSweep();
  void testOrientation();
  bool turnsAt(const PlanarSpan::Point& before, const PlanarSpan::Point& at, const PlanarSpan::Point& after) const;

  Index first_vertex_;
  std::vector<std::uint32_t> corner_of_;  // per vertex, as of the last call
  std::vector<Corner> corners_;
  std::vector<Ends> ends_;                           // per side
  std::vector<std::uint32_t> cycles_, cycle_begin_;  // sides, cycle by cycle
  std::vector<std::uint32_t> path_;
  std::vector<Swept> swept_;
  std::vector<std::uint8_t> bad_;
  double error_ = 0, product_error_ = 0;
};

}  // namespace dccd
