// Every tier of the exact rung on its own, against the truth, against the oracle and against each other.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <iostream>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "elementary/exact_tiers.h"
#include "oracle/oracle.h"
#include "oracle/query_file.h"
#include "support/data.h"
#include "support/exact_tier.h"
#include "support/generators.h"
#include "support/query_symmetries.h"
#include "support/scene_data.h"

namespace dccd {
namespace {

using test::Hardness;

constexpr Tier COMPLETE_TIERS[] = {Tier::FIXED_INTEGER, Tier::BIG_INTEGER};

std::unique_ptr<Rung> exactTest(int toc_bits = 32) {
  AccuracyOptions options;
  options.toc_bits = toc_bits;
  return makeRung(options);
}

/// Verdict and cell, not the tier.
void expectSame(const ElementaryResult& a, const ElementaryResult& b, const std::string& where) {
  EXPECT_EQ(a.verdict, b.verdict) << where;
  EXPECT_EQ(a.toc_lower, b.toc_lower) << where;
  EXPECT_EQ(a.toc_upper, b.toc_upper) << where;
}

std::vector<Query> allQueries() {
  std::vector<Query> queries;
  for (const QueryFileEntry& file : findQueryFiles(test::dataDir() + "/ccd_queries")) {
    for (const Query& query : readQueryFile(file.path, file.kind)) queries.push_back(query);
  }
  return queries;
}

TEST(ExactTiers, EveryTierAgreesWithEveryTruthColumn) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  const std::vector<Query> queries = allQueries();
  ASSERT_EQ(queries.size(), 4279u);
  const auto test = exactTest();
  TierCounters counters;
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Query& query = queries[i];
    const std::string where = std::string(toString(query.kind)) + " query " + std::to_string(i);
    const ElementaryResult whole = testPair(*test, query.kind, query.motion);
    EXPECT_EQ(whole.verdict, query.contact ? Verdict::CONTACT : Verdict::NO_CONTACT) << where;
    ++counters.settled[static_cast<std::size_t>(whole.tier)];
    for (const Tier tier : COMPLETE_TIERS) {
      expectSame(test::decideWithTier(tier, query.kind, query.motion, 32), whole, where + ", " + toString(tier));
    }
    for (int t = 0; t < static_cast<int>(Tier::COUNT); ++t) {
      const ElementaryResult alone = test::decideWithTier(static_cast<Tier>(t), query.kind, query.motion, 32);
      if (alone.verdict == Verdict::UNDECIDED) continue;
      expectSame(alone, whole, where + ", " + toString(alone.tier));
    }
  }
  for (int t = 0; t < static_cast<int>(Tier::COUNT); ++t) {
    std::cout << toString(static_cast<Tier>(t)) << ": " << counters.settled[static_cast<std::size_t>(t)] << "\n";
  }
}

TEST(ExactTiers, NoPairOfTheScenesNeedsIntegers) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  const auto test = exactTest();
  for (const char* name : {"cloth-ball", "n-body"}) {
    const test::SceneData scene = test::readScene(name);
    TierCounters counters;
    for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
      const auto& truth = kind == PairKind::VERTEX_FACE ? scene.vertex_face : scene.edge_edge;
      std::vector<Quad> pairs;
      for (const test::TruthPair& pair : truth) pairs.push_back(pair.pair);
      std::vector<ElementaryResult> results(pairs.size());
      PairBatch batch;
      batch.kind = kind;
      batch.vertices = scene.vertices.data();
      batch.pairs = pairs.data();
      batch.count = pairs.size();
      test->run(batch, results.data(), counters);
      std::size_t wrong = 0;
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        wrong += results[i].verdict != (truth[i].contact ? Verdict::CONTACT : Verdict::NO_CONTACT);
      }
      EXPECT_EQ(wrong, 0u) << name << " " << toString(kind);
    }
    EXPECT_EQ(counters.settled[static_cast<std::size_t>(Tier::FIXED_INTEGER)], 0u) << name;
    EXPECT_EQ(counters.settled[static_cast<std::size_t>(Tier::BIG_INTEGER)], 0u) << name;
  }
}

