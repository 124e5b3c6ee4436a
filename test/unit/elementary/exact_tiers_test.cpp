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
