#include "simd/face_filter.h"

#include <cmath>
#include <limits>

#include "dccd/tolerances.h"
#include "simd/cluster_bounds.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd/face_filter.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "simd/group_lanes-inl.h"
#include "simd/vector_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// --- pairs of faces --------------------------------------------------------------------------------------------------

using DF = hn::CappedTag<float, 16>;
using VF = hn::Vec<DF>;
using Float3 = VectorOf<DF>;
constexpr size_t PAIR_LANES = 16, PAIR_POINTS = 5, PAIR_POINT_SIZE = 4 * PAIR_LANES;
HWY_ALIGN_MAX static constexpr uint32_t PLACES[PAIR_LANES] = {
    0 << PLACE_SHIFT,  1 << PLACE_SHIFT,  2 << PLACE_SHIFT,  3 << PLACE_SHIFT, 4 << PLACE_SHIFT,  5 << PLACE_SHIFT,
    6 << PLACE_SHIFT,  7 << PLACE_SHIFT,  8 << PLACE_SHIFT,  9 << PLACE_SHIFT, 10 << PLACE_SHIFT, 11 << PLACE_SHIFT,
    12 << PLACE_SHIFT, 13 << PLACE_SHIFT, 14 << PLACE_SHIFT, 15 << PLACE_SHIFT};
constexpr double FLOAT_ULPS = 0x1p29;  // so many times as large as a double's half ulp is a float's

/// a0, a1, a2, b1, b2 relative to b0.
HWY_INLINE void gatherPair(const float* HWY_RESTRICT positions, const uint32_t* HWY_RESTRICT a,
                           const uint32_t* HWY_RESTRICT b, size_t place, float* HWY_RESTRICT block) {
  const uint32_t corners[PAIR_POINTS] = {a[0], a[GROUP], a[2 * GROUP], b[GROUP], b[2 * GROUP]};
  const hn::CappedTag<float, 4> d;
  for (size_t k = 0; k < 4; k += hn::Lanes(d)) {
    const auto origin = hn::LoadU(d, positions + size_t{b[0]} * 4 + k);
    for (size_t i = 0; i < PAIR_POINTS; ++i) {
      const auto x = hn::LoadU(d, positions + size_t{corners[i]} * 4 + k);
      hn::Store(hn::Sub(x, origin), d, block + i * PAIR_POINT_SIZE + place * 4 + k);
    }
  }
}

/// Where in a block a lane's four numbers stand, so that loadLanes() need not move them from one 128 bits to others.
HWY_INLINE size_t placeOf(size_t lane) {
  const size_t parts = HWY_MAX(hn::Lanes(DF()), 4) / 4;
  return lane % 4 * parts + lane / 4;
}

/// As loadPoint(), of such a block.
HWY_INLINE Float3 loadLanes(const float* HWY_RESTRICT block) {
  const DF d;
#if HWY_TARGET == HWY_SCALAR
  return loadPoint(d, block);
#else
  const hn::RepartitionToWide<DF> two;  // a pair of lanes moves as one number
  const size_t lanes = hn::Lanes(d);
  const VF first = hn::Load(d, block), second = hn::Load(d, block + lanes);
  const VF third = hn::Load(d, block + 2 * lanes), fourth = hn::Load(d, block + 3 * lanes);
  const auto xy0 = hn::BitCast(two, hn::InterleaveLower(d, first, second));
  const auto xy1 = hn::BitCast(two, hn::InterleaveLower(d, third, fourth));
  const auto z0 = hn::BitCast(two, hn::InterleaveUpper(d, first, second));
  const auto z1 = hn::BitCast(two, hn::InterleaveUpper(d, third, fourth));
  return {hn::BitCast(d, hn::InterleaveLower(two, xy0, xy1)), hn::BitCast(d, hn::InterleaveUpper(two, xy0, xy1)),
          hn::BitCast(d, hn::InterleaveLower(two, z0, z1))};
#endif
}

/// The margin of a sum of products of as many factors as `powers` of M has, and M^2 (M + 2R) or M (M + 2R) it takes.
HWY_INLINE VF marginOf(double multiple, VF powers, VF size, float largest) {
  const DF d;
  const VF reach = hn::Add(size, hn::Set(d, 2 * largest));
  return hn::Add(hn::Mul(hn::Set(d, static_cast<float>(multiple * FLOAT_ULPS)), hn::Mul(powers, reach)),
                 hn::Set(d, tolerance::FUSED_UNDERFLOW));
}

