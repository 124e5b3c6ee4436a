#include "record/explain.h"

#include <algorithm>
#include <map>
#include <sstream>
#include <stdexcept>

#include "obstacle/excluded_leaves.h"
#include "step/history.h"
#include "step/observer.h"
#include "step/parts.h"

namespace dccd {
namespace {

using Says = TraceLine::Says;

struct Feature {
  std::size_t body;
  std::vector<Index> vertex;  // body-local, ascending
};

/// Throws std::invalid_argument where the step has no such body, or the body no such feature.
Feature featureOf(const Step& step, std::size_t body, const Index* first, std::size_t count) {
  if (body >= step.bodies.size()) {
    throw std::invalid_argument("there is no body " + std::to_string(body) + "; the step has " +
                                std::to_string(step.bodies.size()));
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
  static const char* const NAMES[] = {"vertex", "edge", "face"};
  std::string text = "body '" + step.bodies[body].name + "' has no " + NAMES[count - 1];
  for (std::size_t i = 0; i < count; ++i) text += " " + std::to_string(first[i]);
  throw std::invalid_argument(text);
}

/// Is a vertex of it masked, or not at a finite place at both ends of the step?
bool isLeftOut(const Step& step, const Feature& feature) {
  const Body& body = step.bodies[feature.body];
  return std::any_of(feature.vertex.begin(), feature.vertex.end(), [&](Index v) {
    return std::count(body.vertex_mask.begin(), body.vertex_mask.end(), v) > 0 || !(*body.t0)[v].allFinite() ||
           !(*body.t1)[v].allFinite();
  });
}

/// The step with these features' vertices alone, on a mesh that has little else.
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

/// The step as it is asked for, without what changes no answer but its time. What was cut for being too much still is.
Options plain(Options options) {
  options.num_threads = 1;
  options.step_budget_ms = options.max_compute_ms = 0;
  options.earliest_only = false;
  options.check_start_state = false;
  options.suppress_initial = false;
  options.max_contacts = Options().max_contacts;
  options.patches = false;
  return options;
}

const OccupiedLeaf* leafOf(const std::vector<OccupiedLeaf>& leaves, const VoxelKey& voxel) {
  const auto found = std::find_if(leaves.begin(), leaves.end(), [&](const OccupiedLeaf& leaf) {
    const auto inside = [&](std::uint16_t min, std::uint16_t key) {
      return key >= min && key - min < static_cast<int>(leaf.size);
    };
    return inside(leaf.min.x, voxel.x) && inside(leaf.min.y, voxel.y) && inside(leaf.min.z, voxel.z);
  });
  return found == leaves.end() ? nullptr : &*found;
}

/// What a step said of the pair, by part.
class Watch : public StepObserver {
 public:
  struct Seen {
    bool streamed = false, planar_asked = true, past_planar = false, tested = false, reached_leaf = false;
    std::string self_left_out;
    PairSeparation separation;
    ElementaryResult result;
  };
  Watch(PairKind kind, const std::vector<Feature>& features, const VoxelKey& leaf)
      : kind_(kind), features_(features), leaf_(leaf) {}

  std::map<std::size_t, Seen> parts;

  void onPart(std::size_t part, const SceneArrays& scene) override {
    scene_ = &scene;
    seen_ = &parts[part];
  }
  void onSelfLeftOut(std::size_t body, const char* why) override {
    if (features_.front().body == body && features_.back().body == body) seen_->self_left_out = why;
  }
  void onPairs(Stage stage, PairKind kind, const Quad* pairs, std::size_t count) override {
    if (!contains(kind, pairs, count)) return;
    (stage == Stage::BROAD_PHASE ? seen_->streamed : seen_->past_planar) = true;
  }
  void onPlanarSkipped(PairKind kind, const Quad* pairs, std::size_t count) override {
    if (contains(kind, pairs, count)) seen_->planar_asked = false;
  }
  void onSeparation(PairKind kind, const Quad& pair, const PairSeparation& separation) override {
    if (contains(kind, &pair, 1)) seen_->separation = separation;
  }
  void onResult(PairKind kind, const Quad& pair, const ElementaryResult& result) override {
    if (!contains(kind, &pair, 1)) return;
    seen_->tested = true;
    seen_->result = result;
  }
  void onLeaf(const Index* vertices, std::size_t count, const OccupiedLeaf& leaf) override {
    const std::vector<Index>& asked = features_[0].vertex;
    if (leaf.min == leaf_ && std::is_permutation(asked.begin(), asked.end(), vertices, vertices + count)) {
      seen_->reached_leaf = true;
    }
  }

 private:
  bool isFeature(const Index* internal, const Feature& feature) const {
    const SceneBody& body = scene_->bodies()[feature.body];
    std::vector<Index> local;
    for (std::size_t i = 0; i < feature.vertex.size(); ++i) {
      const Index place = internal[i] - body.internal_begin;  // wraps around before the body's first
      local.push_back(place < body.usedCount() ? body.slot_vertex[place] : NO_INDEX);
    }
    std::sort(local.begin(), local.end());
    return local == feature.vertex;
  }
  bool contains(PairKind kind, const Quad* pairs, std::size_t count) const {
    if (kind != kind_) return false;
    const Feature &a = features_[0], &b = features_[1];
    return std::any_of(pairs, pairs + count, [&](const Quad& q) {
      return (isFeature(q.data(), a) && isFeature(q.data() + a.vertex.size(), b)) ||
             (kind == PairKind::EDGE_EDGE && isFeature(q.data(), b) && isFeature(q.data() + 2, a));
    });
  }

  PairKind kind_;
  const std::vector<Feature>& features_;
  const VoxelKey leaf_;
  const SceneArrays* scene_ = nullptr;
  Seen* seen_ = nullptr;
};

class Explanation {
 public:
  Explanation(const Step& step, const Options& options, const PairQuestion& question)
      : step_(step),
        options_(plain(options)),
        kind_(question.kind),
        parts_(std::min(neededParts(step, options.rigid_tolerance_m), options.max_substeps)) {
    const auto& size = factsOf(kind_).vertices;
    features_.push_back(featureOf(step, question.body[0], question.vertex.data(), size[0]));
    if (!isOnMap()) features_.push_back(featureOf(step, question.body[1], question.vertex.data() + size[0], size[1]));
    if (isOnMap() && !step.map.surface) throw std::invalid_argument("the step has no map");
    if (isOnMap()) findLeaf(question.voxel);
  }

  std::vector<TraceLine> run() {
    std::string broken = brokenRule();
    if (!broken.empty()) {
      for (part_ = 0; part_ < parts_; ++part_) say("rules", Says::REJECTED, broken);
    } else if (isOnMap()) {
      tellVoxel();
    } else {
      tellPair();
    }
    return std::move(lines_);
  }

 private:
  bool isOnMap() const { return factsOf(kind_).isOnMap(); }
  const Body& body(std::size_t side) const { return step_.bodies[features_[side].body]; }

  void findLeaf(const VoxelKey& voxel) {
    const std::vector<OccupiedLeaf>& leaves = step_.map.surface->leaves();
    const auto left = leavesOutside(leaves, step_.map.surface->resolution(), step_.map.map_from_fixed.inverse(),
                                    options_.exclude_boxes);
    if (const OccupiedLeaf* leaf = leafOf(left.leaves, voxel)) {
      leaf_ = *leaf;
    } else {
      no_leaf_ = leafOf(leaves, voxel) ? "the voxel is in one of exclude_boxes" : "the map has no occupied voxel there";
    }
  }

  /// Why no stage is asked about the pair, if none is.
  std::string brokenRule() const {
    if (!no_leaf_.empty()) return no_leaf_;
    for (const Feature& f : features_) {
      if (isLeftOut(step_, f)) {
        return "a vertex of '" + step_.bodies[f.body].name + "' is masked, or its position is not finite: not checked";
      }
    }
    if (isOnMap()) return meetsMap(body(0)) ? "" : "against_obstacle of '" + body(0).name + "' is off";
    if (features_[0].body != features_[1].body) {
      return meet(body(0), features_[0].body, body(1), features_[1].body)
                 ? ""
                 : "the two bodies are not tested against each other";
    }
    for (const Index v : features_[0].vertex) {
      if (std::binary_search(features_[1].vertex.begin(), features_[1].vertex.end(), v)) {
        return "the features share vertex " + std::to_string(v);
      }
    }
    return meetsItself(body(0)) ? "" : "self-collision of '" + body(0).name + "' is off";
  }

  Outcome observe(const Step& step, const Options& options, Watch& watch) const {
    History history;
    history.impl().observer = &watch;
    return detect(step, options, history);
  }

  void say(const std::string& stage, Says says, const std::string& text) {
    lines_.push_back({part_, stage, says, text});
  }
  void saySeparation(double total_m, double noise_m) {
    std::ostringstream text;
    text << "contact from " << total_m << " m, " << noise_m << " m of it tracker noise";
    if (total_m > 0) say("separation", Says::KEPT, text.str());
  }
  static std::string interval(double lower, double upper) {
    std::ostringstream text;
    text.precision(17);
    text << "toc in [" << lower << ", " << upper << "]";
    return text.str();
  }
  const char* rung() const { return toString(options_.accuracy.rung); }

  void tellPair() {
    Watch whole(kind_, features_, leaf_.min), single(kind_, features_, leaf_.min);
    const bool cut = observe(step_, options_, whole).cut;
    Step pair = alone(step_, features_);
    pair.map = ObstacleMap();
    Options all = options_;  // with nothing culled, so that every stage is asked
    all.max_found = all.max_found_per_feature = 0;
    all.broad_phase = BroadPhase::BRUTE_FORCE;
    all.unfolded_test = false;
    observe(pair, all, single);
    for (part_ = 0; part_ < parts_; ++part_) tellPart(whole.parts[part_], single.parts[part_], cut);
  }

  void tellPart(const Watch::Seen& seen, const Watch::Seen& single, bool cut) {
    if (single.separation.left_out) {
      say("separation", Says::KEPT, "closer than the separation in the reference frame: left out of it");
    } else {
      saySeparation(single.separation.total_m, single.separation.noise_m);
    }
    if (!seen.self_left_out.empty()) {
      say("self", Says::REJECTED, seen.self_left_out);
    } else if (seen.streamed) {
      say("broad phase", Says::KEPT, "");
    } else if (cut) {
      say("broad phase", Says::UNDECIDED, "not known: the step was cut at the limit of what it may find");
    } else {
      say("broad phase", Says::REJECTED, "bounds of the pair, of clusters around it, or of the bodies stay apart");
    }
    if (!single.planar_asked) {
      say("planar", Says::KEPT, "not asked about a distance");
    } else {
      say("planar", single.past_planar ? Says::KEPT : Says::REJECTED,
          single.past_planar ? "" : "apart in a plane, or never in one plane");
    }
    if (!single.tested) return say(rung(), Says::REJECTED, "not asked: the planar filter rejects the pair");
    const ElementaryResult& result = single.result;
    const std::string settled = std::string("settled by ") + toString(result.tier);
    if (result.verdict == Verdict::NO_CONTACT) return say(rung(), Says::REJECTED, settled);
    say(rung(), result.verdict == Verdict::CONTACT ? Says::CONTACT : Says::UNDECIDED,
        interval(result.toc_lower, result.toc_upper) + ", " + settled);
  }

  void tellVoxel() {
    double noise_m = 0;
    for (const Index v : features_[0].vertex) {
      noise_m = std::max(noise_m, body(0).radius_m ? (*body(0).radius_m)[v] : 0);
    }
    saySeparation(separationFromMap(body(0)) + noise_m, noise_m);
    Options all = options_;
    all.max_found = all.max_found_per_feature = 0;
    Step feature = alone(step_, features_);
    for (Body& body : feature.bodies) body.self_collision = body.against_bodies = false;
    Watch watch(kind_, features_, leaf_.min), unused(kind_, features_, leaf_.min);
    const std::vector<Contact> found = observe(feature, all, watch).contacts;
    feature.map.surface = VoxelSurface::build(step_.map.surface->resolution(), {leaf_});
    const std::vector<Contact> of_leaf_alone = observe(feature, all, unused).contacts;
    const auto is = [&](const Contact& c) { return c.kind == kind_ && c.voxel == leaf_.min; };
    const auto contact = std::find_if(found.begin(), found.end(), is);
    const bool covered = std::any_of(of_leaf_alone.begin(), of_leaf_alone.end(), is);
    // Contacts are of the whole step: each is told in the part that it begins in.
    const double along = contact == found.end() ? 0 : contact->toc_lower * static_cast<double>(parts_);
    const std::size_t part_of_contact = std::min(static_cast<std::size_t>(along), parts_ - 1);
    for (part_ = 0; part_ < parts_; ++part_) {
      const bool reached = watch.parts[part_].reached_leaf;
      say("bounds", reached ? Says::KEPT : Says::REJECTED,
          reached ? "" : "they stay off the leaf, or off all of it that this feature could be the first to meet");
      if (part_ != part_of_contact) continue;
      if (contact == found.end()) {
        say(rung(), Says::REJECTED, covered ? "a neighbour covers the leaf where it would be met" : "");
      } else {
        say(rung(), contact->certainty == Certainty::CERTAIN ? Says::CONTACT : Says::UNDECIDED,
            interval(contact->toc_lower, contact->toc_upper) +
                (contact->initial ? ", touching when the step begins" : "") +
                (contact->leaving ? ", from within" : ""));
      }
    }
  }

  const Step& step_;
  const Options options_;
  const PairKind kind_;
  const std::size_t parts_;  // of the step
  std::vector<Feature> features_;
  OccupiedLeaf leaf_{};
  std::string no_leaf_;
  std::size_t part_ = 0;
  std::vector<TraceLine> lines_;
};

}  // namespace

std::vector<TraceLine> explain(const Step& step, const Options& options, const PairQuestion& question) {
  return Explanation(step, options, question).run();
}

const char* toString(TraceLine::Says says) {
  static const char* const NAMES[] = {"kept", "rejected", "contact", "undecided"};
  return NAMES[static_cast<std::size_t>(says)];
}

}  // namespace dccd
