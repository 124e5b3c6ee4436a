#include "octomap/passed_voxels.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "obstacle/radix_sort.h"

namespace dccd {
namespace {

constexpr int COORDINATE_BITS = 14;  // of a block
constexpr std::uint64_t COORDINATE = (1u << COORDINATE_BITS) - 1;

std::size_t hashOf(std::uint64_t block) { return static_cast<std::size_t>(block * 0x9e3779b97f4a7c15u >> 20); }

}  // namespace

void PassedVoxels::clear(std::size_t most_bytes) {
  most_bytes_ = most_bytes;
  full_ = false;
  if (table_.empty()) table_.resize(std::size_t{1} << 12);
  std::fill(table_.begin(), table_.end(), Slot());
  used_ = 0;
  blocks_.clear();
  next_ = 0;
}

std::size_t PassedVoxels::memoryBytes() const {
  return table_.capacity() * sizeof(Slot) + (blocks_.capacity() + other_.capacity()) * sizeof(Block);
}

void PassedVoxels::mark(std::uint64_t block, std::uint64_t bits) {
  if (full_) return;
  const std::size_t mask = table_.size() - 1;
  for (std::size_t slot = hashOf(block) & mask;; slot = (slot + 1) & mask) {
    Slot& at = table_[slot];
    if (at.bits != 0 && at.block != block) continue;
    used_ += at.bits == 0;
    at.block = block;
    at.bits |= bits;
    break;
  }
  if (2 * used_ <= table_.size()) return;
  full_ = 4 * table_.size() * sizeof(Slot) > most_bytes_;  // twice the table, and as much for its blocks
  if (full_) return;
  std::vector<Slot> old(2 * table_.size());
  old.swap(table_);
  used_ = 0;
  for (const Slot& slot : old) {
    if (slot.bits != 0) mark(slot.block, slot.bits);
  }
}

void PassedVoxels::add(const Eigen::Vector3d& sensor, const Eigen::Vector3d& end) {
  std::int32_t key[3], step[3];
  double next[3], each[3];
  std::int64_t count = 1;
  for (int axis = 0; axis < 3; ++axis) {
    key[axis] = static_cast<std::int32_t>(std::floor(sensor[axis]));
    const std::int32_t last = static_cast<std::int32_t>(std::floor(end[axis]));
    const double way = end[axis] - sensor[axis];
    step[axis] = way < 0 ? -1 : 1;
    count += std::abs(last - key[axis]);
    each[axis] = key[axis] == last ? std::numeric_limits<double>::infinity() : 1 / std::abs(way);
    const double to_plane = way < 0 ? sensor[axis] - key[axis] : key[axis] + 1 - sensor[axis];
    next[axis] = key[axis] == last ? std::numeric_limits<double>::infinity() : to_plane * each[axis];
  }
  const auto blockOf = [&] {
    return static_cast<std::uint64_t>(key[0] >> 2) | static_cast<std::uint64_t>(key[1] >> 2) << COORDINATE_BITS |
           static_cast<std::uint64_t>(key[2] >> 2) << 2 * COORDINATE_BITS;
  };
  std::uint64_t block = blockOf(), bits = 0;
  for (; count > 0; --count) {
    const auto bitOf = [&](int axis) { return static_cast<std::uint32_t>(key[axis]); };
    bits |= std::uint64_t{1} << cellBit(bitOf(0), bitOf(1), bitOf(2));
    const int axis = next[0] < next[1] ? (next[0] < next[2] ? 0 : 2) : (next[1] < next[2] ? 1 : 2);
    const std::int32_t before = key[axis];
    key[axis] += step[axis];
    next[axis] += each[axis];
    if (((before ^ key[axis]) >> 2) == 0 && count > 1) continue;
    mark(block, bits);
    if (static_cast<std::uint32_t>(key[axis]) > 65535) return;
    block = blockOf();
    bits = 0;
  }
}

void PassedVoxels::sort() {
  blocks_.reserve(used_);
  for (const Slot& slot : table_) {
    if (slot.bits == 0) continue;
    const auto key = [&](int axis) {
      return static_cast<std::uint32_t>(slot.block >> axis * COORDINATE_BITS & COORDINATE) << 2;
    };
    blocks_.push_back({mortonCode(key(0), key(1), key(2)), slot.bits});
  }
  other_.resize(blocks_.size());
  std::uint64_t differ = 0;
  for (const Block& block : blocks_) differ |= block.code ^ blocks_[0].code;
  for (int shift = 6; shift < 48; shift += RADIX_BITS) {
    if ((differ >> shift & ((1u << RADIX_BITS) - 1)) == 0) continue;
    radixPass(blocks_, other_, shift, [](const Block& block) { return block.code; });
  }
}

Seen PassedVoxels::look(const OctreeCube& cube) {
  while (next_ < blocks_.size() && blocks_[next_].code + 63 < cube.code) ++next_;
  if (next_ == blocks_.size() || blocks_[next_].code >= cube.end()) return Seen::NONE;
  if (cube.size() > 4) return Seen::SOME;
  const std::uint64_t all = cube.size() == 4 ? ~std::uint64_t{0} : cube.size() == 2 ? 0xff : 1;
  const std::uint64_t seen = blocks_[next_].bits >> (cube.code & 63) & all;
  return seen == 0 ? Seen::NONE : seen == all ? Seen::ALL : Seen::SOME;
}

}  // namespace dccd
