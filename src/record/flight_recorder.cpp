#include "record/flight_recorder.h"

#include <atomic>
#include <filesystem>
#include <stdexcept>
#include <utility>

namespace dccd {
namespace {

std::atomic<int> files_under_way{0};

struct FileUnderWay {
  FileUnderWay() { ++files_under_way; }
  ~FileUnderWay() { --files_under_way; }
  FileUnderWay(const FileUnderWay&) = delete;
  FileUnderWay& operator=(const FileUnderWay&) = delete;
};

}  // namespace

int FlightRecorder::filesUnderWay() { return files_under_way; }

std::string surpriseIn(const Outcome& outcome, const Options& options) {
  if (outcome.status == StepStatus::INTERNAL_ERROR) return "the step failed: " + outcome.reason;
  if (!outcome.answered) return {};
  const bool exact = options.accuracy.rung == Accuracy::EXACT;
  if (exact && outcome.complete && outcome.stats.undecided > 0) {
    return "exact arithmetic left " + std::to_string(outcome.stats.undecided) + " pairs undecided";
  }
  for (const Contact& c : outcome.contacts) {
    // Written so that a NaN fails.
    if (c.toc_lower >= 0 && c.toc_lower <= c.toc_upper && c.toc_upper <= 1) continue;
    return "a contact's time is outside of the step: [" + std::to_string(c.toc_lower) + ", " +
           std::to_string(c.toc_upper) + "]";
  }
  return {};
}

FlightRecorder::FlightRecorder(std::size_t steps, std::string folder, std::string owner, std::size_t max_map_bytes)
    : ring_(steps), max_map_bytes_(max_map_bytes), folder_(std::move(folder)), owner_(std::move(owner)) {
  if (steps == 0) throw std::invalid_argument("a flight recorder keeps at least 1 step");
}

void FlightRecorder::onStep(const Step& step, const Options& options) {
  next_ = (next_ + 1) % ring_.size();
  count_ = std::min(count_ + 1, ring_.size());
  newest().step = step;
  newest().options = options;
  newest().has_answer = false;
  newest().answer = Outcome();
  forgetOldMaps();
}

void FlightRecorder::forgetOldMaps() {
  std::size_t bytes = 0;
  const VoxelSurface* last = newest().step.map.surface.get();
  for (std::size_t age = 1; age < count_; ++age) {
    const VoxelSurface* map = kept(age).step.map.surface.get();
    if (map && map != last) bytes += map->memoryBytes();
    if (map) last = map;
    if (bytes <= max_map_bytes_) continue;
    for (std::size_t older = age; older < count_; ++older) kept(older) = StepRecording();
    count_ = age;
  }
}

void FlightRecorder::onOutcome(const Outcome& outcome) {
  if (count_ == 0) return;
  newest().answer = outcome;
  newest().has_answer = true;
  const std::string surprise = surpriseIn(outcome, newest().options);
  if (surprise.empty()) return;
  surprise_ = "step " + std::to_string(outcome.sequence) + ": " + surprise;
  if (surprises_ >= MAX_SURPRISES) {
    surprise_ += "; not recorded, " + std::to_string(MAX_SURPRISES) + " were already";
    return;
  }
  ++surprises_;
  try {
    surprise_ += "; recorded in " + write(newest(), "surprise", surprise);
  } catch (const std::runtime_error& error) {
    surprise_ += std::string("; not recorded: ") + error.what();
  }
}

std::string FlightRecorder::write(StepRecording& recording, const std::string& kind, const std::string& note) {
  const FileUnderWay under_way;
  std::error_code ignored;  // the file that cannot be opened says why
  std::filesystem::create_directories(folder_, ignored);
  recording.note = note;
  return writeNewRecording(folder_ + "/" + kind + "_" + (owner_.empty() ? "" : owner_ + "_") +
                               std::to_string(recording.step.sequence) + "_" + std::to_string(recording.step.stamp_ns),
                           recording);
}

std::vector<std::string> FlightRecorder::writeAll(const std::string& note) {
  std::vector<std::string> files;
  for (std::size_t i = 0; i < count_; ++i) {
    StepRecording& recording = kept(i);
    try {
      files.push_back(write(recording, "step", note));
    } catch (const std::runtime_error& error) {
      std::string text = error.what();
      if (!files.empty()) text += "; written before it, newest first:";
      for (const std::string& file : files) text += "\n" + file;
      throw std::runtime_error(text);
    }
  }
  return files;
}

std::string FlightRecorder::takeSurprise() { return std::exchange(surprise_, {}); }

}  // namespace dccd
