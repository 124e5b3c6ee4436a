#include "node/cloud_mapping.h"

#include <algorithm>
#include <iomanip>
#include <limits>
#include <sstream>

#include "dccd/voxel_surface.h"
#include "input/known_types.h"
#include "input/mesh_views.h"
#include "input/short_text.h"
#include "input/steady_clock.h"
#include "input/transform_tracks.h"
#include "input/wire.h"
#include "node/map_decode.h"

namespace dccd {

namespace {

// A frame_id that is refused, and never came again, stands in nobody's way for longer. Of others there are so many.
constexpr double FORGET_REFUSED_S = 10;
constexpr std::size_t MOST_VIEWS = 64;

constexpr double SLOW_SHARE = 0.5;  // of the time within which a map is to be in use

WireReader readerOf(const std::vector<std::uint8_t>& bytes) { return {bytes.data(), bytes.size()}; }

std::string countOf(std::size_t count) { return std::to_string(count) + (count == 1 ? " point" : " points"); }

/// Of a camera's pixels or points, row by row, the coordinates one after the other.
void pointsInto(const CloudView& cloud, std::vector<float>& xyz) {
  xyz.resize(3 * cloud.size());
  const std::size_t first = cloud.xyz[0].offset;
  bool is_packed = !cloud.big_endian;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    is_packed = is_packed && !cloud.xyz[axis].is_double && cloud.xyz[axis].offset == first + 4 * axis;
  }
  float* out = xyz.data();
  for (std::size_t row = 0; row < cloud.height; ++row) {
    if (is_packed) {
      const std::uint8_t* at = cloud.data + row * (cloud.height > 1 ? cloud.row_step : 0) + first;
      for (std::size_t i = 0; i < cloud.width; ++i, out += 3) std::memcpy(out, at + i * cloud.point_step, 12);
      continue;
    }
    for (std::size_t i = row * cloud.width; i < (row + 1) * cloud.width; ++i) {
      const Vec3 p = cloud.point(i);
      for (int axis = 0; axis < 3; ++axis) *out++ = static_cast<float>(p[axis]);
    }
  }
}

/// The same, from another place. What is no number, or no return, stays so.
void pointsInto(const CloudView& cloud, const Eigen::Isometry3d& sensor_from_cloud, std::vector<float>& xyz) {
  xyz.clear();
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    Vec3 p = cloud.point(i);
    if (p.allFinite()) p = sensor_from_cloud * p;
    for (int axis = 0; axis < 3; ++axis) xyz.push_back(static_cast<float>(p[axis]));
  }
}

/// Where the points were seen from, in the cloud's frame: one place. Throws.
std::optional<Vec3> viewpointOf(const CloudView& cloud) {
  std::optional<Vec3> place;
  for (std::size_t i = 0; cloud.viewpoint && i < cloud.size(); ++i) {
    const Vec3 one = cloud.vector(i, *cloud.viewpoint);
    if (!one.allFinite() || !cloud.point(i).allFinite()) continue;
    if (place && *place != one) {
      throw WireError("its points were seen from different places (vp_x, vp_y, vp_z); send a cloud for each");
    }
    place = one;
  }
  return place;
}

/// By the names of image_pipeline: CameraInfo tells of the picture before it was rectified.
bool isRectified(const std::string& topic) { return topic.compare(topic.rfind('/') + 1, 10, "image_rect") == 0; }

/// [ms] of two digits: lines that say it stay the same as long as it does.
std::string inMilliseconds(double s) {
  std::ostringstream text;
  text << std::setprecision(s < 0.1 ? 1 : 2) << std::max(1.0, s * 1e3);
  return text.str() + " ms";
}

}  // namespace

bool needsCameraInfo(const std::string& datatype) { return isDepthPicture(datatype); }

std::string cameraInfoTopic(const CloudSource& source) {
  if (!source.camera_info.empty()) return source.camera_info;
  return source.topic.substr(0, source.topic.rfind('/') + 1) + "camera_info";
}

std::string frameIdOf(const std::vector<std::uint8_t>& bytes) try {
  WireReader wire = readerOf(bytes);
  return shortText(readHeader(wire).frame_id, MAX_NAME);
} catch (const WireError&) {
  return {};
}

/// What is made of a message, and what is known of that so far.
struct CloudMapping::Reading {
  LoadedMap& map;
  ViewName view;
  const std::function<bool()>& may_wait;
  double waited_s = 0;
  std::map<std::string, std::uint64_t> placed_by{};
  bool is_in = false;  ///< be it in part

