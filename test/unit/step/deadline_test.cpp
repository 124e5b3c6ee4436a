#include "dccd/types.h"

#include <gtest/gtest.h>

#include <limits>

namespace dccd {
namespace {

TEST(Deadline, NoTimeIsNever) {
  for (const double ms : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_TRUE(Deadline::after(ms).isNever()) << ms;
    EXPECT_FALSE(Deadline::after(ms).isOver()) << ms;
    EXPECT_FALSE(Deadline::after(ms).canEnd()) << ms;
  }
}

/// Whoever asks for more time than the clock can count has it.
TEST(Deadline, AllTheTimeInTheWorldIsNotOver) {
  for (const double ms :
       {1e3, 1e9, 1e12, 1e13, 1e300, std::numeric_limits<double>::max(), std::numeric_limits<double>::infinity()}) {
    EXPECT_FALSE(Deadline::after(ms).isOver()) << ms;
  }
  EXPECT_FALSE(Deadline::after(1e12).isNever()) << "the most that options may ask for is a time";
  EXPECT_TRUE(Deadline::after(1e-6).movedBy(std::chrono::seconds(-1)).isOver());
}

TEST(Deadline, AFlagEndsItAndStaysWhereTheTimeIsMoved) {
  std::atomic<bool> cancelled{false};
  for (const Deadline& deadline : {Deadline().orWhen(cancelled), Deadline::after(1e6).orWhen(cancelled)}) {
    EXPECT_TRUE(deadline.canEnd());
    const Deadline later = deadline.movedBy(std::chrono::hours(1));
    EXPECT_EQ(later.isNever(), deadline.isNever()) << "a time that is not set stays so";
    cancelled = false;
    EXPECT_FALSE(deadline.isOver());
    EXPECT_FALSE(later.isOver());
    cancelled = true;
    EXPECT_TRUE(deadline.isOver());
    EXPECT_TRUE(later.isOver());
  }
}

}  // namespace
}  // namespace dccd
