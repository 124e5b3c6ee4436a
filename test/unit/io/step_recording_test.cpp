#include "io/step_recording.h"

#include <sys/resource.h>

#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>

#include <gtest/gtest.h>

#include "deformable_ccd/simd_target.h"
#include "detector/voxel_trace.h"
#include "io/step_replay.h"
#include "support/recordings.h"

namespace deformable_ccd {
namespace test {
namespace {

namespace fs = std::filesystem;

std::string errorOf(const std::vector<std::uint8_t>& bytes) {
  try {
    readRecording(bytes.data(), bytes.size(), "FILE");
  } catch (const RecordingError& error) {
    return error.what();
  }
  return {};
}

MonitorOptions with(Accuracy rung) {
  MonitorOptions options;
  options.detector.accuracy.rung = rung;
  options.obstacle_expected = true;
  return options;
}

TEST(StepRecording, TheSceneCallsForEverything) {
  const StepRecording r = recordScene();
  EXPECT_EQ(r.bodies.size(), 3u);
  EXPECT_GT(r.answer.substeps, 1u) << "the finger turns";
  bool self_or_body = false, obstacle = false;
  for (const core::Contact& c : r.answer.contacts) (c.body[1] == OBSTACLE_BODY ? obstacle : self_or_body) = true;
  EXPECT_TRUE(self_or_body);
  EXPECT_TRUE(obstacle);
}

TEST(StepRecording, WhatIsReadIsWhatWasWritten) {
  const StepRecording r = recordScene();
  const std::vector<std::uint8_t> bytes = recordingBytes(r);
  const StepRecording again = readRecording(bytes.data(), bytes.size(), "FILE");
  EXPECT_EQ(recordingBytes(again), bytes);
  EXPECT_EQ(again.bodies[2].setup.motion, BodyMotionKind::STATIC);
  EXPECT_FALSE(again.bodies[2].topology->hasFaces()) << "the rope is a polyline";
  EXPECT_EQ(again.bodies[2].topology->edges().size(), 3u);
  ASSERT_TRUE(again.map.surface);
  EXPECT_EQ(again.map.surface->leafCount(), 2u);
  EXPECT_TRUE(compareAnswers(r.answer, again.answer).empty());
}

TEST(StepReplay, EveryRungAndTargetAndNumberOfThreadsGivesTheSameBits) {
  const std::string before = simdTarget();
  for (const Accuracy rung : {Accuracy::SCREEN, Accuracy::FAST, Accuracy::CONSERVATIVE, Accuracy::EXACT}) {
    const std::vector<std::uint8_t> bytes = recordingBytes(recordScene(with(rung)));
    const StepRecording r = readRecording(bytes.data(), bytes.size(), "FILE");
    ASSERT_FALSE(r.answer.contacts.empty()) << toString(rung);
    for (const std::string& target : simdTargets()) {
      setSimdTarget(target);
      for (const int threads : {1, 3}) {
        const StepReplay replay = replayStep(r, threads);
        EXPECT_TRUE(replay.differences.empty()) << toString(rung) << ' ' << target << ": " << replay.differences.front();
        EXPECT_EQ(replay.answer.contacts.size(), r.answer.contacts.size());
      }
    }
  }
  setSimdTarget(before);
}

TEST(StepReplay, DistancesAndWhatTheyLeaveOutAreRecordedToo) {
  for (const Accuracy rung : {Accuracy::SCREEN, Accuracy::CONSERVATIVE}) {
    const StepRecording without = recordScene(with(rung));
    StepRecording r = recordScene(with(rung), true, true);
    const std::vector<std::uint8_t> bytes = recordingBytes(r);
    r = readRecording(bytes.data(), bytes.size(), "FILE");
    EXPECT_EQ(recordingBytes(r), bytes);
    ASSERT_EQ(r.bodies[0].radius_m.size(), 20u);
    EXPECT_EQ(r.bodies[0].radius_m[7], 3e-3);
    ASSERT_TRUE(r.bodies[0].reference) << "its first frame";
    EXPECT_NE(r.bodies[0].reference->positions, r.bodies[0].t0);
    ASSERT_EQ(r.bodies[2].setup.separations.size(), 1u);
    EXPECT_EQ(r.bodies[2].setup.separations[0].separation_m, 0.15);
    EXPECT_GT(r.answer.contacts.size(), without.answer.contacts.size());
    for (const int threads : {1, 3}) {
      const StepReplay replay = replayStep(r, threads);
      EXPECT_TRUE(replay.differences.empty()) << toString(rung) << ": " << replay.differences.front();
    }
    // Each of them matters: without it the answer is another.
    const auto differs = [&r](const std::function<void(StepRecording&)>& change) {
      StepRecording changed = r;
      change(changed);
      return !replayStep(changed).differences.empty();
    };
    EXPECT_TRUE(differs([](StepRecording& c) { c.bodies[0].radius_m.assign(20, 0.05); })) << toString(rung);
    EXPECT_TRUE(differs([](StepRecording& c) { c.bodies[2].setup.separations.clear(); })) << toString(rung);
    EXPECT_TRUE(differs([](StepRecording& c) {
      ReferenceFrame spread = *c.bodies[0].reference;
      for (Vec3& p : spread.positions) p *= 10;  // nothing is close in it, so nothing is left out
      c.bodies[0].reference = std::make_shared<const ReferenceFrame>(spread);
    })) << toString(rung);
  }
}

TEST(StepReplay, WithoutAMapTheStatusIsTheSame) {
  const StepRecording r = recordScene(with(Accuracy::EXACT), false);
  EXPECT_EQ(r.answer.status, StepStatus::NO_MAP);
  const StepReplay replay = replayStep(r);
  EXPECT_EQ(replay.answer.status, StepStatus::NO_MAP);
  EXPECT_TRUE(replay.differences.empty());
}

TEST(StepReplay, OneBitIsADifference) {
  StepRecording r = recordScene();
  ASSERT_FALSE(r.answer.contacts.empty());
  r.answer.contacts.back().toc_lower = std::nextafter(r.answer.contacts.back().toc_lower, 2);
  EXPECT_EQ(replayStep(r).differences.size(), 1u);
  r.answer.contacts.pop_back();
  EXPECT_FALSE(replayStep(r).differences.empty());
}

TEST(StepReplay, AStepThatRanOutOfItsBudgetIsConfirmed) {
  StepRecording r = recordScene();
  r.answer.complete = false;
  r.answer.status = StepStatus::DEADLINE;
  r.answer.contacts.resize(1);
  EXPECT_TRUE(replayStep(r).differences.empty()) << "the rest was left out, which is no contradiction";
  r.answer.contacts[0].vertex[0] += 1;
  EXPECT_FALSE(replayStep(r).differences.empty());
}

TEST(StepReplay, AStepWithoutAnAnswerIsComputed) {
  StepRecording r = recordScene();
  const std::size_t contacts = r.answer.contacts.size();
  r.answer = RecordedAnswer();
  const StepReplay replay = replayStep(r);
  EXPECT_TRUE(replay.differences.empty());
  EXPECT_EQ(replay.answer.contacts.size(), contacts);
}

TEST(StepRecording, EveryTruncationIsRefused) {
  const std::vector<std::uint8_t> bytes = recordingBytes(recordScene());
  for (std::size_t n = 0; n < bytes.size(); n += n < 600 ? 1 : 37) {
    const std::vector<std::uint8_t> cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(n));
    EXPECT_EQ(errorOf(cut).rfind("FILE: byte ", 0), 0u) << n;
  }
  std::vector<std::uint8_t> more = bytes;
  more.push_back(0);
  EXPECT_NE(errorOf(more).find("1 bytes are left over"), std::string::npos) << errorOf(more);
}

TEST(StepRecording, AnyByteMayLie) {
  const std::vector<std::uint8_t> bytes = recordingBytes(recordScene());
  std::size_t refused = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    for (const std::uint8_t value : {0xff, 0x80, 0x01}) {
      std::vector<std::uint8_t> bad = bytes;
      bad[i] ^= value;
      refused += !errorOf(bad).empty();
    }
  }
  EXPECT_GT(refused, 100u);
}

TEST(StepRecording, LiesAreNamed) {
  const std::vector<std::uint8_t> bytes = recordingBytes(recordScene());
  std::vector<std::uint8_t> bad = bytes;
  bad[0] = 'X';
  EXPECT_NE(errorOf(bad).find("not a recording"), std::string::npos);
  bad = bytes;
  bad[8] = 9;
  EXPECT_NE(errorOf(bad).find("version 9"), std::string::npos);
  StepRecording r = recordScene();
  r.stamp_ns = r.start_ns;
  EXPECT_NE(errorOf(recordingBytes(r)).find("the step lasts"), std::string::npos);
  r = recordScene();
  r.bodies[0].t1.pop_back();
  EXPECT_NE(errorOf(recordingBytes(r)).find("20 vertices at t=0 and 19 at t=1"), std::string::npos);
  r = recordScene();
  r.bodies[0].t0.resize(3);
  r.bodies[0].t1.resize(3);
  EXPECT_NE(errorOf(recordingBytes(r)).find("body 'cloth'"), std::string::npos) << "faces name vertices that are not there";
  r = recordScene();
  r.bodies[1].pose_t0.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(errorOf(recordingBytes(r)).find("pose"), std::string::npos);
}

TEST(StepReplay, ImpossibleOptionsAreRefused) {
  StepRecording r = recordScene();
  r.options.clock_body = 7;
  EXPECT_THROW(replayStep(r), std::invalid_argument);
  r = recordScene();
  r.bodies.clear();
  EXPECT_THROW(replayStep(r), std::invalid_argument);
  r = recordScene();
  r.options.detector.accuracy.toc_bits = 99;
  EXPECT_THROW(replayStep(r), std::invalid_argument);
}

// --- the disk --------------------------------------------------------------------------------------------------------

class RecordingFile : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "recording_XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST_F(RecordingFile, IsReadAsItWasWritten) {
  const StepRecording r = recordScene();
  const std::string path = folder_ / "a.step";
  writeRecording(path, r);
  EXPECT_EQ(recordingBytes(readRecordingFile(path)), recordingBytes(r));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

TEST_F(RecordingFile, AFullDiskIsNamedAndNothingIsLeftBehind) {
  // A limit on the size of files stands for the full disk: write(2) fails in the middle of the file either way.
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  rlimit little = before;
  little.rlim_cur = 200;
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &little);
  std::string error;
  try {
    writeRecording(folder_ / "a.step", recordScene());
  } catch (const std::runtime_error& e) {
    error = e.what();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_NE(error.find("a.step: cannot be written: "), std::string::npos) << error;
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(RecordingFile, ADeviceWithoutSpaceIsNamedAndNothingIsLeftBehind) {
  fs::create_symlink("/dev/full", folder_ / "a.step.part");
  try {
    writeRecording(folder_ / "a.step", recordScene());
    FAIL() << "/dev/full took it";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("No space left"), std::string::npos) << error.what();
  }
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(RecordingFile, AFolderThatIsNotThereIsNamed) {
  EXPECT_THROW(writeRecording(folder_ / "none" / "a.step", recordScene()), std::runtime_error);
  EXPECT_THROW(readRecordingFile(folder_ / "none.step"), RecordingError);
}

// --- one pair's way --------------------------------------------------------------------------------------------------

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
  for (const core::Contact& c : r.answer.contacts) {
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
  EXPECT_NE(first({PairKind::VERTEX_FACE, {0, 0}, {0, face[0], face[1], face[2]}}).text.find("masked"), std::string::npos);
  EXPECT_NE(first({PairKind::EDGE_EDGE, {1, 1}, {0, 2, 1, 3}}).text.find("self-collision"), std::string::npos);
  const std::vector<TraceLine> far = tracePair(input, bodies, r.options, {PairKind::VERTEX_FACE, {0, 0}, {19, 1, 2, 6}});
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
  for (const core::Contact& c : r.answer.contacts) {
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
      EXPECT_FALSE(proof && said.size() == 1 && line.says == TraceLine::Says::REJECTED) << line.stage << ": " << line.text;
    }
    ++traced;
  }
  EXPECT_GT(traced, 0u);
}

TEST(VoxelTrace, SaysWhyThereIsNone) {
  StepRecording r = recordScene();
  std::vector<MonitorBody> bodies;
  const StepInput input = inputOf(r, bodies);
  const auto contact = std::find_if(r.answer.contacts.begin(), r.answer.contacts.end(), [](const core::Contact& c) {
    return c.kind == PairKind::EDGE_VOXEL_EDGE;
  });
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
  const auto ask = [&](const MonitorMap& map, const VoxelQuestion& q) { return traceVoxel(input, bodies, r.options, map, q); };
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
    const bool contact = std::any_of(result.contacts.begin(), result.contacts.end(), [&](const core::Contact& c) {
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
  EXPECT_THROW(tracePair(input, bodies, r.options, {PairKind::VERTEX_FACE, {9, 0}, {0, 1, 2, 3}}), std::invalid_argument);
  EXPECT_THROW(tracePair(input, bodies, r.options, {PairKind::VERTEX_FACE, {0, 0}, {0, 1, 2, 300}}), std::invalid_argument);
  EXPECT_THROW(tracePair(input, bodies, r.options, {PairKind::VERTEX_FACE, {0, 0}, {0, 1, 2, 19}}), std::invalid_argument)
      << "no such face";
}

}  // namespace
}  // namespace test
}  // namespace deformable_ccd
