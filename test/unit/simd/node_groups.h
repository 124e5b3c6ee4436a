// Groups of nodes at random, packed as the kernels of the clustered broad phase read them, and what these find of them.
#pragma once

#include <gtest/gtest.h>
#include <hwy/aligned_allocator.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "simd/group_pairs.h"

namespace dccd {
namespace test {

using simd::AOS_SIZE;
using simd::EMPTY;
using simd::GROUP;
using simd::RECORD;
using simd::SOA_SIZE;
using Random = std::mt19937_64;

constexpr int MIDDLE = 32767;  ///< of the records' range

inline std::uint16_t anyRecordValue(Random& random, int range) {
  return static_cast<std::uint16_t>(static_cast<int>(random() % static_cast<unsigned>(2 * range + 1)) + MIDDLE - range);
}

/// Bounds of one node: lo and hi of the 16 record values. Groups hold the latter turned.
struct Node {
  std::array<std::uint16_t, RECORD> lo, hi;
};

inline Node emptyNode() {
  Node n;
  n.lo.fill(EMPTY);
  n.hi.fill(simd::turned(EMPTY));
  return n;
}

/// A level of a tree.
struct Groups {
  std::size_t count = 0;
  std::vector<Node> nodes;  // 16 a group
  hwy::AlignedFreeUniquePtr<std::uint16_t[]> soa, aos;

  simd::GroupsView view() const { return {soa.get(), aos.get()}; }
  void pack() {
    count = nodes.size() / GROUP;
    soa = hwy::AllocateAligned<std::uint16_t>(count * SOA_SIZE);
    aos = hwy::AllocateAligned<std::uint16_t>(count * AOS_SIZE);
    for (std::size_t g = 0; g < count; ++g) {
      for (std::size_t k = 0; k < RECORD; ++k) {
        std::uint16_t lo = EMPTY, hi = simd::turned(EMPTY);
        for (std::size_t i = 0; i < GROUP; ++i) {
          const Node& n = nodes[g * GROUP + i];
          soa[g * SOA_SIZE + simd::soaIndex(k, i)] = n.lo[k];
          soa[g * SOA_SIZE + RECORD * GROUP + simd::soaIndex(k, i)] = simd::turned(n.hi[k]);
          lo = std::min(lo, n.lo[k]);
          hi = std::max(hi, n.hi[k]);
        }
        aos[g * AOS_SIZE + k] = lo;
        aos[g * AOS_SIZE + RECORD + k] = simd::turned(hi);
      }
    }
  }
};

/// range: of the values; small ones make ties. Some lanes are empty, of one group in four most, and now and then all.
inline Groups randomGroups(Random& random, std::size_t count, int range, int size) {
  Groups groups;
  for (std::size_t g = 0; g < count; ++g) {
    const bool all_empty = random() % 16 == 0;
    const std::size_t full_of_eight = random() % 4 == 0 ? 3 : 7;
    for (std::size_t i = 0; i < GROUP; ++i) {
      Node n = emptyNode();
      if (!all_empty && random() % 8 < full_of_eight) {
        for (std::size_t k = 0; k < RECORD; ++k) {
          const std::uint16_t a = anyRecordValue(random, range);
          const int b = a + static_cast<int>(random() % static_cast<unsigned>(size + 1));
          n.lo[k] = a;
          n.hi[k] = static_cast<std::uint16_t>(std::min(b, MIDDLE + 32766));
        }
      }
      groups.nodes.push_back(n);
    }
  }
  groups.pack();
  return groups;
}

using Pairs = std::vector<std::array<std::uint32_t, 2>>;

/// All pairs of nodes that the kernel leaves, in calls of at most `capacity`.
inline Pairs kernelPairs(const simd::GroupsView& a, const simd::GroupsView& b,
                         const std::vector<std::uint32_t>& group_pairs, bool self, simd::Diagonal diagonal,
                         bool t0_only, std::size_t capacity) {
  Pairs pairs;
  std::vector<std::uint32_t> out(2 * capacity + 2, 0xdeadbeef);
  std::size_t done = 0;
  const std::size_t count = group_pairs.size() / 2;
  while (done < count) {
    std::size_t consumed = 0;
    const std::size_t n = simd::testGroupPairs(a, b, group_pairs.data() + 2 * done, count - done, self, diagonal,
                                               t0_only, out.data(), capacity, &consumed);
    EXPECT_GT(consumed, 0u) << "no progress";
    EXPECT_LE(n, capacity);
    EXPECT_EQ(out[2 * capacity], 0xdeadbeef) << "written beyond the capacity";
    if (consumed == 0) break;
    for (std::size_t i = 0; i < n; ++i) pairs.push_back({out[2 * i], out[2 * i + 1]});
    done += consumed;
  }
  return pairs;
}

}  // namespace test
}  // namespace dccd
