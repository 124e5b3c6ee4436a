#include "record/explain_parts.h"

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include "step/parts.h"

namespace dccd {

namespace {

[[noreturn]] void refuse(const std::string& text) { throw std::invalid_argument(text); }

}  // namespace

Feature featureOf(const Step& step, std::size_t body, const Index* first, std::size_t count) {
  if (body >= step.bodies.size()) {
    refuse("there is no body " + std::to_string(body) + "; the step has " + std::to_string(step.bodies.size()));
  }
  Feature feature{body, {first, first + count}};
  std::sort(feature.vertex.begin(), feature.vertex.end());
  const Topology& topology = *step.bodies[body].topology;
  const auto names = [&](const auto& element) {
    return std::is_permutation(element.begin(), element.end(), feature.vertex.begin(), feature.vertex.end());
  };
  const auto& used = topology.usedVertices();
  const bool exists = count == 1   ? std::binary_search(used.begin(), used.end(), *first)
                      : count == 2 ? std::any_of(topology.edges().begin(), topology.edges().end(), names)
                                   : std::any_of(topology.faces().begin(), topology.faces().end(), names);
  if (exists) return feature;
  std::string text = "body '" + step.bodies[body].name + "' has no " + feature.name();
  for (std::size_t i = 0; i < count; ++i) text += " " + std::to_string(first[i]);
  refuse(text);
}

bool isLeftOut(const Step& step, const Feature& feature) {
  const Body& body = step.bodies[feature.body];
  return std::any_of(feature.vertex.begin(), feature.vertex.end(), [&](Index v) {
    return std::count(body.vertex_mask.begin(), body.vertex_mask.end(), v) > 0 || !(*body.t0)[v].allFinite() ||
           !(*body.t1)[v].allFinite();
  });
}

Step alone(const Step& step, const std::vector<Feature>& features) {
  Step out = step;
  for (std::size_t b = 0; b < out.bodies.size(); ++b) {
    Body& body = out.bodies[b];
    std::vector<std::uint8_t> asked(body.topology->vertexCount(), 0);
    std::vector<Face> faces;
    for (const Feature& feature : features) {
      if (feature.body != b) continue;
      for (const Index v : feature.vertex) asked[v] = 1;
      const auto holds = [&](const Face& face) {
        return std::all_of(feature.vertex.begin(), feature.vertex.end(),
                           [&](Index v) { return std::count(face.begin(), face.end(), v) > 0; });
      };
      const auto face = std::find_if(body.topology->faces().begin(), body.topology->faces().end(), holds);
      if (face != body.topology->faces().end()) faces.push_back(*face);
    }
    for (Index v = 0; v < asked.size(); ++v) {
      if (!asked[v]) body.vertex_mask.push_back(v);
    }
    // A rope has no faces to choose from, and keeps its edges: the mask leaves out those that nobody asks about.
    if (body.topology->hasFaces()) body.topology = share(Topology::fromTriangles(asked.size(), faces));
  }
  return out;
}

void removeDistances(Step& step) {
  for (Body& body : step.bodies) {
    body.minimum_separation_m = 0;
    body.separations.clear();
    body.radius_m = nullptr;
    body.reference = nullptr;
  }
}

Options plain(Options options) {
  options.num_threads = 1;
  options.step_budget_ms = options.max_compute_ms = 0;
  options.max_found = options.max_found_per_feature = 0;
  options.earliest_only = false;
  options.check_start_state = false;
  options.suppress_initial = false;
  options.max_contacts = Options().max_contacts;
  options.patches = false;
  return options;
}

Explanation::Explanation(const Step& step, const Options& options)
    : step_(step),
      options_(options),
      parts_(std::min(neededParts(step, options.rigid_tolerance_m), options.max_substeps)) {}

void Explanation::say(const std::string& stage, Says says, const std::string& text) {
  lines_.push_back({part_, stage, says, text});
}

void Explanation::sayOfRung(Accuracy rung, Says says, const std::string& text) {
  say(std::string(toString(rung)) + (rung == options_.accuracy.rung ? " *" : ""), says, text);
}

void Explanation::saySeparation(double total_m, double noise_m) {
  std::ostringstream text;
  text << "contact from " << total_m << " m, " << noise_m << " m of it tracker noise";
  say("separation", Says::KEPT, text.str());
}

const char* toString(TraceLine::Says says) {
  static const char* const NAMES[] = {"kept", "rejected", "contact", "undecided"};
  return NAMES[static_cast<std::size_t>(says)];
}

}  // namespace dccd
