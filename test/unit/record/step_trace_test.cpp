// One pair's way through a recorded step, as replay_step asks for it.
#include <algorithm>

#include <gtest/gtest.h>

#include "record/explain.h"
#include "record/step_replay.h"
#include "support/detector.h"
#include "support/recordings.h"

namespace dccd {
namespace test {
namespace {

PairQuestion questionOf(const Contact& c) {
  PairQuestion q{c.kind, c.body, {}, c.voxel};
  std::copy_if(c.vertex.begin(), c.vertex.end(), std::back_inserter(q.vertex), [](Index v) { return v != NO_INDEX; });
  return q;
}

TEST(PairTrace, ContactsPassEveryStageAndAreTheRecordedOnes) {
  const StepRecording r = recordScene();
  std::size_t traced = 0;
  for (const Contact& c : r.answer.contacts) {
    if (c.body[1] == OBSTACLE_BODY) continue;
    bool met = false;
    std::vector<TraceLine> part;
    const auto judge = [&] {
      const bool contact = !part.empty() && part.back().says == TraceLine::Says::CONTACT;
      met |= contact;
      for (const TraceLine& line : part) {
        EXPECT_FALSE(contact && line.says == TraceLine::Says::REJECTED) << line.stage << ": " << line.text;
      }
      part.clear();
    };
    for (const TraceLine& line : explain(r.step, r.options, questionOf(c))) {
      if (!part.empty() && line.part != part.back().part) judge();
      part.push_back(line);
    }
    judge();
    EXPECT_TRUE(met) << describeContact(c, r.step.bodies);
    ++traced;
  }
  EXPECT_GT(traced, 0u);
}

TEST(PairTrace, SaysWhyAPairIsRejected) {
  const StepRecording r = recordScene();
  const auto first = [&](const PairQuestion& q) { return explain(r.step, r.options, q).front(); };
  // Grid faces: (0, 1, 5) or (0, 1, 6), with its diagonals; a vertex of its own face, then a masked one.
  const Face face = r.step.bodies[0].topology->faces()[10];
  EXPECT_NE(first({PairKind::VERTEX_FACE, {0, 0}, {face[1], face[0], face[1], face[2]}}).text.find("share vertex"),
            std::string::npos);
  EXPECT_NE(first({PairKind::VERTEX_FACE, {0, 0}, {0, face[0], face[1], face[2]}}).text.find("masked"),
            std::string::npos);
  EXPECT_NE(first({PairKind::EDGE_EDGE, {1, 1}, {0, 2, 1, 3}}).text.find("self-collision"), std::string::npos);
  const std::vector<TraceLine> far =
      explain(r.step, r.options, PairQuestion{PairKind::VERTEX_FACE, {0, 0}, {19, 1, 2, 6}});
  EXPECT_EQ(far[0].stage, "broad phase");
  EXPECT_EQ(far[0].says, TraceLine::Says::REJECTED);
  EXPECT_EQ(far.back().says, TraceLine::Says::REJECTED);
}

// A pair is asked by itself: what else the step finds makes no difference.
TEST(PairTrace, ALimitThatCutTheStepRejectsNoPair) {
  const StepRecording r = recordScene();
  Options limited = r.options;
  limited.max_found = limited.max_found_per_feature = 1;
  std::size_t traced = 0;
  for (const Contact& c : r.answer.contacts) {
    if (c.body[1] == OBSTACLE_BODY) continue;
    const std::vector<TraceLine> lines = explain(r.step, limited, questionOf(c)),
                                 unlimited = explain(r.step, r.options, questionOf(c));
    ASSERT_EQ(lines.size(), unlimited.size());
    for (std::size_t i = 0; i < lines.size(); ++i) {
      EXPECT_EQ(lines[i].says, unlimited[i].says) << lines[i].stage;
      EXPECT_EQ(lines[i].text, unlimited[i].text) << lines[i].stage;
    }
    ++traced;
  }
  EXPECT_GT(traced, 1u);
}

/// What the traces of a question say at the rung, one word a part.
std::vector<TraceLine::Says> atTheRung(const std::vector<TraceLine>& lines) {
  std::vector<TraceLine::Says> said;
  for (const TraceLine& line : lines) {
    if (line.stage == "exact") said.push_back(line.says);
  }
  return said;
}

TEST(VoxelTrace, SaysWhyThereIsNone) {
  StepRecording r = recordScene();
  const auto contact = std::find_if(r.answer.contacts.begin(), r.answer.contacts.end(),
                                    [](const Contact& c) { return c.kind == PairKind::EDGE_VOXEL_EDGE; });
  ASSERT_NE(contact, r.answer.contacts.end());
  const PairQuestion q = questionOf(*contact);
  const auto first = [&](const Options& options, const PairQuestion& question) {
    return explain(r.step, options, question).front().text;
  };
  PairQuestion nowhere = q;
  nowhere.voxel = {1, 2, 3};
  EXPECT_EQ(first(r.options, nowhere), "the map has no occupied voxel there");
  Options excluding = r.options;
  excluding.exclude_boxes = {{Vec3::Constant(-1000), Vec3::Constant(1000)}};
  EXPECT_EQ(first(excluding, q), "the voxel is in one of exclude_boxes");
  std::vector<Body>& bodies = r.step.bodies;
  bodies[q.body[0]].vertex_mask = {q.vertex[0]};
  EXPECT_NE(first(r.options, q).find("masked"), std::string::npos);
  bodies[q.body[0]].against_obstacle = false;
  bodies[q.body[0]].vertex_mask.clear();
  EXPECT_NE(first(r.options, q).find("against_obstacle"), std::string::npos);

  // Far from the leaf the bounds tell, and the rung agrees.
  bodies[q.body[0]].against_obstacle = true;
  Step far = r.step;
  for (auto* positions : {&far.bodies[q.body[0]].t0, &far.bodies[q.body[0]].t1}) {
    Positions moved = **positions;
    for (Vec3& p : moved) p.x() += 100;
    *positions = share(moved);
  }
  const std::vector<TraceLine> lines = explain(far, r.options, q);
  ASSERT_GE(lines.size(), 2u);
  EXPECT_EQ(lines[0].stage, "bounds");
  EXPECT_EQ(lines[0].says, TraceLine::Says::REJECTED);
  EXPECT_EQ(atTheRung(lines).front(), TraceLine::Says::REJECTED);
}

// The uncertainty is left out of a pair only while it reaches as far as the two are apart in the reference frame.
TEST(PairTrace, HoldsAPairToItsPresentUncertainty) {
  const auto topology = std::make_shared<const Topology>(Topology::fromTriangles(6, {{0, 1, 2}, {3, 4, 5}}));
  const auto at = [](double z) {
    return Positions{{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}, {0, 0, z}, {0.5, 0, z + 1}, {-0.5, 0, z + 1}};
  };
  Body cloth;
  cloth.name = "cloth";
  cloth.topology = topology;
  cloth.reference = share(at(0.005));
  Options options;
  options.accuracy.rung = Accuracy::CONSERVATIVE;
  const PairQuestion question{PairKind::VERTEX_FACE, {0, 0}, {3, 0, 1, 2}};
  for (const double radius_m : {0.001, 0.004}) {
    const std::vector<double> radii(6, radius_m);
    const Step step = stepOf(cloth, at(0.0015), at(0.0015), &radii);
    Detector detector(options);
    const Outcome result = detector.run(step);
    EXPECT_EQ(result.stats.left_out_met > 0, radius_m > 0.0025);
    const bool contact = std::any_of(result.contacts.begin(), result.contacts.end(), [&](const Contact& c) {
      return c.kind == question.kind && std::equal(c.vertex.begin(), c.vertex.end(), question.vertex.begin());
    });
    EXPECT_EQ(contact, radius_m < 0.0025);  // 0.005 apart there, and 0.0015 now
    const std::vector<TraceLine> trace = explain(step, options, question);
    const auto lineOf = [&](const std::string& stage) {
      const auto line = std::find_if(trace.begin(), trace.end(), [&](const TraceLine& l) { return l.stage == stage; });
      return line == trace.end() ? TraceLine() : *line;
    };
    EXPECT_EQ(lineOf("conservative").says == TraceLine::Says::CONTACT, contact);
    EXPECT_EQ(lineOf("separation").text.find("left out") == std::string::npos, contact) << lineOf("separation").text;
    EXPECT_NE(lineOf("planar").text.find("not asked"), std::string::npos) << lineOf("planar").text;
  }
}

TEST(PairTrace, WhatDoesNotExistIsRefused) {
  StepRecording r = recordScene();
  const auto refuses = [&](const PairQuestion& q) {
    EXPECT_THROW(explain(r.step, r.options, q), std::invalid_argument);
  };
  refuses({PairKind::VERTEX_FACE, {9, 0}, {0, 1, 2, 3}, {}});
  refuses({PairKind::VERTEX_FACE, {0, 0}, {0, 1, 2, 300}, {}});
  refuses({PairKind::VERTEX_FACE, {0, 0}, {0, 1, 2, 19}, {}});  // no such face
  refuses({PairKind::EDGE_VOXEL_EDGE, {0, 0}, {0, 19}, {}});
  r.step.map = ObstacleMap();
  refuses({PairKind::VERTEX_VOXEL_FACE, {0, 0}, {0}, {}});
}

}  // namespace
}  // namespace test
}  // namespace dccd
