// What nobody looked at is a gap, whichever of the witnesses is missing.
#include "proof/looked.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <utility>
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

constexpr auto COUNT = static_cast<std::size_t>(Question::COUNT);

/// Of two bodies; all but one answer are given. which: by question and body, the latter 0 where it is none of a body.
Claim claimWithout(std::pair<std::size_t, std::size_t> which, bool of_cell) {
  Claim claim;
  claim.ask(2);
  if (of_cell) claim.askOfCell();
  claim.add(0, 1, {});
  for (std::size_t q = 0; q < COUNT; ++q) {
    for (std::size_t b = 0; b < 2; ++b) {
      if (std::make_pair(q, b) != which) claim.answer(static_cast<Question>(q), "", b);
    }
  }
  return claim;
}

TEST(Claim, EachAnswerThatIsMissingTakesItAway) {
  const std::size_t none = COUNT;
  EXPECT_TRUE(claimWithout({none, 0}, true).holds());
  std::vector<Body> bodies(2);
  bodies[0].name = "cloth";
  bodies[1].name = "finger";
  std::size_t of_bodies = 0, of_cells = 0;
  for (std::size_t q = 0; q < COUNT; ++q) {
    // What is not of a body is answered by either call of the loop: leave out both.
    Claim neither;
    neither.ask(2);
    neither.askOfCell();
    neither.add(0, 1, {});
    for (std::size_t other = 0; other < COUNT; ++other) {
      for (std::size_t b = 0; other != q && b < 2; ++b) neither.answer(static_cast<Question>(other), "", b);
    }
    EXPECT_FALSE(neither.holds()) << q;
    EXPECT_FALSE(neither.holdsButForTime()) << q;
    for (const std::string& sentence : neither.missing(bodies)) EXPECT_EQ(sentence.rfind("nobody looked ", 0), 0u);
    const bool is_of_body = neither.missing(bodies).size() == 2;
    of_bodies += is_of_body;
    for (std::size_t b = 0; b < 2; ++b) {
      const Claim claim = claimWithout({q, b}, true);
      EXPECT_EQ(claim.holds(), !is_of_body) << q;
      if (is_of_body) EXPECT_TRUE(mentions(claim.missing(bodies).at(0), "'" + bodies[b].name + "'"));
    }
    // Of a step that nobody made of messages less is asked.
    Claim by_hand = claimWithout({none, 0}, false);
    EXPECT_TRUE(by_hand.holds());
    Claim alone;
    alone.ask(0);
    alone.add(0, 1, {});
    for (std::size_t other = 0; other < COUNT; ++other) {
      if (other != q) alone.answer(static_cast<Question>(other), "");
    }
    of_cells += alone.holds() && !is_of_body;
  }
  EXPECT_EQ(of_bodies, 5u);
  EXPECT_EQ(of_cells, 9u);
}

TEST(Claim, OneAnswerThatIsNoTakesItAway) {
  for (std::size_t q = 0; q < COUNT; ++q) {
    Claim claim = claimWithout({COUNT, 0}, true);
    claim.answer(static_cast<Question>(q), "it is not", 1);
    claim.answer(static_cast<Question>(q), "", 1);
    EXPECT_FALSE(claim.holds());
    EXPECT_EQ(claim.holdsButForTime(), static_cast<Question>(q) == Question::TIME);
    EXPECT_EQ(claim.missing({}), std::vector<std::string>{"it is not"});
  }
}

TEST(Claim, HoldsOnceEachPartWithoutAGapFollowsTheOneBefore) {
  const auto begun = [] {
    Claim claim = claimWithout({COUNT, 0}, false);
    claim.add(0, 3, {});
    return claim;
  };
  Claim claim = begun();
  claim.add(1, 3, {});
  EXPECT_FALSE(claim.holds());
  EXPECT_TRUE(mentions(claim.missing({}).at(0), "nobody looked at all of the step"));
  claim.add(2, 3, {});
  EXPECT_TRUE(claim.holds());
  EXPECT_TRUE(claim.missing({}).empty());

  Claim skipped = begun();
  skipped.add(2, 3, {});
  EXPECT_FALSE(skipped.holds());

  Claim gap = claimWithout({COUNT, 0}, false);
  gap.add(0, 2, {});
  gap.add(1, 2, {Gap{{0, OBSTACLE_BODY}}, Gap{{1, 1}}, Gap{{0, 0}, true}});
  EXPECT_FALSE(gap.holds());
  std::vector<Body> bodies(2);
  bodies[0].name = "cloth";
  bodies[1].name = "finger";
  const std::vector<std::string> said = gap.missing(bodies);
  ASSERT_EQ(said.size(), 3u);
  EXPECT_EQ(said[0], "nobody looked whether 'cloth' touches the map from 0.5 to 1 of the step");
  EXPECT_EQ(said[1], "nobody looked whether 'finger' touches itself from 0.5 to 1 of the step");
  EXPECT_EQ(said[2], "nobody looked whether surfaces cross at 0.5 of the step");
  gap.answer(Question::TIME, "it ran out");
  EXPECT_EQ(gap.missing(bodies), std::vector<std::string>{"it ran out"}) << "which tells of the gaps";
  EXPECT_TRUE(gap.holdsButForTime());
}

TEST(Claim, WithoutOneNoAnswerIsProved) {
  EXPECT_FALSE(Claim().holds());
  EXPECT_FALSE(Claim().missing({}).empty());
  Outcome outcome = TwoSheets(0.3, 0.05).answer();
  EXPECT_TRUE(outcome.claim.holds());
  EXPECT_TRUE(assuranceOf(outcome).clear());
  Outcome of_cell = outcome;
  of_cell.claim.askOfCell();
  EXPECT_FALSE(assuranceOf(of_cell).proved) << "nobody answers for what came";
  outcome.claim = Claim();
  EXPECT_FALSE(assuranceOf(outcome).proved);
  ASSERT_EQ(assuranceOf(outcome).missing.size(), 1u);
  EXPECT_TRUE(mentions(assuranceOf(outcome).missing[0], "nobody looked"));
}

TEST(Claim, OfARecordingIsWhatWasSaid) {
  EXPECT_TRUE(Claim::thatWasSaid({}).holds());
  const Claim two = Claim::thatWasSaid({"this", "that"});
  EXPECT_FALSE(two.holds());
  EXPECT_EQ(two.missing({}), (std::vector<std::string>{"this", "that"}));
}

/// What spares a search says itself that it does.
struct Spared : testing::Test {
  TwoSheets sheets{0.3, 0.2};
  History history;

  Outcome run() {
    const Outcome outcome = detect(sheets.step, sheets.options, history);
    EXPECT_TRUE(outcome.complete);
    EXPECT_TRUE(outcome.claim.holds()) << outcome.missing().at(0);
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
