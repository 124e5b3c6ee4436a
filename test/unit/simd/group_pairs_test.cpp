// The kernels of the clustered broad phase against plain references written here, on every target that runs.
#include "simd/group_pairs.h"

#include <gtest/gtest.h>
#include <hwy/aligned_allocator.h>
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

namespace dccd {
namespace test {
namespace {

using simd::AOS_SIZE;
using simd::EMPTY_HI;
using simd::EMPTY_LO;
using simd::GROUP;
using simd::RECORD;
using simd::SOA_SIZE;
using Random = std::mt19937_64;

std::int16_t anyRecordValue(Random& random, int range) {
  return static_cast<std::int16_t>(static_cast<int>(random() % static_cast<unsigned>(2 * range + 1)) - range);
}

/// Bounds of one node: lo and hi of the 16 record values.
struct Node {
  std::array<std::int16_t, RECORD> lo, hi;
};

Node emptyNode() {
  Node n;
  n.lo.fill(EMPTY_LO);
  n.hi.fill(EMPTY_HI);
  return n;
}

bool isEmpty(const Node& n) { return n.lo[0] == EMPTY_LO; }

/// The definition: at both times beyond the other in one direction and on one side.
bool apart(const Node& a, const Node& b, bool t0_only) {
  if (isEmpty(a) || isEmpty(b)) return true;
  for (std::size_t k = 0; k < 8; ++k) {
    const std::size_t end = t0_only ? k : k + 8;
    if ((a.lo[k] > b.hi[k] && a.lo[end] > b.hi[end]) || (b.lo[k] > a.hi[k] && b.lo[end] > a.hi[end])) return true;
  }
  return false;
}

struct Groups {
  std::size_t count = 0;
  std::vector<Node> nodes;  // 16 a group
  hwy::AlignedFreeUniquePtr<std::int16_t[]> soa, aos;

