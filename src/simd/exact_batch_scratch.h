// Working memory of the batched elementary test: a block of pairs as planes of doubles, one lane a pair. Small enough
// for the first-level cache, and on the stack: nothing is allocated, and threads share nothing.
#pragma once

#include <cstddef>
#include <cstdint>

namespace deformable_ccd {
namespace simd {

constexpr std::size_t BATCH_BLOCK = 64;
/// Distance between planes: 72 doubles keep 64-byte alignment and spread the planes over the cache's sets.
constexpr std::size_t BATCH_STRIDE = BATCH_BLOCK + 8;

/// First planes of the differences u, v, w (x, y, z each) at both ends of the step.
enum MotionPlane { U_T0 = 0, V_T0 = 3, W_T0 = 6, U_T1 = 9, V_T1 = 12, W_T1 = 15, MOTION_PLANES = 18 };

/// What a piece of the step holds, as the planes store it.
constexpr double PIECE_FREE = 0;       ///< certainly no root
constexpr double PIECE_ROOT = 1;       ///< certainly one root, ends of opposite signs
constexpr double PIECE_UNCERTAIN = 2;

/// What the refinement of one root found; the first four are BatchVerdict's values.
constexpr double ROOT_NO_CONTACT = 0;
constexpr double ROOT_CONTACT = 1;
constexpr double ROOT_UNCERTAIN = 2;
constexpr double ROOT_CONTACT_NO_CELL = 3;
constexpr double ROOT_NOT_BRACKETED = 4;  ///< the few fixed steps did not get close enough
constexpr double ROOT_PENDING = 5;        ///< not refined yet

struct alignas(64) MotionBlock {
  double motion[MOTION_PLANES][BATCH_STRIDE];
};

/// Pairs that the quick rejection left.
struct alignas(64) RootBlock {
  double motion[MOTION_PLANES][BATCH_STRIDE];
  double coefficient[4][BATCH_STRIDE];  ///< F0 = f0, F1 = 3 f1, F2 = 3 f2, F3 = f3
  double size[3][BATCH_STRIDE];         ///< U, V, W
  double error[BATCH_STRIDE];           ///< bound on f's values; infinite where the guard fails
  double end[4][BATCH_STRIDE];          ///< 0, the two places where the step is split, 1
  double value[4][BATCH_STRIDE];        ///< f there
  double piece[3][BATCH_STRIDE];        ///< PIECE_*
  double lo[BATCH_STRIDE];              ///< the root looked for now
  double hi[BATCH_STRIDE];
  double at_lo[BATCH_STRIDE];
  double at_hi[BATCH_STRIDE];
  double outcome[BATCH_STRIDE];         ///< ROOT_*
  double root_lo[BATCH_STRIDE];
  double root_hi[BATCH_STRIDE];
  std::uint32_t pair[BATCH_STRIDE];     ///< position in the batch
  std::uint8_t current[BATCH_STRIDE];   ///< piece in work; 3: none is left
  std::size_t count = 0;
};

}  // namespace simd
}  // namespace deformable_ccd