/// Only their sign bits are looked at: set where something is so.
using DU = hn::RebindToUnsigned<DF>;
using Flags = hn::Vec<DU>;

/// Of which sign numbers certainly are. A rounded sum or difference has the sign of the true one, and no sign bit where
/// that is 0, so that these are the comparisons value > margin and value < -margin.
struct Signs {
  Flags plus, minus;
  HWY_INLINE Signs(VF value, VF margin)
      : plus(hn::BitCast(DU(), hn::Sub(margin, value))), minus(hn::BitCast(DU(), hn::Add(margin, value))) {}
};
HWY_INLINE Flags areSame(const Signs& a, const Signs& b) {
  return hn::OrAnd(hn::And(a.plus, b.plus), a.minus, b.minus);
}
HWY_INLINE Flags areSame(const Signs (&x)[3]) {
  return hn::OrAnd(hn::And(hn::And(x[0].plus, x[1].plus), x[2].plus), hn::And(x[0].minus, x[1].minus), x[2].minus);
}
/// Or so already.
HWY_INLINE Flags orDiffer(Flags so, const Signs& a, const Signs& b, const Signs& c) {
  return hn::OrAnd(so, hn::Or3(a.plus, b.plus, c.plus), hn::Or3(a.minus, b.minus, c.minus));
}
/// And so already.
HWY_INLINE Flags andCertain(Flags so, const Signs (&x)[3]) {
  for (const Signs& one : x) so = hn::And(so, hn::Or(one.plus, one.minus));
  return so;
}
/// In all bits what the sign bit is.
HWY_INLINE Flags spread(Flags flags) {
  return hn::BitCast(DU(), hn::BroadcastSignBit(hn::BitCast(hn::RebindToSigned<DF>(), flags)));
}

/// Sets the bits of edge K of A and of edge K of B that miss the other face.
template <int K>
HWY_INLINE void addMisses(const Signs (&above)[3], const Signs (&over)[3], const Signs (&along)[3][3], Flags& misses) {
  constexpr int NEXT = K == 2 ? 0 : K + 1, OF_B = K + static_cast<int>(SECOND_EDGES_SHIFT);
  const Flags of_a = orDiffer(areSame(above[K], above[NEXT]), along[K][0], along[K][1], along[K][2]);
  const Flags of_b = orDiffer(areSame(over[K], over[NEXT]), along[0][K], along[1][K], along[2][K]);
  misses = hn::OrAnd(misses, hn::ShiftRight<31 - K>(of_a), hn::Set(DU(), 1u << K));
  misses = hn::OrAnd(misses, hn::ShiftRight<31 - OF_B>(of_b), hn::Set(DU(), 1u << OF_B));
}

