// Moves to dccd/tolerances.h with the next change of that header.
#pragma once

#include "dccd/tolerances.h"

namespace dccd {
namespace tolerance {

// Distances (step/clearance/hull_pair.h).
/// [1] Slack of a bound on a distance, of the power of two that is not above the largest coordinate: 113 half ulps are
/// proved. Larger: bounds are further apart where coordinates are large.
constexpr double CLEARANCE = 0x1p-45;
constexpr double CLEARANCE_BOX = 16 * HALF_ULP;   ///< [1] slack of the distance of two boxes: 6 half ulps
constexpr double CLEARANCE_RELATIVE = 1e-9;       ///< [1] of a distance: how far its bounds may be apart in any case
constexpr double CLEARANCE_UNDERFLOW_M = 1e-290;  ///< [m] more than underflow takes from a distance
constexpr double CLEARANCE_LARGEST_M = 1e150;     ///< [m] guard: squares stay finite
constexpr double CLEARANCE_SHORTEST = 0x1p-48;    ///< [1] part of a step that is not halved any more

}  // namespace tolerance
}  // namespace dccd
