#include "record/voxel_trace.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "dccd/tolerances.h"
#include "obstacle/excluded_leaves.h"
#include "step/float_mode.h"
#include "step/map_frame.h"

namespace dccd {

namespace {

using Says = TraceLine::Says;

bool holds(const OccupiedLeaf& leaf, const VoxelKey& voxel) {
  const auto inside = [&](std::uint16_t min, std::uint16_t key) {
    return key >= min && key - min < static_cast<int>(leaf.size);
  };
  return inside(leaf.min.x, voxel.x) && inside(leaf.min.y, voxel.y) && inside(leaf.min.z, voxel.z);
}

const OccupiedLeaf* leafOf(const std::vector<OccupiedLeaf>& leaves, const VoxelKey& voxel) {
  const auto found = std::find_if(leaves.begin(), leaves.end(), [&](const OccupiedLeaf& l) { return holds(l, voxel); });
  return found == leaves.end() ? nullptr : &*found;
}

const char* nameOf(PairKind kind) {
  return kind == PairKind::VERTEX_VOXEL_FACE ? "vertex" : kind == PairKind::EDGE_VOXEL_EDGE ? "edge" : "face";
}

class VoxelTracer {
 public:
  VoxelTracer(const StepInput& input, const std::vector<MonitorBody>& bodies, const MonitorOptions& options,
              const MonitorMap& map, const VoxelQuestion& question)
      : input_(input), bodies_(bodies), options_(options), map_(map), question_(question) {}

  std::vector<TraceLine> run() {
    check();
    surface_ = VoxelSurface::build(map_.surface->resolution(),
                                   leavesOutside(map_.surface->leaves(), map_.surface->resolution(),
                                                 map_.map_from_fixed.inverse(), options_.exclude_boxes)
                                       .leaves);
    const std::size_t parts = std::min(requiredSubsteps(input_, options_.rigid_tolerance_m), options_.max_substeps);
    std::vector<Positions> t0, t1;
    for (part_ = 0; part_ < parts; ++part_) {
      placeAt(input_, part_, parts, t0);
      placeAt(input_, part_ + 1, parts, t1);
      tracePart(t0[question_.body], t1[question_.body]);
    }
    return std::move(lines_);
  }

 private:
  const MonitorBody& body() const { return bodies_[question_.body]; }
  void say(const std::string& stage, Says says, const std::string& text) {
    lines_.push_back({part_, stage, says, text});
  }

  void check() const {
    if (question_.body >= bodies_.size()) {
      throw std::invalid_argument("there is no body " + std::to_string(question_.body) + "; the step has " +
                                  std::to_string(bodies_.size()));
    }
    if (!map_.surface) throw std::invalid_argument("the step has no map");
    const Topology& topology = *input_.topologies[question_.body];
    const auto names = [&](const auto& feature) {
      return std::is_permutation(feature.begin(), feature.end(), question_.vertex.begin(), question_.vertex.end());
    };
    const auto& used = topology.usedVertices();
    const bool exists =
        question_.kind == PairKind::VERTEX_VOXEL_FACE
            ? question_.vertex.size() == 1 && std::find(used.begin(), used.end(), question_.vertex[0]) != used.end()
        : question_.kind == PairKind::EDGE_VOXEL_EDGE
            ? std::any_of(topology.edges().begin(), topology.edges().end(), names)
            : std::any_of(topology.faces().begin(), topology.faces().end(), names);
    if (exists) return;
    std::string text = "body '" + body().name + "' has no " + nameOf(question_.kind);
    for (const Index v : question_.vertex) text += " " + std::to_string(v);
    throw std::invalid_argument(text);
  }

  void tracePart(const Positions& fixed_t0, const Positions& fixed_t1) {
    const ScopedFloatMode mode;
    const OccupiedLeaf* leaf = leafOf(surface_->leaves(), question_.voxel);
    if (!traceRules(leaf, fixed_t0, fixed_t1)) return;
    setSeparation();
    Positions moved_t0, moved_t1;
    const Positions& t0 = inMapFrame(map_.map_from_fixed, fixed_t0, moved_t0);
    const Positions& t1 = inMapFrame(map_.map_from_fixed, fixed_t1, moved_t1);
    traceBounds(*leaf, t0, t1);
    const auto alone = VoxelSurface::build(surface_->resolution(), {*leaf});
    for (const Accuracy rung : {Accuracy::FAST, Accuracy::CONSERVATIVE, Accuracy::EXACT}) {
      if ((separation_m_ > 0 || radius_m_ > 0) && rung != Accuracy::CONSERVATIVE) continue;
      traceRung(rung, *leaf, *alone, t0, t1);
    }
  }

  bool traceRules(const OccupiedLeaf* leaf, const Positions& t0, const Positions& t1) {
    std::string why;
    if (!body().against_obstacle) why = "against_obstacle of '" + body().name + "' is off";
    for (const Index v : question_.vertex) {
      const bool masked =
          std::find(body().vertex_mask.begin(), body().vertex_mask.end(), v) != body().vertex_mask.end();
      if (masked || !t0[v].allFinite() || !t1[v].allFinite()) {
        why = "vertex " + std::to_string(v) + " is masked, or its position is not finite: not checked";
      }
    }
    if (!leaf) {
      why = leafOf(map_.surface->leaves(), question_.voxel) ? "the voxel is in one of exclude_boxes"
                                                            : "the map has no occupied voxel there";
    }
    std::ostringstream text;
    if (why.empty()) {
      text << "a pair that the step asks about; the leaf begins at " << leaf->min.x << ' ' << leaf->min.y << ' '
           << leaf->min.z << " and is " << leaf->size << " voxels wide";
    }
    say("rules", why.empty() ? Says::KEPT : Says::REJECTED, why.empty() ? text.str() : why);
    return why.empty();
  }

