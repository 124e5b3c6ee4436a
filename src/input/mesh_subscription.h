// One body's topic, of whatever type its publisher has.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <topic_tools/shape_shifter.h>

#include "input/mesh_message.h"

namespace dccd {

/// A subscription that is open to any type until the first message. When that comes from a publisher in the same
/// process (a nodelet beside this one), it subscribes anew with the concrete type, so that the messages after it come
/// without being serialised; none is lost or doubled on the way. Messages of other processes stay bytes, which are
/// checked in place before anything is allocated for them. Its callbacks belong to the one thread that serves the
/// handle's callback queue; renew() to another, for it calls the master, which may hang.
///
/// roscpp gives a subscription the type of the first publisher that connects, for good, whether that ever says anything
/// or not, and connects to no publisher of another type; one that was killed stays connected to, as it were. So where
/// nothing comes, this subscribes anew:
/// - when the last publisher has gone;
/// - when messages have come before and the master names another type now: that of who registered last;
/// - when none has come yet and there are publishers that are not connected: with one type after the other.
class MeshSubscription {
 public:
  /// Gets each message with its number, its times of receipt and arrival unset.
  using Callback = std::function<void(MeshMessage)>;

  /// Subscribes to `topic` at once.
  MeshSubscription(const ros::NodeHandle& node, std::string topic, Callback callback);
  MeshSubscription(const MeshSubscription&) = delete;
  MeshSubscription& operator=(const MeshSubscription&) = delete;

  /// Counts publishers. True: renew() is worth the question to the master; at most twice a second, and five times
  /// where the last publisher has gone. To be called now and then, from the thread of renew().
  bool wantsRenewal();
  /// `published`: what the master says, datatypes by topic. Subscribes anew where that is of use.
  void renew(const std::map<std::string, std::string>& published);
  /// As of the last wantsRenewal(). From any thread.
  std::uint32_t getNumPublishers() const { return publishers_; }

 private:
  ros::NodeHandle node_;
  std::string topic_;  // resolved
  Callback callback_;
  std::atomic<std::uint32_t> publishers_{0};
  std::atomic<std::int64_t> last_message_ns_;
  std::atomic<std::uint64_t> came_{0};  // messages that were handed on, or lost
  std::mutex mutex_;  // of all up to the next blank line; held over no call that waits for the master or a callback
  ros::Subscriber any_, typed_;
  bool has_type_ = false;   // a publisher was there since the topic was opened
  std::string heard_type_;  // datatype of the messages since then; empty: there was none
  // While both subscriptions are open (see onTyped).
  topic_tools::ShapeShifter::ConstPtr last_bytes_;
  std::vector<TypedMesh> held_;
  ros::SteadyTime narrowed_at_;

  // Of the thread that renews.
  std::string acted_on_;  // what the master said when it was last acted on
  std::size_t attempts_ = 0;
  std::int64_t next_look_ns_ = 0, next_attempt_ns_ = 0;

  /// Null: of any type.
  void open(const MeshType* type);
  void close();
  void attempt(const std::string& published_type);
  void onAny(const ros::MessageEvent<const topic_tools::ShapeShifter>& event);
  void onTyped(TypedMesh message);
  void narrowTo(const MeshType& type);
  /// The mutex is held. What was held back is delivered; the subscription to be shut down when it is not held any more.
  ros::Subscriber endOverlap();
  void deliver(TypedMesh object);
};

/// For every callback of a topic: nothing may get out of one, or the thread would end, and the process with it.
void tellLost(const std::string& topic, const std::exception& error);

}  // namespace dccd
