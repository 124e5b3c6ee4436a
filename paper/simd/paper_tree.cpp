#include "paper/simd/paper_tree.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "paper/simd/paper_tree.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 8>;
constexpr size_t DOP = 16;
constexpr size_t RECORD = 16;

void RefitLeaves(const float* HWY_RESTRICT records, const uint32_t* HWY_RESTRICT vertices, size_t count,
                 const float* HWY_RESTRICT widen8, float* HWY_RESTRICT dops) {
  const D d;
  for (size_t i = 0; i < count; ++i) {
    const float* a = records + RECORD * vertices[3 * i];
    const float* b = records + RECORD * vertices[3 * i + 1];
    const float* c = records + RECORD * vertices[3 * i + 2];
    for (size_t k = 0; k < 8; k += hn::Lanes(d)) {
      const auto a0 = hn::Load(d, a + k), a1 = hn::Load(d, a + 8 + k);
      const auto b0 = hn::Load(d, b + k), b1 = hn::Load(d, b + 8 + k);
      const auto c0 = hn::Load(d, c + k), c1 = hn::Load(d, c + 8 + k);
      const auto lo = hn::Min(hn::Min(hn::Min(a0, a1), hn::Min(b0, b1)), hn::Min(c0, c1));
      const auto hi = hn::Max(hn::Max(hn::Max(a0, a1), hn::Max(b0, b1)), hn::Max(c0, c1));
      const auto widen = hn::LoadU(d, widen8 + k);
      hn::Store(hn::Sub(lo, widen), d, dops + DOP * i + k);
      hn::Store(hn::Add(hi, widen), d, dops + DOP * i + 8 + k);
    }
  }
}

void MergeNodes(const uint32_t* HWY_RESTRICT children, size_t leaf_count, size_t begin, size_t end, float* dops) {
  const D d;
  for (size_t i = begin; i < end; ++i) {
    const uint32_t* child = children + 2 * (i - leaf_count);
    const float *l = dops + DOP * child[0], *r = dops + DOP * child[1];
    float* out = dops + DOP * i;
    for (size_t k = 0; k < 8; k += hn::Lanes(d)) {
      hn::Store(hn::Min(hn::Load(d, l + k), hn::Load(d, r + k)), d, out + k);
      hn::Store(hn::Max(hn::Load(d, l + 8 + k), hn::Load(d, r + 8 + k)), d, out + 8 + k);
    }
  }
}

HWY_INLINE bool overlap(const float* HWY_RESTRICT a, const float* HWY_RESTRICT b) {
  const D d;
  bool apart = false;
  for (size_t k = 0; k < 8; k += hn::Lanes(d)) {
    const auto below = hn::Lt(hn::Load(d, a + 8 + k), hn::Load(d, b + k));
    const auto above = hn::Gt(hn::Load(d, a + k), hn::Load(d, b + 8 + k));
    apart |= !hn::AllFalse(d, hn::Or(below, above));
  }
  return !apart;
}

size_t Descend(const DopTree& tree, uint32_t* HWY_RESTRICT stack, size_t* stack_size, uint32_t* HWY_RESTRICT out,
               size_t capacity) {
  const size_t leaf_count = tree.leaf_count;
  size_t top = *stack_size, written = 0;
  // Where a pair goes that is known to overlap: leaf pairs to the output, others back on the stack.
  const auto visit = [&](uint32_t a, uint32_t b) HWY_ATTR {
    const bool leaves = a < leaf_count && b < leaf_count;
    uint32_t* to = leaves ? out + 2 * written : stack + 2 * top;
    to[0] = a;
    to[1] = b;
    written += leaves ? 1 : 0;
    top += leaves ? 0 : 1;
  };
  const auto test = [&](uint32_t a, uint32_t b) HWY_ATTR {
    if (overlap(tree.dops + DOP * a, tree.dops + DOP * b)) visit(a, b);
  };
  while (top > 0 && written + 4 <= capacity) {
    --top;
    const uint32_t a = stack[2 * top], b = stack[2 * top + 1];
    const bool leaf_a = a < leaf_count, leaf_b = b < leaf_count;
    if (a == b) {
      if (leaf_a) continue;
      const uint32_t* child = tree.children + 2 * (a - leaf_count);
      const uint32_t l = child[0], r = child[1];
      if (l >= leaf_count) visit(l, l);
      if (r >= leaf_count) visit(r, r);
      test(l, r);
      continue;
    }
    if (leaf_a && leaf_b) {
      visit(a, b);
      continue;
    }
    // Both sides are opened at once where both can be: fewer tests than opening one at a time.
    uint32_t of_a[2] = {a, a}, of_b[2] = {b, b};
    const size_t count_a = leaf_a ? 1 : 2, count_b = leaf_b ? 1 : 2;
    if (!leaf_a) {
      of_a[0] = tree.children[2 * (a - leaf_count)];
      of_a[1] = tree.children[2 * (a - leaf_count) + 1];
    }
    if (!leaf_b) {
      of_b[0] = tree.children[2 * (b - leaf_count)];
      of_b[1] = tree.children[2 * (b - leaf_count) + 1];
    }
    for (size_t i = 0; i < count_a; ++i) {
      for (size_t j = 0; j < count_b; ++j) test(of_a[i], of_b[j]);
    }
  }
  *stack_size = top;
  return written;
}

size_t OverlapRange(const float* dops, size_t i, size_t begin, size_t end, uint32_t* out) {
  size_t written = 0;
  for (size_t j = begin; j < end; ++j) {
    out[written] = static_cast<uint32_t>(j);
    written += overlap(dops + DOP * i, dops + DOP * j) ? 1 : 0;
  }
  return written;
}

bool Overlap(const float* a, const float* b) { return overlap(a, b); }

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dccd {
namespace simd {

HWY_EXPORT(RefitLeaves);
HWY_EXPORT(MergeNodes);
HWY_EXPORT(Descend);
HWY_EXPORT(OverlapRange);
HWY_EXPORT(Overlap);

void dopRefitLeaves(const float* records, const std::uint32_t* vertices, std::size_t count, const float* widen8,
                    float* dops) {
  HWY_DYNAMIC_DISPATCH(RefitLeaves)(records, vertices, count, widen8, dops);
}

void dopMergeNodes(const std::uint32_t* children, std::size_t leaf_count, std::size_t begin, std::size_t end,
                   float* dops) {
  HWY_DYNAMIC_DISPATCH(MergeNodes)(children, leaf_count, begin, end, dops);
}

std::size_t dopDescend(const DopTree& tree, std::uint32_t* stack, std::size_t* stack_size, std::uint32_t* out,
                       std::size_t capacity) {
  return HWY_DYNAMIC_DISPATCH(Descend)(tree, stack, stack_size, out, capacity);
}

std::size_t dopOverlapRange(const float* dops, std::size_t i, std::size_t begin, std::size_t end, std::uint32_t* out) {
  return HWY_DYNAMIC_DISPATCH(OverlapRange)(dops, i, begin, end, out);
}

bool dopOverlap(const float* a, const float* b) { return HWY_DYNAMIC_DISPATCH(Overlap)(a, b); }

}  // namespace simd
}  // namespace dccd
#endif
