#include "dccd/mesh_store.h"
#include "support/said.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace dccd {
namespace {

constexpr StampNs MS = 1000000;

std::shared_ptr<const Topology> triangle() {
  return std::make_shared<const Topology>(Topology::fromTriangles(3, {{0, 1, 2}}));
}

class MeshStoreTest : public ::testing::Test {
 protected:
  std::shared_ptr<const Topology> topology = triangle();
  MeshStore store{MeshStoreOptions{0.1, 0.5, 4}};

  MeshFrame frame(StampNs stamp_ns, double z = 0) const {
    return {stamp_ns, topology, {{0, 0, z}, {1, 0, z}, {0, 1, z}}, false, Eigen::Isometry3d::Identity()};
  }
};

TEST_F(MeshStoreTest, SaysWhatAFrameIsToTheOneBeforeIt) {
  EXPECT_EQ(store.push(frame(1000 * MS)), StepStatus::FIRST_FRAME);
  EXPECT_EQ(store.push(frame(1050 * MS)), StepStatus::OK);
  EXPECT_EQ(store.push(frame(1050 * MS)), StepStatus::DUPLICATE);
  EXPECT_EQ(store.push(frame(1150 * MS)), StepStatus::OK) << "a step of exactly max_step_s is one";
  EXPECT_EQ(store.push(frame(1250 * MS + 1)), StepStatus::GAP);
  EXPECT_EQ(store.push(frame(1260 * MS, 0.5)), StepStatus::OK) << "exactly max_vertex_step_m";
  EXPECT_EQ(store.push(frame(1270 * MS, 1.1)), StepStatus::TELEPORT);
  EXPECT_EQ(store.push(frame(1269 * MS, 1.1)), StepStatus::TIME_JUMP);
  EXPECT_EQ(store.size(), 1u) << "nothing of the old time is kept";
  EXPECT_EQ(store.push(frame(1280 * MS, 1.1)), StepStatus::OK);
}

// Their difference is more than a stamp can be.
TEST_F(MeshStoreTest, StampsOfAnySizeTellAGap) {
  constexpr StampNs LEAST = std::numeric_limits<StampNs>::min(), MOST = std::numeric_limits<StampNs>::max();
  store.push(frame(LEAST));
  EXPECT_EQ(store.push(frame(MOST)), StepStatus::GAP);
  EXPECT_EQ(secondsBetween(LEAST, MOST), 0x1p64 * 1e-9);
  EXPECT_EQ(secondsBetween(MOST, LEAST), -0x1p64 * 1e-9);
  EXPECT_EQ(secondsBetween(-5, 7), 12 * 1e-9);
}

TEST_F(MeshStoreTest, RefusesAVertexCountThatDoesNotFit) {
  store.push(frame(0));
  MeshFrame wrong = frame(10 * MS);
  wrong.positions.pop_back();
  EXPECT_EQ(store.push(wrong), StepStatus::VERTEX_COUNT);
  EXPECT_EQ(store.push(frame(20 * MS)), StepStatus::OK);
  EXPECT_EQ(store.unknownWithin(0, 20 * MS), "1 frame of it that came was not used: VERTEX_COUNT");
  EXPECT_EQ(store.push(frame(30 * MS)), StepStatus::OK);
  EXPECT_EQ(store.unknownWithin(20 * MS, 30 * MS), "") << "the refused frame leaves no other trace";
}

TEST_F(MeshStoreTest, KnowsTheWayBetweenTwoFramesIfNoneIsMissingBetweenThem) {
  const auto numbered = [&](StampNs stamp_ns, std::uint64_t number, std::uint64_t thinned = 0) {
    MeshFrame one = frame(stamp_ns);
    one.number = number;
    one.thinned = thinned;
    return one;
  };
  store.push(numbered(0, 5));
  store.push(numbered(10 * MS, 6));
  EXPECT_EQ(store.unknownWithin(0, 10 * MS), "") << "what came before the first is missed by nobody";
  store.push(numbered(20 * MS, 9));
  const std::string lost = "2 frames of it that came were not used: the queue was full (QUEUE_FULL), or memory ran out";
  for (const auto& [from, to] : {std::pair<StampNs, StampNs>{10, 20}, {19, 20}, {10, 11}, {12, 15}, {0, 11}}) {
    EXPECT_EQ(store.unknownWithin(from * MS, to * MS), lost) << from << " " << to;
  }
  EXPECT_EQ(store.unknownWithin(0, 10 * MS), "");
  store.push(numbered(30 * MS, 12, 2));
  EXPECT_EQ(store.unknownWithin(20 * MS, 30 * MS), "") << "two were left out by choice";
  EXPECT_EQ(store.thinnedWithin(20 * MS, 30 * MS), 2u);
  EXPECT_EQ(store.thinnedWithin(10 * MS, 20 * MS), 0u);
  store.push(numbered(40 * MS, 15, 1));
  EXPECT_NE(store.unknownWithin(30 * MS, 40 * MS), "") << "one of two was";
  store.passOver(1, "BAD_MESSAGE: cut");
  EXPECT_EQ(store.unknownWithin(30 * MS + 1, 40 * MS + 1),
            "1 frame of it that came was not used: the queue was full (QUEUE_FULL), or memory ran out");
  EXPECT_EQ(store.unknownWithin(40 * MS, 41 * MS), "1 frame of it that came was not used: BAD_MESSAGE: cut");
  EXPECT_EQ(store.unknownWithin(40 * MS, 40 * MS), "");
  store.push(numbered(50 * MS, 16));
  EXPECT_EQ(store.unknownWithin(40 * MS, 50 * MS), "") << "the number tells that it was none of this body's";
  store.push(numbered(160 * MS, 30));
  EXPECT_EQ(store.unknownWithin(0, 160 * MS).find("13 frames"), std::string::npos) << "nothing goes on over a gap";
}

TEST_F(MeshStoreTest, TheSameFrameOnceMoreIsNotMissedAndAnotherOfItsStampIs) {
  MeshFrame lost = frame(10 * MS);
  lost.positions[1].setConstant(std::numeric_limits<double>::quiet_NaN());
  for (const bool same : {true, false}) {
    store.clear();
    store.push(frame(0));
    store.push(lost);
    for (int again = 0; again < 2; ++again) {
      EXPECT_EQ(store.push(same ? lost : frame(10 * MS, 0.1)), StepStatus::DUPLICATE);
      EXPECT_EQ(store.unknownWithin(0, 10 * MS).empty(), same);
      EXPECT_EQ(store.unknownWithin(10 * MS, 11 * MS).empty(), same);
    }
    store.push(frame(20 * MS));
    EXPECT_EQ(store.unknownWithin(10 * MS, 20 * MS).empty(), same);
    store.push(frame(30 * MS));
    EXPECT_EQ(store.unknownWithin(20 * MS, 30 * MS), "");
  }
}

TEST_F(MeshStoreTest, AFrameInDoubtIsSoToBothSides) {
  store.push(frame(0));
  MeshFrame doubted = frame(10 * MS);
  doubted.doubt = "why";
  store.push(doubted);
  EXPECT_EQ(store.unknownWithin(10 * MS, 11 * MS), "why");
  store.push(frame(20 * MS));
  EXPECT_EQ(store.unknownWithin(0, 10 * MS), "why");
  EXPECT_EQ(store.unknownWithin(10 * MS, 20 * MS), "why");
  store.push(frame(30 * MS));
  EXPECT_EQ(store.unknownWithin(20 * MS, 30 * MS), "");
}

// The frame of 60 ms has come, and lies beside the way from that of 50 ms on.
TEST_F(MeshStoreTest, WhatCameBeforeALateFrameIsMissedUntilItsStampIsOver) {
  for (const StampNs stamp : {20, 40, 60, 50, 80, 90}) store.push(frame(stamp * MS));
  EXPECT_EQ(store.unknownWithin(50 * MS, 80 * MS),
            "its stamps went back, and what came before with later ones is not used");
  EXPECT_NE(store.unknownWithin(60 * MS, 80 * MS), "") << "between the frames of 50 ms and 80 ms";
  EXPECT_EQ(store.unknownWithin(80 * MS, 90 * MS), "");
  store.push(frame(85 * MS));
  store.push(frame(70 * MS));
  store.push(frame(88 * MS));
  EXPECT_NE(store.unknownWithin(70 * MS, 88 * MS), "");
  EXPECT_NE(store.unknownWithin(89 * MS, 95 * MS), "") << "up to the latest that came";
  store.push(frame(91 * MS));
  EXPECT_EQ(store.unknownWithin(91 * MS, 95 * MS), "");
  store.push(frame(-5000 * MS));
  store.push(frame(-4990 * MS));
  EXPECT_EQ(store.unknownWithin(-5000 * MS, -4990 * MS), "") << "time begins anew";
  store.push(frame(-4995 * MS));
  store.clear();
  store.push(frame(-5000 * MS));
  store.push(frame(-4990 * MS));
  EXPECT_EQ(store.unknownWithin(-5000 * MS, -4990 * MS), "");
}

TEST_F(MeshStoreTest, TellsAnotherTopologyFromAnEqualOne) {
  store.push(frame(0));
  topology = triangle();
  EXPECT_EQ(store.push(frame(10 * MS)), StepStatus::OK) << "equal, though another object";
  topology = std::make_shared<const Topology>(Topology::fromTriangles(3, {{0, 2, 1}}));
  EXPECT_EQ(store.push(frame(20 * MS)), StepStatus::TOPOLOGY_CHANGED);
  EXPECT_EQ(store.previous(), nullptr) << "a seam has nothing before it";
}

TEST_F(MeshStoreTest, VerticesThatAreNotFiniteAreNoTeleport) {
  store.push(frame(0));
  MeshFrame lost = frame(10 * MS);
  lost.positions[1].setConstant(std::numeric_limits<double>::quiet_NaN());
  lost.positions[2].setConstant(std::numeric_limits<double>::infinity());
  EXPECT_EQ(store.push(lost), StepStatus::OK);
  EXPECT_EQ(store.push(frame(20 * MS)), StepStatus::OK);
}

TEST_F(MeshStoreTest, InterpolatesWithinARunOnly) {
  store.push(frame(0, 0));
  store.push(frame(100 * MS, 0.4));
  store.push(frame(250 * MS, 0.4));  // gap
  ASSERT_EQ(store.lookup(25 * MS), Lookup::READY);
  EXPECT_DOUBLE_EQ(store.frameAt(25 * MS)->positions[0].z(), 0.1);
  EXPECT_EQ(store.frameAt(100 * MS)->positions[0].z(), 0.4) << "a frame's own positions, bit for bit";
  EXPECT_EQ(store.lookup(180 * MS), Lookup::TOO_OLD) << "across the gap";
  EXPECT_EQ(store.lookup(250 * MS), Lookup::READY);
  EXPECT_EQ(store.lookup(251 * MS), Lookup::NOT_YET);
  EXPECT_EQ(store.lookup(-1), Lookup::TOO_OLD);
}

TEST_F(MeshStoreTest, RigidFramesFollowTheArc) {
  MeshFrame a = frame(0), b = frame(100 * MS);
  a.rigid = b.rigid = true;
  b.pose.linear() = Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ()).toRotationMatrix();
  for (Vec3& p : b.positions) p = b.pose * p;
  MeshStore loose(MeshStoreOptions{0.1, 0, 4});
  loose.push(a);
  loose.push(b);
  const Positions at = loose.frameAt(50 * MS)->positions;
  EXPECT_NEAR(at[1].norm(), 1, 1e-12) << "the chord would be at 0.707";
  EXPECT_NEAR(at[1].x(), std::sqrt(0.5), 1e-12);
}

