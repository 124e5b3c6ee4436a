// What the markers of contacts and those of the scene around them have in common. Inside of the room.
#pragma once

#include <visualization_msgs/MarkerArray.h>

#include "output/output_messages.h"

#include "config/monitor_config.h"

namespace dccd {

/// The markers of one step.
struct MarkerDrawing {
  const Outcome& outcome;
  const std::vector<Body>& bodies;
  const MarkerConfig& config;
  const std::string& frame;
  visualization_msgs::MarkerArray array;

  /// A white one, in the frame and with the step's stamp.
  visualization_msgs::Marker make(const std::string& ns, int type, double scale) const;
  /// The same of voxels: its points are in the map's frame.
  visualization_msgs::Marker makeInMap(const std::string& ns, int type, double scale) const;
  /// Of a list that has points.
  void add(visualization_msgs::Marker&& marker);
  void addText(const std::string& ns, int id, const Vec3& at, const std_msgs::ColorRGBA& rgba,
               const std::string& words);
  /// Of a text's letters [m].
  double textHeight() const { return 3 * config.point_size_m; }
};

std_msgs::ColorRGBA color(double r, double g, double b, double a = 1);
geometry_msgs::Point point(const Vec3& p);
/// Of the map's frame [m].
Vec3 voxelMin(const VoxelKey& key, double resolution_m);
/// The twelve of a box.
void addEdges(const Vec3& min, const Vec3& size, visualization_msgs::Marker& edges);

/// If the configuration asks for them: the map around the bodies, what rigid bodies sweep, and the bodies with their
/// names. What of the map is a body's own.
void addScene(MarkerDrawing& drawing);

}  // namespace dccd
