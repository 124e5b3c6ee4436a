// What two runs of a recording are held against each other by: first times of vertices, patches one to one.
#include "report/accuracy_study.h"

#include <gtest/gtest.h>

#include <cmath>

namespace dccd {
namespace {

constexpr StampNs MS = 1000000;

RunRecord run(std::vector<PatchLife> patches = {}) {
  RunRecord record;
  record.bodies.resize(1);
  record.bodies[0].vertices = {0, 1, 2, 3};
  record.bodies[0].edge_m = 0.1;
  record.patches = std::move(patches);
  record.end_ns = 1000 * MS;
  record.steps = 10;
  record.ms = 2;
  record.duration_s = 1;
  return record;
}

/// Of the body with itself, from then to then, in steps of 100 ms, at x.
PatchLife patch(double from_ms, double to_ms, double x_m) {
  PatchLife life;
  const auto ns = [](double ms) { return static_cast<StampNs>(ms * MS); };
  life.began = {ns(from_ms), ns(from_ms)};
  for (StampNs at = ns(from_ms) / (100 * MS) * (100 * MS); at < ns(to_ms); at += 100 * MS) {
    life.seen.push_back({{at, at + 100 * MS}, {Vec3(x_m, 0, 0), Vec3(x_m, 0, 0)}});
  }
  return life;
}

TEST(FirstContacts, AnErrorIsThatOfTheEndThatIsFurtherOff) {
  RunRecord truth = run(), found = run();
  truth.bodies[0].first = {{0, {100 * MS, 100 * MS}}, {1, {200 * MS, 200 * MS}}, {2, {300 * MS, 300 * MS}}};
  found.bodies[0].first = {{0, {99 * MS, 103 * MS}}, {1, {195 * MS, 201 * MS}}, {3, {10 * MS, 10 * MS}}};
  const FirstErrors errors = errorsOf(found, truth).vertices;
  EXPECT_EQ(errors.touched, 3u);
  EXPECT_EQ(errors.missed, 1u) << "vertex 2";
  EXPECT_EQ(errors.invented, 1u) << "vertex 3";
  EXPECT_DOUBLE_EQ(errors.late_ms, 3);
  EXPECT_DOUBLE_EQ(errors.early_ms, -5);
  EXPECT_DOUBLE_EQ(errors.p95_ms, 5);
}

TEST(FirstContacts, OnlyWhatBothHaveIsCompared) {
  RunRecord truth = run(), found = run();
  truth.bodies[0].first = {{0, {100 * MS, 100 * MS}}, {1, {200 * MS, 200 * MS}}, {2, {950 * MS, 950 * MS}}};
  found.bodies[0].vertices = {0, 2, 3};
  found.bodies[0].first = {{0, {110 * MS, 110 * MS}}};
  found.end_ns = 900 * MS;
  const FirstErrors errors = errorsOf(found, truth).vertices;
  EXPECT_EQ(errors.touched, 1u) << "vertex 1 is not in both, vertex 2 touches when the other has ended";
  EXPECT_EQ(errors.missed, 0u);
  EXPECT_DOUBLE_EQ(errors.late_ms, 10);
  found.bodies[0].comparable = false;
  EXPECT_EQ(errorsOf(found, truth).vertices.touched, 0u) << "its numbers mean other vertices in time";
}

TEST(FirstContacts, PatchesMatchByPartnersTimeAndPlace) {
  const RunRecord truth = run({patch(110, 300, 0), patch(500, 900, 0), patch(500, 900, 5)});
  const RunRecord found = run({patch(120, 300, 0.05), patch(620, 900, 5), patch(500, 900, 2)});
  const RunErrors errors = errorsOf(found, truth);
  EXPECT_EQ(errors.patches.touched, 3u);
  EXPECT_EQ(errors.patches.missed, 1u) << "the second: where one touches later is 5 m away";
  EXPECT_EQ(errors.patches.invented, 1u) << "at 2 m";
  EXPECT_DOUBLE_EQ(errors.patches.late_ms, 120);
  EXPECT_DOUBLE_EQ(errors.patches.early_ms, 0);
  EXPECT_DOUBLE_EQ(errors.patches.median_ms, 120) << "of 10 and 120";
  RunRecord other = found;
  for (PatchLife& life : other.patches) life.body = {0, OBSTACLE_BODY};
  EXPECT_EQ(errorsOf(other, truth).patches.missed, 3u);
  EXPECT_EQ(errorsOf(other, truth).patches.invented, 3u);
}

TEST(FirstContacts, WhatGrewTogetherIsNotMissed) {
  const RunRecord two = run({patch(100, 400, 0), patch(200, 400, 0.08)}), one = run({patch(90, 400, 0.04)});
  const RunErrors joined = errorsOf(one, two), parted = errorsOf(two, one);
  EXPECT_EQ(joined.patches.missed, 0u);
  EXPECT_EQ(joined.joined, 1u);
  EXPECT_DOUBLE_EQ(joined.patches.early_ms, -10) << "with the one that begins nearest";
  EXPECT_DOUBLE_EQ(joined.patches.late_ms, 0);
  EXPECT_EQ(parted.patches.invented, 0u);
  EXPECT_EQ(parted.parted, 1u);
  EXPECT_DOUBLE_EQ(parted.patches.late_ms, 10);
  const RunRecord later_first = run({patch(200, 400, 0.08), patch(100, 400, 0)});
  EXPECT_DOUBLE_EQ(errorsOf(one, later_first).patches.early_ms, -10) << "whichever was found first";
}

TEST(FirstContacts, PatchesMeetWithinAnEdgeOfTheFinerBodyOrAnEdgeAndAVoxel) {
  const auto missed = [](std::array<std::uint16_t, 2> partners, double apart_m) {
    RunRecord truth = run({patch(100, 300, 0)}), found = run({patch(100, 300, apart_m)});
    for (RunRecord* record : {&truth, &found}) {
      record->bodies.resize(2);
      record->bodies[0].edge_m = 0.1;
      record->bodies[1].edge_m = 0.5;
      record->voxel_m = 0.25;
      record->patches[0].body = partners;
    }
    return errorsOf(found, truth).patches.missed;
  };
  EXPECT_EQ(missed({0, 1}, 0.09), 0u);
  EXPECT_EQ(missed({0, 1}, 0.11), 1u) << "of the finer body";
  EXPECT_EQ(missed({0, OBSTACLE_BODY}, 0.34), 0u);
  EXPECT_EQ(missed({0, OBSTACLE_BODY}, 0.36), 1u);
  EXPECT_EQ(missed({1, OBSTACLE_BODY}, 0.74), 0u);
}

/// A step of 100 ms of a square with two faces.
Outcome step(int number) {
  Step step;
  step.bodies.resize(1);
  step.bodies[0].topology = share(Topology::grid(2, 2));
  step.bodies[0].t0 = step.bodies[0].t1 = share(Positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}});
  Outcome outcome;
  outcome.answered = true;
  outcome.start_ns = (1000 + 100 * number) * MS;
  outcome.stamp_ns = outcome.start_ns + 100 * MS;
  outcome.step = share(std::move(step));
  outcome.stats.total_ms = 0.5;
  return outcome;
}

