#include "deformable_ccd/detector.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "detector/float_mode.h"
#include "detector/hit_order.h"
#include "detector/pair_worker.h"
#include "detector/scene_arrays.h"
#include "detector/start_state.h"
#include "detector/unfolded.h"

namespace deformable_ccd {
namespace {

constexpr std::size_t TASK_SUPERCLUSTERS = 16;  // supercluster pairs in a unit of work: about a millisecond
constexpr std::size_t CONTACT_PIECE = 16384;    // contacts in a unit of writing them out
constexpr std::size_t PIECE = 256;              // groups or vertices x 16 in a unit of refitting

FeatureKind firstKind(PairKind k) { return k == PairKind::VERTEX_FACE ? FeatureKind::VERTEX : FeatureKind::EDGE; }
FeatureKind secondKind(PairKind k) { return k == PairKind::VERTEX_FACE ? FeatureKind::FACE : FeatureKind::EDGE; }

void check(const DetectorOptions& o) {
  const auto refuse = [](const std::string& text) { throw std::invalid_argument(text); };
  if (o.num_threads < 1 || o.num_threads > 1024) {
    refuse("num_threads = " + std::to_string(o.num_threads) + " is out of range; 1 to 1024");
  }
  if (!(o.step_budget_ms >= 0) || !std::isfinite(o.step_budget_ms)) {
    refuse("step_budget_ms = " + std::to_string(o.step_budget_ms) + " is out of range; 0 (none) or a positive time");
  }
}

}  // namespace

const char* toString(Stage stage) {
  static const char* const NAMES[] = {"record", "bounds", "broad_phase", "planar", "elementary", "obstacle", "start_state", "sort"};
  return NAMES[static_cast<std::size_t>(stage)];
}
const char* toString(Effect effect) {
  static const char* const NAMES[] = {"self_collision", "body_body", "obstacle", "start_state"};
  return NAMES[static_cast<std::size_t>(effect)];
}
const char* toString(StartState state) {
  static const char* const NAMES[] = {"CLEAR", "INTERSECTING", "NOT_CHECKED"};
  return NAMES[static_cast<std::size_t>(state)];
}

double StepResult::earliestToc() const {
  double earliest = unchecked_toc_lower;
  for (const core::Contact& c : contacts) earliest = std::min(earliest, c.toc_lower);
  return earliest;
}

struct Detector::Impl {
  explicit Impl(const DetectorOptions& o) { setOptions(o); }

  void setOptions(const DetectorOptions& o) {
    check(o);
    std::unique_ptr<ElementaryTest> test;
    if (o.accuracy.rung != Accuracy::SCREEN) test = makeElementaryTest(o.accuracy);
    checkSeparation(o, scene.largestSeparation());
    if (!arena || o.num_threads != options.num_threads) arena.emplace(o.num_threads);
    elementary = std::move(test);
    options = o;
    obstacle_tests.clear();
  }

  static void checkSeparation(const DetectorOptions& o, double separation) {
    if (separation > 0 && o.accuracy.rung != Accuracy::CONSERVATIVE && o.accuracy.rung != Accuracy::SCREEN) {
      throw std::invalid_argument(std::string("accuracy = ") + toString(o.accuracy.rung) + " with minimum_separation_m = " +
                                  std::to_string(separation) + "; a separation above 0 needs accuracy = conservative");
    }
  }

  const StepResult& run(const MotionStep& step);
  void findPairs(const StepContext& context);
  bool staysApart(std::size_t body) const;
  bool isUnfolded(std::size_t body);
  void chooseSelfTests(const MotionStep& step);
  bool needsTrees(const MotionStep& step) const;
  void rememberApart(bool certain);
  void addTasks(PairKind kind, std::uint16_t a, std::uint16_t b, const StepContext& context);
  void runPairs(StepContext& context);
  void runObstacle(const MotionStep& step);
  void collect();
  void writeContact(PairKind kind, const Hit& hit, core::Contact& contact) const;
  const Positions& inMap(const MotionStep& step, const Positions& fixed, Positions& scratch) const;
  template <class Body>
  void parallel(std::size_t n, std::size_t piece, const Body& body);

