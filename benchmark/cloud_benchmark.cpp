// A sensor's clouds and pictures to the map's surface, from the bytes of the message, against octomap_server's loop
// with liboctomap, which ends at the octree: the same clouds, in turns, one thread.
#include <octomap/OcTree.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <ctime>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "base/cloud_map.h"
#include "base/next_surface.h"
#include "dccd/tolerances.h"
#include "support/seen_scene.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

constexpr std::size_t POINT_STEP = 32;  // bytes of a point with a colour, as PCL packs it
constexpr double RATE_HZ = 15;

/// [ms] Processor time of this thread, the only one: what else runs on the machine takes none of it.
double threadMs() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

/// A message's data, and where the sensor was.
struct Message {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::size_t width = 0;
  std::vector<std::uint8_t> bytes;
};

enum class Form : std::uint8_t { POINTS_IN_ROWS, POINTS, DEPTHS };

struct Case {
  std::string name;
  double required_ms = 0;
  CloudMapOptions options;
  Form form = Form::POINTS_IN_ROWS;
  Pinhole lens;
  std::vector<Message> messages;
};

Message messageOf(const Eigen::Isometry3d& pose, const std::vector<float>& values, std::size_t width, Form form) {
  Message message;
  message.pose = pose;
  message.width = width;
  const std::size_t take = form == Form::DEPTHS ? 1 : 3, step = form == Form::DEPTHS ? sizeof(float) : POINT_STEP;
  message.bytes.resize(values.size() / take * step);
  for (std::size_t i = 0; i < values.size() / take; ++i) {
    std::memcpy(&message.bytes[i * step], &values[i * take], take * sizeof(float));
  }
  return message;
}

std::vector<float> valuesOf(const Message& message, Form form) {
  const std::size_t take = form == Form::DEPTHS ? 1 : 3, step = form == Form::DEPTHS ? sizeof(float) : POINT_STEP;
  std::vector<float> values(message.bytes.size() / step * take);
  for (std::size_t i = 0; i * step < message.bytes.size(); ++i) {
    std::memcpy(&values[i * take], &message.bytes[i * step], take * sizeof(float));
  }
  return values;
}

/// A table below the camera with things on it, seen with noise, and with lost pixels beside edges.
std::vector<float> tablePicture(std::mt19937& random, const test::SeenScene& scene, const Eigen::Isometry3d& pose,
                                const Pinhole& lens, std::size_t width, std::size_t height) {
  std::vector<float> depths = scene.picture(pose, lens, width, height);
  std::normal_distribution<float> noise(0, 1);
  const std::vector<float> clean = depths;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    depths[i] += 0.0006f * clean[i] * clean[i] * noise(random);
    for (std::size_t back = 1; back <= 6 && back <= i % width; ++back) {
      if (clean[i] > clean[i - back] + 0.03f) depths[i] = std::numeric_limits<float>::quiet_NaN();
    }
  }
  return depths;
}

Case cameraCase(const std::string& name, double required_ms, double resolution_m, double away_m, std::size_t width,
                std::size_t height, double focal_px, double speed_mps, Form form, int frames) {
  std::mt19937 random(5);
  test::SeenScene scene;
  scene.room = Box{Vec3(-5, -5, 0.003), Vec3(5, 5, 5)};
  std::uniform_real_distribution<double> unit(0, 1);
  for (int i = 0; i < 12; ++i) {
    const double x = away_m * (unit(random) - 0.5), y = away_m * (unit(random) - 0.5), z = away_m * 0.2 * unit(random);
    scene.things.push_back(Box{Vec3(x, y, 0), Vec3(x + 0.1 * away_m, y + 0.07 * away_m, z)});
  }
  Case c;
  c.name = name;
  c.required_ms = required_ms;
  c.options.resolution_m = resolution_m;
  c.options.max_range_m = 2 * away_m;
  c.options.min_range_m = 0.01;
  c.form = form;
  c.lens = Pinhole{focal_px, focal_px, 0.5 * double(width) + 1.3, 0.5 * double(height) - 2.1};
  for (int frame = 0; frame < frames; ++frame) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() =
        (Eigen::AngleAxisd(0.3, Vec3::UnitZ()) * Eigen::AngleAxisd(M_PI - 0.35, Vec3::UnitX())).toRotationMatrix();
    pose.translation() = Vec3(0.01 + speed_mps * frame / RATE_HZ, -0.3 * away_m, away_m);
    const std::vector<float> depths = tablePicture(random, scene, pose, c.lens, width, height);
    const std::vector<float> xyz = test::pointsOf(depths, c.lens, width);
    const std::vector<float> values = form == Form::DEPTHS   ? depths
                                      : form == Form::POINTS ? test::withoutLost(xyz)
                                                             : xyz;
    c.messages.push_back(messageOf(pose, values, form == Form::POINTS ? values.size() / 3 : width, form));
  }
  return c;
}

