// What the general tests say of a mesh against occupied voxels as closed boxes: 8 corners, 12 edges, 12 triangles each.
#pragma once

#include <optional>
#include <vector>

#include "dccd/elementary.h"
#include "dccd/topology.h"
#include "dccd/voxel_surface.h"

namespace dccd {
namespace test {

/// A moving mesh beside voxels, in the map's frame.
struct ObstacleScene {
  double resolution_m = 1;
  std::vector<OccupiedLeaf> leaves;
  Topology topology;
  Positions t0, t1;
};

/// The lower end of the earliest TOC cell of a face (or, for a polyline, an edge) of the mesh against every leaf,
/// interior ones too, by `exact`; 0 where it meets one at t=0; nothing where it never does.
std::optional<double> earliestAgainstBoxes(const ObstacleScene& scene, const std::vector<Index>& feature, int toc_bits);

/// The same from an obstacle test's contacts: the earliest of those of the feature's vertices, edges and face.
std::optional<double> earliestOfContacts(const std::vector<Contact>& contacts, const std::vector<Index>& feature);

/// The distance between the mesh and the boxes as solids at time t, rounded [m].
double distanceToBoxes(const ObstacleScene& scene, double t);

/// One line a part, for failures.
std::string describe(const ObstacleScene& scene);

}  // namespace test
}  // namespace dccd
