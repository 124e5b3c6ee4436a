// The accuracy ladder as a list: what its rungs are called and what they can hold.
#pragma once

#include <vector>

#include "dccd/elementary.h"
#include "dccd/export.h"

namespace dccd {

/// In the order of their values.
DCCD_EXPORT const std::vector<Accuracy>& allRungs();
/// Whether the rung can hold a minimum separation or an uncertainty above 0.
DCCD_EXPORT bool holdsDistance(Accuracy rung);

}  // namespace dccd
