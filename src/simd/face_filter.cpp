#include "simd/face_filter.h"

#include "dccd/tolerances.h"
#include "simd/cluster_bounds.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd/face_filter.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

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
constexpr double FLOAT_ULPS = 0x1p29;  // so many times as large as a double's half ulp is a float's

/// a0, a1, a2, b1, b2 relative to b0.
HWY_INLINE void gatherPair(const double* HWY_RESTRICT positions, const uint32_t* HWY_RESTRICT a,
                           const uint32_t* HWY_RESTRICT b, size_t lane, float* HWY_RESTRICT block) {
  const uint32_t corners[PAIR_POINTS] = {a[0], a[GROUP], a[2 * GROUP], b[GROUP], b[2 * GROUP]};
  const hn::CappedTag<double, 4> dd;
  const hn::Rebind<float, decltype(dd)> df;
  for (size_t k = 0; k < 4; k += hn::Lanes(dd)) {
    const auto origin = hn::Load(dd, positions + size_t{b[0]} * 8 + k);
    for (size_t i = 0; i < PAIR_POINTS; ++i) {
      const double* x = positions + size_t{corners[i]} * 8 + k;
      hn::StoreU(hn::DemoteTo(df, hn::Sub(hn::Load(dd, x), origin)), df, block + i * PAIR_POINT_SIZE + lane * 4 + k);
    }
  }
}

/// Of which sign numbers certainly are.
struct Signs {
  hn::Mask<DF> plus, minus;
  HWY_INLINE Signs(VF value, VF margin) : plus(hn::Gt(value, margin)), minus(hn::Lt(value, hn::Neg(margin))) {}
};
HWY_INLINE hn::Mask<DF> areSame(const Signs& a, const Signs& b) {
  return hn::Or(hn::And(a.plus, b.plus), hn::And(a.minus, b.minus));
}
HWY_INLINE hn::Mask<DF> differ(const Signs& a, const Signs& b, const Signs& c) {
  return hn::And(hn::Or(hn::Or(a.plus, b.plus), c.plus), hn::Or(hn::Or(a.minus, b.minus), c.minus));
}

HWY_INLINE void pairBlock(const float* HWY_RESTRICT block, const uint32_t* HWY_RESTRICT asked, size_t count,
                          uint8_t* HWY_RESTRICT edges) {
  const DF d;
  const hn::RebindToUnsigned<DF> du;
  Float3 a[3], b[2];
  VF size = hn::Zero(d);
  for (size_t i = 0; i < PAIR_POINTS; ++i) {
    Float3& point = i < 3 ? a[i] : b[i - 3];
    point = loadPoint(d, block + i * PAIR_POINT_SIZE);
    size = hn::Max(size, largest(point));
  }
  const VF cubed = hn::Mul(hn::Mul(size, size), size), underflow = hn::Set(d, tolerance::FUSED_UNDERFLOW);
  const VF line = hn::Set(d, static_cast<float>(tolerance::SEGMENT_LINE * FLOAT_ULPS));
  const VF plane = hn::Set(d, static_cast<float>(tolerance::SEGMENT_PLANE * FLOAT_ULPS));
  const VF short_margin = hn::Add(hn::Mul(line, cubed), underflow);
  const VF long_margin = hn::Add(hn::Mul(plane, cubed), underflow);

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
    const VF between = hn::Sub(hn::Sub(hn::Sub(height[i == 2 ? 0 : i + 1], height[i]), from[i]), to[i]);
    return Signs(between, long_margin);
  };
  const Signs along[3][3] = {{{from[0], short_margin}, passes(0), {to[0], short_margin}},
                             {{from[1], short_margin}, passes(1), {to[1], short_margin}},
                             {{from[2], short_margin}, passes(2), {to[2], short_margin}}};
  const auto sum = [](const VF* x) HWY_ATTR { return hn::Add(hn::Add(x[0], x[1]), x[2]); };
  const Signs over[3] = {{hn::Neg(volume), long_margin},
                         {hn::Sub(sum(from), volume), long_margin},
                         {hn::Sub(hn::Neg(sum(to)), volume), long_margin}};

  auto bits = hn::Zero(du), all = hn::Zero(du);
  const auto keep = [&](hn::Mask<DF> misses, size_t edge) HWY_ATTR {
    const auto bit = hn::Set(du, 1u << edge);
    bits = hn::Or(bits, hn::IfThenZeroElse(hn::RebindMask(du, misses), bit));
    all = hn::Or(all, bit);
  };
  for (size_t k = 0; k < 3; ++k) {
    const size_t next = k == 2 ? 0 : k + 1;
    keep(hn::Or(areSame(above[k], above[next]), differ(along[k][0], along[k][1], along[k][2])), k);
    keep(hn::Or(areSame(over[k], over[next]), differ(along[0][k], along[1][k], along[2][k])), k + SECOND_EDGES_SHIFT);
  }
  // Where all of a face is on one side of the other's plane, no edge meets anything.
  const auto apart = hn::Or(hn::And(areSame(above[0], above[1]), areSame(above[1], above[2])),
                            hn::And(areSame(over[0], over[1]), areSame(over[1], over[2])));
  bits = hn::IfThenZeroElse(hn::RebindMask(du, apart), bits);
  const auto guarded = hn::Le(size, hn::Set(d, tolerance::FUSED_LARGEST_M));
  bits = hn::IfThenElse(hn::RebindMask(du, guarded), bits, all);
  HWY_ALIGN_MAX uint32_t words[PAIR_LANES];
  hn::Store(hn::And(bits, hn::Load(du, asked)), du, words);
  for (size_t lane = 0; lane < count; ++lane) edges[lane] = static_cast<uint8_t>(words[lane]);
}

