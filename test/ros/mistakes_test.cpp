// What people get wrong when they plug their tracker in, and that they are told what to do about it: in the log and in
// /diagnostics, and in ~state/reason where nothing is proved. doc/troubleshooting.md lists the same messages.
#include <deformable_ccd/State.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>

#include <algorithm>

#include <octomap_msgs/Octomap.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Log.h>
#include <std_msgs/Bool.h>

#include "octomap/map_builder.h"
#include "ros/support/live_tests.h"
#include "ros/support/meshes.h"
#include "ros/support/probe.h"

namespace dccd {
namespace test {
namespace {

class Mistake : public ::testing::Test {
 protected:
  ros::NodeHandle node;
  Probe<rosgraph_msgs::Log> log{node, "/rosout"};
  Probe<diagnostic_msgs::DiagnosticArray> diagnostics{node, "/diagnostics"};

  /// Publishes again and again, as a tracker does, until the monitor has said `what` and `advice` in one line of the
  /// log, in its diagnostics and, unless its steps are proved, in its state.
  void expectTold(const std::string& name, const std::string& what, const std::string& advice,
                  const std::function<void()>& publish) {
    std::string logged, diagnosed;
    const Probe<deformable_ccd::State> states(node, name + "/state");
    const auto stated = [&] {
      const auto all = states.all();
      return std::any_of(all.begin(), all.end(),
                         [&](const auto& state) { return state.proved || holds(state.reason, what, advice); });
    };
    const bool told = waitUntil(
        [&] {
          publish();
          ros::WallDuration(0.03).sleep();
          logged = logLine(name, what, advice);
          if (diagnosed.empty()) diagnosed = diagnosis(name, what, advice);
          return !logged.empty() && !diagnosed.empty() && stated();
        },
        15);
    EXPECT_TRUE(told) << "log: '" << logged << "', diagnostics: '" << diagnosed << "', newest diagnosis: '"
                      << diagnosis(name, "", "") << "', newest state: '"
                      << (states.all().empty() ? "" : states.all().back().reason) << "'";
  }