TEST(ExactTiers, HardPairsAgreeWithTheOracle) {
  test::RandomSource random(11);
  for (int h = 0; h < static_cast<int>(Hardness::COUNT); ++h) {
    const auto hardness = static_cast<Hardness>(h);
    const int count = hardness == Hardness::MIXED_150 || hardness == Hardness::EXTREME ? 20 : 150;
    for (int i = 0; i < count; ++i) {
      const PairKind kind = i % 2 == 0 ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE;
      const Query query = test::hardQuery(random, kind, hardness);
      const int toc_bits = std::array<int, 3>{10, 32, 52}[static_cast<std::size_t>(i % 3)];
      const std::string where = std::string(toString(hardness)) + ", " + toString(kind) + " " + std::to_string(i);
      std::optional<test::Root> toc = test::firstContact(kind, query.motion);
      const ElementaryResult big = test::decideWithTier(Tier::BIG_INTEGER, kind, query.motion, toc_bits);
      EXPECT_EQ(big.verdict, toc ? Verdict::CONTACT : Verdict::NO_CONTACT) << where;
      if (toc) {
        EXPECT_TRUE(test::isCellOf(*toc, big, toc_bits)) << where;
      }
      expectSame(testPair(*exactTest(toc_bits), kind, query.motion), big, where);
      for (int t = 0; t < static_cast<int>(Tier::COUNT); ++t) {
        const ElementaryResult alone = test::decideWithTier(static_cast<Tier>(t), kind, query.motion, toc_bits);
        if (alone.verdict != Verdict::UNDECIDED) expectSame(alone, big, where + ", " + toString(alone.tier));
      }
    }
  }
}

/// Static contact of integer points at time i/steps by orientations of integers alone: independent of every tier.
/// Points are scaled by `steps`; both kinds solve for the parameters by the Gram matrix.
class SmallIntegerPair {
 public:
  SmallIntegerPair(std::mt19937& random, PairKind kind) : kind_(kind) {
    for (auto& time : x_) {
      for (auto& point : time) {
        for (auto& value : point) value = static_cast<int>(random() % 5) - 2;
      }
    }
    const unsigned family = random() % 6;
    for (int i = 0; i < 4; ++i) {
      if (family == 0) x_[0][i][2] = x_[1][i][2] = 0;                              // coplanar
      if (family == 1) x_[0][i][1] = x_[1][i][1] = x_[0][i][2] = x_[1][i][2] = 0;  // collinear
      if (family == 2) std::copy(x_[0][i], x_[0][i] + 3, x_[1][i]);                // at rest
    }
    for (auto& time : x_) {
      if (family == 3) std::copy(time[2], time[2] + 3, time[3]);  // zero area, zero length
      for (int k = 0; family == 4 && k < 3; ++k) time[3][k] = time[2][k] + 2 * (time[1][k] - time[0][k]);  // parallel
    }
  }

  PairMotion motion() const {
    PairMotion pair;
    for (int time = 0; time < 2; ++time) {
      for (int i = 0; i < 4; ++i) {
        for (int k = 0; k < 3; ++k) pair.x[time][i][k] = x_[time][i][k];
      }
    }
    return pair;
  }

