#include "step/clearance/clearance_finder.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "obstacle/start_contact.h"
#include "step/conclude.h"
#include "step/map.h"
#include "step/parts.h"
#include "step/start/segment_triangle.h"

namespace dccd {
namespace {

/// The map's frame is the fixed one.
bool isFixed(const ObstacleMap& map) {
  return map.way.empty() && map.map_from_fixed.matrix() == Eigen::Isometry3d::Identity().matrix();
}

/// It holds something, and squares of distances stay finite.
bool isUsable(const StepBox& box) {
  for (const int k : {0, 1, 2, 4, 5, 6}) {
    const double lo = box.lo[k], hi = box.hi[k];
    if (!(lo > -tolerance::CLEARANCE_LARGEST_M && lo <= hi && hi < tolerance::CLEARANCE_LARGEST_M)) return false;
  }
  return true;
}

/// Empty where nothing is occupied.
StepBox boxOfMap(const VoxelSurface& map) { return StepBox::still(map.bounds().min.data(), map.bounds().max.data()); }

/// Exact, at t1: the hulls of 1 to 3 corners.
bool meetAtEnd(const MovingHull& a, const MovingHull& b) {
  const auto at = [](const MovingHull& hull, std::size_t i) { return hull.t1[std::min(i, hull.count - 1)].data(); };
  const auto edgeMeets = [&](const MovingHull& edge, std::size_t from, std::size_t to, const MovingHull& face) {
    return segmentMeetsTriangle(at(edge, from), at(edge, to), at(face, 0), at(face, 1), at(face, 2));
  };
  if (a.count < 3) return edgeMeets(a, 0, 1, b);
  if (b.count < 3) return edgeMeets(b, 0, 1, a);
  for (std::size_t i = 0; i < 3; ++i) {
    if (edgeMeets(a, i, (i + 1) % 3, b) || edgeMeets(b, i, (i + 1) % 3, a)) return true;
  }
  return false;
}

bool meetAtEnd(const MovingHull& a, const LeafBox& box) {
  const auto at = [&](std::size_t i) { return a.t1[i].data(); };
  if (a.count == 1) return pointInBox(at(0), box);
  if (a.count == 2) return segmentMeetsBox(at(0), at(1), box);
  return triangleMeetsBox(at(0), at(1), at(2), box) != TriangleStart::APART;
}

}  // namespace

/// What is made once for many steps.
void ClearanceFinder::learn(const Body& body, const SceneBody& scene_body, BodyState& state) const {
  const std::size_t vertices = body.topology->vertexCount();
  if (!body.t0 || body.t0->size() != vertices) return;  // the step will be refused
  if (!state.tree.isBuilt()) state.tree.build(scene_body, *body.t0);
  if (!meetsItself(body) || state.tree.empty() || state.self_m == options_.self_m) return;
  state.self_m = 0;  // should memory end, they are half of one and half of the other
  state.neighbours.set(*body.topology, body.reference ? *body.reference : *body.t0, options_.self_m, state.tree);
  state.self_m = options_.self_m;
  state.far_at.clear();
}

void ClearanceFinder::learnBodies(const ClearancePart& part) {
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    BodyState& state = bodies_[b];
    const SceneBody& body = part.scene.bodies()[b];
    const Body& motion = part.step.bodies[b];
    state.motion = part.scene.vertices() + body.internal_begin;
    state.box = StepBox::still(body.bounds_min, body.bounds_max);
    state.leaves_way_m = leavesWayBy(step_->bodies[b], step_->pose_scale, part.count * stretches_);
    state.leaves_on_map_m = state.leaves_way_m + leavesWayOnMap(*step_, step_->bodies[b], part.count * stretches_,
                                                                std::numeric_limits<double>::infinity());
    state.fitted = state.fitted_to_map = false;
    state.known = body.usedCount() > 0 && isUsable(state.box);
    for (std::size_t i = 0; body.masked && i < body.usedCount(); ++i) {
      state.known = state.known && (body.active[i] || !(body.asked.empty() || body.asked[body.slot_vertex[i]]));
    }
    state.radius_m = body.uncertain ? *std::max_element(motion.radius_m->begin(), motion.radius_m->end()) : 0;
  }
}

