// A body that is what a depth camera sees: the newest cloud counts, whatever its triangles.
#include <gtest/gtest.h>
#include <sensor_msgs/PointCloud2.h>

#include <array>
#include <cstring>
#include <limits>

#include "dccd/assurance.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

/// A cloth over what a depth camera sees: 8 x 8 pixels 0.1 m apart, the camera's frame that of the world.
struct Seen : Driven {
  std::string frame = "world";

  explicit Seen(const XmlRpcValue& tree = bodies()) : Driven(tree) {}
  static XmlRpcValue bodies() {
    XmlRpcValue tree;
    tree["max_vertex_step_m"] = 0.0;
    tree["effects"]["octomap"] = "off";
    tree["bodies"]["cloth"]["topic"] = "cloth";
    tree["bodies"]["seen"]["topic"] = "points";
    tree["bodies"]["seen"]["motion"] = "static";
    tree["bodies"]["seen"]["topology"]["source"] = "depth_image";
    tree["bodies"]["seen"]["topology"]["stride"] = 1;
    tree["bodies"]["seen"]["topology"]["max_edge_m"] = 0.2;
    return tree;
  }
  /// Heights by column, NaN for a lost pixel; the first pixel at the origin.
  void see(double stamp_s, const std::array<float, 8>& z) {
    sensor_msgs::PointCloud2 out;
    out.header.stamp = ros::Time(stamp_s);
    out.header.frame_id = frame;
    out.height = out.width = 8;
    addFields({"x", "y", "z", "rgb"}, out);
    out.point_step = 16;
    out.row_step = 128;
    out.data.resize(1024);
    for (std::size_t i = 0; i < 64; ++i) {
      const float p[4] = {0.1f * static_cast<float>(i % 8), 0.1f * static_cast<float>(i / 8), z[i % 8], 0};
      std::memcpy(out.data.data() + 16 * i, p, 16);
    }
    pipeline.take(1, {"sensor_msgs/PointCloud2", bytesOf(out), 0, 0});
    pipeline.nextOutcome(0, outcome);
  }
};

/// The same, of a camera that has a frame of its own in a fixed frame that is named.
struct Camera : Seen {
  Camera() : Seen(inWorld()) { frame = "camera"; }
  static XmlRpcValue inWorld() {
    XmlRpcValue tree = bodies();
    tree["fixed_frame"] = "world";
    return tree;
  }
  void place(double stamp_s, double z, const std::string& sender, const std::string& parent = "world") {
    tf2_msgs::TFMessage message;
    message.transforms = {above("camera", z, ros::Time(stamp_s))};
    message.transforms[0].header.frame_id = parent;
    feed_tf.add(message, sender.empty(), sender);  // static without one
  }
  /// Of a step that nothing touches, if the cloud is where it was first.
  Assurance step(double stamp_s) { return assuranceOf(feed(stamp_s, 0.3f)); }
};
constexpr float NO_DEPTH = std::numeric_limits<float>::quiet_NaN();

TEST(DepthImage, TheNewestCloudHoldsWhateverItsTriangles) {
  Seen scene;
  scene.see(1, {0, 0, 0, 0, 0, 0, 0, 0});
  scene.feed(1, 0.3f);
  // The cloth, x from 0.15 to 0.25, goes from 0.3 to -0.1 and meets the plane z = 0 at 3/4 of the step.
  EXPECT_NEAR(scene.feed(1.1, -0.1f).earliest_toc, 0.75, 1e-6);
  EXPECT_EQ(scene.outcome.status, StepStatus::OK) << scene.outcome.reason;
  EXPECT_EQ(scene.outcome.start_state, StartState::CLEAR);
  // Another cloud with other triangles: the plane is 0.15 m higher, half of it.
  scene.feed(1.2, 0.3f);
  scene.see(1.25, {0.15f, 0.15f, 0.15f, 0.15f, NO_DEPTH, NO_DEPTH, NO_DEPTH, NO_DEPTH});
  const Outcome& higher = scene.feed(1.3, 0.1f);
  EXPECT_EQ(higher.status, StepStatus::OK) << higher.reason;
  EXPECT_NEAR(higher.earliest_toc, 0.75, 1e-6) << "0.3 to 0.1 meets 0.15";
  // The cloth now hangs over a hole in what is seen.
  scene.see(1.35, {0, NO_DEPTH, NO_DEPTH, NO_DEPTH, NO_DEPTH, 0, 0, 0});
  scene.feed(1.4, 0.3f);
  const Outcome& hole = scene.feed(1.5, -0.1f);
  EXPECT_EQ(hole.status, StepStatus::OK) << hole.reason;
  EXPECT_TRUE(hole.contacts.empty());
  EXPECT_EQ(scene.pipeline.monitor().counters(1).processed(), 3u);
  EXPECT_EQ(scene.pipeline.monitor().counters(1).of(StepStatus::TOPOLOGY_CHANGED), 0u);
}

