#include "output/output_messages.h"
#include "output/patch_messages.h"

#include "apps/analyze_bag/result_bag.h"

#include <algorithm>
#include <utility>

#include <std_msgs/Bool.h>
#include <std_msgs/Float64.h>

#include "input/known_types.h"
#include "output/clearance_messages.h"
#include "output/markers.h"
#include "output/safe_until_messages.h"

namespace dccd {

ResultBag::ResultBag(const std::string& path, tf2_msgs::TFMessage lent, std::string intended_topic)
    : bag_(path), diagnostics_(MONITOR_NAMESPACE), lent_(std::move(lent)), intended_topic_(std::move(intended_topic)) {}

template <class Message>
void ResultBag::write(const char* name, const ros::Time& at, const Message& message) {
  bag_.write(std::string(MONITOR_NAMESPACE) + "/" + name, at, message);
}

/// What is counted of the run so far, with or without an outcome.
static StatsContext countersOf(const MonitorPipeline& pipeline, const BagReplaySummary& so_far) {
  StatsContext context = pipeline.counters();
  context.maps_received = so_far.maps;
  context.maps_refused = so_far.maps_refused;
  context.points_no_measurement += so_far.points_no_measurement;
  return context;
}

void ResultBag::copy(const rosbag::MessageInstance& m, const MonitorPipeline& pipeline,
                     const BagReplaySummary& so_far) {
  if (!lent_.transforms.empty()) {
    namespace traits = ros::message_traits;
    using Message = tf2_msgs::TFMessage;
    const auto header =
        boost::make_shared<ros::M_string>(ros::M_string{{"type", traits::datatype<Message>()},
                                                        {"md5sum", traits::md5sum<Message>()},
                                                        {"message_definition", traits::definition<Message>()},
                                                        {"callerid", "/lent"},
                                                        {"latching", "1"}});
    bag_.write("/tf_static", m.getTime(), std::exchange(lent_, {}), header);
  }
  // With every message of the bag, so that frames that do not come are missed as they are live.
  const auto now_ns = static_cast<std::int64_t>(m.getTime().toNSec());
  if (diagnostics_.isDue(now_ns)) {
    bag_.write(DIAGNOSTICS_TOPIC, m.getTime(),
               diagnostics_.take(now_ns, m.getTime(), countersOf(pipeline, so_far), true, map_source_, ""));
  }
  const std::string own = std::string(MONITOR_NAMESPACE) + "/";
  if (m.getTopic().compare(0, own.size(), own) == 0 && m.getTopic() != intended_topic_) return;
  if (m.getTopic() == DIAGNOSTICS_TOPIC && copyOthersDiagnostics(m)) return;
  bag_.write(m.getTopic(), m.getTime(), m, m.getConnectionHeader());
}

/// False where the message holds nothing of a monitor of this name, or nothing that can be read.
bool ResultBag::copyOthersDiagnostics(const rosbag::MessageInstance& m) {
  diagnostic_msgs::DiagnosticArray::ConstPtr recorded;
  try {
    recorded = m.instantiate<diagnostic_msgs::DiagnosticArray>();
  } catch (const std::exception&) {  // it is damaged, or claims to be larger than all of the memory
  }
  if (!recorded) return false;
  diagnostic_msgs::DiagnosticArray others = *recorded;
  const auto own = std::remove_if(others.status.begin(), others.status.end(),
                                  [&](const auto& status) { return status.name == diagnostics_.name(); });
  if (own == others.status.end()) return false;
  others.status.erase(own, others.status.end());
  if (!others.status.empty()) bag_.write(DIAGNOSTICS_TOPIC, m.getTime(), others, m.getConnectionHeader());
  return true;
}

void ResultBag::addPlan(MonitorPipeline& pipeline, const ros::Time& at) {
  const std::string& frame = pipeline.fixedFrame();
  EffectTracker& effects = pipeline.effects();
  if (effects.takeNewPlan()) write("effects", at, effects.message(at, frame));
}

void ResultBag::addPatches(const Outcome& outcome, const MonitorPipeline& pipeline, const ros::Time& at) {
  if (!pipeline.config().monitor.detector.patches) return;
  const std::vector<Body>& bodies = pipeline.monitor().bodies();
  const std::string& frame = pipeline.fixedFrame();
  write("patches", at, toPatchArray(outcome, bodies, frame));
  for (const auto& event : toPatchEvents(outcome, bodies, frame)) write("events", at, event);
}

void ResultBag::addState(const Outcome& outcome, const MonitorPipeline& pipeline, const ros::Time& at) {
  deformable_ccd::State state = toState(outcome, pipeline.fixedFrame());
  state.header.stamp = at;
  fillState(pipeline.statement(), state);
  write("state", at, state);
  std_msgs::Bool clear;
  clear.data = state.clear;
  write("clear", at, clear);
}

deformable_ccd::SpeedScale speedScaleAt(const Outcome& outcome, const MonitorPipeline& pipeline, const ros::Time& at) {
  deformable_ccd::SpeedScale speed = toSpeedScale(outcome, pipeline.speedScale(outcome), pipeline.fixedFrame());
  const std::string too_old =
      whyTooOld(secondsBetween(outcome.stamp_ns, static_cast<StampNs>(at.toNSec())), 0, *pipeline.config().speed_law);
  if (!pipeline.statement().assurance.proved) {
    limitSpeed("not proved", speed);
  } else if (!too_old.empty()) {
    limitSpeed(too_old, speed);
  }
  speed.header.stamp = at;
  return speed;
}

void ResultBag::addAhead(const Outcome& outcome, MonitorPipeline& pipeline, const ros::Time& at) {
  const MonitorConfig& config = pipeline.config();
  if (config.promises()) write("safe_until", at, pipeline.safeUntilMessage(outcome, at));
  if (config.speed_law) {
    const deformable_ccd::SpeedScale speed = speedScaleAt(outcome, pipeline, at);
    write("speed_scale", at, speed);
    std_msgs::Float64 value;
    value.data = speed.scale;
    write("speed_scale/value", at, value);
  }
  if (config.limits) write("limits", at, pipeline.limitsMessage(outcome));
  if (config.intent) write("along_path", at, pipeline.alongPathMessage(outcome));
}

void ResultBag::add(const Outcome& outcome, MonitorPipeline& pipeline, const BagReplaySummary& so_far,
                    const ros::Time& at) {
  const std::vector<Body>& bodies = pipeline.monitor().bodies();
  const std::string& frame = pipeline.fixedFrame();
  const StatsContext context = countersOf(pipeline, so_far);
  write("contacts", at, toContactArray(outcome, bodies, frame));
  addPlan(pipeline, at);
  write("stats", at, toStepStats(outcome, context, frame));
  write("first_contact", at, toFirstContact(outcome, bodies, frame));
  addPatches(outcome, pipeline, at);
  if (pipeline.monitor().options().detector.clearance.wanted) {
    write("clearance", at, toClearanceArray(outcome, bodies, frame));
  }
  addState(outcome, pipeline, at);
  addAhead(outcome, pipeline, at);
  if (!frame.empty()) {
    visualization_msgs::MarkerArray markers = toMarkers(outcome, bodies, pipeline.config().markers, frame);
    addPath(outcome, pipeline.intended().path, frame, markers);
    write("markers", at, markers);
  }
  diagnostics_.add(outcome, context.latency_s);
  const MonitorConfig& config = pipeline.config();
  map_source_ = pipeline.effects().mapExpected() ? config.mapName() : "";
}

void ResultBag::addPrediction(const Outcome& prediction, const MonitorPipeline& pipeline, const ros::Time& at) {
  const std::vector<Body>& bodies = pipeline.monitor().bodies();
  const std::string& frame = pipeline.fixedFrame();
  const double horizon_s = pipeline.config().monitor.look_ahead_s;
  write("predicted_contacts", at, toContactArray(prediction, bodies, frame));
  write("time_to_contact", at, toTimeToContact(prediction, horizon_s, bodies, frame));
  if (!prediction.answered || frame.empty()) return;
  const visualization_msgs::MarkerArray ahead =
      toPredictedMarkers(prediction, horizon_s, bodies, pipeline.config().markers, frame);
  if (!ahead.markers.empty()) write("markers", at, ahead);
}

}  // namespace dccd
