// A block of 4 x 4 x 4 cells as 64 bits in Morton order (x fastest): masks of boxes, shifts to neighbours, ranks.
// With Morton order the cells of an octree leaf are consecutive bits, and leaves sorted by code keep their rank.
#pragma once

#include <array>
#include <cstdint>

namespace dccd {

/// Directions of a cube's faces: -x +x -y +y -z +z.
constexpr int FACE_DIRECTIONS = 6;

/// Bits of the cells whose coordinate on `axis` is `value` (0 to 3).
constexpr std::uint64_t slabBits(int axis, int value) {
  std::uint64_t bits = 0;
  for (int i = 0; i < 64; ++i) {
    if (((i >> axis & 1) | (i >> (axis + 3) & 1) << 1) == value) bits |= std::uint64_t{1} << i;
  }
  return bits;
}

namespace detail {
using RangeMasks = std::array<std::array<std::array<std::uint64_t, 4>, 4>, 3>;

constexpr RangeMasks makeRangeMasks() {
  RangeMasks masks{};
  for (int axis = 0; axis < 3; ++axis) {
    for (int lo = 0; lo < 4; ++lo) {
      for (int hi = lo; hi < 4; ++hi) {
        for (int value = lo; value <= hi; ++value) masks[axis][lo][hi] |= slabBits(axis, value);
      }
    }
  }
  return masks;
}

constexpr std::array<std::array<std::uint8_t, 3>, 64> makeCellCoordinates() {
  std::array<std::array<std::uint8_t, 3>, 64> cells{};
  for (int i = 0; i < 64; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      cells[i][axis] = static_cast<std::uint8_t>((i >> axis & 1) | (i >> (axis + 3) & 1) << 1);
    }
  }
  return cells;
}
}  // namespace detail

/// RANGE_MASKS[axis][lo][hi]: bits of the cells with lo <= coordinate <= hi.
inline constexpr detail::RangeMasks RANGE_MASKS = detail::makeRangeMasks();
/// CELL_COORDINATES[bit]: the cell's x, y, z in its block, 0 to 3.
inline constexpr std::array<std::array<std::uint8_t, 3>, 64> CELL_COORDINATES = detail::makeCellCoordinates();

/// The bit of a cell from its coordinates, each taken modulo 4.
inline unsigned cellBit(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  return (x & 1) | (y & 1) << 1 | (z & 1) << 2 | (x & 2) << 2 | (y & 2) << 3 | (z & 2) << 4;
}

/// Number of set bits. Written out: the baseline has no such instruction and the compiler would call a function.
inline unsigned bitCount(std::uint64_t bits) {
  bits -= bits >> 1 & 0x5555555555555555u;
  bits = (bits & 0x3333333333333333u) + (bits >> 2 & 0x3333333333333333u);
  bits = (bits + (bits >> 4)) & 0x0f0f0f0f0f0f0f0fu;
  return static_cast<unsigned>(bits * 0x0101010101010101u >> 56);
}

/// Index of the lowest set bit; bits must not be 0.
inline unsigned lowestBit(std::uint64_t bits) { return static_cast<unsigned>(__builtin_ctzll(bits)); }

/// Number of set bits strictly below `bit`.
inline unsigned rankBelow(std::uint64_t bits, unsigned bit) { return bitCount(bits & ((std::uint64_t{1} << bit) - 1)); }

/// For every cell, whether its neighbour in `direction` is set: in `block`, or in `next`, the adjoining block there.
inline std::uint64_t neighbourBits(std::uint64_t block, std::uint64_t next, int direction) {
  const int axis = direction >> 1;
  const std::uint64_t v0 = RANGE_MASKS[axis][0][0], v1 = RANGE_MASKS[axis][1][1];
  const std::uint64_t v2 = RANGE_MASKS[axis][2][2], v3 = RANGE_MASKS[axis][3][3];
  if (direction & 1) {
    return (block >> (1 << axis) & (v0 | v2)) | (block >> (7 << axis) & v1) | (next << (9 << axis) & v3);
  }
  return (block << (1 << axis) & (v1 | v3)) | (block << (7 << axis) & v2) | (next >> (9 << axis) & v0);
}

/// 16 bits of a coordinate spread to every third bit.
inline std::uint64_t spreadBits(std::uint32_t value) {
  std::uint64_t v = value & 0xffffu;
  v = (v | v << 16) & 0x0000ff0000ffu;
  v = (v | v << 8) & 0x00f00f00f00fu;
  v = (v | v << 4) & 0x0c30c30c30c3u;
  return (v | v << 2) & 0x249249249249u;
}

/// The inverse of spreadBits.
inline std::uint32_t gatherBits(std::uint64_t v) {
  v &= 0x249249249249u;
  v = (v | v >> 2) & 0x0c30c30c30c3u;
  v = (v | v >> 4) & 0x00f00f00f00fu;
  v = (v | v >> 8) & 0x0000ff0000ffu;
  return static_cast<std::uint32_t>((v | v >> 16) & 0xffffu);
}

/// 48-bit Morton code of a voxel key.
inline std::uint64_t mortonCode(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  return spreadBits(x) | spreadBits(y) << 1 | spreadBits(z) << 2;
}

}  // namespace dccd
