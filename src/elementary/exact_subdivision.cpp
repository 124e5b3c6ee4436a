// Tier BERNSTEIN: the step is halved until the features' projections on some axis stay apart during every piece, or a
// piece gets too short. It settles what the batched tier cannot: pairs whose polynomials all vanish, or nearly so, at
// one time although the features are far from each other then (parallel edges one behind the other, say).
//
// A linearly moving point's projection is linear, so the Bernstein coefficients over a piece are its values at the
// ends: strictly apart at both ends with the same order means apart during the piece. Ends are multiples of 2^-DEPTH,
// computed as fl(fl(x0 (1-t)) + fl(x1 t)) with 1-t exact: error at most (3 + 2^-50) 2^-53 max(|x0|, |x1|), and
// 2^-1074 where a product underflows; the margin below is larger than two such errors and its own rounding.
#include <algorithm>
#include <cmath>

#include "dccd/tolerances.h"
#include "elementary/exact_tiers.h"

namespace dccd {
namespace exact {
namespace {

constexpr int DEPTH = 7;  ///< the shortest piece is 2^-DEPTH of the step; halving on would cost more than integers do

/// The ranges of both features' projections at one time, on the three axes.
struct Ranges {
  double low[2][3], high[2][3];
};

Ranges rangesAt(const PairMotion& pair, int first_points, double t) {
  Ranges ranges;
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 4; ++i) {
      const double x = pair.x[0][i][k] * (1 - t) + pair.x[1][i][k] * t;
      const int feature = i < first_points ? 0 : 1;
      const bool starts = i == 0 || i == first_points;
      ranges.low[feature][k] = starts ? x : std::min(ranges.low[feature][k], x);
      ranges.high[feature][k] = starts ? x : std::max(ranges.high[feature][k], x);
    }
  }
  return ranges;
}

class Separation {
 public:
  Separation(PairKind kind, const PairMotion& pair) : pair_(pair), first_points_(factsOf(kind).vertices[0]) {
    for (int k = 0; k < 3; ++k) {
      double largest = 0;
      for (const auto& time : pair.x) {
        for (const auto& point : time) largest = std::max(largest, std::fabs(point[k]));
      }
      margin_[k] = tolerance::SUBDIVISION * largest + tolerance::SUBDIVISION_UNDERFLOW;
    }
  }

  bool throughout() const {
    return during(0, 1, rangesAt(pair_, first_points_, 0), rangesAt(pair_, first_points_, 1), DEPTH);
  }

 private:
  bool during(double from, double to, const Ranges& a, const Ranges& b, int depth) const {
    for (int k = 0; k < 3; ++k) {
      const double margin = margin_[k];
      if (a.low[0][k] - margin > a.high[1][k] && b.low[0][k] - margin > b.high[1][k]) return true;
      if (a.low[1][k] - margin > a.high[0][k] && b.low[1][k] - margin > b.high[0][k]) return true;
    }
    if (depth == 0) return false;
    const double middle = 0.5 * (from + to);
    const Ranges m = rangesAt(pair_, first_points_, middle);
    return during(from, middle, a, m, depth - 1) && during(middle, to, m, b, depth - 1);
  }

  const PairMotion& pair_;
  int first_points_;
  double margin_[3];
};

}  // namespace

ElementaryResult decideBySubdivision(PairKind kind, const PairMotion& pair) {
  return Separation(kind, pair).throughout() ? noContact(Tier::BERNSTEIN) : undecided(Tier::BERNSTEIN);
}

}  // namespace exact
}  // namespace dccd
