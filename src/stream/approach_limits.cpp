#include "dccd/approach_limits.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "step/clearance/map_boxes.h"
#include "step/threads.h"
#include "stream/body_trees.h"
#include "stream/pairs_ahead.h"
#include "stream/radii.h"

namespace dccd {

struct ApproachSearch::Shapes {
  struct One {
    SceneBody scene;
    FeatureTree own, fixed;  // in the body's own frame, if it is rigid, and in the fixed one
    std::vector<VertexMotion> own_at, fixed_at;
    bool is_known = false;
  };
  std::vector<One> bodies;
  MapBoxes map;

  const One& of(const Body& body, std::size_t number) {
    One& one = bodies[number];
    if (std::exchange(one.is_known, true)) return one;
    if (takesMesh(body, one.scene)) {
      one.own.build(one.scene, *body.t1);
      one.fixed = one.own;
    }
    const Eigen::Isometry3d to_own = body.rigid ? body.pose_t1.inverse() : Eigen::Isometry3d::Identity();
    one.own_at.clear();
    one.fixed_at.clear();
    for (const Index v : one.scene.slot_vertex) {
      const bool is_asked = one.scene.asked.empty() || one.scene.asked[v];
      const Vec3 p = is_asked ? (*body.t1)[v] : Vec3(Vec3::Zero());
      one.own_at.push_back(atRestAt(to_own * p));
      one.fixed_at.push_back(atRestAt(p));
    }
    one.own.refit(one.own_at.data());
    one.fixed.refit(one.fixed_at.data());
    return one;
  }
};

namespace {

constexpr std::size_t MOST_LIMITS = 64;                           // of a pair, unless there is no other way
constexpr std::array<double, 3> SHARES_OF_DISTANCE{0.8, 0.4, 0};  // that a plane leaves at least, if there are more

/// The planes between a rigid body and a partner, both where the step ends.
template <class Partner>
class PlanesBetween {
 public:
  /// to: the frame of the partner's tree, from the body's own.
  PlanesBetween(const FeatureTree& body, const Eigen::Isometry3d& to, const Partner& partner, double far_m)
      : body_(body), to_(to), partner_(partner), far_m_(far_m) {
    slack_m_ = 4 * tolerance::CLEARANCE *
               std::max({1.0, partner.box(partner.root()).largest(),
                         body.box(body.root()).largest() * 2 + to.translation().cwiseAbs().maxCoeff()});
  }
  struct Plane {
    MovingHull corners;  // of the body's
    Vec3 normal;         // towards the partner
    double apart_m = 0;
  };

  /// Such that each pair of features that may be nearer than far_m is on either side of one that leaves at least
  /// enough_m, or as much as two features do; false: two may touch, there is no time, or they are more than `most`.
  bool find(double enough_m, std::size_t most, const Deadline& deadline, std::vector<Plane>& planes) {
    planes.clear();
    std::vector<Nodes> open{{body_.root(), partner_.root(), false}};
    while (!open.empty()) {
      const Nodes at = open.back();
      open.pop_back();
      Plane plane = between(at);
      if (plane.apart_m >= far_m_) continue;
      if (plane.apart_m > 0 && (at.items || plane.apart_m >= enough_m)) {
        if (at.items) plane.corners = filled(plane.corners);
        planes.push_back(std::move(plane));
      } else if (at.items) {
        return false;
      } else {
        split(at, open);
      }
      if (planes.size() > most || deadline.isOver()) return false;
    }
    return true;
  }

 private:
  struct Nodes {
    std::uint32_t a, b;
    bool items;
  };
  static MovingHull filled(MovingHull hull) {
    while (hull.count < 8) hull.addCorner(hull.t1[0], hull.t1[0]);
    return hull;
  }
  MovingHull placed(const MovingHull& own) const {
    MovingHull hull;
    for (std::size_t i = 0; i < own.count; ++i) {
      const Vec3 p = to_ * own.t1[i];
      hull.addCorner(p, p);
    }
    return hull;
  }
  static MovingHull hullOf(const StepBox& box) { return MovingHull::box(box.lo + 4, box.hi + 4); }

  Plane between(const Nodes& at) {
    Plane plane;
    plane.corners = placed(at.items ? body_.itemHull(at.a) : hullOf(body_.box(at.a)));
    const MovingHull other = at.items ? partner_.itemHull(at.b) : hullOf(partner_.box(at.b));
    pair_.set(plane.corners, other);
    plane.normal = -pair_.at(1, 1e-6).direction;
    if (plane.normal.isZero()) return plane;
    plane.normal.normalize();
    double most = -SpeedBound::NONE, least = SpeedBound::NONE;
    for (std::size_t i = 0; i < plane.corners.count; ++i) most = std::max(most, plane.normal.dot(plane.corners.t1[i]));
    for (std::size_t i = 0; i < other.count; ++i) least = std::min(least, plane.normal.dot(other.t1[i]));
    plane.apart_m = least - most - slack_m_;
    return plane;
  }

  void split(const Nodes& at, std::vector<Nodes>& open) const {
    const bool leaf_a = body_.isLeaf(at.a), leaf_b = partner_.isLeaf(at.b);
    if (leaf_a && leaf_b) {
      for (std::uint32_t i = 0; i < body_.count(at.a); ++i) {
        for (std::uint32_t j = 0; j < partner_.count(at.b); ++j)
          open.push_back({body_.first(at.a) + i, partner_.first(at.b) + j, true});
      }
    } else if (leaf_b || (!leaf_a && body_.box(at.a).length() >= partner_.box(at.b).length())) {
      body_.forChildren(at.a, [&](std::uint32_t child) { open.push_back({child, at.b, false}); });
    } else {
      partner_.forChildren(at.b, [&](std::uint32_t child) { open.push_back({at.a, child, false}); });
    }
  }

