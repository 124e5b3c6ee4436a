// How fast bodies may be: the parameters, the room beside straight paths, and what is promised in messages.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "dccd/assurance.h"
#include "output/output_messages.h"
#include "output/safe_until_messages.h"
#include "support/closed_meshes.h"
#include "unit/ros/pipeline/driven_pipeline.h"
#include "unit/ros/stl_text.h"

namespace dccd {
namespace test {
namespace {

constexpr double NONE = SpeedBound::NONE;

MonitorConfig read(const std::string& yaml) { return readConfig(parseYaml(yaml, "p.yaml"), ""); }
std::string mistake(const std::string& yaml) {
  return said<ParameterError>([&] { read(yaml); });
}

TEST(SpeedParameters, HoldForAllBodiesAndForOne) {
  const MonitorConfig none = read("{}");
  EXPECT_EQ(none.bodies[0].speed.max_m_s, NONE);
  EXPECT_FALSE(none.promises());
  EXPECT_FALSE(none.speed_law);
  const MonitorConfig config = read(
      "max_speed_m_s: 0.5\nmax_acceleration_m_s2: 4\n"
      "speed_scale: {reaction_time_s: 0.1, stopping_time_s: 0.2}\n"
      "bodies:\n"
      "  cloth: {topic: a}\n"
      "  person: {topic: b, max_speed_m_s: 1.6, slows_down: false, max_acceleration_m_s2: 0}\n"
      "  free: {topic: c, max_speed_m_s: none}\n"
      "  table: {topic: d, motion: static}\n");
  ASSERT_EQ(config.bodies.size(), 4u);
  const auto bodyOf = [&](const std::string& name) {
    return *std::find_if(config.bodies.begin(), config.bodies.end(),
                         [&](const BodyConfig& body) { return body.body.name == name; });
  };
  EXPECT_EQ(bodyOf("cloth").speed.max_m_s, 0.5);
  EXPECT_EQ(bodyOf("cloth").max_acceleration_m_s2, 4);
  EXPECT_TRUE(bodyOf("cloth").speed.slows_down);
  EXPECT_EQ(bodyOf("person").speed.max_m_s, 1.6);
  EXPECT_FALSE(bodyOf("person").speed.slows_down);
  EXPECT_EQ(bodyOf("person").max_acceleration_m_s2, 0);
  EXPECT_EQ(bodyOf("free").speed.max_m_s, NONE);
  EXPECT_EQ(bodyOf("table").speed.max_m_s, 0) << "it stands still";
  EXPECT_EQ(bodyOf("table").max_acceleration_m_s2, 0);
  EXPECT_TRUE(config.promises());
  EXPECT_EQ(config.speed_law->stopping_time_s, 0.2);
  EXPECT_EQ(config.speed_law->uncertainty_m, 0);
  EXPECT_EQ(config.monitor.detector.accuracy.rung, Accuracy::CONSERVATIVE);
  const MonitorConfig held = read(
      "max_speed_m_s: 0.5\nbodies: {pad: {rigid: {mesh: a.stl, frame: hand}}, cloth: {topic: a, carried_by: hand, "
      "max_relative_speed_m_s: 0.2}}\nclock_body: cloth\nlimits: {max_m: 0.3, horizon_s: 0.1}\n");
  EXPECT_EQ(held.bodies[0].speed.relative_m_s, 0.2);
  EXPECT_EQ(held.bodies.at(held.bodies[0].speed.carrier).body.name, "pad");
  EXPECT_EQ(held.limits->max_m, 0.3);
  EXPECT_EQ(config.bodies[0].speed.carrier, SpeedBound::NO_CARRIER);
  const MonitorConfig off = read("max_speed_m_s: 0.5\neffects: {clearance: off}\n");
  EXPECT_FALSE(off.promises());
}

TEST(SpeedParameters, MistakesAreNamed) {
  for (const auto& [yaml, part] : {
           std::pair{"max_speed_m_s: -1\n", "max_speed_m_s"},
           {"max_speed_m_s: .inf\n", "max_speed_m_s"},
           {"max_speed_m_s: 0\n", "max_speed_m_s is 0; what stands still is motion: static, or rigid in the fixed "},
           {"robot: {description: d, max_speed_m_s: 0}\n", "where nothing is to be promised write none"},
           {"max_speed_m_s: nothing\n", "max_speed_m_s is 'nothing', it must be one of none"},
           {"max_speed_m_s: .nan\n", "max_speed_m_s"},
           {"max_acceleration_m_s2: -1\n", "max_acceleration_m_s2"},
           {"max_acceleration_m_s2: 1\naccuracy: exact\n", "max_acceleration_m_s2 asks for room beside straight paths"},
           {"max_speed_m_s: 1\nspeed_scale: {reaction_time_s: 0.1}\n", "speed_scale/stopping_time_s"},
           {"max_speed_m_s: 1\nspeed_scale: {reaction_time_s: -0.1, stopping_time_s: 1}\n", "reaction_time_s"},
           {"speed_scale: {reaction_time_s: 0.1, stopping_time_s: 1}\n", "speed_scale needs a speed bound"},
           {"max_speed_m_s: 1\neffects: {clearance: off}\nspeed_scale: {reaction_time_s: 1, stopping_time_s: 1}\n",
            "speed_scale needs distances"},
           {"bodies: {cloth: {topic: a}, table: {topic: b, motion: static, max_speed_m_s: 1}}\n",
            "max_speed_m_s has no meaning for a static body"},
           {"bodies: {cloth: {topic: a}, pad: {rigid: {mesh: a.stl, frame: f}, max_acceleration_m_s2: 1}}\n",
            "max_acceleration_m_s2 has no meaning for a rigid body"},
           {"bodies: {cloth: {topic: a, slows_down: 1}}\n", "slows_down"},
           {"bodies: {cloth: {topic: a, carried_by: hand}}\n", "max_relative_speed_m_s"},
           {"bodies: {cloth: {topic: a, carried_by: hand, max_relative_speed_m_s: 1}}\n",
            "carried_by is 'hand', which carries no rigid body or link that is watched"},
           {"bodies: {cloth: {topic: a}, table: {topic: b, motion: static, carried_by: a, max_relative_speed_m_s: "
            "1}}\n",
            "carried_by is for what deforms"},
           {"limits: {max_m: 0.1, horizon_s: 0.1}\n", "limits needs distances and a speed bound"},
           {"max_speed_m_s: 1\nlimits: {max_m: 0.1}\n", "limits/horizon_s"},
           {"max_speed_m_s: 1\nlimits: {max_m: 0.6, horizon_s: 0.1}\n", "limits/max_m is more than clearance/max_m"},
       }) {
    EXPECT_TRUE(mentions(mistake(yaml), part)) << yaml << mistake(yaml);
  }
}

// A fall onto the map's top at z = 0, seen at the same height in two frames: between them it may have been lower.
TEST(PathsBetweenFrames, ATouchThatNobodySawIsReportedWhereTheAccelerationAllowsIt) {
  Driven cloth(scene("max_acceleration_m_s2: 8"));  // 8 * 0.1^2 / 8 = 0.01 m in 0.1 s
  cloth.giveMap(1);
  EXPECT_TRUE(cloth.pipeline.effects().plan().running(Effect::TRACKER_NOISE));
  cloth.feed(1, 0.011f);
  EXPECT_TRUE(assuranceOf(cloth.feed(1.1, 0.011f)).clear()) << "1 mm is left of 11";
  ASSERT_TRUE(cloth.outcome.step->bodies[0].radius_m);
  for (const double radius_m : *cloth.outcome.step->bodies[0].radius_m) {
    EXPECT_GE(radius_m, 0.01 * (1 - 1e-7)) << "a stamp has nanoseconds";
    EXPECT_NEAR(radius_m, 0.01, 1e-8);
  }
  cloth.feed(1.2, 0.009f);
  EXPECT_FALSE(assuranceOf(cloth.feed(1.3, 0.009f)).clear()) << "1 mm is missing";
  EXPECT_FALSE(cloth.outcome.contacts.empty());
  EXPECT_TRUE(cloth.feed(1.34, 0.009f).answered);
  EXPECT_NEAR(cloth.outcome.step->bodies[0].radius_m->at(0), 0.01, 1e-8) << "of the frame before, in doubt";
  cloth.feed(1.38, 0.009f);
  EXPECT_NEAR(cloth.outcome.step->bodies[0].radius_m->at(0), 0.0016, 1e-8) << "a shorter time, a narrower tube";
}

TEST(PathsBetweenFrames, ABodyThatIsNotTheClockHasTheStepsToleranceBesides) {
  Driven both(
      scene("max_acceleration_m_s2: 8, effects: {octomap: 'off'}, clock_body: a, "
            "bodies: {a: {topic: a}, b: {topic: b, uncertainty: {radius_m: 0.5}}}"));
  Outcome outcome;
  for (const double stamp_s : {1.0, 1.1}) {
    both.take(1, cloud(stamp_s, 2));
    both.take(0, cloud(stamp_s, 0));
    while (both.pipeline.nextOutcome(0, outcome)) {
    }
  }
  ASSERT_TRUE(outcome.answered) << outcome.reason;
  EXPECT_NEAR(outcome.step->bodies[0].radius_m->at(0), 0.01, 1e-8);
  EXPECT_NEAR(outcome.step->bodies[1].radius_m->at(0), 0.5 + 0.01 + both.config.monitor.detector.rigid_tolerance_m,
              1e-8);
}

/// A step of a cloth whose distance to the map is as given.
Outcome distant(double lower_m, ClearanceStatus status) {
  Outcome outcome;
  Step step;
  step.bodies.resize(1);
  step.bodies[0].name = "cloth";
  step.bodies[0].topology = share(Topology::grid(2, 2));
  step.bodies[0].t0 = step.bodies[0].t1 = share(Positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}});
  step.map.surface = VoxelSurface::build(0.1, {});
  step.start_ns = 900000000;
  step.stamp_ns = 1000000000;
  outcome.obstacle = step.map.surface;
  outcome.step = std::make_shared<const Step>(step);
  outcome.status = StepStatus::OK;
  outcome.answered = true;
  outcome.claim = Claim::thatWasSaid({});
  outcome.stamp_ns = step.stamp_ns;
  Clearance pair;
  pair.body = {0, OBSTACLE_BODY};
  pair.at_end.status = status;
  pair.at_end.lower_m = lower_m;
  outcome.clearances = {pair};
  return outcome;
}

TEST(SafeUntilMessage, SaysUntilWhenWhoAndWhatItRestsOn) {
  const Outcome outcome = distant(0.3, ClearanceStatus::MEASURED);
  const std::vector<SpeedBound> bounds{{0.5}};
  PromiseWatch watch;
  watch.setBounds(bounds);
  watch.follow(outcome);
  const auto message = toSafeUntil(outcome, watch, bounds, ros::Time(1.1), "world");
  EXPECT_EQ(message.header.stamp, ros::Time(1.0));
  EXPECT_EQ(message.header.frame_id, "world");
  EXPECT_NEAR(message.until.toSec(), 1.6, 1e-8);
  EXPECT_NEAR(message.seconds, 0.6, 1e-8);
  EXPECT_NEAR(message.left, 0.5, 1e-8);
  EXPECT_EQ(message.bodies[0], "cloth");
  EXPECT_EQ(message.bodies[1], "octomap");
  EXPECT_EQ(message.distance, 0.3);
  EXPECT_EQ(message.closing_speed, 0.5);
  EXPECT_EQ(message.assumed,
            (std::vector<std::string>{"no vertex of 'cloth' is faster than 0.5 m/s",
                                      "all that can be touched is in the map, which stands still and gets no new voxel",
                                      "what 'cloth' does to itself is not spoken of (clearance/self_m is 0)"}));
  EXPECT_EQ(message.reason + message.broken, "");
  Outcome asked = outcome;
  asked.clearances.push_back(asked.clearances[0]);
  asked.clearances[1].body = {0, 0};
  EXPECT_EQ(toSafeUntil(asked, watch, bounds, ros::Time(1.1), "world").assumed[2],
            "neighbours on the surface of 'cloth' are not spoken of");
  Step doubtful = *outcome.step;
  doubtful.map.own.doubted = 25;
  Outcome near = outcome;
  near.step = std::make_shared<const Step>(doubtful);
  EXPECT_EQ(toSafeUntil(near, watch, bounds, ros::Time(1.1), "world").assumed[2],
            "voxels of the map in doubt are no obstacle: 25");
}

TEST(SafeUntilMessage, NoMoreIsLeftThanWasPromisedWhereStampsAreAhead) {
  const Outcome outcome = distant(0.3, ClearanceStatus::MEASURED);
  PromiseWatch watch;
  watch.setBounds({{0.5}});
  watch.follow(outcome);
  const auto leftAt = [&](double now_s) {
    return toSafeUntil(outcome, watch, {{0.5}}, ros::Time(now_s), "world").left;
  };
  EXPECT_NEAR(leftAt(0.1), 0.6, 1e-8) << "what is stamped 0.9 s ahead was there when it came";
  EXPECT_NEAR(leftAt(1.0), 0.6, 1e-8);
  EXPECT_NEAR(leftAt(1.7), -0.1, 1e-8) << "it is over";
}

TEST(SafeUntilMessage, HasNoNumberWhereNothingIsKnown) {
  for (const ClearanceStatus status : {ClearanceStatus::UNKNOWN, ClearanceStatus::TOUCHING}) {
    const Outcome outcome = distant(0, status);
    PromiseWatch watch;
    watch.follow(outcome);
    const auto message = toSafeUntil(outcome, watch, {}, ros::Time(1.1), "world");
    EXPECT_EQ(message.until, message.header.stamp);
    EXPECT_EQ(message.seconds, 0);
    EXPECT_TRUE(std::isnan(message.closing_speed)) << "nobody says how fast it is";
    EXPECT_FALSE(message.reason.empty());
    EXPECT_FALSE(std::isinf(message.distance));
  }
  PromiseWatch watch;
  watch.follow(Outcome());
  const auto none = toSafeUntil(Outcome(), watch, {}, ros::Time(1.1), "world");
  EXPECT_TRUE(std::isnan(none.distance) && std::isnan(none.closing_speed));
  EXPECT_TRUE(none.bodies[0].empty() && none.assumed.empty());
}

TEST(SpeedScaleMessage, ItsAgeIsThatOfTheStampOrOfTheArrival) {
  const SpeedLaw law{0.3, 0.2, 0.02};
  EXPECT_EQ(whyTooOld(0.2, 0.1, law), "");
  EXPECT_EQ(whyTooOld(-4, 0.1, law), "") << "a stamp that is ahead of time makes nothing young";
  EXPECT_EQ(whyTooOld(0.2, 0.31, law), "no newer answer within the reaction time");
  EXPECT_EQ(whyTooOld(0.31, 0.2, law), "no newer answer within the reaction time");
  EXPECT_EQ(whyTooOld(5.1, 0.1, law),
            "the newest frame came 5 s after its stamp, which alone is more than the reaction time of 0.3 s: the clock "
            "of the stamps and the monitor's (ros::Time) differ, or frames are late");
  EXPECT_NE(whyTooOld(NONE, NONE, law), "");
  EXPECT_NE(whyTooOld(std::nan(""), 0, law), "");
}

// What is expected is part of what a promise rests on.
TEST(PromisesOfAPipeline, AreVoidOnceOtherContactsAreExpected) {
  Driven cloth(
      scene("max_speed_m_s: 0.5, expected_contacts: [{between: [mesh, octomap], phase: lay}, "
            "{between: [mesh, octomap], phase: smooth}], phase: lay"));
  MonitorPipeline& pipeline = cloth.pipeline;
  cloth.giveMap(1);
  cloth.feed(1, 0.01f);
  cloth.feed(1.1, 0.01f);
  EXPECT_EQ(pipeline.promises().promise().seconds(), MOST_PROMISED_S) << "touching the table is meant";
  pipeline.setPhase("lay");
  EXPECT_TRUE(pipeline.promises().promise().isPromise()) << "nothing has changed";
  EXPECT_EQ(pipeline.takeVoided(), "");
  pipeline.setPhase("");
  EXPECT_EQ(pipeline.takeVoided(), "other contacts are expected now");
  EXPECT_EQ(pipeline.takeVoided(), "");
  EXPECT_TRUE(pipeline.promises().isRevoked());
  EXPECT_FALSE(pipeline.promises().promise().isPromise());
  const auto message = toSafeUntil(Outcome(), pipeline.promises(), {}, ros::Time(1.2), pipeline.fixedFrame());
  EXPECT_EQ(message.header.stamp, ros::Time(1.1));
  EXPECT_EQ(message.until, message.header.stamp);
  EXPECT_EQ(message.seconds + message.others_seconds, 0);
  EXPECT_EQ(message.reason, "other contacts are expected now");
  EXPECT_EQ(message.broken, message.reason);
  EXPECT_EQ(pipeline.counters().promises.broken, 1u);
  cloth.feed(1.2, 0.01f);
  EXPECT_EQ(pipeline.promises().broken(), message.reason);
  EXPECT_NE(pipeline.statement().broken.find(message.reason), std::string::npos);
  EXPECT_EQ(pipeline.counters().promises.made, 2u);
  EXPECT_EQ(pipeline.counters().promises.kept, 0u);
  EXPECT_THROW(pipeline.setPhase("fold"), ParameterError);
  pipeline.reconfigure([](MonitorOptions& options, MarkerConfig&) { options.detector.max_contacts = 5; });
  EXPECT_TRUE(pipeline.promises().promise().isPromise()) << "it does not rest on what is listed";
}

// README's table: `frame` is the fixed frame. In another one it may be carried about.
TEST(PromisesOfAPipeline, ARigidBodyInTheFixedFrameStandsStill) {
  const std::string file = ::testing::TempDir() + "table.stl";
  std::ofstream(file) << stlText(box({0, 0, -0.1}, {0.5, 0.5, 0}));
  for (const std::string frame : {"world", "trolley"}) {
    Driven cloth(
        scene("effects: {octomap: 'off'}, max_speed_m_s: 0.6, bodies: {cloth: {topic: cloth}, table: {rigid: "
              "{frame: " +
              frame + ", mesh: '" + file + "'}}}"));
    cloth.raise("trolley", 0);
    cloth.feed(1, 0.2f);
    cloth.feed(1.1, 0.2f);
    const SafeUntil& promise = cloth.pipeline.promises().promise();
    EXPECT_NEAR(promise.closing_m_s, frame == "world" ? 0.6 : 1.2, 1e-12);
    EXPECT_NEAR(promise.seconds(), promise.distance_m / promise.closing_m_s, 1e-6);
    const auto message =
        toSafeUntil(cloth.outcome, cloth.pipeline.promises(), cloth.pipeline.speedBounds(), ros::Time(1.1), "world");
    const std::string assumed =
        frame == "world" ? "'table' stands still" : "no vertex of 'table' is faster than 0.6 m/s";
    EXPECT_EQ(std::count(message.assumed.begin(), message.assumed.end(), assumed), 1);
    cloth.feed(1.2, 0.2f);
    EXPECT_EQ(cloth.pipeline.counters().promises.kept, 1u) << cloth.pipeline.promises().broken();
  }
}

TEST(PromisesOfAPipeline, AreForgottenByAResetForItsReason) {
  Driven cloth(scene("max_speed_m_s: 0.5"));
  cloth.giveMap(1);
  cloth.feed(1, 0.2f);
  cloth.feed(1.1, 0.2f);
  ASSERT_TRUE(cloth.pipeline.promises().promise().isPromise());
  cloth.pipeline.reset(StepStatus::RESET, "all is forgotten");
  const auto message =
      toSafeUntil(Outcome(), cloth.pipeline.promises(), {}, ros::Time(1.2), cloth.pipeline.fixedFrame());
  EXPECT_EQ(message.reason, "all is forgotten");
  EXPECT_EQ(message.header.stamp, ros::Time(1.1));
  EXPECT_EQ(message.until, message.header.stamp);
  EXPECT_EQ(message.broken, "");
  EXPECT_EQ(cloth.pipeline.counters().promises.broken, 0u);
}

TEST(SpeedScaleMessage, IsZeroForAReason) {
  const auto scaleOf = [](const Outcome& outcome) {
    return toSpeedScale(outcome, speedScale(outcome, {{0.5}}, {0.1, 0.2, 0.02}), "world");
  };
  auto message = scaleOf(distant(3, ClearanceStatus::FARTHER));
  EXPECT_EQ(message.scale, 1);
  EXPECT_EQ(message.holds_until, ros::Time(1.0));
  limitSpeed("not proved", message);
  EXPECT_EQ(message.scale, 0);
  EXPECT_EQ(message.reason, "not proved");
  const auto near = scaleOf(distant(0.05, ClearanceStatus::MEASURED));
  EXPECT_NEAR(near.needed, 0.5 * 0.2 + 0.02, 1e-12);
  EXPECT_EQ(near.bodies[1], "octomap");
  const auto none = scaleOf(Outcome());
  EXPECT_EQ(none.scale, 0);
  EXPECT_TRUE(std::isnan(none.needed));
  EXPECT_TRUE(none.holds_until.isZero());
}

}  // namespace
}  // namespace test
}  // namespace dccd
