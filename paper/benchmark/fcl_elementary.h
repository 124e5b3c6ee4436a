// FCL's elementary tests, as the elementary test of every combination of filters: the cubic of Provot 1997, solved in
// floating point, which is what the paper's comparison has in this place. Not exact (it misses contacts), and only
// timed.
#pragma once

#include <cstddef>

#include "dccd/elementary.h"

namespace dccd {
namespace benchmarks {

/// Tests every pair; returns how many it calls colliding. filtered: with FCL's own coplanarity test in front.
std::size_t fclElementary(PairKind kind, const VertexMotion* vertices, const Quad* pairs, std::size_t count,
                          bool filtered);

}  // namespace benchmarks
}  // namespace dccd
