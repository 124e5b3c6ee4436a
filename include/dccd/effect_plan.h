// Which effects a scene calls for, and one sentence why. Derived before the first step and again when the scene
// changes.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "dccd/export.h"

namespace dccd {

/// What a user asks of an effect.
enum class EffectSetting : std::uint8_t { AUTO, ON, OFF };
DCCD_EXPORT const char* toString(EffectSetting setting);

/// Effects that can be set, in the order in which they are shown.
DCCD_EXPORT const std::vector<std::string>& effectNames();

struct EffectBody {
  std::string name;
  bool rigid = false;
  bool self_collision = true;  ///< as the body's own parameter says
  bool topology_known = false;
  bool has_faces = true;  ///< once the topology is known
  std::string noise;      ///< where its uncertainty radii come from, in words; empty: it has none
};

/// What the plan is derived from.
struct EffectScene {
  std::vector<EffectBody> bodies;
  std::string map_source;            ///< a topic or file, for the sentence
  bool map_seen = false;             ///< a file is named, somebody publishes the topic, or a map has come
  double minimum_separation_m = 0;   ///< the largest that is named
  std::uint64_t left_out_pairs = 0;  ///< closer than that in the reference frame
  double look_ahead_s = 0;
  bool unknown_space_counts = false;  ///< unknown_space is not `free`
};

struct EffectDecision {
  std::string name;
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
  /// Settings that are missing are auto. Throws std::invalid_argument when an effect is asked for (on) that the scene
  /// cannot have, with what to write instead.
  EffectPlan(const EffectScene& scene, const std::map<std::string, EffectSetting>& settings);

  /// The settable effects, then parts of them that the scene leaves out.
  const std::vector<EffectDecision>& decisions() const { return decisions_; }
  /// Throws std::invalid_argument for an unknown name.
  bool running(const std::string& name) const;
  /// One line per effect: "self_collision: off, the body is rigid".
  std::vector<std::string> lines() const;
  friend bool operator==(const EffectPlan& a, const EffectPlan& b) { return a.decisions_ == b.decisions_; }
  friend bool operator!=(const EffectPlan& a, const EffectPlan& b) { return !(a == b); }

 private:
  std::vector<EffectDecision> decisions_;
};

}  // namespace dccd
