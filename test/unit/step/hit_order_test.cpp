#include "step/pairs/hit_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <tuple>
#include <utility>

namespace dccd {
namespace {

TEST(HitOrder, SortsByBodiesThenKeyAndKeepsEveryHit) {
  std::mt19937_64 random(5);
  HitOrder order;
  for (const int bits : {0, 1, 8, 11, 12, 31, 64}) {
    for (const auto& [hits, bodies] :
         {std::pair{3000, 1u}, {3000, 2u}, {3000, 300u}, {1024, 2u}, {1023, 300u}, {9, 2u}}) {
      std::vector<std::vector<Hit>> parts(4);
      std::size_t count = 0;
      for (int i = 0; i < hits; ++i) {
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
      // Those that are equal in both may come in any order.
      const auto same_keys = [](const Hit* x, const Hit* y) { return x->bodies == y->bodies && x->key == y->key; };
      std::sort(expected.begin(), expected.end(),
                [](const Hit* x, const Hit* y) { return std::tie(x->bodies, x->key) < std::tie(y->bodies, y->key); });
      std::vector<const Hit*> sorted;
      order.sort(pointers);
      for (std::size_t i = 0; i < order.size(); ++i) sorted.push_back(&order[i]);
      ASSERT_EQ(sorted.size(), count);
      EXPECT_TRUE(std::equal(sorted.begin(), sorted.end(), expected.begin(), same_keys))
          << hits << " hits, " << bits << " bits, " << bodies << " bodies";
      EXPECT_TRUE(std::set<const Hit*>(sorted.begin(), sorted.end()) ==
                  std::set<const Hit*>(expected.begin(), expected.end()));
    }
  }
}

TEST(HitOrder, NothingAndOne) {
  HitOrder order;
  const std::vector<Hit> none, one(1);
  for (const auto& parts : {std::vector<const std::vector<Hit>*>{}, {&none}}) {
    order.sort(parts);
    EXPECT_EQ(order.size(), 0u);
  }
  for (const auto& parts : {std::vector<const std::vector<Hit>*>{&none, &one}, {&one}, {&one, &none}}) {
    order.sort(parts);
    ASSERT_EQ(order.size(), 1u);
    EXPECT_EQ(&order[0], &one[0]);
  }
}

}  // namespace
}  // namespace dccd
