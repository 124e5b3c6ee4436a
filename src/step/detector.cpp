#include "dccd/detector.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "step/detector_impl.h"
#include "step/map_frame.h"

namespace dccd {
namespace {

constexpr std::size_t CONTACT_PIECE = 16384;  // contacts in a unit of writing them out
constexpr std::size_t PIECE = 256;            // groups or vertices x 16 in a unit of refitting

std::uint64_t pairsIn(const ObstacleStats& stats) {
  return stats.vertex_pairs_in + stats.edge_pairs_in + stats.corner_pairs_in;
}

void check(const DetectorOptions& o) {
  const auto refuse = [](const std::string& text) { throw std::invalid_argument(text); };
  if (o.num_threads < 1 || o.num_threads > 1024) {
    refuse("num_threads = " + std::to_string(o.num_threads) + " is out of range; 1 to 1024");
  }
  if (!(o.step_budget_ms >= 0 && o.step_budget_ms <= 1e9)) {
    refuse("step_budget_ms = " + std::to_string(o.step_budget_ms) + " is out of range; 0 (none) to 1e9");
  }
}

/// Erases what cannot be the first contact: it begins after another one has certainly happened. How wide a bracket is
/// says nothing: `conservative` may find the first contact at once, in [0, 1], and a later one in a narrow bracket.
/// cells: the brackets are cells that do not overlap, and where one ends, the next begins (the last, [1, 1], as well).
void keepEarliest(bool cells, std::vector<Contact>& contacts) {
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

}  // namespace

const char* toString(Stage stage) {
  static const char* const NAMES[] = {"record",     "bounds",   "broad_phase", "planar",
                                      "elementary", "obstacle", "start_state", "sort"};
  return NAMES[static_cast<std::size_t>(stage)];
}
const char* toString(Effect effect) {
  static const char* const NAMES[] = {"self_collision",     "body_body",     "obstacle",
                                      "start_state",        "rigid_bodies",  "unknown_space",
                                      "minimum_separation", "tracker_noise", "look_ahead"};
  return NAMES[static_cast<std::size_t>(effect)];
}
const char* toString(StartState state) {
  static const char* const NAMES[] = {"CLEAR", "INTERSECTING", "NOT_CHECKED"};
  return NAMES[static_cast<std::size_t>(state)];
}

double StepResult::earliestToc() const {
  double earliest = unchecked_toc_lower;
  for (const Contact& c : contacts) earliest = std::min(earliest, c.toc_lower);
  return earliest;
}

void Detector::Impl::setOptions(const DetectorOptions& o) {
  check(o);
  std::unique_ptr<Rung> test;
  if (o.accuracy.rung != Accuracy::SCREEN) test = makeRung(o.accuracy);
  checkSeparation(o, scene.largestSeparation());
  if (!arena || o.num_threads != options.num_threads) arena.emplace(o.num_threads);
  elementary = std::move(test);
  scene.setKeepBounds(o.keep_bounds);
  options = o;
  obstacle_tests.clear();
}

void Detector::Impl::checkHoldsDistance(const DetectorOptions& o, const std::string& what) {
  if (o.accuracy.rung == Accuracy::CONSERVATIVE || o.accuracy.rung == Accuracy::SCREEN) return;
  throw std::invalid_argument(std::string("accuracy = ") + toString(o.accuracy.rung) + " with " + what +
                              "; a distance above 0 needs accuracy = conservative");
}

void Detector::Impl::checkSeparation(const DetectorOptions& o, double separation_m) {
  if (separation_m > 0) checkHoldsDistance(o, "minimum_separation_m = " + std::to_string(separation_m));
}

const StepResult& Detector::Impl::run(const MotionStep& step) {
  const ScopedFloatMode mode;
  const Clock::time_point begin = Clock::now();
  result.intersections.clear();
  result.start_state = StartState::NOT_CHECKED;
  result.start_state_complete = true;
  result.complete = true;
  result.unchecked_toc_lower = std::numeric_limits<double>::infinity();
  result.stats = StepStats();
  StepStats& stats = result.stats;
  if (!finished) {  // the last step threw, or there was none: what it should have left behind is not there
    start_state.skip();
    apart.clear();
  }
  finished = false;

  Clock::time_point start = Clock::now();
  scene.record(step, stats);
  if (scene.uncertain()) checkHoldsDistance(options, "an uncertainty radius");
  stats[Stage::RECORD] = {scene.vertexCount(), scene.vertexCount(), msSince(start)};

  start = Clock::now();
  chooseSelfTests(step);
  stats[Stage::BROAD_PHASE].ms += msSince(start);

  start = Clock::now();
  if (needsTrees(step)) scene.refit([&](std::size_t n, const auto& f) { parallel(n, PIECE, f); }, stats);
  stats[Stage::BOUNDS].ms = msSince(start);

  StepContext context;
  context.scene = &scene;
  context.elementary = elementary.get();
  context.earliest_only = options.earliest_only;
  context.left_out = &left_out;
  stats.left_out_listed = left_out_list.size();
  if (options.accuracy.rung == Accuracy::CONSERVATIVE) context.tolerance_m = options.accuracy.tolerance_m;
  if (options.step_budget_ms > 0) {
    const double left_ms = std::max(0.0, options.step_budget_ms - step.spent_ms);
    context.deadline =
        begin + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double, std::milli>(left_ms));
  }
  for (PairWorker& w : workers) w.beginStep();
  findPairs(context);
  runPairs(context);
  collect();
  const bool all_pairs = result.complete;
  if (checksStartState(step)) result.start_state = StartState::CLEAR;  // until shown otherwise
  if (step.obstacle && scene.meetsObstacle()) runObstacle(step, context);
  rememberApart(all_pairs && !options.earliest_only && options.accuracy.rung != Accuracy::FAST);
  if (options.earliest_only) keepEarliest(options.accuracy.rung == Accuracy::EXACT, result.contacts);
  runStartState(step, begin, all_pairs,
                context);  // after the contacts: of a budget too small for both they are asked for first
  stats.total_ms = msSince(begin);
  finished = true;
  return result;
}

void Detector::Impl::writeContact(PairKind kind, const Hit& hit, Contact& c) const {
  c = Contact();
  c.kind = kind;
  c.toc_lower = hit.toc_lower;
  c.toc_upper = hit.toc_upper;
  c.certainty = hit.certainty;
  c.body = {static_cast<std::uint16_t>(hit.bodies >> 16), static_cast<std::uint16_t>(hit.bodies)};
  const int first_size = kind == PairKind::VERTEX_FACE ? 1 : 2;
  scene.featureVertices(firstKind(kind), c.body[0], static_cast<Index>(hit.key >> 32), c.vertex.data());
  scene.featureVertices(secondKind(kind), c.body[1], static_cast<Index>(hit.key), c.vertex.data() + first_size);
}

void Detector::Impl::collect() {
  const Clock::time_point start = Clock::now();
  StepStats& stats = result.stats;
  std::vector<const std::vector<Hit>*> parts;
  for (const PairWorker& w : workers) {
    for (std::size_t s = 0; s < stats.stages.size(); ++s) stats.stages[s] += w.stats().stages[s];
    for (std::size_t e = 0; e < stats.effects.size(); ++e) stats.effects[e] += w.stats().effects[e];
    stats.tiers += w.stats().tiers;
    stats.undecided += w.stats().undecided;
    stats.left_out_met += w.stats().left_out_met;
    stats.vf_candidates += w.stats().vf_candidates;
    stats.ee_candidates += w.stats().ee_candidates;
    result.unchecked_toc_lower = std::min(result.unchecked_toc_lower, w.uncheckedTocLower());
  }
  std::size_t base = 0;
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    parts.clear();
    for (const PairWorker& w : workers) parts.push_back(&w.hits(kind));
    const std::vector<const Hit*>& sorted = order.sort(parts);
    result.contacts.resize(base + sorted.size());
    parallel(sorted.size(), CONTACT_PIECE, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        // Sorted by key, the hits lie anywhere in memory: the next ones are fetched while this one is written.
        if (i + 8 < last) __builtin_prefetch(sorted[i + 8]);
        writeContact(kind, *sorted[i], result.contacts[base + i]);
      }
    });
    base += sorted.size();
  }
  stats[Stage::SORT] = {result.contacts.size(), result.contacts.size(), msSince(start)};
}

