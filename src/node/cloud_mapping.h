// A sensor's clouds, each made a part of one map where tf says that the sensor was.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "dccd/cloud_map.h"
#include "input/transforms.h"
#include "node/map_memory.h"
#include "node/monitor_pipeline.h"

namespace dccd {

/// For one thread at a time.
class CloudMapping {
 public:
  CloudMapping(const MonitorConfig& config, const TransformFeed& transforms, const MapMemory& memory)
      : config_(config), transforms_(transforms), memory_(memory) {}

  /// In which frame the map is kept, for good: the first one that is not empty; octomap_frame, if there is one.
  void setFrame(const std::string& fixed_frame);
  bool hasFrame() const { return !frame_.empty(); }

  /// A serialised cloud (PointCloud2) becomes part of the map, which it returns; never throws: what is wrong is in
  /// LoadedMap::problem; where the next map will show the cloud all the same, in LoadedMap::missed, too. `may_wait` is
  /// asked again and again while there is no transform at the cloud's stamp (without one: at its receipt); it says
  /// whether to go on, and takes its time. hasFrame() must hold. `before`: as decodeMapMessage()'s.
  LoadedMap add(const std::vector<std::uint8_t>& bytes, StampNs receipt_ns, const std::function<bool()>& may_wait,
                const VoxelSurface* before = nullptr);

 private:
  const MonitorConfig& config_;
  const TransformFeed& transforms_;
  const MapMemory& memory_;
  std::string frame_;
  std::optional<CloudMap> map_;

  /// What the sensor saw, and where it was; returns the points that the view names. Throws.
  std::vector<float> place(const std::vector<std::uint8_t>& bytes, StampNs receipt_ns,
                           const std::function<bool()>& may_wait, LoadedMap& map, SensorView& view) const;
};

}  // namespace dccd
