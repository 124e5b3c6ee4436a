#include "base/effect_plan.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <sstream>
#include <stdexcept>

#include "culling/seams.h"

namespace dccd {

namespace {

/// Whether a scene calls for an effect.
enum class Need : std::uint8_t {
  WANTED,      ///< it runs unless the user switches it off
  NOT_WANTED,  ///< it runs only if the user switches it on
  IDLE,        ///< there is nothing to do as things stand, whatever the user asks for
  IMPOSSIBLE,  ///< the scene cannot have it: to switch it on is a mistake
};

/// What the scene says about an effect before the user has a say.
struct Finding {
  Need need = Need::NOT_WANTED;
  std::string reason;
};

Finding wanted(const std::string& reason) { return {Need::WANTED, reason}; }
Finding notWanted(const std::string& reason) { return {Need::NOT_WANTED, reason}; }
Finding idle(const std::string& reason) { return {Need::IDLE, reason}; }
Finding impossible(const std::string& reason) { return {Need::IMPOSSIBLE, reason}; }

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
    return impossible(scene.bodies.size() == 1 ? "the body is rigid" : "all bodies are rigid");
  }
  can += deforming == 1 ? " deforms" : " deform";
  return wanted(can + (rope.empty() ? "" : "; of " + rope + " only edges, a polyline has no faces"));
}

Finding bodyBody(const EffectScene& scene) {
  const std::vector<Body>& bodies = scene.bodies;
  if (bodies.size() < 2) return impossible("there is only one body");
  std::size_t able = 0;
  for (const Body& body : bodies) able += body.against_bodies;
  if (able < 2) return idle("against_bodies is false for all of them but " + std::to_string(able));
  return wanted("there are " + std::to_string(able) + " bodies");
}

constexpr const char* NOBODY_MEETS_MAP = "against_obstacle is false for every body";

bool nobodyMeetsMap(const EffectScene& scene) {
  return std::none_of(scene.bodies.begin(), scene.bodies.end(), meetsMap);
}

Finding octomap(const EffectScene& scene) {
  if (nobodyMeetsMap(scene)) return idle(NOBODY_MEETS_MAP);
  if (scene.map_seen) return wanted("the map comes from " + scene.map_source);
  if (scene.map_named)
    return wanted(scene.map_parameter + " names " + scene.map_source + ", from which no map has come");
  return notWanted("nobody publishes " + scene.map_source + " and no octomap_file is given");
}

