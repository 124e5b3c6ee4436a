// Working memory of the batched elementary test: pairs as lanes of planes of doubles. Small enough for the first two
// levels of cache, and on the stack: nothing is allocated, and threads share nothing.
#pragma once

#include <cstddef>
#include <cstdint>

#include "simd/exact_batch.h"

namespace dccd {
namespace simd {

constexpr std::size_t BATCH_BLOCK = 64;
/// Distance between planes: 72 doubles keep 64-byte alignment, spread the planes over the cache's sets, and leave room
/// for one vector to be stored from any lane of the block on.
constexpr std::size_t BATCH_STRIDE = BATCH_BLOCK + 8;
using BatchPlane = double[BATCH_STRIDE];

/// First planes of the differences u, v, w (x, y, z each) at both ends of the step.
enum MotionPlane { U_T0 = 0, V_T0 = 3, W_T0 = 6, U_T1 = 9, V_T1 = 12, W_T1 = 15, MOTION_PLANES = 18 };

/// What a piece of the step holds, as the planes store it.
constexpr double PIECE_FREE = 0;  ///< certainly no root
constexpr double PIECE_ROOT = 1;  ///< certainly one root, ends of opposite signs
constexpr double PIECE_UNCERTAIN = 2;

/// What is known of a pair; the first four are BatchVerdict's values.
constexpr double ROOT_NO_CONTACT = 0;  ///< the current root is no contact, or no root is left
constexpr double ROOT_CONTACT = 1;
constexpr double ROOT_UNCERTAIN = 2;
constexpr double ROOT_CONTACT_NO_CELL = 3;
constexpr double ROOT_NOT_BRACKETED = 4;  ///< the few fixed steps did not get close enough
constexpr double ROOT_PENDING = 5;        ///< not refined yet

/// Pairs that came in.
struct alignas(64) MotionBlock {
  BatchPlane motion[MOTION_PLANES];
};

/// Pairs that the quick rejection left, side by side.
struct alignas(64) RootBlock {
  BatchPlane motion[MOTION_PLANES];
  BatchPlane coefficient[4];         ///< F0 = f0, F1 = 3 f1, F2 = 3 f2, F3 = f3
  BatchPlane size[3];                ///< U, V, W
  BatchPlane error;                  ///< bound on f's values
  BatchPlane lo, hi, at_lo;          ///< where the root looked for now lies, and f at lo
  BatchPlane outcome;                ///< ROOT_*
  BatchPlane root_lo, root_hi;       ///< its certified bracket; root_lo holds the approximated root before
  BatchPlane slope, curvature;       ///< |f'| and |f''|/2 where the last step to it began
  std::uint32_t pair[BATCH_STRIDE];  ///< position in the batch
  std::size_t count = 0;
};

/// Pairs that go on to subdivision, with what their coefficients are made of anew.
struct HardBlock : RootBlock {
  const BatchInput* input = nullptr;
  MotionBlock rest;        ///< what rounding took from the differences
  BatchPlane from, width;  ///< of the interval in work, in [0,1]
  BatchPlane smallest;     ///< no interval is narrower
  BatchPlane piece;        ///< PIECE_* of it
};

/// The same with the step split at the extrema of f.
struct alignas(64) SplitBlock : RootBlock {
  alignas(64) BatchPlane end[4];  ///< 0, the two places, 1; without alignas it begins in the base's tail padding
  BatchPlane value[3];            ///< f at the first three
  BatchPlane piece[3];            ///< PIECE_*
  BatchPlane current;             ///< piece in work; -1: none yet, 3: none is left
};

/// Row b lists the positions of b's set bits in ascending order, then zeros: the lane indices that move the lanes of
/// mask b to the front. (Highway's own Compress copies its table to the stack at every use with g++ 12.)
struct FrontTable {
  alignas(64) std::int64_t row[256][8] = {};
  constexpr FrontTable() {
    for (int bits = 0; bits < 256; ++bits) {
      int n = 0;
      for (int lane = 0; lane < 8; ++lane) {
        if (bits >> lane & 1) row[bits][n++] = lane;
      }
    }
  }
};
inline constexpr FrontTable FRONT_TABLE;

/// All of it: about 90 kilobytes, and 35 for the roots that subdivision refines.
struct BatchScratch {
  MotionBlock motion;
  RootBlock single;    ///< certainly one root in the whole step
  SplitBlock several;  ///< more than one sign change among the coefficients
  HardBlock hard;      ///< not settled by these two; goes on to subdivision
};

}  // namespace simd
}  // namespace dccd
