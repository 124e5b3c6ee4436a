#include "simd/group_pairs.h"

#include "simd/targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd/group_pairs.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "simd/group_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Writes the pairs of one node with those lanes of another group that are in a mask, node first or second, in the order
// of lanes.
class PairWriter {
 public:
  // Lanes are numbered from `base`.
  HWY_INLINE PairWriter(bool node_first, uint32_t base);
  // Returns where the next pair goes. There is room for all lanes from o on.
  HWY_INLINE uint32_t* write(uint32_t node, uint32_t mask, uint32_t* HWY_RESTRICT o) const;

 private:
#if DCCD_AVX512
  // A pair is one number of 64 bits, of which the lower half, written first, is the node or the lane.
  using D = hn::FixedTag<uint32_t, GROUP>;
  using Pairs = hn::FixedTag<uint64_t, GROUP / 2>;
  hn::Vec<D> lanes_;
  hn::Vec<Pairs> lane_shift_;
  unsigned node_shift_;
#else
  bool node_first_;
  uint32_t base_;
#endif
};

#if DCCD_AVX512
// From a table: Iota() is written to the stack lane by lane, and read back at once.
HWY_ALIGN static constexpr uint32_t LANES[GROUP] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};

PairWriter::PairWriter(bool node_first, uint32_t base)
    : lanes_(hn::Add(hn::Load(D(), LANES), hn::Set(D(), base))),
      lane_shift_(hn::Set(Pairs(), node_first ? 32 : 0)),
      node_shift_(node_first ? 0 : 32) {}

// Without a branch on the number of lanes, which is unpredictable: two whole vectors are stored, and o moves on by what
// counts.
uint32_t* PairWriter::write(uint32_t node, uint32_t mask, uint32_t* HWY_RESTRICT o) const {
  const uint8_t packed[8] = {static_cast<uint8_t>(mask), static_cast<uint8_t>(mask >> 8)};
  const auto lanes = hn::Compress(lanes_, hn::LoadMaskBits(D(), packed));
  const auto nodes = hn::Set(Pairs(), uint64_t{node} << node_shift_);
  const auto pairsOf = [&](hn::Vec<hn::Half<D>> half)
                           HWY_ATTR { return hn::Or(hn::Shl(hn::PromoteTo(Pairs(), half), lane_shift_), nodes); };
  hn::StoreU(hn::BitCast(D(), pairsOf(hn::LowerHalf(hn::Half<D>(), lanes))), D(), o);
  hn::StoreU(hn::BitCast(D(), pairsOf(hn::UpperHalf(hn::Half<D>(), lanes))), D(), o + GROUP);
  return o + 2 * hwy::PopCount(mask);
}
#else
PairWriter::PairWriter(bool node_first, uint32_t base) : node_first_(node_first), base_(base) {}

uint32_t* PairWriter::write(uint32_t node, uint32_t mask, uint32_t* HWY_RESTRICT o) const {
  for (; mask; mask &= mask - 1) {
    const uint32_t lane = base_ + static_cast<uint32_t>(hwy::Num0BitsBelowLS1Bit_Nonzero32(mask));
    o[node_first_ ? 0 : 1] = node;
    o[node_first_ ? 1 : 0] = lane;
    o += 2;
  }
  return o;
}
#endif

// Which pairs of nodes are not reported, of those whose bounds meet: from() takes a mask of the lanes of the group
// opposite node i and returns those that stay. FIRST: it is asked before the bounds are.
struct LeaveNoneOut {
  static constexpr bool FIRST = true;
  HWY_INLINE uint32_t from(uint32_t, uint32_t mask) const { return mask; }
};

