// What distances cost: whole steps with and without clearance in turns, as processor time; and FCL's distances of the
// same frames beside ours, which bound the truth, so that it is seen how far FCL's are off.
#include <fcl/fcl.h>
#include <CLI/CLI.hpp>
#include <cmath>
#include <ctime>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "obstacle/voxel_surface_impl.h"
#include "support/data.h"
#include "support/detector.h"
#include "support/scene_data.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

/// Of this process [ms].
double processorMs() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

constexpr double SELF_M = 0.1;

struct Case {
  std::string name;
  std::shared_ptr<const Topology> topology;
  std::vector<Positions> frames;
  std::shared_ptr<const VoxelSurface> map;  // null: none
  bool bends = true;                        // false: it is moved as it is
  double self_m = 0;                        // ClearanceOptions::self_m
};

/// A wavy cloth of side x side points, `spacing` apart, that sinks towards a table of voxels; waves pass through one
/// that bends.
Case hovering(const std::string& name, int side, double spacing, int voxels, double resolution_m, bool bends) {
  Case c;
  c.name = name;
  c.bends = bends;
  c.topology =
      std::make_shared<const Topology>(Topology::grid(static_cast<std::size_t>(side), static_cast<std::size_t>(side)));
  for (int frame = 0; frame < 12; ++frame) {
    Positions positions;
    for (int i = 0; i < side * side; ++i) {
      const double x = i % side * spacing, y = i / side * spacing, phase = bends ? 0.1 * frame : 0;
      positions.emplace_back(x, y, 0.2 - 0.002 * frame + 0.05 * std::sin(6 * x + 5 * y + phase));
    }
    c.frames.push_back(std::move(positions));
  }
  std::vector<OccupiedLeaf> leaves;
  for (int i = 0; i < voxels * voxels; ++i) {
    leaves.push_back(
        {{static_cast<std::uint16_t>(32768 + i % voxels), static_cast<std::uint16_t>(32768 + i / voxels), 32767}, 1});
  }
  c.map = VoxelSurface::build(resolution_m, std::move(leaves));
  return c;
}

Case clothBall() {
  const test::SceneData scene = test::readScene("cloth-ball");
  Case c;
  c.name = "cloth-ball and itself";
  c.self_m = SELF_M;
  c.topology = std::make_shared<const Topology>(Topology::fromTriangles(scene.vertices.size(), scene.faces));
  c.frames.resize(2);
  for (const VertexMotion& v : scene.vertices) {
    c.frames[0].emplace_back(v.t0[0], v.t0[1], v.t0[2]);
    c.frames[1].emplace_back(v.t1[0], v.t1[1], v.t1[2]);
  }
  return c;
}

Step stepOf(const Case& c, std::size_t frame) {
  Body body;
  body.name = "cloth";
  body.topology = c.topology;
  Step step = test::stepOf(body, c.frames[frame], c.frames[frame + 1]);
  step.map.surface = c.map;
  return step;
}

using Model = fcl::BVHModel<fcl::OBBRSSd>;
std::shared_ptr<Model> modelOf(const Positions& positions, const std::vector<fcl::Triangle>& triangles) {
  auto model = std::make_shared<Model>();
  model->beginModel();
  model->addSubModel(positions, triangles);
  model->endModel();
  return model;
}

/// The map as the sides of its boxes.
std::shared_ptr<Model> modelOf(const VoxelSurface& map) {
  static constexpr std::size_t SIDES[12][3] = {{0, 1, 3}, {0, 3, 2}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                               {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 3, 7}, {1, 7, 5}};
  Positions positions;
  std::vector<fcl::Triangle> triangles;
  for (const OccupiedLeaf& leaf : map.leaves()) {
    const LeafBox box = leafBox(leaf, map.resolution());
    const std::size_t first = positions.size();
    for (int i = 0; i < 8; ++i) {
      positions.emplace_back((i & 1 ? box.hi : box.lo)[0], (i & 2 ? box.hi : box.lo)[1], (i & 4 ? box.hi : box.lo)[2]);
    }
    for (const auto& s : SIDES) triangles.emplace_back(first + s[0], first + s[1], first + s[2]);
  }
  return modelOf(positions, triangles);
}

