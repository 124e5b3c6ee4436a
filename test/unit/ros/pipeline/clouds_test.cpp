// A map that is made of a sensor's clouds: what a step meets, and what is said of clouds that cannot become part of it.
#include <gtest/gtest.h>

#include <thread>

#include "unit/ros/pipeline/cloud_scene.h"

namespace dccd {
namespace test {
namespace {

class Clouds : public ::testing::Test {
 protected:
  Seen driven;

  void tf(double stamp_s) { driven.tell({cameraPose(stamp_s)}); }
  LoadedMap add(const sensor_msgs::PointCloud2& cloud, double seconds_later = 0) {
    return driven.add(cloud, 0, seconds_later);
  }
  void give(LoadedMap map) { driven.give(std::move(map)); }
};

TEST_F(Clouds, ATableIsMetWhereTheCameraSawIt) {
  driven.feed(1, 0.35f);
  EXPECT_EQ(driven.feed(1.1, 0.34f).status, StepStatus::NO_MAP) << "clouds are called for";
  EXPECT_FALSE(assuranceOf(driven.outcome).proved);
  tf(1.1);
  give(add(tableFrom(1.1)));
  EXPECT_EQ(driven.feed(1.2, 0.30f).status, StepStatus::OK) << driven.outcome.reason;
  EXPECT_TRUE(assuranceOf(driven.outcome).clear());
  EXPECT_EQ(driven.outcome.step->map.stamp_ns, 1'100'000'000) << "the cloud's";
  EXPECT_EQ(driven.outcome.step->map.frame_id, "world");
  // From 0.3 down to -0.1: the voxels' top at 0.1 is met half way.
  driven.feed(1.3, -0.1f);
  ASSERT_FALSE(driven.outcome.contacts.empty());
  EXPECT_NEAR(driven.outcome.contacts.front().toc_lower, 0.5, 1e-6);
}

TEST_F(Clouds, EachOneBecomesPartOfTheSameMap) {
  tf(1);
  tf(2);
  EXPECT_EQ(add(cloudOf(1, {{0.05f, -0.05f, 1}})).surface->leafCount(), 1u);
  EXPECT_EQ(add(cloudOf(1.5, {{0.25f, -0.05f, 1}})).surface->leafCount(), 2u);
  // What the first one saw is seen through three times: 0.85 - 3 * 0.41 < 0.
  for (const double stamp_s : {1.6, 1.7}) {
    EXPECT_EQ(add(cloudOf(stamp_s, {{0.07f, -0.07f, 1.4f}})).surface->leafCount(), 3u);
  }
  EXPECT_EQ(add(cloudOf(1.8, {{0.07f, -0.07f, 1.4f}})).surface->leafCount(), 2u);
}

TEST_F(Clouds, WhatCannotBecomePartOfTheMapIsSaid) {
  tf(1);
  sensor_msgs::PointCloud2 flat = tableFrom(1), integers = tableFrom(1), cut = tableFrom(1),
                           nameless = tableFrom(1, "");
  flat.fields.pop_back();
  integers.fields[0].datatype = sensor_msgs::PointField::INT32;
  cut.data.resize(100);
  geometry_msgs::TransformStamped far = cameraPose(1);
  far.child_frame_id = "far";
  far.transform.translation.x = 4000;  // of the 3276.8 m that 0.1 m can span
  driven.tell({far}, true);
  const std::pair<sensor_msgs::PointCloud2, std::string> cases[] = {
      {flat, "the cloud was refused: there is no field 'z'; there are: x, y"},
      {integers, "the cloud was refused: field 'x' has datatype 5; FLOAT32 (7) or FLOAT64 (8) is needed"},
      {cut, "the cloud was refused: 1 x 1601 points of 12 bytes do not fit into data of 100"},
      {nameless, "the cloud was refused: frame_id is empty; it is to name the sensor's frame"},
      {cloudOf(1, {}), "the cloud was refused: it has no points"},
      {cloudOf(1, {{LOST, 0, 1}, {0, 0, LOST}}), "the cloud was refused: none of its 2 points is finite"},
      {tableFrom(1, "nowhere"), "no transform from 'nowhere' to 'world': "},
      {tableFrom(9), "no transform from 'camera' to 'world': "},
      {tableFrom(1, "//a"), "the cloud was refused: frame_id '/a' is no frame's name"},
      {cloudOf(1, {{0, 0, 1}}, "far"),
       "the cloud was refused: the sensor is at (4000 0 1.05) m, beyond the 65536 voxels"},
  };
  double stamp_s = 1;
  driven.feed(stamp_s, 0.35f);
  for (const auto& [cloud, expected] : cases) {
    SCOPED_TRACE(expected);
    give(add(tableFrom(1), 20));  // so that a sensor of another name is forgotten
    EXPECT_EQ(driven.feed(stamp_s += 0.1, 0.35f).status, StepStatus::OK) << driven.outcome.reason;
    give(add(cloud));
    EXPECT_EQ(driven.feed(stamp_s += 0.1, 0.35f).status, StepStatus::NO_MAP) << "the map is void";
    EXPECT_NE(driven.outcome.reason.find(expected), std::string::npos) << driven.outcome.reason;
  }
  give(add(tableFrom(1), 20));
  EXPECT_EQ(driven.feed(stamp_s + 0.1, 0.35f).status, StepStatus::OK) << "and what was seen is not lost";
}

// Maps and static bodies in these frames were in doubt; clouds were not, and steps were proved clear with them.
TEST_F(Clouds, OneWhoseCameraMayHaveBeenElsewhereIsRefused) {
  const auto refusal = [](Seen& scene, double stamp_s) {
    const LoadedMap map = scene.add(tableFrom(stamp_s));
    EXPECT_FALSE(map.surface);
    EXPECT_NE(map.problem.find("where frame 'camera' was at its stamp is not known"), std::string::npos) << map.problem;
    return map.problem;
  };
  geometry_msgs::TransformStamped higher = cameraPose(1.2);
  higher.transform.translation.z = 2.05;
  {
    Seen silent;
    silent.tell({cameraPose(1), cameraPose(4.1)});
    EXPECT_NE(refusal(silent, 2).find("none came for more than 2 s"), std::string::npos);
    EXPECT_TRUE(silent.add(tableFrom(1)).surface == nullptr) << "next to the hole";
  }
  {
    Seen twice;
    higher.header.stamp = ros::Time(1);
    twice.tell({cameraPose(1), higher});
    EXPECT_NE(refusal(twice, 1).find("came that is not used"), std::string::npos);
  }
  {
    Seen carried;
    carried.tell({above("wrist", 0, ros::Time(1)), above("wrist", 0, ros::Time(1.3))});
    higher.header.stamp = ros::Time(1.2);
    higher.header.frame_id = "wrist";
    carried.tell({cameraPose(1), higher});
    EXPECT_NE(refusal(carried, 1.1).find("changed its parent"), std::string::npos);
    higher.header.frame_id = "world";
  }
  {
    Seen contested;
    int count = 0;
    for (const auto& pose : {cameraPose(1), higher, cameraPose(1.4)}) {
      tf2_msgs::TFMessage message;
      message.transforms.push_back(pose);
      contested.feed_tf.add(message, false, count++ % 2 == 0 ? "/one" : "/other");
    }
    EXPECT_NE(refusal(contested, 1.1).find("came from two publishers"), std::string::npos);
    EXPECT_NE(refusal(contested, 1.4).find("came from two publishers"), std::string::npos);
  }
}

// The camera's mount was corrected on /tf_static: what was seen before stayed in the map, a metre from where it is.
TEST_F(Clouds, ThoseOfACameraThatIsSentElsewhereOnTfStaticProveNothingMore) {
  driven.showCamera();
  driven.feed(1, 0.35f);
  give(add(tableFrom(1.1)));
  driven.feed(1.2, 0.35f);
  EXPECT_TRUE(assuranceOf(driven.outcome).clear()) << driven.outcome.reason;
  driven.showCamera();
  driven.showCamera("another");
  driven.feed(1.3, 0.35f);
  EXPECT_TRUE(assuranceOf(driven.outcome).clear()) << "it was sent again where it was";
  tf2_msgs::TFMessage message;
  message.transforms.push_back(cameraPose(1));
  message.transforms[0].transform.translation.z = 2.05;
  driven.feed_tf.add(message, true);
  for (const double stamp_s : {1.4, 1.5}) {
    driven.feed(stamp_s, 0.35f);
    ASSERT_TRUE(driven.outcome.answered);
    const std::vector<std::string> missing = driven.outcome.missing();
    ASSERT_EQ(missing.size(), 1u);
    EXPECT_EQ(missing[0].find("the frame 'camera' was sent elsewhere on /tf_static after"), 0u) << missing[0];
    give(add(tableFrom(stamp_s)));  // what the first one showed stays
  }
}

// A localisation corrected odom: what the first cloud showed moved along, and after the next cloud steps were clear.
TEST_F(Clouds, ThoseOfANamedFrameThatMovesProveNothingMore) {
  Seen scene(cloudScene("octomap_frame: odom"));
  scene.showCamera();
  const auto feedAt = [&](double stamp_s, double odom_z, bool with_cloud) {
    scene.tell({above("odom", odom_z, ros::Time(stamp_s))});
    if (with_cloud) scene.give(scene.add(tableFrom(stamp_s)));
    scene.feed(stamp_s, 0.35f);
  };
  feedAt(1, 0, true);
  feedAt(1.1, 0.0005, false);
  EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << "within rigid_tolerance_m: " << scene.outcome.reason;
  feedAt(1.2, 0.5, true);
  EXPECT_FALSE(assuranceOf(scene.outcome).proved);
  const auto isDenied = [&] {
    const std::vector<std::string> missing = scene.outcome.missing();
    ASSERT_EQ(missing.size(), 1u);
    EXPECT_EQ(missing[0],
              "octomap_frame 'odom' moved by up to 0.5 m in 'world' since the first cloud; set it to a frame at rest, "
              "and restart the monitor");
  };
  feedAt(1.3, 0.5, false);
  isDenied();
  feedAt(1.4, 0.5, true);
  isDenied();
  scene.pipeline.reset(StepStatus::RESET);
  feedAt(1.5, 0.5, true);
  feedAt(1.6, 0.5, false);
  isDenied();
}

// What such a cloud alone had shown was in no later one, and steps were clear without a word.
TEST_F(Clouds, OneThatWasRefusedIsNamedUntilAReset) {
  const auto named = [&]() -> std::string {
    for (const std::string& sentence : driven.outcome.excluded) {
      if (sentence.find("not in the map") != std::string::npos) return sentence;
    }
    return {};
  };
  driven.showCamera();
  give(add(tableFrom(1)));
  driven.feed(1, 0.35f);
  driven.feed(1.1, 0.35f);
  EXPECT_EQ(named(), "");
  sensor_msgs::PointCloud2 flat = tableFrom(1.1);
  flat.fields.pop_back();
  give(add(flat));
  EXPECT_EQ(driven.feed(1.2, 0.35f).status, StepStatus::NO_MAP);
  give(add(tableFrom(1.2)));
  driven.feed(1.3, 0.35f);
  EXPECT_EQ(named().find("1 cloud on /camera/points that came is not in the map (the newest: there is no field 'z'"),
            0u)
      << named();
  for (int i = 0; i < 11; ++i) driven.clouds.miss(0, "a fault");
  give(add(tableFrom(1.3)));
  driven.feed(1.4, 0.35f);
  EXPECT_EQ(named(), "at least 10 clouds on /camera/points that came are not in the map (the newest: a fault)");
  driven.pipeline.reset(StepStatus::RESET);
  give(add(tableFrom(1.5)));
  driven.feed(1.5, 0.35f);
  driven.feed(1.6, 0.35f);
  EXPECT_TRUE(driven.outcome.answered);
  EXPECT_EQ(named(), "");
}

TEST_F(Clouds, UnknownSpaceIsWhatNoRayWentThrough) {
  Seen occupied(cloudScene("unknown_space: occupied, unknown_box: [0, 0, 0, 1, 1, 1]"));
  occupied.showCamera();
  const LoadedMap map = occupied.add(tableFrom(1));
  ASSERT_TRUE(map.known) << map.problem;
  EXPECT_TRUE(map.known->isKnown(Box{{0.05, 0.05, 0.05}, {0.2, 0.2, 0.3}}));
  EXPECT_FALSE(map.known->isKnown(Box{{0.05, 0.05, -0.15}, {0.4, 0.4, -0.1}})) << "under the table";
}

TEST_F(Clouds, AnOctreeThatIsTooLargeIsRefusedWithWhatToDo) {
  XmlRpcValue tree = cloudScene();
  tree["obstacle_resolution_m"] = 0.001;
  tree["max_map_mb"] = 1;
  Seen small(tree);
  small.showCamera();
  const LoadedMap map = small.add(tableFrom(1));
  EXPECT_EQ(map.surface, nullptr);
  EXPECT_NE(map.problem.find("a quarter of max_map_mb 1 is for it: raise that or obstacle_resolution_m"),
            std::string::npos)
      << map.problem;
}

// What is in the octree, but was in no map that was looked at: the next one shows it beside the cloth that came near.
TEST_F(Clouds, OneWhoseMapIsRefusedForMemoryLeavesInDoubtWhatTheNextOneShows) {
  for (const bool refused : {false, true}) {
    XmlRpcValue tree = cloudScene();
    tree["own_voxels_m"] = "auto";
    tree["max_map_mb"] = 160;
    Seen owner(tree);
    owner.showCamera();
    const auto see = [&](const sensor_msgs::PointCloud2& cloud) {
      LoadedMap map = owner.add(cloud);
      const bool is_map = map.surface != nullptr;
      owner.pipeline.setMap(std::move(map), 0);
      return is_map;
    };
    owner.feed(1, 0.9f);
    EXPECT_TRUE(see(tableFrom(1)));
    EXPECT_TRUE(assuranceOf(owner.feed(1.1, 0.9f)).clear()) << describe(assuranceOf(owner.outcome));
    // An obstacle at the height 0.35, while the cloth is far above it.
    const sensor_msgs::PointCloud2 obstacle = cloudOf(1.1, {{0.15f, -0.15f, 0.7f}, {0.25f, -0.25f, 0.7f}});
    std::vector<std::shared_ptr<const KnownSpace>> held;
    std::vector<OccupiedLeaf> many;
    for (std::uint16_t i = 0; i < 40000; ++i) {
      many.push_back({{static_cast<std::uint16_t>(8 * (i % 200)), static_cast<std::uint16_t>(8 * (i / 200)), 7}, 1});
    }
    const std::shared_ptr<const KnownSpace> old = KnownSpace::build(0.1, many);
    for (std::size_t bytes = 0; refused && bytes < std::size_t{60} << 20; bytes += old->memoryBytes()) {
      held.push_back(owner.memory.counted(old));
    }
    EXPECT_EQ(see(obstacle), !refused);
    owner.feed(1.2, 0.9f);
    EXPECT_EQ(owner.outcome.status, refused ? StepStatus::NO_MAP : StepStatus::OK);
    held.clear();
    owner.feed(1.5, 0.9f);
    owner.feed(1.8, 0.45f);
    EXPECT_TRUE(see(cloudOf(1.8, {{0.15f, -0.15f, 0.7f}, {0.25f, -0.25f, 0.7f}})));
    const Outcome& near = owner.feed(1.9, 0.35f);
    EXPECT_FALSE(assuranceOf(near).clear()) << refused << ": " << describe(assuranceOf(near));
    EXPECT_EQ(near.step->map.own.own, 0u);
    EXPECT_EQ(near.step->map.own.doubted > 0, refused);
  }
}

LoadedMap next(MapLoader& loader) {
  LoadedMap loaded;
  while (!loader.take(loaded)) std::this_thread::yield();
  return loaded;
}

TEST_F(Clouds, TheLoaderWaitsForTheFrameAndForTf) {
  XmlRpcValue tree = cloudScene();
  tree.clear();
  tree["obstacle_cloud_topic"] = "/camera/points";
  tree["transform_timeout_s"] = 60.0;
  Driven learning(tree);
  MapLoader loader(learning.config, learning.feed_tf, [] {});
  loader.submit(messageOf(tableFrom(1)), steadyNs());
  EXPECT_FALSE(loader.busySince()) << "no frame is to wait for a cloud that waits for the frame's frame";
  loader.setFixedFrame("world");
  EXPECT_TRUE(loader.busySince());
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  LoadedMap loaded;
  EXPECT_FALSE(loader.take(loaded)) << "without tf";
  tf2_msgs::TFMessage message;
  message.transforms.push_back(cameraPose(1));
  learning.feed_tf.add(message, false);
  loaded = next(loader);
  ASSERT_TRUE(loaded.surface) << loaded.problem;
  EXPECT_EQ(loaded.frame_id, "world");
  EXPECT_EQ(loader.refused(), 0u);
}

TEST_F(Clouds, TheLoaderCountsThoseThatGiveWayOnceThereIsAMap) {
  XmlRpcValue tree = cloudScene("transform_timeout_s: 60.0");
  Driven waiting(tree);
  MapLoader loader(waiting.config, waiting.feed_tf, [] {});
  // The first one waits for tf, in the thread or before it; of the others the last one is left.
  for (const double stamp_s : {1.0, 1.1, 1.2, 1.3}) loader.submit(messageOf(tableFrom(stamp_s)), steadyNs());
  tf2_msgs::TFMessage message;
  message.transforms.push_back(cameraPose(1));
  waiting.feed_tf.add(message, true);
  LoadedMap loaded = next(loader);
  while (loaded.stamp_ns != 1'300'000'000) loaded = next(loader);
  ASSERT_EQ(loaded.missed.size(), 1u);
  EXPECT_GE(loaded.missed[0].count, 2u);
  EXPECT_EQ(loaded.missed[0].count, loader.dropped());
  EXPECT_EQ(loaded.missed[0].newest, "too many came, and it gave way to a newer one");
}

TEST_F(Clouds, TheLoaderRefusesWhatTfDoesNotPlaceInTime) {
  MapLoader loader(driven.config, driven.feed_tf, [] {});
  const std::int64_t start_ns = steadyNs();
  loader.submit(messageOf(tableFrom(1)), start_ns);
  const LoadedMap loaded = next(loader);
  EXPECT_NE(loaded.problem.find("no transform from 'camera' to 'world'"), std::string::npos) << loaded.problem;
  EXPECT_GE(secondsBetween(start_ns, steadyNs()), driven.config.transform_timeout_s);
  EXPECT_EQ(loader.refused(), 1u);
  EXPECT_EQ(mapMessageProblem("octomap_msgs/Octomap", "*", 1, driven.config),
            "type octomap_msgs/Octomap is not a cloud; publish sensor_msgs/PointCloud2");
}

}  // namespace
}  // namespace test
}  // namespace dccd
