// What max_map_mb bounds: messages that wait or are decoded, trees as they are built, maps that anybody still holds.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "base/octomap_decode.h"
#include "config/monitor_config.h"
#include "dccd/known_space.h"

namespace dccd {

/// The octree of a sensor's clouds, if they make the map, has a quarter. An eighth each for the message that waits, the
/// one that is decoded, and older maps that recordings hold; the rest is for maps: two of them, the one in use and its
/// successor, and what it takes to build one more. A map of which that is too much is refused whatever else there is,
/// so that of two equal maps the second is not refused. Safe to use from any thread.
class MapMemory {
 public:
  explicit MapMemory(const MonitorConfig& config) : config_(config) {}

  /// Throws OctomapError with need and limit where there is no room. Else how many cubes of unknown space may be added.
  std::size_t accept(const OctomapCounts& counts) const;
  /// The same map, counted until nobody holds it any more.
  template <class Map>
  std::shared_ptr<const Map> counted(std::shared_ptr<const Map> map) const;

 private:
  using Bytes = std::atomic<std::size_t>;
  const MonitorConfig& config_;
  std::shared_ptr<Bytes> held_ = std::make_shared<Bytes>(0);
};

/// Bytes of a message that may wait, or of a file that may be read.
inline std::size_t largestMapMessage(const MonitorConfig& config) { return config.max_map_bytes / 8; }
/// Bytes of the octree of a sensor's clouds, with what it takes to make one more a part of it.
inline std::size_t cloudMemory(const MonitorConfig& config) { return config.max_map_bytes / 4; }
/// Bytes of older maps that recordings may hold on to.
inline std::size_t recordedMaps(const MonitorConfig& config) { return config.max_map_bytes / 8; }

template <class Map>
std::shared_ptr<const Map> MapMemory::counted(std::shared_ptr<const Map> map) const {
  const std::size_t bytes = map->memoryBytes();
  *held_ += bytes;
  const Map* place = map.get();
  return std::shared_ptr<const Map>(place, [held = held_, map = std::move(map), bytes](const Map*) mutable {
    map.reset();
    *held -= bytes;
  });
}

}  // namespace dccd
