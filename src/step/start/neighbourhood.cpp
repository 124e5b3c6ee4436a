#include "step/start/neighbourhood.h"

#include <algorithm>
#include <utility>

namespace dccd {

void SlotsAtVertex::build(const SceneBody& body, FeatureKind kind) {
  const ClusterTree& tree = body.tree(kind);
  begin.assign(body.usedCount() + 1, 0);
  slots.resize(tree.featureCount() * tree.arity());
  for (std::size_t i = 0; i < slots.size(); ++i) ++begin[tree.feature(0)[i] - body.internal_begin];
  std::uint32_t sum = 0;
  for (std::uint32_t& n : begin) n = sum += n;  // ends, moved down to begins below
  for (std::size_t i = slots.size(); i-- > 0;) {
    slots[--begin[tree.feature(0)[i] - body.internal_begin]] = static_cast<std::uint32_t>(i / tree.arity());
  }
}

void FacesSharing::build(const ClusterTree& faces, const SlotsAtVertex& at, Index first_vertex) {
  const std::size_t groups = faces.level(0).groups;
  begin.assign(1, 0);
  others.clear();
  pairs.clear();
  std::vector<std::uint32_t> place(groups, 0);  // of a group in others, if not before the group's that is looked at
  for (std::size_t g = 0; g < groups; ++g) {
    const std::size_t end = std::min((g + 1) * simd::GROUP, faces.featureCount()), own = others.size();
    for (std::size_t slot = g * simd::GROUP; slot < end; ++slot) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Index vertex = faces.feature(slot)[k] - first_vertex;
        for (std::uint32_t i = at.begin[vertex]; i < at.begin[vertex + 1]; ++i) {
          const std::uint32_t other = at.slots[i], h = other / simd::GROUP;
          if (h < g) continue;
          if (place[h] < own || place[h] >= others.size() || others[place[h]] != h) {
            place[h] = static_cast<std::uint32_t>(others.size());
            others.push_back(h);
            pairs.emplace_back();
          }
          simd::LanePairs& lanes = pairs[place[h]];
          lanes.rows[slot % simd::GROUP] |= static_cast<std::uint16_t>(1u << other % simd::GROUP);
          lanes.columns[other % simd::GROUP] |= static_cast<std::uint16_t>(1u << slot % simd::GROUP);
        }
      }
    }
    begin.push_back(static_cast<std::uint32_t>(others.size()));
  }
  others.resize(others.size() + 8);
  others.shrink_to_fit();
  pairs.shrink_to_fit();
}

void FacesSharing::leaveOut(const std::vector<std::uint8_t>& owns) {
  constexpr std::uint16_t ALL = 0xffff;
  std::vector<std::uint16_t> none(begin.size() - 1, ALL);  // by groups: lanes
  for (std::size_t slot = 0; slot < owns.size(); ++slot) {
    if (owns[slot] != 0) none[slot / simd::GROUP] &= static_cast<std::uint16_t>(~(1u << slot % simd::GROUP));
  }
  for (std::size_t g = 0; g < none.size(); ++g) {
    for (std::uint32_t k = begin[g]; k < begin[g + 1]; ++k) {
      for (std::size_t lane = 0; lane < simd::GROUP; ++lane) {
        const bool is_none = none[g] >> lane & 1;
        if (others[k] == g) {
          const std::uint32_t up_to_it = (2u << lane) - 1;
          pairs[k].rows[lane] |= is_none ? ALL : static_cast<std::uint16_t>(up_to_it & ~none[g]);
          continue;
        }
        if (is_none) pairs[k].rows[lane] |= none[others[k]];
        if (none[others[k]] >> lane & 1) pairs[k].columns[lane] |= none[g];
      }
    }
  }
}

void Fans::build(const SlotsAtVertex& faces, const std::vector<std::uint8_t>& corner,
                 const std::vector<std::uint8_t>& closed, std::size_t slots) {
  constexpr std::uint32_t MOST_ROWS = 255, CORNERS = 4;
  const std::size_t vertices = closed.size();
  begin.assign(1, 0);
  corners.clear();
  for (std::size_t first = 0; first < vertices; first += simd::GROUP) {
    const std::size_t own = corners.size(), last = std::min(first + simd::GROUP, vertices);
    for (std::size_t v = first; v < last; ++v) {
      const std::uint32_t at = faces.begin[v], n = faces.begin[v + 1] - at;
      const bool known = closed[v] && n <= MOST_ROWS;
      const std::size_t rows = known ? n : 1;
      if (corners.size() < own + rows * simd::GROUP) {
        corners.resize(own + rows * simd::GROUP, static_cast<std::uint32_t>(CORNERS * slots));
      }
      std::uint32_t* lane = corners.data() + own + v % simd::GROUP;
      if (!known) *lane = static_cast<std::uint32_t>(CORNERS * (slots + 1));
      for (std::uint32_t i = 0; known && i < n; ++i)
        lane[i * simd::GROUP] = CORNERS * faces.slots[at + i] + corner[at + i];
    }
    begin.push_back(static_cast<std::uint32_t>(corners.size() / simd::GROUP));
  }
  corners.shrink_to_fit();
}

