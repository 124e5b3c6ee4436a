// A cloth against an occupied map: far away, hovering, resting on it; and the small meshes that trackers send. The same
// surface as triangles is the rival. Both are exact, so their earliest contacts are compared before a time is written.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <set>

#include "dccd/next_surface.h"
#include "dccd/stream.h"
#include "dccd/voxel_surface.h"
#include "obstacle/voxel_bits.h"
#include "support/detector.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

constexpr double VOXEL_M = 0.02;
constexpr int SIDE = 112, LAYERS = 4;  // 50,176 voxels: a table top
constexpr int FIRST = 32768 - SIDE / 2;
constexpr int TOP = 32768 + LAYERS;

/// A cloth of rows x cols points over the table, and what it must not take longer than.
struct Case {
  std::string name;
  Topology topology;
  Positions t0, t1;
  double required_ms = 0;
  bool triangulated = false;  ///< also measured against the triangulated surface
};

/// Points over the middle of the table, `height_voxels` above it, moving down by up to `fall_voxels`.
Case makeCase(const std::string& name, std::size_t rows, std::size_t cols, double side_m, double height_voxels,
              double fall_voxels, double required_ms, bool triangulated) {
  Case c;
  c.name = name;
  c.topology = rows > 1 ? Topology::grid(rows, cols) : Topology::polyline(cols);
  c.required_ms = required_ms;
  c.triangulated = triangulated;
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> unit(0, 1), sideways(-0.2, 0.2);
  const double top_m = voxelPlane(TOP, VOXEL_M);
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t k = 0; k < cols; ++k) {
      const double x = (static_cast<double>(k) / static_cast<double>(cols - 1) - 0.5) * side_m;
      const double y = rows > 1 ? (static_cast<double>(r) / static_cast<double>(rows - 1) - 0.5) * side_m : 0.0;
      const Vec3 p(x, y, top_m + VOXEL_M * (height_voxels + 0.1 * unit(random)));
      c.t0.push_back(p);
      c.t1.push_back(p + VOXEL_M * Vec3(sideways(random), sideways(random), -fall_voxels * unit(random)));
    }
  }
  return c;
}

std::vector<OccupiedLeaf> tableTop() {
  std::vector<OccupiedLeaf> leaves;
  for (int x = 0; x < SIDE; ++x) {
    for (int y = 0; y < SIDE; ++y) {
      for (int z = 0; z < LAYERS; ++z) {
        OccupiedLeaf leaf;
        leaf.min = {static_cast<std::uint16_t>(FIRST + x), static_cast<std::uint16_t>(FIRST + y),
                    static_cast<std::uint16_t>(TOP - 1 - z)};
        leaves.push_back(leaf);
      }
    }
  }
  return leaves;
}

/// The exposed voxel faces of the table top, two triangles each, vertices shared.
void triangulate(Positions& vertices, std::vector<Face>& faces) {
  std::map<std::array<int, 3>, Index> number;
  const auto vertex = [&](const std::array<int, 3>& plane) {
    const auto [it, is_new] = number.try_emplace(plane, static_cast<Index>(vertices.size()));
    if (is_new) {
      vertices.emplace_back(voxelPlane(plane[0], VOXEL_M), voxelPlane(plane[1], VOXEL_M),
                            voxelPlane(plane[2], VOXEL_M));
    }
    return it->second;
  };
  const std::array<int, 3> lo{FIRST, FIRST, TOP - LAYERS}, hi{FIRST + SIDE, FIRST + SIDE, TOP};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (const int plane : {lo[axis], hi[axis]}) {
      for (int i = lo[u]; i < hi[u]; ++i) {
        for (int j = lo[v]; j < hi[v]; ++j) {
          const auto at = [&](int di, int dj) {
            std::array<int, 3> p{};
            p[axis] = plane;
            p[u] = i + di;
            p[v] = j + dj;
            return vertex(p);
          };
          const Index a = at(0, 0), b = at(1, 0), c = at(1, 1), d = at(0, 1);
          faces.push_back({a, b, c});
          faces.push_back({a, c, d});
        }
      }
    }
  }
}

double earliest(const std::vector<Contact>& contacts) {
  double toc = 2;
  for (const Contact& c : contacts) toc = std::min(toc, c.toc_lower);
  return toc;
}

Body bodyOf(const Case& c) {
  Body cloth;
  cloth.name = "cloth";
  cloth.topology = std::make_shared<const Topology>(c.topology);
  cloth.self_collision = false;  // what is measured is the map
  return cloth;
}

