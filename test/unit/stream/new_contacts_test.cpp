// Which contacts of a stream are an alarm: those with which a patch begins that nobody expected, once.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <utility>

#include "dccd/assurance.h"
#include "dccd/monitor_extras.h"
#include "unit/stream/monitor_support.h"
#include "unit/stream/patch_stream.h"

namespace dccd {
namespace test {
namespace {

/// These vertices of the first body, or all of them, may lie on the table.
MonitorOptions expectedOnTheTable(const std::vector<Index>& vertices = {}) {
  MonitorOptions options;
  options.detector.expected = {{{ExpectedPartner{0, vertices, ""}, ExpectedPartner{OBSTACLE_BODY, {}, ""}}, ""}};
  return options;
}

/// Vertices of a cloth of 5 rows and 21 columns.
std::vector<Index> columns(Index from, Index to) {
  std::vector<Index> vertices;
  for (Index v = 0; v < 5 * 21; ++v) {
    if (from <= v % 21 && v % 21 < to) vertices.push_back(v);
  }
  return vertices;
}

TEST(NewContacts, APatchIsNewsOnceAndThenLasts) {
  ClothOnTable stream(5, 21);
  std::vector<Touching> said;
  for (int k = 0; k < 8; ++k) {
    // One column more touches in every frame: growth.
    const Outcome outcome = stream.lift([&](std::size_t c) { return k == 0 || static_cast<int>(c) > k ? 0.01 : 0.0; });
    said.push_back(assuranceOf(outcome).touching);
    const std::vector<NewContact> found = newContacts(outcome);
    ASSERT_EQ(found.size(), k == 1 ? 1u : 0u) << k;
    EXPECT_EQ(std::isfinite(earliestNewToc(outcome)), k == 1) << k;
    if (k > 0) EXPECT_LT(outcome.counts.initial, outcome.total_contacts) << k << ": of itself each step has news";
    if (k != 1) continue;
    EXPECT_EQ(found[0].body, (std::array<std::uint16_t, 2>{0, OBSTACLE_BODY}));
    EXPECT_EQ(found[0].patch, 1u);
    EXPECT_EQ(found[0].contact.toc_lower, earliestNewToc(outcome));
  }
  EXPECT_EQ(said[1], Touching::NEW);
  for (int k = 2; k < 8; ++k) EXPECT_EQ(said[static_cast<std::size_t>(k)], Touching::LASTING) << k;
}

// One rule: NEW is an alarm. What comes back within patch_gap_s is the same patch, and lasts, though the step starts
// CLEAR and its contact is not initial.
TEST(NewContacts, WhatComesBackWithinTheGapLastsThoughItsStepStartsClear) {
  ClothOnTable stream(5, 5);
  std::vector<Touching> said;
  const auto to = [&](double z) {
    const Outcome outcome = stream.at(z);
    said.push_back(assuranceOf(outcome).touching);
    EXPECT_EQ(said.back() == Touching::NEW, !newContacts(outcome).empty());
    return outcome;
  };
  for (const double z : {0.01, 0.0, 0.01, 0.01}) to(z);
  const Outcome back = to(0);
  EXPECT_EQ(back.start_state, StartState::CLEAR);
  EXPECT_EQ(back.counts.initial, 0u);
  EXPECT_GT(back.counts.certain, 0u);
  EXPECT_EQ(back.touching, Touching::NEW) << "as if no patches were tracked";
  for (int k = 0; k < 12; ++k) to(0.01);
  to(0);
  std::vector<Touching> expected{Touching::NONE, Touching::NEW,     Touching::LASTING,
                                 Touching::NONE, Touching::LASTING, Touching::LASTING};
  expected.resize(17, Touching::NONE);
  expected.push_back(Touching::NEW);
  EXPECT_EQ(said, expected);
}

TEST(NewContacts, OfAPatchThatIsNewByEdgesThatCrossAnExpectedContactIsNone) {
  Outcome outcome;
  outcome.tracked = true;
  outcome.patches.resize(1);
  Patch& patch = outcome.patches[0];
  patch.is_new = true;
  patch.contacts = patch.crossings = patch.expected = 1;
  EXPECT_EQ(newContacts(outcome).size(), 1u);
  patch.earliest.expected = true;
  EXPECT_TRUE(newContacts(outcome).empty());
}

TEST(NewContacts, TheEarliestOfEachPairOfPartners) {
  Stream stream({grid(5, 5), grid(5, 5)});
  stream.setMap(table(0.05));
  const auto sheets = [](double lower, double upper) {
    Positions second = strip(5, 5, 0.02, [&](std::size_t) { return upper; });
    for (Vec3& p : second) p.x() += 0.0037;
    return std::vector<Positions>{strip(5, 5, 0.02, [&](std::size_t) { return lower; }), second};
  };
  stream.feed(sheets(0.01, 0.02));
  // The lower sheet passes the table's top at 1/2 and is met by the upper one at 1/4.
  const Outcome outcome = stream.feed(sheets(-0.01, -0.04));
  const std::vector<NewContact> found = newContacts(outcome);
  ASSERT_EQ(found.size(), 3u) << "with the map each, and with each other";
  EXPECT_EQ(found[0].body, (std::array<std::uint16_t, 2>{0, 1}));
  EXPECT_NEAR(found[0].contact.toc_lower, 0.25, 1e-6);
  for (std::size_t i = 1; i < 3; ++i) EXPECT_LE(found[i - 1].contact.toc_lower, found[i].contact.toc_lower);
  EXPECT_EQ(earliestNewToc(outcome), found[0].contact.toc_lower);
}

TEST(NewContacts, WhatIsExpectedIsNoneUntilItGrowsBeyondThat) {
  ClothOnTable stream(5, 21, expectedOnTheTable(columns(0, 6)));
  std::vector<std::size_t> news;
  Outcome outcome;
  for (int k = 0; k < 12; ++k) {
    outcome = stream.lift([&](std::size_t c) { return k == 0 || static_cast<int>(c) > k ? 0.01 : 0.0; });
    news.push_back(newContacts(outcome).size());
    if (k >= 1 && k < 5) EXPECT_EQ(assuranceOf(outcome).touching, Touching::EXPECTED) << k;
    if (k > 7) EXPECT_EQ(assuranceOf(outcome).touching, Touching::LASTING) << k;
  }
  EXPECT_EQ(std::count(news.begin(), news.end(), 0u), 11) << "one alarm";
  EXPECT_EQ(stream.text(), "BEGAN 1, UNEXPECTED 1");
  EXPECT_TRUE(stream.events()[0].expected);
  EXPECT_NE(stream.events()[1].from_ns, UNKNOWN_NS);
  ASSERT_EQ(outcome.patches.size(), 1u);
  EXPECT_GT(outcome.patches[0].expected, 0u);
  EXPECT_FALSE(outcome.patches[0].isExpected());
}

TEST(NewContacts, WhatIsNotExpectedIsRememberedWhereExpectedThingsTouchAsWell) {
  // Each end of the rope may touch the sheet, but no expectation holds its edge.
  MonitorOptions options;
  for (Index v = 0; v < 2; ++v) {
    Expectation end;
    end.partners[0].vertices = {v};
    end.partners[1].body = 1;
    options.detector.expected.push_back(end);
  }
  Stream stream({share(Topology::polyline(2)), grid(2, 2)}, options);  // across the edge between two triangles
  const Positions sheet = strip(2, 2, 0.1, [](std::size_t) { return 0.0; });
  std::vector<std::size_t> news;
  for (int k = 0; k < 9; ++k) {
    const double z = k % 3 == 2 ? -0.001 : 0.01;  // down every third frame, well within the gap
    news.push_back(newContacts(stream.feed({{Vec3(0.02, 0.05, z), Vec3(0.09, 0.06, z)}, sheet})).size());
  }
  EXPECT_EQ(news, (std::vector<std::size_t>{0, 0, 1, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(stream.text(), "BEGAN 1");
}

TEST(NewContacts, WhatIsNoLongerExpectedButLastsIsOneOnce) {
  ClothOnTable stream(5, 5, expectedOnTheTable());
  stream.at(0.01);
  for (int k = 0; k < 3; ++k) EXPECT_TRUE(newContacts(stream.at(0)).empty());
  stream.expect({});  // the next phase of the task
  const Outcome outcome = stream.at(0);
  EXPECT_EQ(newContacts(outcome).size(), 1u);
  EXPECT_EQ(earliestNewToc(outcome), 0) << "it touched when the step began";
  EXPECT_EQ(assuranceOf(outcome).touching, Touching::NEW);
  EXPECT_EQ(stream.text(), "BEGAN 1, UNEXPECTED 1");
  const Outcome after = stream.at(0);
  EXPECT_TRUE(newContacts(after).empty());
  EXPECT_EQ(assuranceOf(after).touching, Touching::LASTING);
  for (int k = 0; k < 12; ++k) stream.at(0.01);
  EXPECT_EQ(newContacts(stream.at(0)).size(), 1u) << "it comes back";
}

/// Two triangles that cross as long as the second one's tip is below the first one, and what is expected of them.
struct PhasesOfCrossing : ::testing::Test {
  static Positions sheet() { return {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}}; }
  static Positions tipAt(double z) { return {{0, 0, z}, {0.5, 0, z + 1}, {-0.5, 0, z + 1}}; }
  static MonitorOptions carrying() {
    MonitorOptions options = expecting(true);
    options.patch_gap_s = 0.25;
    return options;
  }
  static MonitorOptions expecting(bool they_meet) {
    MonitorOptions options;
    options.store.max_vertex_step_m = 0;
    if (!they_meet) return options;
    Expectation meeting;
    meeting.partners[1].body = 1;
    options.detector.expected = {meeting};
    return options;
  }
  Stream stream{{oneTriangle(), oneTriangle()}, carrying()};

  void expectMeeting(bool they_meet) { stream.expect(expecting(they_meet).detector.expected); }
  /// The step that ends with the tip at this height; whether it is an alarm.
  bool isAlarm(double z) {
    const Outcome outcome = stream.feed({sheet(), tipAt(z)});
    const bool alarm = assuranceOf(outcome).touching == Touching::NEW;
    EXPECT_EQ(std::isfinite(earliestNewToc(outcome)), alarm) << stream.text();
    return alarm;
  }
  std::size_t unexpected() const {
    return static_cast<std::size_t>(
        std::count_if(stream.events().begin(), stream.events().end(),
                      [](const PatchEvent& event) { return event.kind == PatchEventKind::UNEXPECTED; }));
  }
};

TEST_F(PhasesOfCrossing, ACrossingWithoutAContactIsAnAlarmOnceItIsNoLongerExpected) {
  isAlarm(0.2);
  EXPECT_FALSE(isAlarm(-0.2));
  EXPECT_FALSE(isAlarm(-0.2));
  expectMeeting(false);
  const Outcome outcome = stream.feed({sheet(), tipAt(-0.2)});
  ASSERT_EQ(outcome.total_contacts, 0u) << "edges cross a face, and nothing moves";
  ASSERT_FALSE(outcome.intersections.empty());
  EXPECT_EQ(assuranceOf(outcome).touching, Touching::NEW);
  EXPECT_EQ(earliestNewToc(outcome), 0);
  EXPECT_TRUE(newContacts(outcome).empty()) << "no contact can be told";
  ASSERT_EQ(unexpected(), 1u) << stream.text();
  EXPECT_EQ(stream.events().back().from_ns, outcome.start_ns);
  EXPECT_FALSE(isAlarm(-0.2)) << "one alarm";
  EXPECT_FALSE(isAlarm(0.2)) << "it leaves";
  EXPECT_FALSE(isAlarm(-0.2)) << "within the gap it is the same";
  EXPECT_EQ(unexpected(), 1u);
}

/// What a stream does, word by word: the tip is "above" the sheet, "below" it, "higher" or "deeper"; "!" behind a place
/// is an alarm in the step that ends there. "on" and "off" expect them to meet or not, "seam" and "gap" begin anew.
TEST_F(PhasesOfCrossing, AnAlarmFollowsThePhaseThatEnds) {
  const struct {
    const char *story, *events;
  } CASES[] = {
      {"above below off below!", "BEGAN 1, UNEXPECTED 1"},
      {"above below off deeper!", "BEGAN 1, UNEXPECTED 1"},
      {"above below off above!", "BEGAN 1, UNEXPECTED 1"},
      {"above below above off higher below!", "BEGAN 1, UNEXPECTED 1"},  // it returns within the gap
      {"above below off on below", "BEGAN 1"},                           // a phase between two steps is none
      {"above below off below! on below off deeper! on below off below! on below",
       "BEGAN 1, UNEXPECTED 1, UNEXPECTED 1, UNEXPECTED 1"},
      // Within the gap something touched without an expectation that no phase has looked at.
      {"off above below! on below off below!", "BEGAN 1, UNEXPECTED 1"},
      {"below below off below! below", "BEGAN 1 INITIAL, UNEXPECTED 1"},
      {"above below seam below off below! below seam below below", nullptr},
      {"above below off seam below below! below seam below below", nullptr},
      {"above below gap off below below!", nullptr},
      {"above below seam below below", nullptr},  // a seam alone is no alarm
  };
  const std::map<std::string, double> PLACES = {{"above", 0.2}, {"below", -0.2}, {"higher", 0.3}, {"deeper", -0.3}};
  for (const auto& [story, events] : CASES) {
    SCOPED_TRACE(story);
    Stream fresh{{oneTriangle(), oneTriangle()}, carrying()};
    std::swap(stream, fresh);
    std::istringstream words(story);
    for (std::string word; words >> word;) {
      const bool alarm = word.back() == '!';
      if (alarm) word.pop_back();
      if (word == "on" || word == "off") {
        expectMeeting(word == "on");
      } else if (word == "seam") {
        stream.monitor().reset();
      } else if (word == "gap") {
        stream.wait(1000000000);
      } else {
        EXPECT_EQ(isAlarm(PLACES.at(word)), alarm) << word << ": " << stream.text();
      }
    }
    if (events) EXPECT_EQ(stream.text(), events);
  }
}

TEST_F(PhasesOfCrossing, WithoutPatchesEveryStepIsAnAlarm) {
  isAlarm(0.2);
  isAlarm(-0.2);
  stream.options().detector.patches = false;
  expectMeeting(false);
  for (int k = 0; k < 2; ++k) {
    const Outcome outcome = stream.feed({sheet(), tipAt(-0.2)});
    EXPECT_EQ(earliestNewToc(outcome), 0) << "a crossing, which is no contact";
  }
  expectMeeting(true);
  EXPECT_TRUE(std::isinf(earliestNewToc(stream.feed({sheet(), tipAt(-0.2)}))));
}

TEST(NewContacts, WhatSplitsOrMergesAtTheSwitchIsTold) {
  const MonitorOptions options = expectedOnTheTable(columns(0, 8));
  ClothOnTable stream(5, 21, options);
  const auto down = [&](const std::vector<std::pair<std::size_t, std::size_t>>& columns) {
    return stream.lift([&](std::size_t c) {
      const auto holds = [&](const auto& range) { return range.first <= c && c <= range.second; };
      return std::any_of(columns.begin(), columns.end(), holds) ? 0.0 : 0.01;
    });
  };
  down({});
  EXPECT_TRUE(newContacts(down({{0, 5}})).empty());
  EXPECT_EQ(newContacts(down({{0, 5}, {12, 20}})).size(), 1u) << "that side is not expected";
  stream.expect({});
  EXPECT_EQ(newContacts(down({{0, 20}})).size(), 1u) << "both are one now: " << stream.text();
  EXPECT_NE(stream.text().find("MERGED 1+2"), std::string::npos) << stream.text();
  EXPECT_NE(stream.text().find("UNEXPECTED 1"), std::string::npos) << stream.text();

  ClothOnTable other(5, 21, options);
  std::swap(stream, other);
  stream.options().patch_gap_s = 0;
  stream.options().detector.expected[0].partners[0].vertices.clear();
  stream.monitor().setOptions(stream.options());
  down({});
  EXPECT_TRUE(newContacts(down({{0, 20}})).empty());
  for (int k = 0; k < 2; ++k) EXPECT_TRUE(newContacts(down({{0, 5}, {12, 20}})).empty());
  stream.expect({});
  const Outcome outcome = down({{0, 5}, {12, 20}});
  EXPECT_NE(stream.text().find("SPLIT"), std::string::npos) << stream.text();
  EXPECT_EQ(std::count_if(outcome.patches.begin(), outcome.patches.end(), [](const Patch& p) { return p.is_new; }), 2);
}

TEST(NewContacts, WhatABurstLeavesAtTheSwitchIsTold) {
  MonitorOptions options = expectedOnTheTable();
  options.detector.max_contacts = 1;
  Stream stream({grid(300, 300)}, options);  // more vertices than are remembered in any case
  stream.setMap(table(0.05));
  const auto resting = [&](std::size_t columns) {
    return stream.feed({strip(300, 300, 0.001, [&](std::size_t c) { return c < columns ? 0.0 : 0.01; })});
  };
  resting(0);
  resting(300);
  EXPECT_TRUE(newContacts(resting(4)).empty());
  stream.expect({});
  EXPECT_EQ(newContacts(resting(4)).size(), 1u) << stream.text();
}

TEST(NewContacts, OfAPredictionWhatDoesNotLastYet) {
  MonitorOptions options;
  options.look_ahead_s = 0.2;
  Stream stream({grid(5, 5), share(Topology::fromTriangles(3, {{0, 1, 2}}))}, options);
  stream.setMap(table(0.05));
  std::size_t seen = 0;
  for (int k = 0; k < 22; ++k) {
    Positions falling = {Vec3(0.02, 0.02, 0.1), Vec3(0.05, 0.02, 0.2), Vec3(0.02, 0.05, 0.2)};
    for (Vec3& p : falling) p.z() -= 0.004 * k;
    const Positions cloth = strip(5, 5, 0.02, [&](std::size_t) { return k == 0 ? 0.01 : 0.0; });
    stream.feed({cloth, falling});
    if (k < 3) continue;
    const Outcome prediction = stream.monitor().predict();
    EXPECT_GT(prediction.total_contacts, 0u) << "the cloth rests";
    for (const NewContact& one : newContacts(prediction)) {
      EXPECT_NE(one.body, (std::array<std::uint16_t, 2>{0, OBSTACLE_BODY})) << k << ": the cloth rests on the table";
      EXPECT_EQ(one.patch, 0u);
      ++seen;
    }
  }
  EXPECT_GT(seen, 0u);
}

TEST(NewContacts, WithoutPatchesAllThatIsNotExpected) {
  ClothOnTable stream(5, 5);
  stream.options().detector.patches = false;
  stream.monitor().setOptions(stream.options());
  stream.at(0);
  const Outcome outcome = stream.at(0);
  EXPECT_EQ(newContacts(outcome).size(), 1u);
  EXPECT_EQ(earliestNewToc(outcome), 0);
}

}  // namespace
}  // namespace test
}  // namespace dccd