  bool mayWait() {
    const std::int64_t since_ns = steadyNs();
    const bool may = may_wait();
    waited_s += secondsBetween(since_ns, steadyNs());
    return may;
  }
};

CloudMapping::CloudMapping(const MonitorConfig& config, const TransformFeed& transforms, const MapMemory& memory)
    : config_(config), transforms_(transforms), memory_(memory), missed_(config.clouds.size()) {
  for (const CloudSource& source : config.clouds) camera_infos_.emplace_back(cameraInfoTopic(source));
}

void CloudMapping::setFrame(const std::string& fixed_frame) {
  if (hasFrame()) return;
  frame_ = config_.octomap_frame.empty() ? fixed_frame : config_.octomap_frame;
}

std::string CloudMapping::setCameraInfo(std::size_t source, const std::string& problem,
                                        const std::vector<std::uint8_t>& bytes) {
  return camera_infos_.at(source).add(problem, bytes);
}

Eigen::Isometry3d CloudMapping::place(const std::string& frame, const CloudMessage& message, Reading& reading) const {
  Eigen::Isometry3d map_from_frame;
  std::string reason;
  const StampNs stamp_ns = reading.map.stamp_ns;
  const auto isPlaced = [&] {
    reading.placed_by[frame] = transforms_.staticSince(frame_, frame);  // before: what comes meanwhile counts as later
    return transforms_.lookup(frame_, frame, stamp_ns, map_from_frame, reason);
  };
  while (!isPlaced()) {
    if (reading.mayWait()) continue;
    throw WireError(transforms_.noTransform(frame, "'" + frame_ + "'", reason) + "; the clouds on " +
                    config_.clouds[message.source].topic + " need it");
  }
  // Unlike a map, a cloud stays for good where it was put.
  std::string doubt = TransformTracks(transforms_, frame_).doubtAt(frame_, frame, stamp_ns);
  if (doubt.empty()) doubt = transforms_.doubtNextTo(frame_, frame, stamp_ns);
  if (!doubt.empty()) throw WireError("where frame '" + frame + "' was at its stamp is not known (" + doubt + ")");
  return map_from_frame;
}

SensorView CloudMapping::readPicture(const CloudMessage& message, Reading& reading) {
  WireReader wire = readerOf(message.bytes);
  const DepthView picture = readDepth(wire);
  if (picture.size() == 0) throw WireError("it has no pixels");
  const CloudSource& source = config_.clouds[message.source];
  const std::string topic = cameraInfoTopic(source);
  std::string why_not;
  std::optional<PinholeView> pinhole;
  while (!(pinhole = camera_infos_[message.source].find(picture.header.stamp_ns, why_not))) {
    if (!reading.mayWait()) throw WireError(why_not);
  }
  const std::string of = "the CameraInfo on " + topic + ": ", &frame = reading.view.second;
  if (!pinhole->problem.empty()) throw WireError(of + pinhole->problem);
  if (frameNameOf({0, pinhole->frame_id}) != frame) {
    throw WireError(of + "its frame_id is '" + pinhole->frame_id + "', and the picture's '" + frame +
                    "': they are of two cameras, or one names the wrong frame");
  }
  // Where a rectified picture looks P tells, in the frame that it names, as to depth_image_proc.
  if (!pinhole->unrectified.empty() && !isRectified(source.topic)) {
    throw WireError(of + pinhole->unrectified +
                    ": pictures with distortion (D not 0, R not the identity, K not P's) are not "
                    "rectified; take the driver's image_rect, or its cloud");
  }
  if (pinhole->width != picture.width || pinhole->height != picture.height) {
    std::ostringstream text;
    text << "it has " << picture.width << " x " << picture.height << " pixels, and the CameraInfo on " << topic
         << " is of " << pinhole->width << " x " << pinhole->height;
    throw WireError(text.str());
  }
  SensorView seen;
  seen.map_from_sensor = place(frame, message, reading);
  picture.depthsInto(numbers_);
  seen.depth_m = numbers_.data();
  seen.width = picture.width;
  seen.height = picture.height;
  seen.pinhole = {pinhole->fx, pinhole->fy, pinhole->cx, pinhole->cy};
  return seen;
}

