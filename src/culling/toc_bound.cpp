#include "culling/toc_bound.h"

#include <algorithm>
#include <cmath>

#include "dccd/tolerances.h"
#include "simd/directions.h"

namespace dccd {
namespace {

using tolerance::SQRT2_UP;

// First time at which the point u -> (1-t) u0 + t u1 is not above l -> (1-t) l0 + t l1 + margin, rounded down; 2 if
// never.
double meets(double u0, double u1, double l0, double l1, double margin) {
  // The projections' sums are rounded, by at most HALF_ULP of their size each. A difference of nearly equal numbers
  // is not; but where a margin is taken from it, its rounding counts, too: by at most HALF_ULP of twice the size.
  const double factor = (margin == 0 ? 1 : 2) * tolerance::TOC_BOUND_GAP;
  const double slack0 = factor * std::max(std::abs(u0), std::abs(l0));
  const double slack1 = factor * std::max(std::abs(u1), std::abs(l1));
  // Strict comparison of the rounded sums is exact evidence of order; the slack only enters the time.
  if (!(u0 - margin > l0)) return 0;
  const double gap0 = (u0 - l0) - margin - slack0, gap1_low = (u1 - l1) - margin - slack1;
  if (margin == 0 ? u1 > l1 : gap1_low > 0) return gap0 > 0 || margin == 0 ? 2 : 0;
  if (!(gap0 > 0)) return 0;
  // Either gap is too large by at most two roundings, the sum, the quotient and the product with the margin by one
  // each.
  const double t = gap0 / (gap0 - gap1_low) * (1 - tolerance::TOC_BOUND);
  return t > 0 ? std::min(t, 1.0) : 0;
}

}  // namespace

double linearTocBound(PairKind kind, const VertexMotion* vertices, const Quad& pair, double minimum_separation_m) {
  double p0[4][8], p1[4][8];
  for (int i = 0; i < 4; ++i) {
    simd::project(vertices[pair[i]].t0, p0[i]);
    simd::project(vertices[pair[i]].t1, p1[i]);
  }
  const int first_count = factsOf(kind).vertices[0];
  // At t=0, per direction: what meets there has no say. That leaves few directions, and few divisions.
  double low_a[8], high_a[8], low_b[8], high_b[8];
  for (int d = 0; d < 8; ++d) {
    const bool edges = first_count == 2;
    low_a[d] = std::min(p0[0][d], p0[edges ? 1 : 0][d]);
    high_a[d] = std::max(p0[0][d], p0[edges ? 1 : 0][d]);
    low_b[d] = std::min(std::min(p0[edges ? 2 : 1][d], p0[2][d]), p0[3][d]);
    high_b[d] = std::max(std::max(p0[edges ? 2 : 1][d], p0[2][d]), p0[3][d]);
  }
  double latest = 0;
  for (int d = 0; d < 8; ++d) {
    const double margin =
        minimum_separation_m > 0 ? minimum_separation_m * (d < 3 ? 1.0 : SQRT2_UP) * (1 + tolerance::TOC_BOUND) : 0;
    if (!(low_a[d] - margin > high_b[d]) && !(low_b[d] - margin > high_a[d])) continue;
    // Every vertex of one feature against every vertex of the other; the features' projections meet when the first pair
    // of opposite ends does. What is not later than the best so far needs no further look.
    for (const bool first_above : {true, false}) {
      double meeting = 3;
      for (int i = 0; i < first_count && meeting > latest; ++i) {
        for (int j = first_count; j < 4 && meeting > latest; ++j) {
          const int u = first_above ? i : j, l = first_above ? j : i;
          meeting = std::min(meeting, meets(p0[u][d], p1[u][d], p0[l][d], p1[l][d], margin));
        }
      }
      latest = std::max(latest, meeting);
    }
  }
  return latest;
}

}  // namespace dccd
