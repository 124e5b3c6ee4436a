#include "paper/paper_record.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace dccd {
namespace {

/// The projections in the lanes' order, each at most one rounded sum: monotone in the exact projection.
inline void project(const double* x, double* p) {
  p[0] = x[0];
  p[1] = x[1];
  p[2] = x[1] + x[2];
  p[3] = x[0] + x[2];
  p[4] = x[2];
  p[5] = x[0] + x[1];
  p[6] = x[1] - x[2];
  p[7] = x[0] - x[1];
}

constexpr double MAX_COORDINATE = 0x1p1000;

}  // namespace

void PaperRecords::measure(const VertexMotion* vertices, std::size_t count, const std::uint8_t* active) {
  constexpr double INF = std::numeric_limits<double>::infinity();
  double lo[PAPER_DIRECTIONS], hi[PAPER_DIRECTIONS], p[PAPER_DIRECTIONS];
  std::fill(lo, lo + PAPER_DIRECTIONS, INF);
  std::fill(hi, hi + PAPER_DIRECTIONS, -INF);
  for (std::size_t i = 0; i < count; ++i) {
    if (active && !active[i]) continue;
    for (const double* x : {vertices[i].t0, vertices[i].t1}) {
      project(x, p);
      for (std::size_t k = 0; k < PAPER_DIRECTIONS; ++k) {
        lo[k] = p[k] < lo[k] ? p[k] : lo[k];
        hi[k] = p[k] > hi[k] ? p[k] : hi[k];
      }
    }
  }
  double largest = 0, half_width = 0;
  for (std::size_t k = 0; k < PAPER_DIRECTIONS; ++k) {
    largest = std::max({largest, std::abs(lo[k]), std::abs(hi[k])});
    centre_[k] = 0.5 * lo[k] + 0.5 * hi[k];
    half_width = std::max({half_width, hi[k] - centre_[k], centre_[k] - lo[k]});
  }
  if (!(largest <= MAX_COORDINATE)) {  // also when there is no active vertex, and largest is infinite
    centre_.fill(0);
    scale_ = 0;
    error_ = 1;
    return;
  }
  // The largest stored value lands in [1/2, 1]: a power of two at least half_width, and not so small that its inverse
  // overflows.
  int exponent = -1000;
  if (half_width > 0) std::frexp(half_width, &exponent);
  exponent = std::max(exponent, -1000);
  scale_ = std::ldexp(1.0, -exponent);
  // |fl(x+y) - (x+y)| <= 2^-53 largest; |fl(p-c) - (p-c)| <= 2^-53 * 2^exponent; the scaling is exact or errs by less
  // than 2^-1074; rounding to float errs by 2^-25 on values up to 1 (half a unit in the last place of [1/2,1] is
  // 2^-25). In stored units the sum is at most 2^-53 largest*scale + 2^-53 + 2^-1074 + 2^-25; the factor 1 + 2^-20
  // covers the rounding of this very line and of `largest`, which is itself rounded.
  const double bound = (0x1p-53 * largest * scale_ + 0x1p-53 + 0x1p-25) * (1 + 0x1p-20);
  // Beyond 1 every margin exceeds what it is compared with, so the bound may be cut there (and stays finite).
  error_ = bound < 1 ? std::nextafter(static_cast<float>(bound), 2.0f) : 1.0f;
}

void PaperRecords::build(const VertexMotion* vertices, std::size_t count, const std::uint8_t* active) {
  records_.resize(count);
  measure(vertices, count, active);
  double p[PAPER_DIRECTIONS];
  for (std::size_t i = 0; i < count; ++i) {
    if (scale_ == 0 || (active && !active[i])) {
      records_[i] = PaperRecord{};
      continue;
    }
    project(vertices[i].t0, p);
    for (std::size_t k = 0; k < PAPER_DIRECTIONS; ++k) {
      records_[i].t0[k] = static_cast<float>((p[k] - centre_[k]) * scale_);
    }
    project(vertices[i].t1, p);
    for (std::size_t k = 0; k < PAPER_DIRECTIONS; ++k) {
      records_[i].t1[k] = static_cast<float>((p[k] - centre_[k]) * scale_);
    }
  }
}

}  // namespace dccd
