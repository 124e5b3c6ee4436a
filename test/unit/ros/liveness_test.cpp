// What ends a proof between steps, on a watch that the test winds.
#include "node/liveness.h"

#include <gtest/gtest.h>
#include <ros/time.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <random>
#include <thread>

#include "node/state_reporter.h"

namespace dccd {
namespace {

constexpr std::int64_t MS = 1000000;

std::vector<Fault::Kind> kinds(const Liveness& liveness, std::int64_t now_ns) {
  std::vector<Fault::Kind> found;
  for (const Fault& fault : liveness.faults(now_ns)) {
    EXPECT_FALSE(fault.sentence.empty());
    found.push_back(fault.kind);
  }
  return found;
}

using Kinds = std::vector<Fault::Kind>;

TEST(Liveness, TheOldestFrameWithoutAnAnswerCountsHoweverManyFollow) {
  Liveness liveness({0.1, 10, 0});
  std::int64_t now_ns = 0;
  for (int i = 1; i <= 20000; ++i) liveness.frame(i, now_ns += MS / 100);
  EXPECT_EQ(kinds(liveness, now_ns), Kinds{Fault::Kind::NO_ANSWER});
  liveness.outcome(19999, -1, now_ns);
  EXPECT_EQ(kinds(liveness, now_ns + 100 * MS), Kinds{}) << "the last of them came just now";
  EXPECT_EQ(kinds(liveness, now_ns + 101 * MS), Kinds{Fault::Kind::NO_ANSWER}) << "and was not lost among so many";
}

TEST(Liveness, Silence) {
  Liveness liveness({10, 0.5, 0});
  liveness.frame(1, 0);
  liveness.outcome(1, -1, MS);
  EXPECT_EQ(kinds(liveness, 500 * MS), Kinds{});
  EXPECT_EQ(kinds(liveness, 501 * MS), Kinds{Fault::Kind::SILENCE});
  liveness.frame(2, 502 * MS);
  EXPECT_EQ(kinds(liveness, 503 * MS), Kinds{});
  liveness.setLimits({10, 0.1, 0});
  EXPECT_EQ(kinds(liveness, 650 * MS), Kinds{Fault::Kind::SILENCE}) << "a limit that changes counts at once";
}

TEST(Liveness, HowOldTheNewestAnswerIs) {
  Liveness liveness({10, 10, 0});
  EXPECT_EQ(liveness.answerAge(5 * MS), std::numeric_limits<double>::infinity());
  liveness.frame(1, 0);
  liveness.frame(2, 40 * MS);
  liveness.outcome(1, -1, 60 * MS);
  EXPECT_DOUBLE_EQ(liveness.answerAge(100 * MS), 0.1) << "since it came, not since it was answered";
  liveness.outcome(2, -1, 110 * MS);
  EXPECT_DOUBLE_EQ(liveness.answerAge(140 * MS), 0.1);
  liveness.forget();
  EXPECT_EQ(liveness.answerAge(150 * MS), std::numeric_limits<double>::infinity());
}

TEST(Liveness, AFrameThatOvertookAResetIsOneThatCame) {
  Liveness liveness({10, 0.5, 0});
  liveness.frame(1, 0);
  liveness.forget();
  liveness.outcome(1, -1, 20 * MS);
  EXPECT_EQ(kinds(liveness, 520 * MS), Kinds{});
  EXPECT_EQ(kinds(liveness, 521 * MS), Kinds{Fault::Kind::SILENCE}) << "else nothing would ever end what it proved";
}

TEST(Liveness, AMapThatGrowsOldAndOneThatIsOnItsWay) {
  Liveness liveness({0.1, 10, 1.0});
  liveness.frame(1, 0);
  liveness.outcome(1, 0.7, 50 * MS);
  EXPECT_EQ(kinds(liveness, 300 * MS), Kinds{}) << "0.7 s old at the frame, which came 0.3 s ago";
  EXPECT_EQ(kinds(liveness, 301 * MS), Kinds{Fault::Kind::OLD_MAP});
  liveness.mapCame(2, 310 * MS);
  liveness.mapCame(3, 400 * MS);
  EXPECT_EQ(kinds(liveness, 411 * MS), (Kinds{Fault::Kind::NEWER_MAP, Fault::Kind::OLD_MAP}));
  liveness.mapSettled(2, 2);
  EXPECT_EQ(kinds(liveness, 411 * MS), (Kinds{Fault::Kind::NEWER_MAP, Fault::Kind::OLD_MAP})) << "in no answer yet";
  liveness.outcome(1, 1.1, 411 * MS);
  EXPECT_EQ(kinds(liveness, 412 * MS), Kinds{Fault::Kind::OLD_MAP}) << "the second has waited for 12 ms";
  liveness.mapSettled(3, 3);
  liveness.frame(4, 420 * MS);
  liveness.outcome(4, -1, 430 * MS);
  EXPECT_EQ(kinds(liveness, 5000 * MS), Kinds{}) << "without a map none is old";
}

TEST(Liveness, AFrameAnsweredWithoutTheMapThatCameBeforeItProvesNothing) {
  Liveness liveness({0.5, 10, 0});
  liveness.frame(1, 0);
  liveness.mapCame(2, 10 * MS);
  liveness.outcome(1, -1, 20 * MS);
  EXPECT_EQ(kinds(liveness, 20 * MS), Kinds{}) << "the frame came before the map";
  liveness.frame(3, 30 * MS);
  EXPECT_EQ(kinds(liveness, 30 * MS), Kinds{}) << "and waits for it";
  liveness.outcome(3, -1, 40 * MS);
  EXPECT_EQ(kinds(liveness, 40 * MS), Kinds{Fault::Kind::NEWER_MAP});
  liveness.mapSettled(1, 2);
  EXPECT_EQ(kinds(liveness, 50 * MS), Kinds{Fault::Kind::NEWER_MAP}) << "it has its place, the answer is the old one";
  liveness.mapSettled(2, 2);
  EXPECT_EQ(kinds(liveness, 60 * MS), Kinds{Fault::Kind::NEWER_MAP});
  liveness.frame(4, 70 * MS);
  liveness.outcome(4, 0, 80 * MS);
  EXPECT_EQ(kinds(liveness, 80 * MS), Kinds{}) << "answered with it";
}

TEST(Liveness, SomeMapsHaveTheTimeOfAnAnswer) {
  // One of a stream; and with own voxels one that counts from the first frame on that is not before its stamp.
  for (const bool streams : {true, false}) {
    Liveness liveness({0.1, 10, 0, streams});
    liveness.frame(1, 0);
    liveness.outcome(1, 0, 10 * MS);
    liveness.mapCame(2, 20 * MS);
    if (!streams) liveness.mapSettled(1, 2);
    liveness.frame(3, 30 * MS);
    liveness.outcome(3, 0, 40 * MS);
    EXPECT_EQ(kinds(liveness, 119 * MS), Kinds{});
    EXPECT_EQ(kinds(liveness, 121 * MS), Kinds{Fault::Kind::NEWER_MAP});
    liveness.mapSettled(2, 2);
    EXPECT_EQ(kinds(liveness, 122 * MS), Kinds{Fault::Kind::NEWER_MAP}) << "what was said was said without it";
    liveness.frame(4, 130 * MS);
    liveness.outcome(4, 0, 140 * MS);
    EXPECT_EQ(kinds(liveness, 141 * MS), Kinds{});
  }
}

TEST(Liveness, AStaticBodysNewerFrameVoidsWhatWasSaid) {
  Liveness liveness({0.1, 10, 0});
  liveness.frame(1, 0);
  liveness.outcome(1, -1, 10 * MS);
  EXPECT_EQ(kinds(liveness, 20 * MS), Kinds{});
  liveness.staticCame("table", 1, 20 * MS);
  EXPECT_EQ(kinds(liveness, 20 * MS), Kinds{Fault::Kind::NEWER_BODY}) << "at once";
  EXPECT_EQ(liveness.faults(20 * MS)[0].sentence, "a newer frame of body 'table' came, which no step has used yet");
  liveness.frame(2, 30 * MS);
  liveness.outcome(2, -1, 40 * MS);
  EXPECT_EQ(kinds(liveness, 40 * MS), Kinds{Fault::Kind::NEWER_BODY}) << "that step was made without it";
  liveness.staticInUse("table", 1);
  EXPECT_EQ(kinds(liveness, 40 * MS), Kinds{Fault::Kind::NEWER_BODY}) << "no step has used it";
  liveness.staticCame("table", 2, 45 * MS);
  liveness.outcome(3, -1, 50 * MS);
  EXPECT_EQ(kinds(liveness, 50 * MS), Kinds{Fault::Kind::NEWER_BODY}) << "the second came meanwhile";
  liveness.staticInUse("table", 2);
  liveness.staticCame("table", 2, 55 * MS);
  liveness.outcome(4, -1, 60 * MS);
  EXPECT_EQ(kinds(liveness, 60 * MS), Kinds{}) << "it came once";
}

// What is lost between its number and its place is never in use: the next one takes its place.
TEST(Liveness, AStaticBodysFrameThatIsLostProvesNothing) {
  Liveness liveness({0.01, 10, 0});
  liveness.staticInUse("table", 1);
  liveness.staticCame("table", 1, 0);
  liveness.staticCame("chair", 1, 0);
  liveness.staticInUse("chair", 1);
  liveness.frame(1, 0);
  liveness.outcome(1, -1, 10 * MS);
  EXPECT_EQ(kinds(liveness, 10 * MS), Kinds{});
  liveness.staticCame("table", 2, 20 * MS);
  for (int k = 2; k < 6; ++k) {
    liveness.staticInUse("table", 1);
    liveness.staticCame("chair", 2, 30 * MS);
    liveness.staticInUse("chair", 2);
    liveness.frame(k, 10 * (k + 2) * MS);
    liveness.outcome(k, -1, 10 * (k + 2) * MS);
    EXPECT_EQ(kinds(liveness, 10 * (k + 2) * MS), Kinds{Fault::Kind::NEWER_BODY}) << "what others send is not it";
  }
  liveness.staticCame("table", 3, 80 * MS);
  liveness.staticInUse("table", 3);
  liveness.outcome(6, -1, 90 * MS);
  EXPECT_EQ(kinds(liveness, 90 * MS), Kinds{});
}

// A depth camera's surfaces come as often as the cloth's frames; each is in the next answer.
TEST(Liveness, AStreamOfStaticFramesHasItsTime) {
  Liveness liveness({0.1, 0.5, 0});
  liveness.staticCame("surface", 1, 0);
  for (int k = 1; k <= 20; ++k) {
    liveness.staticInUse("surface", static_cast<std::uint64_t>(k));
    liveness.frame(k, 30 * k * MS);
    liveness.outcome(k, -1, (30 * k + 5) * MS);
    EXPECT_EQ(kinds(liveness, (30 * k + 5) * MS), Kinds{});
    liveness.staticCame("surface", static_cast<std::uint64_t>(k + 1), (30 * k + 10) * MS);
    EXPECT_EQ(kinds(liveness, (30 * k + 29) * MS), Kinds{}) << k;
  }
  EXPECT_EQ(kinds(liveness, 720 * MS), Kinds{Fault::Kind::NEWER_BODY}) << "0.1 s after the last one came";
}

/// /clock goes by `simulated`, a step of it each 5 ms of true time; how far the watch went [s].
double watchedOver(int steps, double step_s, bool no_faster = false) {
  ros::Time::init();
  ros::Time::setNow(ros::Time(10000));
  WatchClock watch(no_faster);
  const std::int64_t begin_ns = watch.now();
  for (int k = 1; k <= steps; ++k) {
    ros::Time::setNow(ros::Time(10000 + k * step_s));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    for (int look = 0; look < 3; ++look) watch.now();  // more often than the clock ticks
  }
  const std::int64_t end_ns = watch.now();
  ros::Time::useSystemTime();
  return 1e-9 * static_cast<double>(end_ns - begin_ns);
}

TEST(WatchClockTest, TimeThatRunsBackwardsPasses) {
  EXPECT_NEAR(watchedOver(20, 1), 20, 1e-6) << "forwards, at the clock's rate";
  EXPECT_NEAR(watchedOver(20, 0), 0, 1e-6) << "it stands";
  const double slowly_s = watchedOver(20, -0.001);
  EXPECT_NEAR(slowly_s, 0.02, 1e-6) << "no more than the clock went back";
  const double backwards_s = watchedOver(20, -1);
  EXPECT_GE(backwards_s, 0.1) << "true time has passed";
  EXPECT_LT(backwards_s, 20) << "a jump back is no long silence";
}

// A simulation at a third of true time is waited for by its clock; what is played ten times as fast by true time.
TEST(WatchClockTest, WhatWaitsGoesByTheSlowerClock) {
  EXPECT_NEAR(watchedOver(20, 0.001, true), 0.02, 1e-6);
  const double fast_s = watchedOver(20, 1, true);
  EXPECT_GE(fast_s, 0.1) << "true time has passed";
  EXPECT_LT(fast_s, 5);
}

// /use_sim_time, and nobody who sends /clock: there is nothing else to go by.
TEST(WatchClockTest, BeforeTheFirstClockTrueTimePasses) {
  ros::Time::init();
  ros::Time::setNow(ros::Time());
  WatchClock watch;
  const std::int64_t begin_ns = watch.now();
  std::this_thread::sleep_for(std::chrono::milliseconds(30));
  const std::int64_t passed_ns = watch.now() - begin_ns;
  EXPECT_GE(passed_ns, 30 * MS);
  EXPECT_LT(passed_ns, 20000 * MS);
  ros::Time::setNow(ros::Time(10000));
  EXPECT_EQ(watch.now() - begin_ns, passed_ns) << "from there to the first one nothing does";
  ros::Time::setNow(ros::Time(10001));
  EXPECT_EQ(watch.now() - begin_ns, passed_ns + 1000 * MS);
  ros::Time::useSystemTime();
}

TEST(Liveness, WhatIsAskedForHoldsUntilItIsDone) {
  Liveness liveness({0.1, 0.1, 0});
  liveness.frame(1, 0);
  liveness.ask("a reset was asked for");
  liveness.outcome(1, -1, MS);
  EXPECT_EQ(kinds(liveness, MS), Kinds{Fault::Kind::ASKED}) << "an answer does not undo it";
  liveness.forget();
  EXPECT_EQ(kinds(liveness, 1000 * MS), Kinds{});
  liveness.disable(true);
  liveness.forget();
  EXPECT_EQ(kinds(liveness, 0), Kinds{Fault::Kind::DISABLED}) << "a reset does not enable";
  liveness.disable(false);
  liveness.stop();
  liveness.forget();
  EXPECT_EQ(kinds(liveness, 0), Kinds{Fault::Kind::STOPPED}) << "for good";
}

/// Random frames, answers and times against a list of all frames.
TEST(Liveness, AnyCourseOfFramesAgainstAListOfThem) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 200; ++trial) {
    const double timeout_s = 0.001 * static_cast<double>(1 + random() % 300),
                 step_s = 0.001 * static_cast<double>(1 + random() % 300);
    Liveness liveness({timeout_s, step_s, 0});
    struct Came {
      std::int64_t at;
      bool answered;
    };
    std::vector<Came> all;
    std::int64_t now_ns = 0;
    for (int event = 0; event < 300; ++event) {
      now_ns += static_cast<std::int64_t>(random() % 60) * MS;
      if (random() % 2) {
        all.push_back({now_ns, false});
        liveness.frame(static_cast<std::int64_t>(all.size()), now_ns);
      } else if (!all.empty()) {
        const std::size_t last = random() % all.size();
        for (std::size_t i = 0; i <= last; ++i) all[i].answered = true;
        liveness.outcome(static_cast<std::int64_t>(last) + 1, -1, now_ns);
      }
      bool late = false;
      for (const Came& frame : all)
        late |= !frame.answered && static_cast<double>(now_ns - frame.at) * 1e-9 > timeout_s;
      const bool silent = !all.empty() && static_cast<double>(now_ns - all.back().at) * 1e-9 > step_s;
      const Kinds found = kinds(liveness, now_ns);
      EXPECT_EQ(std::count(found.begin(), found.end(), Fault::Kind::NO_ANSWER), late);
      EXPECT_EQ(std::count(found.begin(), found.end(), Fault::Kind::SILENCE), silent);
    }
  }
}

}  // namespace
}  // namespace dccd
