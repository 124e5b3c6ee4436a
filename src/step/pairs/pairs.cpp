// Which pairs of features a step tests: the tasks of each body and pair of bodies, and what is left out of them.
#include <algorithm>
#include <sstream>

#include "dccd/accuracy.h"
#include "dccd/tolerances.h"
#include "obstacle/burst.h"
#include "step/history.h"
#include "step/pairs/pair_separation.h"

namespace dccd {

using Clock = Deadline::Clock;

namespace {

constexpr std::size_t TASK_SUPERCLUSTERS = 16;            // supercluster pairs in a unit of work: about a millisecond
constexpr std::chrono::nanoseconds ORDERING_A_PAIR(200);  // its bound, and its share of sorting ten thousand
constexpr std::size_t PIECE_TO_SHORTEN = 1024;            // groups in a unit of moving their bounds
constexpr double WORTH_SHORTENING = 0.75;                 // of the step: to move all bounds takes a tenth of a search

/// One pair of groups in 32 is in the sample, whatever the order in which they are found.
void keepShare(bool sample, std::vector<std::uint32_t>& pairs) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < pairs.size(); i += 2) {
    const std::uint32_t hash = (pairs[i] * 0x9e3779b1u ^ pairs[i + 1] * 0x85ebca77u) * 0xc2b2ae3du;
    if ((hash >> 27 == 0) != sample) continue;
    pairs[kept++] = pairs[i];
    pairs[kept++] = pairs[i + 1];
  }
  pairs.resize(kept);
}

}  // namespace

void History::Impl::addTasks(PairKind kind, std::uint16_t a, std::uint16_t b, const StepContext& context, Share share) {
  const ClusterTree &ta = scene.bodies()[a].tree(firstKind(kind)), &tb = scene.bodies()[b].tree(secondKind(kind));
  if (ta.featureCount() == 0 || tb.featureCount() == 0) return;
  PairTask task{kind, a, b, a == b, 0, 0, false};
  if (options->broad_phase == BroadPhase::BRUTE_FORCE) {
    tasks.push_back(task);
    return;
  }
  const TreePair trees = context.treesOf(kind, a, b);
  const bool limited = foundLimit() != FoundLimit::NONE;
  const std::size_t room = limited ? tolerance::MAX_SUPERCLUSTER_PAIRS - group_pairs.size() / 2 : FoundLimit::NONE;
  const SearchRest rest =
      superclusterPairs(trees, found_groups, scratch, room, context.deadline, &result.stats.unfolded_pairs);
  if (rest.toc <= 1) leaveOutAt(rest.toc, !rest.late);
  if (share != Share::ALL) keepShare(share == Share::SAMPLE, found_groups);
  const auto ordering = ORDERING_A_PAIR * static_cast<std::int64_t>(found_groups.size() / 2);
  const bool late =
      rest.late || (found_groups.size() / 2 > TASK_SUPERCLUSTERS && context.deadline.movedBy(-ordering).isOver());
  task.by_bound = (limited || context.deadline.canEnd()) && !late;
  if (task.by_bound) orderByBound(trees);
  const std::uint32_t base = static_cast<std::uint32_t>(group_pairs.size() / 2);
  const std::uint32_t count = static_cast<std::uint32_t>(found_groups.size() / 2);
  group_pairs.insert(group_pairs.end(), found_groups.begin(), found_groups.end());
  for (std::uint32_t first = 0; first < count; first += TASK_SUPERCLUSTERS) {
    task.first = base + first;
    task.last = base + std::min<std::uint32_t>(count, first + TASK_SUPERCLUSTERS);
    tasks.push_back(task);
  }
}

/// What a deadline or a limit leaves over should be what can touch last; of equal ones what was found last.
void History::Impl::orderByBound(const TreePair& trees) {
  by_toc.clear();
  for (std::uint32_t i = 0; 2 * i < found_groups.size(); ++i) {
    const std::array<std::uint32_t, 2> pair{found_groups[2 * i], found_groups[2 * i + 1]};
    by_toc.push_back({superclusterTocBound(trees, pair[0], pair[1]), i, pair});
  }
  std::sort(by_toc.begin(), by_toc.end());
  for (std::size_t i = 0; i < by_toc.size(); ++i) std::copy_n(std::get<2>(by_toc[i]).begin(), 2, &found_groups[2 * i]);
}

// A body whose vertices all move by exactly the same vector keeps its shape: what was apart at the end of the last step
// stays apart. (A rotation is no such motion: straight vertex paths deform the body.)
bool History::Impl::staysApart(std::size_t body) const {
  return body < carried.apart.size() && carried.apart[body] && scene.bodies()[body].translates &&
         !scene.bodies()[body].uncertain;
}

