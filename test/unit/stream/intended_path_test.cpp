// What an intended path allows beyond bounds on speed: paths by hand, whose answers can be worked out.
#include "dccd/intended.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/closed_meshes.h"
#include "support/said.h"

namespace dccd {
namespace test {
namespace {

constexpr double NONE = SpeedBound::NONE, VOXEL_M = 0.05;
constexpr SpeedLaw LAW{0.1, 0.3, 0.025};  // on a path: 0.25 s until all stands

Body boxBody(const std::string& name, const Vec3& low, const Vec3& high) {
  TestStep one;
  one.bodies = {box(low, high)};
  Body body = one.motion().bodies[0];
  body.name = name;
  return body;
}

/// A table of voxels, its top at z = 0, with a wall of them at x = 1.
std::shared_ptr<const VoxelSurface> table() {
  std::vector<OccupiedLeaf> leaves;
  const auto add = [&](int x, int y, int z) {
    const auto key = [](int k) { return static_cast<std::uint16_t>(32768 + k); };
    leaves.push_back({{key(x), key(y), key(z)}, 1});
  };
  for (int x = -20; x < 20; ++x)
    for (int y = -4; y < 4; ++y) add(x, y, -1);
  for (int y = -4; y < 4; ++y)
    for (int z = 0; z < 10; ++z) add(20, y, z);
  return VoxelSurface::build(VOXEL_M, leaves);
}

/// A tool above a table, or whatever the test puts there; a step without motion.
struct Scene {
  Step step;
  Options options;
  std::vector<SpeedBound> bounds{{0.5}};
  IntendedPath path;
  explicit Scene(double height_m) {
    step.bodies = {boxBody("tool", {-0.05, -0.05, height_m}, {0.05, 0.05, height_m + 0.1})};
    step.map.surface = table();
    step.stamp_ns = 1;
    options.clearance.wanted = true;
  }
  /// The first body goes this far in so long, straight, and turns.
  Scene& goes(const Vec3& way, double seconds, double turn = 0) {
    path.bodies = {{0, {}}};
    addPieces(
        [=](double t) {
          Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
          pose.translation() = way * (t / seconds);
          pose.linear() = Eigen::AngleAxisd(turn * t / seconds, Vec3::UnitZ()).toRotationMatrix();
          return std::vector<Eigen::Isometry3d>{pose};
        },
        seconds, std::pow(turn / seconds, 2) * 0.2, 0.2, 1e-3, 64, path);
    return *this;
  }
  Scene& tube(double deviation_m, double rate_m_s) {
    path.deviation_m = deviation_m;
    path.deviation_rate_m_s = rate_m_s;
    return *this;
  }
  AlongPath run(Deadline deadline = {}) const {
    History history;
    const Outcome outcome = detect(step, options, history);
    PathSearch search;
    return search.run(outcome, options, bounds, LAW, path, deadline);
  }
};

TEST(IntendedPath, OnADiveTheTimeIsWhenTheTubesMayTouch) {
  // 0.2 m at 0.25 m/s, less 1 mm, in a tube that grows by 0.05 m/s: two thirds of a second.
  const AlongPath along = Scene(0.201).goes({0, 0, -0.5}, 2).tube(0.001, 0.05).run();
  EXPECT_EQ(along.unused, "");
  EXPECT_TRUE(along.rests_on_path);
  EXPECT_LE(along.until.seconds(), 0.2 / 0.3);
  EXPECT_GE(along.until.seconds(), 0.97 * 0.2 / 0.3);
  EXPECT_EQ(along.contact, PathContact::FREE);
}

TEST(IntendedPath, WhatASensorSawTooSeldomIsMet) {
  Scene dive = Scene(0.201).goes({0, 0, -0.5}, 2).tube(0.001, 0);
  dive.step.map.own.seen = share(std::vector<OccupiedLeaf>{{{32768, 32768, 32769}, 1}});  // its top at 0.1 m
  const AlongPath along = dive.run();
  EXPECT_TRUE(along.rests_on_path);
  EXPECT_LE(along.until.seconds(), 0.1 / 0.25);
  EXPECT_GE(along.until.seconds(), 0.97 * 0.1 / 0.25);
}

TEST(IntendedPath, ASheetAcrossAllAxesIsMetWhereItIs) {
  Eigen::Isometry3d turned(Eigen::Translation3d(0.3, -0.2, 0.5));
  turned.rotate(Eigen::AngleAxisd(0.7, Vec3(1, 0.6, 0.3).normalized()));
  Scene dive(0.1);
  TestStep below;
  below.bodies = {sheet(9, 9, {-0.4, -0.4, 0}, 0.1)};
  dive.step.map = {};
  dive.step.bodies.push_back(below.motion().bodies[0]);
  dive.step.bodies[1].name = "sheet";
  dive.bounds.push_back({0});
  for (Body& body : dive.step.bodies) {
    Positions at = *body.t1;
    for (Vec3& p : at) p = turned * p;
    body.t0 = body.t1 = share(at);
    body.self_collision = false;
  }
  dive.goes(turned.linear() * Vec3(0, 0, -0.5), 2).tube(0.001, 0);
  History history;
  FirstTouch first;
  const Outcome outcome = detect(dive.step, dive.options, history);
  PathSearch().run(outcome, dive.options, dive.bounds, LAW, dive.path, {}, &first);
  EXPECT_LE(first.free_s, 0.099 / 0.25);
  EXPECT_GE(first.free_s, 0.97 * 0.099 / 0.25);
  const Vec3 there = turned.inverse() * first.point;
  EXPECT_LE(there.head<2>().cwiseAbs().maxCoeff(), 0.05 + 1e-9);
  EXPECT_NEAR(there.z(), 0.001, 0.001) << "between the two";
}

TEST(IntendedPath, NeverLessThanBoundsAloneAllow) {
  // A path faster than the bound, and a tube that is wider than the distance.
  for (const double deviation_m : {0.0, 0.3}) {
    const Scene dive = Scene(0.2).goes({0, 0, deviation_m > 0 ? -0.4 : -4}, 1).tube(deviation_m, 0);
    const AlongPath along = dive.run();
    EXPECT_NEAR(along.until.seconds(), 0.4, 1e-3);
    EXPECT_FALSE(along.rests_on_path);
    EXPECT_EQ(along.unused, deviation_m > 0 ? "" : "on it 'tool' is faster than 0.5 m/s");
    EXPECT_NEAR(along.scale.scale, speedScale(0.2, 0.5, 0, LAW), 1e-3);
  }
}

TEST(IntendedPath, AlongTheTableAtAConstantDistanceIsFullSpeed) {
  const Scene slide = Scene(0.02).goes({0.4, 0, 0}, 1, 0.5).tube(0.001, 0.002);
  const AlongPath along = slide.run();
  EXPECT_EQ(along.scale.scale, 1) << along.scale.reason;
  EXPECT_EQ(along.scale.reason, "");
  EXPECT_EQ(along.contact, PathContact::FREE);
  EXPECT_NEAR(along.until.seconds(), 1, 1e-6) << "as far as the path is known";
  Scene without = slide;
  without.path = {};
  EXPECT_EQ(without.run().scale.scale, 0) << "20 mm are less than what is to be left";
  EXPECT_NE(without.run().unused, "");
}

TEST(IntendedPath, TowardsTheTableItIsNot) {
  // 1 mm nearer within the time until it stands: no constant distance.
  const AlongPath along = Scene(0.02).goes({0.4, 0, -0.004}, 1).run();
  EXPECT_LT(along.scale.scale, 0.2) << along.scale.reason;
}

TEST(IntendedPath, WhatComesOverSomethingIsNoLongerAsFarFromIt) {
  // At a constant height, from 0.25 m beside a box to 0.05 m above it, which may rise.
  Scene over(0.05);
  over.step.map = {};
  over.step.bodies.push_back(boxBody("box", {0.3, -0.1, -0.1}, {0.5, 0.1, 0}));
  over.bounds = {{2.5}, {0.5}};
  over.goes({0.5, 0, 0}, 0.25).tube(0.001, 0);
  // At 2 m/s: the root of (0.25 - 2 t)^2 + 0.05^2 is 0.026 + 0.5 t.
  const double s = over.run().scale.scale, t = s * 0.1 + s * s * 0.15;
  EXPECT_NEAR(std::hypot(0.25 - 2 * t, 0.05), 0.026 + 0.5 * t, 0.004);
}

TEST(IntendedPath, TheScaleLetsItStandBeforeItTouches) {
  // 1 m/s towards the table, 0.125 m above it, of which 0.025 m are to be left.
  Scene dive = Scene(0.125).goes({0, 0, -1}, 1);
  dive.bounds = {{2}};
  const AlongPath along = dive.run();
  const double s = along.scale.scale;
  EXPECT_LE(s * 0.1 + s * s * 0.15, 0.1 + 1e-9);
  EXPECT_GE(s * 0.1 + s * s * 0.15, 0.1 * 0.97 - 0.001);
  EXPECT_NE(along.scale.reason.find("on the intended path 'tool' and octomap come too near"), std::string::npos);
  EXPECT_EQ(along.scale.limiting, 0u);
}

TEST(IntendedPath, WhatWasPassedNearbyMayStillCome) {
  // Up to 0.1 m of a cloth in half a second, and away from it: at 0.1 m/s that is where the tool is within a second.
  Scene scene(0.1);
  scene.step.map.surface = nullptr;
  scene.step.bodies.push_back(boxBody("cloth", {0.3, -0.05, 0.1}, {0.4, 0.05, 0.2}));
  scene.bounds = {{1}, {0.1}};
  scene.goes({0.15, 0, 0}, 0.5);
  addPieces(
      [](double t) {
        Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
        pose.translation().x() = 0.15 - 0.6 * (t - 0.5);
        return std::vector<Eigen::Isometry3d>{pose};
      },
      2, 0, 0, 1e-3, 64, scene.path);
  const AlongPath along = scene.run();
  EXPECT_LE(along.until.seconds(), 1);
  EXPECT_GE(along.until.seconds(), 0.97);
}

TEST(IntendedPath, WhatTouchesAtItsSurfaceMayLeave) {
  for (const Vec3& way : {Vec3(0, 0, 0.3), Vec3(0.2, 0, 0.2), Vec3(0.3, 0, 0)}) {
    const AlongPath along = Scene(0).goes(way, 1).tube(0.002, 0.01).run();
    EXPECT_EQ(along.contact, PathContact::TOUCHES_AND_LEAVES) << way.transpose();
    EXPECT_EQ(along.scale.scale, 1) << way.transpose() << along.scale.reason;
    EXPECT_FALSE(along.until.isPromise()) << "it touches";
  }
}

TEST(IntendedPath, WhatLeavesTheTableMayMeetWhatASensorSawTooSeldom) {
  Scene up = Scene(0).goes({0, 0, 0.3}, 1).tube(0.002, 0.01);
  up.step.map.own.seen = share(std::vector<OccupiedLeaf>{{{32768, 32768, 32771}, 1}});  // 0.05 m above it
  const double s = up.run().scale.scale;
  EXPECT_LE(0.3 * (s * 0.1 + s * s * 0.15), 0.05 - 0.025 + 1e-9);
}

TEST(IntendedPath, WhatGoesOnIntoWhatItTouchesDoesNot) {
  for (const Vec3& way : {Vec3(0, 0, -0.3), Vec3(0.3, 0, -0.001)}) {
    const AlongPath along = Scene(0).goes(way, 1).run();
    EXPECT_EQ(along.contact, PathContact::TOUCHES_AND_APPROACHES) << way.transpose();
    EXPECT_EQ(along.scale.scale, 0) << way.transpose();
    EXPECT_NE(along.scale.reason, "");
  }
  // First up, then down into it: it leaves for as long as it goes up.
  Scene back(0);
  back.goes({0, 0, 0.02}, 0.05);
  addPieces(
      [](double t) {
        Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
        pose.translation().z() = 0.02 - (t - 0.05);
        return std::vector<Eigen::Isometry3d>{pose};
      },
      1, 0, 0, 1e-3, 64, back.path);
  EXPECT_LT(back.run().scale.scale, 0.6);
}

TEST(IntendedPath, WhatIsInsideOrCrossesHasNoWayOut) {
  EXPECT_EQ(Scene(-0.02).goes({0, 0, 0.3}, 1).run().scale.scale, 0) << "in the table's voxels";
  Scene in_box(0);
  in_box.step.map.surface = nullptr;
  in_box.step.bodies.push_back(boxBody("crate", {-1, -1, 0}, {1, 1, 1}));
  in_box.bounds = {{0.5}, {0}};
  in_box.goes({0, 0, 0.3}, 1);
  const AlongPath inside = in_box.run();
  EXPECT_EQ(inside.scale.scale, 0) << "it stands on the floor of a closed crate, from within";
  EXPECT_EQ(inside.contact, PathContact::TOUCHES_AND_APPROACHES);
  in_box.step.bodies[1] = boxBody("crate", {-1, -1, -1}, {1, 1, 0.05});
  EXPECT_EQ(in_box.run().scale.scale, 0) << "it crosses the lid";
  in_box.step.bodies[1] = boxBody("crate", {-1, -1, -1}, {1, 1, 0});
  EXPECT_EQ(in_box.run().scale.scale, 1) << "it stands on it";
}

TEST(IntendedPath, LeavingOneThingDoesNotHideAnotherOne) {
  // It lies on the table, 0.1 m before the wall.
  Scene scene(0);
  for (Body& body : scene.step.bodies) {
    Positions at = *body.t0;
    for (Vec3& p : at) p.x() += 0.85;
    body.t0 = body.t1 = share(at);
  }
  scene.bounds = {{2}};
  scene.goes({1, 0, 0.1}, 1);
  const double s = scene.run().scale.scale;
  EXPECT_GT(s, 0);
  EXPECT_LE(s * 0.1 + s * s * 0.15, 0.1 - 0.025 + 1e-9);
}

TEST(IntendedPath, WhatComesByItselfHasNoStandingRule) {
  Scene scene(0.1);
  scene.step.bodies.push_back(boxBody("person", {-0.5, -0.5, 0.25}, {0.5, 0.5, 0.5}));
  scene.step.bodies[1].against_obstacle = false;
  scene.bounds = {{0.5}, {1, false}};
  scene.goes({0.2, 0, 0}, 1);
  EXPECT_EQ(scene.run().scale.scale, 0) << "it may come 0.1 m until the arm begins to slow down";
  scene.bounds[1] = {1};
  EXPECT_EQ(scene.run().scale.scale, 1) << "it slows down, and the two come no nearer";
  scene.bounds[1] = {NONE};
  EXPECT_EQ(scene.run().scale.scale, 0) << "nobody says how fast it is";
  EXPECT_FALSE(scene.run().until.isPromise());
}

TEST(IntendedPath, OfWhatIsOnItNoBoundIsNeeded) {
  Scene scene(0.2);
  scene.bounds = {{NONE}};
  scene.goes({0.4, 0, 0}, 1).tube(0.01, 0.02);
  const AlongPath along = scene.run();
  EXPECT_NEAR(along.until.seconds(), 1, 1e-6);
  EXPECT_EQ(along.scale.scale, 1);
  scene.step.bodies[0].against_obstacle = false;
  scene.step.bodies.push_back(boxBody("cloth", {-0.05, -0.05, 0.4}, {0.05, 0.05, 0.41}));
  EXPECT_EQ(scene.run().until.seconds(), 0) << "the cloth has none";
}

TEST(IntendedPath, ABudgetLeavesAnEarlierTimeThatHolds) {
  std::atomic<std::int64_t> looks{0};
  const Scene dive = Scene(0.4).goes({0, 0, -0.2}, 1, 1).tube(0.001, 0.01);
  const double whole_s = dive.run().until.seconds();
  double last_s = 0;
  for (const std::int64_t most : {0, 20, 60, 100000}) {
    looks = most;
    const AlongPath along = dive.run(Deadline::afterLooks(looks));
    EXPECT_GE(along.until.seconds(), 0.8 - 1e-3) << "by bounds alone";
    EXPECT_LE(along.until.seconds(), whole_s);
    EXPECT_GE(along.until.seconds(), last_s - 1e-9);
    last_s = along.until.seconds();
  }
  EXPECT_EQ(last_s, whole_s);
}

TEST(IntendedPath, OneThatCannotBeUsedChangesNothing) {
  const Scene good = Scene(0.2).goes({0.4, 0, 0}, 1);
  const auto unused = [&](const std::function<void(Scene&)>& change) {
    Scene bad = good;
    change(bad);
    const AlongPath along = bad.run();
    Scene without = bad;
    without.path = {};
    EXPECT_EQ(along.until.seconds(), without.run().until.seconds()) << along.unused;
    EXPECT_EQ(along.scale.scale, without.run().scale.scale) << along.unused;
    EXPECT_FALSE(along.rests_on_path);
    return along.unused;
  };
  EXPECT_EQ(good.run().unused, "");
  EXPECT_EQ(unused([](Scene& s) { s.path.bodies[0].pose[0].translation().x() = std::nan(""); }),
            "it has not a pose of 'tool' for each time");
  EXPECT_EQ(unused([](Scene& s) { s.path.bodies[0].pose.pop_back(); }), "it has not a pose of 'tool' for each time");
  EXPECT_EQ(unused([](Scene& s) { s.path.time_s.back() = 0; }), "its times do not ascend");
  EXPECT_EQ(unused([](Scene& s) { s.path.time_s.back() = std::nan(""); }), "its times do not ascend");
  EXPECT_EQ(unused([](Scene& s) { s.path.time_s[0] = 0.1; }), "it does not begin at 0 s");
  EXPECT_EQ(unused([](Scene& s) { s.path.bend_m[0] = NONE; }), "nobody says how far its pieces are from straight");
  EXPECT_EQ(unused([](Scene& s) { s.path.bodies[0].body = 7; }), "it moves a body that is not there");
  EXPECT_EQ(unused([](Scene& s) { s.path.bodies.push_back(s.path.bodies[0]); }), "it moves 'tool' twice");
  EXPECT_EQ(unused([](Scene& s) { s.path.deviation_m = -1; }), "its tube is not 0 or more");
  EXPECT_EQ(unused([](Scene& s) { s.path.bodies.clear(); }), "it moves no body that is watched");
  EXPECT_EQ(unused([](Scene& s) { s.path = restOf(s.path, 1, 1, NONE); }), "it is over");
  EXPECT_EQ(unused([](Scene& s) {
              Positions lost = *s.step.bodies[0].t1;
              lost[0].x() = std::nan("");
              s.step.bodies[0].t0 = s.step.bodies[0].t1 = share(lost);
            }).substr(0, 10),
            "not proved");
}

TEST(IntendedPath, PiecesBendByNoMoreThanTheySay) {
  // A joint 0.4 m away turns, and another one in the wrist.
  const auto pose = [](double t) {
    return Eigen::AngleAxisd(2 * t, Vec3::UnitZ()) * Eigen::Translation3d(0.4, 0, 0) *
           Eigen::AngleAxisd(1.5 * t, Vec3::UnitX());
  };
  IntendedPath path;
  path.bodies = {{0, {}}};
  const auto poses = [&](double t) { return std::vector<Eigen::Isometry3d>{pose(t)}; };
  addPieces(poses, 1, 3.5 * 3.5 * 0.6, 0.2, 1e-3, 64, path);
  EXPECT_LE(path.bend_m.size(), 64u);
  EXPECT_GT(path.bend_m.size(), 10u);
  EXPECT_EQ(path.time_s.back(), 1);
  for (std::size_t k = 0; k < path.bend_m.size(); ++k) {
    EXPECT_LE(path.bend_m[k], 1.01e-3);
    for (double u = 0; u <= 1; u += 0.125) {
      const double t = path.time_s[k] + u * (path.time_s[k + 1] - path.time_s[k]);
      const Eigen::Isometry3d meant = pose(t),
                              said = interpolate(path.bodies[0].pose[k], path.bodies[0].pose[k + 1], u);
      for (const Vec3& v : {Vec3(0.2, 0, 0), Vec3(0, 0.2, 0), Vec3(0, 0, 0.2), Vec3(0.1, -0.1, 0.1)})
        EXPECT_LE((meant * v - said * v).norm(), path.bend_m[k]);
    }
  }
  IntendedPath few;
  few.bodies = {{0, {}}};
  addPieces(poses, 1, 3.5 * 3.5 * 0.6, 0.2, 1e-3, 3, few);
  EXPECT_EQ(few.bend_m.size(), 3u);
  EXPECT_GT(few.bend_m[0], 0.05);
}

TEST(IntendedPath, WhereOnItBodiesAre) {
  Scene scene = Scene(0.2).goes({0.4, 0, 0}, 1, 1);
  const auto at = [&](double t, double aside_m) {
    Step step = scene.step;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = Vec3(0.4 * t, aside_m, 0);
    pose.linear() = Eigen::AngleAxisd(t, Vec3::UnitZ()).toRotationMatrix();
    Positions moved = *step.bodies[0].t1;
    for (Vec3& p : moved) p = pose * p;
    step.bodies[0].t1 = share(moved);
    step.bodies[0].pose_t1 = pose;
    return step;
  };
  for (const double t : {0.0, 0.26, 0.5, 1.0}) {
    const PlaceOnPath place = placeOnPath(scene.path, at(t, 0), 0, 1);
    EXPECT_NEAR(place.time_s, t, 2e-3);
    EXPECT_LE(place.off_m, 2.1e-3);
  }
  EXPECT_NEAR(placeOnPath(scene.path, at(0.5, 0.02), 0, 1).off_m, 0.02, 3e-3);
  EXPECT_NEAR(placeOnPath(scene.path, at(0.5, 0), 0, 0.3).time_s, 0.3, 1e-9) << "it is not to be farther than that";
  EXPECT_GT(placeOnPath(scene.path, at(0.5, 0), 0, 0.3).off_m, 0.05);
  const IntendedPath rest = restOf(scene.path, 0.26, 0.26, NONE);
  EXPECT_NEAR(rest.endsAt(), 0.74, 1e-12);
  EXPECT_EQ(rest.time_s[0], 0);
  EXPECT_LE(placeOnPath(rest, at(0.26, 0), 0, 0).off_m, 1e-3);
  Step lost = at(0.5, 0);
  lost.bodies[0].t1 = share(Positions(lost.bodies[0].t1->size(), Vec3::Constant(std::nan(""))));
  EXPECT_EQ(placeOnPath(scene.path, lost, 0, 1).off_m, NONE);
}

/// The path of a body that goes along x, by places and times.
IntendedPath alongX(const std::vector<std::pair<double, double>>& time_and_x) {
  IntendedPath path;
  path.bodies = {{0, {}}};
  for (const auto& [time_s, x] : time_and_x) {
    if (!path.time_s.empty()) path.bend_m.push_back(0);
    path.time_s.push_back(time_s);
    path.bodies[0].pose.push_back(Eigen::Isometry3d(Eigen::Translation3d(x, 0, 0)));
  }
  return path;
}

// Who may be further on the path than the nearest place, for all that its tube tells, is taken to be there already.
TEST(IntendedPath, OfSeveralPlacesTheLastOneTellsTheTime) {
  const Scene scene = Scene(0.2).goes({0.4, 0, 0}, 1);
  const Step& rests = scene.step;  // at 0
  const IntendedPath creeps = alongX({{0, -0.001}, {1, 0.001}, {2, 1}});
  const PlaceOnPath on_creeping = placeOnPath(creeps, rests, 0, 0.9, 0.005);
  EXPECT_NEAR(on_creeping.time_s, 0.5, 1e-9);
  EXPECT_NEAR(on_creeping.last_s, 0.9, 1e-9) << "not beyond the time that is over";
  EXPECT_NEAR(placeOnPath(creeps, rests, 0, 2, 0.0005).last_s, 0.75, 1e-6);
  EXPECT_NEAR(placeOnPath(creeps, rests, 0, 2, 0.002).last_s, 1 + 0.001 / 0.999, 1e-6);
  const IntendedPath rest = restOf(creeps, on_creeping.time_s, on_creeping.last_s, 0.5);
  EXPECT_EQ(problemOf(rest, rests.bodies), "");
  EXPECT_NEAR(rest.endsAt(), 0.5, 1e-12) << "by the clock";
  EXPECT_NEAR(rest.bodies[0].pose.back().translation().x(), 0.001 + 0.4 * 0.999, 1e-9);
  EXPECT_NEAR(rest.bodies[0].pose.front().translation().x(), 0, 1e-9);

  // There and back: it is at the first of the two places, and may be at the second one.
  const IntendedPath twice = alongX({{0, 0}, {0.5, 0.2}, {1, 0}, {1.5, 0.5}});
  const PlaceOnPath on_twice = placeOnPath(twice, rests, 0, 1, 0.005);
  EXPECT_NEAR(on_twice.time_s, 0, 1e-9);
  EXPECT_NEAR(on_twice.last_s, 1, 1e-9);
  const IntendedPath all = restOf(twice, on_twice.time_s, on_twice.last_s, NONE);
  EXPECT_EQ(problemOf(all, rests.bodies), "");
  EXPECT_NEAR(all.endsAt(), 0.5, 1e-6);
  ASSERT_EQ(all.bodies[0].pose.size(), 4u);
  EXPECT_LE(all.time_s[2], 1e-6) << "the way there and back takes no time";
  EXPECT_NEAR(all.bodies[0].pose[1].translation().x(), 0.2, 1e-12);
  EXPECT_NEAR(placeOnPath(twice, rests, 0.6, 1, 0.005).time_s, 1, 1e-9) << "once it has been away";
}

}  // namespace
}  // namespace test
}  // namespace dccd
