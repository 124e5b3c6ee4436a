// Progress of long work on standard error: a bar with the time that is left on a terminal, elsewhere now and then a
// line.
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
  /// `total` steps; silent where `enabled` is false. `line_every`: without a terminal.
  ProgressBar(std::string label, std::size_t total, bool enabled = true,
              std::chrono::milliseconds line_every = std::chrono::seconds(20))
      : label_(std::move(label)),
        total_(std::max<std::size_t>(total, 1)),
        enabled_(enabled),
        on_terminal_(isatty(STDERR_FILENO) != 0),
        // Ten times a second is smooth; more would cost time on slow terminals.
        every_(on_terminal_ ? std::chrono::milliseconds(100) : line_every) {}
  ~ProgressBar() {
    if (drawn_) std::fputc('\n', stderr);
  }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void advance(std::size_t steps = 1) {
    done_ = std::min(done_ + steps, total_);
    const auto now = std::chrono::steady_clock::now();
    // What is over at once draws nothing.
    if (!enabled_ || (now - last_ < every_ && !(drawn_ && done_ == total_))) return;
    last_ = now;
    const int percent = static_cast<int>(done_ * 100 / total_);
    const std::string left = timeLeft(std::chrono::duration<double>(now - started_).count());
    if (!on_terminal_) {
      std::fprintf(stderr, "%s: %d %%%s\n", label_.c_str(), percent, left.c_str());
    } else {
      drawn_ = true;
      const int filled = static_cast<int>(done_ * WIDTH / total_);
      std::fprintf(stderr, "\r%s [%s%s] %3d %%%s\033[K", label_.c_str(), std::string(filled, '#').c_str(),
                   std::string(WIDTH - filled, ' ').c_str(), percent, left.c_str());
    }
    std::fflush(stderr);
  }

 private:
  static constexpr int WIDTH = 40;

  /// By what was done so far; nothing at the end, and in the first second, of which it would be a guess.
  std::string timeLeft(double spent_s) const {
    if (spent_s < 1 || done_ == 0 || done_ == total_) return "";
    const auto left_s =
        static_cast<long>(spent_s * static_cast<double>(total_ - done_) / static_cast<double>(done_) + 0.5);
    char text[48];
    std::snprintf(text, sizeof text, ", about %ld:%02ld:%02ld left", left_s / 3600, left_s / 60 % 60, left_s % 60);
    return text;
  }

  std::string label_;
  std::size_t total_;
  std::size_t done_ = 0;
  bool enabled_, on_terminal_, drawn_ = false;
  std::chrono::milliseconds every_;
  std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now(), last_ = started_;
};

}  // namespace dccd
