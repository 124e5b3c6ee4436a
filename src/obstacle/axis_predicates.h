// Exact signs and times of what a static, axis-aligned obstacle asks: double first, rational arithmetic where the
// double result is not certain. All coordinates must be finite; rounding to nearest.
#pragma once

#include <cstdint>

#include "dccd/export.h"
#include "dccd/tolerances.h"

namespace dccd {

/// Sign of (p1 - p0) x (q - p0) in the plane of two coordinates, exact: +1 where q lies left of p0 p1. Also
/// for the polygons of the input, in another library.
DCCD_EXPORT int orientation2d(double p0x, double p0y, double p1x, double p1y, double qx, double qy);

/// Sign of the volume (b - a) x (c - a) . (q - a), exact.
int orientation3d(const double* a, const double* b, const double* c, const double* q);

/// The time (plane - from) / (to - from) at which a coordinate that moves from `from` to `to` is at `plane`, exact.
/// from != to, and the time must be >= 0.
struct CrossingTime {
  CrossingTime() = default;
  CrossingTime(double plane_, double from_, double to_);

  double plane = 0, from = 0, to = 1;
  double approximate = 0;  ///< rounded; relative error at most CROSSING_TIME where certain
  bool certain = true;     ///< false: `approximate` may be anything
};

/// Two differences and a quotient, each rounded once: 3.01 * 2^-53, and slack for comparing two of them in double.
using tolerance::CROSSING_TIME;

/// Sign of a - b, exact.
int compare(const CrossingTime& a, const CrossingTime& b);

/// Sign of time - 1, exact.
inline int compareToOne(const CrossingTime& time) {
  if (time.plane == time.to) return 0;
  return (time.to > time.from) == (time.plane > time.to) ? 1 : -1;
}

/// floor(time * 2^bits), exact. The time must be at most 1; bits 10 to 52.
std::int64_t timeCell(const CrossingTime& time, int bits);

}  // namespace dccd
