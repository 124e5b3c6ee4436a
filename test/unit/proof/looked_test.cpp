// What nobody looked at is a gap, whichever of the witnesses is missing.
#include "proof/looked.h"

#include <gtest/gtest.h>

#include <functional>
#include <vector>

#include "dccd/assurance.h"
#include "support/said.h"
#include "unit/step/two_sheets.h"

namespace dccd {
namespace test {
namespace {

/// Two cloths near each other, and a rigid body that is far from both; all are tested against the map.
std::vector<Body> threeBodies() {
  std::vector<Body> bodies(3);
  bodies[2].rigid = true;
  return bodies;
}

using Witness = std::function<void(Looked&)>;

/// All that these bodies ask for.
std::vector<Witness> witnesses() {
  const auto at = [](PairKind kind, std::size_t a, std::size_t b) {
    return [=](Looked& looked) { looked.at(kind, a, b); };
  };
  std::vector<Witness> all{[](Looked& looked) {
                             looked.compared({0, 1});
                           },
                           [](Looked& looked) { looked.atStart(); },
                           [](Looked& looked) { looked.atItself(1); },
                           at(PairKind::VERTEX_FACE, 0, 0),
                           at(PairKind::EDGE_EDGE, 0, 0),
                           at(PairKind::VERTEX_FACE, 0, 1),
                           at(PairKind::VERTEX_FACE, 1, 0),
                           at(PairKind::EDGE_EDGE, 0, 1)};
  for (std::size_t b = 0; b < 3; ++b) all.push_back([=](Looked& looked) { looked.atMap(b); });
  return all;
}

TEST(Looked, EachWitnessThatIsMissingIsAGap) {
  const std::vector<Body> bodies = threeBodies();
  const std::vector<Witness> all = witnesses();
  Looked looked;
  for (std::size_t missing = 0; missing <= all.size(); ++missing) {
    looked.begin();
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (i != missing) all[i](looked);
    }
    EXPECT_EQ(looked.gaps(bodies, true, true).empty(), missing == all.size()) << "without witness " << missing;
  }
}

TEST(Looked, NothingIsLookedAtWhenAPartBegins) {
  const std::vector<Body> bodies = threeBodies();
  Looked looked;
  for (const Witness& one : witnesses()) one(looked);
  looked.begin();
  // Two bodies against themselves, three pairs of bodies, three bodies against the map, the start.
  EXPECT_EQ(looked.gaps(bodies, true, true).size(), 9u);
  EXPECT_EQ(looked.gaps(bodies, false, false).size(), 5u);
}

TEST(Looked, WhatIsLeftOutByChoiceIsNoGap) {
  std::vector<Body> bodies = threeBodies();
  for (Body& body : bodies) body.self_collision = body.against_obstacle = false;
  bodies[0].not_against = {1, 2};
  bodies[1].against_bodies = false;
  Looked looked;
  looked.begin();
  EXPECT_TRUE(looked.gaps(bodies, true, false).empty());
}

TEST(Claim, HoldsOnceEachPartWithoutAGapFollowsTheOneBefore) {
  Claim claim;
  EXPECT_FALSE(claim.holds());
  claim.add(0, 3, {});
  claim.add(1, 3, {});
  EXPECT_FALSE(claim.holds());
  EXPECT_TRUE(mentions(claim.inWords({}).at(0), "nobody looked at all of the step"));
  claim.add(2, 3, {});
  EXPECT_TRUE(claim.holds());

  Claim skipped;
  skipped.add(0, 3, {});
  skipped.add(2, 3, {});
  EXPECT_FALSE(skipped.holds());

  Claim gap;
  gap.add(0, 2, {});
  gap.add(1, 2, {Gap{{0, OBSTACLE_BODY}}, Gap{{1, 1}}, Gap{{0, 0}, true}});
  EXPECT_FALSE(gap.holds());
  const std::vector<std::string> said = gap.inWords({"cloth", "finger"});
  ASSERT_EQ(said.size(), 3u);
  EXPECT_EQ(said[0], "nobody looked whether 'cloth' touches the map from 0.5 to 1 of the step");
  EXPECT_EQ(said[1], "nobody looked whether 'finger' touches itself from 0.5 to 1 of the step");
  EXPECT_EQ(said[2], "nobody looked whether surfaces cross at 0.5 of the step");
}

TEST(Claim, WithoutOneNoAnswerIsProved) {
  Outcome outcome = TwoSheets(0.3, 0.05).answer();
  EXPECT_TRUE(outcome.claim.holds());
  EXPECT_TRUE(assuranceOf(outcome).clear());
  outcome.claim = Claim();
  EXPECT_FALSE(assuranceOf(outcome).proved);
  ASSERT_EQ(assuranceOf(outcome).missing.size(), 1u);
  EXPECT_TRUE(mentions(assuranceOf(outcome).missing[0], "nobody looked"));
}

/// What spares a search says itself that it does.
struct Spared : testing::Test {
  TwoSheets sheets{0.3, 0.2};
  History history;

