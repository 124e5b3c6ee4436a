// What effects cost that a scene does not call for, what patches cost, and what a rope costs: the flag in the wind with
// every effect `auto` against only self-collision, and a rope of 500 points against itself and a map of 50,000 voxels.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>

#include "base/effect_plan.h"
#include "dccd/stream.h"
#include "scenes/physics/scene_file.h"
#include "scenes/physics/simulation.h"
#include "support/data.h"
#include "support/detector.h"
#include "support/scene_data.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

struct Recorded {
  std::shared_ptr<const Topology> topology;
  std::vector<Positions> frames;
  std::shared_ptr<const VoxelSurface> map;
  StampNs period_ns = 0;
};

/// Voxels whose centres lie in the box.
std::vector<OccupiedLeaf> leavesIn(const Box& box, double resolution_m) {
  std::vector<OccupiedLeaf> leaves;
  int low[3], high[3];
  for (int axis = 0; axis < 3; ++axis) {
    low[axis] = static_cast<int>(std::ceil(box.min[axis] / resolution_m - 0.5));
    high[axis] = static_cast<int>(std::floor(box.max[axis] / resolution_m - 0.5));
  }
  for (int x = low[0]; x <= high[0]; ++x) {
    for (int y = low[1]; y <= high[1]; ++y) {
      for (int z = low[2]; z <= high[2]; ++z) {
        leaves.push_back({{static_cast<std::uint16_t>(x + 32768), static_cast<std::uint16_t>(y + 32768),
                           static_cast<std::uint16_t>(z + 32768)},
                          1});
      }
    }
  }
  return leaves;
}

Recorded record(const std::string& scene_file) {
  const scene::SceneSpec spec = scene::readSceneFile(scene_file);
  Recorded out;
  const scene::Shape& shape = spec.bodies.at(0).shape;
  out.topology = std::make_shared<const Topology>(
      Topology::grid(static_cast<std::size_t>(shape.rows), static_cast<std::size_t>(shape.cols)));
  out.period_ns = std::llround(1e9 / spec.frame_rate_hz);
  scene::Simulation simulation(spec, 1);
  for (int i = 0; i < spec.frames; ++i) {
    out.frames.push_back(simulation.positions(0));
    simulation.step();
  }
  std::vector<OccupiedLeaf> leaves;
  for (const scene::Solid& solid : spec.obstacle.value().solids) {
    const auto more = leavesIn(solid.box, spec.obstacle->resolution_m);
    leaves.insert(leaves.end(), more.begin(), more.end());
  }
  out.map = VoxelSurface::build(spec.obstacle->resolution_m, std::move(leaves));
  return out;
}

/// A monitor as the plan of these settings makes it.
std::unique_ptr<Monitor> monitorFor(const Recorded& scene, const EffectSettings& settings) {
  EffectScene described;
  described.bodies.resize(1);
  described.bodies[0].name = "flag";
  described.bodies[0].topology = scene.topology;
  described.map_source = "the map";
  described.map_seen = described.map_used = true;
  const EffectPlan plan(described, settings);
  MonitorOptions options;
  options.store.max_vertex_step_m = 0;
  options.detector.obstacle_expected = plan.running(Effect::OCTOMAP);
  options.detector.check_start_state = plan.running(Effect::START_STATE);
  options.detector.patches = plan.running(Effect::PATCHES);
  Body body;
  body.name = "flag";
  body.self_collision = plan.running(Effect::SELF_COLLISION);
  body.against_obstacle = plan.running(Effect::OCTOMAP);
  auto monitor = std::make_unique<Monitor>(options, std::vector<Body>{body});
  if (plan.running(Effect::OCTOMAP)) monitor->setMap({scene.map, 1, Eigen::Isometry3d::Identity(), {}});
  return monitor;
}

struct Run {
  double ms = 0, patches_ms = 0;
  std::size_t contacts = 0, steps = 0;
};

void feed(Monitor& monitor, const Recorded& scene, std::size_t k, Run& run) {
  MeshFrame frame;
  frame.stamp_ns = static_cast<StampNs>(k + 1) * scene.period_ns;
  frame.topology = scene.topology;
  frame.positions = scene.frames[k];
  Outcome outcome;
  const Stopwatch watch;
  monitor.push(0, std::move(frame), 0);
  monitor.next(0, outcome);
  run.ms += watch.milliseconds();
  run.contacts += outcome.total_contacts;
  run.patches_ms += outcome.stats[Effect::PATCHES].ms;
  run.steps += outcome.answered;
}

/// Median of the rounds' ratios, and the interval that holds the true median with 95 % (order statistics).
nlohmann::json medianWithInterval(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const double n = static_cast<double>(values.size());
  const double reach = 0.5 * 1.96 * std::sqrt(n);
  const auto at = [&](double place) {
    return values[static_cast<std::size_t>(std::clamp(std::round(place), 0.0, n - 1))];
  };
  return {{"median", at((n - 1) / 2)},
          {"low", at((n - 1) / 2 - reach)},
          {"high", at((n - 1) / 2 + reach)},
          {"rounds", values.size()}};
}

