// Stamps of two computers whose clocks differ: things are not at one time where they are taken to be.
#include <gtest/gtest.h>

#include <fstream>

#include "dccd/assurance.h"
#include "input/stamp_lead.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

constexpr double START_S = 1.7e9;

StampNs at(double seconds) { return static_cast<StampNs>((START_S + seconds) * 1e9); }

TEST(StampLead, IsTheMostOfTheLastMessages) {
  StampLead lead;
  EXPECT_EQ(lead.seconds(), std::nullopt);
  lead.add(at(1), 0);
  EXPECT_EQ(lead.seconds(), std::nullopt) << "when it came is not known";
  for (int i = 0; i < 20; ++i) lead.add(at(i + 2), at(i + (i % 8 == 0 ? 0 : 1.9)));
  EXPECT_NEAR(*lead.seconds(), 2, 1e-6) << "what was late on its way hides nothing";
  for (int i = 20; i < 36; ++i) lead.add(at(i), at(i + 0.03));
  EXPECT_NEAR(*lead.seconds(), -0.03, 1e-6) << "the clock was set";
}

struct Clocks : Driven {
  using Driven::Driven;
  /// Its stamp is ahead by so much of when it comes.
  void takeOf(std::size_t body, double now_s, double ahead_s, float z) {
    const auto stamp = ros::Time(START_S) + ros::Duration(now_s + ahead_s);
    pipeline.take(body, {"sensor_msgs/PointCloud2", cloudAt(stamp, z), at(now_s), 0});
  }
  /// Sends for so long; returns the newest outcome that is no seam.
  const Outcome& run(double a_ahead_s, double b_ahead_s) {
    for (int i = 0; i <= 30; ++i) {
      takeOf(1, 0.1 * i, b_ahead_s, 1);
      while (pipeline.nextOutcome(0, outcome)) continue;
      takeOf(0, 0.1 * i, a_ahead_s, 0);
      while (pipeline.nextOutcome(0, outcome)) continue;
    }
    return outcome;
  }
};

TEST(ClocksOfTwoComputers, OfTwoBodies) {
  for (const auto& [a_s, b_s, alike] : {std::tuple(0.0, 0.0, true),
                                        {0.0, 0.2, true},
                                        {0.0, 2.0, false},
                                        {2.0, 2.0, true},
                                        {0.5, 0.9, false},
                                        {-0.2, 0.2, true}}) {
    Clocks bodies(scene("effects: {octomap: 'off'}, bodies: {a: {topic: a}, b: {topic: b}}"));
    const Outcome& outcome = bodies.run(a_s, b_s);
    ASSERT_TRUE(outcome.answered) << a_s << " " << b_s << " " << outcome.reason;
    const Assurance said = assuranceOf(outcome);
    EXPECT_EQ(said.proved, alike) << a_s << " " << b_s << " " << describe(said);
    if (!alike) EXPECT_NE(describe(said).find("stamps of body 'b' are up to"), std::string::npos) << describe(said);
  }
}

// What holds at all times may be old, but nothing is of a time to come.
TEST(ClocksOfTwoComputers, OfAStaticBody) {
  for (const auto& [cloth_s, table_s, alike] :
       {std::tuple(0.0, -100.0, true), {2.0, -100.0, true}, {0.0, 2.0, false}}) {
    Clocks bodies(scene("effects: {octomap: 'off'}, bodies: {a: {topic: a}, b: {topic: b, motion: static}}"));
    bodies.takeOf(1, 0, table_s, 1);
    for (int i = 0; i <= 10; ++i) {
      bodies.takeOf(0, 0.1 * i, cloth_s, 0);
      while (bodies.pipeline.nextOutcome(0, bodies.outcome)) continue;
    }
    ASSERT_TRUE(bodies.outcome.answered) << table_s << " " << bodies.outcome.reason;
    const Assurance said = assuranceOf(bodies.outcome);
    EXPECT_EQ(said.proved, alike) << cloth_s << " " << table_s << " " << describe(said);
    if (!alike) EXPECT_NE(describe(said).find("stamps of body 'b' are up to 2 s later"), std::string::npos);
  }
}