  bool touchesAt(long step, long steps) const {
    Point p[4];
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < 3; ++k) {
        p[i][static_cast<std::size_t>(k)] = x_[0][i][k] * (steps - step) + x_[1][i][k] * step;
      }
    }
    return kind_ == PairKind::VERTEX_FACE ? inTriangle(p[0], p[1], p[2], p[3]) : segmentsMeet(p[0], p[1], p[2], p[3]);
  }

 private:
  using Point = std::array<long, 3>;
  static Point minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
  static long dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
  static bool isZero(const Point& a) { return a == Point{0, 0, 0}; }

  /// p = a + l (b - a) + m (c - a) in the least-squares sense, then tested for equality.
  static bool inTriangle(const Point& p, const Point& a, const Point& b, const Point& c) {
    const Point u = minus(b, a), v = minus(c, a), w = minus(p, a);
    const long uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), uw = dot(u, w), vw = dot(v, w);
    const long gram = uu * vv - uv * uv;
    if (gram == 0) return onSegment(p, a, b) || onSegment(p, b, c) || onSegment(p, c, a);
    const long l = uw * vv - vw * uv, m = vw * uu - uw * uv;  // times gram
    for (std::size_t k = 0; k < 3; ++k) {
      if (l * u[k] + m * v[k] != gram * w[k]) return false;
    }
    return l >= 0 && m >= 0 && l + m <= gram;
  }

  static bool onSegment(const Point& p, const Point& a, const Point& b) {
    const Point u = minus(b, a), w = minus(p, a);
    const long uu = dot(u, u), uw = dot(u, w);
    if (uu == 0) return isZero(w);
    return uw >= 0 && uw <= uu && uw * uw == uu * dot(w, w);
  }

  static bool segmentsMeet(const Point& a, const Point& b, const Point& c, const Point& d) {
    const Point u = minus(b, a), v = minus(d, c), w = minus(c, a);
    const long uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), uw = dot(u, w), vw = dot(v, w);
    const long gram = uu * vv - uv * uv;
    if (gram == 0) return onSegment(a, c, d) || onSegment(b, c, d) || onSegment(c, a, b) || onSegment(d, a, b);
    const long l = uw * vv - vw * uv, m = uw * uv - vw * uu;  // a + l u = c + m v, times gram
    for (std::size_t k = 0; k < 3; ++k) {
      if (l * u[k] - m * v[k] != gram * w[k]) return false;
    }
    return l >= 0 && l <= gram && m >= 0 && m <= gram;
  }

  PairKind kind_;
  int x_[2][4][3];
};

TEST(ExactTiers, DegenerateSmallIntegersAgainstTheirStaticTestAtRationalTimes) {
  constexpr long STEPS = 60;  // contains halves, thirds, quarters, fifths, sixths...
  std::mt19937 random(5);
  const auto test = exactTest();
  int contacts = 0, free = 0;
  for (int i = 0; i < 12000; ++i) {
    const PairKind kind = i % 2 == 0 ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE;
    const SmallIntegerPair pair(random, kind);
    const ElementaryResult result = test::decideWithTier(Tier::FIXED_INTEGER, kind, pair.motion(), 32);
    expectSame(testPair(*test, kind, pair.motion()), result, std::to_string(i));
    long first = 0;
    while (first <= STEPS && !pair.touchesAt(first, STEPS)) ++first;
    if (result.verdict == Verdict::CONTACT) {
      ++contacts;
      // It may have touched between two of the looked-at times, earlier than at any of them; never later.
      if (first <= STEPS) {
        EXPECT_LE(result.toc_lower, static_cast<double>(first) / STEPS) << i;
      }
    } else {
      ++free;
      EXPECT_EQ(first, STEPS + 1) << i;
    }
    if (HasFailure()) return;
  }
  EXPECT_GT(contacts, 1000);
  EXPECT_GT(free, 1000);
}

TEST(ExactTiers, InvariantUnderPermutationsAxesAndScaling) {
  test::RandomSource random(17);
  const auto test = exactTest();
  const auto axes = test::axisPermutations();
  for (int i = 0; i < 400; ++i) {
    const Query query = test::hardQuery(random);
    const ElementaryResult result = testPair(*test, query.kind, query.motion);
    for (const auto& order : test::vertexPermutations(query.kind)) {
      expectSame(testPair(*test, query.kind, test::permuted(query, order).motion), result, "vertices");
    }
    for (const auto& permutation : axes) {
      expectSame(testPair(*test, query.kind, test::permuted(query, permutation).motion), result, "axes");
    }
    for (const int exponent : {-700, -60, -1, 1, 60, 700}) {
      Query scaled;
      if (!test::scaledExactly(query, exponent, scaled)) continue;
      expectSame(testPair(*test, query.kind, scaled.motion), result, "scale 2^" + std::to_string(exponent));
    }
    EXPECT_EQ(testPair(*test, query.kind, test::timeReversed(query).motion).verdict, result.verdict) << "time reversed";
    if (HasFailure()) return;
  }
}

