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
  /// A tenth of a second: of tf, and from the start on of the cloth.
  void tick(int i, double tip_ahead_s, double other_ahead_s = 0) {
    for (const auto& [frame, ahead_s] : {std::pair("tip", tip_ahead_s), {"elsewhere", other_ahead_s}}) {
      tf2_msgs::TFMessage message;
      message.transforms = {above(frame, 0.5, ros::Time(START_S) + ros::Duration(0.1 * i + ahead_s))};
      feed_tf.add(message, false, is_one_sender ? "both" : frame, at(0.1 * i));
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

// A map is placed, and its voxels are told from bodies, by its stamp.
TEST(ClocksOfTwoComputers, OfMaps) {
  for (const auto& [ahead_s, alike] : {std::pair(0.0, true), {0.2, true}, {-5.0, true}, {2.0, false}}) {
    Clocks cell(scene("octomap_topic: map, topic: cloth"));
    LoadedMap map = decodeMapMessage(test::map(START_S + ahead_s), cell.config);
    map.receipt_ns = at(0);
    cell.pipeline.setMap(std::move(map), 0);
    for (int i = 0; i <= 10; ++i) {
      cell.takeOf(0, 0.1 * i, 0, 0.1f);
      while (cell.pipeline.nextOutcome(0, cell.outcome)) continue;
    }
    ASSERT_TRUE(cell.outcome.answered) << ahead_s << " " << cell.outcome.reason;
    const Assurance said = assuranceOf(cell.outcome);
    EXPECT_EQ(said.proved, alike) << ahead_s << " " << describe(said);
    if (!alike)
      EXPECT_NE(describe(said).find("stamps of maps on map are up to 2 s later"), std::string::npos) << describe(said);
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
