// What max_map_mb reckons with is what maps take.
#include "node/map_memory.h"

#include <gtest/gtest.h>

#include <random>

#include "dccd/tolerances.h"
#include "node/map_loader.h"
#include "octomap/map_builder.h"
#include "support/said.h"

namespace dccd {
namespace {

/// A quarter of all voxels of a cube.
std::vector<std::int8_t> sparse(double resolution_m, double edge_m) {
  std::mt19937 random(5);
  return buildOctomap(
      resolution_m, Box{Vec3::Zero(), Vec3::Constant(edge_m)}, [&](const Vec3&) { return random() % 4 == 0; }, true);
}

struct Decoded {
  OctomapCounts counts;
  std::shared_ptr<const VoxelSurface> surface;
};

Decoded decoded(const std::vector<std::int8_t>& data) {
  Decoded result;
  OctomapLimits limits;
  limits.accept = [&](const OctomapCounts& counts) { result.counts = counts; };
  const DecodedOctomap map = decodeOctomap({"OcTree", 0.1, true, data.data(), data.size()}, limits);
  result.surface = VoxelSurface::build(0.1, map.occupied);
  return result;
}

TEST(MapMemory, ASurfaceTakesWhatIsReckonedWith) {
  const Decoded map = decoded(sparse(0.1, 4));
  const std::size_t reckoned =
      map.counts.occupied * tolerance::MAP_LEAF_IN_SURFACE + map.counts.occupied_nodes * tolerance::MAP_NODE;
  EXPECT_LE(map.surface->memoryBytes(), reckoned + 4096);
  EXPECT_GE(map.surface->memoryBytes(), reckoned * 3 / 4);
}

TEST(MapMemory, WhatIsHeldHasNoRoomTwice) {
  MonitorConfig config;
  config.max_map_bytes = std::size_t{1} << 20;
  const Decoded map = decoded(sparse(0.1, 1.6));
  const MapMemory memory(config);
  EXPECT_NO_THROW(memory.accept(map.counts));
  std::vector<std::shared_ptr<const VoxelSurface>> held;
  for (int i = 0; i < 2; ++i) {
    held.push_back(memory.counted(decoded(sparse(0.1, 1.6)).surface));
    EXPECT_NO_THROW(memory.accept(map.counts)) << "a map in use and one that waits leave room for the next";
  }
  while (held.size() < 40) held.push_back(memory.counted(decoded(sparse(0.1, 1.6)).surface));
  const std::string text = test::said<OctomapError>([&] { memory.accept(map.counts); });
  EXPECT_NE(text.find("max_map_mb 1 MB; maps that are still held take"), std::string::npos) << text;
  held.clear();
  EXPECT_NO_THROW(memory.accept(map.counts));
}

TEST(MapMemory, WhatHasRoomAtFirstHasItBesideTwoLikeIt) {
  MonitorConfig config;
  config.max_map_bytes = std::size_t{1} << 20;
  const MapMemory memory(config);
  const auto data = sparse(0.1, 4);
  const Decoded map = decoded(data);
  while (!test::said<OctomapError>([&] { memory.accept(map.counts); }).empty()) config.max_map_bytes += 1 << 14;
  const auto in_use = memory.counted(decoded(data).surface), waits = memory.counted(decoded(data).surface);
  EXPECT_NO_THROW(memory.accept(map.counts));
}

TEST(MapMemory, LeavesThatNeedMoreThanThereIsAreRefused) {
  MonitorConfig config;
  const MapMemory memory(config);
  EXPECT_NO_THROW(memory.accept({500000, 4000000, 100000, 500000})) << "an ordinary map, under the default";
  EXPECT_THROW(memory.accept({8000000, 8000000, 200000, 300000}), OctomapError);
  const std::size_t room = memory.accept({1000, 1000, 100, 100});
  config.monitor.detector.exclude_boxes = {Box{Vec3::Zero(), Vec3::Ones()}};
  EXPECT_LT(memory.accept({1000, 1000, 100, 100}), room);
  config.unknown_space = UnknownSpace::OCCUPIED;
  config.max_map_bytes = std::size_t{128} << 20;
  EXPECT_THROW(memory.accept({100, 1000000, 100, 50000}), OctomapError) << "free leaves count where they are kept";
  config.unknown_space = UnknownSpace::FREE;
  EXPECT_NO_THROW(memory.accept({100, 1000000, 100, 50000}));
}

}  // namespace
}  // namespace dccd
