// What people get wrong when they plug their tracker in, and that they are told what to do about it: in the log and in
// /diagnostics, and in ~state/reason where nothing is proved. doc/troubleshooting.md lists the same messages.
#include <deformable_ccd/State.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

#include <octomap_msgs/Octomap.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Log.h>
#include <std_msgs/Bool.h>

#include "octomap/map_builder.h"
#include "ros/support/live_tests.h"
#include "ros/support/meshes.h"
#include "ros/support/monitor_fixture.h"
#include "ros/support/probe.h"

namespace dccd {
namespace test {
namespace {

/// What somebody does wrong with the monitor of this name, again and again, and the words that tell of it.
struct Mistake {
  std::string name, what, advice;
  std::function<void()> make = [] {};
  bool guessed = false;  ///< not in diagnostics: the answers may be right
  bool doubted = false;  ///< the state tells of it though all is proved
};

class Mistakes : public ::testing::Test {
 protected:
  ros::NodeHandle node;
  Probe<rosgraph_msgs::Log> log{node, "/rosout"};
  Probe<diagnostic_msgs::DiagnosticArray> diagnostics{node, "/diagnostics"};
  double stamp_s = 100;  // of the frames of a round, ten rounds a second

  /// Publishes what `message` makes.
  template <class Message>
  std::function<void()> sends(const std::string& topic, const std::function<Message()>& message) {
    const ros::Publisher publisher = advertiseAndWait<Message>(node, topic);
    return [publisher, message] { publisher.publish(message()); };
  }

  /// Makes them all until each monitor has said `what` and `advice` in one line of the log, in its diagnostics and,
  /// unless its steps are proved, in its state.
  void expectTold(const std::vector<Mistake>& mistakes) {
    std::map<std::string, Probe<deformable_ccd::State>> states;
    for (const Mistake& one : mistakes) states.try_emplace(one.name, node, one.name + "/state");
    std::string untold;
    waitUntil(
        [&] {
          stamp_s += 0.1;
          for (const Mistake& one : mistakes) one.make();
          ros::WallDuration(0.03).sleep();
          const auto lines = log.all();
          const auto diagnoses = diagnostics.all();
          untold.clear();
          for (const Mistake& one : mistakes) {
            const bool logged = isLogged(one, lines), diagnosed = one.guessed || isDiagnosed(one, diagnoses);
            const bool stated = isStated(one, states.at(one.name).all());
            if (logged && diagnosed && stated) continue;
            untold += '\n' + one.name + ": " + one.what + (logged ? "" : ", not in the log") +
                      (diagnosed ? "" : ", not in diagnostics") +
                      (stated ? "" : ", state: " + states.at(one.name).last().reason);
          }
          return untold.empty();
        },
        30);
    EXPECT_EQ(untold, "");
  }

  /// What a monitor waited for has come: one line says so.
  void expectOver(const std::string& name, const std::function<void()>& make) {
    const auto saidAfterAnother = [&] {
      stamp_s += 0.1;
      make();
      ros::WallDuration(0.03).sleep();
      const auto lines = log.all();
      return std::count_if(lines.begin(), lines.end(), [&](const rosgraph_msgs::Log& line) {
        return line.msg == name + ": what it waited for has come";
      });
    };
    EXPECT_TRUE(waitUntil([&] { return saidAfterAnother() > 0; }, 10));
    for (int more = 0; more < 10; ++more) EXPECT_EQ(saidAfterAnother(), 1);
  }

