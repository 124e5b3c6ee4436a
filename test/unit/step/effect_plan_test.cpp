#include "dccd/effect_plan.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace dccd {
namespace {

EffectBody body(const std::string& name, bool rigid = false) {
  EffectBody out;
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

TEST(EffectPlan, AutoTakesWhatTheSceneCallsFor) {
  const EffectPlan plan(cloth(), {});
  EXPECT_TRUE(plan.running("self_collision"));
  EXPECT_TRUE(plan.running("start_state"));
  EXPECT_FALSE(plan.running("body_body"));
  EXPECT_FALSE(plan.running("octomap"));
  EXPECT_FALSE(plan.running("minimum_separation"));
  EXPECT_FALSE(plan.running("look_ahead"));
  EXPECT_EQ(reason(plan, "body_body"), "there is only one body");
  for (const EffectDecision& decision : plan.decisions()) EXPECT_FALSE(decision.reason.empty()) << decision.name;
  EXPECT_THROW(plan.running("wind"), std::invalid_argument);
}

TEST(EffectPlan, ChangesWithTheScene) {
  EffectScene scene = cloth();
  const EffectPlan before(scene, {});
  EXPECT_EQ(before, EffectPlan(scene, {}));
  scene.map_seen = true;
  const EffectPlan after(scene, {});
  EXPECT_NE(before, after);
  EXPECT_TRUE(after.running("octomap"));
  EXPECT_TRUE(after.running("octomap_corner_face"));
  scene.bodies[0].topology_known = true;
  scene.bodies[0].has_faces = false;
  const EffectPlan rope(scene, {});
  EXPECT_FALSE(rope.running("octomap_corner_face"));
  EXPECT_EQ(reason(rope, "octomap_corner_face"), "a polyline has no faces");
}

TEST(EffectPlan, RigidBodiesMeetOthersOnly) {
  EffectScene scene = cloth();
  scene.bodies = {body("finger", true)};
  EXPECT_EQ(reason(EffectPlan(scene, {}), "self_collision"), "the body is rigid");
  scene.bodies.push_back(body("cloth"));
  const EffectPlan both(scene, {});
  EXPECT_TRUE(both.running("self_collision"));
  EXPECT_TRUE(both.running("body_body"));
  EXPECT_TRUE(both.running("rigid_bodies"));
}

TEST(EffectPlan, OffIsOffAndOnNeedsItsReason) {
  EffectScene scene = cloth();
  scene.map_seen = true;
  const EffectPlan plan(scene, {{"octomap", EffectSetting::OFF}, {"self_collision", EffectSetting::OFF}});
  EXPECT_FALSE(plan.running("octomap"));
  EXPECT_FALSE(plan.running("self_collision"));
  scene.map_seen = false;
  EXPECT_TRUE(EffectPlan(scene, {{"octomap", EffectSetting::ON}}).running("octomap")) << "so a missing map is told";
  for (const char* name : {"body_body", "rigid_bodies", "unknown_space", "minimum_separation", "look_ahead"}) {
    try {
      EffectPlan impossible(scene, {{name, EffectSetting::ON}});
      ADD_FAILURE() << name;
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(std::string("effects/") + name), std::string::npos) << error.what();
    }
  }
}

TEST(EffectPlan, LinesSayOneThingEach) {
  const EffectPlan plan(cloth(), {});
  ASSERT_EQ(plan.lines().size(), plan.decisions().size());
  EXPECT_EQ(plan.lines()[0], "self_collision: on, cloth deforms");
}

}  // namespace
}  // namespace dccd
