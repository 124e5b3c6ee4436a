// The step's culling by normal cones and contours (src/culling/unfolded.h), which the paper names as what comes before
// its filters, asked pair by pair: the share of the candidates that it takes.
#pragma once

#include <vector>

#include "culling/unfolded.h"
#include "support/steps.h"

namespace dccd {
namespace benchmarks {

class NormalCones {
 public:
  /// Bodies that meet themselves; `guide`: a step for the order of their features.
  void setBodies(const SceneBodies& scene, const Step& guide);
  /// Steps that follow each other.
  void certify(const Step& step);
  /// Keeps the pairs that are not of one surface that certainly does not fold; returns how many.
  std::size_t keep(PairKind kind, const Quad* pairs, std::size_t count, Quad* out) const;

 private:
  struct Surface {
    Index first = 0, last = 0;  ///< vertices
    Body body;
    SceneArrays scene;
    std::vector<Unfolded> unfolded;  ///< of the one body
  };
  std::vector<Surface> surfaces_;
  std::vector<Index> surface_of_;  ///< of a vertex; NO_INDEX: none
};

}  // namespace benchmarks
}  // namespace dccd
