#include "support/timing.h"

#include <hwy/targets.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <thread>

namespace dccd {
namespace benchmarks {

nlohmann::json spread(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  const double median = n == 0 ? 0 : 0.5 * (values[(n - 1) / 2] + values[n / 2]);
  return {{"best", n ? values.front() : 0.0}, {"median", median}, {"worst", n ? values.back() : 0.0}, {"runs", n}};
}

nlohmann::json quartiles(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {
    return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
  };
  return {{"median", at(0.5)}, {"quartile_1", at(0.25)}, {"quartile_3", at(0.75)}, {"runs", values.size()}};
}

std::size_t residentBytes() {
  malloc_trim(0);  // what was freed before is not in use
  std::ifstream pages("/proc/self/statm");
  std::size_t total = 0, resident = 0;
  pages >> total >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

double calibrationMs() {
  double best = 1e9;
  for (int run = 0; run < 5; ++run) {
    const Stopwatch watch;
    volatile double seed = 1.0000001;
    const double factor = seed;
    double x = 1;
    for (int i = 0; i < 2'000'000; ++i) x = x * factor - 1e-7;
    seed = x;
    best = std::min(best, watch.milliseconds());
  }
  return best;
}

nlohmann::json machine() {
  std::string processor = "unknown", line;
  std::ifstream info("/proc/cpuinfo");
  while (std::getline(info, line)) {
    if (line.rfind("model name", 0) != 0) continue;
    processor = line.substr(line.find(':') + 2);
    break;
  }
  const std::int64_t targets = hwy::SupportedTargets();
  return {{"processor", processor},
          {"threads", std::thread::hardware_concurrency()},
          {"simd_target", hwy::TargetName(targets & ~(targets - 1))},
          {"compiler", __VERSION__},
          {"calibration_ms", calibrationMs()}};
}

}  // namespace benchmarks
}  // namespace dccd
