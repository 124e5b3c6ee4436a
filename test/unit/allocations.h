// The test program's own operator new: what is allocated is counted, and an allocation can be made to fail.
#pragma once

#include <atomic>
#include <cstdint>

namespace dccd {
namespace test {

extern std::atomic<std::uint64_t> allocations, allocated_bytes;
/// The allocation after so many more throws std::bad_alloc, that one alone; negative: none does.
extern std::atomic<std::int64_t> allocations_until_failure;

}  // namespace test
}  // namespace dccd
