#include "report/report.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

namespace dccd {
namespace {

Outcome nothingFound(StepStatus status, StartState start) {
  Outcome outcome;
  outcome.answered = true;
  outcome.status = status;
  outcome.start_state = start;
  outcome.claim = Claim::thatWasSaid({});
  if (status != StepStatus::OK) outcome.claim.answer(Question::CONTENTS, toString(status));
  if (start == StartState::INTERSECTING) outcome.touching = Touching::LASTING;
  return outcome;
}

std::string headlineOf(const std::vector<Outcome>& outcomes, const std::vector<Body>& bodies = {}) {
  const std::string folder = ::testing::TempDir() + "headline_report";
  Report report(folder);
  for (const Outcome& outcome : outcomes) report.add(outcome, bodies);
  const std::string headline = report.headline();
  std::filesystem::remove_all(folder);
  return headline;
}

TEST(Headline, OnlyClearStepsSayNoContact) {
  const Outcome clear = nothingFound(StepStatus::OK, StartState::CLEAR);
  const Outcome no_map = nothingFound(StepStatus::NO_MAP, StartState::CLEAR);
  const Outcome crossing = nothingFound(StepStatus::OK, StartState::INTERSECTING);
  Outcome lost;
  lost.status = StepStatus::NO_TRANSFORM;
  lost.reason = "no transform from 'camera' to 'world'";
  EXPECT_EQ(headlineOf({}), "No answer; not proved: no frame came.");
  EXPECT_EQ(headlineOf({Outcome{}}), "No answer; not proved: a first frame alone makes no step.");
  EXPECT_EQ(headlineOf({lost, lost}),
            "No answer; not proved: 2 of 2 frames: NO_TRANSFORM: no transform from 'camera' to 'world' (2).");
  EXPECT_EQ(headlineOf({clear, clear}), "No contact in 2 answered steps; all of it proved.");
  EXPECT_EQ(headlineOf({no_map, no_map, nothingFound(StepStatus::PARTIAL, StartState::CLEAR)}),
            "No contact found in 3 answered steps; not proved: 3 of 3 frames: NO_MAP (2), PARTIAL (1).");
  EXPECT_EQ(
      headlineOf({clear, no_map, crossing}),
      "No contact found in 3 answered steps; surfaces touched from the start of a step (1 step: start INTERSECTING); "
      "not proved: 1 of 3 frames: NO_MAP (1).");
  EXPECT_EQ(
      headlineOf({clear, crossing}),
      "No contact found in 2 answered steps; surfaces touched from the start of a step (1 step: start INTERSECTING); "
      "all of it proved.");
  EXPECT_EQ(headlineOf({Outcome{}, clear}), "No contact in 1 answered step; all of it proved.")
      << "of a first frame nothing is asked";
  EXPECT_EQ(headlineOf({Outcome{}, clear, lost, clear}),
            "No contact found in 2 answered steps; not proved: 1 of 4 frames: NO_TRANSFORM: no transform from 'camera' "
            "to 'world' (1).");
  Outcome doubtful = clear;
  doubtful.claim = Claim::thatWasSaid({"1 vertex is not finite", "and more"});
  EXPECT_EQ(headlineOf({doubtful}),
            "No contact found in 1 answered step; not proved: 1 of 1 frame: 1 vertex is not finite (1).");
}

TEST(Headline, ADoubtStandsBesideTheProof) {
  const std::string folder = ::testing::TempDir() + "report_in_doubt";
  Report report(folder);
  report.add(nothingFound(StepStatus::OK, StartState::CLEAR), {});
  report.setDoubts({"body 'rope': the mesh is 600 m across; are these millimetres?"});
  EXPECT_EQ(report.headline(),
            "No contact in 1 answered step; all of it proved; in doubt: body 'rope': the mesh is 600 m across; are "
            "these millimetres?.");
  report.finish();
  const auto proof = nlohmann::json::parse(std::ifstream(folder + "/report.json"))["proof"];
  std::filesystem::remove_all(folder);
  EXPECT_EQ(proof["doubts"], nlohmann::json::array({"body 'rope': the mesh is 600 m across; are these millimetres?"}));
}

// No contact tells of it, and an STL in millimetres is the common cause.
TEST(Headline, WhatLiesInsideOfWhatIsNamed) {
  const auto step = std::make_shared<Step>();
  step->bodies.resize(2);
  step->bodies[0].name = "rope";
  step->bodies[1].name = "box";
  step->bodies[1].rigid = true;
  step->bodies[1].t0 = share(Positions{{0, 0, 0}, {400, 1, 1}});
  Outcome inside = nothingFound(StepStatus::OK, StartState::INTERSECTING);
  inside.step = step;
  inside.intersections.resize(2);
  inside.intersections[0].body = {0, 1};
  inside.intersections[0].vertex[0] = 3;
  inside.intersections[1] = inside.intersections[0];
  inside.intersections[1].vertex[0] = 4;
  EXPECT_EQ(headlineOf({inside}),
            "No contact found in 1 answered step; surfaces touched from the start of a step (1 step: rope lies inside "
            "of box, which is 400 m across: rigid/scale: 0.001 if its file is in millimetres, shell: true if it is a "
            "container); all of it proved.");
}

TEST(Headline, WhatWasNotLookedAtStandsBesideWhatWasFound) {
  const std::string folder = ::testing::TempDir() + "report_without_map";
  Report report(folder);
  Outcome no_map = nothingFound(StepStatus::NO_MAP, StartState::CLEAR);
  no_map.step = std::make_shared<Step>();
  report.add(no_map, {});
  report.setNotLookedAt({"nothing was checked against a map: the bag has none"});
  EXPECT_EQ(report.headline(false),
            "No contact found in 1 answered step; not proved: 1 of 1 frame; nothing was checked against a map: the bag "
            "has none.");
  report.finish();
  const auto proof = nlohmann::json::parse(std::ifstream(folder + "/report.json"))["proof"];
  std::filesystem::remove_all(folder);
  EXPECT_EQ(proof, nlohmann::json({{"steps", 1},
                                   {"proved", 0},
                                   {"unproved", "1 of 1 frame: NO_MAP (1)"},
                                   {"doubts", nlohmann::json::array()},
                                   {"not_looked_at", {"nothing was checked against a map: the bag has none"}}}));
}

TEST(Headline, ExpectedContactsAreToldApart) {
  Outcome quiet = nothingFound(StepStatus::OK, StartState::CLEAR);
  quiet.total_contacts = quiet.counts.certain = quiet.counts.expected = 3;
  quiet.touching = Touching::EXPECTED;
  EXPECT_EQ(headlineOf({quiet, nothingFound(StepStatus::OK, StartState::CLEAR)}),
            "No unexpected contact in 2 answered steps; expected contacts in 1 of them; all of it proved.");
}

std::shared_ptr<Step> stepOfACloth() {
  auto step = std::make_shared<Step>();
  step->bodies.resize(1);
  step->bodies[0].name = "cloth";
  step->bodies[0].topology = share(Topology::grid(2, 2));
  step->bodies[0].t0 = step->bodies[0].t1 = share(Positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}});
  return step;
}

