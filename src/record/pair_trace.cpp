#include "record/pair_trace.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>

#include "culling/cluster_pairs.h"
#include "culling/scene_arrays.h"
#include "culling/unfolded.h"
#include "projection/toc_bound.h"
#include "simd/fused_filter.h"
#include "step/float_mode.h"
#include "step/left_out.h"
#include "step/pair_separation.h"

namespace dccd {

namespace {

using Says = TraceLine::Says;

/// One feature of the question: where its vertices are in the question, and its slot in its body's tree.
struct Feature {
  FeatureKind kind;
  std::size_t body, first, size;
  std::size_t slot = 0;
};

std::array<Feature, 2> features(const PairQuestion& q) {
  if (q.kind == PairKind::VERTEX_FACE) {
    return {Feature{FeatureKind::VERTEX, q.body[0], 0, 1}, Feature{FeatureKind::FACE, q.body[1], 1, 3}};
  }
  return {Feature{FeatureKind::EDGE, q.body[0], 0, 2}, Feature{FeatureKind::EDGE, q.body[1], 2, 2}};
}

std::string nameOf(const Feature& f, const PairQuestion& q, const std::string& body) {
  static const char* const NAMES[] = {"vertex", "edge", "face"};
  std::string text = "body '" + body + "' has no " + NAMES[static_cast<int>(f.kind)];
  for (std::size_t i = 0; i < f.size; ++i) text += " " + std::to_string(q.vertex[f.first + i]);
  return text;
}

class Tracer {
 public:
  Tracer(const std::vector<MonitorBody>& bodies, const MonitorOptions& options, const PairQuestion& question)
      : bodies_(bodies), options_(options), question_(question), features_(features(question)) {}

  std::vector<TraceLine> run(const StepInput& input) {
    check(input);
    const std::size_t parts = std::min(requiredSubsteps(input, options_.rigid_tolerance_m), options_.max_substeps);
    std::vector<Positions> t0, t1;
    for (part_ = 0; part_ < parts; ++part_) {
      placeAt(input, part_, parts, t0);
      placeAt(input, part_ + 1, parts, t1);
      tracePart(input, t0, t1);
    }
    return std::move(lines_);
  }

 private:
  void check(const StepInput& input) {
    for (Feature& f : features_) {
      if (f.body >= bodies_.size()) {
        throw std::invalid_argument("there is no body " + std::to_string(f.body) + "; the step has " +
                                    std::to_string(bodies_.size()));
      }
      for (std::size_t i = 0; i < f.size; ++i) {
        const Index v = question_.vertex[f.first + i];
        if (v >= input.t0[f.body].size()) {
          throw std::invalid_argument("body '" + bodies_[f.body].name + "' has no vertex " + std::to_string(v) +
                                      "; it has " + std::to_string(input.t0[f.body].size()));
        }
      }
    }
  }

  void say(const std::string& stage, Says says, const std::string& text) {
    lines_.push_back({part_, stage, says, text});
  }

  void tracePart(const StepInput& input, const std::vector<Positions>& t0, const std::vector<Positions>& t1) {
    const ScopedFloatMode mode;
    SceneArrays scene;
    std::vector<const Positions*> rest;
    MotionStep step;
    for (std::size_t b = 0; b < t0.size(); ++b) {
      rest.push_back(&input.t0[b]);
      step.bodies.push_back({&t0[b], &t1[b], input.radius_m[b].empty() ? nullptr : &input.radius_m[b]});
    }
    scene.setBodies(bodySetups(input, bodies_), rest);
    Detector detector(options_.detector);  // knows what is left out
    detector.setBodies(bodySetups(input, bodies_), rest);
    StepStats stats;
    scene.record(step, stats);
    scene.refit([](std::size_t n, const auto& f) { f(0, n); }, stats);
    for (Feature& f : features_) findSlot(scene, f);
    if (!traceRules(scene)) return;
    setSeparation(scene, input, detector.leftOut());
    traceUnfolded(scene);
    traceLinear(t0, t1);
    traceBroadPhase(scene);
    tracePlanar(scene);
    traceRungs(t0, t1);
  }

