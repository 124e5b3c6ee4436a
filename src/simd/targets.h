// Which SIMD target the kernels run on; process-wide, chosen once at start. Raw names, for include/.../simd_target.h.
#pragma once

/// In kernels, of the target that is being compiled: x86 with vectors of 512 bits and 32 registers, where hn::Compress
/// is one instruction.
#define DCCD_AVX512 (HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3)

#include <string>
#include <vector>

namespace dccd {
namespace simd {

std::vector<std::string> usableTargets();  ///< compiled in and supported here, best first
std::string activeTarget();
bool restrictTo(const std::string& name);  ///< false when the name is not usable here; "" removes the restriction

}  // namespace simd
}  // namespace dccd
