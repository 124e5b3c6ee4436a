// One pair's way through a recorded step, as replay_step asks for it.
#include <algorithm>

#include <gtest/gtest.h>

#include "record/step_replay.h"
#include "record/voxel_trace.h"
#include "support/recordings.h"

namespace dccd {
namespace test {
namespace {

StepInput inputOf(const StepRecording& r, std::vector<MonitorBody>& bodies) {
  StepInput input;
  input.resize(r.bodies.size());
  for (std::size_t b = 0; b < r.bodies.size(); ++b) {
    bodies.push_back(r.bodies[b].setup);
    input.t0[b] = r.bodies[b].t0;
    input.t1[b] = r.bodies[b].t1;
    input.topologies[b] = r.bodies[b].topology;
    input.rigid[b] = r.bodies[b].rigid;
    input.pose_t0[b] = r.bodies[b].pose_t0;
    input.pose_t1[b] = r.bodies[b].pose_t1;
    input.radius_m[b] = r.bodies[b].radius_m;
    input.references[b] = r.bodies[b].reference;
  }
  return input;
}

TEST(PairTrace, ContactsPassEveryStageAndAreTheRecordedOnes) {
  const StepRecording r = recordScene();
  std::vector<MonitorBody> bodies;
  const StepInput input = inputOf(r, bodies);
  std::size_t traced = 0;
  for (const Contact& c : r.answer.contacts) {
    if (c.body[1] == OBSTACLE_BODY) continue;
    bool met = false;
    std::vector<TraceLine> part;
    const auto judge = [&] {
      const bool contact = !part.empty() && part.back().says == TraceLine::Says::CONTACT;
      met |= contact;
      for (const TraceLine& line : part) {
        const bool may_err = line.stage == "fast";  // it promises nothing
        EXPECT_FALSE(contact && !may_err && line.says == TraceLine::Says::REJECTED) << line.stage << ": " << line.text;
      }
      part.clear();
    };
    for (const TraceLine& line : tracePair(input, bodies, r.options, {c.kind, c.body, c.vertex})) {
      if (!part.empty() && line.part != part.back().part) judge();
      part.push_back(line);
    }
    judge();
    EXPECT_TRUE(met) << describeContact(c, r.bodies);
    ++traced;
  }
  EXPECT_GT(traced, 0u);
}

TEST(PairTrace, SaysWhyAPairIsRejected) {
  const StepRecording r = recordScene();
  std::vector<MonitorBody> bodies;
  const StepInput input = inputOf(r, bodies);
  const auto first = [&](const PairQuestion& q) { return tracePair(input, bodies, r.options, q).front(); };
  // Grid faces: (0, 1, 5) or (0, 1, 6), with its diagonals; a vertex of its own face, then a masked one.
  const Face face = r.bodies[0].topology->faces()[10];
  EXPECT_NE(first({PairKind::VERTEX_FACE, {0, 0}, {face[1], face[0], face[1], face[2]}}).text.find("share vertex"),
            std::string::npos);
  EXPECT_NE(first({PairKind::VERTEX_FACE, {0, 0}, {0, face[0], face[1], face[2]}}).text.find("masked"),
            std::string::npos);
  EXPECT_NE(first({PairKind::EDGE_EDGE, {1, 1}, {0, 2, 1, 3}}).text.find("self-collision"), std::string::npos);
  const std::vector<TraceLine> far =
      tracePair(input, bodies, r.options, {PairKind::VERTEX_FACE, {0, 0}, {19, 1, 2, 6}});
  EXPECT_EQ(far[1].stage, "linear");
  EXPECT_EQ(far[1].says, TraceLine::Says::REJECTED);
  EXPECT_EQ(far.back().says, TraceLine::Says::REJECTED);
}

/// What the traces of a question say at the rung of the recording, one word a part.
std::vector<TraceLine::Says> atTheRung(const std::vector<TraceLine>& lines) {
  std::vector<TraceLine::Says> said;
  for (const TraceLine& line : lines) {
    if (line.stage.find('*') != std::string::npos) said.push_back(line.says);
  }
  return said;
}

TEST(VoxelTrace, ContactsWithTheMapAreTheRecordedOnes) {
  const StepRecording r = recordScene();
  std::vector<MonitorBody> bodies;
  const StepInput input = inputOf(r, bodies);
  std::size_t traced = 0;
  for (const Contact& c : r.answer.contacts) {
    if (c.body[1] != OBSTACLE_BODY) continue;
    VoxelQuestion q{c.kind, c.body[0], {}, c.voxel};
    for (const Index v : c.vertex) {
      if (v != NO_INDEX) q.vertex.push_back(v);
    }
    std::reverse(q.vertex.begin(), q.vertex.end());  // the order does not matter
    const std::vector<TraceLine> lines = traceVoxel(input, bodies, r.options, r.map, q);
    const std::vector<TraceLine::Says> said = atTheRung(lines);
    EXPECT_NE(std::count(said.begin(), said.end(), TraceLine::Says::CONTACT), 0) << describeContact(c, r.bodies);
    for (const TraceLine& line : lines) {
      const bool proof = line.stage == "rules" || line.stage == "bounds";
      EXPECT_FALSE(proof && said.size() == 1 && line.says == TraceLine::Says::REJECTED)
          << line.stage << ": " << line.text;
    }
    ++traced;
  }
  EXPECT_GT(traced, 0u);
}

TEST(VoxelTrace, SaysWhyThereIsNone) {
  StepRecording r = recordScene();
  std::vector<MonitorBody> bodies;
  const StepInput input = inputOf(r, bodies);
  const auto contact = std::find_if(r.answer.contacts.begin(), r.answer.contacts.end(),
                                    [](const Contact& c) { return c.kind == PairKind::EDGE_VOXEL_EDGE; });
  ASSERT_NE(contact, r.answer.contacts.end());
  const VoxelQuestion q{contact->kind, contact->body[0], {contact->vertex[0], contact->vertex[1]}, contact->voxel};
  const auto first = [&](const MonitorOptions& options, const VoxelQuestion& question) {
    return traceVoxel(input, bodies, options, r.map, question).front().text;
  };
  VoxelQuestion nowhere = q;
  nowhere.voxel = {1, 2, 3};
  EXPECT_EQ(first(r.options, nowhere), "the map has no occupied voxel there");
  MonitorOptions excluding = r.options;
  excluding.exclude_boxes = {{Vec3::Constant(-1000), Vec3::Constant(1000)}};
  EXPECT_EQ(first(excluding, q), "the voxel is in one of exclude_boxes");
  bodies[q.body].vertex_mask = {q.vertex[0]};
  EXPECT_NE(first(r.options, q).find("masked"), std::string::npos);
  bodies[q.body].against_obstacle = false;
  bodies[q.body].vertex_mask.clear();
  EXPECT_NE(first(r.options, q).find("against_obstacle"), std::string::npos);

  // Far from the leaf the bounds tell, and the rungs agree.
  bodies[q.body].against_obstacle = true;
  StepInput far = input;
  for (Positions* positions : {&far.t0[q.body], &far.t1[q.body]}) {
    for (Vec3& p : *positions) p.x() += 100;
  }
  const std::vector<TraceLine> lines = traceVoxel(far, bodies, r.options, r.map, q);
  ASSERT_GE(lines.size(), 3u);
  EXPECT_EQ(lines[1].stage, "bounds");
  EXPECT_EQ(lines[1].says, TraceLine::Says::REJECTED);
  EXPECT_EQ(atTheRung(lines).front(), TraceLine::Says::REJECTED);
}

TEST(VoxelTrace, WhatDoesNotExistIsNamed) {
  const StepRecording r = recordScene();
  std::vector<MonitorBody> bodies;
  const StepInput input = inputOf(r, bodies);
  const auto ask = [&](const MonitorMap& map, const VoxelQuestion& q) {
    return traceVoxel(input, bodies, r.options, map, q);
  };
  EXPECT_THROW(ask(r.map, {PairKind::VERTEX_VOXEL_FACE, 9, {0}, {}}), std::invalid_argument);
  EXPECT_THROW(ask(r.map, {PairKind::VERTEX_VOXEL_FACE, 0, {300}, {}}), std::invalid_argument);
  EXPECT_THROW(ask(r.map, {PairKind::EDGE_VOXEL_EDGE, 0, {0, 19}, {}}), std::invalid_argument) << "no such edge";
  EXPECT_THROW(ask(MonitorMap(), {PairKind::VERTEX_VOXEL_FACE, 0, {0}, {}}), std::invalid_argument) << "no map";
}

// A listed pair is left out only while it is closer in the reference frame than its present separation; its radii may
// be smaller now than those of the list.
TEST(PairTrace, HoldsAListedPairToItsPresentSeparation) {
  const auto topology = std::make_shared<const Topology>(Topology::fromTriangles(6, {{0, 1, 2}, {3, 4, 5}}));
  const auto at = [](double z) {
    return Positions{{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}, {0, 0, z}, {0.5, 0, z + 1}, {-0.5, 0, z + 1}};
  };
  std::vector<MonitorBody> bodies(1);
  bodies[0].name = "cloth";
  MonitorOptions options;
  options.detector.accuracy.rung = Accuracy::CONSERVATIVE;
  const PairQuestion question{PairKind::VERTEX_FACE, {0, 0}, {3, 0, 1, 2}};
  for (const double radius_m : {0.001, 0.004}) {
    StepInput input;
    input.resize(1);
    input.topologies = {topology};
    input.t0[0] = input.t1[0] = at(0.0015);
    input.radius_m[0].assign(6, radius_m);
    const ReferenceFrame reference{at(0.005), std::vector<double>(6, 0.01)};
    input.references[0] = std::make_shared<const ReferenceFrame>(reference);
    Detector detector(options.detector);
    detector.setBodies(bodySetups(input, bodies), {&input.t0[0]});
    const auto listed = [&](const LeftOutPair& pair) {
      return pair.kind == question.kind && std::equal(pair.vertex.begin(), pair.vertex.end(), question.vertex.begin());
    };
    ASSERT_TRUE(std::any_of(detector.leftOut().begin(), detector.leftOut().end(), listed));
    MotionStep step;
    step.bodies = {{&input.t0[0], &input.t1[0], &input.radius_m[0]}};
    const StepResult result = detector.run(step);
    const bool contact = std::any_of(result.contacts.begin(), result.contacts.end(), [&](const Contact& c) {
      return c.kind == question.kind && std::equal(c.vertex.begin(), c.vertex.end(), question.vertex.begin());
    });
    EXPECT_EQ(contact, radius_m < 0.0025);  // 0.005 apart there, and 0.0015 now
    const std::vector<TraceLine> trace = tracePair(input, bodies, options, question);
    const auto lineOf = [&](const std::string& stage) {
      const auto line = std::find_if(trace.begin(), trace.end(), [&](const TraceLine& l) { return l.stage == stage; });
      return line == trace.end() ? TraceLine() : *line;
    };
    EXPECT_EQ(lineOf("conservative *").says == TraceLine::Says::CONTACT, contact);
    EXPECT_EQ(lineOf("separation").text.find("left out") == std::string::npos, contact) << lineOf("separation").text;
    EXPECT_NE(lineOf("planar").text.find("not asked"), std::string::npos) << lineOf("planar").text;
  }
}

TEST(PairTrace, WhatDoesNotExistIsNamed) {
  const StepRecording r = recordScene();
  std::vector<MonitorBody> bodies;
  const StepInput input = inputOf(r, bodies);
  EXPECT_THROW(tracePair(input, bodies, r.options, {PairKind::VERTEX_FACE, {9, 0}, {0, 1, 2, 3}}),
               std::invalid_argument);
  EXPECT_THROW(tracePair(input, bodies, r.options, {PairKind::VERTEX_FACE, {0, 0}, {0, 1, 2, 300}}),
               std::invalid_argument);
  EXPECT_THROW(tracePair(input, bodies, r.options, {PairKind::VERTEX_FACE, {0, 0}, {0, 1, 2, 19}}),
               std::invalid_argument)
      << "no such face";
}

}  // namespace
}  // namespace test
}  // namespace dccd