// The terminal said 0.0000 s (initial), the page 0.240 s.
TEST(Headline, TheFirstContactIsANewOneAsOnThePage) {
  const auto step = stepOfACloth();
  Outcome resting = nothingFound(StepStatus::OK, StartState::CLEAR);
  resting.step = step;
  resting.start_ns = 1000000000;
  resting.stamp_ns = 1100000000;
  resting.contacts.resize(1);
  resting.contacts[0].vertex = {0, 1, 2, 3};
  resting.contacts[0].initial = true;
  resting.total_contacts = resting.counts.certain = resting.counts.initial = 1;
  resting.touching = Touching::LASTING;
  const std::string none = headlineOf({resting}, step->bodies);
  EXPECT_EQ(none.rfind("No new contact; since before it was looked at cloth meets cloth (", 0), 0u) << none;
  Outcome touching = resting;
  touching.start_ns = 1100000000;
  touching.stamp_ns = 1200000000;
  touching.contacts.push_back(touching.contacts[0]);
  touching.contacts[1].initial = false;
  touching.contacts[1].vertex = {1, 0, 2, 3};
  touching.contacts[1].toc_lower = touching.contacts[1].toc_upper = 0.5;
  touching.touching = Touching::NEW;
  const std::string headline = headlineOf({resting, touching}, step->bodies);
  EXPECT_EQ(headline.rfind("First contact 0.1500 s after the start: cloth meets cloth (", 0), 0u) << headline;
  EXPECT_NE(headline.find("vertices 1 0 2 3, certain)"), std::string::npos) << headline;
}

