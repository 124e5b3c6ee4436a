// The presets of launch/presets against emulated publishers: type, topic, stamps and frames as the real ones have them.
#include <deformable_ccd/ContactArray.h>
#include <geometry_msgs/TransformStamped.h>
#include <gtest/gtest.h>
#include <octomap_msgs/Octomap.h>
#include <ros/ros.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <limits>
#include <set>

#include "octomap/map_builder.h"
#include "ros/support/live_tests.h"
#include "ros/support/meshes.h"
#include "ros/support/probe.h"

namespace dccd {
namespace test {
namespace {

constexpr double RATE_HZ = 30;
constexpr double TABLE_M = 0;  // height of the table's top in the map
constexpr std::size_t MONITORS = 6;

/// A table of 2 m x 2 m below z = 0 and, where `more` says so, other voxels; as octomap_server sends it: latched,
/// binary, in the frame map, stamped when the sensor saw it.
octomap_msgs::Octomap tableMap(const std::function<bool(const Vec3&)>& more = [](const Vec3&) { return false; }) {
  octomap_msgs::Octomap map;
  map.header.stamp = ros::Time::now();
  map.header.frame_id = "map";
  map.binary = true;
  map.id = "OcTree";
  map.resolution = 0.05;
  map.data = buildOctomap(
      0.05, Box{{-1, -1, -0.2}, {1, 1, 1}}, [&](const Vec3& c) { return c.z() < TABLE_M || more(c); }, true);
  return map;
}

Positions grid(std::size_t rows, std::size_t cols, double spacing_m, double z) {
  Positions positions;
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < cols; ++c) {
      positions.emplace_back(spacing_m * (static_cast<double>(c) - 0.5 * static_cast<double>(cols - 1)),
                             spacing_m * (static_cast<double>(r) - 0.5 * static_cast<double>(rows - 1)), z);
    }
  }
  return positions;
}

/// A camera that looks straight down from a metre above the table; its optical frame has z ahead and y down in the
/// image.
void toOpticalFrame(Positions& positions) {
  for (Vec3& p : positions) p = Vec3(p.x(), -p.y(), 1 - p.z());
}

geometry_msgs::TransformStamped cameraPose(const std::string& frame) {
  geometry_msgs::TransformStamped pose;
  pose.header.stamp = ros::Time::now();
  pose.header.frame_id = "map";
  pose.child_frame_id = frame;
  pose.transform.translation.z = 1;
  pose.transform.rotation.x = 1;  // half a turn about x
  return pose;
}

/// A cloud as pcl_ros publishes it: points of 32 bytes with a colour behind the coordinates, stamps in whole
/// microseconds.
sensor_msgs::PointCloud2 pclCloud(const Positions& positions, const std::string& frame) {
  sensor_msgs::PointCloud2 out = cloud(positions, 0, frame);
  out.header.stamp.fromNSec(ros::Time::now().toNSec() / 1000 * 1000);
  sensor_msgs::PointField colour;
  colour.name = "rgb";
  colour.offset = 16;
  colour.datatype = sensor_msgs::PointField::FLOAT32;
  colour.count = 1;
  out.fields.push_back(colour);
  out.point_step = 32;
  out.row_step = 32 * out.width;
  std::vector<std::uint8_t> wide(out.row_step);
  for (std::size_t i = 0; i < positions.size(); ++i) std::memcpy(&wide[32 * i], &out.data[16 * i], 16);
  out.data = wide;
  out.is_dense = true;
  return out;
}

class Preset : public ::testing::Test {
 protected:
  explicit Preset(const std::string& name) : contacts(node, "/" + name + "/collision_monitor/contacts") {
    EXPECT_TRUE(ros::service::waitForService("/" + name + "/collision_monitor/reset", 20000));
  }

