#include "dccd/clearance.h"

#include "dccd/detect.h"

namespace dccd {

const char* toString(ClearanceStatus status) {
  static constexpr const char* NAMES[] = {"MEASURED", "FARTHER", "TOUCHING", "LOWER", "UNKNOWN"};
  return NAMES[static_cast<std::size_t>(status)];
}

std::vector<Clearance> distance(const Step& step, const Options& options) {
  Options asked = options;
  asked.clearance.wanted = true;
  History history;
  return detect(step, asked, history).clearances;
}

}  // namespace dccd
