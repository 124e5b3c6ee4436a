// One tier of the exact rung alone, which a step never asks for.
#pragma once

#include "dccd/elementary.h"

namespace dccd {
namespace test {

/// DOUBLE_BATCH: the batched kernel on one pair; a contact whose cell it cannot tell is undecided.
ElementaryResult decideByBatch(PairKind kind, const PairMotion& pair, int toc_bits);

/// kind: VERTEX_FACE or EDGE_EDGE. Throws std::invalid_argument for a tier that does not exist.
ElementaryResult decideWithTier(Tier tier, PairKind kind, const PairMotion& pair, int toc_bits);

}  // namespace test
}  // namespace dccd
