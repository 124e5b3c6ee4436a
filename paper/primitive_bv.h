// A rival of the paper: SIMD primitive bounding volumes (Section 6; Tang et al. 2010). A pair is rejected when the
// swept 16-DOPs of its two features, over the directions of the record, are disjoint. The bounds are minima and maxima
// of stored values, compared strictly; the values are monotone in the exact projection, so no margin is needed.
#pragma once

#include "dccd/elementary.h"
#include "paper/paper_record.h"

namespace dccd {

/// True when the swept bounds prove that the pair (VERTEX_FACE or EDGE_EDGE) does not meet. Plain reference.
bool primitiveBvSeparated(PairKind kind, const PaperRecord* records, const Quad& pair);

}  // namespace dccd