void Detector::Impl::runObstacle(const MotionStep& step, const StepContext& context) {
  const Clock::time_point start = Clock::now();
  const std::size_t n = scene.bodies().size();
  obstacle_tests.resize(n);
  ObstacleStats total;
  const std::size_t before = result.contacts.size();
  for (std::size_t b = 0; b < n; ++b) {
    const SceneBody& body = scene.bodies()[b];
    if (!body.setup.against_obstacle) continue;
    if (!obstacle_tests[b]) {
      ObstacleOptions o;
      o.accuracy = options.accuracy;
      o.minimum_separation_m = scene.separation(b, OBSTACLE_BODY);
      obstacle_tests[b] = std::make_unique<ObstacleCheck>(o);
    }
    const std::uint8_t* active = nullptr;
    if (body.masked) {
      obstacle_active.assign(body.setup.topology->vertexCount(), 0);
      for (std::size_t i = 0; i < body.usedCount(); ++i) obstacle_active[body.slot_vertex[i]] = body.active[i];
      active = obstacle_active.data();
    }
    const Clock::time_point body_start = Clock::now();
    const std::uint64_t in_before = pairsIn(total), out_before = result.contacts.size();
    const Positions& t0 = inMapFrame(step.map_from_fixed, *step.bodies[b].t0, map_t0);
    const Positions& t1 = inMapFrame(step.map_from_fixed, *step.bodies[b].t1, map_t1);
    const bool whole =
        obstacle_tests[b]->run(*step.obstacle, *body.setup.topology, t0, t1, active, static_cast<std::uint16_t>(b),
                               result.contacts, total, body.uncertain ? step.bodies[b].radius_m->data() : nullptr,
                               context.deadline == Clock::time_point::max() ? nullptr : &context.deadline);
    if (!whole) {
      result.complete = false;
      result.unchecked_toc_lower = 0;
      result.start_state_complete = false;
      if (result.start_state == StartState::CLEAR) result.start_state = StartState::NOT_CHECKED;
    }
    const StageStats of_body{pairsIn(total) - in_before, result.contacts.size() - out_before, msSince(body_start)};
    if (scene.separation(b, OBSTACLE_BODY) > 0) result.stats[Effect::MINIMUM_SEPARATION] += of_body;
    if (body.uncertain) result.stats[Effect::TRACKER_NOISE] += of_body;
  }
  // Each body's are in order; of several bodies, kinds come first.
  const auto first = result.contacts.begin() + static_cast<std::ptrdiff_t>(before);
  if (!std::is_sorted(first, result.contacts.end(), canonicalLess))
    std::sort(first, result.contacts.end(), canonicalLess);
  result.stats[Stage::OBSTACLE] = {pairsIn(total), result.contacts.size() - before, msSince(start)};
  result.stats[Effect::OBSTACLE] = result.stats[Stage::OBSTACLE];
  for (std::size_t i = before; i < result.contacts.size(); ++i) {
    const Contact& c = result.contacts[i];
    result.stats.initial += c.initial;
    result.stats.leaving += c.leaving;
    result.stats.undecided += c.certainty == Certainty::UNDECIDED;
    if (c.initial && checksStartState(step)) {
      result.start_state = StartState::INTERSECTING;
      if (c.kind == PairKind::VERTEX_VOXEL_FACE) {
        StartIntersection s;
        s.body = {c.body[0], OBSTACLE_BODY};
        s.vertex[0] = c.vertex[0];
        result.intersections.push_back(s);
      }
    }
  }
}

