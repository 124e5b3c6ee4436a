#include "support/generated_scene.h"

#include <gtest/gtest.h>

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

INSTANTIATE_TEST_SUITE_P(All, GeneratedScenes,
                         ::testing::Values(GeneratedKind::CLOTH_BALL, GeneratedKind::N_BODY, GeneratedKind::CLOTH_BONE,
                                           GeneratedKind::DRAGON, GeneratedKind::LION),
                         [](const auto& info) { return std::string(toString(info.param)); });

}  // namespace
}  // namespace test
}  // namespace dccd
