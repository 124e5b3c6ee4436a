// Patches against their definition, pair by pair, and scenes whose patches are known.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "oracle/oracle.h"
#include "support/patch_oracle.h"
#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

Options withPatches(int threads = 1) {
  Options options;
  options.patches = true;
  options.num_threads = threads;
  return options;
}

Body sheet(const std::string& name, std::size_t rows, std::size_t cols) {
  return bodyOf(name, Topology::grid(rows, cols));
}

/// One triangle.
Body triangle(const std::string& name) { return bodyOf(name, Topology::fromTriangles(3, {{0, 1, 2}})); }

/// Leaves of edge 1, 2 and 4, in no order.
std::shared_ptr<const VoxelSurface> randomMap(const Draw& draw, double resolution_m) {
  std::vector<OccupiedLeaf> leaves;
  for (int x = -3; x < 3; ++x) {
    for (int y = -3; y < 3; ++y) {
      for (int z = -1; z < 1; ++z) {
        switch (draw(0, 3)) {
          case 0:
            leaves.push_back(voxelAt(4 * x, 4 * y, 4 * z, 4));
            break;
          case 1:
            for (int i = 0; i < 8; ++i) {
              if (draw(0, 1)) leaves.push_back(voxelAt(4 * x + 2 * (i & 1), 4 * y + (i & 2), 4 * z + (i & 4) / 2, 2));
            }
            break;
          case 2:
            for (int i = 0; i < 64; ++i) {
              if (draw(0, 2) == 0) leaves.push_back(voxelAt(4 * x + i % 4, 4 * y + i / 4 % 4, 4 * z + i / 16));
            }
            break;
          default:
            break;
        }
      }
    }
  }
  return VoxelSurface::build(resolution_m, leaves);
}

TEST(Patches, AreThoseOfTheDefinitionOnSmallScenes) {
  std::size_t patches = 0, with_several = 0, crossings = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const Draw draw = drawFrom(seed);
    TestStep scene = randomStep(draw, 40, static_cast<Coordinates>(draw(0, static_cast<int>(Coordinates::COUNT) - 1)));
    const Outcome outcome = runOnce(scene, withPatches());
    ASSERT_EQ(patchProblem(outcome), "") << "seed " << seed;
    patches += outcome.patches.size();
    for (const Patch& patch : outcome.patches) {
      with_several += patch.contacts > 1;
      crossings += patch.crossings;
    }
  }
  EXPECT_GT(patches, 300u);
  EXPECT_GT(with_several, 50u);
  EXPECT_GT(crossings, 50u);
}

TEST(Patches, AreThoseOfTheDefinitionOnCrumpledClothsAndOverAMap) {
  std::size_t patches = 0, on_map = 0, contacts = 0;
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    Step step = crumpled(seed, 1 + static_cast<int>(seed % 3), 12).motion();
    const Draw draw = drawFrom(1000 + seed);
    step.map.surface = randomMap(draw, 0.05 + 0.1 * static_cast<double>(seed));
    const Outcome outcome = Detector(withPatches()).run(step);
    ASSERT_EQ(patchProblem(outcome), "") << "seed " << seed;
    patches += outcome.patches.size();
    contacts += outcome.contacts.size();
    on_map += static_cast<std::size_t>(std::count_if(outcome.patches.begin(), outcome.patches.end(),
                                                     [](const Patch& p) { return p.body[1] == OBSTACLE_BODY; }));
  }
  EXPECT_GT(on_map, 20u);
  EXPECT_GT(patches, 100u);
  EXPECT_GT(contacts, 5000u);
}

