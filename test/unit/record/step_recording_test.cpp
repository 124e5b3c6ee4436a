#include "record/step_recording.h"

#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <set>

#include <gtest/gtest.h>

#include "dccd/simd_target.h"
#include "record/step_replay.h"
#include "support/recordings.h"

namespace dccd {
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
  options.detector.obstacle_expected = true;
  return options;
}

TEST(StepRecording, TheSceneCallsForEverything) {
  const StepRecording r = recordScene();
  EXPECT_EQ(r.step.bodies.size(), 3u);
  EXPECT_GT(r.answer.substeps, 1u) << "the finger turns";
  bool self_or_body = false, obstacle = false;
  for (const Contact& c : r.answer.contacts) (c.body[1] == OBSTACLE_BODY ? obstacle : self_or_body) = true;
  EXPECT_TRUE(self_or_body);
  EXPECT_TRUE(obstacle);
}

TEST(StepRecording, WhatIsReadIsWhatWasWritten) {
  const StepRecording r = recordScene();
  const std::vector<std::uint8_t> bytes = recordingBytes(r);
  const StepRecording again = readRecording(bytes.data(), bytes.size(), "FILE");
  EXPECT_EQ(recordingBytes(again), bytes);
  EXPECT_EQ(again.step.bodies[2].motion, BodyMotionKind::STATIC);
  EXPECT_FALSE(again.step.bodies[2].topology->hasFaces()) << "the rope is a polyline";
  EXPECT_EQ(again.step.bodies[2].topology->edges().size(), 3u);
  ASSERT_TRUE(again.step.map.surface);
  EXPECT_EQ(again.step.map.surface->leafCount(), 2u);
  EXPECT_TRUE(compareAnswers(r.answer, again.answer).empty());
}

TEST(StepReplay, EveryRungAndTargetAndNumberOfThreadsGivesTheSameBits) {
  const std::string before = simdTarget();
  for (const Accuracy rung : {Accuracy::FAST, Accuracy::CONSERVATIVE, Accuracy::EXACT}) {
    const std::vector<std::uint8_t> bytes = recordingBytes(recordScene(with(rung)));
    const StepRecording r = readRecording(bytes.data(), bytes.size(), "FILE");
    ASSERT_FALSE(r.answer.contacts.empty()) << toString(rung);
    for (const std::string& target : simdTargets()) {
      setSimdTarget(target);
      for (const int threads : {1, 3}) {
        const StepReplay replay = replayStep(r, threads);
        EXPECT_TRUE(replay.differences.empty())
            << toString(rung) << ' ' << target << ": " << replay.differences.front();
        EXPECT_EQ(replay.answer.contacts.size(), r.answer.contacts.size());
      }
    }
  }
  setSimdTarget(before);
}

TEST(StepReplay, DistancesAndWhatTheyLeaveOutAreRecordedToo) {
  const StepRecording without = recordScene(with(Accuracy::CONSERVATIVE));
  StepRecording r = recordScene(with(Accuracy::CONSERVATIVE), true, true);
  const std::vector<std::uint8_t> bytes = recordingBytes(r);
  r = readRecording(bytes.data(), bytes.size(), "FILE");
  EXPECT_EQ(recordingBytes(r), bytes);
  ASSERT_EQ(r.step.bodies[0].radius_m->size(), 20u);
  EXPECT_EQ((*r.step.bodies[0].radius_m)[7], 3e-3);
  ASSERT_TRUE(r.step.bodies[0].reference) << "its first frame";
  EXPECT_NE(r.step.bodies[0].reference->positions, *r.step.bodies[0].t0);
  ASSERT_EQ(r.step.bodies[2].separations.size(), 1u);
  EXPECT_EQ(r.step.bodies[2].separations[0].separation_m, 0.15);
  EXPECT_GT(r.answer.contacts.size(), without.answer.contacts.size());
  for (const int threads : {1, 3}) {
    const StepReplay replay = replayStep(r, threads);
    EXPECT_TRUE(replay.differences.empty()) << replay.differences.front();
  }
  // Each of them matters: without it the answer is another.
  const auto differs = [&r](const std::function<void(StepRecording&)>& change) {
    StepRecording changed = r;
    change(changed);
    return !replayStep(changed).differences.empty();
  };
  EXPECT_TRUE(differs([](StepRecording& c) { c.step.bodies[0].radius_m = share(std::vector<double>(20, 0.05)); }));
  EXPECT_TRUE(differs([](StepRecording& c) { c.step.bodies[2].separations.clear(); }));
  EXPECT_TRUE(differs([](StepRecording& c) {
    ReferenceFrame spread = *c.step.bodies[0].reference;
    for (Vec3& p : spread.positions) p *= 10;  // nothing is close in it, so nothing is left out
    c.step.bodies[0].reference = std::make_shared<const ReferenceFrame>(spread);
  }));
}

