// What a library that was built with -ffast-math leaves behind in its process: denormal numbers are taken for zero.
#pragma once

#include <cstdint>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace dccd {
namespace test {

#if defined(__SSE2__)
constexpr std::uint64_t FLUSH_BITS = 0x8040;  // flush-to-zero, denormals-are-zero
inline std::uint64_t floatControl() { return _mm_getcsr(); }
inline void setFloatControl(std::uint64_t word) { _mm_setcsr(static_cast<unsigned>(word)); }
#elif defined(__aarch64__)
constexpr std::uint64_t FLUSH_BITS = std::uint64_t{1} << 24;  // FPCR.FZ
inline std::uint64_t floatControl() {
  std::uint64_t word;
  asm volatile("mrs %0, fpcr" : "=r"(word));
  return word;
}
inline void setFloatControl(std::uint64_t word) { asm volatile("msr fpcr, %0" : : "r"(word)); }
#else
constexpr std::uint64_t FLUSH_BITS = 0;
inline std::uint64_t floatControl() { return 0; }
inline void setFloatControl(std::uint64_t) {}
#endif

/// While it lives, this thread flushes to zero, unless somebody changes the mode.
class FlushToZero {
 public:
  FlushToZero() : saved_(floatControl()) { setFloatControl(saved_ | FLUSH_BITS); }
  ~FlushToZero() { setFloatControl(saved_); }
  FlushToZero(const FlushToZero&) = delete;
  FlushToZero& operator=(const FlushToZero&) = delete;
  bool isInForce() const { return (floatControl() & FLUSH_BITS) == FLUSH_BITS; }

 private:
  std::uint64_t saved_;
};

}  // namespace test
}  // namespace dccd
