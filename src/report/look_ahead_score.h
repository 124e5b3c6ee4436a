// How many predictions came true: what was predicted against what was observed later.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "dccd/outcome.h"

namespace dccd {

/// What is compared is whether a vertex first touches another body, its own, or the map, as vertex or through an edge
/// or face of it: which of many neighbouring features it meets first is chance.
struct LookAheadSummary {
  std::size_t came_true = 0;      ///< within their horizon (each prediction of each vertex)
  std::size_t not_observed = 0;   ///< predicted, and not in contact when the horizon was over
  std::size_t not_predicted = 0;  ///< came into contact unannounced
};

/// What a prediction cost, for the statistics of the step that it begins after.
StageStats lookAheadStats(const Outcome& prediction);

/// Feed it every outcome in order, and after an outcome the prediction that begins at its end, if there is one. Memory
/// grows with the vertices times the steps in a horizon.
class LookAheadScore {
 public:
  explicit LookAheadScore(double horizon_s) : horizon_s_(horizon_s) {}

  void observe(const Outcome& outcome);
  void predict(const Outcome& prediction);
  const LookAheadSummary& summary() const { return summary_; }

 private:
  /// Body, what it touches (body or OBSTACLE_BODY), vertex.
  using Key = std::uint64_t;

  /// first: vertices that certainly come into contact; touching: all that is in contact, initial or not certain too.
  static void vertexContacts(const Outcome& outcome, std::set<Key>& first, std::set<Key>& touching);
  void expire(StampNs now_ns);

  double horizon_s_;
  bool any_ = false;
  std::set<Key> touching_;                       // at the end of the last step
  std::map<Key, std::vector<StampNs>> pending_;  // when it was predicted
  LookAheadSummary summary_;
};

}  // namespace dccd
