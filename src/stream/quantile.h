// One quantile of a run's values, for scores and tables.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace dccd {

/// The value at the rank nearest to `q`, from 0 (the smallest) to 1 (the largest); 0 where there are no values.
inline double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  const auto rank = static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

}  // namespace dccd
