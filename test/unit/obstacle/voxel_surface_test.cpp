// Exposed faces, edges and corners against their definition on single voxels, for leaves of all sizes.
#include "dccd/voxel_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "obstacle/voxel_surface_impl.h"
#include "support/said.h"

namespace dccd {
namespace {

using Cell = std::array<int, 3>;

OccupiedLeaf leafAt(int x, int y, int z, std::uint32_t size) {
  return {{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y), static_cast<std::uint16_t>(z)}, size};
}

/// Random leaves of 1 to 16 voxels a side within `reach` voxels of `origin`, a multiple of 16.
std::vector<OccupiedLeaf> randomLeaves(std::mt19937& random, int origin, int reach, int count) {
  std::vector<OccupiedLeaf> leaves;
  std::set<Cell> taken;
  for (int i = 0; i < count; ++i) {
    const int size = 1 << std::min<int>(random() % 7 < 4 ? 0 : random() % 5, 4);
    Cell cell;
    for (int& c : cell) c = origin + static_cast<int>(random() % reach) / size * size;
    std::vector<Cell> voxels;
    for (int x = 0; x < size; ++x) {
      for (int y = 0; y < size; ++y) {
        for (int z = 0; z < size; ++z) voxels.push_back({cell[0] + x, cell[1] + y, cell[2] + z});
      }
    }
    if (std::any_of(voxels.begin(), voxels.end(), [&](const Cell& v) { return taken.count(v) > 0; })) continue;
    taken.insert(voxels.begin(), voxels.end());
    leaves.push_back(leafAt(cell[0], cell[1], cell[2], static_cast<std::uint32_t>(size)));
  }
  return leaves;
}

std::set<Cell> voxelsOf(const std::vector<OccupiedLeaf>& leaves) {
  std::set<Cell> voxels;
  for (const OccupiedLeaf& leaf : leaves) {
    const int size = static_cast<int>(leaf.size);
    for (int i = 0; i < size * size * size; ++i) {
      voxels.insert({leaf.min.x + i % size, leaf.min.y + i / size % size, leaf.min.z + i / size / size});
    }
  }
  return voxels;
}

/// Six faces of a cube, exposed (bit set) or covered: an edge counts when both its faces are exposed, a corner when all
/// three are.
FeatureMask featuresOfFaces(unsigned faces) {
  const auto exposed = [&](int axis, int side) { return (faces >> (2 * axis + side) & 1) != 0; };
  FeatureMask mask = faces;
  for (int i = 0; i < 12; ++i) {
    const int axis = i / 4, side_b = i & 1, side_c = i >> 1 & 1;
    if (exposed((axis + 1) % 3, side_b) && exposed((axis + 2) % 3, side_c)) mask |= 1u << edgeBit(axis, side_b, side_c);
  }
  for (int i = 0; i < 8; ++i) {
    const int x = i & 1, y = i >> 1 & 1, z = i >> 2;
    if (exposed(0, x) && exposed(1, y) && exposed(2, z)) mask |= 1u << cornerBit(x, y, z);
  }
  return mask;
}

/// Features of these kinds, each leaf's own.
std::size_t count(const VoxelSurface& surface, FeatureMask kinds) {
  std::size_t found = 0;
  for (const FeatureMask mask : VoxelSurface::Impl::of(surface).features) found += bitCount(mask & kinds);
  return found;
}

/// The definition: a face counts where the voxel beyond is empty somewhere, an edge where the two voxels beyond its
/// faces are both empty at one place, a corner where all three are.
FeatureMask expectedFeatures(const OccupiedLeaf& leaf, const std::set<Cell>& voxels) {
  const int size = static_cast<int>(leaf.size);
  FeatureMask mask = 0;
  for (int i = 0; i < size * size * size; ++i) {
    const Cell offset{i % size, i / size % size, i / size / size};
    unsigned faces = 0;
    for (int d = 0; d < FACE_DIRECTIONS; ++d) {
      const int axis = d / 2, step = d % 2 ? 1 : -1;
      if (offset[axis] != (d % 2 ? size - 1 : 0)) continue;
      Cell beyond{leaf.min.x + offset[0], leaf.min.y + offset[1], leaf.min.z + offset[2]};
      beyond[axis] += step;
      if (voxels.count(beyond) == 0) faces |= 1u << d;
    }
    mask |= featuresOfFaces(faces);
  }
  return mask;
}

TEST(VoxelSurface, ExposesWhatTheDefinitionSays) {
  std::mt19937 random(3);
  for (int round = 0; round < 60; ++round) {
    const int origin = round % 3 == 0 ? 0 : round % 3 == 1 ? 32768 - 16 : 65536 - 48;
    const std::vector<OccupiedLeaf> leaves = randomLeaves(random, origin, 8 + round % 41, 20 + 20 * (round % 5));
    const std::set<Cell> voxels = voxelsOf(leaves);
    const auto surface = VoxelSurface::build(0.05, leaves);
    ASSERT_EQ(surface->leafCount(), leaves.size());
    for (std::size_t i = 0; i < leaves.size(); ++i) {
      const OccupiedLeaf& leaf = surface->leaves()[i];
      EXPECT_EQ(VoxelSurface::Impl::of(*surface).features[i], expectedFeatures(leaf, voxels))
          << "leaf " << leaf.min.x << " " << leaf.min.y << " " << leaf.min.z << " size " << leaf.size;
    }
  }
}

TEST(VoxelSurface, TheQueryFindsTheLeavesOfABoxEachOnce) {
  std::mt19937 random(4);
  for (int round = 0; round < 300; ++round) {
    const std::vector<OccupiedLeaf> leaves = randomLeaves(random, 32768 - 16, 48, 60);
    const VoxelTree tree(leaves);
    KeyBox box;
    for (int axis = 0; axis < 3; ++axis) {
      const int reach = 1 << random() % 17;
      const int a =
          std::clamp<int>(32740 + static_cast<int>(random() % 70) - static_cast<int>(random() % reach), 0, 65535);
      box.lo[axis] = a;
      box.hi[axis] = std::min<int>(65535, a + static_cast<int>(random() % reach));
    }
    std::set<std::uint32_t> expected, found;
    for (std::uint32_t i = 0; i < leaves.size(); ++i) {
      const OccupiedLeaf& leaf = tree.leaves()[i];
      const int min[3] = {leaf.min.x, leaf.min.y, leaf.min.z};
      bool meets = true;
      for (int axis = 0; axis < 3; ++axis) {
        meets = meets && min[axis] <= box.hi[axis] && min[axis] + static_cast<int>(leaf.size) > box.lo[axis];
      }
      if (meets) expected.insert(i);
    }
    tree.visitLeaves(box, [&](std::uint32_t leaf) {
      EXPECT_TRUE(found.insert(leaf).second) << "twice";
      return true;
    });
    EXPECT_EQ(found, expected);
    EXPECT_EQ(tree.reached(box).leaf, !expected.empty());
  }
}

TEST(VoxelSurface, CoverageOfCubes) {
  const VoxelTree tree({leafAt(16, 16, 16, 16), leafAt(0, 0, 0, 1), leafAt(4, 4, 4, 4), leafAt(8, 8, 8, 2)});
  using Coverage = VoxelTree::Coverage;
  EXPECT_EQ(tree.coverage(16, 16, 16, 16), Coverage::FULL);
  EXPECT_EQ(tree.coverage(20, 24, 31, 1), Coverage::FULL);
  EXPECT_EQ(tree.coverage(0, 0, 0, 1), Coverage::FULL);
  EXPECT_EQ(tree.coverage(1, 0, 0, 1), Coverage::EMPTY);
  EXPECT_EQ(tree.coverage(0, 0, 0, 2), Coverage::PARTIAL);
  EXPECT_EQ(tree.coverage(4, 4, 4, 4), Coverage::FULL);
  EXPECT_EQ(tree.coverage(8, 8, 8, 2), Coverage::FULL);
  EXPECT_EQ(tree.coverage(8, 8, 8, 4), Coverage::PARTIAL);
  EXPECT_EQ(tree.coverage(0, 0, 0, 65536), Coverage::PARTIAL);
  EXPECT_EQ(tree.coverage(-16, 0, 0, 16), Coverage::EMPTY);
  EXPECT_EQ(tree.coverage(32768, 0, 0, 32768), Coverage::EMPTY);
}

// A level without leaves of its own between two with some: its nodes are skipped, and their parents' children with
// them.
TEST(VoxelSurface, CoverageBesideALargeLeafWithSmallOnesFurtherOn) {
  const VoxelTree tree({{{0, 0, 0}, 64}, {{96, 0, 0}, 1}});
  EXPECT_EQ(tree.coverage(80, 16, 16, 1), VoxelTree::Coverage::EMPTY);
  EXPECT_EQ(tree.coverage(64, 32, 32, 8), VoxelTree::Coverage::EMPTY);
  EXPECT_EQ(tree.coverage(63, 16, 16, 1), VoxelTree::Coverage::FULL);
  EXPECT_EQ(tree.coverage(64, 0, 0, 64), VoxelTree::Coverage::PARTIAL);
}

TEST(VoxelSurface, HugeLeavesCostWhatSmallOnesDo) {
  const auto whole = VoxelSurface::build(0.05, {leafAt(0, 0, 0, 65536)});
  EXPECT_EQ(count(*whole, FACE_MASK), 6u);
  EXPECT_EQ(count(*whole, EDGE_MASK), 12u);
  EXPECT_EQ(count(*whole, CORNER_MASK), 8u);
  EXPECT_LT(whole->memoryBytes(), 4096u);
  EXPECT_NE(whole->leafAt(Vec3(1, -2, 3)), nullptr);

  const auto halves = VoxelSurface::build(1.0, {leafAt(0, 0, 0, 32768), leafAt(32768, 0, 0, 32768)});
  EXPECT_EQ(count(*halves, FACE_MASK), 10u);
  EXPECT_EQ(count(*halves, EDGE_MASK), 16u);
  EXPECT_EQ(count(*halves, CORNER_MASK), 8u);
}

TEST(VoxelSurface, BoundsAndPlanesAreTheRoundedProducts) {
  const auto surface = VoxelSurface::build(0.05, {leafAt(32767, 32775, 32768, 1)});
  EXPECT_EQ(surface->bounds().min, Vec3(-0.05, 7 * 0.05, 0));
  EXPECT_EQ(surface->bounds().max, Vec3(0, 8 * 0.05, 0.05));
  EXPECT_TRUE(VoxelSurface::build(0.05, {})->bounds().empty());
}

TEST(VoxelSurface, LeafAtTakesClosedVoxelsAndTheSmallestKey) {
  const auto surface = VoxelSurface::build(0.05, {leafAt(32768, 32768, 32768, 1), leafAt(32769, 32768, 32768, 1)});
  ASSERT_NE(surface->leafAt(Vec3(0.05, 0, 0)), nullptr);
  EXPECT_EQ(surface->leafAt(Vec3(0.05, 0, 0))->min.x, 32768);
  EXPECT_EQ(surface->leafAt(Vec3(std::nextafter(0.05, 1), 0, 0))->min.x, 32769);
  EXPECT_EQ(surface->leafAt(Vec3(0.1, 0.05, 0.05))->min.x, 32769);
  EXPECT_EQ(surface->leafAt(Vec3(std::nextafter(0.1, 1), 0, 0)), nullptr);
  EXPECT_EQ(surface->leafAt(Vec3(std::numeric_limits<double>::quiet_NaN(), 0, 0)), nullptr);
}

std::string refusal(double resolution_m, const std::vector<OccupiedLeaf>& leaves) {
  return test::said<std::invalid_argument>([&] { VoxelSurface::build(resolution_m, leaves); });
}

TEST(VoxelSurface, RefusesWhatIsNoMapAndNamesIt) {
  EXPECT_EQ(refusal(0, {}), "resolution_m is 0, which is not a length from 1e-290 to 1e290 m");
  EXPECT_EQ(refusal(1e-290, {}), "");
  EXPECT_EQ(refusal(1e290, {}), "");
  EXPECT_NE(refusal(std::nextafter(1e-290, 0), {}), "");
  EXPECT_NE(refusal(std::nextafter(1e290, 1e300), {}), "");
  EXPECT_NE(refusal(std::numeric_limits<double>::quiet_NaN(), {}).find("nan"), std::string::npos);
  EXPECT_NE(refusal(1, {leafAt(0, 0, 0, 3)}).find("size 3"), std::string::npos);
  EXPECT_NE(refusal(1, {leafAt(2, 0, 0, 4)}).find("multiple"), std::string::npos);
  EXPECT_NE(refusal(1, {leafAt(8, 8, 8, 1), leafAt(8, 8, 8, 1)}).find("overlaps"), std::string::npos);
  EXPECT_NE(refusal(1, {leafAt(9, 8, 8, 1), leafAt(8, 8, 8, 2)}).find("overlaps"), std::string::npos);
  EXPECT_NE(refusal(1, {leafAt(63, 63, 63, 1), leafAt(0, 0, 0, 64)}).find("overlaps"), std::string::npos);
}

/// One behind the other as what is occupied and what is free, each in order: as if they were mixed up.
TEST(VoxelSurface, TwoListsInOrderMakeTheTreeThatTheirLeavesMake) {
  std::mt19937 random(5);
  const auto isBefore = [](const OccupiedLeaf& a, const OccupiedLeaf& b) { return codeOf(a) < codeOf(b); };
  for (int round = 0; round < 100; ++round) {
    std::vector<OccupiedLeaf> mixed = randomLeaves(random, 32768 - 16, 48, 5 + round);
    std::vector<OccupiedLeaf> lists = mixed;
    const auto middle = lists.begin() + static_cast<std::ptrdiff_t>(random() % (lists.size() + 1));
    std::sort(lists.begin(), middle, isBefore);
    std::sort(middle, lists.end(), isBefore);
    const VoxelTree one(lists), other(mixed);
    ASSERT_TRUE(std::equal(
        one.leaves().begin(), one.leaves().end(), other.leaves().begin(), other.leaves().end(),
        [](const OccupiedLeaf& a, const OccupiedLeaf& b) { return a.size == b.size && codeOf(a) == codeOf(b); }));
    for (int level = 0; level < VoxelTree::LEVELS; ++level) {
      ASSERT_EQ(one.nodes(level).size(), other.nodes(level).size());
      for (std::uint32_t n = 0; n < one.nodes(level).size(); ++n) {
        const VoxelTree::Node &a = one.nodes(level)[n], &b = other.nodes(level)[n];
        ASSERT_EQ(one.nodeCell(level, n), other.nodeCell(level, n));
        ASSERT_TRUE(a.full == b.full && a.start == b.start && a.child == b.child && a.first_leaf == b.first_leaf &&
                    a.first_child == b.first_child);
      }
    }
    // One that the second list has once more is no set of leaves.
    lists.push_back(lists[random() % lists.size()]);
    EXPECT_THROW(VoxelTree{lists}, std::invalid_argument) << round;
  }
}

TEST(VoxelSurface, MemoryIsProportional) {
  std::vector<OccupiedLeaf> leaves;
  for (int x = 0; x < 300; ++x) {
    for (int y = 0; y < 300; ++y) leaves.push_back(leafAt(32000 + x, 33000 + y, 32768 + (x * y) % 5, 1));
  }
  const auto surface = VoxelSurface::build(0.05, leaves);
  EXPECT_LT(surface->memoryBytes(), 64 * leaves.size());
}

}  // namespace
}  // namespace dccd