  void findSlot(const SceneArrays& scene, Feature& f) const {
    const SceneBody& body = scene.bodies()[f.body];
    const ClusterTree& tree = body.tree(f.kind);
    std::array<Index, 3> wanted{NO_INDEX, NO_INDEX, NO_INDEX};
    std::copy_n(question_.vertex.begin() + f.first, f.size, wanted.begin());
    std::sort(wanted.begin(), wanted.end());
    for (f.slot = 0; f.slot < tree.featureCount(); ++f.slot) {
      std::array<Index, 3> found{NO_INDEX, NO_INDEX, NO_INDEX};
      for (std::size_t i = 0; i < f.size; ++i)
        found[i] = body.slot_vertex[tree.feature(f.slot)[i] - body.internal_begin];
      std::sort(found.begin(), found.end());
      if (found == wanted) return;
    }
    throw std::invalid_argument(nameOf(f, question_, body.setup.name));
  }

  /// Pairs that no stage is asked about.
  bool traceRules(const SceneArrays& scene) {
    const SceneBody &a = scene.bodies()[features_[0].body], &b = scene.bodies()[features_[1].body];
    const bool self = features_[0].body == features_[1].body;
    std::string why;
    if (self && !a.setup.self_collision) why = "self-collision of '" + a.setup.name + "' is off";
    if (!self && (!a.setup.against_bodies || !b.setup.against_bodies))
      why = "against_bodies of one of the bodies is off";
    for (const Feature& f : features_) {
      if (scene.bodies()[f.body].holds(f.kind, f.slot)) continue;
      why = "a vertex of '" + bodies_[f.body].name + "' is masked, or its position is not finite: not checked";
    }
    for (std::size_t i = 0; self && i < features_[0].size; ++i) {
      for (std::size_t j = features_[1].first; j < 4; ++j) {
        if (question_.vertex[i] == question_.vertex[j])
          why = "the features share vertex " + std::to_string(question_.vertex[i]);
      }
    }
    say("rules", why.empty() ? Says::KEPT : Says::REJECTED, why.empty() ? "a pair that the step asks about" : why);
    return why.empty();
  }

  /// Is the whole body left out of self-collision?
  void traceUnfolded(const SceneArrays& scene) {
    const std::size_t b = features_[0].body;
    const SceneBody& body = scene.bodies()[b];
    if (b != features_[1].body || !options_.detector.unfolded_test || scene.separation(b, b) > 0 || body.uncertain ||
        body.masked) {
      return;
    }
    const bool unfolded = UnfoldedProof(body).run(body, scene.vertices());
    say("unfolded", unfolded ? Says::REJECTED : Says::KEPT,
        unfolded ? "the whole surface certainly does not fold onto itself in this step"
                 : "the surface may fold onto itself");
  }

  PairMotion motion(const std::vector<Positions>& t0, const std::vector<Positions>& t1) const {
    PairMotion pair{};
    for (const Feature& f : features_) {
      for (std::size_t i = f.first; i < f.first + f.size; ++i) {
        for (int axis = 0; axis < 3; ++axis) {
          pair.x[0][i][axis] = t0[f.body][question_.vertex[i]][axis];
          pair.x[1][i][axis] = t1[f.body][question_.vertex[i]][axis];
        }
      }
    }
    return pair;
  }

  /// The pair by its vertices' numbers in the scene's arrays.
  Quad internalVertices(const SceneArrays& scene) const {
    Quad quad{};
    for (const Feature& f : features_) {
      const Index* found = scene.bodies()[f.body].tree(f.kind).feature(f.slot);
      std::copy_n(found, f.size, quad.begin() + static_cast<std::ptrdiff_t>(f.first));
    }
    return quad;
  }