/// Of the bodies that one would take for solid and that others could be inside of, those for which that is not asked.
/// A cloth, or a camera's view, has a border by nature.
std::string notSolid(const EffectScene& scene) {
  if (std::count_if(scene.bodies.begin(), scene.bodies.end(), [](const Body& b) { return b.against_bodies; }) < 2)
    return "";
  std::string border, mask;
  for (const Body& body : scene.bodies) {
    if (!body.rigid || !body.topology || !body.topology->hasFaces() || body.shell || !body.against_bodies) continue;
    const bool sewn = body.t0 && !seamsOf(*body.topology, *body.t0, *body.t0).vertices.empty();
    if (!body.topology->isClosed() && !sewn && openFaces(*body.topology).empty()) {
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
  return wanted("surfaces that cross already at the start are invisible to continuous detection" + notSolid(scene));
}

Finding rigidBodies(const EffectScene& scene) {
  const auto count = std::count_if(scene.bodies.begin(), scene.bodies.end(), [](const Body& b) { return b.rigid; });
  if (count == 0) return impossible("no body is rigid; give one under bodies/NAME/rigid");
  return wanted(std::to_string(count) + (count == 1 ? " body moves" : " bodies move") + " by tf");
}

Finding unknownSpace(const EffectScene& scene) {
  if (!scene.unknown_space_counts) return impossible("unknown_space is free; set it to occupied");
  if (nobodyMeetsMap(scene)) return idle(NOBODY_MEETS_MAP);
  if (!scene.map_used) return idle("unknown_space is not free, but there is no map that could know it");
  return wanted("unknown_space is not free");
}

/// The largest separations of the pairs that meet, of each kind of pair [m].
struct CarriedSeparations {
  double own_m = 0;     ///< of a body from itself
  double bodies_m = 0;  ///< of two bodies
  double map_m = 0;     ///< of a body from the map, be there one or not
};

CarriedSeparations carriedSeparations(const std::vector<Body>& bodies) {
  CarriedSeparations carried;
  const auto raise = [](double& largest_m, double separation_m) { largest_m = std::max(largest_m, separation_m); };
  for (std::size_t a = 0; a < bodies.size(); ++a) {
    if (meetsItself(bodies[a])) raise(carried.own_m, separationBetween(bodies[a], a, bodies[a], a));
    if (meetsMap(bodies[a])) raise(carried.map_m, separationFromMap(bodies[a]));
    for (std::size_t b = a + 1; b < bodies.size(); ++b) {
      if (meet(bodies[a], a, bodies[b], b)) raise(carried.bodies_m, separationBetween(bodies[a], a, bodies[b], b));
    }
  }
  return carried;
}

Finding minimumSeparation(const EffectScene& scene) {
  if (!(largestSeparation(scene.bodies) > 0)) return impossible("minimum_separation_m is 0; set it above");
  const CarriedSeparations carried = carriedSeparations(scene.bodies);
  const double largest_m = std::max({carried.own_m, carried.bodies_m, scene.map_used ? carried.map_m : 0});
  if (largest_m > 0) return wanted("contacts are reported from " + metres(largest_m) + " m");
  if (carried.map_m > 0) return idle("only pairs with the map carry a separation, but there is no map");
  return idle("a separation is set, but no pair that is tested carries it");
}

bool meetsAnotherBody(const std::vector<Body>& bodies, std::size_t b) {
  for (std::size_t other = 0; other < bodies.size(); ++other) {
    if (other != b && meet(bodies[b], b, bodies[other], other)) return true;
  }
  return false;
}

Finding trackerNoise(const EffectScene& scene) {
  const std::vector<Body>& bodies = scene.bodies;
  std::string carried;
  bool any = false, any_map = false;
  for (std::size_t b = 0; b < scene.noise.size(); ++b) {
    if (scene.noise[b].empty()) continue;
    any = true;
    any_map = any_map || meetsMap(bodies[b]);
    if (!meetsItself(bodies[b]) && !meetsAnotherBody(bodies, b) && !(meetsMap(bodies[b]) && scene.map_used)) continue;
    append(carried, "; ", bodies[b].name + ": " + scene.noise[b]);
  }
  if (!any) return impossible("no body has an uncertainty; give one under uncertainty");
  if (!carried.empty()) return wanted("vertices are only known to a radius (" + carried + ")");
  if (any_map) return idle("bodies with an uncertainty meet nothing but the map, and there is no map");
  return idle("no body with an uncertainty meets anything");
}

Finding lookAhead(const EffectScene& scene) {
  if (!(scene.look_ahead_s > 0)) return impossible("look_ahead_s is 0; set it above");
  if (!scene.predictions_heard) return idle("nobody subscribes to predictions");
  return wanted("predictions reach " + metres(scene.look_ahead_s) + " s ahead");
}

Finding patches(const EffectScene&) { return wanted("contacts that belong together are told as one"); }

Finding ownVoxels(const EffectScene& scene) {
  std::string bodies;
  for (const Body& body : scene.bodies) {
    if (!ownsVoxels(body)) continue;
    append(bodies, ", ",
           body.name + " within " + (body.own_voxels_m > 0 ? metres(body.own_voxels_m) + " m" : "a voxel"));
  }
  if (bodies.empty()) return impossible("own_voxels_m is 0 for every body; set it above");
  if (!scene.map_used) return idle("there is no map");
  return wanted("what the map first shows where a body is, is no obstacle: " + bodies);
}

Finding clearance(const EffectScene& scene) {
  return scene.clearance_wanted ? wanted("distances are asked for") : notWanted("nobody asks for distances");
}

/// By Effect: what a scene says of it.
constexpr Finding (*FIND[])(const EffectScene&) = {
    selfCollision,     bodyBody,     octomap,   startState, rigidBodies, unknownSpace,
    minimumSeparation, trackerNoise, lookAhead, patches,    ownVoxels,   clearance,
};
static_assert(std::size(FIND) == static_cast<std::size_t>(Effect::COUNT), "one for each effect");

EffectDecision decide(const std::string& name, EffectSetting setting, const Finding& finding) {
  switch (setting) {
    case EffectSetting::OFF:
      return {name, setting, false, "switched off by effects/" + name};
    case EffectSetting::AUTO:
      return {name, setting, finding.need == Need::WANTED, finding.reason};
    case EffectSetting::ON:
      break;
  }
  if (finding.need == Need::IMPOSSIBLE) {
    throw std::invalid_argument("effects/" + name + " is on, but " + finding.reason + "; or write effects/" + name +
                                ": auto");
  }
  if (finding.need == Need::IDLE) return {name, setting, false, finding.reason};
  return {name, setting, true, finding.need == Need::WANTED ? finding.reason : "switched on by effects/" + name};
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
    decisions_.push_back(decide(toString(effect), settingOf(settings, effect), FIND[e](scene)));
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
