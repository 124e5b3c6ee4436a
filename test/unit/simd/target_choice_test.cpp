// The choice of the SIMD target: whoever asks which there are changes nothing.
#include "dccd/monitor_extras.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace dccd {
namespace {

TEST(SimdTarget, AskingAndBeingRefusedLeaveTheChoiceAsItIs) {
  const std::vector<std::string> all = simdTargets();
  ASSERT_FALSE(all.empty());
  const std::string before = simdTarget();
  for (const std::string& one : all) {
    setSimdTarget(one);
    EXPECT_EQ(simdTargets(), all) << "those of the machine, not of the choice";
    EXPECT_EQ(simdTarget(), one);
    EXPECT_THROW(setSimdTarget("SSE17"), std::invalid_argument);
    EXPECT_EQ(simdTarget(), one) << "what is refused changes nothing";
  }
  setSimdTarget("auto");
  EXPECT_EQ(simdTarget(), all.front());
  setSimdTarget(before);
}

}  // namespace
}  // namespace dccd
