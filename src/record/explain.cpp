#include "record/explain.h"

#include <algorithm>
#include <map>
#include <sstream>
#include <stdexcept>

#include "dccd/accuracy.h"
#include "obstacle/excluded_leaves.h"
#include "projection/toc_bound.h"
#include "step/history.h"
#include "step/map_frame.h"
#include "step/parts.h"

namespace dccd {

namespace {

using Says = TraceLine::Says;

[[noreturn]] void refuse(const std::string& text) { throw std::invalid_argument(text); }

/// The features that the question names, body-local: one for a voxel, two for a pair.
struct Feature {
  std::size_t body;
  std::vector<Index> vertex;  // ascending

  const char* name() const { return vertex.size() == 1 ? "vertex" : vertex.size() == 2 ? "edge" : "face"; }
};

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

/// The step with these features' vertices alone, on a mesh that has little else: every pair of it can be looked at.
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
    // A rope is small as it is.
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

std::string rungName(Accuracy rung, const Options& options) {
  return std::string(toString(rung)) + (rung == options.accuracy.rung ? " *" : "");
}

/// All rungs that have an elementary test.
std::vector<Accuracy> testedRungs() {
  std::vector<Accuracy> rungs = allRungs();
  rungs.erase(std::remove(rungs.begin(), rungs.end(), Accuracy::SCREEN), rungs.end());
  return rungs;
}

/// What a step said of one pair of mesh features, by part.
class Watch : public StepObserver {
 public:
  struct Seen {
    bool streamed = false, planar_asked = true, past_planar = false, tested = false;
    std::string self_left_out;
    PairSeparation separation;
    ElementaryResult result;
  };
  Watch(PairKind kind, const std::vector<Feature>& features) : kind_(kind), features_(features) {}

  std::map<std::size_t, Seen> parts;

  void onPart(std::size_t part, const SceneArrays& scene) override {
    scene_ = &scene;
    seen_ = &parts[part];
  }
  void onSelfLeftOut(std::size_t body, const char* why) override {
    if (features_[0].body == body && features_[1].body == body) seen_->self_left_out = why;
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
  const SceneArrays* scene_ = nullptr;
  Seen* seen_ = nullptr;
};

/// The step as it is asked for, without what changes no answer but its time.
Options plain(Options options) {
  options.num_threads = 1;
  options.step_budget_ms = 0;
  options.earliest_only = false;
  options.check_start_state = false;
  options.suppress_initial = false;
  options.max_contacts = Options().max_contacts;
  return options;
}

class PairExplanation {
 public:
  PairExplanation(const Step& step, const Options& options, const PairQuestion& question)
      : step_(step), options_(options), question_(question) {
    const std::size_t first = question.kind == PairKind::VERTEX_FACE ? 1 : 2;
    features_ = {featureOf(step, question.body[0], question.vertex.data(), first),
                 featureOf(step, question.body[1], question.vertex.data() + first, 4 - first)};
  }

  std::vector<TraceLine> run() {
    const std::string rule = brokenRule();
    const std::size_t parts = std::min(requiredSubsteps(step_, options_.rigid_tolerance_m), options_.max_substeps);
    if (!rule.empty()) {
      for (std::size_t part = 0; part < parts; ++part) lines_.push_back({part, "rules", Says::REJECTED, rule});
      return lines_;
    }
    // As it is; then with the pair alone and nothing culled, so that every stage is asked.
    Options whole = plain(options_);
    if (whole.accuracy.rung == Accuracy::SCREEN) whole.accuracy.rung = Accuracy::CONSERVATIVE;  // it has no result
    const auto seen = observe(step_, whole);
    Step pair = alone(step_, features_);
    pair.map = ObstacleMap();
    Options all = whole;
    all.broad_phase = BroadPhase::BRUTE_FORCE;
    all.unfolded_test = false;
    all.accuracy.rung = Accuracy::CONSERVATIVE;
    const auto conservative = observe(pair, all);
    removeDistances(pair);
    std::map<Accuracy, std::map<std::size_t, Watch::Seen>> rungs;
    for (const Accuracy rung : testedRungs()) {
      all.accuracy.rung = rung;
      rungs[rung] = observe(pair, all);
    }
    for (part_ = 0; part_ < parts; ++part_) {
      say("rules", Says::KEPT, "a pair that the step asks about");
      tellStages(seen.at(part_), conservative.at(part_), linearBound(parts, conservative.at(part_).separation.total_m));
      const bool held = conservative.at(part_).separation.total_m > 0;
      for (const Accuracy rung : testedRungs()) {
        if (!held) tellRung(rung, rungs.at(rung).at(part_));
        if (held && rung == Accuracy::CONSERVATIVE) tellRung(rung, conservative.at(part_));
      }
    }
    return lines_;
  }