  simd::GroupsView view() const { return {soa.get(), aos.get()}; }
  void pack() {
    count = nodes.size() / GROUP;
    soa = hwy::AllocateAligned<std::int16_t>(count * SOA_SIZE);
    aos = hwy::AllocateAligned<std::int16_t>(count * AOS_SIZE);
    for (std::size_t g = 0; g < count; ++g) {
      for (std::size_t k = 0; k < RECORD; ++k) {
        std::int16_t lo = EMPTY_LO, hi = EMPTY_HI;
        for (std::size_t i = 0; i < GROUP; ++i) {
          const Node& n = nodes[g * GROUP + i];
          soa[g * SOA_SIZE + simd::soaIndex(k, i)] = n.lo[k];
          soa[g * SOA_SIZE + RECORD * GROUP + simd::soaIndex(k, i)] = n.hi[k];
          lo = std::min(lo, n.lo[k]);
          hi = std::max(hi, n.hi[k]);
        }
        aos[g * AOS_SIZE + k] = lo;
        aos[g * AOS_SIZE + RECORD + k] = hi;
      }
    }
  }
};

/// range: of the values; small ones make ties. Some lanes, and now and then whole groups, are empty.
Groups randomGroups(Random& random, std::size_t count, int range, int size) {
  Groups groups;
  for (std::size_t g = 0; g < count; ++g) {
    const bool all_empty = random() % 16 == 0;
    for (std::size_t i = 0; i < GROUP; ++i) {
      Node n = emptyNode();
      if (!all_empty && random() % 8 != 0) {
        for (std::size_t k = 0; k < RECORD; ++k) {
          const std::int16_t a = anyRecordValue(random, range);
          const int b = a + static_cast<int>(random() % static_cast<unsigned>(size + 1));
          n.lo[k] = a;
          n.hi[k] = static_cast<std::int16_t>(std::min(b, 32766));
        }
      }
      groups.nodes.push_back(n);
    }
  }
  groups.pack();
  return groups;
}

using Pairs = std::vector<std::array<std::uint32_t, 2>>;

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

Pairs kernelPairs(const simd::GroupsView& a, const simd::GroupsView& b, const std::vector<std::uint32_t>& group_pairs,
                  bool self, simd::Diagonal diagonal, bool t0_only, std::size_t capacity) {
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

std::vector<std::uint32_t> allGroupPairs(std::size_t na, std::size_t nb, bool upper) {
  std::vector<std::uint32_t> pairs;
  for (std::uint32_t g = 0; g < na; ++g) {
    for (std::uint32_t h = upper ? g : 0; h < nb; ++h) pairs.insert(pairs.end(), {g, h});
  }
  return pairs;
}

TEST(GroupPairs, MoreThanOneTargetRuns) {
  std::vector<std::string> names;
  forEachSimdTarget([&](const std::string& name) { names.push_back(name); });
  for (const std::string& name : names) std::cout << "SIMD target: " << name << '\n';
  ASSERT_FALSE(names.empty());
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::unique(names.begin(), names.end()), names.end());
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
  AtTheEndOfMemory(const std::int16_t* values, std::size_t count) {
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
  const std::int16_t* data() const { return reinterpret_cast<const std::int16_t*>(copy_); }

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
      for (const int at : {-32764, -32763, 0, 32762, 32763}) {
        for (int gap0 = -1; gap0 <= 1; ++gap0) {
          for (int gap1 = -1; gap1 <= 1; ++gap1) {
            Groups a, b;
            Node below, above;
            below.lo.fill(-32764);
            below.hi.fill(32764);
            above = below;
            below.hi[d] = static_cast<std::int16_t>(at);
            below.hi[d + 8] = static_cast<std::int16_t>(at);
            above.lo[d] = static_cast<std::int16_t>(at + gap0);
            above.lo[d + 8] = static_cast<std::int16_t>(at + gap1);
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

// Two that pass each other are beyond each other at both times, on different sides: they may meet.
TEST(GroupPairs, PassingEachOtherIsKept) {
  Node a, b;
  a.lo.fill(0);
  a.hi.fill(1);
  b = a;
  for (std::size_t k = 0; k < 8; ++k) {
    b.lo[k] = b.hi[k] = 10;
    b.lo[k + 8] = b.hi[k + 8] = -10;
  }
  Groups x, y;
  x.nodes.assign(GROUP, emptyNode());
  y.nodes = x.nodes;
  x.nodes[0] = a;
  y.nodes[0] = b;
  x.pack();
  y.pack();
  forEachSimdTarget([&](const std::string& target) {
    EXPECT_EQ(kernelPairs(x.view(), y.view(), {0, 0}, false, simd::Diagonal::ALL, false, 256).size(), 1u) << target;
    EXPECT_EQ(kernelPairs(x.view(), y.view(), {0, 0}, false, simd::Diagonal::ALL, true, 256).size(), 0u) << target;
  });
}

// --- groups ----------------------------------------------------------------------------------------------------------

TEST(GroupPairs, LeavesHoldTheBoundsOfTheirVertices) {
  forEachSimdTarget([](const std::string& target) {
    Random random(17);
    for (std::size_t arity = 1; arity <= 3; ++arity) {
      for (const bool with_margin : {false, true}) {
        const std::size_t vertices = 40, groups = 3;
        std::vector<std::int16_t> records(vertices * RECORD);
        for (auto& r : records) r = anyRecordValue(random, 32764);
        std::int16_t margin[RECORD];
        for (auto& m : margin) {
          m = static_cast<std::int16_t>(random() % 3 == 0 ? 32766 + random() % 2 : random() % 1000);
        }
        std::vector<std::uint32_t> indices(groups * GROUP * arity);
        for (std::size_t i = 0; i < indices.size(); ++i) indices[i] = static_cast<std::uint32_t>(random() % vertices);
        for (std::size_t lane = 0; lane < groups * GROUP; lane += 1 + random() % 7) indices[lane * arity] = UINT32_MAX;

        Groups expected;
        for (std::size_t lane = 0; lane < groups * GROUP; ++lane) {
          Node n = emptyNode();
          for (std::size_t k = 0; k < RECORD && indices[lane * arity] != UINT32_MAX; ++k) {
            int lo = 40000, hi = -40000;
            for (std::size_t j = 0; j < arity; ++j) {
              lo = std::min<int>(lo, records[indices[lane * arity + j] * RECORD + k]);
              hi = std::max<int>(hi, records[indices[lane * arity + j] * RECORD + k]);
            }
            if (with_margin) {
              lo = margin[k] == simd::UNBOUNDED ? -32766 : std::max(lo - margin[k], -32766);
              hi = margin[k] == simd::UNBOUNDED ? 32766 : std::min(hi + margin[k], 32766);
            }
            n.lo[k] = static_cast<std::int16_t>(lo);
            n.hi[k] = static_cast<std::int16_t>(hi);
          }
          expected.nodes.push_back(n);
        }
        expected.pack();
        auto soa = hwy::AllocateAligned<std::int16_t>(groups * SOA_SIZE);
        auto aos = hwy::AllocateAligned<std::int16_t>(groups * AOS_SIZE);
        simd::buildLeaves(records.data(), indices.data(), arity, groups * GROUP, with_margin ? margin : nullptr,
                          soa.get(), aos.get());
        EXPECT_TRUE(std::equal(soa.get(), soa.get() + groups * SOA_SIZE, expected.soa.get())) << target << arity;
        EXPECT_TRUE(std::equal(aos.get(), aos.get() + groups * AOS_SIZE, expected.aos.get())) << target << arity;
      }
    }
  });
}

TEST(GroupPairs, UpperGroupsHoldTheBoundsOfTheirChildren) {
  forEachSimdTarget([](const std::string& target) {
    Random random(19);
    for (std::size_t children = 1; children <= 40; ++children) {
      const Groups below = randomGroups(random, children, 32764, 1000);
      Groups expected;
      for (std::size_t c = 0; c < (children + GROUP - 1) / GROUP * GROUP; ++c) {
        Node n = emptyNode();
        if (c < children) {
          std::copy_n(below.aos.get() + c * AOS_SIZE, RECORD, n.lo.begin());
          std::copy_n(below.aos.get() + c * AOS_SIZE + RECORD, RECORD, n.hi.begin());
        }
        expected.nodes.push_back(n);
      }
      expected.pack();
      auto soa = hwy::AllocateAligned<std::int16_t>(expected.count * SOA_SIZE);
      auto aos = hwy::AllocateAligned<std::int16_t>(expected.count * AOS_SIZE);
      simd::buildUpper(below.aos.get(), children, soa.get(), aos.get());
      EXPECT_TRUE(std::equal(soa.get(), soa.get() + expected.count * SOA_SIZE, expected.soa.get()))
          << target << children;
      EXPECT_TRUE(std::equal(aos.get(), aos.get() + expected.count * AOS_SIZE, expected.aos.get()))
          << target << children;
    }
  });
}

// A margin that reaches the ends of the range must not make a feature look empty, or two overlapping ones apart.
TEST(GroupPairs, WidenedNodesStillMeetWhatTheyTouch) {
  forEachSimdTarget([](const std::string& target) {
    std::vector<std::int16_t> records(2 * RECORD, 32764);
    std::fill_n(records.begin(), RECORD, static_cast<std::int16_t>(-32764));
    std::vector<std::uint32_t> indices(GROUP, UINT32_MAX);
    indices[0] = 0;
    indices[1] = 1;
    const auto widened = [&](int m) {
      std::int16_t margin[RECORD];
      std::fill_n(margin, RECORD, static_cast<std::int16_t>(m));
      Groups groups;
      groups.count = 1;
      groups.soa = hwy::AllocateAligned<std::int16_t>(SOA_SIZE);
      groups.aos = hwy::AllocateAligned<std::int16_t>(AOS_SIZE);
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
