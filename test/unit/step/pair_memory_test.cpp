// Steps that remember what is apart give the answers of steps that do not: over streams of any kind, and with less
// work.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "simd/group_pairs.h"
#include "step/history.h"
#include "support/step_support.h"

namespace dccd {
namespace test {
namespace {

/// A sheet that is rolled up and bent more with time, so that its layers lie close and in places meet; it turns as a
/// whole by `turn` a frame. Many pairs of clusters, few contacts.
struct Roll {
  std::size_t size;
  Topology topology;
  explicit Roll(std::size_t n) : size(n), topology(Topology::grid(n, n)) {}
  Positions at(double time, double turn = 0.2) const {
    Positions x;
    for (std::size_t r = 0; r < size; ++r) {
      for (std::size_t c = 0; c < size; ++c) {
        const double angle = 9.0 * static_cast<double>(c) / static_cast<double>(size);
        const double radius = 0.2 + 0.02 * angle + 0.004 * std::sin(0.9 * time + 3 * angle);
        const Vec3 p(radius * std::cos(angle), radius * std::sin(angle),
                     static_cast<double>(r) / static_cast<double>(size) + 0.003 * std::sin(time + 7 * angle));
        x.push_back(Eigen::AngleAxisd(turn * time, Vec3(1, 2, 3).normalized()) * p + Vec3(0.1 * time, 0, 0));
      }
    }
    return x;
  }
};

Body bodyOf(const Topology& topology, const char* name) {
  Body body;
  body.name = name;
  body.topology = share(topology);
  return body;
}

Options options(bool remember) {
  Options o;
  o.keep_bounds = remember;
  o.unfolded_test = false;
  return o;
}

/// What an answer says, but for its times and what it cost.
void expectSame(const Outcome& a, const Outcome& b, const std::string& where) {
  ASSERT_EQ(difference(a.contacts, b.contacts), "") << where;
  ASSERT_EQ(a.start_state, b.start_state) << where;
  ASSERT_EQ(a.intersections.size(), b.intersections.size()) << where;
  for (std::size_t i = 0; i < a.intersections.size(); ++i)
    ASSERT_TRUE(a.intersections[i] == b.intersections[i]) << where;
  ASSERT_EQ(a.status, b.status) << where;
  ASSERT_EQ(a.complete, b.complete) << where;
  ASSERT_EQ(a.cut, b.cut) << where;
  ASSERT_EQ(a.unchecked_toc_lower, b.unchecked_toc_lower) << where;
  ASSERT_EQ(a.earliest_toc, b.earliest_toc) << where;
}

TEST(PairMemory, ARollThatTurnsAndBendsIsLookedAtInPart) {
  const Roll roll(40);
  const Body body = bodyOf(roll.topology, "roll");
  Detector remembers(options(true)), forgets(options(false));
  std::uint64_t known = 0, tested = 0, all = 0;
  for (int k = 0; k < 40; ++k) {
    const Step step = stepOf(body, roll.at(0.1 * k, 2), roll.at(0.1 * (k + 1), 2));
    const Outcome with = remembers.run(step), without = forgets.run(step);
    expectSame(with, without, "step " + std::to_string(k));
    EXPECT_EQ(without.stats.pairs_known_apart + without.stats.pairs_shown_apart, 0u);
    if (k < 2) continue;
    known += with.stats.pairs_known_apart;
    tested += with.stats[Stage::BROAD_PHASE].in;
    all += without.stats[Stage::BROAD_PHASE].in;
  }
  EXPECT_EQ(256 * known + tested, all) << "the same pairs of clusters, known or tested";
  EXPECT_LT(tested, all / 2) << "it turns by a fifth of a radian a step, which bends nothing";
}

TEST(PairMemory, WhatComesNearIsFoundInTime) {
  // A point of the outer layer is pushed through the next one, faster with each step.
  const Roll roll(40);
  const Body body = bodyOf(roll.topology, "roll");
  Detector remembers(options(true)), forgets(options(false));
  std::uint64_t known = 0, contacts = 0;
  Positions before = roll.at(0, 0);
  for (int k = 0; k < 14; ++k) {
    Positions after = before;
    for (std::size_t c = roll.size - 8; c < roll.size; ++c) {
      for (std::size_t r = 10; r < 18; ++r) {
        Vec3& p = after[r * roll.size + c];
        const Vec3 inward(-p.x(), -p.y(), 0);
        p += 0.0002 * std::pow(1.6, k) * inward.normalized();
      }
    }
    const Step step = stepOf(body, before, after);
    const Outcome with = remembers.run(step);
    expectSame(with, forgets.run(step), "step " + std::to_string(k));
    known += with.stats.pairs_known_apart;
    contacts += with.contacts.size();
    before = after;
  }
  EXPECT_GT(known, 1000u);
  EXPECT_GT(contacts, 20u);
}

TEST(PairMemory, ASeamForgets) {
  const Roll roll(40);
  const Body body = bodyOf(roll.topology, "roll");
  Detector detector(options(true));
  for (int k = 0; k < 4; ++k) detector.run(stepOf(body, roll.at(0.1 * k), roll.at(0.1 * (k + 1))));
  EXPECT_TRUE(detector.history().impl().carried.memory.isOn());
  EXPECT_GT(detector.history().impl().carried.memory.bytes(), 0u);
  detector.history().clear();
  EXPECT_TRUE(detector.history().isClear());
  EXPECT_EQ(detector.history().impl().carried.memory.bytes(), 0u);
  // A teleport that nobody tells of: to where the next step turns the roll inside out.
  for (int k = 0; k < 4; ++k) detector.run(stepOf(body, roll.at(0.1 * k, 0), roll.at(0.1 * (k + 1), 0)));
  const Positions elsewhere = roll.at(0.41, 0);
  Positions inside_out = elsewhere;
  for (Vec3& p : inside_out) {
    const double radius = std::hypot(p.x(), p.y());
    p.head<2>() *= (0.6 - radius) / radius;
  }
  Detector fresh(options(false));
  const Outcome with = detector.run(stepOf(body, elsewhere, inside_out));
  EXPECT_EQ(with.stats.pairs_known_apart, 0u);
  expectSame(with, fresh.run(stepOf(body, elsewhere, inside_out)), "after the teleport");
  EXPECT_GT(with.contacts.size(), 100u);
}

/// Everything that can happen to a stream, at random.
TEST(PairMemory, RandomStreamsAreAnsweredAsWithoutMemory) {
  std::uint64_t known = 0, contacts = 0, cut = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    std::mt19937_64 random(seed);
    const auto any = [&](int low, int high) {
      return low + static_cast<int>(random() % static_cast<std::uint64_t>(high - low + 1));
    };
    const Roll roll(static_cast<std::size_t>(any(36, 48))), other(static_cast<std::size_t>(any(8, 28)));
    Options with = options(true), without = options(false);
    with.num_threads = any(1, 2);
    Detector remembers(with), forgets(without);
    double time = 0, pace = 0.3, nearness = 0.8;
    bool second = true;
    Positions last[2];
    for (int k = 0; k < 30; ++k) {
      const int event = any(0, 19);
      if (event == 0) pace = std::ldexp(1.0, any(-6, 2));
      if (event == 1) remembers.history().clear();
      if (event == 1) forgets.history().clear();
      if (event == 2) time += 3;  // a teleport
      if (event == 3) second = !second;
      if (event == 4) nearness = 0.1 * any(0, 10);
      if (event == 5) {
        with.accuracy.rung = without.accuracy.rung = any(0, 1) ? Accuracy::EXACT : Accuracy::CONSERVATIVE;
        with.max_found = without.max_found = any(0, 2) ? 0 : static_cast<std::size_t>(any(5, 200));
        remembers.setOptions(with);
        forgets.setOptions(without);
      }
      const double next = event == 6 ? time : time + pace;  // at rest
      Step step;
      for (int b = 0; b < (second ? 2 : 1); ++b) {
        const auto at = [&](double when) {
          Positions x = (b ? other : roll).at(when);
          if (b) {
            for (Vec3& p : x) p += Vec3(nearness, 0.1 * std::sin(when), 0);
          }
          return x;
        };
        Positions t0 = event == 2 || last[b].empty() ? at(time) : last[b], t1 = event == 6 ? t0 : at(next);
        if (event == 7) t1[static_cast<std::size_t>(any(0, 50))].x() = std::nan("");
        step.bodies.push_back(moving(bodyOf((b ? other : roll).topology, b ? "other" : "roll"), t0, t1));
        last[b] = t1;
      }
      if (!second) last[1].clear();
      if (event == 8) {  // with a distance, from here on
        for (Body& body : step.bodies) body.minimum_separation_m = 0.001;
        with.accuracy.rung = without.accuracy.rung = Accuracy::CONSERVATIVE;
        remembers.setOptions(with);
        forgets.setOptions(without);
      }
      time = next;
      const Outcome a = remembers.run(step), b = forgets.run(step);
      expectSame(a, b, "seed " + std::to_string(seed) + " step " + std::to_string(k));
      if (HasFatalFailure()) return;
      known += a.stats.pairs_known_apart;
      contacts += a.contacts.size();
      cut += a.cut;
    }
  }
  EXPECT_GT(known, 10000u);
  EXPECT_GT(contacts, 1000u);
  EXPECT_GT(cut, 0u);
}

/// A tilted sheet, and on it points at the very middle of edges: they touch, though no normal that is computed in
/// doubles can say so. All coordinates are multiples of 2^-50, so that the middles are exact.
TEST(PairMemory, WhatTouchesAtRestIsNotApartByALastBit) {
  std::size_t contacts = 0;
  std::uint64_t known = 0;
  for (int seed = 1; seed <= 6; ++seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    const auto grid = [](double x) { return std::ldexp(std::round(std::ldexp(x, 49)), -49); };
    const Eigen::AngleAxisd tilt(0.7 + 0.1 * seed, Vec3(1, 2, -1.3).normalized());
    constexpr std::size_t SIZE = 40;
    Positions sheet, above;
    for (std::size_t r = 0; r < SIZE; ++r) {
      for (std::size_t c = 0; c < SIZE; ++c) {
        const Vec3 p(static_cast<double>(r) / SIZE, static_cast<double>(c) / SIZE,
                     0.01 * std::sin(0.2 * static_cast<double>(r)));
        sheet.push_back((tilt * p).unaryExpr(grid));
        above.push_back((tilt * (p + Vec3(0, 0, 0.03))).unaryExpr(grid));
      }
    }
    const Topology topology = Topology::grid(SIZE, SIZE);
    // The sheet above hovers, but for a few points of it.
    for (int k = 0; k < 40; ++k) {
      const Edge& edge = topology.edges()[random() % topology.edges().size()];
      above[edge[0]] = 0.5 * (sheet[edge[0]] + sheet[edge[1]]);
    }
    Detector remembers(options(true)), forgets(options(false));
    for (int k = 0; k < 8; ++k) {
      Step step;
      step.bodies.push_back(moving(bodyOf(topology, "sheet"), sheet, sheet));
      step.bodies.push_back(moving(bodyOf(topology, "above"), above, above));
      for (Body& body : step.bodies) body.self_collision = false;
      const Outcome with = remembers.run(step);
      expectSame(with, forgets.run(step), "seed " + std::to_string(seed) + " step " + std::to_string(k));
      if (HasFatalFailure()) return;
      contacts += with.contacts.size();
      known += with.stats.pairs_known_apart;
    }
  }
  EXPECT_GT(contacts, 1000u);
  EXPECT_GT(known, 1000u);
}

/// To turn it on costs what some steps with it save. Here every trial is a success, and every step after that shows it
/// to be none: the worst that a stream can do.
TEST(PairMemory, WhatIsGivenUpSoonRestsLongerEachTime) {
  const Roll roll(40);
  const Body body = bodyOf(roll.topology, "roll");
  Detector detector(options(true));
  std::mt19937 random(3);
  std::uniform_real_distribution<double> noise(-0.01, 0.01);
  const auto state = [&] { return detector.history().impl().carried.memory.state(); };
  Positions before = roll.at(0, 2);
  int turned_on = 0;
  for (int k = 0; k < 500; ++k) {
    const bool was_on = state() == PairMemory::State::ON;
    Positions after = roll.at(0.1 * (k + 1), 2);
    if (was_on) {
      for (Vec3& p : after) p += Vec3(noise(random), noise(random), noise(random));
    }
    detector.run(stepOf(body, before, after));
    turned_on += !was_on && state() == PairMemory::State::ON;
    before = after;
  }
  EXPECT_GE(turned_on, 3) << "a trial came, and was a success";
  EXPECT_LE(turned_on, 7) << "after 16, 32, 64, 128, 256 steps";
}

TEST(PairMemory, TakesNoMoreThanItMay) {
  const Roll roll(64);
  const Body body = bodyOf(roll.topology, "roll");
  Detector detector(options(true));
  for (int k = 0; k < 4; ++k) detector.run(stepOf(body, roll.at(0.1 * k), roll.at(0.1 * (k + 1))));
  const PairMemory& memory = detector.history().impl().carried.memory;
  ASSERT_TRUE(memory.isOn());
  EXPECT_LT(memory.bytes(), 200 * roll.topology.faces().size());
}

}  // namespace
}  // namespace test
}  // namespace dccd
