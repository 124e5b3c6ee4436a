#include "node/crash_handler.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstring>
#include <stdexcept>

namespace dccd {

namespace {

constexpr std::size_t PATH_SIZE = 4096;
constexpr std::array<int, 5> CRASHES{SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};

// What the handler may touch: lock-free, and never freed while it is set.
FlightRecorder::NewestImage crash_image{nullptr};
static_assert(FlightRecorder::NewestImage::is_always_lock_free);
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

FlightRecorder::NewestImage& crashImage() { return crash_image; }

void installCrashHandler(const std::string& folder, const std::string& owner) {
  const std::string stem = folder + "/crash_" + (owner.empty() ? "" : owner + "_") + std::to_string(::getpid());
  std::string path = stem + ".step";
  // In containers every process may have the same number.
  for (int copy = 2; ::access(path.c_str(), F_OK) == 0; ++copy) path = stem + "_" + std::to_string(copy) + ".step";
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

}  // namespace dccd
