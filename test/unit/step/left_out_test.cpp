// What is left out of a minimum separation and of an uncertainty: a body's own features that are as close in its
// reference frame.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "dccd/assurance.h"
#include "dccd/stream.h"
#include "oracle/exact_distance.h"
#include "step/pairs/pair_separation.h"
#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

constexpr double EDGE_M = 0.01, SEPARATION_M = 0.012;
constexpr std::size_t SIZE = 6;

/// Two layers of one body, `gap` apart; the upper one is the second half of the vertices.
struct Layers {
  std::shared_ptr<const Topology> topology;
  Positions at(double gap) const {
    Positions x = gridAt(SIZE, SIZE, EDGE_M);
    // A little aside, so that no vertex is above another one.
    for (const Vec3& p : gridAt(SIZE, SIZE, EDGE_M, {0.003, 0.002, gap})) x.push_back(p);
    return x;
  }
  Layers() {
    std::vector<Face> faces = Topology::grid(SIZE, SIZE).faces();
    const std::size_t n = faces.size();
    for (std::size_t f = 0; f < n; ++f) {
      Face upper = faces[f];
      for (Index& v : upper) v += static_cast<Index>(SIZE * SIZE);
      faces.push_back(upper);
    }
    topology = share(Topology::fromTriangles(2 * SIZE * SIZE, faces));
  }
};

Options conservative() {
  Options options;
  options.accuracy.rung = Accuracy::CONSERVATIVE;
  return options;
}

Body felt(const Layers& layers, const Positions* reference) {
  Body body = bodyOf("felt", *layers.topology);
  body.minimum_separation_m = SEPARATION_M;
  if (reference) body.reference = share(*reference);
  return body;
}

/// A detector of one body.
struct Felt {
  Body body;
  Detector detector{conservative()};
  Felt(const Body& of, const Positions& rest) : body(of) { run(rest, rest); }
  /// As a first step: at rest nothing of a step that goes on would be tested.
  Outcome run(const Positions& t0, const Positions& t1) {
    detector.history().clear();
    return detector.run(stepOf(body, t0, t1));
  }
};

using Pair = std::pair<PairKind, std::array<Index, 4>>;

/// Every pair of the body's features without a common vertex that is certainly, or not certainly not, within `bound`.
std::set<Pair> pairsWithin(const Topology& topology, const Positions& x, double bound) {
  std::set<Pair> found;
  const auto add = [&](PairKind kind, const std::array<Index, 4>& v) {
    for (int i = 0; i < 4; ++i) {
      for (int j = i + 1; j < 4; ++j) {
        if (v[i] == v[j]) return;
      }
    }
    PairMotion pair;
    for (auto& time : pair.x) {
      for (int i = 0; i < 4; ++i) std::copy_n(x[v[i]].data(), 3, time[i]);
    }
    if (isWithin(kind, pair, 0, bound)) found.insert({kind, v});
  };
  for (const Index v : topology.usedVertices()) {
    for (const Face& f : topology.faces()) add(PairKind::VERTEX_FACE, {v, f[0], f[1], f[2]});
  }
  for (std::size_t a = 0; a < topology.edges().size(); ++a) {
    for (std::size_t b = a + 1; b < topology.edges().size(); ++b) {
      const Edge &e = topology.edges()[a], &f = topology.edges()[b];
      add(PairKind::EDGE_EDGE, {e[0], e[1], f[0], f[1]});
    }
  }
  return found;
}

