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

// Writes the pairs of a node with lanes of the group opposite it, node first or second, in the order of lanes.
class PairWriter {
 public:
  // Lanes of the group are numbered from `base`.
  HWY_INLINE PairWriter(bool node_first, uint32_t base);
  // Of the lanes in a mask; returns where the next pair goes. There is room for all lanes from o on.
  HWY_INLINE uint32_t* write(uint32_t node, uint32_t mask, uint32_t* HWY_RESTRICT o) const;

 private:
#if DCCD_AVX512
  using D = Lanes32;
  hn::Vec<D> lanes_;        // their numbers
  hn::Mask<D> node_slots_;  // of the numbers of eight pairs, those of nodes
#else
  bool node_first_;
  uint32_t base_;
#endif
};

#if DCCD_AVX512
PairWriter::PairWriter(bool node_first, uint32_t base)
    : lanes_(hn::Add(hn::Load(D(), LANES), hn::Set(D(), base))), node_slots_(maskOf(node_first ? 0x5555 : 0xaaaa)) {}

// Hardly a node meets more than eight lanes. Below that there is no branch on their number, which nothing foretells: a
// whole vector is stored, and o moves on by what counts.
uint32_t* PairWriter::write(uint32_t node, uint32_t mask, uint32_t* HWY_RESTRICT o) const {
  HWY_ALIGN static constexpr uint32_t TWICE[2 * GROUP] = {0, 0, 1, 1, 2,  2,  3,  3,  4,  4,  5,  5,  6,  6,  7,  7,
                                                          8, 8, 9, 9, 10, 10, 11, 11, 12, 12, 13, 13, 14, 14, 15, 15};
  const auto lanes = hn::Compress(lanes_, maskOf(mask)), nodes = hn::Set(D(), node);
  const auto store = [&](size_t at) HWY_ATTR {
    const auto pairs = hn::TableLookupLanes(lanes, hn::IndicesFromVec(D(), hn::Load(D(), TWICE + at)));
    hn::StoreU(hn::IfThenElse(node_slots_, nodes, pairs), D(), o + at);
  };
  const size_t count = hwy::PopCount(mask);
  store(0);
  if (HWY_UNLIKELY(count > GROUP / 2)) store(GROUP);
  return o + 2 * count;
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
// opposite node i and returns those that stay. FIRST: it is asked before the bounds are, and nodesWith() of which nodes
// any stay.
struct LeaveNoneOut {
  static constexpr bool FIRST = true;
  HWY_INLINE uint32_t from(uint32_t, uint32_t mask) const { return mask; }
  HWY_INLINE uint32_t nodesWith(uint32_t) const { return ~0u; }
};

// Features of A and B vertices that share one: their vertices lane by lane.
template <size_t A, size_t B>
class LeaveAdjacentOut {
 public:
  static constexpr bool FIRST = false;
  // by_rows: node i is in the first group.
  HWY_INLINE LeaveAdjacentOut(const uint32_t* HWY_RESTRICT a, const uint32_t* HWY_RESTRICT b, bool by_rows);
  HWY_INLINE uint32_t from(uint32_t i, uint32_t mask) const;

 private:
#if DCCD_AVX512
  using D = Lanes32;
  // Of the k-th pair of a vertex of a and one of b, which are compared.
  const uint32_t* HWY_RESTRICT of_nodes_[A * B];
  hn::Vec<D> of_lanes_[A * B];
#else
  const uint32_t* HWY_RESTRICT a_;
  const uint32_t* HWY_RESTRICT b_;
  bool by_rows_;
#endif
};

#if DCCD_AVX512
template <size_t A, size_t B>
LeaveAdjacentOut<A, B>::LeaveAdjacentOut(const uint32_t* HWY_RESTRICT a, const uint32_t* HWY_RESTRICT b, bool by_rows) {
  const uint32_t *HWY_RESTRICT nodes = by_rows ? a : b, *HWY_RESTRICT opposite = by_rows ? b : a;
  for (size_t k = 0; k < A * B; ++k) {
    // Groups that are alike change places without a difference: a vertex of a node then is loaded once for all lanes'.
    const bool node_first = A == B || by_rows;
    of_nodes_[k] = nodes + (node_first ? k / B : k % B) * GROUP;
    of_lanes_[k] = hn::Load(D(), opposite + (node_first ? k % B : k / B) * GROUP);
  }
}

template <size_t A, size_t B>
uint32_t LeaveAdjacentOut<A, B>::from(uint32_t i, uint32_t mask) const {
  const D d;
  auto same = hn::Eq(hn::Set(d, of_nodes_[0][i]), of_lanes_[0]);
  for (size_t k = 1; k < A * B; ++k) same = hn::Or(same, hn::Eq(hn::Set(d, of_nodes_[k][i]), of_lanes_[k]));
  return mask & ~bitsOf(d, same);
}
#else
template <size_t A, size_t B>
LeaveAdjacentOut<A, B>::LeaveAdjacentOut(const uint32_t* HWY_RESTRICT a, const uint32_t* HWY_RESTRICT b, bool by_rows)
    : a_(a), b_(b), by_rows_(by_rows) {}

template <size_t A, size_t B>
uint32_t LeaveAdjacentOut<A, B>::from(uint32_t i, uint32_t mask) const {
  return mask & ~(by_rows_ ? sharing<A, B>(a_, i, b_) : sharing<B, A>(b_, i, a_));
}
#endif

struct LeaveKnownOut {
  static constexpr bool FIRST = true;
  const uint16_t* HWY_RESTRICT lanes;  // by node
  HWY_INLINE uint32_t from(uint32_t i, uint32_t mask) const { return mask & ~uint32_t{lanes[i]}; }
  // Of which nodes from() leaves any lane of a mask.
  HWY_INLINE uint32_t nodesWith(uint32_t mask) const {
    const hn::CappedTag<uint16_t, GROUP> d;
    const auto all = hn::Set(d, static_cast<uint16_t>(mask));
    uint32_t nodes = 0;
    for (size_t part = 0; part < GROUP; part += hn::Lanes(d)) {
      nodes |= bitsOf(d, hn::Ne(hn::AndNot(hn::Load(d, lanes + part), all), hn::Zero(d))) << part;
    }
    return nodes;
  }
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

// What is left out of the pairs of groups, one after another: of() of the one that came to next() two before the last.
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

// Looked up, and fetched from far away, while the two pairs before are tested.
struct KnownOf {
  const KnownPairs& known;
  const uint32_t* HWY_RESTRICT vertices;  // of faces, which who reads the pairs needs next
  const LanePairs *now = nullptr, *soon = nullptr, *later = nullptr;
  HWY_INLINE void next(uint32_t g, uint32_t h) {
    now = soon;
    soon = later;
    later = &pairsOf(known, g, h);
    hwy::Prefetch(later);
    for (size_t k = 0; k < 3; ++k) hwy::Prefetch(vertices + (size_t{h} * 3 + k) * GROUP);
  }
  HWY_INLINE LeaveKnownOut of(uint32_t, uint32_t, bool by_rows) const { return {by_rows ? now->rows : now->columns}; }
};

// Whether a node meets anything is unpredictable. Where a test costs no more than a mispredicted branch, all nodes are
// tested first, and then what met is written.
constexpr bool WRITES_LATER = DCCD_AVX512;

// A pair of groups, g and h: nodes of one are compared with lanes of the other, by rows those of g with h's.
struct NodesAndLanes {
  const uint16_t *HWY_RESTRICT soa_of_nodes, *HWY_RESTRICT soa_of_lanes;
  uint32_t nodes, lanes;  // masks: which may meet something
  uint32_t g, h;
  bool by_rows;
};

// The surviving pairs of nodes and lanes, less what is left out: to o, which is returned moved on.
template <bool T0_ONLY, class LeaveOutOf>
HWY_INLINE uint32_t* testNodes(const NodesAndLanes& pair, bool same, Diagonal diagonal, const LeaveOutOf& left_out,
                               uint32_t* HWY_RESTRICT o) {
  const GroupLanes<T0_ONLY> group(pair.soa_of_lanes);
  const PairWriter writer(pair.by_rows, (pair.by_rows ? pair.h : pair.g) * GROUP);
  const uint32_t base = (pair.by_rows ? pair.g : pair.h) * GROUP;
  const auto leave_out = left_out.of(pair.g, pair.h, pair.by_rows);
  constexpr bool LEAVES_OUT_FIRST = decltype(leave_out)::FIRST;
  uint32_t met[GROUP], to_write = 0;
  uint32_t nodes = pair.nodes;
  if constexpr (LEAVES_OUT_FIRST) nodes &= leave_out.nodesWith(pair.lanes);
  for (uint32_t left = nodes; left; left &= left - 1) {
    const uint32_t i = static_cast<uint32_t>(hwy::Num0BitsBelowLS1Bit_Nonzero32(left));
    uint32_t mask = pair.lanes;
    // A group with itself: rows and columns are both full, so that i is a row, and only the lanes above it are new.
    if (same && diagonal == Diagonal::UPPER_WITH_DIAGONAL) mask &= ~0u << i;
    if (same && diagonal == Diagonal::STRICT_UPPER) mask &= ~0u << (i + 1);
    if (LEAVES_OUT_FIRST) mask = leave_out.from(i, mask);
    mask &= group.meets(pair.soa_of_nodes + soaIndex(0, i), pair.soa_of_nodes + RECORD * GROUP + soaIndex(0, i));
    if (WRITES_LATER) {
      met[i] = LEAVES_OUT_FIRST ? mask : leave_out.from(i, mask);
      to_write |= static_cast<uint32_t>(met[i] != 0) << i;
    } else if (mask) {
      o = writer.write(base + i, LEAVES_OUT_FIRST ? mask : leave_out.from(i, mask), o);
    }
  }
  for (; to_write; to_write &= to_write - 1) {
    const uint32_t i = static_cast<uint32_t>(hwy::Num0BitsBelowLS1Bit_Nonzero32(to_write));
    o = writer.write(base + i, met[i], o);
  }
  return o;
}

// One pair of groups.
template <bool T0_ONLY, class LeaveOutOf>
HWY_INLINE uint32_t* testPair(const GroupsView& a, const GroupsView& b, uint32_t g, uint32_t h, bool same,
                              Diagonal diagonal, const LeaveOutOf& left_out, uint32_t* HWY_RESTRICT o) {
  const uint16_t* HWY_RESTRICT sa = a.soa + size_t{g} * SOA_SIZE;
  const uint16_t* HWY_RESTRICT sb = b.soa + size_t{h} * SOA_SIZE;
  const uint16_t* HWY_RESTRICT bound_a = a.aos + size_t{g} * AOS_SIZE;
  const uint16_t* HWY_RESTRICT bound_b = b.aos + size_t{h} * AOS_SIZE;
  uint32_t rows = same ? 0xffffu : meeting<T0_ONLY>(bound_b, bound_b + RECORD, 1, sa);
  if (rows == 0) return o;
  uint32_t cols = same ? 0xffffu : meeting<T0_ONLY>(bound_a, bound_a + RECORD, 1, sb);
  if (cols == 0) return o;
  // Broadcast the nodes of the side with fewer left.
  const bool by_rows = hwy::PopCount(rows) <= hwy::PopCount(cols);
  const NodesAndLanes pair = {
      by_rows ? sa : sb, by_rows ? sb : sa, by_rows ? rows : cols, by_rows ? cols : rows, g, h, by_rows};
  return testNodes<T0_ONLY>(pair, same, diagonal, left_out, o);
}

template <bool T0_ONLY>
HWY_INLINE void prefetch(const GroupsView& view, uint32_t group) {
  const uint16_t* next = view.soa + size_t{group} * SOA_SIZE;
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
  const auto fetch = [&](size_t i) HWY_ATTR {
    i = HWY_MIN(i, count - 1);
    left_out.next(group_pairs[2 * i], group_pairs[2 * i + 1]);
  };
  for (size_t i = 0; count > 0 && i < 2; ++i) fetch(i);
  // There is room for every pair of a pair of groups, so that testPair() need not look.
  for (; p < count && static_cast<size_t>(o - out) + 2 * GROUP * GROUP <= 2 * capacity; ++p) {
    const uint32_t g = group_pairs[2 * p], h = group_pairs[2 * p + 1];
    if (p + 2 < count) {
      prefetch<T0_ONLY>(a, group_pairs[2 * p + 4]);
      prefetch<T0_ONLY>(b, group_pairs[2 * p + 5]);
    }
    fetch(p + 2);
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
  return testPairs<true>(tree, tree, group_pairs, count, true, Diagonal::ALL, KnownOf{left_out, tree.vertices}, out,
                         capacity, consumed);
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
