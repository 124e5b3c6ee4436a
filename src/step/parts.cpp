#include "step/parts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "dccd/mesh_store.h"
#include "dccd/tolerances.h"

namespace dccd {
namespace {

constexpr double MOST_PARTS_FOR_WAYPOINTS = 64;

/// Two neighbours of the step's ends and the waypoints, and how far between them.
struct Leg {
  const Eigen::Isometry3d *from_pose, *to_pose;
  const Positions *from, *to;
  double u;
};

/// On which of the body's ways from waypoint to waypoint it is at the fraction u of the step, and where on it.
Leg legAt(const Body& body, double u) {
  const std::vector<Waypoint>& points = body.waypoints;
  const auto isBefore = [](const Waypoint& point, double at) { return point.u < at; };
  const auto next = std::lower_bound(points.begin(), points.end(), u, isBefore);
  const Waypoint* const from = next == points.begin() ? nullptr : &*std::prev(next);
  const Waypoint* const to = next == points.end() ? nullptr : &*next;
  const double from_u = from ? from->u : 0, to_u = to ? to->u : 1;
  return {from ? &from->pose : &body.pose_t0, to ? &to->pose : &body.pose_t1,
          from ? from->positions.get() : body.t0.get(), to ? to->positions.get() : body.t1.get(),
          points.empty() ? u : (u - from_u) / (to_u - from_u)};
}

/// What moves a turning body from t0 to where it is at the fraction u of the step.
Eigen::Isometry3d movedBy(double pose_scale, const Body& body, double u) {
  const Leg leg = legAt(body, u);
  return interpolate(*leg.from_pose, *leg.to_pose, leg.u * pose_scale) * body.pose_t0.inverse();
}

/// The body's vertices at t0 after a motion.
Positions moved(const Body& body, const Eigen::Isometry3d& motion) {
  Positions places(body.t0->size());
  for (std::size_t v = 0; v < places.size(); ++v) places[v] = motion * (*body.t0)[v];
  return places;
}

/// Where the vertices are at the fraction u of the step.
Positions placedAt(double pose_scale, const Body& body, double u) {
  if (body.turns) return moved(body, movedBy(pose_scale, body, u));
  Positions placed;
  const Leg leg = legAt(body, u);
  interpolate(*leg.from, *leg.to, leg.u, placed);
  return placed;
}

double radiusOf(const Body& body) {
  double squared = 0;
  for (const Vec3& p : *body.t0) squared = std::max(squared, (p - body.pose_t0.translation()).squaredNorm());
  return std::sqrt(squared);
}

/// A chord leaves its arc by this at most, which is the whole diameter from a full turn on.
double sagitta(double radius, double angle) {
  const double half = std::sin(std::min(angle, 2 * M_PI) / 4);
  return radius * 2 * half * half;
}

/// Of what the body spans at its start.
std::array<Vec3, 8> cornersOf(const Body& body) {
  Eigen::AlignedBox3d bounds(Vec3::Zero());
  bounds.setEmpty();
  for (const Vec3& p : *body.t0) {
    if (p.allFinite()) bounds.extend(p);
  }
  if (bounds.isEmpty()) bounds.extend(body.pose_t0.translation());
  return dccd::cornersOf(bounds);
}

/// How far the body is at its waypoints from straight paths through so many equal parts [m]. Vertices that are not
/// finite are not compared.
double offParts(const Body& body, std::size_t parts) {
  const double count = static_cast<double>(parts);
  std::array<Vec3, 8> corners;
  if (body.turns) corners = cornersOf(body);
  double off = 0;
  for (const Waypoint& point : body.waypoints) {
    const double part = std::min(std::floor(point.u * count), count - 1), s = point.u * count - part;
    if (body.turns) {
      const Eigen::Isometry3d from = movedBy(1, body, part / count), to = movedBy(1, body, (part + 1) / count);
      const Eigen::Isometry3d there = point.pose * body.pose_t0.inverse();
      for (const Vec3& p : corners) off = std::max(off, (there * p - ((1 - s) * (from * p) + s * (to * p))).norm());
    } else {
      const Positions from = placedAt(1, body, part / count), to = placedAt(1, body, (part + 1) / count);
      for (std::size_t v = 0; v < from.size(); ++v) {
        off = std::max(off, ((*point.positions)[v] - ((1 - s) * from[v] + s * to[v])).norm());
      }
    }
  }
  return off;
}

/// The largest turn between two neighbours of the waypoints, the parts' ends and the step's, where it turns [rad].
double turnBetween(const Body& body, double pose_scale, std::size_t parts) {
  double most = 0, from_u = 0;
  const auto add = [&](double u, const Eigen::Isometry3d& from, const Eigen::Isometry3d& to) {
    // Of a leg as much as its share, at the most a part's.
    const double part_of_it = std::min(1.0, 1 / (static_cast<double>(parts) * (u - from_u)));
    most = std::max(most, part_of_it * pose_scale * rotationAngle(from, to));
    from_u = u;
  };
  const Eigen::Isometry3d* from = &body.pose_t0;
  for (const Waypoint& point : body.waypoints) {
    add(point.u, *from, point.pose);
    from = &point.pose;
  }
  add(1, *from, body.pose_t1);
  return most;
}

/// Holds all of the body's ways through the step. One that turns does so about its frame's origin, which moves
/// straight: on whichever way, no vertex is further from there than its radius.
Eigen::AlignedBox3d sweptBounds(const Step& step, const Body& body, double margin_m) {
  Eigen::AlignedBox3d bounds;
  if (body.turns) {
    const Vec3 from = body.pose_t0.translation();
    bounds.extend(from);
    bounds.extend(Vec3(from + step.pose_scale * (body.pose_t1.translation() - from)));
    for (const Waypoint& point : body.waypoints) bounds.extend(Vec3(point.pose.translation()));
    margin_m += radiusOf(body);
  } else {
    const auto extend = [&](const Positions& positions) {
      for (const Vec3& p : positions) {
        if (p.allFinite()) bounds.extend(p);
      }
    };
    extend(*body.t0);
    extend(*body.t1);
    for (const Waypoint& point : body.waypoints) extend(*point.positions);
  }
  if (body.radius_m && !body.radius_m->empty()) {
    margin_m += *std::max_element(body.radius_m->begin(), body.radius_m->end());
  }
  bounds.min().array() -= margin_m;
  bounds.max().array() += margin_m;
  return bounds;
}

}  // namespace

Eigen::Isometry3d ObstacleMap::fromFixedAt(double u) const {
  if (way.empty() || u <= 0) return map_from_fixed;
  const auto next =
      std::lower_bound(way.begin(), way.end() - 1, u, [](const Waypoint& point, double at) { return point.u < at; });
  const double from_u = next == way.begin() ? 0 : std::prev(next)->u;
  const Eigen::Isometry3d from = next == way.begin() ? map_from_fixed.inverse() : std::prev(next)->pose;
  return interpolate(from, next->pose, (u - from_u) / (next->u - from_u)).inverse();
}

double rotationAngle(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  const Eigen::Quaterniond turn(a.linear().transpose() * b.linear());
  return 2 * std::atan2(turn.vec().norm(), std::abs(turn.w()));
}

std::array<Vec3, 8> cornersOf(const Eigen::AlignedBox3d& box) {
  std::array<Vec3, 8> corners;
  corners.fill(Vec3::Zero());
  for (int i = 0; i < 8 && !box.isEmpty(); ++i)
    corners[static_cast<std::size_t>(i)] = box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(i));
  return corners;
}

