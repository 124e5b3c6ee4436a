#include "record/explain.h"

#include <algorithm>
#include <set>
#include <sstream>
#include <stdexcept>

#include "dccd/accuracy.h"
#include "obstacle/excluded_leaves.h"
#include "record/explain_parts.h"
#include "step/history.h"
#include "step/observer.h"
#include "step/parts.h"

namespace dccd {

namespace {

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

bool isFeature(const std::vector<Index>& vertices, const Index* first, std::size_t count) {
  return std::is_permutation(vertices.begin(), vertices.end(), first, first + count);
}

/// In which parts of a step the bounds of one feature reached one leaf.
class Watch : public StepObserver {
 public:
  Watch(const std::vector<Index>& vertices, const VoxelKey& leaf) : vertices_(vertices), leaf_(leaf) {}
  bool reached(std::size_t part) const { return parts_.count(part) > 0; }
  void onPart(std::size_t part, const SceneArrays&) override { part_ = part; }
  void onLeaf(const Index* vertices, std::size_t count, const OccupiedLeaf& leaf) override {
    if (leaf.min == leaf_ && isFeature(vertices_, vertices, count)) parts_.insert(part_);
  }

 private:
  const std::vector<Index>& vertices_;
  const VoxelKey leaf_;
  std::size_t part_ = 0;
  std::set<std::size_t> parts_;
};

class VoxelExplanation : Explanation {
 public:
  VoxelExplanation(const Step& step, const Options& options, const VoxelQuestion& question)
      : Explanation(step, options),
        question_(question),
        feature_(featureOf(step, question.body, question.vertex.data(), question.vertex.size())) {
    if (!step.map.surface) throw std::invalid_argument("the step has no map");
  }

  std::vector<TraceLine> run() {
    const std::vector<OccupiedLeaf> left = leavesOutside(step_.map.surface->leaves(), step_.map.surface->resolution(),
                                                         step_.map.map_from_fixed.inverse(), options_.exclude_boxes)
                                               .leaves;
    const OccupiedLeaf* leaf = leafOf(left, question_.voxel);
    if (!tellRules(leaf)) return lines_;
    tellSeparation();
    Step feature = alone(step_, {feature_});
    for (Body& body : feature.bodies) body.self_collision = body.against_bodies = false;
    if (distance_m_ <= 0) removeDistances(feature);  // of other bodies; `exact` holds none
    Step single = feature;
    single.map.surface = VoxelSurface::build(step_.map.surface->resolution(), {*leaf});
    Watch watch(question_.vertex, leaf->min);
    Options bounded = plain(options_);
    if (distance_m_ > 0) bounded.accuracy.rung = Accuracy::CONSERVATIVE;
    contacts(feature, bounded, &watch);
    for (part_ = 0; part_ < parts_; ++part_) tellBounds(*leaf, watch.reached(part_));
    for (const Accuracy rung : allRungs()) {
      if (distance_m_ > 0 && !holdsDistance(rung)) continue;
      Options options = plain(options_);
      options.accuracy.rung = rung;
      tellRung(rung, *leaf, contacts(feature, options), contacts(single, options));
    }
    std::stable_sort(lines_.begin(), lines_.end(),
                     [](const TraceLine& a, const TraceLine& b) { return a.part < b.part; });
    return lines_;
  }

 private:
  const Body& body() const { return step_.bodies[question_.body]; }

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
    distance_m_ = separationFromMap(body());
    double radius_m = 0;
    for (const Index v : question_.vertex) radius_m = std::max(radius_m, body().radius_m ? (*body().radius_m)[v] : 0);
    distance_m_ += radius_m;
    if (distance_m_ > 0) saySeparation(distance_m_, radius_m);
  }

  /// Whether the flow tested the pair; and for the reader, the box of the feature's way and the leaf's.
  void tellBounds(const OccupiedLeaf& leaf, bool reached) {
    if (reached) return say("bounds", Says::KEPT, "the bounds of the way reach the leaf");
    const std::uint16_t key[3] = {leaf.min.x, leaf.min.y, leaf.min.z};
    const double resolution = step_.map.surface->resolution();
    Box way;
    for (const Index v : question_.vertex) {
      for (const std::size_t end : {part_, part_ + 1}) {
        const Vec3 at = step_.map.map_from_fixed * placeVertex(step_, question_.body, v, end, parts_);
        way.min = way.min.cwiseMin(at);
        way.max = way.max.cwiseMax(at);
      }
    }
    std::ostringstream text;
    for (int axis = 0; axis < 3; ++axis) {
      const double begin = voxelPlane(key[axis], resolution);
      const double end = voxelPlane(static_cast<std::int64_t>(key[axis]) + leaf.size, resolution);
      if (way.min[axis] - end <= distance_m_ && begin - way.max[axis] <= distance_m_) continue;
      text << "apart along the map's "
           << "xyz"[axis] << ": the way spans " << way.min[axis] << " to " << way.max[axis] << " m, the leaf " << begin
           << " to " << end;
      return say("bounds", Says::REJECTED, text.str());
    }
    text << "the box of the way reaches the leaf, but nothing of it that this " << feature_.name()
         << " could be the first to meet";
    say("bounds", Says::REJECTED, text.str());
  }

  static std::vector<Contact> contacts(const Step& step, const Options& options, StepObserver* observer = nullptr) {
    History history;
    history.impl().observer = observer;
    return detect(step, options, history).contacts;
  }

  bool isQuestion(const Contact& c, const OccupiedLeaf& leaf) const {
    return c.kind == question_.kind && c.voxel == leaf.min &&
           isFeature(question_.vertex, c.vertex.data(), question_.vertex.size());
  }

  /// Contacts of the whole step: each is told in the part that it begins in.
  void tellRung(Accuracy rung, const OccupiedLeaf& leaf, const std::vector<Contact>& found,
                const std::vector<Contact>& single) {
    const auto is = [&](const Contact& c) { return isQuestion(c, leaf); };
    std::ostringstream text;
    text.precision(17);
    const auto contact = std::find_if(found.begin(), found.end(), is);
    part_ = 0;
    if (contact != found.end()) {
      const double along = contact->toc_lower * static_cast<double>(parts_);
      part_ = std::min(static_cast<std::size_t>(along), parts_ - 1);
      text << "toc in [" << contact->toc_lower << ", " << contact->toc_upper << "]"
           << (contact->initial ? ", touching when the step begins" : "") << (contact->leaving ? ", from within" : "");
      return sayOfRung(rung, contact->certainty == Certainty::CERTAIN ? Says::CONTACT : Says::UNDECIDED, text.str());
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
    sayOfRung(rung, Says::REJECTED, text.str());
  }

  const VoxelQuestion& question_;
  Feature feature_;
  double distance_m_ = 0;
};

}  // namespace

std::vector<TraceLine> explain(const Step& step, const Options& options, const VoxelQuestion& question) {
  return VoxelExplanation(step, options, question).run();
}

}  // namespace dccd
