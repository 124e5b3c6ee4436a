// The surface of a map that follows another one, against the surface of the same leaves that was built whole: bit for
// bit, over random maps of leaves of all sizes, whole and pruned, and random changes.
#include "base/next_surface.h"

#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "obstacle/voxel_surface_impl.h"

namespace dccd {
namespace {

constexpr int SIDE = 64;

/// Which voxels are occupied of a cube of 64 a side.
using Voxels = std::vector<bool>;

std::size_t at(int x, int y, int z) { return static_cast<std::size_t>((z * SIDE + y) * SIDE + x); }

/// Leaves in Morton order, eight that are alike as one wherever `prunes` says so.
std::vector<OccupiedLeaf> leavesOf(const Voxels& voxels, int origin, const std::function<bool(int size)>& prunes) {
  std::vector<OccupiedLeaf> leaves;
  const std::function<bool(int, int, int, int)> isFull = [&](int x, int y, int z, int size) {
    for (int i = 0; i < size * size * size; ++i) {
      if (!voxels[at(x + i % size, y + i / size % size, z + i / size / size)]) return false;
    }
    return true;
  };
  const std::function<void(int, int, int, int)> add = [&](int x, int y, int z, int size) {
    if ((size == 1 || prunes(size)) && isFull(x, y, z, size)) {
      const auto key = [origin](int k) { return static_cast<std::uint16_t>(origin + k); };
      leaves.push_back({{key(x), key(y), key(z)}, static_cast<std::uint32_t>(size)});
      return;
    }
    const int half = size / 2;
    for (int i = 0; i < 8 && size > 1; ++i) {
      add(x + (i & 1 ? half : 0), y + (i & 2 ? half : 0), z + (i & 4 ? half : 0), half);
    }
  };
  add(0, 0, 0, SIDE);
  return leaves;
}

/// Fills or empties an aligned cube, a plane's part, or single voxels.
void change(std::mt19937& random, Voxels& voxels, int kinds) {
  const auto below = [&](int limit) { return static_cast<int>(random() % static_cast<unsigned>(limit)); };
  const bool value = random() % 2 == 0;
  const int size = 1 << below(6), kind = below(kinds);
  const auto corner = [&] { return below(SIDE / size) * size; };
  const int x = corner(), y = corner(), z = corner();
  for (int i = 0; i < size; ++i) {
    for (int k = 0; k < size; ++k) {
      if (kind == 0) voxels[at(below(SIDE), below(SIDE), below(SIDE))] = value;
      if (kind == 1) voxels[at(x + i, y + k, z)] = value;
      for (int j = 0; j < size && kind == 2; ++j) voxels[at(x + i, y + k, z + j)] = value;
    }
  }
}

void expectSameBits(const VoxelSurface& a, const VoxelSurface& b) {
  const VoxelTree &x = VoxelSurface::Impl::of(a).tree, &y = VoxelSurface::Impl::of(b).tree;
  ASSERT_EQ(a.resolution(), b.resolution());
  ASSERT_EQ(a.bounds().min, b.bounds().min);
  ASSERT_EQ(a.bounds().max, b.bounds().max);
  ASSERT_EQ(VoxelSurface::Impl::of(a).features, VoxelSurface::Impl::of(b).features);
  ASSERT_EQ(a.memoryBytes(), b.memoryBytes());
  ASSERT_EQ(x.leaves().size(), y.leaves().size());
  for (std::size_t i = 0; i < x.leaves().size(); ++i) {
    const OccupiedLeaf &p = x.leaves()[i], &q = y.leaves()[i];
    ASSERT_TRUE(p.min.x == q.min.x && p.min.y == q.min.y && p.min.z == q.min.z && p.size == q.size) << i;
  }
  for (int level = 0; level < VoxelTree::LEVELS; ++level) {
    ASSERT_EQ(x.firstLeafOfLevel(level), y.firstLeafOfLevel(level));
    ASSERT_EQ(x.nodes(level).size(), y.nodes(level).size());
    for (std::uint32_t n = 0; n < x.nodes(level).size(); ++n) {
      const VoxelTree::Node &p = x.nodes(level)[n], &q = y.nodes(level)[n];
      ASSERT_EQ(x.nodeCell(level, n), y.nodeCell(level, n));
      ASSERT_TRUE(p.full == q.full && p.start == q.start && p.child == q.child && p.first_leaf == q.first_leaf &&
                  p.first_child == q.first_child)
          << "level " << level << " node " << n;
      ASSERT_TRUE(p.edges == q.edges && p.corners == q.corners) << "level " << level << " node " << n;
      const auto& cell = x.nodeCell(level, n);
      ASSERT_EQ(x.find(level, cell[0], cell[1], cell[2]), y.find(level, cell[0], cell[1], cell[2]));
    }
  }
}

TEST(NextSurface, IsTheSameBitForBitAsOneThatIsBuiltWhole) {
  std::mt19937 random(11);
  const std::function<bool(int)> prunings[] = {
      [](int) { return true; },                // as OctoMap's binary maps
      [](int size) { return size <= 2; },      // in part
      [](int) { return false; },               // not at all
      [&](int) { return random() % 2 == 0; },  // other leaves for the same voxels
  };
  std::size_t leaves = 0, large = 0;
  for (int stream = 0; stream < 24; ++stream) {
    const int origin = stream % 3 == 0 ? 0 : stream % 3 == 1 ? 32768 - 64 : 65536 - 64;
    const auto& prunes = prunings[stream % 4];
    Voxels voxels(SIDE * SIDE * SIDE);
    for (int i = 0; i < 30; ++i) change(random, voxels, 3);
    std::shared_ptr<const VoxelSurface> last = VoxelSurface::build(0.05, leavesOf(voxels, origin, prunes));
    for (int step = 0; step < 25; ++step) {
      for (int i = step % 6; i > 0; --i) change(random, voxels, 1 + stream % 3);
      const std::vector<OccupiedLeaf> list = leavesOf(voxels, origin, prunes);
      const auto whole = VoxelSurface::build(0.05, list);
      last = nextSurface(0.05, list, *last);
      ASSERT_NO_FATAL_FAILURE(expectSameBits(*last, *whole)) << "stream " << stream << " step " << step;
      leaves += list.size();
      for (const OccupiedLeaf& leaf : list) large += leaf.size > 2;
    }
  }
  EXPECT_GT(leaves, 1000000u);
  EXPECT_GT(large, 1000u) << "larger leaves have their own ways";
}

TEST(NextSurface, LeavesInAnotherOrderMakeTheSameAndBadOnesAreRefused) {
  std::mt19937 random(5);
  Voxels voxels(SIDE * SIDE * SIDE);
  for (int i = 0; i < 40; ++i) change(random, voxels, 3);
  const auto all = [](int) { return true; };
  const std::vector<OccupiedLeaf> list = leavesOf(voxels, 0, all);
  const auto before = VoxelSurface::build(0.05, list);
  for (int i = 0; i < 20; ++i) {
    change(random, voxels, 3);
    std::vector<OccupiedLeaf> other = leavesOf(voxels, 0, all);
    std::shuffle(other.begin(), other.end(), random);
    expectSameBits(*nextSurface(0.05, other, *before), *VoxelSurface::build(0.05, other));
  }
  expectSameBits(*nextSurface(0.1, list, *before), *VoxelSurface::build(0.1, list));
  expectSameBits(*nextSurface(0.05, {}, *before), *VoxelSurface::build(0.05, {}));
  expectSameBits(*nextSurface(0.05, list, *VoxelSurface::build(0.05, {})), *before);
  EXPECT_THROW(nextSurface(0, list, *before), std::invalid_argument);
  for (std::size_t i = 0; i < list.size(); i += 1 + list.size() / 50) {
    const OccupiedLeaf& leaf = list[i];
    const std::vector<OccupiedLeaf> wrong{leaf,  // once more
                                          {leaf.min, 3},
                                          {leaf.min, 0},
                                          {leaf.min, 1u << 17},
                                          {{static_cast<std::uint16_t>(leaf.min.x | 1), leaf.min.y, leaf.min.z}, 8},
                                          {{0, 0, 0}, 65536}};  // which holds all others
    for (const OccupiedLeaf& one : wrong) {
      for (const std::size_t place : {i, i + 1}) {
        std::vector<OccupiedLeaf> bad = list;
        bad.insert(bad.begin() + static_cast<std::ptrdiff_t>(place), one);
        EXPECT_THROW(nextSurface(0.05, bad, *before), std::invalid_argument) << "leaf " << i << " size " << one.size;
      }
    }
  }
}

}  // namespace
}  // namespace dccd
