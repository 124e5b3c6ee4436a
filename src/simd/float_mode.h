// Round to nearest, denormals on: what every proof of a rounding margin assumes. Set by each rung for a batch, on each
// worker of a step for the time of its work, and restored after it (doc/algorithm.md, last section).
#pragma once

#include <cfenv>

#if defined(__SSE2_MATH__)
#include <immintrin.h>
#endif

namespace dccd {

#if defined(__SSE2_MATH__)
// The register alone: fegetenv() and fesetenv() also save the x87 unit, which takes longer than most pairs do.
class ScopedFloatMode {
 public:
  ScopedFloatMode() : saved_(_mm_getcsr()) {
    if ((saved_ & ~STICKY) != DEFAULT) _mm_setcsr(DEFAULT);
  }
  ~ScopedFloatMode() { _mm_setcsr(saved_); }
  ScopedFloatMode(const ScopedFloatMode&) = delete;
  ScopedFloatMode& operator=(const ScopedFloatMode&) = delete;

 private:
  static constexpr unsigned DEFAULT = 0x1f80, STICKY = 0x3f;  ///< all exceptions masked; flags that were raised
  unsigned saved_;
};
#else
class ScopedFloatMode {
 public:
  ScopedFloatMode() {
    std::fegetenv(&saved_);
    std::fesetenv(FE_DFL_ENV);
  }
  ~ScopedFloatMode() { std::fesetenv(&saved_); }
  ScopedFloatMode(const ScopedFloatMode&) = delete;
  ScopedFloatMode& operator=(const ScopedFloatMode&) = delete;

 private:
  std::fenv_t saved_;
};
#endif

}  // namespace dccd
