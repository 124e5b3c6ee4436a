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

constexpr std::ptrdiff_t AHEAD = 32;   // touches that are fetched from memory
constexpr std::uint32_t PIECE = 4096;  // of the touches of a group that a thread takes at once

std::array<std::uint8_t, 2> sizesOf(const Contact& contact) { return factsOf(contact.kind).vertices; }
std::array<std::uint8_t, 2> sizesOf(const StartIntersection&) { return {2, 3}; }
std::array<std::uint8_t, 2> sizesOf(const TouchGraph::Spot& spot) {
  return {1, static_cast<std::uint8_t>(spot.body[1] == OBSTACLE_BODY ? 0 : 1)};
}

/// Where those end that are of one kind and of the same bodies as the first one.
const Contact* endOfAlike(const Contact* first, const Contact* last) {
  return std::partition_point(first, last,
                              [&](const Contact& one) { return one.kind == first->kind && one.body == first->body; });
}
template <class T>
const T* endOfAlike(const T* first, const T* last) {
  const std::uint16_t low = first->body[0], high = first->body[1];  // as numbers: arrays are compared by a function
  return std::find_if(first, last, [&](const T& one) { return one.body[0] != low || one.body[1] != high; });
}

/// Where there is one piece alone, which most steps have, nothing is made for threads.
template <class F>
void inPieces(const TouchGraph::Parallel& parallel, std::size_t n, std::size_t piece, const F& f) {
  n <= piece ? f(0, n) : parallel(n, piece, std::cref(f));
}

/// Several threads mark the same vertices, most of them often: only what is not marked yet takes memory from another.
inline void mark(std::uint8_t& is_touched) {
  if (!__atomic_load_n(&is_touched, __ATOMIC_RELAXED)) __atomic_store_n(&is_touched, true, __ATOMIC_RELAXED);
}

}  // namespace

template <class T>
void TouchGraph::add(const T* first, const T* last, const Parallel& parallel) {
  const auto count = static_cast<std::size_t>(last - first);
  constexpr std::size_t MOST = std::tuple_size_v<decltype(T::vertex)>;
  if (vertices_.size() < vertices_used_ + MOST * count) vertices_.resize(vertices_used_ + MOST * count);
  if (expected_.size() < touch_count_ + count) expected_.resize(touch_count_ + count);
  for (const T *at = first, *end; at != last; at = end) {
    end = endOfAlike(at, last);
    const auto alike = static_cast<std::uint32_t>(end - at);
    const TouchGroup& group =
        groups_.emplace_back(TouchGroup{at->body, sizesOf(*at), touch_count_, touch_count_ + alike, vertices_used_});
    inPieces(parallel, alike, PIECE, [&](std::size_t from, std::size_t to) {
      take(group, group.first + static_cast<std::uint32_t>(from), group.first + static_cast<std::uint32_t>(to),
           at + from);
    });
    touch_count_ += alike;
    vertices_used_ += alike * static_cast<std::size_t>(group.size());
  }
}
template void TouchGraph::add(const Contact*, const Contact*, const Parallel&);
template void TouchGraph::add(const StartIntersection*, const StartIntersection*, const Parallel&);
template void TouchGraph::add(const Spot*, const Spot*, const Parallel&);

/// The vertices of a group's touches from first to last.
template <class T>
void TouchGraph::take(const TouchGroup& group, std::uint32_t first, std::uint32_t last, const T* touch) {
  withSize(group.size(), [&](auto size) {
    // Pointers of the loop's own: after each byte that it writes members would be read anew.
    std::uint8_t* const touched = group.partners() == groups_.front().partners() ? is_touched_.data() : nullptr;
    std::uint8_t* expected = expected_.data() + first;
    Index* out = vertices_.data() + group.vertices + (first - group.first) * std::size_t{size};
    std::array<Index, size> base{};
    for (int i = 0; !std::is_same_v<T, Spot> && i < size; ++i) {
      base[i] = vertex_begin_[group.body[i >= group.sizes[0]]];
    }
    for (const T *at = touch, *const end = touch + (last - first); at != end; ++at, out += size) {
      __builtin_prefetch(at + AHEAD);
      for (int i = 0; i < size; ++i) {
        const Index vertex = base[i] + at->vertex[i];
        out[i] = vertex;
        if (touched) mark(touched[vertex]);
      }
      *expected++ = at->expected;
    }
  });
}

