// How far apart the partners of a step are: bodies and the map, two bodies, a body and itself. The effect `clearance`.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "dccd/contact.h"
#include "dccd/export.h"
#include "dccd/types.h"

namespace dccd {

struct ClearanceOptions {
  bool wanted = false;        ///< nothing is asked, and nothing costs time, while this is false
  double tolerance_m = 1e-4;  ///< upper_m - lower_m is at most this, or 1e-9 of the distance [m]; above 0
  double max_m = 0.5;         ///< what is farther apart is FARTHER, and no minimum is looked for [m]; above 0
  /// A body against itself: faces (of ropes: edges) are neighbours, and are not asked for, where a way along the mesh's
  /// edges from one to the other is shorter than this in its reference frame, or in its first step [m]. 0: no body is
  /// asked for itself, which takes longer than all else while it bends.
  double self_m = 0;
};

enum class ClearanceStatus : std::uint8_t {
  MEASURED = 0,  ///< the interval is as narrow as was asked for
  /// Than max_m, or, of a body from itself, than a quarter of self_m if that is less: lower_m says it, upper_m is
  /// infinite.
  FARTHER = 1,
  /// Over the step exactly where it has a certain contact of the two, or they cross at its start. Both bounds are 0;
  /// but of a contact within a separation, an uncertainty or the tolerance of `conservative`, upper_m is what was
  /// measured.
  TOUCHING = 2,
  LOWER = 3,  ///< the budget ran out, or rounding is wider than the tolerance: the bounds hold; upper_m may be infinite
  UNKNOWN = 4,  ///< nothing is known: something of the two is unchecked or undecided, or the map is missing
};
DCCD_EXPORT const char* toString(ClearanceStatus status);

/// The distance of two partners [m], unsigned: what is inside of a closed body has a distance from its surface.
/// lower_m <= truth <= upper_m for every finite input. From the map: from Outcome::measured.
struct ClearanceDistance {
  ClearanceStatus status = ClearanceStatus::UNKNOWN;
  double lower_m = 0;
  double upper_m = std::numeric_limits<double>::infinity();
  double t = 1;  ///< [0, 1] of the step: where upper_m was taken; TOUCHING over the step: its first contact
  /// Where that was: a point of either [m], fixed frame; not finite without one.
  std::array<Vec3, 2> point{Vec3::Constant(std::numeric_limits<double>::quiet_NaN()),
                            Vec3::Constant(std::numeric_limits<double>::quiet_NaN())};
  /// The features that the points are on: one vertex, two of an edge, three of a face; the rest NO_INDEX, as is all
  /// of the map's.
  std::array<std::array<Index, 3>, 2> vertex{{{NO_INDEX, NO_INDEX, NO_INDEX}, {NO_INDEX, NO_INDEX, NO_INDEX}}};
  VoxelKey voxel;                ///< with the map: the occupied leaf of point[1] (its smallest key)
  std::uint32_t voxel_size = 0;  ///< edge length of that leaf in finest voxels; 0: none
};

/// Of a pair of partners that the step looks at, whether or not they are expected to touch.
struct Clearance {
  std::array<std::uint16_t, 2> body{0, 0};  ///< the smaller first; the same twice: itself; OBSTACLE_BODY: the map
  bool expected = false;                    ///< Options::expected says so of every contact of the two
  ClearanceDistance at_end;                 ///< at the step's end
  ClearanceDistance over_step;              ///< the smallest over the whole step
};

struct Options;
struct Step;
/// The distances of one step, whatever Options::clearance.wanted says; throws as detect() does. By body[0], then [1].
/// Of more than 1,000 pairs those that are FARTHER and not expected have no row, but for the first of different bodies.
DCCD_EXPORT std::vector<Clearance> distance(const Step& step, const Options& options);

}  // namespace dccd
