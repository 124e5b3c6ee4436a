#include "step/map.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/next_surface.h"
#include "dccd/tolerances.h"
#include "obstacle/excluded_leaves.h"
#include "obstacle/leaf_sets.h"
#include "obstacle/voxel_surface_impl.h"
#include "proof/looked.h"
#include "step/conclude.h"
#include "step/history.h"

namespace dccd {
namespace {

/// Whether the body comes so near to what is occupied that their bounds, in the map's frame, tell nothing. Those of its
/// records along x, y and z, over the whole step, are placed as inMapFrame() places a vertex, by the map's pose at
/// either end: straight ways stay within what holds both. Each is off by some ten half ulps of the size of its terms,
/// of which the slack is thousands.
bool boundsReach(const SceneBody& body, const ObstacleMap& map, const Box& occupied, double distance_m) {
  const Eigen::Isometry3d at_end = map.fromFixedAt(1);
  for (int axis = 0; axis < 3; ++axis) {
    double least = std::numeric_limits<double>::infinity(), most = -least;
    for (const Eigen::Isometry3d* pose : {&map.map_from_fixed, &at_end}) {
      double lo = pose->translation()[axis], hi = lo, size = std::abs(lo) + distance_m;
      for (int from = 0; from < 3; ++from) {
        const double factor = pose->linear()(axis, from);
        const double a = factor * body.bounds_min[from], b = factor * body.bounds_max[from];
        lo += std::min(a, b);
        hi += std::max(a, b);
        size += std::max(std::abs(a), std::abs(b));
      }
      const double reach = distance_m + tolerance::LENGTH * size;
      least = std::min(least, lo - reach);
      most = std::max(most, hi + reach);
    }
    if (least > occupied.max[axis] || most < occupied.min[axis]) return false;
  }
  return true;
}

/// False: its bounds show that the body does not come near what is occupied in the part.
bool reachesMap(std::size_t b, const Part& part) {
  const SceneBody& body = part.scene.bodies()[b];
  double distance_m = part.scene.separation(b, OBSTACLE_BODY);
  if (body.uncertain) {
    const std::vector<double>& radii = *part.step.bodies[b].radius_m;
    distance_m += *std::max_element(radii.begin(), radii.end());
  }
  return boundsReach(body, part.step.map, part.prepared.map.surface->bounds(), distance_m);
}

/// The answer of the step before, where it is this part's, too; null: it is not, and is forgotten.
const MapAnswer* takeAnswer(std::size_t b, const Part& part, std::vector<MapAnswer>& known) {
  if (b >= known.size() || !part.options().keep_bounds) return nullptr;
  MapAnswer& answer = known[b];
  const bool same = part.scene.bodies()[b].unchanged && answer.map && answer.map == part.prepared.map.surface &&
                    answer.pose == part.step.map.map_from_fixed.matrix() && part.step.map.way.empty();
  if (!same) answer = MapAnswer();
  return same ? &answer : nullptr;
}

/// What moves has other contacts in the next step: they are kept of what has not moved once already.
void keepAnswer(std::size_t b, const Part& part, const std::vector<Contact>& contacts, std::size_t first,
                std::uint64_t pairs, std::vector<MapAnswer>& known) {
  if (!part.scene.bodies()[b].unchanged || !part.options().keep_bounds || !part.step.map.way.empty()) return;
  known.resize(part.scene.bodies().size());
  known[b] = {part.prepared.map.surface,
              part.step.map.map_from_fixed.matrix(),
              {contacts.begin() + static_cast<std::ptrdiff_t>(first), contacts.end()},
              pairs};
}

/// The reduced map, and what was seen there too seldom for an obstacle.
std::shared_ptr<const VoxelSurface> withSeen(const ObstacleMap& map, const std::vector<Box>& exclude_boxes,
                                             const std::shared_ptr<const VoxelSurface>& reduced) {
  if (!reduced || !map.own.seen) return reduced;
  const double resolution_m = reduced->resolution();
  const VoxelTree& tree = VoxelSurface::Impl::of(*reduced).tree;
  std::vector<OccupiedLeaf> more;
  const auto add = [&](const OccupiedLeaf& leaf) { more.push_back(leaf); };
  const RemainingLeaves seen = leavesOutside(*map.own.seen, resolution_m, map.map_from_fixed.inverse(), exclude_boxes);
  for (const OccupiedLeaf& leaf : seen.leaves) visitUncovered(tree, leaf, add);
  const VoxelTree nothing{std::vector<OccupiedLeaf>()};
  return nextSurface(resolution_m, leavesWithout(tree, nothing, more), *reduced);
}

}  // namespace

const Positions& inMapFrame(const Eigen::Isometry3d& map_from_fixed, const Positions& fixed, Positions& moved) {
  if (map_from_fixed.matrix() == Eigen::Isometry3d::Identity().matrix()) return fixed;
  moved.resize(fixed.size());
  const Eigen::Matrix3d rotation = map_from_fixed.linear();
  const Vec3 translation = map_from_fixed.translation();
  for (std::size_t i = 0; i < fixed.size(); ++i) moved[i] = rotation * fixed[i] + translation;
  return moved;
}

void ReducedMap::clear() noexcept {
  given_ = surface = measured = nullptr;
  excluded_voxels = 0;
}

void ReducedMap::set(const ObstacleMap& map, const std::vector<Box>& exclude_boxes, bool is_measured) {
  const bool same_pose = pose_.matrix() == map.map_from_fixed.matrix();
  const bool has_measured = !is_measured || (measured && seen_ == map.own.seen) || !map.surface;
  if (given_ == map.surface && has_measured && (same_pose || exclude_boxes.empty())) return;
  clear();
  std::shared_ptr<const VoxelSurface> reduced = map.surface;
  if (map.surface && !exclude_boxes.empty()) {
    RemainingLeaves remaining =
        leavesOutside(map.surface->leaves(), map.surface->resolution(), map.map_from_fixed.inverse(), exclude_boxes);
    if (remaining.excluded_voxels > 0) {
      reduced = VoxelSurface::build(map.surface->resolution(), std::move(remaining.leaves));
    }
    excluded_voxels = remaining.excluded_voxels;
  }
  if (is_measured) measured = withSeen(map, exclude_boxes, reduced);
  surface = std::move(reduced);
  given_ = map.surface;
  seen_ = map.own.seen;
  pose_ = map.map_from_fixed;
}

/// False where the deadline cut it.
bool MapSearch::runBody(const Part& part, std::size_t b, std::vector<MapAnswer>& known, ObstacleStats& total,
                        Looked& looked, Findings& result) {
  const SceneBody& body = part.scene.bodies()[b];
  const double separation_m = part.scene.separation(b, OBSTACLE_BODY);
  const Deadline::Clock::time_point start = Deadline::Clock::now();
  const std::uint64_t in_before = total.pairs_in, out_before = result.contacts.size();
  const Effect effect = body.uncertain     ? Effect::TRACKER_NOISE
                        : separation_m > 0 ? Effect::MINIMUM_SEPARATION
                                           : Effect::OCTOMAP;
  const auto count = [&] {
    result.stats[effect] += StageStats{total.pairs_in - in_before, result.contacts.size() - out_before, msSince(start)};
  };
  if (!reachesMap(b, part)) {
    if (b < known.size()) known[b] = MapAnswer();  // of a map that it did reach
    looked.atMap(b);
    count();
    return true;
  }
  if (!checks_[b]) {
    ObstacleOptions o;
    o.accuracy = part.options().accuracy;
    o.minimum_separation_m = separation_m;
    checks_[b] = std::make_unique<ObstacleCheck>(o);
  }
  const Body& moving = part.step.bodies[b];
  const ObstacleMap& map = part.step.map;
  ObstacleQuery query{*part.prepared.map.surface, *body.setup.topology, inMapFrame(map.map_from_fixed, *moving.t0, t0_),
                      inMapFrame(map.fromFixedAt(1), *moving.t1, t1_)};
  query.body = static_cast<std::uint16_t>(b);
  if (body.masked) {
    active_.assign(body.setup.topology->vertexCount(), 0);
    for (std::size_t i = 0; i < body.usedCount(); ++i) active_[body.slot_vertex[i]] = body.active[i];
    query.vertex_active = active_.data();
  }
  if (body.uncertain) query.vertex_radius_m = moving.radius_m->data();
  if (part.found_limit != FoundLimit::NONE) {
    query.most_found = part.found_limit - std::min(part.found_limit, result.contacts.size());
  }
  const MapAnswer* answer = takeAnswer(b, part, known);
  if (answer && answer->contacts.size() <= query.most_found) {
    result.contacts.insert(result.contacts.end(), answer->contacts.begin(), answer->contacts.end());
    total.pairs_in += answer->pairs;
    ++result.stats.map_answers_kept;
    looked.atMap(b);
    count();
    return true;
  }
  query.deadline = part.deadline.movedBy(-part.per_hit * static_cast<std::int64_t>(result.contacts.size()));
  const bool whole = checks_[b]->run(query, result.contacts, total);
  if (checks_[b]->isFull()) {
    result.cut = true;
  } else if (whole) {
    looked.atMap(b);
    keepAnswer(b, part, result.contacts, out_before, total.pairs_in - in_before, known);
  }
  count();
  return whole;
}

bool MapSearch::run(const Part& part, std::vector<MapAnswer>& known, Looked& looked, Findings& result) {
  const Deadline::Clock::time_point start = Deadline::Clock::now();
  const std::vector<SceneBody>& bodies = part.scene.bodies();
  checks_.resize(bodies.size());
  ObstacleStats total;
  const std::size_t before = result.contacts.size();
  bool whole = true;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (!meetsMap(bodies[b].setup) || runBody(part, b, known, total, looked, result)) continue;
    whole = false;
    leaveOut(0, false, result);
  }
  // Each body's are in order; of several bodies, kinds come first.
  const auto first = result.contacts.begin() + static_cast<std::ptrdiff_t>(before);
  if (!std::is_sorted(first, result.contacts.end(), canonicalLess)) {
    std::sort(first, result.contacts.end(), canonicalLess);
  }
  result.stats[Stage::OBSTACLE] = {total.pairs_in, result.contacts.size() - before, msSince(start)};
  for (std::size_t i = before; i < result.contacts.size(); ++i) {
    const Contact& c = result.contacts[i];
    result.stats.initial += c.initial;
    result.stats.leaving += c.leaving;
    result.stats.undecided += c.certainty == Certainty::UNDECIDED;
    if (!c.initial || !part.checksStartState()) continue;
    result.start_state = StartState::INTERSECTING;
    if (c.kind != PairKind::VERTEX_VOXEL_FACE) continue;
    StartIntersection s;
    s.body = {c.body[0], OBSTACLE_BODY};
    s.vertex[0] = c.vertex[0];
    result.intersections.push_back(s);
  }
  return whole;
}

}  // namespace dccd
