// Messages of one topic from two publishers in turn: nobody knows which of them shows the body.
#include <gtest/gtest.h>

#include "dccd/assurance.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

struct TwoPublishers : ::testing::Test {
  Driven cloth{scene("effects: {octomap: 'off'}")};
  double now_s = 1;

  /// Frames from each of these, one after the other; what is said of the last one.
  Assurance saidAfter(const std::vector<std::string>& senders) {
    for (const std::string& sender : senders) {
      MeshMessage message{"sensor_msgs/PointCloud2", cloud(now_s += 0.1, 0.3f), 0, 0};
      message.sender = sender;
      cloth.pipeline.take(0, message);
      while (cloth.pipeline.nextOutcome(0, cloth.outcome)) continue;
    }
    return assuranceOf(cloth.outcome);
  }
};

TEST_F(TwoPublishers, OneAfterTheOtherIsATrackerThatWasStartedAnew) {
  EXPECT_TRUE(saidAfter({"/a", "/a", "/b", "/b", "/c", "/c"}).proved);
  EXPECT_TRUE(saidAfter({"", "/c", "", "/c"}).proved) << "whoever is not known is none";
}

TEST_F(TwoPublishers, InTurnTheyProveNothingUntilAReset) {
  const Assurance said = saidAfter({"/a", "/a", "/b", "/a"});
  EXPECT_FALSE(said.proved);
  EXPECT_NE(describe(said).find("frames of body 'mesh' came in turn from two publishers, /b and /a"), std::string::npos)
      << describe(said);
  EXPECT_FALSE(saidAfter({"/a", "/a"}).proved);
  cloth.pipeline.reset(StepStatus::RESET, "a test");
  EXPECT_TRUE(saidAfter({"/a", "/a"}).proved);
}

TEST_F(TwoPublishers, NorDoThree) { EXPECT_FALSE(saidAfter({"/a", "/b", "/c", "/a"}).proved); }

TEST(TwoMapServers, InTurnTheyProveNothingUntilAReset) {
  Driven cell(scene());
  double now_s = 1;
  const auto saidAfter = [&](const std::vector<std::array<std::string, 2>>& frames_and_senders) {
    for (const auto& [frame, sender] : frames_and_senders) {
      cell.pipeline.hearMap("/map", frame, sender);
      cell.giveMap(now_s += 0.1);
      for (int i = 0; i < 2; ++i) cell.feed(now_s += 0.1, 0.3f);
    }
    return assuranceOf(cell.outcome);
  };
  EXPECT_TRUE(saidAfter({{"", "/a"}, {"", "/a"}, {"", "/b"}}).proved) << "started anew";
  EXPECT_TRUE(saidAfter({{"left", "/a"}, {"right", "/b"}, {"left", "/a"}}).proved) << "two sensors";
  EXPECT_FALSE(saidAfter({{"", "/a"}}).proved);
  EXPECT_NE(describe(assuranceOf(cell.outcome)).find("maps on /map came in turn from two publishers, /b and /a"),
            std::string::npos)
      << describe(assuranceOf(cell.outcome));
  cell.pipeline.reset(StepStatus::RESET, "a test");
  EXPECT_TRUE(saidAfter({{"", "/a"}}).proved);
}

}  // namespace
}  // namespace test
}  // namespace dccd
