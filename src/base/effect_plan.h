// Which effects a scene calls for, and one sentence why. Derived before the first step and again when the scene
// changes.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "dccd/export.h"
#include "dccd/outcome.h"

namespace dccd {

/// What a user asks of an effect.
enum class EffectSetting : std::uint8_t { AUTO, ON, OFF };
DCCD_EXPORT const char* toString(EffectSetting setting);

using EffectSettings = std::map<Effect, EffectSetting>;  ///< what is missing is auto
inline EffectSetting settingOf(const EffectSettings& settings, Effect effect) {
  const auto setting = settings.find(effect);
  return setting == settings.end() ? EffectSetting::AUTO : setting->second;
}

/// What the plan is derived from: the bodies that the flow is given, and what it is not told.
struct EffectScene {
  std::vector<Body> bodies;        ///< topology null: not known yet; t0 of rigid ones: wherever they were once
  std::vector<std::string> noise;  ///< per body, where its uncertainty radii come from, in words; empty: it has none
  std::string map_source;          ///< a topic or file, for the sentence
  std::string map_parameter = "octomap_topic";  ///< which names it, for the sentence
  bool map_named = false;                       ///< by the user, as a topic: it is missed until it comes
  bool map_seen = false;                        ///< a file is named, somebody publishes the topic, or a map has come
  bool map_used = false;                        ///< the last step that was answered had a map
  bool predictions_heard = false;               ///< somebody subscribes to them
  double look_ahead_s = 0;
  bool clearance_wanted = false;      ///< by a parameter, or a subscriber to distances
  bool unknown_space_counts = false;  ///< unknown_space is not `free`
};

struct EffectDecision {
  std::string name;  ///< toString(Effect), or a part of one
  EffectSetting setting = EffectSetting::AUTO;
  bool running = false;
  std::string reason;  ///< one sentence
  friend bool operator==(const EffectDecision& a, const EffectDecision& b) {
    return a.name == b.name && a.setting == b.setting && a.running == b.running && a.reason == b.reason;
  }
};

class DCCD_EXPORT EffectPlan {
 public:
  EffectPlan() = default;
  /// Throws std::invalid_argument when an effect is asked for (on) that the scene cannot have, with what to write
  /// instead.
  EffectPlan(const EffectScene& scene, const EffectSettings& settings);

  /// The effects in their order, then parts of them that the scene may leave out.
  const std::vector<EffectDecision>& decisions() const { return decisions_; }
  bool running(Effect effect) const;
  /// One line per effect: "self_collision: off, the body is rigid".
  std::vector<std::string> lines() const;
  friend bool operator==(const EffectPlan& a, const EffectPlan& b) { return a.decisions_ == b.decisions_; }
  friend bool operator!=(const EffectPlan& a, const EffectPlan& b) { return !(a == b); }

 private:
  std::vector<EffectDecision> decisions_;
};

}  // namespace dccd