Patch patchOf(std::uint64_t id, double x_m) {
  Patch patch;
  patch.id = id;
  patch.box = {Vec3(x_m, 0, 0), Vec3(x_m, 1, 0)};
  return patch;
}

TEST(RunRecorder, FirstTimesAreTheEarliestOfAllFeaturesOnAVertex) {
  RunRecorder recorder;
  recorder.add(Outcome());
  Outcome outcome = step(0);
  Contact contact;
  contact.kind = PairKind::VERTEX_VOXEL_FACE;
  contact.body = {0, OBSTACLE_BODY};
  contact.vertex = {3, NO_INDEX, NO_INDEX, NO_INDEX};
  contact.toc_lower = 0.5;
  contact.toc_upper = 0.75;
  outcome.contacts = {contact};
  contact.kind = PairKind::EDGE_VOXEL_EDGE;
  contact.vertex = {1, 3, NO_INDEX, NO_INDEX};
  contact.toc_lower = 0.25;
  contact.toc_upper = 1;
  outcome.contacts.push_back(contact);
  contact.vertex = {1, 2, NO_INDEX, NO_INDEX};
  contact.toc_lower = 0.3;
  contact.toc_upper = 0.5;
  outcome.contacts.push_back(contact);
  recorder.add(outcome);
  Outcome next = step(1);
  next.contacts = outcome.contacts;
  recorder.add(next);
  const RunRecord record = recorder.take();
  EXPECT_EQ(record.steps, 2u);
  EXPECT_DOUBLE_EQ(record.msPerSecond(), 5);
  ASSERT_EQ(record.bodies.size(), 1u);
  const RunRecord::BodyRecord& body = record.bodies[0];
  EXPECT_EQ(body.vertices.size(), 4u);
  EXPECT_DOUBLE_EQ(body.edge_m, (4 + std::sqrt(2.0)) / 5);
  ASSERT_EQ(body.first.size(), 3u);
  EXPECT_EQ(body.first.at(3).from_ns, 1025 * MS);
  EXPECT_EQ(body.first.at(3).to_ns, 1075 * MS);
  EXPECT_EQ(body.first.at(1).from_ns, 1025 * MS);
  EXPECT_EQ(body.first.at(1).to_ns, 1050 * MS);
  EXPECT_TRUE(body.comparable);
}