size_t FacePairFilter(const double* HWY_RESTRICT positions, const FacesView& a, const FacesView& b,
                      const uint32_t* HWY_RESTRICT slots, size_t count, uint8_t* HWY_RESTRICT edges) {
  const size_t lanes = hn::Lanes(DF());
  HWY_ALIGN_MAX float blocks[2][PAIR_POINTS * PAIR_POINT_SIZE] = {};
  HWY_ALIGN_MAX uint32_t asked[2][PAIR_LANES] = {};
  size_t all = 0;
  const auto corners = [](const FacesView& of, size_t slot)
                           HWY_ATTR { return of.vertices + slot / GROUP * 3 * GROUP + slot % GROUP; };
  const auto fill = [&](size_t first, size_t block) HWY_ATTR {
    const size_t n = first >= count ? 0 : HWY_MIN(lanes, count - first);
    for (size_t lane = 0; lane < n; ++lane) {
      const size_t f = slots[2 * (first + lane)], g = slots[2 * (first + lane) + 1];
      gatherPair(positions, corners(a, f), corners(b, g), lane, blocks[block]);
      asked[block][lane] = uint32_t{a.edges[f]} | uint32_t{b.edges[g]} << SECOND_EDGES_SHIFT;
      all += hwy::PopCount(asked[block][lane]);
    }
    return n;
  };
  // The next block is filled before this one is tested, as in segment_filter.cpp.
  size_t now = 0;
  for (size_t first = 0, n = fill(0, 0); n > 0; first += lanes, now = 1 - now) {
    const size_t next = fill(first + lanes, 1 - now);
    pairBlock(blocks[now], asked[now], n, edges + first);
    n = next;
  }
  return all;
}

// --- faces along the axes --------------------------------------------------------------------------------------------

using DD = hn::CappedTag<double, 8>;
using VD = hn::Vec<DD>;
using Double3 = VectorOf<DD>;
constexpr size_t FACE_LANES = 8, FACE_POINT_SIZE = 4 * FACE_LANES;