 private:
  static bool holds(const std::string& text, const std::string& what, const std::string& advice) {
    return text.find(what) != std::string::npos && text.find(advice) != std::string::npos;
  }
  std::string logLine(const std::string& name, const std::string& what, const std::string& advice) const {
    for (const auto& line : log.all()) {
      if (line.name == name && line.level >= rosgraph_msgs::Log::WARN && holds(line.msg, what, advice)) return line.msg;
    }
    return {};
  }
  std::string diagnosis(const std::string& name, const std::string& what, const std::string& advice) const {
    const auto all = diagnostics.all();
    for (auto array = all.rbegin(); array != all.rend(); ++array) {
      for (const auto& status : array->status) {
        const bool alarmed = status.level > diagnostic_msgs::DiagnosticStatus::OK;
        if (status.name == name + ": steps" && alarmed && holds(status.message, what, advice)) return status.message;
      }
    }
    return {};
  }
};

/// Frames of a mesh, ten a second by their stamps.
struct Tracker {
  double stamp_s = 100;
  double next() { return stamp_s += 0.1; }
};

octomap_msgs::Octomap mapIn(const std::string& frame) {
  octomap_msgs::Octomap map;
  map.header = header(1, frame);
  map.binary = true;
  map.id = "OcTree";
  map.resolution = 0.1;
  map.data = buildOctomap(
      0.1, Box{{0, 0, 0}, {0.2, 0.2, 0.2}}, [](const Vec3&) { return true; }, true);
  return map;
}

TEST_F(Mistake, NoTransform) {
  Tracker tracker;
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/no_transform/mesh");
  expectTold("/no_transform", "no transform from 'camera' to 'world'", "publish it on /tf or /tf_static",
             [&] { publisher.publish(meshStamped(tipAbove(1), tracker.next(), "camera")); });
}

TEST_F(Mistake, WrongTopicType) {
  const auto publisher = advertiseAndWait<std_msgs::Bool>(node, "/wrong_type/mesh");
  expectTold("/wrong_type", "type std_msgs/Bool is not a mesh",
             "publish deformable_ccd/MeshStamped, geometry_msgs/PoseArray",
             [&] { publisher.publish(std_msgs::Bool()); });
}

TEST_F(Mistake, RowsAndColumnsSwapped) {
  Tracker tracker;
  const auto publisher = advertiseAndWait<sensor_msgs::PointCloud2>(node, "/swapped/mesh");
  expectTold("/swapped", "topology/rows and topology/cols look swapped", "set rows: 3, cols: 4",
             [&] { publisher.publish(cloud(gridAt(3, 4, 0), tracker.next())); });
}

TEST_F(Mistake, NoMap) {
  Tracker tracker;
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/no_map/mesh");
  expectTold("/no_map", "no octomap has been received yet",
             "see rostopic hz /no_map/octomap, or do without with effects/octomap: off",
             [&] { publisher.publish(meshStamped(tipAbove(1), tracker.next())); });
}

TEST_F(Mistake, MapOnAnotherTopic) {
  const auto map = node.advertise<octomap_msgs::Octomap>("/octomap_full", 1, true);
  expectTold("/unheard_map", "an octomap is published on /octomap_full, and this monitor listens to /octomap_binary",
             "give the topic with octomap:=TOPIC, or do without with effects/octomap: off", [] {});
}

TEST_F(Mistake, MapInAnotherFrame) {
  Tracker tracker;
  const auto map = advertiseAndWait<octomap_msgs::Octomap>(node, "/map_frame/octomap", true);
  map.publish(mapIn("odom"));
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/map_frame/mesh");
  expectTold("/map_frame", "no transform from 'world' to the octomap's frame 'odom'", "publish it on /tf or /tf_static",
             [&] { publisher.publish(meshStamped(tipAbove(1), tracker.next())); });
}

TEST_F(Mistake, MeshTopicNeverPublished) {
  const ros::Publisher other = node.advertise<sensor_msgs::PointCloud2>("/tracker/points", 1);
  expectTold("/silent", "nobody publishes /silent/cloth; give the mesh's topic with mesh:=TOPIC",
             "/tracker/points (sensor_msgs/PointCloud2)", [] {});
}

TEST_F(Mistake, NamedMapNeverPublished) {
  Tracker tracker;
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/no_map/mesh");
  expectTold("/no_map", "nobody publishes /no_map/octomap", "",
             [&] { publisher.publish(meshStamped(tipAbove(1), tracker.next())); });
}

TEST_F(Mistake, StampsOfZero) {
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/no_stamp/mesh");
  expectTold("/no_stamp", "messages carry no stamp", "set header.stamp in the publisher",
             [&] { publisher.publish(meshStamped(tipAbove(1), 0)); });
}

TEST_F(Mistake, CloudWithoutTopology) {
  Tracker tracker;
  const auto publisher = advertiseAndWait<sensor_msgs::PointCloud2>(node, "/no_topology/mesh");
  expectTold("/no_topology", "an unorganised point cloud has no topology",
             "set topology/rows and topology/cols for a grid",
             [&] { publisher.publish(cloud(gridAt(3, 4, 0), tracker.next())); });
}

TEST_F(Mistake, WrongRowStep) {
  Tracker tracker;
  const auto publisher = advertiseAndWait<sensor_msgs::PointCloud2>(node, "/row_step/mesh");
  expectTold("/row_step", " contradicts the data, which are just 3 rows of 4 points", "publish row_step ", [&] {
    sensor_msgs::PointCloud2 message = cloud(gridAt(3, 4, 0), tracker.next());
    message.height = 3;
    message.width = 4;
    message.row_step = static_cast<std::uint32_t>(message.data.size());
    publisher.publish(message);
  });
}

TEST_F(Mistake, TopologyThatDoesNotFit) {
  Tracker tracker;
  const auto publisher = advertiseAndWait<sensor_msgs::PointCloud2>(node, "/mismatch/mesh");
  expectTold("/mismatch", "12 points, but topology/rows x topology/cols is 3 x 5 = 15",
             "correct topology/rows and topology/cols",
             [&] { publisher.publish(cloud(gridAt(3, 4, 0), tracker.next())); });
}

TEST_F(Mistake, Millimetres) {
  Tracker tracker;
  Mesh mesh = tipAbove(1);
  for (Vec3& p : mesh.positions) p *= 1000;
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/millimetres/mesh");
  expectTold("/millimetres", "the mesh is 2000 m across", "are these millimetres?",
             [&] { publisher.publish(meshStamped(mesh, tracker.next())); });
}

TEST_F(Mistake, FramesTooFarApart) {
  double stamp_s = 100;
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/too_slow/mesh");
  expectTold("/too_slow", "GAP: 2 s since the last frame, max_step_s is 0.5",
             "a slower publisher needs a larger max_step_s",
             [&] { publisher.publish(meshStamped(tipAbove(1), stamp_s += 2)); });
}

TEST_F(Mistake, AnotherMeshEveryFrame) {
  Tracker tracker;
  bool more = false;
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/remeshed/mesh");
  expectTold("/remeshed",
             "TOPOLOGY_CHANGED: the mesh has 6 vertices and ",  // 1 or 2 faces in turn; one line in some seconds
             "use a tracker, or give topology/file", [&] {
               Mesh mesh = tipAbove(1);
               if ((more = !more)) mesh.faces.pop_back();
               publisher.publish(meshStamped(mesh, tracker.next()));
             });
}

class NoClock : public Mistake {};
TEST_F(NoClock, SimulatedTimeWithoutAClock) {
  expectTold("/no_clock", "/use_sim_time is set, but nobody publishes /clock", "play the bag with --clock", [] {});
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "mistakes_test"); }
