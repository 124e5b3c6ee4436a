// What becomes of a voxel of a map beside tracked bodies: the whole rule of own voxels (doc/algorithm.md, "Own
// voxels").
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace dccd {

enum class VoxelState : std::uint8_t {
  UNKNOWN,    ///< no map showed it free while no body was within reach, or maps leave it out while one rests there
  FREE,       ///< one did, or nobody looked there, and it has not been occupied since
  OWN,        ///< it was free, and has been occupied only while one of its owners was within reach
  OBSTACLE,   ///< it was occupied while nobody was within reach, or is trusted
  DOUBT,      ///< all else that is occupied
  LEFT,       ///< it was OWN, its owners are out of reach, and nothing was found there since: theirs if they come back
              ///< within OWN_LEFT_S, then in DOUBT
  LEFT_SEEN,  ///< the same, but one look found something there: a sensor's noise, unless another one does
};

/// What a map shows of it, and who was within reach at some time from the map before, less the lag, to this one. What a
/// map leaves out is as it was.
enum class VoxelEvent : std::uint8_t {
  OCCUPIED_WITH_OWNER,  ///< a body that may account for it: an owner, or of what appears any whose way is known. After
                        ///< a gap it must have stayed within reach
  OCCUPIED_WITH_OTHER,  ///< only others are
  OCCUPIED_ALONE,       ///< nobody is
  FOUND_ALONE,          ///< the same, and the sensor found something there since the map before
  UNFOUND_ALONE,        ///< the same, and the map tells that it did not
  OCCUPIED_AT_SEAM,     ///< nobody is, as far as is known, but where some body was is not known
  FREE_WITH_OWNER,
  FREE_WITH_OTHER,  ///< or where some body was is not known
  FREE_ALONE,
  MAP_SEAM,  ///< its frame moved, or it is another one, or has another resolution: these are other voxels
};

constexpr std::size_t VOXEL_STATES = 7, VOXEL_EVENTS = 10;

constexpr VoxelState nextState(VoxelState state, VoxelEvent event) {
  using Row = std::array<VoxelState, VOXEL_EVENTS>;
  constexpr VoxelState U = VoxelState::UNKNOWN, F = VoxelState::FREE, OWN = VoxelState::OWN, B = VoxelState::OBSTACLE,
                       D = VoxelState::DOUBT, L = VoxelState::LEFT, S = VoxelState::LEFT_SEEN;
  // clang-format off
  constexpr std::array<Row, VOXEL_STATES> TABLE{{
      //    occupied                                free                 the map's
      //    owner other alone found unfound at seam owner other alone    seam
      {{    D,    D,    B,    B,    B,      B,      U,    U,    F,       U}},  // UNKNOWN
      {{    OWN,  D,    B,    B,    B,      D,      F,    F,    F,       U}},  // FREE
      {{    OWN,  D,    D,    S,    L,      D,      F,    F,    F,       U}},  // OWN
      {{    B,    B,    B,    B,    B,      B,      B,    B,    F,       U}},  // OBSTACLE
      {{    D,    D,    D,    B,    D,      D,      F,    F,    F,       U}},  // DOUBT
      {{    OWN,  D,    D,    S,    L,      D,      F,    F,    F,       U}},  // LEFT
      {{    OWN,  D,    D,    D,    S,      D,      F,    F,    F,       U}},  // LEFT_SEEN
  }};
  // clang-format on
  return TABLE[static_cast<std::size_t>(state)][static_cast<std::size_t>(event)];
}

}  // namespace dccd
