// Octomaps are decoded, or made of clouds, and their surface is built on a thread of its own; the worker swaps the
// finished one in between steps. Of several that wait, only the newest is decoded.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "node/cloud_mapping.h"
#include "node/map_memory.h"
#include "node/monitor_pipeline.h"
#include "octomap/map_odds.h"

namespace dccd {

/// Why a message is no map, or no cloud where the map is made of these, as far as its type and its size [bytes] tell;
/// empty: it can be decoded.
std::string mapMessageProblem(const std::string& datatype, const std::string& md5, std::size_t size,
                              const MonitorConfig& config);
/// Why there is no map, of one whose problem this is.
std::string whyRefused(const std::string& problem, const MonitorConfig& config);
/// A serialised octomap_msgs/Octomap to a map; never throws: what is wrong is in LoadedMap::problem.
/// `memory`: what it must fit in; null: no limit but that of the message. `before`: of an older map, or null; the same
/// map is then made faster. `odds`: of the maps before, or null: nobody is told what they found.
LoadedMap decodeMapMessage(const std::vector<std::uint8_t>& bytes, const MonitorConfig& config,
                           const MapMemory* memory = nullptr, const VoxelSurface* before = nullptr,
                           MapOdds* odds = nullptr);
/// A .bt or .ot file. Never throws.
LoadedMap loadMapFile(const std::string& file, const MonitorConfig& config, const MapMemory* memory = nullptr);

class MapLoader {
 public:
  /// `ready` is called from the loader's thread when a map can be taken.
  MapLoader(const MonitorConfig& config, const TransformFeed& transforms, std::function<void()> ready);
  ~MapLoader();
  MapLoader(const MapLoader&) = delete;
  MapLoader& operator=(const MapLoader&) = delete;

  /// A serialised octomap_msgs/Octomap, or a cloud where clouds make the map, that came at `arrival_ns` of the steady
  /// clock; replaces one of the same view that still waits. From any thread.
  void submit(CloudMessage message, std::int64_t arrival_ns);
  void submitFile(const std::string& file, std::int64_t arrival_ns);
  /// One of the source came, or may have, of which there is nothing. From any thread.
  void lose(std::size_t source = 0);
  /// A message of a source that is refused undecoded takes its turn all the same: it is newer than the map in use,
  /// which is void with it. From any thread.
  void refuse(std::size_t source, const std::string& problem, StampNs receipt_ns, std::int64_t arrival_ns);
  /// As CloudMapping::setCameraInfo(). From any thread.
  std::string setCameraInfo(std::size_t source, const std::string& problem, const std::vector<std::uint8_t>& bytes) {
    return clouds_.setCameraInfo(source, problem, bytes);
  }
  /// A cloud waits until the fixed frame is known. From any thread.
  void setFixedFrame(const std::string& frame);
  /// The oldest finished map, once.
  bool take(LoadedMap& map);

  /// When the first of the maps came that are on their way, that wait to be decoded, are being decoded or can be taken;
  /// none is: no value.
  std::optional<std::int64_t> busySince();

  std::uint64_t received() const { return received_; }
  std::uint64_t refused() const { return refused_; }
  /// That gave way to a newer one before they were decoded.
  std::uint64_t dropped() const { return dropped_; }
  CloudCounters cloudCounters() const { return clouds_.counters(); }

 private:
  struct Job {
    CloudMessage message;
    std::string file;
    std::int64_t arrival_ns = 0;
    std::string problem;          // not empty: refused
    std::uint64_t number = 0;     // ObstacleMap::number; a cloud's map gets its own
    std::string view{};           // which frame_id of its source; one job of each waits
    std::int64_t since_ns = 0;    // arrival of the first of the view that nothing has come of
    std::int64_t settles_ns = 0;  // what came up to then is in the map with this one, or gave way
  };
  const MonitorConfig& config_;  // what it reads there does not change while the node runs
  const MapMemory memory_{config_};
  CloudMapping clouds_;
  std::shared_ptr<const VoxelSurface> last_;  // of the newest map, if that was not refused; the thread's
  MapOdds odds_;                              // the same
  std::function<void()> ready_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool frame_known_ = false;  // and set in clouds_, which is the thread's from then on
  std::uint64_t number_ = 0;  // of the last one that came
  std::vector<Job> jobs_;     // that wait, one a view, by since_ns
  std::deque<LoadedMap> done_;
  bool stopping_ = false, decoding_ = false;
  std::int64_t busy_since_ns_ = 0;
  std::atomic<std::uint64_t> received_{0}, refused_{0}, dropped_{0};
  std::thread thread_;

  /// Nothing keeps a job that there is from being begun. The mutex is held.
  bool isReady() const {
    return !jobs_.empty() && (frame_known_ || !config_.takesClouds() || !jobs_.front().problem.empty());
  }
  bool isBusy() const { return isReady() || decoding_ || !done_.empty(); }
  LoadedMap load(const Job& job);
  bool mayWait(const Job& job);
  void put(Job job);
  Job takeJob();
  void keep(LoadedMap map);
  void loop();
};

}  // namespace dccd
