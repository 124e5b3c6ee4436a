#include <algorithm>
#include <cmath>

#include "stream/path_search.h"
#include "stream/radii.h"

namespace dccd {
namespace {

constexpr double PLANE_ROUNDING = 1e-12;  // [1] of the largest coordinate: far above what heights are rounded by
constexpr std::size_t MOST_NORMALS = 8;   // of contacts that are tried

double lowest(const Positions& positions, const Vec3& direction) {
  double least = SpeedBound::NONE;
  for (const Vec3& p : positions) least = std::min(least, direction.dot(p));
  return least;
}

Vec3 middleOf(const Positions& positions) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& p : positions) sum += p;
  return sum / static_cast<double>(positions.size());
}

}  // namespace

LeavingPlanes::LeavingPlanes(const Outcome& outcome, const PathPair& pair, std::uint16_t mover,
                             std::vector<Positions> ends, std::vector<double> leaves_m, std::vector<double> time_s,
                             const PathPace& pace)
    : outcome_(outcome),
      pair_(pair),
      ends_(std::move(ends)),
      leaves_m_(std::move(leaves_m)),
      time_s_(std::move(time_s)),
      mover_(mover),
      partner_(pair.body[0] == mover ? pair.body[1] : pair.body[0]) {
  const std::vector<Body>& bodies = outcome.step->bodies;
  const bool on_map = partner_ == OBSTACLE_BODY;
  if (on_map) to_map_ = outcome.step->map.map_from_fixed;
  double largest = 1;
  for (std::size_t k = 0; k < ends_.size(); ++k) {
    Eigen::AlignedBox3d box;
    for (Vec3& p : ends_[k]) {
      p = to_map_ * p;
      box.extend(p);
      largest = std::max(largest, p.cwiseAbs().maxCoeff());
    }
    pieces_.push_back(box);
    if (k > 0) pieces_[k - 1].extend(box);
  }
  pieces_.pop_back();
  Eigen::AlignedBox3d all;
  for (std::size_t k = 0; k < pieces_.size(); ++k) {
    pieces_[k].min().array() -= leaves_m_[k];
    pieces_[k].max().array() += leaves_m_[k];
    all.extend(pieces_[k]);
  }
  rounding_m_ = PLANE_ROUNDING * largest;
  radius_m_ = largestRadius(bodies[mover_]) + (on_map ? 0 : largestRadius(bodies[partner_]));
  for (const double time_s : time_s_)
    needed_m_.push_back(pair_.scaleNeeds(pace.scaleOf(time_s), pace) + pair_.separation_m + radius_m_ + rounding_m_);
  all.min().array() -= needed_m_.back();
  all.max().array() += needed_m_.back();
  const auto addNear = [&](const Eigen::AlignedBox3d& box, const Positions& corners) {
    if (all.intersects(box)) features_.push_back({box, corners});
  };
  if (on_map) {
    const double resolution_m = outcome.obstacle->resolution();
    const auto corner = [&](const VoxelKey& key, std::int64_t size) {
      return Vec3(voxelPlane(key.x + size, resolution_m), voxelPlane(key.y + size, resolution_m),
                  voxelPlane(key.z + size, resolution_m));
    };
    for (const OccupiedLeaf& leaf : outcome.obstacle->leaves())
      addNear({corner(leaf.min, 0), corner(leaf.min, leaf.size)}, {});
    return;
  }
  const Body& partner = bodies[partner_];
  const Positions& at = *partner.t1;
  const auto addHull = [&](const auto& feature) {
    Eigen::AlignedBox3d box;
    Positions corners;
    for (const Index v : feature) {
      corners.push_back(at[v]);
      box.extend(at[v]);
    }
    addNear(box, corners);
  };
  for (const Face& face : partner.topology->faces()) addHull(face);
  if (!partner.topology->hasFaces()) {
    for (const Edge& edge : partner.topology->edges()) addHull(edge);
  }
  Eigen::AlignedBox3d mover_box, partner_box;
  for (const Vec3& p : ends_[0]) mover_box.extend(p);
  for (const Vec3& p : at) partner_box.extend(p);
  may_hold_ = (partner.topology->isClosed() && partner_box.contains(mover_box)) ||
              (bodies[mover_].topology->isClosed() && mover_box.contains(partner_box));
}

/// What may be normal to such a plane: any will do that is one.
std::vector<Vec3> LeavingPlanes::directions() const {
  std::vector<Vec3> all;
  const auto add = [&](const Vec3& direction) {
    const double length = direction.norm();
    if (length > 0 && std::isfinite(length)) all.push_back(direction / length);
  };
  add(middleOf(ends_[1]) - middleOf(ends_[0]));
  add(middleOf(ends_.back()) - middleOf(ends_[0]));
  if (partner_ == OBSTACLE_BODY) {
    for (int axis = 0; axis < 3; ++axis) {
      add(Vec3::Unit(axis));
      add(-Vec3::Unit(axis));
    }
  }
  const auto isOfBoth = [&](const std::array<std::uint16_t, 2>& body) {
    return (body[0] == mover_ && body[1] == partner_) || (body[0] == partner_ && body[1] == mover_);
  };
  Vec3 sum = Vec3::Zero();
  std::size_t found = 0;
  for (const Contact& contact : outcome_.contacts) {
    if (!isOfBoth(contact.body) || found == MOST_NORMALS) continue;
    ++found;
    const Vec3 normal = to_map_.linear() * contactGeometry(outcome_, contact).normal;
    sum += normal.dot(all.empty() ? normal : all[0]) < 0 ? Vec3(-normal) : normal;
    add(normal);
    add(-normal);
  }
  add(sum);
  add(-sum);
  if (pair_.number != SafeUntil::NO_PAIR) {
    const std::array<Vec3, 2>& point = outcome_.clearances[pair_.number].at_end.point;
    add(to_map_.linear() * (point[0] - point[1]));
    add(to_map_.linear() * (point[1] - point[0]));
  }
  return all;
}

double LeavingPlanes::untilBy(const Vec3& direction) const {
  const double height = lowest(ends_[0], direction);
  std::size_t last = 0;
  while (last + 1 < ends_.size() && lowest(ends_[last + 1], direction) >= height - rounding_m_) ++last;
  if (last == 0) return 0;
  double until_s = time_s_[last];
  for (const Feature& feature : features_) {
    double most = -SpeedBound::NONE;
    for (const Vec3& corner : feature.corners) most = std::max(most, direction.dot(corner));
    if (feature.corners.empty())
      most = direction.dot(feature.box.center()) + direction.cwiseAbs().dot(feature.box.sizes()) / 2;
    if (most + radius_m_ <= height + rounding_m_) continue;
    double least_m = SpeedBound::NONE;
    for (std::size_t k = 0; k < last && time_s_[k] < until_s; ++k) {
      least_m = std::min(least_m, pieces_[k].exteriorDistance(feature.box));
      if (least_m >= needed_m_[k + 1]) continue;
      until_s = time_s_[k];
      break;
    }
  }
  if (!may_hold_) return until_s;
  const Positions& partner = *outcome_.step->bodies[partner_].t1;
  return std::all_of(partner.begin(), partner.end(), [&](const Vec3& p) { return direction.dot(p) <= height; })
             ? until_s
             : 0;
}

double LeavingPlanes::until() const {
  double until_s = 0;
  for (const Vec3& direction : directions()) until_s = std::max(until_s, untilBy(direction));
  return until_s;
}

}  // namespace dccd
