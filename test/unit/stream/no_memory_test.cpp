// An allocation that fails, wherever it is in a step, a prediction or a check, leaves nothing half done: the monitor
// answers the next step as one to which nothing has happened.
#include <gtest/gtest.h>

#include <array>
#include <map>
#include <memory>
#include <optional>

#include "dccd/tolerances.h"
#include "unit/failing_allocations.h"
#include "unit/stream/patch_stream.h"

namespace dccd {
namespace test {
namespace {

constexpr int BEFORE = 4, AFTER = 5;  // frames; of the first two something is made that all later steps use

/// Two cloths on a table, of which one end is lifted for two frames and lies for two: patches begin, come apart, merge
/// and end.
Positions cloth(int frame, bool upper) {
  return strip(6, 8, 0.02, [&](std::size_t column) {
    const double wave = column < 3 || (column > 4 && frame / 2 % 2 == 0) ? -0.001 : 0.01;
    return upper ? 0.012 + 2 * wave : 0.5 * wave;
  });
}

MonitorOptions options() {
  MonitorOptions options;
  options.detector.patches = true;
  options.look_ahead_s = 0.05;
  options.patch_gap_s = 0;
  return options;
}

class Cloths {
 public:
  Cloths() : topology_(grid(6, 8)) {
    std::vector<Body> bodies(2);
    bodies[0].name = "lower";
    bodies[1].name = "upper";
    monitor_ = std::make_unique<Monitor>(options(), bodies);
    monitor_->setMap({table(0.05), 1, Eigen::Isometry3d::Identity(), {}});
  }
  Monitor& monitor() { return *monitor_; }
  Outcome feed(int frame) {
    push(frame);
    return next();
  }
  void push(int frame) {
    for (const std::size_t body : {1, 0}) {
      MeshFrame made;
      made.stamp_ns = PERIOD_NS * (frame + 1);
      made.topology = topology_;
      made.positions = cloth(frame, body == 1);
      monitor_->push(body, std::move(made), 0);
    }
  }
  Outcome next() {
    Outcome outcome;
    EXPECT_TRUE(monitor_->next(0, outcome));
    return outcome;
  }

