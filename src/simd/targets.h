// Which SIMD target the kernels run on; process-wide, chosen once at start. Raw names, for include/.../simd_target.h.
#pragma once

#include <string>
#include <vector>

namespace dccd {
namespace simd {

std::vector<std::string> usableTargets();  ///< compiled in and supported here, best first
std::string activeTarget();
bool restrictTo(const std::string& name);  ///< false when the name is not usable here; "" removes the restriction

}  // namespace simd
}  // namespace dccd
