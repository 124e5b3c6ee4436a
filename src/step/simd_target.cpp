#include "dccd/monitor_extras.h"

#include <stdexcept>

#include "simd/targets.h"

namespace dccd {

std::vector<std::string> simdTargets() { return simd::usableTargets(); }

std::string simdTarget() { return simd::activeTarget(); }

void setSimdTarget(const std::string& name) {
  if (simd::restrictTo(name == "auto" ? "" : name)) return;
  std::string usable = "auto";
  for (const std::string& n : simd::usableTargets()) usable += ", " + n;
  throw std::invalid_argument("simd_target = '" + name + "' cannot be used here; usable: " + usable);
}

}  // namespace dccd
