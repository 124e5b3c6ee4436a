// The flow of a step: options, bodies and map; then of each straight part records, bounds, pairs, map and start state;
// then what of it is said.
#include "dccd/detect.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <type_traits>

#include "dccd/accuracy.h"
#include "dccd/tolerances.h"
#include "obstacle/excluded_leaves.h"
#include "step/clearance/clearance_finder.h"
#include "step/conclude.h"
#include "step/history.h"
#include "step/parts.h"

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

bool sameBits(const std::shared_ptr<const Positions>& a, const std::shared_ptr<const Positions>& b) {
  return a == b || (a && b && a->size() == b->size() &&
                    (a->empty() || std::memcmp(a->data(), b->data(), a->size() * sizeof(Vec3)) == 0));
}

}  // namespace

Outcome detect(const Step& step, const Options& options, History& history, Deadline deadline) {
  const ScopedFloatMode mode;  // of all that follows on this thread; turning bodies are cut into parts with it, too
  return history.impl().run(step, options, deadline);
}

History::History() : impl_(std::make_unique<Impl>()) {}
History::~History() = default;
History::History(History&& other) noexcept = default;
History& History::operator=(History&& other) noexcept = default;
void History::clear() {
  impl_->carried.clear();
  impl_->begins_at = nullptr;
}
void History::beginAt(History& other) { impl_->begins_at = other.impl_.get(); }
bool History::isClear() const { return impl_->carried.isClear() && !impl_->begins_at; }
const std::vector<LeftOutPair>& History::leftOut() const { return impl_->left_out_list; }

void Carried::clear() {
  end.clear();
  apart.clear();
  start_state.clear();
  inside.clear();
  map = std::vector<MapAnswer>();
}

bool Carried::isContinuedBy(const Step& step) const {
  if (end.empty() || end.size() != step.bodies.size()) return false;
  for (std::size_t b = 0; b < end.size(); ++b) {
    if (!sameBits(end[b], step.bodies[b].t0)) return false;
  }
  return true;
}

void History::Impl::forgetMade() noexcept {
  carried.clear();
  options.reset();  // so that all that follows from them is made, too
  forgetMap();
  expected_known = false;
  scene.forgetBounds();
  static_assert(std::is_nothrow_default_constructible_v<PatchMaker> && std::is_nothrow_move_assignable_v<PatchMaker>);
  patches = PatchMaker();
}

void History::Impl::forgetMap() noexcept {
  map_given = map_reduced = nullptr;
  excluded_voxels = 0;
}

Outcome History::Impl::run(const Step& step, const Options& wanted, Deadline deadline) {
  // Whatever throws from here on leaves nothing behind that could be taken for known.
  struct Guard {
    Impl& history;
    bool done = false;
    ~Guard() {
      if (!done) history.forgetMade();
      history.begins_at = nullptr;
    }
  } guard{*this};
  aside = begins_at != nullptr;
  const Clock::time_point called = Clock::now();
  setOptions(wanted);
  setBodies(step);
  if (!expected_known) expected.set(options->expected, step.bodies);
  expected_known = true;
  useMap(step.map);
  if (options->clearance.wanted) {
    if (!clearance) clearance = std::make_unique<ClearanceFinder>();
    clearance->begin(step, scene, *options);
  }
  // What is made once for many steps is not taken from the time of the first.
  const Clock::time_point begun = Clock::now();
  deadline = deadline.movedBy(begun - called);
  if (options->patches && !deadline.isNever()) {
    // Patches come after all else and are not cut: what they took last time is kept for them, up to a share.
    const auto share = std::chrono::duration_cast<Clock::duration>(tolerance::PATCHES_SHARE * (deadline.at() - begun));
    deadline =
        deadline.movedBy(-std::clamp(patches_took, Clock::duration::zero(), std::max(share, Clock::duration::zero())));
  }
  const bool continues = carried.isContinuedBy(step);
  if (!continues) carried.clear();
  Outcome outcome;
  const std::size_t needed = neededParts(step, outcome.stats);
  const std::size_t parts = std::min(needed, options->max_substeps);
  outcome.start_ns = step.start_ns;
  outcome.stamp_ns = step.stamp_ns;
  outcome.sequence = step.sequence;
  outcome.substeps = parts;
  outcome.excluded_voxels = excluded_voxels;
  if (!runParts(step, continues, parts, deadline, outcome)) carried.clear();
  if (options->clearance.wanted) clearance->finish(parts, outcome);
  outcome.step = std::make_shared<const Step>(step);
  outcome.obstacle = map_reduced;
  const std::size_t hits = outcome.contacts.size();
  expected.mark(outcome);
  if (options->patches) findPatches(outcome);
  sayLeftOutForNoise(step, outcome.unproved);
  conclude(*options, step, needed, outcome);
  if (options->patches) patches.list(outcome);
  outcome.stats.total_ms = msSince(begun);
  if (parts == 1 && hits >= FEWEST_TO_MEASURE) {
    const double others_ms =
        outcome.stats[Stage::OBSTACLE].ms + outcome.stats[Stage::START_STATE].ms + outcome.stats[Effect::CLEARANCE].ms;
    const double after_ms = std::max(0.0, msSince(hits_done) - others_ms);
    const double measured_ns = std::min(MOST_NS_PER_HIT, 1.5e6 * after_ms / static_cast<double>(hits));
    per_hit = std::max(per_hit * 7 / 8, std::chrono::nanoseconds(static_cast<std::int64_t>(measured_ns)));
  }
  guard.done = true;
  return outcome;
}