 private:
  static bool tells(const std::string& text, const Mistake& mistake) {
    return text.find(mistake.what) != std::string::npos && text.find(mistake.advice) != std::string::npos;
  }
  static bool isLogged(const Mistake& mistake, const std::vector<rosgraph_msgs::Log>& lines) {
    return std::any_of(lines.begin(), lines.end(), [&](const rosgraph_msgs::Log& line) {
      return line.name == mistake.name && line.level >= rosgraph_msgs::Log::WARN && tells(line.msg, mistake);
    });
  }
  static bool isDiagnosed(const Mistake& mistake, const std::vector<diagnostic_msgs::DiagnosticArray>& diagnoses) {
    return std::any_of(diagnoses.begin(), diagnoses.end(), [&](const diagnostic_msgs::DiagnosticArray& array) {
      return std::any_of(array.status.begin(), array.status.end(), [&](const auto& status) {
        const bool alarmed = status.level > diagnostic_msgs::DiagnosticStatus::OK;
        return alarmed && status.name == mistake.name + ": steps" && tells(status.message, mistake);
      });
    });
  }
  static bool isStated(const Mistake& mistake, const std::vector<deformable_ccd::State>& states) {
    return std::any_of(states.begin(), states.end(), [&](const auto& state) {
      return (state.proved && !mistake.doubted) || tells(state.reason, mistake);
    });
  }
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

TEST_F(Mistakes, AreToldWithWhatToDo) {
  using deformable_ccd::MeshStamped;
  using sensor_msgs::PointCloud2;
  bool more = false;
  Mesh in_millimetres = tipAbove(1);
  for (Vec3& p : in_millimetres.positions) p *= 1000;
  Positions shuffled = gridAt(20, 30, 0);
  std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937(1));
  const auto other_map = node.advertise<octomap_msgs::Octomap>("/octomap_full", 1, true);
  const auto other_mesh = node.advertise<PointCloud2>("/a_tracker/points", 1);
  const auto map = advertiseAndWait<octomap_msgs::Octomap>(node, "/map_frame/octomap", true);
  map.publish(mapIn("odom"));
  const auto tip = [&] { return meshStamped(tipAbove(1), stamp_s); };
  const auto unplaced =
      sends<MeshStamped>("/no_transform/mesh", [&] { return meshStamped(tipAbove(1), stamp_s, "camera"); });
  const auto grid = [&] { return cloud(gridAt(3, 4, 0), stamp_s); };
  expectTold({
      {"/no_transform", "no transform from 'camera' to 'world'", "publish it on /tf or /tf_static", unplaced},
      {"/wrong_type", "type std_msgs/Bool is not a mesh", "publish deformable_ccd/MeshStamped, geometry_msgs/PoseArray",
       sends<std_msgs::Bool>("/wrong_type/mesh", [] { return std_msgs::Bool(); })},
      {"/swapped", "topology/rows and topology/cols look swapped", "set rows: 3, cols: 4",
       sends<PointCloud2>("/swapped/mesh", grid), false, true},
      {"/shuffled", "the points look shuffled", "publish them in",
       sends<PointCloud2>("/shuffled/mesh", [&] { return cloud(shuffled, stamp_s); }), true, true},
      {"/no_map", "no octomap has been received yet",
       "see rostopic hz /no_map/octomap, or do without with effects/octomap: off",
       sends<MeshStamped>("/no_map/mesh", tip)},
      {"/no_map", "nobody publishes /no_map/octomap", ""},
      {"/unheard_map", "/octomap_full, and this monitor listens to /octomap_binary",
       "give the topic with octomap:=TOPIC, or do without with effects/octomap: off"},
      {"/map_frame", "no transform from 'world' to the octomap's frame 'odom'", "publish it on /tf or /tf_static",
       sends<MeshStamped>("/map_frame/mesh", tip)},
      {"/silent", "nobody publishes /silent/cloth; give the mesh's topic with mesh:=TOPIC",
       "/a_tracker/points (sensor_msgs/PointCloud2)"},
      {"/no_stamp", "messages carry no stamp", "set header.stamp in the publisher",
       sends<MeshStamped>("/no_stamp/mesh", [] { return meshStamped(tipAbove(1), 0); })},
      {"/no_topology", "an unorganised point cloud has no topology", "set topology/rows and topology/cols for a grid",
       sends<PointCloud2>("/no_topology/mesh", grid)},
      {"/row_step", " contradicts the data, which are just 3 rows of 4 points", "publish row_step ",
       sends<PointCloud2>("/row_step/mesh",
                          [&] {
                            PointCloud2 message = grid();
                            message.height = 3;
                            message.width = 4;
                            message.row_step = static_cast<std::uint32_t>(message.data.size());
                            return message;
                          })},
      {"/mismatch", "12 points, but topology/rows x topology/cols is 3 x 5 = 15",
       "correct topology/rows and topology/cols", sends<PointCloud2>("/mismatch/mesh", grid)},
      {"/millimetres", "the mesh is 2000 m across", "are these millimetres?",
       sends<MeshStamped>("/millimetres/mesh", [&] { return meshStamped(in_millimetres, stamp_s); }), false, true},
      {"/too_slow", "GAP: 2 s since the last frame, max_step_s is 0.5", "a slower publisher needs a larger max_step_s",
       sends<MeshStamped>("/too_slow/mesh", [&] { return meshStamped(sheetAt(1), 100 + 20 * (stamp_s - 100)); })},
      {"/remeshed", "TOPOLOGY_CHANGED: the mesh has 6 vertices and ",  // 1 or 2 faces in turn; one line in some seconds
       "use a tracker, or give topology/file",
       sends<MeshStamped>("/remeshed/mesh",
                          [&] {
                            Mesh mesh = tipAbove(1);
                            if ((more = !more)) mesh.faces.pop_back();
                            return meshStamped(mesh, stamp_s);
                          })},
  });
  int waits = 0;
  std::set<std::string> effects;
  for (const rosgraph_msgs::Log& line : log.all()) {
    waits += line.level == rosgraph_msgs::Log::INFO && line.msg.rfind("/no_transform waits: ", 0) == 0;
    const bool is_effect =
        line.msg.find(": on, ") != std::string::npos || line.msg.find(": off, ") != std::string::npos;
    EXPECT_TRUE(!is_effect || effects.insert(line.name + line.msg).second) << "said twice: " << line.name << line.msg;
    EXPECT_TRUE(line.name == "/shuffled" || line.msg.find("look shuffled") == std::string::npos)
        << line.name << line.msg;
  }
  EXPECT_EQ(waits, 1) << "what may be on its way is no mistake yet";

  const auto tf = advertiseAndWait<tf2_msgs::TFMessage>(node, "/tf_static", true);
  tf.publish(transformAt(1, "camera", {0, 0, 0}));
  expectOver("/no_transform", unplaced);
}

class NoClock : public Mistakes {};
TEST_F(NoClock, SimulatedTimeWithoutAClock) {
  expectTold({{"/no_clock", "/use_sim_time is set, but nobody publishes /clock", "play the bag with --clock"}});
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "mistakes_test"); }