  /// Frames at rest until the monitor has the map and says OK, then ten that sink. Leaves the last outcome at rest and
  /// those of the fall.
  deformable_ccd::ContactArray rest;
  std::vector<deformable_ccd::ContactArray> fall;
  void drop(double from_z, double to_z, const std::function<void(double z)>& publish) {
    ros::WallRate rate(RATE_HZ);
    ASSERT_TRUE(waitUntil(
        [&] {
          publish(from_z);
          rate.sleep();
          rest = contacts.last();
          return rest.status == deformable_ccd::ContactArray::OK && rest.answered && ++steady_ > 3;
        },
        15))
        << static_cast<int>(rest.status) << " " << rest.reason;
    // Outcomes of the rest may still be on their way: those of the fall are told by their stamps, which pclCloud cuts
    // to whole microseconds.
    const ros::Time start = ros::Time::now() - ros::Duration(1e-5);
    const auto isOfTheFall = [&](const deformable_ccd::ContactArray& outcome) { return outcome.header.stamp > start; };
    constexpr int FRAMES = 10;
    for (int i = 1; i <= FRAMES; ++i) {
      publish(from_z + (to_z - from_z) * i / FRAMES);
      rate.sleep();
    }
    ASSERT_TRUE(waitUntil([&] {
      const auto all = contacts.all();
      fall.clear();
      std::copy_if(all.begin(), all.end(), std::back_inserter(fall), isOfTheFall);
      return fall.size() >= FRAMES;
    }));
    for (const auto& outcome : fall) EXPECT_EQ(outcome.status, deformable_ccd::ContactArray::OK) << outcome.reason;
  }
  /// Above the table in the first frame of the fall, and in contact with it in a later one.
  void expectTouched() {
    EXPECT_GT(touching(), 0u) << "it fell through the table's top";
    EXPECT_TRUE(fall.front().contacts.empty()) << "still above the table";
  }
  /// The contacts of the first step of the fall that has any, which is to be this one.
  auto metIn(std::ptrdiff_t step) const {
    EXPECT_TRUE(rest.contacts.empty());
    const auto met =
        std::find_if(fall.begin(), fall.end(), [](const auto& outcome) { return !outcome.contacts.empty(); });
    EXPECT_EQ(met - fall.begin(), step) << "of " << fall.size();
    return met == fall.end() ? deformable_ccd::ContactArray().contacts : met->contacts;
  }
  /// Says where the camera is, as long as the publisher lives.
  ros::Publisher placeCamera(const std::string& frame) {
    const auto tf = advertiseAndWait<tf2_msgs::TFMessage>(node, "/tf_static", true, MONITORS);
    tf2_msgs::TFMessage poses;
    poses.transforms.push_back(cameraPose(frame));
    tf.publish(poses);
    return tf;
  }
  /// Steps of the fall that meet the map anew.
  std::size_t touching() const {
    return static_cast<std::size_t>(
        std::count_if(fall.begin(), fall.end(), [](const deformable_ccd::ContactArray& outcome) {
          return std::any_of(outcome.contacts.begin(), outcome.contacts.end(),
                             [](const auto& c) { return c.body[1] == 65535 && !c.initial && !c.leaving; });
        }));
  }

  ros::NodeHandle node;
  Probe<deformable_ccd::ContactArray> contacts;

 private:
  int steady_ = 0;
};

struct Cdcpd : Preset {
  Cdcpd() : Preset("cdcpd") {}
};

TEST_F(Cdcpd, ClothInTheCamerasOpticalFrame) {
  const std::string frame = "kinect2_rgb_optical_frame";
  const auto tf = placeCamera(frame);
  const auto map = advertiseAndWait<octomap_msgs::Octomap>(node, "/cdcpd/octomap_binary", true);
  map.publish(tableMap());
  const auto publisher = advertiseAndWait<sensor_msgs::PointCloud2>(node, "/cdcpd/tracker_points");
  drop(0.1, -0.02, [&](double z) {
    Positions positions = grid(20, 20, 0.02, z);
    toOpticalFrame(positions);
    publisher.publish(pclCloud(positions, frame));
  });
  EXPECT_EQ(rest.header.frame_id, frame) << "without fixed_frame the mesh's own";
  EXPECT_TRUE(rest.contacts.empty());
  expectTouched();
}

struct Trackdlo : Preset {
  Trackdlo() : Preset("trackdlo") {}
};

TEST_F(Trackdlo, RopeOf45Points) {
  const auto map = advertiseAndWait<octomap_msgs::Octomap>(node, "/trackdlo/octomap_binary", true);
  octomap_msgs::Octomap table = tableMap();
  table.header.frame_id = "camera_color_optical_frame";
  map.publish(table);
  const auto publisher = advertiseAndWait<sensor_msgs::PointCloud2>(node, "/trackdlo/results_pc");
  drop(0.1, -0.02, [&](double z) { publisher.publish(pclCloud(grid(1, 45, 0.01, z), "camera_color_optical_frame")); });
  EXPECT_TRUE(rest.contacts.empty());
  expectTouched();
}

struct FabricSimulator : Preset {
  FabricSimulator() : Preset("fabric_simulator") {}

