// What lies around a vertex of a body: its edges and faces, by their slots in the body's trees.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "culling/scene_arrays.h"
#include "simd/face_filter.h"

namespace dccd {

/// Slots of the features at each used vertex of a body: those of vertex i are slots[begin[i]] to slots[begin[i + 1]].
struct SlotsAtVertex {
  std::vector<std::uint32_t> begin, slots;
  void build(const SceneBody& body, FeatureKind kind);
};

/// Which faces of a body share a vertex.
struct FacesSharing {
  std::vector<std::uint32_t> begin, others;
  std::vector<simd::LanePairs> pairs;
  void build(const ClusterTree& faces, const SlotsAtVertex& at, Index first_vertex);
  /// Adds to these, of the same groups, all pairs of faces of which neither stands for an edge, and within a group one
  /// order of each other pair: what is left has a face in its row that does. owns: Neighbourhood's.
  void leaveOut(const std::vector<std::uint8_t>& owns);
  simd::KnownPairs view() const { return {begin.data(), others.data(), pairs.data()}; }
};

/// simd::FansView of a body's used vertices. Where an edge at the vertex is not on two faces, which pass along it in
/// opposite directions, a slot of the view 0 stands for all of them.
struct Fans {
  std::vector<std::uint32_t> begin, corners;
  void build(const SlotsAtVertex& faces, const std::vector<std::uint8_t>& corner,
             const std::vector<std::uint8_t>& closed, std::size_t slots);
  simd::FansView view() const { return {begin.data(), corners.data()}; }
};

struct Neighbourhood {
  std::vector<Index> internal_of_local;
  SlotsAtVertex edges, faces;
  std::vector<Face> listed;  ///< by ranks from the body's first face's on: SceneArrays::featureVertices()

  // Of a body whose faces are searched.
  bool searched = false;  ///< it is known
  /// By slots of faces: the slot of the edge from each corner to the next, if this face stands for that edge, else
  /// NO_INDEX. Of an edge's faces one that is not spared stands for it, of these that of the lowest rank.
  std::vector<std::array<std::uint32_t, 3>> own_edges;
  std::vector<std::uint8_t> owns;  ///< by slots of faces: bit k where the k-th of these is one
  /// Of each of faces.slots, which of the face's corners the vertex is.
  std::vector<std::uint8_t> corner;
  FacesSharing sharing;  ///< of a body that meets itself,
  Fans fans;             ///< whose slots are those of all groups of faces, and two more: of the views TURNS and 0

  void learn(const SceneArrays& scene, std::size_t body_index);
  /// Once, what a search by faces needs besides.
  void learnFaces(const SceneBody& body);

 private:
  std::vector<std::uint8_t> spareFaces(const SceneBody& body) const;
};

inline bool contains(const Index* face, Index v) { return (face[0] == v) | (face[1] == v) | (face[2] == v); }
inline bool shareVertex(const Index* edge, const Index* face) {
  return contains(face, edge[0]) | contains(face, edge[1]);
}

}  // namespace dccd
