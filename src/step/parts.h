// A step whose bodies turn or have waypoints, as parts that are straight enough.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <memory>
#include <vector>

#include "culling/scene_arrays.h"
#include "dccd/step.h"

namespace dccd {

/// How far the second pose is turned from the first one [rad], 0 to pi.
double rotationAngle(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b);

/// Of all that is affine in what the box holds, the largest is at one of these. All 0 of an empty one.
std::array<Vec3, 8> cornersOf(const Eigen::AlignedBox3d& box);

/// The parts that a step must be cut into so that the turning body's straight vertex paths stay within the tolerance of
/// its arc [m]; not limited. extent: what spares a look at each vertex, if it is of t0; null: none.
double partsFor(const Body& body, double pose_scale, double tolerance_m, const Extent* extent = nullptr);

/// How far the body's straight vertex paths leave its way at most when the step is cut into so many equal parts [m],
/// what placing them rounds included; 0 of one that goes straight.
double leavesWayBy(const Body& body, double pose_scale, std::size_t parts);

/// The same of its way as it is seen from a map that moves, by its samples, those of the map and the middles between
/// any two; 0 where the map stays, or the two are not tested. Once it is more than most_m it is not looked at further.
double leavesWayOnMap(const Step& step, const Body& body, std::size_t parts, double most_m);

/// How far a body's places are from the ways between others [m]. Vertices that are not finite are not compared.
class WayBends {
 public:
  explicit WayBends(const Body& body);
  /// Of a place from the way that leads from one before it straight to one after it, or along the arc.
  double at(const Waypoint& before, const Waypoint& point, const Waypoint& after) const;

 private:
  const Body& body_;
  std::array<Vec3, 8> corners_;  ///< of what it spans at its start, if it turns
};

/// Where the body's vertices are at one of its waypoints.
std::shared_ptr<const Positions> placesAt(const Body& body, const Waypoint& point);

/// Calls f(from, to, share) for each of the body's ways from waypoint to waypoint: where its vertices are at both, and
/// which share of the step lies between. Without waypoints that is the whole step.
template <class F>
void forEachLeg(const Body& body, F&& f) {
  std::shared_ptr<const Positions> from = body.t0;
  double from_u = 0;
  for (const Waypoint& point : body.waypoints) {
    const std::shared_ptr<const Positions> to = placesAt(body, point);
    f(*from, *to, point.u - from_u);
    from = to;
    from_u = point.u;
  }
  f(*from, *body.t1, 1 - from_u);
}

/// How far the waypoints are from the way that the body takes without them [m].
double offWay(const Body& body, const std::vector<Waypoint>& waypoints);

/// Of a step with a body that so many equal parts, or fewer, do not keep near its waypoints.
constexpr std::size_t NO_NUMBER_OF_PARTS = std::numeric_limits<std::size_t>::max();
/// The parts that a step is cut into where so many are needed. Where no number is enough it is not cut in vain.
inline std::size_t partsAllowed(std::size_t needed, std::size_t most) {
  return needed == NO_NUMBER_OF_PARTS ? 1 : std::min(needed, most);
}

/// The most that a body needs, up to 1e9, or NO_NUMBER_OF_PARTS; 1 where each goes straight. One does not count where
/// neither its arcs nor its straight paths come near anything that it is tested against or, with apart_m, from which
/// its distance is asked for up to there. before: the bodies as a step before left them.
std::size_t neededParts(const Step& step, double tolerance_m, const std::vector<SceneBody>& before = {},
                        double apart_m = 0);

/// Moves `at`, which ends where part `part` - 1 of `parts` equal parts ends, and its map, on by one part.
void advance(const Step& step, std::size_t part, std::size_t parts, Step& at);

/// One vertex at the end of the first `part` of `parts` equal parts, as advance() has it.
Vec3 placeVertex(const Step& step, std::size_t body, Index vertex, std::size_t part, std::size_t parts);

}  // namespace dccd
