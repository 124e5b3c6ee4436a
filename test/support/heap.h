// How much of the heap is in use.
#pragma once

#include <malloc.h>

#include <cstddef>

namespace dccd {
namespace test {

/// Bytes that were allocated and not freed, large blocks with pages of their own included. 0 under a sanitizer.
inline std::size_t heapInUse() {
#if __GLIBC_PREREQ(2, 33)
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
#else  // counts in ints there, which wrap at 4 GB; no test comes near that
  const struct mallinfo info = mallinfo();
  return static_cast<unsigned>(info.uordblks) + std::size_t{static_cast<unsigned>(info.hblkhd)};
#endif
}

}  // namespace test
}  // namespace dccd
