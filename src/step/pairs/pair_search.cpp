// Which pairs of features a step tests: the tasks of each body and pair of bodies, and what is left out of them.
#include "step/pairs/pair_search.h"

#include <algorithm>

#include "base/accuracy.h"
#include "dccd/tolerances.h"
#include "obstacle/burst.h"
#include "proof/looked.h"
#include "step/conclude.h"
#include "step/history.h"

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

/// Only the first contact is wanted, and what cannot touch before it is not looked at.
bool PairSearch::stopsAtFirst(const Part& part) const {
  const Options& options = part.options();
  return options.earliest_only && options.accuracy.rung == Accuracy::EXACT && !brute_force_;
}

void PairSearch::begin() {
  for (PairWorker& worker : workers_) worker.beginStep();
  for (HitOrder& kind : order_) kind.beginStep();
}

void PairSearch::run(const Part& part, const SelfTests& self_tests, SceneArrays& shortened, Looked& looked,
                     Findings& result) {
  const Options& options = part.options();
  const bool until_first = stopsAtFirst(part);
  StepContext context;
  context.scene = &part.scene;
  context.elementary = part.prepared.elementary.get();
  context.earliest_only = options.earliest_only;
  context.bounds_late = options.earliest_only && !until_first;
  context.deadline = part.deadline;
  context.per_hit = part.per_hit;
  if (holdsDistance(options.accuracy.rung)) context.tolerance_m = options.accuracy.tolerance_m;
  Search search{part.prepared, context, part.found_limit, result};
  if (until_first) {
    runUntilFirst(search, self_tests, shortened);
  } else {
    findPairs(search, self_tests);
    runTasks(search);
  }
  looked.compared(body_pairs_);
  for (const Searched& one : searched_) {
    if (one.listed && one.done == one.superclusters) looked.at(one.kind, one.body_a, one.body_b);
  }
}

/// A share of the pairs that is looked for after another one is the same searches', in the same order.
PairSearch::Searched& PairSearch::nextSearched(const Search& search, PairKind kind, std::size_t a, std::size_t b) {
  const auto body_a = static_cast<std::uint16_t>(a), body_b = static_cast<std::uint16_t>(b);
  if (search.share != Share::REST) return searched_.emplace_back(Searched{kind, body_a, body_b});
  const auto isIt = [&](const Searched& one) {
    return one.kind == kind && one.body_a == body_a && one.body_b == body_b;
  };
  while (!isIt(searched_.at(next_searched_))) ++next_searched_;
  return searched_[next_searched_++];
}

void PairSearch::addTasks(const Search& search, PairKind kind, std::size_t a, std::size_t b) {
  const StepContext& context = search.context;
  const TreePair trees = context.treesOf(kind, a, b);
  Searched& searched = nextSearched(search, kind, a, b);
  if (trees.a->featureCount() == 0 || trees.b->featureCount() == 0) {
    searched.listed = true;
    return;
  }
  PairTask task{kind, searched.body_a, searched.body_b, a == b, 0, 0, 0, false};
  task.search = static_cast<std::uint32_t>(&searched - searched_.data());
  if (brute_force_) {
    tasks_.push_back(task);
    searched.listed = true;
    ++searched.superclusters;
    return;
  }
  const bool limited = search.found_limit != FoundLimit::NONE;
  const std::size_t room = limited ? tolerance::MAX_SUPERCLUSTER_PAIRS - group_pairs_.size() / 2 : FoundLimit::NONE;
  const SearchRest rest = superclusterPairs(trees, found_groups_, scratch_, room, context.deadline);
  if (rest.toc <= 1) leaveOut(rest.toc, !rest.late, search.result);
  searched.listed = rest.toc > 1 && (search.share != Share::REST || searched.listed);
  if (search.share != Share::ALL) keepShare(search.share == Share::SAMPLE, found_groups_);
  const auto ordering = ORDERING_A_PAIR * static_cast<std::int64_t>(found_groups_.size() / 2);
  const bool late =
      rest.late || (found_groups_.size() / 2 > TASK_SUPERCLUSTERS && context.deadline.movedBy(-ordering).isOver());
  task.by_bound = (limited || context.deadline.canEnd()) && !late;
  if (task.by_bound) orderByBound(trees);
  const std::uint32_t base = static_cast<std::uint32_t>(group_pairs_.size() / 2);
  const std::uint32_t count = static_cast<std::uint32_t>(found_groups_.size() / 2);
  group_pairs_.insert(group_pairs_.end(), found_groups_.begin(), found_groups_.end());
  for (std::uint32_t first = 0; first < count; first += TASK_SUPERCLUSTERS) {
    task.first = base + first;
    task.last = base + std::min<std::uint32_t>(count, first + TASK_SUPERCLUSTERS);
    tasks_.push_back(task);
    searched.superclusters += task.last - task.first;
  }
}

