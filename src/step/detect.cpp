// The flow of a step: what is prepared (history.cpp); then of each straight part records, bounds, pairs, map and start
// state; then what of it is said.
#include "dccd/detect.h"

#include <algorithm>
#include <atomic>
#include <sstream>

#include "base/accuracy.h"
#include "dccd/tolerances.h"
#include "step/clearance/clearance_finder.h"
#include "step/conclude.h"
#include "step/history.h"
#include "step/parts.h"
#include "step/start/start.h"

namespace dccd {
namespace {

using Clock = Deadline::Clock;

constexpr double MOST_NS_PER_HIT = 2000;         // more is what the operating system took
constexpr std::size_t FEWEST_TO_MEASURE = 1000;  // hits of a step that tell what one takes
constexpr std::size_t PIECE = 256;               // groups or vertices that are refitted between two looks at the clock
constexpr std::size_t FEWEST_PIECES = 8;         // done without a look, so that any budget bounds a small mesh

/// Erases what cannot be the first contact: it begins after another one has certainly happened. How wide a bracket is
/// says nothing: the first contact may begin in a wide one, and a later one in a narrow bracket.
/// cells: the brackets are cells that do not overlap, and where one ends, the next begins (the last, [1, 1], as well).
void keepFirst(bool cells, std::vector<Contact>& contacts) {
  double lower = 2, upper = 2;
  for (const Contact& c : contacts) {
    if (c.certainty != Certainty::CERTAIN) continue;
    lower = std::min(lower, c.toc_lower);
    upper = std::min(upper, c.toc_upper);
  }
  const auto late = [&](const Contact& c) {
    const bool next_cell = cells && c.certainty == Certainty::CERTAIN && c.toc_lower == upper && c.toc_lower > lower;
    return c.toc_lower > upper || next_cell;
  };
  contacts.erase(std::remove_if(contacts.begin(), contacts.end(), late), contacts.end());
}

/// How often the step is to be cut for a map that moves and bodies that turn or have waypoints, and how many these are.
std::size_t countParts(const Step& step, const Options& options, const SceneArrays& scene, StepStats& stats) {
  const auto turning = std::count_if(step.bodies.begin(), step.bodies.end(),
                                     [](const Body& body) { return body.turns || !body.waypoints.empty(); });
  if (turning == 0 && step.map.way.empty()) return 1;
  const Clock::time_point start = Clock::now();
  const std::size_t needed = neededParts(step, options.rigid_tolerance_m, scene.bodies());
  stats[Effect::RIGID_BODIES] = {static_cast<std::uint64_t>(turning), 0, msSince(start)};
  return needed;
}

}  // namespace

Outcome detect(const Step& step, const Options& options, History& history, Deadline deadline) {
  const ScopedFloatMode mode;  // of all that follows on this thread; turning bodies are cut into parts with it, too
  return History::Impl::of(history).run(step, options, deadline);
}

Outcome History::Impl::run(const Step& step, const Options& wanted, Deadline deadline) {
  // Whatever throws from here on leaves nothing behind that could be taken for known.
  struct Guard {
    Impl& history;
    bool done = false;
    ~Guard() {
      if (!done) history.forgetPrepared();
    }
  } guard{*this};
  const Clock::time_point called = Clock::now();
  prepare(step, wanted);
  const Options& options = *prepared.options;
  // What is made once for many steps is not taken from the time of the first.
  const Clock::time_point begun = Clock::now();
  deadline = deadline.movedBy(begun - called);
  if (options.patches && !deadline.isNever()) {
    // Patches come after all else and are not cut: what they took last time is kept for them, up to a share.
    const auto share = std::chrono::duration_cast<Clock::duration>(tolerance::PATCHES_SHARE * (deadline.at() - begun));
    deadline =
        deadline.movedBy(-std::clamp(patches_took_, Clock::duration::zero(), std::max(share, Clock::duration::zero())));
  }
  const bool continues = carried.isContinuedBy(step);
  if (!continues) carried.clear();
  Outcome outcome;
  outcome.claim.ask(step.bodies.size());
  unsure_.assign(step.bodies.size(), 0);
  const std::size_t needed = countParts(step, options, scene, outcome.stats);
  const std::size_t parts = partsAllowed(needed, options.max_substeps);
  outcome.start_ns = step.start_ns;
  outcome.stamp_ns = step.stamp_ns;
  outcome.sequence = step.sequence;
  outcome.substeps = parts;
  outcome.excluded_voxels = prepared.map.excluded_voxels;
  if (!runParts(step, continues, parts, deadline, outcome)) carried.clear();
  if (options.clearance.wanted) clearance->finish(parts, outcome);
  outcome.step = std::make_shared<const Step>(step);
  outcome.obstacle = prepared.map.surface;
  outcome.measured = prepared.map.measured;
  const std::size_t hits = outcome.contacts.size();
  prepared.expected.mark(outcome);
  if (options.patches) findPatches(outcome);
  answerNeighbours(step, outcome.claim);
  conclude(options, step, needed, outcome);
  outcome.stats.total_ms = msSince(begun);
  if (parts == 1 && hits >= FEWEST_TO_MEASURE) measureHits(hits, outcome.stats);
  guard.done = true;
  return outcome;
}

void History::Impl::measureHits(std::size_t hits, const StepStats& stats) {
  const double others_ms = stats[Stage::OBSTACLE].ms + stats[Stage::START_STATE].ms + stats[Effect::CLEARANCE].ms;
  const double after_ms = std::max(0.0, msSince(hits_done_) - others_ms);
  const double measured_ns = std::min(MOST_NS_PER_HIT, 1.5e6 * after_ms / static_cast<double>(hits));
  per_hit_ = std::max(per_hit_ * 7 / 8, std::chrono::nanoseconds(static_cast<std::int64_t>(measured_ns)));
}

void History::Impl::answerNeighbours(const Step& step, Claim& claim) const {
  for (std::size_t b = 0; b < unsure_.size(); ++b) {
    std::string why_not;
    if (unsure_[b]) {
      const Body& body = step.bodies[b];
      std::ostringstream text;
      text << "body '" << body.name << "': some of its own features are as close as its uncertainty (radii of up to "
           << *std::max_element(body.radius_m->begin(), body.radius_m->end())
           << " m) reaches, and so they are in its reference frame; whether they touch is not known";
      why_not = text.str();
    }
    claim.answer(Question::NEIGHBOURS, why_not, b);
  }
}

void History::Impl::findPatches(Outcome& outcome) {
  const Clock::time_point start = Clock::now();
  patches.run(prepared.threads, outcome);
  StageStats& stats = outcome.stats[Effect::PATCHES];
  patches_took_ = Clock::now() - start;
  stats = {patches.touchCount(), outcome.patches.size(), msSince(start)};
}

/// How far apart things are in a part, after its contacts: of a budget too small for both these come first.
void History::Impl::findClearance(const Part& part, Findings& result) {
  const Clock::time_point start = Clock::now();
  clearance->addPart(
      {part.step, part.index, part.count, part.scene, prepared.map.measured, result, part.shareFrom(start)});
  result.stats[Effect::CLEARANCE].ms = msSince(start);
}

/// False: the step was cut before its end.
bool History::Impl::runParts(const Step& step, bool continues, std::size_t parts, Deadline deadline, Outcome& outcome) {
  bool reached_end = true;
  if (parts == 1) {
    runPart(step, 0, 1, continues, deadline, outcome);
  } else {
    Step part = step;
    for (Body& body : part.bodies) body.t1 = body.t0;
    for (std::size_t i = 0; i < parts; ++i) {
      if (i > 0 && (outcome.cut || deadline.isOver())) {
        // Of the rest all that is known is that it has not begun yet.
        leaveOut(scaleDown(0, i, parts), false, outcome);
        reached_end = false;
        break;
      }
      const Clock::time_point start = Clock::now();
      advance(step, i + 1, parts, part);
      const double place_ms = msSince(start);
      outcome.stats[Effect::RIGID_BODIES].ms += place_ms;
      outcome.stats[Effect::RIGID_BODIES].out += outcome.stats[Effect::RIGID_BODIES].in;
      runPart(part, i, parts, i > 0 || continues, deadline, outcome);
    }
    joinParts(outcome.contacts);
    if (prepared.options->earliest_only) keepFirst(false, outcome.contacts);
  }
  // Where a step was cut, nobody looked at its end.
  if (reached_end) {
    carried.end.clear();
    for (const Body& body : step.bodies) carried.end.push_back(body.t1);
  }
  return reached_end;
}

/// One part, from records to contacts; what it says goes into the outcome.
void History::Impl::runPart(const Step& step, std::size_t index, std::size_t count, bool continues, Deadline deadline,
                            Outcome& outcome) {
  const Options& options = *prepared.options;
  std::size_t found_limit = foundLimit(options, scene.bodies());
  if (found_limit != FoundLimit::NONE) found_limit -= std::min(found_limit, outcome.contacts.size());
  const Part part{step, index, count, continues, deadline, Clock::now(), prepared, scene, found_limit, per_hit_};
  Findings result;
  pairs.begin();
  looked_.begin();
  if (!fill(part, result.stats)) {
    // There was no time for its bounds: of the part nothing is known, and of its end neither.
    scene.forgetBounds();
    carried.clear();
    leaveOut(0, false, result);
    result.start_state_complete = !part.checksStartState();
    addPart(index, count, looked_.gaps(step.bodies, false, false), result, outcome);
    return;
  }
  pairs.run(part, self_tests, scene, looked_, result);
  hits_done_ = Clock::now();
  pairs.collect(part, result);
  if (!result.cut) {  // what was looked at beyond the limit depends on the threads, and nothing is proved
    for (const PairWorker& worker : pairs.workers()) worker.markUnsure(unsure_);
  }
  const bool all_pairs = result.complete && looked_.gaps(step.bodies, false, false).empty();
  const bool has_map = prepared.map.surface != nullptr;
  const bool map_is_whole = !has_map || !scene.mayMeetMap() || map_search.run(part, carried.map, looked_, result);
  // With earliest_only the contacts after the first are unknown; if there is none, there is no later one either.
  const bool all_known = all_pairs && (!options.earliest_only || result.contacts.empty());
  carried.rememberApart(scene, result.contacts, all_known);
  if (options.earliest_only) keepFirst(options.accuracy.rung == Accuracy::EXACT, result.contacts);
  findStartState(part, all_known, map_is_whole, self_tests.unfolded(), carried, looked_, result);
  if (options.clearance.wanted) findClearance(part, result);
  addPart(index, count, looked_.gaps(step.bodies, has_map, part.checksStartState() && index == 0), result, outcome);
}

/// The part's positions into the scene's arrays, and what of it needs bounds. False: there was no time for these.
bool History::Impl::fill(const Part& part, StepStats& stats) {
  Clock::time_point start = Clock::now();
  const bool in_metres =
      part.options().clearance.wanted || holdsDistance(part.options().accuracy.rung) || prepared.map.surface;
  scene.record(part.step, stats, prepared.threads, !part.options().clearance.wanted, !in_metres);
  for (std::size_t b = 0; b < carried.map.size(); ++b) {
    if (!scene.bodies()[b].unchanged) carried.map[b] = MapAnswer();
  }
  if (scene.uncertain()) checkHoldsDistance(part.options(), "an uncertainty radius");
  stats[Stage::RECORD] = {scene.vertexCount(), scene.vertexCount(), msSince(start)};
  start = Clock::now();
  self_tests.choose(part, carried.apart, looked_, stats);
  stats[Stage::BROAD_PHASE].ms += msSince(start);
  start = Clock::now();
  std::atomic<std::size_t> done{0};
  std::atomic<bool> late{false};
  const auto inPieces = [&](std::size_t n, const auto& refit) {
    prepared.threads(n, PIECE, [&](std::size_t first, std::size_t last) {
      for (; first < last; first += PIECE) {
        if (++done > FEWEST_PIECES && (late || (late = part.deadline.isOver()))) return;
        refit(first, std::min(first + PIECE, last));
      }
    });
  };
  bounded_ = self_tests.tested();
  if (searchesStart(part, carried)) {
    for (std::size_t b = 0; b < bounded_.size(); ++b) bounded_[b] = bounded_[b] || meetsItself(scene.bodies()[b].setup);
  }
  // A single body that does not meet itself is tested against the map alone, which has bounds of its own.
  const bool any = std::find(bounded_.begin(), bounded_.end(), 1) != bounded_.end();
  std::vector<std::uint8_t> leaves_wait;
  for (const Unfolded& surface : self_tests.unfolded()) leaves_wait.push_back(surface.isCertified());
  if (any || bounded_.size() > 1) scene.refit(inPieces, stats, bounded_, leaves_wait);
  stats[Stage::BOUNDS].ms = msSince(start);
  return !late;
}

}  // namespace dccd