TEST(RunRecorder, WhatComesOffAPatchIsStillIt) {
  RunRecorder recorder;
  Outcome first = step(0), second = step(1), third = step(2);
  first.patches = {patchOf(1, 0)};
  first.patches[0].began_to_ns = 1000 * MS;  // it touched when it was first looked at
  second.patches = {patchOf(1, 0), patchOf(2, 5)};
  second.patches[1].began_from_ns = second.patches[1].began_to_ns = 1000 * MS;
  PatchEvent split;
  split.kind = PatchEventKind::SPLIT;
  split.id = 1;
  split.others = {2};
  second.patch_events = {split};
  third.patches = {patchOf(3, 7), patchOf(2, 5)};
  third.patches[0].began_from_ns = 1210 * MS;
  third.patches[0].began_to_ns = 1211 * MS;
  for (const Outcome& outcome : {first, second, third}) recorder.add(outcome);
  const RunRecord record = recorder.take();
  ASSERT_EQ(record.patches.size(), 2u);
  const PatchLife& life = record.patches[0];
  EXPECT_EQ(life.began.from_ns, 1000 * MS);
  EXPECT_EQ(life.began.to_ns, 1000 * MS);
  ASSERT_EQ(life.seen.size(), 3u) << "as long as a part of it touches";
  EXPECT_EQ(life.seen[1].box.max.x(), 5);
  EXPECT_EQ(life.seen[1].box.min.x(), 0);
  EXPECT_EQ(record.patches[1].began.from_ns, 1210 * MS);
}

TEST(RunRecorder, AMeshThatChangesHasNoCommonVertices) {
  RunRecorder recorder;
  Outcome other = step(1);
  Step changed = *other.step;
  changed.bodies[0].topology = share(Topology::fromTriangles(4, {{0, 1, 2}}));
  other.step = share(std::move(changed));
  recorder.add(step(0));
  recorder.add(step(1));
  recorder.add(other);
  EXPECT_FALSE(recorder.take().bodies[0].comparable);
}

TEST(AccuracyStudy, TheSentenceIsOfTheFastestThatLosesNothing) {
  AccuracyStudy study(run({patch(110, 300, 0)}));
  RunRecord again = study.reference(), nearly = study.reference(), half = run({patch(118, 300, 0)}), wrong = run();
  again.ms = 3;
  nearly.ms = 1.9;  // much less than the mean of the two, and nearly the lesser
  half.ms = 1.15;
  wrong.ms = 0.1;
  study.add(REFERENCE, "exact", study.reference());
  study.add(REFERENCE, "the same again", again);
  study.add("rung", "fast", nearly);
  EXPECT_EQ(study.sentence(), "Nothing that was tried saves a tenth of the time.");
  study.add("frames", "every 8th", wrong);
  EXPECT_EQ(study.sentence(),
            "frames every 8th: 25 times as fast, 1 of 1 patches missed and 0 invented; nothing that was tried saves a "
            "tenth of the time and gets all of them right.");
  study.add("frames", "every 2nd", half);
  EXPECT_EQ(
      study.sentence(),
      "frames every 2nd: 2.2 times as fast, no patch of 1 missed or invented, first contacts up to 8.0 ms late (95 "
      "% within 8.0 ms).")
      << "46 % of the mean of 2 and 3 ms";
  EXPECT_EQ(AccuracyStudy(run()).sentence(),
            "Nothing touches in this recording: there is no first contact to compare.");
  EXPECT_EQ(AccuracyStudy(RunRecord()).sentence(), "No step was answered: there is nothing to compare.");
}

}  // namespace
}  // namespace dccd