/// The bodies' ways through a stretch of a part.
void ClearanceFinder::place(const ClearancePart& stretch) {
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    BodyState& state = bodies_[b];
    const SceneBody& body = stretch.scene.bodies()[b];
    const Body& motion = stretch.step.bodies[b];
    StepBox box = StepBox::none();
    state.placed.assign(body.usedCount(), VertexMotion{});
    for (std::size_t i = 0; i < body.usedCount(); ++i) {
      if (body.masked && !body.active[i]) continue;
      const Vec3 &p = (*motion.t0)[body.slot_vertex[i]], &q = (*motion.t1)[body.slot_vertex[i]];
      state.placed[i] = {{p[0], p[1], p[2], 0}, {q[0], q[1], q[2], 0}};
      box.add(state.placed[i]);
    }
    for (int k = 0; k < 4; ++k) {
      box.lo[k] = box.lo[4 + k] = std::min(box.lo[k], box.lo[4 + k]);
      box.hi[k] = box.hi[4 + k] = std::max(box.hi[k], box.hi[4 + k]);
    }
    state.motion = state.placed.data();
    state.box = box;
    state.fitted = state.fitted_to_map = false;
  }
}

/// The tree's boxes of this stretch. False: of such a size that nothing is computed with them.
bool ClearanceFinder::fit(std::size_t b, const ClearancePart& stretch, bool to_map) {
  BodyState& state = bodies_[b];
  const SceneBody& body = stretch.scene.bodies()[b];
  const Body& motion = stretch.step.bodies[b];
  if (state.tree.empty()) return false;
  if (to_map && !state.fitted_to_map) {
    const Positions& t0 = inMapFrame(stretch.step.map.map_from_fixed, *motion.t0, state.map_t0);
    const Positions& t1 = inMapFrame(stretch.step.map.fromFixedAt(1), *motion.t1, state.map_t1);
    state.on_map.resize(body.usedCount());
    for (std::size_t i = 0; i < body.usedCount(); ++i) {
      const Vec3 &p = t0[body.slot_vertex[i]], &q = t1[body.slot_vertex[i]];
      state.on_map[i] = {{p[0], p[1], p[2], 0}, {q[0], q[1], q[2], 0}};
    }
    state.tree.refit(state.on_map.data());
  } else if (!to_map && !state.fitted) {
    state.tree.refit(state.motion);
  }
  state.fitted = !to_map;
  state.fitted_to_map = to_map;
  return isUsable(state.tree.box(state.tree.root()));
}

void ClearanceFinder::addPart(const ClearancePart& part) {
  stretches_ = (needed_ + part.count - 1) / part.count;
  learnBodies(part);
  if (rows_.size() < pairs_) addRowsOfNear(part);
  takeContacts(part);
  if (stretches_ == 1) {
    searchRows(part);
  } else {
    Step at = *step_;
    for (Body& body : at.bodies) body.t1 = body.t0;
    const std::size_t count = part.count * stretches_;
    for (std::size_t i = part.index * stretches_; i < (part.index + 1) * stretches_; ++i) {
      if (i > 0 && i == part.index * stretches_) advance(*step_, i, count, at);
      advance(*step_, i + 1, count, at);
      const ClearancePart stretch{at, i, count, part.scene, part.map, part.found, part.deadline};
      place(stretch);
      searchRows(stretch);
    }
  }
  came_ += stretches_;
}

void ClearanceFinder::searchRows(const ClearancePart& stretch) {
  // What is known of several stretches depends on each, and boxes of another frame are made for the map.
  if (readers_ && stretch.count == 1 && isFixed(stretch.step.map)) return searchWhatIsRead(stretch);
  // The map's rows last: they may want the boxes of another frame.
  for (const bool maps : {false, true}) {
    for (Row& row : rows_) {
      if ((row.answer.body[1] == OBSTACLE_BODY) == maps) search(row, stretch);
    }
  }
}

/// Those first that were nearest in the step before: by them is seen what nobody reads.
void ClearanceFinder::searchWhatIsRead(const ClearancePart& step) {
  std::vector<Row*> rows;
  for (Row& row : rows_) rows.push_back(&row);
  std::stable_sort(rows.begin(), rows.end(), [&](const Row* x, const Row* y) { return before(*x) < before(*y); });
  for (Row* row : rows) {
    const auto [a, b] = row->answer.body;
    const bool is_told = a != b && !row->answer.expected;
    if (is_told) {
      const double enough_m = readers_->enoughFor(a, b);
      // What was nearer a step ago is measured at once.
      if (enough_m > 0 && before(*row) > enough_m) row->enough_m = enough_m;
    }
    search(*row, step);
    before(*row) = row->over_step.upper_m;
    if (is_told) readers_->take(a, b, row->at_end.upper_m, row->over_step.upper_m);
  }
}

