#include "support/margin_pair_judges.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "elementary/exact_double_double.h"
#include "oracle/exact_distance.h"
#include "oracle/oracle.h"
#include "oracle/promises.h"
#include "oracle/query_file.h"
#include "simd/exact_batch.h"
#include "simd/fused_filter.h"

namespace dccd {
namespace test {
namespace margins {

IsWrong judgeBatch(const MarginInput& input) {
  const PairKind kind = kindOf(input);
  const PairMotion motion = motionOf(input);
  std::optional<Root> toc = firstContact(kind, motion);
  return [kind, motion, toc]() mutable {
    VertexMotion vertices[4] = {};
    for (int i = 0; i < 4; ++i) {
      std::copy_n(motion.x[0][i], 3, vertices[i].t0);
      std::copy_n(motion.x[1][i], 3, vertices[i].t1);
    }
    const std::uint32_t quads[1][4] = {{0, 1, 2, 3}};
    simd::BatchInput batch;
    batch.vertices = vertices[0].t0;
    batch.quads = quads;
    batch.count = 1;
    batch.kind = kind == PairKind::VERTEX_FACE ? simd::BatchKind::VERTEX_FACE : simd::BatchKind::EDGE_EDGE;
    std::uint8_t verdict;
    std::uint64_t cell;
    double lo, hi;
    simd::exactBatch(batch, {&verdict, &cell, &lo, &hi});
    if (verdict == simd::BATCH_UNDECIDED) return false;
    if (verdict == simd::BATCH_NO) return toc.has_value();
    if (!toc) return true;
    if (verdict == simd::BATCH_YES && toc->cell(32) != Integer(cell)) return true;
    return toc->compareWith(Dyadic::fromDouble(lo)) <= 0 || toc->compareWith(Dyadic::fromDouble(hi)) >= 0;
  };
}

std::function<IsWrong(const MarginInput&)> judgeTier(
    std::function<ElementaryResult(PairKind, const PairMotion&, int)> tier, int toc_bits) {
  return [tier, toc_bits](const MarginInput& input) -> IsWrong {
    Query query;
    query.kind = kindOf(input);
    query.motion = motionOf(input);
    std::optional<Root> toc = firstContact(query.kind, query.motion);
    return [query, toc, tier, toc_bits]() mutable {
      const ElementaryResult result = tier(query.kind, query.motion, toc_bits);
      if (result.verdict == Verdict::UNDECIDED) return false;
      AccuracyOptions options;
      options.toc_bits = toc_bits;
      return !brokenPromise(options, query, toc, result).empty();
    };
  };
}

IsWrong judgePlanarFilter(const MarginInput& input) {
  const PairKind kind = kindOf(input);
  const PairMotion motion = motionOf(input);
  const bool contact = firstContact(kind, motion).has_value();
  return [kind, motion, contact] {
    alignas(64) VertexMotion vertices[4] = {};
    for (int i = 0; i < 4; ++i) {
      std::copy_n(motion.x[0][i], 3, vertices[i].t0);
      std::copy_n(motion.x[1][i], 3, vertices[i].t1);
    }
    const std::uint32_t quad[4] = {0, 1, 2, 3};
    std::uint32_t kept[16];
    return contact &&
           simd::fusedFilter(vertices[0].t0, quad, 1, kind == PairKind::EDGE_EDGE, simd::FusedPlanes::ALL, kept) == 0;
  };
}

namespace {

/// u, v, w at t = 0 and what they change by, exactly.
void exactDifferences(PairKind kind, const PairMotion& motion, Rational (&start)[3][3], Rational (&change)[3][3]) {
  static constexpr int ENDS[2][3][2] = {{{1, 2}, {1, 3}, {1, 0}}, {{0, 1}, {2, 3}, {0, 2}}};
  const auto& ends = ENDS[kind == PairKind::VERTEX_FACE ? 0 : 1];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      start[i][k] = exact(motion.x[0][ends[i][1]][k]) - exact(motion.x[0][ends[i][0]][k]);
      change[i][k] = exact(motion.x[1][ends[i][1]][k]) - exact(motion.x[1][ends[i][0]][k]) - start[i][k];
    }
  }
}

}  // namespace

IsWrong judgeCubic(const MarginInput& input, CubicBound bound) {
  const PairKind kind = kindOf(input);
  const PairMotion motion = motionOf(input);
  const double t = (std::min(1.0, std::max(0.0, input.x[24])) + 1) - 1;
  Rational start[3][3], change[3][3];
  exactDifferences(kind, motion, start, change);
  std::array<std::array<Rational, 3>, 3> at;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) at[i][k] = start[i][k] + exact(t) * change[i][k];
  }
  Rational truth = bound == CubicBound::SLOPE ? Rational(0) : determinant(at);
  if (bound == CubicBound::SLOPE) {
    for (int i = 0; i < 3; ++i) {
      auto one = at;
      for (int k = 0; k < 3; ++k) one[i][k] = change[i][k];
      truth += determinant(one);
    }
  }
  return [=] {
    const exact::CoplanarityCubic f(kind, motion);
    if (bound == CubicBound::VALUE) {
      return abs(exact(f.roughValueAt(t)) - truth) > exact(f.roughError());
    }
    if (bound == CubicBound::SLOPE) return abs(exact(f.slopeAt(t)) - truth) > exact(f.slopeError());
    const double value = f.valueAt(t);  // rounded once more, which changes no sign
    return abs(exact(value) - truth) > exact(f.error()) + exact(0x1p-53 * std::fabs(value));
  };
}

IsWrong judgeDistance(const MarginInput& input) {
  Query query;
  query.kind = kindOf(input);
  query.motion = motionOf(input);
  const double d = input.x[24], tolerance = input.x[25];
  const Rational squared_now = squaredDistanceAt(query.kind, query.motion, 0), within = exact(d) + exact(tolerance);
  const bool is_far = squared_now > within * within, is_within = squared_now <= exact(d) * exact(d);
  return [=] {
    if (!(d > 0 && tolerance > 0 && std::isfinite(d + tolerance))) return false;
    AccuracyOptions options;
    options.rung = Accuracy::CONSERVATIVE;
    options.tolerance_m = tolerance;
    const ElementaryResult result = testQuery(*makeRung(options), query, d);
    if (result.verdict == Verdict::CONTACT && result.toc_lower == 0) return is_far;
    return is_within && (result.verdict == Verdict::NO_CONTACT || result.toc_lower > 0);
  };
}

}  // namespace margins
}  // namespace test
}  // namespace dccd
