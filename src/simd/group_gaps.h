// How far apart the features of two groups of leaves are where a step ends (cluster_bounds.h).
#pragma once

#include "simd/group_pairs.h"

namespace dccd {
namespace simd {

/// How far the features of two leaf groups are apart at t1, in any of the directions, of which `weights` says how much
/// a record unit counts, in 2^-16 of a common unit. Rounded down; EMPTY_LO where there is no pair. Pairs in `shared`
/// (may be null) do not count, nor do those (i, j) that are listed in `near`: those less than `target` apart, as i * 16
/// + j, up to `room`; *found says how many there are. self: each pair once, and none with itself. In proof: a gap of n
/// record units between two numbers truncated to a unit is one of more than n - 1 of the projections, and the
/// directions' lengths and the rounding are the weights' affair.
std::int16_t gapAtEnd(const GroupsView& a, const GroupsView& b, std::uint32_t g, std::uint32_t h, bool self,
                      const std::uint16_t* shared, const std::uint16_t* weights, std::int16_t target,
                      std::uint8_t* near, std::size_t room, std::size_t* found);

}  // namespace simd
}  // namespace dccd
