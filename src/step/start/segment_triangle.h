// Do a segment and a triangle meet? Exact, for any finite doubles.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace dccd {

/// For each of `count` pairs p q a b c: 1 where the closed segment pq and the closed triangle abc meet, else 0. Either
/// may be degenerate: a vertex is a segment without length, an edge a triangle without area. positions: 8 doubles a
/// vertex, of which the first three are read, aligned to 32 bytes.
void segmentsMeetTriangles(const double* positions, const std::array<std::uint32_t, 5>* pairs, std::size_t count,
                           std::uint8_t* meet);

/// The same of one pair. Each argument: x, y, z.
bool segmentMeetsTriangle(const double* p, const double* q, const double* a, const double* b, const double* c);

}  // namespace dccd
