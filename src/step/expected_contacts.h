// Which of a step's contacts are expected: a bit for each partner at each vertex, made once for many steps, so that
// marking looks at 32 expectations at once and allocates nothing.
#pragma once

#include <vector>

#include "dccd/body.h"
#include "dccd/outcome.h"
#include "dccd/step.h"

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
  /// Which partners hold what: bit 2*i + k for the k-th partner of expectation i, from word to word.
  using Word = std::uint64_t;
  struct Masks {
    std::vector<Word> anywhere;  // of partners that name the whole body
    std::vector<Word> vertices;  // per vertex, of those that name vertices of it; empty: none does
  };
  const Masks& masksOf(std::uint16_t body) const { return masks_[body == OBSTACLE_BODY ? masks_.size() - 1 : body]; }
  Word heldBy(const Feature& feature, std::size_t word) const;

  std::vector<Masks> masks_;  // per body, then the map
  std::size_t words_ = 0;     // of a mask; 0: nothing is expected

  bool isExpected(const Feature& a, const Feature& b) const;
  bool isExpected(const Contact& contact) const;
  bool isExpected(const StartIntersection& start) const;
};

/// Throws std::invalid_argument unless each names two of the bodies, or a body and then the map.
void checkPartners(const std::vector<Expectation>& expected, std::size_t bodies);
}  // namespace dccd