SensorView CloudMapping::readCloudOf(const CloudMessage& message, Reading& reading) {
  WireReader wire = readerOf(message.bytes);
  const CloudView cloud = readCloud(wire, {});
  if (cloud.size() == 0) throw WireError("it has no points");
  const std::string &frame = reading.view.second, &sensor = config_.clouds[message.source].sensor_frame;
  SensorView seen;
  seen.map_from_sensor = place(frame, message, reading);
  if (!sensor.empty() && sensor != frame) {
    const Eigen::Isometry3d map_from_sensor = place(sensor, message, reading);
    pointsInto(cloud, map_from_sensor.inverse() * seen.map_from_sensor, numbers_);
    seen.map_from_sensor = map_from_sensor;
  } else if (const std::optional<Vec3> from = sensor.empty() ? viewpointOf(cloud) : std::nullopt) {
    pointsInto(cloud, Eigen::Isometry3d(Eigen::Translation3d(-*from)), numbers_);
    seen.map_from_sensor.translate(*from);
  } else if (sensor.empty() && frame == frame_) {
    throw WireError("it comes in the map's own frame '" + frame_ +
                    "', which does not tell where the sensor was, so that it fills and clears nothing; name "
                    "the sensor's frame by sensor_frame in obstacle_cloud_topics, also where that is this one, or send "
                    "the cloud as the sensor made it");
  } else {
    pointsInto(cloud, numbers_);
  }
  seen.xyz = numbers_.data();
  seen.width = cloud.width;
  seen.height = cloud.height;
  return seen;
}

/// Where the sensor was and what it saw, in numbers_. Throws.
SensorView CloudMapping::read(const CloudMessage& message, Reading& reading) {
  WireReader wire = readerOf(message.bytes);
  const HeaderView header = readHeader(wire);
  if (header.stamp_ns != 0) reading.map.stamp_ns = header.stamp_ns;
  const std::string frame = frameNameOf(header);
  if (frame.empty()) throw WireError("frame_id is empty; it is to name the sensor's frame");
  ViewName view{message.source, frame};
  if (views_.count(view) == 0 && views_.size() >= MOST_VIEWS) {
    throw WireError("frame_id '" + frame + "' is one more than " + std::to_string(MOST_VIEWS) + " of all clouds");
  }
  reading.view = std::move(view);
  const auto known = views_.find(reading.view);
  if (known != views_.end() && isLate(reading.map.stamp_ns, known->second.stamp_ns)) {
    const double late_s = secondsBetween(reading.map.stamp_ns, known->second.stamp_ns);
    throw WireError("it is stamped " + std::to_string(late_s) + " s before one from there that is in the map");
  }
  return isDepthPicture(message.datatype) ? readPicture(message, reading) : readCloudOf(message, reading);
}

void CloudMapping::insert(const SensorView& seen, Reading& reading) {
  if (!map_) map_.emplace(config_.cloud_map);
  reading.is_in = true;
  SeenCounts counts;
  try {
    counts = map_->insert(seen, cloudMemory(config_));
  } catch (const OctomapError& error) {
    const std::string problem = error.what();
    if (problem.find("MB that it may take") == std::string::npos) {
      reading.is_in = false;
      throw OctomapError(problem + "; the map is kept in frame '" + frame_ +
                         "': set octomap_frame to one near the sensor, or raise obstacle_resolution_m");
    }
    throw OctomapError(problem + "; a quarter of max_map_mb " + std::to_string(config_.max_map_bytes >> 20) +
                       " is for it: raise that or obstacle_resolution_m, or set obstacle_max_range_m or obstacle_box");
  }
  no_measurement_ += counts.near;
  const std::size_t all = seen.width * seen.height, said = all - counts.near - counts.nothing;
  if (said == 0) {
    reading.is_in = false;
    if (counts.near == 0) throw WireError("none of its " + countOf(all) + " is finite");
    std::ostringstream text;
    text << "none of its " << countOf(all) << " is a measurement: " << counts.near
         << " at the sensor, or nearer to it than obstacle_min_range_m " << config_.cloud_map.min_range_m << ", "
         << counts.nothing << " not finite";
    throw WireError(text.str());
  }
  if (counts.no_return > 0 && !counts.no_return_cleared) {
    const std::string& topic = config_.clouds[reading.view.first].topic;
    reading.map.hint = "the clouds on " + topic + " have infinite points: ";
    reading.map.hint +=
        config_.cloud_map.no_return_clears
            ? "they are no pixels in rows, and nobody knows where these looked, so that what was there stays"
            : "nothing came back from there, and what was seen there before stays; obstacle_no_return: clears takes "
              "it away";
  }
}

std::string CloudMapping::nameOf(const ViewName& name) const {
  return (name.second.empty() ? "" : "'" + name.second + "' ") + "on " + config_.clouds[name.first].topic;
}