nlohmann::json measureFlag(const std::string& scene_file, int rounds) {
  const Recorded scene = record(scene_file);
  const EffectSettings only_self = {{Effect::OCTOMAP, EffectSetting::OFF},
                                    {Effect::START_STATE, EffectSetting::OFF},
                                    {Effect::PATCHES, EffectSetting::OFF}};
  std::vector<double> ratios, auto_ms, self_ms;
  for (int r = 0; r < rounds + 1; ++r) {
    const auto everything = monitorFor(scene, {}), self = monitorFor(scene, only_self);
    Run with, without;
    for (std::size_t k = 0; k < scene.frames.size(); ++k) {
      // By turns, so that neither always finds the caches that the other left.
      const bool first = (k + static_cast<std::size_t>(r)) % 2 == 0;
      if (first) feed(*everything, scene, k, with);
      feed(*self, scene, k, without);
      if (!first) feed(*everything, scene, k, with);
    }
    if (with.contacts + without.contacts > 0) throw std::runtime_error("the flag touches something");
    if (with.steps + 1 != scene.frames.size()) throw std::runtime_error("a step was not answered");
    if (r == 0) continue;  // warm-up
    ratios.push_back(with.ms / without.ms);
    auto_ms.push_back(with.ms / static_cast<double>(with.steps));
    self_ms.push_back(without.ms / static_cast<double>(without.steps));
  }
  return {{"ratio", medianWithInterval(ratios)}, {"auto_ms", spread(auto_ms)},
          {"self_only_ms", spread(self_ms)},     {"vertices", scene.topology->vertexCount()},
          {"voxels", scene.map->leafCount()},    {"required_ratio", 1.05}};
}

/// What patches and their identities add to the steps of a scene: the same frames with and without, by turns.
nlohmann::json measurePatchesOfScene(const std::string& scene_file, int rounds) {
  const Recorded scene = record(scene_file);
  std::vector<double> ratios, on_ms, off_ms, effect_ms;
  for (int r = 0; r < rounds + 1; ++r) {
    const auto with = monitorFor(scene, {}), without = monitorFor(scene, {{Effect::PATCHES, EffectSetting::OFF}});
    Run on, off;
    for (std::size_t k = 0; k < scene.frames.size(); ++k) {
      const bool first = (k + static_cast<std::size_t>(r)) % 2 == 0;
      if (first) feed(*with, scene, k, on);
      feed(*without, scene, k, off);
      if (!first) feed(*with, scene, k, on);
    }
    if (on.contacts == 0 || on.contacts != off.contacts) throw std::runtime_error("the scene's contacts are not there");
    if (r == 0) continue;  // warm-up
    ratios.push_back(on.ms / off.ms);
    on_ms.push_back(on.ms / static_cast<double>(on.steps));
    off_ms.push_back(off.ms / static_cast<double>(off.steps));
    effect_ms.push_back(on.patches_ms / static_cast<double>(on.steps));
  }
  return {{"ratio", medianWithInterval(ratios)},
          {"on_ms", spread(on_ms)},
          {"off_ms", spread(off_ms)},
          {"effect_ms", spread(effect_ms)},
          {"required_ratio", 1.06}};
}

/// The same for the one step of a real scene.
nlohmann::json measurePatchesOfStep(const std::string& name, int rounds) {
  const test::SceneData data = test::readScene(name);
  Positions t0, t1;
  for (const VertexMotion& v : data.vertices) {
    t0.emplace_back(v.t0[0], v.t0[1], v.t0[2]);
    t1.emplace_back(v.t1[0], v.t1[1], v.t1[2]);
  }
  Body body;
  body.name = "mesh";
  body.topology = share(Topology::fromTriangles(t0.size(), data.faces));
  const dccd::Step step = test::stepOf(body, t0, t1);
  Options options;
  options.num_threads = 2;
  options.keep_bounds = false;
  test::Detector off(options);
  options.patches = true;
  test::Detector on(options);
  std::vector<double> differences, off_ms, effect_ms;
  std::size_t contacts = 0, patches = 0;
  for (int r = 0; r < rounds + 1; ++r) {
    double ms[2] = {0, 0};
    for (int k = 0; k < 2; ++k) {
      const bool with = (k + r) % 2 == 0;
      test::Detector& detector = with ? on : off;
      detector.history().clear();
      const Stopwatch watch;
      const Outcome outcome = detector.run(step);
      ms[with] = watch.milliseconds();
      if (!with) continue;
      contacts = outcome.contacts.size();
      patches = outcome.patches.size();
      if (r > 0) effect_ms.push_back(outcome.stats[Effect::PATCHES].ms);
    }
    if (r == 0) continue;  // warm-up
    differences.push_back(ms[1] - ms[0]);
    off_ms.push_back(ms[0]);
  }
  return {{"difference_ms", medianWithInterval(differences)},
          {"off_ms", spread(off_ms)},
          {"effect_ms", spread(effect_ms)},
          {"contacts", contacts},
          {"patches", patches},
          {"threads", 2},
          {"required_ms", 5}};
}

