// Runs a check once for every SIMD target that this build has and this machine can run.
#pragma once

#include <hwy/targets.h>

#include <string>
#include <vector>

namespace dccd {
namespace test {

/// While it lives, the kernels run on one target; afterwards on the best one again.
class ForcedTarget {
 public:
  explicit ForcedTarget(std::int64_t target) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
  ~ForcedTarget() {
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
  ForcedTarget(const ForcedTarget&) = delete;
  ForcedTarget& operator=(const ForcedTarget&) = delete;
};

/// check(name of the target), for each target.
template <class Check>
void forEachTarget(const Check& check) {
  for (std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    const ForcedTarget forced(target);
    check(std::string(hwy::TargetName(target)));
  }
}

}  // namespace test
}  // namespace dccd