/// Steps to and fro between the two ends, with what is kept of a body at rest and without, in turns.
nlohmann::json timeStream(const Case& c, const std::shared_ptr<const VoxelSurface>& surface, int repeat) {
  Options options, forgetting;
  forgetting.keep_bounds = false;
  test::Detector detectors[2]{test::Detector(options), test::Detector(forgetting)};
  const Body cloth = bodyOf(c);
  Step there = test::stepOf(cloth, c.t0, c.t1), back = test::stepOf(cloth, c.t1, c.t0);
  there.map.surface = back.map.surface = surface;
  std::vector<double> kept, without, ratio;
  std::size_t contacts = 0;
  for (int r = -2; r < repeat; ++r) {  // what is made once for the mesh and the map is in neither
    const Step& step = (r & 1) == 0 ? there : back;
    Outcome outcome[2];
    double ms[2];
    for (const int which : {r & 1, ~r & 1}) {  // each is first in turns
      const Stopwatch watch;
      outcome[which] = detectors[which].run(step);
      ms[which] = watch.milliseconds();
    }
    const Outcome &with = outcome[0], &forgot = outcome[1];
    const bool same = std::equal(with.contacts.begin(), with.contacts.end(), forgot.contacts.begin(),
                                 forgot.contacts.end(), [](const Contact& x, const Contact& y) {
                                   return !canonicalLess(x, y) && !canonicalLess(y, x) && x.toc_upper == y.toc_upper;
                                 });
    if (!same) throw std::runtime_error(c.name + ": what is kept changes the contacts");
    if (r < 0) continue;
    contacts = with.contacts.size();
    kept.push_back(ms[0]);
    without.push_back(ms[1]);
    ratio.push_back(ms[0] / ms[1]);
  }
  return {{"case", c.name},
          {"triangles", c.topology.faces().size()},
          {"voxels", surface->leafCount()},
          {"contacts", contacts},
          {"required_ms", c.required_ms},
          {"ms", spread(kept)},
          {"forget_ms", spread(without)},
          {"forget_ratio", quartiles(ratio)}};
}

/// The case through the detector, with the map as obstacle or as a second body of triangles.
nlohmann::json timeSteps(const Case& c, const std::shared_ptr<const VoxelSurface>& surface, const Positions* triangles,
                         const std::shared_ptr<const Topology>& triangle_topology, int repeat,
                         std::vector<Contact>& contacts) {
  Options options;
  options.keep_bounds = false;  // the same step again and again
  options.check_start_state = false;
  test::Detector detector(options);
  const Body cloth = bodyOf(c);
  Step step = test::stepOf(cloth, c.t0, c.t1);
  if (triangles) {
    Body table = cloth;
    table.name = "table";
    table.topology = triangle_topology;
    step.bodies.push_back(test::moving(table, *triangles, *triangles));
  } else {
    step.map.surface = surface;
  }
  std::vector<double> times;
  for (int r = 0; r < repeat; ++r) {
    const Stopwatch watch;
    const Outcome result = detector.run(step);
    times.push_back(watch.milliseconds());
    contacts = result.contacts;
  }
  return spread(times);
}

using Keys = std::set<std::array<int, 3>>;

/// A room: floor, walls and what stands about, 200,000 voxels and more.
Keys room() {
  std::mt19937 random(8);
  std::uniform_int_distribution<int> anywhere(0, 299);
  Keys keys;
  for (int i = 0; i < 300; ++i) {
    for (int j = 0; j < 300; ++j) {
      keys.insert({i, j, 0});
      if (j >= 120) continue;
      keys.insert({i, 0, j});
      keys.insert({0, i, j});
    }
  }
  while (keys.size() < 200000) {
    const int x = anywhere(random), y = anywhere(random), height = 1 + anywhere(random) / 6;
    for (int dx = 0; dx < 6; ++dx) {
      for (int dy = 0; dy < 6; ++dy) {
        for (int z = 1; z <= height; ++z) keys.insert({x + dx, y + dy, z});
      }
    }
  }
  return keys;
}

/// In Morton order, as decoded maps are.
std::vector<OccupiedLeaf> leavesOf(const Keys& keys) {
  std::vector<OccupiedLeaf> leaves;
  for (const auto& key : keys) {
    OccupiedLeaf leaf;
    leaf.min = {static_cast<std::uint16_t>(32600 + key[0]), static_cast<std::uint16_t>(32600 + key[1]),
                static_cast<std::uint16_t>(32768 + key[2])};
    leaves.push_back(leaf);
  }
  const auto code = [](const OccupiedLeaf& leaf) { return mortonCode(leaf.min.x, leaf.min.y, leaf.min.z); };
  std::sort(leaves.begin(), leaves.end(), [&](const auto& one, const auto& other) { return code(one) < code(other); });
  return leaves;
}

