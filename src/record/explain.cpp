#include "record/explain.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "base/accuracy.h"
#include "obstacle/excluded_leaves.h"
#include "obstacle/mesh_keys.h"
#include "simd/float_mode.h"
#include "simd/fused_filter.h"
#include "step/history.h"
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

/// A feature in the arrays of a scene.
struct Place {
  std::uint32_t slot;
  const Index* vertices;  // internal
  Index rank;
};

Place placeOf(const SceneArrays& scene, const Feature& feature) {
  const SceneBody& body = scene.bodies()[feature.body];
  const auto kind = static_cast<FeatureKind>(feature.vertex.size() - 1);
  const ClusterTree& tree = body.tree(kind);
  for (std::uint32_t slot = 0;; ++slot) {
    const Index* internal = tree.feature(slot);
    const auto isOf = [&](Index v) {
      return std::binary_search(feature.vertex.begin(), feature.vertex.end(),
                                body.slot_vertex[v - body.internal_begin]);
    };
    if (std::all_of(internal, internal + tree.arity(), isOf)) return {slot, internal, body.rank(kind)[slot]};
  }
}

/// Whether the linear filter leaves the pair, of the trees that hold them.
bool passesLinearFilter(const ClusterTree& a, std::uint32_t slot_a, const ClusterTree& b, std::uint32_t slot_b) {
  constexpr std::uint32_t GROUP = simd::GROUP;
  const std::uint32_t groups[2] = {slot_a / GROUP, slot_b / GROUP};
  std::vector<std::uint32_t> kept(std::size_t{2} * GROUP * GROUP);
  std::size_t consumed = 0;
  kept.resize(2 * simd::testGroupPairs(a.level(0).view(), b.level(0).view(), groups, 1, false, simd::Diagonal::ALL,
                                       false, kept.data(), kept.size() / 2, &consumed));
  for (std::size_t i = 0; i < kept.size(); i += 2) {
    if (kept[i] == slot_a && kept[i + 1] == slot_b) return true;
  }
  return false;
}