  /// 16 x 23 = 368 vertices: spheres for the vertices, lines for the edges, and a soup of triangles, all in one array,
  /// without namespaces, in the frame map.
  static visualization_msgs::MarkerArray markers(double z) {
    visualization_msgs::MarkerArray triangles = soup({grid(16, 23, 1.0 / 15, z), Topology::grid(16, 23).faces()}, 0),
                                    out;
    triangles.markers[0].header.frame_id = "map";
    triangles.markers[0].header.stamp = ros::Time::now();
    visualization_msgs::Marker points = triangles.markers[0], lines = triangles.markers[0];
    points.id = 0;
    points.type = visualization_msgs::Marker::POINTS;
    lines.id = 1;
    lines.type = visualization_msgs::Marker::LINE_LIST;
    out.markers = {points, lines, triangles.markers[0]};
    return out;
  }
};

TEST_F(FabricSimulator, TriangleSoupAmongOtherMarkers) {
  const auto map = advertiseAndWait<octomap_msgs::Octomap>(node, "/fabric_simulator/octomap_binary", true);
  map.publish(tableMap());
  const auto publisher = advertiseAndWait<visualization_msgs::MarkerArray>(node, "/fabric_markers");
  drop(0.1, -0.02, [&](double z) { publisher.publish(markers(z)); });
  EXPECT_TRUE(rest.contacts.empty());
  EXPECT_EQ(rest.header.frame_id, "map");
  expectTouched();
}

/// Vertices 0.05 m apart, of now.
deformable_ccd::MeshStamped clothOf(std::size_t rows, std::size_t cols, double z) {
  return meshStamped({grid(rows, cols, 0.05, z), Topology::grid(rows, cols).faces()}, ros::Time::now().toSec(), "map");
}

struct OctomapServer : Preset {
  OctomapServer() : Preset("octomap_server") {}
};

TEST_F(OctomapServer, MapThatHoldsTheClothItself) {
  const auto map = advertiseAndWait<octomap_msgs::Octomap>(node, "/octomap_full", true);
  // The sensor saw the left half of the cloth at rest, at z = 0.31.
  map.publish(tableMap([](const Vec3& c) { return std::abs(c.z() - 0.325) < 0.03 && c.x() > -0.2 && c.x() < 0; }));
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/octomap_server/mesh");
  drop(0.31, -0.02, [&](double z) { publisher.publish(clothOf(5, 9, z)); });
  EXPECT_TRUE(rest.contacts.empty()) << "its own voxels are no obstacle";
  EXPECT_GT(touching(), 0u) << "the table is no part of the cloth";
}

struct DepthCamera : Preset {
  DepthCamera() : Preset("depth_camera") {}
  /// A metre above the table, which it sees at depth 1; 525 pixels a metre. Every tenth pixel of every tenth row is
  /// lost, as are the 40 columns at the left that only one eye sees.
  static sensor_msgs::PointCloud2 seen(const std::string& frame) {
    constexpr float LOST = std::numeric_limits<float>::quiet_NaN();
    // Under a sanitizer a cloud of 640 x 480 takes longer than the camera's next one: there every fourth pixel is all.
    const std::uint32_t coarser = std::getenv("DEFORMABLE_CCD_SANITIZED") ? 4 : 1;
    const std::uint32_t rows = 480 / coarser, cols = 640 / coarser;
    Positions points;
    for (std::uint32_t row = 0; row < rows; ++row) {
      for (std::uint32_t col = 0; col < cols; ++col) {
        const bool lost = col < 40 / coarser || (row % 10 == 0 && col % 10 == 0);
        const double x = (static_cast<double>(coarser * col) - 319.5) / 525,
                     y = (static_cast<double>(coarser * row) - 239.5) / 525;
        points.push_back(lost ? Vec3(LOST, LOST, LOST) : Vec3(x, y, 1));
      }
    }
    sensor_msgs::PointCloud2 out = pclCloud(points, frame);
    out.height = rows;
    out.width = cols;
    out.row_step = 32 * cols;
    out.is_dense = false;
    return out;
  }
};

TEST_F(DepthCamera, ClothOnWhatTheCameraSees) {
  const std::string frame = "camera_depth_optical_frame";
  const auto tf = placeCamera(frame);
  const auto points = advertiseAndWait<sensor_msgs::PointCloud2>(node, "/camera/depth_registered/points");
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/depth_camera/mesh");
  int frames = 0;
  drop(0.1, -0.05, [&](double z) {
    if (frames++ % 3 == 0) points.publish(seen(frame));  // a camera at 10 Hz
    publisher.publish(clothOf(3, 3, z));
  });
  // 150 mm in ten steps of 15 mm: the table is met in the seventh, two thirds of the way down.
  for (const auto& contact : metIn(6)) {
    EXPECT_EQ(std::set<unsigned>({contact.body[0], contact.body[1]}), (std::set<unsigned>{0, 1}));
    EXPECT_NEAR(contact.toc_lower, 2.0 / 3, 1e-3);
  }
}

struct Realsense : Preset {
  Realsense() : Preset("realsense") {}
  /// As with filters:=pointcloud,decimation: a row of points without those that were lost. It is a metre above the
  /// table and sees what lies 10 mm above that: the middle of a layer of voxels.
  static sensor_msgs::PointCloud2 seen() {
    Positions points;
    for (int row = 0; row < 120; ++row) {
      for (int col = 10; col < 160; ++col)
        points.emplace_back((col - 79.5) / 131 * 0.99, (row - 59.5) / 131 * 0.99, 0.99);
    }
    return pclCloud(points, "camera_color_optical_frame");
  }
};

TEST_F(Realsense, ClothOnTheMapThatTheMonitorMakesItself) {
  const auto tf = placeCamera("camera_color_optical_frame");
  const auto points = advertiseAndWait<sensor_msgs::PointCloud2>(node, "/camera/depth/color/points");
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/realsense/mesh");
  int frames = 0;
  drop(0.1, -0.05, [&](double z) {
    if (frames++ % 6 == 0) points.publish(seen());  // a camera at 5 Hz
    publisher.publish(clothOf(3, 3, z));
  });
  // 150 mm in ten steps of 15 mm: the voxels' top at 20 mm is met in the sixth, a third of the way down.
  const auto contacts_met = metIn(5);
  ASSERT_FALSE(contacts_met.empty());
  EXPECT_NEAR(contacts_met.front().toc_lower, 1.0 / 3, 1e-3);
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "presets_test"); }
