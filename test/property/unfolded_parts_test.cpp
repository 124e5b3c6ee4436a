// Parts of random surfaces that are certified: of what is left out no pair is in contact, by brute force and the
// oracle. DEFORMABLE_CCD_LONG=1 runs 100,000 steps.
#include "culling/unfolded_parts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <optional>
#include <random>

#include "oracle/oracle.h"
#include "support/detector.h"
#include "support/query_property.h"
#include "support/simd_targets.h"
#include "support/surfaces.h"

namespace dccd {
namespace {

Outcome bruteForce(const Step& step) {
  Options options;
  options.check_start_state = false;
  options.broad_phase = BroadPhase::BRUTE_FORCE;
  return test::Detector(options).run(step);
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

/// Surfaces of 700 to 1,200 faces: sheets with a roll, tubes, flat ones that close, with holes, wound ones.
class RandomSurface {
 public:
  explicit RandomSurface(std::uint32_t seed) : random_(seed) {
    const std::size_t kind = seed % 6, n = 20 + random_() % 5;
    const bool is_tube = kind == 1 || kind == 2;
    Topology topology = is_tube ? test::tube(n, n) : Topology::grid(n, n);
    if (kind == 3) topology = withHoles(topology);
    const double size = std::exp2(10 * unit()), turn = 2 + 2 * std::abs(unit()), bend = 0.1 + std::abs(unit());
    const double wave = 0.06 * unit(), noise = std::exp2(-4 - 12 * std::abs(unit()));
    const Eigen::Quaterniond turned = Eigen::Quaterniond(unit(), unit(), unit(), unit()).normalized();
    const Vec3 shift = seed % 7 == 0 ? Vec3(1e5, -3e5, 2e5) * size : Vec3(0, 0, 0);
    const std::size_t picked = random_() % (n * n);
    std::vector<Positions> ends;
    for (const double t : {0.0, 1.0}) {
      Positions x = is_tube     ? test::tubeAt(n, n, bend + 0.3 * t * unit())
                    : kind == 4 ? test::rolled(n, 0.3 * unit())
                    : kind == 5 ? wound(n, 0.6 + bend, t == 0 ? 1 : 0.2 * unit())
                                : test::rolled(n, turn + t * unit(), 0.03);
      // One vertex over its neighbours, and through them.
      if (kind == 4) x[picked] += Vec3(0.12, 0.09, t == 0 ? 0.03 : -0.03);
      const double flat = kind != 2 ? 1 : t == 0 ? 0.3 : 0.2 * unit();  // opposite sides come near or pass each other
      for (Vec3& p : x) {
        p += wave * Vec3(std::sin(5 * p.y()), std::sin(4 * p.x()), std::sin(5 * p.x() + p.y() + t));
        p.y() *= flat;
        p = size * (turned * Vec3(p + noise * Vec3(unit(), unit(), unit()))) + shift;
        // On a grid borders touch in a number, and faces are seen on edge.
        if (seed % 4 == 3) p = (p / (0.02 * size)).array().round() * (0.02 * size);
      }
      ends.push_back(x);
    }
    Body body;
    body.topology = std::make_shared<const Topology>(topology);
    step_ = test::stepOf(body, ends[0], ends[1]);
  }
  const Step& step() const { return step_; }

 private:
  double unit() { return std::uniform_real_distribution<double>(-1, 1)(random_); }
  Topology withHoles(const Topology& whole) {
    std::vector<Face> faces = whole.faces();
    for (int i = 0; i < 4; ++i) faces.erase(faces.begin() + static_cast<std::ptrdiff_t>(random_() % faces.size()));
    return Topology::fromTriangles(whole.vertexCount(), faces);
  }

  std::mt19937 random_;
  Step step_;
};

/// What a surface's parts leave out.
struct Certified {
  SceneArrays scene;
  std::optional<UnfoldedParts> parts;
  std::size_t count = 0;

  explicit Certified(const Step& step) {
    StepStats stats;
    scene.setBodies(step.bodies);
    scene.record(step, stats);
    scene.refit([](std::size_t n, const auto& f) { f(0, n); }, stats);
    parts.emplace(body(), 1);
    count = parts->run(body(), scene);
  }
  const SceneBody& body() const { return scene.bodies()[0]; }
  bool isLeftOut(PairKind kind, std::size_t slot_a, std::size_t slot_b) const {
    std::uint32_t pair[2] = {static_cast<std::uint32_t>(slot_a / simd::GROUP),
                             static_cast<std::uint32_t>(slot_b / simd::GROUP)};
    if (kind == PairKind::EDGE_EDGE && pair[0] > pair[1]) std::swap(pair[0], pair[1]);
    return count > 0 && parts->leftOut(kind)->leaveOut(pair, 1) == 0;
  }
  std::size_t slotOf(FeatureKind kind, const Index* local, std::size_t size) const {
    const ClusterTree& tree = body().tree(kind);
    for (std::size_t slot = 0;; ++slot) {
      Index found[3];
      for (std::size_t k = 0; k < size; ++k)
        found[k] = body().slot_vertex[tree.feature(slot)[k] - body().internal_begin];
      if (std::is_permutation(found, found + size, local)) return slot;
    }
  }
};

TEST(UnfoldedPartsProperty, WhatIsLeftOutHasNoContact) {
  const std::uint32_t rounds = test::longRun() ? 100000 : 200;
  std::size_t cells = 0, certified = 0, judged = 0, asked = 0;
  for (std::uint32_t seed = 0; seed < rounds; ++seed) {
    const RandomSurface surface(seed);
    Certified c(surface.step());
    cells += c.parts->cellCount();
    certified += c.count;
    test::forEachTarget(
        [&](const std::string& target) { ASSERT_EQ(c.parts->run(c.body(), c.scene), c.count) << target; });
    if (c.count == 0) continue;
    for (const Contact& contact : bruteForce(surface.step()).contacts) {
      const std::size_t size = factsOf(contact.kind).vertices[0];
      const std::size_t a = c.slotOf(firstKind(contact.kind), contact.vertex.data(), size);
      const std::size_t b = c.slotOf(secondKind(contact.kind), contact.vertex.data() + size, 4 - size);
      ASSERT_FALSE(c.isLeftOut(contact.kind, a, b)) << "seed " << seed;
      ++judged;
    }
    // The oracle knows nothing of brute force: some pairs that are left out.
    std::mt19937 random(seed);
    for (int i = 0; i < 400; ++i) {
      const PairKind kind = i % 2 ? PairKind::EDGE_EDGE : PairKind::VERTEX_FACE;
      const ClusterTree &first = c.body().tree(firstKind(kind)), &second = c.body().tree(secondKind(kind));
      const std::size_t a = random() % first.featureCount(), b = random() % second.featureCount();
      const Index *va = first.feature(a), *vb = second.feature(b);
      if (!c.isLeftOut(kind, a, b)) continue;
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
  std::cout << rounds << " surfaces: " << certified << " of " << cells << " cells certified; " << judged
            << " contacts beside them, " << asked << " pairs asked of the oracle\n";
  EXPECT_GT(certified * 10, cells) << "else nothing is tested";
  EXPECT_GT(judged, 1000u);
  EXPECT_GT(asked, 1000u);
}

}  // namespace
}  // namespace dccd
