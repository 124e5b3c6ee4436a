// Simple times: integers of one or two words for what people make by hand. Features at rest, surfaces that meet at
// t = 0, 1/2 or 1/3, faces that land exactly on each other: there f is exactly 0 where no floating-point bound can say
// so, and all that has to be known are signs at one rational time p/q with a small q.
//
// Which time. The estimate of the first root is plain double and proves nothing. f(r) = 0 is proved by the integers;
// that f has no root before r by its Bernstein coefficients over [0, r], of which the last is 0 and the others are
// certainly of one sign; that it has none after r by those over [r, 1]. Their errors are those of exact_batch_bounds.h,
// and |r| 2^-53 for the rounded quotient p/q, at which they are taken: de Casteljau's three levels move by at most 3 *
// 2 * 2^-53 max |fi|; 8 * 2^-53 max |fi|, at most 48 * 2^-53 U V W, is used, so that the sum is (106 + 48) 2^-53 U V W.
#include <algorithm>
#include <cmath>

#include "dccd/tolerances.h"
#include "elementary/exact_frozen_pair.h"
#include "elementary/exact_tiers.h"

namespace dccd {
namespace exact {
namespace {

constexpr std::int64_t LARGEST_DENOMINATOR = 1024;
using tolerance::SAME_TIME;

/// The rational of the smallest denominator within SAME_TIME of t in [0,1], by continued fractions; q = 0 for none.
SimpleTime simpleTimeAt(double t) {
  std::int64_t p[2] = {1, 0}, q[2] = {0, 1};  // the last two convergents, the last one first
  double rest = t;
  for (int i = 0; i < 12; ++i) {
    const double whole = std::floor(rest);
    if (!(whole <= LARGEST_DENOMINATOR)) break;
    const auto digit = static_cast<std::int64_t>(whole);
    const std::int64_t next_p = digit * p[0] + p[1], next_q = digit * q[0] + q[1];
    if (next_q > LARGEST_DENOMINATOR) break;
    p[1] = p[0], q[1] = q[0], p[0] = next_p, q[0] = next_q;
    const SimpleTime time = {p[0], q[0]};
    if (std::fabs(time.rounded() - t) <= SAME_TIME) return time;
    rest = 1 / (rest - whole);
  }
  return {0, 0};
}

enum class Meeting { APART, NOT_COPLANAR, TOUCHING, UNKNOWN };

template <int N>
Meeting meetingOf(PairKind kind, const PairMotion& pair, const SimpleTime& time, bool only_coplanar) {
  Frozen<N> frozen;
  if (!frozen.set(kind, pair, time)) return Meeting::UNKNOWN;
  if (frozen.volume().sign() != 0) return Meeting::NOT_COPLANAR;
  return only_coplanar || frozen.meet() ? Meeting::TOUCHING : Meeting::APART;
}

/// only_coplanar: TOUCHING where the four points are in a plane.
Meeting meetingAt(PairKind kind, const PairMotion& pair, const SimpleTime& time, bool only_coplanar = false) {
  const Meeting meeting = meetingOf<1>(kind, pair, time, only_coplanar);
  return meeting == Meeting::UNKNOWN ? meetingOf<2>(kind, pair, time, only_coplanar) : meeting;
}

ElementaryResult contactAt(const SimpleTime& time, int toc_bits) {
  const auto cell = static_cast<std::int64_t>((static_cast<__int128>(time.p) << toc_bits) / time.q);
  return contactInCell(cell, toc_bits, Tier::FIXED_INTEGER);
}

/// f in plain double: its Bernstein coefficients over [0,1], each within `error`.
struct RoughCubic {
  double b[4];
  double error;

  RoughCubic(PairKind kind, const PairMotion& pair) {
    const bool vertex_face = kind == PairKind::VERTEX_FACE;
    const int ends[3][2] = {{vertex_face ? 1 : 0, vertex_face ? 2 : 1},
                            {vertex_face ? 1 : 2, 3},
                            {vertex_face ? 1 : 0, vertex_face ? 0 : 2}};  // from, to
    double d[3][2][3], volume = 1;
    for (int i = 0; i < 3; ++i) {
      double size = 0;
      for (int time = 0; time < 2; ++time) {
        for (int k = 0; k < 3; ++k) {
          d[i][time][k] = pair.x[time][ends[i][1]][k] - pair.x[time][ends[i][0]][k];
          size = std::max(size, std::fabs(d[i][time][k]));
        }
      }
      const bool in_range = size >= tolerance::BATCH_SMALLEST_M && size <= tolerance::BATCH_LARGEST_M;
      volume = in_range ? volume * size : HUGE_VAL;
    }
    for (double& x : b) x = 0;
    for (int k = 0; k < 3; ++k) {
      const int i = k == 2 ? 0 : k + 1, j = k == 0 ? 2 : k - 1;
      const auto minor = [&](int s, int t) { return d[0][s][i] * d[1][t][j] - d[0][s][j] * d[1][t][i]; };
      const double n0 = minor(0, 0), n1 = minor(0, 1) + minor(1, 0), n2 = minor(1, 1);
      const double w0 = d[2][0][k], w1 = d[2][1][k];
      b[0] += n0 * w0;
      b[1] += n1 * w0 + n0 * w1;
      b[2] += n1 * w1 + n2 * w0;
      b[3] += n2 * w1;
    }
    b[1] *= 1.0 / 3;
    b[2] *= 1.0 / 3;
    error = tolerance::SIMPLE_TIME * volume;
  }

