// examples/stop_the_arm in C++ and Python: it says stop in time, and whenever it cannot know.
#include <deformable_ccd/FirstContact.h>
#include <deformable_ccd/State.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_msgs/Bool.h>

#include <algorithm>
#include <array>
#include <limits>

#include "ros/support/live_tests.h"
#include "ros/support/meshes.h"
#include "ros/support/probe.h"

namespace dccd {
namespace test {
namespace {

/// A monitor whose words the test chooses.
class PlayedMonitor {
 public:
  explicit PlayedMonitor(ros::NodeHandle& node)
      : state_(advertiseAndWait<deformable_ccd::State>(node, "/played/state", true, 2)),
        prediction_(advertiseAndWait<deformable_ccd::FirstContact>(node, "/played/time_to_contact", false, 2)) {}

  bool silent = false, proved = true, answered = true, goes_on = true;
  std::uint8_t touching = deformable_ccd::State::NONE;
  double contact_in_s = std::numeric_limits<double>::infinity(), horizon_s = 1;
  bool predicts = true;

  void speak() {
    if (silent) return;
    deformable_ccd::State state;
    state.proved = proved;
    state.touching = touching;
    if (goes_on) holds_until_ += ros::Duration(0.03);
    state.holds_until = holds_until_;
    state_.publish(state);
    if (!predicts) return;
    deformable_ccd::FirstContact time;
    time.answered = answered;
    time.contact = contact_in_s < horizon_s;
    time.seconds = contact_in_s;
    time.horizon = horizon_s;
    prediction_.publish(time);
  }

 private:
  ros::Publisher state_, prediction_;
  ros::Time holds_until_{1000};
};

/// What one of the examples says.
struct Client {
  Client(ros::NodeHandle& node, const std::string& client) : name(client), stop(node, "/" + client + "/stop") {}
  std::string name;
  Probe<std_msgs::Bool> stop;
};

struct StopTheArm : ::testing::Test {
  ros::NodeHandle node;
  std::array<Client, 2> clients{Client(node, "cpp"), Client(node, "python")};
  PlayedMonitor monitor{node};

  /// The monitor goes on until both clients say so steadily.
  void expectStop(bool wanted, const std::string& why) {
    std::array<std::size_t, 2> seen{clients[0].stop.count(), clients[1].stop.count()}, steady{};
    EXPECT_TRUE(waitUntil([&] {
      monitor.speak();
      ros::WallDuration(1.0 / 30).sleep();
      for (std::size_t c = 0; c < clients.size(); ++c) {
        const auto said = clients[c].stop.all();
        for (; seen[c] < said.size(); ++seen[c]) {
          steady[c] = static_cast<bool>(said[seen[c]].data) == wanted ? steady[c] + 1 : 0;
        }
      }
      return steady[0] >= 5 && steady[1] >= 5;
    })) << why
        << ": cpp " << steady[0] << " times, python " << steady[1];
  }
};

TEST_F(StopTheArm, WheneverItCannotKnow) {
  monitor.silent = true;
  expectStop(true, "nothing has been heard");
  monitor.silent = false;
  expectStop(false, "clear, and nothing in sight");
  monitor.silent = true;
  expectStop(true, "the monitor fell silent, its last ~state was proved and is latched");
  monitor.silent = false;
  expectStop(false, "it is back");
  monitor.predicts = false;
  expectStop(true, "clear now, but nobody looks ahead");
  monitor.predicts = true;
  expectStop(false, "somebody does again");
  monitor.goes_on = false;
  expectStop(true, "it says the same again and again, of a frame that grows old");
  monitor.goes_on = true;
  expectStop(false, "new frames");
}

TEST_F(StopTheArm, InTime) {
  monitor.contact_in_s = 0.9;
  expectStop(false, "0.9 s are enough to stop in 0.3 s");
  monitor.contact_in_s = 0.29;
  expectStop(true, "0.29 s are not");
  monitor.contact_in_s = std::numeric_limits<double>::infinity();
  expectStop(false, "the way is free again");
  monitor.horizon_s = 0.2;
  expectStop(true, "who looks only 0.2 s ahead does not see what cannot be avoided any more");
  monitor.horizon_s = 1;
  monitor.proved = false;
  expectStop(true, "not proved, as across a seam");
  monitor.proved = true;
  monitor.touching = deformable_ccd::State::NEW;
  expectStop(true, "proved, and something touches anew");
  monitor.touching = deformable_ccd::State::EXPECTED;
  expectStop(false, "what is expected to touch is no reason to stop");
  monitor.touching = deformable_ccd::State::LASTING;
  expectStop(false, "it lasts, and nothing new is in sight");
  monitor.contact_in_s = 0.1;
  expectStop(true, "another one is");
  monitor.contact_in_s = std::numeric_limits<double>::infinity();
  monitor.touching = deformable_ccd::State::NONE;
  expectStop(false, "neither came");
  monitor.answered = false;
  expectStop(true, "no answer is not \"no contact\"");
}

TEST(WithTheMonitor, BothStopBeforeTheTipArrives) {
  ros::NodeHandle node;
  std::array<Client, 2> clients{Client(node, "live_cpp"), Client(node, "live_python")};
  std::array<double, 2> stopped_at{-1, -1};
  std::array<bool, 2> went{};
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/mesh");
  // A tip sinks towards a triangle at 0.5 m/s: they go on while it is far, and stop before it has arrived.
  const ros::SteadyTime start = ros::SteadyTime::now();
  for (double height = 1; height > 0 && *std::min_element(stopped_at.begin(), stopped_at.end()) < 0;) {
    height = 1 - 0.5 * (ros::SteadyTime::now() - start).toSec();
    publisher.publish(meshStamped(tipAbove(height), 1000 - 2 * height));
    ros::WallDuration(1.0 / 30).sleep();
    for (std::size_t c = 0; c < clients.size(); ++c) {
      const bool says_stop = clients[c].stop.count() == 0 || clients[c].stop.last().data;
      went[c] = went[c] || !says_stop;
      if (went[c] && says_stop && stopped_at[c] < 0) stopped_at[c] = height;
    }
  }
  for (std::size_t c = 0; c < clients.size(); ++c) {
    EXPECT_TRUE(went[c]) << clients[c].name << " never let the arm move";
    EXPECT_GT(stopped_at[c], 0) << clients[c].name << " stopped after the contact, or never";
    EXPECT_LT(stopped_at[c], 0.5) << clients[c].name << ": a second of look-ahead at 0.5 m/s";
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "stop_the_arm_test"); }
