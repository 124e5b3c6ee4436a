#include "step/patches/touch_graph.h"

#include <algorithm>
#include <tuple>

#include "obstacle/burst.h"

namespace dccd {
namespace {

constexpr std::uint8_t kindOf(PairKind kind) { return static_cast<std::uint8_t>(kind); }

}  // namespace

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
  neighbours_begin_.assign(vertexCount() + 1, 0);
  neighbours_.resize(2 * edges.size());
  for (const Edge& edge : edges) {
    ++neighbours_begin_[edge[0]];
    ++neighbours_begin_[edge[1]];
  }
  std::uint32_t sum = 0;
  for (std::uint32_t& n : neighbours_begin_) n = sum += n;  // ends, moved down to begins below
  // Backwards, so that each vertex's are ascending: edges are sorted, those to smaller ones come before all others.
  for (auto edge = edges.rbegin(); edge != edges.rend(); ++edge) {
    neighbours_[--neighbours_begin_[(*edge)[0]]] = (*edge)[1];
  }
  for (auto edge = edges.rbegin(); edge != edges.rend(); ++edge) {
    neighbours_[--neighbours_begin_[(*edge)[1]]] = (*edge)[0];
  }
  is_touched_.assign(vertexCount(), false);
  area_.resize(vertexCount());
}

Touch TouchGraph::touchOf(const Contact& contact) const {
  Touch touch;
  touch.kind = kindOf(contact.kind);
  touch.body = contact.body;
  touch.initial = contact.initial;
  touch.expected = contact.expected;
  touch.certain = contact.certainty == Certainty::CERTAIN;
  const int first = touch.firstSize(), all = first + touch.secondSize();
  for (int i = 0; i < all; ++i) touch.point[i] = vertex_begin_[contact.body[i < first ? 0 : 1]] + contact.vertex[i];
  if (touch.onMap()) {
    touch.point[3] = std::uint32_t{contact.voxel.x} << 16 | contact.voxel.y;
    touch.point[4] = contact.voxel.z;
    while (std::uint32_t{1} << touch.level < contact.voxel_size) ++touch.level;
  }
  return touch;
}

Touch TouchGraph::touchOf(const StartIntersection& crossing) const {
  Touch touch;
  touch.body = crossing.body;
  touch.initial = true;
  touch.expected = crossing.expected;
  for (int i = 0; i < 5; ++i) touch.point[i] = vertex_begin_[crossing.body[i < 2 ? 0 : 1]] + crossing.vertex[i];
  return touch;
}

void TouchGraph::findGroups(const std::vector<Touch>& touches) {
  groups_.clear();
  for (std::uint32_t t = 0; t < touches.size(); ++t) {
    const Touch& touch = touches[t];
    const auto& body = touch.body;
    if (t == 0 || touch.kind != touches[t - 1].kind || body[0] != touches[t - 1].body[0] ||
        body[1] != touches[t - 1].body[1]) {
      const auto [low, high] = std::minmax(touch.body[0], touch.body[1]);
      groups_.push_back({{low, high}, t, t});
    }
    groups_.back().last = t + 1;
  }
  std::sort(groups_.begin(), groups_.end(), [](const Group& a, const Group& b) {
    return std::tie(a.partners, a.first) < std::tie(b.partners, b.first);
  });
}

Index TouchGraph::areaRoot(Index vertex) {
  while (area_[vertex] != vertex) vertex = area_[vertex] = area_[area_[vertex]];
  return vertex;
}

/// The vertices that touch the partner, joined where an edge of the mesh joins them.
void TouchGraph::findAreas(const std::vector<Touch>& touches, const Group* first, const Group* last) {
  for (const Group* group = first; group != last; ++group) {
    const int size = touches[group->first].size();
    for (std::uint32_t t = group->first; t < group->last; ++t) {
      for (int i = 0; i < size; ++i) is_touched_[touches[t].point[i]] = true;
    }
  }
  const auto [low, high] = first->partners;
  findAreasOf(low);
  if (high != low && high != OBSTACLE_BODY) findAreasOf(high);
}

void TouchGraph::findAreasOf(std::size_t body) {
  const Index begin = vertex_begin_[body], end = vertex_begin_[body + 1];
  for (Index vertex = begin; vertex < end; ++vertex) {
    if (!is_touched_[vertex]) continue;
    Index root = area_[vertex] = vertex;
    for (std::uint32_t n = neighbours_begin_[vertex]; n < neighbours_begin_[vertex + 1]; ++n) {
      const Index other = neighbours_[n];
      if (other > vertex) break;  // that one comes to this
      if (!is_touched_[other]) continue;
      const Index other_root = areaRoot(other);
      area_[std::max(root, other_root)] = std::min(root, other_root);
      root = std::min(root, other_root);
    }
  }
  for (Index vertex = begin; vertex < end; ++vertex) {
    if (!is_touched_[vertex]) continue;
    area_[vertex] = area_[area_[vertex]];  // no vertex is before the first one of its area
    is_touched_[vertex] = false;
  }
}

/// Touches between the same two areas are one component.
void TouchGraph::nameComponents(const std::vector<Touch>& touches, const Group* first, const Group* last) {
  by_areas_.clear();
  std::uint64_t last_areas = 0;
  std::uint32_t component = 0;
  for (const Group* group = first; group != last; ++group) {
    const Touch& any = touches[group->first];
    const int second = any.onMap() ? 0 : any.firstSize();
    for (std::uint32_t t = group->first; t < group->last; ++t) {
      const auto [low, high] = std::minmax(area_[touches[t].point[0]], area_[touches[t].point[second]]);
      const std::uint64_t areas = std::uint64_t{low} << 32 | high;
      if (by_areas_.empty() || areas != last_areas) {
        const auto [at, is_new] = by_areas_.try_emplace(areas, component_count_);
        component_count_ += is_new;
        component = at->second;
        last_areas = areas;
      }
      component_[t] = component;
    }
  }
}

const std::vector<std::uint32_t>& TouchGraph::components(const std::vector<Touch>& touches) {
  // What a burst made of the buffers in the last run is given back.
  const auto empty = [](auto&... buffers) { ((releaseBurst(buffers), buffers.clear()), ...); };
  empty(component_, number_);
  component_count_ = 0;
  if (touches.empty()) return component_;  // most steps of a stream
  component_.resize(touches.size());
  findGroups(touches);
  const Group* const end = groups_.data() + groups_.size();
  for (const Group *first = groups_.data(), *last = first; first != end; first = last) {
    last = std::find_if(first, end, [&](const Group& group) { return group.partners != first->partners; });
    findAreas(touches, first, last);
    nameComponents(touches, first, last);
  }
  // In the order of their first touches.
  number_.assign(component_count_, NO_INDEX);
  std::uint32_t count = 0;
  for (std::uint32_t& component : component_) {
    if (number_[component] == NO_INDEX) number_[component] = count++;
    component = number_[component];
  }
  return component_;
}

}  // namespace dccd
