// Every rung on every query that has a truth column, and on the pairs of the real scenes.
#include <gtest/gtest.h>

#include <iostream>
#include <memory>

#include "oracle/promises.h"
#include "oracle/query_file.h"
#include "support/data.h"
#include "support/scene_data.h"

namespace dccd {
namespace test {
namespace {

std::vector<AccuracyOptions> allOptions() {
  std::vector<AccuracyOptions> all;
  AccuracyOptions options;
  options.rung = Accuracy::CONSERVATIVE;
  for (double tolerance : {1e-3, 1e-6, 1e-9}) {
    options.tolerance_m = tolerance;
    all.push_back(options);
  }
  options.rung = Accuracy::EXACT;
  for (int bits : {10, 32, 52}) {
    options.toc_bits = bits;
    all.push_back(options);
  }
  return all;
}

TEST(QueryRungs, EveryPromiseIsKeptOnTheQueries) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  const std::vector<AccuracyOptions> all = allOptions();
  std::vector<std::unique_ptr<Rung>> tests;
  for (const AccuracyOptions& options : all) tests.push_back(makeRung(options));
  std::size_t queries = 0;
  for (const QueryFileEntry& file : findQueryFiles(dataDir() + "/ccd_queries")) {
    std::size_t index = 0;
    for (const Query& query : readQueryFile(file.path, file.kind)) {
      std::optional<Root> toc = firstContact(file.kind, query.motion);
      for (std::size_t i = 0; i < all.size(); ++i) {
        const ElementaryResult result = testQuery(*tests[i], query);
        const std::string broken = brokenPromise(all[i], query, toc, result);
        EXPECT_EQ(broken, "") << toString(all[i].rung) << ", " << file.path << ", query " << index;
        if (all[i].rung == Accuracy::EXACT) {
          EXPECT_EQ(result.verdict == Verdict::CONTACT, query.contact);
        }
      }
      ++index;
      ++queries;
    }
  }
  EXPECT_EQ(queries, 4279u);
}

/// Runs all listed pairs of one kind in one batch.
std::vector<ElementaryResult> runPairs(const Rung& test, PairKind kind, const SceneData& scene,
                                       const std::vector<TruthPair>& pairs, TierCounters& counters) {
  std::vector<Quad> quads;
  for (const TruthPair& pair : pairs) quads.push_back(pair.pair);
  PairBatch batch;
  batch.kind = kind;
  batch.vertices = scene.vertices.data();
  batch.pairs = quads.data();
  batch.count = quads.size();
  std::vector<ElementaryResult> results(quads.size());
  test.run(batch, results.data(), counters);
  return results;
}

class SceneRungs : public ::testing::TestWithParam<const char*> {};

TEST_P(SceneRungs, ExactIsTheTruthAndConservativeMissesNothing) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  const SceneData scene = readScene(GetParam());
  AccuracyOptions options;
  options.rung = Accuracy::EXACT;
  const auto exact = makeRung(options);
  options.rung = Accuracy::CONSERVATIVE;
  const auto conservative = makeRung(options);
  TierCounters counters, unused;
  std::size_t undecided = 0;
  for (PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    const std::vector<TruthPair>& pairs = kind == PairKind::VERTEX_FACE ? scene.vertex_face : scene.edge_edge;
    const auto exact_results = runPairs(*exact, kind, scene, pairs, counters);
    const auto conservative_results = runPairs(*conservative, kind, scene, pairs, unused);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      EXPECT_EQ(exact_results[i].verdict == Verdict::CONTACT, pairs[i].contact) << toString(kind) << " pair " << i;
      EXPECT_NE(exact_results[i].verdict, Verdict::UNDECIDED);
      if (!pairs[i].contact) continue;
      EXPECT_NE(conservative_results[i].verdict, Verdict::NO_CONTACT) << toString(kind) << " pair " << i;
      // Not after the true time, which lies before the end of the exact cell.
      EXPECT_LE(conservative_results[i].toc_lower, exact_results[i].toc_upper) << toString(kind) << " pair " << i;
      undecided += conservative_results[i].verdict == Verdict::UNDECIDED;
    }
  }
  std::cout << GetParam() << ": conservative leaves " << undecided << " undecided; exact settled by tier:";
  for (std::size_t tier = 0; tier < counters.settled.size(); ++tier) {
    std::cout << " " << toString(static_cast<Tier>(tier)) << " " << counters.settled[tier];
  }
  std::cout << "\n";
  for (const Tier integers : {Tier::FIXED_INTEGER, Tier::BIG_INTEGER}) {
    EXPECT_EQ(counters.settled[static_cast<std::size_t>(integers)], 0u) << "no pair of the scenes needs integers";
  }
}

INSTANTIATE_TEST_SUITE_P(RealScenes, SceneRungs, ::testing::Values("cloth-ball", "n-body"),
                         [](const auto& info) { return info.index == 0 ? "ClothBall" : "NBody"; });

}  // namespace
}  // namespace test
}  // namespace dccd
