// How much a map may become while it is used; what its parts take in memory is in tolerances.h.
#pragma once

#include <cstddef>

namespace dccd {

/// What splitting the leaves that exclude_boxes cut adds to a map at most.
constexpr std::size_t MAX_ADDED_LEAVES = std::size_t{1} << 18;

}  // namespace dccd