/// Bits of the edges, of those that are asked about.
HWY_INLINE Flags pairBlock(const float* HWY_RESTRICT block, float largest_coordinate,
                           const uint32_t* HWY_RESTRICT asked) {
  const DF d;
  Float3 a[3], b[2];
  VF size = hn::Zero(d);
  for (size_t i = 0; i < PAIR_POINTS; ++i) {
    Float3& point = i < 3 ? a[i] : b[i - 3];
    point = loadLanes(block + i * PAIR_POINT_SIZE);
    size = hn::Max(size, largest(point));
  }
  const VF squared = hn::Mul(size, size);
  const VF short_margin = marginOf(tolerance::SEGMENT_LINE, squared, size, largest_coordinate);
  const VF long_margin = marginOf(tolerance::SEGMENT_PLANE, squared, size, largest_coordinate);

  const Float3 normal_b = cross(b[0], b[1]);
  const VF height[3] = {dot(normal_b, a[0]), dot(normal_b, a[1]), dot(normal_b, a[2])};
  const Signs above[3] = {{height[0], short_margin}, {height[1], short_margin}, {height[2], short_margin}};
  // How the line of each edge of A passes B's edges: from b0 on, and up to b0.
  VF from[3], to[3], volume = hn::Zero(d);
  for (size_t i = 0; i < 3; ++i) {
    const Float3 moment = cross(a[i], a[i == 2 ? 0 : i + 1]);
    from[i] = dot(moment, b[0]);
    to[i] = hn::Neg(dot(moment, b[1]));
    if (i == 1) volume = dot(moment, a[0]);
  }
  const auto passes = [&](size_t i) HWY_ATTR {
    return hn::Sub(hn::Sub(hn::Sub(height[i == 2 ? 0 : i + 1], height[i]), from[i]), to[i]);
  };
  const Signs along[3][3] = {{{from[0], short_margin}, {passes(0), long_margin}, {to[0], short_margin}},
                             {{from[1], short_margin}, {passes(1), long_margin}, {to[1], short_margin}},
                             {{from[2], short_margin}, {passes(2), long_margin}, {to[2], short_margin}}};
  const auto sum = [](const VF* x) HWY_ATTR { return hn::Add(hn::Add(x[0], x[1]), x[2]); };
  const Signs over[3] = {{hn::Neg(volume), long_margin},
                         {hn::Sub(sum(from), volume), long_margin},
                         {hn::Sub(hn::Neg(sum(to)), volume), long_margin}};

  // Where all of a face is on one side of the other's plane, no edge meets anything.
  Flags misses = spread(hn::Or(areSame(above), areSame(over)));
  addMisses<0>(above, over, along, misses);
  addMisses<1>(above, over, along, misses);
  addMisses<2>(above, over, along, misses);
  Flags strict = andCertain(andCertain(hn::Not(hn::Zero(DU())), above), over);
  for (const auto& edge : along) strict = andCertain(strict, edge);
  // Beyond that numbers may be infinite, or none.
  const VF most = hn::Set(d, std::isinf(largest_coordinate) ? -1.0f : tolerance::FUSED_LARGEST_M);
  const auto guarded = hn::RebindMask(DU(), hn::Le(size, most));
  const Flags bits = hn::AndNot(hn::IfThenElseZero(guarded, misses), hn::Load(DU(), asked));
  const Flags meets = hn::IfThenElseZero(guarded, spread(strict));
  return hn::OrAnd(bits, meets, hn::ShiftLeft<MEETS_SHIFT>(bits));
}

FacesLeft FacePairFilter(const NearVertices& vertices, const FacesView& a, const FacesView& b,
                         const uint32_t* HWY_RESTRICT slots, const uint8_t* HWY_RESTRICT asked_of, size_t count,
                         uint32_t* HWY_RESTRICT left) {
  const hn::RebindToUnsigned<DF> du;
  const size_t lanes = hn::Lanes(DF());
  HWY_ALIGN_MAX float blocks[2][PAIR_POINTS * PAIR_POINT_SIZE] = {};
  HWY_ALIGN_MAX uint32_t asked[2][PAIR_LANES] = {};
  FacesLeft result{0, 0};
  const auto corners = [](const FacesView& of, size_t slot)
                           HWY_ATTR { return of.vertices + slot + 2 * (slot & ~(GROUP - 1)); };
  const auto fill = [&](size_t first, size_t block) HWY_ATTR {
    const size_t n = first >= count ? 0 : HWY_MIN(lanes, count - first);
    for (size_t lane = 0; lane < n; ++lane) {
      const size_t f = slots[2 * (first + lane)], g = slots[2 * (first + lane) + 1];
      gatherPair(vertices.positions, corners(a, f), corners(b, g), placeOf(lane), blocks[block]);
      asked[block][lane] = asked_of ? uint32_t{asked_of[first + lane]}
                                    : uint32_t{a.edges[f]} | uint32_t{b.edges[g]} << SECOND_EDGES_SHIFT;
      result.asked += hwy::PopCount(asked[block][lane]);
    }
    for (size_t lane = n; lane < lanes; ++lane) asked[block][lane] = 0;
    return n;
  };
  // The next block is filled before this one is tested, as in segment_filter.cpp.
  size_t now = 0;
  for (size_t first = 0, n = fill(0, 0); n > 0; first += lanes, now = 1 - now) {
    const size_t next = fill(first + lanes, 1 - now);
    // Without a branch on how many are left: a whole vector is stored.
    const auto bits = pairBlock(blocks[now], vertices.largest, asked[now]);
    const auto met = hn::Ne(bits, hn::Zero(du));
    const auto places = hn::Add(hn::Load(du, PLACES), hn::Set(du, static_cast<uint32_t>(first << PLACE_SHIFT)));
    hn::StoreU(hn::Compress(hn::Or(bits, places), met), du, left + result.left);
    result.left += hn::CountTrue(du, met);
    n = next;
  }
  return result;
}