/// Centroids and normals of patches between meshes, from their contacts one by one.
void expectPlaces(const Outcome& outcome) {
  struct Sums {
    Vec3 points = Vec3::Zero(), normals = Vec3::Zero(), first_normal = Vec3::Zero();
    std::size_t contacts = 0;
  };
  std::vector<Sums> sums(outcome.patches.size());
  for (std::size_t c = 0; c < outcome.contacts.size(); ++c) {
    const Contact& contact = outcome.contacts[c];
    if (contact.body[1] == OBSTACLE_BODY) continue;
    Vec3 x[4];
    for (std::size_t i = 0; i < 4; ++i) x[i] = (*outcome.step->bodies[contact.bodyOf(i)].t0)[contact.vertex[i]];
    const bool edges = contact.kind == PairKind::EDGE_EDGE;
    Vec3 normal = (edges ? (x[1] - x[0]).cross(x[3] - x[2]) : (x[2] - x[1]).cross(x[3] - x[1])).normalized();
    if (normal.dot(x[0] - x[edges ? 2 : 1]) < 0) normal = -normal;
    Sums& sum = sums[outcome.patch_of[c]];
    if (sum.contacts++ == 0) sum.first_normal = normal;
    const bool self = contact.body[0] == contact.body[1];
    const bool turned = self ? sum.first_normal.dot(normal) < 0 : contact.body[0] > contact.body[1];
    sum.points += contactGeometry(outcome, contact).point;
    sum.normals += turned ? Vec3(-normal) : normal;
  }
  for (std::size_t p = 0; p < sums.size(); ++p) {
    if (sums[p].contacts == 0) continue;
    const Patch& patch = outcome.patches[p];
    EXPECT_LT((patch.centroid - sums[p].points / static_cast<double>(sums[p].contacts)).norm(), 1e-6) << "patch " << p;
    EXPECT_LT((patch.normal - sums[p].normals.normalized()).norm(), 1e-6) << "patch " << p;
  }
}

TEST(Patches, AreTheSameBitsForAnyNumberOfThreads) {
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    Step step = crumpled(seed, 3, 60).motion();
    step.map.surface = randomMap(drawFrom(seed), 0.7);
    const Outcome one = Detector(withPatches(1)).run(step);
    std::map<std::pair<PairKind, std::array<std::uint16_t, 2>>, std::size_t> alike;
    for (const Contact& contact : one.contacts) ++alike[{contact.kind, contact.body}];
    ASSERT_TRUE(std::any_of(alike.begin(), alike.end(), [](const auto& of) { return of.second > 4096; }))
        << "too few for more than one piece";
    ASSERT_EQ(patchProblem(one), "");
    expectPlaces(one);
    for (const int threads : {2, 3}) {
      EXPECT_EQ(patchDifference(one, Detector(withPatches(threads)).run(step)), "") << threads << " threads";
    }
    // Whoever has made patches of something else before makes the same ones.
    Detector used(withPatches());
    used.run(crumpled(seed + 7, 2, 9).motion());
    EXPECT_EQ(patchDifference(one, used.run(step)), "");
  }
}

TEST(Patches, AFineClothInsideOfOneLargeTriangleIsOne) {
  Step step;
  step.bodies = {moving(sheet("cloth", 9, 9), gridAt(9, 9, 0.01, {0, 0, 0.005}), gridAt(9, 9, 0.01, {0, 0, -0.005})),
                 moving(triangle("table"), {Vec3(-9, -9, 0), Vec3(9, -9, 0), Vec3(0, 9, 0)},
                        {Vec3(-9, -9, 0), Vec3(9, -9, 0), Vec3(0, 9, 0)})};
  const Outcome outcome = Detector(withPatches()).run(step);
  EXPECT_EQ(outcome.contacts.size(), 81u);
  ASSERT_EQ(outcome.patches.size(), 1u);
  const Patch& patch = outcome.patches[0];
  EXPECT_EQ(patch.body, (std::array<std::uint16_t, 2>{0, 1}));
  EXPECT_EQ(patch.contacts, 81u);
  EXPECT_NEAR(patch.area_m2, 0.08 * 0.08, 1e-12) << "the cloth's, not the triangle's";
  EXPECT_LT((patch.centroid - Vec3(0.04, 0.04, 0)).norm(), 1e-9);
  EXPECT_LT((patch.normal - Vec3::UnitZ()).norm(), 1e-12) << "from the table up to the cloth";
  EXPECT_LT((patch.box.max - Vec3(0.08, 0.08, 0)).norm(), 1e-9);
  EXPECT_NEAR(patch.toc_lower, 0.5, 1e-6);
  // Named the other way round the normal is the other body's.
  std::swap(step.bodies[0], step.bodies[1]);
  const Outcome turned = Detector(withPatches()).run(step);
  ASSERT_EQ(turned.patches.size(), 1u);
  EXPECT_LT((turned.patches[0].normal + Vec3::UnitZ()).norm(), 1e-12);
}

