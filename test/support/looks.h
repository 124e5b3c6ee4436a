// Steps that a deadline ends at a look at the clock, not at a time.
#pragma once

#include <atomic>
#include <cstdint>

#include "dccd/detect.h"

namespace dccd {
namespace test {

/// More looks than any step takes.
constexpr std::int64_t MANY = std::int64_t{1} << 40;

inline Outcome runFor(std::int64_t looks, const Step& step, const Options& options, History& history) {
  std::atomic<std::int64_t> left{looks};
  return detect(step, options, history, Deadline::afterLooks(left));
}

/// A first step.
inline Outcome runFor(std::int64_t looks, const Step& step, const Options& options = {}) {
  History history;
  return runFor(looks, step, options, history);
}

inline std::int64_t looksOf(const Step& step, const Options& options = {}) {
  std::atomic<std::int64_t> left{MANY};
  History history;
  detect(step, options, history, Deadline::afterLooks(left));
  return MANY - left;
}

}  // namespace test
}  // namespace dccd
