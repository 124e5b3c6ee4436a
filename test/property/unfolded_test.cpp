// Random surfaces that are certified: none of their pairs is in contact, by brute force and the oracle, on every
// target. DEFORMABLE_CCD_LONG=1 runs 100,000 steps; DEFORMABLE_CCD_BLOCKS="FIRST COUNT" some of them, in thousands.
#include "culling/unfolded.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <optional>
#include <random>
#include <sstream>

#include "oracle/oracle.h"
#include "support/brute_force.h"
#include "support/detector.h"
#include "support/query_property.h"
#include "support/simd_targets.h"
#include "support/surfaces.h"

namespace dccd {
namespace {

Outcome bruteForce(const Step& step) {
  Options options;
  options.check_start_state = false;
  return test::bruteForce(step, options);
}

/// A band whose faces all point upwards, wound around an axis several times, each turn below the one before.
Positions wound(std::size_t side, double turns, double fall) {
  Positions x;
  for (std::size_t r = 0; r < side; ++r) {
    for (std::size_t k = 0; k < side; ++k) {
      const double s = static_cast<double>(k) / static_cast<double>(side - 1), angle = 2 * M_PI * turns * s;
      const double radius = 1 + 2 * static_cast<double>(r) / static_cast<double>(side);
      x.emplace_back(radius * std::cos(angle), -radius * std::sin(angle), fall * s);
    }
  }
  return x;
}

/// A grid whose first and last columns are one, the last turned upside down.
Topology moebius(std::size_t side) {
  const auto at = [side](std::size_t r, std::size_t k) {
    const bool joined = k + 1 == side;
    return static_cast<Index>((joined ? side - 1 - r : r) * side + (joined ? 0 : k));
  };
  std::vector<Face> faces;
  for (std::size_t r = 0; r + 1 < side; ++r) {
    for (std::size_t k = 0; k + 1 < side; ++k) {
      faces.push_back({at(r, k), at(r, k + 1), at(r + 1, k)});
      faces.push_back({at(r + 1, k), at(r, k + 1), at(r + 1, k + 1)});
    }
  }
  return Topology::fromTriangles(side * side, faces);
}

Positions moebiusAt(std::size_t side, double width, double flat) {
  Positions x;
  for (std::size_t r = 0; r < side; ++r) {
    for (std::size_t k = 0; k < side; ++k) {
      const double angle = 2 * M_PI * static_cast<double>(k) / static_cast<double>(side - 1);
      const double out = width * (2 * static_cast<double>(r) / static_cast<double>(side - 1) - 1);
      const double radius = 1 + out * std::cos(angle / 2);
      x.emplace_back(radius * std::cos(angle), radius * std::sin(angle), flat * out * std::sin(angle / 2));
    }
  }
  return x;
}

/// A flat band all around, whose ends lie side by side: they touch, by a number they overlap, or they are apart.
Positions closedBand(std::size_t side, int numbers) {
  Positions x = wound(side, 1, 0);
  for (std::size_t r = 0; r < side; ++r) {
    Vec3& end = x[r * side + side - 1];
    end = x[r * side];
    for (int i = 0; i < std::abs(numbers); ++i) end.y() = std::nextafter(end.y(), numbers);
  }
  return x;
}

/// Surfaces of 500 to 1,200 faces: sheets with a roll, or with a bend that may be one, with holes, wound ones, Moebius
/// bands, bands whose ends touch by a number; some with faces that are cut into three.
class RandomSurface {
 public:
  explicit RandomSurface(std::uint32_t seed) : random_(seed), kind_(seed % 9), n_(20 + random_() % 5) {
    Topology topology = kind_ == 6 ? moebius(n_) : Topology::grid(n_, n_);
    if (kind_ == 3) topology = withHoles(topology);
    const double size = std::exp2((seed % 5 == 0 ? 100 : 10) * unit()), wave = kind_ == 8 ? 0 : 0.06 * unit();
    const double noise = kind_ == 8 ? 0 : std::exp2(-4 - 12 * std::abs(unit()));
    const bool stays = kind_ == 8 && seed % 2 == 0;  // a rotation is no more exact
    const Eigen::Quaterniond turned =
        stays ? Eigen::Quaterniond::Identity() : Eigen::Quaterniond(unit(), unit(), unit(), unit()).normalized();
    const Vec3 shift = seed % 7 == 0 && !stays ? Vec3(1e5, -3e5, 2e5) * size : Vec3(0, 0, 0);
    bend_ = 0.1 + std::abs(unit());
    turn_ = 2 + 2 * std::abs(unit());
    const std::size_t picked = random_() % (n_ * n_);
    std::vector<Positions> ends;
    for (const double t : {0.0, 1.0}) {
      Positions x = formAt(t);
      // One vertex over its neighbours, and through them.
      if (kind_ == 4) x[picked] += Vec3(0.12, 0.09, t == 0 ? 0.03 : -0.03);
      // It becomes narrow, or turns over.
      const double flat = kind_ != 2 ? 1 : t == 0 ? 0.3 : 0.2 * unit();
      for (Vec3& p : x) {
        p += wave * Vec3(std::sin(5 * p.y()), std::sin(4 * p.x()), std::sin(5 * p.x() + p.y() + t));
        p.y() *= flat;
        p = size * (turned * Vec3(p + noise * Vec3(unit(), unit(), unit()))) + shift;
        // On a grid borders touch in a number, and faces are seen on edge.
        if (seed % 4 == 3 && kind_ != 8) p = (p / (0.02 * size)).array().round() * (0.02 * size);
      }
      ends.push_back(x);
    }
    if (seed % 3 == 1) topology = subdivided(topology, ends);
    Body body;
    body.topology = std::make_shared<const Topology>(topology);
    step_ = test::stepOf(body, ends[0], ends[1]);
  }
  const Step& step() const { return step_; }