// Features of A and B vertices that share one: their vertices lane by lane.
template <size_t A, size_t B>
struct LeaveAdjacentOut {
  static constexpr bool FIRST = false;
  const uint32_t* HWY_RESTRICT a;
  const uint32_t* HWY_RESTRICT b;
  bool by_rows;  // node i is in the first group
  HWY_INLINE uint32_t from(uint32_t i, uint32_t mask) const {
    return mask & ~(by_rows ? sharing<A, B>(a, i, b) : sharing<B, A>(b, i, a));
  }
};

struct LeaveKnownOut {
  static constexpr bool FIRST = true;
  const uint16_t* HWY_RESTRICT lanes;  // by node
  HWY_INLINE uint32_t from(uint32_t i, uint32_t mask) const { return mask & ~uint32_t{lanes[i]}; }
};

HWY_INLINE const LanePairs& pairsOf(const KnownPairs& known, uint32_t g, uint32_t h) {
  static constexpr LanePairs NONE{};
  const hn::CappedTag<uint32_t, 8> d;
  const uint32_t end = known.begin[g + 1];
  for (uint32_t k = known.begin[g]; k < end; k += static_cast<uint32_t>(hn::Lanes(d))) {
    const uint32_t same = bitsOf(d, hn::Eq(hn::Set(d, h), hn::LoadU(d, known.others + k)));
    if (same == 0) continue;
    const uint32_t found = k + static_cast<uint32_t>(hwy::Num0BitsBelowLS1Bit_Nonzero32(same));
    return found < end ? known.pairs[found] : NONE;
  }
  return NONE;
}

// What is left out of the pairs of groups, one after another: of() of the one that came last to next() but one. The
// first of them comes before that.
struct NoneOf {
  HWY_INLINE void next(uint32_t, uint32_t) {}
  HWY_INLINE LeaveNoneOut of(uint32_t, uint32_t, bool) const { return {}; }
};

template <size_t A, size_t B>
struct AdjacentOf {
  const GroupsView &a, &b;
  HWY_INLINE void next(uint32_t, uint32_t) {}
  HWY_INLINE LeaveAdjacentOut<A, B> of(uint32_t g, uint32_t h, bool by_rows) const {
    return {a.vertices + size_t{g} * A * GROUP, b.vertices + size_t{h} * B * GROUP, by_rows};
  }
};

// Looked up, and fetched from far away, while the pair before is tested.
struct KnownOf {
  const KnownPairs& known;
  const LanePairs *now = nullptr, *soon = nullptr;
  HWY_INLINE void next(uint32_t g, uint32_t h) {
    now = soon;
    soon = &pairsOf(known, g, h);
    hwy::Prefetch(soon);
  }
  HWY_INLINE LeaveKnownOut of(uint32_t, uint32_t, bool by_rows) const { return {by_rows ? now->rows : now->columns}; }
};

// Whether a node meets anything is unpredictable. Where a test costs no more than a mispredicted branch, all nodes are
// tested first, and then what met is written.
constexpr bool WRITES_LATER = DCCD_AVX512;

