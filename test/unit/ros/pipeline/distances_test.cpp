// When distances are measured, and what is said where they are not known.
#include <cmath>
#include <fstream>

#include <gtest/gtest.h>

#include "output/clearance_messages.h"
#include "output/output_messages.h"
#include "support/closed_meshes.h"
#include "unit/ros/pipeline/driven_pipeline.h"
#include "unit/ros/stl_text.h"

namespace dccd {
namespace test {
namespace {

XmlRpcValue sceneWith(const std::string& clearance) {
  XmlRpcValue tree = scene();
  tree["effects"]["clearance"] = clearance;
  return tree;
}

/// The row of the cloth and the map.
ClearanceDistance fromMap(const Outcome& outcome) {
  for (const Clearance& clearance : outcome.clearances) {
    if (clearance.body[1] == OBSTACLE_BODY) return clearance.at_end;
  }
  ADD_FAILURE() << "no row of the map";
  return {};
}

TEST(Distances, AreMeasuredWhileSomebodyAsksForThem) {
  Driven driven(sceneWith("auto"));
  driven.giveMap(1);
  driven.feed(1, 0.5f);
  EXPECT_TRUE(driven.feed(1.1, 0.375f).clearances.empty());
  driven.pipeline.effects().hearDistances(true);
  const ClearanceDistance distance = fromMap(driven.feed(1.2, 0.25f));
  EXPECT_LE(distance.lower_m, 0.25);
  EXPECT_GE(distance.upper_m, 0.25);
  EXPECT_EQ(driven.outcome.stats[Effect::CLEARANCE].in, driven.outcome.clearances.size());
  EXPECT_TRUE(driven.pipeline.checkNow(0).clearances.empty()) << "nobody reads them there";
  driven.pipeline.effects().hearDistances(false);
  EXPECT_TRUE(driven.feed(1.3, 0.25f).clearances.empty());

  Driven always(sceneWith("on"));
  always.giveMap(1);
  always.feed(1, 0.5f);
  EXPECT_FALSE(always.feed(1.1, 0.375f).clearances.empty());
  Driven never(sceneWith("off"));
  never.pipeline.effects().hearDistances(true);
  never.giveMap(1);
  never.feed(1, 0.5f);
  EXPECT_TRUE(never.feed(1.1, 0.375f).clearances.empty());
}

// The finger is 0.8 m away, the map 0.25 m: a promise needs no more of the finger than that it is farther.
TEST(Distances, OfAPromiseAloneThoseThatTellItAreMeasured) {
  const std::string file = ::testing::TempDir() + "finger.stl";
  std::ofstream(file) << stlText(box({-0.01, -0.01, 0}, {0.01, 0.01, 0.04}));
  const std::string bodies =
      "max_speed_m_s: 1.0, speed_scale: {reaction_time_s: 0.1, stopping_time_s: 0.1}, clearance: {max_m: 2.0}, "
      "bodies: {cloth: {topic: cloth}, finger: {rigid: {frame: finger, mesh: '" +
      file + "'}}}";
  const auto rows = [&](const std::string& more, const auto& prepare) {
    Driven driven(scene(bodies + more));
    driven.raise("finger", 1);
    driven.giveMap(1);
    prepare(driven.pipeline.effects());
    for (int k = 0; k < 4; ++k) driven.feed(1 + 0.1 * k, 0.25f + 0.01f * static_cast<float>(3 - k));
    std::vector<ClearanceStatus> rows;
    for (const Clearance& row : driven.outcome.clearances) rows.push_back(row.at_end.status);
    const SafeUntil& promise = driven.pipeline.promises().promise();
    EXPECT_EQ(promise.limiting, 1u);
    EXPECT_NEAR(promise.seconds(), 0.25, 1e-3);
    return rows;
  };
  using Status = ClearanceStatus;
  const std::vector<Status> all{Status::MEASURED, Status::MEASURED, Status::MEASURED},
      few{Status::FARTHER, Status::MEASURED, Status::FARTHER};
  EXPECT_EQ(rows("", [](EffectTracker& effects) { effects.hearDistances(false); }), few);
  EXPECT_EQ(rows("", [](EffectTracker& effects) { effects.hearDistances(true); }), all);
  EXPECT_EQ(rows("", [](EffectTracker& effects) { effects.hearDistances(false, true); }), all);
  EXPECT_EQ(rows("", [](EffectTracker&) {}), all) << "as in analyze_bag";
  const auto nobody = [](EffectTracker& effects) { effects.hearDistances(false); };
  EXPECT_EQ(rows(", effects: {clearance: 'on'}", nobody), all);
  EXPECT_EQ(rows(", limits: {max_m: 0.3, horizon_s: 0.1}", nobody), all);
}

// Live reconfiguration knows nothing of what the plan decides.
TEST(Distances, GoOnWhenOtherOptionsChange) {
  Driven driven(sceneWith("on"));
  driven.giveMap(1);
  driven.feed(1, 0.5f);
  driven.pipeline.reconfigure([](MonitorOptions& options, MarkerConfig&) { options.detector.max_contacts = 7; });
  EXPECT_TRUE(driven.pipeline.monitor().options().detector.clearance.wanted);
  EXPECT_FALSE(driven.feed(1.1, 0.375f).clearances.empty());
}

TEST(Distances, WithoutTheMapThatIsNamedNothingIsKnownOfIt) {
  XmlRpcValue tree = sceneWith("on");
  tree["octomap_topic"] = "/table";
  Driven driven(tree);
  driven.feed(1, 0.5f);
  EXPECT_EQ(driven.feed(1.1, 0.375f).status, StepStatus::NO_MAP);
  EXPECT_EQ(fromMap(driven.outcome).status, ClearanceStatus::UNKNOWN);
  const auto state = toState(driven.outcome, "world");
  EXPECT_EQ(state.clearance_between, "mesh and octomap");
  EXPECT_TRUE(std::isnan(state.clearance_lower) && std::isnan(state.clearance_upper));
}

TEST(Distances, WhereAPointIsNotSeenNothingIsKnown) {
  Driven driven(sceneWith("on"));
  driven.giveMap(1);
  driven.feed(1, 0.5f);
  std::vector<std::uint8_t> bytes = cloud(1.1, 0.375f);
  const float lost = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(bytes.data() + bytes.size() - 1 - 16, &lost, 4);  // x of the last point, before is_dense
  driven.pipeline.take(0, {"sensor_msgs/PointCloud2", bytes, 0, 0});
  ASSERT_TRUE(driven.pipeline.nextOutcome(0, driven.outcome));
  EXPECT_EQ(driven.outcome.status, StepStatus::PARTIAL) << driven.outcome.reason;
  EXPECT_FALSE(driven.outcome.clearances.empty());
  for (const Clearance& clearance : driven.outcome.clearances) {
    EXPECT_EQ(clearance.over_step.status, ClearanceStatus::UNKNOWN);
  }
  EXPECT_TRUE(std::isnan(toState(driven.outcome, "world").clearance_lower));
}

}  // namespace
}  // namespace test
}  // namespace dccd