/// One voxel in a hundred is another one: a part of a wall is further back, or one here and one there is higher.
Keys changed(Keys keys, bool in_one_place) {
  const std::size_t half = keys.size() / 200;
  std::mt19937 random(9);
  std::vector<std::array<int, 3>> all(keys.begin(), keys.end());
  if (!in_one_place) std::shuffle(all.begin(), all.end(), random);
  for (std::size_t i = 0; i < half; ++i) keys.erase(all[i]);
  for (std::size_t i = 0, added = 0; added < half; ++i) {
    std::array<int, 3> key = all[in_one_place ? i % half : all.size() / 2 + i % (all.size() / 2)];
    const int away = 1 + static_cast<int>(i / half);
    in_one_place ? key[0] -= away : key[2] += away;
    added += keys.insert(key).second;
  }
  return keys;
}

/// Making the surface of a room, whole and from the one before.
std::vector<nlohmann::json> measureBuilds(int repeat) {
  const Keys keys = room();
  const std::vector<OccupiedLeaf> leaves = leavesOf(keys);
  const auto before = VoxelSurface::build(VOXEL_M, leaves);
  const auto time = [&](const std::string& name, const std::vector<OccupiedLeaf>& list, double required_ms,
                        bool whole) {
    std::vector<double> times;
    for (int r = -2; r < repeat; ++r) {  // the first ones get their memory from the system
      std::vector<OccupiedLeaf> given = list;
      const Stopwatch watch;
      const auto surface =
          whole ? VoxelSurface::build(VOXEL_M, std::move(given)) : nextSurface(VOXEL_M, std::move(given), *before);
      if (r >= 0) times.push_back(watch.milliseconds());
      if (surface->leafCount() != list.size()) throw std::runtime_error("the surface lost leaves");
    }
    return nlohmann::json{
        {"case", name},       {"triangles", 0}, {"voxels", list.size()}, {"contacts", 0}, {"required_ms", required_ms},
        {"ms", spread(times)}};
  };
  std::vector<nlohmann::json> runs{time("surface of a map, built on its own thread", leaves, 20.0, true)};
  const double quarter_ms = runs[0]["ms"]["median"].get<double>() / 4;
  runs.push_back(time("the next map, 1 % of it other in one place", leavesOf(changed(keys, true)), quarter_ms, false));
  runs.push_back(time("the next map, 1 % of it other all over", leavesOf(changed(keys, false)), quarter_ms, false));
  return runs;
}

/// What own voxels cost a cloth of 1,200 vertices over the table, at 30 Hz and 5 maps a second. One monitor has the map
/// with the cloth in it and own voxels, the other one the table's alone, so that both check the same; by turns.
std::vector<nlohmann::json> measureOwnVoxels(int repeat) {
  constexpr StampNs FRAME_NS = 33'333'333;
  constexpr int MAP_EVERY = 6;
  Case c = makeCase("", 30, 40, 0.8, 3, 0, 0, false);
  MonitorOptions options;
  options.detector.obstacle_expected = true;
  Body cloth = bodyOf(c);
  Monitor without(options, {cloth});
  cloth.own_voxels_m = ONE_VOXEL;
  Monitor with(options, {cloth});
  const auto topology = std::make_shared<const Topology>(c.topology);
  std::mt19937 random(3);
  std::vector<double> more_ms, map_ms;
  std::uint64_t own = 0, voxels = 0;
  std::shared_ptr<const VoxelSurface> last;
  std::set<std::array<int, 3>> trail;
  for (int k = 0; k < MAP_EVERY * (repeat + 5); ++k) {
    MeshFrame frame;
    frame.stamp_ns = (k + 1) * FRAME_NS;
    frame.topology = topology;
    for (const Vec3& p : c.t0) frame.positions.push_back(p + VOXEL_M * Vec3(0, 0, 2 * std::sin(0.1 * k)));
    if (k % MAP_EVERY == 0) {
      std::vector<OccupiedLeaf> table = tableTop();
      for (int i = 0; i < 500; ++i) table.erase(table.begin() + static_cast<std::ptrdiff_t>(random() % table.size()));
      std::set<std::array<int, 3>> seen;
      if (k > 0) {
        for (const Vec3& p : frame.positions) {
          seen.insert({static_cast<int>(std::floor(p.x() / VOXEL_M)), static_cast<int>(std::floor(p.y() / VOXEL_M)),
                       static_cast<int>(std::floor(p.z() / VOXEL_M))});
        }
      }
      std::vector<OccupiedLeaf> all = table;
      trail.insert(seen.begin(), seen.end());  // a map clears late
      for (const auto& key : trail) {
        all.push_back({{static_cast<std::uint16_t>(32768 + key[0]), static_cast<std::uint16_t>(32768 + key[1]),
                        static_cast<std::uint16_t>(32768 + key[2])},
                       1});
      }
      trail = seen;
      voxels = all.size();
      ObstacleMap map;
      map.stamp_ns = frame.stamp_ns;
      map.surface = VoxelSurface::build(VOXEL_M, std::move(table));
      without.setMap(map);
      map.surface = VoxelSurface::build(VOXEL_M, std::move(all));
      with.setMap(map);
    }
    Outcome outcome[2];
    double ms[2];
    for (const int which : {k & 1, ~k & 1}) {
      Monitor& monitor = which == 0 ? without : with;
      const Stopwatch watch;
      monitor.push(0, frame, 0);
      monitor.next(0, outcome[which]);
      ms[which] = watch.milliseconds();
    }
    if (k < MAP_EVERY * 5) continue;
    if (outcome[1].total_contacts != outcome[0].total_contacts || !outcome[1].unproved.empty()) {
      throw std::runtime_error("own voxels change the answer");
    }
    own += outcome[1].step->map.own.own;
    more_ms.push_back(ms[1] - ms[0]);
    if (k % MAP_EVERY == 0) map_ms.push_back(outcome[1].stats[Effect::OWN_VOXELS].ms);
  }
  if (own == 0) throw std::runtime_error("nothing is own");
  const auto row = [&](const std::string& name, double required_ms, const std::vector<double>& times) {
    return nlohmann::json{{"case", name},
                          {"triangles", topology->faces().size()},
                          {"voxels", voxels},
                          {"contacts", 0},
                          {"required_ms", required_ms},
                          {"ms", spread(times)}};
  };
  return {row("own voxels of 1,200 vertices, 5 maps a second: more in a step", 0.1, more_ms),
          row("the same: a map", 10, map_ms)};
}

