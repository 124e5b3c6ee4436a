// A part of a step against the map.
#include <algorithm>
#include <cmath>

#include "dccd/tolerances.h"
#include "step/history.h"
#include "step/observer.h"

namespace dccd {
namespace {

/// Whether the body comes so near to what is occupied that their bounds, in the map's frame, tell nothing. Those of its
/// records along x, y and z, over the whole step, are placed as inMapFrame() places a vertex. Either is off by some ten
/// half ulps of the size of its terms, of which the slack is thousands.
bool boundsReach(const SceneBody& body, const ObstacleMap& map, const Box& occupied, double distance_m) {
  for (int axis = 0; axis < 3; ++axis) {
    double lo = map.map_from_fixed.translation()[axis], hi = lo, size = std::abs(lo) + distance_m;
    for (int from = 0; from < 3; ++from) {
      const double factor = map.map_from_fixed.linear()(axis, from);
      const double a = factor * body.bounds_min[from], b = factor * body.bounds_max[from];
      lo += std::min(a, b);
      hi += std::max(a, b);
      size += std::max(std::abs(a), std::abs(b));
    }
    const double reach = distance_m + tolerance::LENGTH * size;
    if (lo - reach > occupied.max[axis] || hi + reach < occupied.min[axis]) return false;
  }
  return true;
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

bool History::Impl::takeMapAnswer(std::size_t b, const Part& part, std::size_t room, ObstacleStats& total) {
  if (b >= carried.map.size() || !options->keep_bounds) return false;
  MapAnswer& known = carried.map[b];
  const bool same = scene.bodies()[b].unchanged && known.map && known.map == map_reduced &&
                    known.pose == part.step.map.map_from_fixed.matrix();
  if (!same) known = MapAnswer();
  if (!same || known.contacts.size() > room) return false;
  result.contacts.insert(result.contacts.end(), known.contacts.begin(), known.contacts.end());
  total.pairs_in += known.pairs;
  ++result.stats.map_answers_kept;
  return true;
}

/// What moves has other contacts in the next step: they are kept of what has not moved once already.
void History::Impl::keepMapAnswer(std::size_t b, const Part& part, std::size_t first, std::uint64_t pairs) {
  if (!scene.bodies()[b].unchanged || !options->keep_bounds) return;
  carried.map.resize(scene.bodies().size());
  carried.map[b] = {map_reduced,
                    part.step.map.map_from_fixed.matrix(),
                    {result.contacts.begin() + static_cast<std::ptrdiff_t>(first), result.contacts.end()},
                    pairs};
}

bool History::Impl::reachesMap(std::size_t b, const Part& part) const {
  const SceneBody& body = scene.bodies()[b];
  double distance_m = scene.separation(b, OBSTACLE_BODY);
  if (body.uncertain) {
    const std::vector<double>& radii = *part.step.bodies[b].radius_m;
    distance_m += *std::max_element(radii.begin(), radii.end());
  }
  return boundsReach(body, part.step.map, map_reduced->bounds(), distance_m);
}

/// False where the deadline cut it.
bool History::Impl::runMapOf(std::size_t b, const Part& part, ObstacleStats& total) {
  const SceneBody& body = scene.bodies()[b];
  const Deadline::Clock::time_point start = Deadline::Clock::now();
  const std::uint64_t in_before = total.pairs_in, out_before = result.contacts.size();
  const Effect effect = body.uncertain                           ? Effect::TRACKER_NOISE
                        : scene.separation(b, OBSTACLE_BODY) > 0 ? Effect::MINIMUM_SEPARATION
                                                                 : Effect::OCTOMAP;
  const auto count = [&] {
    result.stats[effect] += StageStats{total.pairs_in - in_before, result.contacts.size() - out_before, msSince(start)};
  };
  if (!reachesMap(b, part)) {
    if (b < carried.map.size()) carried.map[b] = MapAnswer();  // of a map that it did reach
    count();
    return true;
  }
  if (!obstacle_checks[b]) {
    ObstacleOptions o;
    o.accuracy = options->accuracy;
    o.minimum_separation_m = scene.separation(b, OBSTACLE_BODY);
    obstacle_checks[b] = std::make_unique<ObstacleCheck>(o);
  }
  const Body& moving = part.step.bodies[b];
  ObstacleQuery query{*map_reduced, *body.setup.topology, inMapFrame(part.step.map.map_from_fixed, *moving.t0, map_t0),
                      inMapFrame(part.step.map.map_from_fixed, *moving.t1, map_t1)};
  query.body = static_cast<std::uint16_t>(b);
  query.observer = observer;
  if (body.masked) {
    obstacle_active.assign(body.setup.topology->vertexCount(), 0);
    for (std::size_t i = 0; i < body.usedCount(); ++i) obstacle_active[body.slot_vertex[i]] = body.active[i];
    query.vertex_active = obstacle_active.data();
  }
  if (body.uncertain) query.vertex_radius_m = moving.radius_m->data();
  if (found_limit != FoundLimit::NONE) query.most_found = found_limit - std::min(found_limit, result.contacts.size());
  if (takeMapAnswer(b, part, query.most_found, total)) {
    count();
    return true;
  }
  query.deadline = part.deadline.movedBy(-per_hit * static_cast<std::int64_t>(result.contacts.size()));
  const bool whole = obstacle_checks[b]->run(query, result.contacts, total);
  if (obstacle_checks[b]->isFull()) result.cut = true;
  if (whole && !obstacle_checks[b]->isFull()) keepMapAnswer(b, part, out_before, total.pairs_in - in_before);
  count();
  return whole;
}

void History::Impl::runMap(const Part& part) {
  const Deadline::Clock::time_point start = Deadline::Clock::now();
  obstacle_checks.resize(scene.bodies().size());
  ObstacleStats total;
  const std::size_t before = result.contacts.size();
  for (std::size_t b = 0; b < scene.bodies().size(); ++b) {
    if (!meetsMap(scene.bodies()[b].setup) || runMapOf(b, part, total)) continue;
    result.complete = false;
    result.unchecked_toc_lower = 0;
    result.start_state_complete = false;
    if (result.start_state == StartState::CLEAR) result.start_state = StartState::NOT_CHECKED;
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
    if (!c.initial || !checksStartState(part)) continue;
    result.start_state = StartState::INTERSECTING;
    if (c.kind != PairKind::VERTEX_VOXEL_FACE) continue;
    StartIntersection s;
    s.body = {c.body[0], OBSTACLE_BODY};
    s.vertex[0] = c.vertex[0];
    result.intersections.push_back(s);
  }
}

}  // namespace dccd
