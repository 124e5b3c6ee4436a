// The live node with a grid over an octomap: what is missing or unknown of the map, and both kinds of message.
#include <deformable_ccd/ContactArray.h>

#include <algorithm>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <octomap_msgs/Octomap.h>
#include <ros/ros.h>

#include "ros/support/monitor_fixture.h"

namespace dccd {
namespace test {
namespace {

struct Grid : MonitorTest {
  Grid() : MonitorTest("/grid") {}
  ros::Publisher mesh = advertiseAndWait<sensor_msgs::PointCloud2>(node, "/grid/mesh");
  ros::Publisher map = advertiseAndWait<octomap_msgs::Octomap>(node, "/grid/octomap", true);

  void giveMap(const octomap_msgs::Octomap& message) {
    const Stats before = stats.last();
    map.publish(message);
    // Frames that touch nothing, until one has seen the map.
    double stamp_s = 1;
    ASSERT_TRUE(waitUntil([&] {
      send(mesh, cloud(gridAt(3, 4, 5), stamp_s += 0.1));
      const Stats now = stats.last();
      return now.maps_received > before.maps_received && now.map_present;
    }));
  }
};

TEST_F(Grid, AMissingMapIsNoAnswerAboutIt) {
  // The first case of this monitor, before it has had any map.
  send(mesh, cloud(gridAt(3, 4, 0.3), 10));
  const deformable_ccd::ContactArray outcome = send(mesh, cloud(gridAt(3, 4, 0.2), 10.1));
  EXPECT_EQ(outcome.status, deformable_ccd::ContactArray::NO_MAP);
  EXPECT_TRUE(outcome.answered) << "about the mesh alone";
  EXPECT_FALSE(clear.last().data);
}

TEST_F(Grid, OctomapBinaryAndFull) {
  for (const bool binary : {true, false}) {
    giveMap(blockBelowZero(binary));
    send(mesh, cloud(gridAt(3, 4, 0.3), 100));
    const deformable_ccd::ContactArray outcome = send(mesh, cloud(gridAt(3, 4, -0.1), 100.1));
    ASSERT_EQ(outcome.status, deformable_ccd::ContactArray::OK) << outcome.reason;
    EXPECT_EQ(outcome.start_state, deformable_ccd::ContactArray::CLEAR);
    ASSERT_FALSE(outcome.contacts.empty());
    double earliest = 1;
    std::size_t vertices = 0;
    for (const auto& contact : outcome.contacts) {
      earliest = std::min(earliest, contact.toc_lower);
      vertices += contact.kind == decltype(outcome.contacts)::value_type::VERTEX_VOXEL_FACE;
      EXPECT_EQ(contact.body[1], 65535);
    }
    EXPECT_NEAR(earliest, 0.75, 1e-6) << "float coordinates";
    EXPECT_EQ(vertices, 12u) << "each vertex falls on one face";
    send(mesh, cloud(gridAt(3, 4, 0.3), 100.2));
  }
}

TEST_F(Grid, UnknownSpaceIsReported) {
  giveMap(blockBelowZero(true, 90));
  send(mesh, cloud(gridAt(3, 4, 0.35), 100));
  send(mesh, cloud(gridAt(3, 4, 0.15), 100.1));
  ASSERT_TRUE(waitUntil([&] { return stats.last().header.stamp == ros::Time(100.1); }));
  const Stats swept = stats.last();
  EXPECT_EQ(swept.unknown_fraction, 1) << "the map knows what is occupied, and nothing of the air";
  EXPECT_GT(swept.unknown_space_in, 0u);
  EXPECT_EQ(swept.unknown_space_out, swept.unknown_space_in);
  EXPECT_GT(swept.unknown_space_ms, 0);
  EXPECT_NEAR(swept.map_age, 10.1, 1e-6);
  send(mesh, cloud(gridAt(3, 4, -0.05), 100.2));
  ASSERT_TRUE(waitUntil([&] { return stats.last().header.stamp == ros::Time(100.2); }));
  EXPECT_LT(stats.last().unknown_fraction, 1) << "into what is known";
}

TEST_F(Grid, AFrameWithoutAnAnswerSaysNothingAgainstTheMap) {
  giveMap(blockBelowZero(true));
  Probe<diagnostic_msgs::DiagnosticArray> diagnostics(node, "/diagnostics");
  const auto ofGrid = [&] {
    std::vector<diagnostic_msgs::DiagnosticStatus> found;
    for (const auto& array : diagnostics.all()) {
      for (const auto& status : array.status) {
        if (status.name == "/grid: steps") found.push_back(status);
      }
    }
    return found;
  };
  double stamp_s = 600;
  ASSERT_TRUE(waitUntil([&] {
    send(mesh, cloud(gridAt(3, 4, 5), stamp_s += 0.1));
    for (int i = 0; i < 10; ++i) {  // so that one of these is nearly always the newest
      EXPECT_EQ(send(mesh, cloud(gridAt(3, 4, 5), stamp_s)).status, deformable_ccd::ContactArray::DUPLICATE);
    }
    return ofGrid().size() > 3;
  }));
  const auto found = ofGrid();
  for (std::size_t i = 1; i < found.size(); ++i) {  // the first may tell of the time before
    EXPECT_EQ(found[i].level, diagnostic_msgs::DiagnosticStatus::OK) << found[i].message;
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