/// Whether it is shown that nobody reads more of the two; limit_m: from where on.
bool ClearanceFinder::isBeyondEnough(Row& row, const ClearancePart& stretch, double limit_m) {
  NearestSearch::Goal goal{options_.tolerance_m, limit_m, false, stretch.deadline};
  goal.gives_up_m = limit_m;
  const FoundDistance found = measure(row, stretch, goal, {});
  if (!(found.lower_m >= limit_m)) return false;
  row.at_end.lower_m = found.lower_m;
  row.over_step.lower_m = std::max(0.0, found.lower_m - leavesArcsBy(row));
  return true;
}

/// What of it lies in the whole step.
double ClearancePart::ofStep(double t) const { return (static_cast<double>(index) + t) / static_cast<double>(count); }

void ClearanceFinder::takeContacts(const ClearancePart& part) {
  for (const StartIntersection& s : part.found.intersections) {
    // What is inside of another one is apart from its surface; what is inside of the map is a contact as well.
    if (s.body[1] == OBSTACLE_BODY || s.vertex[2] == NO_INDEX) continue;
    touchAt(part, 0, s.body, {{{s.vertex[0], s.vertex[1], NO_INDEX}, {s.vertex[2], s.vertex[3], s.vertex[4]}}},
            nullptr);
  }
  std::vector<const Contact*> first(rows_.size(), nullptr);
  for (const Contact& c : part.found.contacts) {
    Row* row = rowOf(c.body[0], c.body[1]);
    if (!row) continue;
    if (c.certainty != Certainty::CERTAIN) {
      row->undecided = true;
      continue;
    }
    const Contact*& earliest = first[static_cast<std::size_t>(row - rows_.data())];
    if (!earliest || c.toc_lower < earliest->toc_lower) earliest = &c;
  }
  for (const Contact* c : first) {
    if (!c) continue;
    std::array<FeatureTree::Feature, 2> vertex{{{NO_INDEX, NO_INDEX, NO_INDEX}, {NO_INDEX, NO_INDEX, NO_INDEX}}};
    const auto [of_first, of_second] = factsOf(c->kind).vertices;
    std::copy_n(c->vertex.begin(), of_first, vertex[0].begin());
    std::copy_n(c->vertex.begin() + of_first, of_second, vertex[1].begin());
    const OccupiedLeaf leaf{c->voxel, c->voxel_size};
    touchAt(part, c->toc_lower, c->body, vertex, factsOf(c->kind).isOnMap() ? &leaf : nullptr);
  }
}

/// Where two features that the step reports touch. The first of the step's is kept.
void ClearanceFinder::touchAt(const ClearancePart& part, double t, std::array<std::uint16_t, 2> body,
                              std::array<FeatureTree::Feature, 2> vertex, const OccupiedLeaf* leaf) {
  Row* row = rowOf(body[0], body[1]);
  if (!row || row->touches) return;
  row->touches = true;
  if (!leaf && body[0] > body[1]) {
    std::swap(body[0], body[1]);
    std::swap(vertex[0], vertex[1]);
  }
  ClearanceDistance& distance = row->answer.over_step;
  distance.t = part.ofStep(t);
  distance.vertex = vertex;
  std::array<MovingHull, 2> hull;
  for (std::size_t side = 0; side < (leaf ? 1 : 2); ++side) {
    const Body& moving = part.step.bodies[body[side]];
    for (const Index v : vertex[side]) {
      if (v != NO_INDEX) hull[side].addCorner((*moving.t0)[v], (*moving.t1)[v]);
    }
  }
  if (leaf) {
    distance.voxel = leaf->min;
    distance.voxel_size = leaf->size;
    const LeafBox cube = leafBox(*leaf, part.map->resolution());
    hull[1] = MovingHull::box(cube.lo, cube.hi);
    for (std::size_t i = 0; i < hull[0].count; ++i) {
      hull[0].t0[i] = part.step.map.map_from_fixed * hull[0].t0[i];
      hull[0].t1[i] = part.step.map.fromFixedAt(1) * hull[0].t1[i];
    }
  }
  HullPair pair;
  pair.set(hull[0], hull[1]);
  const Nearest nearest = pair.at(t, 0);
  for (int side = 0; side < 2; ++side) {
    const Vec3 point = pair.pointInMetres(nearest.point[side]);
    distance.point[side] = leaf ? Vec3(part.step.map.fromFixedAt(t).inverse() * point) : point;
  }
}

