// One line per kind of trouble and period, with how often it came; on the steady clock, which no replay can stop.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>

namespace dccd {

class LogThrottle {
 public:
  explicit LogThrottle(double period_s) : period_ns_(static_cast<std::int64_t>(period_s * 1e9)) {}

  /// Empty when the kind has been said within the period; else the line, with the number of times it was held back.
  std::string line(const std::string& kind, const std::string& text, std::int64_t now_ns) {
    Entry& entry = entries_[kind];
    if (entry.said && now_ns - entry.at_ns < period_ns_) {
      ++entry.held;
      return {};
    }
    const std::string more =
        entry.held ? " (and " + std::to_string(entry.held) + " times more since the last line)" : "";
    entry = {now_ns, 0, true};
    return text + more;
  }

 private:
  struct Entry {
    std::int64_t at_ns = 0;
    std::uint64_t held = 0;
    bool said = false;
  };
  std::int64_t period_ns_;
  std::unordered_map<std::string, Entry> entries_;
};

}  // namespace dccd
