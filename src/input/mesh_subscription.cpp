#include "input/mesh_subscription.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include <ros/console.h>
#include <ros/exceptions.h>
#include <ros/subscribe_options.h>
#include <ros/this_node.h>

#include "input/master_question.h"
#include "input/message_bytes.h"
#include "input/steady_clock.h"

namespace dccd {

namespace {

using topic_tools::ShapeShifter;

constexpr std::uint32_t SUBSCRIBER_QUEUE = 256;
// The bytes of what was handed over follow within a moment; when they do not, a queue was full and they will not come.
const ros::WallDuration MAX_OVERLAP(1.0);
// A topic that has been quiet so long may have lost its publisher. Asked about so often, and at once when the last
// publisher has gone.
constexpr std::int64_t SILENCE_NS = 1000000000, LOOK_NS = 500000000, LOST_LOOK_NS = 200000000;
// The pause between attempts doubles with each round of them, up to 32 s.
constexpr std::int64_t ATTEMPT_NS = 1000000000;
constexpr std::size_t MAX_DOUBLINGS = 5;
constexpr double MASTER_TIMEOUT_S = 0.5;

/// Whether the bytes are this message. The header's sequence number is set when bytes are sent, and does not count.
bool isSame(const ShapeShifter& bytes, const TypedMesh& mesh) {
  if (bytes.getDataType() != mesh.type->datatype) return false;
  const std::vector<std::uint8_t> a = bytesOf(bytes), b = mesh.type->serialize(mesh.message.get());
  const std::ptrdiff_t skipped = mesh.type->leads_with_header ? 4 : 0;
  return a.size() == b.size() && std::equal(a.begin() + skipped, a.end(), b.begin() + skipped);
}

}  // namespace

void tellLost(const std::string& topic, const std::exception& error) {
  ROS_WARN_STREAM_THROTTLE(5, topic << ": a message was lost: " << error.what());
}

MeshSubscription::MeshSubscription(const ros::NodeHandle& node, std::string topic, Callback callback)
    : node_(node), topic_(node_.resolveName(topic)), callback_(std::move(callback)), last_message_ns_(steadyNs()) {
  open(nullptr);
}

void MeshSubscription::close() {
  ros::Subscriber any, typed;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    any = endOverlap();
    typed = std::exchange(typed_, {});
    has_type_ = false;
    heard_type_.clear();
  }
  // These wait for a callback that runs, which may wait for the mutex.
  any.shutdown();
  typed.shutdown();
}

void MeshSubscription::open(const MeshType* type) {
  close();
  ros::SubscribeOptions options;
  options.initByFullCallbackType<const ros::MessageEvent<const ShapeShifter>&>(
      topic_, SUBSCRIBER_QUEUE, [this](const ros::MessageEvent<const ShapeShifter>& event) { onAny(event); });
  if (type) {
    options.md5sum = type->md5;
    options.datatype = type->datatype;
  }
  options.transport_hints = ros::TransportHints().tcpNoDelay();
  ros::Subscriber opened = node_.subscribe(options);
  const std::lock_guard<std::mutex> lock(mutex_);
  any_ = std::move(opened);
}

void MeshSubscription::onAny(const ros::MessageEvent<const ShapeShifter>& event) try {
  const ShapeShifter::ConstPtr bytes = event.getConstMessage();
  ros::Subscriber ended;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    last_message_ns_ = steadyNs();
    has_type_ = true;  // the publisher may come and go between two looks
    heard_type_ = bytes->getDataType();
    // Before any_ is known there is nothing to narrow: the first message may overtake open().
    if (!typed_ && any_ && event.getPublisherName() == ros::this_node::getName() &&
        meshTypeProblem(heard_type_, bytes->getMD5Sum()).empty()) {
      narrowTo(*findMeshType(heard_type_));
    }
    if (typed_ && !held_.empty() && isSame(*bytes, held_.front())) {
      ended = endOverlap();
    } else {
      if (typed_) last_bytes_ = bytes;
      MeshMessage message;
      message.datatype = heard_type_;
      message.md5 = bytes->getMD5Sum();
      const MeshType* type = findMeshType(heard_type_);
      if (type && message.md5 != type->md5) message.definition = bytes->getMessageDefinition();
      if (hasMemoryFor(bytes->size())) {
        message.bytes = bytesOf(*bytes);
      } else {
        message.no_memory = bytes->size();
      }
      message.number = ++came_;
      callback_(std::move(message));
    }
  }
  ended.shutdown();
} catch (const std::exception& error) {
  ++came_;
  tellLost(topic_, error);
}