TEST(ExactTiers, CellsOfCoarserGridsContainThoseOfFinerOnes) {
  test::RandomSource random(23);
  for (int i = 0; i < 1000; ++i) {
    const Query query = test::hardQuery(random);
    const ElementaryResult fine = testPair(*exactTest(52), query.kind, query.motion);
    for (const int bits : {10, 23, 32, 51}) {
      const ElementaryResult coarse = testPair(*exactTest(bits), query.kind, query.motion);
      ASSERT_EQ(coarse.verdict, fine.verdict);
      if (fine.verdict != Verdict::CONTACT) continue;
      const double cells = std::ldexp(1.0, bits);
      EXPECT_EQ(coarse.toc_lower, std::floor(fine.toc_lower * cells) / cells) << bits;
      EXPECT_EQ(coarse.toc_upper, fine.toc_lower == 1 ? 1.0 : coarse.toc_lower + 1 / cells) << bits;
    }
  }
}

TEST(ExactTiers, FixedIntegersAgreeWithBigOnesUpToTheirWidth) {
  // Coordinates of 53 bits spread over almost FIXED_INTEGER_MAX_BITS, so that every intermediate number is as long as
  // it gets (a build with the address sanitizer sees one that is too long).
  std::mt19937_64 random(43);
  int decided = 0;
  for (int i = 0; i < 3000; ++i) {
    const PairKind kind = i % 2 == 0 ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE;
    const int spread = exact::FIXED_INTEGER_MAX_BITS - 53 - static_cast<int>(random() % 4);
    PairMotion pair;
    for (auto& time : pair.x) {
      for (auto& point : time) {
        for (double& value : point) {
          const auto mantissa = static_cast<std::int64_t>(random() >> 11) - (std::int64_t{1} << 52);
          const bool large = random() % 8 != 0;
          value = std::ldexp(static_cast<double>(mantissa | 1), large ? spread - static_cast<int>(random() % 3) : 0);
        }
      }
    }
    if (i % 3 == 0) pair.x[1][3][2] = pair.x[0][3][2];
    const ElementaryResult fixed = test::decideWithTier(Tier::FIXED_INTEGER, kind, pair, 52);
    decided += fixed.verdict != Verdict::UNDECIDED;
    if (fixed.verdict == Verdict::UNDECIDED) continue;
    expectSame(fixed, test::decideWithTier(Tier::BIG_INTEGER, kind, pair, 52), std::to_string(i));
  }
  EXPECT_GT(decided, 2000);
}

TEST(ExactTiers, FixedIntegersRefuseWhatIsTooWideForThem) {
  test::RandomSource random(29);
  Query wide = test::hardQuery(random, PairKind::VERTEX_FACE, Hardness::GENERAL);
  for (int i = 0; i < 24; ++i) (&wide.motion.x[0][0][0])[i] *= i % 3 == 0 ? 0x1p300 : i % 3 == 1 ? 0x1p-300 : 1;
  EXPECT_NE(test::decideWithTier(Tier::FIXED_INTEGER, wide.kind, wide.motion, 32).verdict, Verdict::UNDECIDED)
      << "each axis has a power of two of its own";
  wide.motion.x[0][1][0] *= 0x1p-400;
  EXPECT_EQ(test::decideWithTier(Tier::FIXED_INTEGER, wide.kind, wide.motion, 32).verdict, Verdict::UNDECIDED);
  EXPECT_NE(test::decideWithTier(Tier::BIG_INTEGER, wide.kind, wide.motion, 32).verdict, Verdict::UNDECIDED);
}

TEST(ExactTiers, RefuseKindsThatTheyDoNotHave) {
  const PairMotion pair{};
  EXPECT_THROW(testPair(*exactTest(), PairKind::EDGE_VOXEL_EDGE, pair), std::invalid_argument);
}

}  // namespace
}  // namespace dccd
