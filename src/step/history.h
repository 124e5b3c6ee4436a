// What a history holds, and what a step does with it: detect.cpp has the flow, pairs.cpp the pairs of meshes,
// contacts.cpp the list of what they found, map.cpp the map, start.cpp what meets at t=0, left_out.h what is left out
// of the separation.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <memory>
#include <optional>
#include <tuple>
#include <vector>

#include "culling/scene_arrays.h"
#include "culling/unfolded.h"
#include "dccd/detect.h"
#include "simd/float_mode.h"
#include "step/expected_contacts.h"
#include "step/fork_join.h"
#include "step/pairs/hit_order.h"
#include "step/pairs/left_out.h"
#include "step/pairs/pair_worker.h"
#include "step/patches/patches.h"
#include "step/start/inside.h"
#include "step/start/start_state.h"

namespace dccd {

class ClearanceFinder;

/// `fixed` itself where the frames are the same, else `moved`, filled with the positions in the map's frame [m].
const Positions& inMapFrame(const Eigen::Isometry3d& map_from_fixed, const Positions& fixed, Positions& moved);

/// One straight part of a step, of which the later ones begin where the one before ended.
struct Part {
  const Step& step;
  std::size_t index = 0, count = 1;
  bool continues = false;  ///< it begins where the last part of this history ended
  Deadline deadline;
};

/// The contacts of a body with the map, as long as neither changes.
struct MapAnswer {
  std::shared_ptr<const VoxelSurface> map;  ///< null: none
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  std::vector<Contact> contacts;
  std::uint64_t pairs = 0;  ///< that were tested
};

/// What is known of the end of the last step, and nothing else that could change an answer: clear() is its beginning.
struct Carried {
  std::vector<std::shared_ptr<const Positions>>
      end;                          ///< where each body was; empty: no step, or nothing is known of it
  std::vector<std::uint8_t> apart;  ///< per body: it certainly did not touch itself
  StartStateSearch start_state;     ///< what may meet there
  InsideSearch inside;              ///< and what may be inside of something
  std::vector<MapAnswer> map;       ///< per body that has not moved since; empty: none

  void clear();
  bool isClear() const {
    return end.empty() && apart.empty() && start_state.isClear() && inside.isClear() && map.empty();
  }
  /// Does the step begin where the last one ended? Every body bit for bit. The one place that decides it.
  bool isContinuedBy(const Step& step) const;
};

struct History::Impl {
  Outcome run(const Step& step, const Options& wanted, Deadline deadline);

  /// What throws may leave half of it made: what follows from options and map is made anew, and from bodies, where
  /// these were not done. Nothing is carried over.
  void forgetMade() noexcept;
  void forgetMap() noexcept;
  void setOptions(const Options& wanted);
  void setBodies(const Step& step);
  void useMap(const ObstacleMap& map);
  void findLeftOut(const Step& step);
  void listLeftOut(std::size_t body, PairKind kind);
  bool needsReference(std::size_t body) const;