/// Whether nothing is to be searched: nothing can be known of the two, boxes or the steps before show that they are
/// far, or there is no time.
bool ClearanceFinder::needsNoSearch(Row& row, const ClearancePart& stretch, double limit_m) {
  const auto [a, b] = row.answer.body;
  const bool on_map = b == OBSTACLE_BODY, empty = on_map && stretch.map && stretch.map->leafCount() == 0;
  const bool known = on_map ? stretch.map && (empty || isUsable(boxOfMap(*stretch.map))) : bodies_[b].known;
  row.unknown = row.unknown || !bodies_[a].known || !known;
  if (row.unknown) return true;
  ++row.stretches;
  FoundDistance apart;
  apart.lower_m = 0;
  if (empty) {
    apart.lower_m = std::numeric_limits<double>::infinity();
  } else if (a == b) {
    apart.lower_m = isStillFar(a, stretch, limit_m) ? limit_m : 0;
  } else if (!on_map || isFixed(stretch.step.map)) {
    apart.lower_m = apartByBoxes(bodies_[a].box, on_map ? boxOfMap(*stretch.map) : bodies_[b].box);
  }
  const bool is_far = apart.lower_m >= limit_m;
  if (!is_far && !stretch.deadline.isOver()) return false;
  apart.cut = !is_far;
  row.over_step.lower_m = std::min(row.over_step.lower_m, std::max(0.0, apart.lower_m - leavesArcsBy(row)));
  row.over_step.cut = row.over_step.cut || apart.cut;
  if (stretch.index + 1 == stretch.count) row.at_end = apart;
  return true;
}

void ClearanceFinder::search(Row& row, const ClearancePart& stretch) {
  const auto [a, b] = row.answer.body;
  const bool on_map = b == OBSTACLE_BODY, last = stretch.index + 1 == stretch.count;
  double limit_m = limitOverStep(row);
  if (needsNoSearch(row, stretch, limit_m)) return;
  const bool moved = on_map && !isFixed(stretch.step.map);
  if (!fit(a, stretch, moved) || (!on_map && a != b && !fit(b, stretch, false))) {
    row.unknown = true;
    return;
  }
  if (row.enough_m < options_.max_m) {
    if (isBeyondEnough(row, stretch, limit_m)) return;
    row.enough_m = std::numeric_limits<double>::infinity();
    limit_m = limitOverStep(row);
  }
  NearestSearch::Goal goal{options_.tolerance_m, limit_m, false, stretch.deadline};
  std::array<std::uint32_t, 2> nearest{};
  FoundDistance at_end;
  if (!(row.touches && exact_)) {  // else all is known of the step
    if (a == b) goal.limit_m *= tolerance::CLEARANCE_SELF_REACH;
    const FoundDistance found = measure(row, stretch, goal, row.over_step);
    if (a == b) keepFar(a, stretch, found);
    if (takeOverStep(row, stretch, found)) {
      nearest = found.item;
      goal.first = &nearest;
      if (found.t == 1) at_end = found;
    }
    if (last && found.lower_m >= limit_m) {
      row.at_end.lower_m = found.lower_m;
      return;
    }
  }
  if (!last) return;
  goal.limit_m = limitOf(row) + radiusOf(row);
  if (at_end.lower_m > 0 && at_end.upper_m < goal.limit_m) {  // the step's least is at its end, and they do not meet
    row.at_end = at_end;
    describe(row, stretch, row.at_end, row.answer.at_end);
    return;
  }
  goal.at_end = true;
  row.at_end = measure(row, stretch, goal, at_end);
  describe(row, stretch, row.at_end, row.answer.at_end);
}

/// What was found on straight paths becomes what is known of the true ones, which meet them at a stretch's ends.
/// Whether it is the least of the step so far.
bool ClearanceFinder::takeOverStep(Row& row, const ClearancePart& stretch, const FoundDistance& found) {
  const double leaves_m = leavesArcsBy(row);
  const double upper_m = found.t > 0 && found.t < 1 ? found.upper_m + leaves_m : found.upper_m;
  const bool is_least = upper_m < row.over_step.upper_m;
  if (is_least && !row.touches) describe(row, stretch, found, row.answer.over_step);
  row.over_step.upper_m = std::min(row.over_step.upper_m, upper_m);
  row.over_step.lower_m = std::min(row.over_step.lower_m, std::max(0.0, found.lower_m - leaves_m));
  row.over_step.cut = row.over_step.cut || found.cut;
  return is_least;
}

