// No voxel is own that the rule of stream/own_voxels.h does not name, and none that it names is missing but at the rim:
// random bodies, motions, maps and faults against a model that keeps every voxel by itself and measures distances by
// the oracle. DEFORMABLE_CCD_LONG=1 runs many more worlds.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <functional>
#include <map>
#include <random>
#include <set>

#include "obstacle/voxel_surface_impl.h"
#include "stream/own_voxels.h"
#include "support/box_oracle.h"

namespace dccd {
namespace test {
namespace {

constexpr double VOXEL_M = 0.1;
constexpr StampNs MS = 1000000;
constexpr int SIDE = 12;  // voxels of the world, each way
// What the finder may miss: half of the way between two places at which it asks for a body.
constexpr double RIM_M = 0.5 * tolerance::OWN_PLACES * VOXEL_M + 1e-9;

using Cell = std::array<int, 3>;

OccupiedLeaf leafOf(const Cell& cell, std::uint32_t size = 1) {
  const auto key = [](int i) { return static_cast<std::uint16_t>(32768 + i); };
  return {{key(cell[0]), key(cell[1]), key(cell[2])}, size};
}

/// One frame, and whether it goes on from the one before.
struct Seen {
  StampNs stamp_ns;
  Positions positions;
  bool goes_on;
};

/// The least distance between a voxel and the body on its way between two fractions of a stretch. For each face it is
/// convex in time: both move straight.
double distance(const Cell& cell, const Topology& topology, const Positions& a, const Positions& b, double first,
                double last) {
  double least = 1e300;
  for (const Face& face : topology.faces()) {
    ObstacleScene scene{VOXEL_M, {leafOf(cell)}, Topology::fromTriangles(3, {{0, 1, 2}}), {}, {}};
    for (const Index v : face) {
      scene.t0.push_back(a[v]);
      scene.t1.push_back(b[v]);
    }
    double lo = first, hi = last;
    for (int i = 0; i < 24 && hi > lo; ++i) {
      const double u = lo + (hi - lo) / 3, v = hi - (hi - lo) / 3;
      const double at_u = distanceToBoxes(scene, u), at_v = distanceToBoxes(scene, v);
      least = std::min({least, at_u, at_v});
      if (least == 0) return 0;
      (at_u < at_v ? hi : lo) = at_u < at_v ? v : u;
    }
    least = std::min({least, distanceToBoxes(scene, lo), distanceToBoxes(scene, hi)});
  }
  return least;
}

/// What the rule says, voxel by voxel.
class Model {
 public:
  enum class State { OBSTACLE, OWN, DOUBTED };
  Model(const Topology& topology, std::set<Cell> trusted) : topology_(topology), trusted_(std::move(trusted)) {}

  double nearest(const Cell& cell, const std::vector<Seen>& frames, StampNs since_ns, StampNs until_ns) const {
    double least = 1e300;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const bool alone = !frames[i].goes_on && !(i + 1 < frames.size() && frames[i + 1].goes_on);
      if (alone && frames[i].stamp_ns >= since_ns && frames[i].stamp_ns <= until_ns) {
        least = std::min(least, distance(cell, topology_, frames[i].positions, frames[i].positions, 0, 0));
      }
      if (!frames[i].goes_on) continue;
      const StampNs from = frames[i - 1].stamp_ns, to = frames[i].stamp_ns;
      if (from > until_ns || to < since_ns) continue;
      const auto at = [&](StampNs t) { return static_cast<double>(t - from) / static_cast<double>(to - from); };
      least = std::min(least, distance(cell, topology_, frames[i - 1].positions, frames[i].positions,
                                       at(std::max(from, since_ns)), at(std::min(to, until_ns))));
    }
    return least;
  }

