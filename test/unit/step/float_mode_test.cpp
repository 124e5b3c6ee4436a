// The floating-point mode of whoever asks is no part of the question: a step brings its own, on every thread, and
// leaves the caller's as it was.
#include <gtest/gtest.h>

#include <cfenv>
#include <cmath>

#include "record/step_replay.h"
#include "step/history.h"
#include "support/flush_to_zero.h"
#include "support/recordings.h"
#include "support/step_support.h"

namespace dccd {
namespace test {
namespace {

class RoundingMode {
 public:
  explicit RoundingMode(int mode) : saved_(std::fegetround()) { std::fesetround(mode); }
  ~RoundingMode() { std::fesetround(saved_); }
  RoundingMode(const RoundingMode&) = delete;
  RoundingMode& operator=(const RoundingMode&) = delete;

 private:
  int saved_;
};

MonitorOptions with(Accuracy rung) {
  MonitorOptions options;
  options.detector.accuracy.rung = rung;
  options.detector.obstacle_expected = true;
  options.detector.patches = true;
  return options;
}

TEST(FloatMode, OfTheCallerChangesNoAnswerAndStays) {
  for (const Accuracy rung : {Accuracy::CONSERVATIVE, Accuracy::EXACT}) {
    StepRecording recorded = recordScene(with(rung));  // with a body that turns
    recorded.answer = replayStep(recorded).answer;     // whose counters are those of a step without one before it
    for (const int mode : {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO}) {
      for (const int threads : {1, 3}) {
        StepReplay replay;
        int left = 0;
        {
          const RoundingMode rounding(mode);
          replay = replayStep(recorded, threads);
          left = std::fegetround();
        }
        EXPECT_EQ(left, mode);
        EXPECT_FALSE(replay.answer.contacts.empty());
        for (const StepCounter& counter : STEP_COUNTERS) {
          EXPECT_EQ(replay.answer.stats.*counter.value, recorded.answer.stats.*counter.value) << counter.name;
        }
        EXPECT_TRUE(replay.differences.empty())
            << toString(rung) << ", mode " << mode << ", " << threads << " threads: " << replay.differences.front();
      }
    }
    StepReplay replay;
    {
      const FlushToZero flushing;
      replay = replayStep(recorded, 3);
      EXPECT_TRUE(flushing.isInForce());
    }
    EXPECT_TRUE(replay.differences.empty()) << replay.differences.front();
  }
}

/// The filters leave out as much as ever, and nothing else: what they keep is counted.
TEST(FloatMode, OfTheCallerChangesNoCounter) {
  const TestStep cloth = crumpled(5, 2, 40);
  Options options;
  const Outcome usual = runOnce(cloth, options);
  ASSERT_GT(usual.contacts.size(), 100u);
  for (const int mode : {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO}) {
    Outcome outcome;
    {
      const RoundingMode rounding(mode);
      outcome = runOnce(cloth, options);
    }
    EXPECT_EQ(outcome.contacts.size(), usual.contacts.size());
    for (const StepCounter& counter : STEP_COUNTERS) {
      EXPECT_EQ(outcome.stats.*counter.value, usual.stats.*counter.value) << counter.name << ", mode " << mode;
    }
    for (const Stage stage : {Stage::BROAD_PHASE, Stage::PLANAR, Stage::ELEMENTARY}) {
      EXPECT_EQ(outcome.stats[stage].out, usual.stats[stage].out) << toString(stage) << ", mode " << mode;
    }
  }
}

/// What is made once for all later steps: which pairs are left out of the separation, and how far apart these are.
TEST(FloatMode, OfTheCallerChangesNoLaterAnswer) {
  Step cloth = crumpled(5, 2, 40).motion();
  Body& body = cloth.bodies[0];
  const Edge& edge = body.topology->edges().front();
  body.minimum_separation_m = ((*body.t0)[edge[0]] - (*body.t0)[edge[1]]).norm();
  body.reference = std::make_shared<const ReferenceFrame>(ReferenceFrame{*body.t0, {}});
  Options options;
  options.accuracy.rung = Accuracy::CONSERVATIVE;  // whose minimum separation may be above 0
  const auto distancesAfter = [&](int mode) {
    History history;
    const RoundingMode rounding(mode);
    detect(cloth, options, history);
    EXPECT_EQ(std::fegetround(), mode);
    const LeftOutOfBody& left_out = History::Impl::of(history).prepared.left_out.of_body[0];
    const SceneBody& ranks = History::Impl::of(history).scene.bodies()[0];
    const Index vertices = static_cast<Index>(body.t0->size());
    const Index edges = static_cast<Index>(body.topology->edges().size());
    const Index faces = static_cast<Index>(body.topology->faces().size());
    std::vector<double> distances;
    const auto collect = [&](PairKind kind, Index first, Index firsts, Index second, Index seconds) {
      for (std::uint64_t i = first; i < first + firsts; ++i) {
        for (std::uint64_t j = second; j < second + seconds; ++j) {
          const double distance_m = left_out.distance(kind, i << 32 | j);
          if (std::isfinite(distance_m)) distances.push_back(distance_m);
        }
      }
    };
    collect(PairKind::VERTEX_FACE, ranks.vertex_begin, vertices, ranks.face_begin, faces);
    collect(PairKind::EDGE_EDGE, ranks.edge_begin, edges, ranks.edge_begin, edges);
    EXPECT_EQ(distances.size(), history.leftOut().size());
    return distances;
  };
  const std::vector<double> usual = distancesAfter(FE_TONEAREST);
  ASSERT_GT(usual.size(), 100u);
  for (const int mode : {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO}) {
    EXPECT_EQ(distancesAfter(mode), usual) << "mode " << mode;
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