TEST(Headline, ContactsAreCountedInStepsWithAnUnexpectedOne) {
  const auto step = stepOfACloth();
  Outcome touching = nothingFound(StepStatus::OK, StartState::CLEAR);
  touching.step = step;
  touching.contacts.resize(1);
  touching.contacts[0].vertex = {0, 1, 2, 3};
  touching.total_contacts = touching.counts.certain = 1;
  touching.touching = Touching::NEW;
  Outcome expected = touching;
  expected.contacts[0].expected = true;
  expected.counts.expected = 1;
  expected.touching = Touching::EXPECTED;
  const std::string folder = ::testing::TempDir() + "report_of_contacts";
  Report report(folder);
  for (const Outcome& outcome : {touching, expected, touching}) report.add(outcome, step->bodies);
  const std::string headline = report.headline();
  std::filesystem::remove_all(folder);
  EXPECT_NE(headline.find("; contacts in 2 of 3 answered steps; expected contacts in 1 of them"), std::string::npos)
      << headline;
}

/// The cells of the first row with the names of their columns: "step=3 patch=7 …", none of them twice.
std::string firstRowOf(const std::string& csv) {
  std::ifstream file(csv);
  std::string names, cells, row;
  std::getline(file, names);
  std::getline(file, cells);
  std::istringstream name_words(names), cell_words(cells);
  std::set<std::string> seen;
  for (std::string name, cell; std::getline(name_words, name, ','); cell.clear()) {
    std::getline(cell_words, cell, ',');
    EXPECT_TRUE(seen.insert(name).second) << name << " is there twice";
    row += name + "=" + cell + " ";
  }
  return row;
}

TEST(ReportTables, APatchHasAColumnForEachOfItsFields) {
  const std::string folder = ::testing::TempDir() + "report_of_patches";
  Outcome outcome;
  outcome.sequence = 3;
  outcome.stamp_ns = 40;
  Patch patch;
  patch.id = 7;
  patch.body = {0, OBSTACLE_BODY};
  patch.contacts = 6, patch.certain = 5, patch.initial = 4, patch.crossings = 2, patch.expected = 1;
  patch.toc_lower = 0.25, patch.toc_upper = 0.5, patch.area_m2 = 0.125;
  patch.centroid = Vec3(1, 2, 3), patch.normal = Vec3(0, 0, -1), patch.box = {Vec3(4, 5, 6), Vec3(7, 8, 9)};
  patch.beginning = PatchBeginning::MAP_CHANGED, patch.began_to_ns = 20, patch.is_new = true;
  outcome.patches = {patch};
  std::vector<Body> bodies(1);
  bodies[0].name = "cloth";
  Report report(folder);
  report.add(outcome, bodies);
  report.finish();
  EXPECT_EQ(firstRowOf(folder + "/patches.csv"),
            "step=3 stamp_ns=40 body_0=cloth body_1=octomap contacts=6 certain=5 initial=4 crossings=2 expected=1 "
            "toc_lower=0.25 toc_upper=0.5 area_m2=0.125 centroid_x=1 centroid_y=2 centroid_z=3 normal_x=0 normal_y=0 "
            "normal_z=-1 box_min_x=4 box_min_y=5 box_min_z=6 box_max_x=7 box_max_y=8 box_max_z=9 patch=7 "
            "beginning=MAP_CHANGED began_from_ns= began_to_ns=20 is_new=1 ");
  std::ifstream contacts(folder + "/contacts.csv");
  std::string names;
  std::getline(contacts, names);
  EXPECT_EQ(names,
            "step,stamp_ns,kind,toc_lower,toc_upper,v0,v1,v2,v3,body_0,body_1,voxel_x,voxel_y,voxel_z,voxel_size,"
            "certainty,initial,leaving,expected,time_s,point_x,point_y,point_z,normal_x,normal_y,normal_z,"
            "approach_speed_m_per_s");
  std::filesystem::remove_all(folder);
}

ClearanceDistance distance(ClearanceStatus status, double lower_m, double upper_m) {
  ClearanceDistance out;
  out.status = status;
  out.lower_m = lower_m;
  out.upper_m = upper_m;
  return out;
}

