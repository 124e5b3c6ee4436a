#include "base/effect_plan.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "dccd/detect.h"
#include "support/said.h"

namespace dccd {
namespace {

Body body(const std::string& name, bool rigid = false) {
  Body out;
  out.name = name;
  out.rigid = rigid;
  return out;
}

EffectScene cloth() {
  EffectScene scene;
  scene.bodies = {body("cloth")};
  scene.map_source = "octomap";
  return scene;
}

std::string reason(const EffectPlan& plan, const std::string& name) {
  for (const EffectDecision& decision : plan.decisions()) {
    if (decision.name == name) return decision.reason;
  }
  return "";
}

std::string saidOf(const EffectScene& scene, const std::string& name) { return reason(EffectPlan(scene, {}), name); }

/// By itself.
void expectRuns(const EffectScene& scene, Effect effect, const std::string& why) {
  EXPECT_TRUE(EffectPlan(scene, {}).running(effect)) << why;
  EXPECT_EQ(saidOf(scene, toString(effect)), why);
}

/// Runs neither by itself nor because the user asks for it, which is no mistake either.
void expectIdle(const EffectScene& scene, Effect effect, const std::string& why) {
  for (const EffectSetting setting : {EffectSetting::AUTO, EffectSetting::ON}) {
    const EffectPlan plan(scene, {{effect, setting}});
    EXPECT_FALSE(plan.running(effect)) << toString(setting);
    EXPECT_EQ(reason(plan, toString(effect)), why) << toString(setting);
  }
}

/// To ask for it is a mistake.
void expectRefused(const EffectScene& scene, Effect effect, const std::string& why) {
  EXPECT_FALSE(EffectPlan(scene, {}).running(effect)) << why;
  EXPECT_EQ(saidOf(scene, toString(effect)), why);
  EXPECT_THROW(EffectPlan(scene, {{effect, EffectSetting::ON}}), std::invalid_argument) << why;
}

TEST(EffectPlan, AutoTakesWhatTheSceneCallsFor) {
  const EffectPlan plan(cloth(), {});
  EXPECT_TRUE(plan.running(Effect::SELF_COLLISION));
  EXPECT_TRUE(plan.running(Effect::START_STATE));
  EXPECT_FALSE(plan.running(Effect::BODY_BODY));
  EXPECT_FALSE(plan.running(Effect::OCTOMAP));
  EXPECT_FALSE(plan.running(Effect::MINIMUM_SEPARATION));
  EXPECT_FALSE(plan.running(Effect::LOOK_AHEAD));
  EXPECT_EQ(reason(plan, "body_body"), "there is only one body");
  for (const EffectDecision& decision : plan.decisions()) EXPECT_FALSE(decision.reason.empty()) << decision.name;
}

TEST(EffectPlan, ChangesWithTheScene) {
  EffectScene scene = cloth();
  const EffectPlan before(scene, {});
  EXPECT_EQ(before, EffectPlan(scene, {}));
  scene.map_seen = true;
  const EffectPlan after(scene, {});
  EXPECT_NE(before, after);
  EXPECT_TRUE(after.running(Effect::OCTOMAP));
  EXPECT_EQ(reason(after, "octomap_corner_face"), "a body has faces");
  scene.bodies[0].topology = share(Topology::polyline(3));
  const EffectPlan rope(scene, {});
  EXPECT_EQ(reason(rope, "octomap_corner_face"), "a polyline has no faces");
}

TEST(EffectPlan, AMapThatIsNamedIsWantedBeforeItComes) {
  EffectScene scene = cloth();
  scene.map_source = "/table";
  scene.map_named = true;
  expectRuns(scene, Effect::OCTOMAP, "octomap_topic names /table, from which no map has come");
  scene.map_seen = true;
  expectRuns(scene, Effect::OCTOMAP, "the map comes from /table");
  scene.bodies[0].against_obstacle = false;
  EXPECT_FALSE(EffectPlan(scene, {}).running(Effect::OCTOMAP)) << "nobody could meet it";
}

// Whatever the user asks for: there is nothing to look at, to know, or nobody to tell.
TEST(EffectPlan, NothingIsOnThatHasNothingToDo) {
  EffectScene rope = cloth();
  rope.bodies[0].topology = share(Topology::polyline(3));
  for (const bool seen : {false, true}) {  // which is not yet in use
    rope.map_named = rope.map_seen = seen;
    expectIdle(rope, Effect::START_STATE, "edges alone cannot be inside of anything, and there is no map");
  }
  rope.map_used = true;
  EXPECT_TRUE(EffectPlan(rope, {}).running(Effect::START_STATE)) << "a rope may begin inside of the map";

  EffectScene unknown = cloth();
  unknown.unknown_space_counts = true;
  const char* const no_map = "unknown_space is not free, but there is no map that could know it";
  expectIdle(unknown, Effect::UNKNOWN_SPACE, no_map);
  unknown.map_used = true;
  EXPECT_TRUE(EffectPlan(unknown, {}).running(Effect::UNKNOWN_SPACE));
  unknown.bodies[0].against_obstacle = false;
  EXPECT_FALSE(EffectPlan(unknown, {{Effect::UNKNOWN_SPACE, EffectSetting::ON}}).running(Effect::UNKNOWN_SPACE));

  EXPECT_TRUE(EffectPlan(cloth(), {}).running(Effect::PATCHES));

  EffectScene seen = cloth();
  expectRefused(seen, Effect::OWN_VOXELS, "own_voxels_m is 0 for every body; set it above");
  seen.bodies[0].own_voxels_m = 0.02;
  expectIdle(seen, Effect::OWN_VOXELS, "there is no map");
  seen.map_used = true;
  const std::string told = "what the map first shows where a body is, is no obstacle: ";
  expectRuns(seen, Effect::OWN_VOXELS, told + "cloth within 0.02 m");
  seen.bodies[0].own_voxels_m = ONE_VOXEL;
  expectRuns(seen, Effect::OWN_VOXELS, told + "cloth within a voxel");

  EffectScene ahead = cloth();
  ahead.look_ahead_s = 0.5;
  expectIdle(ahead, Effect::LOOK_AHEAD, "nobody subscribes to predictions");
  ahead.predictions_heard = true;
  expectRuns(ahead, Effect::LOOK_AHEAD, "predictions reach 0.5 s ahead");

  EffectScene apart = cloth();
  EXPECT_FALSE(EffectPlan(apart, {}).running(Effect::CLEARANCE));
  EXPECT_EQ(saidOf(apart, "clearance"), "nobody asks for distances");
  EXPECT_TRUE(EffectPlan(apart, {{Effect::CLEARANCE, EffectSetting::ON}}).running(Effect::CLEARANCE))
      << "for whoever reads ~state alone";
  apart.clearance_wanted = true;
  EXPECT_TRUE(EffectPlan(apart, {}).running(Effect::CLEARANCE));
  EXPECT_FALSE(EffectPlan(apart, {{Effect::CLEARANCE, EffectSetting::OFF}}).running(Effect::CLEARANCE));
}

TEST(EffectPlan, RigidBodiesMeetOthersOnly) {
  EffectScene scene = cloth();
  scene.bodies = {body("finger", true)};
  EXPECT_EQ(reason(EffectPlan(scene, {}), "self_collision"), "the body is rigid");
  scene.bodies.push_back(body("cloth"));
  const EffectPlan both(scene, {});
  EXPECT_TRUE(both.running(Effect::SELF_COLLISION));
  EXPECT_TRUE(both.running(Effect::BODY_BODY));
  EXPECT_TRUE(both.running(Effect::RIGID_BODIES));
}

TEST(EffectPlan, OffIsOffAndOnNeedsItsReason) {
  EffectScene scene = cloth();
  scene.map_seen = true;
  const EffectPlan plan(scene, {{Effect::OCTOMAP, EffectSetting::OFF}, {Effect::SELF_COLLISION, EffectSetting::OFF}});
  EXPECT_FALSE(plan.running(Effect::OCTOMAP));
  EXPECT_FALSE(plan.running(Effect::SELF_COLLISION));
  scene.map_seen = false;
  EXPECT_TRUE(EffectPlan(scene, {{Effect::OCTOMAP, EffectSetting::ON}}).running(Effect::OCTOMAP))
      << "so a missing map is told";
  for (const Effect effect : {Effect::BODY_BODY, Effect::RIGID_BODIES, Effect::UNKNOWN_SPACE,
                              Effect::MINIMUM_SEPARATION, Effect::LOOK_AHEAD}) {
    const std::string text = test::said<std::invalid_argument>([&] {
      EffectPlan impossible(scene, {{effect, EffectSetting::ON}});
    });
    EXPECT_NE(text.find(std::string("effects/") + toString(effect)), std::string::npos) << text;
  }
}

// What bodies say of themselves counts: the flow asks the same.
TEST(EffectPlan, BodiesThatMeetNothingRunNothing) {
  EffectScene scene = cloth();
  scene.map_seen = true;
  scene.bodies = {body("cloth"), body("table")};
  for (Body& one : scene.bodies) one.against_bodies = one.against_obstacle = one.self_collision = false;
  const EffectPlan none(scene, {});
  for (const Effect effect : {Effect::SELF_COLLISION, Effect::BODY_BODY, Effect::OCTOMAP}) {
    EXPECT_FALSE(none.running(effect)) << toString(effect);
    EXPECT_FALSE(EffectPlan(scene, {{effect, EffectSetting::ON}}).running(effect)) << toString(effect);
  }
  EXPECT_EQ(reason(none, "octomap"), "against_obstacle is false for every body");
  scene.bodies[0].against_bodies = true;
  EXPECT_FALSE(EffectPlan(scene, {}).running(Effect::BODY_BODY)) << "one alone has nobody to meet";
  scene.bodies[1].against_bodies = true;
  EXPECT_TRUE(EffectPlan(scene, {}).running(Effect::BODY_BODY));
}

// Said of what one takes for solid, and of nothing else.
TEST(EffectPlan, ABodyWithABorderHasNoInside) {
  const std::vector<Face> faces{{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};
  EffectScene scene = cloth();
  scene.bodies[0].topology = share(Topology::grid(2, 2));
  scene.bodies.push_back(body("finger", true));
  scene.bodies[1].topology = share(Topology::fromTriangles(4, faces));
  const std::string plain = "surfaces that cross already at the start are invisible to continuous detection";
  const auto said = [&] { return reason(EffectPlan(scene, {}), "start_state"); };
  EXPECT_EQ(said(), plain);
  scene.bodies[1].vertex_mask = {2};
  EXPECT_EQ(said(), plain + "; with masked vertices, no inside: finger");
  scene.bodies[1].topology = share(Topology::fromTriangles(4, {faces[0], faces[1]}));
  EXPECT_EQ(said(), plain + "; with a border, no inside: finger");
  scene.bodies[1].vertex_mask.clear();
  std::vector<Face> own;
  Positions corners, apart;
  for (const Face& f : faces) {
    const auto n = static_cast<Index>(corners.size());
    own.push_back({n, n + 1, n + 2});
    for (const Index v : f) corners.push_back(v == 3 ? Vec3(0, 0, 0) : Vec3(Vec3::Unit(v)));
  }
  apart = corners;
  apart[4][1] += 1e-9;
  scene.bodies[1].topology = share(Topology::fromTriangles(corners.size(), own));
  scene.bodies[1].t0 = share(corners);
  EXPECT_EQ(said(), plain) << "doubled corners are no border";
  scene.bodies[1].t0 = share(apart);
  EXPECT_EQ(said(), plain + "; with a border, no inside: finger");
  scene.bodies[1].shell = true;
  EXPECT_EQ(said(), plain) << "a container is not asked";
  scene.bodies[1].shell = false;
  scene.bodies[0].against_bodies = false;
  EXPECT_EQ(said(), plain) << "nobody to be inside of it";
}

// --- what pairs carry ------------------------------------------------------------------------------------------------

const char* const ONLY_THE_MAP_WOULD = "only pairs with the map carry a separation, but there is no map";
const char* const NO_PAIR_CARRIES = "a separation is set, but no pair that is tested carries it";

TEST(EffectPlan, ASeparationThatNoPairCarriesDoesNotRun) {
  EffectScene scene = cloth();
  scene.bodies[0].minimum_separation_m = 0.12;
  EXPECT_EQ(saidOf(scene, "minimum_separation"), "contacts are reported from 0.12 m");
  scene.bodies[0].self_collision = false;
  expectIdle(scene, Effect::MINIMUM_SEPARATION, ONLY_THE_MAP_WOULD);
  scene.map_named = scene.map_seen = true;
  expectIdle(scene, Effect::MINIMUM_SEPARATION, ONLY_THE_MAP_WOULD);
  scene.map_used = true;
  EXPECT_EQ(saidOf(scene, "minimum_separation"), "contacts are reported from 0.12 m");
  scene.bodies[0].against_obstacle = false;
  expectIdle(scene, Effect::MINIMUM_SEPARATION, NO_PAIR_CARRIES);
  scene.bodies[0].self_collision = true;
  scene.bodies[0].rigid = true;
  expectIdle(scene, Effect::MINIMUM_SEPARATION, NO_PAIR_CARRIES);
}

TEST(EffectPlan, AnOverrideMayMakeOnePairAloneSeparated) {
  EffectScene scene = cloth();
  scene.bodies = {body("felt"), body("finger", true), body("table", true)};
  scene.bodies[2].separations = {{0, 0.004}};
  EXPECT_EQ(saidOf(scene, "minimum_separation"), "contacts are reported from 0.004 m");
  scene.bodies[0].against_bodies = false;
  expectIdle(scene, Effect::MINIMUM_SEPARATION, NO_PAIR_CARRIES);
  scene.bodies[0].separations = {{OBSTACLE_BODY, 0.03}};
  expectIdle(scene, Effect::MINIMUM_SEPARATION, ONLY_THE_MAP_WOULD);
  scene.map_used = true;
  EXPECT_EQ(saidOf(scene, "minimum_separation"), "contacts are reported from 0.03 m");
  scene.bodies[0].separations.push_back({0, 0.001});
  EXPECT_EQ(saidOf(scene, "minimum_separation"), "contacts are reported from 0.03 m") << "the largest one";
  scene.map_used = false;
  EXPECT_EQ(saidOf(scene, "minimum_separation"), "contacts are reported from 0.001 m") << "of those that are tested";
}

TEST(EffectPlan, AnUncertaintyCountsWhereItsBodyMeetsSomething) {
  const char* const only_the_map = "bodies with an uncertainty meet nothing but the map, and there is no map";
  EffectScene scene = cloth();
  scene.noise = {"0.003 m"};
  const std::string said = "vertices are only known to a radius (cloth: 0.003 m)";
  EXPECT_EQ(saidOf(scene, "tracker_noise"), said);
  scene.bodies[0].self_collision = false;
  expectIdle(scene, Effect::TRACKER_NOISE, only_the_map);
  scene.map_named = scene.map_seen = true;
  expectIdle(scene, Effect::TRACKER_NOISE, only_the_map);
  scene.map_used = true;
  EXPECT_EQ(saidOf(scene, "tracker_noise"), said);
  scene.bodies[0].against_obstacle = false;
  expectIdle(scene, Effect::TRACKER_NOISE, "no body with an uncertainty meets anything");
  scene.bodies.push_back(body("finger", true));
  scene.noise.push_back("");
  EXPECT_EQ(saidOf(scene, "tracker_noise"), said) << "it meets the finger";
  scene.bodies[1].against_bodies = false;
  expectIdle(scene, Effect::TRACKER_NOISE, "no body with an uncertainty meets anything");
  scene.bodies[0].self_collision = true;
  scene.noise[1] = "0.001 m";
  EXPECT_EQ(saidOf(scene, "tracker_noise"), "vertices are only known to a radius (cloth: 0.003 m; finger: 0.001 m)");
  scene.map_used = false;
  EXPECT_EQ(saidOf(scene, "tracker_noise"), said) << "the finger meets nothing but the map";
  scene.noise = {"", ""};
  EXPECT_THROW(EffectPlan(scene, {{Effect::TRACKER_NOISE, EffectSetting::ON}}), std::invalid_argument);
}

/// Two triangles on top of each other and a voxel below them, all close together: each pair that may meet does.
Step closeTogether(const std::vector<Body>& bodies, bool with_map) {
  Step step;
  step.bodies = bodies;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const double z = 0.01 + 0.01 * static_cast<double>(b);
    const Positions layers{{0, 0, z},         {0.1, 0, z},         {0, 0.1, z},
                           {0, 0, 0.005 + z}, {0.1, 0, 0.005 + z}, {0, 0.1, 0.005 + z}};
    step.bodies[b].topology = share(Topology::fromTriangles(6, {{0, 1, 2}, {3, 4, 5}}));
    step.bodies[b].t0 = step.bodies[b].t1 = share(layers);
  }
  if (with_map) step.map.surface = VoxelSurface::build(0.1, {{{32768, 32768, 32767}, 1}});
  return step;
}

/// What the plan tells is what the flow counts, whatever the bodies meet and whatever they carry.
TEST(EffectPlan, RunsWhatTheFlowCounts) {
  for (unsigned bits = 0; bits < 1u << 10; ++bits) {
    const auto bit = [bits](unsigned i) { return (bits >> i & 1) != 0; };
    std::vector<Body> bodies{body("cloth"), body("finger", true)};
    bodies[0].self_collision = bit(0);
    bodies[0].against_bodies = bit(1);
    bodies[0].against_obstacle = bit(2);
    bodies[1].against_obstacle = bit(3);
    bodies[bit(4) ? 1 : 0].minimum_separation_m = 0.05;
    if (bit(5)) bodies[0].separations.push_back({0, 0});
    if (bit(6)) bodies[0].separations.push_back({OBSTACLE_BODY, 0});
    if (bit(7)) bodies[1].separations.push_back({0, 0});
    const bool with_map = bit(8), noise = bit(9);
    Step step = closeTogether(bodies, with_map);
    EffectScene scene = cloth();
    scene.bodies = step.bodies;
    scene.map_used = with_map;
    if (noise) {
      scene.noise = {"0.03 m", ""};
      step.bodies[0].radius_m = share(std::vector<double>(6, 0.03));
    }
    Options options;
    options.accuracy.rung = Accuracy::CONSERVATIVE;
    History history;
    const Outcome outcome = detect(step, options, history);
    const EffectPlan plan(scene, {});
    EXPECT_EQ(outcome.stats[Effect::TRACKER_NOISE].in > 0, plan.running(Effect::TRACKER_NOISE)) << bits;
    // A pair with an uncertain vertex counts there alone.
    if (noise) continue;
    EXPECT_EQ(outcome.stats[Effect::MINIMUM_SEPARATION].in > 0, plan.running(Effect::MINIMUM_SEPARATION))
        << bits << ": " << saidOf(scene, "minimum_separation");
  }
}

TEST(EffectPlan, LinesSayOneThingEach) {
  const EffectPlan plan(cloth(), {});
  ASSERT_EQ(plan.lines().size(), plan.decisions().size());
  EXPECT_EQ(plan.lines()[0], "self_collision: on, cloth deforms");
}

}  // namespace
}  // namespace dccd
