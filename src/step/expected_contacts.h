// Which of a step's contacts are expected: masks over the bodies' vertices, made once for many steps, so that marking
// is linear and allocates nothing.
#pragma once

#include <string>
#include <vector>

#include "dccd/body.h"
#include "dccd/expectation.h"
#include "dccd/outcome.h"

namespace dccd {

class ExpectedContacts {
 public:
  /// Throws std::invalid_argument naming a partner that is no body, or a vertex that a body has not.
  void set(const std::vector<Expectation>& expected, const std::vector<Body>& bodies);
  /// Of the outcome's contacts and intersections.
  void mark(Outcome& outcome) const;

 private:
  /// One side of a contact.
  struct Feature {
    std::uint16_t body;
    const Index *begin, *end;
    bool whole;  // all of its vertices are named
  };
  struct Partner {
    std::uint16_t body;
    bool anywhere;
    std::vector<std::uint8_t> holds;  // per vertex of the body
    bool has(const Feature& feature) const;
  };
  struct Pair {
    Partner first, second;
  };
  std::vector<Pair> pairs_;

  bool isExpected(const Feature& a, const Feature& b) const;
  bool isExpected(const Contact& contact) const;
  bool isExpected(const StartIntersection& start) const;
};

/// Throws std::invalid_argument unless each names two of the bodies, or a body and then the map.
void checkPartners(const std::vector<Expectation>& expected, std::size_t bodies);
}  // namespace dccd