  /// How far the pair is apart in the reference frame, as the list of what is left out has it; infinity: not listed.
  double apartInReference(const StepInput& input, const std::vector<LeftOutPair>& left_out) const {
    const std::size_t body = features_[0].body;
    for (const LeftOutPair& pair : left_out) {
      if (pair.kind != question_.kind || pair.body != body || features_[1].body != body) continue;
      if (!sameFeatures(pair.vertex)) continue;
      const Positions& at = input.references[body]->positions;
      return restDistance(pair.kind, {at[pair.vertex[0]], at[pair.vertex[1]], at[pair.vertex[2]], at[pair.vertex[3]]});
    }
    return std::numeric_limits<double>::infinity();
  }

  /// What the pair carries into the elementary test.
  void setSeparation(const SceneArrays& scene, const StepInput& input, const std::vector<LeftOutPair>& left_out) {
    const AccuracyOptions& accuracy = options_.detector.accuracy;
    const SeparationRule rule(scene, features_[0].body, features_[1].body,
                              accuracy.rung == Accuracy::CONSERVATIVE ? accuracy.tolerance_m : 0);
    const PairSeparation pair = rule.of(question_.kind, internalVertices(scene), apartInReference(input, left_out));
    separation_ = pair.total_m;
    separated_ = rule.applies();
    if (pair.left_out) {
      say("separation", Says::KEPT, "closer than the separation in the reference frame: left out of it");
    } else if (separation_ > 0) {
      std::ostringstream text;
      text << "contact from " << pair.total_m << " m, " << pair.noise_m << " m of it tracker noise";
      say("separation", Says::KEPT, text.str());
    }
  }

  /// The same vertices in each feature, in any order; for two edges, in any order of the edges.
  bool sameFeatures(const std::array<Index, 4>& vertex) const {
    const auto sorted = [&](const std::array<Index, 4>& v, std::size_t first, std::size_t size) {
      std::vector<Index> part(v.begin() + first, v.begin() + first + size);
      std::sort(part.begin(), part.end());
      return part;
    };
    std::array<Index, 4> asked{};
    std::copy(question_.vertex.begin(), question_.vertex.end(), asked.begin());
    const std::size_t size = features_[0].size;
    const auto a = sorted(asked, 0, size), b = sorted(asked, size, 4 - size);
    const auto c = sorted(vertex, 0, size), d = sorted(vertex, size, 4 - size);
    return (a == c && b == d) || (size == 2 && a == d && b == c);
  }

  double separation() const { return separation_; }

  void traceLinear(const std::vector<Positions>& t0, const std::vector<Positions>& t1) {
    const double bound = linearTocBound(question_.kind, motion(t0, t1), separation());
    std::ostringstream text;
    text.precision(17);
    if (bound > 1) {
      text << "in one of the 8 directions the projections stay apart during the whole step";
    } else {
      text << "the projections overlap in all 8 directions at some time, not before toc " << bound;
    }
    say("linear", bound > 1 ? Says::REJECTED : Says::KEPT, text.str());
  }

  /// The step's own trees: do they stream the pair?
  void traceBroadPhase(const SceneArrays& scene) {
    const Feature &a = features_[0], &b = features_[1];
    const TreePair trees{&scene.bodies()[a.body].tree(a.kind), &scene.bodies()[b.body].tree(b.kind),
                         a.body == b.body && a.kind == b.kind, false};
    std::vector<std::uint32_t> pairs, scratch;
    if (a.body != b.body && !bodiesOverlap(scene, pairs, scratch)) {
      return say("broad phase", Says::REJECTED, "the bounds of the two bodies stay apart");
    }
    superclusterPairs(trees, pairs, scratch);
    ClusterPairStream stream;
    bool found = false;
    stream.run(trees, pairs.data(), pairs.size() / 2, [&](const std::uint32_t* slots, std::size_t n) {
      for (std::size_t i = 0; i < n; ++i) {
        found |= slots[2 * i] == a.slot && slots[2 * i + 1] == b.slot;
        found |= trees.self && slots[2 * i] == b.slot && slots[2 * i + 1] == a.slot;
      }
    });
    say("broad phase", found ? Says::KEPT : Says::REJECTED,
        found ? "the clustered trees stream the pair" : "the bounds of the pair, or of clusters around it, stay apart");
  }

