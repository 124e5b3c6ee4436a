// The live node with a grid over an octomap, of both kinds of message.
#include <deformable_ccd/ContactArray.h>

#include <algorithm>

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

}  // namespace
}  // namespace test
}  // namespace dccd
