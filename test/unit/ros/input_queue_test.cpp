#include "node/input_queue.h"

#include <gtest/gtest.h>

#include <chrono>
#include <stdexcept>
#include <thread>

namespace dccd {
namespace {

/// Receipt times of what is left of four messages in a queue for two.
std::vector<StampNs> leftOfFour(QueuePolicy policy) {
  InputQueue queue(2, 2, policy);
  for (StampNs time = 1; time <= 4; ++time) {
    MeshMessage message;
    message.receipt_ns = time;
    queue.push(1, std::move(message));
  }
  EXPECT_EQ(queue.size(1), 2u);
  EXPECT_EQ(queue.takeDropped(), (std::vector<std::uint64_t>{0, 2}));
  EXPECT_EQ(queue.takeDropped(), (std::vector<std::uint64_t>{0, 0})) << "each is counted once";
  std::vector<StampNs> left;
  for (MeshMessage message; queue.pop(1, message);) left.push_back(message.receipt_ns);
  EXPECT_EQ(queue.size(0), 0u) << "the other body's queue is its own";
  return left;
}

TEST(InputQueue, NewestKeepsTheLast) { EXPECT_EQ(leftOfFour(QueuePolicy::NEWEST), (std::vector<StampNs>{3, 4})); }

TEST(InputQueue, OldestKeepsTheFirst) { EXPECT_EQ(leftOfFour(QueuePolicy::OLDEST), (std::vector<StampNs>{1, 2})); }

// What was left out by choice is told by what comes next; of what was lost only the numbers tell.
TEST(InputQueue, ThinSaysHowManyItLeftOut) {
  for (const QueuePolicy policy : {QueuePolicy::THIN, QueuePolicy::NEWEST, QueuePolicy::OLDEST}) {
    const bool thin = policy == QueuePolicy::THIN;
    for (const std::size_t capacity : {1, 2}) {
      InputQueue queue(1, capacity, policy);
      std::uint64_t thinned = 0, taken = 0;
      for (int k = 0; k < 9; ++k) {
        queue.push(0, {});
        MeshMessage message;
        if (k % 4 != 3) continue;
        while (queue.pop(0, message)) thinned += message.thinned, ++taken;
      }
      EXPECT_EQ(taken, 2 * capacity);
      EXPECT_EQ(thinned, thin ? 8 - taken : 0u);
      EXPECT_EQ(queue.takeDropped()[0], 8 - taken);
      MeshMessage last;
      ASSERT_TRUE(queue.pop(0, last));
      EXPECT_EQ(last.thinned, 0u) << "nothing was left out before it";
    }
  }
}

/// Bytes of what is left in two queues for 100 bytes in all, and how many were dropped of each.
TEST(InputQueue, BytesAreBoundedOverAllBodies) {
  const auto message = [](std::size_t bytes) {
    MeshMessage m;
    m.bytes.resize(bytes);
    return m;
  };
  for (const QueuePolicy policy : {QueuePolicy::NEWEST, QueuePolicy::OLDEST}) {
    InputQueue queue(2, 64, policy, 100);
    queue.push(0, message(40));
    for (const std::size_t bytes : {20, 30, 25}) queue.push(1, message(bytes));
    EXPECT_EQ(queue.size(0), 1u) << "nobody's messages make room for another body's";
    MeshMessage last, first;
    ASSERT_TRUE(queue.pop(1, first));
    ASSERT_TRUE(queue.pop(1, last));
    const bool newest = policy == QueuePolicy::NEWEST;
    EXPECT_EQ(first.bytes.size(), newest ? 30u : 20u);
    EXPECT_EQ(last.bytes.size(), newest ? 25u : 30u);
    EXPECT_EQ(queue.takeDropped(), (std::vector<std::uint64_t>{0, 1}));
    queue.push(1, message(61));
    EXPECT_EQ(queue.size(1), 0u) << "beside what the other body has there is no room for it";
    queue.clear();
    queue.push(1, message(100));
    EXPECT_EQ(queue.size(1), 1u) << "what was popped or cleared has left its room";
    EXPECT_EQ(queue.takeDropped(), (std::vector<std::uint64_t>{0, 1}));
    queue.push(1, message(101));
    ASSERT_TRUE(queue.pop(1, first));
    ASSERT_TRUE(queue.pop(1, last)) << "what never finds room keeps its turn, to be refused in words";
    EXPECT_EQ(last.too_large, 101u);
    EXPECT_TRUE(last.bytes.empty());
  }
}

TEST(InputQueue, ClearSaysWhatItDropped) {
  InputQueue queue(2, 3, QueuePolicy::NEWEST);
  queue.push(0, {});
  queue.push(0, {});
  EXPECT_EQ(queue.clear(), (std::vector<std::uint64_t>{2, 0}));
  EXPECT_EQ(queue.takeDropped(), (std::vector<std::uint64_t>{0, 0})) << "what was cleared was not too much";
  MeshMessage message;
  EXPECT_FALSE(queue.pop(0, message));
}

TEST(InputQueue, ClearSparesWhatItIsTold) {
  InputQueue queue(3, 3, QueuePolicy::NEWEST);
  for (std::size_t body = 0; body < 3; ++body) queue.push(body, {});
  EXPECT_EQ(queue.clear({false, true, false}), (std::vector<std::uint64_t>{1, 0, 1}));
  EXPECT_EQ(queue.size(0) + queue.size(2), 0u);
  EXPECT_EQ(queue.size(1), 1u);
}

/// Runs what is queued, as the worker does.
void serve(InputQueue& queue) {
  for (const auto& command : queue.wait(std::chrono::seconds(10))) command();
}

TEST(InputQueue, ACallIsAnsweredByTheWorkerAlsoWhenItThrows) {
  InputQueue queue(1, 1, QueuePolicy::NEWEST);
  std::thread worker([&] {
    serve(queue);
    serve(queue);
  });
  const Reply good = queue.call([] { return Reply{true, "done"}; }, 10);
  EXPECT_TRUE(good.success);
  EXPECT_EQ(good.message, "done");
  const Reply bad = queue.call([]() -> Reply { throw std::invalid_argument("vertex 500"); }, 10);
  EXPECT_FALSE(bad.success);
  EXPECT_EQ(bad.message, "vertex 500");
  worker.join();
}

TEST(InputQueue, ACallThatTimesOutIsDoneLaterAndSaysSo) {
  InputQueue queue(1, 1, QueuePolicy::NEWEST);
  bool done = false;
  const Reply reply = queue.call(
      [&] {
        done = true;
        return Reply{true, "done"};
      },
      0.01);
  EXPECT_FALSE(reply.success);
  EXPECT_NE(reply.message.find("will be done"), std::string::npos) << reply.message;
  EXPECT_FALSE(done);
  serve(queue);
  EXPECT_TRUE(done);
}

TEST(InputQueue, ClosingEndsCallsAtOnce) {
  InputQueue queue(1, 1, QueuePolicy::NEWEST);
  Reply reply{true, ""};
  const auto start = std::chrono::steady_clock::now();
  std::thread caller([&] { reply = queue.call([] { return Reply{true, "done"}; }, 30); });
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  queue.close();
  caller.join();
  EXPECT_FALSE(reply.success);
  EXPECT_NE(reply.message.find("stopped"), std::string::npos) << reply.message;
  EXPECT_FALSE(queue.call([] { return Reply{true, "done"}; }, 30).success) << "nor does a later one wait";
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
}

}  // namespace
}  // namespace dccd
