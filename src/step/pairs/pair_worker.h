// What one worker does with the pairs of the broad phase: drop pairs that share a vertex, planar filter, elementary
// test, hits. All buffers are kept from step to step.
#pragma once

#include <atomic>
#include <chrono>
#include <limits>
#include <vector>

#include "culling/cluster_pairs.h"
#include "culling/scene_arrays.h"
#include "step/pairs/found_limit.h"
#include "step/pairs/pair_separation.h"

namespace dccd {

inline double msSince(Deadline::Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Deadline::Clock::now() - start).count();
}

/// A contact (certain or undecided) by the ranks of its features; within a kind it sorts canonically by bodies, then
/// key.
struct Hit {
  std::uint64_t key;  ///< rank of the first feature << 32 | rank of the second
  double toc_lower, toc_upper;
  std::uint32_t bodies;  ///< body of the first feature << 16 | body of the second
  Certainty certainty;
};

/// Pairs to be streamed: features of kind a of body_a against features of kind b of body_b.
struct PairTask {
  PairKind kind;
  std::uint16_t body_a, body_b;
  bool self;
  std::uint32_t first, last;  ///< supercluster pairs in the step's list
  std::uint32_t search;       ///< number of the search that it is a piece of
  bool by_bound;              ///< which are in the order in which they can touch, from task to task
  /// `other`, the task before it, is of the same trees, and no bound on the TOC here is earlier than one there.
  bool follows(const PairTask& other) const {
    return by_bound && kind == other.kind && body_a == other.body_a && body_b == other.body_b;
  }
};

class PairWorker;

/// Where the hits of a task are: in its worker's list for the task's kind, from `begin` on.
struct TaskHits {
  PairWorker* worker = nullptr;
  std::size_t begin = 0;
};

/// What all workers share during a step.
struct StepContext {
  const SceneArrays* scene = nullptr;
  const Rung* elementary = nullptr;
  Deadline deadline;
  std::atomic<bool> expired{false};
  bool earliest_only = false;
  double tolerance_m = 0;                 ///< the elementary test may call features this far apart a contact
  std::atomic<double> best_toc_upper{2};  ///< earliest_only: contacts after this are not wanted
  FoundLimit* found = nullptr;            ///< null: no limit
  double not_after = 2;                   ///< earliest_only: contacts that begin after this are not listed
  bool bounds_late = false;               ///< earliest_only: a pair's TOC is bounded before its elementary test
  Span span;                              ///< of the bounds
  /// What each hit takes after the pairs, until it is in an outcome: the time for pairs ends so much earlier.
  std::chrono::nanoseconds per_hit{0};
  std::atomic<std::size_t> hits{0};
  /// Of the pairs of two bodies, or of a body with itself.
  TreePair treesOf(PairKind kind, std::size_t a, std::size_t b) const {
    return {&scene->bodies()[a].tree(firstKind(kind)), &scene->bodies()[b].tree(secondKind(kind)),
            a == b && kind == PairKind::EDGE_EDGE, span, a == b};
  }
  Deadline pairsDeadline() const {
    return deadline.movedBy(-per_hit * static_cast<std::int64_t>(hits.load(std::memory_order_relaxed)));
  }
  bool timeIsUp() {
    if (expired.load(std::memory_order_relaxed)) return true;
    if (deadline.canEnd() && pairsDeadline().isOver()) expired = true;
    return expired.load(std::memory_order_relaxed);
  }
};

class PairWorker {
 public:
  PairWorker();
  void beginStep();
  /// Streams the task's supercluster pairs through all stages. Ends early where context.found has enough. index: of the
  /// task. Returns of how many of these all pairs of features were accounted for; 0 where time or what may be found ran
  /// out.
  std::size_t run(StepContext& context, const PairTask& task, std::size_t index,
                  const std::vector<std::uint32_t>& pairs);
  /// The same for every pair of features, without any bounds, as if it were one.
  std::size_t runBruteForce(StepContext& context, const PairTask& task, std::size_t index);
  /// Forgets the hits of a kind from this one on.
  void dropHits(PairKind kind, std::size_t begin);

  const std::vector<Hit>& hits(PairKind kind) const { return hits_[static_cast<int>(kind)]; }
  const StepStats& stats() const { return stats_; }
  double uncheckedTocLower() const { return unchecked_toc_lower_; }
  /// Bodies of which neighbours came as near as their uncertainty reaches: whether these touch nobody can tell.
  void markUnsure(std::vector<std::uint8_t>& bodies) const {
    for (std::size_t b = 0; b < unsure_.size(); ++b) bodies[b] = bodies[b] || unsure_[b];
  }

 private:
  void begin(StepContext& context, const PairTask& task, std::size_t index);
  std::size_t end(std::size_t done);
  bool goesOn() const { return !enough_ && !context_->timeIsUp(); }
  bool shareVertex(std::size_t i, std::size_t j) const;
  /// Pairs of slots whose features share no vertex.
  void take(const std::uint32_t* slots, std::size_t count);
  void flush();
  void filter();
  void makeCanonical();
  void decide();
  void keepUndecided();
  double boundOf(std::size_t i, double distance_m);
  bool isTooLateForBounds();
  void leaveOut(const TreePair& trees, const std::vector<std::uint32_t>& pairs, std::size_t first);
  void dropLate();
  Effect effect() const { return task_->self ? Effect::SELF_COLLISION : Effect::BODY_BODY; }
  /// What a pair counts for whose elementary test carries a distance, or none.
  Effect effectOf(double separation_m, double noise_m) const {
    return noise_m > 0 ? Effect::TRACKER_NOISE : separation_m > 0 ? Effect::MINIMUM_SEPARATION : effect();
  }
  void setSeparations();
  void lookAtUnsure();
  double separationOf(std::size_t i) const { return separated_ ? separations_[i] : 0; }
  void countOut(std::size_t i);
  void lap(Stage stage);

  StepContext* context_ = nullptr;
  const PairTask* task_ = nullptr;
  std::size_t task_index_ = 0;
  bool enough_ = false;  // of hits, for this task
  const SceneBody *a_ = nullptr, *b_ = nullptr;
  ClusterPairStream stream_;
  std::vector<Quad> quads_;
  std::vector<std::array<std::uint32_t, 2>> slots_;
  std::vector<std::uint64_t> keys_;
  std::vector<std::uint32_t> kept_;
  std::vector<ElementaryResult> results_;
  std::vector<double> separations_;
  SeparationRule rule_;             // of the task's bodies
  bool separated_ = false;          // the rule applies: separations_ holds a value for each pair
  std::vector<Quad> unsure_pairs_;  // of the count_, those that PairSeparation::unsure_m is set of
  std::vector<double> unsure_m_;
  std::vector<std::uint8_t> unsure_;  // per body
  std::size_t count_ = 0;
  std::size_t bounds_ = 0;                         // that were asked for in this step
  bool late_ = false;                              // there is no time for more
  Deadline::Clock::time_point begun_, lap_begun_;  // the task, and what the clock was read for last
  double separated_ms_ = 0;                        // of the task, that count for a separation or an uncertainty
  std::vector<Hit> hits_[2];
  StepStats stats_;
  double unchecked_toc_lower_ = std::numeric_limits<double>::infinity();  // workers may be made during a step
};

}  // namespace dccd