  DetectorOptions options;
  std::unique_ptr<ElementaryTest> elementary;
  std::optional<tbb::task_arena> arena;
  SceneArrays scene;
  tbb::enumerable_thread_specific<PairWorker> workers;
  std::vector<PairTask> tasks;
  std::vector<std::uint32_t> group_pairs, found_groups, scratch;
  std::vector<std::uint32_t> body_pairs;
  HitOrder order;
  StartStateTest start_state;
  std::vector<UnfoldedTest> unfolded;
  std::vector<std::uint8_t> apart;  // per body: at the end of the last step it certainly did not touch itself
  std::vector<std::uint8_t> self_tested;  // per body: its pairs with itself are looked at in this step
  std::vector<std::unique_ptr<ObstacleTest>> obstacle_tests;
  Positions map_t0, map_t1;
  std::vector<std::uint8_t> obstacle_active;
  StepResult result;
};

template <class Body>
void Detector::Impl::parallel(std::size_t n, std::size_t piece, const Body& body) {
  if (options.num_threads == 1 || n <= piece) {
    body(0, n);
    return;
  }
  arena->execute([&] {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, piece), [&](const tbb::blocked_range<std::size_t>& r) {
      const ScopedFloatMode mode;
      body(r.begin(), r.end());
    }, tbb::simple_partitioner());
  });
}

const StepResult& Detector::Impl::run(const MotionStep& step) {
  const ScopedFloatMode mode;
  const Clock::time_point begin = Clock::now();
  result.intersections.clear();
  result.start_state = StartState::NOT_CHECKED;
  result.complete = true;
  result.unchecked_toc_lower = std::numeric_limits<double>::infinity();
  result.stats = core::StepStats();
  core::StepStats& stats = result.stats;

  Clock::time_point start = Clock::now();
  scene.record(step, stats);
  stats[Stage::RECORD] = {scene.vertexCount(), scene.vertexCount(), msSince(start)};

  start = Clock::now();
  chooseSelfTests(step);
  stats[Stage::BROAD_PHASE].ms += msSince(start);

  start = Clock::now();
  if (needsTrees(step)) scene.refit([&](std::size_t n, const auto& f) { parallel(n, PIECE, f); });
  stats[Stage::BOUNDS].ms = msSince(start);

  if (options.check_start_state) {
    start = Clock::now();
    result.intersections = start_state.run(scene, step.continues, stats);
    result.start_state = result.intersections.empty() ? StartState::CLEAR : StartState::INTERSECTING;
    stats[Stage::START_STATE].ms += msSince(start);
  }

  StepContext context;
  context.scene = &scene;
  context.elementary = elementary.get();
  context.earliest_only = options.earliest_only;
  if (options.accuracy.rung == Accuracy::CONSERVATIVE) context.tolerance_m = options.accuracy.tolerance_m;
  if (options.step_budget_ms > 0) {
    context.deadline = begin + std::chrono::duration_cast<Clock::duration>(
                                   std::chrono::duration<double, std::milli>(options.step_budget_ms));
  }
  for (PairWorker& w : workers) w.beginStep();
  findPairs(context);
  runPairs(context);
  collect();
  if (step.obstacle) runObstacle(step);
  rememberApart(result.complete && !options.earliest_only && options.accuracy.rung != Accuracy::FAST);
  if (options.earliest_only && !result.contacts.empty()) {
    double lower = 2, upper = 2;
    for (const core::Contact& c : result.contacts) {
      if (c.certainty != Certainty::CERTAIN) continue;
      lower = std::min(lower, c.toc_lower);
      upper = std::min(upper, c.toc_upper);
    }
    // The cell [1, 1] ends where the one before it does, and is later all the same.
    const auto late = [&](const core::Contact& c) {
      if (c.certainty != Certainty::CERTAIN) return c.toc_lower > upper;
      return c.toc_upper > upper || (c.toc_lower > lower && c.toc_lower >= upper);
    };
    result.contacts.erase(std::remove_if(result.contacts.begin(), result.contacts.end(), late), result.contacts.end());
  }
  if (options.check_start_state) {
    start = Clock::now();
    // With earliest_only the later contacts are unknown, and `fast` may miss some, so nothing may be concluded about the
    // end of the step.
    start_state.remember(scene, result.contacts, result.complete && !options.earliest_only &&
                                                     stats.unchecked_vertices == 0 &&
                                                     options.accuracy.rung != Accuracy::FAST);
    stats[Stage::START_STATE].ms += msSince(start);
    stats[Effect::START_STATE].ms = stats[Stage::START_STATE].ms;
  } else {
    start_state.skip();
  }
  stats.total_ms = msSince(begin);
  return result;
}

