// The monitors of test/ros/monitor.test.
#pragma once

#include <cstddef>

namespace dccd {
namespace test {

constexpr std::size_t MONITORS = 4;  // each listens to /tf

}  // namespace test
}  // namespace dccd
