#include "output/latency_histogram.h"

#include <algorithm>
#include <cmath>

namespace dccd {

double LatencyHistogram::upperEdge(std::size_t bin) {
  return LEAST_S * std::pow(10.0, static_cast<double>(bin + 1) / BINS_PER_DECADE);
}

void LatencyHistogram::add(double seconds) {
  // Clamped before the cast, which a NaN or an infinity would not survive.
  const double place = seconds > LEAST_S ? std::log10(seconds / LEAST_S) * BINS_PER_DECADE : 0.0;
  std::size_t bin = static_cast<std::size_t>(std::clamp(place, 0.0, static_cast<double>(BINS - 1)));
  // The logarithm is rounded: a value on an edge belongs below it.
  while (bin > 0 && seconds <= upperEdge(bin - 1)) --bin;
  while (bin + 1 < BINS && seconds > upperEdge(bin)) ++bin;
  ++counts_[bin];
  ++count_;
  worst_s_ = std::max(worst_s_, seconds);
}

double LatencyHistogram::quantile(double q) const {
  if (count_ == 0) return 0;
  const double wanted = q * static_cast<double>(count_);
  std::uint64_t sum = 0;
  for (std::size_t bin = 0; bin < BINS; ++bin) {
    sum += counts_[bin];
    if (sum > 0 && static_cast<double>(sum) >= wanted) return std::min(upperEdge(bin), worst_s_);
  }
  return worst_s_;
}

}  // namespace dccd