// The surviving lanes of one pair of groups, less what is left out: to o, which is returned moved on.
template <bool T0_ONLY, class LeaveOutOf>
HWY_INLINE uint32_t* testPair(const GroupsView& a, const GroupsView& b, uint32_t g, uint32_t h, bool same,
                              Diagonal diagonal, const LeaveOutOf& left_out, uint32_t* HWY_RESTRICT o) {
  const int16_t* HWY_RESTRICT sa = a.soa + size_t{g} * SOA_SIZE;
  const int16_t* HWY_RESTRICT sb = b.soa + size_t{h} * SOA_SIZE;
  const int16_t* HWY_RESTRICT bound_a = a.aos + size_t{g} * AOS_SIZE;
  const int16_t* HWY_RESTRICT bound_b = b.aos + size_t{h} * AOS_SIZE;
  uint32_t rows = same ? 0xffffu : meeting<T0_ONLY>(bound_b, bound_b + RECORD, 1, sa);
  if (rows == 0) return o;
  uint32_t cols = same ? 0xffffu : meeting<T0_ONLY>(bound_a, bound_a + RECORD, 1, sb);
  if (cols == 0) return o;
  // Broadcast the nodes of the side with fewer left.
  const bool by_rows = hwy::PopCount(rows) <= hwy::PopCount(cols);
  const int16_t* HWY_RESTRICT outer = by_rows ? sa : sb;
  const GroupLanes<T0_ONLY> lanes(by_rows ? sb : sa);
  const uint32_t inner_mask = by_rows ? cols : rows;
  const PairWriter writer(by_rows, (by_rows ? h : g) * GROUP);
  const uint32_t base = (by_rows ? g : h) * GROUP;
  const auto leave_out = left_out.of(g, h, by_rows);
  constexpr bool LEAVES_OUT_FIRST = decltype(leave_out)::FIRST;
  const auto write = [&](uint32_t i, uint32_t mask)
                         HWY_ATTR { o = writer.write(base + i, LEAVES_OUT_FIRST ? mask : leave_out.from(i, mask), o); };
  uint32_t met[GROUP], to_write = 0;
  for (uint32_t left = by_rows ? rows : cols; left; left &= left - 1) {
    const uint32_t i = static_cast<uint32_t>(hwy::Num0BitsBelowLS1Bit_Nonzero32(left));
    uint32_t mask = inner_mask;
    // A group with itself: rows and columns are both full, so that i is a row, and only the lanes above it are new.
    if (same && diagonal == Diagonal::UPPER_WITH_DIAGONAL) mask &= ~0u << i;
    if (same && diagonal == Diagonal::STRICT_UPPER) mask &= ~0u << (i + 1);
    if (LEAVES_OUT_FIRST) mask = leave_out.from(i, mask);
    if (mask == 0) continue;
    mask &= lanes.meets(outer + soaIndex(0, i), outer + RECORD * GROUP + soaIndex(0, i));
    if (WRITES_LATER) {
      met[i] = mask;
      to_write |= static_cast<uint32_t>(mask != 0) << i;
    } else if (mask) {
      write(i, mask);
    }
  }
  for (; to_write; to_write &= to_write - 1) {
    const uint32_t i = static_cast<uint32_t>(hwy::Num0BitsBelowLS1Bit_Nonzero32(to_write));
    write(i, met[i]);
  }
  return o;
}

template <bool T0_ONLY>
HWY_INLINE void prefetch(const GroupsView& view, uint32_t group) {
  const int16_t* next = view.soa + size_t{group} * SOA_SIZE;
  for (size_t line = 0; line < SOA_SIZE; line += 32) {
    if (!T0_ONLY || line % (RECORD * GROUP) < SOA_T1) hwy::Prefetch(next + line);
  }
}

template <bool T0_ONLY, class LeaveOutOf>
HWY_INLINE size_t testPairs(const GroupsView& a, const GroupsView& b, const uint32_t* HWY_RESTRICT group_pairs,
                            size_t count, bool self, Diagonal diagonal, LeaveOutOf left_out, uint32_t* HWY_RESTRICT out,
                            size_t capacity, size_t* consumed) {
  uint32_t* o = out;
  size_t p = 0;
  if (count > 0) left_out.next(group_pairs[0], group_pairs[1]);
  // There is room for every pair of a pair of groups, so that testPair() need not look.
  for (; p < count && static_cast<size_t>(o - out) + 2 * GROUP * GROUP <= 2 * capacity; ++p) {
    const uint32_t g = group_pairs[2 * p], h = group_pairs[2 * p + 1];
    if (p + 2 < count) {
      prefetch<T0_ONLY>(a, group_pairs[2 * p + 4]);
      prefetch<T0_ONLY>(b, group_pairs[2 * p + 5]);
    }
    const size_t next = p + 1 < count ? p + 1 : p;
    left_out.next(group_pairs[2 * next], group_pairs[2 * next + 1]);
    o = testPair<T0_ONLY>(a, b, g, h, self && g == h, diagonal, left_out, o);
  }
  *consumed = p;
  return static_cast<size_t>(o - out) / 2;
}