TEST(Recording, OfARungThatIsNoneAnyMoreSaysSo) {
  StepRecording r = recordScene();
  r.options.accuracy.rung = static_cast<Accuracy>(0);
  const std::vector<std::uint8_t> bytes = recordingBytes(r);
  try {
    readRecording(bytes.data(), bytes.size(), "FILE");
    FAIL() << "it was read";
  } catch (const RecordingError& error) {
    EXPECT_NE(std::string(error.what()).find("accuracy screen"), std::string::npos) << error.what();
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

TEST(StepReplay, PatchesAreRecordedAndMadeAgain) {
  MonitorOptions options;
  options.detector.patches = true;
  StepRecording r = recordScene(options);
  ASSERT_FALSE(r.answer.patches.empty());
  const std::vector<std::uint8_t> bytes = recordingBytes(r);
  StepRecording read = readRecording(bytes.data(), bytes.size(), "FILE");
  EXPECT_TRUE(read.options.patches);
  EXPECT_EQ(read.answer.patch_of, r.answer.patch_of);
  EXPECT_TRUE(replayStep(read).differences.empty());
  read.answer.patches.back().area_m2 = std::nextafter(read.answer.patches.back().area_m2, 1);
  EXPECT_EQ(replayStep(read).differences.size(), 1u);
}

constexpr std::size_t EFFECTS_SIZE = 8;  // of what version 6 added

TEST(StepRecording, EffectsThatAreOffAreKept) {
  StepRecording r = recordScene();
  r.options.off.add(Effect::OCTOMAP);
  r.options.off.add(Effect::PATCHES);
  std::vector<std::uint8_t> bytes = recordingBytes(r);
  const StepRecording read = readRecording(bytes.data(), bytes.size(), "FILE");
  EXPECT_TRUE(read.options == r.options);
  EXPECT_FALSE(read.options == recordScene().options);
  bytes.back() = 0x80;
  EXPECT_NE(errorOf(bytes).find("an effect is off that this program does not know"), std::string::npos);
}

TEST(StepRecording, InAFileOfTheVersionBeforeEffectsNoneIsOff) {
  StepRecording r = recordScene();
  r.options.off.add(Effect::PATCHES);
  std::vector<std::uint8_t> bytes = recordingBytes(r);
  bytes[8] = 5;
  bytes.resize(bytes.size() - EFFECTS_SIZE);
  const StepRecording read = readRecording(bytes.data(), bytes.size(), "FILE");
  EXPECT_EQ(read.version, 5u);
  EXPECT_TRUE(read.options.off == EffectSet());
  EXPECT_TRUE(replayStep(read).differences.empty());
}

constexpr std::size_t PATCHES_SIZE = 17;  // of a recording without any: a flag and two empty lists

TEST(StepRecording, AFileOfTheVersionBeforePatchesIsRead) {
  std::vector<std::uint8_t> bytes = recordingBytes(recordScene());
  bytes[8] = 4;
  bytes.resize(bytes.size() - EFFECTS_SIZE - PATCHES_SIZE);
  const StepRecording read = readRecording(bytes.data(), bytes.size(), "FILE");
  EXPECT_EQ(read.version, 4u);
  EXPECT_FALSE(read.options.patches);
  EXPECT_TRUE(replayStep(read).differences.empty());
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
  r.answer = Outcome();
  r.has_answer = false;
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

MonitorOptions expecting() {
  MonitorOptions options = with(Accuracy::EXACT);
  options.detector.expected = {
      {{ExpectedPartner{0, {0, 1, 2, 3, 4, 5, 6, 7}, "hem"}, ExpectedPartner{OBSTACLE_BODY, {}, ""}}, "carry"},
      {{ExpectedPartner{0, {}, ""}, ExpectedPartner{2, {}, ""}}, ""}};
  return options;
}

TEST(StepRecording, WhatIsExpectedIsKeptAndReplayed) {
  const StepRecording r = recordScene(expecting());
  ASSERT_GT(r.answer.counts.expected, 0u);
  const std::vector<std::uint8_t> bytes = recordingBytes(r);
  StepRecording again = readRecording(bytes.data(), bytes.size(), "FILE");
  EXPECT_EQ(recordingBytes(again), bytes);
  EXPECT_EQ(again.options.expected, r.options.expected);
  EXPECT_EQ(again.answer.expected, r.answer.expected);
  EXPECT_TRUE(replayStep(again).differences.empty());
  again.options.expected.pop_back();
  EXPECT_FALSE(replayStep(again).differences.empty()) << "a mark is part of the answer";
}

std::size_t expectedBytes(const Outcome& answer) {  // what version 4 added, where nothing is expected
  return 8 + answer.contacts.size() + answer.intersections.size() + 8 + 8;
}

TEST(StepReplay, PatchesOfExpectedContactsAreMadeAgain) {
  MonitorOptions options = expecting();
  options.detector.patches = true;
  const std::vector<std::uint8_t> bytes = recordingBytes(recordScene(options));
  StepRecording read = readRecording(bytes.data(), bytes.size(), "FILE");
  const auto expected = std::find_if(read.answer.patches.begin(), read.answer.patches.end(),
                                     [](const Patch& patch) { return patch.expected > 0; });
  ASSERT_NE(expected, read.answer.patches.end());
  EXPECT_TRUE(replayStep(read).differences.empty());
  --expected->expected;
  EXPECT_EQ(replayStep(read).differences.size(), 1u);
}

/// The file of version 3 is that of version 4 without its end.
TEST(StepRecording, AFileWithoutExpectedContactsIsReadAndReplayed) {
  const StepRecording r = recordScene();
  std::vector<std::uint8_t> bytes = recordingBytes(r);
  bytes.resize(bytes.size() - EFFECTS_SIZE - PATCHES_SIZE - expectedBytes(r.answer));
  bytes[8] = 3;
  const StepRecording old = readRecording(bytes.data(), bytes.size(), "FILE");
  EXPECT_EQ(old.version, 3u);
  EXPECT_TRUE(old.options.expected.empty());
  EXPECT_EQ(old.answer.contacts.size(), r.answer.contacts.size());
  EXPECT_TRUE(replayStep(old).differences.empty());
}

std::size_t textBytes(const std::string& text) { return 4 + text.size(); }

std::size_t verdictBytes(const StepRecording& r) {  // what version 3 added
  std::size_t size = 8 + 8 + 1 + textBytes(r.step.off_path) + 1;
  for (const Body& body : r.step.bodies) size += 1 + sizeof body.dropped_faces;
  for (const auto* sentences : {&r.answer.unproved, &r.answer.excluded}) {
    size += 8;
    for (const std::string& sentence : *sentences) size += textBytes(sentence);
  }
  return size;
}

std::size_t distanceBytes(const StepRecording& r) {  // what version 2 added, where there are none
  return r.step.bodies.size() * (8 + 8 + 1);
}

/// A file as version 2 wrote it, whose flag `clear` stood for the verdict.
std::vector<std::uint8_t> bytesOfVersion2(const StepRecording& r) {
  std::vector<std::uint8_t> bytes = recordingBytes(r);
  bytes.resize(bytes.size() - EFFECTS_SIZE - PATCHES_SIZE - expectedBytes(r.answer) - verdictBytes(r));
  bytes[8] = 2;
  return bytes;
}

TEST(StepRecording, AFileOfVersion2IsReadAndReplayedWithItsDistances) {
  const StepRecording r = recordScene(with(Accuracy::CONSERVATIVE), true, true);
  const std::vector<std::uint8_t> bytes = bytesOfVersion2(r);
  const StepRecording old = readRecording(bytes.data(), bytes.size(), "FILE");
  EXPECT_EQ(old.version, 2u);
  EXPECT_EQ(old.step.bodies[2].separations.size(), 1u);
  EXPECT_EQ(*old.step.bodies[0].radius_m, *r.step.bodies[0].radius_m);
  ASSERT_TRUE(old.step.bodies[0].reference);
  EXPECT_EQ(old.step.bodies[0].reference->positions, r.step.bodies[0].reference->positions);
  EXPECT_EQ(old.answer.contacts.size(), r.answer.contacts.size());
  EXPECT_TRUE(replayStep(old).differences.empty());
}

TEST(StepRecording, AFileOfVersion1IsReadAndReplayed) {
  const StepRecording r = recordScene();
  std::vector<std::uint8_t> bytes = bytesOfVersion2(r);
  bytes.resize(bytes.size() - distanceBytes(r));
  bytes[8] = 1;
  // Before the start state, the counts, the contacts of 50 bytes and the crossings of 24.
  const std::size_t clear = bytes.size() - 1 -
                            (1 + 8 + 8 + sizeof r.answer.excluded_voxels + 8 + 8 + 8 + 8 +
                             50 * r.answer.contacts.size() + 8 + 24 * r.answer.intersections.size());
  for (const std::uint8_t was_clear : {0, 1}) {
    bytes[clear] = was_clear;
    const StepRecording old = readRecording(bytes.data(), bytes.size(), "FILE");
    EXPECT_EQ(old.version, 1u);
    EXPECT_EQ(old.answer.contacts.size(), r.answer.contacts.size());
    EXPECT_TRUE(replayStep(old).differences.empty()) << "the flag is read and stands for nothing any more";
  }
  bytes[clear] = 2;
  EXPECT_NE(errorOf(bytes).find("byte " + std::to_string(clear + 1) + ": a flag is 2"), std::string::npos)
      << "that byte is the flag: " << errorOf(bytes);
}

/// Files of versions 1, 2, 5 and 6 as programs of that time wrote them; one that is refused early is no seed for a
/// fuzzer.
TEST(StepRecording, TheSeedsOfTheFuzzerAreRead) {
  std::set<std::uint32_t> versions;
  for (const auto& seed : fs::directory_iterator(DEFORMABLE_CCD_SOURCE_DIR "/test/fuzz/corpus/recording")) {
    try {
      const StepRecording r = readRecordingFile(seed.path());
      versions.insert(r.version);
      if (!r.step.bodies.empty()) EXPECT_NO_THROW(replayStep(r)) << seed.path();
    } catch (const RecordingError& error) {
      EXPECT_EQ(seed.path().filename(), "screen_without_answer") << error.what();
    }
  }
  EXPECT_EQ(versions, (std::set<std::uint32_t>{1, 2, 5, 6}));
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
  r.step.stamp_ns = r.step.start_ns;
  EXPECT_NE(errorOf(recordingBytes(r)).find("the step lasts"), std::string::npos);
  r = recordScene();
  r.step.bodies[0].t1 = share(Positions(19, Vec3::Zero()));
  EXPECT_NE(errorOf(recordingBytes(r)).find("20 vertices at t=0 and 19 at t=1"), std::string::npos);
  r = recordScene();
  r.step.bodies[0].t0 = r.step.bodies[0].t1 = share(Positions(3, Vec3::Zero()));
  EXPECT_NE(errorOf(recordingBytes(r)).find("body 'cloth'"), std::string::npos)
      << "faces name vertices that are not there";
  r = recordScene();
  r.step.bodies[1].pose_t0.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(errorOf(recordingBytes(r)).find("pose"), std::string::npos);
}

TEST(StepReplay, ImpossibleOptionsAreRefused) {
  StepRecording r = recordScene();
  r.options.max_substeps = 0;
  EXPECT_THROW(replayStep(r), std::invalid_argument);
  r = recordScene();
  r.step.bodies.clear();
  EXPECT_THROW(replayStep(r), std::invalid_argument);
  r = recordScene();
  r.options.accuracy.toc_bits = 99;
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

}  // namespace
}  // namespace test
}  // namespace dccd
