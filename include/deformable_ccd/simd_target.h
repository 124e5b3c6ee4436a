// The SIMD target of the process: the best that the processor has, or a named one for tests and measurements.
#pragma once

#include <string>
#include <vector>

namespace deformable_ccd {

/// Names of the targets that this build and this processor share, best first, e.g. AVX2, SSE4, SSSE3.
std::vector<std::string> simdTargets();

/// The name of the target in use.
std::string simdTarget();

/// "auto" or one of simdTargets(). Process-wide: call it at start, before any work. Answers do not depend on it.
/// Throws std::invalid_argument naming the value and the usable ones.
void setSimdTarget(const std::string& name);

}  // namespace deformable_ccd
