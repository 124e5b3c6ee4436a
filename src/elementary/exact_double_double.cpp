// Bounds. e = 2^-53, every operation correctly rounded; U, V, W: largest |rounded difference component| of u, v, w at
// t = 0 and 1, between 2^-300 and 2^300. "p + q exactly" is an error-free transform (two-sum, Dekker's product).
//   A difference D = h + l exactly, |l| <= e |h|. With t and s = 1-t exact, x(t) = s D0 + t D1 is kept as a pair:
//     s h0 + t h1 exactly into one leading and three trailing terms, which like s l0, t l1 sum to at most 3 e U;
//     rounding two products and four sums of such terms: at most 8 e^2 U. |x| <= U (1 + 3 e).
//   A product of pairs within bounds X, Y: leading parts exactly, cross terms rounded, x.lo y.lo dropped: at most
//     8 e^2 X Y, its trailing part at most 3 e X Y.
//   n_k, a difference of two products: 2 * 8 + (6 + 8) for adding the trailing parts, + 2 * 2 * 8 from the errors of
//     x and y: at most 62 e^2 U V; |n_k| <= 2 U V.
//   f, a sum of three products: 3 * 16 + (12 + 18 + 10 + 28) for adding, 3 * 62 + 3 * 2 * 8 from the errors of n_k and
//     w: at most 350 e^2 U V W. 360 covers terms of higher order, the bound's own rounding, and underflow: fewer than
//     200 operations that each err by at most 2^-1074, times at most two of U, V, W, against 5 * 2^-106 U V W.
//   The last sum to one double rounds once more, which changes no sign.
// In plain double with x = fl(fl(s h0) + fl(t h1)): x errs by at most 4 e U; n_k by 2 * (2*4 + 1) + 2 = 20 e U V; f by
//   3 * (20 + 2*4 + 2) + (4 + 6) = 100 e U V W; 102 is used.
// Slope: f' = det(u', v, w) + det(u, v', w) + det(u, v, w'), at most 3 * 6 * 2 U V W; three factors with at most 3
//   roundings each, 2 for products, 5 for sums: at most 16 * 36 = 576 e U V W; 656 is used, for what exact_refined.cpp
//   adds.
// Tangent: |f(x + h) - f(x) - f'(x) h| <= h^2 max|f''| / 2 on [0,1]; f'' is twice a sum of three determinants with two
//   changes each, at most 2 * 3 * 6 * 4 U V W: 72 h^2 U V W.
#include "elementary/exact_double_double.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dccd/tolerances.h"
#include "elementary/exact_expansion.h"

