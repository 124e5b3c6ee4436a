#include "step/clearance/surface_neighbours.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <numeric>

namespace dccd {
namespace {

constexpr std::uint64_t MOST_REACHED = 4'000'000;  // vertices by all searches around patches

}  // namespace

void SurfaceNeighbours::set(const Topology& topology, const Positions& reference, double self_m,
                            const FeatureTree& tree) {
  tree_ = &tree;
  self_m_ = self_m;
  begin_.assign(topology.vertexCount() + 1, 0);
  for (const Edge& e : topology.edges()) ++begin_[e[0]], ++begin_[e[1]];
  std::uint32_t sum = 0;
  for (std::uint32_t& begin : begin_) sum += std::exchange(begin, sum);
  edges_.resize(sum);
  std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
  for (const Edge& e : topology.edges()) {
    const double length_m = (reference[e[0]] - reference[e[1]]).norm();
    edges_[next[e[0]]++] = {e[1], length_m};
    edges_[next[e[1]]++] = {e[0], length_m};
  }
  reached_.assign(topology.vertexCount(), 0);
  way_m_.resize(topology.vertexCount());
  search_ = 0;
  around_ = NO_INDEX;
  choosePatches();
  row_.clear();
  entries_.clear();
  exact_ ? listNeighbours() : listWholePatches();
  row_.push_back(static_cast<std::uint32_t>(entries_.size()));
  listWholeNodes();
}

/// Dijkstra's search from all of the vertices, as far as self_m.
const std::vector<Index>& SurfaceNeighbours::around(const Index* begin, const Index* end) {
  around_ = NO_INDEX;
  if (++search_ == 0) {
    std::fill(reached_.begin(), reached_.end(), 0);
    search_ = 1;
  }
  found_.clear();
  heap_.clear();
  const auto reach = [&](Index v, double way_m) {
    if (!(way_m < self_m_)) return;
    if (reached_[v] != search_) {
      found_.push_back(v);
    } else if (way_m_[v] <= way_m) {
      return;
    }
    reached_[v] = search_;
    way_m_[v] = way_m;
    heap_.emplace_back(way_m, v);
    std::push_heap(heap_.begin(), heap_.end(), std::greater<>());
  };
  for (; begin != end; ++begin) {
    if (*begin != NO_INDEX) reach(*begin, 0);
  }
  while (!heap_.empty()) {
    std::pop_heap(heap_.begin(), heap_.end(), std::greater<>());
    const auto [way_m, v] = heap_.back();
    heap_.pop_back();
    if (way_m > way_m_[v]) continue;
    for (std::uint32_t e = begin_[v]; e < begin_[v + 1]; ++e) reach(edges_[e].first, way_m + edges_[e].second);
  }
  return found_;
}

/// So large that the searches from one vertex each reach MOST_REACHED vertices together at most, by what a few do.
void SurfaceNeighbours::choosePatches() {
  const std::vector<Feature>& features = tree_->features();
  std::uint64_t reached = 0;
  std::size_t searches = 0;
  for (std::size_t i = 0; i < features.size(); i += 1 + features.size() / 16, ++searches) {
    reached += around(features[i].data(), features[i].data() + 1).size();
  }
  const double all = static_cast<double>(reached) / static_cast<double>(std::max<std::size_t>(searches, 1)) *
                     static_cast<double>(reached_.size());
  std::uint32_t largest = 1;
  while (largest < features.size() && all > static_cast<double>(largest * MOST_REACHED)) largest *= 2;
  exact_ = largest == 1;
  largest = std::max(largest, FeatureTree::LEAF);
  patch_of_.assign(tree_->nodeCount(), NO_INDEX);
  patch_node_.clear();
  for (std::uint32_t n = 0; n < patch_of_.size(); ++n) {  // parents come before their children
    if (patch_of_[n] == NO_INDEX && tree_->count(n) <= largest) {
      patch_of_[n] = static_cast<std::uint32_t>(patch_node_.size());
      patch_node_.push_back(n);
    }
    if (!tree_->isLeaf(n) && patch_of_[n] != NO_INDEX) {
      tree_->forChildren(n, [&](std::uint32_t child) { patch_of_[child] = patch_of_[n]; });
    }
  }
}

void SurfaceNeighbours::listNeighbours() {
  const std::vector<Feature>& features = tree_->features();
  std::vector<std::vector<std::pair<std::uint32_t, std::uint32_t>>> at_vertex(reached_.size());  // patch, place in it
  for (std::uint32_t p = 0; p < patch_node_.size(); ++p) {
    for (std::uint32_t i = 0; i < tree_->count(patch_node_[p]); ++i) {
      for (const Index v : features[tree_->first(patch_node_[p]) + i]) {
        if (v != NO_INDEX) at_vertex[v].emplace_back(p, i);
      }
    }
  }
  std::vector<std::uint32_t> row(reached_.size() + 1, 0);  // of each vertex, those that are near it
  std::vector<Index> near;
  for (Index v = 0; v < reached_.size(); ++v) {
    if (!at_vertex[v].empty()) {
      const std::vector<Index>& found = around(&v, &v + 1);
      near.insert(near.end(), found.begin(), found.end());
    }
    row[v + 1] = static_cast<std::uint32_t>(near.size());
  }
  std::vector<std::uint32_t> mask(patch_node_.size(), 0), touched, seen(reached_.size(), NO_INDEX);
  for (std::uint32_t p = 0; p < patch_node_.size(); ++p) {
    row_.push_back(static_cast<std::uint32_t>(entries_.size()));
    touched.clear();
    for (std::uint32_t i = 0; i < tree_->count(patch_node_[p]); ++i) {
      const std::uint32_t feature = tree_->first(patch_node_[p]) + i;
      for (const Index v : features[feature]) {
        if (v == NO_INDEX) continue;
        for (std::uint32_t k = row[v]; k < row[v + 1]; ++k) {
          if (std::exchange(seen[near[k]], feature) == feature) continue;
          for (const auto& [other, j] : at_vertex[near[k]]) {
            if (other < p) continue;
            if (mask[other] == 0) touched.push_back(other);
            mask[other] |= 1u << (FeatureTree::LEAF * i + j);
          }
        }
      }
    }
    std::sort(touched.begin(), touched.end());
    for (const std::uint32_t other : touched) entries_.push_back({other, std::exchange(mask[other], 0)});
  }
}

/// By a vertex in the middle of a patch: no way between features of two patches is longer than by way of it.
void SurfaceNeighbours::listWholePatches() {
  const std::vector<Feature>& features = tree_->features();
  std::vector<std::uint32_t> patch_of_feature(features.size());
  std::vector<std::vector<std::uint32_t>> patches_at(reached_.size());
  for (std::uint32_t p = 0; p < patch_node_.size(); ++p) {
    for (std::uint32_t i = 0; i < tree_->count(patch_node_[p]); ++i) {
      for (const Index v : features[tree_->first(patch_node_[p]) + i]) {
        if (v != NO_INDEX && (patches_at[v].empty() || patches_at[v].back() != p)) patches_at[v].push_back(p);
      }
    }
  }
  const auto farthest = [&](std::uint32_t p) {
    double farthest_m = 0;
    for (std::uint32_t i = 0; i < tree_->count(patch_node_[p]); ++i) {
      double way_m = std::numeric_limits<double>::infinity();
      for (const Index v : features[tree_->first(patch_node_[p]) + i]) {
        if (v != NO_INDEX && reached_[v] == search_) way_m = std::min(way_m, way_m_[v]);
      }
      farthest_m = std::max(farthest_m, way_m);
    }
    return farthest_m;
  };
  std::vector<std::uint32_t> near;
  for (std::uint32_t p = 0; p < patch_node_.size(); ++p) {
    row_.push_back(static_cast<std::uint32_t>(entries_.size()));
    const Index middle = features[tree_->first(patch_node_[p]) + tree_->count(patch_node_[p]) / 2][0];
    near.clear();
    for (const Index v : around(&middle, &middle + 1)) {
      for (const std::uint32_t other : patches_at[v]) {
        if (other >= p) near.push_back(other);
      }
    }
    std::sort(near.begin(), near.end());
    near.erase(std::unique(near.begin(), near.end()), near.end());
    const double own_m = farthest(p);
    for (const std::uint32_t other : near) {
      if (own_m + farthest(other) < self_m_) entries_.push_back({other, ~0u});
    }
  }
}

/// A level has the nodes of one depth, and the patches that are less deep: together they hold each feature once. A pair
/// of nodes is whole, all features of one are neighbours of all of the other, exactly where each pair of what they are
/// made of on the level below is, for each two of their features are in such a pair: four, three of a node and itself,
/// or fewer where one is a patch and stays what it is. So the pairs of a level are found by counting those below.
void SurfaceNeighbours::listWholeNodes() {
  using Pair = std::pair<std::uint32_t, std::uint32_t>;
  const auto nodes = static_cast<std::uint32_t>(patch_of_.size());
  depth_.assign(nodes, 0);
  std::vector<std::uint32_t> parent(nodes, 0);
  std::uint32_t level = 0;
  for (std::uint32_t n = 0; n < nodes; ++n) {
    if (patch_of_[n] != NO_INDEX) continue;
    tree_->forChildren(n, [&](std::uint32_t child) {
      parent[child] = n;
      depth_[child] = depth_[n] + 1;
      level = std::max(level, depth_[child]);
    });
  }
  std::vector<Pair> whole;
  for (std::uint32_t p = 0; p < patch_node_.size(); ++p) {
    for (std::uint32_t e = row_[p]; e < row_[p + 1]; ++e) {
      const Pair pair{patch_node_[p], patch_node_[entries_[e].patch]};
      if (!exact_ || asked(pair.first, pair.second) == 0) whole.push_back(pair);
    }
  }
  std::vector<Pair> all = whole;
  for (; level > 0 && !whole.empty(); --level) {
    const auto above = [&](std::uint32_t node) { return depth_[node] == level ? parent[node] : node; };
    const auto parts = [&](std::uint32_t node) {
      return depth_[node] + 1 == level && patch_of_[node] == NO_INDEX ? 2 : 1;
    };
    for (auto& [a, b] : whole) a = above(a), b = above(b);
    std::sort(whole.begin(), whole.end());
    std::vector<Pair> next;
    for (auto begin = whole.begin(), end = begin; begin != whole.end(); begin = end) {
      end = std::upper_bound(begin, whole.end(), *begin);
      const auto [a, b] = *begin;
      if (end - begin == (a != b ? parts(a) * parts(b) : parts(a) == 2 ? 3 : 1)) next.push_back(*begin);
    }
    whole = std::move(next);
    all.insert(all.end(), whole.begin(), whole.end());
  }
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  whole_row_.assign(nodes + 1, 0);
  whole_nodes_.clear();
  for (const auto& [a, b] : all) {
    ++whole_row_[a + 1];
    whole_nodes_.push_back(b);
  }
  std::partial_sum(whole_row_.begin(), whole_row_.end(), whole_row_.begin());
}

/// Of two nodes. Where one is a level above the other its two children are asked for.
bool SurfaceNeighbours::isWhole(std::uint32_t a, std::uint32_t b) const {
  if (patch_of_[a] != NO_INDEX) a = patch_node_[patch_of_[a]];
  if (patch_of_[b] != NO_INDEX) b = patch_node_[patch_of_[b]];
  const auto isListed = [&](std::uint32_t first, std::uint32_t second) {
    return std::binary_search(whole_nodes_.begin() + whole_row_[first], whole_nodes_.begin() + whole_row_[first + 1],
                              second);
  };
  const auto isAbove = [&](std::uint32_t x, std::uint32_t y) {
    return patch_of_[x] == NO_INDEX && depth_[x] < depth_[y];
  };
  bool whole = true;
  if (isAbove(a, b)) {
    tree_->forChildren(a, [&](std::uint32_t child) { whole = whole && isListed(child, b); });
  } else if (isAbove(b, a)) {
    tree_->forChildren(b, [&](std::uint32_t child) { whole = whole && isListed(a, child); });
  } else {
    whole = isListed(a, b);
  }
  return whole;
}

std::uint32_t SurfaceNeighbours::asked(std::uint32_t node_a, std::uint32_t node_b) const {
  const std::uint32_t in_a = patch_of_[node_a], in_b = patch_of_[node_b];
  if (in_a == NO_INDEX || in_b == NO_INDEX) return isWhole(node_a, node_b) ? 0 : ~0u;
  const auto begin = entries_.begin() + row_[in_a], end = entries_.begin() + row_[in_a + 1];
  const auto entry =
      std::lower_bound(begin, end, in_b, [](const Entry& e, std::uint32_t patch) { return e.patch < patch; });
  const std::uint32_t neighbours = entry != end && entry->patch == in_b ? entry->mask : 0;
  std::uint32_t pairs = 0;  // that there are; of one leaf each once
  if (!tree_->isLeaf(node_a) || !tree_->isLeaf(node_b)) return ~neighbours;
  for (std::uint32_t i = 0; i < tree_->count(node_a); ++i) {
    for (std::uint32_t j = node_a == node_b ? i + 1 : 0; j < tree_->count(node_b); ++j) {
      pairs |= 1u << (FeatureTree::LEAF * i + j);
    }
  }
  return pairs & ~neighbours;
}

bool SurfaceNeighbours::leavesOut(std::uint32_t a, std::uint32_t b) {
  if (exact_) return false;  // the table has said it
  const std::vector<Feature>& features = tree_->features();
  if (around_ != a) {
    around(features[a].data(), features[a].data() + 3);
    around_ = a;
  }
  return std::any_of(features[b].begin(), features[b].end(),
                     [&](Index v) { return v != NO_INDEX && reached_[v] == search_; });
}

}  // namespace dccd
