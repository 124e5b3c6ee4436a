#include "ros/input_queue.h"

#include <gtest/gtest.h>

namespace deformable_ccd {
namespace {

/// Receipt times of what is left of four messages in a queue for two.
std::vector<StampNs> leftOfFour(QueuePolicy policy) {
  InputQueue queue(2, 2, policy);
  for (StampNs time = 1; time <= 4; ++time) {
    QueuedMessage message;
    message.receipt_ns = time;
    queue.push(1, std::move(message));
  }
  EXPECT_EQ(queue.size(1), 2u);
  EXPECT_EQ(queue.takeDropped(), (std::vector<std::uint64_t>{0, 2}));
  EXPECT_EQ(queue.takeDropped(), (std::vector<std::uint64_t>{0, 0})) << "each is counted once";
  std::vector<StampNs> left;
  for (QueuedMessage message; queue.pop(1, message);) left.push_back(message.receipt_ns);
  EXPECT_EQ(queue.size(0), 0u) << "the other body's queue is its own";
  return left;
}

TEST(InputQueue, NewestKeepsTheLast) { EXPECT_EQ(leftOfFour(QueuePolicy::NEWEST), (std::vector<StampNs>{3, 4})); }

TEST(InputQueue, OldestKeepsTheFirst) { EXPECT_EQ(leftOfFour(QueuePolicy::OLDEST), (std::vector<StampNs>{1, 2})); }

TEST(InputQueue, ClearSaysWhatItDropped) {
  InputQueue queue(2, 3, QueuePolicy::NEWEST);
  queue.push(0, {});
  queue.push(0, {});
  EXPECT_EQ(queue.clear(), (std::vector<std::uint64_t>{2, 0}));
  EXPECT_EQ(queue.takeDropped(), (std::vector<std::uint64_t>{0, 0})) << "what was cleared was not too much";
  QueuedMessage message;
  EXPECT_FALSE(queue.pop(0, message));
}

}  // namespace
}  // namespace deformable_ccd
