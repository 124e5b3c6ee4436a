// What a detector holds and does: detector.cpp has the flow, detector_pairs.cpp the pairs of meshes, left_out.h what is
// left out of them.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "culling/scene_arrays.h"
#include "culling/unfolded.h"
#include "dccd/detector.h"
#include "step/float_mode.h"
#include "step/fork_join.h"
#include "step/hit_order.h"
#include "step/left_out.h"
#include "step/pair_worker.h"
#include "step/start_state.h"

namespace dccd {

inline FeatureKind firstKind(PairKind k) {
  return k == PairKind::VERTEX_FACE ? FeatureKind::VERTEX : FeatureKind::EDGE;
}
inline FeatureKind secondKind(PairKind k) { return k == PairKind::VERTEX_FACE ? FeatureKind::FACE : FeatureKind::EDGE; }

struct Detector::Impl {
  explicit Impl(const DetectorOptions& o) { setOptions(o); }

  void setOptions(const DetectorOptions& o);
  /// Throws std::invalid_argument unless the rung can hold a distance; `what` asks for one.
  static void checkHoldsDistance(const DetectorOptions& o, const std::string& what);
  static void checkSeparation(const DetectorOptions& o, double separation_m);

  const StepResult& run(const MotionStep& step);
  void addSelfTasks(std::size_t body, const StepContext& context);
  void findPairs(const StepContext& context);
  bool needsReference(std::size_t body) const;
  void findLeftOut(const std::vector<const Positions*>& rest_positions);
  void listLeftOut(std::size_t body, PairKind kind);
  bool staysApart(std::size_t body) const;
  bool isUnfolded(std::size_t body);
  void chooseSelfTests(const MotionStep& step);
  bool needsTrees(const MotionStep& step) const;
  void rememberApart(bool certain);
  void addTasks(PairKind kind, std::uint16_t a, std::uint16_t b, const StepContext& context);
  void runPairs(StepContext& context);
  /// Sets complete to false, and the bound on what was left out to 0, where the deadline cut it.
  void runObstacle(const MotionStep& step, const StepContext& context);
  bool checksStartState(const MotionStep& step) const;
  /// By the step's predecessor.
  static bool isStartKnown(const MotionStep& step);
  /// all_pairs: no pair of meshes was left out.
  void runStartState(const MotionStep& step, Clock::time_point begin, bool all_pairs, const StepContext& context);
  void collect();
  void writeContact(PairKind kind, const Hit& hit, Contact& contact) const;
  template <class Body>
  void parallel(std::size_t n, std::size_t piece, const Body& body);

  DetectorOptions options;
  std::unique_ptr<Rung> elementary;
  std::optional<tbb::task_arena> arena;
  SceneArrays scene;
  tbb::enumerable_thread_specific<PairWorker> workers;
  std::vector<PairTask> tasks;
  std::vector<std::uint32_t> group_pairs, found_groups, scratch;
  std::vector<std::tuple<double, std::uint32_t, std::array<std::uint32_t, 2>>> by_toc;  // and place, pair of groups
  std::vector<std::uint32_t> body_pairs;
  HitOrder order;
  StartStateSearch start_state;
  std::vector<UnfoldedProof> unfolded;
  std::vector<std::uint8_t> apart;        // per body: at the end of the last step it certainly did not touch itself
  std::vector<std::uint8_t> self_tested;  // per body: its pairs with itself are looked at in this step
  std::vector<std::unique_ptr<ObstacleCheck>> obstacle_tests;
  Positions map_t0, map_t1;
  std::vector<std::uint8_t> obstacle_active;
  std::vector<LeftOutOfBody> left_out;  // per body
  std::vector<LeftOutPair> left_out_list;
  bool finished = false;  // the last run() came to its end
  StepResult result;
};

template <class Body>
void Detector::Impl::parallel(std::size_t n, std::size_t piece, const Body& body) {
  if (options.num_threads == 1 || n <= piece) {
    body(0, n);
    return;
  }
  const auto in_mode = [&](std::size_t first, std::size_t last) {
    const ScopedFloatMode mode;
    body(first, last);
  };
  ForkJoin::fork();
  arena->execute([&] {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, n, piece),
        [&](const tbb::blocked_range<std::size_t>& r)
            DEFORMABLE_CCD_COPIED_BY_TBB { ForkJoin::piece(in_mode, r.begin(), r.end()); },
        tbb::simple_partitioner());
  });
  ForkJoin::join();
}

}  // namespace dccd
