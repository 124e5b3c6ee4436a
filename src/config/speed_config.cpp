// How fast bodies may be: max_speed_m_s, max_acceleration_m_s2, speed_scale.
#include <algorithm>
#include <cmath>

#include "config/body_config.h"

namespace dccd {
namespace {

SpeedLaw readSpeedLaw(ParameterReader section) {
  SpeedLaw law;
  law.reaction_time_s = section.number("reaction_time_s", 0, LARGE);
  law.stopping_time_s = section.number("stopping_time_s", 0, LARGE);
  law.uncertainty_m = section.number("uncertainty_m", 0.0, 0, LARGE);
  section.finish();
  return law;
}

IntentConfig readIntent(ParameterReader section) {
  IntentConfig intent;
  intent.horizon_s = section.number("horizon_s", 0.01, MOST_PROMISED_S);
  intent.deviation_m = section.number("deviation_m", 0, LARGE);
  intent.deviation_rate_m_s = section.number("deviation_rate_m_s", 0.0, 0, LARGE);
  section.finish();
  return intent;
}

LimitsConfig readApproachLimits(ParameterReader section) {
  LimitsConfig limits;
  limits.max_m = section.number("max_m", 1e-3, LARGE);
  limits.horizon_s = section.number("horizon_s", 1e-3, MOST_PROMISED_S);
  section.finish();
  return limits;
}

/// Bodies that move by themselves, or with a link.
bool anyBounded(const MonitorConfig& config) {
  return std::any_of(config.bodies.begin(), config.bodies.end(), [](const BodyConfig& body) {
    return body.body.motion == BodyMotionKind::STREAM && std::isfinite(body.speed.max_m_s);
  });
}

}  // namespace

void readSpeeds(ParameterReader& reader, MonitorConfig& config) {
  config.speed = speedBoundOf(reader, {});
  config.max_acceleration_m_s2 = reader.number("max_acceleration_m_s2", 0.0, 0, LARGE);
  if (reader.has("speed_scale")) config.speed_law = readSpeedLaw(reader.neededSection("speed_scale"));
  if (reader.has("intent")) config.intent = readIntent(reader.neededSection("intent"));
  if (reader.has("limits")) config.limits = readApproachLimits(reader.neededSection("limits"));
}

void findCarriers(const ParameterReader& reader, MonitorConfig& config) {
  for (BodyConfig& body : config.bodies) {
    if (!std::isfinite(body.speed.relative_m_s)) continue;
    const auto carrier = std::find_if(config.bodies.begin(), config.bodies.end(), [&](const BodyConfig& other) {
      return other.isRigid() && !body.carried_by.empty() && other.tf_frame == body.carried_by;
    });
    if (carrier == config.bodies.end()) {
      reader.fail("bodies/" + body.body.name + "/carried_by",
                  "is '" + body.carried_by + "', which carries no rigid body or link that is watched");
    }
    body.speed.carrier = static_cast<std::size_t>(carrier - config.bodies.begin());
  }
}

void checkSpeeds(const ParameterReader& reader, const MonitorConfig& config) {
  if (config.limits && config.limits->max_m > config.monitor.detector.clearance.max_m)
    reader.fail("limits/max_m", "is more than clearance/max_m, up to which distances are looked for");
  if ((config.intent || config.limits) && !config.promises()) {
    reader.fail(config.intent ? "intent" : "limits",
                "needs distances and a speed bound: give max_speed_m_s, with effects/clearance not off, or remove it");
  }
  if (!config.speed_law) return;
  if (!anyBounded(config)) {
    reader.fail("speed_scale", "needs a speed bound, without which it is always 0: give max_speed_m_s, or remove it");
  }
  if (!config.promises()) {
    reader.fail("speed_scale", "needs distances, but effects/clearance is off; remove one of both");
  }
}

bool MonitorConfig::promises() const {
  return anyBounded(*this) && settingOf(effects, Effect::CLEARANCE) != EffectSetting::OFF;
}

std::vector<SpeedBound> MonitorConfig::speedBounds(std::size_t count) const {
  std::vector<SpeedBound> bounds;
  for (const BodyConfig& body : bodies) bounds.push_back(body.speed);
  bounds.resize(std::max(count, bounds.size()), robot_asked.speed.value_or(speed));
  return bounds;
}

}  // namespace dccd
