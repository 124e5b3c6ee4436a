#include "step/clearance/feature_tree.h"

#include <algorithm>
#include <limits>

namespace dccd {

void FeatureTree::build(const SceneBody& body, const Positions& positions) {
  const Topology& topology = *body.setup.topology;
  const auto asked = [&](Index v) { return body.asked.empty() || body.asked[v] != 0; };
  *this = FeatureTree();
  std::vector<Edge> on_faces;
  std::vector<bool> covered(topology.vertexCount());
  for (const Face& f : topology.faces()) {
    if (!asked(f[0]) || !asked(f[1]) || !asked(f[2])) continue;
    features_.push_back(f);
    for (int i = 0; i < 3; ++i) {
      covered[f[i]] = true;
      on_faces.push_back({std::min(f[i], f[(i + 1) % 3]), std::max(f[i], f[(i + 1) % 3])});
    }
  }
  // Edges are on asked faces, all of them, unless some vertex is left out, or there are edges on no face.
  std::sort(on_faces.begin(), on_faces.end());
  for (const Edge& e : topology.edges()) {
    if (!asked(e[0]) || !asked(e[1]) || std::binary_search(on_faces.begin(), on_faces.end(), e)) continue;
    features_.push_back({e[0], e[1], NO_INDEX});
    covered[e[0]] = covered[e[1]] = true;
  }
  for (const Index v : topology.usedVertices()) {
    if (asked(v) && !covered[v]) features_.push_back({v, NO_INDEX, NO_INDEX});
  }
  std::vector<Vec3> centres;
  for (const Feature& f : features_) {
    Vec3 sum = Vec3::Zero();
    int count = 0;
    for (const Index v : f) {
      if (v != NO_INDEX) sum += positions[v], ++count;
    }
    centres.push_back(sum.allFinite() ? Vec3(sum / count) : Vec3::Zero());
  }
  std::vector<std::uint32_t> order(features_.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  if (!order.empty()) addNode(order, centres, 0, static_cast<std::uint32_t>(order.size()));
  std::vector<Feature> sorted;
  for (const std::uint32_t i : order) sorted.push_back(features_[i]);
  features_ = std::move(sorted);
  std::vector<Index> slot_of(topology.vertexCount(), NO_INDEX);
  for (Index slot = 0; slot < body.usedCount(); ++slot) slot_of[body.slot_vertex[slot]] = slot;
  slots_ = features_;
  for (Feature& feature : slots_) {
    for (Index& v : feature) v = v == NO_INDEX ? NO_INDEX : slot_of[v];
  }
  for (Node& node : nodes_) {
    node.vertices = static_cast<std::uint32_t>(leaf_slots_.size());
    if (node.right != 0) continue;
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      for (const Index slot : slots_[i]) {
        const auto begin = leaf_slots_.begin() + node.vertices;
        if (slot != NO_INDEX && std::find(begin, leaf_slots_.end(), slot) == leaf_slots_.end())
          leaf_slots_.push_back(slot);
      }
    }
    node.vertices_end = static_cast<std::uint32_t>(leaf_slots_.size());
  }
  nodes_.shrink_to_fit();
  leaf_slots_.shrink_to_fit();
  boxes_.resize(nodes_.size());
  built_ = true;
}

/// Halves at the median of the longest side.
std::uint32_t FeatureTree::addNode(std::vector<std::uint32_t>& order, const std::vector<Vec3>& centres,
                                   std::uint32_t first, std::uint32_t last) {
  const auto node = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  nodes_[node].first = first;
  nodes_[node].count = last - first;
  if (last - first <= LEAF) return node;
  Eigen::AlignedBox3d box;
  for (std::uint32_t i = first; i < last; ++i) box.extend(centres[order[i]]);
  Eigen::Index axis;
  (box.max() - box.min()).maxCoeff(&axis);
  const std::uint32_t middle = first + ((last - first) / 2 + LEAF - 1) / LEAF * LEAF;
  std::nth_element(order.begin() + first, order.begin() + middle, order.begin() + last,
                   [&](std::uint32_t x, std::uint32_t y) {
                     const double p = centres[x][axis], q = centres[y][axis];
                     return p != q ? p < q : x < y;
                   });
  addNode(order, centres, first, middle);
  const std::uint32_t right = addNode(order, centres, middle, last);
  nodes_[node].right = right;
  return node;
}

StepBox FeatureTree::itemBox(std::uint32_t feature) const {
  StepBox box = StepBox::none();
  for (const Index slot : slots_[feature]) {
    if (slot != NO_INDEX) box.add(vertices_[slot]);
  }
  return box;
}

Reach FeatureTree::leafReach(std::uint32_t leaf, const Turning& along) const {
  Reach reach = Reach::none();
  for (std::size_t i = nodes_[leaf].vertices; i < nodes_[leaf].vertices_end; ++i)
    reach.add(vertices_[leaf_slots_[i]], along);
  return reach;
}

Reach FeatureTree::itemReach(std::uint32_t feature, const Turning& along) const {
  Reach reach = Reach::none();
  for (const Index slot : slots_[feature]) {
    if (slot != NO_INDEX) reach.add(vertices_[slot], along);
  }
  return reach;
}

MovingHull FeatureTree::itemHull(std::uint32_t feature) const {
  MovingHull hull;
  for (const Index slot : slots_[feature]) {
    if (slot == NO_INDEX) break;
    const VertexMotion& v = vertices_[slot];
    hull.addCorner(Vec3(v.t0[0], v.t0[1], v.t0[2]), Vec3(v.t1[0], v.t1[1], v.t1[2]));
  }
  return hull;
}

Turning FeatureTree::itemNormal(std::uint32_t feature) const {
  Turning normal{Vec3::Zero(), Vec3::Zero()};
  const Feature& slots = slots_[feature];
  if (slots[2] == NO_INDEX) return normal;
  for (int end = 0; end < 2; ++end) {
    const auto at = [&](int k) {
      return Eigen::Map<const Vec3>(end == 0 ? vertices_[slots[k]].t0 : vertices_[slots[k]].t1);
    };
    const Vec3 across = (at(1) - at(0)).cross(at(2) - at(0));
    const double length = across.norm();
    if (length > tolerance::CLEARANCE_DIRECTION_M) normal[end] = across / length;
  }
  return normal;
}

void FeatureTree::refit(const VertexMotion* vertices) {
  vertices_ = vertices;
  for (std::size_t n = nodes_.size(); n-- > 0;) {  // children come after their parents
    const Node& node = nodes_[n];
    if (node.right == 0) {
      StepBox box = StepBox::none();
      for (std::size_t i = node.vertices; i < node.vertices_end; ++i) box.add(vertices[leaf_slots_[i]]);
      boxes_[n] = box;
    } else {
      boxes_[n] = boxes_[n + 1];
      boxes_[n].add(boxes_[node.right]);
    }
  }
}

}  // namespace dccd