// Once one of two that were ahead alike is set, what it was ahead by says nothing of the other.
TEST(ClocksOfTwoComputers, OfWhichOneWasSet) {
  Clocks bodies(scene("effects: {octomap: 'off'}, bodies: {a: {topic: a}, b: {topic: b}}"));
  ASSERT_TRUE(assuranceOf(bodies.run(0.5, 0.5)).proved);
  for (int i = 31; i <= 38; ++i) {
    bodies.takeOf(1, 0.1 * i, 0.5, 1);
    bodies.takeOf(0, 0.1 * i, 0, 0);
    while (bodies.pipeline.nextOutcome(0, bodies.outcome)) continue;
    EXPECT_FALSE(assuranceOf(bodies.outcome).proved) << i;
  }
  EXPECT_TRUE(bodies.outcome.answered) << bodies.outcome.reason;
  EXPECT_NE(describe(assuranceOf(bodies.outcome)).find("stamps of body 'b' are up to 0.5 s later"), std::string::npos);
}

/// A cloth, and a tip that tf carries.
XmlRpcValue clothAndTip() {
  const std::string file = ::testing::TempDir() + "clock_tip.obj";
  std::ofstream(file) << "v 0.2 0.2 0\nv 0.21 0.2 0.05\nv 0.2 0.21 0.05\nf 1 2 3\n";
  return scene("effects: {octomap: 'off'}, bodies: {cloth: {topic: cloth}, tip: {rigid: {frame: tip, mesh: " + file +
               "}}}");
}

struct Carried : Clocks {
  bool is_one_sender = false;
  Carried() : Clocks(clothAndTip()) {}
  void send(const std::string& frame, double now_s, double ahead_s) {
    tf2_msgs::TFMessage message;
    message.transforms = {above(frame, 0.5, ros::Time(START_S) + ros::Duration(now_s + ahead_s))};
    feed_tf.add(message, false, is_one_sender ? "both" : frame, at(now_s));
  }
  /// A tenth of a second: of tf, and from the start on of the cloth.
  void tick(int i, double tip_ahead_s, double other_ahead_s = 0) {
    for (const auto& [frame, ahead_s] : {std::pair("tip", tip_ahead_s), {"elsewhere", other_ahead_s}}) {
      send(frame, 0.1 * i, ahead_s);
    }
    if (i < 0) return;
    takeOf(0, 0.1 * i, 0, 0);
    while (pipeline.nextOutcome(0, outcome)) continue;
  }
};

TEST(ClocksOfTwoComputers, OfAFrameThatCarriesABody) {
  for (const double ahead_s : {0.0, 0.1, 2.0}) {
    for (const bool is_carrier : {true, false}) {
      Carried cell;
      for (int i = -30; i <= 10; ++i) cell.tick(i, is_carrier ? ahead_s : 0, is_carrier ? 0 : ahead_s);
      ASSERT_TRUE(cell.outcome.answered) << ahead_s << " " << cell.outcome.reason;
      const Assurance said = assuranceOf(cell.outcome);
      EXPECT_EQ(said.proved, ahead_s < 1 || !is_carrier) << ahead_s << " " << describe(said);
      if (said.proved) continue;
      EXPECT_NE(describe(said).find("stamps of the frame 'tip' are up to 2 s later than they come, those of body "
                                    "'cloth' 0 s earlier: clocks of two computers differ"),
                std::string::npos)
          << describe(said);
    }
  }
}

// As analyze_bag has it, where tf is read ahead of the messages that it places.
TEST(ClocksOfTwoComputers, OfTheClockBodyAlone) {
  for (const auto& [cloth_s, tip_s, alike] : {std::tuple(3.0, 0.0, false), {3.0, 3.0, true}, {3.0, 2.3, true}}) {
    Carried cell;
    for (int i = -30; i <= 80; ++i) cell.send("tip", 0.1 * i, tip_s);
    for (int i = 0; i <= 10; ++i) {
      cell.takeOf(0, 0.1 * i, cloth_s, 0);
      while (cell.pipeline.nextOutcome(0, cell.outcome)) continue;
    }
    ASSERT_TRUE(cell.outcome.answered) << cell.outcome.reason;
    const Assurance said = assuranceOf(cell.outcome);
    EXPECT_EQ(said.proved, alike) << tip_s << " " << describe(said);
    if (alike) continue;
    EXPECT_NE(describe(said).find("stamps of the frame 'tip' are up to 0 s earlier than they come, those of body "
                                  "'cloth' 3 s later"),
              std::string::npos)
        << describe(said);
  }
}

