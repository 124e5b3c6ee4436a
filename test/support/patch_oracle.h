// Which contacts belong together, by the definition of doc/algorithm.md alone.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "dccd/outcome.h"

namespace dccd {
namespace test {

/// Which contacts (and edges through faces) of a step are between the same two areas.
class PatchOracle {
 public:
  explicit PatchOracle(const Outcome& outcome);
  /// Numbers of the patches in the order of their first members: contacts, then crossings, as they
  /// are listed.
  std::vector<std::uint32_t> patches() const;

 private:
  using Vertex = std::pair<std::uint16_t, Index>;            // body, index
  using Partners = std::pair<std::uint16_t, std::uint16_t>;  // ascending
  struct Member {
    std::vector<Vertex> side[2];  // the second is empty with the map
    std::uint16_t body[2];
    Partners partners() const { return std::minmax(body[0], body[1]); }
  };
  std::map<Vertex, std::size_t> areasOf(const Partners& partners) const;

  const Outcome& outcome_;
  std::vector<std::vector<std::vector<Index>>> joined_;  // per body and vertex: at the other ends of its edges
  std::vector<Member> members_;
};

/// What differs, in words: patch_of and the patches' counts against the oracle. Empty: nothing. The outcome's contacts
/// must be all that there are.
std::string patchProblem(const Outcome& outcome);
/// What differs between the patches of two outcomes, bit by bit.
std::string patchDifference(const Outcome& a, const Outcome& b);

}  // namespace test
}  // namespace dccd
