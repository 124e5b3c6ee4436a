// Hard pairs made on purpose. Free of any test framework: the property tests, the fuzz targets and the tools draw from
// here.
#pragma once

#include <cstdint>
#include <random>

#include "oracle/query_file.h"

namespace dccd {
namespace test {

/// What makes a pair hard.
enum class Hardness : std::uint8_t {
  GENERAL = 0,       ///< random coordinates of one scale
  SMALL_GRID,        ///< integers of -3 to 3 at both times: degenerate in every way
  GRAZING,           ///< a contact made on a vertex, an edge or inside, at a dyadic time; sometimes one ulp off
  AT_THE_ENDS,       ///< the same at exactly t=0 or t=1
  PARALLEL,          ///< edges that stay parallel; faces that move along their own planes
  COLLINEAR,         ///< everything on one line
  SLIVER,            ///< faces and edge pairs whose normal is nearly zero
  TURNING,           ///< faces that turn over, edges that become parallel in mid-step
  ONE_ULP,           ///< coordinates that move by one representable number or not at all
  HUGE_TRANSLATION,  ///< far from the origin, or far away motion, and tiny relative motion
  COINCIDENT,        ///< vertices of both features in the same place, at one time or both
  AT_REST,           ///< no motion at all
  COPLANAR,          ///< everything in one plane during the whole step
  SUBNORMAL,         ///< coordinates below the smallest normal double
  MIXED_15,          ///< each coordinate of its own scale, 1e-15 to 1e15
  MIXED_150,         ///< the same from 1e-150 to 1e150
  EXTREME,           ///< coordinates near the largest double
  COUNT
};
const char* toString(Hardness hardness);

/// The random numbers of the generators.
using RandomSource = std::mt19937_64;

/// A hard pair of random hardness (MIXED_150 and EXTREME are rare, since they are slow to judge), kind and symmetry.
/// `contact` is left false. All coordinates are finite.
Query hardQuery(RandomSource& random);
Query hardQuery(RandomSource& random, PairKind kind);
Query hardQuery(RandomSource& random, PairKind kind, Hardness hardness);

}  // namespace test
}  // namespace dccd