TEST_F(MeshStoreTest, FindsTheFrameOfAnyStamp) {
  store.setOptions({0.1, 0.5, 64});
  for (int frames = 1; frames <= 12; ++frames) {
    store.push(frame(frames * 10 * MS));
    EXPECT_EQ(store.lookup(5 * MS), Lookup::TOO_OLD);
    for (int at = 10; at <= frames * 10; at += 5) {
      ASSERT_EQ(store.lookup(at * MS), Lookup::READY);
      EXPECT_EQ(store.frameAt(at * MS)->stamp_ns, at * MS);
      EXPECT_EQ(store.framesWithin(at * MS, frames * 10 * MS).size(),
                static_cast<std::size_t>(std::max(0, frames - at / 10 - 1)));
    }
    EXPECT_EQ(store.lookup(frames * 10 * MS + 1), Lookup::NOT_YET);
  }
}

TEST_F(MeshStoreTest, KeepsNoMoreThanItsCapacity) {
  for (int i = 0; i < 100; ++i) store.push(frame(i * 10 * MS));
  EXPECT_EQ(store.size(), 4u);
  store.forgetBefore(985 * MS);
  EXPECT_EQ(store.size(), 2u);
  EXPECT_EQ(store.lookup(985 * MS), Lookup::READY);
  store.forgetBefore(2000 * MS);
  EXPECT_NE(store.previous(), nullptr) << "a prediction needs two";
}

