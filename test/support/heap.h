// How much of the heap is in use.
#pragma once

#include <malloc.h>

#include <cstddef>

namespace dccd {
namespace test {

/// Bytes that were allocated and not freed, large blocks with pages of their own included. 0 under a sanitizer.
inline std::size_t heapInUse() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

}  // namespace test
}  // namespace dccd