class Explanation {
 public:
  Explanation(const Step& step, const Options& options, const PairQuestion& question)
      : step_(step),
        options_(plain(options)),
        kind_(question.kind),
        parts_(partsAllowed(neededParts(step, options.rigid_tolerance_m), options.max_substeps)) {
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

  /// f is given each straight part of the step.
  template <class F>
  void forEachPart(const F& f) {
    Step part = step_;
    if (parts_ > 1) {
      for (Body& body : part.bodies) body.t1 = body.t0;
    }
    for (part_ = 0; part_ < parts_; ++part_) {
      if (parts_ > 1) advance(step_, part_ + 1, parts_, part);
      f(part);
    }
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
    const ScopedFloatMode mode;
    History history;
    History::Impl::of(history).prepare(step_, options_);
    forEachPart([&](const Step& part) { tellPart(part, History::Impl::of(history)); });
  }

  /// Each filter, and the rung, is asked about the pair alone, whatever the one before said.
  void tellPart(const Step& part, History::Impl& impl) {
    SceneArrays& scene = impl.scene;
    StepStats stats;
    scene.record(part, stats);
    scene.refit([](std::size_t n, const auto& f) { f(std::size_t{0}, n); }, stats);
    std::size_t first = 0, second = 1;
    std::array<Place, 2> place{placeOf(scene, features_[0]), placeOf(scene, features_[1])};
    if (kind_ == PairKind::EDGE_EDGE && place[1].rank < place[0].rank) {
      std::swap(place[0], place[1]);
      std::swap(first, second);
    }
    const std::size_t a = features_[first].body, b = features_[second].body;
    Quad quad;
    std::copy_n(place[1].vertices, 4 - features_[first].vertex.size(),
                std::copy_n(place[0].vertices, features_[first].vertex.size(), quad.begin()));

    const double tolerance_m = holdsDistance(options_.accuracy.rung) ? options_.accuracy.tolerance_m : 0;
    const SeparationRule rule(scene, a, b, tolerance_m);
    const PairSeparation separation = rule.of(kind_, quad);
    if (separation.left_out) {
      say("separation", Says::KEPT, "closer than the separation in the reference frame: left out of it");
    } else if (separation.unsure_m > 0) {
      say("separation", Says::KEPT, "closer in the reference frame than the uncertainty reaches: left out of that");
    } else {
      saySeparation(separation.total_m, separation.noise_m);
    }
    if (a == b && mayBeUnfolded(options_, scene, a)) {
      Unfolded surface(scene.bodies()[a]);
      surface.run(scene.bodies()[a], scene.vertices());
      if (surface.isCertified()) {
        say("self", Says::REJECTED, "the whole surface certainly does not fold onto itself in this step");
      }
    }
    const bool near = passesLinearFilter(scene.bodies()[a].tree(firstKind(kind_)), place[0].slot,
                                         scene.bodies()[b].tree(secondKind(kind_)), place[1].slot);
    say("broad phase", near ? Says::KEPT : Says::REJECTED, near ? "" : "bounds of the pair stay apart");
    if (rule.applies()) {  // to be apart is less than a distance
      say("planar", Says::KEPT, "not asked about a distance");
    } else {
      std::uint32_t kept = 0;
      const bool passes = simd::fusedFilter(scene.vertices()->t0, quad.data(), 1, kind_ == PairKind::EDGE_EDGE,
                                            simd::FusedPlanes::ADAPTIVE, &kept) > 0;
      say("planar", passes ? Says::KEPT : Says::REJECTED, passes ? "" : "apart in a plane, or never in one plane");
    }
    tellRung(impl, quad, rule.applies() ? &separation.total_m : nullptr);
  }

  void tellRung(const History::Impl& impl, const Quad& quad, const double* separation_m) {
    PairBatch batch;
    batch.kind = kind_;
    batch.vertices = impl.scene.vertices();
    batch.pairs = &quad;
    batch.count = 1;
    batch.minimum_separation_m = separation_m;
    ElementaryResult result;
    TierCounters tiers;
    impl.prepared.elementary->run(batch, &result, tiers);
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
    const double separation_m = separationFromMap(body(0)) + noise_m;
    saySeparation(separation_m, noise_m);
    Step feature = alone(step_, features_);
    for (Body& body : feature.bodies) body.self_collision = body.against_bodies = false;
    const auto contactIn = [&](const Outcome& outcome) -> std::optional<Contact> {
      for (const Contact& c : outcome.contacts) {
        if (c.kind == kind_ && c.voxel == leaf_.min) return c;
      }
      return std::nullopt;
    };
    Options all = options_;
    all.max_found = all.max_found_per_feature = 0;
    History history, with_leaf_alone;
    const std::optional<Contact> contact = contactIn(detect(feature, all, history));
    feature.map.surface = VoxelSurface::build(step_.map.surface->resolution(), {leaf_});
    const bool covered = contactIn(detect(feature, all, with_leaf_alone)).has_value();
    // Contacts are of the whole step: each is told in the part that it begins in.
    const double along = contact ? contact->toc_lower * static_cast<double>(parts_) : 0;
    const std::size_t part_of_contact = std::min(static_cast<std::size_t>(along), parts_ - 1);
    forEachPart([&](const Step& part) {
      const bool near = reachesLeaf(part, separation_m * (1 + tolerance::SEPARATION_SUM));
      say("bounds", near ? Says::KEPT : Says::REJECTED, near ? "" : "they stay off the leaf");
      if (part_ != part_of_contact) return;
      if (!contact) {
        say(rung(), Says::REJECTED, covered ? "a neighbour covers the leaf where it would be met" : "");
      } else {
        say(rung(), contact->certainty == Certainty::CERTAIN ? Says::CONTACT : Says::UNDECIDED,
            interval(contact->toc_lower, contact->toc_upper) +
                (contact->initial ? ", touching when the step begins" : "") +
                (contact->leaving ? ", from within" : ""));
      }
    });
  }

  bool reachesLeaf(const Step& part, double reach_m) const {
    const Body& moving = part.bodies[features_[0].body];
    const double inverse_resolution = 1 / step_.map.surface->resolution();
    std::optional<KeyLanes> keys;
    for (const bool at_end : {false, true}) {
      Positions moved;
      const Positions& in_map = inMapFrame(part.map.fromFixedAt(at_end), at_end ? *moving.t1 : *moving.t0, moved);
      for (const Index v : features_[0].vertex) {
        const KeyLanes of_vertex = pointKeys(in_map[v], inverse_resolution, reach_m);
        if (keys) {
          keys->include(of_vertex);
        } else {
          keys = of_vertex;
        }
      }
    }
    const KeyBox box = keys->box();
    const std::array<std::uint16_t, 3> low{leaf_.min.x, leaf_.min.y, leaf_.min.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (box.hi[axis] < low[axis] || box.lo[axis] >= low[axis] + static_cast<int>(leaf_.size)) return false;
    }
    return true;
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
