// One body's topic, of whatever type its publisher has.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
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
/// checked in place before anything is allocated for them. Its calls and callbacks belong to the one thread that serves
/// the handle's callback queue.
class MeshSubscription {
 public:
  /// Gets each message, its times of receipt and arrival unset.
  using Callback = std::function<void(MeshMessage)>;

  /// Subscribes to `topic` at once.
  MeshSubscription(const ros::NodeHandle& node, std::string topic, Callback callback);
  MeshSubscription(const MeshSubscription&) = delete;
  MeshSubscription& operator=(const MeshSubscription&) = delete;

  /// A subscription takes on the type of its first publisher for good. When the last publisher is gone, this one opens
  /// to any type again. To be called now and then.
  void renew();
  /// As of the last renew(). From any thread.
  std::uint32_t getNumPublishers() const { return publishers_; }

 private:
  ros::NodeHandle node_;
  std::string topic_;
  Callback callback_;
  ros::Subscriber any_, typed_;
  std::atomic<std::uint32_t> publishers_{0};
  bool has_type_ = false;  // a publisher was there since the topic was opened to any type
  // While both subscriptions are open (see onTyped).
  topic_tools::ShapeShifter::ConstPtr last_bytes_;
  std::vector<TypedMesh> held_;
  ros::SteadyTime narrowed_at_;

  void openToAnyType();
  void onAny(const ros::MessageEvent<const topic_tools::ShapeShifter>& event);
  void onTyped(TypedMesh message);
  void narrowTo(const MeshType& type);
  void closeAny();
  void deliver(const topic_tools::ShapeShifter& bytes);
  void deliver(TypedMesh object);
};

}  // namespace dccd
