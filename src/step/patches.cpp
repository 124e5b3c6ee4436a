#include "step/patches.h"

#include <algorithm>
#include <cmath>

#include "obstacle/burst.h"
#include "step/closest_points.h"

namespace dccd {
namespace {

Vec3 along(const Body& body, Index v, double toc) {
  const Vec3 &from = (*body.t0)[v], &to = (*body.t1)[v];
  return toc == 0 ? from : Vec3(from + toc * (to - from));
}

/// Towards the side of `from_second`, which leads from the second feature to the first.
Vec3 towards(const Vec3& cross, const Vec3& from_second) {
  const Vec3 normal = unitOr(cross, Vec3::Zero());
  return normal.dot(from_second) < 0 ? Vec3(-normal) : normal;
}

/// The point of the segment that is in the triangle's plane.
Vec3 throughPlane(const Vec3& p, const Vec3& q, const Vec3& corner, const Vec3& normal) {
  const double from = normal.dot(p - corner), to = normal.dot(q - corner), share = from / (from - to);
  return std::isfinite(share) ? Vec3(p + std::clamp(share, 0.0, 1.0) * (q - p)) : Vec3(0.5 * (p + q));
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

void PatchMaker::begin(const Outcome& outcome) {
  releaseBurst(touches_);
  releaseBurst(places_);
  graph_.setBodies(outcome.step->bodies);
  contacts_ = outcome.contacts.size();
  touches_.resize(contacts_);
}

void PatchMaker::connect(const Outcome& outcome) {
  for (const StartIntersection& crossing : outcome.intersections) {
    // A vertex inside of the map is a contact as well; a body inside of another touches nothing.
    if (crossing.vertex[4] != NO_INDEX) touches_.push_back(graph_.touchOf(crossing));
  }
  std::sort(touches_.begin() + static_cast<std::ptrdiff_t>(contacts_), touches_.end(),
            [](const Touch& a, const Touch& b) { return a.key() < b.key(); });
  patch_of_ = &graph_.components(touches_);
  places_.resize(touches_.size());
}

PatchMaker::Place PatchMaker::placeOf(const Outcome& outcome, std::size_t t) const {
  const std::vector<Body>& bodies = outcome.step->bodies;
  const Touch& touch = touches_[t];
  const Body& a = bodies[touch.body[0]];
  const auto local = [&](int i, int side) { return touch.point[i] - graph_.firstVertex(touch.body[side]); };
  if (touch.kind == Touch::CROSSING) {
    const Body& b = bodies[touch.body[1]];
    const Vec3 &f0 = (*b.t0)[local(2, 1)], &f1 = (*b.t0)[local(3, 1)], &f2 = (*b.t0)[local(4, 1)];
    return {throughPlane((*a.t0)[local(0, 0)], (*a.t0)[local(1, 0)], f0, (f1 - f0).cross(f2 - f0)), Vec3::Zero()};
  }
  const Contact& contact = outcome.contacts[t];
  if (touch.onMap() && outcome.substeps == 1) return placeOnMap(outcome, contact);
  if (outcome.substeps > 1) {
    const ContactGeometry geometry = contactGeometry(outcome, contact);
    return {geometry.point, geometry.normal};
  }
  const Body& b = bodies[touch.body[1]];
  const double toc = contact.toc_lower;
  if (contact.kind == PairKind::VERTEX_FACE) {
    const Vec3 &f0 = (*b.t0)[contact.vertex[1]], &f1 = (*b.t0)[contact.vertex[2]], &f2 = (*b.t0)[contact.vertex[3]];
    const Vec3& v = (*a.t0)[contact.vertex[0]];
    return {along(a, contact.vertex[0], toc), towards((f1 - f0).cross(f2 - f0), v - f0)};
  }
  const Vec3 &a0 = (*a.t0)[contact.vertex[0]], &a1 = (*a.t0)[contact.vertex[1]];
  const Vec3 &b0 = (*b.t0)[contact.vertex[2]], &b1 = (*b.t0)[contact.vertex[3]];
  const Closest closest = closestOnSegments(along(a, contact.vertex[0], toc), along(a, contact.vertex[1], toc),
                                            along(b, contact.vertex[2], toc), along(b, contact.vertex[3], toc));
  return {0.5 * (closest.on_first + closest.on_second), towards((a1 - a0).cross(b1 - b0), a0 - b0)};
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

void PatchMaker::make(Outcome& outcome) {
  std::vector<Patch>& patches = outcome.patches;
  patches.resize(graph_.componentCount());
  if (patches.empty()) return;
  for (std::size_t t = 0; t < touches_.size(); ++t) {
    const Touch& touch = touches_[t];
    Patch& patch = patches[(*patch_of_)[t]];
    const bool swapped = touch.body[0] > touch.body[1], first = patch.contacts + patch.crossings == 0;
    patch.body = touch.body;
    if (swapped) std::swap(patch.body[0], patch.body[1]);
    const Place& at = places_[t];
    patch.centroid += at.point;
    patch.box.min = patch.box.min.cwiseMin(at.point);
    patch.box.max = patch.box.max.cwiseMax(at.point);
    // Of a body with itself neither side is the first: all are turned to the side of the first one.
    const bool turned = touch.body[0] == touch.body[1] ? !first && patch.normal.dot(at.normal) < 0 : swapped;
    patch.normal += turned ? Vec3(-at.normal) : at.normal;
    patch.expected += touch.expected;
    if (touch.kind == Touch::CROSSING) {
      ++patch.crossings;
      patch.toc_lower = patch.toc_upper = 0;
      continue;
    }
    const Contact& contact = outcome.contacts[t];
    if (patch.contacts == 0 || isEarlier(contact, patch.earliest)) patch.earliest = contact;
    ++patch.contacts;
    patch.certain += touch.certain;
    patch.initial += touch.initial;
    patch.toc_lower = std::min(patch.toc_lower, contact.toc_lower);
    patch.toc_upper = std::min(patch.toc_upper, contact.toc_upper);
  }
  for (Patch& patch : patches) {
    patch.centroid /= static_cast<double>(patch.contacts + patch.crossings);
    patch.normal = unitOr(patch.normal, Vec3::Zero());
  }
  addAreas(outcome, patches);
}

/// Of the faces that have a vertex that touches something; where it is when the step begins.
void PatchMaker::findVertexAreas(const Step& step) {
  vertex_area_.assign(graph_.vertexCount(), 0);
  for (std::size_t b = 0; b < step.bodies.size(); ++b) {
    const Index base = graph_.firstVertex(b);
    const Positions& x = *step.bodies[b].t0;
    for (const Face& face : step.bodies[b].topology->faces()) {
      if (!graph_.isTouched(base + face[0]) && !graph_.isTouched(base + face[1]) && !graph_.isTouched(base + face[2])) {
        continue;
      }
      const double third = (x[face[1]] - x[face[0]]).cross(x[face[2]] - x[face[0]]).norm() / 6;
      if (!std::isfinite(third)) continue;
      for (const Index v : face) vertex_area_[base + v] += third;
    }
  }
}

void PatchMaker::addAreas(const Outcome& outcome, std::vector<Patch>& patches) {
  findVertexAreas(*outcome.step);
  const double resolution_m = outcome.obstacle ? outcome.obstacle->resolution() : 0;
  areas_.assign(2 * patches.size(), 0);
  last_point_.assign(patches.size(), NO_INDEX);
  std::size_t body = 0;
  for (std::size_t point = 0; point < graph_.pointCount(); ++point) {
    if (!graph_.isTouched(point)) continue;
    const bool leaf = point >= graph_.vertexCount();
    while (!leaf && point >= graph_.firstVertex(body + 1)) ++body;
    const double edge_m = leaf ? graph_.leaf(point).size * resolution_m : 0;
    const double area_m2 = leaf ? edge_m * edge_m : vertex_area_[point];
    graph_.forTouchesAt(point, [&](std::uint32_t touch) {
      const std::uint32_t p = (*patch_of_)[touch];
      if (last_point_[p] == point) return;
      last_point_[p] = static_cast<std::uint32_t>(point);
      areas_[2 * p + (leaf || body != patches[p].body[0])] += area_m2;
    });
  }
  for (std::size_t p = 0; p < patches.size(); ++p) {
    const bool self = patches[p].body[0] == patches[p].body[1];
    patches[p].area_m2 = self ? areas_[2 * p] / 2 : std::min(areas_[2 * p], areas_[2 * p + 1]);
  }
}

void PatchMaker::list(Outcome& outcome) const {
  const std::vector<Contact>& contacts = outcome.contacts;
  if (contacts.size() == contacts_) {
    outcome.patch_of.assign(patch_of_->begin(), patch_of_->begin() + static_cast<std::ptrdiff_t>(contacts_));
    return;
  }
  outcome.patch_of.reserve(contacts.size());
  std::size_t t = 0;
  for (const Contact& contact : contacts) {
    const Touch touch = graph_.touchOf(contact);
    while (touches_[t].key() != touch.key()) ++t;
    outcome.patch_of.push_back((*patch_of_)[t]);
  }
}

}  // namespace dccd
