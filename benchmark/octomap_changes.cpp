// What comes before a step against a map: the map's surface, whole or from the one before, and whose voxels are whose.
#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <set>

#include "base/next_surface.h"
#include "dccd/stream.h"
#include "obstacle/voxel_bits.h"
#include "support/octomap_cases.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

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

}  // namespace

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
  Keys trail;
  for (int k = 0; k < MAP_EVERY * (repeat + 5); ++k) {
    MeshFrame frame;
    frame.stamp_ns = (k + 1) * FRAME_NS;
    frame.topology = topology;
    for (const Vec3& p : c.t0) frame.positions.push_back(p + VOXEL_M * Vec3(0, 0, 2 * std::sin(0.1 * k)));
    if (k % MAP_EVERY == 0) {
      std::vector<OccupiedLeaf> table = tableTop();
      for (int i = 0; i < 500; ++i) table.erase(table.begin() + static_cast<std::ptrdiff_t>(random() % table.size()));
      Keys seen;
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
    if (outcome[1].total_contacts != outcome[0].total_contacts || !outcome[1].claim.holds()) {
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

}  // namespace benchmarks
}  // namespace dccd
