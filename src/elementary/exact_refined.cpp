// Tier DOUBLE_DOUBLE as a procedure of its own: like the batched tier it looks at f's monotone pieces in order of time,
// but with signs of f in double-double and each root within 2^-52, so that the inside test there is as sharp as doubles
// allow. Settles nearly parallel edges, slivers and grazing features.
//
// Bounds, with e = 2^-53 and U, V, W as in exact_double_double.cpp. In plain double, f = F0 s^3 + F1 s^2 t + F2 s t^2 +
// F3 t^3 with F0, F3 within 54 e U V W and F1, F2 within 198 e U V W (6 and 18 products of three differences with at
// most 9 and 11 rounding factors). f' = c0 s^2 + 2 c1 s t + c2 t^2, c0 = F1 - 3 F0, c1 = F2 - F1, c2 = 3 F3 - F2:
// 396 from those, at most 36 U V W in magnitude, so at most 3 * 36 for their own rounding and 4 * 36 for the blossom:
// 648 e U V W; slopeError() has 656.
// Minors x_i y_j - x_j y_i at t within h of m: 16 e X Y computed, 8 h X Y for moving by h, 4 e X Y for sums of three;
// with h = 2^-52 = 2 e: 36 e X Y; 48 is used. Underflow is covered by the range that CoplanarityCubic demands.
#include <algorithm>
#include <cmath>

#include "dccd/tolerances.h"
#include "elementary/exact_double_double.h"
#include "elementary/exact_tiers.h"

namespace dccd {
namespace exact {
namespace {

using tolerance::BOUND_OF_BOUNDS, tolerance::ROOT_BRACKET;
constexpr double LEAST_ZONE = tolerance::EXTREMUM_ZONE;  ///< half the width around an extremum, see setExtrema()
constexpr int HALVINGS = 6;                              ///< of a piece on which f' is uncertain

enum class Outcome { FREE, CONTACT, UNCERTAIN };

double onGrid(double t) { return (t + 1) - 1; }  // multiples of 2^-52 in [0,1]

class RefinedDecision {
 public:
  RefinedDecision(PairKind kind, const PairMotion& pair) : vertex_face_(kind == PairKind::VERTEX_FACE), f_(kind, pair) {
    setCoefficients();
  }

  Outcome decide() {
    if (f_.signAt(0) == 0 || f_.signAt(1) == 0) return Outcome::UNCERTAIN;
    double ends[6] = {0, 0, 0, 0, 0, 1};
    setExtrema(ends);
    for (int i = 0; i < 5; ++i) {
      if (ends[i] == ends[i + 1]) continue;
      const Outcome outcome = decidePiece(ends[i], ends[i + 1], HALVINGS);
      if (outcome != Outcome::FREE) return outcome;
    }
    return Outcome::FREE;
  }

  std::int64_t cell52() const { return cell52_; }  ///< of the contact

 private:
  void setCoefficients() {
    double u[2][3], v[2][3], w[2][3];
    for (int time = 0; time < 2; ++time) {
      for (int k = 0; k < 3; ++k) {
        u[time][k] = f_.difference(time, 0, k);
        v[time][k] = f_.difference(time, 1, k);
        w[time][k] = f_.difference(time, 2, k);
      }
    }
    for (double& c : coefficient_) c = 0;
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      const double n0 = u[0][i] * v[0][j] - u[0][j] * v[0][i], n2 = u[1][i] * v[1][j] - u[1][j] * v[1][i];
      const double n1 = (u[0][i] * v[1][j] - u[0][j] * v[1][i]) + (u[1][i] * v[0][j] - u[1][j] * v[0][i]);
      coefficient_[0] += n0 * w[0][k];
      coefficient_[1] += n1 * w[0][k] + n0 * w[1][k];
      coefficient_[2] += n1 * w[1][k] + n2 * w[0][k];
      coefficient_[3] += n2 * w[1][k];
    }
    slope_[0] = coefficient_[1] - 3 * coefficient_[0];
    slope_[1] = coefficient_[2] - coefficient_[1];
    slope_[2] = 3 * coefficient_[3] - coefficient_[2];
  }

  /// Fills in ends[1..4]: a zone around each extremum in the step, outside which f' is certain (its slope at the
  /// extrema is 2 sqrt(discriminant)) and inside which f hardly moves. Any ends are safe.
  void setExtrema(double (&ends)[6]) const {
    const double a = slope_[0] - 2 * slope_[1] + slope_[2], b = slope_[1] - slope_[0], c = slope_[0];
    const double discriminant = b * b - a * c;
    const double root = std::sqrt(std::max(0.0, discriminant));
    const double q = -(b + std::copysign(root, b));
    const double zone = LEAST_ZONE + 2 * f_.slopeError() / root;
    const double places[2] = {q / a, c / q};
    for (int i = 0; i < 2; ++i) {
      const bool inside = discriminant > 0 && places[i] > 0 && places[i] < 1;  // false for NaN, too
      ends[1 + 2 * i] = inside ? onGrid(std::max(0.0, places[i] - zone)) : 0;
      ends[2 + 2 * i] = inside ? onGrid(std::min(1.0, places[i] + zone)) : 0;
    }
    std::sort(ends, ends + 6);
  }