double partsFor(const Body& body, double pose_scale, double tolerance_m, const Extent* extent) {
  const double angle = pose_scale * rotationAngle(body.pose_t0, body.pose_t1);
  const auto isStraight = [&](double radius) { return sagitta(radius, angle) <= tolerance_m; };
  // The farthest corner of what its vertices span is no nearer than any of them, also as it is rounded.
  if (extent && extent->of == body.t0 && extent->is_finite) {
    const Vec3 centre = body.pose_t0.translation();
    const Vec3 corner = (extent->lo - centre).cwiseAbs().cwiseMax((extent->hi - centre).cwiseAbs());
    if (isStraight(corner.norm())) return 1;
  }
  const double radius = radiusOf(body);
  return isStraight(radius) ? 1 : std::ceil(angle / (2 * std::acos(1 - tolerance_m / radius)));
}

/// Between neighbours of waypoints and parts' ends the way leaves its own chord by the sagitta at the most, and that
/// chord leaves the part's by no more than its two ends do.
double leavesWayBy(const Body& body, double pose_scale, std::size_t parts) {
  if (!body.turns && body.waypoints.empty()) return 0;
  const double radius = body.turns ? radiusOf(body) : 0;
  double largest = radius;
  if (body.turns) {
    for (const Eigen::Isometry3d* pose : {&body.pose_t0, &body.pose_t1})
      largest = std::max(largest, pose->translation().cwiseAbs().maxCoeff() + radius);
  }
  for (const Waypoint& point : body.waypoints) {
    if (body.turns) largest = std::max(largest, point.pose.translation().cwiseAbs().maxCoeff() + radius);
    for (std::size_t v = 0; point.positions && v < point.positions->size(); ++v) {
      const Vec3& p = (*point.positions)[v];
      if (p.allFinite()) largest = std::max(largest, p.cwiseAbs().maxCoeff());
    }
  }
  const double arc = body.turns ? sagitta(radius, turnBetween(body, pose_scale, parts)) : 0;
  return (offParts(body, parts) + arc + tolerance::CLEARANCE * largest) * (1 + tolerance::CLEARANCE);
}