void History::Impl::findPatches(Outcome& outcome) {
  const Clock::time_point start = Clock::now();
  patches.run([&](std::size_t n, std::size_t piece, const auto& f) { parallel(n, piece, f); }, outcome);
  StageStats& stats = outcome.stats[Effect::PATCHES];
  patches_took = Clock::now() - start;
  stats = {patches.touches().size(), outcome.patches.size(), msSince(start)};
}

/// How far apart things are in a part, after its contacts: of a budget too small for both these come first.
void History::Impl::findClearance(const Part& part, Clock::time_point begin) {
  const Clock::time_point start = Clock::now();
  Deadline deadline = part.deadline;
  if (!deadline.isNever()) {
    // Later parts need as much time for their contacts; what is over that is shared.
    const auto later = static_cast<Clock::rep>(part.count - part.index - 1);
    deadline = deadline.movedTo(start + (deadline.at() - start - later * (start - begin)) / (later + 1));
  }
  clearance->addPart({part.step, part.index, part.count, scene, map_reduced, result, deadline});
  result.stats[Effect::CLEARANCE].ms = msSince(start);
}

void History::Impl::setOptions(const Options& wanted) {
  if (options && *options == wanted) return;
  check(wanted);
  std::unique_ptr<Rung> rung = makeRung(wanted.accuracy);
  if (!arena || !options || wanted.num_threads != options->num_threads) arena.emplace(wanted.num_threads);
  elementary = std::move(rung);
  scene.setKeepBounds(wanted.keep_bounds);
  obstacle_checks.clear();
  carried.map.clear();
  expected_known = false;
  forgetMap();  // other boxes may be excluded
  options = wanted;
}

void History::Impl::setBodies(const Step& step) {
  check(*options, step.bodies);
  if (bodies_made && scene.holds(step.bodies)) return;
  bodies_made = false;
  if (clearance) clearance->forgetBodies();
  carried.clear();
  carried.start_state.forgetBodies();
  carried.inside.forgetBodies();
  scene.setBodies(step.bodies);
  unfolded.clear();
  for (const SceneBody& body : scene.bodies()) unfolded.emplace_back(body);
  obstacle_checks.clear();
  expected_known = false;
  findLeftOut(step);
  bodies_made = true;
}

void History::Impl::useMap(const ObstacleMap& map) {
  const bool same_pose = map_pose.matrix() == map.map_from_fixed.matrix();
  if (map_given == map.surface && (same_pose || options->exclude_boxes.empty())) return;
  forgetMap();
  std::shared_ptr<const VoxelSurface> reduced = map.surface;
  if (map.surface && !options->exclude_boxes.empty()) {
    RemainingLeaves remaining = leavesOutside(map.surface->leaves(), map.surface->resolution(),
                                              map.map_from_fixed.inverse(), options->exclude_boxes);
    if (remaining.excluded_voxels > 0) {
      reduced = VoxelSurface::build(map.surface->resolution(), std::move(remaining.leaves));
    }
    excluded_voxels = remaining.excluded_voxels;
  }
  map_reduced = std::move(reduced);
  map_given = map.surface;
  map_pose = map.map_from_fixed;
}

/// How often the step is to be cut for the bodies that turn, and how many these are.
std::size_t History::Impl::neededParts(const Step& step, StepStats& stats) const {
  const auto turning =
      std::count_if(step.bodies.begin(), step.bodies.end(), [](const Body& body) { return body.turns; });
  if (turning == 0) return 1;
  const Clock::time_point start = Clock::now();
  const std::size_t needed = dccd::neededParts(step, options->rigid_tolerance_m, scene.bodies());
  stats[Effect::RIGID_BODIES] = {static_cast<std::uint64_t>(turning), 0, msSince(start)};
  return needed;
}

bool History::Impl::runParts(const Step& step, bool continues, std::size_t parts, Deadline deadline, Outcome& outcome) {
  bool reached_end = true;
  if (parts == 1) {
    runPart({step, 0, 1, continues, deadline}, outcome);
  } else {
    Step part = step;
    for (Body& body : part.bodies) body.t1 = body.t0;
    for (std::size_t i = 0; reached_end && i < parts; ++i) {
      if (i > 0 && (outcome.cut || deadline.isOver())) {
        // Of the rest all that is known is that it has not begun yet.
        leaveOut(scaleDown(0, i, parts), outcome);
        reached_end = false;
        break;
      }
      const Clock::time_point start = Clock::now();
      advance(step, i + 1, parts, part);
      const double place_ms = msSince(start);
      outcome.stats[Effect::RIGID_BODIES].ms += place_ms;
      outcome.stats[Effect::RIGID_BODIES].out += outcome.stats[Effect::RIGID_BODIES].in;
      runPart({part, i, parts, i > 0 || continues, deadline}, outcome);
    }
    joinParts(outcome.contacts);
  }
  // At the end of the last part that was done something else may be.
  if (reached_end) {
    carried.end.clear();
    for (const Body& body : step.bodies) carried.end.push_back(body.t1);
  }
  return reached_end;
}

