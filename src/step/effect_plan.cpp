#include "dccd/effect_plan.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <sstream>
#include <stdexcept>

namespace dccd {

namespace {

/// What the scene says about an effect before the user has a say.
struct Finding {
  bool wanted = false;
  bool possible = true;
  std::string reason;
  bool idle = false;  ///< there is nothing to do as things stand, whatever the user asks for
};

Finding idle(const std::string& reason) { return {false, true, reason, true}; }

std::string metres(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

bool ropesOnly(const EffectScene& scene) {
  return std::all_of(scene.bodies.begin(), scene.bodies.end(),
                     [](const Body& body) { return body.topology && !body.topology->hasFaces(); });
}

void append(std::string& list, const std::string& separator, const std::string& item) {
  list += (list.empty() ? "" : separator) + item;
}

Finding selfCollision(const EffectScene& scene) {
  std::string can, rope;
  std::size_t deforming = 0;
  for (const Body& body : scene.bodies) {
    if (!meetsItself(body)) continue;
    append(can, ", ", body.name);
    ++deforming;
    if (body.topology && !body.topology->hasFaces()) append(rope, ", ", body.name);
  }
  if (can.empty()) {
    const bool all_rigid = std::all_of(scene.bodies.begin(), scene.bodies.end(), [](const Body& b) { return b.rigid; });
    if (!all_rigid) return idle("it is switched off for every body that deforms");
    return {false, false, scene.bodies.size() == 1 ? "the body is rigid" : "all bodies are rigid"};
  }
  can += deforming == 1 ? " deforms" : " deform";
  return {true, true, can + (rope.empty() ? "" : "; of " + rope + " only edges, a polyline has no faces")};
}

Finding bodyBody(const EffectScene& scene) {
  const std::vector<Body>& bodies = scene.bodies;
  if (bodies.size() < 2) return {false, false, "there is only one body"};
  std::size_t able = 0;
  for (const Body& body : bodies) able += meet(body, body);
  if (able < 2) return idle("against_bodies is false for all of them but " + std::to_string(able));
  return {true, true, "there are " + std::to_string(able) + " bodies"};
}

constexpr const char* NOBODY_MEETS_MAP = "against_obstacle is false for every body";

bool nobodyMeetsMap(const EffectScene& scene) {
  return std::none_of(scene.bodies.begin(), scene.bodies.end(), meetsMap);
}

Finding octomap(const EffectScene& scene) {
  if (nobodyMeetsMap(scene)) return idle(NOBODY_MEETS_MAP);
  if (scene.map_seen) return {true, true, "the map comes from " + scene.map_source};
  if (scene.map_named) {
    return {true, true, "octomap_topic names " + scene.map_source + ", from which no map has come"};
  }
  return {false, true, "nobody publishes " + scene.map_source + " and no octomap_file is given"};
}

/// Of the bodies that one would take for solid and that others could be inside of, those for which that is not asked.
/// A cloth, or a camera's view, has a border by nature.
std::string notSolid(const EffectScene& scene) {
  if (std::count_if(scene.bodies.begin(), scene.bodies.end(), [](const Body& b) { return meet(b, b); }) < 2) return "";
  std::string border, mask;
  for (const Body& body : scene.bodies) {
    if (!body.rigid || !body.topology || !body.topology->hasFaces() || body.shell || !meet(body, body)) continue;
    if (!body.topology->isClosed()) {
      append(border, ", ", body.name);
    } else if (!body.vertex_mask.empty()) {
      append(mask, ", ", body.name);
    }
  }
  return (border.empty() ? "" : "; with a border, no inside: " + border) +
         (mask.empty() ? "" : "; with masked vertices, no inside: " + mask);
}

Finding startState(const EffectScene& scene) {
  if (ropesOnly(scene) && !scene.map_used) {
    return idle("edges alone cannot be inside of anything, and there is no map");
  }
  return {true, true,
          "surfaces that cross already at the start are invisible to continuous detection" + notSolid(scene)};
}

Finding rigidBodies(const EffectScene& scene) {
  const auto count = std::count_if(scene.bodies.begin(), scene.bodies.end(), [](const Body& b) { return b.rigid; });
  if (count == 0) return {false, false, "no body is rigid; give one under bodies/NAME/rigid"};
  return {true, true, std::to_string(count) + (count == 1 ? " body moves" : " bodies move") + " by tf"};
}

Finding unknownSpace(const EffectScene& scene) {
  if (!scene.unknown_space_counts) return {false, false, "unknown_space is free; set it to occupied or report"};
  if (nobodyMeetsMap(scene)) return idle(NOBODY_MEETS_MAP);
  if (!scene.map_used) return idle("unknown_space is not free, but there is no map that could know it");
  return {true, true, "unknown_space is not free"};
}

std::string leftOut(const EffectScene& scene) {
  if (scene.left_out_pairs == 0) return "";
  return "; " + std::to_string(scene.left_out_pairs) +
         " pairs of a body's own features are closer in its reference frame and left out of it";
}

Finding minimumSeparation(const EffectScene& scene) {
  const double largest_m = largestSeparation(scene.bodies);
  if (!(largest_m > 0)) return {false, false, "minimum_separation_m is 0; set it above"};
  return {true, true, "contacts are reported from " + metres(largest_m) + " m" + leftOut(scene)};
}

Finding trackerNoise(const EffectScene& scene) {
  std::string all;
  for (std::size_t b = 0; b < scene.noise.size(); ++b) {
    if (!scene.noise[b].empty()) append(all, "; ", scene.bodies[b].name + ": " + scene.noise[b]);
  }
  if (all.empty()) return {false, false, "no body has an uncertainty; give one under uncertainty"};
  return {true, true, "vertices are only known to a radius (" + all + ")" + leftOut(scene)};
}

Finding lookAhead(const EffectScene& scene) {
  if (!(scene.look_ahead_s > 0)) return {false, false, "look_ahead_s is 0; set it above"};
  if (!scene.predictions_heard) return idle("nobody subscribes to predictions");
  return {true, true, "predictions reach " + metres(scene.look_ahead_s) + " s ahead"};
}

Finding patches(const EffectScene& scene) {
  if (scene.earliest_only) return {false, false, "earliest_only is true, and patches are made of all contacts"};
  return {true, true, "contacts that belong together are told as one"};
}

/// By Effect: what a scene says of it.
constexpr Finding (*FIND[])(const EffectScene&) = {
    selfCollision, bodyBody,          octomap,      startState, rigidBodies,
    unknownSpace,  minimumSeparation, trackerNoise, lookAhead,  patches,
};
static_assert(std::size(FIND) == static_cast<std::size_t>(Effect::COUNT), "one for each effect");

EffectDecision decide(const std::string& name, EffectSetting setting, const Finding& finding) {
  switch (setting) {
    case EffectSetting::OFF:
      return {name, setting, false, "switched off by effects/" + name};
    case EffectSetting::AUTO:
      return {name, setting, finding.wanted, finding.reason};
    case EffectSetting::ON:
      break;
  }
  if (!finding.possible) {
    throw std::invalid_argument("effects/" + name + " is on, but " + finding.reason + "; or write effects/" + name +
                                ": auto");
  }
  if (finding.idle) return {name, setting, false, finding.reason};
  return {name, setting, true, finding.wanted ? finding.reason : "switched on by effects/" + name};
}

}  // namespace

const char* toString(EffectSetting setting) {
  return setting == EffectSetting::AUTO ? "auto" : setting == EffectSetting::ON ? "on" : "off";
}

const char* toString(Effect effect) {
#define DCCD_EFFECT_NAME(EFFECT, name) #name,
  static constexpr const char* NAMES[] = {DCCD_EFFECTS(DCCD_EFFECT_NAME)};
#undef DCCD_EFFECT_NAME
  return NAMES[static_cast<std::size_t>(effect)];
}

EffectPlan::EffectPlan(const EffectScene& scene, const EffectSettings& settings) {
  for (std::size_t e = 0; e < std::size(FIND); ++e) {
    const Effect effect = static_cast<Effect>(e);
    const auto setting = settings.find(effect);
    decisions_.push_back(
        decide(toString(effect), setting == settings.end() ? EffectSetting::AUTO : setting->second, FIND[e](scene)));
  }
  if (!running(Effect::OCTOMAP)) return;
  const bool faces = !ropesOnly(scene);
  decisions_.push_back(
      {"octomap_corner_face", EffectSetting::AUTO, faces, faces ? "a body has faces" : "a polyline has no faces"});
}

bool EffectPlan::running(Effect effect) const {
  const std::size_t e = static_cast<std::size_t>(effect);
  return e < decisions_.size() && decisions_[e].running;
}

std::vector<std::string> EffectPlan::lines() const {
  std::vector<std::string> lines;
  for (const EffectDecision& decision : decisions_) {
    lines.push_back(decision.name + ": " + (decision.running ? "on" : "off") + ", " + decision.reason);
  }
  return lines;
}

}  // namespace dccd
