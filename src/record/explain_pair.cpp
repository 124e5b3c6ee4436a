#include "record/explain.h"

#include <algorithm>
#include <map>
#include <sstream>

#include "culling/toc_bound.h"
#include "dccd/accuracy.h"
#include "record/explain_parts.h"
#include "step/history.h"
#include "step/parts.h"

namespace dccd {

namespace {

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

class PairExplanation : Explanation {
 public:
  PairExplanation(const Step& step, const Options& options, const PairQuestion& question)
      : Explanation(step, options), question_(question) {
    const auto& size = factsOf(question.kind).vertices;
    features_ = {featureOf(step, question.body[0], question.vertex.data(), size[0]),
                 featureOf(step, question.body[1], question.vertex.data() + size[0], size[1])};
  }

  std::vector<TraceLine> run() {
    const std::string rule = brokenRule();
    if (!rule.empty()) {
      for (part_ = 0; part_ < parts_; ++part_) say("rules", Says::REJECTED, rule);
      return lines_;
    }
    // First the whole step, with its limits of what it may find: what was recorded for being too much is too much here,
    // too. Then the pair alone with nothing culled, so that every stage is asked.
    const Options whole = plain(options_);
    Options limited = whole;
    limited.max_found = options_.max_found;
    limited.max_found_per_feature = options_.max_found_per_feature;
    const auto seen = observe(step_, limited, &cut_);
    Step pair = alone(step_, features_);
    pair.map = ObstacleMap();
    Options all = whole;
    all.broad_phase = BroadPhase::BRUTE_FORCE;
    all.unfolded_test = false;
    all.accuracy.rung = Accuracy::CONSERVATIVE;
    const auto conservative = observe(pair, all);
    removeDistances(pair);
    std::map<Accuracy, std::map<std::size_t, Watch::Seen>> rungs;
    for (const Accuracy rung : allRungs()) {
      all.accuracy.rung = rung;
      rungs[rung] = observe(pair, all);
    }
    for (part_ = 0; part_ < parts_; ++part_) {
      const auto at = seen.find(part_);  // a step that was cut may not have come to it
      const Watch::Seen whole_step = at == seen.end() ? Watch::Seen() : at->second;
      say("rules", Says::KEPT, "a pair that the step asks about");
      tellStages(whole_step, conservative.at(part_), linearBound(conservative.at(part_).separation.total_m));
      const bool held = conservative.at(part_).separation.total_m > 0;
      for (const Accuracy rung : allRungs()) {
        if (!held) tellRung(rung, rungs.at(rung).at(part_));
        if (held && holdsDistance(rung)) tellRung(rung, conservative.at(part_));
      }
    }
    return lines_;
  }

 private:
  std::map<std::size_t, Watch::Seen> observe(const Step& step, const Options& options, bool* cut = nullptr) const {
    Watch watch(question_.kind, features_);
    History history;
    history.impl().observer = &watch;
    const Outcome outcome = detect(step, options, history);
    if (cut) *cut = outcome.cut;
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
    if (!self && !meet(a, features_[0].body, b, features_[1].body))
      return "the two bodies are not tested against each other";
    return "";
  }

  double linearBound(double separation_m) const {
    PairMotion pair{};
    for (std::size_t i = 0; i < 4; ++i) {
      const std::size_t body = question_.body[factsOf(question_.kind).sideOf(i)];
      const Vec3 from = placeVertex(step_, body, question_.vertex[i], part_, parts_);
      const Vec3 to = placeVertex(step_, body, question_.vertex[i], part_ + 1, parts_);
      std::copy_n(from.data(), 3, pair.x[0][i]);
      std::copy_n(to.data(), 3, pair.x[1][i]);
    }
    return linearTocBound(question_.kind, pair, separation_m);
  }

  void tellStages(const Watch::Seen& seen, const Watch::Seen& single, double bound) {
    if (single.separation.left_out) {
      say("separation", Says::KEPT, "closer than the separation in the reference frame: left out of it");
    } else if (single.separation.total_m > 0) {
      saySeparation(single.separation.total_m, single.separation.noise_m);
    }
    if (!seen.self_left_out.empty()) say("unfolded", Says::REJECTED, seen.self_left_out);
    std::ostringstream text;
    text.precision(17);
    text << "the projections overlap in all 8 directions at some time, not before toc " << bound;
    say("linear", bound > 1 ? Says::REJECTED : Says::KEPT,
        bound > 1 ? "in one of the 8 directions the projections stay apart during the whole step" : text.str());
    if (seen.self_left_out.empty() && !seen.streamed && cut_) {
      say("broad phase", Says::UNDECIDED, "not known: the step was cut at the limit of what it may find");
    } else if (seen.self_left_out.empty()) {
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
    sayOfRung(rung, says, text.str());
  }

  const PairQuestion& question_;
  std::vector<Feature> features_;
  bool cut_ = false;  // the step, at the limit of what it may find
};

}  // namespace

std::vector<TraceLine> explain(const Step& step, const Options& options, const PairQuestion& question) {
  return PairExplanation(step, options, question).run();
}

}  // namespace dccd