void Detector::Impl::addTasks(PairKind kind, std::uint16_t a, std::uint16_t b, const StepContext& context) {
  const ClusterTree &ta = scene.bodies()[a].tree(firstKind(kind)), &tb = scene.bodies()[b].tree(secondKind(kind));
  if (ta.featureCount() == 0 || tb.featureCount() == 0) return;
  const bool same_tree = a == b && kind == PairKind::EDGE_EDGE;
  PairTask task{kind, a, b, a == b, 0, 0};
  if (options.broad_phase == BroadPhase::BRUTE_FORCE) {
    tasks.push_back(task);
    return;
  }
  const TreePair trees{&ta, &tb, same_tree, false};
  superclusterPairs(trees, found_groups, scratch);
  if (context.deadline != Clock::time_point::max()) {
    // What the deadline leaves over should be what can touch last.
    std::vector<std::array<std::uint32_t, 2>> pairs(found_groups.size() / 2);
    for (std::size_t i = 0; i < pairs.size(); ++i) pairs[i] = {found_groups[2 * i], found_groups[2 * i + 1]};
    std::stable_sort(pairs.begin(), pairs.end(), [&](const auto& x, const auto& y) {
      return superclusterTocBound(trees, x[0], x[1]) < superclusterTocBound(trees, y[0], y[1]);
    });
    for (std::size_t i = 0; i < pairs.size(); ++i) std::copy(pairs[i].begin(), pairs[i].end(), &found_groups[2 * i]);
  }
  const std::uint32_t base = static_cast<std::uint32_t>(group_pairs.size() / 2);
  const std::uint32_t count = static_cast<std::uint32_t>(found_groups.size() / 2);
  group_pairs.insert(group_pairs.end(), found_groups.begin(), found_groups.end());
  for (std::uint32_t first = 0; first < count; first += TASK_SUPERCLUSTERS) {
    task.first = base + first;
    task.last = base + std::min<std::uint32_t>(count, first + TASK_SUPERCLUSTERS);
    tasks.push_back(task);
  }
}

// A body whose vertices all move by exactly the same vector keeps its shape: what was apart at the end of the last step
// stays apart. (A rotation is no such motion: straight vertex paths deform the body.)
bool Detector::Impl::staysApart(std::size_t body) const {
  return body < apart.size() && apart[body] && scene.bodies()[body].translates;
}

void Detector::Impl::chooseSelfTests(const MotionStep& step) {
  self_tested.assign(scene.bodies().size(), 0);
  for (std::size_t b = 0; b < self_tested.size(); ++b) {
    if (!scene.bodies()[b].setup.self_collision || (step.continues && staysApart(b))) continue;
    const bool unfolded = isUnfolded(b);
    result.stats.unfolded_bodies += unfolded;
    self_tested[b] = !unfolded;
  }
}

// A single body that cannot meet itself is tested against the obstacle alone, which has bounds of its own.
bool Detector::Impl::needsTrees(const MotionStep& step) const {
  return self_tested.size() > 1 || std::count(self_tested.begin(), self_tested.end(), 1) > 0 ||
         (options.check_start_state && start_state.needsTrees(step.continues));
}

bool Detector::Impl::isUnfolded(std::size_t body) {
  const SceneBody& b = scene.bodies()[body];
  // With a separation, not touching is not enough. Brute force is for comparisons, so nothing is culled there.
  if (!options.unfolded_test || options.broad_phase == BroadPhase::BRUTE_FORCE) return false;
  return b.setup.minimum_separation_m == 0 && !b.masked && unfolded[body].run(b, scene.vertices());
}

void Detector::Impl::rememberApart(bool certain) {
  apart.resize(scene.bodies().size(), 0);
  for (std::size_t b = 0; b < apart.size(); ++b) {
    const bool tested = scene.bodies()[b].setup.self_collision;
    apart[b] = certain && tested && !scene.bodies()[b].masked;
  }
  for (const core::Contact& c : result.contacts) {
    if (c.body[0] == c.body[1]) apart[c.body[0]] = 0;
  }
}

void Detector::Impl::findPairs(const StepContext& context) {
  const Clock::time_point start = Clock::now();
  tasks.clear();
  group_pairs.clear();
  const std::size_t n = scene.bodies().size();
  for (std::size_t b = 0; b < n; ++b) {
    if (!self_tested[b]) continue;
    const std::uint16_t i = static_cast<std::uint16_t>(b);
    addTasks(PairKind::VERTEX_FACE, i, i, context);
    addTasks(PairKind::EDGE_EDGE, i, i, context);
  }
  if (n > 1) {
    scene.overlappingBodies(false, body_pairs, scratch);
    for (std::size_t p = 0; p < body_pairs.size(); p += 2) {
      const std::uint16_t a = static_cast<std::uint16_t>(body_pairs[p]), b = static_cast<std::uint16_t>(body_pairs[p + 1]);
      if (!scene.bodies()[a].setup.against_bodies || !scene.bodies()[b].setup.against_bodies) continue;
      addTasks(PairKind::VERTEX_FACE, a, b, context);
      addTasks(PairKind::VERTEX_FACE, b, a, context);
      addTasks(PairKind::EDGE_EDGE, a, b, context);
    }
  }
  result.stats[Stage::BROAD_PHASE].ms += msSince(start);
}

