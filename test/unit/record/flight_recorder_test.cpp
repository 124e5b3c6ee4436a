#include "record/flight_recorder.h"

#include <cmath>
#include <filesystem>
#include <set>

#include <gtest/gtest.h>

#include "record/step_replay.h"
#include "support/folder_test.h"
#include "support/recordings.h"

namespace dccd {
namespace test {
namespace {

namespace fs = std::filesystem;

class FlightRecorderTest : public FolderTest {};

TEST_F(FlightRecorderTest, KeepsTheLastSteps) {
  RecordedScene scene;
  FlightRecorder recorder(3, folder_ / "new");
  scene.monitor().setListener(&recorder);
  EXPECT_TRUE(recorder.writeAll("none").empty());
  std::vector<std::uint64_t> sequences;
  for (int i = 0; i < 5; ++i) sequences.push_back(scene.nextFrames().sequence);
  EXPECT_EQ(recorder.size(), 3u);
  const std::vector<std::string> files = recorder.writeAll("why");
  ASSERT_EQ(files.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    const StepRecording r = readRecordingFile(files[i]);
    EXPECT_EQ(r.step.sequence, sequences[4 - i]) << "the newest first";
    EXPECT_EQ(r.note, "why");
    EXPECT_TRUE(replayStep(r).differences.empty());
  }
  EXPECT_TRUE(recorder.takeSurprise().empty());
  recorder.onStep(readRecordingFile(files[0]).step, scene.monitor().options().detector);
  EXPECT_FALSE(readRecordingFile(recorder.writeAll("ended").at(0)).has_answer) << "in the place of one with an answer";
}

TEST_F(FlightRecorderTest, TwoInOneFolderOverwriteNothing) {
  RecordedScene scene;
  FlightRecorder one(2, folder_, "one"), same(2, folder_, "one"), other(2, folder_, "other");
  for (int i = 0; i < 2; ++i) {
    const Outcome outcome = scene.nextFrames();
    for (FlightRecorder* recorder : {&one, &same, &other}) {
      recorder->onStep(*outcome.step, scene.monitor().options().detector);
      recorder->onOutcome(outcome);
    }
  }
  std::set<std::string> files;
  for (FlightRecorder* recorder : {&one, &same, &other, &one}) {
    for (const std::string& file : recorder->writeAll("asked")) {
      EXPECT_TRUE(files.insert(file).second) << file;
      EXPECT_EQ(readRecordingFile(file).note, "asked");
    }
  }
  EXPECT_EQ(files.size(), 8u);
}

TEST_F(FlightRecorderTest, AFailureNamesWhatWasWrittenBefore) {
  RecordedScene scene;
  FlightRecorder recorder(2, folder_);
  scene.monitor().setListener(&recorder);
  const Outcome oldest = scene.nextFrames(), newest = scene.nextFrames();
  const auto name = [&](const Outcome& o) {
    return (folder_ / ("step_" + std::to_string(o.sequence) + "_" + std::to_string(o.stamp_ns) + ".step")).string();
  };
  fs::create_symlink("/dev/full", name(oldest) + ".part");
  std::string text;
  try {
    recorder.writeAll("asked");
  } catch (const std::runtime_error& error) {
    text = error.what();
  }
  EXPECT_NE(text.find(name(oldest) + ": "), std::string::npos) << text;
  EXPECT_NE(text.find("newest first:\n" + name(newest)), std::string::npos) << text;
  EXPECT_TRUE(fs::exists(name(newest)));
  EXPECT_FALSE(fs::exists(name(oldest))) << "nothing is left of what failed";
}

TEST_F(FlightRecorderTest, SurprisesAreWrittenAndBounded) {
  RecordedScene scene;
  FlightRecorder recorder(1, folder_);
  scene.monitor().setListener(&recorder);
  Outcome outcome = scene.nextFrames();
  outcome.status = StepStatus::INTERNAL_ERROR;
  outcome.reason = "made up";
  for (std::size_t i = 0; i < FlightRecorder::MAX_SURPRISES + 2; ++i) {
    outcome.sequence = 100 + i;
    recorder.onOutcome(outcome);
  }
  EXPECT_NE(recorder.takeSurprise().find("not recorded, 16 were already"), std::string::npos);
  EXPECT_TRUE(recorder.takeSurprise().empty()) << "said once";
  recorder.writeAll("again");
  std::size_t files = 0;
  for (const auto& entry : fs::directory_iterator(folder_)) {
    ++files;
    EXPECT_FALSE(readRecordingFile(entry.path()).note.empty());
  }
  EXPECT_EQ(files, FlightRecorder::MAX_SURPRISES + 1)
      << "the surprises, though they are the same step, and one asked for";
}

TEST(Surprise, OnlyWhatContradictsThePromises) {
  Options options;
  Outcome outcome;
  outcome.status = StepStatus::OK;
  outcome.answered = true;
  EXPECT_TRUE(surpriseIn(outcome, options).empty());
  outcome.stats.undecided = 2;
  EXPECT_NE(surpriseIn(outcome, options).find("2 pairs undecided"), std::string::npos);
  outcome.complete = false;
  EXPECT_TRUE(surpriseIn(outcome, options).empty()) << "a deadline leaves pairs undecided";
  outcome.complete = true;
  outcome.stats.undecided = 0;
  Contact contact;
  contact.toc_lower = std::numeric_limits<double>::quiet_NaN();
  outcome.contacts.push_back(contact);
  EXPECT_NE(surpriseIn(outcome, options).find("outside of the step"), std::string::npos);
  outcome.contacts[0].toc_lower = 1;
  outcome.contacts[0].toc_upper = std::nextafter(1.0, 2.0);
  EXPECT_NE(surpriseIn(outcome, options).find("outside of the step"), std::string::npos);
}

TEST_F(FlightRecorderTest, AStepThatFailsIsASurprise) {
  RecordedScene scene;
  FlightRecorder recorder(2, folder_);
  scene.monitor().setListener(&recorder);
  MonitorOptions options = scene.monitor().options();
  scene.nextFrames();
  // The mask of another mesh: found only when the step is computed.
  Body cloth;
  cloth.name = "cloth";
  cloth.vertex_mask = {99};
  Monitor failing(options, {cloth});
  failing.setListener(&recorder);
  const auto grid = std::make_shared<const Topology>(Topology::grid(2, 2));
  const Positions at{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  Outcome outcome;
  for (const StampNs stamp_ns : {1, 2}) {
    failing.push(0, {stamp_ns, grid, at, false, Eigen::Isometry3d::Identity()}, 0);
    ASSERT_TRUE(failing.next(0, outcome));
  }
  ASSERT_EQ(outcome.status, StepStatus::INTERNAL_ERROR);
  const std::string surprise = recorder.takeSurprise();
  EXPECT_NE(surprise.find("vertex 99"), std::string::npos) << surprise;
  const StepRecording r = readRecordingFile(surprise.substr(surprise.find(folder_.string())));
  EXPECT_NE(replayStep(r).answer.reason.find("vertex 99"), std::string::npos) << "fails again";
}

}  // namespace
}  // namespace test
}  // namespace dccd
