// A cell as a first user has it, in one process beside the node: an arm whose joints come at 100 Hz, a cloth in its
// hand at 30 Hz, a depth camera above a table. What the camera sees is rendered before the first message. It listens to
// what the monitor says of it, and writes down what that cost.
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <tf2_msgs/TFMessage.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <functional>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "cell/cell_camera.h"
#include "cell/cell_witness.h"
#include "cell/cell_world.h"

namespace dccd {
namespace benchmarks {
namespace {

/// What comes again and again: its numbers' stamps, and how much later than those it is sent.
struct Stream {
  double rate_hz, lag_s, first_s;
  std::function<void(std::size_t number, double time_s)> send;
  std::size_t number = 0;
  double stampS() const { return first_s + static_cast<double>(number) / rate_hz; }
  double dueS() const { return stampS() + lag_s; }
};

int run(const Settings& settings) {
  std::ifstream file(settings.urdf);
  if (!file) throw std::runtime_error(settings.urdf + " is not there");
  const Arm arm({std::istreambuf_iterator<char>(file), {}});
  ros::NodeHandle node;
  const ros::Publisher tf_static = node.advertise<tf2_msgs::TFMessage>("/tf_static", 1, true);
  const ros::Publisher joint_states = node.advertise<sensor_msgs::JointState>("/joint_states", 10);
  const ros::Publisher cloths = node.advertise<sensor_msgs::PointCloud2>("/tracker/cloth", 10);
  Camera camera(node, settings, arm);
  tf2_msgs::TFMessage places;
  places.transforms = {transformOf("world", "base_link", Pose::Identity()),
                       transformOf("world", CAMERA_FRAME, cameraPose())};
  tf_static.publish(places);
  Witness witness(node, settings);
  ros::AsyncSpinner spinner(1);
  spinner.start();
  ros::WallDuration(1).sleep();  // until all have found each other

  const ros::Time begin = ros::Time::now() + ros::Duration(0.1);
  sensor_msgs::JointState joints;
  joints.name.assign(NAMES.begin(), NAMES.end());
  sensor_msgs::PointCloud2 cloth = cloudOf(ROWS, COLS, sensor_msgs::PointField::FLOAT64, sizeof(Vec3));
  cloth.header.frame_id = "world";
  cloth.is_dense = true;
  bool measures = false;
  std::size_t cloths_sent = 0, pictures_sent = 0;
  std::vector<Stream> streams{
      {JOINT_HZ, 0, 0,
       [&](std::size_t, double time_s) {
         joints.header.stamp = begin + ros::Duration(time_s);
         const auto now = jointsAt(time_s);
         joints.position.assign(now.begin(), now.end());
         joint_states.publish(joints);
       }},
      {CLOTH_HZ, TRACKER_LAG_S, CLOTH_S,
       [&](std::size_t, double time_s) {
         cloth.header.stamp = begin + ros::Duration(time_s);
         const Positions now = clothAt(arm.linksAt(time_s).at("tool0"), time_s);
         std::memcpy(cloth.data.data(), now.data(), cloth.data.size());
         cloths.publish(cloth);
         cloths_sent += measures;
       }},
      {settings.camera_hz, DRIVER_LAG_S, Film::stampOf(settings, 0), [&](std::size_t number, double time_s) {
         camera.publish(number, begin + ros::Duration(time_s));
         pictures_sent += measures;
       }}};
  double latest_s = 0;  // by which a message was sent late
  while (ros::ok()) {
    Stream& next = *std::min_element(streams.begin(), streams.end(),
                                     [](const Stream& a, const Stream& b) { return a.dueS() < b.dueS(); });
    if (!measures && next.dueS() >= settings.start_s) {
      measures = true;
      witness.begin();
    }
    if (next.dueS() >= settings.start_s + settings.seconds) break;
    const ros::Time due = begin + ros::Duration(next.dueS());
    if (!ros::Time::sleepUntil(due)) break;
    if (measures) latest_s = std::max(latest_s, (ros::Time::now() - due).toSec());
    next.send(next.number, next.stampS());
    ++next.number;
  }
  json out{{"camera_hz", settings.camera_hz}, {"noise_m", settings.noise_m}, {"flying_share", settings.flying_share}};
  witness.end(out);
  out["cloths_sent"] = cloths_sent;
  out["pictures_sent"] = pictures_sent;
  out["sent_late_s"] = latest_s;
  std::ofstream(settings.out) << out;
  return 0;
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  ros::init(argc, argv, "cell");
  dccd::benchmarks::Settings settings;
  CLI::App app("A cell with an arm, a cloth in its hand and a depth camera, live");
  app.add_option("--urdf", settings.urdf)->required();
  app.add_option("--out", settings.out, "JSON file")->required();
  app.add_option("--monitor", settings.monitor, "its name")->required();
  app.add_option("--process", settings.processes, "NAME=PID, whose share of a core is measured");
  app.add_option("--camera-hz", settings.camera_hz);
  app.add_option("--noise-m", settings.noise_m, "standard deviation of a depth");
  app.add_option("--lost-share", settings.lost_share, "of the pixels");
  app.add_option("--flying-share", settings.flying_share, "of the pixels, along edges");
  app.add_option("--start-s", settings.start_s, "before it measures");
  app.add_option("--seconds", settings.seconds);
  app.add_option("--stride", settings.stride, "of clouds: every so many pixels of every so many rows")
      ->check(CLI::Range(1, 16));
  app.add_flag("--clouds", settings.clouds, "publish organised clouds");
  app.add_flag("--images", settings.images, "publish depth images");
  CLI11_PARSE(app, argc, argv);
  try {
    return dccd::benchmarks::run(settings);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cell_publisher: %s\n", error.what());
    return 1;
  }
}
