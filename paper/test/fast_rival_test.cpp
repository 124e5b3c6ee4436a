// The rival `fast`: right away from ties, approximately in time, and close to the truth on the scenes.
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <stdexcept>
#include <vector>

#include "dccd/elementary.h"
#include "oracle/oracle.h"
#include "paper/fast_rival.h"
#include "support/data.h"
#include "support/generators.h"
#include "support/scene_data.h"

namespace dccd {
namespace test {
namespace {

TEST(FastRival, ApproximatesTheTimeOfContact) {
  RandomSource random(5);
  const auto test = makeFastRival();
  int contacts = 0, wrong = 0;
  for (int i = 0; i < 3000; ++i) {
    const Query query = hardQuery(random, i % 2 ? PairKind::EDGE_EDGE : PairKind::VERTEX_FACE, Hardness::GENERAL);
    const ElementaryResult result = testPair(*test, query.kind, query.motion);
    std::optional<Root> toc = firstContact(query.kind, query.motion);
    ASSERT_NE(result.verdict, Verdict::UNDECIDED);
    if ((result.verdict == Verdict::CONTACT) != toc.has_value()) {
      ++wrong;
    } else if (toc) {
      ++contacts;
      ASSERT_EQ(result.toc_lower, result.toc_upper);
      ASSERT_LT(std::fabs(tocError(*toc, result.toc_lower)), 1e-3) << i;
    }
  }
  EXPECT_GT(contacts, 100);
  EXPECT_LE(wrong, 3);
}

TEST(FastRival, NearlyRightOnClothBall) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  const SceneData scene = readScene("cloth-ball");
  const auto test = makeFastRival();
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    const auto& truth = kind == PairKind::VERTEX_FACE ? scene.vertex_face : scene.edge_edge;
    std::vector<Quad> quads;
    for (const TruthPair& pair : truth) quads.push_back(pair.pair);
    PairBatch batch;
    batch.kind = kind;
    batch.vertices = scene.vertices.data();
    batch.pairs = quads.data();
    batch.count = quads.size();
    std::vector<ElementaryResult> results(quads.size());
    TierCounters counters;
    test->run(batch, results.data(), counters);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      wrong += (results[i].verdict == Verdict::CONTACT) != truth[i].contact;
    }
    std::cout << "fast, " << toString(kind) << ": " << wrong << " of " << truth.size() << " wrong\n";
    EXPECT_LT(wrong, truth.size() / 500);
    EXPECT_EQ(counters.settled[static_cast<std::size_t>(Tier::DOUBLE_BATCH)], truth.size());
  }
}

TEST(FastRival, RefusesWhatItCannotTest) {
  const auto test = makeFastRival();
  EXPECT_THROW(testPair(*test, PairKind::FACE_VOXEL_CORNER, PairMotion{}), std::invalid_argument);
  const double separation_m = 1e-3;
  const VertexMotion vertices[4] = {};
  const Quad quad = {0, 1, 2, 3};
  PairBatch batch;
  batch.vertices = vertices;
  batch.pairs = &quad;
  batch.count = 1;
  batch.minimum_separation_m = &separation_m;
  ElementaryResult result;
  TierCounters counters;
  EXPECT_THROW(test->run(batch, &result, counters), std::invalid_argument);
}

}  // namespace
}  // namespace test
}  // namespace dccd
