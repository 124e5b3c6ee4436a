#include "support/timing.h"

#include <hwy/targets.h>
#include <malloc.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <ctime>
#include <fstream>
#include <string>
#include <thread>

namespace dccd {
namespace benchmarks {
namespace {

double threadMs() {
  timespec used{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  return 1e3 * static_cast<double>(used.tv_sec) + 1e-6 * static_cast<double>(used.tv_nsec);
}

/// What the thread had used when its budget ended; written by a signal, which the timer sends at that moment.
volatile double used_at_end_ms = 0;
volatile std::sig_atomic_t has_ended = 0;

void startTimer(double ms) {
  itimerval timer{};
  timer.it_value.tv_sec = static_cast<time_t>(ms / 1000);
  timer.it_value.tv_usec = static_cast<suseconds_t>(1e3 * ms) % 1000000;
  setitimer(ITIMER_REAL, &timer, nullptr);
}

}  // namespace

double overrunMs(double budget_ms, const std::function<void()>& run) {
  std::signal(SIGALRM, [](int) {
    used_at_end_ms = threadMs();
    has_ended = 1;
  });
  has_ended = 0;
  startTimer(budget_ms);
  run();
  const double over_ms = has_ended ? threadMs() - used_at_end_ms : 0;
  startTimer(0);
  return over_ms;
}

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