  double slopeBlossom(double a, double b) const {
    return (slope_[0] * (1 - a) + slope_[1] * a) * (1 - b) + (slope_[1] * (1 - a) + slope_[2] * a) * b;
  }

  Outcome decidePiece(double a, double b, int halvings) {
    const auto [least, most] = std::minmax({slopeBlossom(a, a), slopeBlossom(a, b), slopeBlossom(b, b)});
    if (least > f_.slopeError() || most < -f_.slopeError()) {
      const int before = f_.signAt(a), after = f_.signAt(b);
      if (before == 0 || after == 0) return Outcome::UNCERTAIN;
      return before == after ? Outcome::FREE : decideRoot(a, b, before);
    }
    const double middle = onGrid(0.5 * (a + b));
    const double most_change = BOUND_OF_BOUNDS * (std::max(-least, most) + f_.slopeError()) * (b - a);
    if (std::fabs(f_.valueAt(middle)) > BOUND_OF_BOUNDS * (f_.error() + most_change)) return Outcome::FREE;
    if (halvings == 0 || middle == a || middle == b) return Outcome::UNCERTAIN;
    const Outcome outcome = decidePiece(a, middle, halvings - 1);
    return outcome == Outcome::FREE ? decidePiece(middle, b, halvings - 1) : outcome;
  }

  double roughValueAt(double t) const {
    const double s = 1 - t;
    const double low = (coefficient_[0] * s + coefficient_[1] * t) * s + coefficient_[2] * t * t;
    return low * s + coefficient_[3] * t * t * t;
  }

  /// The only root of f in [a, b], f having the certain sign `before` at a and the opposite one at b.
  Outcome decideRoot(double a, double b, int before) {
    double low = a, high = b;
    for (int i = 0; i < 52; ++i) {
      const double middle = 0.5 * (low + high);
      ((roughValueAt(middle) > 0) == (before > 0) ? low : high) = middle;
    }
    const double close_low = std::max(a, onGrid(low - ROOT_BRACKET)),
                 close_high = std::min(b, onGrid(high + ROOT_BRACKET));
    if (f_.signAt(close_low) == before) a = close_low;
    if (f_.signAt(close_high) == -before) b = close_high;
    cell52_ = a < b ? cellOfRoot(f_, a, b, 52) : -1;
    return cell52_ < 0 ? Outcome::UNCERTAIN : insideTest(std::ldexp(static_cast<double>(cell52_), -52));
  }

  /// The features at the root of f within 2^-52 of m. Seen along axis k, with n = u x v, B = w x v and C = u x w (VF)
  /// or w x u (EE), and n != 0, they touch when n, B, C, n-B-C (VF) or n, B, C, n-B, n-C (EE) have no two opposite
  /// signs; when two have, they do not touch, n = 0 or not (B = l n, C = m n with barycentric coordinates or edge
  /// parameters).
  Outcome insideTest(double m) const {
    double x[3][3];
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) x[i][k] = f_.difference(0, i, k) * (1 - m) + f_.difference(1, i, k) * m;
    }
    const double error_n = tolerance::INSIDE_MINOR * f_.size(0) * f_.size(1),
                 error_b = tolerance::INSIDE_MINOR * f_.size(1) * f_.size(2);
    const double error_c = tolerance::INSIDE_MINOR * f_.size(0) * f_.size(2);
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      const auto minor = [&](int p, int q) { return x[p][i] * x[q][j] - x[p][j] * x[q][i]; };
      const double n = minor(0, 1), b = minor(2, 1), c = vertex_face_ ? minor(0, 2) : minor(2, 0);
      int signs[5] = {certainSign(n, error_n), certainSign(b, error_b), certainSign(c, error_c)};
      if (vertex_face_) {
        signs[3] = signs[4] = certainSign((n - b) - c, error_n + error_b + error_c);
      } else {
        signs[3] = certainSign(n - b, error_n + error_b);
        signs[4] = certainSign(n - c, error_n + error_c);
      }
      const auto [least, most] = std::minmax({signs[0], signs[1], signs[2], signs[3], signs[4]});
      if (least < 0 && most > 0) return Outcome::FREE;
      if (least == most && least != 0) return Outcome::CONTACT;
    }
    return Outcome::UNCERTAIN;
  }

  static int certainSign(double value, double error) { return value > error ? 1 : value < -error ? -1 : 0; }

  bool vertex_face_;
  CoplanarityCubic f_;
  double coefficient_[4];
  double slope_[3];
  std::int64_t cell52_ = -1;
};

}  // namespace

ElementaryResult decideByDoubleDouble(PairKind kind, const PairMotion& pair, int toc_bits) {
  RefinedDecision decision(kind, pair);
  const Outcome outcome = decision.decide();
  if (outcome == Outcome::FREE) return noContact(Tier::DOUBLE_DOUBLE);
  if (outcome == Outcome::UNCERTAIN) return undecided(Tier::DOUBLE_DOUBLE);
  return contactInCell(decision.cell52() >> (52 - toc_bits), toc_bits, Tier::DOUBLE_DOUBLE);
}

}  // namespace exact
}  // namespace dccd
