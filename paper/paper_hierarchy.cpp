#include "paper/paper_hierarchy.h"

#include <algorithm>
#include <numeric>

#include "paper/simd/paper_tree.h"

namespace dccd {

Index PaperHierarchy::buildOver(Item* items, std::size_t count, unsigned depth) {
  depth_ = std::max(depth_, depth);
  if (count == 1) return items[0].node;
  std::array<float, 3> lo = items[0].centroid, hi = lo;
  for (std::size_t i = 1; i < count; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      lo[k] = std::min(lo[k], items[i].centroid[k]);
      hi[k] = std::max(hi[k], items[i].centroid[k]);
    }
  }
  std::size_t axis = 0;
  for (std::size_t k = 1; k < 3; ++k) {
    if (hi[k] - lo[k] > hi[axis] - lo[axis]) axis = k;
  }
  // Equal centroids are told apart by their number, so that the tree does not depend on the library's nth_element.
  std::nth_element(items, items + count / 2, items + count, [axis](const Item& a, const Item& b) {
    return a.centroid[axis] != b.centroid[axis] ? a.centroid[axis] < b.centroid[axis] : a.node < b.node;
  });
  const Index left = buildOver(items, count / 2, depth + 1);
  const Index right = buildOver(items + count / 2, count - count / 2, depth + 1);
  children_.push_back(left);
  children_.push_back(right);
  return static_cast<Index>(leaf_count_ + children_.size() / 2 - 1);
}

std::vector<Index> PaperHierarchy::build(const std::vector<std::array<float, 3>>& centroids,
                                         const std::vector<Index>& part) {
  leaf_count_ = centroids.size();
  children_.clear();
  part_root_.clear();
  depth_ = 0;
  std::vector<Index> order(leaf_count_);
  std::iota(order.begin(), order.end(), Index{0});
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return part[a] < part[b]; });
  items_.resize(leaf_count_);
  for (std::size_t i = 0; i < leaf_count_; ++i) items_[i] = {centroids[order[i]], order[i]};
  for (std::size_t begin = 0, end = 0; begin < leaf_count_; begin = end) {
    while (end < leaf_count_ && part[order[end]] == part[order[begin]]) ++end;
    part_root_.push_back(buildOver(items_.data() + begin, end - begin, 0));
  }
  // The leaves lie in memory as the tree visits them. Inner nodes keep their numbers, leaves get their places.
  std::vector<Index> place(leaf_count_);
  for (std::size_t i = 0; i < leaf_count_; ++i) {
    order[i] = items_[i].node;
    place[order[i]] = static_cast<Index>(i);
  }
  const auto renumber = [&](Index& node) {
    if (node < leaf_count_) node = place[node];
  };
  std::for_each(children_.begin(), children_.end(), renumber);
  std::for_each(part_root_.begin(), part_root_.end(), renumber);
  lower_end_ = leaf_count_ + children_.size() / 2;
  // Every tree over n leaves has n - 1 inner nodes, upper level included.
  const std::size_t node_count = leaf_count_ == 0 ? 0 : 2 * leaf_count_ - 1;
  dops_.assign(node_count, Dop16{});
  children_.reserve(2 * (node_count - std::min(node_count, leaf_count_)));
  return order;
}

void PaperHierarchy::update() {
  if (leaf_count_ == 0) return;
  float* dops = dops_.data()->lo;
  children_.resize(2 * (lower_end_ - leaf_count_));
  simd::dopMergeNodes(children_.data(), leaf_count_, leaf_count_, lower_end_, dops);
  items_.clear();
  for (Index root : part_root_) {
    const Dop16& d = dops_[root];
    Item item;
    for (std::size_t k = 0; k < 3; ++k) item.centroid[k] = d.lo[PAPER_AXIS_LANE[k]] + d.hi[PAPER_AXIS_LANE[k]];
    item.node = root;
    items_.push_back(item);
  }
  buildOver(items_.data(), items_.size(), 0);
  simd::dopMergeNodes(children_.data(), leaf_count_, lower_end_, leaf_count_ + children_.size() / 2, dops);
}

void PaperHierarchy::begin(const std::uint8_t* part_self) {
  const std::size_t upper_begin = lower_end_ - leaf_count_, upper_end = children_.size() / 2;
  // A descent puts at most 3 more pairs on the stack per level of either tree it goes down.
  stack_.resize(2 * (part_root_.size() + (upper_end - upper_begin) + 6 * (depth_ + 2)));
  stack_size_ = 0;
  const auto push = [this](Index a, Index b) {
    stack_[2 * stack_size_] = a;
    stack_[2 * stack_size_ + 1] = b;
    ++stack_size_;
  };
  for (std::size_t p = 0; p < part_root_.size(); ++p) {
    if (part_self[p] && part_root_[p] >= leaf_count_) push(part_root_[p], part_root_[p]);
  }
  // Any two parts meet at exactly one node of the upper level: the lowest above both.
  for (std::size_t i = upper_begin; i < upper_end; ++i) {
    const Index a = children_[2 * i], b = children_[2 * i + 1];
    if (simd::dopOverlap(dops_[a].lo, dops_[b].lo)) push(a, b);
  }
}

std::size_t PaperHierarchy::next(std::uint32_t* pairs, std::size_t capacity) {
  if (stack_size_ == 0) return 0;
  const simd::DopTree tree{dops_.data()->lo, children_.data(), leaf_count_};
  return simd::dopDescend(tree, stack_.data(), &stack_size_, pairs, capacity);
}

std::size_t PaperHierarchy::overlapping(std::size_t i, std::size_t begin, std::size_t end, std::uint32_t* out) const {
  return simd::dopOverlapRange(dops_.data()->lo, i, begin, end, out);
}

}  // namespace dccd