namespace dccd {
namespace exact {
namespace {

/// A factor of products: the pair and the halves of its leading part.
struct Factor {
  DoubleDouble value;
  Halves halves;
  explicit Factor(const DoubleDouble& x) : value(x), halves(x.hi) {}
};

DoubleDouble product(const Factor& a, const Factor& b) {
  const DoubleDouble p = twoProduct(a.value.hi, a.halves, b.value.hi, b.halves);
  return {p.hi, p.lo + (a.value.hi * b.value.lo + a.value.lo * b.value.hi)};
}

/// s D0 + t D1, the leading and the trailing part not overlapping.
Factor interpolate(const DoubleDouble& d0, const DoubleDouble& d1, double s, const Halves& s_halves, double t,
                   const Halves& t_halves) {
  const DoubleDouble p0 = twoProduct(d0.hi, Halves(d0.hi), s, s_halves);
  const DoubleDouble p1 = twoProduct(d1.hi, Halves(d1.hi), t, t_halves);
  const DoubleDouble sum = twoSum(p0.hi, p1.hi);
  return Factor(twoSum(sum.hi, ((p0.lo + p1.lo) + (d0.lo * s + d1.lo * t)) + sum.lo));
}

/// The exponent of the lowest bit that is set; of 0 one that is never the lowest.
int lowestBitOf(double x) {
  int exponent;
  const auto bits = static_cast<std::int64_t>(std::ldexp(std::frexp(x, &exponent), 53));
  return bits == 0 ? std::numeric_limits<int>::max()
                   : exponent - 53 + __builtin_ctzll(static_cast<std::uint64_t>(bits));
}

/// a b - c d.
Factor minor(const Factor& a, const Factor& b, const Factor& c, const Factor& d) {
  const DoubleDouble p = product(a, b), q = product(c, d);
  const DoubleDouble difference = twoSum(p.hi, -q.hi);
  return Factor(twoSum(difference.hi, (p.lo - q.lo) + difference.lo));
}

}  // namespace

CoplanarityCubic::CoplanarityCubic(PairKind kind, const PairMotion& pair) {
  static constexpr int ENDS[2][3][2] = {{{1, 2}, {1, 3}, {1, 0}}, {{0, 1}, {2, 3}, {0, 2}}};  // from, to
  const auto& ends = ENDS[kind == PairKind::VERTEX_FACE ? 0 : 1];
  constexpr double SMALLEST = tolerance::CUBIC_SMALLEST_M3, LARGEST = tolerance::CUBIC_LARGEST_M3;
  double volume = 1;
  bool in_range = true;
  for (int i = 0; i < 3; ++i) {
    double& size = size_[i];
    size = 0;
    for (int time = 0; time < 2; ++time) {
      for (int k = 0; k < 3; ++k) {
        const DoubleDouble d = twoSum(pair.x[time][ends[i][1]][k], -pair.x[time][ends[i][0]][k]);
        difference_[time][i][k] = d;
        size = std::max(size, std::fabs(d.hi));
      }
    }
    in_range = in_range && size >= SMALLEST && size <= LARGEST;
    volume *= size;
  }
  constexpr double INFINITE = std::numeric_limits<double>::infinity();
  error_ = in_range ? tolerance::CUBIC_VALUE_PAIRS * volume : INFINITE;
  slope_error_ = tolerance::CUBIC_SLOPE * volume;
  most_curvature_ = 73 * volume;
  rough_error_ = in_range ? tolerance::CUBIC_VALUE * volume : INFINITE;
}

double CoplanarityCubic::roughValueAt(double t) const {
  double x[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) x[i][k] = difference_[0][i][k].hi * (1 - t) + difference_[1][i][k].hi * t;
  }
  const auto term = [&](int k, int i, int j) { return (x[0][i] * x[1][j] - x[0][j] * x[1][i]) * x[2][k]; };
  return term(0, 1, 2) + term(1, 2, 0) + term(2, 0, 1);
}

double CoplanarityCubic::valueAt(double t) const {
  const double s = 1 - t;
  const Halves s_halves(s), t_halves(t);
  const auto at = [&](int i, int k) {
    return interpolate(difference_[0][i][k], difference_[1][i][k], s, s_halves, t, t_halves);
  };
  const Factor ux = at(0, 0), uy = at(0, 1), uz = at(0, 2), vx = at(1, 0), vy = at(1, 1), vz = at(1, 2);
  const DoubleDouble x = product(minor(uy, vz, uz, vy), at(2, 0));
  const DoubleDouble y = product(minor(uz, vx, ux, vz), at(2, 1));
  const DoubleDouble z = product(minor(ux, vy, uy, vx), at(2, 2));
  const DoubleDouble xy = twoSum(x.hi, y.hi), xyz = twoSum(xy.hi, z.hi);
  return xyz.hi + (((x.lo + y.lo) + z.lo) + (xy.lo + xyz.lo));
}

int CoplanarityCubic::signAt(double t) const {
  const double rough = roughValueAt(t);
  if (std::fabs(rough) > rough_error_) return rough > 0 ? 1 : -1;
  return signOf(valueAt(t), t);
}

/// Each axis is multiplied by a power of two of its own, which multiplies f, so that its largest difference is about
/// 2^LARGEST and f below 2^(3 LARGEST + 10). All terms are multiples of the product of the lowest bits on the three
/// axes, t and 1-t being multiples of 2^-52: none underflows where that is representable, and where those of one axis
/// or two are.
int CoplanarityCubic::exactSignAt(double t) const {
  constexpr int LARGEST = 300, LOWEST = -1074;
  if (!std::isfinite(error_)) return 0;
  double scale[3];
  int lowest = 0;
  for (int k = 0; k < 3; ++k) {
    double largest = 0;
    int lowest_bit = LARGEST;
    for (const auto& vectors : difference_) {
      for (const auto& vector : vectors) {
        largest = std::max(largest, std::fabs(vector[k].hi));
        for (const double x : {vector[k].hi, vector[k].lo}) lowest_bit = std::min(lowest_bit, lowestBitOf(x));
      }
    }
    if (largest == 0) return 0;
    const int up = std::min(LARGEST - std::ilogb(largest), 1000);  // whose power is finite
    scale[k] = std::ldexp(1.0, up);
    lowest += std::min(0, lowest_bit + up - 52);
  }
  if (lowest < LOWEST) return 0;
  const double s = 1 - t;
  Expansion x[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      const auto scaled = [&](const DoubleDouble& d) { return Expansion({d.hi * scale[k], d.lo * scale[k]}); };
      x[i][k] = scaled(difference_[0][i][k]) * s + scaled(difference_[1][i][k]) * t;
    }
  }
  const auto term = [&](int k, int i, int j) { return (x[0][i] * x[1][j] - x[0][j] * x[1][i]) * x[2][k]; };
  const Expansion f = term(0, 1, 2) + term(1, 2, 0) + term(2, 0, 1);
  return f.isLost() ? 0 : f.sign();
}

