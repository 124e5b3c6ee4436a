#include "node/effects.h"

#include <algorithm>
#include <sstream>
#include <utility>

namespace dccd {

namespace {

std::string noiseOf(const BodyConfig& body) {
  const MeshInputConfig& input = body.input;
  std::ostringstream text;
  if (body.max_acceleration_m_s2 > 0) text << body.max_acceleration_m_s2 << " m/s^2 x (time between frames)^2 / 8";
  if (body.max_acceleration_m_s2 > 0 && body.hasNoise()) text << " + ";
  if (input.noise_radius_m > 0) text << input.noise_radius_m << " m";
  if (!input.noise_field.empty()) {
    text << (input.noise_radius_m > 0 ? " + " : "") << "point field '" << input.noise_field << "'";
  }
  return text.str();
}

}  // namespace

EffectTracker::EffectTracker(const MonitorConfig& config, const std::string& map_source) : settings_(config.effects) {
  for (const BodyConfig& body : config.bodies) {
    scene_.bodies.push_back(body.body);
    scene_.noise.push_back(body.isUncertain() ? noiseOf(body) : "");
  }
  scene_.map_source = config.mapName();
  if (!map_source.empty()) scene_.map_source = map_source;
  scene_.map_named = config.octomap_topic_named || config.cloud_named;
  if (config.takesClouds())
    scene_.map_parameter = config.clouds.size() == 1 ? "obstacle_cloud_topic" : "obstacle_cloud_topics";
  scene_.map_seen = config.takesMapFileAlone();
  scene_.look_ahead_s = config.monitor.look_ahead_s;
  promised_ = scene_.clearance_wanted = config.promises();
  scene_.unknown_space_counts = config.unknown_space != UnknownSpace::FREE;
  plan_ = EffectPlan(scene_, settings_);
}

bool EffectTracker::mayUseMap() const { return settingOf(settings_, Effect::OCTOMAP) != EffectSetting::OFF; }

void EffectTracker::expectMap() {
  if (scene_.map_seen) return;
  scene_.map_seen = true;
  plan_ = EffectPlan(scene_, settings_);
}

void EffectTracker::hearPredictions(bool heard) {
  if (std::exchange(scene_.predictions_heard, heard) != heard) plan_ = EffectPlan(scene_, settings_);
}

void EffectTracker::hearDistances(bool heard, bool drawn) {
  const bool wanted = heard || promised_;
  all_read_ = heard || drawn || settingOf(settings_, Effect::CLEARANCE) == EffectSetting::ON;
  if (std::exchange(scene_.clearance_wanted, wanted) != wanted) plan_ = EffectPlan(scene_, settings_);
}

void EffectTracker::setBody(std::size_t body, const Body& what) {
  scene_.bodies.resize(std::max(scene_.bodies.size(), body + 1));
  scene_.noise.resize(scene_.bodies.size());
  scene_.bodies[body] = what;
  plan_ = EffectPlan(scene_, settings_);
}

bool EffectTracker::decide(MonitorOptions& options) const {
  const bool map = mapExpected(), distances = plan_.running(Effect::CLEARANCE);
  const bool other_map = std::exchange(options.detector.obstacle_expected, map) != map;
  return std::exchange(options.detector.clearance.wanted, distances) != distances || other_map;
}

void EffectTracker::learn(const Outcome& outcome) {
  if (!outcome.answered) return;
  const bool has_map = outcome.obstacle != nullptr;
  bool changed = std::exchange(scene_.map_used, has_map) != has_map;
  for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
    const auto& topology = outcome.step->bodies[b].topology;
    std::shared_ptr<const Topology>& known = scene_.bodies[b].topology;
    const bool other = !known || known->hasFaces() != topology->hasFaces();
    if (other && scene_.bodies[b].rigid) scene_.bodies[b].t0 = outcome.step->bodies[b].t0;
    changed = changed || other;
    known = topology;
  }
  if (changed) plan_ = EffectPlan(scene_, settings_);
}

bool EffectTracker::takeNewPlan() {
  if (plan_ == told_) return false;
  told_ = plan_;
  return true;
}

diagnostic_msgs::DiagnosticArray EffectTracker::message(const ros::Time& stamp, const std::string& frame) const {
  diagnostic_msgs::DiagnosticArray out;
  out.header.stamp = stamp;
  out.header.frame_id = frame;
  for (const EffectDecision& decision : plan_.decisions()) {
    diagnostic_msgs::DiagnosticStatus state;
    state.name = decision.name;
    state.message = decision.reason;
    const auto add = [&](const char* key, const std::string& value) {
      state.values.emplace_back();
      state.values.back().key = key;
      state.values.back().value = value;
    };
    add("setting", toString(decision.setting));
    add("running", decision.running ? "true" : "false");
    out.status.push_back(state);
  }
  return out;
}

}  // namespace dccd
