// Kernels of the filters in the paper's form: one pair at a time, 8 subspaces at once, and the batched
// non-penetration filter. Raw arrays only.
//
// records: 16 floats a vertex, 64-byte aligned: 8 lanes at t=0, 8 lanes at t=1 (paper/paper_record.h has their order).
// pairs: 4 vertex indices a pair, VF: v f0 f1 f2, EE: ea0 ea1 eb0 eb1.
// Every function copies the pairs that it cannot reject to `survivors`, in order, and returns their number. `survivors`
// has room for `count` pairs and may be `pairs` itself. `error` bounds the rounding of the records
// (PaperRecords::error). The proofs of the margins are in paper/planar_reference.h and paper/non_penetration.h,
// beside the plain references that these kernels equal bit for bit.
#pragma once

#include <cstddef>
#include <cstdint>

namespace dccd {
namespace simd {

std::size_t paperLinearVf(const float* records, const std::uint32_t* pairs, std::size_t count,
                          std::uint32_t* survivors);
std::size_t paperLinearEe(const float* records, const std::uint32_t* pairs, std::size_t count,
                          std::uint32_t* survivors);

std::size_t paperPrimitiveBvVf(const float* records, const std::uint32_t* pairs, std::size_t count,
                               std::uint32_t* survivors);
std::size_t paperPrimitiveBvEe(const float* records, const std::uint32_t* pairs, std::size_t count,
                               std::uint32_t* survivors);

/// Algorithms 1 and 2 of the paper, with margins.
std::size_t paperPlanarVf(const float* records, float error, const std::uint32_t* pairs, std::size_t count,
                          std::uint32_t* survivors);
std::size_t paperPlanarEe(const float* records, float error, const std::uint32_t* pairs, std::size_t count,
                          std::uint32_t* survivors);

/// The branch-free form: every certificate of both algorithms, and more.
std::size_t branchFreePlanarVf(const float* records, float error, const std::uint32_t* pairs, std::size_t count,
                               std::uint32_t* survivors);
std::size_t branchFreePlanarEe(const float* records, float error, const std::uint32_t* pairs, std::size_t count,
                               std::uint32_t* survivors);

/// Four Bernstein coefficients of the coplanarity cubic, a vector's lanes of pairs at a time, in float.
std::size_t nonPenetrationVf(const float* records, float error, const std::uint32_t* pairs, std::size_t count,
                             std::uint32_t* survivors);
std::size_t nonPenetrationEe(const float* records, float error, const std::uint32_t* pairs, std::size_t count,
                             std::uint32_t* survivors);

}  // namespace simd
}  // namespace dccd
