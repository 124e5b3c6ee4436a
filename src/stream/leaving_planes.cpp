#include <algorithm>
#include <cmath>
#include <utility>

#include "dccd/mesh_store.h"
#include "step/parts.h"
#include "stream/path_search.h"
#include "stream/radii.h"

namespace dccd {
namespace {

constexpr double PLANE_ROUNDING = 1e-12;  // [1] of the largest coordinate: far above what heights are rounded by
constexpr std::size_t MOST_NORMALS = 8;   // of contacts that are tried
constexpr double PLANE_PIECES = 32;       // of the time that is asked for, about

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

/// A body on the path at ends of pieces of its own, and what of its partner is not far from these: the box around a
/// piece of the path, which may be long and straight, is near to much.
class LeavingPlanes {
 public:
  LeavingPlanes(const Outcome& outcome, const PathPair& pair, const IntendedPath& path, double most_s,
                const PathPace& pace)
      : outcome_(outcome), pair_(pair) {
    const std::vector<Body>& bodies = outcome.step->bodies;
    mover_ = pair.body[path.find(pair.body[0]) == nullptr];
    partner_ = pair.body[pair.body[0] == mover_];
    follow(path, *path.find(mover_), most_s);
    const bool on_map = partner_ == OBSTACLE_BODY;
    if (on_map) to_map_ = outcome.step->map.fromFixedAt(1);
    double largest = 1;
    Eigen::AlignedBox3d before, all;
    for (End& end : ends_) {
      Eigen::AlignedBox3d here;
      for (Vec3& p : end.at) {
        p = to_map_ * p;
        here.extend(p);
        largest = std::max(largest, p.cwiseAbs().maxCoeff());
      }
      end.piece = here.merged(before);
      end.piece.min().array() -= end.leaves_m;
      end.piece.max().array() += end.leaves_m;
      if (end.time_s > 0) all.extend(end.piece);
      before = here;
    }
    rounding_m_ = PLANE_ROUNDING * largest;
    radius_m_ = largestRadius(bodies[mover_]) + (on_map ? 0 : largestRadius(bodies[partner_]));
    for (End& end : ends_)
      end.needed_m = pair_.scaleNeeds(pace.scaleOf(end.time_s), pace) + pair_.separation_m + radius_m_ + rounding_m_;
    all.min().array() -= ends_.back().needed_m;
    all.max().array() += ends_.back().needed_m;
    addFeatures(all);
  }

  double until() const {
    double until_s = 0;
    for (const Vec3& direction : directions()) until_s = std::max(until_s, untilBy(direction));
    return until_s;
  }

 private:
  struct End {
    double time_s = 0;
    Positions at{};
    double leaves_m = 0;          // of the piece up to here: how far it leaves the straight way
    Eigen::AlignedBox3d piece{};  // around the body on it, wider by that
    double needed_m = 0;          // between the two up to here
  };
  struct Feature {
    Eigen::AlignedBox3d box;
    Positions corners;  // none: all of the box's
  };
  void follow(const IntendedPath& path, const IntendedPath::Of& of, double most_s) {
    Body whole = outcome_.step->bodies[of.body];
    whole.waypoints.clear();
    whole.turns = true;
    whole.t0 = whole.t1;
    whole.pose_t0 = whole.pose_t1 = outcome_.step->bodies[of.frameOf()].pose_t1;
    Body part = whole;  // on one of the pieces
    const auto go = [&](const Eigen::Isometry3d& pose) {
      part.t0 = std::exchange(part.t1, placesAt(whole, {0, pose, nullptr}));
      part.pose_t0 = std::exchange(part.pose_t1, pose);
    };
    go(of.pose[0]);
    ends_ = {{0, *part.t1}};
    for (std::size_t k = 0; k < path.bend_m.size() && ends_.back().time_s < most_s; ++k) {
      const double begins_s = path.time_s[k], lasts_s = std::min(path.time_s[k + 1], most_s) - begins_s;
      const double count = std::ceil(PLANE_PIECES * lasts_s / most_s);
      for (double i = 1; i <= count; ++i) {
        const double time_s = begins_s + i / count * lasts_s;
        go(interpolate(of.pose[k], of.pose[k + 1], path.shareAt(k, time_s)));
        ends_.push_back({time_s, *part.t1, path.bend_m[k] + leavesWayBy(part, 1, 1)});
      }
    }
  }