  bool bodiesOverlap(const SceneArrays& scene, std::vector<std::uint32_t>& pairs,
                     std::vector<std::uint32_t>& scratch) const {
    scene.overlappingBodies(false, pairs, scratch);
    const std::uint32_t low = static_cast<std::uint32_t>(std::min(features_[0].body, features_[1].body));
    const std::uint32_t high = static_cast<std::uint32_t>(std::max(features_[0].body, features_[1].body));
    for (std::size_t p = 0; p < pairs.size(); p += 2) {
      if (pairs[p] == low && pairs[p + 1] == high) return true;
    }
    return false;
  }

  void tracePlanar(const SceneArrays& scene) {
    // Nor of what is left out, whose task carries distances.
    if (separated_) return say("planar", Says::KEPT, "not asked: it proves 'never touch', not 'never closer than'");
    const Quad quad = internalVertices(scene);
    const auto keeps = [&](simd::FusedPlanes planes) {
      std::uint32_t kept = 0;
      return simd::fusedFilter(scene.vertices()->t0, quad.data(), 1, question_.kind == PairKind::EDGE_EDGE, planes,
                               &kept) == 1;
    };
    if (keeps(simd::FusedPlanes::ADAPTIVE))
      return say("planar", Says::KEPT, "no plane and no sign of the volume tells them apart");
    say("planar", Says::REJECTED,
        keeps(simd::FusedPlanes::COORDINATE) ? "apart in a plane made for the pair"
                                             : "apart in a coordinate plane, or never in one plane (non-penetration)");
  }

  void traceRungs(const std::vector<Positions>& t0, const std::vector<Positions>& t1) {
    const PairMotion pair = motion(t0, t1);
    for (const Accuracy rung : {Accuracy::FAST, Accuracy::CONSERVATIVE, Accuracy::EXACT}) {
      if (separation() > 0 && rung != Accuracy::CONSERVATIVE) continue;
      AccuracyOptions accuracy = options_.detector.accuracy;
      accuracy.rung = rung;
      traceRung(*makeRung(accuracy), pair,
                std::string(toString(rung)) + (rung == options_.detector.accuracy.rung ? " *" : ""));
    }
  }

  void traceRung(const Rung& test, const PairMotion& pair, const std::string& name) {
    VertexMotion vertices[4] = {};
    for (int i = 0; i < 4; ++i) {
      std::copy_n(pair.x[0][i], 3, vertices[i].t0);
      std::copy_n(pair.x[1][i], 3, vertices[i].t1);
    }
    const Quad quad{0, 1, 2, 3};
    const double distance = separation();
    PairBatch batch{question_.kind, vertices, &quad, 1, distance > 0 ? &distance : nullptr};
    ElementaryResult result;
    TierCounters counters;
    test.run(batch, &result, counters);
    std::ostringstream text;
    text.precision(17);
    if (result.verdict == Verdict::NO_CONTACT) {
      text << "no contact";
    } else {
      text << "toc in [" << result.toc_lower << ", " << result.toc_upper << "]";
    }
    text << ", settled by " << toString(result.tier);
    const Says says = result.verdict == Verdict::NO_CONTACT ? Says::REJECTED
                      : result.verdict == Verdict::CONTACT  ? Says::CONTACT
                                                            : Says::UNDECIDED;
    say(name, says, text.str());
  }

  const std::vector<MonitorBody>& bodies_;
  const MonitorOptions& options_;
  const PairQuestion& question_;
  std::array<Feature, 2> features_;
  std::size_t part_ = 0;
  double separation_ = 0;
  bool separated_ = false;  // the pair's task carries distances, be the pair's own 0
  std::vector<TraceLine> lines_;
};

}  // namespace

const char* toString(Says says) {
  static const char* const NAMES[] = {"kept", "rejected", "contact", "undecided"};
  return NAMES[static_cast<std::size_t>(says)];
}

std::vector<TraceLine> tracePair(const StepInput& input, const std::vector<MonitorBody>& bodies,
                                 const MonitorOptions& options, const PairQuestion& question) {
  return Tracer(bodies, options, question).run(input);
}

}  // namespace dccd
