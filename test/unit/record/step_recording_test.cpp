// The bytes of a recording: what is read is what was written, and bytes that lie are refused by name.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "record/step_replay.h"
#include "support/recordings.h"
#include "support/said.h"
#include "unit/record/recording_support.h"

namespace dccd {
namespace test {
namespace {

TEST(StepRecording, TheSceneCallsForEverything) {
  const StepRecording r = recordScene();
  EXPECT_EQ(r.step.bodies.size(), 3u);
  EXPECT_GT(r.answer.substeps, 1u) << "the finger turns";
  bool self_or_body = false, obstacle = false;
  for (const Contact& c : r.answer.contacts) (c.body[1] == OBSTACLE_BODY ? obstacle : self_or_body) = true;
  EXPECT_TRUE(self_or_body);
  EXPECT_TRUE(obstacle);
}

TEST(StepRecording, WhatIsReadIsWhatWasWritten) {
  const StepRecording r = recordScene();
  const StepRecording read = again(r);
  EXPECT_EQ(read.step.bodies[2].motion, BodyMotionKind::STATIC);
  EXPECT_FALSE(read.step.bodies[2].topology->hasFaces()) << "the rope is a polyline";
  EXPECT_EQ(read.step.bodies[2].topology->edges().size(), 3u);
  ASSERT_TRUE(read.step.map.surface);
  EXPECT_EQ(read.step.map.surface->leafCount(), 2u);
  EXPECT_TRUE(compareAnswers(r.options, r.answer, read.answer).empty());
}

TEST(Recording, SeveralRopesInOneBodyStaySeveral) {
  StepRecording r = recordScene();
  Body& rope = r.step.bodies[2];
  ASSERT_FALSE(rope.topology->hasFaces());
  rope.topology = share(Topology::fromEdges(rope.t0->size(), {{0, 1}, {2, 3}}));
  EXPECT_EQ(*again(r).step.bodies[2].topology, *rope.topology);
}

TEST(StepRecording, EveryTruncationIsRefused) {
  const std::vector<std::uint8_t> bytes = recordingBytes(recordScene());
  for (std::size_t n = 0; n < bytes.size(); n += n < 600 ? 1 : 37) {
    const std::vector<std::uint8_t> cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(n));
    EXPECT_EQ(errorOf(cut).rfind("FILE: byte ", 0), 0u) << n;
  }
  std::vector<std::uint8_t> more = bytes;
  more.push_back(0);
  EXPECT_NE(errorOf(more).find("1 bytes are left over"), std::string::npos) << errorOf(more);
}

TEST(StepRecording, WhatIsExpectedIsKeptAndReplayed) {
  const StepRecording r = recordScene(expecting());
  ASSERT_GT(r.answer.counts.expected, 0u);
  StepRecording read = again(r);
  EXPECT_EQ(read.options.expected, r.options.expected);
  EXPECT_EQ(read.answer.expected, r.answer.expected);
  EXPECT_TRUE(replayStep(read).differences.empty());
  read.options.expected.pop_back();
  EXPECT_FALSE(replayStep(read).differences.empty()) << "a mark is part of the answer";
}

TEST(StepRecording, AnyByteMayLie) {
  const std::vector<std::uint8_t> bytes = recordingBytes(recordScene());
  std::size_t refused = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    for (const std::uint8_t value : {0xff, 0x80, 0x01}) {
      std::vector<std::uint8_t> bad = bytes;
      bad[i] ^= value;
      refused += !errorOf(bad).empty();
    }
  }
  EXPECT_GT(refused, 100u);
}

TEST(StepRecording, LiesAreNamed) {
  const std::vector<std::uint8_t> bytes = recordingBytes(recordScene());
  std::vector<std::uint8_t> bad = bytes;
  bad[0] = 'X';
  EXPECT_NE(errorOf(bad).find("not a recording"), std::string::npos);
  bad = bytes;
  for (const std::uint32_t other : {0u, 1u, RECORDING_VERSION - 1, RECORDING_VERSION + 1, 255u}) {
    bad = bytes;
    bad[8] = static_cast<std::uint8_t>(other);
    EXPECT_EQ(errorOf(bad), "FILE: byte 12: version " + std::to_string(other) +
                                " of the format, and this program reads version " + std::to_string(RECORDING_VERSION) +
                                " alone; record the step again, or replay it by the program that recorded it");
  }
  const auto refused = [](const std::function<void(StepRecording&)>& change) {
    StepRecording r = recordScene();
    change(r);
    return errorOf(recordingBytes(r));
  };
  const std::pair<const char*, std::function<void(StepRecording&)>> lies[] = {
      {"the step lasts", [](StepRecording& r) { r.step.stamp_ns = r.step.start_ns; }},
      {"20 vertices at t=0 and 19 at t=1",
       [](StepRecording& r) { r.step.bodies[0].t1 = share(Positions(19, Vec3::Zero())); }},
      {"body 'cloth'",  // faces name vertices that are not there
       [](StepRecording& r) { r.step.bodies[0].t0 = r.step.bodies[0].t1 = share(Positions(3, Vec3::Zero())); }},
      {"pose", [](StepRecording& r) { r.step.bodies[1].pose_t0.translation().x() = std::nan(""); }},
      {"rung 0 does not exist", [](StepRecording& r) { r.options.accuracy.rung = static_cast<Accuracy>(0); }}};
  for (const auto& [text, change] : lies) EXPECT_TRUE(mentions(refused(change), text)) << refused(change);
}

}  // namespace
}  // namespace test
}  // namespace dccd
