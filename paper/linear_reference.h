// The parallel linear filter (paper, Section 4, Equations 1 to 7), one pair at a time in plain C++.
//
// On a line, if every vertex of one feature is strictly on one side of every vertex of the other at t=0, and on the
// same side at t=1, each difference of two vertices keeps its sign during the step, since it is linear in t. A point of
// one feature minus a point of the other is a convex combination of such differences and keeps it, too: no contact
// on the line, hence none in space (paper, Theorem 1).
//
// Rounding: values are compared strictly and never combined; a stored value is monotone in the exact projection
// (paper/paper_record.h), so each strict comparison holds for the exact projections. No margin. Equal values prove
// nothing: taking zero as positive loses contacts.
#pragma once

#include "dccd/elementary.h"
#include "paper/paper_record.h"

namespace dccd {

/// True when the linear filter proves that vertex v and face f0 f1 f2 do not meet.
bool linearSeparatedVf(const PaperRecord& v, const PaperRecord& f0, const PaperRecord& f1, const PaperRecord& f2);

/// True when the linear filter proves that the edges ea and eb do not meet.
bool linearSeparatedEe(const PaperRecord& ea0, const PaperRecord& ea1, const PaperRecord& eb0, const PaperRecord& eb1);

/// Either, for a pair of the kind (VERTEX_FACE or EDGE_EDGE).
bool linearSeparated(PairKind kind, const PaperRecord* records, const Quad& pair);

}  // namespace dccd