// A gripper at 240 Hz beside a tracker that comes 0.4 s late must still be known where the tracker's step begins.
TEST_F(MeshStoreTest, SmallMeshesAreKeptForLongLargeOnesAreNot) {
  MeshStore kept{MeshStoreOptions()};
  for (int i = 0; i < 300; ++i) kept.push(frame(i * 4 * MS));
  EXPECT_EQ(kept.size(), 300u);
  EXPECT_EQ(kept.lookup(2 * MS), Lookup::READY);
  MeshStoreOptions options;
  options.max_vertices = 100 * frame(0).positions.size();
  MeshStore large(options);
  for (int i = 0; i < 300; ++i) {
    large.push(frame(i * 4 * MS));
    EXPECT_LE(large.size(), 100u);
  }
  EXPECT_EQ(large.size(), 100u);
  options.max_vertices = 1;
  MeshStore huge(options);
  for (int i = 0; i < 300; ++i) huge.push(frame(i * 4 * MS));
  EXPECT_EQ(huge.size(), 64u);
  huge.clear();
  for (int i = 0; i < 10; ++i) huge.push(frame(i * 4 * MS));
  EXPECT_EQ(huge.size(), 10u);
}

TEST(MeshStoreOptionsTest, OutOfRangeNamesTheOption) {
  const auto message = [](const MeshStoreOptions& options) -> std::string {
    return test::said<std::invalid_argument>([&] { MeshStore store(options); });
  };
  EXPECT_NE(message({0, 0.5, 4}).find("max_step_s"), std::string::npos);
  EXPECT_NE(message({std::nan(""), 0.5, 4}).find("max_step_s"), std::string::npos);
  EXPECT_NE(message({2e9, 0.5, 4}).find("max_step_s"), std::string::npos);
  EXPECT_NE(message({0.1, -1, 4}).find("max_vertex_step_m"), std::string::npos);
  EXPECT_NE(message({0.1, 0.5, 1}).find("capacity"), std::string::npos);
}

