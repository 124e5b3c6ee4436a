#include "input/watched_queue.h"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include <ros/message_deserializer.h>
#include <ros/subscription_callback_helper.h>
#include <ros/subscription_queue.h>
#include <std_msgs/Int32.h>
#include <boost/make_shared.hpp>

namespace dccd {
namespace {

constexpr std::uint32_t ROOM = 4;

/// A subscription as roscpp has it, without a master: its own queue, in which messages are numbers.
class Topic {
 public:
  Topic(const std::string& name, WatchedQueue& callbacks)
      : callbacks_(callbacks),
        queue_(boost::make_shared<ros::SubscriptionQueue>(name, ROOM, false)),
        helper_(boost::make_shared<ros::SubscriptionCallbackHelperT<const std_msgs::Int32::ConstPtr&>>(
            [this](const std_msgs::Int32::ConstPtr& message) { take(message->data); })) {}

  /// As ros::Subscription::handleMessage().
  void come() {
    const auto message = boost::make_shared<std_msgs::Int32>();
    message->data = came_++;
    bool was_full = false;
    const ros::SerializedMessage object(ros::serialization::serializeMessage(*message));
    queue_->push(helper_,
                 boost::make_shared<ros::MessageDeserializer>(helper_, object, boost::shared_ptr<ros::M_string>()),
                 false, ros::VoidConstWPtr(), false, ros::Time(), &was_full);
    dropped_ += was_full;
    if (!was_full) callbacks_.addCallback(queue_, reinterpret_cast<std::uint64_t>(this));
  }

  int dropped() const { return dropped_; }
  int taken() const { return taken_; }
  int lacking() const { return lacking_; }

  /// What comes while the callback runs, before and after it looks.
  int before_look = 0, after_look = 0;

 private:
  WatchedQueue& callbacks_;
  boost::shared_ptr<ros::SubscriptionQueue> queue_;
  ros::SubscriptionCallbackHelperPtr helper_;
  DropWatch watch_;
  int came_ = 0, last_ = -1, dropped_ = 0, taken_ = 0, lacking_ = 0;

  void take(int number) {
    for (; before_look > 0; --before_look) come();
    const bool may_lack = watch_.mayLack(callbacks_);
    EXPECT_TRUE(may_lack || number == last_ + 1) << number << " follows " << last_;
    lacking_ += may_lack;
    last_ = number;
    ++taken_;
    for (; after_look > 0; --after_look) come();
  }
};

struct WatchedQueueTest : testing::Test {
  static void SetUpTestSuite() { ros::Time::init(); }
};

TEST_F(WatchedQueueTest, WhatIsTakenInTimeLacksNothing) {
  WatchedQueue callbacks(ROOM);
  Topic topic("/tf", callbacks);
  for (int k = 0; k < 100; ++k) {
    for (std::uint32_t i = 1; i < ROOM; ++i) topic.come();
    while (callbacks.callOne() == ros::CallbackQueue::Called) {
    }
  }
  EXPECT_EQ(topic.taken(), 300);
  EXPECT_EQ(topic.lacking(), 0);
}

// Two cameras that send at the same time are two subscriptions, each with room of its own.
TEST_F(WatchedQueueTest, WhatWaitsOfAnotherTopicTakesNoRoom) {
  WatchedQueue callbacks(ROOM);
  Topic one("/left", callbacks), other("/right", callbacks);
  for (std::uint32_t i = 1; i < ROOM; ++i) one.come(), other.come();
  while (callbacks.callOne() == ros::CallbackQueue::Called) {
  }
  EXPECT_EQ(one.lacking() + other.lacking(), 0);
}

// A message that follows a dropped one is told of, however many come when: before a callback, or while it runs.
TEST_F(WatchedQueueTest, WhatFollowsADroppedOneLacksIt) {
  std::mt19937 random(7);
  int dropped = 0, lacking = 0, taken = 0;
  for (int run = 0; run < 2000; ++run) {
    WatchedQueue callbacks(ROOM);
    Topic topic("/tf", callbacks), other("/mesh", callbacks);
    for (int k = 0; k < 30; ++k) {
      Topic& one = random() % 4 == 0 ? other : topic;
      for (auto n = random() % (ROOM + 2); n > 0; --n) one.come();
      for (int* some : {&one.before_look, &one.after_look}) {
        *some = random() % 3 == 0 ? static_cast<int>(random() % (ROOM + 3)) : 0;
      }
      for (auto n = random() % (ROOM + 2); n > 0; --n) callbacks.callOne();
    }
    while (callbacks.callOne() == ros::CallbackQueue::Called) {
    }
    dropped += topic.dropped() + other.dropped();
    lacking += topic.lacking() + other.lacking();
    taken += topic.taken() + other.taken();
  }
  EXPECT_GT(dropped, 1000);
  EXPECT_LT(lacking, taken) << "it is not said of each";
}

}  // namespace
}  // namespace dccd
