// The accuracy ladder as a list: what its rungs are called and what they can hold.
#pragma once

#include <vector>

#include "dccd/elementary.h"
#include "dccd/export.h"

namespace dccd {

/// Cheapest first.
DCCD_EXPORT const std::vector<Accuracy>& allRungs();
/// Whether the rung can hold a minimum separation or an uncertainty above 0.
DCCD_EXPORT bool holdsDistance(Accuracy rung);
/// Whether the rung misses nothing. What does not is a rival to measure against, and no setting of a monitor.
DCCD_EXPORT bool provesAnswers(Accuracy rung);

}  // namespace dccd
