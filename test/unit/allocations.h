// The test program's own operator new: what is allocated is counted, and an allocation can be made to fail.
#pragma once

#include <atomic>
#include <cstdint>

namespace dccd {
namespace test {

extern std::atomic<std::uint64_t> allocations, allocated_bytes;
/// While it lives, the allocation after `after` more throws std::bad_alloc, and where it lasts, so do all that follow.
class AllocationFailure {
 public:
  AllocationFailure(int after, bool lasts);
  ~AllocationFailure();
  AllocationFailure(const AllocationFailure&) = delete;
  AllocationFailure& operator=(const AllocationFailure&) = delete;
  /// An allocation has failed.
  bool met() const;
};

}  // namespace test
}  // namespace dccd
