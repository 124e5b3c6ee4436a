#include "unit/allocations.h"

#include <cstdlib>
#include <new>

namespace dccd {
namespace test {

std::atomic<std::uint64_t> allocations{0}, allocated_bytes{0};
std::atomic<std::int64_t> allocations_until_failure{-1};

namespace {

void* allocate(std::size_t size) {
  ++allocations;
  allocated_bytes += size;
  if (allocations_until_failure >= 0 && allocations_until_failure-- == 0) return nullptr;
  return std::malloc(size ? size : 1);
}

}  // namespace
}  // namespace test
}  // namespace dccd

// Forms with an alignment are the library's and not used by std::vector of ours.
void* operator new(std::size_t size) {
  if (void* p = dccd::test::allocate(size)) return p;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {  // std::stable_sort's
  return dccd::test::allocate(size);
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