  /// `own` and `doubted` as the finder has them: followed at the rim, judged elsewhere.
  void judge(const std::set<Cell>& occupied, const std::set<Cell>* free, const std::vector<Seen>& frames,
             StampNs stamp_ns, double lag_s, double reach_m, const std::map<Cell, bool>& found) {
    const bool is_first = !before_ns_;
    const StampNs lag_ns = std::llround(lag_s * 1e9);
    const StampNs since_ns = (is_first ? stamp_ns : std::min(*before_ns_, stamp_ns)) - lag_ns;
    const bool is_older = stamp_ns < frames.front().stamp_ns;
    const StampNs until_ns = std::max(stamp_ns, frames.front().stamp_ns);
    const auto reached = [&](const Cell& cell, bool otherwise) {
      const double m = nearest(cell, frames, since_ns, until_ns);
      return m > reach_m ? false : m <= reach_m - RIM_M ? true : otherwise;
    };
    std::map<Cell, State> now;
    std::set<Cell> remembered;
    for (const Cell& cell : occupied) {
      const auto was = states_.find(cell);
      const auto said = found.find(cell);
      const bool said_own = said != found.end(), said_doubted = said_own && said->second;
      State state = State::OBSTACLE;
      if (was != states_.end()) {
        state = was->second;
        if (state == State::DOUBTED && !reached(cell, said_doubted)) state = State::OBSTACLE;
      } else if (remembered_.count(cell) + trusted_.count(cell) == 0 && reached(cell, said_own)) {
        state = is_first || is_older ? State::DOUBTED : State::OWN;
      }
      now[cell] = state;
      EXPECT_EQ(said_own, state != State::OBSTACLE) << cell[0] << ' ' << cell[1] << ' ' << cell[2];
      EXPECT_EQ(said_doubted, state == State::DOUBTED) << cell[0] << ' ' << cell[1] << ' ' << cell[2];
      own += state == State::OWN;
      doubted += state == State::DOUBTED;
    }
    EXPECT_LE(found.size(), occupied.size());
    const auto vanish = [&](const Cell& cell) {
      if (occupied.count(cell) > 0) return;
      const double m = nearest(cell, frames, since_ns, until_ns);
      const bool unseen = free && free->count(cell) == 0;
      // At the rim either is right, and only one is followed: such a world ends.
      rim = rim || (!unseen && m <= reach_m && m > reach_m - RIM_M);
      if (unseen || m <= reach_m) remembered.insert(cell);
    };
    for (const auto& [cell, state] : states_) {
      if (state == State::OBSTACLE) vanish(cell);
    }
    for (const Cell& cell : remembered_) vanish(cell);
    states_ = now;
    remembered_ = remembered;
    before_ns_ = stamp_ns;
  }

  std::uint64_t own = 0, doubted = 0;
  bool rim = false;
  std::size_t remembers() const { return remembered_.size(); }