/// 64 rings of 2,048 points.
Case lidarCase(int frames) {
  std::mt19937 random(6);
  const test::SeenScene scene = test::SeenScene::make(random, Vec3(9.9, 9.8, 2.9), 15);
  Case c;
  c.name = "lidar, 131,072 points, 5 cm, within a box of 10 x 10 x 3 m";
  c.required_ms = 40;
  c.options.resolution_m = 0.05;
  c.options.box = Box{Vec3(-5, -5, -1.5), Vec3(5, 5, 1.5)};
  c.form = Form::POINTS;
  std::normal_distribution<double> noise(0, 0.005);
  for (int frame = 0; frame < frames; ++frame) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = Vec3(0.02 * frame, 0.31, -0.4);
    std::vector<float> xyz;
    for (int ring = 0; ring < 64; ++ring) {
      for (int column = 0; column < 2048; ++column) {
        const double up = 0.58 * (ring / 63.0 - 0.5), around = 2 * M_PI * column / 2048;
        const Vec3 way(std::cos(around) * std::cos(up), std::sin(around) * std::cos(up), std::sin(up));
        const Vec3 p = way * (scene.depth(pose.translation(), way) + noise(random));
        for (int axis = 0; axis < 3; ++axis) xyz.push_back(static_cast<float>(p[axis]));
      }
    }
    c.messages.push_back(messageOf(pose, xyz, xyz.size() / 3, Form::POINTS));
  }
  return c;
}

void setModel(octomap::OcTree& tree) {
  tree.setProbHit(tolerance::MAP_HIT);
  tree.setProbMiss(tolerance::MAP_MISS);
  tree.setClampingThresMin(tolerance::MAP_LEAST);
  tree.setClampingThresMax(tolerance::MAP_MOST);
}

/// OctomapServer::insertScan() for the points that are no ground, with its defaults.
void serve(octomap::OcTree& tree, const Case& c, const Message& message) {
  std::vector<float> values = valuesOf(message, c.form);
  if (c.form == Form::DEPTHS) values = test::pointsOf(values, c.lens, message.width);
  const Eigen::Isometry3f pose = message.pose.cast<float>();
  const auto pointOf = [](const Eigen::Vector3f& p) { return octomap::point3d(p.x(), p.y(), p.z()); };
  const octomap::point3d origin = pointOf(pose.translation());
  octomap::KeySet free, occupied;
  octomap::KeyRay ray;
  const double range_m = c.options.max_range_m > 0 ? c.options.max_range_m : -1;
  for (std::size_t i = 0; i < values.size(); i += 3) {
    const Eigen::Vector3f p = pose * Eigen::Vector3f(values[i], values[i + 1], values[i + 2]);
    if (!p.allFinite()) continue;
    const octomap::point3d point = pointOf(p);
    if (range_m < 0 || (point - origin).norm() <= range_m) {
      if (tree.computeRayKeys(origin, point, ray)) free.insert(ray.begin(), ray.end());
      octomap::OcTreeKey key;
      if (tree.coordToKeyChecked(point, key)) occupied.insert(key);
    } else if (tree.computeRayKeys(origin, origin + (point - origin).normalized() * float(range_m), ray)) {
      free.insert(ray.begin(), ray.end());
    }
  }
  for (const octomap::OcTreeKey& key : free) {
    if (occupied.find(key) == occupied.end()) tree.updateNode(key, false);
  }
  for (const octomap::OcTreeKey& key : occupied) tree.updateNode(key, true);
  tree.prune();
}

/// The message's bytes to the surface after them.
std::shared_ptr<const VoxelSurface> see(CloudMap& map, const Case& c, const Message& message,
                                        const std::shared_ptr<const VoxelSurface>& before) {
  const std::vector<float> values = valuesOf(message, c.form);
  const SensorView view = c.form == Form::DEPTHS ? test::viewOf(message.pose, values, c.lens, message.width)
                                                 : test::viewOf(message.pose, values, message.width);
  if (map.insert(view, std::size_t{8} << 30).is_picture != (c.form != Form::POINTS)) {
    throw std::runtime_error(c.name + ": no picture");
  }
  OctomapLimits limits;
  limits.free_leaves = false;
  DecodedOctomap leaves = map.leaves(limits);
  return before ? nextSurface(leaves.resolution_m, std::move(leaves.occupied), *before)
                : VoxelSurface::build(leaves.resolution_m, std::move(leaves.occupied));
}

