#include "output/outputs.h"

#include <optional>

#include "output/clearance_messages.h"
#include "output/markers.h"
#include "output/patch_messages.h"

namespace dccd {

namespace {

constexpr std::uint32_t EVENT_QUEUE = 4096;  // many may come of one step, a message each

}  // namespace

Outputs::Outputs(ros::NodeHandle& node, const MonitorConfig& config) {
  contacts_ = node.advertise<deformable_ccd::ContactArray>("contacts", TOPIC_QUEUE);
  first_contact_ = node.advertise<deformable_ccd::FirstContact>("first_contact", TOPIC_QUEUE);
  stats_ = node.advertise<deformable_ccd::StepStats>("stats", TOPIC_QUEUE);
  markers_ = node.advertise<visualization_msgs::MarkerArray>("markers", 2);
  effects_ = node.advertise<diagnostic_msgs::DiagnosticArray>("effects", 1, true);
  if (config.monitor.look_ahead_s > 0) {
    predicted_ = node.advertise<deformable_ccd::ContactArray>("predicted_contacts", TOPIC_QUEUE);
    time_to_contact_ = node.advertise<deformable_ccd::FirstContact>("time_to_contact", TOPIC_QUEUE);
  }
  if (config.monitor.detector.patches) {
    patches_ = node.advertise<deformable_ccd::PatchArray>("patches", TOPIC_QUEUE);
    events_ = node.advertise<deformable_ccd::PatchEvent>("events", EVENT_QUEUE);
  }
  if (settingOf(config.effects, Effect::CLEARANCE) != EffectSetting::OFF) {
    clearance_ = node.advertise<deformable_ccd::ClearanceArray>("clearance", TOPIC_QUEUE);
  }
  if (config.promises()) safe_until_ = node.advertise<deformable_ccd::SafeUntil>("safe_until", TOPIC_QUEUE, true);
  if (config.intent) along_path_ = node.advertise<deformable_ccd::AlongPath>("along_path", TOPIC_QUEUE);
  if (config.limits) limits_ = node.advertise<deformable_ccd::Limits>("limits", TOPIC_QUEUE);
}

std::function<void()> Outputs::makeResult(const Outcome& outcome, const std::vector<Body>& bodies,
                                          const std::string& frame) {
  std::optional<deformable_ccd::FirstContact> first;
  if (first_contact_.getNumSubscribers() > 0) first = toFirstContact(outcome, bodies, frame);
  const bool listed = contacts_.getNumSubscribers() > 0;
  if (listed) fillContactArray(outcome, bodies, frame, list_);
  // Of a step from before somebody asked there are no distances.
  std::optional<deformable_ccd::ClearanceArray> distances;
  if (wantsDistances() && !(outcome.answered && outcome.clearances.empty())) {
    distances = toClearanceArray(outcome, bodies, frame);
  }
  std::optional<deformable_ccd::PatchArray> patches;
  if (patches_.getNumSubscribers() > 0) patches = toPatchArray(outcome, bodies, frame);
  std::vector<deformable_ccd::PatchEvent> events;
  if (events_.getNumSubscribers() > 0) events = toPatchEvents(outcome, bodies, frame);
  return [this, listed, first = std::move(first), distances = std::move(distances), patches = std::move(patches),
          events = std::move(events)] {
    if (first) first_contact_.publish(*first);
    if (listed) contacts_.publish(list_);
    if (distances) clearance_.publish(*distances);
    if (patches) patches_.publish(*patches);
    for (const auto& event : events) events_.publish(event);
  };
}

void Outputs::publishMarkers(const Outcome& outcome, const std::vector<Body>& bodies, const MarkerConfig& markers,
                             const std::string& frame, const IntendedPath& path) {
  if (markers_.getNumSubscribers() == 0 || frame.empty()) return;
  visualization_msgs::MarkerArray array = toMarkers(outcome, bodies, markers, frame);
  addPath(outcome, path, frame, array);
  markers_.publish(array);
}

void Outputs::publishStats(const Outcome& outcome, const StatsContext& context, const std::string& frame) {
  stats_.publish(toStepStats(outcome, context, frame));
}

bool Outputs::wantsStats() const { return stats_.getNumSubscribers() > 0; }

bool Outputs::wantsPrediction() const {
  return predicted_.getNumSubscribers() > 0 || time_to_contact_.getNumSubscribers() > 0 ||
         (time_to_contact_ && markers_.getNumSubscribers() > 0);
}

bool Outputs::wantsDistances() const { return clearance_.getNumSubscribers() > 0; }

bool Outputs::wantsMarkers() const { return markers_.getNumSubscribers() > 0; }

void Outputs::publishPrediction(const Outcome& prediction, double horizon_s, const std::vector<Body>& bodies,
                                const MarkerConfig& markers, const std::string& frame) {
  if (predicted_.getNumSubscribers() > 0) predicted_.publish(fillContactArray(prediction, bodies, frame, list_));
  if (time_to_contact_.getNumSubscribers() > 0) {
    time_to_contact_.publish(toTimeToContact(prediction, horizon_s, bodies, frame));
  }
  if (markers_.getNumSubscribers() > 0 && prediction.answered && !frame.empty()) {
    const visualization_msgs::MarkerArray ahead = toPredictedMarkers(prediction, horizon_s, bodies, markers, frame);
    if (!ahead.markers.empty()) markers_.publish(ahead);
  }
}

void Outputs::publishSafeUntil(const deformable_ccd::SafeUntil& message) { safe_until_.publish(message); }

void Outputs::publishLimits(const std::function<deformable_ccd::Limits()>& make) {
  if (limits_ && limits_.getNumSubscribers() > 0) limits_.publish(make());
}
void Outputs::publishAlongPath(const deformable_ccd::AlongPath& message) { along_path_.publish(message); }

void Outputs::publishEffects(const diagnostic_msgs::DiagnosticArray& effects) { effects_.publish(effects); }

void Outputs::publishNothing(const std::string& frame) {
  // Of an outcome without an answer all that is shown is that what was there before is gone.
  if (markers_.getNumSubscribers() > 0 && !frame.empty()) markers_.publish(toMarkers({}, {}, {}, frame));
}

}  // namespace dccd