/// One part, from records to contacts; what it says goes into the outcome.
void History::Impl::runPart(const Part& part, Outcome& outcome) {
  const Clock::time_point begin = Clock::now();
  for (PairWorker& w : workers) w.beginStep();
  for (HitOrder& kind : order) kind.beginStep();
  result = Findings();
  if (!fill(part)) {
    leaveOutPart(part);
    addPart(part.index, part.count, result, outcome);
    return;
  }
  found_limit = foundLimit();
  if (found_limit != FoundLimit::NONE) found_limit -= std::min(found_limit, outcome.contacts.size());
  StepContext context;
  context.scene = &scene;
  context.elementary = elementary.get();
  context.earliest_only = options->earliest_only;
  context.bounds_late = options->earliest_only && !stopsAtFirst();
  context.left_out = &left_out;
  context.unfolded = &unfolded;
  context.observer = observer;
  context.deadline = part.deadline;
  context.per_hit = per_hit;
  result.stats.left_out_listed = left_out_list.size();
  if (holdsDistance(options->accuracy.rung)) context.tolerance_m = options->accuracy.tolerance_m;
  if (stopsAtFirst()) {
    runUntilFirst(context);
  } else {
    findPairs(context, Share::ALL);
    runPairs(context);
  }
  hits_done = Clock::now();
  collect(part.step, part.deadline);
  const bool all_pairs = result.complete;
  if (checksStartState(part)) result.start_state = StartState::CLEAR;  // until shown otherwise
  if (map_reduced && scene.mayMeetMap()) runMap(part);
  // With earliest_only the contacts after the first are unknown; if there is none, there is no later one either.
  const bool all_known = all_pairs && (!options->earliest_only || result.contacts.empty());
  rememberApart(all_known);
  if (options->earliest_only) keepFirst(options->accuracy.rung == Accuracy::EXACT, result.contacts);
  runStartState(part, begin, all_known);  // after the contacts: of a budget too small for both they come first
  if (options->clearance.wanted) findClearance(part, begin);
  addPart(part.index, part.count, result, outcome);
}

/// There was no time for its bounds: of the part nothing is known, and of its end neither.
void History::Impl::leaveOutPart(const Part& part) {
  scene.forgetBounds();
  leaveOutAt(0, false);
  result.start_state_complete = !checksStartState(part);
  carried.clear();
}

/// The part's positions into the scene's arrays, and what of it needs bounds.
bool History::Impl::fill(const Part& part) {
  StepStats& stats = result.stats;
  Clock::time_point start = Clock::now();
  scene.record(
      part.step, stats, [&](std::size_t n, std::size_t piece, const auto& f) { parallel(n, piece, f); },
      !observer && !options->clearance.wanted);
  for (std::size_t b = 0; b < carried.map.size(); ++b) {
    if (!scene.bodies()[b].unchanged) carried.map[b] = MapAnswer();
  }
  if (observer) observer->onPart(part.index, scene);
  if (scene.uncertain()) checkHoldsDistance(*options, "an uncertainty radius");
  stats[Stage::RECORD] = {scene.vertexCount(), scene.vertexCount(), msSince(start)};
  start = Clock::now();
  chooseSelfTests(part);
  stats[Stage::BROAD_PHASE].ms += msSince(start);
  start = Clock::now();
  std::atomic<std::size_t> done{0};
  std::atomic<bool> late{false};
  const auto inPieces = [&](std::size_t n, const auto& refit) {
    parallel(n, PIECE, [&](std::size_t first, std::size_t last) {
      for (; first < last; first += PIECE) {
        if (++done > FEWEST_PIECES && (late || (late = part.deadline.isOver()))) return;
        refit(first, std::min(first + PIECE, last));
      }
    });
  };
  bounded = self_tested;
  if (searchesStart(part)) {
    for (std::size_t b = 0; b < bounded.size(); ++b) bounded[b] = bounded[b] || meetsItself(scene.bodies()[b].setup);
  }
  // A single body that does not meet itself is tested against the map alone, which has bounds of its own.
  const bool any = std::find(bounded.begin(), bounded.end(), 1) != bounded.end();
  std::vector<std::uint8_t> leaves_wait;
  for (const Unfolded& surface : unfolded) leaves_wait.push_back(surface.holdsMost());
  if (any || bounded.size() > 1) scene.refit(inPieces, stats, bounded, leaves_wait);
  stats[Stage::BOUNDS].ms = msSince(start);
  return !late;
}

}  // namespace dccd
