// Simple times: integers of one or two words for what people make by hand. Features at rest, surfaces that meet at
// t = 0, 1/2 or 1/3, faces that land exactly on each other: there f is exactly 0 where no floating-point bound can say
// so, and all that has to be known are signs at one rational time p/q with a small q.
//
// Coordinates. Each axis is multiplied by a power of two of its own, which changes no sign that is asked for: the terms
// of f have one factor of each axis, a minor's one of each of its two, and whether a point of a line is between two
// others each axis tells alone. A position at p/q, times q, is x0 (q - p) + x1 p. With 64 N bits and coordinates below
// 2^(64 N - 3 - log2 q) in magnitude these are below 2^(64 N - 3), differences below 2^(64 N - 2), minors of two words
// times two below 2^(128 N - 3), and f, a sum of three, below 2^(192 N - 3).
//
// Motion along one axis. Where the other two coordinates of all four points rest, what is seen along that axis rests,
// and f is linear in t, since only one factor of each of its terms moves. So one look tells whether the features can
// meet, and two values of f when. Edges that are seen as one line meet, if not at t = 0, with an end first: how high an
// end is above the other edge is linear in t, too.
//
// Which time. The estimate of the first root is plain double and proves nothing. f(r) = 0 is proved by the integers;
// that f has no root before r by its Bernstein coefficients over [0, r], of which the last is 0 and the others are
// certainly of one sign; that it has none after r by those over [r, 1]. Their errors are those of exact_batch_bounds.h,
// and |r| 2^-53 for the rounded quotient p/q, at which they are taken: de Casteljau's three levels move by at most 3 *
// 2 * 2^-53 max |fi|; 8 * 2^-53 max |fi|, at most 48 * 2^-53 U V W, is used, so that the sum is (106 + 48) 2^-53 U V W.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "dccd/tolerances.h"
#include "elementary/exact_short_integer.h"
#include "elementary/exact_tiers.h"

namespace dccd {
namespace exact {
namespace {

constexpr std::int64_t LARGEST_DENOMINATOR = 1024;
constexpr double SAME_TIME = 0x1p-30;  ///< an estimate this close to p/q is tried as p/q; others differ by 2^-20

struct SimpleTime {
  std::int64_t p = 0, q = 1;
  double rounded() const { return static_cast<double>(p) / static_cast<double>(q); }
};

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

/// The pair at one time, as differences: u, v, w as everywhere (VF: b-a, c-a, p-a; EE: b-a, d-c, c-a).
template <int N>
class Frozen {
  using Number = ShortInteger<N>;
  using Minor = ShortInteger<2 * N>;

 public:
  /// False where the coordinates are no integers of N words on any common scale.
  bool set(PairKind kind, const PairMotion& pair, const SimpleTime& time) {
    vertex_face_ = kind == PairKind::VERTEX_FACE;
    const int room = 64 * N - 3 - std::ilogb(static_cast<double>(2 * time.q - 1));
    for (int k = 0; k < 3; ++k) {
      if (!setAxis(pair, k, time, room)) return false;
    }
    const auto between = [&](int i, int from, int to) {
      for (int k = 0; k < 3; ++k) difference_[i][k] = x_[to][k] - x_[from][k];
    };
    between(0, vertex_face_ ? 1 : 0, vertex_face_ ? 2 : 1);
    between(1, vertex_face_ ? 1 : 2, 3);
    between(2, vertex_face_ ? 1 : 0, vertex_face_ ? 0 : 2);
    for (int k = 0; k < 3; ++k) normal_[k] = minor(0, 1, k);
    return true;
  }

  /// f, scaled.
  ShortInteger<3 * N> volume() const {
    const auto& w = difference_[2];
    return (normal_[0] * w[0] + normal_[1] * w[1]) + normal_[2] * w[2];
  }

  int normalSign(int k) const { return normal_[k].sign(); }

  /// Whether the features meet as they are seen along axis k, along which the normal is not 0.
  bool meetAlong(int k) const {
    const int sign = normal_[k].sign();
    const Minor b = minor(2, 1, k), c = vertex_face_ ? minor(0, 2, k) : minor(2, 0, k);
    if (b.sign() == -sign || c.sign() == -sign) return false;
    if (vertex_face_) return ((normal_[k] - b) - c).sign() != -sign;
    return (normal_[k] - b).sign() != -sign && (normal_[k] - c).sign() != -sign;
  }

