// What the obstacle test says of single features whose answer is known.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "dccd/voxel_surface.h"

namespace dccd {
namespace {

OccupiedLeaf leafAt(int x, int y, int z, std::uint32_t size = 1) {
  return {{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y), static_cast<std::uint16_t>(z)}, size};
}

/// Unit voxels; keys 32768 and up start at 0.
std::shared_ptr<const VoxelSurface> unitVoxels(std::vector<OccupiedLeaf> leaves) {
  return VoxelSurface::build(1.0, std::move(leaves));
}

struct Answer {
  std::vector<Contact> contacts;
  ObstacleStats stats;
};

Answer run(const VoxelSurface& surface, const Topology& topology, const Positions& t0, const Positions& t1,
           const ObstacleOptions& options = {}, const std::uint8_t* active = nullptr) {
  Answer answer;
  ObstacleCheck test(options);
  test.run({surface, topology, t0, t1, 0, active}, answer.contacts, answer.stats);
  return answer;
}

Positions moved(Positions positions, const Vec3& by) {
  for (Vec3& p : positions) p += by;
  return positions;
}

const Topology ROPE = Topology::polyline(2);
const Topology TRIANGLE = Topology::fromTriangles(3, {{0, 1, 2}});
constexpr double CELL = 0x1p-32;

TEST(ObstacleCheck, AVertexMeetsAFaceInItsCell) {
  const auto surface = unitVoxels({leafAt(32768, 32768, 32768)});
  const Answer answer = run(*surface, ROPE, {{0.5, 0.5, 3}, {0.5, 0.5, 5}}, {{0.5, 0.5, 0}, {0.5, 0.5, 5}});
  ASSERT_EQ(answer.contacts.size(), 1u);
  const Contact& contact = answer.contacts[0];
  EXPECT_EQ(contact.kind, PairKind::VERTEX_VOXEL_FACE);
  EXPECT_EQ(contact.vertex[0], 0u);
  EXPECT_EQ(contact.vertex[1], NO_INDEX);
  EXPECT_EQ(contact.body[1], OBSTACLE_BODY);
  EXPECT_EQ(contact.voxel, (VoxelKey{32768, 32768, 32768}));
  EXPECT_EQ(contact.voxel_size, 1u);
  EXPECT_EQ(contact.toc_lower, std::floor(2.0 / 3 * 0x1p32) * CELL);
  EXPECT_EQ(contact.toc_upper, contact.toc_lower + CELL);
  EXPECT_FALSE(contact.initial);
  EXPECT_FALSE(contact.leaving);
  EXPECT_GE(answer.stats.pairs_in, 1u);
}

TEST(ObstacleCheck, WhatMeetsAFaceAfterTheLeastOfTimesIsNotInitial) {
  const auto surface = unitVoxels({leafAt(32768, 32768, 32767)});
  for (const auto& [rung, cell] : {std::pair(Accuracy::EXACT, CELL), std::pair(Accuracy::CONSERVATIVE, 0x1p-52)}) {
    ObstacleOptions options;
    options.accuracy.rung = rung;
    const Answer answer =
        run(*surface, ROPE, {{0.5, 0.5, 1e-300}, {0.5, 0.5, 5}}, {{0.5, 0.5, -0.5}, {0.5, 0.5, 5}}, options);
    ASSERT_EQ(answer.contacts.size(), 1u);
    const Contact& contact = answer.contacts[0];
    EXPECT_EQ(contact.certainty, Certainty::CERTAIN);
    EXPECT_EQ(contact.toc_lower, 0);
    EXPECT_EQ(contact.toc_upper, cell);
    EXPECT_FALSE(contact.initial);
  }
}

TEST(ObstacleCheck, TheLastMomentCounts) {
  const auto surface = unitVoxels({leafAt(32768, 32768, 32768)});
  const Positions t0 = {{0.5, 0.5, 3}, {0.5, 0.5, 5}};
  const Answer touching = run(*surface, ROPE, t0, {{0.5, 0.5, 1}, {0.5, 0.5, 5}});
  ASSERT_EQ(touching.contacts.size(), 1u);
  EXPECT_EQ(touching.contacts[0].toc_lower, 1.0);
  EXPECT_EQ(touching.contacts[0].toc_upper, 1.0);
  EXPECT_TRUE(run(*surface, ROPE, t0, {{0.5, 0.5, std::nextafter(1.0, 2.0)}, {0.5, 0.5, 5}}).contacts.empty());
}

TEST(ObstacleCheck, AnEdgeMeetsAnEdge) {
  const auto surface = unitVoxels({leafAt(32768, 32768, 32768)});
  // A line along y that falls onto the box's upper edge at x = 1 beside its corner.
  const Positions t0 = {{1, -1, 2}, {1, 3, 2}};
  const Answer answer = run(*surface, ROPE, {{0.5, -1, 2}, {0.75, 3, 2}}, {{0.5, -1, 0}, {0.75, 3, 0}});
  ASSERT_EQ(answer.contacts.size(), 1u);
  EXPECT_EQ(answer.contacts[0].kind, PairKind::EDGE_VOXEL_EDGE);
  EXPECT_EQ(answer.contacts[0].toc_lower, 0.5);
  EXPECT_EQ(run(*surface, ROPE, t0, moved(t0, {0, 0, -2})).contacts.size(), 1u) << "exactly along the box's edge";
}

TEST(ObstacleCheck, ACornerMeetsAFace) {
  const auto surface = unitVoxels({leafAt(32768, 32768, 32768)});
  const Positions t0 = {{-9, -9, 3}, {11, -9, 4}, {1, 19, 5}};
  const Answer answer = run(*surface, TRIANGLE, t0, moved(t0, {0, 0, -4}));
  ASSERT_FALSE(answer.contacts.empty());
  for (const Contact& contact : answer.contacts) EXPECT_EQ(contact.kind, PairKind::FACE_VOXEL_CORNER);
  EXPECT_EQ(answer.contacts.size(), 1u) << "one contact of a face and a leaf, though four corners pass";
  EXPECT_EQ(answer.contacts[0].vertex, (std::array<Index, 4>{0, 1, 2, NO_INDEX}));
}

TEST(ObstacleCheck, CoveredFacesAreNotMet) {
  // From inside the first voxel into the second: the face between them is covered, the second's far face is left.
  const auto surface = unitVoxels({leafAt(32768, 32768, 32768), leafAt(32769, 32768, 32768)});
  const Answer answer = run(*surface, ROPE, {{0.5, 0.5, 0.5}, {0.5, 0.5, 0.25}}, {{2.5, 0.5, 0.5}, {0.5, 0.5, 0.25}});
  ASSERT_EQ(answer.contacts.size(), 3u);
  EXPECT_TRUE(answer.contacts[0].initial);
  EXPECT_FALSE(answer.contacts[0].leaving);
  EXPECT_EQ(answer.contacts[1].voxel.x, 32769);
  EXPECT_TRUE(answer.contacts[1].leaving);
  EXPECT_EQ(answer.contacts[1].toc_lower, 0.75);
  EXPECT_EQ(answer.contacts[2].vertex[0], 1u);
  EXPECT_TRUE(answer.contacts[2].initial);
  EXPECT_FALSE(answer.contacts[2].leaving);
}

TEST(ObstacleCheck, WhatLeavesAndComesBackIsMet) {
  const auto surface = unitVoxels({leafAt(32768, 32768, 32768), leafAt(32771, 32768, 32768)});
  // The rope trails behind, so that its edge meets nothing that its first vertex does not.
  const Answer answer = run(*surface, ROPE, {{0.5, 0.5, 0.5}, {0.5, 0.5, 0.5}}, {{3.5, 0.5, 0.5}, {0.5, 0.5, 0.5}});
  ASSERT_EQ(answer.contacts.size(), 3u);
  EXPECT_TRUE(answer.contacts[0].initial);
  EXPECT_EQ(answer.contacts[1].vertex[0], 0u);
  EXPECT_EQ(answer.contacts[1].voxel.x, 32771);
  EXPECT_FALSE(answer.contacts[1].leaving) << "it goes in";
  EXPECT_EQ(answer.contacts[1].toc_lower, std::floor(2.5 / 3 * 0x1p32) * CELL);
}

TEST(ObstacleCheck, WhatPiercesAVoxelAtTheStartIsInitial) {
  const auto surface = unitVoxels({leafAt(32768, 32768, 32768)});
  const Answer edge = run(*surface, ROPE, {{0.5, 0.5, -3}, {0.5, 0.5, 3}}, {{0.5, 0.5, -3}, {0.5, 0.5, 3}});
  ASSERT_EQ(edge.contacts.size(), 1u);
  EXPECT_EQ(edge.contacts[0].kind, PairKind::EDGE_VOXEL_EDGE);
  EXPECT_TRUE(edge.contacts[0].initial);
  EXPECT_EQ(edge.contacts[0].toc_lower, 0);
  EXPECT_EQ(edge.contacts[0].toc_upper, CELL);
  const Positions wide = {{-9, -9, 0.5}, {11, -9, 0.5}, {1, 19, 0.5}};
  const Answer face = run(*surface, TRIANGLE, wide, wide);
  ASSERT_EQ(face.contacts.size(), 1u);
  EXPECT_EQ(face.contacts[0].kind, PairKind::FACE_VOXEL_CORNER);
  EXPECT_TRUE(face.contacts[0].initial);
}

TEST(ObstacleCheck, WhatTouchesAnEdgeOfTheBoxAtOnePointIsMet) {
  const auto surface = unitVoxels({leafAt(32768, 32768, 32768)});
  const Vec3 below(-0.5, 0.5, 0.5), above(0.5, 0.5, 1.5), away(-3, 0.5, 5);
  const Answer grazing = run(*surface, ROPE, {below, away}, {above, away});
  ASSERT_FALSE(grazing.contacts.empty());
  EXPECT_EQ(grazing.contacts[0].kind, PairKind::VERTEX_VOXEL_FACE);
  EXPECT_EQ(grazing.contacts[0].toc_lower, 0.5);
  const Answer resting = run(*surface, ROPE, {below, above}, {below, above});
  ASSERT_EQ(resting.contacts.size(), 1u);
  EXPECT_EQ(resting.contacts[0].kind, PairKind::EDGE_VOXEL_EDGE);
  EXPECT_TRUE(resting.contacts[0].initial);
}

TEST(ObstacleCheck, WhatPassesThroughIsNotLeavingWhatItWasNotIn) {
  const auto surface = unitVoxels({leafAt(32768, 32768, 32768), leafAt(32769, 32768, 32768)});
  const Answer through = run(*surface, ROPE, {{-1, 0.5, 0.5}, {-1, 0.5, 5}}, {{3, 0.5, 0.5}, {-1, 0.5, 5}});
  ASSERT_GE(through.contacts.size(), 2u);
  for (const Contact& contact : through.contacts) EXPECT_FALSE(contact.leaving) << contact.voxel.x;
}

TEST(ObstacleCheck, AWallThroughAPlateStartsInsideWithTheEdgesThatPierceIt) {
  // The plate is one voxel thick and its rim far away: what is near the wall's faces has no edge and no corner.
  std::vector<OccupiedLeaf> leaves;
  for (int i = 0; i < 20 * 20; ++i) leaves.push_back(leafAt(32768 + i % 20, 32768 + i / 20, 32768));
  constexpr Index COLUMNS = 9;
  Positions wall;  // below, above, below, …
  std::vector<Face> faces;
  for (Index i = 0; i < COLUMNS; ++i) {
    for (const double z : {-0.5, 1.5}) wall.emplace_back(5.5 + i, 9.5, z);
    if (i == 0) continue;
    faces.push_back({2 * i - 2, 2 * i, 2 * i - 1});
    faces.push_back({2 * i - 1, 2 * i, 2 * i + 1});
  }
  std::set<std::array<Index, 2>> piercing, found;
  for (Index i = 0; i < COLUMNS; ++i) {
    piercing.insert({2 * i, 2 * i + 1});
    if (i > 0) piercing.insert({2 * i - 1, 2 * i});
  }
  const Answer answer = run(*unitVoxels(leaves), Topology::fromTriangles(wall.size(), faces), wall, wall);
  for (const Contact& contact : answer.contacts) {
    EXPECT_EQ(contact.kind, PairKind::EDGE_VOXEL_EDGE);
    EXPECT_TRUE(contact.initial);
    found.insert({contact.vertex[0], contact.vertex[1]});
  }
  EXPECT_EQ(found, piercing);
}

TEST(ObstacleCheck, InteriorLeavesHoldWhatStartsInThem) {
  std::vector<OccupiedLeaf> leaves;
  for (int i = 0; i < 27; ++i) leaves.push_back(leafAt(32768 + i % 3, 32768 + i / 3 % 3, 32768 + i / 9));
  const auto surface = unitVoxels(leaves);
  const Positions inside = {{1.5, 1.5, 1.5}, {1.4, 1.5, 1.5}, {1.5, 1.4, 1.5}};
  const Answer answer = run(*surface, TRIANGLE, inside, inside);
  EXPECT_EQ(answer.contacts.size(), 3u);
  for (const Contact& contact : answer.contacts) EXPECT_TRUE(contact.initial);
}

TEST(ObstacleCheck, FeaturesOnInactiveVerticesAreLeftOut) {
  const auto surface = unitVoxels({leafAt(32768, 32768, 32768)});
  const Positions t0 = {{0.25, 0.25, 2}, {0.75, 0.25, 2}, {0.25, 0.75, 2}}, t1 = moved(t0, {0, 0, -1.5});
  EXPECT_EQ(run(*surface, TRIANGLE, t0, t1).contacts.size(), 3u);
  const std::uint8_t active[3] = {1, 0, 1};
  const Answer answer = run(*surface, TRIANGLE, t0, t1, {}, active);
  ASSERT_EQ(answer.contacts.size(), 2u);
  EXPECT_EQ(answer.contacts[0].vertex[0], 0u);
  EXPECT_EQ(answer.contacts[1].vertex[0], 2u);
  Positions broken = t0;
  broken[1][2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(run(*surface, TRIANGLE, broken, t1, {}, active).contacts.size(), 2u);
  EXPECT_EQ(run(*surface, TRIANGLE, broken, t1).contacts.size(), 2u) << "not finite is as good as inactive";
}

TEST(ObstacleCheck, ReusedItGivesTheSameAnswer) {
  const auto surface = unitVoxels({leafAt(32768, 32768, 32768)});
  ObstacleCheck test({});
  std::vector<Contact> first, second;
  ObstacleStats stats;
  const Positions t0 = {{0.5, 0.5, 3}, {0.5, 0.5, 5}}, t1 = {{0.5, 0.5, 0}, {0.5, 0.5, 5}};
  const Positions wide = {{-9, -9, 0.5}, {11, -9, 0.5}, {1, 19, 0.5}};
  test.run({*surface, ROPE, t0, t1}, first, stats);
  std::vector<Contact> other;
  test.run({*surface, TRIANGLE, wide, wide}, other, stats);
  test.run({*surface, ROPE, t0, t1}, second, stats);
  ASSERT_EQ(first.size(), second.size());
  EXPECT_EQ(first[0].toc_lower, second[0].toc_lower);
  EXPECT_EQ(other.size(), 1u);
}

TEST(ObstacleCheck, RefusesOptionsAndPositionsThatDoNotFit) {
  ObstacleOptions options;
  options.minimum_separation_m = 0.1;
  EXPECT_THROW(ObstacleCheck{options}, std::invalid_argument) << "exact has no separation";
  options.minimum_separation_m = -1;
  EXPECT_THROW(ObstacleCheck{options}, std::invalid_argument);
  const auto surface = unitVoxels({leafAt(32768, 32768, 32768)});
  EXPECT_THROW(run(*surface, ROPE, {{0, 0, 0}}, {{0, 0, 0}}), std::invalid_argument);
}

}  // namespace
}  // namespace dccd