// Of random sheets, crumpled in the reference frame and folded in the step, by exact distances: a pair is left out of
// the separation exactly where it is closer there. A pair that is not, but is as close as its uncertainty reaches, both
// there and in the step, ends the proof. All others are contacts from separation and uncertainty on.
TEST(LeftOut, IsExactlyWhatIsCloserInTheReferenceFrame) {
  std::size_t left_out = 0, contacts = 0, proved = 0, unsure = 0;
  const Topology topology = Topology::grid(4, 4);
  for (unsigned seed = 0; seed < 40; ++seed) {
    std::mt19937 random(seed);
    const auto uniform = [&](double most) { return most * (2 * static_cast<double>(random() >> 8) / (1 << 24) - 1); };
    const auto sheet = [&](double turned, double shake) {
      Positions x;
      for (const Vec3& p : gridAt(4, 4, 1)) {
        const double out = std::max(0.0, p.x() - 1);
        x.emplace_back(std::min(p.x(), 1.0) + out * std::cos(turned), p.y(), out * std::sin(turned));
        x.back() += Vec3(uniform(shake), uniform(shake), uniform(shake));
      }
      return x;
    };
    const Positions fit = sheet(0.7 * static_cast<double>(seed % 4), 0.3), now = sheet(3 - uniform(1), 0.2);
    const double separation_m = seed % 3 ? 0.7 + uniform(0.6) : 0, noise_m = seed % 2 ? 0.3 + uniform(0.29) : 0;
    Body body = bodyOf("sheet", topology);
    body.minimum_separation_m = separation_m;
    body.reference = share(fit);
    const std::vector<double> radii(now.size(), noise_m / 2);
    const Outcome outcome = Detector(conservative()).run(stepOf(body, now, now, noise_m > 0 ? &radii : nullptr));
    std::set<Pair> found;
    for (const Contact& c : outcome.contacts) found.insert({c.kind, c.vertex});
    bool surely = false, perhaps = false;
    for (const Pair& pair : pairsWithin(topology, now, 100)) {
      bool known = true;  // the elementary test may call what is farther by its tolerance as near
      const auto within = [&](const Positions& x, double m) {
        PairMotion motion;
        for (auto& time : motion.x) {
          for (int i = 0; i < 4; ++i) std::copy_n(x[pair.second[i]].data(), 3, time[i]);
        }
        const bool is = m > 0 && isWithin(pair.first, motion, 0, m);
        known = known && (is || m == 0 || !isWithin(pair.first, motion, 0, m + 3e-6));
        return is;
      };
      const bool is_left_out = within(fit, separation_m);
      const bool is_unsure = !is_left_out && noise_m > 0 && within(fit, separation_m + noise_m);
      const bool near = within(now, separation_m + noise_m);
      const bool contact = !is_left_out && (is_unsure ? within(now, separation_m) : near);
      perhaps = perhaps || !known;
      if (!known) continue;
      ASSERT_EQ(found.count(pair) > 0, contact) << "seed " << seed << ", left out " << is_left_out << is_unsure;
      surely = surely || (is_unsure && near);
      left_out += is_left_out && near;
      contacts += contact;
    }
    const std::vector<std::string> missing = assuranceOf(outcome).missing;
    const bool said = std::any_of(missing.begin(), missing.end(), [](const std::string& one) {
      return one.find("own features are as close as its uncertainty") != std::string::npos;
    });
    if (surely || !perhaps) {
      EXPECT_EQ(said, surely) << "seed " << seed;
    }
    ++(said ? unsure : proved);
  }
  EXPECT_GT(left_out, 100u);
  EXPECT_GT(contacts, 500u);
  EXPECT_GT(proved, 10u);
  EXPECT_GT(unsure, 10u);
}

TEST(LeftOut, ADistanceInTheReferenceFrameIsThatToTheNearestSide) {
  std::array<Vec3, 4> x;
  const auto around = [](int sixths) { return Vec3(std::cos(sixths * M_PI / 3), std::sin(sixths * M_PI / 3), 0); };
  for (int k = 0; k < 3; ++k) x[k + 1] = around(2 * k);
  for (int k = 0; k < 3; ++k) {
    x[0] = around(2 * k + 1);  // beyond the middle of a side
    EXPECT_NEAR(restDistance(PairKind::VERTEX_FACE, x), 0.5, 1e-12) << k;
  }
  x[0] = {0, 0, 0.25};
  EXPECT_EQ(restDistance(PairKind::VERTEX_FACE, x), 0.25);
}

