#include "input/mesh_subscription.h"

#include <algorithm>
#include <cstddef>
#include <type_traits>
#include <utility>

#include <ros/subscribe_options.h>
#include <ros/this_node.h>

#include "input/known_types.h"

namespace dccd {

namespace {

using topic_tools::ShapeShifter;

constexpr std::uint32_t SUBSCRIBER_QUEUE = 256;
// The bytes of what was handed over follow within a moment; when they do not, a queue was full and they will not come.
const ros::WallDuration MAX_OVERLAP(1.0);

/// Whether the bytes are this message. The header's sequence number is set when bytes are sent, and does not count.
bool isSame(const ShapeShifter& bytes, const TypedMesh& mesh) {
  return std::visit(
      [&](const auto& message) {
        using Message = std::remove_const_t<std::remove_reference_t<decltype(*message)>>;
        const std::uint32_t size = ros::serialization::serializationLength(*message);
        if (bytes.getDataType() != ros::message_traits::datatype<Message>() || size != bytes.size()) return false;
        std::vector<std::uint8_t> a(size), b(size);
        ros::serialization::OStream a_stream(a.data(), size), b_stream(b.data(), size);
        bytes.write(a_stream);
        ros::serialization::serialize(b_stream, *message);
        const std::size_t skipped = ros::message_traits::hasHeader<Message>() ? 4 : 0;
        return std::equal(a.begin() + static_cast<std::ptrdiff_t>(skipped), a.end(),
                          b.begin() + static_cast<std::ptrdiff_t>(skipped));
      },
      mesh);
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
    narrow(message->getDataType());
    last_bytes_ = message;
  }
  callback_(message);
}

/// What is handed over comes at once, and overtakes the bytes of messages before it that are still on their way; until
/// the first subscription is closed, every message comes both ways. So the first objects are held back until the bytes
/// have caught up with them. A message that was on its way when the second subscription was made comes through that one
/// as bytes, too, right behind itself and perhaps behind objects that overtook it.
void MeshSubscription::onTyped(TypedMesh message) {
  if (!any_) return callback_(std::move(message));
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
  for (TypedMesh& message : held_) callback_(std::move(message));
  held_.clear();
}

template <typename Message>
void MeshSubscription::narrowIf(const std::string& datatype) {
  if (datatype != ros::message_traits::datatype<Message>()) return;
  typed_ = node_.subscribe<Message>(
      topic_, SUBSCRIBER_QUEUE, [this](const boost::shared_ptr<const Message>& message) { onTyped(message); },
      ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
}

void MeshSubscription::narrow(const std::string& datatype) {
  narrowed_at_ = ros::SteadyTime::now();
  narrowIf<deformable_ccd::MeshStamped>(datatype);
  narrowIf<sensor_msgs::PointCloud2>(datatype);
  narrowIf<pcl_msgs::PolygonMesh>(datatype);
  narrowIf<visualization_msgs::Marker>(datatype);
  narrowIf<visualization_msgs::MarkerArray>(datatype);
  narrowIf<shape_msgs::Mesh>(datatype);
}

void MeshSubscription::renew() {
  if (any_ && !held_.empty() && ros::SteadyTime::now() - narrowed_at_ > MAX_OVERLAP) closeAny();
  const std::uint32_t publishers = any_ ? any_.getNumPublishers() : typed_.getNumPublishers();
  has_type_ = has_type_ || publishers > 0;
  if (has_type_ && publishers == 0) openToAnyType();
  publishers_ = publishers;
}

}  // namespace dccd
