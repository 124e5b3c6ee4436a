// One body's topic, of whatever type its publisher has.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include <ros/node_handle.h>
#include <ros/subscribe_options.h>
#include <ros/subscriber.h>

#include "input/mesh_message.h"
#include "input/raw_message.h"

namespace dccd {

/// A subscription that is open to any type: messages come as bytes, which are checked in place before anything is
/// allocated for them. Or one to objects of a named type, which those of publishers in this process (nodelets beside
/// this one) are as they come: neither serialised nor copied. Its callbacks belong to the one thread that serves the
/// handle's callback queue; renew() to another, for it calls the master, which may hang.
///
/// roscpp gives a subscription the type of the first publisher that connects, for good, whether that ever says anything
/// or not, and connects to no publisher of another type; one that was killed stays connected to, as it were. So where
/// nothing comes, one of any type subscribes anew:
/// - when the last publisher has gone;
/// - when messages have come before and the master names another type now: that of who registered last;
/// - when none has come yet and there are publishers that are not connected: with one type after the other.
class MeshSubscription {
 public:
  /// Hears the number of each message, before anything of it is taken.
  using Came = std::function<void(std::uint64_t number)>;
  /// Gets each message with its number, its times of receipt and arrival unset.
  using Callback = std::function<void(MeshMessage)>;

  /// Subscribes to `topic` at once. `objects_of`: the type that is named; null: any.
  MeshSubscription(const ros::NodeHandle& node, std::string topic, const MeshType* objects_of, Came came,
                   Callback callback);
  ~MeshSubscription();
  MeshSubscription(const MeshSubscription&) = delete;
  MeshSubscription& operator=(const MeshSubscription&) = delete;

  /// Counts publishers. True: renew() is worth the question to the master; at most twice a second, and five times
  /// where the last publisher has gone. To be called now and then, from the thread of renew().
  bool wantsRenewal();
  /// `published`: what the master says, datatypes by topic. Subscribes anew where that is of use.
  void renew(const std::map<std::string, std::string>& published);
  /// Messages so far, those that were lost among them. From any thread.
  std::uint64_t came() const { return *came_; }
  /// As of the last wantsRenewal(). From any thread.
  std::uint32_t getNumPublishers() const { return publishers_; }

 private:
  ros::NodeHandle node_;
  std::string topic_;  // resolved
  const MeshType* objects_of_;
  Came on_number_;
  Callback callback_;
  std::atomic<std::uint32_t> publishers_{0};
  std::atomic<std::int64_t> last_message_ns_;
  const MessageCount came_ = std::make_shared<std::atomic<std::uint64_t>>(0);
  std::mutex mutex_;  // of all up to the next blank line; held over no call that waits for the master or a callback
  ros::Subscriber subscriber_;
  bool has_type_ = false;   // a publisher was there since the topic was opened
  std::string heard_type_;  // datatype of the messages since then; empty: there was none

  // Of the thread that renews.
  std::string acted_on_;  // what the master said when it was last acted on
  std::size_t attempts_ = 0;
  std::int64_t next_look_ns_ = 0, next_attempt_ns_ = 0;

  /// As bytes. Null: of any type.
  void open(const MeshType* type);
  void openToObjects();
  void subscribe(ros::SubscribeOptions& options);
  void close();
  void attempt(const std::string& published_type);
  void heard(const std::string& type);
  void onBytes(const ros::MessageEvent<RawMessage>& event);
  void onObject(const TypedMesh& object);
};

/// For every callback of a topic: nothing may get out of one, or the thread would end, and the process with it.
void tellLost(const std::string& topic, const std::exception& error);

}  // namespace dccd
