#include "output/diagnostics.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "output/advice.h"

namespace dccd {

namespace {

constexpr std::int64_t PERIOD_NS = 1000000000;

using diagnostic_msgs::DiagnosticStatus;

template <typename T>
void putValue(DiagnosticStatus& status, const char* key, const T& value) {
  std::ostringstream text;
  text << value;
  diagnostic_msgs::KeyValue pair;
  pair.key = key;
  pair.value = text.str();
  status.values.push_back(pair);
}

}  // namespace

Diagnostics::Diagnostics(const std::string& monitor) : name_(monitor + ": steps") {}

void Diagnostics::add(const Outcome& outcome, double latency_s) {
  ++outcomes_;
  answers_ += outcome.answered;
  worst_latency_s_ = std::max(worst_latency_s_, latency_s);
  status_ = outcome.status;
  reason_ = outcome.reason;
  if (!outcome.answered) return;
  map_present_ = outcome.obstacle != nullptr;
  map_reason_ = outcome.reason;
  map_age_s_ = map_present_ ? mapAge(outcome) : 0;
}

void Diagnostics::judge(DiagnosticStatus& status, bool drops, bool enabled, const std::string& map_topic,
                        const std::string& hint) const {
  // Of several with the same level the first stands, so they come in the order in which they are to be mended.
  const auto raise = [&](decltype(status.level) level, const std::string& text) {
    if (level <= status.level) return;
    status.level = level;
    status.message = text;
  };
  const auto because = [&](const std::string& what) {
    const std::string advice = adviceFor(status_, reason_, map_topic);
    return what + toString(status_) + (reason_.empty() ? "" : ": " + reason_) + (advice.empty() ? "" : "; " + advice);
  };
  if (!enabled) raise(DiagnosticStatus::WARN, "disabled");
  if (outcomes_ > 0 && answers_ == 0) raise(DiagnosticStatus::ERROR, because("no answer: "));
  if (!map_topic.empty() && answers_ > 0 && !map_present_) {
    raise(DiagnosticStatus::WARN, (status_ == StepStatus::NO_MAP ? because("") : "no octomap: " + map_reason_) +
                                      (hint.empty() ? "" : "; " + hint));
  }
  if (drops) {
    raise(DiagnosticStatus::WARN, "frames are dropped: steps take longer than the time between frames; " +
                                      adviceFor(StepStatus::QUEUE_FULL, {}, map_topic));
  }
  if (outcomes_ == 0 && enabled) raise(DiagnosticStatus::WARN, "no frames arrive" + (hint.empty() ? "" : ": " + hint));
  if (status_ != StepStatus::OK && isAnswered(status_)) raise(DiagnosticStatus::WARN, because(""));
  if (!hint.empty()) raise(DiagnosticStatus::WARN, hint);
}

bool Diagnostics::isDue(std::int64_t now_ns) const { return now_ns - last_ns_ >= PERIOD_NS; }

diagnostic_msgs::DiagnosticArray Diagnostics::take(std::int64_t now_ns, const ros::Time& stamp,
                                                   const StatsContext& context, bool enabled,
                                                   const std::string& map_topic, const std::string& hint) {
  // The first status has no period before it: as if of one second.
  const double seconds = last_ns_ == 0 ? 1 : secondsBetween(last_ns_, now_ns);
  last_ns_ = now_ns;
  DiagnosticStatus status;
  status.name = name_;
  status.level = DiagnosticStatus::OK;
  status.message = toString(status_);
  const std::uint64_t dropped = context.frames.of(StepStatus::QUEUE_FULL);
  judge(status, dropped > dropped_before_, enabled, map_topic, hint);
  dropped_before_ = dropped;
  putValue(status, "outcomes [Hz]", static_cast<double>(outcomes_) / seconds);
  putValue(status, "answers [Hz]", static_cast<double>(answers_) / seconds);
  if (worst_latency_s_ > 0) putValue(status, "worst latency [s]", worst_latency_s_);  // of a recorded run nobody waited
  putValue(status, "frames received", context.frames.received);
  putValue(status, "frames processed", context.frames.processed());
  putValue(status, "frames started anew", context.frames.started());
  putValue(status, "frames skipped", context.frames.skipped());
  putValue(status, "frames dropped", dropped);
  putValue(status, "time jumps", context.frames.of(StepStatus::TIME_JUMP));
  putValue(status, "gaps", context.frames.of(StepStatus::GAP));
  putValue(status, "steps not wholly published", context.steps_unpublished);
  putValue(status, "frames handed over in process", context.frames_handed_over);
  putValue(status, "unusable transforms", context.transforms_unusable);
  putValue(status, "wrong row_steps", context.wrong_row_steps);
  putValue(status, "messages of other markers", context.markers_passed_over);
  putValue(status, "refused requests for objects", context.requests_refused);
  putValue(status, "maps received", context.maps_received);
  putValue(status, "maps refused", context.maps_refused);
  putValue(status, "maps dropped", context.maps_dropped);
  if (map_present_) putValue(status, "map age [s]", map_age_s_);
  outcomes_ = answers_ = 0;
  worst_latency_s_ = 0;
  diagnostic_msgs::DiagnosticArray array;
  array.header.stamp = stamp;
  array.status.push_back(std::move(status));
  return array;
}

std::string describe(const Outcome& outcome) {
  std::ostringstream text;
  text << toString(outcome.status);
  if (!outcome.reason.empty()) text << " (" << outcome.reason << ")";
  if (!outcome.answered) return text.str();
  text << ": " << outcome.total_contacts << " contacts";
  if (outcome.counts.expected > 0) text << " (" << outcome.counts.expected << " expected)";
  text << ", start state " << toString(outcome.start_state);
  if (std::isfinite(outcome.earliest_toc)) text << ", earliest toc " << outcome.earliest_toc;
  text << "; " << describe(assuranceOf(outcome));
  return text.str();
}

}  // namespace dccd