/// Of all lanes of a vector of faces: their edges 0-1, 0-2 and 1-2.
HWY_INLINE void viewBlock(const double* HWY_RESTRICT block, uint16_t* HWY_RESTRICT views) {
  const DD d;
  const Double3 x = loadPoint(d, block), y = loadPoint(d, block + FACE_POINT_SIZE);
  const Double3 z = loadPoint(d, block + 2 * FACE_POINT_SIZE);
  const VD size = hn::Max(largest(x), largest(y)), zero = hn::Zero(d);
  const auto guarded = hn::Le(size, hn::Set(d, tolerance::SEGMENT_LARGEST_M));
  const VD margin = hn::Add(hn::Mul(hn::Set(d, tolerance::SEGMENT_PROJECTED), hn::Mul(size, size)),
                            hn::Set(d, tolerance::SEGMENT_UNDERFLOW));
  const Double3 normal = cross(x, y);
  const VD n[3] = {normal.x, normal.y, normal.z};
  // What is low along axis k is low in the coordinate after k.
  const VD to_1[3] = {x.y, x.z, x.x}, to_2[3] = {y.y, y.z, y.x}, between[3] = {z.y, z.z, z.x};
  VD bits = zero;
  const auto add = [&](hn::Mask<DD> mask, unsigned bit)
                       HWY_ATTR { bits = hn::Add(bits, hn::IfThenElseZero(mask, hn::Set(d, bit))); };
  for (size_t k = 0; k < 3; ++k) {
    add(hn::And(guarded, hn::Gt(n[k], margin)), TURNS_LEFT << k);
    add(hn::And(guarded, hn::Lt(n[k], hn::Neg(margin))), TURNS_RIGHT << k);
    add(hn::And(hn::Lt(to_1[k], zero), hn::Ge(to_2[k], zero)), RISES << k);
    add(hn::And(hn::Lt(between[k], zero), hn::Le(to_1[k], zero)), RISES << (3 + k));
    add(hn::And(hn::Gt(to_2[k], zero), hn::Le(between[k], zero)), RISES << (6 + k));
  }
  HWY_ALIGN_MAX double words[FACE_LANES];
  hn::Store(bits, d, words);
  for (size_t lane = 0; lane < hn::Lanes(d); ++lane) views[lane] = static_cast<uint16_t>(words[lane]);
}

void FaceViews(const double* HWY_RESTRICT positions, const uint32_t* HWY_RESTRICT groups, size_t count,
               uint16_t* HWY_RESTRICT views) {
  const size_t lanes = hn::Lanes(DD());
  const hn::CappedTag<double, 4> dd;
  // A group is written whole before any of it is read: a load in larger pieces than was written waits for the cache.
  HWY_ALIGN_MAX double blocks[GROUP / FACE_LANES][3 * FACE_POINT_SIZE] = {};
  for (size_t g = 0; g < count; ++g, groups += 3 * GROUP, views += GROUP) {
    // The next group's vertices are fetched while this one's are tested.
    for (size_t i = 3 * GROUP; g + 1 < count && i < 6 * GROUP; ++i) {
      if (groups[i] != UINT32_MAX) hwy::Prefetch(positions + size_t{groups[i]} * 8);
    }
    for (size_t lane = 0; lane < GROUP; ++lane) {
      if (groups[lane] == UINT32_MAX) continue;
      for (size_t k = 0; k < 4; k += hn::Lanes(dd)) {
        const auto a = hn::Load(dd, positions + size_t{groups[lane]} * 8 + k);
        const auto b = hn::Load(dd, positions + size_t{groups[GROUP + lane]} * 8 + k);
        const auto c = hn::Load(dd, positions + size_t{groups[2 * GROUP + lane]} * 8 + k);
        double* to = blocks[lane / FACE_LANES] + lane % FACE_LANES * 4 + k;
        hn::Store(hn::Sub(b, a), dd, to);
        hn::Store(hn::Sub(c, a), dd, to + FACE_POINT_SIZE);
        hn::Store(hn::Sub(c, b), dd, to + 2 * FACE_POINT_SIZE);
      }
    }
    for (size_t lane = 0; lane < GROUP; lane += lanes) {
      viewBlock(blocks[lane / FACE_LANES] + lane % FACE_LANES * 4, views + lane);
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
std::size_t facePairFilter(const double* positions, const FacesView& a, const FacesView& b, const std::uint32_t* slots,
                           std::size_t count, std::uint8_t* edges) {
  return HWY_DYNAMIC_DISPATCH(FacePairFilter)(positions, a, b, slots, count, edges);
}
void faceViews(const double* positions, const std::uint32_t* groups, std::size_t count, std::uint16_t* views) {
  HWY_DYNAMIC_DISPATCH(FaceViews)(positions, groups, count, views);
}
}  // namespace simd
}  // namespace dccd
#endif
