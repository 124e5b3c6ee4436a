// Scalar reference against kernel, on every target: the same pairs survive, in the same order.
#include "paper/paper_filters.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "support/simd_targets.h"

namespace dccd {
namespace {

/// Vertices in clumps, so that every filter keeps some pairs and rejects some; some coincide, some rest.
std::vector<VertexMotion> clumps(std::size_t count, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> place(-1.0, 1.0), shift(-0.3, 0.3);
  std::vector<VertexMotion> vertices(count);
  for (std::size_t i = 0; i < count; ++i) {
    VertexMotion& v = vertices[i];
    v = VertexMotion{};
    if (i > 0 && i % 11 == 0) {
      v = vertices[i - 1];
      continue;
    }
    for (int k = 0; k < 3; ++k) {
      v.t0[k] = 5.0 + place(random);
      v.t1[k] = v.t0[k] + (i % 7 == 0 ? 0.0 : shift(random));
    }
    if (i % 5 == 0) v.t0[2] = v.t1[2] = 5.0;  // many in one plane
  }
  return vertices;
}

std::vector<Quad> randomPairs(std::size_t count, std::size_t vertex_count, unsigned seed) {
  std::mt19937_64 random(seed);
  std::vector<Quad> pairs;
  while (pairs.size() < count) {
    Quad q;
    for (Index& v : q) v = static_cast<Index>(random() % vertex_count);
    if (std::set<Index>(q.begin(), q.end()).size() == 4) pairs.push_back(q);
  }
  return pairs;
}

using Case = std::tuple<PaperFilter, PairKind>;
class PaperFilterKernels : public ::testing::TestWithParam<Case> {};

TEST_P(PaperFilterKernels, EqualTheReferenceOnEveryTargetAndLength) {
  const auto [filter, kind] = GetParam();
  const auto vertices = clumps(400, 1);
  PaperRecords records;
  records.build(vertices.data(), vertices.size());
  for (std::size_t count : {0u, 1u, 2u, 3u, 7u, 8u, 9u, 15u, 16u, 17u, 1000u, 4001u}) {
    const auto pairs = randomPairs(count, vertices.size(), 7 + static_cast<unsigned>(count));
    std::vector<Quad> expected;
    for (const Quad& q : pairs) {
      if (!filterRejects(filter, kind, records, vertices.data(), q)) expected.push_back(q);
    }
    if (count > 1000) {
      EXPECT_GT(expected.size(), 20u) << "the test would not see a filter that keeps nothing";
      EXPECT_LT(expected.size(), count - 20) << "the test would not see a filter that keeps everything";
    }
    test::forEachTarget([&, filter = filter, kind = kind](const std::string& target) {
      std::vector<Quad> out(count + 1, Quad{1, 2, 3, 4});
      const std::size_t kept = filterPairs(filter, kind, records, vertices.data(), pairs.data(), count, out.data());
      EXPECT_EQ(out[count], (Quad{1, 2, 3, 4})) << target << " wrote past the end";
      out.resize(kept);
      EXPECT_EQ(out, expected) << target << ", " << count << " pairs";
      std::vector<Quad> in_place = pairs;
      in_place.resize(count + 1);
      in_place.resize(filterPairs(filter, kind, records, vertices.data(), in_place.data(), count, in_place.data()));
      EXPECT_EQ(in_place, expected) << target << " in place, " << count << " pairs";
    });
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, PaperFilterKernels,
    ::testing::Combine(::testing::Values(PaperFilter::PRIMITIVE_BV, PaperFilter::LINEAR, PaperFilter::NON_PENETRATION,
                                         PaperFilter::NON_PENETRATION_BATCHED, PaperFilter::PLANAR_PAPER,
                                         PaperFilter::PLANAR_BRANCH_FREE),
                       ::testing::Values(PairKind::VERTEX_FACE, PairKind::EDGE_EDGE)),
    [](const ::testing::TestParamInfo<Case>& info) {
      return std::string(toString(std::get<0>(info.param))) +
             (std::get<1>(info.param) == PairKind::VERTEX_FACE ? "_vf" : "_ee");
    });

}  // namespace
}  // namespace dccd
