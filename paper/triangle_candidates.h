// The paper's broad phase and that of all triangles with all: candidate pairs of features of triangle pairs with
// overlapping swept bounds, each feature pair once (paper/feature_ownership.h), pairs that share a vertex left out.
// This is the candidate set of the paper's culling ratios.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "dccd/elementary.h"
#include "dccd/topology.h"
#include "paper/feature_ownership.h"
#include "paper/paper_hierarchy.h"
#include "paper/paper_record.h"

namespace dccd {

/// Takes chunks of candidates: one virtual call a chunk.
class PairSink {
 public:
  virtual ~PairSink() = default;
  /// kind: VERTEX_FACE (v, then the face's three as in the topology) or EDGE_EDGE (smaller index first within an edge,
  /// smaller edge first). The array is the caller's to overwrite (filters work in place) until the call returns.
  virtual void take(PairKind kind, Quad* pairs, std::size_t count) = 0;
};

/// How triangle pairs are found. Both give the same candidates, in different order.
enum class TrianglePairs : std::uint8_t { HIERARCHY = 0, BRUTE_FORCE = 1 };

/// Which directions the swept bounds of triangles have. DOP18 adds x - z to the 16-DOP; BOX is x, y, z alone.
enum class SweptBounds : std::uint8_t { DOP16 = 0, DOP18 = 1, BOX = 2 };

class TriangleCandidates {
 public:
  struct Body {
    const Topology* topology = nullptr;
    Index vertex_offset = 0;  ///< of the body's vertex 0 in the array of all bodies' vertices
    bool self = true;         ///< pairs within the body
    bool against = true;      ///< pairs with other bodies; both bodies must allow it
  };

  /// Builds the trees; `vertices` of any frame guide them. The topologies are not kept.
  void setBodies(const std::vector<Body>& bodies, const VertexMotion* vertices);

  /// Bounds of the step. `active`: one byte a vertex, 0 leaves the vertex and every feature on it out; null means all.
  /// separation_m >= 0: features that come this close are candidates, too.
  void refit(const VertexMotion* vertices, const PaperRecords& records, const std::uint8_t* active = nullptr,
             double separation_m = 0, SweptBounds bounds = SweptBounds::DOP16);

  /// Hands every candidate of the refitted step to the sink, in chunks of at most CHUNK.
  void enumerate(TrianglePairs method, PairSink& sink);

  static constexpr std::size_t CHUNK = 2048;
  std::size_t primitiveCount() const { return primitives_.size(); }
  /// Pairs of primitives with overlapping bounds that the last enumerate() found.
  std::uint64_t primitivePairs() const { return primitive_pairs_; }

 private:
  struct Chunk {
    std::vector<Quad> pairs;
    std::size_t count = 0;
  };
  void expand(std::uint32_t a, std::uint32_t b, PairSink& sink);
  void expandVertexFace(const Primitive& owner, const Primitive& face);
  void expandEdgeEdge(const Primitive& a, const Primitive& b);
  void flush(Chunk& chunk, PairKind kind, PairSink& sink);
  bool wanted(std::uint32_t a, std::uint32_t b) const;
  void refitDifference(const VertexMotion* vertices, double separation_m);
  void deactivate(const std::uint8_t* active);

  PaperHierarchy hierarchy_;
  std::vector<Primitive> primitives_;       // in the order of the tree
  std::vector<std::uint8_t> all_features_;  // Primitive::features with every vertex active
  std::vector<Index> body_of_;              // of a primitive
  std::vector<Body> bodies_;
  std::vector<std::uint8_t> part_self_;
  std::vector<std::uint32_t> leaf_vertices_;           // 3 a leaf, as dopRefitLeaves wants them
  std::vector<double> difference_lo_, difference_hi_;  // swept x - z of a primitive, DOP18 alone
  bool use_difference_ = false;
  bool all_wanted_ = true;
  std::vector<std::uint32_t> found_;
  Chunk vf_, ee_;
  std::uint64_t primitive_pairs_ = 0;
};

}  // namespace dccd
