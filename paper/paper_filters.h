// The filters over chunks of pairs, by name: what the tests and the benchmarks of the paper's pipeline call.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "dccd/elementary.h"
#include "paper/paper_record.h"

namespace dccd {

enum class PaperFilter : std::uint8_t {
  PRIMITIVE_BV = 0,         ///< rival: swept 16-DOP of each feature (paper/primitive_bv.h)
  LINEAR,                   ///< paper, Section 4 (paper/linear_reference.h)
  NON_PENETRATION,          ///< rival as published: scalar, in double (paper/non_penetration.h)
  NON_PENETRATION_BATCHED,  ///< the same, 8 pairs at a time in float
  PLANAR_PAPER,             ///< paper, Algorithms 1 and 2 (paper/planar_reference.h)
  PLANAR_BRANCH_FREE,       ///< every certificate of both algorithms
  COUNT
};
const char* toString(PaperFilter filter);

/// Copies the pairs that the filter cannot reject to `survivors`, in order, and returns their number. `survivors` has
/// room for `count` pairs and may be `pairs`. kind: VERTEX_FACE or EDGE_EDGE. `vertices` is read by NON_PENETRATION
/// alone.
std::size_t filterPairs(PaperFilter filter, PairKind kind, const PaperRecords& records, const VertexMotion* vertices,
                        const Quad* pairs, std::size_t count, Quad* survivors);

/// The plain reference of the filter, pair by pair: true when it rejects.
bool filterRejects(PaperFilter filter, PairKind kind, const PaperRecords& records, const VertexMotion* vertices,
                   const Quad& pair);

}  // namespace dccd
