// The kernels for pairs of leaves that share no vertex against a plain reference, on every target that runs.
#include <gtest/gtest.h>
#include <hwy/aligned_allocator.h>

#include <algorithm>
#include <random>
#include <vector>

#include "simd/group_pairs.h"
#include "support/step_support.h"

namespace dccd {
namespace test {
namespace {

using namespace simd;
using Random = std::mt19937_64;

/// Two groups of features over the same few vertices, some lanes empty, now and then most.
struct LeafGroups {
  std::size_t arity;
  std::vector<std::uint32_t> features;  // 2 x 16 x arity
  hwy::AlignedFreeUniquePtr<std::uint16_t[]> soa, aos;
  hwy::AlignedFreeUniquePtr<std::uint32_t[]> lanes;

  LeafGroups(Random& random, std::size_t vertices, std::size_t arity, const std::uint16_t* margin,
             const hwy::AlignedFreeUniquePtr<std::uint16_t[]>& of)
      : arity(arity),
        soa(hwy::AllocateAligned<std::uint16_t>(2 * SOA_SIZE)),
        aos(hwy::AllocateAligned<std::uint16_t>(2 * AOS_SIZE)) {
    const std::size_t empty_of_ten = random() % 3 == 0 ? 7 : 1;
    for (std::size_t i = 0; i < 2 * GROUP; ++i) {
      const bool empty = random() % 10 < empty_of_ten;
      const std::size_t first = random() % vertices;
      for (std::size_t k = 0; k < arity; ++k) {
        features.push_back(empty ? UINT32_MAX : static_cast<std::uint32_t>((first + k) % vertices));
      }
    }
    lanes = hwy::AllocateAligned<std::uint32_t>(features.size());
    for (std::size_t i = 0; i < 2 * GROUP; ++i) {
      for (std::size_t k = 0; k < arity; ++k) {
        lanes[(i / GROUP * arity + k) * GROUP + i % GROUP] = features[i * arity + k];
      }
    }
    buildLeaves(of.get(), features.data(), arity, 2 * GROUP, margin, soa.get(), aos.get());
  }
  GroupsView view() const { return {soa.get(), aos.get(), lanes.get(), arity}; }
  bool isEmpty(std::size_t slot) const { return features[slot * arity] == UINT32_MAX; }
  bool shares(std::size_t slot, const LeafGroups& other, std::size_t other_slot) const {
    if (isEmpty(slot)) return false;
    for (std::size_t x = 0; x < arity; ++x) {
      for (std::size_t y = 0; y < other.arity; ++y) {
        if (features[slot * arity + x] == other.features[other_slot * other.arity + y]) return true;
      }
    }
    return false;
  }
};

/// Calls test(a, b, self) with groups of all kinds, near and far, with and without margins.
template <class Test>
void forRandomGroups(const Test& test) {
  forEachSimdTarget([&](const std::string& target) {
    SCOPED_TRACE(target);
    Random random(7);
    for (int round = 0; round < 60; ++round) {
      const std::size_t vertices = 40;
      const int spread = round % 3 == 0 ? 30000 : round % 3 == 1 ? 900 : 40;
      const auto records = hwy::AllocateAligned<std::uint16_t>(vertices * RECORD);
      for (std::size_t i = 0; i < vertices * RECORD; ++i) {
        records[i] =
            static_cast<std::uint16_t>(static_cast<int>(random() % static_cast<unsigned>(2 * spread)) - spread);
      }
      std::uint16_t margin[RECORD];
      std::fill_n(margin, RECORD, static_cast<std::uint16_t>(random() % 20));
      const std::uint16_t* widened = round % 2 ? margin : nullptr;
      const bool self = round % 4 < 2;
      const std::size_t own = round % 8 < 4 ? 2 : 3;
      const LeafGroups a(random, vertices, self ? own : round % 8 == 3 ? 2 : 1, widened, records);
      const LeafGroups b(random, vertices, self ? own : 3, widened, records);
      test(a, self ? a : b, self);
    }
  });
}

/// Pairs of the faces that share a vertex, and of those of one group each other one in one order or the other.
struct Sharing {
  std::vector<std::uint32_t> begin{0}, others;
  std::vector<LanePairs> pairs;

  explicit Sharing(const LeafGroups& faces) {
    for (std::uint32_t g = 0; g < 2; ++g) {
      for (std::uint32_t h = g; h < 2; ++h) {
        LanePairs lanes{};
        bool any = false;
        for (std::size_t i = 0; i < GROUP; ++i) {
          for (std::size_t j = 0; j < GROUP; ++j) {
            if (!leavesOut(faces, g * GROUP + i, h * GROUP + j)) continue;
            lanes.rows[i] |= static_cast<std::uint16_t>(1u << j);
            lanes.columns[j] |= static_cast<std::uint16_t>(1u << i);
            any = true;
          }
        }
        if (!any) continue;
        others.push_back(h);
        pairs.push_back(lanes);
      }
      begin.push_back(static_cast<std::uint32_t>(others.size()));
    }
    others.resize(others.size() + 8);
  }
  static bool leavesOut(const LeafGroups& faces, std::size_t i, std::size_t j) {
    const bool is_other_order = i / GROUP == j / GROUP && (i < j) == ((i + j) % 3 == 0);
    return is_other_order || faces.shares(i, faces, j);
  }
  KnownPairs view() const { return {begin.data(), others.data(), pairs.data()}; }
};

TEST(UnsharedPairs, AreThoseOfTheGeneralTestThatShareNoVertex) {
  std::size_t kept[4] = {0}, dropped[4] = {0};  // by the first one's vertices
  forRandomGroups([&](const LeafGroups& a, const LeafGroups& b, bool self) {
    const std::vector<std::uint32_t> pairs = {0, 0, 0, 1, 1, 1};
    for (const bool t0_only : {false, true}) {
      if (a.arity == 3 && !t0_only) continue;
      std::uint32_t all[6 * GROUP * GROUP], some[6 * GROUP * GROUP];
      std::size_t consumed = 0;
      const Diagonal diagonal = a.arity == 3 ? Diagonal::ALL : Diagonal::STRICT_UPPER;
      const std::size_t n = testGroupPairs(a.view(), b.view(), pairs.data(), 3, self, diagonal, t0_only, all,
                                           3 * GROUP * GROUP, &consumed);
      std::vector<std::uint32_t> expected;
      for (std::size_t i = 0; i < n; ++i) {
        const std::uint32_t one = all[2 * i], other = all[2 * i + 1];
        if (a.arity == 3 ? Sharing::leavesOut(a, one, other) : a.shares(one, b, other)) continue;
        expected.insert(expected.end(), all + 2 * i, all + 2 * i + 2);
      }
      const std::size_t m = a.arity == 3 ? testOtherPairs(a.view(), pairs.data(), 3, Sharing(a).view(), some,
                                                          3 * GROUP * GROUP, &consumed)
                                         : testUnsharedPairs(a.view(), b.view(), pairs.data(), 3, self, t0_only, some,
                                                             3 * GROUP * GROUP, &consumed);
      ASSERT_EQ(consumed, 3u);
      ASSERT_EQ(std::vector<std::uint32_t>(some, some + 2 * m), expected);
      kept[a.arity + b.arity - 3] += m;
      dropped[a.arity + b.arity - 3] += n - m;
    }
  });
  for (const std::size_t vertices : {4, 5, 6}) {
    EXPECT_GT(kept[vertices - 3], 1000u) << vertices;
    EXPECT_GT(dropped[vertices - 3], 100u) << vertices;
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