TEST(Patches, TwoFingersUnderASheetStayTwoAlsoUnderOneTriangle) {
  // Both fingers are one body; the sheet is one triangle, or a fine one.
  Body hand;
  hand.name = "hand";
  hand.topology = share(Topology::fromTriangles(8, {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {4, 5, 6}, {4, 6, 7}, {4, 7, 5}}));
  Positions fingers;
  for (const double x : {0.0, 0.3}) {
    fingers.emplace_back(x, 0, 0);
    fingers.emplace_back(x + 0.02, 0, -0.1);
    fingers.emplace_back(x - 0.02, 0.02, -0.1);
    fingers.emplace_back(x - 0.02, -0.02, -0.1);
  }
  const Positions large = {Vec3(-2, -2, 0.05), Vec3(2, -2, 0.05), Vec3(0, 4, 0.05)};
  for (const bool fine : {false, true}) {
    const Body cloth = fine ? sheet("cloth", 41, 41) : triangle("cloth");
    const Positions t0 = fine ? gridAt(41, 41, 0.02, {-0.203, -0.207, 0.05}) : large;
    Step step;
    step.bodies = {moving(cloth, t0, movedBy(t0, Vec3(0, 0, -0.06))), moving(hand, fingers, fingers)};
    const Outcome outcome = Detector(withPatches()).run(step);
    ASSERT_EQ(outcome.patches.size(), 2u) << (fine ? "fine" : "one triangle");
    EXPECT_LT(std::abs(outcome.patches[0].centroid.x() - outcome.patches[1].centroid.x()) - 0.3, 0.05);
  }
}

TEST(Patches, AClothOnATableIsOneWhateverTheVoxelsAndTwoPostsAreTwo) {
  const Positions t0 = gridAt(21, 21, 0.02, {0.0063, 0.0063, 0.01}), t1 = movedBy(t0, Vec3(0, 0, -0.02));
  Step step;
  step.bodies = {moving(sheet("cloth", 21, 21), t0, t1)};
  // A table of voxels coarser than the cloth, as fine, and finer.
  for (const double resolution_m : {0.05, 0.021, 0.005}) {
    const int n = static_cast<int>(0.5 / resolution_m);
    step.map.surface = VoxelSurface::build(resolution_m, voxelsOfBox({-2, -2, -8}, {n, n, 0}));
    const Outcome outcome = Detector(withPatches()).run(step);
    ASSERT_EQ(outcome.patches.size(), 1u) << resolution_m;
    EXPECT_EQ(outcome.patches[0].body, (std::array<std::uint16_t, 2>{0, OBSTACLE_BODY}));
    EXPECT_LT((outcome.patches[0].normal - Vec3::UnitZ()).norm(), 1e-9) << resolution_m;
    EXPECT_LE(outcome.patches[0].area_m2, 0.4 * 0.4 * (1 + 1e-9)) << resolution_m;
    EXPECT_NEAR(outcome.patches[0].toc_lower, 0.5, 1e-6);
  }
  std::vector<OccupiedLeaf> posts = voxelsOfBox({2, 2, -2}, {5, 5, 0});
  for (const OccupiedLeaf& leaf : voxelsOfBox({12, 12, -2}, {15, 15, 0})) posts.push_back(leaf);
  step.map.surface = VoxelSurface::build(0.02, posts);
  EXPECT_EQ(Detector(withPatches()).run(step).patches.size(), 2u) << "two posts";
  // A patch is as fine as the mesh is: one triangle over both is one. Of its area counts what the voxels have of it.
  step.bodies = {moving(triangle("cover"), {Vec3(-2, -2, 0.01), Vec3(2, -2, 0.01), Vec3(0, 4, 0.01)},
                        {Vec3(-2, -2, -0.01), Vec3(2, -2, -0.01), Vec3(0, 4, -0.01)})};
  const Outcome outcome = Detector(withPatches()).run(step);
  ASSERT_EQ(outcome.patches.size(), 1u);
  EXPECT_NEAR(outcome.patches[0].area_m2, 2 * 4 * 0.02 * 0.02, 1e-9) << "two times four leaves with corners";
}

