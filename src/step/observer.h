// What a step tells of itself while it is computed, to whoever asks why it answers as it does (record/explain.h).
// Without an observer it costs a look at a pointer for each chunk of pairs.
#pragma once

#include <cstddef>

#include "culling/scene_arrays.h"
#include "dccd/elementary.h"
#include "dccd/outcome.h"
#include "obstacle/leaf_observer.h"
#include "step/pairs/pair_separation.h"

namespace dccd {

/// Called on one thread: a step that is observed has one worker. Pairs are by internal vertices, features in any order.
class StepObserver : public LeafObserver {
 public:
  virtual void onPart(std::size_t /*part*/, const SceneArrays& /*scene*/) {}
  /// The body's pairs with itself are left out as a whole: it certainly does not fold, or keeps its shape.
  virtual void onSelfLeftOut(std::size_t /*body*/, const char* /*why*/) {}
  /// Pairs that are left after a stage.
  virtual void onPairs(Stage, PairKind, const Quad* /*pairs*/, std::size_t /*count*/) {}
  /// The planar filter is not asked: the pairs carry distances.
  virtual void onPlanarSkipped(PairKind, const Quad* /*pairs*/, std::size_t /*count*/) {}
  virtual void onSeparation(PairKind, const Quad& /*pair*/, const PairSeparation&) {}
  virtual void onResult(PairKind, const Quad& /*pair*/, const ElementaryResult&) {}
  void onLeaf(const Index* /*vertices*/, std::size_t /*count*/, const OccupiedLeaf&) override {}
};

}  // namespace dccd
