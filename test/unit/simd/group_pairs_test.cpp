// The kernels of the clustered broad phase against plain references written here, on every target that runs.
#include "simd/group_pairs.h"

#include <gtest/gtest.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <new>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/step_support.h"
#include "unit/simd/node_groups.h"

namespace dccd {
namespace test {
namespace {

bool isEmpty(const Node& n) { return n.lo[0] == EMPTY; }

/// The definition: at both times beyond the other in one direction and on one side.
bool apart(const Node& a, const Node& b, bool t0_only) {
  if (isEmpty(a) || isEmpty(b)) return true;
  for (std::size_t k = 0; k < 8; ++k) {
    const std::size_t end = t0_only ? k : k + 8;
    if ((a.lo[k] > b.hi[k] && a.lo[end] > b.hi[end]) || (b.lo[k] > a.hi[k] && b.lo[end] > a.hi[end])) return true;
  }
  return false;
}

Pairs referencePairs(const Groups& a, const Groups& b, const std::vector<std::uint32_t>& group_pairs, bool self,
                     simd::Diagonal diagonal, bool t0_only) {
  Pairs pairs;
  for (std::size_t p = 0; p < group_pairs.size(); p += 2) {
    const std::uint32_t g = group_pairs[p], h = group_pairs[p + 1];
    for (std::uint32_t i = 0; i < GROUP; ++i) {
      for (std::uint32_t j = 0; j < GROUP; ++j) {
        if (self && g == h && diagonal == simd::Diagonal::UPPER_WITH_DIAGONAL && j < i) continue;
        if (self && g == h && diagonal == simd::Diagonal::STRICT_UPPER && j <= i) continue;
        if (!apart(a.nodes[g * GROUP + i], b.nodes[h * GROUP + j], t0_only)) {
          pairs.push_back({static_cast<std::uint32_t>(g * GROUP + i), static_cast<std::uint32_t>(h * GROUP + j)});
        }
      }
    }
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

std::vector<std::uint32_t> allGroupPairs(std::size_t na, std::size_t nb, bool upper) {
  std::vector<std::uint32_t> pairs;
  for (std::uint32_t g = 0; g < na; ++g) {
    for (std::uint32_t h = upper ? g : 0; h < nb; ++h) pairs.insert(pairs.end(), {g, h});
  }
  return pairs;
}

TEST(GroupPairs, PairsOfTwoTreesAreThoseOfTheDefinition) {
  forEachSimdTarget([](const std::string& target) {
    Random random(7);
    std::size_t kept = 0, all = 0;
    for (int round = 0; round < 60; ++round) {
      const int range = round % 3 == 0 ? 2 : round % 3 == 1 ? 100 : 32764;
      const int size = std::max(1, range / static_cast<int>(1 + random() % 4));
      const Groups a = randomGroups(random, 1 + random() % 4, range, size),
                   b = randomGroups(random, 1 + random() % 4, range, size);
      for (const bool t0_only : {false, true}) {
        const auto groups = allGroupPairs(a.count, b.count, false);
        Pairs found =
            kernelPairs(a.view(), b.view(), groups, false, simd::Diagonal::ALL, t0_only, 256 + random() % 300);
        std::sort(found.begin(), found.end());
        ASSERT_EQ(found, referencePairs(a, b, groups, false, simd::Diagonal::ALL, t0_only))
            << target << ", round " << round;
        kept += found.size();
        all += groups.size() / 2 * GROUP * GROUP;
      }
    }
    EXPECT_GT(kept, all / 50) << "the test keeps too little to say anything";
    EXPECT_LT(kept, all - all / 50);
  });
}

TEST(GroupPairs, EachPairOfATreeWithItselfOnce) {
  forEachSimdTarget([](const std::string& target) {
    Random random(11);
    for (int round = 0; round < 40; ++round) {
      const Groups a = randomGroups(random, 1 + random() % 4, 50, 40);
      const auto groups = allGroupPairs(a.count, a.count, true);
      for (const simd::Diagonal diagonal : {simd::Diagonal::UPPER_WITH_DIAGONAL, simd::Diagonal::STRICT_UPPER}) {
        Pairs found = kernelPairs(a.view(), a.view(), groups, true, diagonal, false, 256);
        std::sort(found.begin(), found.end());
        ASSERT_EQ(found, referencePairs(a, a, groups, true, diagonal, false)) << target;
        EXPECT_EQ(std::adjacent_find(found.begin(), found.end()), found.end());
      }
    }
  });
}

/// A copy of values that ends where the process may read no further.
class AtTheEndOfMemory {
 public:
  AtTheEndOfMemory(const std::uint16_t* values, std::size_t count) {
    const std::size_t bytes = count * sizeof *values;
    size_ = (bytes + PAGE - 1) / PAGE * PAGE;
    base_ =
        static_cast<char*>(::mmap(nullptr, size_ + PAGE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
    if (base_ == MAP_FAILED) throw std::bad_alloc();
    if (::mprotect(base_ + size_, PAGE, PROT_NONE) != 0) throw std::runtime_error("mprotect failed");
    copy_ = base_ + size_ - bytes;
    std::memcpy(copy_, values, bytes);
  }
  ~AtTheEndOfMemory() { ::munmap(base_, size_ + PAGE); }
  AtTheEndOfMemory(const AtTheEndOfMemory&) = delete;
  AtTheEndOfMemory& operator=(const AtTheEndOfMemory&) = delete;
  const std::uint16_t* data() const { return reinterpret_cast<const std::uint16_t*>(copy_); }

 private:
  static constexpr std::size_t PAGE = 1 << 16;  // no system's pages are larger than that
  std::size_t size_ = 0;
  char *base_ = nullptr, *copy_ = nullptr;
};

// One time alone may be either: the arrays then begin with the values at t1, and end a quarter earlier.
TEST(GroupPairs, WithOneTimeAloneNothingIsReadOfTheOther) {
  Random random(12);
  const Groups both = randomGroups(random, 3, 50, 100);
  Groups at_end;
  at_end.nodes = both.nodes;
  at_end.count = both.count;
  for (Node& n : at_end.nodes) {
    std::copy(n.lo.begin() + 8, n.lo.end(), n.lo.begin());
    std::copy(n.hi.begin() + 8, n.hi.end(), n.hi.begin());
  }
  const AtTheEndOfMemory soa(both.soa.get(), both.count * SOA_SIZE), aos(both.aos.get(), both.count * AOS_SIZE);
  const simd::GroupsView view{soa.data() + simd::SOA_T1, aos.data() + simd::DIRECTIONS};
  const auto groups = allGroupPairs(both.count, both.count, true);
  const Pairs expected = referencePairs(at_end, at_end, groups, true, simd::Diagonal::STRICT_UPPER, true);
  ASSERT_FALSE(expected.empty());
  forEachSimdTarget([&](const std::string& target) {
    Pairs found = kernelPairs(view, view, groups, true, simd::Diagonal::STRICT_UPPER, true, 1000);
    std::sort(found.begin(), found.end());
    EXPECT_EQ(found, expected) << target;
  });
}

TEST(GroupPairs, EveryTargetGivesTheSameOrder) {
  Random random(13);
  const Groups a = randomGroups(random, 6, 60, 50), b = randomGroups(random, 6, 60, 50);
  const auto groups = allGroupPairs(a.count, b.count, false);
  const Pairs expected = kernelPairs(a.view(), b.view(), groups, false, simd::Diagonal::ALL, false, 1000);
  forEachSimdTarget([&](const std::string& target) {
    EXPECT_EQ(kernelPairs(a.view(), b.view(), groups, false, simd::Diagonal::ALL, false, 1000), expected) << target;
  });
}

// One node against one node, everything overlapping but one direction: apart only where strictly beyond, at both times
// and on the same side, with values up to the ends of their range (where a difference would wrap around).
TEST(GroupPairs, StrictAndOneUnitEitherSide) {
  forEachSimdTarget([](const std::string& target) {
    for (std::size_t d = 0; d < 8; ++d) {
      for (const int at : {3, 4, 32767, 65529, 65530}) {
        for (int gap0 = -1; gap0 <= 1; ++gap0) {
          for (int gap1 = -1; gap1 <= 1; ++gap1) {
            Groups a, b;
            Node below, above;
            below.lo.fill(3);
            below.hi.fill(65531);
            above = below;
            below.hi[d] = static_cast<std::uint16_t>(at);
            below.hi[d + 8] = static_cast<std::uint16_t>(at);
            above.lo[d] = static_cast<std::uint16_t>(at + gap0);
            above.lo[d + 8] = static_cast<std::uint16_t>(at + gap1);
            a.nodes.assign(GROUP, emptyNode());
            b.nodes.assign(GROUP, emptyNode());
            a.nodes[5] = below;
            b.nodes[14] = above;
            a.pack();
            b.pack();
            const bool want_both = !(gap0 > 0 && gap1 > 0), want_t0 = !(gap0 > 0);
            const auto count = [&](const Groups& x, const Groups& y, bool t0_only) {
              return kernelPairs(x.view(), y.view(), {0, 0}, false, simd::Diagonal::ALL, t0_only, 256).size();
            };
            ASSERT_EQ(count(a, b, false), want_both ? 1u : 0u) << target << " d " << d << " at " << at << gap0 << gap1;
            ASSERT_EQ(count(b, a, false), want_both ? 1u : 0u) << target << " d " << d << " at " << at << gap0 << gap1;
            ASSERT_EQ(count(a, b, true), want_t0 ? 1u : 0u) << target;
            ASSERT_EQ(count(b, a, true), want_t0 ? 1u : 0u) << target;
          }
        }
      }
    }
  });
}

}  // namespace
}  // namespace test
}  // namespace dccd
