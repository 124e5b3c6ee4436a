// With a minimum separation the obstacle test is never late, misses nothing closer than it, and reports nothing farther
// than it plus the tolerance.
#include <gtest/gtest.h>

#include <iostream>
#include <random>

#include "support/box_oracle.h"
#include "support/query_property.h"

namespace dccd {
namespace {

using test::ObstacleScene;

constexpr double RESOLUTION = 0.05;

ObstacleScene randomScene(std::mt19937_64& random) {
  std::uniform_real_distribution<double> place(-0.1, 0.25), step(-0.15, 0.15);
  ObstacleScene scene;
  scene.resolution_m = RESOLUTION;
  scene.leaves = {{{32768, 32768, 32768}, 2}, {{32770, 32768, 32768}, 1}, {{32768, 32770, 32769}, 1}};
  for (int i = 0; i < 3; ++i) {
    scene.t0.emplace_back(place(random), place(random), place(random));
    scene.t1.push_back(scene.t0.back() + Vec3(step(random), step(random), step(random)));
  }
  scene.topology = random() % 2 ? Topology::fromTriangles(3, {{0, 1, 2}}) : Topology::polyline(3);
  return scene;
}

/// The contact's feature and the leaf that it meets.
ObstacleScene onlyThese(const ObstacleScene& scene, const Contact& contact) {
  const std::size_t count = contact.kind == PairKind::VERTEX_VOXEL_FACE ? 1
                            : contact.kind == PairKind::EDGE_VOXEL_EDGE ? 2
                                                                        : 3;
  ObstacleScene alone;
  alone.resolution_m = scene.resolution_m;
  for (const OccupiedLeaf& leaf : scene.leaves) {
    if (leaf.min == contact.voxel) alone.leaves.push_back(leaf);
  }
  for (std::size_t i = 0; i < 3; ++i) {  // a vertex is an edge of no length
    const Index v = contact.vertex[std::min(i, count - 1)];
    alone.t0.push_back(scene.t0[v]);
    alone.t1.push_back(scene.t1[v]);
  }
  alone.topology = count == 3 ? Topology::fromTriangles(3, {{0, 1, 2}}) : Topology::polyline(3);
  return alone;
}

TEST(ObstacleSeparation, NeverLateNothingMissedNothingFarther) {
  std::mt19937_64 random(11);
  const int scenes = test::longRun() ? 20000 : 400;
  int within = 0, apart = 0, certain = 0, wide = 0, undecided = 0;
  ObstacleOptions options;
  options.accuracy.rung = Accuracy::CONSERVATIVE;
  options.accuracy.tolerance_m = 1e-6;
  options.accuracy.max_subdivisions = 1 << 16;
  for (int i = 0; i < scenes; ++i) {
    const ObstacleScene scene = randomScene(random);
    options.minimum_separation_m = (random() % 4 + 1) * 0.004;
    ObstacleCheck test(options);
    std::vector<Contact> contacts;
    ObstacleStats stats;
    const auto surface = VoxelSurface::build(scene.resolution_m, scene.leaves);
    test.run({*surface, scene.topology, scene.t0, scene.t1}, contacts, stats);
    double earliest = 2;
    for (const Contact& contact : contacts) earliest = std::min(earliest, contact.toc_lower);
    bool close = false;
    for (int k = 0; k <= 64; ++k) {
      const double t = k / 64.0;
      const double distance = test::distanceToBoxes(scene, t);
      if (distance > options.minimum_separation_m - 1e-9) continue;
      close = true;
      ASSERT_LE(earliest, t) << "distance " << distance << " of " << options.minimum_separation_m << "\n"
                             << test::describe(scene);
      break;
    }
    for (const Contact& contact : contacts) {
      undecided += contact.certainty != Certainty::CERTAIN;
      if (contact.certainty != Certainty::CERTAIN) continue;
      ASSERT_LE(test::distanceToBoxes(scene, contact.toc_lower), options.minimum_separation_m + 1.1e-6)
          << test::describe(scene);
      ASSERT_LE(test::distanceToBoxes(scene, contact.toc_upper), options.minimum_separation_m + 1.1e-6)
          << test::describe(scene);
      // At most 2^-20 of the step wide, or the feature stays within the tolerance of the separation from this leaf.
      ++certain;
      const double width = contact.toc_upper - contact.toc_lower;
      if (width <= 0x1p-20) continue;
      wide += width > 1e-3;  // of motions of 0.15 m a step: few
      const ObstacleScene alone = onlyThese(scene, contact);
      for (int k = 0; k <= 8; ++k) {
        ASSERT_LE(test::distanceToBoxes(alone, contact.toc_lower + width * k / 8),
                  options.minimum_separation_m + options.accuracy.tolerance_m + 1e-12)
            << test::describe(scene);
      }
    }
    ++(close ? within : apart);
  }
  std::cout << scenes << " scenes, closer than the separation " << within << ", apart " << apart << "\n";
  std::cout << certain << " certain contacts, " << wide << " of them longer than a thousandth of the step, "
            << undecided << " undecided\n";
  EXPECT_LT(wide, certain / 20);
  EXPECT_LT(undecided, certain / 50);
  EXPECT_GT(within, scenes / 10);
  EXPECT_GT(apart, scenes / 10);
}

double pointToBoxes(const ObstacleScene& scene, const Vec3& point) {
  double distance = 1e308;
  const Vec3 key_origin = Vec3::Constant(32768);
  for (const OccupiedLeaf& leaf : scene.leaves) {
    const Vec3 lo = (Vec3(leaf.min.x, leaf.min.y, leaf.min.z) - key_origin) * scene.resolution_m;
    const Vec3 hi = lo + Vec3::Constant(leaf.size * scene.resolution_m);
    distance = std::min(distance, (point - point.cwiseMax(lo).cwiseMin(hi)).norm());
  }
  return distance;
}

// The uncertainty of a point on an edge lies between those of its ends: no point may come closer than its own unseen,
// and no contact of the edge is farther than its most uncertain end asks for.
TEST(ObstacleSeparation, UncertainVerticesCarryTheirRadius) {
  std::mt19937_64 random(12);
  const int scenes = test::longRun() ? 20000 : 400;
  int within = 0, sure_apart = 0;
  ObstacleOptions options;
  options.accuracy.rung = Accuracy::CONSERVATIVE;
  options.accuracy.max_subdivisions = 1 << 16;
  for (int i = 0; i < scenes; ++i) {
    const ObstacleScene scene = randomScene(random);
    options.minimum_separation_m = random() % 2 ? 0.0 : 0.006;
    std::vector<double> radius(3, 0.0);
    radius[random() % 3] = 0.005 * static_cast<double>(1 + random() % 8);
    ObstacleCheck test(options);
    std::vector<Contact> contacts;
    ObstacleStats stats;
    const auto surface = VoxelSurface::build(scene.resolution_m, scene.leaves);
    test.run({*surface, scene.topology, scene.t0, scene.t1, 0, nullptr, radius.data()}, contacts, stats);
    for (const Edge& edge : scene.topology.edges()) {
      ObstacleScene alone = scene;
      alone.topology = Topology::polyline(2);
      alone.t0 = {scene.t0[edge[0]], scene.t0[edge[1]]};
      alone.t1 = {scene.t1[edge[0]], scene.t1[edge[1]]};
      const double separation = options.minimum_separation_m + std::max(radius[edge[0]], radius[edge[1]]);
      double earliest = 2;
      for (const Contact& c : contacts) {
        for (std::size_t k = 0; k < 3; ++k) {
          // Whatever says of the edge that it is near: itself, an end of it, a face at it.
          if (c.vertex[k] == edge[0] || c.vertex[k] == edge[1]) earliest = std::min(earliest, c.toc_lower);
        }
        const bool own = c.kind == PairKind::EDGE_VOXEL_EDGE && c.vertex[0] == edge[0] && c.vertex[1] == edge[1];
        if (!own || c.certainty != Certainty::CERTAIN) continue;
        ASSERT_LE(test::distanceToBoxes(alone, c.toc_lower), separation + 1.1e-6) << test::describe(scene);
      }
      bool close = false;
      for (int k = 0; k <= 64 * 16 && !close; ++k) {
        const double t = k / 16 / 64.0, on_edge = k % 16 / 15.0;
        const Vec3 from = (1 - t) * alone.t0[0] + t * alone.t1[0], to = (1 - t) * alone.t0[1] + t * alone.t1[1];
        const double radius_there = (1 - on_edge) * radius[edge[0]] + on_edge * radius[edge[1]];
        const double distance = pointToBoxes(scene, (1 - on_edge) * from + on_edge * to);
        if (distance > options.minimum_separation_m + radius_there - 1e-9) continue;
        close = true;
        ASSERT_LE(earliest, t) << "distance " << distance << ", radius " << radius_there << "\n"
                               << test::describe(scene);
      }
      ++(close ? within : sure_apart);
    }
  }
  std::cout << within << " edges came within their separation, " << sure_apart << " did not\n";
  EXPECT_GT(within, scenes / 4);
  EXPECT_GT(sure_apart, scenes / 4);
}

}  // namespace
}  // namespace dccd