  double at(double t) const {
    const double s = 1 - t;
    return ((b[0] * s + 3 * b[1] * t) * s + 3 * b[2] * t * t) * s + b[3] * t * t * t;
  }

  int signOf(double value) const { return value > error ? 1 : value < -error ? -1 : 0; }

  /// About the first root after a start with a certain sign; -1 where no sign changes.
  double firstRoot() const {
    if (signOf(b[3]) == 0) return 1;
    if (signOf(b[3]) == signOf(b[0])) return -1;
    double low = 0, high = 1, at_low = b[0], at_high = b[3];
    for (int i = 0; i < 12; ++i) {  // Illinois: false position that does not get stuck at one end
      const double t = (low * at_high - high * at_low) / (at_high - at_low), value = at(t);
      if (std::fabs(value) <= error || !(t > low && t < high)) return t;
      if ((value > 0) == (at_low > 0)) {
        low = t, at_low = value, at_high *= 0.5;
      } else {
        high = t, at_high = value, at_low *= 0.5;
      }
    }
    return 0.5 * (low + high);
  }

  /// f has no root in [0, r), given f(r) = 0.
  bool isFreeBefore(double r) const {
    const double s = 1 - r;
    const double c1 = b[0] * s + b[1] * r, c2 = c1 * s + (b[1] * s + b[2] * r) * r;
    const int sign = signOf(b[0]);
    return sign != 0 && signOf(c1) == sign && signOf(c2) == sign;
  }

  /// f has no root in (r, 1], given f(r) = 0.
  bool isFreeAfter(double r) const {
    const double s = 1 - r;
    const double c2 = b[2] * s + b[3] * r, c1 = (b[1] * s + b[2] * r) * s + c2 * r;
    const int sign = signOf(b[3]);
    return sign != 0 && signOf(c1) == sign && signOf(c2) == sign;
  }
};

bool isAtRest(const PairMotion& pair) {
  const double *start = &pair.x[0][0][0], *end = &pair.x[1][0][0];
  return std::equal(start, start + 12, end);
}

}  // namespace

ElementaryResult decideAtSimpleTime(PairKind kind, const PairMotion& pair, int toc_bits) {
  if (isAtRest(pair)) {
    const Meeting meeting = meetingAt(kind, pair, {0, 1});
    if (meeting == Meeting::UNKNOWN) return undecided(Tier::FIXED_INTEGER);
    return meeting == Meeting::TOUCHING ? contactInCell(0, toc_bits, Tier::FIXED_INTEGER)
                                        : noContact(Tier::FIXED_INTEGER);
  }
  const ElementaryResult along_axis = decideAlongAxis(kind, pair, toc_bits);
  if (along_axis.verdict != Verdict::UNDECIDED) return along_axis;
  const RoughCubic f(kind, pair);
  const bool at_start = f.signOf(f.b[0]) == 0;
  const double estimate = at_start ? 0 : f.firstRoot();
  const SimpleTime time = estimate >= 0 ? simpleTimeAt(estimate) : SimpleTime{0, 0};
  if (time.q == 0 || time.p > time.q) return undecided(Tier::FIXED_INTEGER);
  const double r = time.rounded();
  if (!at_start && !f.isFreeBefore(r)) return undecided(Tier::FIXED_INTEGER);
  const Meeting meeting = meetingAt(kind, pair, time);
  if (meeting == Meeting::TOUCHING) return contactAt(time, toc_bits);
  if (meeting == Meeting::APART && (r == 1 || f.isFreeAfter(r))) return noContact(Tier::FIXED_INTEGER);
  return undecided(Tier::FIXED_INTEGER);
}

ElementaryResult contactAtSimpleTime(PairKind kind, const PairMotion& pair, double low, double high, int toc_bits) {
  const SimpleTime time = simpleTimeAt(0.5 * (low + high));
  if (time.q == 0 || !(time.rounded() > low && time.rounded() < high)) return undecided(Tier::FIXED_INTEGER);
  const bool is_root = meetingAt(kind, pair, time, true) == Meeting::TOUCHING;
  return is_root ? contactAt(time, toc_bits) : undecided(Tier::FIXED_INTEGER);
}

}  // namespace exact
}  // namespace dccd
