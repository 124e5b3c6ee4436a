// Bounds of leaves and of upper groups against plain references written here, on every target that runs.
#include "simd/cluster_bounds.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "support/step_support.h"
#include "unit/simd/node_groups.h"

namespace dccd {
namespace test {
namespace {

TEST(ClusterBounds, LeavesHoldTheBoundsOfTheirVertices) {
  forEachSimdTarget([](const std::string& target) {
    Random random(17);
    for (std::size_t arity = 1; arity <= 3; ++arity) {
      for (const bool with_margin : {false, true}) {
        const std::size_t vertices = 40, groups = 3;
        std::vector<std::uint16_t> records(vertices * RECORD);
        for (auto& r : records) r = anyRecordValue(random, 32764);
        std::uint16_t margin[RECORD];
        for (auto& m : margin) {
          m = static_cast<std::uint16_t>(random() % 3 == 0 ? 32766 + random() % 2 : random() % 1000);
        }
        std::vector<std::uint32_t> indices(groups * GROUP * arity);
        for (std::size_t i = 0; i < indices.size(); ++i) indices[i] = static_cast<std::uint32_t>(random() % vertices);
        for (std::size_t lane = 0; lane < groups * GROUP; lane += 1 + random() % 7) indices[lane * arity] = UINT32_MAX;

        Groups expected;
        for (std::size_t lane = 0; lane < groups * GROUP; ++lane) {
          Node n = emptyNode();
          for (std::size_t k = 0; k < RECORD && indices[lane * arity] != UINT32_MAX; ++k) {
            int lo = 70000, hi = -1;
            for (std::size_t j = 0; j < arity; ++j) {
              lo = std::min<int>(lo, records[indices[lane * arity + j] * RECORD + k]);
              hi = std::max<int>(hi, records[indices[lane * arity + j] * RECORD + k]);
            }
            if (with_margin) {
              lo = margin[k] == simd::UNBOUNDED ? MIDDLE - 32766 : std::max(lo - margin[k], MIDDLE - 32766);
              hi = margin[k] == simd::UNBOUNDED ? MIDDLE + 32766 : std::min(hi + margin[k], MIDDLE + 32766);
            }
            n.lo[k] = static_cast<std::uint16_t>(lo);
            n.hi[k] = static_cast<std::uint16_t>(hi);
          }
          expected.nodes.push_back(n);
        }
        expected.pack();
        auto soa = hwy::AllocateAligned<std::uint16_t>(groups * SOA_SIZE);
        auto aos = hwy::AllocateAligned<std::uint16_t>(groups * AOS_SIZE);
        simd::buildLeaves(records.data(), indices.data(), arity, groups * GROUP, with_margin ? margin : nullptr,
                          soa.get(), aos.get());
        EXPECT_TRUE(std::equal(soa.get(), soa.get() + groups * SOA_SIZE, expected.soa.get())) << target << arity;
        EXPECT_TRUE(std::equal(aos.get(), aos.get() + groups * AOS_SIZE, expected.aos.get())) << target << arity;
        if (with_margin) continue;
        std::fill_n(aos.get(), groups * AOS_SIZE, std::uint16_t{0});
        simd::boundGroups(records.data(), indices.data(), arity, groups * GROUP, aos.get());
        EXPECT_TRUE(std::equal(aos.get(), aos.get() + groups * AOS_SIZE, expected.aos.get())) << target << arity;
      }
    }
  });
}

TEST(ClusterBounds, UpperGroupsHoldTheBoundsOfTheirChildren) {
  forEachSimdTarget([](const std::string& target) {
    Random random(19);
    for (std::size_t children = 1; children <= 40; ++children) {
      const Groups below = randomGroups(random, children, 32764, 1000);
      Groups expected;
      for (std::size_t c = 0; c < (children + GROUP - 1) / GROUP * GROUP; ++c) {
        Node n = emptyNode();
        if (c < children) {
          std::copy_n(below.aos.get() + c * AOS_SIZE, RECORD, n.lo.begin());
          std::transform(below.aos.get() + c * AOS_SIZE + RECORD, below.aos.get() + (c + 1) * AOS_SIZE, n.hi.begin(),
                         simd::turned);
        }
        expected.nodes.push_back(n);
      }
      expected.pack();
      auto soa = hwy::AllocateAligned<std::uint16_t>(expected.count * SOA_SIZE);
      auto aos = hwy::AllocateAligned<std::uint16_t>(expected.count * AOS_SIZE);
      simd::buildUpper(below.aos.get(), children, soa.get(), aos.get());
      EXPECT_TRUE(std::equal(soa.get(), soa.get() + expected.count * SOA_SIZE, expected.soa.get()))
          << target << children;
      EXPECT_TRUE(std::equal(aos.get(), aos.get() + expected.count * AOS_SIZE, expected.aos.get()))
          << target << children;
    }
  });
}

// A margin that reaches the ends of the range must not make a feature look empty, or two overlapping ones apart.
TEST(ClusterBounds, WidenedNodesStillMeetWhatTheyTouch) {
  forEachSimdTarget([](const std::string& target) {
    std::vector<std::uint16_t> records(2 * RECORD, MIDDLE + 32764);
    std::fill_n(records.begin(), RECORD, static_cast<std::uint16_t>(MIDDLE - 32764));
    std::vector<std::uint32_t> indices(GROUP, UINT32_MAX);
    indices[0] = 0;
    indices[1] = 1;
    const auto widened = [&](int m) {
      std::uint16_t margin[RECORD];
      std::fill_n(margin, RECORD, static_cast<std::uint16_t>(m));
      Groups groups;
      groups.count = 1;
      groups.soa = hwy::AllocateAligned<std::uint16_t>(SOA_SIZE);
      groups.aos = hwy::AllocateAligned<std::uint16_t>(AOS_SIZE);
      simd::buildLeaves(records.data(), indices.data(), 1, GROUP, margin, groups.soa.get(), groups.aos.get());
      return groups;
    };
    const Groups none = widened(0);
    for (const int m : {0, 32763, 32764, 32766, int{simd::UNBOUNDED}}) {
      const Groups groups = widened(m);
      const auto pairs =
          kernelPairs(groups.view(), groups.view(), {0, 0}, true, simd::Diagonal::UPPER_WITH_DIAGONAL, false, 256);
      // Each lane meets itself; the two meet when 2 m reaches the distance of 65528.
      EXPECT_EQ(pairs.size(), m >= 32764 ? 3u : 2u) << target << ", margin " << m;
      // On one side alone the largest margin with an end is half the distance.
      const auto across = kernelPairs(groups.view(), none.view(), {0, 0}, false, simd::Diagonal::ALL, false, 256);
      EXPECT_EQ(across.size(), m == simd::UNBOUNDED ? 4u : 2u) << target << ", margin " << m;
    }
  });
}

}  // namespace
}  // namespace test
}  // namespace dccd