TEST(LeftOut, LayersThatComeNearAreFoundAllTheSame) {
  const Layers layers;
  const Positions apart = layers.at(0.03), near = layers.at(0.01);
  Felt detector(felt(layers, &apart), apart);
  const Outcome result = detector.run(apart, near);
  ASSERT_FALSE(result.contacts.empty());
  for (const Contact& c : result.contacts) {
    const bool first_below = c.vertex[0] < SIZE * SIZE, last_below = c.vertex[3] < SIZE * SIZE;
    EXPECT_NE(first_below, last_below) << "between the layers only";
  }
  EXPECT_NEAR(result.earliest_toc, (0.03 - SEPARATION_M) / 0.02, 1e-3);
  EXPECT_GT(result.stats[Effect::MINIMUM_SEPARATION].out, 0u);
  EXPECT_GT(result.stats[Effect::MINIMUM_SEPARATION].in, result.stats[Effect::MINIMUM_SEPARATION].out);
}

// Left out of the separation only: that its features truly meet is found without one.
TEST(LeftOut, TrueContactIsNotLost) {
  const Positions apart{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.25, 0.25, 0.1}, {0.25, 0.25, 1}, {0.5, 0.25, 1}};
  Positions through = apart;
  through[3].z() = -0.1;
  Body body = bodyOf("pair", Topology::fromTriangles(6, {{0, 1, 2}, {3, 4, 5}}));
  body.minimum_separation_m = 0.2;
  body.reference = share(apart);
  Felt detector(body, apart);
  const Outcome rest = detector.run(apart, apart);
  EXPECT_TRUE(rest.contacts.empty());
  EXPECT_GT(rest.stats.left_out_met, 0u);
  const Outcome result = detector.run(apart, through);
  ASSERT_FALSE(result.contacts.empty());
  EXPECT_LE(result.earliest_toc, 0.5);
  EXPECT_NEAR(result.earliest_toc, 0.5, 1e-4);
}

TEST(LeftOut, SeparationsOfPairsReplaceTheBodies) {
  const Layers layers;
  const Positions apart = layers.at(0.03), near = layers.at(0.01);
  Body body = felt(layers, &apart);
  body.separations = {{0, 0.0}};  // from itself: none
  Felt detector(body, apart);
  EXPECT_TRUE(detector.run(apart, near).contacts.empty());
  const Positions other = layers.at(5);
  Body second = felt(layers, nullptr);
  second.separations = {{0, 6.0}};
  second.self_collision = body.self_collision = false;
  const auto both = [&] {
    Step step = stepOf(body, apart, apart);
    step.bodies.push_back(moving(second, other, other));
    return detector.detector.run(step);
  };
  EXPECT_FALSE(both().contacts.empty()) << "5 m apart, 6 m asked for by the other body";
  for (const SeparationFrom& wrong : {SeparationFrom{7, 1.0}, {0, -1.0}, {0, std::nan("")}}) {
    second.separations = {wrong};
    EXPECT_THROW(both(), std::invalid_argument);
  }
}

/// A monitor of one body of two layers, fed with frames 0.1 s apart.
struct MonitoredFelt {
  Layers layers;
  Monitor monitor;
  StampNs stamp_ns = 0;

  explicit MonitoredFelt(double separation_m) : monitor(options(), {body(separation_m)}) {}

  Outcome feed(double gap, std::vector<double> radius_m = {}) {
    stamp_ns += 100000000;
    monitor.push(
        0, {stamp_ns, layers.topology, layers.at(gap), false, Eigen::Isometry3d::Identity(), std::move(radius_m)}, 0);
    Outcome outcome;
    EXPECT_TRUE(monitor.next(0, outcome));
    return outcome;
  }
  static std::vector<double> radii(double radius_m) { return std::vector<double>(2 * SIZE * SIZE, radius_m); }

 private:
  static MonitorOptions options() {
    MonitorOptions options;
    options.detector = conservative();
    options.look_ahead_s = 0.1;
    return options;
  }
  static Body body(double separation_m) {
    Body body;
    body.name = "felt";
    body.minimum_separation_m = separation_m;
    return body;
  }
};

