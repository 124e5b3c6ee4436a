// Worlds in which an obstacle was taken for a body, or a body for an obstacle: what a monitor says of each.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "dccd/assurance.h"
#include "obstacle/voxel_tree.h"
#include "stream/rigid_shape.h"
#include "support/closed_meshes.h"
#include "support/shapes.h"
#include "unit/stream/monitor_support.h"

namespace dccd {
namespace test {
namespace {

constexpr double VOXEL_M = 0.02;
constexpr StampNs HZ_10 = 100 * MS;

using Cell = std::array<int, 3>;
using Cells = std::set<Cell>;

int cellOf(double x) { return static_cast<int>(std::floor(x / VOXEL_M)); }

/// The voxels that a box of space meets.
Cells cellsOf(const Vec3& low, const Vec3& high) {
  Cells cells;
  for (int x = cellOf(low.x()); x <= cellOf(high.x()); ++x) {
    for (int y = cellOf(low.y()); y <= cellOf(high.y()); ++y) {
      for (int z = cellOf(low.z()); z <= cellOf(high.z()); ++z) cells.insert({x, y, z});
    }
  }
  return cells;
}
Cells operator+(Cells a, const Cells& b) {
  a.insert(b.begin(), b.end());
  return a;
}
std::vector<OccupiedLeaf> leavesOf(const Cells& cells) {
  std::vector<OccupiedLeaf> leaves;
  for (const auto& [x, y, z] : cells) leaves.push_back(voxelAt(x, y, z));
  return leaves;
}

/// Two bodies, sheets of 0.1 m side, or boxes if they are links, and a sensor.
class OwnWorlds : public ::testing::Test {
 protected:
  enum { CLOTH, LINK };
  /// From corner on, 0.1 m each way.
  struct Place {
    Vec3 corner;
    double height_m = 0;  // of a link
    Cells cells() const { return cellsOf(corner, corner + Vec3(0.1, 0.1, height_m)); }
  };

  void SetUp() override { start(); }
  void start(double cloth_reach_m = ONE_VOXEL, double link_reach_m = ONE_VOXEL) {
    Body cloth = named("cloth"), link = named("link");
    cloth.own_voxels_m = cloth_reach_m;
    link.own_voxels_m = link_reach_m;
    link.rigid = true;
    MonitorOptions options = loose();
    options.detector.obstacle_expected = true;
    options.own_voxels_lag_s = 0;
    monitor_ = std::make_unique<Monitor>(options, std::vector<Body>{cloth, link});
    now_ = 0;
    map_from_fixed_.setIdentity();
  }

  /// What the sensor says: all that it does not show as occupied it shows as free, but for what it does not see.
  /// seen_seldom: not often enough for an obstacle.
  void map(const Cells& occupied, const std::function<bool(const Cell&)>& sees = nullptr, bool finds = true,
           const Cells& seen_seldom = {}) {
    ObstacleMap map;
    map.surface = VoxelSurface::build(VOXEL_M, leavesOf(occupied));
    map.stamp_ns = now_;
    map.frame_id = "map";
    map.map_from_fixed = map_from_fixed_;
    Cells known = occupied;
    for (const Cell& cell : room_) {
      if (!sees || sees(cell)) known.insert(cell);
    }
    std::vector<OccupiedLeaf> found;
    if (finds) found = leavesOf(occupied + seen_seldom);
    std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return codeOf(a) < codeOf(b); });
    map.known = KnownSpace::build(VOXEL_M, leavesOf(known), found);
    if (!seen_seldom.empty()) map.own.doubted_surface = VoxelSurface::build(VOXEL_M, leavesOf(seen_seldom));
    monitor_->setMap(std::move(map));
  }
  /// A step; the bodies are there at its end.
  Outcome go(const Place& cloth, const Place& link, StampNs step_ns = HZ_10) {
    now_ += step_ns;
    monitor_->push(LINK, linkAt(link), NOW);
    monitor_->push(CLOTH, clothAt(cloth), NOW);
    return only(*monitor_);
  }
  MeshFrame clothAt(const Place& place) const {
    static const auto topology = share(Topology::grid(6, 6));
    return {now_, topology, fixed(gridAt(6, 6, 0.02, place.corner))};
  }
  MeshFrame linkAt(const Place& place) const {
    static const StepBody box = test::box(Vec3::Zero(), Vec3::Ones());
    static const auto topology = share(Topology(box.topology));
    MeshFrame frame{now_, topology, box.t0, true, Eigen::Isometry3d::Identity()};
    for (Vec3& p : frame.positions) p = p.cwiseProduct(Vec3(0.1, 0.1, place.height_m)) + place.corner;
    frame.positions = fixed(frame.positions);
    frame.pose = map_from_fixed_.inverse() * Eigen::Translation3d(place.corner);
    return frame;
  }
  Positions fixed(Positions at) const {
    for (Vec3& p : at) p = map_from_fixed_.inverse() * p;
    return at;
  }
  static bool isClear(const Outcome& outcome) { return assuranceOf(outcome).clear(); }
  static std::uint64_t own(const Outcome& outcome) { return outcome.step->map.own.own; }
  static std::uint64_t doubted(const Outcome& outcome) { return outcome.step->map.own.doubted; }

