// The table of own voxels: what the code has is what doc/algorithm.md says, and each of its cells holds of a voxel that
// maps show one after the other.
#include "stream/voxel_states.h"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "stream/own_voxels.h"
#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

constexpr double VOXEL_M = 0.1;
constexpr StampNs MS = 1000000;
constexpr const char* STATES[] = {"UNKNOWN", "FREE", "OWN", "OBSTACLE", "DOUBT", "LEFT", "LEFT_SEEN"};
constexpr const char* EVENTS[] = {
    "occupied, a body that may account for it",
    "occupied, only others",
    "occupied, nobody",
    "occupied, nobody, and something was found there since the map before",
    "occupied, nobody, and nothing was found there since the map before",
    "occupied, nobody, at a body's seam",
    "free, a body that may account for it",
    "free, only others, or a body's seam",
    "free, nobody",
    "the map's seam",
};

VoxelState next(std::size_t state, std::size_t event) {
  return nextState(static_cast<VoxelState>(state), static_cast<VoxelEvent>(event));
}

TEST(VoxelStates, TheTableIsThatOfThePage) {
  std::ifstream page(std::string(DEFORMABLE_CCD_SOURCE_DIR) + "/doc/algorithm.md");
  std::size_t rows = 0;
  for (std::string line; std::getline(page, line);) {
    for (std::size_t event = 0; event < VOXEL_EVENTS; ++event) {
      if (line.rfind("| " + std::string(EVENTS[event]) + " |", 0) != 0) continue;
      ++rows;
      std::istringstream cells(line.substr(line.find('|', 1) + 1));
      for (std::size_t state = 0; state < VOXEL_STATES; ++state) {
        std::string cell;
        std::getline(cells, cell, '|');
        EXPECT_EQ(cell, " " + std::string(STATES[static_cast<std::size_t>(next(state, event))]) + " ") << line;
      }
    }
  }
  EXPECT_EQ(rows, VOXEL_EVENTS);
}

/// One voxel, and two bodies, each a small triangle that is beside it or 2 m away.
class OneVoxel {
 public:
  /// OCCUPIED: by a map that does not tell what was found.
  enum Shows { OCCUPIED, FOUND, UNFOUND, FREE, LEFT_OUT };
  /// A map, and the bodies until then: at its stamp they are where they are told to be.
  void look(Shows shows, bool first, bool second, int pause_ms = 100) {
    const StampNs from = now_;
    now_ += pause_ms * MS;
    move(0, from, first);
    move(1, from, second);
    ObstacleMap map;
    const bool is_occupied = shows == OCCUPIED || shows == FOUND || shows == UNFOUND;
    std::vector<OccupiedLeaf> occupied{voxelAt(90, 90, 90)}, known = occupied;
    if (is_occupied) occupied.push_back(voxelAt(5, 5, 5));
    if (shows != LEFT_OUT) known.push_back(voxelAt(5, 5, 5));
    known.push_back(voxelAt(-90, 0, 0));  // there is something free
    map.surface = VoxelSurface::build(VOXEL_M, occupied);
    std::vector<OccupiedLeaf> found;
    if (shows == FOUND) found.push_back(voxelAt(5, 5, 5));
    map.known = shows == OCCUPIED ? KnownSpace::build(VOXEL_M, known) : KnownSpace::build(VOXEL_M, known, found);
    map.map_from_fixed = map_from_fixed_;
    map.stamp_ns = now_;
    map.frame_id = "map";
    reduced_ =
        finder_.reduce(map, nullptr, {{0, "first", 0.05, &stores_[0]}, {1, "second", 0.05, &stores_[1]}}, 0, false);
  }
  /// The next map is one of a frame that is elsewhere.
  void moveMap() { map_from_fixed_.translation().x() += VOXEL_M; }
  /// Frames of the first body are missing up to the next map.
  void loseFirst() { lost_ = true; }

  bool isOwn() const { return reduced_.own.own == 1; }
  bool isDoubted() const { return reduced_.own.doubted == 1; }
  bool isObstacle() const { return reduced_.surface->leafCount() == 2; }

