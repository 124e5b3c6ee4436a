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

/// Whether the patch, one of the outcome's, is news: not expected, and it began in this step or, where the outcome is a
/// prediction, would begin. What touched when it was first looked at is none, nor what a change of the map brought
/// about.
DCCD_EXPORT bool isNew(const Outcome& outcome, const Patch& patch);

/// One for each pair of partners, the earliest first; of one time in canonical order. Without Options::patches every
/// contact that is not expected counts.
DCCD_EXPORT std::vector<NewContact> newContacts(const Outcome& outcome);

}  // namespace dccd
