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

/// One for each pair of partners, the earliest first; of one time in canonical order. Of patches that are new
/// (Patch::is_new) or, where none are tracked, of all contacts that are not expected.
DCCD_EXPORT std::vector<NewContact> newContacts(const Outcome& outcome);

/// Not after the first of them, nor after what was left unchecked: [1] of the step; infinity: neither is there.
DCCD_EXPORT double earliestNewToc(const Outcome& outcome);

}  // namespace dccd