/// Throws where there is no map for what another view lacks.
void CloudMapping::checkOthers(const ViewName& name, StampNs receipt_ns) const {
  for (std::size_t source = 0; source < config_.clouds.size(); ++source) {
    const bool has_come =
        std::any_of(views_.begin(), views_.end(), [&](const auto& view) { return view.first.first == source; });
    if (!has_come) throw WireError("no cloud has come on " + config_.clouds[source].topic + " yet");
  }
  for (const auto& [other, view] : views_) {
    if (other == name) continue;
    if (view.problem.rfind("no transform", 0) == 0) throw WireError(view.problem);
    if (!view.problem.empty()) throw WireError("the newest cloud " + nameOf(other) + " was refused: " + view.problem);
    const double silent_s = secondsBetween(view.receipt_ns, receipt_ns);
    if (config_.monitor.octomap_timeout_s <= 0 || silent_s <= config_.monitor.octomap_timeout_s) continue;
    std::string text = "no cloud " + nameOf(other) + " has come for longer than octomap_timeout_s";
    // Of one that was renamed and one of two that died the other's clouds say the same.
    if (other.first == name.first) {
      text += "; if '" + name.second + "' is that camera's new name, restart the monitor, which takes them for two";
    }
    throw WireError(text);
  }
}

void CloudMapping::forgetRefused(StampNs receipt_ns) {
  for (auto view = views_.begin(); view != views_.end();) {
    const bool is_over =
        !view->second.is_known && secondsBetween(view->second.receipt_ns, receipt_ns) > FORGET_REFUSED_S;
    view = is_over ? views_.erase(view) : std::next(view);
  }
}

void CloudMapping::miss(std::size_t source, const std::string& why) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++missed_.at(source).count;
  missed_[source].newest = shortText(why);
}

void CloudMapping::refuse(std::size_t source, StampNs receipt_ns, const std::string& problem) {
  miss(source, problem);
  View& view = views_[{source, {}}];
  view.problem = problem;
  view.receipt_ns = receipt_ns;
}

LoadedMap CloudMapping::add(const CloudMessage& message, const std::function<bool()>& may_wait,
                            const VoxelSurface* before) {
  const std::int64_t start_ns = steadyNs();
  LoadedMap map;
  map.frame_id = frame_;
  map.stamp_ns = map.receipt_ns = message.receipt_ns;
  Reading reading{map, {message.source, {}}, may_wait};
  bool is_seen = false;
  forgetRefused(message.receipt_ns);
  loadMap(config_, &memory_, before, map, [&](const OctomapLimits& limits) {
    SensorView seen = read(message, reading);
    const auto known = views_.find(reading.view);
    seen.clears = !(message.is_behind && known != views_.end() && known->second.fills_next);
    insert(seen, reading);
    views_.erase({message.source, {}});
    views_[reading.view] = {{}, true, message.receipt_ns, map.stamp_ns, seen.clears, map_->doubtfulNow()};
    if (!seen.clears) ++only_filled_;
    is_seen = true;
    checkOthers(reading.view, message.receipt_ns);
    const std::vector<OccupiedLeaf>& doubtful = map_->doubtful();
    if (!doubtful.empty()) {
      map.own.doubted_surface = memory_.counted(VoxelSurface::build(config_.cloud_map.resolution_m, doubtful));
      std::vector<OccupiedLeaf> now;
      for (const auto& [name, view] : views_) now.insert(now.end(), view.doubtful.begin(), view.doubtful.end());
      map.own.seen = share(std::move(now));
    }
    return map_->leaves(limits);
  });
  if (!is_seen) {
    miss(message.source, map.problem);
    View& view = views_[reading.view];
    view.problem = map.problem;
    view.receipt_ns = message.receipt_ns;
  }
  if (!map.surface) map.own = OwnVoxels();
  if (reading.is_in) {
    map.number = ++looks_;
    first_ns_ = first_ns_ == 0 ? map.stamp_ns : std::min(first_ns_, map.stamp_ns);
    placed_by_.insert(reading.placed_by.begin(), reading.placed_by.end());  // of the first cloud
  }
  map.placed_by = placed_by_;
  map.first_ns = first_ns_;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    map.missed = missed_;
  }
  const double spent_s = secondsBetween(start_ns, steadyNs()) - reading.waited_s;
  const double limit_s = config_.monitor.octomap_timeout_s > 0
                             ? std::min(config_.monitor.octomap_timeout_s, config_.answer_timeout_s)
                             : config_.answer_timeout_s;
  if (spent_s > SLOW_SHARE * limit_s) {
    map.slow = "a cloud on " + config_.clouds[message.source].topic + " takes " + inMilliseconds(spent_s) +
               " to become part of the map; raise obstacle_resolution_m, set obstacle_max_range_m or obstacle_box, or "
               "send fewer points";
  }
  return map;
}

}  // namespace dccd
