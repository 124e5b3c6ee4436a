// Runs a check once for every SIMD target that this build has and this machine can run.
#pragma once

#include <string>

#include "dccd/monitor_extras.h"

namespace dccd {
namespace test {

/// While it lives, the kernels run on one target; afterwards on the best one again. The core is asked, not Highway:
/// where Highway is a static library, the test program has a copy of its own, of which the kernels know nothing.
class ForcedTarget {
 public:
  explicit ForcedTarget(const std::string& target) { setSimdTarget(target); }
  ~ForcedTarget() { setSimdTarget("auto"); }
  ForcedTarget(const ForcedTarget&) = delete;
  ForcedTarget& operator=(const ForcedTarget&) = delete;
};

/// check(name of the target), for each target.
template <class Check>
void forEachTarget(const Check& check) {
  for (const std::string& target : simdTargets()) {
    const ForcedTarget forced(target);
    check(target);
  }
}

}  // namespace test
}  // namespace dccd
