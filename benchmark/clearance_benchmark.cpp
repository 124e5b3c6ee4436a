// What distances cost: whole steps with and without clearance in turns, as processor time; and the distances that FCL,
// CGAL's tree and octomap's distance map tell of the same frames beside ours, which bound the truth, so that it is seen
// how far theirs are off.
#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <dynamicEDT3D/dynamicEDTOctomap.h>
#include <fcl/fcl.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <fstream>
#include <functional>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>

#include "dccd/monitor_extras.h"
#include "obstacle/voxel_surface_impl.h"
#include "support/data.h"
#include "support/detector.h"
#include "support/robot_cell.h"
#include "support/scene_data.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

/// Of this process [ms].
double processorMs() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

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

/// One that tells distances of the cloth and the table.
struct Peer {
  std::string name;
  double once_ms = 0;                                // what is made of the table
  std::function<double(const Positions&)> distance;  // [m] of a frame; its time is taken
  std::function<double(const Positions&)> judged;    // the same; its error is taken
};

/// The map as the sides of its boxes.
struct Sides {
  Positions positions;
  std::vector<std::array<std::size_t, 3>> triangles;

  explicit Sides(const VoxelSurface& map) {
    static constexpr std::size_t SIDES[12][3] = {{0, 1, 3}, {0, 3, 2}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                                 {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 3, 7}, {1, 7, 5}};
    for (const OccupiedLeaf& leaf : map.leaves()) {
      const LeafBox box = leafBox(leaf, map.resolution());
      const std::size_t first = positions.size();
      for (int i = 0; i < 8; ++i) {
        positions.emplace_back((i & 1 ? box.hi : box.lo)[0], (i & 2 ? box.hi : box.lo)[1],
                               (i & 4 ? box.hi : box.lo)[2]);
      }
      for (const auto& s : SIDES) triangles.push_back({first + s[0], first + s[1], first + s[2]});
    }
  }
};

using Model = fcl::BVHModel<fcl::OBBRSSd>;
std::shared_ptr<Model> modelOf(const Positions& positions, const std::vector<fcl::Triangle>& triangles) {
  auto model = std::make_shared<Model>();
  model->beginModel();
  model->addSubModel(positions, triangles);
  model->endModel();
  return model;
}

/// Of the two meshes. Its time is that of a model that is refitted; its error that of one made anew: what is refitted
/// may be off.
Peer fclPeer(const Case& c) {
  std::vector<fcl::Triangle> triangles, sides;
  for (const Face& f : c.topology->faces()) triangles.emplace_back(f[0], f[1], f[2]);
  const Sides table_sides(*c.map);
  for (const auto& s : table_sides.triangles) sides.emplace_back(s[0], s[1], s[2]);
  const double start = processorMs();
  const auto table = modelOf(table_sides.positions, sides);
  Peer peer{"FCL", processorMs() - start, {}};
  const auto apart = [table](const std::shared_ptr<Model>& cloth) {
    fcl::DistanceResultd found;
    fcl::distance<double>(cloth.get(), fcl::Transform3d::Identity(), table.get(), fcl::Transform3d::Identity(),
                          fcl::DistanceRequestd(), found);
    return found.min_distance;
  };
  peer.distance = [apart, cloth = modelOf(c.frames[0], triangles)](const Positions& frame) {
    cloth->beginReplaceModel();
    cloth->replaceSubModel(frame);
    cloth->endReplaceModel(true);
    return apart(cloth);
  };
  peer.judged = [apart, triangles](const Positions& frame) { return apart(modelOf(frame, triangles)); };
  return peer;
}

double leastOf(const Positions& frame, const std::function<double(const Vec3&)>& distance) {
  double least_m = std::numeric_limits<double>::infinity();
  for (const Vec3& p : frame) least_m = std::min(least_m, distance(p));
  return least_m;
}

/// Its tree tells the distance of a point: of each vertex from the table.
Peer cgalPeer(const Case& c) {
  using Kernel = CGAL::Simple_cartesian<double>;
  using Surface = CGAL::Surface_mesh<Kernel::Point_3>;
  using Primitive = CGAL::AABB_face_graph_triangle_primitive<Surface>;
  using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;
  const Sides sides(*c.map);
  const auto surface = std::make_shared<Surface>();
  for (const auto& triangle : sides.triangles) {
    // Each has corners of its own: together they are no manifold.
    std::array<Surface::Vertex_index, 3> corner;
    for (int i = 0; i < 3; ++i) {
      const Vec3& x = sides.positions[triangle[i]];
      corner[i] = surface->add_vertex(Kernel::Point_3(x[0], x[1], x[2]));
    }
    surface->add_face(corner[0], corner[1], corner[2]);
  }
  const double start = processorMs();
  const auto tree = std::make_shared<Tree>(surface->faces_begin(), surface->faces_end(), *surface);
  tree->build();
  tree->accelerate_distance_queries();
  Peer peer{"CGAL, vertices", processorMs() - start, {}};
  peer.distance = peer.judged = [surface, tree](const Positions& frame) {
    return leastOf(frame,
                   [&](const Vec3& p) { return std::sqrt(tree->squared_distance(Kernel::Point_3(p[0], p[1], p[2]))); });
  };
  return peer;
}