  StampNs now_ = 0;
  Eigen::Isometry3d map_from_fixed_ = Eigen::Isometry3d::Identity();
  const Cells room_ = cellsOf({-0.1, -0.1, -0.1}, {0.5, 0.3, 0.3});
  const Place far_{{3, 0.001, 0.001}, 0.1};
  std::unique_ptr<Monitor> monitor_;
};

// A table first shown 60 mm from a link; the link is then 2 m away, and the cloth goes through the table.
TEST_F(OwnWorlds, ATableFirstShownBesideALinkIsNobodysOnceThatIsAway) {
  for (const bool finds : {true, false}) {
    start(0, 0.1);
    const Cells table = cellsOf({0.001, 0.001, 0.001}, {0.3, 0.2, 0.019});
    const Place beside{{0.1, 0.05, 0.081}, 0.1}, above{{0.101, 0.051, 0.2}};
    go(above, beside);
    map(table + beside.cells(), nullptr, finds);
    go(above, beside);
    for (double x = 0.1; x < 2; x += 0.2) {
      go(above, {{x, 0.05, 0.081}, 0.1});
      map(table, nullptr, finds);
    }
    const Assurance through = assuranceOf(go({{0.101, 0.051, -0.05}}, {{2.1, 0.05, 0.081}, 0.1}));
    EXPECT_FALSE(through.clear()) << finds;
    EXPECT_EQ(through.touching, finds ? Touching::NEW : Touching::NONE);
  }
}

TEST_F(OwnWorlds, ADoubtThatAMapLeavesOutComesBackAsADoubt) {
  const Place rests{{0.101, 0.051, 0.051}};
  go(rests, far_);
  map(rests.cells());
  EXPECT_EQ(doubted(go(rests, far_)), rests.cells().size());
  map({}, [&](const Cell& cell) { return rests.cells().count(cell) == 0; });
  go(rests, far_);
  map(rests.cells());
  const Outcome back = go(rests, far_);
  EXPECT_EQ(doubted(back), rests.cells().size());
  EXPECT_FALSE(isClear(back));
}

TEST_F(OwnWorlds, APrunedLeafThatVanishesNearABodyComesBackAsAnObstacle) {
  const Cells block = cellsOf({0.161, 0.081, 0.081}, {0.199, 0.119, 0.119});  // one leaf of 2 voxels a side
  const auto pruned = [&] {
    ObstacleMap map;
    map.surface = VoxelSurface::build(VOXEL_M, {voxelAt(8, 4, 4, 2)});
    map.stamp_ns = now_;
    map.frame_id = "map";
    map.known = KnownSpace::build(VOXEL_M, leavesOf(room_ + block));
    monitor_->setMap(std::move(map));
  };
  const Place beside{{0.05, 0.05, 0.101}};
  go({{0.05, 0.05, 0.25}}, far_);
  pruned();
  go({{0.05, 0.05, 0.25}}, far_);
  go(beside, far_);
  map(beside.cells());
  go(beside, far_);
  map(beside.cells() + block);
  go(beside, far_);
  EXPECT_FALSE(isClear(go({{0.101, 0.05, 0.101}}, far_)));
}

// The same keys are other places.
TEST_F(OwnWorlds, WhereTheMapsFrameMovedNoKeyIsOwn) {
  const Place rests{{0.101, 0.051, 0.051}};
  map({});
  go(rests, far_);
  map(rests.cells());
  ASSERT_EQ(own(go(rests, far_)), rests.cells().size());
  map_from_fixed_.translation().z() += 5 * VOXEL_M;  // the frame, and the bodies with it
  go(rests, far_);
  map(rests.cells());
  const Outcome moved = go(rests, far_);
  EXPECT_EQ(own(moved), 0u);
  EXPECT_EQ(doubted(moved), rests.cells().size());
}

// fixed_frame is not given, and was learnt from the mesh: the camera's, which the arm moves. The way of the cloth is
// placed by the newest pose, and seems to come from where it never was.
TEST_F(OwnWorlds, WhereTheFixedFrameMovesNothingIsOwn) {
  const Place rests{{0.101, 0.051, 0.051}};
  map({});
  for (int k = 0; k < 8; ++k) {
    map_from_fixed_.translation().x() += 0.05;
    go(rests, far_);
    map(rests.cells() + cellsOf({0.14, 0.09, 0.1}, {0.16, 0.1, 0.1}));
    EXPECT_EQ(own(go(rests, far_)), 0u) << k;
  }
}

TEST_F(OwnWorlds, FacesThatAreTurnedTheOtherWayMakeNoInside) {
  StepBody body = box(Vec3::Zero(), {0.1, 0.1, 0.1});
  for (int turned = 0; turned < 64; ++turned) {
    std::vector<Face> faces = body.topology.faces();
    for (std::size_t f = 0; f < faces.size(); ++f) {
      if (turned >> (f / 2) & 1) std::swap(faces[f][1], faces[f][2]);
    }
    for (const double out : {0.25, 0.05, -0.05}) {
      EXPECT_EQ(isInside(body.t0, faces, {0.05, 0.05, 0.1 + out}), out < 0) << turned << ' ' << out;
    }
  }
}

// A tracker loses the cloth for 0.7 s while it is carried: where the map showed it meanwhile is no obstacle.
TEST_F(OwnWorlds, WhereTheTrackerLostTheClothIsNoObstacle) {
  const auto at = [](double x) { return Place{{x, 0.051, 0.101}}; };
  map({});
  go(at(0.001), far_);
  map(at(0.001).cells());
  go(at(0.001), far_);
  for (int k = 1; k <= 7; ++k) {  // frames of the link alone
    now_ += HZ_10;
    monitor_->push(LINK, linkAt(far_), NOW);
    map(at(0.001 + 0.03 * k).cells());
  }
  for (double x = 0.211; x > 0.01; x -= 0.02) {
    const Outcome outcome = go(at(x), far_);
    EXPECT_EQ(outcome.touching, Touching::NONE) << x;
    map(at(x).cells());
  }
}

// A camera that turns sees the table below the cloth for the first time, some of it free at first: a ray grazed it.
TEST_F(OwnWorlds, WhatIsFirstSeenBelowTheClothIsNotTheCloths) {
  const Cells table = cellsOf({0.001, 0.001, 0.001}, {0.3, 0.2, 0.039});
  const Place rests{{0.101, 0.051, 0.051}};
  const auto sees = [&](bool grazes) {
    return [&, grazes](const Cell& cell) { return table.count(cell) == 0 || (grazes && (cell[0] + cell[1]) % 2 == 0); };
  };
  map({}, sees(false));
  go(rests, far_);
  map(rests.cells(), sees(false));
  ASSERT_TRUE(isClear(go(rests, far_)));
  map(rests.cells(), sees(true));
  go(rests, far_);
  map(rests.cells() + table);
  EXPECT_FALSE(isClear(go(rests, far_))) << "the cloth's voxels touch the table's, and may hold some of it";
  EXPECT_FALSE(isClear(go({{0.101, 0.051, 0.031}}, far_))) << "from above into it";
}

// A hand of several voxels comes from the side, as fast as hands do, to a cloth and to a link that rest. Then these go
// into it.
TEST_F(OwnWorlds, AHandThatComesIsNeverTheirs) {
  for (const double speed : {0.1, 0.3, 1.0, 2.0}) {
    for (const StampNs step_ns : {33 * MS, 100 * MS, 200 * MS}) {
      for (const int body : {CLOTH, LINK}) {
        start();
        const Place rests{{0.101, 0.051, 0.051}, 0.05};
        const auto bodies = [&](const Place& place) {
          return body == CLOTH ? go(place, far_, step_ns) : go(far_, place, step_ns);
        };
        const Cells seen = body == CLOTH ? Place{rests.corner}.cells() : rests.cells();
        map({});
        bodies(rests);
        map(seen);
        ASSERT_TRUE(isClear(bodies(rests)));
        double front = 0.5;
        while (front > 0.221) {  // its voxels end 0.02 m beside the body's
          front = std::max(0.221, front - speed * step_ns * 1e-9);
          map(seen + cellsOf({front, 0.06, 0.03}, {front + 0.15, 0.14, 0.12}));
          // Where their voxels touch, the body's own may hold some of the hand.
          EXPECT_EQ(isClear(bodies(rests)), front > 0.241) << "it is beside them, at " << front;
        }
        EXPECT_FALSE(isClear(bodies({{0.131, 0.051, 0.051}, 0.05}))) << speed << " m/s, " << step_ns << ' ' << body;
      }
    }
  }
}

// It comes while maps are missing, or they come less than once a second.
TEST_F(OwnWorlds, AHandThatComesBetweenSeldomMapsIsNotTheCloths) {
  const Place rests{{0.101, 0.051, 0.051}};
  for (const auto& [pause_ms, from, speed] : {std::tuple{1600, 0.24, 0.0}, std::tuple{1100, 0.5, 0.1}}) {
    start();
    map({});
    go(rests, far_);
    map(rests.cells());
    ASSERT_TRUE(isClear(go(rests, far_)));
    for (double front = from; front > 0.221;) {
      for (int k = 0; k < pause_ms / 100; ++k) go(rests, far_);
      front = std::max(0.221, front - (speed > 0 ? speed * pause_ms * 1e-3 : 1));
      map(rests.cells() + cellsOf({front, 0.06, 0.03}, {0.6, 0.14, 0.12}));
    }
    go(rests, far_);
    EXPECT_FALSE(isClear(go({{0.131, 0.051, 0.051}}, far_))) << pause_ms;
  }
}

// All of it is within the cloth's reach, for longer than what comes from outside is new.
TEST_F(OwnWorlds, AThingThatSlidesBelowTheClothIsNotTheCloths) {
  for (const double speed : {0.05, 0.1, 0.3}) {
    start();
    const Place rests{{0.101, 0.051, 0.061}};
    const auto thingAt = [](double x) { return cellsOf({x, 0.061, 0.041}, {x + 0.04, 0.139, 0.059}); };
    map({});
    go(rests, far_);
    map(rests.cells());
    for (int k = 0; k < 6; ++k) {
      go(rests, far_);
      map(rests.cells());
    }
    for (double x = 0.4; x > 0.12; x -= speed * 0.1) {
      go(rests, far_);
      map(rests.cells() + thingAt(x));
    }
    go(rests, far_);
    EXPECT_FALSE(isClear(go({{0.101, 0.051, 0.05}}, far_))) << speed;
  }
}

// Something first appears beside a cloth, which then leaves it for a while in which nobody looks, or once.
TEST_F(OwnWorlds, WhatAClothLeftForLongIsNotItsOwnAgain) {
  const Cells cup = cellsOf({0.121, 0.071, 0.041}, {0.179, 0.13, 0.059});
  const Place onto{{0.101, 0.051, 0.065}}, above{{0.101, 0.051, 0.2}}, into{{0.101, 0.051, 0.05}};
  for (const int looks : {20, 35}) {
    for (const bool is_found : {false, true}) {
      start();
      map({});
      go(above, far_);
      map(above.cells());
      go(onto, far_);
      map(onto.cells() + cup);
      for (int k = 0; k < looks; ++k) {
        go(above, far_);
        map(above.cells() + cup, nullptr, is_found && k == 1);
      }
      go(onto, far_);
      map(onto.cells() + cup, nullptr, false);
      EXPECT_EQ(isClear(go(into, far_)), looks < 30) << looks << ' ' << is_found;
    }
  }
}

// A hand comes from above onto a cloth that fills its own layer of voxels, and through it: no voxel in which the cloth
// is tells of the hand. Once that is gone, the cloth's are its own again.
TEST_F(OwnWorlds, AHandInTheClothsOwnLayerIsNotTheCloths) {
  for (const double thickness_m : {0.02, 0.04, 0.06}) {
    start();
    const Place rests{{0.101, 0.051, 0.051}};
    const auto handFrom = [&](double z) {
      return cellsOf({0.141, 0.091, z}, {0.141 + thickness_m - 0.002, 0.091 + thickness_m - 0.002, 0.29});
    };
    map({});
    go(rests, far_);
    map(rests.cells());
    ASSERT_TRUE(isClear(go(rests, far_)));
    for (double z = 0.27; z > 0; z -= 0.05) {
      map(rests.cells() + handFrom(z));
      EXPECT_EQ(isClear(go(rests, far_)), z > 0.08) << thickness_m << ", from " << z;
    }
    map(rests.cells());
    EXPECT_TRUE(isClear(go(rests, far_))) << thickness_m << ", gone";
  }
}

// Where a hand comes from above, own voxels end at the cloth's reach: none appears between the two.
TEST_F(OwnWorlds, AHandThatEntersOwnVoxelsIsNotTheCloths) {
  const Place rests{{0.101, 0.051, 0.051}};
  const Cells layer = rests.cells(), thick = layer + Place{{0.101, 0.051, 0.071}}.cells();
  for (const auto& [reach_m, seen] : {std::pair{0.005, layer}, std::pair{ONE_VOXEL, thick}}) {
    start(reach_m);
    map({});
    go(rests, far_);
    map(seen);
    ASSERT_TRUE(isClear(go(rests, far_)));
    for (double z = 0.201; z > 0.03; z -= 0.02) {
      map(seen + cellsOf({0.141, 0.091, z}, {0.179, 0.129, 0.29}));
      const bool is_clear = isClear(go(rests, far_));
      if (z > 0.11) EXPECT_TRUE(is_clear) << reach_m << ", from " << z;
      if (z < 0.05) EXPECT_FALSE(is_clear) << reach_m << ", from " << z;
    }
    for (int k = 0; k < 15; ++k) {
      map(seen + cellsOf({0.141, 0.091, 0.041}, {0.179, 0.129, 0.29}));
      EXPECT_FALSE(isClear(go(rests, far_))) << reach_m << ", it stays, " << k;
    }
    map(seen);
    EXPECT_TRUE(isClear(go(rests, far_))) << reach_m << ", gone";
  }
}

// A sensor's first look shows some of a table as free, and its second one does not: no hand has come.
TEST_F(OwnWorlds, WhatTheFirstMapAloneShowsFreeHasNotGrown) {
  const Cells table = cellsOf({0.001, 0.001, 0.001}, {0.3, 0.2, 0.019});
  const Cells rim = cellsOf({0.141, 0.091, 0.021}, {0.179, 0.129, 0.039});
  const Place above{{0.101, 0.051, 0.2}}, rests{{0.101, 0.051, 0.051}};
  for (const StampNs step_ns : {33 * MS, 100 * MS, 500 * MS}) {
    for (const int looks : {1, 2, 3}) {
      start(0.005);
      map(table);
      for (int k = 1; k < looks; ++k) {
        go(above, far_, step_ns);
        map(table + above.cells());
      }
      go(rests, far_, step_ns);
      map(table + rim + rests.cells());
      EXPECT_EQ(isClear(go(rests, far_, step_ns)), looks == 1) << looks << ' ' << step_ns;
    }
  }
}

// A cup is seen below a cloth that sinks, too seldom for an obstacle while the cloth is out of reach: once it may be a
// sensor's noise, twice it is there. A doubt of the map's maker, so that only its own octree tells it.
TEST_F(OwnWorlds, WhatWasSeenTwiceWithNobodyNearIsNotTheCloths) {
  const Cells cup = cellsOf({0.121, 0.071, 0.041}, {0.179, 0.13, 0.059});
  for (const int looks : {1, 2, 3}) {
    start();
    const Place above{{0.101, 0.051, 0.2}}, near_cup{{0.101, 0.051, 0.065}}, into{{0.101, 0.051, 0.05}};
    map({});
    go(above, far_);
    map(above.cells());
    ASSERT_TRUE(isClear(go(above, far_)));
    for (int k = 0; k < looks; ++k) {
      map(above.cells(), nullptr, true, cup);
      EXPECT_TRUE(isClear(go(above, far_))) << "the cloth is above it";
    }
    go(near_cup, far_);
    if (looks < 3) {
      map(near_cup.cells(), nullptr, true, cup);
      EXPECT_EQ(isClear(go(into, far_)), looks < 2) << "not yet an obstacle";
      go(near_cup, far_);
    }
    map(near_cup.cells() + cup);
    go(near_cup, far_);
    EXPECT_EQ(isClear(go(into, far_)), looks < 2) << looks;
  }
}

// One pixel flies: what it left behind is still there in the maps of those who do not look.
TEST_F(OwnWorlds, WhatWasSeenOnceIsNotSeenAgainWhereNobodyLooks) {
  const Cells noise = cellsOf({0.121, 0.071, 0.041}, {0.121, 0.071, 0.059});
  const Place above{{0.101, 0.051, 0.2}}, into{{0.101, 0.051, 0.05}};
  map({});
  go(above, far_);
  for (const bool finds : {true, false, false}) {
    map(above.cells(), nullptr, finds, noise);
    ASSERT_TRUE(isClear(go(above, far_)));
  }
  go(into, far_);
  map(into.cells() + noise);
  EXPECT_TRUE(isClear(go(into, far_)));
}

// A bowl that a gripper sets down, and the cloth that comes to it once the gripper has gone.
TEST_F(OwnWorlds, WhatAGripperSetsDownIsNotTheCloths) {
  const Place above{{0.101, 0.051, 0.2}}, away{{0.101, 0.051, -0.5}, 0.1}, near_bowl{{0.101, 0.051, -0.01}, 0.04};
  const Cells bowl = cellsOf({0.121, 0.071, 0.041}, {0.179, 0.13, 0.059});
  map({});
  go(above, away);
  go(above, near_bowl);
  map(above.cells() + near_bowl.cells() + bowl);
  go(above, near_bowl);
  for (int k = 0; k < 3; ++k) {
    go(above, away);
    map(above.cells() + bowl, nullptr, false);
  }
  const Place onto{{0.101, 0.051, 0.065}}, into{{0.101, 0.051, 0.05}};
  go(onto, away);
  map(onto.cells() + bowl, nullptr, false);
  EXPECT_FALSE(isClear(go(into, away)));
}

// The towel keeps what is its own while the gripper leaves it, and rests for as long as nobody looks.
TEST_F(OwnWorlds, ATowelThatAGripperLaysKeepsItsOwn) {
  const Place lies{{0.101, 0.051, 0.051}}, grips{{0.101, 0.051, 0.06}, 0.1}, away{{0.101, 0.051, 1}, 0.1};
  map({});
  go(lies, grips);
  map(lies.cells() + grips.cells());
  go(lies, grips);
  go(lies, away);
  map(lies.cells());
  EXPECT_TRUE(isClear(go(lies, away)));
  map(lies.cells());
  EXPECT_TRUE(isClear(go(lies, away)));
  for (int k = 0; k < 20; ++k) go(lies, away);
  map(lies.cells());
  const Outcome rests = go(lies, away);
  EXPECT_TRUE(isClear(rests)) << describe(assuranceOf(rests));
  EXPECT_EQ(own(rests), lies.cells().size());
}

// A towel that lay for a while is carried away, and maps go on to show it where it lay, as something found or not. Once
// they show that free it is carried back through its own trail.
TEST_F(OwnWorlds, ALaidTowelGoesThroughItsOwnTrailOnceThatIsCleared) {
  for (const bool finds : {true, false}) {
    start();
    const auto at = [](int k) { return Place{{0.001 + 0.05 * k, 0.051, 0.051}}; };
    map({});
    for (int k = 0; k < 10; ++k) {
      go(at(0), far_);
      map(at(0).cells());
    }
    ASSERT_TRUE(isClear(go(at(0), far_)));
    for (int k = 1; k <= 6; ++k) {
      go(at(k), far_);
      map(at(0).cells() + at(k).cells(), nullptr, finds);
    }
    EXPECT_FALSE(isClear(go(at(0), far_))) << "no map has cleared it";
    go(at(6), far_);
    map(at(6).cells());
    const StampNs cleared_ns = now_;
    for (int k = 5; k >= 0; --k) {
      const Outcome back = go(at(k), far_);
      EXPECT_TRUE(isClear(back)) << finds << ", " << k << ": " << describe(assuranceOf(back));
      map(at(k).cells());
    }
    EXPECT_LE(now_, cleared_ns + 3000 * MS);
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
