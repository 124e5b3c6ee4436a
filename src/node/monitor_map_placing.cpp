// Where maps are: each waits for the transform of its frame, in turn.
#include <algorithm>
#include <iomanip>
#include <optional>
#include <sstream>
#include <utility>

#include "input/transforms.h"
#include "node/monitor_pipeline.h"

namespace dccd {

namespace {

// As long as tf lags behind maps: a second and a half of a camera's. They take a share of max_map_mb at the most, so
// that there is room for what follows.
constexpr std::size_t MOST_UNPLACED = 16, SHARE_OF_UNPLACED = 8;

constexpr double CLOUDS_REACH_M = 10;  // voxels that far from their frame's origin are displaced by a turn of it

ObstacleMap noMap(std::string why) {
  ObstacleMap none;
  none.problem = std::move(why);
  return none;
}

}  // namespace

/// The map in the fixed frame, by the transform at its stamp.
bool MonitorPipeline::findPlace(const LoadedMap& loaded, ObstacleMap& map, std::string& reason) {
  const std::string frame = loaded.frame_id.empty() ? fixed_frame_ : loaded.frame_id;
  map = loaded;
  map.frame_id = frame;
  if (transforms_.lookup(frame, fixed_frame_, map.stamp_ns, map.map_from_fixed, reason)) return true;
  // A latched map is older than all of tf that a monitor hears that starts later.
  const std::optional<StampNs> first_ns = transforms_.firstStamp(frame, fixed_frame_);
  std::string unused;
  if (!first_ns || *first_ns <= map.stamp_ns ||
      !transforms_.lookup(frame, fixed_frame_, *first_ns, map.map_from_fixed, unused)) {
    return false;
  }
  std::ostringstream text;
  text << "the octomap is older than all transforms of its frame '" << frame << "': it is placed by the first, "
       << secondsBetween(map.stamp_ns, *first_ns) << " s after its stamp";
  map_hint_ = text.str();
  return true;
}

/// Whether what octomap_file holds beside live maps has its place, without which none of these is used.
bool MonitorPipeline::placeTrusted(std::int64_t now_ns) {
  if (!trusted_map_ || trusted_placed_) return true;
  ObstacleMap map;
  std::string reason;
  trusted_placed_ = findPlace(*trusted_map_, map, reason);
  if (trusted_placed_) {
    monitor_->setMapBeside(std::move(map));
  } else if (finishing_ || secondsBetween(unplaced_maps_.front().since_ns, now_ns) >= config_.transform_timeout_s) {
    monitor_->setMap(
        noMap(transforms_.noTransform(fixed_frame_, "the frame of octomap_file '" + map.frame_id + "'", reason)));
  }
  return trusted_placed_;
}

bool MonitorPipeline::settleMap(const LoadedMap& loaded, bool may_place, ObstacleMap& map, std::string& reason) {
  const LoadedMap& refused = trusted_map_ && !trusted_map_->surface ? *trusted_map_ : loaded;
  if (refused.surface) return may_place && findPlace(loaded, map, reason);
  // What was there before is out of date, and no map is better than a wrong one.
  map = noMap(refused.problem);
  return true;
}

/// Why what it shows may not be there, in words; empty: nothing says so.
std::string MonitorPipeline::doubtOf(const LoadedMap& loaded, const std::string& frame) const {
  if (loaded.is_late) {
    return "the octomap in use is stamped before one that came before it";
  }
  const std::string doubt = tracks_.doubtAt(frame, fixed_frame_, loaded.stamp_ns);
  return doubt.empty() ? "" : "where the octomap's frame was at its stamp is not known (" + doubt + ")";
}

StampNs MonitorPipeline::lookFrom(const FramesAtRest& frames, const std::string& frame, StampNs from_ns) const {
  return first_cloud_ns_ == 0 || frames.hasLookedAt(frame) ? from_ns : std::min(from_ns, first_cloud_ns_);
}

/// What earlier clouds showed moves along with it. One that was learnt is looked at with what else is held in it.
void MonitorPipeline::lookAtCloudsFrame(const std::string& frame, StampNs from_ns, StampNs to_ns) {
  if (!config_.takesClouds() || config_.octomap_frame.empty() || frame == fixed_frame_) return;
  const std::string reference = config_.fixed_frame.empty() ? transforms_.rootOf(frame) : fixed_frame_;
  clouds_frame_ =
      clouds_frames_.look(tracks_, frame, reference, lookFrom(clouds_frames_, frame, from_ns), to_ns, CLOUDS_REACH_M);
}

std::string MonitorPipeline::mapPlaceProblem(const Step& step) {
  const ObstacleMap& map = step.map;
  if (!map.surface) return {};
  lookAtCloudsFrame(map.frame_id, step.start_ns, step.stamp_ns);
  if (clouds_frame_.moved_m > config_.monitor.detector.rigid_tolerance_m) {
    std::ostringstream text;
    text << "octomap_frame '" << map.frame_id << "' moved by up to " << std::setprecision(2) << clouds_frame_.moved_m
         << " m in '" << clouds_frame_.reference
         << "' since the first cloud; set it to a frame at rest, and restart the monitor";
    return text.str();
  }
  if (!clouds_frame_.unknown.empty()) {
    return "where octomap_frame '" + map.frame_id + "' was since the first cloud is not known (" +
           clouds_frame_.unknown + ")";
  }
  if (map.arrival_ns <= doubted_map_ns_) return map_doubt_;
  for (const auto& [frame, since] : clouds_placed_by_) {
    if (transforms_.staticSince(map.frame_id, frame) <= since) continue;
    return "the frame '" + frame + "' was sent elsewhere on /tf_static after clouds were placed by it, which stay in " +
           "the map; restart the monitor";
  }
  return {};
}

/// As far as the newest that has its place, or was refused. Where bodies have own voxels each is looked at in turn,
/// else the newest alone counts.
void MonitorPipeline::placeMaps(std::int64_t now_ns) {
  if (unplaced_maps_.empty()) return;
  const bool may_place = !fixed_frame_.empty() && placeTrusted(now_ns);
  ObstacleMap newest, map;
  std::string reason, unused;
  std::size_t settled = unplaced_maps_.size();
  while (settled > 0 && !settleMap(unplaced_maps_[settled - 1].map, may_place, newest, reason)) --settled;
  for (; settled > 0; --settled) {
    LoadedMap loaded = std::move(unplaced_maps_.front().map);
    unplaced_maps_.pop_front();
    const bool is_newest = settled == 1;
    if (!is_newest && !config_.ownsVoxels()) continue;
    if (is_newest) {
      map = std::move(newest);
    } else if (!settleMap(loaded, may_place, map, unused)) {
      monitor_->sayOfMaps("one got no transform to its frame before the next one did");
      continue;
    }
    const std::string frame = map.frame_id;
    const bool is_placed = map.surface != nullptr;
    if (const std::string doubt = is_placed ? doubtOf(loaded, frame) : ""; !doubt.empty()) {
      doubted_map_ns_ = loaded.arrival_ns;
      map_doubt_ = doubt;
    }
    monitor_->setMap(std::move(map));
    settled_map_ns_ = loaded.arrival_ns;
    placed_map_.reset();
    if (!is_placed) continue;
    map_placed_ns_ = now_ns;
    lookAtCloudsFrame(frame, loaded.stamp_ns, loaded.stamp_ns);
    if (config_.fixed_frame.empty()) placed_map_ = std::move(loaded);
  }
  if (unplaced_maps_.empty() || !may_place || !monitor_->map().problem.empty()) return;
  // Each is tried again at every call: its transform may come late. Where those before it went on finding their places
  // while it waited, tf lags, and the map in use is the newest that there can be.
  const UnplacedMap& oldest = unplaced_maps_.front();
  const bool overdue = finishing_ || secondsBetween(oldest.since_ns, now_ns) >= config_.transform_timeout_s;
  if (!overdue || map_placed_ns_ > oldest.since_ns) return;
  monitor_->setMap(
      noMap(transforms_.noTransform(fixed_frame_, "the octomap's frame '" + oldest.map.frame_id + "'", reason)));
}

/// Of too many the oldest, which gets its place first, and the newest are kept; of two large ones the newest.
void MonitorPipeline::limitUnplacedMaps() {
  const auto isTooMuch = [&] {
    std::size_t bytes = 0;
    for (const UnplacedMap& one : unplaced_maps_) {
      if (one.map.surface) bytes += one.map.surface->memoryBytes();
      if (one.map.known) bytes += one.map.known->memoryBytes();
    }
    return unplaced_maps_.size() > MOST_UNPLACED || bytes > config_.max_map_bytes / SHARE_OF_UNPLACED;
  };
  while (unplaced_maps_.size() > 1 && isTooMuch()) {
    const auto left_out = unplaced_maps_.begin() + (unplaced_maps_.size() > 2 ? 1 : 0);
    unplaced_maps_.erase(left_out);
    monitor_->sayOfMaps("too many waited for the transforms of their frame");
  }
}

bool MonitorPipeline::mapMayCome(std::int64_t arrival_ns, std::int64_t now_ns) const {
  return !finishing_ && std::any_of(unplaced_maps_.begin(), unplaced_maps_.end(), [&](const UnplacedMap& one) {
    return one.map.arrival_ns <= arrival_ns && secondsBetween(one.since_ns, now_ns) < config_.transform_timeout_s;
  });
}

}  // namespace dccd
