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

// A camera's map holds the cloth itself, which looks like a run with contacts, all of it proved.
TEST(Map, OneThatIsOccupiedAlongABodyFromTheFirstStepOnIsDoubted) {
  const std::vector<std::string> doubt{
      "the map was occupied where 'mesh' was: does it hold 'mesh' itself? Then set own_voxels_m: auto"};
  struct Case {
    std::string parameters;
    float first_z, next_z, tilt;
    std::vector<std::string> doubts;
  };
  for (const Case& one : {
           Case{"", -0.05f, -0.05f, 0, doubt},
           {"", -0.05f, 0.15f, 0, doubt},                  // and what follows from it may last
           {"", -0.15f, -0.15f, 0.1f, doubt},              // half of it
           {"", 0, 0, 0, doubt},                           // beside it by less than noise
           {"", -0.05f, -0.05f, 0.12f, {}},                // one vertex of four
           {"", 0.15f, -0.05f, 0, {}},                     // it went there
           {"own_voxels_m: auto", -0.05f, -0.05f, 0, {}},  // which has doubts of its own
           {"against_obstacle: false", -0.05f, -0.05f, 0, {}},
           {"expected_contacts: [{between: [mesh, octomap]}]", -0.05f, -0.05f, 0, {}},
           {"octomap_file: box.bt", -0.05f, -0.05f, 0, {}},
       }) {
    Driven driven(scene(one.parameters));
    driven.giveMap(1);
    driven.feed(1, one.first_z, {}, "world", one.tilt);
    driven.feed(1.1, one.first_z, {}, "world", one.tilt);
    driven.feed(1.2, one.next_z, {}, "world", one.tilt);
    EXPECT_EQ(driven.pipeline.doubts(), one.doubts) << one.parameters << ' ' << one.first_z << ' ' << one.tilt;
    EXPECT_EQ(driven.pipeline.statement().doubts, one.doubts);
    driven.pipeline.reset(StepStatus::RESET);
    EXPECT_TRUE(driven.pipeline.doubts().empty());
  }
}

// The camera first looked before the cloth came.
TEST(Map, OneThatComesToHoldABodyIsDoubtedToo) {
  for (const bool comes_by_map : {true, false}) {
    Driven driven(scene());
    octomap::OcTree empty(0.1);
    empty.updateNode(0.05, 0.05, 0.05, false);
    driven.giveMap(empty, 1);
    driven.feed(1, -0.05f);
    EXPECT_TRUE(assuranceOf(driven.feed(1.1, -0.05f)).clear());
    EXPECT_TRUE(driven.pipeline.doubts().empty());
    if (comes_by_map) driven.giveMap(1.15);
    driven.feed(1.2, -0.05f);
    EXPECT_EQ(driven.pipeline.doubts().size(), comes_by_map ? 1u : 0u);
  }
}

// Which of the two shows how things are now?
TEST(Map, OneThatComesAfterALaterOneIsInDoubt) {
  Driven driven(scene("octomap_topic: /table"));
  driven.feed(1, 0.35f);
  std::int64_t arrival_ns = 0;
  const auto saidWith = [&](double map_stamp_s, double stamp_s) {
    LoadedMap map = decodeMapMessage(mapOf(table(), map_stamp_s), driven.config);
    map.arrival_ns = ++arrival_ns;
    driven.pipeline.setMap(std::move(map), 0);
    return assuranceOf(driven.feed(stamp_s, 0.35f));
  };
  EXPECT_TRUE(saidWith(10, 1.1).proved);
  const Assurance late = saidWith(9.5, 1.2);
  EXPECT_NE(describe(late).find("the octomap in use is stamped before one that came before it"), std::string::npos)
      << describe(late);
  EXPECT_FALSE(saidWith(9.9, 1.3).proved);
  LoadedMap later = decodeMapMessage(mapOf(table(), 10.2), driven.config);
  later.arrival_ns = ++arrival_ns;
  driven.pipeline.setMap(std::move(later), 0);
  EXPECT_FALSE(saidWith(10.1, 1.35).proved) << "also of two that come between two frames";
  EXPECT_TRUE(saidWith(10.2, 1.4).proved);
  EXPECT_TRUE(saidWith(2, 1.5).proved) << "a time that begins anew";
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
