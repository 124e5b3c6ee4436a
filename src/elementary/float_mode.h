// Round to nearest, denormals on: what every proof of a rounding margin assumes. Set by each rung for a batch, on each
// worker of a step for the time of its work, and restored after it (doc/algorithm.md, last section).
#pragma once

#include <cfenv>

namespace dccd {

class ScopedFloatMode {
 public:
  ScopedFloatMode() {
    std::fegetenv(&saved_);
    std::fesetenv(FE_DFL_ENV);  // on x86 this clears flush-to-zero and denormals-are-zero as well
  }
  ~ScopedFloatMode() { std::fesetenv(&saved_); }
  ScopedFloatMode(const ScopedFloatMode&) = delete;
  ScopedFloatMode& operator=(const ScopedFloatMode&) = delete;

 private:
  std::fenv_t saved_;
};

}  // namespace dccd
