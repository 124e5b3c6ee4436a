#include "dccd/effect_plan.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace dccd {

namespace {

/// What the scene says about an effect before the user has a say.
struct Finding {
  bool wanted = false;
  bool possible = true;
  std::string reason;
};

std::string metres(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

bool ropesOnly(const EffectScene& scene) {
  return std::all_of(scene.bodies.begin(), scene.bodies.end(),
                     [](const EffectBody& body) { return body.topology_known && !body.has_faces; });
}

Finding selfCollision(const EffectScene& scene) {
  std::string can, rope;
  bool all_rigid = true;
  std::size_t deforming = 0;
  for (const EffectBody& body : scene.bodies) {
    all_rigid = all_rigid && body.rigid;
    if (body.rigid || !body.self_collision) continue;
    can += (can.empty() ? "" : ", ") + body.name;
    ++deforming;
    if (body.topology_known && !body.has_faces) rope += (rope.empty() ? "" : ", ") + body.name;
  }
  if (can.empty()) {
    return {false, !all_rigid,
            all_rigid ? (scene.bodies.size() == 1 ? "the body is rigid" : "all bodies are rigid")
                      : "it is switched off for every body that deforms"};
  }
  can += deforming == 1 ? " deforms" : " deform";
  return {true, true, can + (rope.empty() ? "" : "; of " + rope + " only edges, a polyline has no faces")};
}

Finding bodyBody(const EffectScene& scene) {
  if (scene.bodies.size() < 2) return {false, false, "there is only one body"};
  return {true, true, "there are " + std::to_string(scene.bodies.size()) + " bodies"};
}

Finding octomap(const EffectScene& scene) {
  if (scene.map_seen) return {true, true, "the map comes from " + scene.map_source};
  return {false, true, "nobody publishes " + scene.map_source + " and no octomap_file is given"};
}

Finding startState(const EffectScene& scene) {
  if (ropesOnly(scene) && !scene.map_seen) return {false, true, "edges alone cannot be inside of anything"};
  return {true, true, "surfaces that cross already at the start are invisible to continuous detection"};
}

Finding rigidBodies(const EffectScene& scene) {
  const auto count =
      std::count_if(scene.bodies.begin(), scene.bodies.end(), [](const EffectBody& b) { return b.rigid; });
  if (count == 0) return {false, false, "no body is rigid; give one under bodies/NAME/rigid"};
  return {true, true, std::to_string(count) + (count == 1 ? " body moves" : " bodies move") + " by tf"};
}

Finding unknownSpace(const EffectScene& scene) {
  if (!scene.unknown_space_counts) return {false, false, "unknown_space is free; set it to occupied or report"};
  return {true, true, "unknown_space is not free"};
}

std::string leftOut(const EffectScene& scene) {
  if (scene.left_out_pairs == 0) return "";
  return "; " + std::to_string(scene.left_out_pairs) +
         " pairs of a body's own features are closer in its reference frame and left out of it";
}

Finding minimumSeparation(const EffectScene& scene) {
  if (!(scene.minimum_separation_m > 0)) return {false, false, "minimum_separation_m is 0; set it above"};
  return {true, true, "contacts are reported from " + metres(scene.minimum_separation_m) + " m" + leftOut(scene)};
}

Finding trackerNoise(const EffectScene& scene) {
  std::string all;
  for (const EffectBody& body : scene.bodies) {
    if (!body.noise.empty()) all += (all.empty() ? "" : "; ") + body.name + ": " + body.noise;
  }
  if (all.empty()) return {false, false, "no body has an uncertainty; give one under uncertainty"};
  return {true, true, "vertices are only known to a radius (" + all + ")" + leftOut(scene)};
}

Finding lookAhead(const EffectScene& scene) {
  if (!(scene.look_ahead_s > 0)) return {false, false, "look_ahead_s is 0; set it above"};
  return {true, true, "predictions reach " + metres(scene.look_ahead_s) + " s ahead"};
}

Finding find(const std::string& name, const EffectScene& scene) {
  if (name == "self_collision") return selfCollision(scene);
  if (name == "body_body") return bodyBody(scene);
  if (name == "octomap") return octomap(scene);
  if (name == "start_state") return startState(scene);
  if (name == "rigid_bodies") return rigidBodies(scene);
  if (name == "unknown_space") return unknownSpace(scene);
  if (name == "minimum_separation") return minimumSeparation(scene);
  if (name == "tracker_noise") return trackerNoise(scene);
  return lookAhead(scene);
}

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
  return {name, setting, true, finding.wanted ? finding.reason : "switched on by effects/" + name};
}

}  // namespace

const char* toString(EffectSetting setting) {
  return setting == EffectSetting::AUTO ? "auto" : setting == EffectSetting::ON ? "on" : "off";
}

const std::vector<std::string>& effectNames() {
  static const std::vector<std::string> NAMES = {"self_collision",     "body_body",     "octomap",
                                                 "start_state",        "rigid_bodies",  "unknown_space",
                                                 "minimum_separation", "tracker_noise", "look_ahead"};
  return NAMES;
}

EffectPlan::EffectPlan(const EffectScene& scene, const std::map<std::string, EffectSetting>& settings) {
  for (const std::string& name : effectNames()) {
    const auto setting = settings.find(name);
    decisions_.push_back(
        decide(name, setting == settings.end() ? EffectSetting::AUTO : setting->second, find(name, scene)));
  }
  if (running("octomap")) {
    decisions_.push_back(
        ropesOnly(scene) ? EffectDecision{"octomap_corner_face", EffectSetting::AUTO, false, "a polyline has no faces"}
                         : EffectDecision{"octomap_corner_face", EffectSetting::AUTO, true, "a body has faces"});
  }
}

bool EffectPlan::running(const std::string& name) const {
  for (const EffectDecision& decision : decisions_) {
    if (decision.name == name) return decision.running;
  }
  throw std::invalid_argument("there is no effect '" + name + "'");
}

std::vector<std::string> EffectPlan::lines() const {
  std::vector<std::string> lines;
  for (const EffectDecision& decision : decisions_) {
    lines.push_back(decision.name + ": " + (decision.running ? "on" : "off") + ", " + decision.reason);
  }
  return lines;
}

}  // namespace dccd
