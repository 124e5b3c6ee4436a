#include "node/map_loader.h"

#include <utility>

namespace dccd {

MapLoader::MapLoader(const MonitorConfig& config, std::function<void()> ready)
    : config_(config), ready_(std::move(ready)), thread_([this] { loop(); }) {}

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
    if (!job_ && !decoding_ && !done_) busy_since_ns_ = job.arrival_ns;
    job_ = std::move(job);
  }
  changed_.notify_one();
}

void MapLoader::submit(std::vector<std::uint8_t> bytes, StampNs receipt_ns, std::int64_t arrival_ns) {
  put({std::move(bytes), {}, receipt_ns, arrival_ns, {}});
}

void MapLoader::submitFile(const std::string& file, std::int64_t arrival_ns) { put({{}, file, 0, arrival_ns, {}}); }

void MapLoader::refuse(const std::string& problem, std::int64_t arrival_ns) { put({{}, {}, 0, arrival_ns, problem}); }

LoadedMap MapLoader::load(const Job& job) const {
  if (!job.file.empty()) return loadMapFile(job.file, config_, &memory_);
  if (job.problem.empty()) return decodeMapMessage(job.bytes, config_, &memory_);
  LoadedMap refused;
  refused.problem = job.problem;
  return refused;
}

bool MapLoader::take(LoadedMap& map) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!done_) return false;
  map = std::move(*done_);
  done_.reset();
  return true;
}

std::optional<std::int64_t> MapLoader::busySince() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!job_ && !decoding_ && !done_) return std::nullopt;
  return busy_since_ns_;
}

void MapLoader::loop() {
  while (true) {
    Job job;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      changed_.wait(lock, [this] { return stopping_ || job_; });
      if (stopping_) return;
      job = std::move(*job_);
      job_.reset();
      decoding_ = true;
    }
    LoadedMap map = load(job);
    map.arrival_ns = job.arrival_ns;
    if (map.stamp_ns == 0) map.stamp_ns = job.receipt_ns;
    if (!map.surface) ++refused_;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      done_ = std::move(map);
      decoding_ = false;
    }
    ready_();
  }
}

}  // namespace dccd