double leavesWayOnMap(const Step& step, const Body& body, std::size_t parts, double most_m) {
  if (step.map.way.empty() || !meetsMap(body)) return 0;
  const double count = static_cast<double>(parts);
  std::vector<double> at;
  for (std::size_t part = 0; part <= parts; ++part) at.push_back(static_cast<double>(part) / count);
  for (const Waypoint& point : step.map.way) at.push_back(point.u);
  for (const Waypoint& point : body.waypoints) at.push_back(point.u);
  std::sort(at.begin(), at.end());
  const auto onMap = [&](double u) {
    Positions placed = placedAt(step.pose_scale, body, u);
    const Eigen::Isometry3d map_from_fixed = step.map.fromFixedAt(u);
    for (Vec3& p : placed) p = map_from_fixed * p;
    return placed;
  };
  double off = 0, largest = 0;
  std::size_t next = 1;
  Positions from, to = onMap(0);
  for (std::size_t part = 0; part < parts; ++part) {
    const double from_u = static_cast<double>(part) / count, to_u = static_cast<double>(part + 1) / count;
    from = std::exchange(to, onMap(to_u));
    for (; next < at.size() && at[next] <= to_u; ++next) {
      for (const double u : {(at[next - 1] + at[next]) / 2, at[next]}) {
        if (at[next - 1] == at[next] || u == to_u) continue;
        const Positions there = onMap(u);
        const double s = (u - from_u) * count;
        for (std::size_t v = 0; v < there.size(); ++v) {
          off = std::max(off, (there[v] - ((1 - s) * from[v] + s * to[v])).norm());
          largest = std::max(largest, there[v].cwiseAbs().maxCoeff());
        }
        if (off > most_m) return off;
      }
    }
  }
  return (off + tolerance::CLEARANCE * largest) * (1 + tolerance::CLEARANCE);
}

std::shared_ptr<const Positions> placesAt(const Body& body, const Waypoint& point) {
  return body.turns ? share(moved(body, point.pose * body.pose_t0.inverse())) : point.positions;
}

WayBends::WayBends(const Body& body) : body_(body) {
  if (body.turns) corners_ = cornersOf(body);
}

double WayBends::at(const Waypoint& before, const Waypoint& point, const Waypoint& after) const {
  const double s = (point.u - before.u) / (after.u - before.u);
  double off = 0;
  if (body_.turns) {
    const Eigen::Isometry3d from_t0 = body_.pose_t0.inverse();
    const Eigen::Isometry3d without = interpolate(before.pose, after.pose, s) * from_t0, with = point.pose * from_t0;
    for (const Vec3& p : corners_) off = std::max(off, (with * p - without * p).norm());
    return off;
  }
  for (std::size_t v = 0; v < point.positions->size(); ++v) {
    const Vec3 &from = (*before.positions)[v], &to = (*after.positions)[v];
    off = std::max(off, ((*point.positions)[v] - (from + s * (to - from))).norm());
  }
  return off;
}