 private:
  static MeshStoreOptions fast() {
    MeshStoreOptions options;
    options.max_vertex_step_m = 0;
    return options;
  }
  MeshStore stores_[2] = {MeshStore(fast()), MeshStore(fast())};
  const std::shared_ptr<const Topology> topology_ = share(Topology::fromTriangles(3, {{0, 1, 2}}));
  OwnVoxelFinder finder_;
  Eigen::Isometry3d map_from_fixed_ = Eigen::Isometry3d::Identity();
  StampNs now_ = 1000 * MS;
  bool lost_ = false;
  bool was_near_[2] = {false, false};
  ObstacleMap reduced_;

  /// It comes, or goes, half way between two maps.
  void move(int body, StampNs from, bool near) {
    const auto push = [&](StampNs stamp_ns, bool is_near) {
      const double z = is_near ? 0.55 : 2.55;
      Positions at{{0.52, 0.52, z}, {0.58, 0.52, z}, {0.52, 0.58, z}};
      for (Vec3& p : at) p = map_from_fixed_.inverse() * p;
      stores_[body].push({stamp_ns, topology_, at});
    };
    const bool is_lost = body == 0 && std::exchange(lost_, body == 0 ? false : lost_);
    const StampNs middle = from + (now_ - from) / 2;
    if (stores_[body].empty()) push(from, near);
    for (StampNs t = from + 100 * MS; !is_lost && t < middle; t += 100 * MS) push(t, was_near_[body]);
    if (!is_lost) push(middle, was_near_[body]);
    for (StampNs t = middle + 10 * MS; !is_lost && t < now_; t += 100 * MS) push(t, near);
    push(now_, near);
    was_near_[body] = near;
  }
};

/// Brings the voxel into the state; nobody is near from then on, as far as the state allows.
void begin(OneVoxel& world, VoxelState state) {
  switch (state) {
    case VoxelState::UNKNOWN:
      return world.look(OneVoxel::FREE, true, false);
    case VoxelState::FREE:
      return world.look(OneVoxel::FREE, false, false);
    case VoxelState::OWN:
      world.look(OneVoxel::FREE, false, false);
      world.look(OneVoxel::OCCUPIED, true, false);
      ASSERT_TRUE(world.isOwn());
      return;
    case VoxelState::OBSTACLE:
      world.look(OneVoxel::FREE, false, false);
      world.look(OneVoxel::OCCUPIED, false, false);
      ASSERT_TRUE(world.isObstacle());
      return;
    case VoxelState::DOUBT:
      world.look(OneVoxel::OCCUPIED, true, false);
      ASSERT_TRUE(world.isDoubted());
      return;
    case VoxelState::LEFT:
      begin(world, VoxelState::OWN);
      world.look(OneVoxel::UNFOUND, false, false);
      ASSERT_TRUE(world.isOwn()) << "it was near when this look began";
      world.look(OneVoxel::UNFOUND, false, false);
      ASSERT_TRUE(world.isDoubted());
      return;
    case VoxelState::LEFT_SEEN:
      begin(world, VoxelState::LEFT);
      return world.look(OneVoxel::FOUND, false, false);
  }
}

bool isLeft(VoxelState state) { return state == VoxelState::LEFT || state == VoxelState::LEFT_SEEN; }