  void addFeatures(const Eigen::AlignedBox3d& near) {
    if (partner_ == OBSTACLE_BODY) {
      const double resolution_m = outcome_.measured->resolution();
      const auto corner = [&](const VoxelKey& key, std::int64_t size) {
        return Vec3(voxelPlane(key.x + size, resolution_m), voxelPlane(key.y + size, resolution_m),
                    voxelPlane(key.z + size, resolution_m));
      };
      for (const OccupiedLeaf& leaf : outcome_.measured->leaves()) {
        const Eigen::AlignedBox3d box(corner(leaf.min, 0), corner(leaf.min, leaf.size));
        if (near.intersects(box)) features_.push_back({box, {}});
      }
      return;
    }
    const Body &mover = outcome_.step->bodies[mover_], &partner = outcome_.step->bodies[partner_];
    const auto boxOf = [](const Positions& positions) {
      Eigen::AlignedBox3d box;
      for (const Vec3& p : positions) box.extend(p);
      return box;
    };
    const auto addHull = [&](const auto& feature) {
      Positions corners;
      for (const Index v : feature) corners.push_back((*partner.t1)[v]);
      if (near.intersects(boxOf(corners))) features_.push_back({boxOf(corners), corners});
    };
    for (const Face& face : partner.topology->faces()) addHull(face);
    if (!partner.topology->hasFaces()) {
      for (const Edge& edge : partner.topology->edges()) addHull(edge);
    }
    const Eigen::AlignedBox3d mover_box = boxOf(ends_[0].at), partner_box = boxOf(*partner.t1);
    may_hold_ = (partner.topology->isClosed() && partner_box.contains(mover_box)) ||
                (mover.topology->isClosed() && mover_box.contains(partner_box));
  }

  /// What may be normal to such a plane: any will do that is one.
  std::vector<Vec3> directions() const {
    std::vector<Vec3> all;
    const auto add = [&](const Vec3& direction) {
      const double length = direction.norm();
      if (length > tolerance::CLEARANCE_DIRECTION_M && std::isfinite(length)) all.push_back(direction / length);
    };
    add(middleOf(ends_[1].at) - middleOf(ends_[0].at));
    add(middleOf(ends_.back().at) - middleOf(ends_[0].at));
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

  double untilBy(const Vec3& direction) const {
    const double height = lowest(ends_[0].at, direction);
    std::size_t last = 0;
    while (last + 1 < ends_.size() && lowest(ends_[last + 1].at, direction) >= height - rounding_m_) ++last;
    if (last == 0) return 0;
    double until_s = ends_[last].time_s;
    for (const Feature& feature : features_) {
      double most = -SpeedBound::NONE;
      for (const Vec3& corner : feature.corners) most = std::max(most, direction.dot(corner));
      if (feature.corners.empty())
        most = direction.dot(feature.box.center()) + direction.cwiseAbs().dot(feature.box.sizes()) / 2;
      if (most + radius_m_ <= height + rounding_m_) continue;
      double least_m = SpeedBound::NONE;
      for (std::size_t k = 0; k < last && ends_[k].time_s < until_s; ++k) {
        least_m = std::min(least_m, ends_[k + 1].piece.exteriorDistance(feature.box));
        if (least_m >= ends_[k + 1].needed_m) continue;
        until_s = ends_[k].time_s;
        break;
      }
    }
    if (!may_hold_) return until_s;
    const Positions& partner = *outcome_.step->bodies[partner_].t1;
    return std::all_of(partner.begin(), partner.end(), [&](const Vec3& p) { return direction.dot(p) <= height; })
               ? until_s
               : 0;
  }

  const Outcome& outcome_;
  const PathPair& pair_;
  std::uint16_t mover_ = 0, partner_ = 0;
  Eigen::Isometry3d to_map_ = Eigen::Isometry3d::Identity();  // the frame in which all of this is
  std::vector<End> ends_;
  std::vector<Feature> features_;
  double radius_m_ = 0, rounding_m_ = 0;
  bool may_hold_ = false;  // one of the two may be inside of the other
};

}  // namespace

double leavesUntil(const Outcome& outcome, const PathPair& pair, const IntendedPath& path, double most_s,
                   const PathPace& pace) {
  return LeavingPlanes(outcome, pair, path, most_s, pace).until();
}

}  // namespace dccd
