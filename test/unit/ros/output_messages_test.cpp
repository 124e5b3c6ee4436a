// Messages out of outcomes: what a line for people says, and what is counted.
#include "output/output_messages.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <sstream>

#include "output/advice.h"
#include "output/patch_messages.h"

namespace dccd {
namespace {

/// A step that found nothing.
Outcome nothingFound(StepStatus status, StartState start, const std::string& reason = "") {
  Outcome outcome;
  outcome.answered = true;
  outcome.status = status;
  outcome.reason = reason;
  outcome.start_state = start;
  outcome.claim = Claim::thatWasSaid({});
  if (status != StepStatus::OK) outcome.claim.answer(Question::CONTENTS, reason);
  if (start == StartState::INTERSECTING) outcome.touching = Touching::LASTING;
  return outcome;
}

std::string summaryOf(const Outcome& outcome) { return toFirstContact(outcome, {}, "world").summary; }

TEST(Summary, NoContactIsSaidOfClearStepsAlone) {
  EXPECT_EQ(summaryOf(nothingFound(StepStatus::OK, StartState::CLEAR)), "no contact, starts CLEAR");
  EXPECT_EQ(summaryOf(nothingFound(StepStatus::NO_MAP, StartState::CLEAR, "none came; checked without it")),
            "no contact found, but NO_MAP (none came; checked without it), starts CLEAR");
  EXPECT_EQ(summaryOf(nothingFound(StepStatus::PARTIAL, StartState::NOT_CHECKED, "2 vertices were lost")),
            "no contact found, but PARTIAL (2 vertices were lost), starts NOT_CHECKED");
  EXPECT_EQ(summaryOf(nothingFound(StepStatus::OK, StartState::INTERSECTING)),
            "no contact found, but starts INTERSECTING");
  Outcome doubtful = nothingFound(StepStatus::OK, StartState::CLEAR);
  doubtful.claim = Claim::thatWasSaid({"1 vertex is not finite"});
  EXPECT_EQ(summaryOf(doubtful), "no contact found, but 1 vertex is not finite, starts CLEAR");
  Outcome unanswered;
  unanswered.status = StepStatus::GAP;
  EXPECT_EQ(summaryOf(unanswered), "no answer: GAP");
}

// Its cost stands in ~stats under the name that its decision has in ~effects.
TEST(Stats, EachStageAndEffectHasARowOfItsName) {
  Outcome outcome = nothingFound(StepStatus::OK, StartState::CLEAR);
  std::uint64_t value = 100;
  std::map<std::string, StageStats> given;
  const auto give = [&](const char* name, StageStats& one) {
    if (!given.count(name)) one = given[name] = {value, value + 1, static_cast<double>(value + 2)};
    value += 3;
  };
  for (std::size_t s = 0; s < outcome.stats.stages.size(); ++s) {
    give(toString(static_cast<Stage>(s)), outcome.stats.stages[s]);
  }
  for (std::size_t e = 0; e < outcome.stats.effects.size(); ++e) {
    give(toString(static_cast<Effect>(e)), outcome.stats.effects[e]);
  }
  const std::string definition = ros::message_traits::definition<deformable_ccd::StepStats>();
  const auto rows = toStepStats(outcome, {}, "world").stages;
  EXPECT_EQ(rows.size(), given.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    ASSERT_EQ(given.count(rows[i].name), 1u) << rows[i].name;
    const StageStats one = given[rows[i].name];
    given.erase(rows[i].name);
    EXPECT_EQ(rows[i].count_in, one.in) << rows[i].name;
    EXPECT_EQ(rows[i].count_out, one.out) << rows[i].name;
    EXPECT_EQ(rows[i].ms, one.ms) << rows[i].name;
    const std::string told = " " + std::to_string(i) + " " + rows[i].name;
    EXPECT_NE(definition.find(told), std::string::npos) << "the message's comment says the order:" << told;
  }
}

TEST(Stats, EachCounterOfAStepHasAFieldOfItsName) {
  Outcome outcome = nothingFound(StepStatus::OK, StartState::CLEAR);
  std::uint64_t value = 100;
  for (const StepCounter& counter : STEP_COUNTERS) outcome.stats.*counter.value = ++value;
  std::ostringstream text;
  text << toStepStats(outcome, {}, "world");
  for (const StepCounter& counter : STEP_COUNTERS) {
    const std::string line = counter.name + (": " + std::to_string(outcome.stats.*counter.value)) + '\n';
    EXPECT_NE(('\n' + text.str()).find('\n' + line), std::string::npos) << line;
  }
}

TEST(Stats, FramesAreCountedByWhatBecameOfThem) {
  const std::pair<StepStatus, const char*> fields[] = {{StepStatus::DUPLICATE, "skipped_duplicate"},
                                                       {StepStatus::VERTEX_COUNT, "skipped_vertex_count"},
                                                       {StepStatus::BAD_MESSAGE, "skipped_bad_message"},
                                                       {StepStatus::NO_TRANSFORM, "skipped_no_transform"},
                                                       {StepStatus::NO_BODY, "skipped_no_body"},
                                                       {StepStatus::QUEUE_FULL, "skipped_queue_full"},
                                                       {StepStatus::DISABLED, "skipped_disabled"},
                                                       {StepStatus::RESET, "skipped_reset"},
                                                       {StepStatus::INTERNAL_ERROR, "skipped_error"},
                                                       {StepStatus::TOPOLOGY_CHANGED, "seams_topology"},
                                                       {StepStatus::GAP, "seams_gap"},
                                                       {StepStatus::TIME_JUMP, "seams_time_jump"},
                                                       {StepStatus::TELEPORT, "seams_teleport"}};
  StatsContext context;
  std::uint64_t count = 0;
  for (const auto& field : fields) context.frames.by_status.at(static_cast<std::size_t>(field.first)) = ++count;
  std::ostringstream text;
  text << toStepStats(nothingFound(StepStatus::OK, StartState::CLEAR), context, "world");
  count = 0;
  for (const auto& field : fields) {
    const std::string line = '\n' + std::string(field.second) + ": " + std::to_string(++count) + '\n';
    EXPECT_NE(text.str().find(line), std::string::npos) << line;
  }
}

/// A step in which an expected contact is at toc 0 and, if asked for, an unexpected one at 0.5.
Outcome resting(bool alarm) {
  Outcome outcome = nothingFound(StepStatus::OK, StartState::CLEAR);
  auto step = std::make_shared<Step>();
  Body cloth, finger;
  cloth.name = "cloth";
  finger.name = "finger";
  const auto triangle = std::make_shared<const Topology>(Topology::fromTriangles(3, {{0, 1, 2}}));
  for (Body* body : {&cloth, &finger}) {
    body->topology = triangle;
    body->t0 = body->t1 = share(Positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
    step->bodies.push_back(*body);
  }
  outcome.step = step;
  outcome.stamp_ns = 1000000000;
  Contact contact;
  contact.toc_lower = contact.toc_upper = 0;
  contact.vertex = {0, 0, 1, 2};
  contact.body = {0, 1};
  contact.initial = contact.expected = true;
  outcome.contacts.push_back(contact);
  outcome.earliest_toc = 0;
  outcome.touching = Touching::EXPECTED;
  outcome.expected = {"cloth with finger in phase 'carry'"};
  outcome.counts.certain = outcome.counts.mesh = outcome.counts.initial = 1;
  outcome.counts.expected = outcome.counts.expected_initial = 1;
  if (alarm) {
    contact.toc_lower = contact.toc_upper = outcome.earliest_unexpected_toc = 0.5;
    contact.vertex = {1, 0, 1, 2};
    contact.initial = contact.expected = false;
    outcome.contacts.push_back(contact);
    ++outcome.counts.certain;
    ++outcome.counts.mesh;
    outcome.touching = Touching::NEW;
  }
  outcome.total_contacts = outcome.contacts.size();
  return outcome;
}

TEST(TimeToContact, IsNeverLate) {
  // Of two odd numbers of 27 bits the product has 53 or 54, and of those with 54 a double loses the last one, which is
  // a tie: it goes either way.
  Outcome alarm = resting(true);
  int inexact = 0;
  for (std::uint64_t a = 100000001; a < 134217728; a += 3355444) {
    for (std::uint64_t b = 100000003; b < 134217728; b += 3355442) {
      const std::uint64_t product = a * b;
      const double toc = std::ldexp(static_cast<double>(a), -27), horizon_s = std::ldexp(static_cast<double>(b), -26);
      alarm.contacts[1].toc_lower = alarm.contacts[1].toc_upper = alarm.earliest_unexpected_toc = toc;
      const double seconds = toTimeToContact(alarm, horizon_s, alarm.step->bodies, "world").seconds;
      const std::uint64_t said = static_cast<std::uint64_t>(std::ldexp(seconds, 53));
      EXPECT_LE(said, product);
      EXPECT_LE(product - said, 1u) << "nor much too early";
      inexact += said != product;
    }
  }
  EXPECT_GT(inexact, 10);
}

TEST(Plots, WhatIsNotThereIsNotInfinite) {
  Outcome nothing = resting(false);
  ASSERT_EQ(nothing.earliest_unexpected_toc, std::numeric_limits<double>::infinity());
  nothing.earliest_toc = std::numeric_limits<double>::infinity();
  const auto first = toFirstContact(nothing, nothing.step->bodies, "world");
  EXPECT_TRUE(std::isnan(first.toc) && std::isnan(first.seconds));
  EXPECT_TRUE(std::isnan(toTimeToContact(nothing, 2, nothing.step->bodies, "world").seconds));
  EXPECT_TRUE(std::isnan(toStepStats(nothing, {}, "world").earliest_toc));
  EXPECT_TRUE(std::isnan(toTimeToContact(Outcome(), 2, {}, "world").seconds)) << "no answer";
}

TEST(Expected, ContactsAreMarkedAndCountedAndNoAlarm) {
  const Outcome quiet = resting(false);
  const std::vector<Body>& bodies = quiet.step->bodies;
  const auto array = toContactArray(quiet, bodies, "world");
  ASSERT_EQ(array.contacts.size(), 1u) << "listed";
  EXPECT_TRUE(array.contacts[0].expected);
  EXPECT_EQ(array.expected_contacts, 1u);
  const auto none = toFirstContact(quiet, bodies, "world");
  EXPECT_FALSE(none.contact);
  EXPECT_EQ(none.expected_contacts, 1u);
  EXPECT_EQ(none.summary, "only what is expected touches: 1 expected contact");
  const auto later = toTimeToContact(quiet, 2, bodies, "world");
  EXPECT_FALSE(later.contact);
  EXPECT_EQ(later.expected_contacts, 1u);

  const Outcome alarm = resting(true);
  const auto first = toFirstContact(alarm, bodies, "world");
  EXPECT_TRUE(first.contact && first.certain);
  EXPECT_EQ(first.toc, 0.5);
  EXPECT_EQ(first.time_of_contact, ros::Time(0, 500000000));
  EXPECT_EQ(first.expected_contacts, 1u);
  EXPECT_EQ(first.summary,
            "contact 0.500000 s into the step: vertex 1 of cloth and face 0-1-2 of finger, besides 1 expected "
            "contact, starts CLEAR");
  EXPECT_EQ(toTimeToContact(alarm, 2, bodies, "world").seconds, 1);

  deformable_ccd::State state = toState(quiet, "world");
  fillState(statementOf(quiet, "", ""), state);
  EXPECT_TRUE(state.proved);
  EXPECT_FALSE(state.clear);
  EXPECT_EQ(state.touching, deformable_ccd::State::EXPECTED);
  EXPECT_EQ(state.expected, quiet.expected);
}

TEST(State, ADoubtStandsBesideTheProof) {
  const std::string doubt = "body 'rope': the mesh is 600 m across";
  const auto stateOf = [&](const Outcome& outcome) {
    deformable_ccd::State state;
    fillState(statementOf(outcome, "", "", {doubt}), state);
    return state;
  };
  const auto proved = stateOf(nothingFound(StepStatus::OK, StartState::CLEAR));
  EXPECT_TRUE(proved.proved && proved.clear);
  EXPECT_EQ(proved.reason, "proved, nothing touches; in doubt: " + doubt);
  const auto lost = stateOf(nothingFound(StepStatus::PARTIAL, StartState::CLEAR, "2 vertices were lost"));
  EXPECT_EQ(lost.reason, "not proved: 2 vertices were lost; in doubt: " + doubt);
  // What it may be the cause of is not to be cured otherwise.
  const auto cut = stateOf(nothingFound(StepStatus::TRUNCATED, StartState::CLEAR, "too many"));
  EXPECT_EQ(cut.reason, "not proved: " + doubt + "; too many");
  EXPECT_EQ(cut.missing.front(), doubt);
  Outcome listed = nothingFound(StepStatus::OK, StartState::CLEAR);
  listed.status = StepStatus::TRUNCATED;  // the list is cut, and all of it was looked at
  const Statement said = statementOf(listed, "", "", {doubt});
  EXPECT_TRUE(said.is_doubts_fault);
  EXPECT_EQ(said.hint, "");
  EXPECT_EQ(stateOf(listed).reason, proved.reason);
}

TEST(State, ReasonIsEnoughByItself) {
  Outcome outcome = nothingFound(StepStatus::OK, StartState::CLEAR);
  const auto step = std::make_shared<Step>();
  step->bodies.resize(1);
  step->bodies[0].name = "cloth";
  step->bodies[0].topology = share(Topology::grid(2, 2));
  step->bodies[0].t0 = step->bodies[0].t1 = share(Positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}});
  outcome.step = step;
  outcome.start_ns = 4900000000;
  outcome.stamp_ns = 5000000000;
  const auto reasonOf = [&](const std::string& broken) {
    deformable_ccd::State state = toState(outcome, "world");
    fillState(statementOf(outcome, "/octomap", broken), state);
    return state.reason;
  };
  EXPECT_EQ(reasonOf(""), "proved, nothing touches; nothing was checked against a map");
  Patch first, second;
  first.contacts = 2;
  first.began_to_ns = 2930000000;
  second.contacts = 5;
  second.began_to_ns = 4000000000;
  second.centroid = {0.3, 0.1, 0.75};
  outcome.patches = {first, second};
  outcome.touching = Touching::LASTING;
  EXPECT_EQ(reasonOf(""),
            "proved, what touches lasts: cloth and itself for 2.07 s, 2 patches, the largest at "
            "0.300 0.100 0.750; nothing was checked against a map");
  outcome.patches = {second};
  outcome.patches[0].beginning = PatchBeginning::INITIAL;
  outcome.status = StepStatus::NO_MAP;
  outcome.claim = Claim::thatWasSaid({"no octomap has been received yet; checked without it"});
  EXPECT_EQ(
      reasonOf("the map has new voxels"),
      "not proved: no octomap has been received yet; checked without it; what touches lasts: "
      "cloth and itself since the first look, 1 patch at 0.300 0.100 0.750; see rostopic hz /octomap, or do without "
      "with effects/octomap: off; the promise of ~safe_until was void: the map has new voxels");
}

// A file is on no topic, and what was refused did come.
TEST(Advice, AMapThatWasRefusedIsToBeCorrected) {
  EXPECT_EQ(adviceFor(StepStatus::NO_MAP, "the octomap was refused: box.stl: no header; checked without it", "box.stl"),
            "correct the map of box.stl, or do without with effects/octomap: off");
}

TEST(Advice, WhatWasGivenIsToBeCorrected) {
  const std::string lost = "publish NaN for points that were lost";
  EXPECT_EQ(adviceFor(StepStatus::VERTEX_COUNT, "12 points, but topology/rows x topology/cols is 3 x 5 = 15", ""),
            "correct topology/rows and topology/cols (rows:= and cols:= of the launch files), and " + lost);
  EXPECT_EQ(adviceFor(StepStatus::VERTEX_COUNT, "3 points, but the topology file has 4 vertices", ""),
            "give this mesh's own as topology/file, and " + lost);
  EXPECT_EQ(adviceFor(StepStatus::VERTEX_COUNT, "1 points, but a polyline needs 2", ""), lost);
}

TEST(Advice, WhoHasNoClockIsToldOfIt) {
  const std::string no_clock = "there is no stamp, and no /clock yet by which to tell the time of receipt";
  EXPECT_EQ(adviceFor(StepStatus::DUPLICATE, no_clock, ""), "publish /clock first (rosbag play --clock)");
  EXPECT_EQ(adviceFor(StepStatus::DUPLICATE, "the stamp is that of the last frame", ""),
            "the publisher must stamp every frame anew");
}

/// Bytes as they go over the wire.
template <class Message>
std::string wireOf(const Message& message) {
  const ros::SerializedMessage bytes = ros::serialization::serializeMessage(message);
  return {reinterpret_cast<const char*>(bytes.buf.get()), bytes.num_bytes};
}

TEST(Lists, AMessageThatWasOneBeforeSaysTheSameAsANewOne) {
  const Outcome alarm = resting(true), none = nothingFound(StepStatus::OK, StartState::CLEAR);
  Outcome crossing = alarm;
  crossing.intersections.resize(3);
  const std::vector<Body>& bodies = alarm.step->bodies;
  ASSERT_GT(alarm.contacts.size(), 0u);
  deformable_ccd::ContactArray kept;
  for (const Outcome* outcome : std::initializer_list<const Outcome*>{&crossing, &none, &alarm, &crossing}) {
    fillContactArray(*outcome, bodies, "world", kept);
    EXPECT_EQ(wireOf(kept), wireOf(toContactArray(*outcome, bodies, "world")));
  }
}

// A list is made with the geometry of many contacts at once, a first contact with that of one.
TEST(Lists, EachContactIsWhatItIsByItself) {
  const Outcome alarm = resting(true);
  const auto list = toContactArray(alarm, alarm.step->bodies, "world");
  ASSERT_EQ(list.contacts.size(), alarm.contacts.size());
  for (std::size_t i = 0; i < alarm.contacts.size(); ++i) {
    EXPECT_EQ(wireOf(list.contacts[i]), wireOf(toContact(alarm, alarm.contacts[i], list.contacts[i].patch))) << i;
  }
}

TEST(Summary, PatchesThatLastAreThoseThatAreNeitherNewNorExpected) {
  Outcome outcome = nothingFound(StepStatus::OK, StartState::CLEAR);
  outcome.tracked = true;
  outcome.touching = Touching::LASTING;
  outcome.patches.resize(4);
  for (std::size_t p = 0; p < 4; ++p) {
    outcome.patches[p].id = p < 2 ? 1 : p;  // two that came apart are one
    outcome.patches[p].contacts = 1;
  }
  outcome.patches[2].is_new = true;
  std::swap(outcome.patches[2].contacts, outcome.patches[2].crossings);
  outcome.patches[3].expected = 1;
  EXPECT_EQ(toFirstContact(outcome, std::vector<Body>(1), "world").lasting_patches, 1u);
}

TEST(Times, WhatRosCannotHoldIsTheNearestThatItCan) {
  EXPECT_EQ(toRosTime(1500000000), ros::Time(1, 500000000));
  EXPECT_EQ(toRosTime(-1), ros::Time(0, 0));
  const StampNs last_ns = 4294967295999999999;
  EXPECT_EQ(toRosTime(last_ns), ros::Time(4294967295, 999999999));
  EXPECT_EQ(toRosTime(last_ns + 1), ros::Time(4294967295, 999999999));
  EXPECT_EQ(toRosTime(std::numeric_limits<StampNs>::max()), ros::Time(4294967295, 999999999));
}

TEST(Stats, ContactsAreCountedBeforeTheCutToMaxContacts) {
  Outcome cut = nothingFound(StepStatus::TRUNCATED, StartState::CLEAR);
  cut.total_contacts = 7;
  cut.counts = {5, 2, 3, 1, 4, 3, 6, 2};
  cut.stats.unfolded_bodies = 2;
  cut.substeps = 13;
  const auto stats = toStepStats(cut, {}, "world");
  EXPECT_EQ(stats.unfolded_bodies, 2u);
  EXPECT_EQ(stats.substeps, 13u);
  EXPECT_EQ(stats.contacts, 7u);
  EXPECT_EQ(stats.contacts_certain, 5u);
  EXPECT_EQ(stats.contacts_undecided, 2u);
  EXPECT_EQ(stats.contacts_initial, 3u);
  EXPECT_EQ(stats.contacts_leaving, 1u);
  EXPECT_EQ(stats.contacts_mesh, 4u);
  EXPECT_EQ(stats.contacts_obstacle, 3u);
  EXPECT_EQ(stats.contacts_expected, 6u);
}

}  // namespace
}  // namespace dccd