void History::Impl::chooseSelfTests(const Part& part) {
  self_tested.assign(scene.bodies().size(), 0);
  for (std::size_t b = 0; b < self_tested.size(); ++b) {
    if (!meetsItself(scene.bodies()[b].setup)) continue;
    unfolded[b].clear();
    if (part.continues && staysApart(b)) {
      if (observer)
        observer->onSelfLeftOut(b, "the whole body moves without turning, and was apart from itself before");
      continue;
    }
    const Clock::time_point start = Clock::now();
    const bool whole = certify(b);
    result.stats[Effect::SELF_COLLISION].ms += msSince(start);
    self_tested[b] = !whole;
    if (whole && observer) {
      observer->onSelfLeftOut(b, "the whole surface certainly does not fold onto itself in this step");
    }
  }
}

/// Crossings at t = 0 are looked for among all pairs, those of a body with itself included.
bool History::Impl::searchesStart(const Part& part) const {
  return checksStartState(part) && !isStartKnown() && carried.start_state.needsTrees(part.continues);
}

bool History::Impl::mayBeUnfolded(std::size_t body) const {
  const SceneBody& b = scene.bodies()[body];
  // With a distance, not touching is not enough. Brute force is for comparisons, so nothing is culled there.
  if (!options->unfolded_test || options->broad_phase == BroadPhase::BRUTE_FORCE) return false;
  return scene.separation(body, body) == 0 && !b.uncertain && !b.masked;
}

/// True: all of it is certified.
bool History::Impl::certify(std::size_t body) {
  if (!mayBeUnfolded(body)) return false;
  unfolded[body].run(scene.bodies()[body], scene.vertices(),
                     [&](std::size_t n, std::size_t piece, const auto& f) { parallel(n, piece, f); });
  const bool whole = unfolded[body].isWhole();
  if (observer && !whole) unfolded[body].clear();  // it wants to see the pairs
  result.stats.unfolded_bodies += whole;
  result.stats.unfolded_parts += whole ? 0 : unfolded[body].partCount();
  return whole;
}

void History::Impl::rememberApart(bool certain) {
  std::vector<std::uint8_t>& apart = carried.apart;
  apart.resize(scene.bodies().size(), 0);
  for (std::size_t b = 0; b < apart.size(); ++b) {
    const bool tested = meetsItself(scene.bodies()[b].setup);
    // With radii that change, what is apart now may be too close without having moved.
    apart[b] = certain && tested && !scene.bodies()[b].masked && !scene.bodies()[b].uncertain;
  }
  std::size_t left = static_cast<std::size_t>(std::count(apart.begin(), apart.end(), 1));
  for (auto c = result.contacts.begin(); left > 0 && c != result.contacts.end(); ++c) {
    if (c->body[0] != c->body[1]) continue;
    left -= apart[c->body[0]];
    apart[c->body[0]] = 0;
  }
}

void History::Impl::addSelfTasks(std::size_t body, const StepContext& context, Share share) {
  const std::uint16_t i = static_cast<std::uint16_t>(body);
  addTasks(PairKind::VERTEX_FACE, i, i, context, share);
  addTasks(PairKind::EDGE_EDGE, i, i, context, share);
}

void History::Impl::findPairs(const StepContext& context, Share share) {
  const Clock::time_point start = Clock::now();
  if (share != Share::REST) {
    const std::size_t used = group_pairs.size();  // by the last step
    for (auto* buffer : {&group_pairs, &found_groups, &scratch}) {
      buffer->clear();
      releaseBurst(*buffer, used);
    }
    by_toc.clear();
    releaseBurst(by_toc, used / 2);
    releaseBurst(tasks);
    releaseBurst(task_hits);
  }
  group_pairs.clear();
  tasks.clear();
  result.stats.body_pairs = 0;
  const std::size_t n = scene.bodies().size();
  for (std::size_t b = 0; b < n; ++b) {
    if (self_tested[b]) addSelfTasks(b, context, share);
  }
  if (n > 1) {
    scene.overlappingBodies(false, body_pairs, scratch);
    for (std::size_t p = 0; p < body_pairs.size(); p += 2) {
      const std::uint16_t a = static_cast<std::uint16_t>(body_pairs[p]),
                          b = static_cast<std::uint16_t>(body_pairs[p + 1]);
      if (!meet(scene.bodies()[a].setup, a, scene.bodies()[b].setup, b)) continue;
      ++result.stats.body_pairs;
      addTasks(PairKind::VERTEX_FACE, a, b, context, share);
      addTasks(PairKind::VERTEX_FACE, b, a, context, share);
      addTasks(PairKind::EDGE_EDGE, a, b, context, share);
    }
  }
  result.stats[Stage::BROAD_PHASE].ms += msSince(start);
}

