#include "step/hit_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace dccd {
namespace {

TEST(HitOrder, SortsByBodiesThenKeyAndKeepsEveryHit) {
  std::mt19937_64 random(5);
  HitOrder order;
  for (const int bits : {0, 1, 8, 11, 12, 31, 64}) {
    for (const std::uint32_t bodies : {1u, 2u, 300u}) {
      std::vector<std::vector<Hit>> parts(4);
      std::size_t count = 0;
      for (int i = 0; i < 3000; ++i) {
        Hit hit{};
        hit.key = bits == 64 ? random() : random() & ((std::uint64_t{1} << bits) - 1);
        hit.bodies =
            static_cast<std::uint32_t>(random() % bodies) << 16 | static_cast<std::uint32_t>(random() % bodies);
        hit.toc_lower = static_cast<double>(i);
        parts[random() % 3].push_back(hit);  // the last part stays empty
        ++count;
      }
      std::vector<const std::vector<Hit>*> pointers;
      std::vector<const Hit*> expected;
      for (const auto& part : parts) {
        pointers.push_back(&part);
        for (const Hit& hit : part) expected.push_back(&hit);
      }
      std::stable_sort(expected.begin(), expected.end(), [](const Hit* x, const Hit* y) {
        return std::tie(x->bodies, x->key) < std::tie(y->bodies, y->key);
      });
      const auto& sorted = order.sort(pointers);
      ASSERT_EQ(sorted.size(), count);
      EXPECT_EQ(sorted, expected) << bits << " bits, " << bodies << " bodies";
    }
  }
}

TEST(HitOrder, NothingAndOne) {
  HitOrder order;
  EXPECT_TRUE(order.sort({}).empty());
  const std::vector<Hit> none, one(1);
  EXPECT_TRUE(order.sort({&none}).empty());
  ASSERT_EQ(order.sort({&none, &one}).size(), 1u);
  EXPECT_EQ(order.sort({&one})[0], &one[0]);
}

}  // namespace
}  // namespace dccd