TEST(Patches, TwoPlacesOnOneClothStayTwo) {
  const Positions t0 = gridAt(31, 31, 0.02, {0, 0, 0.01});
  const auto pin = [](double x, double y) {
    return Positions{Vec3(x, y, 0), Vec3(x + 0.01, y, -0.1), Vec3(x, y + 0.01, -0.1)};
  };
  Step step;
  step.bodies = {moving(sheet("cloth", 31, 31), t0, movedBy(t0, Vec3(0, 0, -0.02))),
                 moving(triangle("a"), pin(0.105, 0.103), pin(0.105, 0.103)),
                 moving(triangle("b"), pin(0.111, 0.108), pin(0.111, 0.108))};
  EXPECT_EQ(Detector(withPatches()).run(step).patches.size(), 2u) << "of different partners, in the same place";
}

TEST(Patches, SurfacesThatCrossAtTheStartAreInThem) {
  const Positions flat_t0 = gridAt(5, 5, 0.1, {0, 0, 0});
  Positions upright;
  for (const Vec3& p : gridAt(5, 5, 0.1, {0.03, -0.17, 0.21})) upright.emplace_back(p.x(), p.z(), p.y());
  Step step;
  step.bodies = {moving(sheet("lying", 5, 5), flat_t0, flat_t0), moving(sheet("upright", 5, 5), upright, upright)};
  const Outcome outcome = Detector(withPatches()).run(step);
  ASSERT_GT(outcome.intersections.size(), 0u);
  EXPECT_EQ(outcome.contacts.size(), 0u);
  ASSERT_EQ(outcome.patches.size(), 1u);
  EXPECT_EQ(outcome.patches[0].crossings, outcome.intersections.size());
  EXPECT_EQ(outcome.patches[0].toc_upper, 0);
  EXPECT_NEAR(outcome.patches[0].centroid.y(), 0.21, 1e-9);
  EXPECT_NEAR(outcome.patches[0].centroid.z(), 0, 1e-9);
}

TEST(Patches, AreOfAllContactsAlsoOfThoseThatAreNotListed) {
  const Step step = crumpled(3, 2, 12).motion();
  Options options = withPatches();
  const Outcome all = Detector(options).run(step);
  options.max_contacts = 10;
  const Outcome cut = Detector(options).run(step);
  ASSERT_GT(all.contacts.size(), 100u);
  ASSERT_EQ(cut.contacts.size(), 10u);
  ASSERT_EQ(cut.patch_of.size(), 10u);
  EXPECT_EQ(cut.patches.size(), all.patches.size());
  for (std::size_t i = 0; i < 10; ++i) {
    const auto same = std::find_if(all.contacts.begin(), all.contacts.end(), [&](const Contact& c) {
      return !canonicalLess(c, cut.contacts[i]) && !canonicalLess(cut.contacts[i], c);
    });
    ASSERT_NE(same, all.contacts.end());
    EXPECT_EQ(cut.patch_of[i], all.patch_of[static_cast<std::size_t>(same - all.contacts.begin())]);
  }
  // A contact that lasts is in a patch, also where it is not listed.
  Step resting;
  const Positions x = gridAt(5, 5, 0.02, {0, 0, 0});
  resting.bodies = {moving(sheet("cloth", 5, 5), x, x)};
  resting.map.surface = VoxelSurface::build(0.02, voxelsOfBox({-2, -2, -2}, {9, 9, 0}));
  options = withPatches();
  options.suppress_initial = true;
  const Outcome suppressed = Detector(options).run(resting);
  EXPECT_EQ(suppressed.contacts.size(), 0u);
  EXPECT_EQ(suppressed.patch_of.size(), 0u);
  ASSERT_EQ(suppressed.patches.size(), 1u);
  EXPECT_EQ(suppressed.patches[0].initial, suppressed.patches[0].contacts);
}

