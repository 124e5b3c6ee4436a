#include "node/monitor_log.h"

#include <utility>

#include <ros/console.h>

#include "input/short_text.h"
#include "input/steady_clock.h"
#include "output/advice.h"

namespace dccd {

namespace {

// A publisher that has not been heard for so long after the start may not be there; what has not come for so long after
// the first frame may not come.
constexpr std::int64_t PATIENCE_NS = 3000000000;

/// It lacks what may be on its way when frames begin to come: tf, the map, another body.
bool lacksWhatMayCome(const Outcome& outcome) {
  switch (outcome.status) {
    case StepStatus::NO_TRANSFORM:
    case StepStatus::NO_MAP:
    case StepStatus::NO_BODY:
      return true;
    case StepStatus::PARTIAL:
      return outcome.reason.find("no transform") != std::string::npos;
    default:
      return false;
  }
}

}  // namespace

MonitorLog::MonitorLog(const ros::NodeHandle& node, const std::string& name, const MonitorConfig& config)
    : node_(node), name_(name), config_(config), map_source_(mapSourceOf(node, config)) {}

void MonitorLog::complain(std::size_t body, const std::string& kind, const std::string& text) {
  complain(kind, body < config_.bodies.size() ? topicOf(body) : mapSource(), text);
}

void MonitorLog::complain(const std::string& kind, const std::string& topic, const std::string& text) {
  const std::string line = throttle_.line(topic + " " + kind, topic + ": " + shortText(text), steadyNs());
  if (!line.empty()) ROS_WARN_STREAM(line);
}

void MonitorLog::alarm(const std::string& kind, const std::string& text) {
  const std::string line = throttle_.line(kind, shortText(text), steadyNs());
  if (!line.empty()) ROS_ERROR_STREAM(line);
}

bool MonitorLog::isDue(const std::string& kind) { return !throttle_.line(kind, kind, steadyNs()).empty(); }

bool MonitorLog::isStarting() const {
  return !has_started_ && (first_ns_ == 0 || steadyNs() - first_ns_ <= PATIENCE_NS);
}

bool MonitorLog::waits(const std::string& what) {
  if (!isStarting()) return false;
  if (!std::exchange(told_waiting_, true)) ROS_INFO_STREAM(name_ << " waits: " << shortText(what));
  return true;
}

void MonitorLog::tell(const Outcome& outcome, const Statement& said) {
  if (first_ns_ == 0) first_ns_ = steadyNs();
  if (outcome.status == StepStatus::OK && !std::exchange(has_started_, true) && told_waiting_) {
    ROS_INFO_STREAM(name_ << ": what it waited for has come");
  }
  if (outcome.status == StepStatus::OK || outcome.status == StepStatus::FIRST_FRAME) return;
  if (said.is_doubts_fault) return complain(config_.monitor.clock_body, "doubt", said.doubts.front());
  // A long reason is cut, and never what is to be done.
  const std::string what = toString(outcome.status) + (outcome.reason.empty() ? "" : ": " + outcome.reason);
  const std::string text = joined(shortText(what, MAX_TEXT / 2), said.hint);
  if (lacksWhatMayCome(outcome) && waits(text)) return;
  if (outcome.status != StepStatus::TIME_JUMP) {
    return complain(config_.monitor.clock_body, toString(outcome.status), text);
  }
  // A replay that loops is no reason to warn.
  const std::string topic = topicOf(config_.monitor.clock_body);
  const std::string line = throttle_.line(topic + " TIME_JUMP", topic + ": " + text, steadyNs());
  if (!line.empty()) ROS_INFO_STREAM(line);
}

bool MonitorLog::isSilenceDue(std::int64_t now_ns) {
  if (asked_ns_ == 0) asked_ns_ = now_ns;
  if (now_ns - asked_ns_ < PATIENCE_NS) return false;
  asked_ns_ = now_ns;
  return true;
}

void MonitorLog::hintAt(std::string silence, const MonitorPipeline& pipeline) {
  std::string text = std::move(silence);
  for (std::size_t b = 0; b < config_.bodies.size(); ++b) {
    const std::string hint = joined(pipeline.hint(b), pipeline.onlyPassedOver(b));
    if (hint.empty()) continue;
    const BodyConfig& body = config_.bodies[b];
    const std::string source = body.isRigid() ? "body '" + body.body.name + "'" : topicOf(b);
    text += (text.empty() ? "" : "; ") + source + ": " + hint;
  }
  if (text.empty() && !std::exchange(told_hint_, {}).empty()) ROS_INFO_STREAM(name_ << ": what was missing has come");
  if (!text.empty() && text != told_hint_ && isDue("hint")) {
    told_hint_ = text;
    if (isStarting() && isYetToCome(text)) {
      ROS_INFO_STREAM(name_ << ": " << text);
    } else {
      ROS_WARN_STREAM(name_ << ": " << text);
    }
  }
  hint_ = std::move(text);
}

}  // namespace dccd