bool History::Impl::needsReference(std::size_t b) const {
  const Body& setup = scene.bodies()[b].setup;
  if (!setup.reference || !meetsItself(setup)) return false;
  const auto& radius = setup.reference->radius_m;
  return scene.separation(b, b) > 0 || std::any_of(radius.begin(), radius.end(), [](double r) { return r > 0; });
}

/// The pairs that a step without motion in the reference frame calls contacts: exactly those that would be contacts for
/// as long as the body keeps its shape.
void History::Impl::findLeftOut(const Step& step) {
  const std::size_t n = scene.bodies().size();
  left_out.assign(n, {});
  left_out_list.clear();
  left_out_m.clear();
  Step rest = step;
  bool any = false;
  for (std::size_t b = 0; b < n; ++b) {
    Body& body = rest.bodies[b];
    body.radius_m = nullptr;
    body.t1 = body.t0;
    if (!needsReference(b)) continue;
    any = true;
    body.t0 = body.t1 = std::shared_ptr<const Positions>(body.reference, &body.reference->positions);
    if (body.reference->radius_m.empty()) continue;
    body.radius_m = std::shared_ptr<const std::vector<double>>(body.reference, &body.reference->radius_m);
  }
  if (!any) return;
  result.stats = StepStats();
  scene.record(rest, result.stats);
  scene.refit([](std::size_t count, const auto& f) { f(0, count); }, result.stats);
  AccuracyOptions accuracy = options->accuracy;
  accuracy.rung = Accuracy::CONSERVATIVE;
  const std::unique_ptr<Rung> test = makeRung(accuracy);
  StepContext context;
  context.scene = &scene;
  context.elementary = test.get();
  context.tolerance_m = accuracy.tolerance_m;
  for (PairWorker& w : workers) w.beginStep();
  tasks.clear();
  group_pairs.clear();
  found_limit = foundLimit();  // a pair that is not listed keeps its separation
  for (std::size_t b = 0; b < n; ++b) {
    if (needsReference(b)) addSelfTasks(b, context, Share::ALL);
  }
  runPairs(context);
  for (std::size_t b = 0; b < n; ++b) {
    if (!needsReference(b)) continue;
    for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) listLeftOut(b, kind);
  }
}

void History::Impl::listLeftOut(std::size_t b, PairKind kind) {
  std::vector<LeftOutKey> keys;
  for (const PairWorker& w : workers) {
    for (const Hit& hit : w.hits(kind)) {
      if ((hit.bodies >> 16) == b) keys.push_back({hit.key, 0});
    }
  }
  std::sort(keys.begin(), keys.end());
  const SceneBody& body = scene.bodies()[b];
  const Topology& topology = *body.setup.topology;
  const Positions& at = body.setup.reference->positions;
  const bool vertices = kind == PairKind::VERTEX_FACE;
  for (LeftOutKey& one : keys) {
    LeftOutPair pair;
    pair.kind = kind;
    pair.body = static_cast<std::uint16_t>(b);
    scene.featureVertices(firstKind(kind), b, static_cast<Index>(one.key >> 32), pair.vertex.data());
    scene.featureVertices(secondKind(kind), b, static_cast<Index>(one.key),
                          pair.vertex.data() + factsOf(kind).vertices[0]);
    one.distance_m =
        restDistance(kind, {at[pair.vertex[0]], at[pair.vertex[1]], at[pair.vertex[2]], at[pair.vertex[3]]});
    left_out_list.push_back(pair);
    left_out_m.push_back(one.distance_m);
  }
  left_out[b].set(kind, keys, vertices ? body.vertex_begin : body.edge_begin,
                  vertices ? topology.vertexCount() : topology.edges().size());
}

void History::Impl::sayLeftOutForNoise(const Step& step, std::vector<std::string>& unproved) const {
  if (left_out_list.empty() || !scene.uncertain()) return;
  std::vector<std::size_t> counts(step.bodies.size(), 0);
  std::vector<SeparationRule> rules;
  for (std::size_t b = 0; b < step.bodies.size(); ++b) {
    rules.emplace_back(scene, b, b, holdsDistance(options->accuracy.rung) ? options->accuracy.tolerance_m : 0);
    if (step.bodies[b].radius_m) rules.back().radii = step.bodies[b].radius_m->data();  // the list names its vertices
  }
  for (std::size_t i = 0; i < left_out_list.size(); ++i) {
    const LeftOutPair& pair = left_out_list[i];
    counts[pair.body] += rules[pair.body].of(pair.kind, pair.vertex, left_out_m[i]).for_noise;
  }
  for (std::size_t b = 0; b < counts.size(); ++b) {
    if (counts[b] == 0) continue;
    const Body& body = step.bodies[b];
    std::ostringstream text;
    text << "body '" << body.name << "': " << counts[b]
         << " pairs of its own features are closer in its reference frame than its uncertainty (radii of up to "
         << *std::max_element(body.radius_m->begin(), body.radius_m->end())
         << " m) reaches, and were only checked for touching";
    unproved.push_back(text.str());
  }
}