/// Faces that need not stand for an edge, as many as are soon found: no two of them share one. By slots; which they are
/// does not depend on what is in which slot.
std::vector<std::uint8_t> Neighbourhood::spareFaces(const SceneBody& body) const {
  const ClusterTree& tree = body.tree(FeatureKind::FACE);
  const std::vector<Index>& rank = body.rank(FeatureKind::FACE);
  std::vector<std::uint32_t> slot_of(tree.featureCount()), order, beside;
  for (std::uint32_t slot = 0; slot < slot_of.size(); ++slot) slot_of[rank[slot] - body.face_begin] = slot;
  std::vector<std::uint8_t> spared(slot_of.size(), 0), seen(slot_of.size(), 0);
  std::size_t done = 0;
  for (std::uint32_t seed = 0; seed < slot_of.size(); ++seed) {
    if (!std::exchange(seen[seed], 1)) order.push_back(seed);
    for (; done < order.size(); ++done) {  // from neighbour to neighbour: of a regular mesh every other face is spared
      const Index* f = tree.feature(slot_of[order[done]]);
      beside.clear();
      for (std::size_t k = 0; k < 3; ++k) {
        const Index at = f[k] - body.internal_begin, to = f[k == 2 ? 0 : k + 1];
        for (std::uint32_t i = faces.begin[at]; i < faces.begin[at + 1]; ++i) {
          if (contains(tree.feature(faces.slots[i]), to)) beside.push_back(rank[faces.slots[i]] - body.face_begin);
        }
      }
      std::sort(beside.begin(), beside.end());
      bool beside_one = false;
      for (const std::uint32_t other : beside) {
        beside_one |= spared[slot_of[other]] != 0;
        if (!std::exchange(seen[other], 1)) order.push_back(other);
      }
      spared[slot_of[order[done]]] = !beside_one;
    }
  }
  return spared;
}

void Neighbourhood::learn(const SceneArrays& scene, std::size_t body_index) {
  const SceneBody& body = scene.bodies()[body_index];
  internal_of_local.assign(body.setup.topology->vertexCount(), NO_INDEX);
  for (std::size_t i = 0; i < body.usedCount(); ++i) {
    internal_of_local[body.slot_vertex[i]] = body.internal_begin + static_cast<Index>(i);
  }
  edges.build(body, FeatureKind::EDGE);
  faces.build(body, FeatureKind::FACE);
  listed.resize(body.rank(FeatureKind::FACE).size());
  for (std::size_t i = 0; i < listed.size(); ++i) {
    scene.featureVertices(FeatureKind::FACE, body_index, body.face_begin + static_cast<Index>(i), listed[i].data());
  }
}

void Neighbourhood::learnFaces(const SceneBody& body) {
  if (searched) return;
  const ClusterTree &edge_tree = body.tree(FeatureKind::EDGE), &face_tree = body.tree(FeatureKind::FACE);
  corner.resize(faces.slots.size());
  for (std::size_t v = 0; v < body.usedCount(); ++v) {
    for (std::uint32_t i = faces.begin[v]; i < faces.begin[v + 1]; ++i) {
      const Index *f = face_tree.feature(faces.slots[i]), at = body.internal_begin + static_cast<Index>(v);
      corner[i] = static_cast<std::uint8_t>(f[0] == at ? 0 : f[1] == at ? 1 : 2);
    }
  }
  own_edges.assign(face_tree.featureCount(), {NO_INDEX, NO_INDEX, NO_INDEX});
  const std::vector<std::uint8_t> spared = spareFaces(body);
  // Per used vertex: each edge at it is on two faces, which pass along it in opposite directions.
  std::vector<std::uint8_t> closed(body.usedCount(), 1);
  for (std::uint32_t slot = 0; slot < edge_tree.featureCount(); ++slot) {
    const Index* e = edge_tree.feature(slot);
    const Index at = e[0] - body.internal_begin;
    std::size_t along = 0, against = 0;
    std::uint32_t* own = nullptr;
    std::uint64_t own_place = UINT64_MAX;
    for (std::uint32_t i = faces.begin[at]; i < faces.begin[at + 1]; ++i) {
      const Index* f = face_tree.feature(faces.slots[i]);
      if (!contains(f, e[1])) continue;
      const std::size_t c = corner[i];
      const bool is_along = f[(c + 1) % 3] == e[1];
      const std::uint32_t face = faces.slots[i];
      const std::uint64_t place = std::uint64_t{spared[face]} << 32 | body.rank(FeatureKind::FACE)[face];
      if (place < own_place) own = &own_edges[face][is_along ? c : (c + 2) % 3];
      own_place = std::min(own_place, place);
      ++(is_along ? along : against);
    }
    if (own) *own = slot;
    if (along != 1 || against != 1) closed[at] = closed[e[1] - body.internal_begin] = 0;
  }
  owns.clear();
  for (const std::array<std::uint32_t, 3>& own : own_edges) {
    owns.push_back(
        static_cast<std::uint8_t>((own[0] != NO_INDEX) | (own[1] != NO_INDEX) << 1 | (own[2] != NO_INDEX) << 2));
  }
  if (meetsItself(body.setup)) {
    sharing.build(face_tree, faces, body.internal_begin);
    sharing.leaveOut(owns);
    fans.build(faces, corner, closed, face_tree.level(0).groups * simd::GROUP);
  }
  searched = true;
}

}  // namespace dccd
