// What a history holds, by who may change it: what is prepared for many steps, what is carried from step to step, and
// the stages of a part. detect.cpp has the flow.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <vector>

#include "culling/scene_arrays.h"
#include "dccd/detect.h"
#include "proof/looked.h"
#include "step/expected_contacts.h"
#include "step/map.h"
#include "step/pairs/pair_search.h"
#include "step/pairs/self_tests.h"
#include "step/patches/patches.h"
#include "step/start/inside.h"
#include "step/start/start_state.h"
#include "step/threads.h"

namespace dccd {

class ClearanceFinder;
class DistanceReaders;

/// Made from options, bodies and map, again when these change. No part of a step changes it.
struct Prepared {
  std::optional<Options> options;
  std::unique_ptr<Rung> elementary;
  Threads threads;
  ReducedMap map;
  ExpectedContacts expected;
  bool bodies_known = false;    ///< what follows from bodies is of those that the scene holds
  bool expected_known = false;  ///< `expected` is of these options and bodies
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
  /// contacts: of the part just done. complete: no other pair of meshes touches in it.
  void rememberApart(const SceneArrays& scene, const std::vector<Contact>& contacts, bool complete);
};

/// One straight part of a step, of which the later ones begin where the one before ended: what its stages read, and
/// none of them changes.
struct DCCD_HIDDEN Part {
  const Step& step;
  std::size_t index, count;
  bool continues;  ///< it begins where the last part of this history ended
  Deadline deadline;
  Deadline::Clock::time_point begun;
  const Prepared& prepared;
  const SceneArrays& scene;          ///< once it is filled: the part's positions
  std::size_t found_limit;           ///< what may be found in it; FoundLimit::NONE: no limit
  std::chrono::nanoseconds per_hit;  ///< what a hit takes after the pairs, until it is in an outcome

  const Options& options() const { return *prepared.options; }
  bool checksStartState() const { return options().check_start_state; }
  /// For a stage that begins now: later parts need as much time for what was done before it; what is over is shared.
  Deadline shareFrom(Deadline::Clock::time_point now) const {
    if (deadline.isNever()) return deadline;
    const auto later = static_cast<Deadline::Clock::rep>(count - index - 1);
    return deadline.movedTo(now + (deadline.at() - now - later * (now - begun)) / (later + 1));
  }
};

struct History::Impl {
  static Impl& of(History& history) { return *history.impl_; }

  Outcome run(const Step& step, const Options& wanted, Deadline deadline);
  /// What run() begins with.
  void prepare(const Step& step, const Options& wanted);

  Prepared prepared;
  Carried carried;
  DistanceReaders* readers = nullptr;  // of the next step's distances; null: all are read

  // The stages of a part: what each keeps from step to step are buffers, and what it has learnt of the meshes.
  SceneArrays scene;  // the bodies are those that were prepared
  SelfTests self_tests;
  PairSearch pairs;
  MapSearch map_search;
  std::unique_ptr<ClearanceFinder> clearance;  // once it is wanted
  PatchMaker patches;

 private:
  void forgetPrepared() noexcept;
  void setOptions(const Options& wanted);
  void setBodies(const Step& step);
  bool runParts(const Step& step, bool continues, std::size_t parts, Deadline deadline, Outcome& outcome);
  void runPart(const Step& step, std::size_t index, std::size_t count, bool continues, Deadline deadline,
               Outcome& outcome);
  bool fill(const Part& part, StepStats& stats);
  void findClearance(const Part& part, Findings& result);
  void findPatches(Outcome& outcome);
  void answerNeighbours(const Step& step, Claim& claim) const;
  void measureHits(std::size_t hits, const StepStats& stats);

  /// One and a half times what a hit took after the pairs, in the last steps that had many.
  std::chrono::nanoseconds per_hit_{400};
  Deadline::Clock::time_point hits_done_;      // when the last part's pairs ended
  Deadline::Clock::duration patches_took_{0};  // in the last step
  std::vector<std::uint8_t> bounded_;          // per body: it needs bounds, whatever is near
  std::vector<std::uint8_t> unsure_;           // per body: PairWorker::markUnsure(), in any part of the step
  Looked looked_;                              // of the part
};

}  // namespace dccd
