// Memory for large arrays that are read in any order: in huge pages where the system has them, so that a processor
// need not look up so many addresses.
#pragma once

#include <hwy/aligned_allocator.h>
#ifdef __linux__
#include <sys/mman.h>
#include <unistd.h>
#endif

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>

namespace dccd {

/// Aligned for vector loads. Huge pages are asked for where the array fills them, so that they take no more memory.
template <class T>
hwy::AlignedFreeUniquePtr<T[]> makeLarge(std::size_t n) {
  const auto allocate = [](void*, std::size_t bytes) -> void* {
#ifdef MADV_HUGEPAGE
    constexpr std::size_t HUGE_PAGE = std::size_t{1} << 21;
    if (bytes >= HUGE_PAGE) {
      void* memory = nullptr;
      if (posix_memalign(&memory, HUGE_PAGE, bytes) != 0) return nullptr;
      madvise(memory, bytes / HUGE_PAGE * HUGE_PAGE, MADV_HUGEPAGE);  // where it is refused, small pages serve as well
      return memory;
    }
#endif
    return std::malloc(bytes);
  };
  auto array = hwy::AllocateAligned<T>(
      n, allocate, [](void*, void* memory) { std::free(memory); }, nullptr);
  if (!array) throw std::bad_alloc();
  return array;
}

/// The system has the memory until it is written again; what was in it is lost.
inline void giveBack([[maybe_unused]] void* memory, [[maybe_unused]] std::size_t bytes) {
#ifdef MADV_DONTNEED
  const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
  const auto begin = reinterpret_cast<std::uintptr_t>(memory), first = (begin + page - 1) / page * page;
  const std::uintptr_t last = (begin + bytes) / page * page;
  if (first < last) madvise(reinterpret_cast<void*>(first), last - first, MADV_DONTNEED);
#endif
}

}  // namespace dccd
