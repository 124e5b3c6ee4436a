#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dccd/body.h"
#include "dccd/voxel_surface.h"

namespace dccd {
namespace benchmarks {

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
              double fall_voxels, double required_ms, bool triangulated);

/// What is measured is the map: it does not collide with itself.
Body bodyOf(const Case& c);

std::vector<OccupiedLeaf> tableTop();

/// Making the surface of a room, whole and from the one before.
std::vector<nlohmann::json> measureBuilds(int repeat);

/// What own voxels cost a cloth of 1,200 vertices over the table, at 30 Hz and 5 maps a second. One monitor has the map
/// with the cloth in it and own voxels, the other one the table's alone, so that both check the same; by turns.
std::vector<nlohmann::json> measureOwnVoxels(int repeat);

}  // namespace benchmarks
}  // namespace dccd
