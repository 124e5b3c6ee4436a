// What a history holds after each kind of seam is what a new one holds: nothing, and so the next answer is a new one's.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <tuple>

#include "dccd/stream.h"
#include "step/history.h"
#include "stream/monitor_impl.h"
#include "support/closed_meshes.h"
#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

/// All that could be carried over, taken apart.
void expectFresh(History& history) {
  History fresh;
  const Carried &now = History::Impl::of(history).carried, &then = History::Impl::of(fresh).carried;
  EXPECT_EQ(now.end, then.end);
  EXPECT_EQ(now.apart, then.apart);
  EXPECT_TRUE(then.start_state.isClear());
  EXPECT_TRUE(now.start_state.isClear());
  EXPECT_TRUE(then.inside.isClear());
  EXPECT_TRUE(now.inside.isClear());
  EXPECT_TRUE(now.map.empty());
  EXPECT_TRUE(history.isClear());
}

void expectSameAnswer(const Outcome& a, const Outcome& b) {
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(difference(a.contacts, b.contacts), "");
  EXPECT_EQ(a.start_state, b.start_state);
  EXPECT_TRUE(same(a.intersections, b.intersections));
}

/// Everything about an answer but its times.
void expectSame(const Outcome& a, const Outcome& b) {
  expectSameAnswer(a, b);
  for (std::size_t e = 0; e < a.stats.effects.size(); ++e) {
    EXPECT_EQ(a.stats.effects[e].in, b.stats.effects[e].in) << toString(static_cast<Effect>(e));
    EXPECT_EQ(a.stats.effects[e].out, b.stats.effects[e].out) << toString(static_cast<Effect>(e));
  }
  EXPECT_EQ(a.stats.undecided, b.stats.undecided);
  EXPECT_EQ(a.stats.body_pairs, b.stats.body_pairs);
}

/// Two cloths that cross, in a box around both: something of every kind to carry over.
TestStep clothsInABox() {
  TestStep step = crumpled(3, 2, 9);
  step.bodies.push_back(box(Vec3::Constant(-50), Vec3::Constant(50)));
  step.bodies[2].t1 = movedBy(step.bodies[2].t0, {1, 0, 0});  // bounds of what rests are wider, and let more through
  return step;
}

TestStep nextOf(const TestStep& first) {
  return first.continued({first.bodies[0].t0, first.bodies[1].t0, first.bodies[2].t0});
}

TEST(History, EverySeamLeavesNothingBehind) {
  const TestStep first = clothsInABox(), next = nextOf(first);
  const Outcome expected = runOnce(next, {});
  ASSERT_EQ(std::count_if(expected.intersections.begin(), expected.intersections.end(),
                          [](const StartIntersection& one) { return one.vertex[1] == NO_INDEX; }),
            2)
      << "both cloths in the box";
  Step broken = first.motion();
  broken.bodies[1].t1 = share(Positions(3, Vec3::Zero()));
  Step other = first.motion();
  other.bodies.pop_back();
  const std::vector<std::pair<const char*, std::function<void(Detector&)>>> seams = {
      {"a seam or a reset", [](Detector& d) { d.history().clear(); }},
      {"a step that throws", [&](Detector& d) { EXPECT_THROW(d.run(broken), std::invalid_argument); }},
      {"options that throw",
       [&](Detector& d) {
         Options bad;
         bad.num_threads = 0;
         d.setOptions(bad);
         EXPECT_THROW(d.run(next.motion()), std::invalid_argument);
         d.setOptions(Options());
       }},
  };
  for (const auto& [name, seam] : seams) {
    SCOPED_TRACE(name);
    Detector detector;
    detector.run(first.motion());
    EXPECT_FALSE(detector.history().isClear());
    seam(detector);
    expectFresh(detector.history());
    expectSame(detector.run(next.motion()), expected);
  }
  // Other bodies are no seam that anybody tells of, and nothing of theirs may be taken for these.
  Detector detector;
  detector.run(first.motion());
  detector.run(other);
  expectSameAnswer(detector.run(next.motion()), expected);
}

/// What is made of a mesh once takes as long as many steps: of bodies that stay it stays.
TEST(History, NothingIsMadeAnewOfBodiesBeforeOneThatComesOrGoes) {
  const TestStep first = clothsInABox();
  Step more = nextOf(first).motion();
  Body rod = more.bodies[2];
  rod.name = "rod";
  more.bodies.push_back(rod);
  Detector detector;
  detector.run(first.motion());
  const std::vector<SceneBody>& bodies = History::Impl::of(detector.history()).scene.bodies();
  const auto placesOf = [&] {
    std::vector<const Index*> places;
    for (std::size_t b = 0; b < 3; ++b) places.push_back(bodies[b].tree(FeatureKind::FACE).feature(0));
    return places;
  };
  const std::vector<const Index*> places = placesOf();
  for (const Step& step : {more, first.motion(), more}) {
    detector.run(step);
    ASSERT_EQ(bodies.size(), step.bodies.size());
    EXPECT_EQ(placesOf(), places);
  }
}

