#include "obstacle/axis_predicates.h"

#include <algorithm>
#include <cmath>

#include <gmpxx.h>

#include "dccd/tolerances.h"

namespace dccd {
namespace {

using Rational = mpq_class;  // doubles convert exactly

/// Products of differences above this and below its inverse neither overflow nor lose bits to underflow.
constexpr double TINY = tolerance::PREDICATE_SMALLEST, LARGE = tolerance::PREDICATE_LARGEST;
using tolerance::PREDICATE_LARGEST_M, tolerance::PREDICATE_SMALLEST_M;

/// Whether the rounded difference a - b has no error; a and b of moderate size.
bool differenceIsExact(double a, double b, double difference) {
  // Knuth's two-sum: the error of a rounded difference, exact.
  const double b_part = a - difference;
  const double a_part = difference + b_part;
  return (a - a_part) + (b_part - b) == 0;
}

/// The rounding error of the product a * b, exact (Dekker): needs no fused instruction.
double productError(double a, double b, double product) {
  constexpr double SPLIT = 134217729.0;  // 2^27 + 1
  const double ca = SPLIT * a, cb = SPLIT * b;
  const double ah = ca - (ca - a), bh = cb - (cb - b);
  const double al = a - ah, bl = b - bh;
  return ((ah * bh - product) + ah * bl + al * bh) + al * bl;
}

/// Products of two such differences neither overflow nor lose bits to underflow, nor do their errors.
bool isModerate(double difference) {
  return std::abs(difference) > PREDICATE_SMALLEST_M && std::abs(difference) < PREDICATE_LARGEST_M;
}

int signOf(double value) { return (value > 0) - (value < 0); }

int exactOrientation2d(double p0x, double p0y, double p1x, double p1y, double qx, double qy) {
  const Rational x0(p0x), y0(p0y);
  return sgn((Rational(p1x) - x0) * (Rational(qy) - y0) - (Rational(p1y) - y0) * (Rational(qx) - x0));
}

int exactOrientation3d(const double* a, const double* b, const double* c, const double* q) {
  const Rational ax(a[0]), ay(a[1]), az(a[2]);
  const Rational bx = Rational(b[0]) - ax, by = Rational(b[1]) - ay, bz = Rational(b[2]) - az;
  const Rational cx = Rational(c[0]) - ax, cy = Rational(c[1]) - ay, cz = Rational(c[2]) - az;
  const Rational qx = Rational(q[0]) - ax, qy = Rational(q[1]) - ay, qz = Rational(q[2]) - az;
  return sgn((by * cz - bz * cy) * qx + (bz * cx - bx * cz) * qy + (bx * cy - by * cx) * qz);
}

}  // namespace

int orientation2d(double p0x, double p0y, double p1x, double p1y, double qx, double qy) {
  const double ex = p1x - p0x, ey = p1y - p0y, dx = qx - p0x, dy = qy - p0y;
  const double left = ex * dy, right = ey * dx;
  const double determinant = left - right;
  // Each product carries three roundings (two differences, itself), the subtraction one: 4.01 * 2^-53 of the sum of
  // magnitudes. Only where nothing under- or overflowed.
  const double sum = std::abs(left) + std::abs(right);
  if (std::abs(determinant) > tolerance::ORIENTATION_2D * sum && sum > TINY && sum < LARGE) return signOf(determinant);
  // Exact differences (they are, between neighbours): compare the two products, then their rounding errors. A zero
  // factor is exact whatever the other one is.
  const double largest = std::max(std::max(std::abs(ex), std::abs(ey)), std::max(std::abs(dx), std::abs(dy)));
  const auto moderate = [](double product) { return product == 0 || std::abs(product) > TINY; };
  const bool zero_left = ex == 0 || dy == 0, zero_right = ey == 0 || dx == 0;
  if (largest < PREDICATE_LARGEST_M && (zero_left || moderate(left)) && (zero_right || moderate(right)) &&
      (left != 0 || zero_left) && (right != 0 || zero_right)) {
    if (zero_left && zero_right) return 0;
    if (differenceIsExact(p1x, p0x, ex) && differenceIsExact(p1y, p0y, ey) && differenceIsExact(qx, p0x, dx) &&
        differenceIsExact(qy, p0y, dy)) {
      if (left != right) return left > right ? 1 : -1;
      return signOf(productError(ex, dy, left) - productError(ey, dx, right));
    }
  }
  return exactOrientation2d(p0x, p0y, p1x, p1y, qx, qy);
}

int orientation3d(const double* a, const double* b, const double* c, const double* q) {
  const double bx = b[0] - a[0], by = b[1] - a[1], bz = b[2] - a[2];
  const double cx = c[0] - a[0], cy = c[1] - a[1], cz = c[2] - a[2];
  const double qx = q[0] - a[0], qy = q[1] - a[1], qz = q[2] - a[2];
  const double determinant = (by * cz - bz * cy) * qx + (bz * cx - bx * cz) * qy + (bx * cy - by * cx) * qz;
  // Per term: 2 x 3 roundings in the minor's products, one in its subtraction, the third difference, the product, two
  // sums: below 10 * 2^-53 of the term's magnitude.
  const double magnitude = (std::abs(by * cz) + std::abs(bz * cy)) * std::abs(qx) +
                           (std::abs(bz * cx) + std::abs(bx * cz)) * std::abs(qy) +
                           (std::abs(bx * cy) + std::abs(by * cx)) * std::abs(qz);
  // Factors below LARGE keep what an underflowing minor lost below the slack.
  const double largest = std::max(std::abs(qx), std::max(std::abs(qy), std::abs(qz)));
  if (std::abs(determinant) > tolerance::ORIENTATION_3D * magnitude && magnitude > TINY && magnitude < LARGE &&
      largest < LARGE) {
    return signOf(determinant);
  }
  return exactOrientation3d(a, b, c, q);
}

CrossingTime::CrossingTime(double plane_, double from_, double to_) : plane(plane_), from(from_), to(to_) {
  const double numerator = plane - from, denominator = to - from;
  approximate = numerator / denominator;
  // A rounded difference of doubles is never inexact by underflow; overflow and tiny quotients are left to rationals.
  certain = std::abs(denominator) < LARGE && (approximate > TINY || numerator == 0) && approximate < LARGE;
}

int compare(const CrossingTime& a, const CrossingTime& b) {
  if (a.certain && b.certain) {
    const double difference = a.approximate - b.approximate;
    if (std::abs(difference) > tolerance::CROSSING_TIME * std::max(a.approximate, b.approximate))
      return signOf(difference);
  }
  // Ties are common where a mesh and a map share a grid: settled in double where nothing was rounded.
  const double na_rounded = a.plane - a.from, da_rounded = a.to - a.from;
  const double nb_rounded = b.plane - b.from, db_rounded = b.to - b.from;
  if (na_rounded == 0 && nb_rounded == 0) return 0;
  if (a.certain && b.certain && isModerate(na_rounded) && isModerate(nb_rounded) && isModerate(da_rounded) &&
      isModerate(db_rounded) && differenceIsExact(a.plane, a.from, na_rounded) &&
      differenceIsExact(a.to, a.from, da_rounded) && differenceIsExact(b.plane, b.from, nb_rounded) &&
      differenceIsExact(b.to, b.from, db_rounded)) {
    const double left = std::abs(na_rounded * db_rounded), right = std::abs(nb_rounded * da_rounded);
    if (left != right) return left > right ? 1 : -1;
    return signOf(productError(std::abs(na_rounded), std::abs(db_rounded), left) -
                  productError(std::abs(nb_rounded), std::abs(da_rounded), right));
  }
  const Rational na = Rational(a.plane) - Rational(a.from), da = Rational(a.to) - Rational(a.from);
  const Rational nb = Rational(b.plane) - Rational(b.from), db = Rational(b.to) - Rational(b.from);
  return sgn(na * db - nb * da) * sgn(da) * sgn(db);
}

std::int64_t timeCell(const CrossingTime& time, int bits) {
  const double scale = std::ldexp(1.0, bits);
  std::int64_t cell = 0;
  if (time.certain) {
    const double scaled = time.approximate * scale, error = scaled * tolerance::CROSSING_TIME;
    cell = static_cast<std::int64_t>(scaled);
    // cell + 1 and the sums are exact or rounded to within the slack of tolerance::CROSSING_TIME.
    if (scaled - error >= static_cast<double>(cell) && scaled + error < static_cast<double>(cell + 1)) return cell;
  } else {
    // Differences that may overflow, or a tiny quotient: quarters cannot overflow, and lose nothing that matters here.
    cell = static_cast<std::int64_t>((time.plane / 4 - time.from / 4) / (time.to / 4 - time.from / 4) * scale);
  }
  // A guess is a few cells off at most. Where the differences are exact, so is this comparison of numerator * 2^bits
  // with k * denominator; that settles times on the grid, such as one half.
  const double n = time.plane - time.from, d = time.to - time.from;
  if (time.certain && std::abs(n) > TINY && std::abs(d) < PREDICATE_LARGEST_M &&
      differenceIsExact(time.plane, time.from, n) && differenceIsExact(time.to, time.from, d)) {
    const double target = std::abs(n) * scale, unit = std::abs(d);
    const auto reached = [target, unit](std::int64_t k) {
      const double product = static_cast<double>(k) * unit;
      return product != target ? product < target : productError(static_cast<double>(k), unit, product) <= 0;
    };
    while (!reached(cell)) --cell;
    while (reached(cell + 1)) ++cell;
    return cell;
  }
  // cell <= time * 2^bits  <=>  numerator * 2^bits - cell * denominator >= 0 for a positive denominator.
  const Rational denominator = Rational(time.to) - Rational(time.from);
  const Rational numerator = (Rational(time.plane) - Rational(time.from)) * Rational(scale);
  const auto reached = [&](std::int64_t k) {
    return sgn(numerator - Rational(static_cast<double>(k)) * denominator) * sgn(denominator) >= 0;
  };
  while (!reached(cell)) --cell;
  while (reached(cell + 1)) ++cell;
  return cell;
}

}  // namespace dccd
