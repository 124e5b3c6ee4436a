// A mesh laid flat for a picture.
#pragma once

#include <array>
#include <vector>

#include "dccd/types.h"

namespace dccd {

/// Each position in the plane in which the points spread most, turned so that their bounding box is smallest and lies
/// along the page, and how high it is above that plane, towards the reader. [m], about the centroid; what is not finite
/// lands on it.
std::vector<std::array<double, 3>> flatLayout(const Positions& positions);

}  // namespace dccd