/// Bodies with a separation, of which some are left out of it, come, go and give way to others, wherever in the list.
TEST(History, BodiesThatComeAndGoChangeNoAnswer) {
  Options options;
  options.accuracy.rung = Accuracy::CONSERVATIVE;
  std::size_t contacts = 0, left_out = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const Draw draw = drawFrom(9000 + seed);
    const auto moved = [&](Positions x) {
      for (Vec3& p : x) p += Vec3(draw(-9, 9), draw(-9, 9), draw(-9, 9)) / 400;
      return x;
    };
    std::vector<Body> there;
    History history;
    for (int i = 0; i < 8; ++i) {
      for (Body& body : there) body.t0 = body.t1;
      const auto place = draw(0, static_cast<int>(there.size()));
      if (!there.empty() && place < static_cast<int>(there.size()) && draw(0, 2) > 0)
        there.erase(there.begin() + place);
      if (there.empty() || draw(0, 2) > 0) {
        const auto rows = static_cast<std::size_t>(draw(2, 6));
        Body come = bodyOf("body " + std::to_string(i), Topology::grid(rows, 4));
        come.t0 = come.t1 = share(moved(gridAt(rows, 4, 0.1, {0, 0, 0.03 * draw(0, 3)})));
        come.reference = come.t0;
        come.minimum_separation_m = 0.01 * draw(0, 6);
        there.insert(there.begin() + std::min<int>(place, static_cast<int>(there.size())), std::move(come));
      }
      for (Body& body : there) body.t1 = share(moved(*body.t0));
      Step step;
      step.bodies = there;
      History fresh;
      const Outcome now = detect(step, options, history), then = detect(step, options, fresh);
      SCOPED_TRACE("seed " + std::to_string(seed) + ", step " + std::to_string(i));
      expectSameAnswer(now, then);
      contacts += now.contacts.size();
      left_out += now.stats.left_out_met;
    }
  }
  EXPECT_GT(contacts, 1000u);
  EXPECT_GT(left_out, 1000u);
}

/// Other options make what follows from the map anew: also where there is no map any more.
TEST(History, AMapThatIsGoneIsNotKeptByOtherOptions) {
  TestStep step = crumpled(3, 1, 9);
  for (Positions* x : {&step.bodies[0].t0, &step.bodies[0].t1}) {
    for (Vec3& p : *x) p *= 0.1;
  }
  Step with_map = step.motion();
  with_map.map = {VoxelSurface::build(0.05, {voxelAt(0, 0, 0, 4)}), 1, Eigen::Isometry3d::Identity(), {}};
  Options expecting, other;
  expecting.obstacle_expected = other.obstacle_expected = true;
  other.max_contacts = 5000;
  History history;
  ASSERT_GT(detect(with_map, expecting, history).counts.obstacle, 0u);
  const Outcome without = detect(step.motion(), other, history);
  EXPECT_EQ(without.status, StepStatus::NO_MAP);
  EXPECT_EQ(without.counts.obstacle, 0u);
  EXPECT_EQ(without.obstacle, nullptr);
}

/// The cloths and the box as streams: one cloth is the clock, the box holds still.
struct ClothStream {
  explicit ClothStream(const Step& step, const ClothStream* like = nullptr) : scene(step) {
    if (like) {
      stamp_ns = like->stamp_ns;
      frames = like->frames;
      away_m = like->away_m;
      radius_m = like->radius_m;
      fewer = like->fewer;
    }
    pushBox();
  }
  static MonitorOptions options() {
    MonitorOptions o;
    o.store.max_vertex_step_m = 1000;
    o.look_ahead_s = 0.1;
    return o;
  }
  static std::vector<Body> bodies() {
    std::vector<Body> bodies(3);
    bodies[0].name = "cloth";
    bodies[1].name = "other";
    bodies[2].name = "box";
    bodies[2].motion = BodyMotionKind::STATIC;
    return bodies;
  }
  void push(std::size_t b) {
    const Body& body = scene.bodies[b];
    MeshFrame frame{stamp_ns, body.topology, frames % 2 ? *body.t1 : *body.t0, false, Eigen::Isometry3d::Identity()};
    for (Vec3& p : frame.positions) p += Vec3::Constant(b == 0 ? away_m[0] : b == 1 ? away_m[1] : 0);
    if (b == 0 && radius_m > 0) frame.radius_m.assign(frame.positions.size(), radius_m);
    if (b == 0 && fewer) {
      std::vector<Face> faces = body.topology->faces();
      faces.pop_back();
      frame.topology = share(Topology::fromTriangles(frame.positions.size(), faces));
    }
    monitor.countReceived(b);
    monitor.push(b, std::move(frame), 0);
  }
  void pushBox() { push(2); }
  Outcome feed() {
    push(1);
    push(0);
    Outcome outcome;
    EXPECT_TRUE(monitor.next(0, outcome));
    stamp_ns += 30000000;
    ++frames;
    return outcome;
  }
  History& history() { return Monitor::Impl::of(monitor).history; }

  const Step scene;
  Monitor monitor{options(), bodies()};
  StampNs stamp_ns = 1000000000;
  int frames = 0;
  std::array<double, 2> away_m{0, 0};
  double radius_m = 0;
  bool fewer = false;
};

