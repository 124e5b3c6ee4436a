#include "step/patches/touch_graph.h"

#include <algorithm>
#include <cstring>
#include <tuple>
#include <type_traits>

#include "obstacle/burst.h"

namespace dccd {

bool TouchGraph::sameMesh(std::size_t body, const Body& now) const {
  return topologies_[body] == now.topology || *topologies_[body] == *now.topology;
}

void TouchGraph::setBodies(const std::vector<Body>& bodies) {
  bool same = bodies.size() == topologies_.size();
  for (std::size_t b = 0; same && b < bodies.size(); ++b) same = sameMesh(b, bodies[b]);
  if (same) return;
  topologies_.clear();
  vertex_begin_.assign(1, 0);
  std::vector<Edge> edges;
  for (const Body& body : bodies) {
    const Index first = vertex_begin_.back();
    for (const Edge& edge : body.topology->edges()) edges.push_back({first + edge[0], first + edge[1]});
    vertex_begin_.push_back(first + static_cast<Index>(body.topology->vertexCount()));
    topologies_.push_back(body.topology);
  }
  // Edges are sorted: each vertex's are ascending.
  neighbours_begin_.assign(vertexCount() + 2, 0);
  neighbours_.resize(edges.size());
  for (const Edge& edge : edges) ++neighbours_begin_[edge[1] + 2];
  for (std::size_t v = 1; v < neighbours_begin_.size(); ++v) neighbours_begin_[v] += neighbours_begin_[v - 1];
  for (const Edge& edge : edges) neighbours_[neighbours_begin_[edge[1] + 1]++] = edge[0];
  is_touched_.assign(vertexCount(), false);
  area_.resize(vertexCount());
}

namespace {

constexpr std::ptrdiff_t AHEAD = 32;  // touches that are fetched from memory

std::array<std::uint8_t, 2> sizesOf(const Contact& contact) { return factsOf(contact.kind).vertices; }
std::array<std::uint8_t, 2> sizesOf(const StartIntersection&) { return {2, 3}; }
std::array<std::uint8_t, 2> sizesOf(const TouchGraph::Spot& spot) {
  return {1, static_cast<std::uint8_t>(spot.body[1] == OBSTACLE_BODY ? 0 : 1)};
}

template <class T>
bool isAlike(const T& a, const T& b) {
  return a.body[0] == b.body[0] && a.body[1] == b.body[1] && sizesOf(a) == sizesOf(b);
}

}  // namespace

template <class T>
void TouchGraph::add(const T* first, const T* last) {
  constexpr std::size_t MOST = std::tuple_size_v<decltype(T::vertex)>;
  constexpr bool NUMBERED_ON = std::is_same_v<T, Spot>;
  const auto count = static_cast<std::size_t>(last - first);
  std::size_t used = vertices_used_;
  if (vertices_.size() < used + MOST * count) vertices_.resize(used + MOST * count);
  if (expected_.size() < touch_count_ + count) expected_.resize(touch_count_ + count);
  for (const T* at = first; at != last;) {
    const T& head = *at;
    TouchGroup group{head.body, sizesOf(head), touch_count_, 0, used};
    std::array<Index, MOST> base{};
    for (std::size_t i = 0; !NUMBERED_ON && i < static_cast<std::size_t>(group.size()); ++i) {
      base[i] = vertex_begin_[head.body[i >= group.sizes[0]]];
    }
    do {
      __builtin_prefetch(at + std::min<std::ptrdiff_t>(AHEAD, last - at));
      // All that there may be, which takes no branch; the next touch overwrites what is too many.
      for (std::size_t i = 0; i < MOST; ++i) vertices_[used + i] = base[i] + at->vertex[i];
      used += static_cast<std::size_t>(group.size());
      expected_[touch_count_++] = at->expected;
      ++at;
    } while (at != last && isAlike(head, *at));
    group.last = touch_count_;
    groups_.push_back(group);
  }
  vertices_used_ = used;
}
template void TouchGraph::add(const Contact*, const Contact*);
template void TouchGraph::add(const StartIntersection*, const StartIntersection*);
template void TouchGraph::add(const Spot*, const Spot*);

void TouchGraph::clear() {
  // What a burst made of the buffers in the last run is given back.
  const auto empty = [](auto&... buffers) { ((releaseBurst(buffers), buffers.clear()), ...); };
  empty(groups_, by_partners_, named_, runs_, named_of_, number_);
  const auto shorten = [](auto& buffer, std::size_t used) {
    if (buffer.size() > KEPT_FOR_USE * used) buffer.resize(used);
    releaseBurst(buffer, used);
  };
  shorten(vertices_, vertices_used_);
  shorten(expected_, touch_count_);
  vertices_used_ = touch_count_ = patch_count_ = 0;
}

Index TouchGraph::areaRoot(Index vertex) {
  while (area_[vertex] != vertex) vertex = area_[vertex] = area_[area_[vertex]];
  return vertex;
}

/// The vertices that touch the partner, joined where an edge of the mesh joins them.
void TouchGraph::findAreas(std::size_t first, std::size_t last) {
  for (std::size_t g = first; g < last; ++g) {
    const TouchGroup& group = groups_[by_partners_[g]];
    const Index *vertex = verticesOf(group, group.first), *const end = verticesOf(group, group.last);
    for (; vertex != end; ++vertex) is_touched_[*vertex] = true;
  }
  const auto [low, high] = groups_[by_partners_[first]].partners();
  findAreasOf(low);
  if (high != low && high != OBSTACLE_BODY) findAreasOf(high);
}

void TouchGraph::findAreasOf(std::size_t body) {
  const auto forEachTouched = [this, begin = vertex_begin_[body], end = vertex_begin_[body + 1]](const auto& f) {
    for (Index vertex = begin; vertex < end; ++vertex) {
      if (!is_touched_[vertex]) {  // most are not
        const void* const next = std::memchr(is_touched_.data() + vertex, true, end - vertex);
        if (!next) return;
        vertex = static_cast<Index>(static_cast<const std::uint8_t*>(next) - is_touched_.data());
      }
      f(vertex);
    }
  };
  forEachTouched([&](Index vertex) {
    Index root = area_[vertex] = vertex;
    for (std::uint32_t n = neighbours_begin_[vertex]; n < neighbours_begin_[vertex + 1]; ++n) {
      const Index other = neighbours_[n];
      if (!is_touched_[other]) continue;
      const Index other_root = areaRoot(other);
      area_[std::max(root, other_root)] = std::min(root, other_root);
      root = std::min(root, other_root);
    }
  });
  forEachTouched([&](Index vertex) {
    area_[vertex] = area_[area_[vertex]];  // no vertex is before the first one of its area
    is_touched_[vertex] = false;
  });
}

/// Touches between the same two areas are one component.
void TouchGraph::nameComponents(std::size_t first, std::size_t last) {
  by_areas_.clear();
  struct Recent {
    std::uint64_t areas = ~std::uint64_t{0};
    std::uint32_t component = 0;
  };
  std::array<Recent, 64> recent;
  for (std::size_t g = first; g < last; ++g) {
    const TouchGroup& group = groups_[by_partners_[g]];
    const Index* vertex = verticesOf(group, group.first);
    const int second = group.onMap() ? 0 : group.sizes[0];
    std::uint64_t last_areas = ~std::uint64_t{0};  // none
    named_of_[by_partners_[g]][0] = named_.size();
    for (std::uint32_t t = group.first; t < group.last; ++t, vertex += group.size()) {
      const auto [low, high] = std::minmax(area_[vertex[0]], area_[vertex[second]]);
      const std::uint64_t areas = std::uint64_t{low} << 32 | high;
      if (areas == last_areas) continue;
      last_areas = areas;
      Recent& one = recent[(low + 7 * high) % recent.size()];
      if (one.areas != areas) {
        const auto [at, is_new] = by_areas_.try_emplace(areas, patch_count_);
        patch_count_ += is_new;
        one = {areas, at->second};
      }
      named_.push_back({t, one.component});
    }
    named_of_[by_partners_[g]][1] = named_.size();
  }
}

void TouchGraph::findPatches() {
  if (touch_count_ == 0) return;  // most steps of a stream
  for (std::uint32_t g = 0; g < groups_.size(); ++g) by_partners_.push_back(g);
  std::stable_sort(by_partners_.begin(), by_partners_.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return groups_[a].partners() < groups_[b].partners(); });
  named_of_.resize(groups_.size());
  for (std::size_t first = 0, last = 0; first < groups_.size(); first = last) {
    const auto partners = groups_[by_partners_[first]].partners();
    while (last < groups_.size() && groups_[by_partners_[last]].partners() == partners) ++last;
    findAreas(first, last);
    nameComponents(first, last);
  }
  // In the order of their first touches.
  number_.assign(patch_count_, NO_PATCH);
  std::uint32_t count = 0;
  for (const auto& [begin, end] : named_of_) {
    for (std::size_t r = begin; r < end; ++r) {
      std::uint32_t& number = number_[named_[r].patch];
      if (number == NO_PATCH) number = count++;
      runs_.push_back({named_[r].first, number});
    }
  }
}

}  // namespace dccd
