// Bodies that are seen between a step's ends: the step is cut into parts that keep near where they were.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "dccd/detect.h"
#include "record/step_replay.h"
#include "step/parts.h"
#include "unit/record/recording_support.h"
#include "unit/stream/monitor_support.h"

namespace dccd {
namespace test {
namespace {

struct RandomWays {
  std::mt19937_64 random;
  explicit RandomWays(std::uint64_t seed) : random(seed) {}
  double operator()(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random); }
  Vec3 vector(double size) { return {(*this)(-size, size), (*this)(-size, size), (*this)(-size, size)}; }
  Eigen::Isometry3d pose(double size, double angle) {
    return Eigen::Translation3d(vector(size)) * Eigen::AngleAxisd((*this)(-angle, angle), vector(1).normalized());
  }
};

/// A body of a few vertices that goes by up to seven waypoints, and turns or not.
Body wander(RandomWays& draw, bool turns) {
  Body body = named("wanderer");
  body.turns = body.rigid = turns;
  body.topology = share(Topology::fromTriangles(5, {{0, 1, 2}, {2, 3, 4}}));
  Positions local;
  for (int v = 0; v < 5; ++v) local.push_back(draw.vector(0.3));
  std::vector<double> at{0, 1};
  for (int k = static_cast<int>(draw(1, 7.99)); k > 0; --k) at.push_back(draw(0.001, 0.999));
  std::sort(at.begin(), at.end());
  const double size = std::pow(10, draw(-3, 0)), angle = draw(0, 1.5);
  for (const double u : at) {
    const Eigen::Isometry3d pose = draw.pose(size, angle);
    Positions there = local;
    for (Vec3& p : there) p = turns ? Vec3(pose * p) : Vec3(p + draw.vector(size));
    if (u == 0) {
      body.t0 = share(there);
      body.pose_t0 = pose;
    } else if (u == 1) {
      body.t1 = share(there);
      body.pose_t1 = pose;
    } else {
      body.waypoints.push_back({u, pose, turns ? nullptr : share(there)});
    }
  }
  return body;
}

/// Where the vertex is, by slerp and straight lines alone: nothing of the code is asked.
Vec3 truthAt(const Body& body, std::size_t v, double u) {
  Waypoint from{0, body.pose_t0, body.t0}, to{1, body.pose_t1, body.t1};
  for (const Waypoint& point : body.waypoints) {
    if (point.u <= u) from = point;
    if (point.u > u && point.u < to.u) to = point;
  }
  const double s = (u - from.u) / (to.u - from.u);
  if (!body.turns) return (1 - s) * (*from.positions)[v] + s * (*to.positions)[v];
  const Vec3 local = body.pose_t0.inverse() * (*body.t0)[v];
  const Eigen::Quaterniond a(from.pose.linear()), b(to.pose.linear());
  return (1 - s) * from.pose.translation() + s * to.pose.translation() + a.slerp(s, b) * local;
}

// The bound holds the straight paths of any number of parts, and is no more than a few times what they are off by.
TEST(Waypoints, NoPathLeavesTheWayByMoreThanIsSaid) {
  double tightness = 0;
  int drawn = 0;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    RandomWays draw(seed);
    const Body body = wander(draw, seed % 2 == 0);
    const auto parts = static_cast<std::size_t>(draw(1, 20));
    const double n = static_cast<double>(parts), said = leavesWayBy(body, 1, parts);
    double off = 0;
    for (int i = 0; i <= 2000; ++i) {
      const double u = i / 2000.0, part = std::min(std::floor(u * n), n - 1), s = u * n - part;
      for (std::size_t v = 0; v < body.t0->size(); ++v) {
        const Vec3 on_part = (1 - s) * truthAt(body, v, part / n) + s * truthAt(body, v, (part + 1) / n);
        off = std::max(off, (on_part - truthAt(body, v, u)).norm());
      }
    }
    EXPECT_LE(off, said) << "seed " << seed;
    tightness += off / said;
    ++drawn;
  }
  EXPECT_GT(tightness / drawn, 0.4);
}

// advance() and placeVertex() have the body at the ends of parts where the way has it.
TEST(Waypoints, PartsEndOnTheWay) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    RandomWays draw(seed);
    Step step;
    step.bodies = {wander(draw, seed % 2 == 0)};
    Step at = step;
    at.bodies[0].t1 = step.bodies[0].t0;
    const std::size_t parts = 1 + seed % 9;
    for (std::size_t part = 1; part <= parts; ++part) {
      advance(step, part, parts, at);
      for (Index v = 0; v < 5; ++v) {
        const Vec3 truth = truthAt(step.bodies[0], v, static_cast<double>(part) / static_cast<double>(parts));
        EXPECT_LT(((*at.bodies[0].t1)[v] - truth).norm(), 1e-14) << "seed " << seed << ", part " << part;
        EXPECT_EQ(placeVertex(step, 0, v, part, parts), (*at.bodies[0].t1)[v]);
      }
    }
  }
}

