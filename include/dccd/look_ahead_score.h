// How good predictions were: predicted against later observed times of contact.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "dccd/export.h"
#include "dccd/outcome.h"

namespace dccd {

/// What is compared is when a vertex first touches another body, its own, or the map, as vertex or through an edge or
/// face of it: which of many neighbouring features it meets first is chance, when it arrives is not.
struct LookAheadSummary {
  std::size_t compared = 0;       ///< predictions that came true within their horizon (each prediction of each vertex)
  std::size_t not_observed = 0;   ///< predicted, and not in contact when the horizon was over
  std::size_t not_predicted = 0;  ///< came into contact unannounced
  double median_error_s = 0;      ///< of |predicted - observed| [s]; 0 without any
  double p95_error_s = 0;         ///< [s]
  double median_signed_error_s = 0;  ///< [s] above 0: predicted too late
};

/// Newest comparisons that running statistics (~stats) summarise.
constexpr std::size_t LOOK_AHEAD_SAMPLES = 1000;

/// What a prediction cost, for the statistics of the step that it begins after.
DCCD_EXPORT StageStats lookAheadStats(const Outcome& prediction);

/// Feed it every outcome in order, and after an outcome the prediction that begins at its end, if there is one. Memory
/// grows with the vertices times the steps in a horizon, and with max_samples.
class DCCD_EXPORT LookAheadScore {
 public:
  /// max_samples: errors that are kept, the newest ones; 0: all.
  explicit LookAheadScore(double horizon_s, std::size_t max_samples = 0);

  void observe(const Outcome& outcome);
  void predict(const Outcome& prediction);
  LookAheadSummary summary() const;

 private:
  /// Body, what it touches (body or OBSTACLE_BODY), vertex.
  using Key = std::uint64_t;
  struct Prediction {
    StampNs made_ns = 0;
    double after_ns = 0;
  };
  using Times = std::map<Key, double>;

  /// The earliest certain contact of each vertex [0,1]; `touching`: all that is in contact, initial or not certain too.
  static void vertexTimes(const Outcome& outcome, Times& first, std::set<Key>* touching);
  void expire(StampNs now_ns);
  void addSample(double error_s);

  double horizon_s_;
  std::size_t max_samples_;
  bool any_ = false;
  std::set<Key> touching_;  // at the end of the last step
  std::map<Key, std::vector<Prediction>> pending_;
  std::vector<double> errors_s_;
  std::size_t next_sample_ = 0, not_observed_ = 0, not_predicted_ = 0;
};

}  // namespace dccd
