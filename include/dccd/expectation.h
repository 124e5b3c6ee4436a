// Contacts that a task brings about: they are found, listed, counted and marked like all others, and are no alarm.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "dccd/body.h"
#include "dccd/export.h"
#include "dccd/types.h"

namespace dccd {

/// One of the two that are expected to meet.
struct ExpectedPartner {
  std::uint16_t body = 0;       ///< index into the bodies; OBSTACLE_BODY: the map
  std::vector<Index> vertices;  ///< only features all of whose vertices are among these; empty: anywhere on the body
  std::string set;              ///< what these vertices are called, for people; empty: they have no name
  friend bool operator==(const ExpectedPartner& a, const ExpectedPartner& b) {
    return a.body == b.body && a.vertices == b.vertices && a.set == b.set;
  }
};

/// A contact is expected where everything of it that one expectation names is in that: one partner holds the one
/// feature, the other partner the other one. Which comes first has no meaning; the same body twice is one with itself.
struct Expectation {
  std::array<ExpectedPartner, 2> partners;
  std::string phase;  ///< of the task, for people; empty: in all of them
  friend bool operator==(const Expectation& a, const Expectation& b) {
    return a.partners == b.partners && a.phase == b.phase;
  }
};

/// A sentence for each: "cloth ('hem', 30 vertices) with finger in phase 'carry'".
DCCD_EXPORT std::vector<std::string> describe(const std::vector<Expectation>& expected,
                                              const std::vector<Body>& bodies);

}  // namespace dccd
