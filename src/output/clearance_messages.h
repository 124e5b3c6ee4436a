// Distances as messages.
#pragma once

#include <string>
#include <vector>

#include <deformable_ccd/ClearanceArray.h>

#include "dccd/outcome.h"

namespace dccd {

/// What is not there is NaN.
deformable_ccd::ClearanceArray toClearanceArray(const Outcome& outcome, const std::vector<Body>& bodies,
                                                const std::string& frame);

/// Two different partners that are not expected to touch, and how near they came in the step.
struct NearestPartners {
  std::string names;                ///< empty: there are none, or nobody asked
  double lower_m = 0, upper_m = 0;  ///< of all such partners; NaN: it is not known
};
/// Those of the smallest lower bound; of which nothing is known, where there are such. What is inside of another,
/// closed body is 0 from it, unlike its surface (Clearance).
NearestPartners nearestPartners(const Outcome& outcome);

}  // namespace dccd
