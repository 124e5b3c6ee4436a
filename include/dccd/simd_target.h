// The SIMD target of the process: the best that the processor has, or a named one for tests and measurements.
#pragma once

#include <string>
#include <vector>

#include "dccd/export.h"

namespace dccd {

/// Names of the targets that this build and this processor share, best first, e.g. AVX2, SSE4, SSSE3.
DCCD_EXPORT std::vector<std::string> simdTargets();

/// The name of the target in use.
DCCD_EXPORT std::string simdTarget();

/// "auto" or one of simdTargets(). Process-wide: call it at start, before any work. Answers do not depend on it.
/// Throws std::invalid_argument naming the value and the usable ones.
DCCD_EXPORT void setSimdTarget(const std::string& name);

}  // namespace dccd
