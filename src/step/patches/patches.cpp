#include "step/patches/patches.h"

#include <algorithm>
#include <cmath>

#include "obstacle/burst.h"
#include "step/pairs/closest_points.h"
#include "step/patches/touch_lanes.h"

namespace dccd {
namespace {

constexpr std::size_t AHEAD = 8;  // touches that are fetched from memory

Vec3 along(const Body& body, Index v, double toc) {
  const Vec3 &from = (*body.t0)[v], &to = (*body.t1)[v];
  return toc == 0 ? from : Vec3(from + toc * (to - from));
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
  releaseBurst(order_);
  releaseBurst(parts_);
  releaseBurst(spots_);
  spots_.clear();
  unexpected_.clear();
  graph_.setBodies(outcome.step->bodies);
  contacts_ = outcome.contacts.size();
  releaseBurst(places_);
  places_.resize(contacts_);
  // They come first: a vertex inside of the map is a contact as well, and a body inside of another touches nothing.
  const auto& met = outcome.intersections;
  const auto crosses = [](const StartIntersection& one) { return one.vertex[4] != NO_INDEX; };
  const auto crossings = std::partition_point(met.begin(), met.end(), crosses) - met.begin();
  touches_.resize(contacts_ + static_cast<std::size_t>(crossings));
}

void PatchMaker::findTouches(const Outcome& outcome, std::size_t first, std::size_t last) {
  // In place: a copy would wait for bytes to be joined to words.
  for (std::size_t t = first; t < last; ++t) {
    void* const at = &touches_[t];
    t < contacts_ ? new (at) Touch(graph_.touchOf(outcome.contacts[t]))
                  : new (at) Touch(graph_.touchOf(outcome.intersections[t - contacts_]));
  }
}

void PatchMaker::connect() {
  patch_of_ = &graph_.components(touches_);
  const std::size_t count = graph_.componentCount();
  begin_.assign(count + 2, 0);
  for (const std::uint32_t p : *patch_of_) ++begin_[p + 2];
  for (std::size_t p = 1; p < begin_.size(); ++p) begin_[p] += begin_[p - 1];
  order_.resize(touches_.size());
  for (std::uint32_t t = 0; t < touches_.size(); ++t) order_[begin_[(*patch_of_)[t] + 1]++] = t;
  parts_.assign(count + pieces(), Part());
}

PatchMaker::Place PatchMaker::placeOf(const Outcome& outcome, const Contact& contact) const {
  if (outcome.substeps == 1) return placeOnMap(outcome, contact);
  const ContactGeometry geometry = contactGeometry(outcome, contact);
  return {geometry.point, geometry.normal};
}

Vec3 PatchMaker::pointOfCrossing(const Outcome& outcome, const Touch& touch) const {
  const auto at = [&](int i, int side) -> const Vec3& {
    return (*outcome.step->bodies[touch.body[side]].t0)[touch.point[i] - graph_.firstVertex(touch.body[side])];
  };
  const Vec3 &f0 = at(2, 1), &f1 = at(3, 1), &f2 = at(4, 1);
  return throughPlane(at(0, 0), at(1, 0), f0, (f1 - f0).cross(f2 - f0));
}

void PatchMaker::findPlaces(const Outcome& outcome, std::size_t piece) {
  const auto use = [&](std::size_t c, const simd::TouchBlock& block, std::size_t lane) {
    places_[c] = {laneOf(block.point, lane), laneOf(block.normal, lane)};
  };
  const auto other = [&](std::size_t c) { places_[c] = placeOf(outcome, outcome.contacts[c]); };
  inLanes<true>(outcome, piece * PIECE, std::min(contacts_, (piece + 1) * PIECE), simd::touchPlaces, use, other);
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

void PatchMaker::measure(const Outcome& outcome, std::size_t piece) {
  const std::size_t end = std::min(touches_.size(), (piece + 1) * PIECE);
  for (std::size_t i = piece * PIECE; i < end;) {
    const std::uint32_t p = (*patch_of_)[order_[i]], first = order_[begin_[p]];
    const bool crosses_alone = first >= contacts_;  // only then do crossings say where the patch is
    const Vec3 first_normal = crosses_alone ? Vec3(Vec3::Zero()) : places_[first].normal;
    Part& part = parts_[piece + p];
    for (const std::size_t end_of_patch = std::min<std::size_t>(end, begin_[p + 1]); i < end_of_patch; ++i) {
      const std::uint32_t t = order_[i], ahead = order_[std::min(i + AHEAD, end - 1)];
      if (ahead < contacts_) {
        __builtin_prefetch(&places_[ahead]);
        __builtin_prefetch(&outcome.contacts[ahead]);
      }
      if (t < contacts_) {
        addContact(outcome.contacts[t], places_[t], first_normal, part);
      } else {
        addCrossing(outcome, touches_[t], crosses_alone, part);
      }
    }
  }
}

void PatchMaker::addContact(const Contact& contact, const Place& at, const Vec3& first_normal, Part& part) {
  part.expected += contact.expected;
  if (!contact.expected) (contact.initial ? part.unexpected.is_initial : part.unexpected.is_new) = true;
  part.centroid += at.point;
  part.box.min = part.box.min.cwiseMin(at.point);
  part.box.max = part.box.max.cwiseMax(at.point);
  // Of a body with itself neither side is the first: all are turned to the side of the first one.
  const bool self = contact.body[0] == contact.body[1];
  const bool turned = self ? first_normal.dot(at.normal) < 0 : contact.body[0] > contact.body[1];
  part.normal += turned ? Vec3(-at.normal) : at.normal;
  if (part.contacts == 0 || isEarlier(contact, part.earliest)) part.earliest = contact;
  ++part.contacts;
  part.certain += contact.certainty == Certainty::CERTAIN;
  part.initial += contact.initial;
  part.toc_lower = std::min(part.toc_lower, contact.toc_lower);
  part.toc_upper = std::min(part.toc_upper, contact.toc_upper);
}

void PatchMaker::addCrossing(const Outcome& outcome, const Touch& touch, bool alone, Part& part) const {
  part.expected += touch.expected;
  if (!touch.expected) part.unexpected.is_initial = true;
  ++part.crossings;
  part.toc_lower = part.toc_upper = 0;
  if (!alone) return;
  const Vec3 point = pointOfCrossing(outcome, touch);
  part.centroid += point;
  part.box.min = part.box.min.cwiseMin(point);
  part.box.max = part.box.max.cwiseMax(point);
}

void PatchMaker::make(Outcome& outcome) {
  std::vector<Patch>& patches = outcome.patches;
  patches.resize(graph_.componentCount());
  unexpected_.assign(patches.size(), PatchUnexpected());
  for (std::size_t p = 0; p < patches.size(); ++p) {
    Patch& patch = patches[p];
    patch.body = touches_[order_[begin_[p]]].body;
    if (patch.body[0] > patch.body[1]) std::swap(patch.body[0], patch.body[1]);
    for (std::size_t piece = begin_[p] / PIECE; piece * PIECE < begin_[p + 1]; ++piece) {
      const Part& part = parts_[piece + p];
      if (part.contacts > 0 && (patch.contacts == 0 || isEarlier(part.earliest, patch.earliest))) {
        patch.earliest = part.earliest;
      }
      unexpected_[p].is_new |= part.unexpected.is_new;
      unexpected_[p].is_initial |= part.unexpected.is_initial;
      patch.contacts += part.contacts;
      patch.certain += part.certain;
      patch.initial += part.initial;
      patch.crossings += part.crossings;
      patch.expected += part.expected;
      patch.toc_lower = std::min(patch.toc_lower, part.toc_lower);
      patch.toc_upper = std::min(patch.toc_upper, part.toc_upper);
      patch.centroid += part.centroid;
      patch.normal += part.normal;
      patch.box.min = patch.box.min.cwiseMin(part.box.min);
      patch.box.max = patch.box.max.cwiseMax(part.box.max);
    }
    patch.centroid /= static_cast<double>(patch.contacts > 0 ? patch.contacts : patch.crossings);
    patch.normal = unitOr(patch.normal, Vec3::Zero());
    const bool self = patch.body[0] == patch.body[1];
    patch.area_m2 = self ? areas_[2 * p] / 2 : std::min(areas_[2 * p], areas_[2 * p + 1]);
  }
}

/// Of the faces that have a vertex that touches something; where it is when the step begins.
void PatchMaker::findVertexAreas(const Step& step) {
  vertex_area_.assign(graph_.vertexCount(), 0);
  const auto isTouched = [&](Index vertex) { return seen_[vertex].patch != NO_PATCH; };
  for (std::size_t b = 0; b < step.bodies.size(); ++b) {
    const Index base = graph_.firstVertex(b);
    const Positions& x = *step.bodies[b].t0;
    for (const Face& face : step.bodies[b].topology->faces()) {
      if (!isTouched(base + face[0]) && !isTouched(base + face[1]) && !isTouched(base + face[2])) continue;
      const double third = (x[face[1]] - x[face[0]]).cross(x[face[2]] - x[face[0]]).norm() / 6;
      if (!std::isfinite(third)) continue;
      for (const Index v : face) vertex_area_[base + v] += third;
    }
  }
}

void PatchMaker::findAreas(const Outcome& outcome) {
  findSpots();
  findVertexAreas(*outcome.step);
  areas_.assign(2 * graph_.componentCount(), 0);
  for (const PatchSpot& spot : spots_) areas_[2 * spot.patch + spot.side] += vertex_area_[spot.vertex];
  for (std::uint32_t p = 0; p < graph_.componentCount(); ++p) {
    if (touches_[order_[begin_[p]]].onMap()) areas_[2 * p + 1] = leafArea(p, outcome.obstacle->resolution());
  }
}

void PatchMaker::findSpots() {
  seen_.assign(graph_.vertexCount(), {NO_PATCH, 0});
  for (std::uint32_t patch = 0; patch < graph_.componentCount(); ++patch) {
    bool some_expected = false;  // of the patch's spots
    for (std::uint32_t k = begin_[patch]; k < begin_[patch + 1]; ++k) {
      const Touch& touch = touches_[order_[k]];
      const int first = touch.firstSize(), all = touch.size();
      for (int i = 0; i < all; ++i) {
        const Index vertex = touch.point[i];
        Seen& seen = seen_[vertex];
        if (seen.patch == patch) {
          if (some_expected && !touch.expected) spots_[seen.spot].expected = false;
          continue;
        }
        seen = {patch, static_cast<std::uint32_t>(spots_.size())};
        some_expected = some_expected || touch.expected;
        const bool is_first = i < first;
        const Index across = touch.onMap() ? NO_INDEX : touch.point[is_first ? first : 0];
        const auto side =
            static_cast<std::uint8_t>(touch.body[is_first ? 0 : 1] != std::min(touch.body[0], touch.body[1]));
        spots_.push_back({vertex, across, patch, side, touch.expected});
      }
    }
  }
}

/// Each leaf that the patch touches counts once.
double PatchMaker::leafArea(std::uint32_t patch, double resolution_m) {
  leaves_.clear();
  for (std::uint32_t i = begin_[patch]; i < begin_[patch + 1]; ++i) {
    const Touch& touch = touches_[order_[i]];
    leaves_.push_back(std::uint64_t{touch.level} << 48 | std::uint64_t{touch.point[3]} << 16 | touch.point[4]);
  }
  std::sort(leaves_.begin(), leaves_.end());
  leaves_.erase(std::unique(leaves_.begin(), leaves_.end()), leaves_.end());
  double area_m2 = 0;
  for (const std::uint64_t leaf : leaves_) {
    const double edge_m = std::ldexp(resolution_m, static_cast<int>(leaf >> 48));
    area_m2 += edge_m * edge_m;
  }
  return area_m2;
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
