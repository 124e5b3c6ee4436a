// Recordings of earlier versions are read and replayed; what they do not have is as it was then.
#include <gtest/gtest.h>

#include <filesystem>
#include <set>

#include "record/step_replay.h"
#include "support/recordings.h"
#include "unit/record/recording_support.h"

namespace dccd {
namespace test {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t EFFECTS_SIZE = 8;  // of what version 6 added

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

std::size_t expectedBytes(const Outcome& answer) {  // what version 4 added, where nothing is expected
  return 8 + answer.contacts.size() + answer.intersections.size() + 8 + 8;
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

}  // namespace
}  // namespace test
}  // namespace dccd
