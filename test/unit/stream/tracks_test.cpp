// What carries bodies and the map: a step asks where it went, and is no proof where nobody knows.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>

#include "dccd/assurance.h"
#include "dccd/monitor_extras.h"
#include "unit/stream/monitor_support.h"

namespace dccd {
namespace test {
namespace {

/// Frames that go as the test has them, with a knot each 10 ms.
struct Said : FrameTracks {
  std::map<std::string, std::function<Eigen::Isometry3d(double)>> fixed_from;  ///< at a time [s]
  std::map<std::string, StampNs> unknown_at;
  std::uint64_t now = 1;
  bool has_ends_alone = false;  ///< and the middle between them

  Eigen::Isometry3d poseOf(const std::string& frame, StampNs stamp_ns) const {
    if (frame.empty()) return Eigen::Isometry3d::Identity();
    return fixed_from.at(frame)(1e-9 * static_cast<double>(stamp_ns));
  }
  std::vector<Knot> between(const std::string& target, const std::string& source, StampNs from_ns, StampNs to_ns,
                            Silence) const override {
    std::vector<Knot> knots;
    if (target == source) return knots;
    const StampNs step_ns = has_ends_alone ? (to_ns - from_ns + 1) / 2 : 10 * MS;
    for (StampNs at = from_ns; at < to_ns; at += step_ns) {
      knots.push_back({at});
      knots.back().is_middle = has_ends_alone && at > from_ns;
    }
    knots.push_back({to_ns});
    for (Knot& knot : knots) {
      knot.pose = poseOf(target, knot.stamp_ns).inverse() * poseOf(source, knot.stamp_ns);
      for (const auto& [frame, stamp_ns] : unknown_at) {
        if ((frame == source || frame == target) && stamp_ns == knot.stamp_ns) knot.why_unknown = "nobody saw " + frame;
      }
    }
    return knots;
  }
  std::uint64_t epoch() const override { return now; }
};

/// A floor at rest, which is the clock, and a tip 1 m above it, rigid or not, in the frame 'hand'.
struct Tracks : testing::Test {
  Said said;
  bool rigid = false;