 private:
  double unit() { return std::uniform_real_distribution<double>(-1, 1)(random_); }
  Positions formAt(double t) {
    switch (kind_) {
      case 1:
      case 2:
      case 7:
        return test::rolled(n_, 2 * bend_ + 0.3 * t * unit(), 0.1);
      case 4:
        return test::rolled(n_, 0.3 * unit());
      case 5:
        return wound(n_, 0.6 + bend_, t == 0 ? 1 : 0.2 * unit());
      case 6:
        return moebiusAt(n_, 0.1 + 0.3 * bend_, t == 0 ? 1 : unit());
      case 8:
        return closedBand(n_, static_cast<int>(random_() % 5) - 2);
      default:
        return test::rolled(n_, turn_ + t * unit(), 0.03);
    }
  }
  Topology withHoles(const Topology& whole) {
    std::vector<Face> faces = whole.faces();
    for (int i = 0; i < 4; ++i) faces.erase(faces.begin() + static_cast<std::ptrdiff_t>(random_() % faces.size()));
    return Topology::fromTriangles(whole.vertexCount(), faces);
  }
  /// Some faces get a vertex near their middle.
  Topology subdivided(const Topology& whole, std::vector<Positions>& ends) {
    std::vector<Face> faces = whole.faces();
    for (int i = 0; i < 60; ++i) {
      const std::size_t f = random_() % faces.size();
      const Face face = faces[f];
      const auto middle = static_cast<Index>(ends[0].size());
      const double b = 0.2 + 0.1 * unit(), c = 0.3 + 0.1 * unit();
      for (Positions& x : ends) x.push_back((1 - b - c) * x[face[0]] + b * x[face[1]] + c * x[face[2]]);
      faces[f] = {face[0], face[1], middle};
      faces.push_back({face[1], face[2], middle});
      faces.push_back({face[2], face[0], middle});
    }
    return Topology::fromTriangles(ends[0].size(), faces);
  }

  std::mt19937 random_;
  std::size_t kind_, n_;
  double bend_ = 0, turn_ = 0;
  Step step_;
};

struct Certified {
  SceneArrays scene;
  std::optional<Unfolded> unfolded;

  explicit Certified(const Step& step) {
    StepStats stats;
    scene.setBodies(step.bodies);
    scene.record(step, stats);
    unfolded.emplace(body());
    unfolded->run(body(), scene.vertices());
  }
  const SceneBody& body() const { return scene.bodies()[0]; }
};

/// The first seed, and how many.
std::pair<std::uint32_t, std::uint32_t> seedsToRun() {
  std::uint32_t first = 0, count = test::longRun() ? 100 : 0;
  if (const char* text = std::getenv("DEFORMABLE_CCD_BLOCKS")) std::istringstream(text) >> first >> count;
  return {1000 * first, count == 0 ? 225 : 1000 * count};
}

TEST(UnfoldedProperty, WhatIsCertifiedHasNoContact) {
  const auto [first_seed, rounds] = seedsToRun();
  std::size_t certified = 0, touching = 0, asked = 0;
  for (std::uint32_t seed = first_seed; seed < first_seed + rounds; ++seed) {
    const RandomSurface surface(seed);
    Certified c(surface.step());
    test::forEachTarget([&](const std::string& target) {
      Unfolded again(c.body());
      again.run(c.body(), c.scene.vertices());
      ASSERT_EQ(again.isCertified(), c.unfolded->isCertified()) << target;
    });
    const std::size_t contacts = bruteForce(surface.step()).contacts.size();
    touching += contacts > 0;
    if (!c.unfolded->isCertified()) continue;
    ++certified;
    ASSERT_EQ(contacts, 0u) << "seed " << seed;
    // The oracle knows nothing of brute force: some pairs.
    std::mt19937 random(seed);
    for (int i = 0; i < 400; ++i) {
      const PairKind kind = i % 2 ? PairKind::EDGE_EDGE : PairKind::VERTEX_FACE;
      const ClusterTree &first = c.body().tree(firstKind(kind)), &second = c.body().tree(secondKind(kind));
      const Index *va = first.feature(random() % first.featureCount()),
                  *vb = second.feature(random() % second.featureCount());
      if (std::find_first_of(va, va + first.arity(), vb, vb + second.arity()) != va + first.arity()) continue;
      PairMotion pair;
      for (std::size_t k = 0; k < 4; ++k) {
        const VertexMotion& v = c.scene.vertices()[k < first.arity() ? va[k] : vb[k - first.arity()]];
        std::copy_n(v.t0, 3, pair.x[0][k]);
        std::copy_n(v.t1, 3, pair.x[1][k]);
      }
      ASSERT_FALSE(test::firstContact(kind, pair).has_value()) << "seed " << seed;
      ++asked;
    }
  }
  std::cout << rounds << " surfaces: " << certified << " certified, " << touching << " that touch themselves; " << asked
            << " pairs asked of the oracle\n";
  EXPECT_GT(10 * certified, rounds) << "else nothing is tested";
  EXPECT_GT(4 * touching, rounds);
  EXPECT_GT(asked, 1000u);
}

}  // namespace
}  // namespace dccd