void apply(OneVoxel& world, VoxelState state, VoxelEvent event) {
  const auto goAway = [&] {  // within this look the first body is near at its beginning
    if (state == VoxelState::UNKNOWN) world.look(OneVoxel::FREE, false, false);
    if (state == VoxelState::OWN || state == VoxelState::DOUBT) world.look(OneVoxel::OCCUPIED, false, false);
  };
  switch (event) {
    case VoxelEvent::OCCUPIED_WITH_OWNER:
      return world.look(OneVoxel::OCCUPIED, true, false);
    case VoxelEvent::OCCUPIED_WITH_OTHER:
      goAway();
      if (state == VoxelState::OWN || isLeft(state)) return world.look(OneVoxel::OCCUPIED, false, true);
      return world.look(OneVoxel::OCCUPIED, true, false, 700);  // within reach in a part of a gap
    case VoxelEvent::OCCUPIED_ALONE:
      goAway();
      return world.look(OneVoxel::OCCUPIED, false, false);
    case VoxelEvent::FOUND_ALONE:
      goAway();
      return world.look(OneVoxel::FOUND, false, false);
    case VoxelEvent::UNFOUND_ALONE:
      goAway();
      return world.look(OneVoxel::UNFOUND, false, false);
    case VoxelEvent::OCCUPIED_AT_SEAM:
      goAway();
      world.loseFirst();
      return world.look(OneVoxel::OCCUPIED, false, false, 700);
    case VoxelEvent::FREE_WITH_OWNER:
      return world.look(OneVoxel::FREE, true, false);
    case VoxelEvent::FREE_WITH_OTHER:
      goAway();
      if (state == VoxelState::OWN || isLeft(state)) return world.look(OneVoxel::FREE, false, true);
      return world.look(OneVoxel::FREE, true, false, 700);
    case VoxelEvent::FREE_ALONE:
      goAway();
      return world.look(OneVoxel::FREE, false, false);
    case VoxelEvent::MAP_SEAM:
      goAway();
      world.moveMap();
      return world.look(OneVoxel::FREE, true, false);
  }
}

TEST(VoxelStates, EachCellHolds) {
  for (std::size_t s = 0; s < VOXEL_STATES; ++s) {
    for (std::size_t e = 0; e < VOXEL_EVENTS; ++e) {
      SCOPED_TRACE(std::string(STATES[s]) + ", " + EVENTS[e]);
      const VoxelState state = static_cast<VoxelState>(s), after = next(s, e);
      const VoxelEvent event = static_cast<VoxelEvent>(e);
      OneVoxel world;
      begin(world, state);
      apply(world, state, event);
      const bool is_free = event >= VoxelEvent::FREE_WITH_OWNER;
      if (!is_free) {
        EXPECT_EQ(world.isOwn(), after == VoxelState::OWN);
        EXPECT_EQ(world.isDoubted(), after == VoxelState::DOUBT || isLeft(after));
        EXPECT_EQ(world.isObstacle(), after == VoxelState::OBSTACLE);
        if (!world.isDoubted()) continue;
        // One more look that finds something tells the two apart; theirs again they are without.
        OneVoxel again;
        begin(again, state);
        apply(again, state, event);
        if (after == VoxelState::LEFT_SEEN) again.look(OneVoxel::FOUND, false, false);
        again.look(OneVoxel::OCCUPIED, true, false);
        world.look(OneVoxel::OCCUPIED, true, false);
        EXPECT_EQ(again.isOwn(), after == VoxelState::LEFT);
        EXPECT_EQ(world.isOwn(), isLeft(after)) << "theirs again";
        continue;
      }
      EXPECT_FALSE(world.isOwn() || world.isDoubted() || world.isObstacle());
      // What comes of it with a body near tells the free ones apart, and what was hidden.
      world.look(OneVoxel::OCCUPIED, true, false);
      EXPECT_EQ(world.isOwn(), after == VoxelState::FREE);
      EXPECT_EQ(world.isDoubted(), after == VoxelState::UNKNOWN);
      EXPECT_EQ(world.isObstacle(), after == VoxelState::OBSTACLE);
    }
  }
}

// What nobody looks at is free, but for what a body has rested beside for longer than a gap.
TEST(VoxelStates, WhatIsLeftOutIsFreeUntilABodyRestsThere) {
  for (const int looks : {1, 2, 3, 4, 5}) {
    OneVoxel world;
    world.look(OneVoxel::LEFT_OUT, false, false, 200);
    for (int k = 0; k < looks; ++k) world.look(OneVoxel::LEFT_OUT, true, false, 200);
    world.look(OneVoxel::OCCUPIED, true, false, 200);
    EXPECT_EQ(world.isOwn(), looks < 3) << looks;
    EXPECT_EQ(world.isDoubted(), looks >= 3) << looks;
  }
  OneVoxel first;  // what was there before the first map nobody knows
  first.look(OneVoxel::LEFT_OUT, true, false, 200);
  first.look(OneVoxel::OCCUPIED, true, false, 200);
  EXPECT_TRUE(first.isDoubted());
}

}  // namespace
}  // namespace test
}  // namespace dccd