TEST(PoseInterpolation, GoesOnBeyondTheEnd) {
  const Eigen::Isometry3d a = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d b = a;
  b.linear() = Eigen::AngleAxisd(0.2, Vec3::UnitX()).toRotationMatrix();
  b.translation() = Vec3(1, 0, 0);
  const Eigen::Isometry3d c = interpolate(a, b, 3);
  EXPECT_NEAR(Eigen::AngleAxisd(c.linear()).angle(), 0.6, 1e-12);
  EXPECT_NEAR(c.translation().x(), 3, 1e-12);
}

/// A frame's own positions are the truth at its stamp: what a sum with a product of zero or one makes of them is not.
TEST(PositionInterpolation, EndsAreReproducedBitForBit) {
  const double lost = std::numeric_limits<double>::quiet_NaN();
  const Positions a{{0.1, -0.0, 1e300}, {lost, 1, 2}, {0x1p-1074, 3, 1e16}},
      b{{0.7, 0.0, -1e300}, {1, 2, 3}, {1, lost, 1}};
  Positions out;
  for (const bool end : {false, true}) {
    interpolate(a, b, end ? 1 : 0, out);
    const Positions& own = end ? b : a;
    ASSERT_EQ(out.size(), own.size());
    EXPECT_EQ(std::memcmp(out.data(), own.data(), own.size() * sizeof(Vec3)), 0) << (end ? "its end" : "its start");
  }
}

}  // namespace
}  // namespace dccd