/// The pairs that can touch first come first: a deadline or a limit leaves out the last ones.
void PairSearch::orderByBound(const TreePair& trees) {
  by_toc_.clear();
  for (std::uint32_t i = 0; 2 * i < found_groups_.size(); ++i) {
    const std::array<std::uint32_t, 2> pair{found_groups_[2 * i], found_groups_[2 * i + 1]};
    by_toc_.push_back({superclusterTocBound(trees, pair[0], pair[1]), i, pair});
  }
  std::sort(by_toc_.begin(), by_toc_.end());
  for (std::size_t i = 0; i < by_toc_.size(); ++i)
    std::copy_n(std::get<2>(by_toc_[i]).begin(), 2, &found_groups_[2 * i]);
}

void PairSearch::addSelfTasks(const Search& search, std::size_t body) {
  addTasks(search, PairKind::VERTEX_FACE, body, body);
  addTasks(search, PairKind::EDGE_EDGE, body, body);
}

void PairSearch::findPairs(const Search& search, const SelfTests& self_tests) {
  const Clock::time_point start = Clock::now();
  const SceneArrays& scene = *search.context.scene;
  StepStats& stats = search.result.stats;
  if (search.share != Share::REST) {
    const std::size_t used = group_pairs_.size();  // by the last step
    for (auto* buffer : {&group_pairs_, &found_groups_, &scratch_}) {
      buffer->clear();
      releaseBurst(*buffer, used);
    }
    by_toc_.clear();
    releaseBurst(by_toc_, used / 2);
    releaseBurst(tasks_);
    releaseBurst(task_hits_);
  }
  group_pairs_.clear();
  tasks_.clear();
  next_searched_ = 0;
  if (search.share != Share::REST) searched_.clear();
  body_pairs_.clear();
  stats.body_pairs = 0;
  const std::size_t n = scene.bodies().size();
  for (std::size_t b = 0; b < n; ++b) {
    if (self_tests.tested()[b]) addSelfTasks(search, b);
  }
  if (n > 1) {
    scene.overlappingBodies(false, body_pairs_, scratch_);
    for (std::size_t p = 0; p < body_pairs_.size(); p += 2) {
      const std::size_t a = body_pairs_[p], b = body_pairs_[p + 1];
      if (!meet(scene.bodies()[a].setup, a, scene.bodies()[b].setup, b)) continue;
      ++stats.body_pairs;
      addTasks(search, PairKind::VERTEX_FACE, a, b);
      addTasks(search, PairKind::VERTEX_FACE, b, a);
      addTasks(search, PairKind::EDGE_EDGE, a, b);
    }
  }
  stats[Stage::BROAD_PHASE].ms += msSince(start);
}

std::size_t foundLimit(const Options& options, const std::vector<SceneBody>& bodies) {
  std::size_t limit = options.max_found > 0 ? options.max_found : FoundLimit::NONE;
  if (options.max_found_per_feature > 0) {
    std::size_t features = 0;
    for (const SceneBody& body : bodies) {
      for (const FeatureKind kind : {FeatureKind::VERTEX, FeatureKind::EDGE, FeatureKind::FACE}) {
        features += body.tree(kind).featureCount();
      }
    }
    limit = std::min(limit, std::max(options.max_contacts, options.max_found_per_feature * features));
  }
  return limit;
}