void Detector::Impl::runStartState(const MotionStep& step, Clock::time_point begin, bool all_pairs,
                                   const StepContext& context) {
  if (!checksStartState(step)) return start_state.skip();
  const Clock::time_point start = Clock::now();
  StepStats& stats = result.stats;
  StartStateSearch::IsOver is_over;
  if (context.deadline != Clock::time_point::max()) {
    // Later parts need as much time for their pairs; what is over that is shared.
    const auto parts = static_cast<Clock::rep>(step.parts_after);
    const Clock::duration slack = context.deadline - start - parts * (start - begin);
    is_over = [deadline = start + slack / (parts + 1)] { return Clock::now() >= deadline; };
  }
  std::vector<StartIntersection> met;
  bool whole = false;
  const bool known = isStartKnown(step);
  if (known) {
    Impl& predecessor = *step.predecessor->impl_;
    whole = predecessor.start_state.listEnd(predecessor.scene, is_over, met);
  } else {
    met = start_state.run(scene, step.continues, is_over, stats);
    whole = start_state.isWhole();
  }
  result.start_state_complete = result.start_state_complete && whole;
  if (!met.empty()) {
    result.start_state = StartState::INTERSECTING;
  } else if (!result.start_state_complete && result.start_state == StartState::CLEAR) {
    result.start_state = StartState::NOT_CHECKED;
  }
  result.intersections.insert(result.intersections.begin(), met.begin(), met.end());
  if (known) {
    start_state.skip();
  } else {
    // With earliest_only the later contacts are unknown, and `fast` may miss some, so nothing may be concluded about
    // the end of the step.
    const bool complete =
        all_pairs && !options.earliest_only && stats.unchecked_vertices == 0 && options.accuracy.rung != Accuracy::FAST;
    start_state.remember(scene, result.contacts, complete);
  }
  stats[Stage::START_STATE].ms += msSince(start);
  stats[Effect::START_STATE].ms = stats[Stage::START_STATE].ms;
}

