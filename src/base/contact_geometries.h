// The geometry of many contacts at once, for those who want all of a long list.
#pragma once

#include <cstddef>

#include "dccd/outcome.h"

namespace dccd {

/// contactGeometry(outcome, contact) of outcome.contacts from `first` to before `last`, the same bits, in a fraction of
/// the time. out has room for them. Safe to call for parts of a list at the same time.
DCCD_EXPORT void contactGeometries(const Outcome& outcome, std::size_t first, std::size_t last, ContactGeometry* out);

}  // namespace dccd
