#include "node/cloud_mapping.h"

#include "input/mesh_views.h"
#include "input/wire.h"
#include "node/map_decode.h"

namespace dccd {

void CloudMapping::setFrame(const std::string& fixed_frame) {
  if (hasFrame()) return;
  frame_ = config_.octomap_frame.empty() ? fixed_frame : config_.octomap_frame;
}

std::vector<float> CloudMapping::place(const std::vector<std::uint8_t>& bytes, StampNs receipt_ns,
                                       const std::function<bool()>& may_wait, LoadedMap& map, SensorView& view) const {
  WireReader wire(bytes.data(), bytes.size());
  const CloudView cloud = readCloud(wire, {});
  map.stamp_ns = cloud.header.stamp_ns != 0 ? cloud.header.stamp_ns : receipt_ns;
  if (cloud.size() == 0) throw WireError("it has no points");
  const std::string frame = frameNameOf(cloud.header);
  if (frame.empty()) throw WireError("frame_id is empty; it is to name the sensor's frame");
  std::string reason;
  while (!transforms_.lookup(frame_, frame, map.stamp_ns, view.map_from_sensor, reason)) {
    if (may_wait()) continue;
    throw WireError(transforms_.noTransform(frame, "'" + frame_ + "'", reason) + "; the clouds on " +
                    config_.cloud_topic + " need it");
  }
  std::vector<float> xyz;
  xyz.reserve(3 * cloud.size());
  bool any = false;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3 p = cloud.point(i);
    any = any || p.allFinite();
    for (int axis = 0; axis < 3; ++axis) xyz.push_back(static_cast<float>(p[axis]));
  }
  if (!any) throw WireError("none of its " + std::to_string(cloud.size()) + " points is finite");
  view.width = cloud.width;
  view.height = cloud.height;
  view.xyz = xyz.data();
  return xyz;
}

LoadedMap CloudMapping::add(const std::vector<std::uint8_t>& bytes, StampNs receipt_ns,
                            const std::function<bool()>& may_wait, const VoxelSurface* before) {
  LoadedMap map;
  map.frame_id = frame_;
  bool is_in = false;
  loadMap(config_, &memory_, before, map, [&](const OctomapLimits& limits) {
    SensorView view;
    const std::vector<float> xyz = place(bytes, receipt_ns, may_wait, map, view);
    if (!map_) map_.emplace(config_.cloud_map);
    is_in = true;  // be it in part
    try {
      map_->insert(view, cloudMemory(config_));
    } catch (const OctomapError& error) {
      throw OctomapError(error.what() + std::string("; a quarter of max_map_mb ") +
                         std::to_string(config_.max_map_bytes >> 20) +
                         " is for it: raise that or obstacle_resolution_m, or set obstacle_max_range_m");
    }
    return map_->leaves(limits);
  });
  if (!map.surface && is_in) map.missed = "one was refused: " + map.problem;
  return map;
}

}  // namespace dccd