 private:
  std::shared_ptr<const Topology> topology_;
  std::unique_ptr<Monitor> monitor_;
};

/// What is said of contacts, patches and the start; not which patches are those of before.
void expectSame(const Outcome& a, const Outcome& b) {
  EXPECT_EQ(difference(a.contacts, b.contacts), "");
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(a.start_state, b.start_state);
  EXPECT_EQ(a.intersections.size(), b.intersections.size());
  EXPECT_EQ(a.patch_of, b.patch_of);
  EXPECT_EQ(a.patches.size(), b.patches.size());
}

/// Of each patch at most one beginning and one end, in this order.
void expectInOrder(const Outcome& outcome, std::map<std::uint64_t, PatchEventKind>& last) {
  for (const PatchEvent& event : outcome.patch_events) {
    const auto known = last.find(event.id);
    if (event.kind == PatchEventKind::BEGAN) {
      EXPECT_EQ(known, last.end()) << event.id;
    }
    if (known != last.end()) {
      EXPECT_NE(known->second, PatchEventKind::ENDED) << event.id;
    }
    last[event.id] = event.kind;
  }
}

TEST(NoMemory, AStepThatFailsAnywhereLeavesNothingHalfDone) {
  std::vector<Outcome> expected;
  Cloths whole;
  for (int k = 0; k <= BEFORE + AFTER; ++k) expected.push_back(whole.feed(k));
  ASSERT_GT(expected[BEFORE].patches.size(), 1u);
  ASSERT_FALSE(expected[BEFORE].patch_events.empty());
  int failed = 0;
  const auto failAt = [&](int before, int n, bool lasts) {
    Cloths cloths;
    std::map<std::uint64_t, PatchEventKind> last;
    for (int k = 0; k < before; ++k) expectInOrder(cloths.feed(k), last);
    cloths.push(before);
    std::optional<Outcome> outcome;
    const bool met = failsAt(n, lasts, [&] {
      Outcome told;
      cloths.monitor().next(0, told);
      outcome = std::move(told);
    });
    if (!outcome) outcome = cloths.next();  // not even what has failed could be told: it is done again
    failed += outcome->status == StepStatus::INTERNAL_ERROR;
    expectInOrder(*outcome, last);
    for (int k = before + 1; k <= before + AFTER; ++k) {
      const Outcome later = cloths.feed(k);
      expectSame(later, expected[static_cast<std::size_t>(k)]);
      expectInOrder(later, last);
      for (const Patch& patch : later.patches) EXPECT_NE(patch.id, 0u);
    }
    return met;
  };
  for (const int before : {1, 2, BEFORE}) {
    for (const bool lasts : {false, true}) {
      EXPECT_GT(failingEverywhere([&](int n) { return failAt(before, n, lasts); }), before == 1 ? 150 : 30) << before;
    }
  }
  EXPECT_GT(failed, 400) << "else the failures were not in the step";
}

TEST(NoMemory, QuestionsThatFailAnywhereLeaveNothingHalfDone) {
  Cloths whole;
  for (int k = 0; k < BEFORE; ++k) whole.feed(k);
  const Outcome check = whole.monitor().checkNow(), prediction = whole.monitor().predict(), next = whole.feed(BEFORE);
  const int allocations_of_a_question = failingEverywhere([&](int n) {
    bool met = false;
    for (const int kind : {0, 1, 2, 3}) {
      const bool predicts = kind % 2 == 0, lasts = kind / 2 == 0;
      Cloths cloths;
      for (int k = 0; k < BEFORE; ++k) cloths.feed(k);
      met |= failsAt(n, lasts, [&] { predicts ? cloths.monitor().predict() : cloths.monitor().checkNow(); });
      expectSame(cloths.monitor().checkNow(), check);
      expectSame(cloths.monitor().predict(), prediction);
      expectSame(cloths.feed(BEFORE), next);
    }
    return met;
  });
  EXPECT_GT(allocations_of_a_question, 50);
}

MeshFrame clothFrame(StampNs stamp_ns, const std::shared_ptr<const Topology>& topology) {
  MeshFrame frame;
  frame.stamp_ns = stamp_ns;
  frame.topology = topology;
  frame.positions = cloth(0, false);
  return frame;
}

TEST(NoMemory, AFrameThatIsNotKeptTakesNoRoomInTheStore) {
  const auto topology = grid(6, 8);
  MeshStoreOptions options;
  options.max_vertices = 2 * tolerance::FRAMES_ALWAYS_KEPT * topology->vertexCount();
  for (const StampNs next_ns : {81 * PERIOD_NS, StampNs{1}}) {  // goes on, or jumps back
    MeshStore store(options);
    for (int k = 1; k <= 80; ++k) store.push(clothFrame(k * PERIOD_NS, topology));
    for (int time = 0; time < 100; ++time) {
      MeshFrame frame = clothFrame(next_ns, topology);
      const AllocationFailure failure(0, false);
      EXPECT_THROW(store.push(std::move(frame)), std::bad_alloc);
    }
    EXPECT_EQ(store.push(clothFrame(81 * PERIOD_NS, topology)), StepStatus::OK);
    EXPECT_EQ(store.size(), 81u);
  }
}

TEST(NoMemory, ABodyForWhichThereIsNoRoomIsNotHalfThere) {
  Cloths whole;
  whole.feed(0);
  const Outcome expected = whole.feed(1);
  const int allocations = failingEverywhere([&](int n) {
    Cloths cloths;
    Body third;
    third.name = "third";
    const bool met = failsAt(n, false, [&] { cloths.monitor().setBody(2, third); });
    EXPECT_EQ(cloths.monitor().bodies().size(), met ? 2u : 3u);
    cloths.monitor().reset();
    if (!met) return met;
    cloths.feed(0);
    expectSame(cloths.feed(1), expected);
    return met;
  });
  EXPECT_GT(allocations, 5);
}

/// Of the clock body a start, steps of which the first ones find no room to wait, a gap, and a jump back.
TEST(NoMemory, EveryFrameThatIsPushedEndsInACount) {
  const auto topology = grid(6, 8);
  int thrown_in_all = 0;
  const auto failAt = [&](int n, bool lasts) {
    std::vector<Body> bodies(3);
    bodies[2].motion = BodyMotionKind::STATIC;
    for (std::size_t b = 0; b < bodies.size(); ++b) bodies[b].name = std::to_string(b);
    MonitorOptions options;
    options.max_waiting = 2;
    Monitor monitor(options, bodies);
    bool met = false;
    std::array<std::uint64_t, 3> thrown{};
    for (const StampNs stamp_ns : {1, 2, 3, 4, 5, 500, 501, 2}) {
      for (std::size_t body = 0; body < bodies.size(); ++body) {
        MeshFrame frame = clothFrame(stamp_ns * PERIOD_NS, topology);
        monitor.countReceived(body);
        const AllocationFailure failure(n, lasts);
        try {
          monitor.push(body, std::move(frame), 0);
        } catch (const std::bad_alloc&) {
          ++thrown[body];
        }
        met = met || failure.met();
      }
    }
    monitor.finish();
    for (Outcome outcome; monitor.next(0, outcome);) {
    }
    for (std::size_t body = 0; body < bodies.size(); ++body) {
      const FrameCounters& c = monitor.counters(body);
      EXPECT_EQ(c.received, c.processed() + c.started() + c.skipped()) << "body " << body;
      EXPECT_EQ(c.of(StepStatus::INTERNAL_ERROR), thrown[body]) << "body " << body;
      thrown_in_all += static_cast<int>(thrown[body]);
    }
    return met;
  };
  for (const bool lasts : {false, true}) {
    EXPECT_GT(failingEverywhere([&](int n) { return failAt(n, lasts); }), 3);
  }
  EXPECT_GT(thrown_in_all, 50);
}

}  // namespace
}  // namespace test
}  // namespace dccd