bool Detector::Impl::checksStartState(const MotionStep& step) const {
  return options.check_start_state && step.start_state_wanted;
}

bool Detector::Impl::isStartKnown(const MotionStep& step) {
  if (!step.predecessor) return false;
  const Impl& predecessor = *step.predecessor->impl_;
  return predecessor.finished && predecessor.start_state.knowsEnd();
}

Detector::Detector(const DetectorOptions& options) : impl_(std::make_unique<Impl>(options)) {}
Detector::~Detector() = default;
const DetectorOptions& Detector::options() const { return impl_->options; }
void Detector::setOptions(const DetectorOptions& options) { impl_->setOptions(options); }

void Detector::setBodies(std::vector<BodySetup> bodies, const std::vector<const Positions*>& rest_positions) {
  double separation = 0;
  for (const BodySetup& b : bodies) {
    separation = std::max(separation, b.minimum_separation_m);
    for (const SeparationFrom& from : b.separations) separation = std::max(separation, from.separation_m);
  }
  Impl::checkSeparation(impl_->options, separation);
  impl_->finished = false;
  impl_->start_state.forget();
  impl_->scene.setBodies(std::move(bodies), rest_positions);
  impl_->unfolded.clear();
  for (const SceneBody& body : impl_->scene.bodies()) impl_->unfolded.emplace_back(body);
  impl_->apart.clear();
  impl_->obstacle_tests.clear();
  impl_->findLeftOut(rest_positions);
}

const std::vector<LeftOutPair>& Detector::leftOut() const { return impl_->left_out_list; }

const StepResult& Detector::run(const MotionStep& step) { return impl_->run(step); }

}  // namespace dccd