// --- faces along the axes --------------------------------------------------------------------------------------------

constexpr size_t FACE_POINT_SIZE = 4 * GROUP;

/// Of all lanes of a vector of faces.
HWY_INLINE void viewBlock(const float* HWY_RESTRICT block, float largest_coordinate, uint32_t* HWY_RESTRICT views) {
  const DF d;
  const hn::RebindToUnsigned<DF> du;
  const Float3 p0 = loadLanes(block), p1 = loadLanes(block + FACE_POINT_SIZE);
  const Float3 p2 = loadLanes(block + 2 * FACE_POINT_SIZE);
  const Float3 x{hn::Sub(p1.x, p0.x), hn::Sub(p1.y, p0.y), hn::Sub(p1.z, p0.z)};
  const Float3 y{hn::Sub(p2.x, p0.x), hn::Sub(p2.y, p0.y), hn::Sub(p2.z, p0.z)};
  const VF size = hn::Max(largest(x), largest(y));
  const auto guarded = hn::Le(size, hn::Set(d, tolerance::FUSED_LARGEST_M));
  const VF margin = marginOf(tolerance::SEGMENT_PROJECTED, size, size, largest_coordinate);
  const Float3 normal = cross(x, y);
  const VF n[3] = {normal.x, normal.y, normal.z};
  // What is low along axis k is low in the coordinate after k.
  const VF c0[3] = {p0.y, p0.z, p0.x}, c1[3] = {p1.y, p1.z, p1.x}, c2[3] = {p2.y, p2.z, p2.x};
  auto bits = hn::Zero(du);
  const auto add = [&](hn::Mask<DF> mask, unsigned bit) HWY_ATTR {
    bits = hn::Or(bits, hn::IfThenElseZero(hn::RebindMask(du, mask), hn::Set(du, bit)));
  };
  for (size_t k = 0; k < 3; ++k) {
    add(hn::And(guarded, hn::Gt(n[k], margin)), TURNS_LEFT << k);
    add(hn::And(guarded, hn::Lt(n[k], hn::Neg(margin))), TURNS_RIGHT << k);
    add(hn::And(hn::Lt(c1[k], c0[k]), hn::Ge(c2[k], c0[k])), RISES << (8 * k));
    add(hn::And(hn::Lt(c2[k], c1[k]), hn::Ge(c0[k], c1[k])), RISES << (8 * k + 1));
    add(hn::And(hn::Lt(c0[k], c2[k]), hn::Ge(c1[k], c2[k])), RISES << (8 * k + 2));
  }
  hn::StoreU(bits, du, views);
}

void FaceViews(const NearVertices& vertices, const uint32_t* HWY_RESTRICT groups, size_t count,
               uint32_t* HWY_RESTRICT views) {
  const hn::CappedTag<float, 4> d;
  const size_t lanes = hn::Lanes(DF());
  HWY_ALIGN_MAX float blocks[2][3 * FACE_POINT_SIZE] = {};
  const auto fill = [&](size_t g) HWY_ATTR {
    const uint32_t* group = groups + g * 3 * GROUP;
    for (size_t lane = 0; g < count && lane < GROUP; ++lane) {
      if (group[lane] == UINT32_MAX) continue;
      const size_t place = lane / lanes * lanes + placeOf(lane % lanes);
      for (size_t k = 0; k < 4; k += hn::Lanes(d)) {
        for (size_t i = 0; i < 3; ++i) {
          const auto x = hn::LoadU(d, vertices.positions + size_t{group[i * GROUP + lane]} * 4 + k);
          hn::Store(x, d, blocks[g % 2] + i * FACE_POINT_SIZE + place * 4 + k);
        }
      }
    }
  };
  // The next group is filled before this one is looked at, as above.
  fill(0);
  for (size_t g = 0; g < count; ++g) {
    fill(g + 1);
    for (size_t lane = 0; lane < GROUP; lane += lanes) {
      viewBlock(blocks[g % 2] + lane * 4, vertices.largest, views + g * GROUP + lane);
    }
  }
}

