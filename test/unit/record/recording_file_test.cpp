// Recordings on the disk: a file is there as a whole or not at all.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <iterator>
#include <stdexcept>

#include "record/step_recording.h"
#include "support/folder_test.h"
#include "support/recordings.h"
#include "support/said.h"

namespace dccd {
namespace test {
namespace {

namespace fs = std::filesystem;

class RecordingFile : public FolderTest {};

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
  const std::string text = said<std::runtime_error>([&] { writeRecording(folder_ / "a.step", recordScene()); });
  EXPECT_NE(text.find("No space left"), std::string::npos) << text;
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(RecordingFile, AFolderThatIsNotThereIsNamed) {
  EXPECT_THROW(writeRecording(folder_ / "none" / "a.step", recordScene()), std::runtime_error);
  EXPECT_THROW(readRecordingFile(folder_ / "none.step"), RecordingError);
}

}  // namespace
}  // namespace test
}  // namespace dccd