/// A plate at rest, and a tip above it that comes by the waypoints; both go back to where they were.
Step dip(const std::vector<std::pair<double, double>>& heights, double end = 1) {
  Step step;
  step.start_ns = 0;
  step.stamp_ns = 100 * MS;
  const auto place = [&](const MeshFrame& from, const MeshFrame& to, const char* name) {
    Body body = named(name);
    body.topology = from.topology;
    body.t0 = share(from.positions);
    body.t1 = share(to.positions);
    step.bodies.push_back(body);
  };
  place(floor(0, 0), floor(0, 0), "floor");
  place(tip(0, 1), tip(0, end), "tip");
  for (const auto& [u, z] : heights) step.bodies[1].waypoints.push_back({u, {}, share(tip(0, z).positions)});
  return step;
}

Outcome answer(const Step& step) {
  History history;
  return detect(step, Options(), history);
}

TEST(Waypoints, WhatDipsBetweenTheEndsTouchesWhenItDoes) {
  RandomWays draw(3);
  int touched = 0, whole = 0;
  for (int i = 0; i < 500; ++i) {
    const int parts = 2 + i % 7, at = 1 + i % (parts - 1);
    const double u = static_cast<double>(at) / parts, depth = draw(-0.5, 0.5);
    const Outcome outcome = answer(dip({{u, depth}}));
    ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
    if (std::abs(depth) < 2e-3) continue;
    EXPECT_EQ(!outcome.contacts.empty(), depth < 0) << depth;
    if (outcome.contacts.empty()) {
      EXPECT_TRUE(assuranceOf(outcome).clear());
      continue;
    }
    ++touched;
    whole += outcome.substeps == static_cast<std::size_t>(parts / std::gcd(parts, at));
    EXPECT_NEAR(outcome.earliest_toc, u / (1 - depth), 2e-3);
  }
  EXPECT_GT(touched, 100);
  EXPECT_GT(10 * whole, 9 * touched) << "where equal parts meet the waypoint there are no more of them";
}

// Where the waypoint is within the tolerance, or nothing is near, the step is whole.
TEST(Waypoints, WhatDoesNotMatterIsNotCutFor) {
  EXPECT_EQ(answer(dip({{0.5, 1.0}})).substeps, 1u);
  Step far = dip({{0.5, 0.9}});
  for (Body& body : far.bodies) body.against_obstacle = body.self_collision = false;
  for (auto* positions : {&far.bodies[0].t0, &far.bodies[0].t1}) {
    Positions away = **positions;
    for (Vec3& p : away) p.x() += 10;
    *positions = share(away);
  }
  const Outcome outcome = answer(far);
  EXPECT_EQ(outcome.substeps, 1u);
  EXPECT_TRUE(assuranceOf(outcome).clear());
}

// A spike of metres at a time that no number of parts meets: no answer is called whole.
TEST(Waypoints, ThatNoNumberOfPartsFollowsAreNoWholeAnswer) {
  const Outcome outcome = answer(dip({{std::sqrt(0.1), -500}}));
  EXPECT_EQ(outcome.status, StepStatus::PARTIAL);
  EXPECT_FALSE(assuranceOf(outcome).proved);
  EXPECT_EQ(outcome.substeps, 1u) << "it is not cut in vain";
  EXPECT_NE(outcome.reason.find("body 'tip' was seen up to 501 m off"), std::string::npos) << outcome.reason;
}

TEST(Waypoints, AreRecorded) {
  StepRecording recording{"", dip({{0.25, 0.5}, {0.5, -0.1}}), Options(), false, {}};
  RandomWays draw(5);
  recording.step.bodies.push_back(wander(draw, true));
  const std::vector<Body> bodies = again(recording).step.bodies;
  ASSERT_EQ(bodies[1].waypoints.size(), 2u);
  EXPECT_EQ(bodies[1].waypoints[1].u, 0.5);
  EXPECT_EQ(*bodies[1].waypoints[1].positions, tip(0, -0.1).positions);
  ASSERT_EQ(bodies[2].waypoints.size(), recording.step.bodies[2].waypoints.size());
  EXPECT_EQ(bodies[2].waypoints[0].pose.matrix(), recording.step.bodies[2].waypoints[0].pose.matrix());
  for (const double u : {0.0, 0.6, 1.0, std::nan("")}) {
    StepRecording bad = recording;
    bad.step.bodies[1].waypoints[0].u = u;
    EXPECT_NE(errorOf(recordingBytes(bad)).find("a waypoint is at"), std::string::npos) << u;
  }
  recording.step.map.way = {{0.5, recording.step.bodies[2].waypoints[0].pose}, {1, Eigen::Isometry3d::Identity()}};
  EXPECT_EQ(again(recording).step.map.way[0].pose.matrix(), recording.step.map.way[0].pose.matrix());
  for (const double u : {0.5, 0.9, std::nan("")}) {
    StepRecording bad = recording;
    bad.step.map.way[1].u = u;
    EXPECT_NE(errorOf(recordingBytes(bad)).find("the map's way has a pose at"), std::string::npos) << u;
  }
  recording.step.map.way.clear();
  recording.step.bodies[1].waypoints[0].positions = nullptr;
  EXPECT_NE(errorOf(recordingBytes(recording)).find("a waypoint of body 'tip' has 0 vertices"), std::string::npos);
}

}  // namespace
}  // namespace test
}  // namespace dccd
