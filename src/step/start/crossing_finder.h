// Which edges meet faces, of those near each other: the work of one thread in a search of the start state.
#pragma once

#include <array>
#include <cstdint>
#include <tuple>
#include <vector>

#include "culling/cluster_pairs.h"
#include "culling/scene_arrays.h"
#include "dccd/types.h"
#include "simd/face_filter.h"
#include "step/start/neighbourhood.h"

namespace dccd {

/// By slot in the bodies' trees, so that sorted pairs are also near each other in memory.
struct EdgeFace {
  std::uint32_t edge_body, edge, face_body, face;
  std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, std::uint32_t> key() const {
    return {edge_body, edge, face_body, face};
  }
  friend bool operator<(const EdgeFace& x, const EdgeFace& y) { return x.key() < y.key(); }
  friend bool operator==(const EdgeFace& x, const EdgeFace& y) { return x.key() == y.key(); }
};

/// Keeps its buffers. Each call looks at the clock from time to time, after so much work that a search comes to its end
/// in the end, and returns false where the deadline ended it, or where it has found more than is wanted.
class CrossingFinder {
 public:
  /// What is asked for in a search. begin() begins one.
  struct Search {
    const SceneArrays* scene = nullptr;
    const std::vector<Neighbourhood>* neighbourhoods = nullptr;
    simd::NearVertices vertices{nullptr, 0};  ///< at t=0; of bodies that are searched by faces
    const std::uint32_t* views = nullptr;     ///< simd::faceViews() of a body that is searched with itself
    Deadline deadline;
    std::size_t most_found = 0;
  };
  void begin(const Search& search);

  /// Appends those pairs to found that are checked and meet at t=0. Returns how many were tested.
  std::size_t addMeeting(const SceneArrays& scene, const EdgeFace* pairs, std::size_t count,
                         std::vector<EdgeFace>& found);

  /// Edges against faces of pairs of groups of the trees of edges and of faces.
  bool searchEdges(std::uint32_t edge_body, std::uint32_t face_body, const TreePair& trees,
                   const std::uint32_t* group_pairs, std::size_t count, std::vector<EdgeFace>& found);
  /// Edges of either body against faces of the other, or of one body: those of faces that share no vertex, of pairs of
  /// groups of the trees of faces. An edge is looked at with the face that stands for it.
  bool searchFaces(std::uint32_t a, std::uint32_t b, const TreePair& trees, const std::uint32_t* group_pairs,
                   std::size_t count, std::vector<EdgeFace>& found);
  /// What that leaves out within a body: edges of faces that share one vertex with the other face. first, last: of the
  /// body's groups of used vertices.
  bool searchFans(std::uint32_t body, std::size_t first, std::size_t last, std::vector<EdgeFace>& found);

  /// Pairs of an edge and a face that were looked at since begin().
  std::uint64_t tested() const { return tested_; }

 private:
  /// A face at a vertex, the bit of its edge opposite the vertex if the face stands for that, and from where to where
  /// it goes.
  struct FaceOfFan {
    std::uint32_t slot;
    unsigned edge;
    Index from, to;
  };
  bool goesOn(const std::vector<EdgeFace>& found);
  void add(const EdgeFace& pair, const std::array<std::uint32_t, 5>& corners) {
    pairs_.push_back(pair);
    corners_.push_back(corners);
  }
  void add(const SceneArrays& scene, const EdgeFace& pair);
  void test(const double* positions, std::size_t first, std::size_t last, std::vector<EdgeFace>& found);
  bool flush(std::vector<EdgeFace>& found);
  bool flushFans(std::uint32_t body, std::vector<EdgeFace>& found);
  void addFacePairs(std::uint32_t a, std::uint32_t b, const std::uint32_t* slots, std::size_t n,
                    const std::uint8_t* asked, std::vector<EdgeFace>& found);
  void addFan(std::uint32_t body, const Neighbourhood& around, std::size_t vertex);

  Search search_;
  std::uint64_t tested_ = 0;
  std::size_t work_ = 0;  // of a unit, in tests
  ClusterPairStream stream_;
  std::vector<EdgeFace> pairs_;                        // to be tested together,
  std::vector<std::array<std::uint32_t, 5>> corners_;  // the vertices of each,
  std::vector<std::uint8_t> meet_;                     // and whether it meets
  std::vector<std::uint32_t> face_pairs_;              // that simd::facePairFilter() left
  std::vector<FaceOfFan> fan_;                         // the faces at a vertex,
  std::vector<std::uint32_t> fan_slots_;               // pairs of such,
  std::vector<std::uint8_t> fan_asked_;                // and which of their edges are asked about; of these
  std::size_t fan_pairs_ = 0;                          // are there
  std::vector<std::uint16_t> one_turn_;                // simd::fansOfOneTurn(),
  std::vector<std::size_t> other_turns_;               // and the vertices of which that is not known
};

}  // namespace dccd
