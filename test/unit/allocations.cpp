#include "unit/allocations.h"

#include <cstdlib>
#include <new>

namespace dccd {
namespace test {

std::atomic<std::uint64_t> allocations{0}, allocated_bytes{0};

namespace {

std::atomic<bool> may_fail{false}, failure_lasts{false};
std::atomic<std::int64_t> left{0};  // before the failure; then it counts on

void* allocate(std::size_t size) {
  ++allocations;
  allocated_bytes += size;
  if (may_fail) {
    const std::int64_t before = left--;
    if (before == 0 || (before < 0 && failure_lasts)) return nullptr;
  }
  return std::malloc(size ? size : 1);
}

}  // namespace

AllocationFailure::AllocationFailure(int after, bool lasts) {
  left = after;
  failure_lasts = lasts;
  may_fail = true;
}
AllocationFailure::~AllocationFailure() { may_fail = false; }
bool AllocationFailure::met() const { return left < 0; }

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