 private:
  void say(const std::string& stage, Says says, const std::string& text) {
    lines_.push_back({part_, stage, says, text});
  }

  std::map<std::size_t, Watch::Seen> observe(const Step& step, const Options& options) const {
    Watch watch(question_.kind, features_);
    History history;
    history.impl().observer = &watch;
    detect(step, options, history);
    return watch.parts;
  }

  /// Why no stage is asked about the pair, if none is.
  std::string brokenRule() const {
    const Body &a = step_.bodies[features_[0].body], &b = step_.bodies[features_[1].body];
    const bool self = features_[0].body == features_[1].body;
    for (const Index v : features_[0].vertex) {
      if (self && std::binary_search(features_[1].vertex.begin(), features_[1].vertex.end(), v)) {
        return "the features share vertex " + std::to_string(v);
      }
    }
    for (const Feature& f : features_) {
      if (isLeftOut(step_, f)) {
        return "a vertex of '" + step_.bodies[f.body].name + "' is masked, or its position is not finite: not checked";
      }
    }
    if (self && !meetsItself(a)) return "self-collision of '" + a.name + "' is off";
    if (!self && !meet(a, b)) return "against_bodies of one of the bodies is off";
    return "";
  }

  double linearBound(std::size_t parts, double separation_m) const {
    PairMotion pair{};
    for (int i = 0; i < 4; ++i) {
      const std::size_t body = question_.body[question_.kind == PairKind::VERTEX_FACE ? i > 0 : i > 1];
      const Vec3 from = placeVertex(step_, body, question_.vertex[i], part_, parts);
      const Vec3 to = placeVertex(step_, body, question_.vertex[i], part_ + 1, parts);
      std::copy_n(from.data(), 3, pair.x[0][i]);
      std::copy_n(to.data(), 3, pair.x[1][i]);
    }
    return linearTocBound(question_.kind, pair, separation_m);
  }

  void tellStages(const Watch::Seen& seen, const Watch::Seen& single, double bound) {
    std::ostringstream text;
    if (single.separation.left_out) {
      say("separation", Says::KEPT, "closer than the separation in the reference frame: left out of it");
    } else if (single.separation.total_m > 0) {
      text << "contact from " << single.separation.total_m << " m, " << single.separation.noise_m
           << " m of it tracker noise";
      say("separation", Says::KEPT, text.str());
    }
    if (!seen.self_left_out.empty()) say("unfolded", Says::REJECTED, seen.self_left_out);
    text.str("");
    text.precision(17);
    text << "the projections overlap in all 8 directions at some time, not before toc " << bound;
    say("linear", bound > 1 ? Says::REJECTED : Says::KEPT,
        bound > 1 ? "in one of the 8 directions the projections stay apart during the whole step" : text.str());
    if (seen.self_left_out.empty()) {
      say("broad phase", seen.streamed ? Says::KEPT : Says::REJECTED,
          seen.streamed ? "the clustered trees stream the pair"
                        : "the bounds of the pair, of clusters around it, or of the two bodies stay apart");
    }
    if (!single.planar_asked) {
      say("planar", Says::KEPT, "not asked: it proves 'never touch', not 'never closer than'");
    } else if (single.past_planar) {
      say("planar", Says::KEPT, "no plane and no sign of the volume tells them apart");
    } else {
      say("planar", Says::REJECTED, "apart in a plane, or never in one plane (non-penetration)");
    }
  }

  void tellRung(Accuracy rung, const Watch::Seen& seen) {
    std::ostringstream text;
    text.precision(17);
    Says says = Says::REJECTED;
    if (!seen.tested) {
      text << "not asked: the planar filter rejects the pair";
    } else {
      const ElementaryResult& result = seen.result;
      if (result.verdict == Verdict::NO_CONTACT) {
        text << "no contact";
      } else {
        text << "toc in [" << result.toc_lower << ", " << result.toc_upper << "]";
        says = result.verdict == Verdict::CONTACT ? Says::CONTACT : Says::UNDECIDED;
      }
      text << ", settled by " << toString(result.tier);
    }
    say(rungName(rung, options_), says, text.str());
  }