  void SetUp() override {
    said.fixed_from["hand"] = [](double) { return Eigen::Isometry3d(Eigen::Translation3d(0, 0, 1)); };
  }
  MeshFrame held(StampNs stamp_ns, const std::string& frame = "hand") const {
    MeshFrame mesh = tip(stamp_ns, 0);
    mesh.rigid = rigid;
    mesh.pose = said.poseOf(frame, stamp_ns);
    for (Vec3& p : mesh.positions) p = mesh.pose * p;
    mesh.carrier = {frame, said.now};
    return mesh;
  }
  MeshFrame clock(StampNs stamp_ns) const {
    MeshFrame mesh = floor(stamp_ns, 0);
    mesh.carrier.epoch = said.now;
    return mesh;
  }
  /// The answer to the step of 100 ms that ends at 200 ms; `meanwhile` comes before it is asked for.
  Outcome last(const std::function<void(Monitor&)>& meanwhile = [](Monitor&) {}) {
    std::vector<Body> bodies{named("floor"), named("tip")};
    bodies[1].rigid = rigid;
    Monitor monitor(loose(), bodies);
    monitor.setTracks(&said);
    for (const StampNs stamp_ns : {100 * MS, 200 * MS}) {
      monitor.push(1, held(stamp_ns), NOW);
      monitor.push(0, clock(stamp_ns), NOW);
      if (stamp_ns == 200 * MS) meanwhile(monitor);
      Outcome outcome;
      EXPECT_TRUE(monitor.next(NOW, outcome));
      if (stamp_ns == 200 * MS) return outcome;
    }
    return {};
  }
  static void expectDoubt(const Outcome& outcome, const std::string& why) {
    EXPECT_EQ(outcome.status, StepStatus::PARTIAL);
    EXPECT_FALSE(assuranceOf(outcome).proved);
    EXPECT_NE(outcome.reason.find(why), std::string::npos) << outcome.reason;
  }
};

TEST_F(Tracks, WhatIsCarriedAtRestIsClear) {
  for (const bool is_rigid : {false, true}) {
    rigid = is_rigid;
    EXPECT_TRUE(assuranceOf(last()).clear());
  }
}

// The hand dips and comes back between two frames; what it carries is through the floor for a while, or stays above.
TEST_F(Tracks, WhatIsCarriedGoesAsItsFrameDoes) {
  for (const bool is_rigid : {false, true}) {
    rigid = is_rigid;
    for (const double depth : {0.9, 1.1}) {
      said.fixed_from["hand"] = [depth](double t) {
        const double z = 1 - depth * std::pow(std::sin(M_PI * (t - 0.1) / 0.1), 2);
        return Eigen::Isometry3d(Eigen::Translation3d(0, 0, z));
      };
      const Outcome outcome = last();
      ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
      EXPECT_EQ(assuranceOf(outcome).clear(), depth < 1);
      if (depth < 1) continue;
      EXPECT_NEAR(outcome.earliest_toc, std::asin(std::sqrt(1 / depth)) / M_PI, 0.02);
    }
  }
}

// Between two knots what turns about a far joint leaves the way of whole poses: more of them are asked for.
/// A lever of 1 m swings through its lowest point, where the tip is at this height; at both ends it is 20 mm above.
std::function<Eigen::Isometry3d(double)> swing(double height) {
  return [height](double t) {
    const Eigen::AngleAxisd turn(4 * (t - 0.15), Vec3::UnitX());
    return Eigen::Isometry3d(Eigen::Translation3d(0, 0, 1 + height) * turn * Eigen::Translation3d(0, 0, -1));
  };
}

TEST_F(Tracks, WhatTurnsAboutAFarJointIsFollowedBetweenKnots) {
  said.has_ends_alone = true;
  for (const bool is_rigid : {false, true}) {
    rigid = is_rigid;
    for (const double height : {0.004, -0.004}) {
      said.fixed_from["hand"] = swing(height);
      const Outcome outcome = last();
      ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
      EXPECT_EQ(assuranceOf(outcome).clear(), height > 0) << is_rigid;
      EXPECT_GT(outcome.step->bodies[1].waypoints.size(), 3u);
    }
  }
}

// A step ends between two frames of a mesh that its frame swings on a lever of 1 m: where it is then the lever says,
// not the chord between the two, which comes 123 mm nearer to the joint.
TEST_F(Tracks, WhatIsCarriedIsOnItsWayWhereAStepEnds) {
  for (const double height : {0.004, -0.004}) {
    said.fixed_from["hand"] = [height](double t) {
      const Eigen::AngleAxisd turn(10 * (t - 0.15), Vec3::UnitX());
      return Eigen::Isometry3d(Eigen::Translation3d(0, 0, 1 + height) * turn * Eigen::Translation3d(0, 0, -1));
    };
    Monitor monitor(loose(), {named("floor"), named("tip")});
    monitor.setTracks(&said);
    for (const StampNs stamp_ns : {0, 100, 200, 300}) monitor.push(1, held(stamp_ns * MS), NOW);
    monitor.push(0, clock(50 * MS), NOW);
    only(monitor);
    monitor.push(0, clock(150 * MS), NOW);
    const Outcome outcome = only(monitor);
    ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
    EXPECT_NEAR((*outcome.step->bodies[1].t1)[0].z(), height, 1e-12);
    EXPECT_EQ(assuranceOf(outcome).clear(), height > 0);
  }
}

TEST_F(Tracks, WhereNobodyKnowsThatIsNoProof) {
  for (const bool is_rigid : {false, true}) {
    rigid = is_rigid;
    for (const StampNs at : {100, 150, 200}) {
      said.unknown_at["hand"] = at * MS;
      expectDoubt(last(), "where body 'tip' was is not known for all of this step (nobody saw hand)");
    }
    said.unknown_at.clear();
  }
}

// Two frames of the mesh by two frames of reference that are at one place: how it went from the one to the other nobody
// says.
TEST_F(Tracks, AnotherFrameThatCarriesItIsNoProof) {
  said.fixed_from["other"] = said.fixed_from["hand"];
  for (const std::string& other : {std::string("other"), std::string()}) {
    Monitor monitor(loose(), {named("floor"), named("tip")});
    monitor.setTracks(&said);
    MeshFrame second = held(200 * MS);
    second.carrier.frame = other;
    monitor.push(1, held(100 * MS), NOW);
    monitor.push(0, clock(100 * MS), NOW);
    only(monitor);
    monitor.push(1, second, NOW);
    monitor.push(0, clock(200 * MS), NOW);
    expectDoubt(only(monitor), "the frame that carries it is another one than before");
  }
}

// What is forgotten after the frames were placed, and before the step is answered, may be what they were placed by.
TEST_F(Tracks, WhatIsForgottenBeforeTheAnswerIsNoProof) {
  const auto forget = [&](Monitor&) { ++said.now; };
  expectDoubt(last(forget), "stamps of tf went back");
  said.fixed_from["odom"] = [](double) { return Eigen::Isometry3d::Identity(); };
  std::vector<Body> bodies{named("floor")};
  for (const bool forgets : {false, true}) {
    Monitor monitor(loose(), bodies);
    monitor.setTracks(&said);
    monitor.setMap({VoxelSurface::build(0.1, {{{32768, 32768, 32758}, 1}}), 0, Eigen::Isometry3d::Identity(), "odom"});
    monitor.push(0, clock(100 * MS), NOW);
    only(monitor);
    monitor.push(0, clock(200 * MS), NOW);
    if (forgets) ++said.now;
    const Outcome outcome = only(monitor);
    if (forgets) {
      expectDoubt(outcome, "the octomap's frame 'odom'");
    } else {
      EXPECT_TRUE(assuranceOf(outcome).clear()) << outcome.reason;
    }
  }
}

/// A floor at rest and a map of one voxel of 10 cm, from this key on, in the frame 'odom'.
struct MapTracks : Tracks {
  MonitorOptions options = loose();
  Body sheet = named("floor");
  VoxelKey key{32768, 32768, 32758};
  std::unique_ptr<Monitor> monitor;