/// Octomap's distance map tells of a voxel how far its middle is from the nearest occupied one's: of each vertex's.
Peer distanceMapPeer(const Case& c) {
  const auto tree = std::make_shared<octomap::OcTree>(c.map->resolution());
  for (const OccupiedLeaf& leaf : c.map->leaves()) {
    tree->updateNode(octomap::OcTreeKey(leaf.min.x, leaf.min.y, leaf.min.z), true, true);
  }
  tree->updateInnerOccupancy();
  Eigen::AlignedBox3d box;
  for (const Positions& frame : c.frames) {
    for (const Vec3& p : frame) box.extend(p);
  }
  const auto point = [](const Vec3& p) {
    return octomap::point3d(static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2]));
  };
  box.extend(Vec3(0, 0, -c.map->resolution() / 2));
  const double start = processorMs();
  const auto map = std::make_shared<DynamicEDTOctomap>(1.0f, tree.get(), point(box.min()), point(box.max()), false);
  map->update();
  Peer peer{"dynamicEDT3D, vertices", processorMs() - start, {}};
  peer.distance = peer.judged = [tree, map, point](const Positions& frame) {
    return leastOf(frame, [&](const Vec3& p) { return map->getDistance(point(p)); });
  };
  return peer;
}

/// Its distance at the end of each step, its time, and the most by which it lies outside of our bounds.
nlohmann::json beside(const Case& c, const Peer& peer) {
  Options options;
  options.clearance.wanted = true;
  options.clearance.max_m = 10;
  test::Detector detector(options);
  std::vector<double> ms;
  double worst_m = 0;
  for (std::size_t k = 0; k + 1 < c.frames.size(); ++k) {
    const double start = processorMs();
    peer.distance(c.frames[k + 1]);
    ms.push_back(processorMs() - start);
    const double theirs_m = peer.judged(c.frames[k + 1]);
    const ClearanceDistance ours = detector.run(stepOf(c, k)).clearances.back().at_end;
    if (ours.status != ClearanceStatus::MEASURED) throw std::runtime_error(c.name + ": no distance was measured");
    worst_m = std::max({worst_m, ours.lower_m - theirs_m, theirs_m - ours.upper_m});
  }
  return {{"name", peer.name}, {"ms", spread(ms)}, {"once_ms", peer.once_ms}, {"outside_m", worst_m}};
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

/// What distances take more in the steps of a robot's cell: of each step the best of all rounds, as processor time; and
/// what the promise and the scale take that follow from them.
nlohmann::json measureCell(bool against_links, int repeat) {
  constexpr int STEPS = 300;
  RobotCell cell(against_links);
  std::vector<Step> steps;
  for (int k = 0; k <= STEPS; ++k) steps.push_back(cell.step(k));
  constexpr double NONE = std::numeric_limits<double>::infinity();
  std::vector<double> with(steps.size(), NONE), without = with, promises = with;
  const std::vector<SpeedBound> bounds(steps[0].bodies.size(), SpeedBound{1.0});
  std::size_t measured = 0, pairs = 0;
  for (int round = 0; round < repeat; ++round) {
    Options options;
    options.patches = true;
    test::Detector plain(options);
    options.clearance.wanted = true;
    options.clearance.max_m = 1;
    test::Detector asked(options);
    for (std::size_t k = 0; k < steps.size(); ++k) {
      double start = processorMs();
      plain.run(steps[k]);
      without[k] = std::min(without[k], processorMs() - start);
      start = processorMs();
      const Outcome outcome = asked.run(steps[k]);
      with[k] = std::min(with[k], processorMs() - start);
      start = processorMs();
      safeUntil(outcome, bounds);
      speedScale(outcome, bounds, {0.1, 0.3, 0.02});
      promises[k] = std::min(promises[k], processorMs() - start);
      if (round > 0) continue;
      for (const Clearance& row : outcome.clearances) {
        ++pairs;
        measured += row.over_step.status == ClearanceStatus::MEASURED;
      }
    }
  }
  std::vector<double> more;
  for (std::size_t k = 1; k < steps.size(); ++k)
    more.push_back(with[k] - without[k]);  // the first makes what is made once
  promises.erase(promises.begin());
  nlohmann::json row{{"case", std::string("a robot's cell") + (against_links ? ", links against each other" : "")},
                     {"real_meshes", cell.hasRealMeshes()},
                     {"triangles", cell.triangles()},
                     {"pairs", pairs / steps.size()},
                     {"measured", static_cast<double>(measured) / static_cast<double>(pairs)},
                     {"more_ms", spread(more)},
                     {"promises_ms", spread(promises)}};
  std::sort(more.begin(), more.end());
  row["more_p99_ms"] = more[more.size() * 99 / 100];
  return row;
}

int run(int argc, char** argv) {
  CLI::App app("What distances cost, and those of others beside them");
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
      for (const Peer& peer : {fclPeer(c), cgalPeer(c), distanceMapPeer(c)}) run["peers"].push_back(beside(c, peer));
      out["runs"].push_back(run);
      Case folds = c;
      folds.name += ", and itself";
      folds.self_m = SELF_M;
      out["runs"].push_back(measure(folds, repeat));
    }
  }
  for (const bool against_links : {false, true}) out["cells"].push_back(measureCell(against_links, repeat));
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
