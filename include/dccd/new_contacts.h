// What of an answer is news: contacts that are not expected and belong to no patch that lasts. Alarms are about these.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "dccd/export.h"
#include "dccd/outcome.h"

namespace dccd {

/// The earliest new contact of a pair of partners.
struct NewContact {
  std::array<std::uint16_t, 2> body{0, 0};  ///< as in Patch
  std::uint64_t patch = 0;                  ///< identity of its patch; 0: of a prediction, or without patches
  Contact contact;
};

/// The first touch of a new patch that is not expected is not before this, [1] of the step: 0 where surfaces cross.
inline double newsTocLower(const Patch& patch) { return patch.crossings > 0 ? 0 : patch.earliest.toc_lower; }

/// One for each pair of partners, the earliest first; of one time in canonical order. Of patches that are new
/// (Patch::is_new) or, where none are tracked, of all contacts that are not expected. Of a patch that is new by edges
/// that cross faces when the step begins alone there is none.
DCCD_EXPORT std::vector<NewContact> newContacts(const Outcome& outcome);

/// Not after the first of them, nor after what was left unchecked: [1] of the step; infinity: neither is there. 0 where
/// surfaces cross that is new, or not expected where patches are not tracked.
DCCD_EXPORT double earliestNewToc(const Outcome& outcome);

}  // namespace dccd