 private:
  const Topology& topology_;
  const std::set<Cell> trusted_;
  std::map<Cell, State> states_;
  std::set<Cell> remembered_;  // obstacles that the last map did not show
  std::optional<StampNs> before_ns_;
};

/// Random voxels near the body and elsewhere, among them whole blocks of 2^3 and 4^3 as one leaf.
std::set<Cell> randomCells(std::mt19937_64& random, const Positions& body, std::set<Cell> kept) {
  const auto any = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  for (auto it = kept.begin(); it != kept.end();) it = any(4) == 0 ? kept.erase(it) : std::next(it);
  const auto add = [&](const Cell& cell) {
    for (const int c : cell) {
      if (c < 0 || c >= SIDE) return;
    }
    kept.insert(cell);
  };
  for (int i = any(8); i > 0; --i) {
    const Vec3& p = body[static_cast<std::size_t>(any(static_cast<int>(body.size())))];
    Cell cell;
    for (int a = 0; a < 3; ++a)
      cell[static_cast<std::size_t>(a)] = static_cast<int>(std::floor(p[a] / VOXEL_M)) + any(5) - 2;
    add(cell);
  }
  for (int i = any(3); i > 0; --i) add({any(SIDE), any(SIDE), any(SIDE)});
  if (any(3) == 0) {
    const int size = any(2) == 0 ? 2 : 4, blocks = SIDE / size;
    const Cell corner{size * any(blocks), size * any(blocks), size * any(blocks)};
    for (int i = 0; i < size * size * size; ++i) {
      add({corner[0] + i % size, corner[1] + i / size % size, corner[2] + i / size / size});
    }
  }
  return kept;
}

/// As an octree has them: where all eight of a block are occupied they are one leaf, up to 4 voxels a side.
std::vector<OccupiedLeaf> pruned(const std::set<Cell>& cells) {
  std::vector<OccupiedLeaf> leaves;
  const std::function<int(const Cell&, int)> occupied = [&](const Cell& at, int size) {
    int count = 0;
    for (int i = 0; i < size * size * size; ++i) {
      count += static_cast<int>(cells.count({at[0] + i % size, at[1] + i / size % size, at[2] + i / size / size}));
    }
    return count;
  };
  const std::function<void(const Cell&, int)> add = [&](const Cell& at, int size) {
    const int count = occupied(at, size);
    if (count == size * size * size) return leaves.push_back(leafOf(at, static_cast<std::uint32_t>(size)));
    for (int k = 0; count > 0 && k < 8; ++k) {
      const int half = size / 2;
      add({at[0] + half * (k & 1), at[1] + half * (k >> 1 & 1), at[2] + half * (k >> 2)}, half);
    }
  };
  for (int i = 0; i < SIDE * SIDE * SIDE / 64; ++i) {
    constexpr int BLOCKS = SIDE / 4;
    add({4 * (i % BLOCKS), 4 * (i / BLOCKS % BLOCKS), 4 * (i / BLOCKS / BLOCKS)}, 4);
  }
  return leaves;
}

TEST(OwnVoxelsProperty, WhatIsOwnIsWhatTheRuleNames) {
  const int worlds = std::getenv("DEFORMABLE_CCD_LONG") ? 20000 : 60;
  std::uint64_t own = 0, doubted = 0, remembered = 0;
  for (int world = 0; world < worlds && !::testing::Test::HasFailure(); ++world) {
    SCOPED_TRACE("world " + std::to_string(world));
    std::mt19937_64 random(static_cast<std::uint64_t>(world) + 1);
    const auto real = [&](double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(random); };
    const auto chance = [&](int n) { return random() % static_cast<unsigned>(n) == 0; };
    const auto topology = std::make_shared<const Topology>(Topology::fromTriangles(4, {{0, 1, 2}, {1, 3, 2}}));
    MeshStore store{MeshStoreOptions()};
    OwnVoxelFinder finder;
    std::set<Cell> trusted;
    const double reach_m = chance(2) ? VOXEL_M : real(0.01, 0.25), lag_s = chance(2) ? 0 : real(0, 0.3);
    const bool tells_free = chance(2);
    Positions at;
    for (int v = 0; v < 4; ++v) at.push_back({real(0.2, 0.8), real(0.2, 0.8), real(0.2, 0.8)});
    if (chance(3)) trusted = randomCells(random, at, randomCells(random, at, {}));
    const auto beside = trusted.empty() ? nullptr : VoxelSurface::build(VOXEL_M, pruned(trusted));
    Model model(*topology, trusted);
    std::vector<Seen> frames;
    std::set<Cell> cells;
    StampNs now_ns = 1000 * MS, map_ns = 0;
    for (int event = 0; event < 14 && !model.rim && !::testing::Test::HasFailure(); ++event) {
      const bool gap = chance(8);
      now_ns += (gap ? 700 : 50 + static_cast<StampNs>(random() % 100)) * MS;
      const Vec3 way(real(-0.2, 0.2), real(-0.2, 0.2), real(-0.2, 0.2));
      for (Vec3& p : at) p += way + Vec3(real(-0.05, 0.05), real(-0.05, 0.05), real(-0.05, 0.05));
      const StepStatus status = store.push({now_ns, topology, at, false, Eigen::Isometry3d::Identity()});
      frames.push_back({now_ns, at, status == StepStatus::OK});
      if (!chance(2)) continue;
      map_ns = std::max(map_ns, now_ns - static_cast<StampNs>(random() % 120) * MS);
      cells = randomCells(random, at, cells);
      std::set<Cell> free;
      ObstacleMap map;
      map.surface = VoxelSurface::build(VOXEL_M, pruned(cells));
      map.stamp_ns = map_ns;
      if (tells_free) {
        std::vector<OccupiedLeaf> known = pruned(cells);
        for (int i = 0; i < SIDE * SIDE * SIDE; ++i) {
          const Cell cell{i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE};
          if (cells.count(cell) > 0 || chance(3)) continue;
          free.insert(cell);
          known.push_back(leafOf(cell));
        }
        map.known = KnownSpace::build(VOXEL_M, known);
      }
      const ObstacleMap reduced =
          finder.reduce(map, beside.get(), {{0, "cloth", reach_m, &store, false}}, lag_s, false);
      std::map<Cell, bool> found;
      for (const OwnVoxel& voxel : *reduced.own.voxels) {
        found[{voxel.key.x - 32768, voxel.key.y - 32768, voxel.key.z - 32768}] = voxel.doubted;
      }
      model.judge(cells, tells_free ? &free : nullptr, frames, map_ns, lag_s, reach_m, found);
      std::size_t left = 0;
      for (const OccupiedLeaf& leaf : reduced.surface->leaves()) left += leaf.size * leaf.size * leaf.size;
      EXPECT_EQ(left, cells.size() - found.size() +
                          std::count_if(trusted.begin(), trusted.end(),
                                        [&](const Cell& cell) { return cells.count(cell) == 0; }));
      // However it was made: as from the beginning.
      const auto whole = VoxelSurface::build(VOXEL_M, reduced.surface->leaves());
      EXPECT_EQ(VoxelSurface::Impl::of(*reduced.surface).features, VoxelSurface::Impl::of(*whole).features);
      remembered += model.remembers();
    }
    own += model.own;
    doubted += model.doubted;
  }
  EXPECT_GT(own, 5u * static_cast<unsigned>(worlds));
  EXPECT_GT(doubted, static_cast<unsigned>(worlds) / 2);
  EXPECT_GT(remembered, static_cast<unsigned>(worlds));
}

}  // namespace
}  // namespace test
}  // namespace dccd