TEST(ClearanceTable, HasARowOfEachPairInWhichWhatIsNotThereIsEmpty) {
  const std::string file = ::testing::TempDir() + "clearance.csv";
  std::filesystem::remove(file);
  std::vector<Body> bodies(1);
  bodies[0].name = "cloth, red";
  Outcome outcome;
  outcome.answered = true;
  outcome.sequence = 3;
  outcome.stamp_ns = 40;
  ClearanceTable table(file);
  table.add(outcome, bodies, 0);
  table.close();
  EXPECT_FALSE(std::filesystem::exists(file)) << "where nobody asked for distances";
  Clearance c;
  c.body = {0, OBSTACLE_BODY};
  c.at_end = distance(ClearanceStatus::FARTHER, 0.5, std::numeric_limits<double>::infinity());
  c.over_step = distance(ClearanceStatus::MEASURED, 0.25, 0.2501);
  c.over_step.t = 0.125;
  c.over_step.point = {Vec3(1, 2, 3), Vec3(4, 5, 6)};
  c.over_step.vertex[0] = {7, 8, NO_INDEX};
  c.over_step.voxel = {9, 10, 11};
  c.over_step.voxel_size = 2;
  outcome.clearances = {c};
  table.add(outcome, bodies, 0);
  table.close();
  bodies[0].name = "cloth";  // a name with a comma is quoted, which the reader below does not know
  std::ifstream quoted(file);
  EXPECT_NE(std::string(std::istreambuf_iterator<char>(quoted), {}).find(",\"cloth, red\",octomap,"),
            std::string::npos);
  ClearanceTable plain(file);
  plain.add(outcome, bodies, 0);
  plain.close();
  const std::string row = " " + firstRowOf(file);
  std::filesystem::remove(file);
  std::istringstream wanted(
      "step=3 stamp_ns=40 body_0=cloth body_1=octomap expected=0 end_status=FARTHER end_lower_m=0.5 end_upper_m= "
      "end_t= end_x0= end_v0_0= end_voxel_size= step_status=MEASURED step_lower_m=0.25 step_t=0.125 step_y0=2 "
      "step_z1=6 step_v0_1=8 step_v0_2= step_v1_0= step_voxel_y=10 step_voxel_size=2");
  for (std::string cell; wanted >> cell;) {
    EXPECT_NE(row.find(" " + cell + " "), std::string::npos) << cell << " in" << row;
  }
}

TEST(ClearanceTable, WhatHasNoRowIsDrawnAsFarAsTheOneThatStandsForIt) {
  const std::string file = ::testing::TempDir() + "many_clearance.csv";
  ClearanceTable table(file);
  const std::vector<Body> bodies(3);
  Outcome outcome;
  outcome.answered = true;
  Clearance near, far;
  near.body = {0, 1};
  near.over_step = distance(ClearanceStatus::MEASURED, 0.25, 0.2501);
  far.body = {0, 2};
  far.over_step = distance(ClearanceStatus::FARTHER, 0.5, std::numeric_limits<double>::infinity());
  outcome.clearances = {near, far};
  table.add(outcome, bodies, 0);
  outcome.clearances = {far};
  outcome.stats[Effect::CLEARANCE].in = 2;
  outcome.stamp_ns = 1'000'000'000;
  table.add(outcome, bodies, 0);
  table.close();
  std::filesystem::remove(file);
  const nlohmann::json near_samples = table.json()["curves"][0]["samples"];
  ASSERT_EQ(near_samples.size(), 2u);
  EXPECT_EQ(near_samples[1], (nlohmann::json{1.0, 0.5, nullptr}));
  EXPECT_EQ(table.json()["curves"][1]["samples"].size(), 2u) << "one sample a step";
}

