// How long things took, over any number of them, in a fixed amount of memory.
#pragma once

#include <array>
#include <cstdint>

namespace dccd {

/// Counts in bins of equal ratio, 20 a decade, from 1 microsecond to 1000 seconds; what is outside counts in the first
/// or the last bin. A quantile is the upper edge of its bin: at most 12.2 % too large, never too small (in the last
/// bin: the worst).
class LatencyHistogram {
 public:
  static constexpr int BINS_PER_DECADE = 20;
  static constexpr double LEAST_S = 1e-6;
  static constexpr std::size_t BINS = 9 * BINS_PER_DECADE;

  void add(double seconds);
  std::uint64_t count() const { return count_; }
  /// q in [0, 1]: the least edge that a share of q does not exceed. 0 when there is nothing.
  double quantile(double q) const;
  double worst() const { return worst_s_; }

 private:
  static double upperEdge(std::size_t bin);

  std::array<std::uint64_t, BINS> counts_{};
  std::uint64_t count_ = 0;
  double worst_s_ = 0;
};

}  // namespace dccd
