#include "report/progress_bar.h"

#include <gtest/gtest.h>

#include <thread>

namespace dccd {
namespace {

using std::chrono::milliseconds;

// The tests' standard error is a file here; test/package/progress_test.py has a terminal.
std::string saidBy(std::size_t steps, milliseconds each, bool enabled, milliseconds line_every) {
  testing::internal::CaptureStderr();
  {
    ProgressBar progress("work", 4, enabled, line_every);
    for (std::size_t i = 0; i < steps; ++i) {
      std::this_thread::sleep_for(each);
      progress.advance();
    }
  }
  return testing::internal::GetCapturedStderr();
}

TEST(ProgressBar, WithoutATerminalALineNowAndThen) {
  EXPECT_EQ(saidBy(4, milliseconds(1), true, milliseconds(0)), "work: 25 %\nwork: 50 %\nwork: 75 %\nwork: 100 %\n");
  EXPECT_EQ(saidBy(4, milliseconds(1), true, std::chrono::hours(1)), "") << "short work says nothing";
  EXPECT_EQ(saidBy(4, milliseconds(1), false, milliseconds(0)), "");
}

TEST(ProgressBar, SaysWhatIsLeftByWhatWasDone) {
  const std::string said = saidBy(2, milliseconds(1100), true, milliseconds(0));
  EXPECT_NE(said.find("work: 25 %, about 0:00:03 left\n"), std::string::npos) << said;
  EXPECT_NE(said.find("work: 50 %, about 0:00:02 left\n"), std::string::npos) << said;
}

}  // namespace
}  // namespace dccd
