// Pairs as people and simulators make them: meshes on grids, at rest, in one plane, moving by round numbers. Ordinary
// input that is degenerate everywhere. Free of any test framework: tests and benchmarks draw from here.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "support/generators.h"
#include "support/pair_list.h"

namespace dccd {
namespace test {

/// Two surfaces' pairs of one kind whose boxes meet.
struct StructuredPairs : PairList {
  std::string family;
};

/// All families, vertex-face and edge-edge of each. Two sheets of cells x cells quads each.
std::vector<StructuredPairs> structuredPairs(int cells);

/// The sheets of each family without pairs, for whole steps: each of cells + 1 points a side, one after the other.
std::vector<StructuredPairs> structuredSheets(int cells);

/// Pairs with each coordinate that is not 0 moved by up to two units in the last place.
StructuredPairs perturbed(const StructuredPairs& pairs, std::uint64_t seed);

/// Pairs of one kind without common vertices.
StructuredPairs pairsOf(const std::string& family, PairKind kind, const std::vector<Query>& queries);
/// Random pairs of a family, the same in each run.
StructuredPairs hardPairs(Hardness hardness, PairKind kind, std::size_t count);

}  // namespace test
}  // namespace dccd
