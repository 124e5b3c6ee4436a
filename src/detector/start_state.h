// The start state of a step (DESIGN.md): do an edge and a face already meet at t=0?
#pragma once

#include <cstdint>
#include <vector>

#include "broad_phase/cluster_pairs.h"
#include "detector/scene_arrays.h"

namespace deformable_ccd {

/// Exact: do the closed segment pq and the closed triangle abc meet? Any finite doubles, degenerate ones included.
bool segmentMeetsTriangle(const double* p, const double* q, const double* a, const double* b, const double* c);

/// Keeps what is known from step to step, so that only the first frame, frames after a reset and surroundings of pairs in
/// contact are tested: a pair that starts apart and whose features never touch during the step ends apart.
class StartStateTest {
 public:
  /// Edges that meet faces at t=0; pairs that share a vertex are left out. Full test unless `carry` says that the
  /// step continues the last one, whose contacts were given to remember().
  const std::vector<StartIntersection>& run(const SceneArrays& scene, bool carry, core::StepStats& stats);

  /// Contacts of the step just done (undecided ones included). complete: false forgets everything.
  void remember(const SceneArrays& scene, const std::vector<core::Contact>& contacts, bool complete);
  void forget() { known_ = false; }

 private:
  struct EdgeFace {
    std::uint32_t body_edge, edge, body_face, face;  ///< local edge and face index
    friend bool operator<(const EdgeFace& x, const EdgeFace& y) {
      return std::tie(x.body_edge, x.edge, x.body_face, x.face) < std::tie(y.body_edge, y.edge, y.body_face, y.face);
    }
    friend bool operator==(const EdgeFace& x, const EdgeFace& y) { return !(x < y) && !(y < x); }
  };
  struct Adjacency;
  void testAll(const SceneArrays& scene);
  void testCandidates(const SceneArrays& scene);
  bool test(const SceneArrays& scene, const EdgeFace& pair) const;
  void report(const SceneArrays& scene, const EdgeFace& pair);

  bool known_ = false;
  std::vector<EdgeFace> candidates_, found_;
  std::vector<StartIntersection> intersections_;
  std::vector<std::uint32_t> groups_, scratch_;
  ClusterPairStream stream_;
  std::vector<std::shared_ptr<const Adjacency>> adjacency_;
  std::uint64_t tested_ = 0;
};

}  // namespace deformable_ccd