double CoplanarityCubic::slopeAt(double t) const {
  double x[3][3], change[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      x[i][k] = difference(0, i, k) * (1 - t) + difference(1, i, k) * t;
      change[i][k] = difference(1, i, k) - difference(0, i, k);
    }
  }
  double slope = 0;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    const double n = x[0][i] * x[1][j] - x[0][j] * x[1][i];
    const double n_change =
        (change[0][i] * x[1][j] - change[0][j] * x[1][i]) + (x[0][i] * change[1][j] - x[0][j] * change[1][i]);
    slope += n_change * x[2][k] + n * change[2][k];
  }
  return slope;
}

namespace {

/// A value and a slope of f at x, and what is known of f's sign elsewhere from them.
struct Tangent {
  double x, value, slope;

  /// Whether f has the sign given at t.
  bool provesSign(const CoplanarityCubic& f, double t, int sign) const {
    const double h = t - x;  // exact where it matters: both are multiples of 2^-52 in [0,1]
    const double at_t = value + slope * h;
    const double change = std::fabs(slope * h);
    const double error = f.error() + tolerance::TANGENT_VALUE * (std::fabs(value) + change) +
                         std::fabs(h) * (f.slopeError() + f.mostCurvature() * std::fabs(h));
    return sign * at_t > tolerance::BOUND_OF_BOUNDS * error;
  }
};

}  // namespace

std::int64_t cellOfRoot(const CoplanarityCubic& f, double lo, double hi, int toc_bits) {
  constexpr int MOST_STEPS = 16;       // Newton's; from the batched tier's brackets one or two suffice
  constexpr int MOST_EXACT_SIGNS = 2;  // later ones would take longer than integers do
  constexpr double GRID = tolerance::TIME_GRID;
  const double cells = std::ldexp(1.0, toc_bits), width = 1 / cells;
  auto low = static_cast<std::int64_t>(lo * cells);  // exact, like all products with cells and width
  auto high = static_cast<std::int64_t>(std::ceil(hi * cells));
  if (high - low == 1) return low;
  const int before = f.signAt(lo);
  if (before == 0) return -1;
  Tangent tangent;
  int exact_signs = 0;
  tangent.x = high - low == 2 ? static_cast<double>(low + 1) * width : lo + std::floor(0.5 * (hi - lo) / GRID) * GRID;
  for (int step = 0; step < MOST_STEPS; ++step) {
    tangent.value = f.valueAt(tangent.x);
    if (!(std::fabs(tangent.value) > f.error()) && ++exact_signs > MOST_EXACT_SIGNS) return -1;
    const int sign = f.signOf(tangent.value, tangent.x);
    if (sign == 0) return -1;
    if (sign == before) {
      lo = tangent.x;
      low = std::max(low, static_cast<std::int64_t>(lo * cells));
    } else {
      hi = tangent.x;
      high = std::min(high, static_cast<std::int64_t>(std::ceil(hi * cells)));
    }
    if (high - low == 1) return low;
    tangent.slope = f.slopeAt(tangent.x);
    double reach = -tangent.value / tangent.slope;  // added to x only in cells: t has no bits to spare
    if (!(tangent.x + reach >= lo && tangent.x + reach <= hi)) reach = 0.5 * (lo + hi) - tangent.x;
    const double place = tangent.x * cells, cell_of_x = std::floor(place);
    const auto offset = static_cast<std::int64_t>(std::floor((place - cell_of_x) + reach * cells));
    const std::int64_t k = std::min(std::max(static_cast<std::int64_t>(cell_of_x) + offset, low), high - 1);
    const bool not_before = k == low || tangent.provesSign(f, static_cast<double>(k) * width, before);
    const bool before_end = k + 1 == high || tangent.provesSign(f, static_cast<double>(k + 1) * width, -before);
    if (not_before && before_end) return k;
    tangent.x = std::min(std::max(tangent.x + std::floor(reach / GRID) * GRID, lo + GRID), hi - GRID);
  }
  return -1;
}

}  // namespace exact
}  // namespace dccd
