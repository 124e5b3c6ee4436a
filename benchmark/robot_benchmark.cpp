// What a robot costs beside a cloth: the panda and a cloth of 600 vertices on a map of 50,000 voxels, with and without
// the robot in turns, while it is far and while it is within 10 cm. And FCL through the same links, frame by frame: its
// time, and which steps it takes for free in which a link went through the cloth.
#include <fcl/fcl.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <fstream>
#include <iostream>

#include "support/timing.h"
#include "unit/ros/pipeline/driven_pipeline.h"
#include "unit/ros/robot/panda.h"
#include "unit/ros/robot/robot_texts.h"

namespace dccd {
namespace benchmarks {
namespace {

using test::Driven;
using test::Panda;

constexpr int ROWS = 20, COLS = 30, VOXELS = 224;  // each way
constexpr double SPACING_M = 0.02, VOXEL_M = 0.01;
constexpr double PERIOD_S = 0.02;

/// Of the process; the step has one thread.
double processorMs() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

/// Where the robot stands, how it moves, and how the cloth lies.
struct Scene {
  std::string name;
  double base_y_m = 0;
  double swing_rad = 0;  ///< of the first joint, to each side
  int period = 0;        ///< steps of a swing to and fro
  bool hangs = false;    ///< in the hand's way; else it lies on the map
};

std::vector<double> jointsAt(const Panda& panda, const Scene& scene, int frame) {
  std::vector<double> joints(panda.joints());
  const std::vector<double> ready{0, 0.35, 0, -2.2, 0, 2.55, 0.8};  // the fingers point down, 0.5 m before the base
  std::copy(ready.begin(), ready.end(), joints.begin());
  joints[0] = scene.swing_rad * std::sin(2 * M_PI * (frame + 0.5) / scene.period);  // in the middle between two frames
  return joints;
}

Positions clothAt(const Scene& scene, const Vec3& under, int frame) {
  Positions cloth;
  for (int row = 0; row < ROWS; ++row) {
    for (int col = 0; col < COLS; ++col) {
      const double u = SPACING_M * (row - ROWS / 2), v = SPACING_M * (col - COLS / 2);
      const double wave = 0.001 * std::sin(20 * u + 0.3 * frame) * std::cos(15 * v + 0.2 * frame);
      cloth.push_back(scene.hangs ? Vec3(under.x() + u, wave, under.z() + v)
                                  : Vec3(under.x() + u, under.y() + v, 0.0015 + wave));
    }
  }
  return cloth;
}

std::vector<std::uint8_t> bytesOf(const Positions& positions, double stamp_s) {
  sensor_msgs::PointCloud2 out;
  out.header.stamp = ros::Time(stamp_s);
  out.header.frame_id = "world";
  out.height = ROWS;
  out.width = COLS;
  for (const char* name : {"x", "y", "z"}) {
    sensor_msgs::PointField field;
    field.name = name;
    field.offset = static_cast<std::uint32_t>(8 * out.fields.size());
    field.datatype = sensor_msgs::PointField::FLOAT64;
    field.count = 1;
    out.fields.push_back(field);
  }
  out.point_step = sizeof(Vec3);
  out.row_step = COLS * out.point_step;
  out.data.resize(positions.size() * sizeof(Vec3));
  std::memcpy(out.data.data(), positions.data(), out.data.size());
  return test::bytesOf(out);
}

/// One layer of voxels below z = 0.
std::vector<std::uint8_t> mapBytes() {
  octomap::OcTree tree(VOXEL_M);
  for (int x = 0; x < VOXELS; ++x) {
    for (int y = 0; y < VOXELS; ++y)
      tree.updateNode(VOXEL_M * (x - 0.5 * VOXELS + 0.5), VOXEL_M * (y - 0.5 * VOXELS + 0.5), -0.5 * VOXEL_M, true);
  }
  octomap_msgs::Octomap out;
  out.header.stamp = ros::Time(1);
  out.header.frame_id = "world";
  out.binary = true;
  out.id = "OcTree";
  out.resolution = VOXEL_M;
  std::ostringstream stream;
  tree.writeBinaryData(stream);
  const std::string bytes = stream.str();
  out.data.assign(bytes.begin(), bytes.end());
  return test::bytesOf(out);
}

std::unique_ptr<Driven> monitorOf(const Panda* panda, const std::vector<std::uint8_t>& map) {
  XmlRpc::XmlRpcValue tree = test::scene();
  tree["octomap_topic"] = "/octomap";
  tree["topology"]["rows"] = ROWS;
  tree["topology"]["cols"] = COLS;
  tree["num_threads"] = 1;
  RobotLoader load;
  if (panda) {
    tree["robot"]["description"] = "robot_description";
    load = [panda](const RobotConfig& config, double tolerance_m) {
      return test::robotFrom(panda->urdf(), "", config, tolerance_m);
    };
  }
  auto driven = std::make_unique<Driven>(tree, load);
  driven->pipeline.setMap(decodeMapMessage(map, driven->config), 0);
  return driven;
}

/// The links as FCL has them, and the cloth, refitted for each frame.
class Fcl {
 public:
  Fcl(const Robot& robot, const Topology& cloth, const Positions& start) : cloth_(model(start, cloth)) {
    for (const RobotPart& part : robot.parts) {
      links_.push_back(
          {part.link, std::make_unique<fcl::CollisionObjectd>(model(part.mesh->positions, *part.mesh->topology))});
      manager_.registerObject(links_.back().second.get());
    }
    manager_.setup();
  }

