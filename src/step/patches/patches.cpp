#include "step/patches/patches.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "obstacle/burst.h"
#include "step/pairs/closest_points.h"
#include "step/patches/touch_lanes.h"

namespace dccd {
namespace {

Vec3 along(const Body& body, Index v, double toc) {
  const Vec3 &from = (*body.t0)[v], &to = (*body.t1)[v];
  return toc == 0 ? from : Vec3(from + toc * (to - from));
}

/// The point of the segment that is in the triangle's plane.
Vec3 throughPlane(const Vec3& p, const Vec3& q, const Vec3& corner, const Vec3& normal) {
  const double from = normal.dot(p - corner), to = normal.dot(q - corner), share = from / (from - to);
  return std::isfinite(share) ? Vec3(p + std::clamp(share, 0.0, 1.0) * (q - p)) : Vec3(0.5 * (p + q));
}

/// Of two features of meshes, as lanes have it.
Vec3 normalOf(const Outcome& outcome, const Contact& contact) {
  if (outcome.substeps > 1) return contactGeometry(outcome, contact).normal;
  const auto at = [&](int i) { return (*outcome.step->bodies[contact.bodyOf(i)].t0)[contact.vertex[i]]; };
  const Vec3 v0 = at(0), v1 = at(1), v2 = at(2), v3 = at(3);
  const bool edges = contact.kind == PairKind::EDGE_EDGE;
  const Vec3 normal = unitOr(edges ? (v1 - v0).cross(v3 - v2) : (v2 - v1).cross(v3 - v1), Vec3::Zero());
  return normal.dot(v0 - (edges ? v2 : v1)) < 0 ? Vec3(-normal) : normal;
}

/// Ties stay in the canonical order.
bool isEarlier(const Contact& a, const Contact& b) {
  return a.expected != b.expected ? b.expected : a.toc_lower < b.toc_lower;
}

}  // namespace

const char* toString(PatchBeginning beginning) {
  static const char* const NAMES[] = {"NEW", "INITIAL", "MAP_CHANGED"};
  return NAMES[static_cast<std::size_t>(beginning)];
}

const char* toString(PatchEventKind kind) {
  static const char* const NAMES[] = {"BEGAN", "ENDED", "SPLIT", "MERGED", "UNEXPECTED"};
  return NAMES[static_cast<std::size_t>(kind)];
}

void PatchMaker::begin(const TouchGraph::Parallel& parallel, Outcome& outcome) {
  const auto empty = [](auto&... buffers) { ((releaseBurst(buffers), buffers.clear()), ...); };
  empty(first_of_, newest_part_, parts_, stretches_, by_patch_, spots_, leaves_);
  graph_.clear();
  graph_.setBodies(outcome.step->bodies);
  const std::vector<Contact>& contacts = outcome.contacts;
  const std::vector<StartIntersection>& met = outcome.intersections;
  contacts_ = contacts.size();
  graph_.add(contacts.data(), contacts.data() + contacts.size(), parallel);
  // They come first: a vertex inside of the map is a contact as well, and a body inside of another touches nothing.
  const auto crosses = [](const StartIntersection& one) { return one.vertex[4] != NO_INDEX; };
  graph_.add(met.data(), std::partition_point(met.data(), met.data() + met.size(), crosses), parallel);
  graph_.findPatches(parallel);
  outcome.patches.resize(graph_.patchCount());
  outcome.patch_of.resize(contacts_);
  graph_.forEach([&](const TouchGroup& group, std::uint32_t first, std::uint32_t last, std::uint32_t patch) {
    if (patch == first_of_.size()) {
      first_of_.push_back(first);
      newest_part_.push_back(NO_INDEX);
      outcome.patches[patch].body = group.partners();
    }
    if (first < contacts_) std::fill_n(outcome.patch_of.begin() + first, last - first, patch);
    for (std::uint32_t t = first, next; t < last; t = next) {
      const std::uint32_t piece = t / PIECE;
      next = std::min(last, (piece + 1) * PIECE);
      std::uint32_t& part = newest_part_[patch];
      if (part == NO_INDEX || parts_[part].piece != piece) {
        part = static_cast<std::uint32_t>(parts_.size());
        parts_.emplace_back(patch, piece);
      }
      stretches_.push_back({&group, t, next, patch, part});
    }
  });
}

PatchMaker::Place PatchMaker::placeOf(const Outcome& outcome, const Contact& contact) const {
  if (outcome.substeps > 1 || !outcome.step->map.way.empty()) {
    const ContactGeometry geometry = contactGeometry(outcome, contact);
    return {geometry.point, geometry.normal};
  }
  return placeOnMap(outcome, contact);
}

/// As near as a voxel is large: on its cube, where the feature is nearest to its centre, with the normal from there.
PatchMaker::Place PatchMaker::placeOnMap(const Outcome& outcome, const Contact& contact) const {
  const Eigen::Isometry3d& map_from_fixed = outcome.step->map.map_from_fixed;
  const Body& body = outcome.step->bodies[contact.body[0]];
  const auto at = [&](int i) -> Vec3 { return map_from_fixed * along(body, contact.vertex[i], contact.toc_lower); };
  const double resolution_m = outcome.obstacle->resolution(), half_m = 0.5 * contact.voxel_size * resolution_m;
  const Vec3 center = Vec3(voxelPlane(contact.voxel.x, resolution_m), voxelPlane(contact.voxel.y, resolution_m),
                           voxelPlane(contact.voxel.z, resolution_m)) +
                      Vec3::Constant(half_m);
  Vec3 point = at(0), normal;
  if (contact.kind == PairKind::VERTEX_VOXEL_FACE) {
    int axis = 0;
    (point - center).cwiseAbs().maxCoeff(&axis);
    normal = (point[axis] < center[axis] ? -1 : 1) * Vec3::Unit(axis);
  } else if (contact.kind == PairKind::EDGE_VOXEL_EDGE) {
    const Closest closest = closestOnSegments(point, at(1), center, center);
    normal = unitOr(closest.on_first - center, Vec3::Zero());
    point = closest.on_first;
  } else {
    const Vec3 corner = point;
    normal = unitOr((at(1) - corner).cross(at(2) - corner), Vec3::Zero());
    const double above = normal.dot(corner - center);
    point = center + above * normal;
    if (above < 0) normal = -normal;
  }
  point = point.cwiseMax(center - Vec3::Constant(half_m)).cwiseMin(center + Vec3::Constant(half_m));
  const Eigen::Matrix3d turn = map_from_fixed.linear().transpose();
  return {turn * (point - map_from_fixed.translation()), turn * normal};
}

/// placeOf(contact): the Place of one.
template <class PlaceOf>
void PatchMaker::addContacts(const Outcome& outcome, std::size_t first, std::size_t last, const PlaceOf& placeOf,
                             Part& part) const {
  const std::vector<Contact>& contacts = outcome.contacts;
  // Of a body with itself neither side is the first: all are turned to the side of the first one.
  const auto [one, other] = contacts[first].body;
  const bool self = one == other;
  if (part.contacts == 0) {
    part.earliest = static_cast<std::uint32_t>(first);
    const std::size_t of_patch = first_of_[part.patch];
    if (self) part.first_normal = of_patch == first ? placeOf(first).normal : normalOf(outcome, contacts[of_patch]);
  }
  part.contacts += static_cast<std::uint32_t>(last - first);
  Part& sum = part;
  for (std::size_t c = first; c < last; ++c) {
    const Contact& contact = contacts[c];
    const Place at = placeOf(c);
    // Which way is not foreseeable: no branch. The sum is never -0.
    const double side = self ? sum.first_normal.dot(at.normal) + 0.0 : one > other ? -1 : 1;
    const double turned = std::copysign(1.0, side);
    for (int axis = 0; axis < 3; ++axis) {
      const double x = at.point[axis];
      sum.points[axis] += x;
      sum.box.min[axis] = std::min(sum.box.min[axis], x);
      sum.box.max[axis] = std::max(sum.box.max[axis], x);
      sum.normals[axis] += turned * at.normal[axis];
    }
    if (isEarlier(contact, contacts[sum.earliest])) sum.earliest = static_cast<std::uint32_t>(c);
    sum.toc_lower = std::min(sum.toc_lower, contact.toc_lower);
    sum.toc_upper = std::min(sum.toc_upper, contact.toc_upper);
    sum.certain += contact.certainty == Certainty::CERTAIN;
    sum.initial += contact.initial;
    sum.expected += contact.expected;
    if (!contact.expected) (contact.initial ? sum.unexpected.is_initial : sum.unexpected.is_new) = true;
  }
}

void PatchMaker::measure(const Outcome& outcome, std::size_t piece) {
  const std::size_t first = piece * PIECE, last = std::min(touchCount(), first + PIECE);
  const auto is_before = [](const Stretch& stretch, std::size_t touch) { return stretch.first < touch; };
  auto stretch = std::lower_bound(stretches_.begin(), stretches_.end(), first, is_before);
  const auto forParts = [&](std::size_t from, std::size_t to, const auto& add) {
    for (std::size_t end; from < to; from = end) {
      while (stretch->last <= from) ++stretch;
      end = std::min<std::size_t>(stretch->last, to);
      add(from, end, parts_[stretch->part]);
    }
  };
  const auto addPlaces = [&](std::size_t from, std::size_t to, const auto& placeOf) {
    forParts(from, to, [&](std::size_t f, std::size_t l, Part& part) { addContacts(outcome, f, l, placeOf, part); });
  };
  const auto use = [&](std::size_t c, std::size_t count, const simd::TouchBlock& block) {
    addPlaces(c, c + count, [&](std::size_t i) -> Place {
      return {laneOf(block.point, i - c), laneOf(block.normal, i - c)};
    });
  };
  const auto other = [&](std::size_t c) {
    addPlaces(c, c + 1, [&](std::size_t i) { return placeOf(outcome, outcome.contacts[i]); });
  };
  inLanes(outcome, first, std::min(last, contacts_), use, other);
  forParts(std::max(first, contacts_), last, [&](std::size_t from, std::size_t to, Part& part) {
    const StartIntersection* const crossings = outcome.intersections.data() - contacts_;
    addCrossings(outcome, crossings + from, crossings + to, part);
  });
}

void PatchMaker::addCrossings(const Outcome& outcome, const StartIntersection* first, const StartIntersection* last,
                              Part& part) const {
  const auto count = static_cast<std::uint32_t>(last - first);
  const auto expected = static_cast<std::uint32_t>(
      std::count_if(first, last, [](const StartIntersection& crossing) { return crossing.expected; }));
  part.expected += expected;
  part.unexpected.is_initial |= expected < count;
  part.crossings += count;
  part.toc_lower = part.toc_upper = 0;
  if (first_of_[part.patch] < contacts_) return;  // crossings say where the patch is only if nothing else does
  for (; first != last; ++first) {
    const auto at = [&](int i) { return (*outcome.step->bodies[first->body[i < 2 ? 0 : 1]].t0)[first->vertex[i]]; };
    const Vec3 f0 = at(2), f1 = at(3), f2 = at(4), point = throughPlane(at(0), at(1), f0, (f1 - f0).cross(f2 - f0));
    part.points += point;
    part.box.min = part.box.min.cwiseMin(point);
    part.box.max = part.box.max.cwiseMax(point);
  }
}

void PatchMaker::make(Outcome& outcome) {
  std::vector<Patch>& patches = outcome.patches;
  unexpected_.assign(patches.size(), PatchUnexpected());
  for (const Part& part : parts_) {
    Patch& patch = patches[part.patch];
    if (part.contacts > 0 && (patch.contacts == 0 || isEarlier(outcome.contacts[part.earliest], patch.earliest))) {
      patch.earliest = outcome.contacts[part.earliest];
    }
    unexpected_[part.patch].is_new |= part.unexpected.is_new;
    unexpected_[part.patch].is_initial |= part.unexpected.is_initial;
    patch.contacts += part.contacts;
    patch.certain += part.certain;
    patch.initial += part.initial;
    patch.crossings += part.crossings;
    patch.expected += part.expected;
    patch.toc_lower = std::min(patch.toc_lower, part.toc_lower);
    patch.toc_upper = std::min(patch.toc_upper, part.toc_upper);
    patch.centroid += part.points;
    patch.normal += part.normals;
    patch.box.min = patch.box.min.cwiseMin(part.box.min);
    patch.box.max = patch.box.max.cwiseMax(part.box.max);
  }
  for (std::size_t p = 0; p < patches.size(); ++p) {
    Patch& patch = patches[p];
    patch.centroid /= static_cast<double>(patch.contacts > 0 ? patch.contacts : patch.crossings);
    patch.normal = unitOr(patch.normal, Vec3::Zero());
    const bool self = patch.body[0] == patch.body[1];
    patch.area_m2 = self ? areas_[2 * p] / 2 : std::min(areas_[2 * p], areas_[2 * p + 1]);
  }
}

/// Of the faces that have a vertex that touches something; where it is when the step begins.
void PatchMaker::findVertexAreas(const Step& step) {
  vertex_area_.assign(graph_.vertexCount(), 0);
  for (std::size_t b = 0; b < step.bodies.size(); ++b) {
    const Index base = graph_.firstVertex(b);
    const Positions& x = *step.bodies[b].t0;
    const std::uint32_t* const seen = seen_patch_.data() + base;
    for (const Face& face : step.bodies[b].topology->faces()) {
      if ((seen[face[0]] & seen[face[1]] & seen[face[2]]) == NO_PATCH) continue;  // none of them touches anything
      const double third = (x[face[1]] - x[face[0]]).cross(x[face[2]] - x[face[0]]).norm() / 6;
      if (!std::isfinite(third)) continue;
      for (const Index v : face) vertex_area_[base + v] += third;
    }
  }
}

void PatchMaker::findAreas(const Outcome& outcome) {
  findSpots();
  findVertexAreas(*outcome.step);
  findLeaves(outcome);
  areas_.assign(2 * graph_.patchCount(), 0);
  for (const PatchSpot& spot : spots_) areas_[2 * spot.patch + spot.side] += vertex_area_[spot.vertex];
  for (const PatchLeaf& leaf : leaves_) {
    const double edge_m = std::ldexp(outcome.obstacle->resolution(), leaf.level);
    areas_[2 * leaf.patch + 1] += edge_m * edge_m;
  }
}

/// Patch by patch: of a vertex only the last patch that had it needs to be known.
void PatchMaker::findSpots() {
  by_patch_.resize(stretches_.size());
  std::vector<std::uint32_t> ends(graph_.patchCount() + 1, 0);
  for (const Stretch& stretch : stretches_) ++ends[stretch.patch + 1];
  for (std::size_t p = 1; p < ends.size(); ++p) ends[p] += ends[p - 1];
  for (const Stretch& stretch : stretches_) by_patch_[ends[stretch.patch]++] = stretch;
  seen_patch_.assign(graph_.vertexCount(), NO_PATCH);
  seen_spot_.resize(graph_.vertexCount());
  bool some_expected = false;  // of the patch's spots
  std::uint32_t patch = NO_PATCH;
  for (std::size_t s = 0; s < by_patch_.size(); ++s) {
    const Stretch &stretch = by_patch_[s], &ahead = by_patch_[std::min(s + 4, by_patch_.size() - 1)];
    __builtin_prefetch(graph_.verticesOf(*ahead.group, ahead.first));
    if (stretch.patch != patch) some_expected = false;
    patch = stretch.patch;
    const TouchGroup& group = *stretch.group;
    withSize(group.size(), [&](auto size) {
      const Index* vertices = graph_.verticesOf(group, stretch.first);
      for (std::uint32_t t = stretch.first; t < stretch.last; ++t, vertices += size) {
        std::uint32_t other = some_expected;
        for (int i = 0; i < size; ++i) other |= seen_patch_[vertices[i]] ^ patch;
        if (other == 0) continue;
        const bool expected = graph_.isExpected(t);
        addSpots(stretch, vertices, expected);
        some_expected |= expected;
      }
    });
  }
}

void PatchMaker::addSpots(const Stretch& stretch, const Index* vertices, bool expected) {
  const TouchGroup& group = *stretch.group;
  for (int i = 0; i < group.size(); ++i) {
    const bool second = i >= group.sizes[0];
    const Index vertex = vertices[i];
    if (seen_patch_[vertex] == stretch.patch) {
      PatchSpot& spot = spots_[seen_spot_[vertex]];
      spot.expected = spot.expected && expected;
      continue;
    }
    seen_patch_[vertex] = stretch.patch;
    seen_spot_[vertex] = static_cast<std::uint32_t>(spots_.size());
    const Index across = group.onMap() ? NO_INDEX : vertices[second ? 0 : group.sizes[0]];
    const bool side = group.body[second] != group.partners()[0];
    PatchSpot& spot = spots_.emplace_back();  // in place: a copy would wait for bytes to be joined to words
    spot.vertex = vertex;
    spot.across = across;
    spot.patch = stretch.patch;
    spot.side = side;
    spot.expected = expected;
  }
}

/// Each leaf that a patch touches counts once.
void PatchMaker::findLeaves(const Outcome& outcome) {
  graph_.forEach([&](const TouchGroup& group, std::uint32_t first, std::uint32_t last, std::uint32_t patch) {
    for (std::uint32_t t = first; group.onMap() && t < last; ++t) {
      const Contact& contact = outcome.contacts[t];
      PatchLeaf leaf{patch, 0, contact.voxel, contact.initial};
      while (std::uint32_t{1} << leaf.level < contact.voxel_size) ++leaf.level;
      leaves_.push_back(leaf);
    }
  });
  const auto key = [](const PatchLeaf& leaf) { return std::tie(leaf.patch, leaf.level, leaf.voxel); };
  std::sort(leaves_.begin(), leaves_.end(), [&](const PatchLeaf& a, const PatchLeaf& b) {
    return key(a) < key(b) || (key(a) == key(b) && a.initial > b.initial);
  });
  const auto same = [&](const PatchLeaf& a, const PatchLeaf& b) { return key(a) == key(b); };
  leaves_.erase(std::unique(leaves_.begin(), leaves_.end(), same), leaves_.end());
}

}  // namespace dccd
