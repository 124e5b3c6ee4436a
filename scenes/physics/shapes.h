// Geometry of a scene's shapes, solids and motions; free of Bullet.
#pragma once

#include <vector>

#include "scenes/physics/scene_spec.h"

namespace dccd::scene {

/// Vertices of a shape at the start, row-major, in the fixed frame [m].
Positions startPositions(const Shape& shape);

/// Triangles of a shape; the diagonals alternate, so that no direction folds more easily. None for a rope.
std::vector<Face> shapeFaces(const Shape& shape);

/// The pose of a motion at a time: offset and rotation about the start's centroid.
Eigen::Isometry3d motionAt(const Motion& motion, const Vec3& centroid_m, double time_s);

/// Where a joint is that these keys move.
double jointAt(const std::vector<JointKey>& keys, double time_s);

/// The pose of each link in the frame of its parent, of the root in the fixed frame.
std::vector<Eigen::Isometry3d> posesInParents(const Robot& robot, double time_s);

/// The same of each link in the fixed frame.
std::vector<Eigen::Isometry3d> linkPoses(const Robot& robot, double time_s);

/// True if the point lies in the solid, its surface included.
bool contains(const Solid& solid, const Vec3& point_m);

/// From the surface of a RING to the point; negative within [m].
double distanceToRing(const Solid& ring, const Vec3& point_m);

Box bounds(const Solid& solid);

/// The solid without what lies within `inset_m` of its surface; empty() tells whether anything is left.
Solid shrunk(const Solid& solid, double inset_m);
bool empty(const Solid& solid);

}  // namespace dccd::scene
