// A monitor beside an emulated octomap_server, a process of its own that integrates a camera's clouds at 5 Hz: it comes
// late, is killed, comes back without what it knew, is slow, and loses the camera's tf. What is missing stands in
// ~state, and is there again afterwards; what the map shows of the sheet is the sheet's own throughout.
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <limits>

#include <spawn.h>
#include <sys/wait.h>

#include "base/cloud_map.h"
#include "ros/support/live_tests.h"
#include "ros/support/missing.h"
#include "ros/support/rate.h"

namespace dccd {
namespace test {
namespace {

constexpr double RESOLUTION_M = 0.1;

/// octomap_server as it is with its defaults: a cloud that tf does not place at its stamp is dropped, each other one is
/// followed by the map of all so far, with the cloud's stamp. `slow_s`: so much later.
int serve(int argc, char** argv, double slow_s) {
  ros::init(argc, argv, "emulated_octomap_server");
  ros::NodeHandle node;
  const ros::Publisher maps = node.advertise<octomap_msgs::Octomap>("/served/octomap_full", 1, true);
  CloudMapOptions options;
  options.resolution_m = RESOLUTION_M;
  CloudMap map(options);
  geometry_msgs::TransformStamped camera;
  std::deque<octomap_msgs::Octomap> to_send;
  const auto tf = node.subscribe<tf2_msgs::TFMessage>(
      "/tf", 10, [&](const tf2_msgs::TFMessageConstPtr& message) { camera = message->transforms.at(0); });
  const auto clouds =
      node.subscribe<sensor_msgs::PointCloud2>("/served/points", 1, [&](const sensor_msgs::PointCloud2ConstPtr& cloud) {
        if ((cloud->header.stamp - camera.header.stamp).toSec() > 0.1) return;
        const auto& at = camera.transform.translation;
        SensorView view;
        view.map_from_sensor.translation() = Vec3(at.x, at.y, at.z);
        view.width = cloud->width * cloud->height;
        std::vector<float> xyz(3 * view.width);
        for (std::size_t i = 0; i < view.width; ++i) {
          std::memcpy(&xyz[3 * i], &cloud->data[i * cloud->point_step], 3 * sizeof(float));
        }
        view.xyz = xyz.data();
        map.insert(view, std::numeric_limits<std::size_t>::max());
        octomap_msgs::Octomap message;
        message.header = cloud->header;
        message.header.frame_id = "world";
        message.id = "OcTree";
        message.resolution = RESOLUTION_M;
        message.data = map.serialized(false);
        to_send.push_back(std::move(message));
      });
  for (ros::WallRate rate(100); ros::ok(); rate.sleep()) {
    ros::spinOnce();
    for (; !to_send.empty() && (ros::Time::now() - to_send.front().header.stamp).toSec() >= slow_s; to_send.pop_front())
      maps.publish(to_send.front());
  }
  return 0;
}

/// A process that is killed when it goes.
class Server {
 public:
  explicit Server(const std::string& slow_s = "0") {
    std::string program = "/proc/self/exe", what = "--serve", words = slow_s;
    char* const arguments[] = {program.data(), what.data(), words.data(), nullptr};
    EXPECT_EQ(posix_spawn(&process_, program.c_str(), nullptr, nullptr, arguments, environ), 0);
  }
  ~Server() {
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }

 private:
  pid_t process_ = -1;
};

struct Served : StateTest {
  Served() : StateTest("/served") {}

  /// The camera is 1 m below the world's origin and looks up: at the sheet in z = 0.05, which sinks and rises by 3 cm
  /// with the seconds, and beside it at a plate in z = 0.85.
  static double sheetHeight(double now_s) { return 0.05 + 0.03 * std::sin(2 * now_s); }
  static sensor_msgs::PointCloud2 seen(bool with_sheet) {
    const double now_s = ros::Time::now().toSec();
    Positions points;
    for (int i = 0; i < 400; ++i) {
      points.emplace_back(0.05 + 0.1 * (i % 20), 0.05 + 0.1 * (i / 20), 1.85);
      if (with_sheet) points.emplace_back(0.05 + 0.015 * (i % 20), 0.05 + 0.015 * (i / 20), 1 + sheetHeight(now_s));
    }
    return cloud(points, now_s, "camera");
  }
  bool ownsTheSheet() {
    return waitUntil(
        [&] {
          const deformable_ccd::State last = state.last();
          return last.proved && last.clear && !last.excluded.empty() &&
                 last.excluded[0].find("as own of body 'mesh'") != std::string::npos;
        },
        15);
  }
};

TEST_F(Served, SaysWhatOfTheServersMapIsMissing) {
  const auto mesh = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/served/mesh");
  const ros::Publisher tf = advertiseAndWait<tf2_msgs::TFMessage>(node, "/tf");
  const ros::Publisher points = node.advertise<sensor_msgs::PointCloud2>("/served/points", 1);
  std::atomic<bool> tf_comes{true}, sees_sheet{false};
  std::atomic<double> above_m{0.5};  // of where it will be seen, which the camera sees free before
  const Rate transforms(50, [&] {
    if (tf_comes) tf.publish(transformAt(ros::Time::now().toSec(), "camera", {0, 0, -1}));
  });
  const Rate sheet(30, [&] {
    const double now_s = ros::Time::now().toSec();
    mesh.publish(meshStamped(sheetAt(sheetHeight(now_s) + above_m, 4, 4), now_s));
  });
  const Rate camera(5, [&] { points.publish(seen(sees_sheet)); });
  EXPECT_TRUE(misses("no octomap has been received yet")) << "the map is late: " << state.last().reason;

  auto server = std::make_unique<Server>();
  EXPECT_TRUE(becomesProved()) << state.last().reason;
  for (int k = 49; k >= 0; --k) {
    above_m = 0.01 * k;
    ros::Duration(0.03).sleep();
  }
  sees_sheet = true;
  EXPECT_TRUE(ownsTheSheet()) << state.last().reason;

  server.reset();
  EXPECT_TRUE(misses("older than octomap_timeout_s")) << "killed: " << state.last().reason;
  server = std::make_unique<Server>();
  EXPECT_TRUE(ownsTheSheet()) << "restarted, without what it knew: " << state.last().reason;

  tf_comes = false;
  EXPECT_TRUE(misses("older than octomap_timeout_s")) << "no tf of the camera: " << state.last().reason;
  tf_comes = true;
  EXPECT_TRUE(ownsTheSheet()) << "tf is back: " << state.last().reason;

  server.reset();
  server = std::make_unique<Server>("0.4");
  EXPECT_TRUE(waitUntil([&] { return state.last().proved && state.last().map_age > 0.35; }, 15)) << "slow";
  EXPECT_TRUE(ownsTheSheet()) << "each map comes 0.4 s late: " << state.last().reason;
  server.reset();
  server = std::make_unique<Server>("1.5");
  EXPECT_TRUE(misses("older than octomap_timeout_s")) << state.last().reason;
  ros::Duration(3).sleep();
  EXPECT_TRUE(misses("older than octomap_timeout_s")) << "later than is allowed: " << state.last().reason;
  EXPECT_EQ(stats.last().maps_refused, 0u);
  for (const deformable_ccd::State& said : state.all()) {
    EXPECT_EQ(said.touching, deformable_ccd::State::NONE) << said.reason;
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) {
  if (argc == 3 && std::string(argv[1]) == "--serve") return dccd::test::serve(argc, argv, std::atof(argv[2]));
  return dccd::test::runLiveTests(argc, argv, "octomap_server_test");
}
