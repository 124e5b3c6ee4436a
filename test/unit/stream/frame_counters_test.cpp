// Every frame ends in exactly one count. What waits is defined as what is left, so sums that add up show nothing: a
// tally of its own is kept here, of what came in and of what came out.
#include <gtest/gtest.h>

#include <map>
#include <random>

#include "dccd/stream.h"

namespace dccd {
namespace {

constexpr StampNs MS = 1000000;
constexpr std::int64_t LATER = 1000000 * MS;
constexpr std::size_t CLOCK = 0, OTHER = 1, STATIC = 2;

std::shared_ptr<const Topology> triangle(int which) {
  static const std::shared_ptr<const Topology> topologies[] = {share(Topology::fromTriangles(4, {{0, 1, 2}})),
                                                               share(Topology::fromTriangles(4, {{1, 2, 3}}))};
  return topologies[which];
}

std::vector<Body> bodies() {
  std::vector<Body> three(3);
  three[CLOCK].name = "clock";
  three[OTHER].name = "other";
  three[STATIC].name = "static";
  three[STATIC].motion = BodyMotionKind::STATIC;
  return three;
}

MeshFrame frameAt(StampNs stamp_ns, int which = 0, std::size_t vertices = 4) {
  MeshFrame frame;
  frame.stamp_ns = stamp_ns;
  frame.topology = triangle(which);
  frame.positions.resize(vertices);
  for (std::size_t i = 0; i < vertices; ++i) frame.positions[i] = Vec3(i % 2, static_cast<double>(i) / 2, 0);
  return frame;
}

/// What came in and what came out, counted from outside.
struct Tally {
  Monitor monitor;
  std::map<StepStatus, std::uint64_t> ended;
  std::uint64_t received = 0, clock_waits = 0, withdrawn = 0;
  bool static_in_use = false;

  explicit Tally(const MonitorOptions& options) : monitor(options, bodies()) {}

  void push(std::size_t body, MeshFrame frame, std::int64_t now_ns) {
    ++received;
    monitor.countReceived(body);
    const StepStatus status = monitor.push(body, std::move(frame), now_ns);
    if (body == CLOCK) {
      ++clock_waits;
    } else if (body == STATIC && isSeam(status)) {
      ++ended[StepStatus::OK];
      static_in_use = true;
    } else {
      ++ended[status];
    }
  }
  void skip(std::size_t body, StepStatus status) {
    ++received;
    monitor.countReceived(body);
    monitor.skip(body, status, 0, "refused");
    if (body == CLOCK) {
      ++clock_waits;
    } else {
      ++ended[status];
    }
  }
  void drop(std::size_t body, StepStatus status, std::uint64_t count) {
    received += count;
    monitor.countReceived(body, count);
    monitor.countDropped(body, status, count);
    ended[status] += count;
  }
  /// It counts as one that waits until it is pushed again, which is no frame that came.
  void placeAnew(StampNs stamp_ns) {
    if (!static_in_use) return;
    monitor.withdraw(STATIC);
    --ended[StepStatus::OK];
    ++withdrawn;
    expectSame();
    const StepStatus status = monitor.push(STATIC, frameAt(stamp_ns), 0);
    ASSERT_TRUE(isSeam(status));
    ++ended[StepStatus::OK];
    --withdrawn;
  }
  void answers(std::int64_t now_ns) {
    Outcome outcome;
    while (monitor.next(now_ns, outcome)) {
      ASSERT_GT(clock_waits, 0u);
      --clock_waits;
      ++ended[outcome.status];
    }
  }
  void expectSame() const {
    const FrameCounters all = monitor.total();
    EXPECT_EQ(all.received, received);
    EXPECT_EQ(all.waiting(), clock_waits + withdrawn);
    std::uint64_t processed = 0, started = 0, skipped = 0;
    for (std::size_t s = 0; s < static_cast<std::size_t>(StepStatus::COUNT); ++s) {
      const auto status = static_cast<StepStatus>(s);
      const auto found = ended.find(status);
      const std::uint64_t expected = found == ended.end() ? 0 : found->second;
      EXPECT_EQ(all.of(status), expected) << toString(status);
      (isAnswered(status) ? processed : isSeam(status) ? started : skipped) += expected;
    }
    EXPECT_EQ(all.processed(), processed);
    EXPECT_EQ(all.started(), started);
    EXPECT_EQ(all.skipped(), skipped);
  }
};

TEST(FrameCounters, AreThoseOfATallyFromOutsideWhateverComes) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    std::mt19937 random(seed);
    const auto chance = [&](unsigned of) { return random() % of == 0; };
    MonitorOptions options;
    options.max_waiting = 1 + random() % 8;
    Tally tally(options);
    StampNs stamp_ns = 1000 * MS;
    std::int64_t now_ns = 0;
    for (int i = 0; i < 400 && !::testing::Test::HasFailure(); ++i) {
      now_ns += static_cast<std::int64_t>(random() % 60) * MS;
      stamp_ns += chance(40) ? 2000 * MS : chance(40) ? -5000 * MS : 20 * MS;
      const std::size_t body = chance(8) ? STATIC : random() % 2;
      if (chance(12)) {
        tally.skip(body, chance(2) ? StepStatus::BAD_MESSAGE : StepStatus::NO_TRANSFORM);
      } else if (chance(20)) {
        tally.drop(body, chance(2) ? StepStatus::QUEUE_FULL : StepStatus::DISABLED, 1 + random() % 5);
      } else {
        tally.push(body, frameAt(chance(15) ? stamp_ns - 20 * MS : stamp_ns, chance(20), chance(20) ? 3 : 4), now_ns);
      }
      if (chance(10)) tally.placeAnew(stamp_ns);
      if (!chance(3)) tally.answers(now_ns);
      if (chance(60)) {
        const StepStatus why = chance(2) ? StepStatus::RESET : StepStatus::DISABLED;
        // Frames that were seams or refused already end as what they are.
        const FrameCounters before = tally.monitor.total();
        tally.monitor.reset(why);
        const FrameCounters after = tally.monitor.total();
        std::uint64_t told = 0;
        for (std::size_t s = 0; s < after.by_status.size(); ++s) {
          const std::uint64_t more = after.by_status[s] - before.by_status[s];
          tally.ended[static_cast<StepStatus>(s)] += more;
          told += more;
        }
        EXPECT_EQ(told, tally.clock_waits) << "each that waited, once";
        tally.clock_waits = 0;
      }
      tally.expectSame();
    }
    tally.monitor.finish();
    tally.answers(LATER);
    tally.expectSame();
    EXPECT_EQ(tally.monitor.total().waiting(), 0u) << "seed " << seed;
  }
}

/// A body that sends nothing holds up no more steps than the options allow: the oldest gives way, as NO_BODY.
TEST(FrameCounters, NoMoreStepsWaitForOtherBodiesThanMay) {
  const MonitorOptions options;
  Tally tally(options);
  tally.push(STATIC, frameAt(0), 0);
  for (int i = 0; i < 300; ++i) {
    tally.push(CLOCK, frameAt((i + 1) * MS), 0);
    tally.answers(0);
    EXPECT_LE(tally.clock_waits, options.max_waiting);
    tally.expectSame();
  }
  EXPECT_EQ(options.max_waiting, 64u) << "as doc/interface.md says";
  EXPECT_EQ(tally.clock_waits, 64u);
  EXPECT_EQ(tally.ended[StepStatus::NO_BODY], 300u - 1 - 64);
}

}  // namespace
}  // namespace dccd
