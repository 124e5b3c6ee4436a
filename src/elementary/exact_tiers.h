// The tiers of the exact rung one by one. Each answers CONTACT (with the TOC's cell), NO_CONTACT or UNDECIDED; which
// one answers first changes nothing in the answer. Rounding must be to nearest, denormals on.
#pragma once

#include <cstdint>

#include "dccd/elementary.h"

namespace dccd {
namespace exact {

/// Bits per coordinate, after scaling the pair to integers, up to which the fixed-width integers are wide enough.
constexpr int FIXED_INTEGER_LIMBS = 64;
constexpr int FIXED_INTEGER_MAX_BITS = (64 * FIXED_INTEGER_LIMBS - 66) / 18;

PairMotion motionOf(const VertexMotion* vertices, const Quad& quad);

/// The result that says contact in cell k of the 2^-toc_bits grid; k = 2^toc_bits means a TOC of exactly 1.
ElementaryResult contactInCell(std::int64_t cell, int toc_bits, Tier tier);
ElementaryResult noContact(Tier tier);
ElementaryResult undecided(Tier tier);

/// COINCIDENCE: a vertex of one feature where one of the other is, at t = 0.
ElementaryResult decideByCoincidence(PairKind kind, const PairMotion& pair, int toc_bits);
/// DOUBLE_DOUBLE, in doubles alone: points in a plane across an axis, throughout or at the start. Undecided for others,
/// and where a vertex comes to an edge's end, or an edge's line at once.
ElementaryResult decideInPlane(PairKind kind, const PairMotion& pair, int toc_bits);
/// DOUBLE_DOUBLE: roots bracketed within 2^-52; undecided where f is zero, or nearly, at an end of the step or an
/// extremum, and where a feature's border is hit exactly.
ElementaryResult decideByDoubleDouble(PairKind kind, const PairMotion& pair, int toc_bits);
/// FIXED_INTEGER, where integers of one or two words and one look at a rational time p/q with a small q are enough:
/// both features at rest, or the first root of f is such a time. Undecided otherwise.
ElementaryResult decideAtSimpleTime(PairKind kind, const PairMotion& pair, int toc_bits);
/// The same where the points move along one axis alone: f is linear then.
ElementaryResult decideAlongAxis(PairKind kind, const PairMotion& pair, int toc_bits);
/// The contact at the only root of f in (low, high), where that is such a time; else undecided.
ElementaryResult contactAtSimpleTime(PairKind kind, const PairMotion& pair, double low, double high, int toc_bits);
/// FIXED_INTEGER: undecided for more than FIXED_INTEGER_MAX_BITS bits. BIG_INTEGER: always decides.
ElementaryResult decideByFixedIntegers(PairKind kind, const PairMotion& pair, int toc_bits);
ElementaryResult decideByBigIntegers(PairKind kind, const PairMotion& pair, int toc_bits);

/// What DOUBLE_BATCH left, by the tiers after it; always decides.
ElementaryResult decideUncertain(PairKind kind, const PairMotion& pair, int toc_bits);

}  // namespace exact
}  // namespace dccd
