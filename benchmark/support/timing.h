// Timing as every benchmark here reports it: all runs kept, medians with their spread, the machine named.
#pragma once

#include <chrono>
#include <functional>
#include <nlohmann/json.hpp>
#include <vector>

namespace dccd {
namespace benchmarks {

class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }
  double milliseconds() const { return 1e3 * seconds(); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

/// {"best", "median", "worst", "runs"}; every value 0 for no runs.
nlohmann::json spread(std::vector<double> values);

/// {"median", "quartile_1", "quartile_3", "runs"} of ratios taken run by run; of at least one value.
nlohmann::json quartiles(std::vector<double> values);

/// Processor time that the calling thread takes for `run` past the end of its budget, which begins with the call; 0
/// where it ends in time. By the timer of the process (SIGALRM): one at a time.
double overrunMs(double budget_ms, const std::function<void()>& run);

/// Memory of this process that is in use [bytes].
std::size_t residentBytes();

/// What a time depends on: processor, SIMD target, compiler, and the time of a fixed arithmetic kernel in this process.
nlohmann::json machine();

/// Milliseconds of a fixed scalar kernel (a chain of multiplications and additions): tells a slow or busy machine from
/// a slow program.
double calibrationMs();

}  // namespace benchmarks
}  // namespace dccd
