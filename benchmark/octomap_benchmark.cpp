// A cloth against an occupied map: far away, hovering, resting on it; and the small meshes that trackers send. The same
// surface as triangles is the rival. Both are exact, so their earliest contacts are compared before a time is written.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "dccd/stream.h"
#include "dccd/voxel_surface.h"
#include "support/detector.h"
#include "support/octomap_cases.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

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
