#include "step/pairs/pair_worker.h"

#include <algorithm>
#include <cstring>

#include "culling/toc_bound.h"
#include "obstacle/burst.h"
#include "simd/fused_filter.h"

namespace dccd {

using Clock = Deadline::Clock;

namespace {

constexpr std::size_t CHUNK = 2048;  // pairs that stay in the first-level cache's reach
constexpr std::size_t CAPACITY = CHUNK + ClusterPairStream::CHUNK;

// What is undecided when time is up still gets its bound, but not for longer than this: denormal numbers are slow.
constexpr std::chrono::microseconds TIME_FOR_BOUNDS(100);
constexpr std::size_t BOUNDS_PER_LOOK_AT_THE_CLOCK = 64, BOUNDS_IN_ANY_CASE = 1024;

}  // namespace

PairWorker::PairWorker()
    : quads_(CAPACITY),
      slots_(CAPACITY),
      keys_(CAPACITY),
      kept_(CAPACITY),
      results_(CAPACITY),
      separations_(CAPACITY) {}

void PairWorker::beginStep() {
  for (auto& h : hits_) {
    releaseBurst(h);
    h.clear();
  }
  stats_ = StepStats();
  unsure_.clear();
  bounds_ = 0;
  late_ = false;
  unchecked_toc_lower_ = std::numeric_limits<double>::infinity();
}

/// All time since the last lap was the stage's.
void PairWorker::lap(Stage stage) {
  const Clock::time_point now = Clock::now();
  stats_[stage].ms += std::chrono::duration<double, std::milli>(now - lap_begun_).count();
  lap_begun_ = now;
}

void PairWorker::dropHits(PairKind kind, std::size_t begin) {
  std::vector<Hit>& hits = hits_[static_cast<int>(kind)];
  if (begin < hits.size()) hits.resize(begin);
}

void PairWorker::begin(StepContext& context, const PairTask& task, std::size_t index) {
  context_ = &context;
  task_ = &task;
  task_index_ = index;
  enough_ = context.found && !context.found->add(index, 0);
  a_ = &context.scene->bodies()[task.body_a];
  b_ = &context.scene->bodies()[task.body_b];
  rule_ = SeparationRule(*context.scene, task.body_a, task.body_b, context.tolerance_m);
  separated_ = rule_.applies();
  unsure_.resize(context.scene->bodies().size(), 0);
  count_ = 0;
  separated_ms_ = 0;
  begun_ = lap_begun_ = Clock::now();
}

/// Of so many pairs of superclusters all pairs of features were taken. What is left of these is accounted for now,
/// unless something ran out meanwhile.
std::size_t PairWorker::end(std::size_t done) {
  flush();
  const double all_ms = std::chrono::duration<double, std::milli>(lap_begun_ - begun_).count();
  stats_[effect()].ms += all_ms - separated_ms_;
  return enough_ || context_->expired ? 0 : done;
}

/// Features of the task, by their slots.
bool PairWorker::shareVertex(std::size_t i, std::size_t j) const {
  const ClusterTree &ta = a_->tree(firstKind(task_->kind)), &tb = b_->tree(secondKind(task_->kind));
  const Index *va = ta.feature(i), *vb = tb.feature(j);
  return std::find_first_of(va, va + ta.arity(), vb, vb + tb.arity()) != va + ta.arity();
}

std::size_t PairWorker::runBruteForce(StepContext& context, const PairTask& task, std::size_t index) {
  begin(context, task, index);
  const bool same_tree = task.self && task.kind == PairKind::EDGE_EDGE;
  const std::uint32_t na = static_cast<std::uint32_t>(a_->tree(firstKind(task.kind)).featureCount());
  const std::uint32_t nb = static_cast<std::uint32_t>(b_->tree(secondKind(task.kind)).featureCount());
  std::uint32_t slots[2 * ClusterPairStream::CHUNK];
  std::size_t n = 0;
  for (std::uint32_t i = 0; i < na && !enough_; ++i) {
    for (std::uint32_t j = same_tree ? i + 1 : 0; j < nb; ++j) {
      if (!a_->holds(firstKind(task.kind), i) || !b_->holds(secondKind(task.kind), j) || shareVertex(i, j)) continue;
      slots[2 * n] = i;
      slots[2 * n + 1] = j;
      if (++n == ClusterPairStream::CHUNK) {
        take(slots, n);
        n = 0;
      }
    }
  }
  take(slots, n);
  return end(1);
}

std::size_t PairWorker::run(StepContext& context, const PairTask& task, std::size_t index,
                            const std::vector<std::uint32_t>& pairs) {
  begin(context, task, index);
  std::size_t done = 0;
  const TreePair trees = context.treesOf(task.kind, task.body_a, task.body_b);
  for (std::size_t p = task.first; p < task.last; ++p) {
    const bool whole_pair =
        goesOn() && stream_.run(trees, pairs.data() + 2 * p, 1, [&](const std::uint32_t* slots, std::size_t n) {
          take(slots, n);
          return goesOn();
        });
    if (!whole_pair) {
      leaveOut(trees, pairs, p);
      break;
    }
    ++done;
  }
  done = end(done);
  stats_[Stage::BROAD_PHASE].in += stream_.clusterPairsTested() * simd::GROUP * simd::GROUP;
  stream_.clearCounters();
  return done;
}

/// Of what was not looked at here all that is known is when the groups can meet.
void PairWorker::leaveOut(const TreePair& trees, const std::vector<std::uint32_t>& pairs, std::size_t first) {
  for (std::size_t p = first; p < (task_->by_bound ? first + 1 : task_->last); ++p) {
    const double bound = isTooLateForBounds() ? 0 : superclusterTocBound(trees, pairs[2 * p], pairs[2 * p + 1]);
    unchecked_toc_lower_ = std::min(unchecked_toc_lower_, bound);
  }
}

void PairWorker::take(const std::uint32_t* slots, std::size_t count) {
  std::size_t n = count_;
  Quad* quads = quads_.data();
  std::array<std::uint32_t, 2>* kept_slots = slots_.data();
  constexpr std::size_t NEXT = simd::GROUP;  // vertex of a lane
  if (task_->kind == PairKind::EDGE_EDGE) {
    const ClusterTree &edges_a = a_->tree(FeatureKind::EDGE), &edges_b = b_->tree(FeatureKind::EDGE);
    for (std::size_t i = 0; i < count; ++i, ++n) {
      const Index *ea = edges_a.lane<2>(slots[2 * i]), *eb = edges_b.lane<2>(slots[2 * i + 1]);
      quads[n] = {ea[0], ea[NEXT], eb[0], eb[NEXT]};
      kept_slots[n] = {slots[2 * i], slots[2 * i + 1]};
    }
  } else {
    const ClusterTree &vertices = a_->tree(FeatureKind::VERTEX), &faces = b_->tree(FeatureKind::FACE);
    for (std::size_t i = 0; i < count; ++i, ++n) {
      const Index* f = faces.lane<3>(slots[2 * i + 1]);
      quads[n] = {*vertices.lane<1>(slots[2 * i]), f[0], f[NEXT], f[2 * NEXT]};
      kept_slots[n] = {slots[2 * i], slots[2 * i + 1]};
    }
  }
  (task_->kind == PairKind::EDGE_EDGE ? stats_.ee_candidates : stats_.vf_candidates) += n - count_;
  stats_[Stage::BROAD_PHASE].out += n - count_;
  stats_[effect()].in += n - count_;
  count_ = n;
  if (count_ >= CHUNK) flush();
}

void PairWorker::flush() {
  lap(Stage::BROAD_PHASE);
  if (count_ == 0) return;
  const Clock::time_point start = lap_begun_;
  filter();
  makeCanonical();
  if (separated_) {
    setSeparations();
    lookAtUnsure();
  }
  const std::vector<Hit>& hits = hits_[static_cast<int>(task_->kind)];
  const std::size_t before = hits.size();
  // Which pairs are late depends on which were looked at first: no pair is left out where they are counted.
  const bool counts = context_->found && context_->found->isSet();
  if (context_->bounds_late && !counts) dropLate();
  if (context_->timeIsUp()) {
    keepUndecided();
  } else {
    decide();
  }
  lap(Stage::ELEMENTARY);
  context_->hits += hits.size() - before;
  if (counts) enough_ = !context_->found->add(task_index_, hits.size() - before) || enough_;
  if (separated_) {
    const double ms = std::chrono::duration<double, std::milli>(lap_begun_ - start).count();
    stats_[rule_.uncertain ? Effect::TRACKER_NOISE : Effect::MINIMUM_SEPARATION].ms += ms;
    separated_ms_ += ms;
  }
  count_ = 0;
}

void PairWorker::filter() {
  if (separated_) return;  // the planar filter proves "never touch", not "never closer than d"
  stats_[Stage::PLANAR].in += count_;
  const std::size_t kept =
      simd::fusedFilter(context_->scene->vertices()->t0, quads_[0].data(), count_, task_->kind == PairKind::EDGE_EDGE,
                        simd::FusedPlanes::ADAPTIVE, kept_.data());
  const Index *ranks_a = a_->rank(firstKind(task_->kind)).data(), *ranks_b = b_->rank(secondKind(task_->kind)).data();
  for (std::size_t i = 0; i < kept; ++i) {
    quads_[i] = quads_[kept_[i]];
    slots_[i] = slots_[kept_[i]];
    __builtin_prefetch(ranks_a + slots_[i][0]);  // makeCanonical() reads them next
    __builtin_prefetch(ranks_b + slots_[i][1]);
  }
  count_ = kept;
  stats_[Stage::PLANAR].out += kept;
  lap(Stage::PLANAR);
}

// Only what the filters kept needs its ranks, and the elementary test wants the features in canonical order.
void PairWorker::makeCanonical() {
  const Index *ranks_a = a_->rank(firstKind(task_->kind)).data(), *ranks_b = b_->rank(secondKind(task_->kind)).data();
  const std::array<std::uint32_t, 2>* slots = slots_.data();
  std::uint64_t* keys = keys_.data();
  if (task_->kind == PairKind::VERTEX_FACE) {
    for (std::size_t i = 0; i < count_; ++i) {
      keys[i] = std::uint64_t{ranks_a[slots[i][0]]} << 32 | ranks_b[slots[i][1]];
    }
    return;
  }
  Quad* quads = quads_.data();
  for (std::size_t i = 0, n = count_; i < n; ++i) {
    const std::uint64_t rank_a = ranks_a[slots[i][0]], rank_b = ranks_b[slots[i][1]];
    // Of two edges, which one is first nothing foretells: they change places by a mask, for compilers make a branch of
    // a condition.
    const std::uint64_t swap = std::uint64_t{0} - (rank_b < rank_a);
    std::uint64_t edges[2];
    std::memcpy(edges, quads + i, sizeof edges);
    const std::uint64_t of_edges = (edges[0] ^ edges[1]) & swap, of_ranks = (rank_a ^ rank_b) & swap;
    edges[0] ^= of_edges;
    edges[1] ^= of_edges;
    std::memcpy(quads + i, edges, sizeof edges);
    keys[i] = (rank_a ^ of_ranks) << 32 | (rank_b ^ of_ranks);
  }
}

void PairWorker::setSeparations() {
  for (std::size_t i = 0; i < count_; ++i) {
    const PairSeparation pair = rule_.of(task_->kind, quads_[i]);
    separations_[i] = pair.total_m;
    stats_.left_out_met += pair.left_out || pair.unsure_m > 0;
    if (pair.unsure_m > 0) {
      unsure_pairs_.push_back(quads_[i]);
      unsure_m_.push_back(pair.unsure_m);
    }
    --stats_[effect()].in;
    ++stats_[effectOf(pair.total_m, pair.noise_m)].in;
  }
}

/// One that comes as near as it may be off is enough.
void PairWorker::lookAtUnsure() {
  if (!unsure_[task_->body_a] && !unsure_pairs_.empty()) {
    PairBatch batch;
    batch.kind = task_->kind;
    batch.vertices = context_->scene->vertices();
    batch.pairs = unsure_pairs_.data();
    batch.count = unsure_pairs_.size();
    batch.minimum_separation_m = unsure_m_.data();
    const Deadline deadline = context_->pairsDeadline();
    if (deadline.canEnd()) batch.deadline = &deadline;
    TierCounters not_counted;
    context_->elementary->run(batch, results_.data(), not_counted);
    unsure_[task_->body_a] =
        std::any_of(results_.begin(), results_.begin() + static_cast<std::ptrdiff_t>(batch.count),
                    [](const ElementaryResult& result) { return result.verdict != Verdict::NO_CONTACT; });
  }
  unsure_pairs_.clear();
  unsure_m_.clear();
}

void PairWorker::countOut(std::size_t i) {
  const double separation_m = separationOf(i);
  ++stats_[effectOf(separation_m, separation_m - rule_.bodies_m)].out;
}

void PairWorker::dropLate() {
  const double best = context_->best_toc_upper.load(std::memory_order_relaxed);
  if (best >= 2) return;
  // The answer must not depend on which pair was looked at first: only what keepEarliest() would erase is dropped. The
  // bound is taken with the tolerance: until then the features are certainly farther than that, so that the bracket of
  // a contact begins at the bound or later, and a cell of `exact` not before `best`, which is the end of one.
  std::size_t n = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    const double distance = separationOf(i) + context_->tolerance_m;
    if (linearTocBound(task_->kind, context_->scene->vertices(), quads_[i], distance) > best) continue;
    quads_[n] = quads_[i];
    separations_[n] = separations_[i];
    keys_[n++] = keys_[i];
  }
  count_ = n;
}

