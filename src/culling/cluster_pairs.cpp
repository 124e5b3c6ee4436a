#include "culling/cluster_pairs.h"

#include <algorithm>

#include "dccd/tolerances.h"

namespace dccd {

namespace {

/// superclusterTocBound() of groups of any level.
double tocBound(const TreePair& trees, std::size_t level, std::uint32_t a, std::uint32_t b) {
  const std::uint16_t* x = trees.a->level(level).aos.data() + std::size_t{a} * simd::AOS_SIZE;
  const std::uint16_t* y = trees.b->level(level).aos.data() + std::size_t{b} * simd::AOS_SIZE;
  // Gap of real projections in record units: values are truncated to a unit, and the scaling's rounding is far below
  // another one. The ends of moving intervals are bounded by straight lines between the bounds at t0 and t1.
  const auto firstMeeting = [](int gap0, int gap1) {
    gap0 -= 2;
    gap1 -= 2;
    if (gap0 <= 0) return 0.0;
    if (gap1 > 0) return 1.0;
    return static_cast<double>(gap0) / (gap0 - gap1) * (1 - tolerance::GROUP_TOC_BOUND);
  };
  double latest = 0;
  for (int d = 0; d < 8; ++d) {
    const int HI = simd::RECORD;
    const auto gap = [](std::uint16_t smallest, std::uint16_t largest) { return smallest - simd::turned(largest); };
    latest = std::max(latest, firstMeeting(gap(x[d], y[HI + d]), gap(x[8 + d], y[HI + 8 + d])));
    latest = std::max(latest, firstMeeting(gap(y[d], x[HI + d]), gap(y[8 + d], x[HI + 8 + d])));
  }
  return latest * trees.span.end;
}

// A time that is not 0 is worth so many bounds; the rest of what is left out when time is up may touch at once.
constexpr std::size_t BOUNDS_IN_ANY_CASE = 4096;

/// Of pairs of groups from `first` on.
double tocBoundOfRest(const TreePair& trees, std::size_t level, const std::vector<std::uint32_t>& pairs,
                      std::size_t first, bool late) {
  const std::size_t count = pairs.size() / 2;
  if (late && count > first + BOUNDS_IN_ANY_CASE) return 0;
  double bound = std::numeric_limits<double>::infinity();
  for (; first < count; ++first) {
    bound = std::min(bound, tocBound(trees, level, pairs[2 * first], pairs[2 * first + 1]));
  }
  return bound;
}

}  // namespace

SearchRest superclusterPairs(const TreePair& trees, std::vector<std::uint32_t>& pairs,
                             std::vector<std::uint32_t>& scratch, std::size_t max_pairs, const Deadline& deadline) {
  SearchRest rest;
  pairs.assign({0, 0});
  for (std::size_t l = trees.a->height() - 1; l > 1; --l) {
    scratch.clear();
    std::size_t done = 0;
    const std::size_t count = pairs.size() / 2;
    while (done < count) {
      rest.late = rest.late || (done > 0 && deadline.isOver());
      if ((rest.late && done > 0) || scratch.size() / 2 > max_pairs) {
        rest.toc = std::min(rest.toc, tocBoundOfRest(trees, l, pairs, done, rest.late));
        break;
      }
      constexpr std::size_t STEP = 16 * simd::GROUP * simd::GROUP, PAIRS_PER_LOOK_AT_THE_CLOCK = 512;
      const std::size_t used = scratch.size();
      scratch.resize(used + 2 * STEP);
      std::size_t consumed = 0;
      const std::size_t found = simd::testGroupPairs(
          trees.viewA(l), trees.viewB(l), pairs.data() + 2 * done, std::min(count - done, PAIRS_PER_LOOK_AT_THE_CLOCK),
          trees.self, simd::Diagonal::UPPER_WITH_DIAGONAL, trees.span.times != Times::BOTH, scratch.data() + used, STEP,
          &consumed);
      scratch.resize(used + 2 * found);
      done += consumed;
    }
    std::swap(pairs, scratch);
    if (pairs.size() / 2 <= max_pairs) continue;
    rest.toc = std::min(rest.toc, tocBoundOfRest(trees, l - 1, pairs, max_pairs, rest.late));
    pairs.resize(2 * max_pairs);
  }
  return rest;
}

double superclusterTocBound(const TreePair& trees, std::uint32_t a, std::uint32_t b) {
  return tocBound(trees, 1, a, b);
}

ClusterPairStream::ClusterPairStream() : clusters_(2 * CLUSTER_PAIRS), slots_(2 * CHUNK) {}

}  // namespace dccd
