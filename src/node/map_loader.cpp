#include "node/map_loader.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "dccd/types.h"
#include "input/steady_clock.h"

namespace dccd {

namespace {

constexpr std::chrono::milliseconds POLL{2};  // of tf, where a cloud waits for it

// Where bodies have own voxels each map is to be looked at: that many may be finished while the worker is in a step,
// and take a share of max_map_mb each at the most. Else the newest alone counts.
constexpr std::size_t MOST_FINISHED = 4, SHARE_OF_FINISHED = 32;

const char* const GAVE_WAY = "too many came, and it gave way to a newer one";

constexpr std::size_t MOST_WAITING = 64;  // views: a publisher may make up a frame_id for each cloud

}  // namespace

MapLoader::MapLoader(const MonitorConfig& config, const TransformFeed& transforms, std::function<void()> ready)
    : config_(config), clouds_(config, transforms, memory_), ready_(std::move(ready)), thread_([this] { loop(); }) {
  setFixedFrame(config.octomap_frame.empty() ? config.fixed_frame : config.octomap_frame);
}

MapLoader::~MapLoader() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void MapLoader::put(Job job) {
  ++received_;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    job.number = ++number_;
    if (!isBusy()) busy_since_ns_ = job.arrival_ns;
    std::size_t bytes = job.message.bytes.size();
    const auto isItsPlace = [&](const Job& one) {
      return one.message.source == job.message.source && one.view == job.view;
    };
    auto waiting = std::find_if(jobs_.begin(), jobs_.end(), isItsPlace);
    if (waiting == jobs_.end() && jobs_.size() >= MOST_WAITING) {  // what is one more of its source shares a place
      job.view.clear();
      waiting = std::find_if(jobs_.begin(), jobs_.end(), isItsPlace);
    }
    for (auto one = jobs_.begin(); one != jobs_.end(); ++one) bytes += one == waiting ? 0 : one->message.bytes.size();
    if (job.problem.empty() && bytes > largestMapMessage(config_)) {
      job.message.bytes = {};
      job.problem = "there is no room for it beside others that wait, in the eighth of max_map_mb " +
                    std::to_string(config_.max_map_bytes >> 20) + " for these";
    }
    job.since_ns = job.arrival_ns;
    if (waiting == jobs_.end()) {
      jobs_.push_back(std::move(job));
    } else {
      ++dropped_;
      if (config_.takesClouds() && frame_known_) {  // before, no map has begun
        clouds_.miss(waiting->message.source, waiting->problem.empty() ? GAVE_WAY : waiting->problem);
      }
      job.since_ns = waiting->since_ns;
      job.message.is_behind = true;
      *waiting = std::move(job);
    }
  }
  changed_.notify_one();
}

void MapLoader::lose(std::size_t source) {
  if (config_.takesClouds()) clouds_.miss(source, "it may have come, and was lost before it was taken");
  const std::lock_guard<std::mutex> lock(mutex_);
  ++number_;
}

void MapLoader::submit(CloudMessage message, std::int64_t arrival_ns) {
  Job job;
  if (config_.takesClouds()) job.view = frameIdOf(message.bytes);
  job.message = std::move(message);
  job.arrival_ns = arrival_ns;
  put(std::move(job));
}

void MapLoader::submitFile(const std::string& file, std::int64_t arrival_ns) {
  Job job;
  job.file = file;
  job.arrival_ns = arrival_ns;
  put(std::move(job));
}

void MapLoader::refuse(std::size_t source, const std::string& problem, StampNs receipt_ns, std::int64_t arrival_ns) {
  Job job;
  job.message.source = source;
  job.message.receipt_ns = receipt_ns;
  job.arrival_ns = arrival_ns;
  job.problem = problem;
  put(std::move(job));
}

void MapLoader::setFixedFrame(const std::string& frame) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (frame_known_ || frame.empty()) return;
    clouds_.setFrame(frame);
    frame_known_ = true;
  }
  changed_.notify_one();
}

bool MapLoader::mayWait(const Job& job) {
  if (secondsBetween(job.arrival_ns, steadyNs()) >= config_.transform_timeout_s) return false;
  std::unique_lock<std::mutex> lock(mutex_);
  return !changed_.wait_for(lock, POLL, [this] { return stopping_; });
}

LoadedMap MapLoader::load(const Job& job) {
  if (!job.file.empty()) return loadMapFile(job.file, config_, &memory_);
  if (job.problem.empty() && config_.takesClouds()) {
    return clouds_.add(
        job.message, [&] { return mayWait(job); }, last_.get());
  }
  if (job.problem.empty()) return decodeMapMessage(job.message.bytes, config_, &memory_, last_.get(), &odds_);
  if (config_.takesClouds()) clouds_.refuse(job.message.source, job.message.receipt_ns, job.problem);
  LoadedMap refused;
  refused.problem = job.problem;
  return refused;
}

bool MapLoader::take(LoadedMap& map) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (done_.empty()) return false;
  map = std::move(done_.front());
  done_.pop_front();
  return true;
}

std::optional<std::int64_t> MapLoader::busySince() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!isBusy()) return std::nullopt;
  return busy_since_ns_;
}

/// The mutex is held.
void MapLoader::keep(LoadedMap map) {
  const bool is_small = !map.surface || map.surface->memoryBytes() <= config_.max_map_bytes / SHARE_OF_FINISHED;
  const std::size_t most = config_.ownsVoxels() && is_small ? MOST_FINISHED : 1;
  while (done_.size() >= most) done_.pop_back();
  done_.push_back(std::move(map));
}

/// The one that has waited longest, so that each view has its turn. The mutex is held.
MapLoader::Job MapLoader::takeJob() {
  Job job = std::move(jobs_.front());
  jobs_.erase(jobs_.begin());
  job.settles_ns = jobs_.empty() ? job.arrival_ns : std::min(job.arrival_ns, jobs_.front().since_ns - 1);
  return job;
}

void MapLoader::loop() {
  while (true) {
    Job job;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      changed_.wait(lock, [this] { return stopping_ || isReady(); });
      if (stopping_) return;
      job = takeJob();
      decoding_ = true;
    }
    LoadedMap map = load(job);
    map.arrival_ns = job.settles_ns;
    map.receipt_ns = job.message.receipt_ns;
    if (map.stamp_ns == 0) map.stamp_ns = map.receipt_ns;
    if (!config_.takesClouds()) map.number = job.number;
    if (!map.surface) ++refused_;
    if (map.surface || !config_.takesClouds()) last_ = map.surface;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      keep(std::move(map));
      decoding_ = false;
    }
    ready_();
  }
}

}  // namespace dccd