size_t TestGroupPairs(const GroupsView& a, const GroupsView& b, const uint32_t* group_pairs, size_t count, bool self,
                      Diagonal diagonal, bool t0_only, uint32_t* out, size_t capacity, size_t* consumed) {
  return t0_only ? testPairs<true>(a, b, group_pairs, count, self, diagonal, NoneOf(), out, capacity, consumed)
                 : testPairs<false>(a, b, group_pairs, count, self, diagonal, NoneOf(), out, capacity, consumed);
}

template <size_t A, size_t B>
HWY_INLINE size_t testUnsharedPairsOf(const GroupsView& a, const GroupsView& b, const uint32_t* group_pairs,
                                      size_t count, bool self, bool t0_only, uint32_t* out, size_t capacity,
                                      size_t* consumed) {
  const AdjacentOf<A, B> adjacent{a, b};
  constexpr auto UPPER = Diagonal::STRICT_UPPER;
  return t0_only ? testPairs<true>(a, b, group_pairs, count, self, UPPER, adjacent, out, capacity, consumed)
                 : testPairs<false>(a, b, group_pairs, count, self, UPPER, adjacent, out, capacity, consumed);
}

size_t TestUnsharedPairs(const GroupsView& a, const GroupsView& b, const uint32_t* group_pairs, size_t count, bool self,
                         bool t0_only, uint32_t* out, size_t capacity, size_t* consumed) {
  if (a.arity == 1) return testUnsharedPairsOf<1, 3>(a, b, group_pairs, count, self, t0_only, out, capacity, consumed);
  if (b.arity == 3) return testUnsharedPairsOf<2, 3>(a, b, group_pairs, count, self, t0_only, out, capacity, consumed);
  return testUnsharedPairsOf<2, 2>(a, b, group_pairs, count, self, t0_only, out, capacity, consumed);
}

size_t TestOtherPairs(const GroupsView& tree, const uint32_t* group_pairs, size_t count, const KnownPairs& left_out,
                      uint32_t* out, size_t capacity, size_t* consumed) {
  return testPairs<true>(tree, tree, group_pairs, count, true, Diagonal::STRICT_UPPER, KnownOf{left_out}, out, capacity,
                         consumed);
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dccd {
namespace simd {
HWY_EXPORT(TestGroupPairs);
HWY_EXPORT(TestUnsharedPairs);
HWY_EXPORT(TestOtherPairs);

std::size_t testGroupPairs(const GroupsView& a, const GroupsView& b, const std::uint32_t* group_pairs,
                           std::size_t count, bool self, Diagonal diagonal, bool t0_only, std::uint32_t* out,
                           std::size_t capacity, std::size_t* consumed) {
  return HWY_DYNAMIC_DISPATCH(TestGroupPairs)(a, b, group_pairs, count, self, diagonal, t0_only, out, capacity,
                                              consumed);
}

std::size_t testUnsharedPairs(const GroupsView& a, const GroupsView& b, const std::uint32_t* group_pairs,
                              std::size_t count, bool self, bool t0_only, std::uint32_t* out, std::size_t capacity,
                              std::size_t* consumed) {
  return HWY_DYNAMIC_DISPATCH(TestUnsharedPairs)(a, b, group_pairs, count, self, t0_only, out, capacity, consumed);
}

std::size_t testOtherPairs(const GroupsView& tree, const std::uint32_t* group_pairs, std::size_t count,
                           const KnownPairs& left_out, std::uint32_t* out, std::size_t capacity,
                           std::size_t* consumed) {
  return HWY_DYNAMIC_DISPATCH(TestOtherPairs)(tree, group_pairs, count, left_out, out, capacity, consumed);
}

}  // namespace simd
}  // namespace dccd
#endif