  /// Edges: whether they are seen along axis k as parts of two parallel lines.
  bool areBesideAlong(int k) const { return minor(2, 1, k).sign() != 0 || minor(2, 0, k).sign() != 0; }

  /// Whether points a and b are seen as one along axis k.
  bool coincideAlong(int k, int a, int b) const {
    const int i = k == 2 ? 0 : k + 1, j = k == 0 ? 2 : k - 1;
    return (x_[a][i] - x_[b][i]).sign() == 0 && (x_[a][j] - x_[b][j]).sign() == 0;
  }

  /// Whether p is seen along axis k between a and b, or as one of them, given that all are seen on one line.
  bool isBetweenAlong(int k, int p, int a, int b) const {
    for (int i = 0; i < 3; ++i) {
      if (i != k && (x_[p][i] - x_[a][i]).sign() * (x_[p][i] - x_[b][i]).sign() > 0) return false;
    }
    return true;
  }

  /// How high p is above the line ab along axis k, times the positive or negative extent of ab along axis i.
  Minor heightAbove(int k, int i, int p, int a, int b) const {
    return (x_[p][k] - x_[a][k]) * (x_[b][i] - x_[a][i]) - (x_[b][k] - x_[a][k]) * (x_[p][i] - x_[a][i]);
  }

  /// An axis other than k along which a and b differ.
  int extentBeside(int k, int a, int b) const {
    const int i = k == 2 ? 0 : k + 1, j = k == 0 ? 2 : k - 1;
    return (x_[a][i] - x_[b][i]).sign() != 0 ? i : j;
  }

  /// Whether the features meet, being coplanar.
  bool meet() const {
    for (int k = 0; k < 3; ++k) {
      if (normal_[k].sign() != 0) return meetAlong(k);
    }
    if (vertex_face_) return isOnEdge(0, 1, 2) || isOnEdge(0, 2, 3) || isOnEdge(0, 3, 1);
    return isOnEdge(0, 2, 3) || isOnEdge(1, 2, 3) || isOnEdge(2, 0, 1) || isOnEdge(3, 0, 1);
  }

 private:
  bool setAxis(const PairMotion& pair, int k, const SimpleTime& time, int room) {
    double largest = 0;
    for (const auto& points : pair.x) {
      for (const auto& point : points) largest = std::max(largest, std::fabs(point[k]));
    }
    const int exponent = largest > 0 ? room - 1 - std::ilogb(largest) : 0;
    if (exponent > 1000 || exponent < -1000) return false;
    const double scale = std::ldexp(1.0, exponent);
    for (int i = 0; i < 4; ++i) {
      const double start = pair.x[0][i][k] * scale, end = pair.x[1][i][k] * scale;
      // What vanishes in the product is no integer, and neither is what has a fraction.
      if (start != std::floor(start) || end != std::floor(end)) return false;
      if ((start == 0) != (pair.x[0][i][k] == 0) || (end == 0) != (pair.x[1][i][k] == 0)) return false;
      x_[i][k] = time.p == 0 ? shortInteger<N>(start)
                             : shortInteger<N>(start) * (time.q - time.p) + shortInteger<N>(end) * time.p;
    }
    return true;
  }

  static Minor minorOf(const Number (&x)[3], const Number (&y)[3], int k) {
    const int i = k == 2 ? 0 : k + 1, j = k == 0 ? 2 : k - 1;
    return x[i] * y[j] - x[j] * y[i];
  }
  Minor minor(int x, int y, int k) const { return minorOf(difference_[x], difference_[y], k); }

  /// Point p on the closed segment ab, which may have zero length.
  bool isOnEdge(int p, int a, int b) const {
    Number ap[3], ab[3];
    for (int k = 0; k < 3; ++k) {
      const Number bp = x_[p][k] - x_[b][k];
      ap[k] = x_[p][k] - x_[a][k];
      ab[k] = x_[b][k] - x_[a][k];
      if (ap[k].sign() * bp.sign() > 0) return false;
    }
    return minorOf(ap, ab, 0).sign() == 0 && minorOf(ap, ab, 1).sign() == 0 && minorOf(ap, ab, 2).sign() == 0;
  }