/// A rope in a figure of eight over an uneven floor, dragged a little in each step; it lies on itself where it crosses.
Positions ropeAt(double shift) {
  Positions x;
  for (int i = 0; i < 500; ++i) {
    const double a = 2 * M_PI * i / 499.0;
    x.emplace_back(1.1 + 0.6 * std::sin(a) + shift, 1.1 + 0.4 * std::sin(2 * a),
                   0.012 + 0.006 * std::cos(a) + 0.1 * shift);
  }
  return x;
}

nlohmann::json measureRope(int repeat) {
  constexpr double VOXEL_M = 0.01;
  std::vector<OccupiedLeaf> leaves;
  for (int x = 0; x < 224; ++x) {
    for (int y = 0; y < 224; ++y) {
      const int z = (x * 7 + y * 3) % 11 == 0 ? 0 : -1;
      leaves.push_back({{static_cast<std::uint16_t>(32768 + x), static_cast<std::uint16_t>(32768 + y),
                         static_cast<std::uint16_t>(32768 + z)},
                        1});
    }
  }
  const auto map = VoxelSurface::build(VOXEL_M, std::move(leaves));
  const auto topology = std::make_shared<const Topology>(Topology::polyline(500));
  MonitorOptions options;
  options.store.max_vertex_step_m = 0;
  options.detector.obstacle_expected = true;
  Body body;
  body.name = "rope";
  Monitor monitor(options, {body});
  monitor.setMap({map, 1, Eigen::Isometry3d::Identity(), {}});
  std::vector<double> times;
  std::size_t contacts = 0, self_pairs = 0, map_pairs = 0;
  for (int k = 0; k < repeat; ++k) {
    MeshFrame frame;
    frame.stamp_ns = 10000000LL * (k + 1);
    frame.topology = topology;
    frame.positions = ropeAt(0.003 * (k % 20));
    Outcome outcome;
    const Stopwatch watch;
    monitor.push(0, std::move(frame), 0);
    monitor.next(0, outcome);
    if (outcome.answered) times.push_back(watch.milliseconds());
    contacts += outcome.total_contacts;
    self_pairs += outcome.stats[Effect::SELF_COLLISION].in;
    map_pairs += outcome.stats[Effect::OCTOMAP].in;
  }
  if (self_pairs == 0 || map_pairs == 0 || contacts == 0) throw std::runtime_error("the rope has nothing to do");
  const std::size_t steps = times.size();
  return {{"ms", spread(times)},
          {"points", 500},
          {"voxels", map->leafCount()},
          {"required_ms", 0.3},
          {"contacts_a_step", static_cast<double>(contacts) / static_cast<double>(steps)},
          {"self_pairs_a_step", static_cast<double>(self_pairs) / static_cast<double>(steps)},
          {"map_pairs_a_step", static_cast<double>(map_pairs) / static_cast<double>(steps)}};
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  std::string out, scene = std::string(DEFORMABLE_CCD_SOURCE_DIR) + "/config/scenes/flag_in_wind.yaml";
  std::string touching = std::string(DEFORMABLE_CCD_SOURCE_DIR) + "/config/scenes/table_edge.yaml";
  int rounds = 41;
  CLI::App app("Times effects that a scene does not call for, and a rope.");
  app.add_option("--out", out, "JSON file to write")->required();
  app.add_option("--scene", scene, "scene of one sheet that touches nothing")->check(CLI::ExistingFile);
  app.add_option("--touching", touching, "scene of one sheet, for the cost of patches")->check(CLI::ExistingFile);
  app.add_option("--rounds", rounds, "interleaved rounds over the scene")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  try {
    nlohmann::json result{{"machine", dccd::benchmarks::machine()},
                          {"flag", dccd::benchmarks::measureFlag(scene, rounds)},
                          {"rope", dccd::benchmarks::measureRope(40 * rounds)},
                          {"patches", {{"demo", dccd::benchmarks::measurePatchesOfScene(touching, rounds)}}}};
    if (!dccd::test::dataDir().empty()) {
      result["patches"]["cloth-ball"] = dccd::benchmarks::measurePatchesOfStep("cloth-ball", rounds);
    }
    for (const char* part : {"flag", "rope", "patches"}) std::cerr << result[part].dump() << '\n';
    std::ofstream(out) << result.dump(1) << '\n';
  } catch (const std::exception& e) {
    std::cerr << "effects_benchmark: " << e.what() << '\n';
    return 1;
  }
  return 0;
}
