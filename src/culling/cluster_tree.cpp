#include "culling/cluster_tree.h"

#include <algorithm>
#include <numeric>
#include <thread>

#include "culling/large_arrays.h"

namespace dccd {
namespace {

using simd::AOS_SIZE;
using simd::GROUP;
using simd::SOA_SIZE;

std::size_t roundUp(std::size_t n) { return (n + GROUP - 1) / GROUP * GROUP; }

// Sorts [first, last) so that every multiple of 16^k is a median cut.
void splitSpatially(const std::vector<Vec3>& centres, Index* first, Index* last) {
  const std::size_t n = static_cast<std::size_t>(last - first);
  if (n <= GROUP) return;
  std::size_t piece = GROUP;
  while (piece * GROUP < n) piece *= GROUP;
  // n > piece, so there are at least two pieces and the cut lies inside.
  const std::size_t pieces = (n + piece - 1) / piece;
  const std::size_t cut = pieces / 2 * piece;
  Vec3 lo = Vec3::Constant(std::numeric_limits<double>::infinity()), hi = -lo;
  for (const Index* i = first; i != last; ++i) {
    lo = lo.cwiseMin(centres[*i]);
    hi = hi.cwiseMax(centres[*i]);
  }
  Eigen::Index axis = 0;
  (hi - lo).maxCoeff(&axis);
  std::nth_element(first, first + cut, last, [&](Index a, Index b) {
    const double x = centres[a][axis], y = centres[b][axis];
    return x != y ? x < y : a < b;  // ties by index: the order must not depend on the library's algorithm
  });
  splitSpatially(centres, first, first + cut);
  splitSpatially(centres, first + cut, last);
}

}  // namespace

std::vector<Index> spatialOrder(const std::vector<Vec3>& centres) {
  // Positions that are not finite have no place; zero serves as well as any.
  std::vector<Vec3> finite = centres;
  for (Vec3& c : finite) {
    if (!c.allFinite()) c.setZero();
  }
  std::vector<Index> order(centres.size());
  std::iota(order.begin(), order.end(), 0);
  splitSpatially(finite, order.data(), order.data() + order.size());
  return order;
}

void AlignedRecords::resize(std::size_t n) {
  if (n <= capacity_) return;
  data_ = makeLarge<std::uint16_t>(n);
  capacity_ = n;
}

void ClusterTree::build(std::vector<Index> features, std::size_t arity) {
  arity_ = arity;
  feature_count_ = features.size() / arity;
  features_ = std::move(features);
  features_.resize(std::max(roundUp(feature_count_), GROUP) * arity, NO_INDEX);
  features_.shrink_to_fit();
  lanes_ = makeLarge<Index>(features_.size());
  for (std::size_t slot = 0; slot < features_.size() / arity; ++slot) {
    for (std::size_t k = 0; k < arity; ++k) {
      lanes_[(slot / GROUP * arity + k) * GROUP + slot % GROUP] = features_[slot * arity + k];
    }
  }
  masked_.clear();
  levels_.clear();
  std::size_t groups = features_.size() / arity / GROUP;
  for (;;) {
    Level level;
    level.groups = groups;
    level.soa.resize(groups * SOA_SIZE);
    level.aos.resize(groups * AOS_SIZE);
    levels_.push_back(std::move(level));
    if (groups == 1) break;
    groups = roundUp(groups) / GROUP;
  }
}

void ClusterTree::raise(std::size_t height) {
  while (levels_.size() < height) {
    Level level;
    level.groups = 1;
    level.soa.resize(SOA_SIZE);
    level.aos.resize(AOS_SIZE);
    levels_.push_back(std::move(level));
  }
}

void ClusterTree::mask(const std::uint8_t* active) {
  if (!active) {
    masked_.clear();
    return;
  }
  masked_ = features_;
  for (std::size_t f = 0; f < feature_count_; ++f) {
    for (std::size_t k = 0; k < arity_; ++k) {
      if (!active[features_[f * arity_ + k]]) masked_[f * arity_] = NO_INDEX;
    }
  }
}

void ClusterTree::refitLeaves(const std::uint16_t* records, const std::uint16_t* margin16, std::size_t first_group,
                              std::size_t last_group) {
  simd::buildLeaves(records, boundedGroup(first_group), arity_, (last_group - first_group) * GROUP, margin16,
                    levels_[0].soa.data() + first_group * SOA_SIZE, levels_[0].aos.data() + first_group * AOS_SIZE);
}

void ClusterTree::letLeavesWait(bool wait, const std::uint16_t* records) {
  leaves_wait_ = wait;
  if (!wait) return;
  records_ = records;
  if (made_.size() != levels_[0].groups) made_ = std::vector<std::atomic<std::uint8_t>>(levels_[0].groups);
}

void ClusterTree::refitGroups(std::size_t first_group, std::size_t last_group) {
  simd::boundGroups(records_, boundedGroup(first_group), arity_, (last_group - first_group) * GROUP,
                    levels_[0].aos.data() + first_group * AOS_SIZE);
  for (std::size_t g = first_group; g < last_group; ++g) made_[g].store(WAITS, std::memory_order_relaxed);
}

void ClusterTree::releaseLeaves(const std::uint16_t* records) {
  letLeavesWait(true, records);
  for (std::atomic<std::uint8_t>& made : made_) made.store(WAITS, std::memory_order_relaxed);
  giveBack(levels_[0].soa.data(), levels_[0].groups * SOA_SIZE * sizeof(std::uint16_t));
}

void ClusterTree::makeLeaves(std::size_t group) const {
  std::atomic<std::uint8_t>& made = made_[group];
  std::uint8_t waits = WAITS;
  if (!made.compare_exchange_strong(waits, IS_BEING_MADE, std::memory_order_acquire)) {
    while (made.load(std::memory_order_acquire) != MADE) std::this_thread::yield();
    return;
  }
  simd::buildLeaves(records_, boundedGroup(group), arity_, GROUP, nullptr, levels_[0].soa.data() + group * SOA_SIZE,
                    levels_[0].aos.data() + group * AOS_SIZE);
  made.store(MADE, std::memory_order_release);
}

void ClusterTree::refitUpper() {
  for (std::size_t l = 1; l < levels_.size(); ++l) {
    simd::buildUpper(levels_[l - 1].aos.data(), levels_[l - 1].groups, levels_[l].soa.data(), levels_[l].aos.data());
  }
}

void ClusterTree::shorten(std::size_t level, std::int32_t end, bool swept, std::size_t first_group,
                          std::size_t last_group) {
  for (std::size_t g = first_group; level == 0 && g < last_group; ++g) needLeaves(g);
  Level& of = levels_[level];
  simd::shortenBounds(of.soa.data() + first_group * simd::SOA_SIZE, of.aos.data() + first_group * simd::AOS_SIZE,
                      last_group - first_group, end, swept);
}

}  // namespace dccd