  const Step& step_;
  const Options& options_;
  const PairQuestion& question_;
  std::vector<Feature> features_;
  std::size_t part_ = 0;
  std::vector<TraceLine> lines_;
};

const char* nameOf(PairKind kind) {
  return kind == PairKind::VERTEX_VOXEL_FACE ? "vertex" : kind == PairKind::EDGE_VOXEL_EDGE ? "edge" : "face";
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

class VoxelExplanation {
 public:
  VoxelExplanation(const Step& step, const Options& options, const VoxelQuestion& question)
      : step_(step),
        options_(options),
        question_(question),
        feature_(featureOf(step, question.body, question.vertex.data(), question.vertex.size())) {
    if (!step.map.surface) refuse("the step has no map");
  }

  std::vector<TraceLine> run() {
    const std::vector<OccupiedLeaf> left = leavesOutside(step_.map.surface->leaves(), step_.map.surface->resolution(),
                                                         step_.map.map_from_fixed.inverse(), options_.exclude_boxes)
                                               .leaves;
    const OccupiedLeaf* leaf = leafOf(left, question_.voxel);
    const std::size_t parts = std::min(requiredSubsteps(step_, options_.rigid_tolerance_m), options_.max_substeps);
    if (!tellRules(leaf)) return lines_;
    tellSeparation();
    Step feature = alone(step_, {feature_});
    for (Body& body : feature.bodies) body.self_collision = body.against_bodies = false;
    if (distance_m_ <= 0) removeDistances(feature);  // of other bodies; `exact` holds none
    Step single = feature;
    single.map.surface = VoxelSurface::build(step_.map.surface->resolution(), {*leaf});
    for (part_ = 0; part_ < parts; ++part_) tellBounds(*leaf, parts);
    for (const Accuracy rung : testedRungs()) {
      if (distance_m_ > 0 && rung != Accuracy::CONSERVATIVE) continue;
      Options options = plain(options_);
      options.accuracy.rung = rung;
      tellRung(rung, *leaf, contacts(feature, options), contacts(single, options), parts);
    }
    std::stable_sort(lines_.begin(), lines_.end(),
                     [](const TraceLine& a, const TraceLine& b) { return a.part < b.part; });
    return lines_;
  }

 private:
  const Body& body() const { return step_.bodies[question_.body]; }
  void say(const std::string& stage, Says says, const std::string& text) {
    lines_.push_back({part_, stage, says, text});
  }

  bool tellRules(const OccupiedLeaf* leaf) {
    std::string why;
    if (!meetsMap(body())) why = "against_obstacle of '" + body().name + "' is off";
    if (isLeftOut(step_, feature_)) why = "a vertex is masked, or its position is not finite: not checked";
    if (!leaf) {
      why = leafOf(step_.map.surface->leaves(), question_.voxel) ? "the voxel is in one of exclude_boxes"
                                                                 : "the map has no occupied voxel there";
    }
    if (!why.empty()) {
      say("rules", Says::REJECTED, why);
      return false;
    }
    std::ostringstream text;
    text << "a pair that the step asks about; the leaf begins at " << leaf->min.x << ' ' << leaf->min.y << ' '
         << leaf->min.z << " and is " << leaf->size << " voxels wide";
    say("rules", Says::KEPT, text.str());
    return true;
  }

  void tellSeparation() {
    distance_m_ = body().minimum_separation_m;
    for (const SeparationFrom& from : body().separations) {
      if (from.body == OBSTACLE_BODY) distance_m_ = from.separation_m;
    }
    double radius_m = 0;
    for (const Index v : question_.vertex) radius_m = std::max(radius_m, body().radius_m ? (*body().radius_m)[v] : 0);
    distance_m_ += radius_m;
    if (distance_m_ <= 0) return;
    std::ostringstream text;
    text << "contact from " << distance_m_ << " m, " << radius_m << " m of it tracker noise";
    say("separation", Says::KEPT, text.str());
  }

  /// The box of the feature's way and the leaf's.
  void tellBounds(const OccupiedLeaf& leaf, std::size_t parts) {
    const std::uint16_t key[3] = {leaf.min.x, leaf.min.y, leaf.min.z};
    const double resolution = step_.map.surface->resolution(), reach_m = distance_m_ * (1 + tolerance::MAP_REACH);
    Box way;
    for (const Index v : question_.vertex) {
      for (const std::size_t end : {part_, part_ + 1}) {
        const Vec3 at = step_.map.map_from_fixed * placeVertex(step_, question_.body, v, end, parts);
        way.min = way.min.cwiseMin(at);
        way.max = way.max.cwiseMax(at);
      }
    }
    for (int axis = 0; axis < 3; ++axis) {
      const double begin = voxelPlane(key[axis], resolution);
      const double end = voxelPlane(static_cast<std::int64_t>(key[axis]) + leaf.size, resolution);
      if (way.min[axis] - end <= reach_m && begin - way.max[axis] <= reach_m) continue;
      std::ostringstream text;
      text << "apart along the map's "
           << "xyz"[axis] << ": the way spans " << way.min[axis] << " to " << way.max[axis] << " m, the leaf " << begin
           << " to " << end;
      return say("bounds", Says::REJECTED, text.str());
    }
    say("bounds", Says::KEPT, "the box of the way reaches the leaf");
  }

  static std::vector<Contact> contacts(const Step& step, const Options& options) {
    History history;
    return detect(step, options, history).contacts;
  }

  bool isQuestion(const Contact& c, const OccupiedLeaf& leaf) const {
    return c.kind == question_.kind && c.voxel == leaf.min &&
           std::is_permutation(question_.vertex.begin(), question_.vertex.end(), c.vertex.begin(),
                               c.vertex.begin() + static_cast<std::ptrdiff_t>(question_.vertex.size()));
  }

  /// Contacts of the whole step: each is told in the part that it begins in.
  void tellRung(Accuracy rung, const OccupiedLeaf& leaf, const std::vector<Contact>& found,
                const std::vector<Contact>& single, std::size_t parts) {
    const auto is = [&](const Contact& c) { return isQuestion(c, leaf); };
    std::ostringstream text;
    text.precision(17);
    const auto contact = std::find_if(found.begin(), found.end(), is);
    part_ = 0;
    if (contact != found.end()) {
      const double along = contact->toc_lower * static_cast<double>(parts);
      part_ = std::min(static_cast<std::size_t>(along), parts - 1);
      text << "toc in [" << contact->toc_lower << ", " << contact->toc_upper << "]"
           << (contact->initial ? ", touching when the step begins" : "") << (contact->leaving ? ", from within" : "");
      return say(rungName(rung, options_), contact->certainty == Certainty::CERTAIN ? Says::CONTACT : Says::UNDECIDED,
                 text.str());
    }
    text << "no contact of this kind";
    const auto of_leaf =
        std::find_if(found.begin(), found.end(), [&](const Contact& c) { return c.voxel == leaf.min; });
    if (of_leaf != found.end()) {
      text << "; the leaf is met by its " << nameOf(of_leaf->kind);
      for (const Index v : of_leaf->vertex) {
        if (v != NO_INDEX) text << ' ' << v;
      }
      text << ", toc " << of_leaf->toc_lower;
    } else if (std::any_of(single.begin(), single.end(), is)) {
      text << "; it would meet the leaf if that stood alone, but there a neighbour covers it";
    }
    say(rungName(rung, options_), Says::REJECTED, text.str());
  }

  const Step& step_;
  const Options& options_;
  const VoxelQuestion& question_;
  Feature feature_;
  std::size_t part_ = 0;
  double distance_m_ = 0;
  std::vector<TraceLine> lines_;
};

}  // namespace

const char* toString(Says says) {
  static const char* const NAMES[] = {"kept", "rejected", "contact", "undecided"};
  return NAMES[static_cast<std::size_t>(says)];
}

std::vector<TraceLine> explain(const Step& step, const Options& options, const PairQuestion& question) {
  return PairExplanation(step, options, question).run();
}

std::vector<TraceLine> explain(const Step& step, const Options& options, const VoxelQuestion& question) {
  return VoxelExplanation(step, options, question).run();
}

}  // namespace dccd
