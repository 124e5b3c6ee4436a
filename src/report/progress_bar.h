// A progress bar on standard error: drawn on a terminal only, so that logs stay readable.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>
#include <utility>

namespace dccd {

class ProgressBar {
 public:
  /// `total` steps; nothing is drawn when `enabled` is false or standard error is no terminal.
  ProgressBar(std::string label, std::size_t total, bool enabled = true)
      : label_(std::move(label)),
        total_(std::max<std::size_t>(total, 1)),
        drawn_(enabled && isatty(STDERR_FILENO) != 0) {}
  ~ProgressBar() {
    if (drawn_) std::fputc('\n', stderr);
  }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void advance(std::size_t steps = 1) {
    done_ = std::min(done_ + steps, total_);
    // Ten times a second is smooth; more would cost time on slow terminals.
    const auto now = std::chrono::steady_clock::now();
    if (!drawn_ || (done_ < total_ && now - last_ < std::chrono::milliseconds(100))) return;
    last_ = now;
    const int filled = static_cast<int>(done_ * WIDTH / total_);
    std::fprintf(stderr, "\r%s [%s%s] %3zu %%", label_.c_str(), std::string(filled, '#').c_str(),
                 std::string(WIDTH - filled, ' ').c_str(), done_ * 100 / total_);
    std::fflush(stderr);
  }

 private:
  static constexpr int WIDTH = 40;
  std::string label_;
  std::size_t total_;
  std::size_t done_ = 0;
  bool drawn_;
  std::chrono::steady_clock::time_point last_{};
};

}  // namespace dccd
