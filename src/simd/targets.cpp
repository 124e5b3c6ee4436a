#include "simd/targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd/targets.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
int64_t Target() { return HWY_TARGET; }
}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dccd {
namespace simd {
HWY_EXPORT(Target);

namespace {

/// What this build and this processor share. Highway answers for the restriction in force, so the first call, which
/// restrictTo() makes before it restricts anything, asks once for all.
const std::vector<int64_t>& allTargets() {
  static const std::vector<int64_t> TARGETS = hwy::SupportedAndGeneratedTargets();
  return TARGETS;
}

}  // namespace

std::vector<std::string> usableTargets() {
  std::vector<std::string> names;
  for (const int64_t target : allTargets()) names.push_back(hwy::TargetName(target));
  return names;
}

std::string activeTarget() { return hwy::TargetName(HWY_DYNAMIC_DISPATCH(Target)()); }

bool restrictTo(const std::string& name) {
  int64_t allowed = 0;
  for (const int64_t target : allTargets()) {
    if (name == hwy::TargetName(target)) allowed = target;
  }
  if (allowed == 0 && !name.empty()) return false;
  // The dispatch tables are read by the targets that are supported now; what is better than `allowed` goes.
  hwy::DisableTargets(name.empty() ? 0 : (allowed - 1));
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return true;
}

}  // namespace simd
}  // namespace dccd
#endif
