// An effect that is off costs nothing: not one allocation more than in a scene that knows nothing of it, and zeros in
// its statistics. Switched on, the same scene allocates and counts.
#include <gtest/gtest.h>

#include <functional>

#include "dccd/stream.h"
#include "unit/allocations.h"

namespace dccd {
namespace {

struct Scene {
  MonitorOptions options;
  Body body;
  bool second = false;  ///< another body, turning through the first; with body's own settings
  bool second_is_rigid = false;
  ObstacleMap map;
  std::vector<double> radius_m;
  bool predicts = false;
};

struct Cost {
  std::uint64_t allocations = 0, bytes = 0;
  StepStats stats;
  bool ok = true;
};

/// Set-up and five steps of a crumpled cloth.
Cost costOf(const Scene& scene) {
  const auto topology = std::make_shared<const Topology>(Topology::grid(8, 8));
  std::vector<MeshFrame> frames, others;
  for (int k = 0; k < 6; ++k) {
    MeshFrame frame;
    frame.stamp_ns = 1000000 * (k + 1);
    frame.topology = topology;
    for (int i = 0; i < 64; ++i) {
      frame.positions.emplace_back(0.05 * ((i * 37) % 11), 0.05 * ((i * 29) % 13),
                                   0.05 * ((i * 23) % 7) - 0.01 * k * (i % 3));
    }
    frame.radius_m = scene.radius_m;
    if (scene.second) {
      others.push_back(frame);
      others.back().rigid = scene.second_is_rigid;
      others.back().pose.linear() = Eigen::AngleAxisd(0.3 * k, Vec3::UnitZ()).toRotationMatrix();
      others.back().positions = frames.empty() ? frame.positions : frames.front().positions;
      for (Vec3& p : others.back().positions) p = others.back().pose * p;
    }
    frames.push_back(std::move(frame));
  }
  std::vector<Body> bodies{scene.body};
  if (scene.second) {
    bodies.push_back(scene.body);
    bodies.back().name = "other";
    bodies.back().rigid = scene.second_is_rigid;
  }
  Cost cost;
  Outcome outcome;
  const std::uint64_t before = test::allocations, bytes_before = test::allocated_bytes;
  Monitor monitor(scene.options, bodies);
  if (scene.map.surface) monitor.setMap(scene.map);
  for (std::size_t k = 0; k < frames.size(); ++k) {
    if (scene.second) monitor.push(1, std::move(others[k]), 0);
    monitor.push(0, std::move(frames[k]), 0);
    cost.ok = monitor.next(0, outcome) && cost.ok;
    if (scene.predicts && outcome.answered)
      outcome.stats[Effect::LOOK_AHEAD].in = monitor.predict().stats.vf_candidates;
  }
  cost.allocations = test::allocations - before;
  cost.bytes = test::allocated_bytes - bytes_before;
  cost.stats = outcome.stats;
  cost.ok = cost.ok && outcome.answered;
  return cost;
}

void expectZero(const StageStats& stats, const char* what) {
  EXPECT_EQ(stats.in, 0u) << what;
  EXPECT_EQ(stats.out, 0u) << what;
  EXPECT_EQ(stats.ms, 0.0) << what;
}

/// Conservative, so that every effect can be had; nothing else.
Scene bare() {
  Scene scene;
  scene.options.detector.accuracy.rung = Accuracy::CONSERVATIVE;
  scene.options.detector.check_start_state = false;
  scene.body.name = "cloth";
  scene.body.self_collision = scene.body.against_bodies = scene.body.against_obstacle = false;
  return scene;
}

struct Case {
  Effect effect;
  std::function<void(Scene&)> present;  ///< what the effect would work on is there, but the effect is off
  std::function<void(Scene&)> on;
};

std::vector<Case> cases() {
  const auto surface = VoxelSurface::build(0.05, {{{32768, 32768, 32768}, 1}, {{32770, 32770, 32768}, 2}});
  return {
      {Effect::SELF_COLLISION, [](Scene&) {}, [](Scene& s) { s.body.self_collision = true; }},
      {Effect::OCTOMAP, [=](Scene& s) { s.map.surface = surface; }, [](Scene& s) { s.body.against_obstacle = true; }},
      {Effect::BODY_BODY, [](Scene& s) { s.second = true; }, [](Scene& s) { s.body.against_bodies = true; }},
      {Effect::RIGID_BODIES, [](Scene& s) { s.second = s.body.against_bodies = true; },
       [](Scene& s) { s.second_is_rigid = true; }},
      {Effect::START_STATE, [](Scene& s) { s.body.self_collision = true; },
       [](Scene& s) { s.options.detector.check_start_state = true; }},
      {Effect::LOOK_AHEAD, [](Scene& s) { s.body.self_collision = true; },
       [](Scene& s) {
         s.options.look_ahead_s = 0.1;
         s.predicts = true;
       }},
      {Effect::PATCHES, [](Scene& s) { s.body.self_collision = true; },
       [](Scene& s) { s.options.detector.patches = true; }},
      {Effect::OWN_VOXELS,
       [=](Scene& s) {
         s.map.surface = surface;
         s.body.against_obstacle = true;
       },
       [](Scene& s) { s.body.own_voxels_m = 0.1; }},
      {Effect::CLEARANCE,
       [=](Scene& s) {
         s.map.surface = surface;
         s.body.self_collision = s.body.against_obstacle = true;
       },
       [](Scene& s) { s.options.detector.clearance.wanted = true; }},
      {Effect::MINIMUM_SEPARATION, [](Scene& s) { s.body.self_collision = true; },
       [](Scene& s) { s.body.minimum_separation_m = 0.2; }},
      {Effect::TRACKER_NOISE, [](Scene& s) { s.body.self_collision = true; },
       [](Scene& s) { s.radius_m.assign(64, 0.1); }},
  };
}

TEST(EffectsOff, AllocateNothingAndShowZeros) {
  costOf(bare());  // what the library makes once
  const Cost nothing = costOf(bare());
  ASSERT_TRUE(nothing.ok);
  EXPECT_EQ(costOf(bare()).allocations, nothing.allocations) << "the count is the same for the same scene";
  for (std::size_t e = 0; e < static_cast<std::size_t>(Effect::COUNT); ++e) {
    expectZero(nothing.stats.effects[e], toString(static_cast<Effect>(e)));
  }
  for (const Case& one : cases()) {
    Scene off = bare();
    one.present(off);
    Scene on = off;
    one.on(on);
    const Cost without = costOf(off), with = costOf(on);
    ASSERT_TRUE(without.ok && with.ok) << toString(one.effect);
    expectZero(without.stats[one.effect], toString(one.effect));
    EXPECT_GT(with.stats[one.effect].in, 0u) << toString(one.effect) << " can be told from off";
    EXPECT_GT(with.bytes, without.bytes) << toString(one.effect);
    // Where only the effect itself was left out, the scene costs what an empty one does.
    if (one.effect == Effect::SELF_COLLISION || one.effect == Effect::OCTOMAP) {
      EXPECT_EQ(without.allocations, nothing.allocations) << toString(one.effect);
    }
  }
}

std::uint64_t pairsIn(const StepStats& stats) {
  std::uint64_t sum = 0;
  for (const Effect effect :
       {Effect::SELF_COLLISION, Effect::BODY_BODY, Effect::MINIMUM_SEPARATION, Effect::TRACKER_NOISE}) {
    sum += stats[effect].in;
  }
  return sum;
}

/// Each pair is in one row alone, and so is the time.
TEST(EffectRows, CountNothingTwice) {
  Scene scene = bare();
  scene.second = scene.second_is_rigid = true;
  scene.body.self_collision = scene.body.against_bodies = true;
  const auto check = [&](const char* what) {
    const StepStats stats = costOf(scene).stats;
    EXPECT_EQ(pairsIn(stats), stats[Stage::BROAD_PHASE].out) << what;
    double ms = 0;
    for (const StageStats& effect : stats.effects) ms += effect.ms;
    EXPECT_LE(ms, stats.total_ms * (1 + 1e-9)) << what;  // sums are rounded
    EXPECT_EQ(stats[Effect::RIGID_BODIES].in, 1u) << what << ": the body that turns";
    return stats;
  };
  const StepStats plain = check("plain");
  EXPECT_EQ(plain[Effect::MINIMUM_SEPARATION].in + plain[Effect::TRACKER_NOISE].in, 0u);
  scene.body.minimum_separation_m = 0.02;
  const StepStats separated = check("with a separation");
  EXPECT_GT(separated[Effect::MINIMUM_SEPARATION].in, 0u);
  scene.radius_m.assign(64, 0.0);
  scene.radius_m[5] = 0.01;
  const StepStats noisy = check("with one uncertain vertex");
  EXPECT_GT(noisy[Effect::TRACKER_NOISE].in, 0u);
  EXPECT_GT(noisy[Effect::MINIMUM_SEPARATION].in, 0u);
  std::uint64_t hits = 0;
  for (const StageStats& effect : noisy.effects) hits += effect.out;
  EXPECT_EQ(hits - noisy[Effect::RIGID_BODIES].out, noisy[Stage::ELEMENTARY].out);
}

}  // namespace
}  // namespace dccd
