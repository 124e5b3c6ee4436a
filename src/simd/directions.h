// The eight directions of all projections, once: x, y, z, x+y, x+z, y+z, x-y, y-z.
#pragma once

namespace dccd {
namespace simd {

/// The projections p of a point x. The five sums are rounded once each, so that they keep the order of the exact ones.
inline __attribute__((always_inline)) void project(const double* x, double* p) {
  p[0] = x[0];
  p[1] = x[1];
  p[2] = x[2];
  p[3] = x[0] + x[1];
  p[4] = x[0] + x[2];
  p[5] = x[1] + x[2];
  p[6] = x[0] - x[1];
  p[7] = x[1] - x[2];
}

}  // namespace simd
}  // namespace dccd