/// A body that is far enough from itself stays so while no vertex has moved by more than half of what there is to
/// spare, but for a motion that all have in common. What a search would find is not otherwise.
bool ClearanceFinder::isStillFar(std::size_t b, const ClearancePart& part, double limit_m) const {
  const BodyState& state = bodies_[b];
  const SceneBody& body = part.scene.bodies()[b];
  if (state.far_at.size() != body.usedCount() || !(state.far_m > limit_m) || state.self_m != options_.self_m)
    return false;
  const VertexMotion* now = state.motion;
  double largest = 0, moved_squared = 0;
  for (int end = 0; end < 2; ++end) {
    const auto at = [&](std::size_t i) {
      const double* x = end == 0 ? now[i].t0 : now[i].t1;
      return Vec3(x[0], x[1], x[2]);
    };
    const Vec3 common = at(0) - state.far_at[0];
    largest = std::max(largest, common.cwiseAbs().maxCoeff());
    for (std::size_t i = 0; i < state.far_at.size(); ++i) {
      moved_squared = std::max(moved_squared, (at(i) - state.far_at[i] - common).squaredNorm());
    }
  }
  for (int k = 0; k < 3; ++k) largest = std::max({largest, std::abs(state.box.lo[k]), std::abs(state.box.hi[k])});
  const double spare_m = state.far_m - limit_m - 2 * options_.tolerance_m - tolerance::CLEARANCE * largest;
  return spare_m > 0 && 4 * moved_squared < spare_m * spare_m;
}

void ClearanceFinder::keepFar(std::size_t b, const ClearancePart& part, const FoundDistance& found) {
  BodyState& state = bodies_[b];
  const SceneBody& body = part.scene.bodies()[b];
  const VertexMotion* now = state.motion;
  state.far_m = found.lower_m;
  state.far_at.clear();
  if (!(found.lower_m > limitOf(*rowOf(b, b)))) return;
  for (std::size_t i = 0; i < body.usedCount(); ++i)
    state.far_at.emplace_back(now[i].t1[0], now[i].t1[1], now[i].t1[2]);
}

FoundDistance ClearanceFinder::measure(const Row& row, const ClearancePart& part, const NearestSearch::Goal& goal,
                                       const FoundDistance& known) {
  const auto [a, b] = row.answer.body;
  BodyState& first = bodies_[a];
  const FeatureTree& tree = first.tree;
  if (b == OBSTACLE_BODY) {
    map_.set(part.map);
    return search_.run(tree, map_, NearestSearch::AllPairs(), goal, known, [&](std::uint32_t i, std::uint32_t leaf) {
      return meetAtEnd(tree.itemHull(i), map_.leafBox(leaf));
    });
  }
  const FeatureTree& other = bodies_[b].tree;
  const auto meet = [&](std::uint32_t i, std::uint32_t j) { return meetAtEnd(tree.itemHull(i), other.itemHull(j)); };
  if (a != b) return search_.run(tree, other, NearestSearch::AllPairs(), goal, known, meet);
  return search_.run(tree, tree, first.neighbours, goal, known, meet);
}

void ClearanceFinder::describe(const Row& row, const ClearancePart& part, const FoundDistance& found,
                               ClearanceDistance& distance) const {
  if (!(found.upper_m < std::numeric_limits<double>::infinity())) return;
  const auto [a, b] = row.answer.body;
  distance.t = part.ofStep(found.t);
  distance.point = found.point;
  distance.vertex[0] = bodies_[a].tree.features()[found.item[0]];
  if (b != OBSTACLE_BODY) {
    distance.vertex[1] = bodies_[b].tree.features()[found.item[1]];
    return;
  }
  const OccupiedLeaf& leaf = map_.leaf(found.item[1]);
  distance.voxel = leaf.min;
  distance.voxel_size = leaf.size;
  if (isFixed(part.step.map)) return;
  for (Vec3& point : distance.point) point = part.step.map.fromFixedAt(found.t).inverse() * point;
}

}  // namespace dccd