  bool touches(const std::map<std::string, Eigen::Isometry3d>& poses, const Positions& cloth) {
    for (auto& [link, object] : links_) {
      object->setTransform(poses.at(link));
      object->computeAABB();
    }
    manager_.update();
    cloth_->beginReplaceModel();
    cloth_->replaceSubModel(cloth);
    cloth_->endReplaceModel(true);
    fcl::CollisionObjectd moved(cloth_);
    fcl::DefaultCollisionData<double> found;
    manager_.collide(&moved, &found, fcl::DefaultCollisionFunction);
    return found.result.isCollision();
  }

 private:
  using Model = fcl::BVHModel<fcl::OBBRSSd>;
  std::shared_ptr<Model> cloth_;
  std::vector<std::pair<std::string, std::unique_ptr<fcl::CollisionObjectd>>> links_;
  fcl::DynamicAABBTreeCollisionManagerd manager_;

  static std::shared_ptr<Model> model(const Positions& positions, const Topology& topology) {
    auto model = std::make_shared<Model>();
    std::vector<fcl::Triangle> triangles;
    for (const Face& face : topology.faces()) triangles.emplace_back(face[0], face[1], face[2]);
    model->beginModel();
    model->addSubModel(positions, triangles);
    model->endModel();
    return model;
  }
};

double nearest(const Positions& a, const Positions& b) {
  double least = 1e300;
  for (const Vec3& p : a) {
    for (const Vec3& q : b) least = std::min(least, (p - q).norm());
  }
  return least;
}

nlohmann::json measure(const Panda& panda, const Scene& scene, int steps) {
  const std::vector<std::uint8_t> map = mapBytes();
  const auto with = monitorOf(&panda, map), without = monitorOf(nullptr, map);
  const Robot& robot = with->config.robot;
  const KDL::Vector hand = panda.place(jointsAt(panda, {"", 0, 0, 1, false}, 0), 0).from_base.at("panda_hand").p;
  const Vec3 tips(hand.x(), hand.y(), hand.z() - 0.11);
  // The base is as high as it takes for the tips to be 5 cm above the map, or 2 cm below the upper side of the cloth.
  const Eigen::Isometry3d base(Eigen::Translation3d(-tips.x(), scene.base_y_m, (scene.hangs ? 0.6 : 0.05) - tips.z()));
  const Vec3 under(0, 0, scene.hangs ? 0.34 : 0);
  const Topology topology = Topology::grid(ROWS, COLS);
  Fcl fcl(robot, topology, clothAt(scene, under, 0));
  std::vector<double> with_ms, without_ms, more_ms, more_step_ms, fcl_ms;
  std::vector<bool> touched;  // per step
  std::size_t contacts = 0, missed = 0, far = 0;
  double least_m = 1e300;
  for (int frame = 0; frame <= steps; ++frame) {
    const double stamp_s = 1 + PERIOD_S * frame;
    Panda::Placed placed = panda.place(jointsAt(panda, scene, frame), stamp_s);
    geometry_msgs::TransformStamped& stand = placed.tf.transforms.emplace_back();
    stand.header.frame_id = "world";
    stand.header.stamp = ros::Time(stamp_s);
    stand.child_frame_id = "panda_link0";
    stand.transform.translation.x = base.translation().x();
    stand.transform.translation.y = base.translation().y();
    stand.transform.translation.z = base.translation().z();
    stand.transform.rotation.w = 1;
    with->feed_tf.add(placed.tf, false);
    const Positions cloth = clothAt(scene, under, frame);
    const std::vector<std::uint8_t> bytes = bytesOf(cloth, stamp_s);
    double ms[2];
    for (int turn = 0; turn < 2; ++turn) {
      const bool robots = (turn + frame) % 2 == 0;
      Driven& monitor = robots ? *with : *without;
      const double begin = processorMs();
      monitor.pipeline.take(0, {"sensor_msgs/PointCloud2", bytes, 0, 0});
      if (!monitor.pipeline.nextOutcome(0, monitor.outcome)) throw std::runtime_error("a frame has no answer");
      ms[robots] = processorMs() - begin;
    }
    if (frame == 0) continue;
    const Outcome& outcome = with->outcome;
    if (outcome.status != StepStatus::OK) throw std::runtime_error("a step is not answered: " + outcome.reason);
    bool meets = false;
    for (const Contact& contact : outcome.contacts) meets |= contact.body[1] != 0 && contact.body[1] != OBSTACLE_BODY;
    contacts += outcome.contacts.size();
    touched.push_back(meets);
    far += outcome.stats.bodies_far == robot.parts.size();
    if (!scene.hangs && frame % 10 == 0) {
      for (std::size_t b = 1; b < outcome.step->bodies.size(); ++b)
        least_m = std::min(least_m, nearest(cloth, *outcome.step->bodies[b].t1));
    }
    if (frame <= steps / 10) continue;  // warm-up
    with_ms.push_back(ms[1]);
    without_ms.push_back(ms[0]);
    more_ms.push_back(ms[1] - ms[0]);
    more_step_ms.push_back(outcome.stats.total_ms - without->outcome.stats.total_ms);
  }
  // After the monitors: its models would put theirs out of the caches.
  bool before = false;
  for (int frame = 0; frame <= steps; ++frame) {
    std::map<std::string, Eigen::Isometry3d> poses;
    for (const auto& [link, at] : panda.place(jointsAt(panda, scene, frame), 1).from_base) {
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      for (int i = 0; i < 9; ++i) pose.linear()(i / 3, i % 3) = at.M.data[i];
      pose.translation() = Vec3(at.p.x(), at.p.y(), at.p.z());
      poses[link] = base * pose;
    }
    const Positions cloth = clothAt(scene, under, frame);
    const double begin = processorMs();
    const bool now = fcl.touches(poses, cloth);
    const double this_fcl_ms = processorMs() - begin;
    const bool last = std::exchange(before, now);
    if (frame > 0) missed += touched[static_cast<std::size_t>(frame - 1)] && !now && !last;
    if (frame > steps / 10) fcl_ms.push_back(this_fcl_ms);
  }
  return {{"scene", scene.name},
          {"steps", steps},
          {"with_ms", spread(with_ms)},
          {"without_ms", spread(without_ms)},
          {"more_ms", spread(more_ms)},
          {"more_step_ms", spread(more_step_ms)},
          {"fcl_ms", spread(fcl_ms)},
          {"contacts", contacts},
          {"steps_in_contact", std::count(touched.begin(), touched.end(), true)},
          {"missed_by_fcl", missed},
          {"steps_all_far", far},
          {"nearest_m", scene.hangs ? 0 : least_m}};
}

std::string table(const nlohmann::json& rows) {
  std::ostringstream out;
  out.setf(std::ios::fixed);
  out.precision(3);
  out << "| the robot | without it, ms | more with it, ms | of that in the step, ms | FCL, ms | steps | in contact "
         "with links "
         "| of these free for FCL |\n|---|--:|--:|--:|--:|--:|--:|--:|\n";
  for (const nlohmann::json& row : rows) {
    out << "| " << row["scene"].get<std::string>() << " | " << row["without_ms"]["median"].get<double>() << " | "
        << row["more_ms"]["median"].get<double>() << " | " << row["more_step_ms"]["median"].get<double>() << " | "
        << row["fcl_ms"]["median"].get<double>() << " | " << row["steps"] << " | " << row["steps_in_contact"] << " | "
        << row["missed_by_fcl"] << " |\n";
  }
  return out.str();
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  std::string out;
  int steps = 1000;
  std::string only;
  CLI::App app("Times a robot beside a cloth, in turns with the cloth alone, and FCL through the same links.");
  app.add_option("--out", out, "JSON file to write")->required();
  app.add_option("--steps", steps, "of each scene")->check(CLI::Range(20, 1000000));
  app.add_option("--only", only, "the scene whose name begins so");
  CLI11_PARSE(app, argc, argv);
  try {
    const dccd::test::Panda panda;
    nlohmann::json rows;
    for (const dccd::benchmarks::Scene& scene :
         {dccd::benchmarks::Scene{"3 m away", 3, 0.03, 40, false},
          dccd::benchmarks::Scene{"within 10 cm", 0, 0.03, 40, false},
          dccd::benchmarks::Scene{"goes to and fro through a hanging cloth", 0, 0.6, 16, true}}) {
      if (scene.name.compare(0, only.size(), only) != 0) continue;
      rows.push_back(dccd::benchmarks::measure(panda, scene, steps));
      std::cerr << rows.back().dump() << '\n';
    }
    std::ofstream(out) << nlohmann::json{{"machine", dccd::benchmarks::machine()}, {"rows", rows}}.dump(1) << '\n';
    std::cout << dccd::benchmarks::table(rows);
  } catch (const std::exception& e) {
    std::cerr << "robot_benchmark: " << e.what() << '\n';
    return 1;
  }
  return 0;
}