TEST(LeftOut, TheMonitorsReferenceIsTheFirstFrame) {
  MonitoredFelt felt(SEPARATION_M);
  Monitor& monitor = felt.monitor;
  const auto feed = [&](double gap) { return felt.feed(gap); };
  feed(0.03);
  const Outcome rest = feed(0.03);
  EXPECT_TRUE(rest.contacts.empty());
  EXPECT_GT(rest.stats.left_out_met, 100u);
  EXPECT_TRUE(monitor.checkNow().contacts.empty());
  EXPECT_TRUE(monitor.predict().contacts.empty()) << "predictions leave out the same";
  EXPECT_FALSE(feed(0.01).contacts.empty());
  EXPECT_FALSE(feed(0.01).contacts.empty()) << "and stay contacts";
  monitor.reset(StepStatus::TIME_JUMP);
  feed(0.01);
  EXPECT_FALSE(feed(0.01).contacts.empty()) << "the reference stays with the topology";
  monitor.reset(StepStatus::RESET);
  feed(0.01);
  EXPECT_TRUE(feed(0.01).contacts.empty()) << "after ~reset the body is fit as it is";
}

// Folded after the first frame: with the fold as the reference, the contacts in it would be left out.
TEST(LeftOut, AQuestionChangesNoReference) {
  const Layers layers;
  MonitorOptions options;
  options.detector = conservative();
  Body felt, other;
  felt.name = "felt";
  felt.minimum_separation_m = SEPARATION_M;
  other.name = "other";
  const auto triangle = share(Topology::fromTriangles(3, {{0, 1, 2}}));
  const Positions far{{5, 0, 0}, {6, 0, 0}, {5, 1, 0}};
  const auto contactsWith = [&](bool questions) {
    Monitor monitor(options, {felt, other});
    const auto push = [&](std::size_t body, StampNs stamp_ns, const std::shared_ptr<const Topology>& topology,
                          Positions x) {
      monitor.push(body, {stamp_ns, topology, std::move(x), false, Eigen::Isometry3d::Identity(), {}}, 0);
      if (questions) monitor.checkNow();
    };
    std::array<std::size_t, 2> contacts{};
    Outcome outcome;
    const auto step = [&](std::size_t i, StampNs stamp_ns) {
      EXPECT_FALSE(monitor.next(0, outcome)) << "the step waits for the other body";
      push(1, stamp_ns, triangle, far);
      while (monitor.next(0, outcome)) contacts[i] += outcome.contacts.size();
    };
    push(1, 0, triangle, far);
    push(0, 10000000, layers.topology, layers.at(0.03));
    EXPECT_TRUE(monitor.next(0, outcome));
    push(0, 20000000, layers.topology, layers.at(0.01));
    step(0, 20000000);
    push(0, 30000000, layers.topology, layers.at(0.01));
    push(0, 40000000, triangle, far);
    step(1, 40000000);
    return contacts;
  };
  const std::array<std::size_t, 2> unasked = contactsWith(false);
  EXPECT_GT(unasked[0], 0u);
  EXPECT_GT(unasked[1], 0u);
  EXPECT_EQ(contactsWith(true), unasked);
}

// When radii go, what they alone left out is no neighbour any more.
TEST(LeftOut, RadiiThatGoLeaveNoPairOut) {
  const std::vector<double> none, zero = MonitoredFelt::radii(0), large = MonitoredFelt::radii(0.012);
  const auto contactsAfter = [](const std::vector<double>& first, const std::vector<double>& later) {
    MonitoredFelt felt(SEPARATION_M);
    felt.feed(0.03, first);
    EXPECT_TRUE(felt.feed(0.03, first).contacts.empty());
    EXPECT_TRUE(felt.feed(0.03, later).contacts.empty());
    return felt.feed(0.01, later).contacts.size();
  };
  const std::size_t never = contactsAfter(none, none);
  EXPECT_GT(never, 0u);
  EXPECT_EQ(contactsAfter(large, none), never);
  EXPECT_EQ(contactsAfter(large, zero), never);
}

// A tracker may know its errors only later: neighbours within them are left out from then on.
TEST(LeftOut, RadiiMayComeAfterTheFirstFrame) {
  MonitoredFelt felt(0);
  const std::vector<double> radius_m = MonitoredFelt::radii(0.006);
  felt.feed(0.03);
  EXPECT_TRUE(felt.feed(0.03).contacts.empty());
  const Outcome noisy = felt.feed(0.03, radius_m);
  EXPECT_TRUE(noisy.contacts.empty()) << "neighbours are no contacts";
  EXPECT_GT(noisy.stats.left_out_met, 100u);
  EXPECT_FALSE(felt.feed(0.01, radius_m).contacts.empty());
}