  bool vertex_face_ = true;
  Number x_[4][3], difference_[3][3];
  Minor normal_[3];
};

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

constexpr std::int64_t NEVER = -1, NOT_KNOWN = -2;

/// The cell of the root of a linear function with these values at t = 0 and t = 1; NEVER without a sign change.
template <int LIMBS>
std::int64_t cellOfLinear(const ShortInteger<LIMBS>& at_0, const ShortInteger<LIMBS>& at_1, int toc_bits) {
  const int sign = at_0.sign();
  if (sign == 0) return 0;
  if (at_1.sign() == sign) return NEVER;
  const std::int64_t cells = std::int64_t{1} << toc_bits;
  if (at_1.sign() == 0) return cells;
  const auto sign_at = [&](std::int64_t k) {
    const ShortInteger<1> before = {{static_cast<std::uint64_t>(cells - k)}}, after = {{static_cast<std::uint64_t>(k)}};
    return (at_0 * before + at_1 * after).sign();
  };
  const double share = at_0.approximate() / (at_0.approximate() - at_1.approximate());
  auto k = static_cast<std::int64_t>(share * static_cast<double>(cells));
  for (int i = 0; i < 8; ++i) {
    if (k < 0 || k >= cells) return NOT_KNOWN;
    if (sign_at(k) == -sign) {
      --k;
    } else if (sign_at(k + 1) != -sign) {
      ++k;
    } else {
      return k;
    }
  }
  return NOT_KNOWN;
}

/// The axis along which alone the points move; -1 where there is none.
int axisOfMotion(const PairMotion& pair) {
  int axis = -1;
  for (int k = 0; k < 3; ++k) {
    bool moves = false;
    for (int i = 0; i < 4; ++i) moves |= pair.x[0][i][k] != pair.x[1][i][k];
    if (!moves) continue;
    if (axis >= 0) return -1;
    axis = k;
  }
  return axis;
}

/// Edges that are seen as parts of one line along axis k, and do not meet at t = 0.
template <int N>
std::int64_t cellOnOneLine(const Frozen<N>& start, const Frozen<N>& end, int k, int toc_bits) {
  static constexpr int ENDS[4][3] = {{0, 2, 3}, {1, 2, 3}, {2, 0, 1}, {3, 0, 1}};
  if (start.coincideAlong(k, 0, 1) || start.coincideAlong(k, 2, 3)) return NOT_KNOWN;
  std::int64_t first = NEVER;
  for (const auto& points : ENDS) {
    const int p = points[0], a = points[1], b = points[2], i = start.extentBeside(k, a, b);
    if (!start.isBetweenAlong(k, p, a, b)) continue;
    const std::int64_t cell = cellOfLinear(start.heightAbove(k, i, p, a, b), end.heightAbove(k, i, p, a, b), toc_bits);
    if (cell == NOT_KNOWN) return NOT_KNOWN;
    if (cell != NEVER && (first == NEVER || cell < first)) first = cell;
  }
  return first;
}

/// Cell of the contact of a pair that moves along axis k alone; NEVER for none, NOT_KNOWN where this cannot tell.
template <int N>
std::int64_t cellAlongAxis(PairKind kind, const PairMotion& pair, int k, int toc_bits) {
  Frozen<N> start, end;
  if (!start.set(kind, pair, {0, 1}) || !end.set(kind, pair, {1, 1})) return NOT_KNOWN;
  if (start.normalSign(k) != 0) {
    return start.meetAlong(k) ? cellOfLinear(start.volume(), end.volume(), toc_bits) : NEVER;
  }
  if (kind == PairKind::VERTEX_FACE) return NOT_KNOWN;
  if (start.areBesideAlong(k)) return NEVER;
  if (start.volume().sign() == 0 && start.meet()) return 0;
  return cellOnOneLine(start, end, k, toc_bits);
}

ElementaryResult decideAlongAxis(PairKind kind, const PairMotion& pair, int k, int toc_bits) {
  std::int64_t cell = cellAlongAxis<1>(kind, pair, k, toc_bits);
  if (cell == NOT_KNOWN) cell = cellAlongAxis<2>(kind, pair, k, toc_bits);
  if (cell == NOT_KNOWN) return undecided(Tier::FIXED_INTEGER);
  return cell == NEVER ? noContact(Tier::FIXED_INTEGER) : contactInCell(cell, toc_bits, Tier::FIXED_INTEGER);
}

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
  const int axis = axisOfMotion(pair);
  if (axis >= 0) {
    const ElementaryResult result = decideAlongAxis(kind, pair, axis, toc_bits);
    if (result.verdict != Verdict::UNDECIDED) return result;
  }
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