/// What a stream knows of as a seam, each in the middle of it. After the first frame that follows, or at once, the
/// history holds nothing; and what a new monitor answers from that frame on is what this one answers. (It may look at
/// others: the order of features in the arrays is that of the first frame.)
TEST(History, EverySeamOfAStreamLeavesNothingBehind) {
  enum class Clears { AT_ONCE, WITH_THE_NEXT_FRAME, NEVER };
  struct Seam {
    const char* name;
    std::function<void(ClothStream&)> come;
    StepStatus status;  // of the next frame
    Clears clears;
  };
  const std::vector<Seam> seams = {
      {"gap", [](ClothStream& s) { s.stamp_ns += 10000000000; }, StepStatus::GAP, Clears::WITH_THE_NEXT_FRAME},
      {"time jump", [](ClothStream& s) { s.stamp_ns = 5000000; }, StepStatus::TIME_JUMP, Clears::WITH_THE_NEXT_FRAME},
      {"topology", [](ClothStream& s) { s.fewer = true; }, StepStatus::TOPOLOGY_CHANGED, Clears::WITH_THE_NEXT_FRAME},
      {"teleport", [](ClothStream& s) { s.away_m[0] = 5000; }, StepStatus::TELEPORT, Clears::WITH_THE_NEXT_FRAME},
      {"reset", [](ClothStream& s) { s.monitor.reset(StepStatus::RESET); }, StepStatus::FIRST_FRAME, Clears::AT_ONCE},
      {"reset of the frame", [](ClothStream& s) { s.monitor.reset(StepStatus::NO_TRANSFORM); }, StepStatus::FIRST_FRAME,
       Clears::AT_ONCE},
      {"another static body", [](ClothStream& s) { s.pushBox(); }, StepStatus::OK, Clears::AT_ONCE},
      {"a static body that is gone",
       [](ClothStream& s) {
         s.monitor.withdraw(2);
         expectFresh(s.history());
         s.pushBox();
       },
       StepStatus::OK, Clears::AT_ONCE},
      {"a step that fails", [](ClothStream& s) { s.radius_m = 0.01; }, StepStatus::INTERNAL_ERROR,
       Clears::WITH_THE_NEXT_FRAME},
      {"another body's teleport", [](ClothStream& s) { s.away_m[1] = 5000; }, StepStatus::TELEPORT,
       Clears::WITH_THE_NEXT_FRAME},
      {"a frame of the clock that is refused",
       [](ClothStream& s) {
         s.monitor.skip(0, StepStatus::BAD_MESSAGE, s.stamp_ns - 1, "", 0);
         Outcome refused;
         EXPECT_TRUE(s.monitor.next(0, refused));
       },
       StepStatus::PARTIAL, Clears::NEVER},
  };
  const Step scene = clothsInABox().motion();
  for (const Seam& seam : seams) {
    SCOPED_TRACE(seam.name);
    ClothStream stream(scene);
    for (int k = 0; k < 3; ++k) stream.feed();
    EXPECT_FALSE(stream.history().isClear());
    EXPECT_EQ(stream.monitor.predict().status, StepStatus::OK);
    seam.come(stream);
    if (seam.clears == Clears::AT_ONCE) expectFresh(stream.history());
    ClothStream fresh(scene, &stream);
    EXPECT_EQ(stream.feed().status, seam.status);
    fresh.feed();
    if (seam.clears == Clears::WITH_THE_NEXT_FRAME) expectFresh(stream.history());
    EXPECT_TRUE(seam.clears != Clears::NEVER || !stream.history().isClear());
    stream.radius_m = fresh.radius_m = 0;
    int answered = 0;
    for (int k = 0; k < 4; ++k) {
      const Outcome now = stream.feed(), then = fresh.feed();
      ASSERT_EQ(now.answered, then.answered) << k;
      if (!now.answered) continue;
      ++answered;
      expectSameAnswer(now, then);
      expectSameAnswer(stream.monitor.predict(), fresh.monitor.predict());
      expectSameAnswer(stream.monitor.checkNow(), fresh.monitor.checkNow());
    }
    EXPECT_GE(answered, 3);
  }
}

TEST(History, WhatContinuesIsCarriedOverAndNothingElse) {
  const TestStep first = clothsInABox(), next = nextOf(first);
  const Outcome expected = runOnce(next, {});
  Detector detector;
  detector.run(first.motion());
  const Outcome carried = detector.run(next.motion());
  EXPECT_EQ(carried.start_state, expected.start_state);
  EXPECT_EQ(carried.intersections.size(), expected.intersections.size());
  EXPECT_LT(carried.stats[Stage::START_STATE].in, expected.stats[Stage::START_STATE].in);
  // One coordinate by one representable number: no continuation.
  TestStep elsewhere = next;
  double& x = elsewhere.bodies[1].t0[7].x();
  x = std::nextafter(x, 10.0);
  Detector moved;
  moved.run(first.motion());
  expectSame(moved.run(elsewhere.motion()), runOnce(elsewhere, {}));
}

}  // namespace
}  // namespace test
}  // namespace dccd
