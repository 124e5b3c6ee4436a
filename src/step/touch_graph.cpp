#include "step/touch_graph.h"

#include <algorithm>
#include <limits>

#include "obstacle/burst.h"

namespace dccd {
namespace {

// By kind: points on the first and on the second side; a leaf is one.
constexpr std::uint8_t SIZES[6][2] = {{1, 3}, {2, 2}, {1, 1}, {2, 1}, {3, 1}, {2, 3}};

constexpr std::uint8_t kindOf(PairKind kind) { return static_cast<std::uint8_t>(kind); }
constexpr std::uint8_t FIRST_ON_MAP = kindOf(PairKind::VERTEX_VOXEL_FACE);

std::uint64_t packed(const VoxelKey& min, std::uint8_t level) {
  return std::uint64_t{level} << 48 | std::uint64_t{min.x} << 32 | std::uint64_t{min.y} << 16 | min.z;
}
std::uint32_t levelOf(std::uint64_t leaf) { return static_cast<std::uint32_t>(leaf >> 48); }
std::int64_t axisOf(std::uint64_t leaf, int axis) { return static_cast<std::uint16_t>(leaf >> (32 - 16 * axis)); }

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
  marks_.assign(vertexCount(), Mark());
}

Touch TouchGraph::touchOf(const Contact& contact) const {
  Touch touch;
  touch.kind = kindOf(contact.kind);
  touch.body = contact.body;
  touch.initial = contact.initial;
  touch.expected = contact.expected;
  touch.certain = contact.certainty == Certainty::CERTAIN;
  const int first = SIZES[touch.kind][0], all = touch.onMap() ? first : 4;
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

TouchGraph::Span TouchGraph::side(std::uint32_t t, int side) const {
  const Touch& touch = (*touches_)[t];
  const std::uint8_t* sizes = SIZES[touch.kind];
  const Index* first = touch.point.data() + (side == 0 ? 0 : sizes[0]);
  if (side == 1 && touch.onMap()) first = &leaf_of_[t - map_begin_];
  return {first, first + sizes[side]};
}

TouchGraph::Span TouchGraph::neighbours(Index vertex) const {
  return {neighbours_.data() + neighbours_begin_[vertex], neighbours_.data() + neighbours_begin_[vertex + 1]};
}

std::uint32_t TouchGraph::root(std::uint32_t t) {
  while (parent_[t] != t) t = parent_[t] = parent_[parent_[t]];
  return t;
}

/// The smallest touch of a set is its root, whatever the order in which sets are joined.
void TouchGraph::join(std::uint32_t a, std::uint32_t b) {
  a = root(a);
  b = root(b);
  if (a != b) parent_[std::max(a, b)] = std::min(a, b);
}

void TouchGraph::numberLeaves() {
  const std::vector<Touch>& touches = *touches_;
  const auto is_before = [](std::uint8_t kind) { return [kind](const Touch& t) { return t.kind < kind; }; };
  const auto map_begin = std::partition_point(touches.begin(), touches.end(), is_before(FIRST_ON_MAP));
  const auto map_end = std::partition_point(map_begin, touches.end(), is_before(Touch::CROSSING));
  map_begin_ = static_cast<std::uint32_t>(map_begin - touches.begin());
  map_end_ = static_cast<std::uint32_t>(map_end - touches.begin());
  for (auto touch = map_begin; touch != map_end; ++touch) leaves_.push_back(packed(touch->voxel(), touch->level));
  std::sort(leaves_.begin(), leaves_.end());
  leaves_.erase(std::unique(leaves_.begin(), leaves_.end()), leaves_.end());
  for (auto touch = map_begin; touch != map_end; ++touch) {
    const auto leaf = std::lower_bound(leaves_.begin(), leaves_.end(), packed(touch->voxel(), touch->level));
    leaf_of_.push_back(static_cast<Index>(vertexCount() + static_cast<std::size_t>(leaf - leaves_.begin())));
  }
}

void TouchGraph::listByPoint() {
  const auto count = static_cast<std::uint32_t>(touches_->size());
  begin_.assign(pointCount() + 2, 0);
  std::size_t entries = 0;
  for (std::uint32_t t = 0; t < count; ++t) {
    for (int s = 0; s < 2; ++s) {
      for (const Index point : side(t, s)) ++begin_[point + 2], ++entries;
    }
  }
  for (std::size_t i = 1; i < begin_.size(); ++i) begin_[i] += begin_[i - 1];
  entries_.resize(entries);
  for (std::uint32_t t = 0; t < count; ++t) {
    for (int s = 0; s < 2; ++s) {
      for (const Index point : side(t, s)) entries_[begin_[point + 1]++] = t << 1 | static_cast<std::uint32_t>(s);
    }
  }
}

void TouchGraph::beginPlace() {
  if (tag_ == std::numeric_limits<std::uint32_t>::max()) {
    std::fill(marks_.begin(), marks_.end(), Mark());
    std::fill(seen_.begin(), seen_.end(), Mark());
    tag_ = 0;
  }
  ++tag_;
  marked_.clear();
  sets_.clear();
}

/// The number, at this place, of the set that the touch is in: there are few, and they lie together.
std::uint32_t TouchGraph::setOf(std::uint32_t touch) {
  const std::uint32_t r = root(touch);
  Mark& seen = seen_[r];
  if (seen.tag != tag_) {
    seen = {tag_, static_cast<std::uint32_t>(sets_.size())};
    sets_.push_back({seen.set, r});
  }
  return seen.set;
}

void TouchGraph::joinSets(std::uint32_t a, std::uint32_t b) {
  while (sets_[a].parent != a) a = sets_[a].parent = sets_[sets_[a].parent].parent;
  while (sets_[b].parent != b) b = sets_[b].parent = sets_[sets_[b].parent].parent;
  sets_[std::max(a, b)].parent = std::min(a, b);
}

/// What was joined at this place.
void TouchGraph::endPlace() {
  for (const Set& set : sets_) join(set.root, sets_[set.parent].root);
}

/// Something of the set is at the point.
void TouchGraph::mark(Index point, std::uint32_t set) {
  Mark& mark = marks_[point];
  if (mark.tag != tag_) {
    mark = {tag_, set};
    marked_.push_back(point);
  } else if (mark.set != set) {
    joinSets(mark.set, set);
  }
}

/// Marked points that an edge joins.
void TouchGraph::joinMarked() {
  for (const Index point : marked_) {
    const Span near = neighbours(point);
    const std::uint32_t set = marks_[point].set;
    if (near.size() <= marked_.size()) {
      for (const Index other : near) {
        if (other > point) break;  // that one comes to this
        if (marks_[other].tag == tag_ && marks_[other].set != set) joinSets(set, marks_[other].set);
      }
    } else {  // a vertex in the middle of many
      for (const Index other : marked_) {
        if (marks_[other].set != set && std::binary_search(near.begin(), near.end(), other)) {
          joinSets(set, marks_[other].set);
        }
      }
    }
  }
}

/// Between meshes, of what shares the vertex on one side: what shares a vertex, or an edge, on the other.
void TouchGraph::joinAtVertex(Index vertex) {
  if (begin_[vertex + 1] - begin_[vertex] < 2) return;
  beginPlace();
  at_place_.clear();
  for (std::uint32_t i = begin_[vertex]; i < begin_[vertex + 1]; ++i) {
    if (!(*touches_)[entries_[i] >> 1].onMap()) at_place_.push_back({entries_[i], setOf(entries_[i] >> 1)});
  }
  if (sets_.size() < 2) return;
  for (const auto& [entry, set] : at_place_) {
    for (const Index other : side(entry >> 1, 1 - static_cast<int>(entry & 1))) mark(other, set);
  }
  joinMarked();
  endPlace();
}

/// With the map: what shares a vertex, or an edge, of the mesh. Its leaves come and go, and a cloth that is coarser
/// than they are meets few of those below it.
void TouchGraph::joinOnMap() {
  beginPlace();
  for (std::uint32_t t = map_begin_; t < map_end_; ++t) {
    for (const Index vertex : side(t, 0)) mark(vertex, setOf(t));
  }
  joinMarked();
  endPlace();
}

/// Forgets the last run, and what a burst made of the buffers before it.
void TouchGraph::beginRun() {
  const auto empty = [](auto&... buffers) { ((releaseBurst(buffers), buffers.clear()), ...); };
  empty(leaves_, leaf_of_, entries_, parent_, seen_, sets_, at_place_, marked_, component_);
  component_count_ = 0;
}

const std::vector<std::uint32_t>& TouchGraph::components(const std::vector<Touch>& touches) {
  touches_ = &touches;
  const auto count = static_cast<std::uint32_t>(touches.size());
  beginRun();
  if (touches.empty()) return component_;  // most steps of a stream
  numberLeaves();
  listByPoint();
  parent_.resize(count);
  seen_.assign(count, Mark());
  for (std::uint32_t t = 0; t < count; ++t) parent_[t] = t;
  joinOnMap();
  for (Index vertex = 0; vertex < vertexCount(); ++vertex) joinAtVertex(vertex);
  component_.resize(count);
  for (std::uint32_t t = 0; t < count; ++t) {
    const std::uint32_t r = root(t);  // not after t
    component_[t] = r == t ? component_count_++ : component_[r];
  }
  return component_;
}

Leaf TouchGraph::leaf(std::size_t point) const {
  const std::uint64_t leaf = leaves_[point - vertexCount()];
  const auto axis = [&](int a) { return static_cast<std::uint16_t>(axisOf(leaf, a)); };
  return {{axis(0), axis(1), axis(2)}, std::uint32_t{1} << levelOf(leaf)};
}

}  // namespace dccd
