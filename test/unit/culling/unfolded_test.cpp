// Normal cone and contour test: certifies only what brute force with exact tests finds free of contacts.
#include "culling/unfolded.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "support/brute_force.h"
#include "support/closed_meshes.h"
#include "support/detector.h"
#include "support/surfaces.h"

namespace dccd {
namespace {

Outcome runStep(const Topology& topology, const Positions& t0, const Positions& t1, bool sought = true,
                double separation_m = 0, const std::vector<double>* radius_m = nullptr) {
  Options options;
  options.accuracy.rung = separation_m > 0 || radius_m ? Accuracy::CONSERVATIVE : Accuracy::EXACT;
  options.check_start_state = false;
  Body body;
  body.name = "cloth";
  body.topology = std::make_shared<const Topology>(topology);
  body.minimum_separation_m = separation_m;
  const Step step = test::stepOf(body, t0, t1, radius_m);
  return sought ? test::Detector(options).run(step) : test::bruteForce(step, options);
}

bool certified(const Topology& topology, const Positions& t0, const Positions& t1) {
  return runStep(topology, t0, t1, true).stats.unfolded_bodies == 1;
}

std::size_t trueContacts(const Topology& topology, const Positions& t0, const Positions& t1) {
  return runStep(topology, t0, t1, false).contacts.size();
}

/// A strip of two rows along a curve in the plane, optionally rising.
Positions strip(std::size_t count, double turns, double growth, double rise) {
  Positions p;
  for (const double inner : {0.0, 0.3}) {
    for (std::size_t i = 0; i < count; ++i) {
      const double s = static_cast<double>(i) / static_cast<double>(count - 1), angle = 2 * M_PI * turns * s;
      const double radius = 1 + inner + growth * s;
      p.emplace_back(radius * std::cos(angle), radius * std::sin(angle), rise * s);
    }
  }
  return p;
}

TEST(Unfolded, WavingClothIsCertified) {
  const Topology topology = Topology::grid(30, 40);
  Positions t0, t1;
  for (int r = 0; r < 30; ++r) {
    for (int c = 0; c < 40; ++c) {
      t0.emplace_back(0.02 * c, 0.02 * r, 0.03 * std::sin(0.3 * c + 0.2 * r));
      t1.emplace_back(0.02 * c + 0.001, 0.02 * r, 0.03 * std::sin(0.3 * c + 0.2 * r + 0.5) - 0.01);
    }
  }
  const Outcome result = runStep(topology, t0, t1, true);
  EXPECT_EQ(result.stats.unfolded_bodies, 1u);
  EXPECT_EQ(result.stats[Effect::SELF_COLLISION].in, 0u);
  EXPECT_EQ(trueContacts(topology, t0, t1), 0u);
  EXPECT_EQ(runStep(topology, t0, t1, true, 1e-4).stats.unfolded_bodies, 0u)
      << "not touching is not enough with a separation";
  std::vector<double> radius(1200, 0.0);
  EXPECT_EQ(runStep(topology, t0, t1, true, 0, &radius).stats.unfolded_bodies, 1u) << "a tracker that is sure";
  radius[77] = 0.03;
  const Outcome uncertain = runStep(topology, t0, t1, true, 0, &radius);
  EXPECT_EQ(uncertain.stats.unfolded_bodies, 0u) << "nor with a vertex that is only known to a radius";
  EXPECT_FALSE(uncertain.contacts.empty()) << "which reaches its neighbours";
}

TEST(Unfolded, WhatIsCertifiedHasNoContact) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  int certificates = 0, touching = 0;
  for (int round = 0; round < 1500; ++round) {
    // A cloth of random waves; a flat strip that closes on itself; one that winds above itself.
    const int kind = round % 3;
    const Topology topology = kind == 0 ? Topology::grid(5, 6) : Topology::grid(2, 16);
    Positions t0, t1;
    if (kind == 0) {
      for (int i = 0; i < 30; ++i) t0.emplace_back(i % 6, i / 6, 0);
    } else {
      const double turns = 0.8 + 0.3 * unit(random);
      t0 = strip(16, turns, kind == 1 ? 0.2 * unit(random) : 0, kind == 1 ? 0 : 0.5 * std::abs(unit(random)));
    }
    const double wave = std::exp2(2 * unit(random) - 2), motion = std::exp2(2 * unit(random) - 3);
    for (Vec3& p : t0) {
      const Vec3 by(unit(random), unit(random), unit(random));
      if (kind == 0) p += wave * by;
      t1.push_back(p + motion * Vec3(unit(random), unit(random), kind == 1 ? 0.0 : unit(random)));
    }
    const Eigen::Quaterniond turn =
        Eigen::Quaterniond(unit(random), unit(random), unit(random), unit(random)).normalized();
    const Vec3 shift = round % 5 ? Vec3(0, 0, 0) : Vec3(1e5, -3e5, 2e5);
    for (Positions* positions : {&t0, &t1}) {
      for (Vec3& p : *positions) p = turn * p + shift;
    }
    const std::size_t contacts = trueContacts(topology, t0, t1);
    touching += contacts > 0;
    if (!certified(topology, t0, t1)) continue;
    ++certificates;
    ASSERT_EQ(contacts, 0u) << "round " << round;
  }
  EXPECT_GT(certificates, 150);
  EXPECT_GT(touching, 150);
}

TEST(Unfolded, ContourKeepsASpiralFromBeingCertified) {
  // Every normal points up, but the second turn lies above the first, and sinks onto it.
  const Topology topology = Topology::grid(2, 60);
  const Positions high = strip(60, 1.5, 0, 0.4), low = strip(60, 1.5, 0, 0.0);
  EXPECT_FALSE(certified(topology, high, high));
  EXPECT_GT(trueContacts(topology, high, low), 0u);
  EXPECT_FALSE(certified(topology, high, low));
  EXPECT_TRUE(certified(topology, strip(60, 0.9, 0, 0.4), strip(60, 0.9, 0, 0.0))) << "less than a turn";
}

TEST(Unfolded, OnePieceTheSameWayRound) {
  const Positions square{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {3, 0, 0}, {4, 0, 0}, {3, 1, 0}};
  const auto isWhole = [&](const std::vector<Face>& faces) {
    const Topology topology = Topology::fromTriangles(square.size(), faces);
    return certified(topology, square, square);
  };
  EXPECT_TRUE(isWhole({{0, 1, 2}, {0, 2, 3}}));
  EXPECT_FALSE(isWhole({{0, 1, 2}, {0, 3, 2}})) << "opposite orientation";
  EXPECT_FALSE(isWhole({{0, 1, 2}, {0, 2, 3}, {4, 5, 6}})) << "two parts";
  EXPECT_FALSE(isWhole({{0, 1, 2}, {2, 4, 5}})) << "one vertex in common";
  EXPECT_FALSE(isWhole({{0, 1, 2}, {0, 2, 3}, {0, 2, 4}})) << "three faces at an edge";

  Positions ring = strip(12, 11.0 / 12, 0, 0);
  std::vector<Face> faces;
  for (Index i = 0; i < 12; ++i) {
    const Index j = (i + 1) % 12;
    faces.push_back({i, i + 12, j});
    faces.push_back({j, i + 12, j + 12});
  }
  EXPECT_FALSE(certified(Topology::fromTriangles(24, faces), ring, ring)) << "a hole";
  faces.pop_back();
  EXPECT_FALSE(certified(Topology::fromTriangles(24, faces), ring, ring)) << "a border that comes to a vertex twice";
  faces.pop_back();
  EXPECT_TRUE(certified(Topology::fromTriangles(24, faces), ring, ring));
}

TEST(Unfolded, NotAroundFacesTheOtherWayRoundOrThreeAtAnEdge) {
  const std::size_t side = 41;
  const Positions flat = test::rolled(side, 0);
  const std::vector<Face> faces = Topology::grid(side, side).faces();
  const auto isCertified = [&](const std::vector<Face>& list) {
    return certified(Topology::fromTriangles(side * side, list), flat, flat);
  };
  EXPECT_TRUE(isCertified(faces));
  std::vector<Face> turned = faces, three = faces, holed = faces;
  std::swap(turned[1600][1], turned[1600][2]);
  three.push_back({faces[1600][0], faces[1600][1], faces[10][0]});
  holed.erase(holed.begin() + 1640, holed.begin() + 1646);
  for (const std::vector<Face>& list : {turned, three, holed}) EXPECT_FALSE(isCertified(list));
  // Three more faces stand on the edges of one inside as a cap: the border is as it was, and the cap's tip may go
  // through the face.
  const auto [i, j, k] = faces[1640];
  const auto tip = static_cast<Index>(side * side);
  std::vector<Face> capped = faces;
  for (const Face& face : {Face{i, j, tip}, Face{j, k, tip}, Face{k, i, tip}}) capped.push_back(face);
  Positions with_tip = flat;
  with_tip.push_back((flat[i] + flat[j] + flat[k]) / 3);
  EXPECT_FALSE(certified(Topology::fromTriangles(side * side + 1, capped), with_tip, with_tip));
}

/// A sheet that waves, and a small ball that falls onto the middle of it.
test::TestStep struckSheet(double fall) {
  const std::size_t side = 61;
  test::TestStep step;
  step.bodies = {{}, test::ball({0.5, 0.5, 0.2}, 0.05, 1)};
  step.bodies[0].topology = Topology::grid(side, side);
  step.bodies[0].t0 = step.bodies[0].t1 = test::rolled(side, 0);
  for (Vec3& p : step.bodies[0].t1) p.z() += 0.01 * std::sin(9 * p.x());
  step.bodies[1].t1 = step.bodies[1].t0;
  for (Vec3& p : step.bodies[1].t1) p.z() -= fall;
  return step;
}

// The bounds of a certified body's leaves are made where another body asks for them, some of them after others have
// been shortened.
TEST(Unfolded, WhatOthersMeetOfItIsTheSame) {
  for (const bool earliest_only : {false, true}) {
    const test::TestStep step = struckSheet(0.4);
    std::vector<Outcome> outcomes;
    for (const int threads : {0, 1, 2}) {
      Options options;
      options.unfolded_test = threads > 0;
      options.earliest_only = earliest_only;
      options.num_threads = std::max(threads, 1);
      outcomes.push_back(test::Detector(options).run(step.motion()));
    }
    ASSERT_GT(outcomes[0].contacts.size(), 0u);
    EXPECT_LT(outcomes[0].contacts[0].toc_upper, 0.75) << "else no bounds are shortened";
    EXPECT_EQ(outcomes[0].stats.unfolded_bodies, 0u);
    for (const Outcome* culled : {&outcomes[1], &outcomes[2]}) {
      EXPECT_EQ(culled->stats.unfolded_bodies, 1u);
      EXPECT_EQ(culled->start_state, StartState::CLEAR);
      ASSERT_EQ(culled->contacts.size(), outcomes[0].contacts.size());
      for (std::size_t i = 0; i < culled->contacts.size(); ++i) {
        EXPECT_EQ(culled->contacts[i].vertex, outcomes[0].contacts[i].vertex);
        EXPECT_EQ(culled->contacts[i].toc_lower, outcomes[0].contacts[i].toc_lower);
      }
    }
  }
}

TEST(Unfolded, NothingWithoutAllVertices) {
  test::TestStep step = struckSheet(0.1);
  EXPECT_EQ(test::Detector().run(step.motion()).stats.unfolded_bodies, 1u);
  Step masked = step.motion();
  masked.bodies[0].vertex_mask = {5};
  EXPECT_EQ(test::Detector().run(masked).stats.unfolded_bodies, 0u);
}

TEST(Unfolded, AnotherDirectionIsTriedInTheNextStep) {
  // Its ends lie above each other, but not as they are seen from the side.
  Body body;
  body.topology = std::make_shared<const Topology>(Topology::grid(2, 60));
  const Positions low = strip(60, 1.1, 0, 0.5), high = strip(60, 1.1, 0, 0.52);
  const Step step = test::stepOf(body, low, high);
  test::Detector stream;
  std::vector<bool> certified;
  for (int i = 0; i < 30; ++i) certified.push_back(stream.run(step).stats.unfolded_bodies == 1);
  EXPECT_FALSE(certified[0]);
  const auto first = std::find(certified.begin(), certified.end(), true);
  EXPECT_LT(first - certified.begin(), 24);
  EXPECT_EQ(std::find(first, certified.end(), false), certified.end()) << "it keeps to the direction that held";
  EXPECT_EQ(trueContacts(*body.topology, low, high), 0u);
}

TEST(Unfolded, NothingIsCertifiedOfFoldsAndDegenerateFaces) {
  const Topology topology = Topology::grid(2, 3);
  const Positions flat{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 1, 0}, {1, 1, 0}, {2, 1, 0}};
  EXPECT_TRUE(certified(topology, flat, flat));
  Positions folded = flat;
  folded[2] = folded[0] + Vec3(0, 0, 0.1);
  folded[5] = folded[3] + Vec3(0, 0, 0.1);
  EXPECT_FALSE(certified(topology, flat, folded));
  Positions line = flat;
  for (Vec3& p : line) p.y() = 0;
  EXPECT_FALSE(certified(topology, line, line));
  const Positions point(6, Vec3(1, 2, 3));
  EXPECT_FALSE(certified(topology, point, point));
}

TEST(Unfolded, IsCertifiedOfAnySize) {
  const Topology topology = Topology::grid(2, 3);
  const Positions flat{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 1, 0}, {1, 1, 0}, {2, 1, 0}};
  for (const double size : {1e300, 1e-300, 1e-310}) {
    Positions scaled = flat, folded = flat;
    folded[2] = folded[0] + Vec3(0, 0, 0.1);
    folded[5] = folded[3] + Vec3(0, 0, 0.1);
    for (Positions* positions : {&scaled, &folded}) {
      for (Vec3& p : *positions) p *= size;
    }
    EXPECT_TRUE(certified(topology, scaled, scaled)) << size;
    EXPECT_FALSE(certified(topology, scaled, folded)) << size;
  }
}

}  // namespace
}  // namespace dccd