std::size_t History::Impl::foundLimit() const {
  std::size_t limit = options->max_found > 0 ? options->max_found : FoundLimit::NONE;
  if (options->max_found_per_feature > 0) {
    std::size_t features = 0;
    for (const SceneBody& body : scene.bodies()) {
      for (const FeatureKind kind : {FeatureKind::VERTEX, FeatureKind::EDGE, FeatureKind::FACE}) {
        features += body.tree(kind).featureCount();
      }
    }
    limit = std::min(limit, std::max(options->max_contacts, options->max_found_per_feature * features));
  }
  return limit;
}

void History::Impl::leaveOutAt(double toc, bool by_count) {
  result.complete = false;
  result.cut = result.cut || by_count;
  result.unchecked_toc_lower = std::min(result.unchecked_toc_lower, toc);
}

/// The tasks are begun in their order, each by the next thread that is free.
void History::Impl::runPairs(StepContext& context) {
  found.begin(found_limit, tasks.size());
  context.found = &found;
  task_hits.assign(tasks.size(), {});
  std::atomic<std::size_t> next{0};
  parallel(std::min(tasks.size(), static_cast<std::size_t>(options->num_threads)), 1, [&](std::size_t, std::size_t) {
    PairWorker& worker = workers.local();
    for (std::size_t t = next++; t < tasks.size(); t = next++) {
      task_hits[t] = {&worker, worker.hits(tasks[t].kind).size()};
      if (options->broad_phase == BroadPhase::BRUTE_FORCE) {
        worker.runBruteForce(context, tasks[t], t);
      } else {
        worker.run(context, tasks[t], t, group_pairs);
      }
    }
  });
  if (context.expired) result.complete = false;
  cutHits(context.span);
}

/// What only the first contact is asked of: a sample of the pairs says until when the step is to be looked at, and the
/// bounds of the rest end there. With `exact` the first contacts are those in the cell that ends first, so that none of
/// them touches after the end of any cell, and what is apart until then is none of them. (A conservative contact may
/// be one that never touches; what it says is the nearness of features, which bounds do not hold.) A sample that is
/// cut says nothing: what it found may depend on the threads.
void History::Impl::runUntilFirst(StepContext& context) {
  findPairs(context, Share::SAMPLE);
  runPairs(context);
  const double until = context.best_toc_upper;
  if (result.complete) context.not_after = until;
  if (context.not_after <= WORTH_SHORTENING) {
    const Clock::time_point start = Clock::now();
    context.span = scene.shorten(
        [&](std::size_t groups, const auto& shorten) { parallel(groups, PIECE_TO_SHORTEN, shorten); }, until);
    result.stats[Stage::BOUNDS].ms += msSince(start);
  }
  found_limit -= found_limit == FoundLimit::NONE ? 0 : std::min<std::size_t>(found_limit, context.hits);
  findPairs(context, Share::REST);
  runPairs(context);
}

/// Of what is over the limit all that is known is when the groups can meet.
void History::Impl::cutHits(const Span& span) {
  std::size_t listed = 0;
  const std::size_t cut = found.cutTask(listed);
  for (std::size_t t = cut; t < tasks.size(); ++t) {
    const PairTask& task = tasks[t];
    // A worker's later tasks lie behind in its list, and so go with the first.
    task_hits[t].worker->dropHits(task.kind, task_hits[t].begin + (t == cut ? listed : 0));
    if (options->broad_phase == BroadPhase::BRUTE_FORCE) {
      leaveOutAt(0, true);
      continue;
    }
    if (t > cut && task.follows(tasks[t - 1])) continue;
    const TreePair trees{&scene.bodies()[task.body_a].tree(firstKind(task.kind)),
                         &scene.bodies()[task.body_b].tree(secondKind(task.kind)), task.self, span};
    for (std::size_t p = task.first; p < (task.by_bound ? task.first + 1 : task.last); ++p) {
      leaveOutAt(superclusterTocBound(trees, group_pairs[2 * p], group_pairs[2 * p + 1]), true);
    }
  }
}

}  // namespace dccd
