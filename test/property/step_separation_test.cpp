// Whole steps with a minimum separation and tracker noise, against the exact distance: nothing that comes closer than
// the pair's separation is missed or late, and nothing is called a contact that stays farther than it plus the
// tolerance.
#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>
#include <map>

#include "dccd/stream.h"
#include "oracle/exact_distance.h"
#include "support/brute_force.h"
#include "support/query_property.h"
#include "support/said.h"
#include "support/step_support.h"

namespace dccd {
namespace test {
namespace {

constexpr double TOLERANCE_M = 1e-6;
constexpr int TIMES = 8;

struct NoisyStep {
  TestStep step;
  std::vector<double> separation_m;           // per body
  std::vector<std::vector<double>> radius_m;  // per body, empty: none
};

NoisyStep randomNoisyStep(const Draw& draw) {
  NoisyStep noisy;
  // Radii from a hundredth of the scene's size to several times that, in some steps on one body alone.
  const double unit_m = draw(0, 3) ? 0.01 : 0.15;
  const int only_body = draw(0, 3) ? -1 : draw(0, 2);
  noisy.step = randomStep(draw, draw(1, 10), Coordinates::REAL);
  for (StepBody& body : noisy.step.bodies) {
    body.vertex_active.clear();
    for (Positions* x : {&body.t0, &body.t1}) {
      for (Vec3& p : *x) p = p.allFinite() ? p : Vec3::Zero();
    }
    noisy.separation_m.push_back(draw(0, 1) ? 0.0 : draw(1, 40) * 0.01);
    noisy.radius_m.emplace_back();
    const int body_index = static_cast<int>(noisy.radius_m.size()) - 1;
    if (draw(0, 2) == 0 || (only_body >= 0 && body_index != only_body)) continue;
    for (std::size_t v = 0; v < body.t0.size(); ++v) {
      noisy.radius_m.back().push_back(draw(0, 3) ? 0.0 : draw(1, 60) * unit_m);
    }
  }
  return noisy;
}

double radiusOf(const NoisyStep& noisy, std::uint16_t body, const Index* v, int n) {
  double radius = 0;
  if (noisy.radius_m[body].empty()) return 0;
  for (int i = 0; i < n; ++i) radius = std::max(radius, noisy.radius_m[body][v[i]]);
  return radius;
}

double separationOf(const NoisyStep& noisy, const Contact& c) {
  const int first = c.kind == PairKind::VERTEX_FACE ? 1 : 2;
  return std::max(noisy.separation_m[c.body[0]], noisy.separation_m[c.body[1]]) +
         radiusOf(noisy, c.body[0], c.vertex.data(), first) +
         radiusOf(noisy, c.body[1], c.vertex.data() + first, 4 - first);
}

Outcome run(const NoisyStep& noisy, bool sought, bool earliest_only = false) {
  Options options;
  options.earliest_only = earliest_only;
  options.accuracy.rung = Accuracy::CONSERVATIVE;
  options.accuracy.tolerance_m = TOLERANCE_M;
  options.check_start_state = false;
  Step step = noisy.step.motion();
  for (std::size_t b = 0; b < step.bodies.size(); ++b) {
    step.bodies[b].minimum_separation_m = noisy.separation_m[b];
    if (!noisy.radius_m[b].empty()) step.bodies[b].radius_m = share(noisy.radius_m[b]);
  }
  return sought ? Detector(options).run(step) : bruteForce(step, options);
}

using Key = std::tuple<PairKind, std::array<std::uint16_t, 2>, std::array<Index, 4>>;

/// Calls visit(contact without times) for each pair of features that the step asks for.
template <class Visit>
void forEachPair(const TestStep& step, const Visit& visit) {
  const auto pair = [&](PairKind kind, std::size_t a, std::size_t b, std::array<Index, 4> v) {
    if (a == b) {
      for (int i = 0; i < (kind == PairKind::VERTEX_FACE ? 1 : 2); ++i) {
        for (int j = kind == PairKind::VERTEX_FACE ? 1 : 2; j < 4; ++j) {
          if (v[i] == v[j]) return;
        }
      }
    }
    Contact c;
    c.kind = kind;
    c.body = {static_cast<std::uint16_t>(a), static_cast<std::uint16_t>(b)};
    c.vertex = v;
    visit(c);
  };
  for (std::size_t a = 0; a < step.bodies.size(); ++a) {
    for (std::size_t b = 0; b < step.bodies.size(); ++b) {
      const StepBody &x = step.bodies[a], &y = step.bodies[b];
      if (a == b ? !x.self_collision : !x.against_bodies || !y.against_bodies) continue;
      for (const Index v : x.topology.usedVertices()) {
        for (const Face& f : y.topology.faces()) pair(PairKind::VERTEX_FACE, a, b, {v, f[0], f[1], f[2]});
      }
      if (b < a) continue;
      for (const Edge& e : x.topology.edges()) {
        for (const Edge& f : y.topology.edges()) {
          if (a < b || e < f) pair(PairKind::EDGE_EDGE, a, b, {e[0], e[1], f[0], f[1]});
        }
      }
    }
  }
}

/// Empty, or what is wrong with a certain contact's interval: it is to be narrow, or within the tolerance all the
/// while.
std::string wideInterval(const NoisyStep& noisy, const Contact& c) {
  const double width = c.toc_upper - c.toc_lower;
  if (width <= 0x1p-20) return "";
  const PairMotion motion = motionOf(noisy.step, c);
  const double separation_m = separationOf(noisy, c);
  const double rounding_m = 1e-12 * separation_m;  // the separations are sums
  for (int i = 0; i <= 4; ++i) {
    const double t = c.toc_lower + width * i / 4;
    const bool beyond = !isWithin(c.kind, motion, t, separation_m + TOLERANCE_M + rounding_m);
    const double least = separation_m - TOLERANCE_M - rounding_m;
    if (beyond || (least > 0 && isWithin(c.kind, motion, t, least))) return "wide at " + std::to_string(t);
  }
  return "";
}

TEST(StepSeparation, NeverLateNothingMissedNothingFarther) {
  const int steps = longRun() ? 6000 : 600;
  std::uint64_t pairs = 0, within = 0, noisy_within = 0, certain = 0, undecided = 0, initial = 0;
  for (int seed = 0; seed < steps; ++seed) {
    const Draw draw = drawFrom(4200 + static_cast<std::uint64_t>(seed));
    const NoisyStep noisy = randomNoisyStep(draw);
    const Outcome result = run(noisy, true);
    ASSERT_EQ(difference(result.contacts, run(noisy, false).contacts), "") << "seed " << seed;
    std::map<Key, const Contact*> found;
    for (const Contact& c : result.contacts) {
      found[{c.kind, c.body, c.vertex}] = &c;
      ++(c.certainty == Certainty::CERTAIN ? certain : undecided);
      if (c.certainty != Certainty::CERTAIN) continue;
      initial += c.toc_upper == 0;
      ASSERT_EQ(wideInterval(noisy, c), "") << "seed " << seed << describe(c);
      const double reach = (separationOf(noisy, c) + TOLERANCE_M) * (1 + 1e-12);
      ASSERT_TRUE(isWithin(c.kind, motionOf(noisy.step, c), c.toc_lower, reach)) << "seed " << seed << describe(c);
    }
    forEachPair(noisy.step, [&](const Contact& c) {
      ++pairs;
      const PairMotion motion = motionOf(noisy.step, c);
      const double separation_m = separationOf(noisy, c);
      for (int k = 0; k <= TIMES; ++k) {
        const double t = static_cast<double>(k) / TIMES;
        if (approximateDistanceAt(c.kind, motion, t) > separation_m * (1 + 1e-9) + 1e-9) continue;
        if (!isWithin(c.kind, motion, t, separation_m)) continue;
        const auto at = found.find({c.kind, c.body, c.vertex});
        ASSERT_TRUE(at != found.end()) << "missed, seed " << seed << " " << describe(c);
        ASSERT_LE(at->second->toc_lower, t) << "late, seed " << seed << " " << describe(c);
        ++within;
        noisy_within += separation_m > std::max(noisy.separation_m[c.body[0]], noisy.separation_m[c.body[1]]);
        break;
      }
    });
    if (HasFatalFailure()) return;
  }
  std::cout << pairs << " pairs, " << within << " came within their separation, " << noisy_within
            << " of them with noise\n";
  std::cout << certain << " certain contacts, " << initial << " of them at t = 0, " << undecided << " undecided\n";
  EXPECT_GT(certain, initial + 1000) << "too few that begin within the step";
  EXPECT_LT(undecided, certain / 50);
  EXPECT_GT(within, pairs / 100);
  EXPECT_GT(noisy_within, within / 10);
}

// Of brackets of any width the earliest is kept, and all that may be as early.
TEST(StepSeparation, EarliestOnlyIsTheFirstOfAll) {
  int left_out = 0, several = 0;
  std::uint64_t certain = 0, undecided = 0;
  for (int seed = 0; seed < 200; ++seed) {
    const NoisyStep noisy = randomNoisyStep(drawFrom(7700 + static_cast<std::uint64_t>(seed)));
    const Outcome full = run(noisy, true), first = run(noisy, true, true);
    ASSERT_EQ(first.earliest_toc, full.earliest_toc) << "seed " << seed;
    double upper = 1;
    for (const Contact& c : full.contacts) {
      if (c.certainty == Certainty::CERTAIN) upper = std::min(upper, c.toc_upper);
    }
    std::vector<Contact> expected;
    for (const Contact& c : full.contacts) {
      if (c.toc_lower <= upper) expected.push_back(c);
    }
    ASSERT_EQ(difference(first.contacts, expected), "") << "seed " << seed;
    for (const Contact& c : first.contacts) {
      ++(c.certainty == Certainty::CERTAIN ? certain : undecided);
      if (c.certainty == Certainty::CERTAIN) ASSERT_EQ(wideInterval(noisy, c), "") << "seed " << seed << describe(c);
    }
    left_out += full.contacts.size() > first.contacts.size();
    several += first.contacts.size() > 1;
  }
  EXPECT_GT(left_out, 20);
  EXPECT_GT(several, 20);
  EXPECT_GT(certain, 500u);
  EXPECT_LT(undecided, certain / 50);
}

// A prediction's step is an extrapolation; its times are as narrow as those of what was observed.
TEST(StepSeparation, PredictionsAreAsNarrow) {
  MonitorOptions options;
  options.detector.accuracy.rung = Accuracy::CONSERVATIVE;
  options.detector.accuracy.tolerance_m = TOLERANCE_M;
  options.detector.max_contacts = 1 << 20;
  options.store.max_vertex_step_m = 0;
  options.look_ahead_s = 0.07;
  constexpr StampNs TENTH_S = 100000000;
  std::uint64_t certain = 0, within_step = 0, undecided = 0;
  for (int seed = 0; seed < (longRun() ? 2000 : 200); ++seed) {
    NoisyStep noisy = randomNoisyStep(drawFrom(8300 + static_cast<std::uint64_t>(seed)));
    for (auto& radius : noisy.radius_m) radius.clear();
    Step step = noisy.step.motion();
    std::vector<Body> bodies = step.bodies;
    for (std::size_t b = 0; b < bodies.size(); ++b) bodies[b].minimum_separation_m = noisy.separation_m[b];
    Monitor monitor(options, bodies);
    for (int frame = 0; frame < 2; ++frame) {
      for (std::size_t b = 0; b < bodies.size(); ++b) {
        const StepBody& body = noisy.step.bodies[b];
        monitor.push(
            b,
            {frame * TENTH_S, bodies[b].topology, frame == 0 ? body.t0 : body.t1, false, Eigen::Isometry3d::Identity()},
            0);
      }
    }
    Outcome outcome;
    while (monitor.next(0, outcome)) {
    }
    const Outcome ahead = monitor.predict();
    ASSERT_TRUE(ahead.answered) << "seed " << seed << ": " << ahead.reason;
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      noisy.step.bodies[b].t0 = *ahead.step->bodies[b].t0;
      noisy.step.bodies[b].t1 = *ahead.step->bodies[b].t1;
    }
    for (const Contact& c : ahead.contacts) {
      ++(c.certainty == Certainty::CERTAIN ? certain : undecided);
      if (c.certainty != Certainty::CERTAIN) continue;
      within_step += c.toc_upper > 0;
      ASSERT_EQ(wideInterval(noisy, c), "") << "seed " << seed << describe(c);
    }
  }
  std::cout << certain << " certain contacts of predictions, " << within_step << " that begin within the step, "
            << undecided << " undecided\n";
  EXPECT_GT(within_step, 300u);
  EXPECT_LT(undecided, certain / 50);
}

// Just those vertices: a pair without an uncertain vertex gives the same bits as without any noise.
TEST(StepSeparation, OtherPairsAreAsWithoutNoise) {
  int same = 0;
  for (int seed = 0; seed < 40; ++seed) {
    const Draw draw = drawFrom(9100 + static_cast<std::uint64_t>(seed));
    NoisyStep noisy = randomNoisyStep(draw), quiet = noisy;
    for (auto& radius : quiet.radius_m) radius.clear();
    std::map<Key, Contact> without;
    for (const Contact& c : run(quiet, true).contacts) without[{c.kind, c.body, c.vertex}] = c;
    for (const Contact& c : run(noisy, true).contacts) {
      const bool uncertain = separationOf(noisy, c) > separationOf(quiet, c);
      const auto at = without.find({c.kind, c.body, c.vertex});
      if (uncertain) continue;
      ASSERT_TRUE(at != without.end()) << describe(c);
      EXPECT_EQ(difference({c}, {at->second}), "");
      ++same;
    }
  }
  EXPECT_GT(same, 20);
}

TEST(StepSeparation, BadRadiiAndRungsAreRefused) {
  const TestStep step = crossing();
  const auto error = [&](std::vector<double> radius, Accuracy rung) -> std::string {
    Options options;
    options.accuracy.rung = rung;
    Detector detector(options);
    Step motion = step.motion();
    motion.bodies[0].radius_m = share(radius);
    return said<std::invalid_argument>([&] { detector.run(motion); });
  };
  const std::size_t n = step.bodies[0].t0.size();
  const auto names = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  EXPECT_EQ(error(std::vector<double>(n, 0.1), Accuracy::CONSERVATIVE), "");
  EXPECT_EQ(error(std::vector<double>(n, 0.0), Accuracy::EXACT), "") << "no radius, no distance";
  EXPECT_TRUE(names(error(std::vector<double>(n, 0.1), Accuracy::EXACT), "conservative"));
  EXPECT_TRUE(names(error(std::vector<double>(n, -0.1), Accuracy::CONSERVATIVE), "body_0"));
  EXPECT_TRUE(names(error(std::vector<double>(n, NAN), Accuracy::CONSERVATIVE), "nan"));
  EXPECT_TRUE(names(error(std::vector<double>(n + 1, 0.1), Accuracy::CONSERVATIVE), "radii"));
}

}  // namespace
}  // namespace test
}  // namespace dccd
