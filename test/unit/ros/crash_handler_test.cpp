#include "node/crash_handler.h"

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include <gtest/gtest.h>

#include "record/step_replay.h"
#include "support/folder_test.h"
#include "support/recordings.h"

namespace dccd {
namespace test {
namespace {

class CrashHandlerTest : public FolderTest {};

/// A process of its own that crashes in the middle of a step.
class CrashInStep : public StepListener {
 public:
  CrashInStep(FlightRecorder& recorder, int signal) : recorder_(recorder), signal_(signal) {}
  void onStep(const Step& step, const Options& options) override {
    recorder_.onStep(step, options);
    std::raise(signal_);
  }
  void onOutcome(const Outcome& outcome) override { recorder_.onOutcome(outcome); }

 private:
  FlightRecorder& recorder_;
  int signal_;
};

TEST_F(CrashHandlerTest, ACrashWritesTheStep) {
  for (const int signal : {SIGSEGV, SIGABRT, SIGFPE}) {
    const StepRecording expected = recordScene();
    RecordedScene scene;
    scene.nextFrames();
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      // As in a program without a sanitizer: its handlers would end the process in their own way.
      for (const int s : {SIGSEGV, SIGABRT, SIGFPE}) std::signal(s, SIG_DFL);
      FlightRecorder recorder(1, folder_, &crashImage());
      CrashInStep crash(recorder, signal);
      installCrashHandler(folder_);
      scene.monitor().setListener(&crash);
      scene.nextFrames();
      ::_exit(0);
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the crash goes on to be one";
    EXPECT_EQ(WTERMSIG(status), signal);
    const StepRecording r = readRecordingFile(folder_ / ("crash_" + std::to_string(child) + ".step"));
    EXPECT_FALSE(r.has_answer);
    EXPECT_EQ(r.step.sequence, expected.step.sequence);
    const StepReplay replay = replayStep(r);
    EXPECT_TRUE(compareAnswers(r.options, expected.answer, replay.answer).empty());
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
