#include "step/clearance/surface_neighbours.h"

#include <algorithm>
#include <functional>

namespace dccd {

void SurfaceNeighbours::set(const Topology& topology, const Positions& reference, double self_m) {
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
  asked_ = {NO_INDEX, NO_INDEX, NO_INDEX};
}

/// Dijkstra's search from all of its vertices, as far as self_m.
void SurfaceNeighbours::lookAround(const std::array<Index, 3>& feature) {
  asked_ = feature;
  if (++search_ == 0) {
    std::fill(reached_.begin(), reached_.end(), 0);
    search_ = 1;
  }
  const auto reach = [&](Index v, double way_m) {
    if (!(way_m < self_m_) || (reached_[v] == search_ && way_m_[v] <= way_m)) return;
    reached_[v] = search_;
    way_m_[v] = way_m;
    heap_.emplace_back(way_m, v);
    std::push_heap(heap_.begin(), heap_.end(), std::greater<>());
  };
  heap_.clear();
  for (const Index v : feature) {
    if (v != NO_INDEX) reach(v, 0);
  }
  while (!heap_.empty()) {
    std::pop_heap(heap_.begin(), heap_.end(), std::greater<>());
    const auto [way_m, v] = heap_.back();
    heap_.pop_back();
    if (way_m > way_m_[v]) continue;
    for (std::uint32_t e = begin_[v]; e < begin_[v + 1]; ++e) reach(edges_[e].first, way_m + edges_[e].second);
  }
}

bool SurfaceNeighbours::are(const std::array<Index, 3>& a, const std::array<Index, 3>& b) {
  if (asked_ != a) lookAround(a);
  return std::any_of(b.begin(), b.end(), [&](Index v) { return v != NO_INDEX && reached_[v] == search_; });
}

}  // namespace dccd