/// FCL's distance at the end of each step, its time, and the most by which it lies outside of our bounds.
nlohmann::json beside(const Case& c) {
  std::vector<fcl::Triangle> triangles;
  for (const Face& f : c.topology->faces()) triangles.emplace_back(f[0], f[1], f[2]);
  const auto cloth = modelOf(c.frames[0], triangles), table = modelOf(*c.map);
  Options options;
  options.clearance.wanted = true;
  options.clearance.max_m = 10;
  test::Detector detector(options);
  std::vector<double> ms;
  double worst_m = 0;
  for (std::size_t k = 0; k + 1 < c.frames.size(); ++k) {
    const double start = processorMs();
    cloth->beginReplaceModel();
    cloth->replaceSubModel(c.frames[k + 1]);
    cloth->endReplaceModel(true);
    fcl::DistanceResultd found;
    fcl::distance<double>(cloth.get(), fcl::Transform3d::Identity(), table.get(), fcl::Transform3d::Identity(),
                          fcl::DistanceRequestd(), found);
    ms.push_back(processorMs() - start);
    // The error is that of a model made anew: what is refitted may be off.
    fcl::DistanceResultd anew;
    fcl::distance<double>(modelOf(c.frames[k + 1], triangles).get(), fcl::Transform3d::Identity(), table.get(),
                          fcl::Transform3d::Identity(), fcl::DistanceRequestd(), anew);
    const ClearanceDistance ours = detector.run(stepOf(c, k)).clearances.back().at_end;
    if (ours.status != ClearanceStatus::MEASURED) throw std::runtime_error(c.name + ": no distance was measured");
    worst_m = std::max({worst_m, ours.lower_m - anew.min_distance, anew.min_distance - ours.upper_m});
  }
  return {{"ms", spread(ms)}, {"outside_m", worst_m}};
}

nlohmann::json measure(const Case& c, int repeat) {
  std::vector<double> with, without, ratios;
  for (int round = 0; round <= repeat; ++round) {
    double ms[2] = {};
    for (const bool wanted : {false, true}) {
      Options options;
      options.clearance.wanted = wanted;
      options.clearance.self_m = c.self_m;
      options.keep_bounds = false;
      test::Detector detector(options);
      detector.run(stepOf(c, 0));  // what is made once
      const double start = processorMs();
      for (std::size_t k = 0; k + 1 < c.frames.size(); ++k) detector.run(stepOf(c, k));
      ms[wanted] = (processorMs() - start) / static_cast<double>(c.frames.size() - 1);
    }
    if (round == 0) continue;  // the first one warms up
    without.push_back(ms[0]);
    with.push_back(ms[1]);
    ratios.push_back(ms[1] / std::max(ms[0], 1e-6));
  }
  return {{"case", c.name},
          {"triangles", c.topology->faces().size()},
          {"without_ms", spread(without)},
          {"with_ms", spread(with)},
          {"ratio", quartiles(ratios)}};
}

int run(int argc, char** argv) {
  CLI::App app("What distances cost, and FCL's beside them");
  std::string path;
  int repeat = 5;
  app.add_option("--out", path, "JSON file to write")->required();
  app.add_option("--repeat", repeat, "rounds in turns")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  nlohmann::json out{{"machine", machine()}, {"runs", nlohmann::json::array()}};
  for (const bool bends : {false, true}) {
    const std::string how = bends ? ", bending" : ", moving";
    for (const Case& c : {hovering("400 vertices over 3,600 voxels" + how, 20, 0.05, 60, 0.02, bends),
                          hovering("20,000 triangles over 50,000 voxels" + how, 101, 0.01, 224, 0.005, bends)}) {
      nlohmann::json run = measure(c, repeat);
      run["fcl"] = beside(c);
      out["runs"].push_back(run);
      Case folds = c;
      folds.name += ", and itself";
      folds.self_m = SELF_M;
      out["runs"].push_back(measure(folds, repeat));
    }
  }
  if (!test::dataDir().empty()) out["runs"].push_back(measure(clothBall(), repeat));
  std::ofstream(path) << out.dump(1) << "\n";
  return 0;
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  try {
    return dccd::benchmarks::run(argc, argv);
  } catch (const std::exception& e) {
    std::cerr << "clearance_benchmark: " << e.what() << "\n";
    return 1;
  }
}