// Each of these was clear.
TEST(DepthImage, OfACameraWhosePlaceIsInDoubtNothingIsProved) {
  const std::array<float, 8> plane{0.05f, 0.05f, 0.05f, 0.05f, 0.05f, 0.05f, 0.05f, 0.05f};
  for (const std::string doubt : {"", "came from two publishers", "changed its parent"}) {
    Camera camera;
    camera.tell({above("base", 0.1, ros::Time(0.9)), above("base", 0.1, ros::Time(2))});
    const bool are_two = doubt == "came from two publishers", is_moved = doubt == "changed its parent";
    for (int i = 0; i < 12; ++i) {
      const bool is_after = i > 5, is_second = i % 2 == 1;  // 1.0 is between 0.99 and 1.01
      camera.place(0.89 + 0.02 * i, is_second && are_two ? 0.2 : 0, is_second && are_two ? "b" : "a",
                   is_after && is_moved ? "base" : "world");
    }
    camera.see(1, plane);
    camera.step(1);
    const Assurance said = camera.step(1.1);
    EXPECT_EQ(said.proved, doubt.empty()) << describe(said);
    EXPECT_NE(describe(said).find(doubt), std::string::npos) << describe(said);
    EXPECT_EQ(camera.step(1.2).proved, doubt.empty());
  }
}

TEST(DepthImage, ItsPlaceIsInDoubtOnceTheCamerasStaticFrameIsSentElsewhere) {
  const std::array<float, 8> plane{0.05f, 0.05f, 0.05f, 0.05f, 0.05f, 0.05f, 0.05f, 0.05f};
  Camera camera;
  camera.place(0, 0, "");
  camera.see(1, plane);
  camera.step(1);
  EXPECT_TRUE(camera.step(1.1).clear()) << describe(assuranceOf(camera.outcome));
  camera.place(0, 0, "");
  EXPECT_TRUE(camera.step(1.2).clear()) << "the same place once more";
  camera.place(0, 0.2, "");
  for (const double at : {1.3, 1.4}) {
    const Assurance said = camera.step(at);
    EXPECT_FALSE(said.proved) << at;
    EXPECT_NE(describe(said).find("where the camera's frame 'camera' was at the stamp of the newest cloud of body "
                                  "'seen' is not known until the next one"),
              std::string::npos)
        << describe(said);
  }
  camera.see(1.45, plane);
  EXPECT_TRUE(camera.step(1.5).clear()) << describe(assuranceOf(camera.outcome));
}

TEST(DepthImage, ACameraThatSeesNothingIsNoSurfaceAndNoAnswer) {
  Seen scene;
  scene.see(1, {0, 0, 0, 0, 0, 0, 0, 0});
  scene.see(1.05, {NO_DEPTH, NO_DEPTH, NO_DEPTH, NO_DEPTH, NO_DEPTH, NO_DEPTH, NO_DEPTH, NO_DEPTH});
  EXPECT_EQ(scene.pipeline.monitor().counters(1).of(StepStatus::BAD_MESSAGE), 1u);
  const std::string problem = scene.pipeline.takeProblem(1);
  EXPECT_NE(problem.find("no three of the 64 kept pixels"), std::string::npos) << problem;
  EXPECT_EQ(scene.feed(1.1, 0.3f).status, StepStatus::NO_BODY);
  scene.see(1.15, {0, 0, 0, 0, 0, 0, 0, 0});
  scene.feed(1.2, 0.3f);
  EXPECT_NEAR(scene.feed(1.3, -0.1f).earliest_toc, 0.75, 1e-6);
}

}  // namespace
}  // namespace test
}  // namespace dccd
