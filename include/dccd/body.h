// A body: what it is, how it is tested, its mesh, and where it is at both ends of a step.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "dccd/contact.h"
#include "dccd/topology.h"
#include "dccd/types.h"

namespace dccd {

/// How a body comes by its positions.
enum class BodyMotionKind : std::uint8_t {
  STREAM = 0,  ///< frames with stamps, interpolated between them
  STATIC = 1,  ///< the newest frame holds at all times
};

/// A minimum separation [m] from one other body (or itself, or OBSTACLE_BODY) instead of the larger of the two bodies'.
struct SeparationFrom {
  std::uint16_t body = 0;
  double separation_m = 0;
  friend bool operator==(const SeparationFrom& a, const SeparationFrom& b) {
    return a.body == b.body && a.separation_m == b.separation_m;
  }
};

/// Body::own_voxels_m, whatever the map's resolution.
constexpr double ONE_VOXEL = -1;

/// Where a body is between a step's ends.
struct Waypoint {
  double u = 0;                                            ///< fraction of the step, in (0,1)
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  ///< of one that turns: fixed_from_body there
  std::shared_ptr<const Positions> positions{};            ///< of others: where its vertices are there; null: it turns
};

/// Large parts are shared, never changed: a copy of a body costs no positions.
struct Body {
  // What it is and what it is tested against: the same in every step of a stream.
  std::string name;
  BodyMotionKind motion = BodyMotionKind::STREAM;
  bool rigid = false;  ///< never tested against itself
  bool self_collision = true;
  bool against_bodies = true;
  bool against_obstacle = true;
  bool shell = false;  ///< a container: closed, but others may be inside of it
  /// In a stream: how far from its surface the sensor that made the map may have put its points; what the map first
  /// shows there is the body's own, and no obstacle [m]. 0: nothing is. ONE_VOXEL: as far as a voxel is long.
  double own_voxels_m = 0;
  std::string link;  ///< of a robot; empty: none. What one link accounts for in a map another one may go on to
  double minimum_separation_m = 0;          ///< [m]; a pair uses the larger of its two bodies'
  std::vector<Index> vertex_mask;           ///< vertices that are left out, with every feature on them (grasped ones)
  std::vector<SeparationFrom> separations;  ///< named by either of the two bodies
  std::vector<std::uint16_t> not_against;   ///< bodies that it is not tested against, ascending; named by either

  // Its mesh.
  std::shared_ptr<const Topology> topology;
  /// Where it was when it was known to be fit [m]: its features that are closer there than the minimum separation are
  /// neighbours, not layers. null: no pair is left out of the separation.
  std::shared_ptr<const Positions> reference;

  std::uint64_t dropped_faces = 0;  ///< that were sent and could not be used: unchecked

  // Its way through the step, in the fixed frame [m]. Non-finite positions are unchecked.
  std::shared_ptr<const Positions> t0, t1;
  bool turns = false;  ///< moves from pose_t0 to pose_t1 along the rotation, not straight
  Eigen::Isometry3d pose_t0 = Eigen::Isometry3d::Identity(), pose_t1 = Eigen::Isometry3d::Identity();
  /// Between these, ascending, it goes as it does from t0 to t1 where there are none. Those that it does not leave by
  /// more than rigid_tolerance_m without them are of no use. Not with Step::pose_scale.
  std::vector<Waypoint> waypoints;
  /// Uncertainty radius per vertex during the whole step [m], finite and 0 or more; null: none. A pair's separation
  /// grows by the largest radius of each of its two features. Needs accuracy conservative.
  std::shared_ptr<const std::vector<double>> radius_m;
};

/// All but a body's way, and what is only counted: what a history makes its arrays of. A new field goes in here, or the
/// next step is answered by the old one's arrays.
inline bool sameBody(const Body& a, const Body& b) {
  const bool same_mesh = a.topology == b.topology || (a.topology && b.topology && *a.topology == *b.topology);
  return same_mesh && a.reference == b.reference && a.name == b.name && a.rigid == b.rigid &&
         a.self_collision == b.self_collision && a.against_bodies == b.against_bodies &&
         a.against_obstacle == b.against_obstacle && a.shell == b.shell &&
         a.minimum_separation_m == b.minimum_separation_m && a.vertex_mask == b.vertex_mask &&
         a.separations == b.separations && a.not_against == b.not_against;
}

/// What a step looks at. The flow asks these, and so does the effect plan. `a` and `b` are the numbers of two bodies.
inline bool meetsItself(const Body& body) { return body.self_collision && !body.rigid; }
inline bool meet(const Body& body_a, std::size_t a, const Body& body_b, std::size_t b) {
  const auto names = [](const Body& body, std::size_t other) {
    return std::binary_search(body.not_against.begin(), body.not_against.end(), other);
  };
  return body_a.against_bodies && body_b.against_bodies && !names(body_a, b) && !names(body_b, a);
}
inline bool meetsMap(const Body& body) { return body.against_obstacle; }
inline bool ownsVoxels(const Body& body) { return body.own_voxels_m > 0 || body.own_voxels_m == ONE_VOXEL; }

/// What the body names as its separation from another one, by its number (or itself, or OBSTACLE_BODY) [m]; null: none.
inline const double* namedSeparation(const Body& body, std::size_t other) {
  for (const SeparationFrom& from : body.separations) {
    if (from.body == other) return &from.separation_m;
  }
  return nullptr;
}

/// The separation of the bodies number a and b, or of one from itself [m]. What either names for the other takes the
/// place of the larger of their own, be it 0. Whether they meet at all is not its matter.
inline double separationBetween(const Body& body_a, std::size_t a, const Body& body_b, std::size_t b) {
  if (const double* named = namedSeparation(body_a, b)) return *named;
  if (const double* named = namedSeparation(body_b, a)) return *named;
  return std::max(body_a.minimum_separation_m, body_b.minimum_separation_m);
}

/// The same of a body and the map.
inline double separationFromMap(const Body& body) {
  const double* named = namedSeparation(body, OBSTACLE_BODY);
  return named ? *named : body.minimum_separation_m;
}

/// The largest separation that is asked for [m], of bodies or from the map, be there a pair that carries it or not.
inline double largestSeparation(const std::vector<Body>& bodies) {
  double largest_m = 0;
  for (const Body& body : bodies) {
    largest_m = std::max(largest_m, body.minimum_separation_m);
    for (const SeparationFrom& from : body.separations) largest_m = std::max(largest_m, from.separation_m);
  }
  return largest_m;
}

/// Values to be shared.
template <class T>
std::shared_ptr<const T> share(T value) {
  return std::make_shared<const T>(std::move(value));
}

}  // namespace dccd
