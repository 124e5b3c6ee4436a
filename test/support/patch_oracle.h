// Which contacts belong together, by the definition of doc/algorithm.md alone: pair by pair.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dccd/outcome.h"

namespace dccd {
namespace test {

/// Whether two contacts (or edges through faces) of a step are neighbours.
class PatchOracle {
 public:
  explicit PatchOracle(const Outcome& outcome);
  /// Numbers of the patches in the order of their first members: contacts, then crossings in the order of their kind,
  /// bodies and vertices. All pairs are looked at; by_vertex: those that share a vertex, and all with the map.
  std::vector<std::uint32_t> patches(bool by_vertex) const;

 private:
  struct Vertex {
    std::uint16_t body;
    Index vertex;
  };
  struct Member {
    std::vector<Vertex> side[2];  // the second is empty with the map
    std::uint16_t body[2];
  };
  bool share(const std::vector<Vertex>& a, const std::vector<Vertex>& b) const;
  bool near(const std::vector<Vertex>& a, const std::vector<Vertex>& b) const;
  bool neighbours(const Member& a, const Member& b) const;

  const Outcome& outcome_;
  std::vector<std::vector<std::vector<Index>>> joined_;  // per body and vertex: at the other ends of its edges
  std::vector<Member> members_;
};

/// What differs, in words: patch_of and the patches' counts against the oracle. Empty: nothing. The outcome's contacts
/// must be all that there are.
std::string patchProblem(const Outcome& outcome, bool by_vertex = false);
/// What differs between the patches of two outcomes, bit by bit.
std::string patchDifference(const Outcome& a, const Outcome& b);

}  // namespace test
}  // namespace dccd
