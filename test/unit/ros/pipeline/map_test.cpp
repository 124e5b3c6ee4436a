// The map in use: one that is named is missed until it comes, one that is refused or of another time is none.
#include <gtest/gtest.h>

#include <thread>

#include "dccd/assurance.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

TEST(Map, OneThatIsNamedIsMissedFromTheFirstStepOn) {
  Driven named(scene("octomap_topic: /table"));
  named.feed(1, 0.35f);
  EXPECT_EQ(named.feed(1.1, 0.34f).status, StepStatus::NO_MAP);
  EXPECT_FALSE(assuranceOf(named.outcome).proved);
  named.giveMap(1);
  EXPECT_EQ(named.feed(1.2, 0.33f).status, StepStatus::OK) << named.outcome.reason;
  Driven unnamed(scene());
  unnamed.feed(1, 0.35f);
  EXPECT_TRUE(assuranceOf(unnamed.feed(1.1, 0.34f)).clear()) << "nobody called for one";
}

TEST(Map, ARefusedMessageMakesTheMapInUseVoid) {
  Driven driven(scene("max_map_mb: 1"));
  MapLoader loader(driven.config, driven.feed_tf, [] {});
  const auto take = [&] {
    LoadedMap loaded;
    while (!loader.take(loaded)) std::this_thread::yield();
    driven.pipeline.setMap(std::move(loaded), 0);
  };
  double stamp_s = 1;
  driven.feed(stamp_s, 0.35f);
  const std::pair<std::string, std::size_t> refusals[] = {{"std_msgs/Bool", 1},
                                                          {"octomap_msgs/Octomap", std::size_t{2} << 20}};
  for (const auto& [datatype, size] : refusals) {
    loader.submit({0, "octomap_msgs/Octomap", map(1), 0}, 0);
    take();
    EXPECT_EQ(driven.feed(stamp_s += 0.1, 0.35f).status, StepStatus::OK) << driven.outcome.reason;
    const std::string problem = mapMessageProblem(datatype, "*", size, driven.config);
    ASSERT_FALSE(problem.empty()) << datatype;
    loader.refuse(0, problem, 0, 0);
    take();
    EXPECT_EQ(driven.feed(stamp_s += 0.1, 0.35f).status, StepStatus::NO_MAP) << datatype << ", " << size << " bytes";
    EXPECT_NE(driven.outcome.reason.find(problem), std::string::npos) << driven.outcome.reason;
  }
  EXPECT_EQ(loader.received(), 4u);
  EXPECT_EQ(loader.refused(), 2u);
  EXPECT_EQ(mapMessageProblem("octomap_msgs/Octomap", "*", std::size_t{1} << 17, driven.config), "");
}

}  // namespace
}  // namespace test
}  // namespace dccd