  Outcome run() {
    const Outcome outcome = detect(sheets.step, sheets.options, history);
    EXPECT_TRUE(outcome.complete);
    EXPECT_TRUE(outcome.claim.holds()) << outcome.claim.inWords({"upper", "lower"}).at(0);
    return outcome;
  }
  /// The upper one is moved on as it is.
  void goOn() {
    Body& upper = sheets.upper();
    upper.t0 = upper.t1;
    upper.t1 = share(movedBy(*upper.t0, {0, 0, -0x1p-6}));
  }
  void putMap(int z) { sheets.step.map.surface = VoxelSurface::build(0.25, {voxelAt(0, 0, z)}); }
};

TEST_F(Spared, TheSelfTestOfASurfaceWithoutAFold) { EXPECT_EQ(run().stats.unfolded_bodies, 2u); }

TEST_F(Spared, TheSelfTestOfWhatKeepsItsShape) {
  sheets.options.unfolded_test = false;
  EXPECT_GT(run().stats[Stage::BROAD_PHASE].in, 0u);
  goOn();
  EXPECT_EQ(run().stats[Stage::BROAD_PHASE].in, 0u);
}

TEST_F(Spared, TheMapThatIsFarAndThatOfWhatRests) {
  putMap(-9);
  EXPECT_EQ(run().stats[Stage::OBSTACLE].in, 0u);
  putMap(-1);
  for (int i = 0; i < 3; ++i) {
    const Outcome outcome = run();
    EXPECT_GT(outcome.stats[Stage::OBSTACLE].in, 0u);
    EXPECT_EQ(outcome.stats.map_answers_kept > 0, i > 0);
    goOn();
  }
}

TEST_F(Spared, WhatHasNoFeatures) {
  for (Body& body : sheets.step.bodies) body.topology = share(Topology::polyline(16));
  EXPECT_EQ(run().start_state, StartState::CLEAR);
}

TEST_F(Spared, TheRestOfAStepOfWhichTheFirstContactIsWanted) {
  sheets = TwoSheets(0.3, -0.3);
  sheets.options.earliest_only = true;
  EXPECT_GT(run().total_contacts, 0u);
}

TEST_F(Spared, PartsOfAStepAreAllThere) {
  Body& upper = sheets.upper();
  upper.turns = upper.rigid = true;
  upper.pose_t1 = Eigen::AngleAxisd(0.5, Vec3::UnitZ());
  Positions t1 = *upper.t0;
  for (Vec3& x : t1) x = upper.pose_t1 * x;
  upper.t1 = share(t1);
  upper.t0 = share(sheetAt(0.001));
  EXPECT_GE(run().substeps, 1u);
}

}  // namespace
}  // namespace test
}  // namespace dccd