  Outcome last() {
    monitor = std::make_unique<Monitor>(options, std::vector<Body>{sheet});
    monitor->setTracks(&said);
    monitor->setMap({VoxelSurface::build(0.1, {{key, 1}}), 0, said.poseOf("odom", 0).inverse(), "odom"});
    monitor->push(0, clock(100 * MS), NOW);
    only(*monitor);
    monitor->push(0, clock(200 * MS), NOW);
    return only(*monitor);
  }
  /// Up by that much and down again between two frames; the voxel's top is 0.9 m below the floor.
  void rise(double height) {
    said.fixed_from["odom"] = [height](double t) {
      return Eigen::Isometry3d(
          Eigen::Translation3d(0, 0, t < 0.1 ? 0 : height * std::pow(std::sin(M_PI * (t - 0.1) / 0.1), 2)));
    };
  }
};

TEST_F(MapTracks, AMapGoesAsItsFrameDoes) {
  for (const double height : {0.0, 0.0005, 0.8, 1.0}) {
    rise(height);
    const Outcome outcome = last();
    ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
    EXPECT_EQ(outcome.substeps == 1, height < 0.001) << "what stays within rigid_tolerance_m is no part";
    EXPECT_EQ(assuranceOf(outcome).clear(), height < 0.9);
    if (height < 0.9) continue;
    ASSERT_FALSE(outcome.contacts.empty());
    const double toc = std::asin(std::sqrt(0.9 / height)) / M_PI;
    EXPECT_NEAR(outcome.earliest_toc, toc, 0.02);
    const ContactGeometry geometry = contactGeometry(outcome, outcome.contacts.front());
    EXPECT_NEAR(geometry.point.z(), 0, 2e-3) << "in the fixed frame";
  }
}

// The lowest corner of the voxel swings 5 mm lower than both ends of its arc.
TEST_F(MapTracks, AMapThatTurnsIsFollowedBetweenKnots) {
  said.has_ends_alone = true;
  key = {32768, 32768, 32768};
  for (const double height : {0.009, 0.001}) {
    said.fixed_from["odom"] = swing(height);
    const Outcome outcome = last();
    ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
    EXPECT_EQ(assuranceOf(outcome).clear(), height > 0.005) << height;
    const Outcome now = monitor->checkNow();
    EXPECT_TRUE(assuranceOf(now).proved) << now.reason;
    EXPECT_EQ(now.step->map.map_from_fixed.matrix(), said.poseOf("odom", 200 * MS).inverse().matrix());
  }
}

TEST_F(MapTracks, WhatIsHeldAgainstAMapThatStaysIsNoProofOnOneThatGoes) {
  rise(0.5);
  EXPECT_TRUE(assuranceOf(last()).proved);
  options.detector.exclude_boxes = {{{-9, -9, -9}, {9, 9, 9}}};
  expectDoubt(last(), "the octomap's frame moves, and exclude_boxes do not");
  options.detector.exclude_boxes.clear();
  sheet.own_voxels_m = 0.01;
  expectDoubt(last(), "m from where it was at its stamp; set fixed_frame to it");
}

// A distance is that of where the map is; of one that goes nothing is promised.
TEST_F(MapTracks, DistancesAreThoseOfAMapThatGoes) {
  options.detector.clearance.wanted = true;
  options.detector.clearance.max_m = 2;
  rise(0.8);
  const Outcome outcome = last();
  ASSERT_EQ(outcome.clearances.size(), 1u);
  const Clearance& row = outcome.clearances.back();
  ASSERT_EQ(row.body[1], OBSTACLE_BODY);
  EXPECT_LE(row.over_step.lower_m, 0.1);
  EXPECT_NEAR(row.over_step.upper_m, 0.1, 0.01);
  EXPECT_NEAR(row.at_end.upper_m, 0.9, 0.01);
  EXPECT_NEAR(row.over_step.t, 0.5, 0.05);
  SpeedBound slow;
  slow.max_m_s = 0.1;
  EXPECT_FALSE(safeUntil(outcome, {slow}).isPromise());
  rise(0);
  EXPECT_TRUE(safeUntil(last(), {slow}).isPromise());
}

// A static tip dips through the floor with its frame; or was only seen from there, and stays.
TEST_F(Tracks, AStaticBodyGoesAsItsFrameDoes) {
  std::vector<Body> bodies{named("floor"), named("tip")};
  bodies[1].motion = BodyMotionKind::STATIC;
  for (const double depth : {0.0, 0.9, 1.1}) {
    said.fixed_from["hand"] = [depth](double t) {
      return Eigen::Isometry3d(
          Eigen::Translation3d(0, 0, t < 0.1 ? 1 : 1 - depth * std::pow(std::sin(M_PI * (t - 0.1) / 0.1), 2)));
    };
    for (const bool takes_along : {true, false}) {
      Monitor monitor(loose(), bodies);
      monitor.setTracks(&said);
      MeshFrame frame = held(50 * MS);
      frame.carrier.takes_along = takes_along;
      monitor.push(1, frame, NOW);
      monitor.push(0, clock(100 * MS), NOW);
      only(monitor);
      monitor.push(0, clock(200 * MS), NOW);
      const Outcome outcome = only(monitor);
      EXPECT_EQ(assuranceOf(outcome).proved, takes_along || depth == 0) << outcome.reason;
      if (takes_along) EXPECT_EQ(assuranceOf(outcome).clear(), depth < 1) << depth;
    }
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