// The bounds of neighbours that became one hold for all of them.
TEST(ClearanceTable, ALongRunIsDrawnByTheSmallestDistances) {
  ClearanceTable table(::testing::TempDir() + "long_clearance.csv");
  std::vector<Body> bodies(2);
  bodies[1].name = "palm";
  const std::size_t steps = 3 * ClearanceTable::MOST_SAMPLES;
  for (std::size_t i = 0; i < steps; ++i) {
    Outcome outcome;
    outcome.answered = i != 1000;
    outcome.stamp_ns = static_cast<StampNs>(i) * 1'000'000'000;
    Clearance near, far;
    near.body = {0, 1};
    near.over_step =
        distance(ClearanceStatus::MEASURED, 100.0 + static_cast<double>(i), 101.0 + static_cast<double>(i));
    if (i == 2000) near.over_step = distance(ClearanceStatus::FARTHER, 1, std::numeric_limits<double>::infinity());
    far.body = {0, OBSTACLE_BODY};
    far.expected = true;
    far.over_step = distance(ClearanceStatus::UNKNOWN, 0, std::numeric_limits<double>::infinity());
    if (outcome.answered) outcome.clearances = {far, near};
    table.add(outcome, bodies, 0);
  }
  table.close();
  std::filesystem::remove(::testing::TempDir() + "long_clearance.csv");
  const nlohmann::json json = table.json();
  ASSERT_EQ(json["curves"].size(), 2u);
  EXPECT_EQ(json["curves"][0]["names"][1], "palm") << "what comes nearest is first";
  EXPECT_EQ(json["curves"][1]["expected"], true);
  EXPECT_TRUE(json["curves"][1]["samples"][0][1].is_null()) << "unknown";
  const nlohmann::json& samples = json["curves"][0]["samples"];
  ASSERT_EQ(samples.size(), 3 * ClearanceTable::MOST_SAMPLES / 4) << "four steps are one";
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double first = 4.0 * static_cast<double>(i);
    EXPECT_DOUBLE_EQ(samples[i][0].get<double>(), first);
    if (i == 250) {
      EXPECT_TRUE(samples[i][1].is_null()) << "one of the four had no answer";
    } else {
      EXPECT_EQ(samples[i][1], i == 500 ? 1 : 100 + first);
    }
    EXPECT_EQ(samples[i][2], i == 500 || i == 250 ? 102 + first : 101 + first) << "finite, if one of the four is";
  }
}

TEST(ReportJson, HoldsEachCounterOfTheSteps) {
  const std::string folder = ::testing::TempDir() + "report_of_counters";
  Outcome outcome = nothingFound(StepStatus::OK, StartState::CLEAR);
  outcome.step = std::make_shared<Step>();
  std::uint64_t value = 100;
  for (const StepCounter& counter : STEP_COUNTERS) outcome.stats.*counter.value = ++value;
  Report report(folder);
  report.add(outcome, {});
  report.add(outcome, {});
  report.finish();
  const auto data = nlohmann::json::parse(std::ifstream(folder + "/report.json"));
  std::filesystem::remove_all(folder);
  EXPECT_EQ(data["step_counters"].size(), std::size(STEP_COUNTERS));
  for (const StepCounter& counter : STEP_COUNTERS) {
    const std::uint64_t once = outcome.stats.*counter.value;
    EXPECT_EQ(data["step_counters"].value(counter.name, std::uint64_t{0}), counter.same_in_every_part ? once : 2 * once)
        << counter.name;
  }
}

TEST(ReportJson, NoNameIsTakenForThePlaceOfTheSteps) {
  const std::string folder = ::testing::TempDir() + "report_of_odd_names";
  Outcome first = nothingFound(StepStatus::OK, StartState::CLEAR), second = first;
  first.sequence = 1;
  second.sequence = 2;
  auto step = std::make_shared<Step>();
  step->bodies.resize(1);
  step->bodies[0].topology = share(Topology::grid(2, 2));
  step->bodies[0].t0 = step->bodies[0].t1 = share(Positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}});
  first.step = second.step = step;
  for (const char* const name : {"@rows@", "@steps@", "\"steps\": [", "steps", "{", "[]"}) {
    SCOPED_TRACE(name);
    std::vector<Body> bodies(1);
    bodies[0].name = name;
    Report report(folder);
    report.setFacts({{"bag", name}, {name, name}});
    report.setEffects({{name, EffectSetting::AUTO, true, name}});
    report.add(first, bodies);
    report.add(second, bodies);
    report.finish();
    const auto data = nlohmann::json::parse(std::ifstream(folder + "/report.json"), nullptr, false);
    std::filesystem::remove_all(folder);
    ASSERT_FALSE(data.is_discarded());
    ASSERT_EQ(data["steps"].size(), 2u);
    EXPECT_EQ(data["steps"][1]["step"], 2);
    EXPECT_EQ(data["facts"][1], nlohmann::json::array({name, name}));
    EXPECT_EQ(data["bodies"][0]["name"], name);
  }
}

}  // namespace
}  // namespace dccd