  const FeatureTree& body_;
  const Eigen::Isometry3d to_;
  const Partner& partner_;
  const double far_m_;
  double slack_m_ = 0;
  HullPair pair_;
};

/// At which a distance lasts for the horizon, less the partner's bound; rounded down.
double speedFor(double apart_m, double horizon_s, double partner_m_s) {
  const double speed_m_s = apart_m / horizon_s;
  return speed_m_s - partner_m_s - 1e-9 * (std::abs(speed_m_s) + partner_m_s);
}

/// Appends a pair's limits; false: nobody knows enough for them. held_m: what holds the two apart.
template <class Partner>
bool addLimits(const FeatureTree& body, const Eigen::Isometry3d& to, const Partner& partner, const Clearance& row,
               double far_m, double held_m, double partner_m_s, const Deadline& deadline, ApproachLimit limit,
               ApproachLimits& result) {
  PlanesBetween<Partner> between(body, to, partner, far_m);
  std::vector<typename PlanesBetween<Partner>::Plane> planes;
  const double apart_m = std::min(far_m, row.at_end.upper_m);
  const bool are_found = std::any_of(SHARES_OF_DISTANCE.begin(), SHARES_OF_DISTANCE.end(), [&](double share) {
    const std::size_t most = share > 0 ? MOST_LIMITS : planes.max_size();
    return between.find(share * apart_m, most, deadline, planes);
  });
  if (!are_found) return false;
  for (const auto& plane : planes) {
    limit.corner = plane.corners.t1;
    limit.normal = plane.normal;
    limit.speed_m_s = speedFor(plane.apart_m - held_m, result.horizon_s, partner_m_s);
    result.of.push_back(limit);
  }
  return true;
}

}  // namespace

ApproachLimits ApproachSearch::run(const Outcome& outcome, const Options& options, const std::vector<SpeedBound>& given,
                                   double max_m, double horizon_s, Deadline deadline) {
  const ScopedFloatMode mode;
  ApproachLimits result;
  result.horizon_s = horizon_s;
  const std::vector<SpeedBound> bounds = boundsOf(outcome, given);
  if (const std::string why = whyNone(outcome); !why.empty()) {
    result.unknown.push_back(why);
    return result;
  }
  const std::vector<Body>& bodies = outcome.step->bodies;
  if (!shapes_) shapes_ = std::make_shared<Shapes>();
  shapes_->bodies.resize(bodies.size());
  for (Shapes::One& one : shapes_->bodies) one.is_known = false;
  if (outcome.measured) shapes_->map.set(outcome.measured);
  const auto isLink = [&](std::uint16_t b) { return b != OBSTACLE_BODY && bodies[b].rigid && bounds[b].max_m_s > 0; };
  for (std::uint16_t b = 0; b < bodies.size(); ++b)
    if (isLink(b)) result.bodies.push_back(b);
  max_m = std::min(max_m, options.clearance.max_m);
  result.most_speed_m_s = max_m / horizon_s;
  // A map whose frame moves may go any way.
  const double map_m_s = outcome.step->map.way.empty() ? 0 : SpeedBound::NONE;
  const Insides insides(outcome);
  forPairs(outcome, [&](const Clearance& row, std::size_t) {
    if (!counts(outcome, row) || isItself(row)) return;
    const double start_m = distanceOf(outcome, insides, row);
    for (const bool swaps : {false, true}) {
      const std::uint16_t link = row.body[swaps], other = row.body[!swaps];
      if (!isLink(link) || (other != OBSTACLE_BODY && bounds[other].carrier == link)) continue;
      const bool on_map = other == OBSTACLE_BODY;
      const double partner_m_s = on_map ? map_m_s : bounds[other].max_m_s;
      const double radii_m = largestRadius(bodies[link]) + (on_map ? 0 : largestRadius(bodies[other]));
      const double held_m = (separationOf(*outcome.step, row) + radii_m) * (1 + 1e-9);
      if (!std::isfinite(partner_m_s)) {
        result.unknown.push_back(unboundedReason(on_map ? "octomap" : bodies[other].name));
      } else if (start_m == 0) {
        result.unknown.push_back(zeroReason(outcome, insides, row));
      } else {
        result.most_speed_m_s = std::min(result.most_speed_m_s, speedFor(max_m - held_m, horizon_s, partner_m_s));
        if (start_m + held_m * (1 - 2e-9) > max_m) continue;
        const FeatureTree& own = shapes_->of(bodies[link], link).own;
        ApproachLimit limit;
        limit.body = link;
        limit.partner = other;
        const auto add = [&](const auto& partner, const Eigen::Isometry3d& to) {
          return addLimits(own, to, partner, row, max_m, held_m, partner_m_s, deadline, limit, result);
        };
        const std::size_t before = result.of.size();
        const bool is_known = on_map ? add(shapes_->map, outcome.step->map.map_from_fixed * bodies[link].pose_t1)
                                     : add(shapes_->of(bodies[other], other).fixed, bodies[link].pose_t1);
        if (!is_known) result.unknown.push_back("of " + pairOf(outcome, row) + " there was no time to look at all");
        const Eigen::Isometry3d back = outcome.step->map.map_from_fixed.inverse();
        for (std::size_t i = before; on_map && i < result.of.size(); ++i) {
          for (Vec3& corner : result.of[i].corner) corner = back * corner;
          result.of[i].normal = back.linear() * result.of[i].normal;
        }
      }
    }
  });
  if (!(result.most_speed_m_s > 0))
    result.unknown.push_back("something is so fast that it may come from beyond limits/max_m");
  return result;
}

}  // namespace dccd
