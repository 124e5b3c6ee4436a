// Uncertainty radii of frames.
#pragma once

#include <algorithm>
#include <vector>

#include "dccd/body.h"

namespace dccd {

/// Of two lists of radii [m], of which either may be empty (none), the larger ones.
inline std::vector<double> largerRadii(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.empty() || b.empty()) return a.empty() ? b : a;
  std::vector<double> larger(a.size());
  for (std::size_t v = 0; v < a.size(); ++v) larger[v] = std::max(a[v], b[v]);
  return larger;
}

inline double largestRadius(const Body& body) {
  return body.radius_m && !body.radius_m->empty() ? *std::max_element(body.radius_m->begin(), body.radius_m->end()) : 0;
}

}  // namespace dccd
