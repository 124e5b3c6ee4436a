// From the pairs of bodies that a part of a step tests to contacts in order.
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <array>
#include <tuple>
#include <vector>

#include "step/pairs/hit_order.h"
#include "step/pairs/pair_worker.h"

namespace dccd {

struct Part;
struct Prepared;
class Looked;
class SelfTests;

class PairSearch {
 public:
  using Workers = tbb::enumerable_thread_specific<PairWorker>;

  /// For tests, which hold the search against it: from now on every pair is tested, and none is looked for.
  void testAll() { brute_force_ = true; }
  /// A part of a step begins: what the last one found is forgotten.
  void begin();
  /// Pairs of two bodies, and of those with themselves that are to be. shortened: the part's scene; with earliest_only
  /// its bounds may end before the step. result: of the pairs, what is left out and counted; collect() has the rest.
  /// looked: of which pairs of bodies all was looked at.
  void run(const Part& part, const SelfTests& self_tests, SceneArrays& shortened, Looked& looked, Findings& result);
  /// The contacts found, in canonical order, and what the workers counted (contacts.cpp). What is undecided when the
  /// deadline is over may be new: nothing is computed for it any more.
  void collect(const Part& part, Findings& result);

  const Workers& workers() const { return workers_; }

 private:
  /// Which pairs of groups are looked for: all of them, a sample of them, or the rest of it.
  enum class Share : std::uint8_t { ALL, SAMPLE, REST };
  /// What a search reads and, in the result, where it says what it left out.
  struct Search {
    const Prepared& prepared;
    StepContext& context;
    std::size_t found_limit;  // what may still be found
    Findings& result;
    Share share = Share::ALL;
  };

  /// One kind of pairs of two bodies, of which the tasks are pieces.
  struct Searched {
    PairKind kind;
    std::uint16_t body_a, body_b;
    bool listed = false;                      ///< all pairs of superclusters that may touch are in tasks
    std::size_t superclusters = 0, done = 0;  ///< pairs of these in all tasks, and those that were looked at
  };

  bool stopsAtFirst(const Part& part) const;
  void runUntilFirst(Search& search, const SelfTests& self_tests, SceneArrays& shortened);
  void findPairs(const Search& search, const SelfTests& self_tests);
  void addSelfTasks(const Search& search, std::size_t body);
  void addTasks(const Search& search, PairKind kind, std::size_t a, std::size_t b);
  Searched& nextSearched(const Search& search, PairKind kind, std::size_t a, std::size_t b);
  void orderByBound(const TreePair& trees);
  void runTasks(const Search& search);
  void cutHits(const Search& search);
  void countDone(std::size_t tasks);

  bool brute_force_ = false;
  Workers workers_;
  std::vector<PairTask> tasks_;
  std::vector<TaskHits> task_hits_;     // per task
  std::vector<std::size_t> task_done_;  // per task, of its pairs of superclusters
  std::vector<Searched> searched_;      // in their order, which is that of all shares
  std::size_t next_searched_ = 0;
  FoundLimit found_;  // by the tasks
  std::vector<std::uint32_t> group_pairs_, found_groups_, scratch_, body_pairs_;
  std::vector<std::tuple<double, std::uint32_t, std::array<std::uint32_t, 2>>> by_toc_;  // and place, pair of groups
  std::array<HitOrder, 2> order_;                                                        // by PairKind
};

/// What may be found in a whole step with these options and bodies; FoundLimit::NONE: no limit.
std::size_t foundLimit(const Options& options, const std::vector<SceneBody>& bodies);

}  // namespace dccd