/// A crumpled sheet of random heights and then each vertex somewhere else, all vertices known to this radius [m].
/// Whether each of the steps is clear: proved, and nothing touches.
std::vector<bool> clearWith(double radius_m, unsigned seed, double separation_m) {
  MonitorOptions options;
  options.detector = conservative();
  options.store.max_vertex_step_m = 0;
  Body sheet;
  sheet.name = "sheet";
  sheet.minimum_separation_m = separation_m;
  Monitor monitor(options, {sheet});
  const auto topology = share(Topology::grid(4, 5));
  std::mt19937 random(seed);
  const auto uniform = [&](double most) { return most * (2 * static_cast<double>(random() >> 8) / (1 << 24) - 1); };
  const double fold = 0.2 * static_cast<double>(seed % 5), shake = std::pow(10, -1 - static_cast<double>(seed % 4));
  std::vector<bool> clear;
  for (int k = 0; k < 4; ++k) {
    Positions x;
    for (std::size_t v = 0; v < topology->vertexCount(); ++v) {
      // A sheet of cells of 1 m, of which one side is folded over the other one, more in every step.
      const double along = static_cast<double>(v % 5), across = static_cast<double>(v / 5), turned = fold * k;
      const double out = std::max(0.0, along - 2);
      x.emplace_back(std::min(along, 2.0) + out * std::cos(turned), across, out * std::sin(turned));
      x.back() += Vec3(uniform(shake), uniform(shake), uniform(shake));
    }
    const StampNs stamp_ns = 10000000 * (k + 1);
    monitor.push(0,
                 {stamp_ns, topology, x, false, Eigen::Isometry3d::Identity(),
                  std::vector<double>(radius_m > 0 ? x.size() : 0, radius_m)},
                 0);
    Outcome outcome;
    EXPECT_TRUE(monitor.next(0, outcome));
    if (k > 0) clear.push_back(assuranceOf(outcome).clear());
  }
  return clear;
}

TEST(LeftOut, MoreNoiseMakesNothingClearThatLessNoiseDidNot) {
  std::size_t cleared = 0, not_cleared = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    const double separation_m = seed % 2 ? 0.05 : 0;
    std::vector<bool> before(3, true);
    double radius_m = 0;
    for (int i = 0; i < 42; ++i) {
      const std::vector<bool> clear = clearWith(radius_m, seed, separation_m);
      for (std::size_t k = 0; k < clear.size(); ++k) {
        EXPECT_LE(clear[k], before[k]) << "seed " << seed << ", step " << k << ", radius " << radius_m << " m";
        ++(clear[k] ? cleared : not_cleared);
      }
      before = clear;
      radius_m = i == 0 ? 1e-4 : radius_m * (radius_m < 10 ? 1.4 : 1e6);
    }
    EXPECT_GT(radius_m, 1e30);
    EXPECT_EQ(before, std::vector<bool>(3, false)) << "of a sheet of 4 m that is known to 1e30 m nothing is known";
  }
  EXPECT_GT(cleared, 1000u);
  EXPECT_GT(not_cleared, 1000u);
}

TEST(LeftOut, WhatOnlyNoiseLeavesOutIsSaid) {
  MonitoredFelt near(0), far(SEPARATION_M);
  const auto unproved = [](MonitoredFelt& felt, double radius_m) {
    felt.feed(0.03, MonitoredFelt::radii(radius_m));
    return felt.feed(0.03, MonitoredFelt::radii(radius_m)).missing();
  };
  const auto said = unproved(near, 0.006);  // two of them reach over an edge of 10 mm
  ASSERT_EQ(said.size(), 1u);
  EXPECT_EQ(
      said[0],
      "body 'felt': some of its own features are as close as its uncertainty (radii of up to 0.006 m) reaches, and "
      "so they are in its reference frame; whether they touch is not known");
  EXPECT_TRUE(unproved(far, 1e-6).empty()) << "what is left out is closer than the separation";
}

}  // namespace
}  // namespace test
}  // namespace dccd
