#include "support/generated_scene.h"

#include <gtest/gtest.h>

#include <set>

#include "support/generated_shapes.h"

namespace dccd {
namespace test {
namespace {

class GeneratedScenes : public ::testing::TestWithParam<GeneratedKind> {};

TEST_P(GeneratedScenes, OfTheSameSeedAreTheSameAndOfAnotherAreNot) {
  GeneratedOptions options;
  options.triangles = 3000;
  const auto a = generateSequence(GetParam(), options), b = generateSequence(GetParam(), options);
  options.seed = 2;
  const auto c = generateSequence(GetParam(), options);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(a->advance());
    ASSERT_TRUE(b->advance());
    ASSERT_TRUE(c->advance());
  }
  EXPECT_EQ(a->positions(), b->positions());
  EXPECT_NE(a->positions(), c->positions());
}

TEST_P(GeneratedScenes, MoveStayFiniteAndKeepTheirSize) {
  GeneratedOptions options;
  options.triangles = 3000;
  const auto sequence = generateSequence(GetParam(), options);
  EXPECT_GE(sequence->frameCount(), 64u);
  EXPECT_LE(sequence->frameCount(), 96u);
  EXPECT_GT(sequence->triangleCount(), 1500u);
  EXPECT_LT(sequence->triangleCount(), 4500u);
  std::size_t vertices = 0;
  for (const GeneratedBody& body : sequence->bodies()) {
    EXPECT_EQ(body.vertex_offset, vertices);
    vertices += body.topology.vertexCount();
    EXPECT_EQ(body.topology.usedVertices().size(), body.topology.vertexCount()) << body.name << " has loose vertices";
  }
  ASSERT_EQ(sequence->positions().size(), vertices);
  const Positions first = sequence->positions();
  sequence->advanceTo(sequence->frameCount() - 1);
  EXPECT_FALSE(sequence->advance());
  ASSERT_EQ(sequence->positions().size(), vertices);
  EXPECT_NE(first, sequence->positions());
  for (const Vec3& p : sequence->positions()) {
    ASSERT_TRUE(p.allFinite());
    ASSERT_LT(p.norm(), 500.0) << "fragments fly a few hundred metres at most";
  }
}

TEST_P(GeneratedScenes, SkippingFramesChangesNothing) {
  GeneratedOptions options;
  options.triangles = 2000;
  const auto one_by_one = generateSequence(GetParam(), options), at_once = generateSequence(GetParam(), options);
  for (int i = 0; i < 5; ++i) one_by_one->advance();
  at_once->advanceTo(5);
  EXPECT_EQ(one_by_one->positions(), at_once->positions());
  EXPECT_EQ(at_once->frame(), 5u);
  EXPECT_THROW(at_once->advanceTo(1000), std::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(All, GeneratedScenes,
                         ::testing::Values(GeneratedKind::CLOTH_BALL, GeneratedKind::N_BODY, GeneratedKind::CLOTH_BONE,
                                           GeneratedKind::DRAGON, GeneratedKind::LION),
                         [](const auto& info) { return std::string(toString(info.param)); });

TEST(GeneratedKinds, NamesAreParsedAndOthersRefused) {
  EXPECT_EQ(generatedKindFromString("dragon"), GeneratedKind::DRAGON);
  EXPECT_THROW(generatedKindFromString("Dragon"), std::invalid_argument);
}

/// Every edge of a closed surface has two faces.
void expectClosed(const TriangleShape& shape) {
  std::multiset<Edge> edges;
  for (const Face& f : shape.faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      edges.insert({std::min(f[k], f[(k + 1) % 3]), std::max(f[k], f[(k + 1) % 3])});
    }
  }
  for (const Edge& e : edges) EXPECT_EQ(edges.count(e), 2u);
}

TEST(GeneratedShapes, AreWhatTheySay) {
  EXPECT_EQ(cubeSphere(4).faces.size(), 12u * 16u);
  expectClosed(cubeSphere(4));
  for (const Vec3& v : cubeSphere(4).vertices) EXPECT_NEAR(v.norm(), 1.0, 1e-12);
  expectClosed(revolution(5, 6, 1.0, [](double) { return 0.3; }));
  EXPECT_EQ(sheet(3, 2.0).faces.size(), 18u);
  EXPECT_EQ(sheet(3, 2.0).vertices.size(), 16u);
}

}  // namespace
}  // namespace test
}  // namespace dccd