TEST(Patches, OfATurningBodyArePlacedOnItsPath) {
  // A blade turns by a half about z and meets a thin post a quarter turn on.
  Body blade = triangle("blade");
  blade.rigid = true;
  const Positions t0 = {Vec3(0, 0, 0), Vec3(1, 0, -0.1), Vec3(1, 0, 0.1)};
  Step step;
  step.bodies = {moving(blade, t0, {Vec3(0, 0, 0), Vec3(-1, 0, -0.1), Vec3(-1, 0, 0.1)}), triangle("post")};
  step.bodies[0].turns = true;
  step.bodies[0].pose_t1.linear() = Eigen::AngleAxisd(M_PI - 1e-9, Vec3::UnitZ()).toRotationMatrix();
  const Positions post = {Vec3(0.001, 0.5, -1), Vec3(0, 0.5, 1), Vec3(0, 0.51, 1)};
  step.bodies[1] = moving(step.bodies[1], post, post);
  const Outcome outcome = Detector(withPatches()).run(step);
  ASSERT_GT(outcome.substeps, 1u);
  ASSERT_EQ(outcome.patches.size(), 1u);
  EXPECT_LT((outcome.patches[0].centroid.head<2>() - Eigen::Vector2d(0, 0.5)).norm(), 0.02);
}

// Contacts between meshes that touch when the step begins are initial, all others are not: by exact truth.
TEST(Patches, WhatTouchesAtTheStartIsInitial) {
  std::size_t initial = 0, at_zero = 0, later = 0;
  const auto judge = [&](const TestStep& step, const Outcome& outcome) {
    for (const Contact& contact : outcome.contacts) {
      PairMotion at_start = motionOf(step, contact);
      std::copy_n(&at_start.x[0][0][0], 12, &at_start.x[1][0][0]);
      const bool touches = firstContact(contact.kind, at_start).has_value();
      EXPECT_EQ(contact.initial, touches) << describe(contact);
      initial += touches;
      at_zero += !touches && contact.toc_lower == 0;
      later += contact.toc_lower > 0;
    }
  };
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const Draw draw = drawFrom(seed);
    const Coordinates styles[] = {Coordinates::SMALL_INTEGERS, Coordinates::FEW_BITS,   Coordinates::FLAT,
                                  Coordinates::AT_REST,        Coordinates::COINCIDENT, Coordinates::REAL};
    const TestStep scene = randomStep(draw, 16, styles[seed % 6]);
    judge(scene, runOnce(scene, Options()));
    judge(scene, runOnce(scene, withPatches()));
  }
  // A cloth that lies on another one, as felt under a finger does: of two frames the second begins in contact.
  TestStep resting;
  for (int b = 0; b < 2; ++b) {
    StepBody body;
    body.topology = Topology::grid(6, 6);
    body.t0 = body.t1 = gridAt(6, 6, 1, {0.375 * b, 0.25 * b, 0});
    for (Vec3& p : body.t1) p.z() += b == 0 ? 0 : -0.125;
    resting.bodies.push_back(body);
  }
  const Outcome outcome = runOnce(resting, Options());
  judge(resting, outcome);
  EXPECT_EQ(outcome.counts.initial, outcome.contacts.size());
  EXPECT_EQ(outcome.touching, Touching::LASTING);
  EXPECT_GT(initial, 1000u);
  EXPECT_GT(later, 100u);
  EXPECT_GT(at_zero, 0u) << "a cell that begins at 0, but no touch there";
}

TEST(Patches, OfABodyWithItselfHasTheAreaOfOneSideAndOneNormal) {
  StepBody body;
  body.topology = Topology::fromTriangles(6, {{0, 1, 2}, {3, 4, 5}});
  body.t0 = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 1, 1}, {-3, 1, 1}, {1, -3, 1}};
  body.t1 = body.t0;
  for (Index v = 3; v < 6; ++v) body.t1[v].z() = -1;
  TestStep step;
  step.bodies = {body};
  const Outcome outcome = runOnce(step, withPatches());
  ASSERT_EQ(outcome.patches.size(), 1u);
  EXPECT_GT(outcome.patches[0].contacts, 1u) << "a corner of either triangle meets the other one";
  EXPECT_NEAR(outcome.patches[0].area_m2, 8, 1e-12);
  EXPECT_NEAR(std::abs(outcome.patches[0].normal.z()), 1, 1e-12);
}

}  // namespace
}  // namespace test
}  // namespace dccd
