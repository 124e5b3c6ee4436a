// The list behind "proved": one thing of it is taken away at a time, and what the user left out is named.
#include "dccd/assurance.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <random>

#include "support/said.h"
#include "unit/step/two_sheets.h"

namespace dccd {
namespace test {
namespace {

constexpr double LOST = std::numeric_limits<double>::quiet_NaN();

/// A sheet that comes down on another one, and stays 5 cm above it.
struct Asked : TwoSheets {
  Asked() : TwoSheets(0.3, 0.05) {}
};

void move(Body& body, double z0, double z1) {
  body.t0 = share(sheetAt(z0));
  body.t1 = share(sheetAt(z1));
}

bool oneMentions(const std::vector<std::string>& sentences, const std::string& words) {
  return std::any_of(sentences.begin(), sentences.end(),
                     [&](const std::string& sentence) { return mentions(sentence, words); });
}

void lose(Asked& asked) {
  Positions t1 = sheetAt(0.05);
  t1[3].y() = LOST;
  asked.upper().t1 = share(t1);
}

void loosen(Asked& asked) { asked.upper().topology = share(Topology::fromTriangles(16, {{0, 1, 2}})); }

void leaveRigidPoints(Asked& asked) {
  asked.upper().rigid = true;
  asked.upper().topology = share(Topology::fromTriangles(16, {}));
}

void turnFar(Asked& asked) {
  asked.upper().turns = asked.upper().rigid = true;
  asked.upper().pose_t1 = Eigen::AngleAxisd(3, Vec3::UnitZ()) * Eigen::Translation3d(0, 0, -0.25);
  Positions t1 = sheetAt(0.3);
  for (Vec3& x : t1) x = asked.upper().pose_t1 * x;
  asked.upper().t1 = share(t1);
  asked.options.max_substeps = 2;
}

struct Missing {
  const char* what;
  const char* sentence;
  std::function<void(Asked&)> take;
};

const std::vector<Missing>& list() {
  static const std::vector<Missing> LIST = {
      {"a position", "1 vertex is not finite and was not checked (the first is 3 of 'upper')", lose},
      {"a face", "7 faces were sent that cannot be used", [](Asked& a) { a.upper().dropped_faces = 7; }},
      {"a surface at a vertex", "13 vertices belong to no face and no edge", loosen},
      {"a rigid body's surface", "16 vertices belong to no face and no edge", leaveRigidPoints},
      {"the map that is expected", "nobody came",
       [](Asked& a) {
         a.options.obstacle_expected = true;
         a.step.map.problem = "nobody came";
       }},
      {"the start state", "whether surfaces cross at the start", [](Asked& a) { a.options.check_start_state = false; }},
      {"the time that it takes", "the step budget ran out", [](Asked& a) { a.options.step_budget_ms = 1e-6; }},
      {"paths that were seen", "was seen elsewhere", [](Asked& a) { a.step.off_path = "upper was seen elsewhere"; }},
      {"parts enough for a turn", "at most 2 are allowed", turnFar},
  };
  return LIST;
}

TEST(Assurance, HoldsWhereNothingIsMissing) {
  Asked asked;
  const Assurance all = assuranceOf(asked.answer());
  EXPECT_TRUE(all.proved) << describe(all);
  EXPECT_TRUE(all.clear());
  EXPECT_EQ(all.touching, Touching::NONE);
  EXPECT_EQ(describe(all), "proved, nothing touches");
  asked.options.accuracy.rung = Accuracy::CONSERVATIVE;
  EXPECT_TRUE(assuranceOf(asked.answer()).clear());
}

TEST(Assurance, EachLineOfTheListTakesTheProofAway) {
  for (const Missing& missing : list()) {
    Asked asked;
    missing.take(asked);
    const Outcome outcome = asked.answer();
    const Assurance assurance = assuranceOf(outcome);
    EXPECT_FALSE(assurance.proved) << "without " << missing.what;
    EXPECT_FALSE(assurance.clear()) << "without " << missing.what;
    EXPECT_TRUE(oneMentions(assurance.missing, missing.sentence)) << missing.what << ": " << describe(assurance);
    EXPECT_TRUE(outcome.answered) << missing.what;
  }
}

TEST(Assurance, WhatIsSaidFromOutsideTakesItAwayToo) {
  const Assurance late = assuranceOf(Asked().answer(), {"a frame that came 0.6 s ago has had no answer"});
  EXPECT_FALSE(late.proved);
  EXPECT_EQ(late.touching, Touching::NONE);
  EXPECT_EQ(describe(late), "not proved: a frame that came 0.6 s ago has had no answer");
  Outcome gap;
  gap.status = StepStatus::GAP;
  gap.reason = "0.7 s";
  EXPECT_EQ(describe(assuranceOf(gap)), "not proved: no answer, GAP: 0.7 s");
}

TEST(Assurance, ABodyOfWhichEveryVertexIsMaskedIsNotProved) {
  Asked asked;
  for (Index v = 0; v < 16; ++v) asked.upper().vertex_mask.push_back(v);
  const Assurance none = assuranceOf(asked.answer());
  EXPECT_FALSE(none.proved);
  EXPECT_FALSE(none.clear());
  EXPECT_EQ(none.missing,
            std::vector<std::string>{"vertex_mask names every vertex of body 'upper', so nothing of it was checked"});
  asked.upper().vertex_mask.back() = 0;  // twice, and one of them is looked at
  EXPECT_TRUE(assuranceOf(asked.answer()).proved);
  // A vertex of no face makes no difference: there is nothing to look at.
  asked.upper().topology = share(Topology::fromTriangles(16, {{0, 1, 2}}));
  EXPECT_TRUE(oneMentions(assuranceOf(asked.answer()).missing, "nothing of it was checked"));
}

TEST(Assurance, WhatIsLeftOutByChoiceIsNamedAndTakesNothingAway) {
  Asked asked;
  asked.upper().vertex_mask = {0, 1};
  asked.upper().self_collision = false;
  asked.upper().against_obstacle = false;
  asked.options.exclude_boxes.push_back(Box{{-1, -1, -1}, {1, 1, 1}});
  const Assurance assurance = assuranceOf(asked.answer());
  EXPECT_TRUE(assurance.proved) << describe(assurance);
  for (const char* sentence : {"body 'upper': 2 vertices by vertex_mask", "body 'upper': not against itself",
                               "body 'upper': not against the map", "0 voxels of the map by exclude_boxes"}) {
    EXPECT_TRUE(oneMentions(assurance.excluded, sentence)) << sentence;
  }
  EXPECT_EQ(assurance.excluded.size(), 4u);
  asked.options.excluded = {"rigid body 'finger' by effects/rigid_bodies: off"};
  EXPECT_TRUE(oneMentions(assuranceOf(asked.answer()).excluded, "'finger'"))
      << "what was taken away before the step, too";
  // A vertex of no face that is masked is left out by choice, too.
  Asked loose;
  loosen(loose);
  for (Index v = 3; v < 16; ++v) loose.upper().vertex_mask.push_back(v);
  EXPECT_TRUE(assuranceOf(loose.answer()).proved);
}

TEST(Assurance, TouchingTellsWhatLastsFromWhatIsNew) {
  Asked asked;
  move(asked.upper(), 0.3, -0.3);
  Assurance assurance = assuranceOf(asked.answer());
  EXPECT_TRUE(assurance.proved);
  EXPECT_EQ(assurance.touching, Touching::NEW);
  EXPECT_FALSE(assurance.clear());
  EXPECT_EQ(describe(assurance), "proved, something touches anew");
  // The same sheets, one on the other: they meet when the step begins.
  move(asked.upper(), 0, 0);
  assurance = assuranceOf(asked.answer());
  EXPECT_TRUE(assurance.proved);
  EXPECT_EQ(assurance.touching, Touching::LASTING);
  // Beside patches that last, a further contact is nothing new; a new patch is.
  Outcome tracked;
  tracked.touching = Touching::NEW;
  tracked.tracked = true;
  tracked.patches.resize(2);
  EXPECT_EQ(assuranceOf(tracked).touching, Touching::LASTING);
  tracked.patches[1].is_new = true;
  EXPECT_EQ(assuranceOf(tracked).touching, Touching::NEW);
  // Crossing at the start leaves the proof, and counts as touching.
  Positions tilted = sheetAt(0);
  for (Vec3& x : tilted) x.z() += 0.2 * (x.x() - 0.15);
  asked.upper().t0 = share(tilted);
  asked.upper().t1 = share(tilted);
  const Outcome crossing = asked.answer();
  EXPECT_EQ(crossing.start_state, StartState::INTERSECTING);
  EXPECT_TRUE(assuranceOf(crossing).proved);
  EXPECT_NE(assuranceOf(crossing).touching, Touching::NONE);
}

TEST(Assurance, RopesWithoutAMapHaveNoInside) {
  Asked asked;
  const auto rope = share(Topology::polyline(16));
  for (Body& body : asked.step.bodies) body.topology = rope;
  const Outcome outcome = asked.answer();
  EXPECT_EQ(outcome.start_state, StartState::CLEAR);
  EXPECT_TRUE(assuranceOf(outcome).clear()) << describe(assuranceOf(outcome));
}

/// Random sets of faults against the same list, asked of the step itself instead of the answer.
TEST(Assurance, AnyFaultsTogetherAreHeldAgainstTheList) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 300; ++trial) {
    Asked asked;
    bool faulty = false, turned = false, touches = false;
    std::string taken;
    for (const Missing& missing : list()) {
      // A loose sheet cannot turn, and one that turns is no longer where another fault puts it.
      const bool shapes = missing.take.target<void (*)(Asked&)>() != nullptr;
      if (random() % 4 != 0 || (shapes && turned)) continue;
      missing.take(asked);
      turned |= shapes;
      faulty = true;
      taken += std::string(missing.what) + ", ";
    }
    if (random() % 2 && !turned) {
      move(asked.upper(), 0.3, -0.3);
      touches = true;
    }
    const Outcome outcome = asked.answer();
    const Assurance assurance = assuranceOf(outcome);
    EXPECT_EQ(assurance.proved, !faulty) << taken << describe(assurance);
    EXPECT_EQ(assurance.proved, assurance.missing.empty());
    if (!faulty) EXPECT_EQ(assurance.touching == Touching::NONE, !touches) << taken;
    if (assurance.clear()) EXPECT_TRUE(outcome.contacts.empty() && outcome.intersections.empty());
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
