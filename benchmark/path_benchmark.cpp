// What an intended path costs a step, and what ~limits do: the panda beside a cloth of 600 vertices over a map of
// 50,000 voxels, on a path of 1 s in 20 pieces, far, along the cloth, down onto it, and in touch with it. On one
// thread, without a budget.
#include <CLI/CLI.hpp>
#include <cmath>
#include <ctime>
#include <fstream>
#include <iostream>

#include "dccd/approach_limits.h"
#include "dccd/intended.h"
#include "support/timing.h"
#include "unit/ros/robot/panda.h"
#include "unit/ros/robot/robot_texts.h"

namespace dccd {
namespace benchmarks {
namespace {

using test::Panda;

constexpr int ROWS = 20, COLS = 30, VOXELS = 224, PIECES = 20;
constexpr double SPACING_M = 0.02, VOXEL_M = 0.01;
constexpr SpeedLaw LAW{0.137, 0.3125, 0.025};
constexpr double LIMITS_MAX_M = 0.4, LIMITS_HORIZON_S = 0.3;

double processorMs() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

/// Of each run but the first.
template <class Run>
nlohmann::json timesOf(int runs, const Run& run) {
  std::vector<double> ms;
  for (int i = 0; i <= runs; ++i) {
    const double begin_ms = processorMs();
    run();
    if (i > 0) ms.push_back(processorMs() - begin_ms);
  }
  return spread(ms);
}

struct Scene {
  std::string name;
  double away_m, tips_m;           ///< of the robot; of its fingertips above the map
  double swing_rad_s, dive_rad_s;  ///< of the first joint; of the fourth, by which the hand goes down
};

std::vector<double> jointsAt(const Panda& panda, const Scene& scene, double time_s) {
  std::vector<double> joints(panda.joints());
  const std::vector<double> ready{scene.swing_rad_s * time_s, 0.35, 0, -2.2 + scene.dive_rad_s * time_s, 0, 2.55, 0.8};
  std::copy(ready.begin(), ready.end(), joints.begin());
  return joints;
}

Eigen::Isometry3d poseOf(const KDL::Frame& at) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 9; ++i) pose.linear()(i / 3, i % 3) = at.M.data[i];
  pose.translation() = Vec3(at.p.x(), at.p.y(), at.p.z());
  return pose;
}

std::shared_ptr<const VoxelSurface> mapOf() {
  std::vector<OccupiedLeaf> leaves;
  const auto key = [](int k) { return static_cast<std::uint16_t>(32768 + k - VOXELS / 2); };
  for (int x = 0; x < VOXELS; ++x)
    for (int y = 0; y < VOXELS; ++y) leaves.push_back({{key(x), key(y), 32767}, 1});
  return VoxelSurface::build(VOXEL_M, leaves);
}

Body clothOf() {
  Positions at;
  for (int row = 0; row < ROWS; ++row) {
    for (int col = 0; col < COLS; ++col) {
      const double u = SPACING_M * (row - ROWS / 2), v = SPACING_M * (col - COLS / 2);
      at.push_back(Vec3(u, v, 0.0015 + 0.001 * std::sin(20 * u) * std::cos(15 * v)));
    }
  }
  Body cloth;
  cloth.name = "cloth";
  cloth.against_obstacle = false;  // it lies there
  cloth.topology = share(Topology::grid(ROWS, COLS));
  cloth.t0 = cloth.t1 = share(at);
  return cloth;
}

nlohmann::json measure(const Panda& panda, const Scene& scene, int runs) {
  const Robot robot = test::robotFrom(panda.urdf(), panda.srdf());
  const auto placed = [&](double time_s) { return panda.place(jointsAt(panda, scene, time_s), 1).from_base; };
  const Vec3 hand = poseOf(placed(0).at("panda_hand")).translation();
  const Eigen::Isometry3d base(Eigen::Translation3d(-hand.x(), scene.away_m, scene.tips_m + 0.112 - hand.z()));
  Step step;
  step.bodies = {clothOf()};
  step.map.surface = mapOf();
  step.stamp_ns = 1;
  IntendedPath path;
  path.deviation_m = 0.005;
  path.deviation_rate_m_s = 0.01;
  std::vector<SpeedBound> bounds{{0.2}};
  std::vector<std::string> links;
  for (const RobotPart& part : robot.parts) {
    Body body;
    body.name = body.link = part.link;
    body.rigid = true;
    body.topology = part.mesh->topology;
    body.pose_t0 = body.pose_t1 = base * poseOf(placed(0).at(part.link));
    Positions at;
    for (const Vec3& p : part.mesh->positions) at.push_back(body.pose_t1 * p);
    body.t0 = body.t1 = share(at);
    body.against_obstacle = part.link != "panda_link0";
    const auto number = static_cast<std::uint16_t>(step.bodies.size());
    for (std::size_t other = 0; other < robot.parts.size(); ++other) {
      for (const auto& [a, b] : robot.never_meet) {
        const std::string& name = robot.parts[other].link;
        if ((a == part.link && b == name) || (b == part.link && a == name))
          body.not_against.push_back(static_cast<std::uint16_t>(other + 1));
      }
    }
    std::sort(body.not_against.begin(), body.not_against.end());
    step.bodies.push_back(std::move(body));
    bounds.push_back({2});
    path.bodies.push_back({number, {}});
    links.push_back(part.link);
  }
  const auto poses = [&](double time_s) {
    const auto at = placed(time_s);
    std::vector<Eigen::Isometry3d> all;
    for (const std::string& link : links) all.push_back(base * poseOf(at.at(link)));
    return all;
  };
  addPieces(poses, 1, 1e9, 0.2, 1e-3, PIECES, path);
  path.bend_m.assign(PIECES, 1e-3);
  Options options;
  options.clearance.wanted = true;
  options.num_threads = 1;
  History history;
  const Outcome outcome = detect(step, options, history);
  PathSearch search;
  ApproachSearch approach;
  AlongPath along;
  ApproachLimits limits;
  const nlohmann::json ms = timesOf(runs, [&] { along = search.run(outcome, options, bounds, LAW, path); });
  const nlohmann::json limits_ms =
      timesOf(runs, [&] { limits = approach.run(outcome, options, bounds, LIMITS_MAX_M, LIMITS_HORIZON_S); });
  if (!along.unused.empty()) throw std::runtime_error("the path is not used: " + along.unused);
  return {{"scene", scene.name},
          {"bodies", step.bodies.size()},
          {"ms", ms},
          {"limits_ms", limits_ms},
          {"half_spaces", limits.of.size()},
          {"unknown", limits.unknown},
          {"searches", along.searches},
          {"contact", static_cast<int>(along.contact)},
          {"until_s", along.until.seconds()},
          {"scale", along.scale.scale},
          {"until_by_bounds_s", safeUntil(outcome, bounds).seconds()},
          {"scale_by_bounds", speedScale(outcome, bounds, LAW).scale}};
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  std::string out, only;
  int runs = 200;
  CLI::App app("Times what an intended path of the panda adds to a step.");
  app.add_option("--out", out, "JSON file to write")->required();
  app.add_option("--runs", runs, "of each scene")->check(CLI::Range(1, 1000000));
  app.add_option("--only", only, "the scene whose name begins so");
  CLI11_PARSE(app, argc, argv);
  try {
    const dccd::test::Panda panda;
    nlohmann::json rows;
    std::cout << "| the arm | bodies | ms a step | questions | until, s | by bounds | scale | by bounds | ~limits, ms "
                 "| half-spaces |\n"
                 "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n";
    for (const dccd::benchmarks::Scene& scene :
         {dccd::benchmarks::Scene{"is 3 m away", 3, 0.05, 0.4, 0},
          dccd::benchmarks::Scene{"goes along at 50 mm", 0, 0.05, 0.4, 0},
          dccd::benchmarks::Scene{"goes down from 100 mm", 0, 0.1, 0.1, -0.4},
          dccd::benchmarks::Scene{"rises from the cloth", 0, 0.0025, 0.1, 0.3}}) {
      if (scene.name.compare(0, only.size(), only) != 0) continue;
      const nlohmann::json row = dccd::benchmarks::measure(panda, scene, runs);
      rows.push_back(row);
      std::cout << "| " << scene.name << " | " << row["bodies"] << " | " << row["ms"]["median"].get<double>() << " | "
                << row["searches"] << " | " << row["until_s"] << " | " << row["until_by_bounds_s"] << " | "
                << row["scale"] << " | " << row["scale_by_bounds"] << " | " << row["limits_ms"]["median"].get<double>()
                << " | " << row["half_spaces"] << " |\n";
      std::cerr << row.dump() << '\n';
    }
    std::ofstream(out) << nlohmann::json{{"machine", dccd::benchmarks::machine()}, {"rows", rows}}.dump(1) << '\n';
  } catch (const std::exception& e) {
    std::cerr << "path_benchmark: " << e.what() << '\n';
    return 1;
  }
  return 0;
}
