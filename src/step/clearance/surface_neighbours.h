// Which features of a body are so near each other along its surface that their distance says nothing of a fold.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "dccd/topology.h"
#include "dccd/types.h"

namespace dccd {

/// Two features are neighbours where a way along the edges of the mesh leads from a vertex of one to a vertex of the
/// other that is shorter than self_m, in the reference frame. No way on the surface is longer than the one along its
/// edges by more than the mesh's grain, so that what is not left out is at least almost self_m away.
class SurfaceNeighbours {
 public:
  void set(const Topology& topology, const Positions& reference, double self_m);
  bool isSet() const { return !begin_.empty(); }
  /// Features as a FeatureTree has them. Quick where `a` is the one that was asked about last.
  bool are(const std::array<Index, 3>& a, const std::array<Index, 3>& b);

 private:
  void lookAround(const std::array<Index, 3>& feature);

  double self_m_ = 0;
  std::vector<std::uint32_t> begin_;             // of each vertex's edges
  std::vector<std::pair<Index, double>> edges_;  // the other end, and the length [m]
  std::array<Index, 3> asked_{NO_INDEX, NO_INDEX, NO_INDEX};
  std::vector<std::uint32_t> reached_;  // per vertex the number of the last search that came there
  std::vector<double> way_m_;           // per vertex, of that search
  std::uint32_t search_ = 0;
  std::vector<std::pair<double, Index>> heap_;
};

}  // namespace dccd
