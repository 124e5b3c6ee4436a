// Sensors' clouds and depth pictures, each made a part of one map where tf says that the sensor was.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/cloud_map.h"
#include "input/transforms.h"
#include "node/camera_infos.h"
#include "node/map_memory.h"
#include "node/monitor_pipeline.h"

namespace dccd {

/// A serialised cloud (PointCloud2), or a depth picture (Image).
struct CloudMessage {
  std::size_t source = 0;  ///< of MonitorConfig::clouds
  std::string datatype;
  std::vector<std::uint8_t> bytes;
  StampNs receipt_ns = 0;
  bool is_behind = false;  ///< older ones of the same view were left out, for want of time
};

/// Whether CameraInfo messages are needed for the message.
bool needsCameraInfo(const std::string& datatype);
std::string cameraInfoTopic(const CloudSource& source);
/// The frame_id of a cloud or a depth picture, as it came; empty: it has none that can be read.
std::string frameIdOf(const std::vector<std::uint8_t>& bytes);

/// What became of points and pictures since the start.
struct CloudCounters {
  std::uint64_t only_filled = 0;     ///< pictures that cleared nothing, for want of time
  std::uint64_t no_measurement = 0;  ///< points at the sensor, or nearer to it than obstacle_min_range_m
};

/// For one thread at a time, but for what says otherwise.
class CloudMapping {
 public:
  CloudMapping(const MonitorConfig& config, const TransformFeed& transforms, const MapMemory& memory);

  /// In which frame the map is kept, for good: the first one that is not empty; octomap_frame, if there is one.
  void setFrame(const std::string& fixed_frame);
  bool hasFrame() const { return !frame_.empty(); }
  /// CameraInfos::add(): for what it returns the view is to be refused. From any thread.
  std::string setCameraInfo(std::size_t source, const std::string& problem, const std::vector<std::uint8_t>& bytes);

  /// The message becomes part of the map, which is returned; never throws: what is wrong is in LoadedMap::problem;
  /// a map has the next number where the cloud is in what the next map will show. There is no map while the newest
  /// cloud of any view was refused, or of a source none has come. `may_wait` is asked again and again while there is
  /// no transform at the cloud's stamp (without one: at its receipt), or no CameraInfo; it says whether to go on, and
  /// takes its time. hasFrame() must hold. `before`: as decodeMapMessage()'s.
  LoadedMap add(const CloudMessage& message, const std::function<bool()>& may_wait,
                const VoxelSurface* before = nullptr);
  /// A message that was refused undecoded counts as the newest one of its source.
  void refuse(std::size_t source, StampNs receipt_ns, const std::string& problem);
  /// One of the source came, and becomes no part of the map. From any thread.
  void miss(std::size_t source, const std::string& why);

  /// From any thread.
  CloudCounters counters() const { return {only_filled_, no_measurement_}; }

 private:
  /// One sensor, as far as anybody can tell: the topic's number and the frame_id.
  using ViewName = std::pair<std::size_t, std::string>;
  struct View {
    std::string problem;                                     // why its newest cloud is not in the map; empty: it is
    bool is_known = false;                                   // one of them was
    StampNs receipt_ns = 0;                                  // of the newest one
    StampNs stamp_ns = std::numeric_limits<StampNs>::min();  // of the last one that is in the map
    bool fills_next = false;               // the last one cleared, and the next is to do without if time is short
    std::vector<OccupiedLeaf> doubtful{};  // what that one saw and the map had in doubt then
  };
  const MonitorConfig& config_;
  const TransformFeed& transforms_;
  const MapMemory& memory_;
  std::string frame_;
  std::optional<CloudMap> map_;
  std::map<ViewName, View> views_;
  StampNs first_ns_ = 0;                            // LoadedMap::first_ns
  std::uint64_t looks_ = 0;                         // clouds that are in the map, be it in part
  std::map<std::string, std::uint64_t> placed_by_;  // LoadedMap::placed_by
  std::vector<float> numbers_;                      // of the view that is inserted
  std::deque<CameraInfos> camera_infos_;            // by source
  std::mutex mutex_;                                // of the next one
  std::vector<MissedClouds> missed_;
  std::atomic<std::uint64_t> only_filled_{0}, no_measurement_{0};

  struct Reading;
  SensorView read(const CloudMessage& message, Reading& reading);
  SensorView readPicture(const CloudMessage& message, Reading& reading);
  SensorView readCloudOf(const CloudMessage& message, Reading& reading);
  Eigen::Isometry3d place(const std::string& frame, const CloudMessage& message, Reading& reading) const;
  void insert(const SensorView& seen, Reading& reading);
  void checkOthers(const ViewName& name, StampNs receipt_ns) const;
  void forgetRefused(StampNs receipt_ns);
  std::string nameOf(const ViewName& name) const;
};

}  // namespace dccd