nlohmann::json measure(int repeat) {
  std::vector<Case> cases;
  cases.push_back(makeCase("20,000 triangles, far away", 101, 101, 2.0, 50, 1, 1.5, true));
  cases.push_back(makeCase("20,000 triangles, hovering half a voxel above", 101, 101, 2.0, 0.5, 0.4, 2.5, true));
  cases.push_back(makeCase("20,000 triangles, resting", 101, 101, 2.0, 0.01, 0.15, 2.5, true));
  cases.push_back(makeCase("cloth of 400 vertices, resting", 20, 20, 0.5, 0.01, 0.15, 0.2, false));
  cases.push_back(makeCase("rope of 50 points, resting", 1, 50, 1.0, 0.01, 0.15, 0.2, false));
  const auto surface = VoxelSurface::build(VOXEL_M, tableTop());
  Positions vertices;
  std::vector<Face> faces;
  triangulate(vertices, faces);
  const auto topology = std::make_shared<const Topology>(Topology::fromTriangles(vertices.size(), faces));
  nlohmann::json out{{"machine", machine()}, {"resolution_m", VOXEL_M}, {"map_triangles", faces.size()}};
  for (const Case& c : cases) {
    std::vector<Contact> contacts, of_triangles;
    nlohmann::json run{{"case", c.name},
                       {"triangles", c.topology.faces().size()},
                       {"voxels", surface->leafCount()},
                       {"required_ms", c.required_ms}};
    run["ms"] = timeSteps(c, surface, nullptr, topology, repeat, contacts);
    run["contacts"] = contacts.size();
    if (c.triangulated) {
      run["triangulated_ms"] = timeSteps(c, nullptr, &vertices, topology, std::max(1, repeat / 5), of_triangles);
      if (contacts.empty() != of_triangles.empty() || earliest(contacts) != earliest(of_triangles)) {
        throw std::runtime_error(c.name + ": the earliest contact with the voxels is not that with their triangles");
      }
    }
    std::cerr << run.dump() << '\n';
    out["runs"].push_back(run);
  }
  Case still = cases[2];
  still.name = "20,000 triangles in a stream, lying still";
  still.t0 = still.t1;
  Case stirring = cases[2];
  stirring.name = "20,000 triangles in a stream, moving to and fro";
  for (const nlohmann::json& run : {timeStream(still, surface, repeat), timeStream(stirring, surface, repeat)}) {
    out["runs"].push_back(run);
    std::cerr << run.dump() << '\n';
  }
  for (const auto& runs : {measureBuilds(repeat), measureOwnVoxels(repeat)}) {
    for (const nlohmann::json& run : runs) {
      out["runs"].push_back(run);
      std::cerr << run.dump() << '\n';
    }
  }
  return out;
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  std::string out;
  int repeat = 25;
  CLI::App app("Times meshes against an occupied map.");
  app.add_option("--out", out, "JSON file to write")->required();
  app.add_option("--repeat", repeat, "runs of each case")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  try {
    std::ofstream(out) << dccd::benchmarks::measure(repeat).dump(1) << '\n';
  } catch (const std::exception& e) {
    std::cerr << "octomap_benchmark: " << e.what() << '\n';
    return 1;
  }
  return 0;
}