/// So far so many may be asked for in any case.
bool PairWorker::isTooLateForBounds() {
  if (bounds_++ % BOUNDS_PER_LOOK_AT_THE_CLOCK == 0 && bounds_ > BOUNDS_IN_ANY_CASE) {
    late_ = late_ || context_->deadline.movedBy(TIME_FOR_BOUNDS).isOver();
  }
  return late_;
}

/// 0 where there is no time for a better one.
double PairWorker::boundOf(std::size_t i, double distance_m) {
  return isTooLateForBounds() ? 0 : linearTocBound(task_->kind, context_->scene->vertices(), quads_[i], distance_m);
}

void PairWorker::keepUndecided() {
  auto& hits = hits_[static_cast<int>(task_->kind)];
  const std::uint32_t bodies = std::uint32_t{task_->body_a} << 16 | task_->body_b;
  std::size_t out = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    const double bound = boundOf(i, separationOf(i));
    if (bound > std::min(context_->not_after, 1.0)) continue;
    countOut(i);
    hits.push_back({keys_[i], bound, 1, bodies, Certainty::UNDECIDED});
    ++out;
  }
  stats_.undecided += out;
}

void PairWorker::decide() {
  PairBatch batch;
  batch.kind = task_->kind;
  batch.vertices = context_->scene->vertices();
  batch.pairs = quads_.data();
  batch.count = count_;
  if (separated_) batch.minimum_separation_m = separations_.data();
  const Deadline deadline = context_->pairsDeadline();
  if (deadline.canEnd()) batch.deadline = &deadline;
  context_->elementary->run(batch, results_.data(), stats_.tiers);
  context_->timeIsUp();  // pairs that it left undecided are known to be
  auto& hits = hits_[static_cast<int>(task_->kind)];
  const std::uint32_t bodies = std::uint32_t{task_->body_a} << 16 | task_->body_b;
  const std::size_t before = hits.size();
  // First which, without a branch on what half of the pairs are and the other half are not.
  std::uint32_t* hit = kept_.data();
  for (std::size_t i = 0; i < count_; ++i) {
    const ElementaryResult& r = results_[i];
    *hit = static_cast<std::uint32_t>(i);
    hit += (r.verdict != Verdict::NO_CONTACT) & !(r.toc_lower > context_->not_after);
  }
  hits.resize(before + static_cast<std::size_t>(hit - kept_.data()));
  Hit* written = hits.data() + before;
  for (const std::uint32_t* one = kept_.data(); one != hit; ++one) {
    const std::size_t i = *one;
    ElementaryResult& r = results_[i];
    if (separated_) countOut(i);
    const bool certain = r.verdict == Verdict::CONTACT;
    if (!certain) {
      // As tight as the linear filter allows; dropLate() decides by the same bound.
      const double bound = boundOf(i, separationOf(i) + context_->tolerance_m);
      r.toc_lower = std::max(r.toc_lower, std::min(bound, 1.0));
    }
    *written++ = {keys_[i], r.toc_lower, certain ? r.toc_upper : 1, bodies,
                  certain ? Certainty::CERTAIN : Certainty::UNDECIDED};
    stats_.undecided += !certain;
    if (certain && context_->earliest_only) {
      double best = context_->best_toc_upper.load(std::memory_order_relaxed);
      while (r.toc_upper < best && !context_->best_toc_upper.compare_exchange_weak(best, r.toc_upper)) {
      }
    }
  }
  if (!separated_) stats_[effect()].out += hits.size() - before;
  stats_[Stage::ELEMENTARY].in += count_;
  stats_[Stage::ELEMENTARY].out += hits.size() - before;
}

}  // namespace dccd
