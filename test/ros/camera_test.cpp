// A monitor that makes its map of a camera's clouds, at 5 Hz beside a cloth at 30 Hz: the camera is killed and comes
// back, its tf stops, it sends what is no cloud. What is missing stands in ~state, and is there again afterwards.
#include <atomic>

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include "ros/support/live_tests.h"
#include "ros/support/missing.h"
#include "ros/support/rate.h"

namespace dccd {
namespace test {
namespace {

struct Seeing : StateTest {
  Seeing() : StateTest("/seeing") {}

  /// The camera is 1 m below the world's origin and looks up, at the lower side of a plate; with the sheet beside it,
  /// of which it sees that it lies at z = 0.
  static sensor_msgs::PointCloud2 plate(bool with_sheet) {
    Positions points;
    for (int i = 0; i < 400; ++i) points.emplace_back(0.025 * (i % 20), 0.025 * (i / 20), 0.55);
    for (int i = 0; i < (with_sheet ? 400 : 0); ++i)
      points.emplace_back(0.05 + 0.015 * (i % 20), 0.05 + 0.015 * (i / 20), 2.0);
    // A wall behind where the sheet comes to, so that the place is seen free before.
    for (int i = 0; i < (with_sheet ? 0 : 900); ++i) points.emplace_back(0.02 * (i % 30), 0.02 * (i / 30), 2.6);
    return cloud(points, ros::Time::now().toSec(), "camera");
  }
};

TEST_F(Seeing, SaysWhatOfTheCameraIsMissing) {
  const auto mesh = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/seeing/mesh");
  ros::Publisher tf = advertiseAndWait<tf2_msgs::TFMessage>(node, "/tf");
  std::atomic<bool> tf_comes{true}, is_whole{true}, sees_sheet{false};
  std::atomic<double> height_m{0.5};
  const Rate transforms(50, [&] {
    if (tf_comes) tf.publish(transformAt(ros::Time::now().toSec(), "camera", {0, 0, -1}));
  });
  const Rate cloth(30, [&] { mesh.publish(meshStamped(sheetAt(height_m, 4, 4), ros::Time::now().toSec())); });
  EXPECT_TRUE(misses("no octomap has been received yet")) << state.last().reason;
  const auto start = [&] {
    const auto points =
        std::make_shared<ros::Publisher>(advertiseAndWait<sensor_msgs::PointCloud2>(node, "/seeing/points"));
    return std::make_unique<Rate>(5, [&, points] {
      sensor_msgs::PointCloud2 message = plate(sees_sheet);
      if (!is_whole) message.fields.pop_back();
      points->publish(message);
    });
  };
  std::unique_ptr<Rate> camera = start();
  EXPECT_TRUE(becomesProved()) << state.last().reason;
  camera.reset();
  EXPECT_TRUE(misses("older than")) << state.last().reason;
  camera = start();
  EXPECT_TRUE(becomesProved()) << "a new camera: " << state.last().reason;
  tf_comes = false;
  EXPECT_TRUE(misses("no transform from 'camera' to 'world'")) << state.last().reason;
  tf_comes = true;
  EXPECT_TRUE(becomesProved()) << "tf is back: " << state.last().reason;
  is_whole = false;
  EXPECT_TRUE(misses("the cloud was refused: there is no field 'z'")) << state.last().reason;
  is_whole = true;
  EXPECT_TRUE(becomesProved()) << "whole clouds again: " << state.last().reason;
  for (int k = 51; k <= 100; ++k) {
    height_m = 0.01 * k;
    ros::Duration(0.03).sleep();
  }
  sees_sheet = true;
  EXPECT_TRUE(waitUntil([&] { return !state.last().excluded.empty(); }, 15));
  EXPECT_TRUE(becomesProved()) << "what it sees of the sheet is the sheet's own: " << state.last().reason;
  EXPECT_TRUE(waitUntil([&] { return state.last().reason.find("as own of body 'mesh'") != std::string::npos; }, 15))
      << state.last().reason;
  EXPECT_NE(state.last().reason.find("that came are not in the map (the newest: there is no field 'z'"),
            std::string::npos)
      << state.last().reason;
  EXPECT_GT(stats.last().maps_refused, 0u);
  EXPECT_LT(stats.last().maps_refused, stats.last().maps_received);
}

struct SeeingTwice : StateTest {
  SeeingTwice() : StateTest("/seeing_twice") {}

  /// What the camera below the origin sees of a plate above the sheet.
  static sensor_msgs::Image picture(float depth_m) {
    sensor_msgs::Image out;
    out.header.stamp = ros::Time::now();
    out.header.frame_id = "camera";
    out.width = out.height = 32;
    out.encoding = "32FC1";
    out.step = 4 * out.width;
    const std::vector<float> depths(out.width * out.height, depth_m);
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(depths.data());
    out.data.assign(bytes, bytes + 4 * depths.size());
    return out;
  }
  static sensor_msgs::CameraInfo info() {
    sensor_msgs::CameraInfo out;
    out.header.frame_id = "camera";
    out.width = out.height = 32;
    out.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    out.P = {32, 0, 15.5, 0, 0, 32, 15.5, 0, 0, 0, 1, 0};
    return out;
  }
};

TEST_F(SeeingTwice, TakesPicturesAndCloudsAndSaysWhichCameraIsMissing) {
  const auto mesh = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/seeing_twice/mesh");
  ros::Publisher tf = advertiseAndWait<tf2_msgs::TFMessage>(node, "/tf");
  const Rate transforms(50, [&] {
    tf.publish(transformAt(ros::Time::now().toSec(), "camera", {0, 0, -1}));
    tf.publish(transformAt(ros::Time::now().toSec(), "other", {0, 0, -1}));
  });
  const Rate cloth(30, [&] { mesh.publish(meshStamped(sheetAt(1, 4, 4), ros::Time::now().toSec())); });
  std::atomic<float> depth_m{3};
  std::atomic<bool> knows_pinhole{false};
  ros::Publisher infos = node.advertise<sensor_msgs::CameraInfo>("/seeing_twice/depth/camera_info", 1);
  const auto pictures = advertiseAndWait<sensor_msgs::Image>(node, "/seeing_twice/depth/image");
  const Rate camera(15, [&] {
    if (knows_pinhole) infos.publish(info());
    pictures.publish(picture(depth_m));
  });
  EXPECT_TRUE(misses("no CameraInfo has come on /seeing_twice/depth/camera_info")) << state.last().reason;
  knows_pinhole = true;
  EXPECT_TRUE(misses("no cloud has come on /seeing_twice/points yet")) << state.last().reason;
  const auto points = advertiseAndWait<sensor_msgs::PointCloud2>(node, "/seeing_twice/points");
  {
    const Rate other(100, [&] {
      points.publish(cloud({{0.5, 0.5, 3}, {0.6, 0.5, 3}}, ros::Time::now().toSec(), "other"));
    });
    EXPECT_TRUE(becomesProved()) << state.last().reason;
    depth_m = 0;
    EXPECT_TRUE(misses("none of its 1024 points is a measurement")) << state.last().reason;
    EXPECT_TRUE(misses("'camera' on /seeing_twice/depth/image was refused")) << state.last().reason;
    depth_m = 3;
    EXPECT_TRUE(becomesProved()) << state.last().reason;
    EXPECT_GE(stats.last().points_no_measurement, 1024u);
  }
  EXPECT_TRUE(misses("no cloud 'other' on /seeing_twice/points has come for longer than octomap_timeout_s"))
      << state.last().reason;
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "camera_test"); }
