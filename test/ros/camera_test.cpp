// A monitor that makes its map of a camera's clouds, at 5 Hz beside a cloth at 30 Hz: the camera is killed and comes
// back, its tf stops, it sends what is no cloud. What is missing stands in ~state, and is there again afterwards.
#include <atomic>

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
    return cloud(points, ros::Time::now().toSec(), "camera");
  }
};

TEST_F(Seeing, SaysWhatOfTheCameraIsMissing) {
  const auto mesh = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/seeing/mesh");
  ros::Publisher tf = advertiseAndWait<tf2_msgs::TFMessage>(node, "/tf");
  std::atomic<bool> tf_comes{true}, is_whole{true}, sees_sheet{false};
  const Rate transforms(50, [&] {
    if (tf_comes) tf.publish(transformAt(ros::Time::now().toSec(), "camera", {0, 0, -1}));
  });
  const Rate cloth(30, [&] { mesh.publish(meshStamped(sheetAt(1, 4, 4), ros::Time::now().toSec())); });
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
  sees_sheet = true;
  EXPECT_TRUE(waitUntil([&] { return !state.last().excluded.empty(); }, 15));
  EXPECT_TRUE(becomesProved()) << "what it sees of the sheet is the sheet's own: " << state.last().reason;
  EXPECT_NE(state.last().excluded.at(0).find("as own of body 'mesh'"), std::string::npos) << state.last().reason;
  EXPECT_GT(stats.last().maps_refused, 0u);
  EXPECT_LT(stats.last().maps_refused, stats.last().maps_received);
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "camera_test"); }