/// The tasks are begun in their order, each by the next thread that is free.
void PairSearch::runTasks(const Search& search) {
  StepContext& context = search.context;
  const Threads& threads = search.prepared.threads;
  found_.begin(search.found_limit, tasks_.size());
  context.found = &found_;
  task_hits_.assign(tasks_.size(), {});
  task_done_.assign(tasks_.size(), 0);
  std::atomic<std::size_t> next{0};
  threads(std::min(tasks_.size(), threads.count()), 1, [&](std::size_t, std::size_t) {
    PairWorker& worker = workers_.local();
    for (std::size_t t = next++; t < tasks_.size(); t = next++) {
      task_hits_[t] = {&worker, worker.hits(tasks_[t].kind).size()};
      task_done_[t] =
          brute_force_ ? worker.runBruteForce(context, tasks_[t], t) : worker.run(context, tasks_[t], t, group_pairs_);
    }
  });
  if (context.expired) search.result.complete = false;
  cutHits(search);
}

/// Of the first ones, of which everything that they found is listed.
void PairSearch::countDone(std::size_t tasks) {
  for (std::size_t t = 0; t < tasks; ++t) searched_[tasks_[t].search].done += task_done_[t];
}

/// What only the first contact is asked of: a sample of the pairs says until when the step is to be looked at, and the
/// bounds of the rest end there. With `exact` the first contacts are those in the cell that ends first, so that none of
/// them touches after the end of any cell, and what is apart until then is none of them. (A conservative contact may
/// be one that never touches; what it says is the nearness of features, which bounds do not hold.) A sample that is
/// cut says nothing: what it found may depend on the threads.
void PairSearch::runUntilFirst(Search& search, const SelfTests& self_tests, SceneArrays& shortened) {
  StepContext& context = search.context;
  search.share = Share::SAMPLE;
  findPairs(search, self_tests);
  runTasks(search);
  const double until = context.best_toc_upper;
  if (search.result.complete) context.not_after = until;
  if (context.not_after <= WORTH_SHORTENING) {
    const Clock::time_point start = Clock::now();
    const auto inPieces = [&](std::size_t groups, const auto& shorten) {
      search.prepared.threads(groups, PIECE_TO_SHORTEN, shorten);
    };
    context.span = shortened.shorten(inPieces, until);
    search.result.stats[Stage::BOUNDS].ms += msSince(start);
  }
  search.share = Share::REST;
  if (search.found_limit != FoundLimit::NONE) {
    search.found_limit -= std::min<std::size_t>(search.found_limit, context.hits);
  }
  findPairs(search, self_tests);
  runTasks(search);
}

/// What was found beyond the limit is dropped: all that is known of it is when its groups can meet.
void PairSearch::cutHits(const Search& search) {
  const std::vector<SceneBody>& bodies = search.context.scene->bodies();
  std::size_t listed = 0;
  const std::size_t cut = found_.cutTask(listed);
  countDone(cut);
  for (std::size_t t = cut; t < tasks_.size(); ++t) {
    const PairTask& task = tasks_[t];
    // A worker's later tasks lie behind in its list, and so go with the first.
    task_hits_[t].worker->dropHits(task.kind, task_hits_[t].begin + (t == cut ? listed : 0));
    if (brute_force_) {
      leaveOut(0, true, search.result);
      continue;
    }
    if (t > cut && task.follows(tasks_[t - 1])) continue;
    const TreePair trees{&bodies[task.body_a].tree(firstKind(task.kind)),
                         &bodies[task.body_b].tree(secondKind(task.kind)), task.self, search.context.span};
    for (std::size_t p = task.first; p < (task.by_bound ? task.first + 1 : task.last); ++p) {
      leaveOut(superclusterTocBound(trees, group_pairs_[2 * p], group_pairs_[2 * p + 1]), true, search.result);
    }
  }
}

}  // namespace dccd