  /// See SceneArrays::separation and ObstacleCheck::Impl::separationOf.
  void setSeparation() {
    separation_m_ = body().minimum_separation_m;
    for (const SeparationFrom& from : body().separations) {
      if (from.body == OBSTACLE_BODY) separation_m_ = from.separation_m;
    }
    const std::vector<double>& radii = input_.radius_m[question_.body];
    radius_m_ = 0;
    for (const Index v : question_.vertex) radius_m_ = std::max(radius_m_, radii.empty() ? 0 : radii[v]);
    if (separation_m_ + radius_m_ <= 0) return;
    std::ostringstream text;
    text << "contact from " << separation_m_ + radius_m_ << " m, " << radius_m_ << " m of it tracker noise";
    say("separation", Says::KEPT, text.str());
  }

  /// The box of the feature's way and the leaf's.
  void traceBounds(const OccupiedLeaf& leaf, const Positions& t0, const Positions& t1) {
    const std::uint16_t key[3] = {leaf.min.x, leaf.min.y, leaf.min.z};
    const double reach_m = (separation_m_ + radius_m_) * (1 + tolerance::MAP_REACH);
    for (int axis = 0; axis < 3; ++axis) {
      double low = HUGE_VAL, high = -HUGE_VAL;
      for (const Index v : question_.vertex) {
        low = std::min({low, t0[v][axis], t1[v][axis]});
        high = std::max({high, t0[v][axis], t1[v][axis]});
      }
      const double begin = voxelPlane(key[axis], map_.surface->resolution());
      const double end = voxelPlane(static_cast<std::int64_t>(key[axis]) + leaf.size, map_.surface->resolution());
      if (low - end <= reach_m && begin - high <= reach_m) continue;
      std::ostringstream text;
      text << "apart along the map's "
           << "xyz"[axis] << ": the way spans " << low << " to " << high << " m, the leaf " << begin << " to " << end;
      return say("bounds", Says::REJECTED, text.str());
    }
    say("bounds", Says::KEPT, "the box of the way reaches the leaf");
  }

  /// The body's own test with this feature alone: its vertices and sides are tested with it, as in the step.
  std::vector<Contact> contacts(Accuracy rung, const VoxelSurface& surface, const Positions& t0,
                                const Positions& t1) const {
    ObstacleOptions options;
    options.accuracy = options_.detector.accuracy;
    options.accuracy.rung = rung;
    options.minimum_separation_m = separation_m_;
    const Topology& topology = *input_.topologies[question_.body];
    std::vector<std::uint8_t> active(topology.vertexCount(), 0);
    for (const Index v : question_.vertex) active[v] = 1;
    const std::vector<double>& radii = input_.radius_m[question_.body];
    std::vector<Contact> found;
    ObstacleStats stats;
    ObstacleCheck(options).run(surface, topology, t0, t1, active.data(), question_.body, found, stats,
                               radii.empty() ? nullptr : radii.data());
    return found;
  }

  const Contact* ofQuestion(const std::vector<Contact>& found, const OccupiedLeaf& leaf) const {
    for (const Contact& c : found) {
      if (c.kind == question_.kind && c.voxel == leaf.min &&
          std::is_permutation(question_.vertex.begin(), question_.vertex.end(), c.vertex.begin(),
                              c.vertex.begin() + static_cast<std::ptrdiff_t>(question_.vertex.size()))) {
        return &c;
      }
    }
    return nullptr;
  }

  void traceRung(Accuracy rung, const OccupiedLeaf& leaf, const VoxelSurface& alone, const Positions& t0,
                 const Positions& t1) {
    const std::string name = std::string(toString(rung)) + (rung == options_.detector.accuracy.rung ? " *" : "");
    const std::vector<Contact> found = contacts(rung, *surface_, t0, t1);
    std::ostringstream text;
    text.precision(17);
    if (const Contact* contact = ofQuestion(found, leaf)) {
      text << "toc in [" << contact->toc_lower << ", " << contact->toc_upper << "]"
           << (contact->initial ? ", touching when the step begins" : "") << (contact->leaving ? ", from within" : "");
      return say(name, contact->certainty == Certainty::CERTAIN ? Says::CONTACT : Says::UNDECIDED, text.str());
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
    } else if (ofQuestion(contacts(rung, alone, t0, t1), leaf)) {
      text << "; it would meet the leaf if that stood alone, but there a neighbour covers it";
    }
    say(name, Says::REJECTED, text.str());
  }

  const StepInput& input_;
  const std::vector<MonitorBody>& bodies_;
  const MonitorOptions& options_;
  const MonitorMap& map_;
  const VoxelQuestion& question_;
  std::shared_ptr<const VoxelSurface> surface_;  // what exclude_boxes leave of the map
  std::size_t part_ = 0;
  double separation_m_ = 0, radius_m_ = 0;
  std::vector<TraceLine> lines_;
};

}  // namespace

std::vector<TraceLine> traceVoxel(const StepInput& input, const std::vector<MonitorBody>& bodies,
                                  const MonitorOptions& options, const MonitorMap& map, const VoxelQuestion& question) {
  return VoxelTracer(input, bodies, options, map, question).run();
}

}  // namespace dccd