double offWay(const Body& body, const std::vector<Waypoint>& waypoints) {
  if (waypoints.empty()) return 0;
  const WayBends bends(body);
  const Waypoint start{0, body.pose_t0, body.t0}, end{1, body.pose_t1, body.t1};
  double off = 0;
  for (const Waypoint& point : waypoints) off = std::max(off, bends.at(start, point, end));
  return off;
}

std::size_t neededParts(const Step& step, double tolerance_m, const std::vector<SceneBody>& before, double apart_m) {
  std::vector<std::optional<Eigen::AlignedBox3d>> bounds(step.bodies.size());
  // The tolerance is far above all rounding. A distance is told less what both bodies leave their arcs by.
  const double margin_m = std::max(largestSeparation(step.bodies), apart_m / 2) + tolerance_m;
  const auto boundsOf = [&](std::size_t b) -> const Eigen::AlignedBox3d& {
    const double leaves_m = apart_m > 0 && !bounds[b] ? leavesWayBy(step.bodies[b], step.pose_scale, 1) : 0;
    if (!bounds[b]) bounds[b] = sweptBounds(step, step.bodies[b], margin_m + leaves_m);
    return *bounds[b];
  };
  const auto isNear = [&](std::size_t b) {
    if (meetsMap(step.bodies[b]) && step.map.surface) return true;
    for (std::size_t other = 0; other < step.bodies.size(); ++other) {
      const bool tested = other != b && meet(step.bodies[b], b, step.bodies[other], other);
      if (tested && boundsOf(b).intersects(boundsOf(other))) return true;
    }
    return false;
  };
  // What more parts need for another body may leave this one's bends where fewer met them.
  const auto fits = [&](double parts) {
    const auto count = static_cast<std::size_t>(parts);
    return std::all_of(step.bodies.begin(), step.bodies.end(), [&](const Body& body) {
      const bool is_straight = body.waypoints.empty() ||
                               !isNear(static_cast<std::size_t>(&body - step.bodies.data())) ||
                               leavesWayBy(body, 1, count) <= tolerance_m;
      return is_straight && leavesWayOnMap(step, body, count, tolerance_m) <= tolerance_m;
    });
  };
  double parts = 1;
  for (std::size_t b = 0; b < step.bodies.size(); ++b) {
    const Body& body = step.bodies[b];
    if (!body.turns || !body.waypoints.empty()) continue;
    const double own =
        partsFor(body, step.pose_scale, tolerance_m, b < before.size() ? &before[b].extents[1] : nullptr);
    if (own > parts && isNear(b)) parts = own;
  }
  for (; !fits(parts); ++parts) {
    if (parts >= MOST_PARTS_FOR_WAYPOINTS) return NO_NUMBER_OF_PARTS;
  }
  return parts < 1e9 ? static_cast<std::size_t>(parts) : static_cast<std::size_t>(1e9);
}

void advance(const Step& step, std::size_t part, std::size_t parts, Step& at) {
  const double u = static_cast<double>(part) / static_cast<double>(parts);
  if (!step.map.way.empty()) {
    at.map.map_from_fixed = step.map.fromFixedAt(static_cast<double>(part - 1) / static_cast<double>(parts));
    at.map.way = {{1, step.map.fromFixedAt(u).inverse()}};
  }
  for (std::size_t b = 0; b < step.bodies.size(); ++b) {
    const Body& body = step.bodies[b];
    Body& moved = at.bodies[b];
    moved.t0 = moved.t1;
    moved.t1 = part == parts ? body.t1 : share(placedAt(step.pose_scale, body, u));
  }
}

Vec3 placeVertex(const Step& step, std::size_t b, Index vertex, std::size_t part, std::size_t parts) {
  const Body& body = step.bodies[b];
  const Vec3 &t0 = (*body.t0)[vertex], &t1 = (*body.t1)[vertex];
  if (part == 0 || part == parts) return part == 0 ? t0 : t1;
  const double u = static_cast<double>(part) / static_cast<double>(parts);
  if (body.turns) return movedBy(step.pose_scale, body, u) * t0;
  const Leg leg = legAt(body, u);
  const Vec3 &from = (*leg.from)[vertex], &to = (*leg.to)[vertex];
  return leg.u == 0 ? from : leg.u == 1 ? to : Vec3(from + leg.u * (to - from));
}

}  // namespace dccd