void FansOfOneTurn(const uint32_t* HWY_RESTRICT views, const FansView& fans, size_t first, size_t count,
                   uint16_t* HWY_RESTRICT one_turn) {
  const hn::CappedTag<uint32_t, GROUP> d;
  const hn::RebindToSigned<decltype(d)> di;
  constexpr unsigned CORNER = 3, A_BYTE = 0xff;
  for (size_t g = 0; g < count; ++g) {
    const uint32_t begin = fans.begin[first + g], end = fans.begin[first + g + 1];
    one_turn[g] = 0;
    for (size_t lane = 0; lane < GROUP; lane += hn::Lanes(d)) {
      auto turns = hn::Set(d, TURNS), rises = hn::Zero(d);  // a byte of rises for each axis
      for (uint32_t row = begin; row < end; ++row) {
        const auto at = hn::LoadU(d, fans.corners + size_t{row} * GROUP + lane);
        const auto view = hn::GatherOffset(d, views, hn::BitCast(di, hn::AndNot(hn::Set(d, CORNER), at)));
        turns = hn::And(turns, view);
        rises = hn::Add(rises, hn::And(hn::Shr(view, hn::And(at, hn::Set(d, CORNER))), hn::Set(d, RISES * 0x10101)));
      }
      turns = hn::Or(turns, hn::ShiftRight<3>(turns));
      const auto along = [&](unsigned k) HWY_ATTR {
        const auto once = hn::Eq(hn::And(rises, hn::Set(d, RISES * A_BYTE << (8 * k))), hn::Set(d, RISES << (8 * k)));
        return hn::And(once, hn::TestBit(turns, hn::Set(d, TURNS_LEFT << k)));
      };
      const auto is_one = hn::Or(hn::Or(along(0), along(1)), along(2));
      one_turn[g] = static_cast<uint16_t>(one_turn[g] | bitsOf(d, is_one) << lane);
    }
  }
}

void MoveNear(const double* HWY_RESTRICT positions, size_t count, const double* HWY_RESTRICT origin,
              float* HWY_RESTRICT near) {
  const hn::CappedTag<double, 4> dd;
  const hn::Rebind<float, decltype(dd)> df;
  for (size_t i = 0; i < count; ++i) {
    for (size_t k = 0; k < 4; k += hn::Lanes(dd)) {
      const auto x = hn::Sub(hn::LoadU(dd, positions + i * 8 + k), hn::LoadU(dd, origin + k));
      hn::StoreU(hn::DemoteTo(df, x), df, near + i * 4 + k);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dccd {
namespace simd {
HWY_EXPORT(FacePairFilter);
HWY_EXPORT(FaceViews);
HWY_EXPORT(FansOfOneTurn);
HWY_EXPORT(MoveNear);
float largestNear(double largest) {
  constexpr float INFINITE = std::numeric_limits<float>::infinity();
  return largest < tolerance::FUSED_LARGEST_M ? std::nextafter(static_cast<float>(largest), INFINITE) : INFINITE;
}
void moveNear(const double* positions, std::size_t count, const double* origin, float* near) {
  HWY_DYNAMIC_DISPATCH(MoveNear)(positions, count, origin, near);
}
FacesLeft facePairFilter(const NearVertices& vertices, const FacesView& a, const FacesView& b,
                         const std::uint32_t* slots, const std::uint8_t* asked, std::size_t count,
                         std::uint32_t* left) {
  return HWY_DYNAMIC_DISPATCH(FacePairFilter)(vertices, a, b, slots, asked, count, left);
}
void faceViews(const NearVertices& vertices, const std::uint32_t* groups, std::size_t count, std::uint32_t* views) {
  HWY_DYNAMIC_DISPATCH(FaceViews)(vertices, groups, count, views);
}
void fansOfOneTurn(const std::uint32_t* views, const FansView& fans, std::size_t first, std::size_t count,
                   std::uint16_t* one_turn) {
  HWY_DYNAMIC_DISPATCH(FansOfOneTurn)(views, fans, first, count, one_turn);
}
}  // namespace simd
}  // namespace dccd
#endif
