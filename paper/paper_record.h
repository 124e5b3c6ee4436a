// The paper's record of a vertex: its projections onto 8 directions at both ends of the step, in float
// (paper, Section 5.1 and Figure 8). The bounding volumes, the linear and the planar filter all read it.
//
// Rounding. A stored value is a composition of functions that are monotone non-decreasing in the exact projection n.x:
// one rounded sum fl(x+y), minus a constant, times a positive constant, rounded to float. Hence value(a) < value(b)
// implies n.a < n.b exactly, and a strict comparison of stored values needs no margin. (Subtracting the centre from the
// coordinates before they are added would break that, and loses contacts.)
// For what is computed from the values (planar and non-penetration filter) `error` bounds |stored - exact|, where
// exact = (n.x - centre) * scale in real arithmetic.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dccd/elementary.h"

namespace dccd {

constexpr std::size_t PAPER_DIRECTIONS = 8;

/// Coefficients of the 8 directions in the order of the record's lanes. Lane i and its successor within the same half
/// of four span plane i: with this order the 8 planes are distinct (rotating over all 8 lanes would give XY twice).
constexpr std::array<std::array<int, 3>, PAPER_DIRECTIONS> PAPER_DIRECTION{{
    {1, 0, 0},
    {0, 1, 0},
    {0, 1, 1},
    {1, 0, 1},  // X, Y, Y+Z, X+Z
    {0, 0, 1},
    {1, 1, 0},
    {0, 1, -1},
    {1, -1, 0},  // Z, X+Y, Y-Z, X-Y
}};
/// The lane that is the second coordinate of the plane whose first coordinate is this lane.
constexpr std::array<std::size_t, PAPER_DIRECTIONS> PAPER_ROTATED{1, 2, 3, 0, 5, 6, 7, 4};
/// Lanes of x, y and z.
constexpr std::array<std::size_t, 3> PAPER_AXIS_LANE{0, 1, 4};

/// One vertex over one step: one cache line.
struct alignas(64) PaperRecord {
  float t0[PAPER_DIRECTIONS];
  float t1[PAPER_DIRECTIONS];
};

/// The records of all vertices of a step.
class PaperRecords {
 public:
  /// Projects every vertex. `active`: one byte a vertex, 0 leaves it out (its record is zero); null means all. Active
  /// vertices must be finite. Keeps its memory between calls.
  /// Coordinates beyond 2^1000 are out of the range in which the bound holds: then every record is zero and
  /// nothing is ever separated, which is conservative.
  void build(const VertexMotion* vertices, std::size_t count, const std::uint8_t* active = nullptr);

  std::size_t size() const { return records_.size(); }
  const PaperRecord* data() const { return records_.data(); }
  const PaperRecord& operator[](std::size_t i) const { return records_[i]; }
  /// Bound of |stored value - exact scaled value|, the same for every lane.
  float error() const { return error_; }
  /// Power of two that takes metres to stored units; stored values lie in [-1, 1]. 0 when out of range.
  double scale() const { return scale_; }
  /// The centre that is subtracted from the projection onto direction `lane` [m].
  double centre(std::size_t lane) const { return centre_[lane]; }

 private:
  void measure(const VertexMotion* vertices, std::size_t count, const std::uint8_t* active);
  std::vector<PaperRecord> records_;
  std::array<double, PAPER_DIRECTIONS> centre_{};
  double scale_ = 0;
  float error_ = 0;
};

}  // namespace dccd