void TouchGraph::clear() {
  // What a burst made of the buffers in the last run is given back.
  const auto empty = [](auto&... buffers) { ((releaseBurst(buffers), buffers.clear()), ...); };
  empty(groups_, by_partners_, runs_, runs_of_, number_);
  changes_.resize(std::min<std::size_t>(changes_.size(), touch_count_ / PIECE + 1));
  std::fill(is_touched_.begin(), is_touched_.end(), false);  // by touches that were added in vain, too
  const auto shorten = [](auto& buffer, std::size_t used) {
    if (buffer.size() > KEPT_FOR_USE * used) buffer.resize(used);
    releaseBurst(buffer, used);
  };
  shorten(vertices_, vertices_used_);
  shorten(expected_, touch_count_);
  vertices_used_ = touch_count_ = component_count_ = patch_count_ = 0;
}

Index TouchGraph::areaRoot(Index vertex) {
  while (area_[vertex] != vertex) vertex = area_[vertex] = area_[area_[vertex]];
  return vertex;
}

/// The vertices that touch the partner, joined where an edge of the mesh joins them.
void TouchGraph::findAreas(std::size_t first, std::size_t last) {
  for (std::size_t g = first; first > 0 && g < last; ++g) {
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
      if (!is_touched_[other] || area_[other] == root) continue;
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

void TouchGraph::findChanges(const TouchGroup& group, std::uint32_t first, std::uint32_t last,
                             std::vector<Change>& changes) const {
  changes.clear();
  const Index *vertex = verticesOf(group, first), *const area = area_.data();
  const int size = group.size(), second = group.onMap() ? 0 : group.sizes[0];
  std::array<Index, 2> areas{NO_INDEX, NO_INDEX};
  for (std::uint32_t t = first; t < last; ++t, vertex += size) {
    const Index one = area[vertex[0]], other = area[vertex[second]];
    const Index low = std::min(one, other), high = std::max(one, other);
    if (low == areas[0] && high == areas[1]) continue;
    areas = {low, high};
    changes.push_back({t, areas});
  }
}

/// Touches between the same two areas are one component.
void TouchGraph::nameComponents(std::size_t first, std::size_t last, const Parallel& parallel) {
  by_areas_.clear();
  struct Recent {
    std::uint64_t areas = ~std::uint64_t{0};
    std::uint32_t component = 0;
  };
  std::array<Recent, 64> recent;
  for (std::size_t g = first; g < last; ++g) {
    const TouchGroup& group = groups_[by_partners_[g]];
    const std::size_t pieces = (group.last - group.first + PIECE - 1) / PIECE;
    if (changes_.size() < pieces) changes_.resize(pieces);
    inPieces(parallel, pieces, 1, [&](std::size_t from, std::size_t to) {
      for (std::size_t p = from; p < to; ++p) {
        const std::uint32_t begin = group.first + static_cast<std::uint32_t>(p) * PIECE;
        findChanges(group, begin, std::min(begin + PIECE, group.last), changes_[p]);
      }
    });
    std::uint64_t last_areas = ~std::uint64_t{0};  // none
    runs_of_[by_partners_[g]][0] = runs_.size();
    for (std::size_t p = 0; p < pieces; ++p) {
      for (const Change& change : changes_[p]) {
        const auto [low, high] = change.areas;
        const std::uint64_t areas = std::uint64_t{low} << 32 | high;
        if (areas == last_areas) continue;
        last_areas = areas;
        Recent& one = recent[(low + 7 * high) % recent.size()];
        if (one.areas != areas) {
          const auto [at, is_new] = by_areas_.try_emplace(areas, component_count_);
          component_count_ += is_new;
          one = {areas, at->second};
        }
        runs_.push_back({change.first, one.component});
      }
    }
    runs_of_[by_partners_[g]][1] = runs_.size();
  }
}

void TouchGraph::findPatches(const Parallel& parallel) {
  if (touch_count_ == 0) return;  // most steps of a stream
  for (std::uint32_t g = 0; g < groups_.size(); ++g) by_partners_.push_back(g);
  const auto key = [&, home = groups_.front().partners()](std::uint32_t g) {
    return std::make_pair(groups_[g].partners() != home, groups_[g].partners());
  };
  std::stable_sort(by_partners_.begin(), by_partners_.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
  runs_of_.resize(groups_.size());
  for (std::size_t first = 0, last = 0; first < groups_.size(); first = last) {
    const auto partners = groups_[by_partners_[first]].partners();
    while (last < groups_.size() && groups_[by_partners_[last]].partners() == partners) ++last;
    findAreas(first, last);
    nameComponents(first, last, parallel);
  }
  // In the order of their first touches.
  number_.assign(component_count_, NO_PATCH);
  for (const auto& [begin, end] : runs_of_) {
    for (std::size_t r = begin; r < end; ++r) {
      std::uint32_t& number = number_[runs_[r].component];
      if (number == NO_PATCH) number = patch_count_++;
    }
  }
}

}  // namespace dccd
