#include "io/flight_recorder.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <utility>

namespace deformable_ccd {

namespace {

constexpr std::size_t PATH_SIZE = 4096;
constexpr std::array<int, 5> CRASHES{SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};

// What the handler may touch: lock-free, and never freed while it is set.
std::atomic<const RecordingImage*> crash_image{nullptr};
static_assert(std::atomic<const RecordingImage*>::is_always_lock_free);
char crash_path[PATH_SIZE];
struct sigaction before_crash[CRASHES.size()];
// Overflow of the installing thread's stack leaves no room for the handler on it.
alignas(16) char crash_stack[64 * 1024];

void say(const char* text) noexcept {
  const ssize_t ignored = ::write(STDERR_FILENO, text, std::strlen(text));
  static_cast<void>(ignored);
}

void onCrash(int signal) {
  // Taken away, so that a second crash in here, or in another thread, writes nothing.
  const RecordingImage* image = crash_image.exchange(nullptr);
  if (image) {
    const int descriptor = ::open(crash_path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (descriptor >= 0) {
      const bool good = image->write(descriptor);
      ::close(descriptor);
      say(good ? "crashed; the last step is in " : "crashed; the last step could not be written to ");
      say(crash_path);
      say("\n");
    }
  }
  for (std::size_t i = 0; i < CRASHES.size(); ++i) {
    if (CRASHES[i] == signal) ::sigaction(signal, &before_crash[i], nullptr);
  }
  // What happened before happens now: a core file, a sanitizer's report.
  ::raise(signal);
}

}  // namespace

std::string surpriseIn(const StepOutcome& outcome, const MonitorOptions& options) {
  if (outcome.status == StepStatus::INTERNAL_ERROR) return "the step failed: " + outcome.reason;
  if (!outcome.answered) return {};
  const bool exact = options.detector.accuracy.rung == Accuracy::EXACT;
  if (exact && outcome.complete && outcome.stats.undecided > 0) {
    return "exact arithmetic left " + std::to_string(outcome.stats.undecided) + " pairs undecided";
  }
  for (const core::Contact& c : outcome.contacts) {
    // Written so that a NaN fails.
    if (c.toc_lower >= 0 && c.toc_lower <= c.toc_upper && c.toc_upper <= 1) continue;
    return "a contact's time is outside of the step: [" + std::to_string(c.toc_lower) + ", " +
           std::to_string(c.toc_upper) + "]";
  }
  return {};
}

FlightRecorder::FlightRecorder(std::size_t steps, std::string folder) : ring_(steps), folder_(std::move(folder)) {
  if (steps == 0) throw std::invalid_argument("a flight recorder keeps at least 1 step");
}

FlightRecorder::~FlightRecorder() {
  const RecordingImage* mine = &image_;
  crash_image.compare_exchange_strong(mine, nullptr);
}

void FlightRecorder::onStep(const StepSource& source) {
  crash_image = nullptr;
  next_ = (next_ + 1) % ring_.size();
  count_ = std::min(count_ + 1, ring_.size());
  newest().note = "written by the crash handler";
  setSource(source, newest());
  image_.build(newest());
  crash_image = &image_;
}

void FlightRecorder::onOutcome(const StepOutcome& outcome) {
  if (count_ == 0) return;
  setAnswer(outcome, newest());  // the image points to nothing of the answer
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
  std::error_code ignored;  // the file says so, too
  std::filesystem::create_directories(folder_, ignored);
  const std::string path = folder_ + "/" + kind + "_" + std::to_string(recording.sequence) + "_" +
                           std::to_string(recording.stamp_ns) + ".step";
  recording.note = note;
  writeRecording(path, recording);
  return path;
}

std::vector<std::string> FlightRecorder::writeAll(const std::string& note) {
  std::vector<std::string> files;
  for (std::size_t i = count_; i-- > 0;) {
    StepRecording& recording = ring_[(next_ + 2 * ring_.size() - 1 - i) % ring_.size()];
    files.push_back(write(recording, "step", note));
  }
  return files;
}

std::string FlightRecorder::takeSurprise() { return std::exchange(surprise_, {}); }

void installCrashHandler(const std::string& folder) {
  const std::string path = folder + "/crash_" + std::to_string(::getpid()) + ".step";
  if (path.size() >= PATH_SIZE) throw std::invalid_argument("record_folder is too long: " + folder);
  std::memcpy(crash_path, path.c_str(), path.size() + 1);
  stack_t stack{};
  stack.ss_sp = crash_stack;
  stack.ss_size = sizeof crash_stack;
  ::sigaltstack(&stack, nullptr);
  struct sigaction action {};
  action.sa_handler = onCrash;
  action.sa_flags = SA_ONSTACK;
  sigemptyset(&action.sa_mask);
  for (std::size_t i = 0; i < CRASHES.size(); ++i) ::sigaction(CRASHES[i], &action, &before_crash[i]);
}

}  // namespace deformable_ccd