/// Until the first subscription is closed, every message comes both ways: as an object at once, as bytes a little
/// later. An object thus overtakes the bytes of the messages before it. To keep the order, the first objects are held
/// back until their bytes have come. A message that was on its way as bytes when the second subscription was made comes
/// through both: what the second brings of it is dropped here, even behind objects that overtook it.
void MeshSubscription::onTyped(TypedMesh message) try {
  ros::Subscriber ended;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    last_message_ns_ = steadyNs();
    if (!any_) return deliver(std::move(message));
    if (last_bytes_ && isSame(*last_bytes_, message)) {  // came as bytes already
      if (held_.empty()) ended = endOverlap();
    } else {
      held_.push_back(std::move(message));
      if (held_.size() >= SUBSCRIBER_QUEUE) ended = endOverlap();
    }
  }
  ended.shutdown();
} catch (const std::exception& error) {
  ++came_;
  tellLost(topic_, error);
}

ros::Subscriber MeshSubscription::endOverlap() {
  last_bytes_.reset();
  for (TypedMesh& message : held_) deliver(std::move(message));
  held_.clear();
  return std::exchange(any_, {});
}

void MeshSubscription::deliver(TypedMesh object) {
  MeshMessage message;
  message.datatype = object.type->datatype;
  message.object = std::move(object);
  message.number = ++came_;
  callback_(std::move(message));
}

/// No question to the master: it joins the subscription that there is.
void MeshSubscription::narrowTo(const MeshType& type) {
  narrowed_at_ = ros::SteadyTime::now();
  ros::SubscribeOptions options(topic_, SUBSCRIBER_QUEUE, type.md5, type.datatype);
  options.helper = type.callbackHelper(type, [this](TypedMesh message) { onTyped(std::move(message)); });
  options.transport_hints = ros::TransportHints().tcpNoDelay();
  typed_ = node_.subscribe(options);
}

bool MeshSubscription::wantsRenewal() {
  ros::Subscriber ended, open;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (any_ && !held_.empty() && ros::SteadyTime::now() - narrowed_at_ > MAX_OVERLAP) ended = endOverlap();
    open = any_ ? any_ : typed_;
  }
  ended.shutdown();
  const std::uint32_t publishers = open ? open.getNumPublishers() : 0;
  bool lost = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    has_type_ = has_type_ || publishers > 0;
    lost = has_type_ && publishers == 0;
  }
  publishers_ = publishers;
  const std::int64_t now_ns = steadyNs();
  if ((!lost && now_ns - last_message_ns_ < SILENCE_NS) || now_ns < next_look_ns_) return false;
  next_look_ns_ = now_ns + (lost ? LOST_LOOK_NS : LOOK_NS);
  return true;
}

void MeshSubscription::renew(const std::map<std::string, std::string>& published) {
  const auto found = published.find(topic_);
  const std::string type = found == published.end() ? "" : found->second;
  std::string heard;
  bool lost = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    heard = heard_type_;
    lost = has_type_ && publishers_ == 0;
  }
  try {
    // What was tried before a message came tells nothing about what comes after it: a type may be back, and pauses that
    // had grown by then would lock it out.
    if (lost || !heard.empty()) attempts_ = 0;
    if (lost || heard == type) acted_on_.clear();
    if (lost) {
      open(nullptr);
    } else if (heard.empty()) {
      attempt(type);
    } else if (!type.empty() && type != heard && type != acted_on_) {
      acted_on_ = type;
      open(findMeshType(type));
    }
  } catch (const ros::Exception& error) {  // another nodelet holds the topic with another type
    ROS_DEBUG_STREAM(topic_ << ": " << error.what());
    open(nullptr);
  }
}

/// Whose type the subscription has taken on is not known: nothing has come. A single publisher may be silent for good
/// reasons, and need not be asked again; but one that is not connected was refused for its type, or was killed.
void MeshSubscription::attempt(const std::string& published_type) {
  if (published_type != acted_on_) {
    acted_on_ = published_type;
    attempts_ = 0;
    next_attempt_ns_ = steadyNs() + LOOK_NS;  // a publisher that has just come may be about to be connected
  }
  if (published_type.empty() || steadyNs() < next_attempt_ns_) return;
  const auto registered = registeredPublishers(topic_, MASTER_TIMEOUT_S);
  if (!registered || registered->size() <= publishers_) return;
  // The master's type, any, then each that can be a mesh.
  const auto& types = meshTypes();
  const std::size_t round = attempts_ / (types.size() + 2), at = attempts_ % (types.size() + 2);
  ++attempts_;
  next_attempt_ns_ = steadyNs() + (ATTEMPT_NS << std::min(round, MAX_DOUBLINGS));
  open(at == 0 ? findMeshType(published_type) : at == 1 ? nullptr : &types[at - 2]);
}

}  // namespace dccd