  std::size_t neededParts(const Step& step, StepStats& stats) const;
  bool runParts(const Step& step, bool continues, std::size_t parts, Deadline deadline, Outcome& outcome);
  void runPart(const Part& part, Outcome& outcome);
  /// False: there was no time for it.
  bool fill(const Part& part);
  void leaveOutPart(const Part& part);
  void chooseSelfTests(const Part& part);
  bool staysApart(std::size_t body) const;
  bool searchesStart(const Part& part) const;
  bool mayBeUnfolded(std::size_t body) const;
  bool certify(std::size_t body);
  void rememberApart(bool certain);
  /// Which pairs of groups a search is for: all of them, a sample of them, or the rest of it.
  enum class Share : std::uint8_t { ALL, SAMPLE, REST };
  void addSelfTasks(std::size_t body, const StepContext& context, Share share);
  void addTasks(PairKind kind, std::uint16_t a, std::uint16_t b, const StepContext& context, Share share);
  void orderByBound(const TreePair& trees);
  void findPairs(const StepContext& context, Share share);
  void runPairs(StepContext& context);
  void runUntilFirst(StepContext& context);
  /// Only the first contact is wanted, and what cannot touch before it is not looked at.
  bool stopsAtFirst() const {
    return options->earliest_only && options->accuracy.rung == Accuracy::EXACT &&
           options->broad_phase == BroadPhase::CLUSTERED && !observer;
  }
  /// Of a pair that only uncertainty leaves out it is not known whether it comes as near as that. A sentence a body.
  void sayLeftOutForNoise(const Step& step, std::vector<std::string>& unproved) const;
  void cutHits(const Span& span);
  /// What may be found in a whole step with these options and bodies; FoundLimit::NONE: no limit.
  std::size_t foundLimit() const;
  /// More was there to be found, by a limit (by_count) or a deadline; nothing of what was left out touches before this.
  void leaveOutAt(double toc, bool by_count);
  void collect(const Step& step, const Deadline& deadline);
  void writeContact(PairKind kind, const Hit& hit, Contact& contact) const;
  /// Sets complete to false, and the bound on what was left out to 0, where the deadline cut it.
  void runMap(const Part& part);
  /// False: its bounds show that it does not come near what is occupied in the part.
  bool reachesMap(std::size_t body, const Part& part) const;
  bool runMapOf(std::size_t body, const Part& part, ObstacleStats& total);
  /// The body's contacts with the map where they are known to be those of the step before; false: they are not.
  bool takeMapAnswer(std::size_t body, const Part& part, std::size_t room, ObstacleStats& total);
  void keepMapAnswer(std::size_t body, const Part& part, std::size_t first, std::uint64_t pairs);
  bool checksStartState(const Part& part) const;
  bool isStartKnown() const;
  /// all_known: no other pair of meshes touches in the part.
  void runStartState(const Part& part, Deadline::Clock::time_point begin, bool all_known);
  bool listStart(const Part& part, const Deadline& deadline, std::vector<StartIntersection>& met);
  void findPatches(Outcome& outcome);
  void findClearance(const Part& part, Deadline::Clock::time_point begin);
  template <class Function>
  void parallel(std::size_t n, std::size_t piece, const Function& function);

  Carried carried;
  StepObserver* observer = nullptr;
  Impl* begins_at = nullptr;  // the next step begins where this one's ended
  bool aside = false;         // the step that is being run began so

  // Made from options, bodies and map, again when these change.
  std::optional<Options> options;
  bool bodies_made = false;  // scene and what follows from it are of the bodies that they hold
  std::unique_ptr<Rung> elementary;
  std::optional<tbb::task_arena> arena;
  SceneArrays scene;
  std::vector<Unfolded> unfolded;       // per body
  std::vector<LeftOutOfBody> left_out;  // per body
  std::vector<LeftOutPair> left_out_list;
  std::vector<double> left_out_m;  // of each one, how far apart it is in the reference frame
  std::shared_ptr<const VoxelSurface> map_given, map_reduced;  // the step's, and what exclude_boxes leave of it
  Eigen::Isometry3d map_pose = Eigen::Isometry3d::Identity();  // with which
  std::uint64_t excluded_voxels = 0;
  std::vector<std::unique_ptr<ObstacleCheck>> obstacle_checks;
  ExpectedContacts expected;
  bool expected_known = false;  // it is of these options and bodies

  // Buffers of a part.
  tbb::enumerable_thread_specific<PairWorker> workers;
  std::vector<PairTask> tasks;
  std::vector<TaskHits> task_hits;             // per task
  FoundLimit found;                            // by the tasks
  std::size_t found_limit = FoundLimit::NONE;  // what the part may find
  /// Half as much again as a hit took, after the pairs, in the last steps with many.
  std::chrono::nanoseconds per_hit{400};
  Deadline::Clock::time_point hits_done;  // when the last part's pairs ended
  std::vector<std::uint32_t> group_pairs, found_groups, scratch, body_pairs;
  std::vector<std::tuple<double, std::uint32_t, std::array<std::uint32_t, 2>>> by_toc;  // and place, pair of groups
  std::vector<std::uint8_t> self_tested;  // per body: its pairs with itself are looked at
  std::vector<std::uint8_t> bounded;      // per body: it needs bounds, whatever is near
  std::vector<std::uint8_t> obstacle_active;
  Positions map_t0, map_t1;
  std::array<HitOrder, 2> order;               // by PairKind
  Findings result;                             // of the part; whether it is complete is said of its pairs alone
  std::unique_ptr<ClearanceFinder> clearance;  // once it is wanted
  PatchMaker patches;
  Deadline::Clock::duration patches_took{0};  // in the last step
};

template <class Function>
void History::Impl::parallel(std::size_t n, std::size_t piece, const Function& function) {
  if (options->num_threads == 1 || n <= piece) {
    function(0, n);
    return;
  }
  const auto in_mode = [&](std::size_t first, std::size_t last) {
    const ScopedFloatMode mode;
    function(first, last);
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