void Detector::Impl::runPairs(StepContext& context) {
  parallel(tasks.size(), 1, [&](std::size_t first, std::size_t last) {
    PairWorker& worker = workers.local();
    for (std::size_t t = first; t < last; ++t) {
      if (options.broad_phase == BroadPhase::BRUTE_FORCE) {
        worker.runBruteForce(context, tasks[t]);
      } else {
        worker.run(context, tasks[t], group_pairs, tasks[t].first, tasks[t].last);
      }
    }
  });
  result.complete = !context.expired;
}

void Detector::Impl::writeContact(PairKind kind, const Hit& hit, core::Contact& c) const {
  c = core::Contact();
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
  core::StepStats& stats = result.stats;
  std::vector<const std::vector<Hit>*> parts;
  for (const PairWorker& w : workers) {
    for (std::size_t s = 0; s < stats.stages.size(); ++s) {
      stats.stages[s].in += w.stats().stages[s].in;
      stats.stages[s].out += w.stats().stages[s].out;
      stats.stages[s].ms += w.stats().stages[s].ms;
    }
    for (std::size_t e = 0; e < stats.effects.size(); ++e) {
      stats.effects[e].in += w.stats().effects[e].in;
      stats.effects[e].out += w.stats().effects[e].out;
      stats.effects[e].ms += w.stats().effects[e].ms;
    }
    stats.tiers += w.stats().tiers;
    stats.undecided += w.stats().undecided;
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

const Positions& Detector::Impl::inMap(const MotionStep& step, const Positions& fixed, Positions& out) const {
  if (step.map_from_fixed.matrix() == Eigen::Isometry3d::Identity().matrix()) return fixed;
  out.resize(fixed.size());
  const Eigen::Matrix3d R = step.map_from_fixed.linear();
  const Vec3 p = step.map_from_fixed.translation();
  for (std::size_t i = 0; i < fixed.size(); ++i) out[i] = R * fixed[i] + p;
  return out;
}

void Detector::Impl::runObstacle(const MotionStep& step) {
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
      o.minimum_separation_m = body.setup.minimum_separation_m;
      obstacle_tests[b] = std::make_unique<ObstacleTest>(o);
    }
    const std::uint8_t* active = nullptr;
    if (body.masked) {
      obstacle_active.assign(body.setup.topology->vertexCount(), 0);
      for (std::size_t i = 0; i < body.usedCount(); ++i) obstacle_active[body.slot_vertex[i]] = body.active[i];
      active = obstacle_active.data();
    }
    obstacle_tests[b]->run(*step.obstacle, *body.setup.topology, inMap(step, *step.bodies[b].t0, map_t0),
                           inMap(step, *step.bodies[b].t1, map_t1), active, static_cast<std::uint16_t>(b), result.contacts,
                           total);
  }
  // Each body's are in order; of several bodies, kinds come first.
  const auto first = result.contacts.begin() + static_cast<std::ptrdiff_t>(before);
  if (!std::is_sorted(first, result.contacts.end(), canonicalLess)) std::sort(first, result.contacts.end(), canonicalLess);
  const std::uint64_t in = total.vertex_pairs_in + total.edge_pairs_in + total.corner_pairs_in;
  const std::uint64_t out = result.contacts.size() - before;
  result.stats[Stage::OBSTACLE] = {in, out, msSince(start)};
  result.stats[Effect::OBSTACLE] = result.stats[Stage::OBSTACLE];
  for (std::size_t i = before; i < result.contacts.size(); ++i) {
    const core::Contact& c = result.contacts[i];
    result.stats.initial += c.initial;
    result.stats.leaving += c.leaving;
    result.stats.undecided += c.certainty == Certainty::UNDECIDED;
    if (c.initial && options.check_start_state) {
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

Detector::Detector(const DetectorOptions& options) : impl_(std::make_unique<Impl>(options)) {}
Detector::~Detector() = default;
const DetectorOptions& Detector::options() const { return impl_->options; }
void Detector::setOptions(const DetectorOptions& options) { impl_->setOptions(options); }

void Detector::setBodies(std::vector<BodySetup> bodies, const std::vector<const Positions*>& rest_positions) {
  double separation = 0;
  for (const BodySetup& b : bodies) separation = std::max(separation, b.minimum_separation_m);
  Impl::checkSeparation(impl_->options, separation);
  impl_->scene.setBodies(std::move(bodies), rest_positions);
  impl_->unfolded.clear();
  for (const SceneBody& body : impl_->scene.bodies()) impl_->unfolded.emplace_back(body);
  impl_->start_state.forget();
  impl_->apart.clear();
  impl_->obstacle_tests.clear();
}

const StepResult& Detector::run(const MotionStep& step) { return impl_->run(step); }

}  // namespace deformable_ccd
