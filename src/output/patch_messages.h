// Patches, their events and what is new as messages. Used by the node and by analyze_bag.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <deformable_ccd/PairContact.h>
#include <deformable_ccd/PatchArray.h>
#include <deformable_ccd/PatchEvent.h>

#include "dccd/outcome.h"

namespace dccd {

/// "cloth and itself".
std::string pairOf(const std::array<std::uint16_t, 2>& body, const std::vector<Body>& bodies);
deformable_ccd::PatchArray toPatchArray(const Outcome& outcome, const std::vector<Body>& bodies,
                                        const std::string& frame);
/// One for each event of the outcome, in order.
std::vector<deformable_ccd::PatchEvent> toPatchEvents(const Outcome& outcome, const std::vector<Body>& bodies,
                                                      const std::string& frame);
/// The earliest new contact of each pair of partners.
std::vector<deformable_ccd::PairContact> toPairContacts(const Outcome& outcome, const std::vector<Body>& bodies);
/// Patches that touch and are not new.
std::size_t lastingPatches(const Outcome& outcome);

}  // namespace dccd