// What a map shows would count as being there when the body was, which came later: the body's own.
TEST(ClocksOfTwoComputers, OfAMap) {
  for (const double ahead_s : {0.0, 0.2, 1.25}) {
    Clocks bodies(scene("octomap_topic: /map, bodies: {a: {topic: a}, b: {topic: b}}"));
    LoadedMap map = decodeMapMessage(mapOf(table(), 0), bodies.config);
    map.stamp_ns = at(ahead_s);
    map.receipt_ns = at(0);
    bodies.pipeline.setMap(map, 0);
    const Assurance said = assuranceOf(bodies.run(0, 0));
    EXPECT_EQ(said.proved, ahead_s < 1) << ahead_s << " " << describe(said);
    if (said.proved) continue;
    EXPECT_NE(describe(said).find("stamps of maps on /map are up to 1.25 s later than they come"), std::string::npos)
        << describe(said);
    bodies.pipeline.reset(StepStatus::RESET, "a test");
    map.stamp_ns = at(0);
    bodies.pipeline.setMap(map, 0);
    EXPECT_TRUE(assuranceOf(bodies.run(0, 0)).proved) << "the clock was set";
  }
}

// A recording begins anew, or a simulation: what was sent for times of the one before places nothing of this one.
TEST(ATimeThatBeginsAnew, IsNotPlacedByTheTransformsOfTheOneBefore) {
  for (const bool tf_comes : {true, false}) {
    Carried cell;
    for (int i = -1; i <= 40; ++i) cell.tick(i, 0);
    ASSERT_TRUE(assuranceOf(cell.outcome).proved) << describe(assuranceOf(cell.outcome));
    for (int i = 5; i <= 8; ++i) {
      if (tf_comes) {
        cell.tick(i, 0);
      } else {
        cell.takeOf(0, 0.1 * i, 0, 0);
        while (cell.pipeline.nextOutcome(2000000000, cell.outcome)) continue;
      }
    }
    const Assurance said = assuranceOf(cell.outcome);
    EXPECT_EQ(said.proved, tf_comes) << describe(said);
    if (!tf_comes) EXPECT_EQ(cell.outcome.status, StepStatus::NO_TRANSFORM) << describe(said);
  }
}

// The arm's driver was started anew: where it was meanwhile nobody knows, though tf goes on from one place to the
// other.
TEST(AHoleInTf, IsNoWay) {
  for (const double hole_s : {1.9, 2.1}) {
    Carried cell;
    for (int i = -20; i <= 0; ++i) cell.send("tip", 0.1 * i, 0);
    for (int i = 0; i <= 40; ++i) cell.send("tip", hole_s + 0.1 * i, 0);
    for (int i = 0; i <= 10; ++i) {
      cell.takeOf(0, 0.5 + 0.1 * i, 0, 0);
      while (cell.pipeline.nextOutcome(0, cell.outcome)) continue;
    }
    EXPECT_EQ(assuranceOf(cell.outcome).proved, hole_s < 2) << describe(assuranceOf(cell.outcome));
    for (int i = 11; i <= 25; ++i) {
      cell.takeOf(0, 0.5 + 0.1 * i, 0, 0);
      while (cell.pipeline.nextOutcome(0, cell.outcome)) continue;
    }
    EXPECT_TRUE(assuranceOf(cell.outcome).proved) << "behind it " << describe(assuranceOf(cell.outcome));
  }
}

// Only the body's: what it was ahead by says nothing from then on of the others.
TEST(ClocksOfTwoComputers, UntilTheClockOfTheClockBodyIsSet) {
  Carried cell;
  for (int i = -30; i <= 60; ++i) cell.send("tip", 0.1 * i, 2);
  for (int i = 0; i <= 24; ++i) {
    cell.takeOf(0, 0.1 * i, i < 20 ? 2 : 0, 0);
    while (cell.pipeline.nextOutcome(0, cell.outcome)) continue;
    if (i > 0 && i < 20) EXPECT_TRUE(assuranceOf(cell.outcome).proved) << i << describe(assuranceOf(cell.outcome));
    if (i > 20) EXPECT_FALSE(assuranceOf(cell.outcome).proved) << i;
  }
}

// The clock that was ahead is set: its stamps go back, and what it sent is forgotten.
TEST(ClocksOfTwoComputers, UntilTheClockIsSet) {
  for (const bool is_one_sender : {true, false}) {
    Carried cell;
    cell.is_one_sender = is_one_sender;
    for (int i = -30; i <= 20; ++i) {
      cell.tick(i, i <= 10 ? 2 : 0);
      if (i == 10) EXPECT_FALSE(assuranceOf(cell.outcome).proved);
      if (i < 15) continue;
      EXPECT_TRUE(assuranceOf(cell.outcome).proved) << i << " " << describe(assuranceOf(cell.outcome));
    }
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