/// Means over the second half of the messages, when the map knows the scene; of each run.
nlohmann::json measure(const Case& c, int repeat, int repeat_server) {
  const std::size_t first = c.messages.size() / 2;
  std::vector<double> ours, servers, ratios;
  std::size_t voxels = 0;
  for (int run = 0; run < std::max(repeat, repeat_server); ++run) {
    if (run < repeat) {
      CloudMap map(c.options);
      std::shared_ptr<const VoxelSurface> surface;
      double ms = 0;
      for (std::size_t i = 0; i < c.messages.size(); ++i) {
        const double start = threadMs();
        surface = see(map, c, c.messages[i], surface);
        if (i >= first) ms += threadMs() - start;
      }
      voxels = surface->leafCount();
      ours.push_back(ms / double(c.messages.size() - first));
    }
    if (run < repeat_server) {
      octomap::OcTree tree(c.options.resolution_m);
      setModel(tree);
      double ms = 0;
      for (std::size_t i = 0; i < c.messages.size(); ++i) {
        const double start = threadMs();
        serve(tree, c, c.messages[i]);
        if (i >= first) ms += threadMs() - start;
      }
      servers.push_back(ms / double(c.messages.size() - first));
    }
    if (run < std::min(repeat, repeat_server)) ratios.push_back(servers.back() / ours.back());
  }
  nlohmann::json row{{"case", c.name}, {"required_ms", c.required_ms}, {"voxels", voxels}, {"ms", spread(ours)}};
  if (!servers.empty()) {
    row["server_ms"] = spread(servers);
    row["ratio"] = quartiles(ratios);
  }
  return row;
}

nlohmann::json measureAll(const std::string& only, int repeat, int repeat_server) {
  nlohmann::json out{{"machine", machine()}};
  const auto row = [&](const std::string& name, const auto& make) {
    if (name.find(only) == std::string::npos) return;
    out["runs"].push_back(measure(make(), repeat, repeat_server));
    std::cerr << out["runs"].back().dump() << '\n';
  };
  const auto camera = [&](const std::string& name, double required_ms, double speed_mps, Form form) {
    row(name, [&] { return cameraCase(name, required_ms, 0.02, 1.5, 640, 480, 525, speed_mps, form, 16); });
  };
  camera("640 x 480 points in rows, 2 cm, 1.5 m away, still", 16, 0, Form::POINTS_IN_ROWS);
  camera("the same, moving at 0.3 m/s", 25, 0.3, Form::POINTS_IN_ROWS);
  camera("640 x 480 depths, 2 cm, 1.5 m away, still", 16, 0, Form::DEPTHS);
  camera("640 x 480 depths, moving at 0.3 m/s", 25, 0.3, Form::DEPTHS);
  camera("640 x 480 without lost points, still", 25, 0, Form::POINTS);
  camera("640 x 480 without lost points, moving at 0.3 m/s", 25, 0.3, Form::POINTS);
  const std::string fine = "848 x 480 points in rows, 5 mm, 1 m away, moving at 0.3 m/s";
  row(fine, [&] { return cameraCase(fine, 80, 0.005, 1, 848, 480, 425, 0.3, Form::POINTS_IN_ROWS, 16); });
  row("lidar", [&] { return lidarCase(16); });
  return out;
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  std::string out, only;
  int repeat = 10, repeat_server = 2;
  CLI::App app("Times a sensor's clouds and pictures on their way to the map's surface.");
  app.add_option("--out", out, "JSON file to write")->required();
  app.add_option("--only", only, "rows with this in their name");
  app.add_option("--repeat", repeat, "runs of each row")->check(CLI::PositiveNumber);
  app.add_option("--repeat-server", repeat_server, "runs of octomap_server's loop")->check(CLI::NonNegativeNumber);
  CLI11_PARSE(app, argc, argv);
  try {
    std::ofstream(out) << dccd::benchmarks::measureAll(only, repeat, repeat_server).dump(1) << '\n';
  } catch (const std::exception& e) {
    std::cerr << "cloud_benchmark: " << e.what() << '\n';
    return 1;
  }
  return 0;
}
