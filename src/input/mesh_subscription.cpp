#include "input/mesh_subscription.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include <ros/subscribe_options.h>
#include <ros/this_node.h>

#include "ros/message_bytes.h"

namespace dccd {

namespace {

using topic_tools::ShapeShifter;

constexpr std::uint32_t SUBSCRIBER_QUEUE = 256;
// The bytes of what was handed over follow within a moment; when they do not, a queue was full and they will not come.
const ros::WallDuration MAX_OVERLAP(1.0);

/// Whether the bytes are this message. The header's sequence number is set when bytes are sent, and does not count.
bool isSame(const ShapeShifter& bytes, const TypedMesh& mesh) {
  if (bytes.getDataType() != mesh.type->datatype) return false;
  const std::vector<std::uint8_t> a = bytesOf(bytes), b = mesh.type->serialize(mesh.message.get());
  const std::ptrdiff_t skipped = mesh.type->leads_with_header ? 4 : 0;
  return a.size() == b.size() && std::equal(a.begin() + skipped, a.end(), b.begin() + skipped);
}

}  // namespace

MeshSubscription::MeshSubscription(const ros::NodeHandle& node, std::string topic, Callback callback)
    : node_(node), topic_(std::move(topic)), callback_(std::move(callback)) {
  openToAnyType();
}

void MeshSubscription::openToAnyType() {
  closeAny();
  typed_.shutdown();
  has_type_ = false;
  ros::SubscribeOptions options;
  options.initByFullCallbackType<const ros::MessageEvent<const ShapeShifter>&>(
      topic_, SUBSCRIBER_QUEUE, [this](const ros::MessageEvent<const ShapeShifter>& event) { onAny(event); });
  options.transport_hints = ros::TransportHints().tcpNoDelay();
  any_ = node_.subscribe(options);
}

void MeshSubscription::onAny(const ros::MessageEvent<const ShapeShifter>& event) {
  const ShapeShifter::ConstPtr message = event.getConstMessage();
  has_type_ = true;  // the publisher may come and go between two calls of renew()
  if (typed_) {
    if (!held_.empty() && isSame(*message, held_.front())) return closeAny();
    last_bytes_ = message;
  } else if (event.getPublisherName() == ros::this_node::getName() &&
             meshTypeProblem(message->getDataType(), message->getMD5Sum()).empty()) {
    narrowTo(*findMeshType(message->getDataType()));
    last_bytes_ = message;
  }
  deliver(*message);
}

/// What is handed over comes at once, and overtakes the bytes of messages before it that are still on their way; until
/// the first subscription is closed, every message comes both ways. So the first objects are held back until the bytes
/// have caught up with them. A message that was on its way when the second subscription was made comes through that one
/// as bytes, too, right behind itself and perhaps behind objects that overtook it.
void MeshSubscription::onTyped(TypedMesh message) {
  if (!any_) return deliver(std::move(message));
  if (last_bytes_ && isSame(*last_bytes_, message)) {  // came as bytes already
    if (held_.empty()) closeAny();
    return;
  }
  held_.push_back(std::move(message));
  if (held_.size() >= SUBSCRIBER_QUEUE) closeAny();
}

void MeshSubscription::closeAny() {
  any_.shutdown();
  last_bytes_.reset();
  for (TypedMesh& message : held_) deliver(std::move(message));
  held_.clear();
}

void MeshSubscription::deliver(const ShapeShifter& bytes) {
  MeshMessage message;
  message.datatype = bytes.getDataType();
  message.md5 = bytes.getMD5Sum();
  message.bytes = bytesOf(bytes);
  callback_(std::move(message));
}

void MeshSubscription::deliver(TypedMesh object) {
  MeshMessage message;
  message.datatype = object.type->datatype;
  message.object = std::move(object);
  callback_(std::move(message));
}

void MeshSubscription::narrowTo(const MeshType& type) {
  narrowed_at_ = ros::SteadyTime::now();
  ros::SubscribeOptions options(topic_, SUBSCRIBER_QUEUE, type.md5, type.datatype);
  options.helper = type.callbackHelper(type, [this](TypedMesh message) { onTyped(std::move(message)); });
  options.transport_hints = ros::TransportHints().tcpNoDelay();
  typed_ = node_.subscribe(options);
}

void MeshSubscription::renew() {
  if (any_ && !held_.empty() && ros::SteadyTime::now() - narrowed_at_ > MAX_OVERLAP) closeAny();
  const std::uint32_t publishers = any_ ? any_.getNumPublishers() : typed_.getNumPublishers();
  has_type_ = has_type_ || publishers > 0;
  if (has_type_ && publishers == 0) openToAnyType();
  publishers_ = publishers;
}

}  // namespace dccd
