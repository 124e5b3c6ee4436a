#include "input/mesh_subscription.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include <ros/console.h>
#include <ros/exceptions.h>

#include "input/master_question.h"
#include "input/message_bytes.h"
#include "input/steady_clock.h"
#include "input/watched_queue.h"

namespace dccd {

namespace {

// A topic that has been quiet so long may have lost its publisher. Asked about so often, and at once when the last
// publisher has gone.
constexpr std::int64_t SILENCE_NS = 1000000000, LOOK_NS = 500000000, LOST_LOOK_NS = 200000000;
// The pause between attempts doubles with each round of them, up to 32 s.
constexpr std::int64_t ATTEMPT_NS = 1000000000;
constexpr std::size_t MAX_DOUBLINGS = 5;
constexpr double MASTER_TIMEOUT_S = 0.5;

}  // namespace

void tellLost(const std::string& topic, const std::exception& error) {
  ROS_WARN_STREAM_THROTTLE(5, topic << ": a message was lost: " << error.what());
}

MeshSubscription::MeshSubscription(const ros::NodeHandle& node, std::string topic, const MeshType* objects_of,
                                   Came came, Callback callback)
    : node_(node),
      topic_(node_.resolveName(topic)),
      objects_of_(objects_of),
      on_number_(std::move(came)),
      callback_(std::move(callback)),
      last_message_ns_(steadyNs()) {
  if (objects_of_) {
    openToObjects();
  } else {
    open(nullptr);
  }
}

MeshSubscription::~MeshSubscription() { close(); }

void MeshSubscription::close() {
  ros::Subscriber subscriber;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    subscriber = std::exchange(subscriber_, {});
    has_type_ = false;
    heard_type_.clear();
  }
  subscriber.shutdown();  // waits for a callback that runs, which may wait for the mutex
}

void MeshSubscription::open(const MeshType* type) {
  close();
  ros::SubscribeOptions options;
  options.initByFullCallbackType<const ros::MessageEvent<RawMessage>&>(
      topic_, SUBSCRIBER_QUEUE, [this](const ros::MessageEvent<RawMessage>& event) { onBytes(event); });
  if (type) {
    options.md5sum = type->md5;
    options.datatype = type->datatype;
  }
  subscribe(options);
}

void MeshSubscription::openToObjects() {
  const MeshType& type = *objects_of_;
  ros::SubscribeOptions options(topic_, SUBSCRIBER_QUEUE, type.md5, type.datatype);
  options.helper = type.receiver(type, came_, [this](const TypedMesh& object) { onObject(object); });
  subscribe(options);
}

void MeshSubscription::subscribe(ros::SubscribeOptions& options) {
  options.transport_hints = ros::TransportHints().tcpNoDelay();
  ros::Subscriber opened = node_.subscribe(options);
  const std::lock_guard<std::mutex> lock(mutex_);
  subscriber_ = std::move(opened);
}

void MeshSubscription::heard(const std::string& type) {
  const std::lock_guard<std::mutex> lock(mutex_);
  last_message_ns_ = steadyNs();
  has_type_ = true;  // the publisher may come and go between two looks
  heard_type_ = type;
}

void MeshSubscription::onBytes(const ros::MessageEvent<RawMessage>& event) try {
  MeshMessage message;
  message.number = ++*came_;
  on_number_(message.number);
  message.sender = event.getPublisherName();
  RawMessage& raw = *event.getMessage();
  message.datatype = std::move(raw.datatype);
  heard(message.datatype);
  message.md5 = std::move(raw.md5);
  const MeshType* type = findMeshType(message.datatype);
  if (type && message.md5 != type->md5) message.definition = event.getConnectionHeader()["message_definition"];
  if (hasMemoryFor(raw.bytes.size())) {
    message.bytes = std::move(raw.bytes);
  } else {
    message.no_memory = raw.bytes.size();
  }
  callback_(std::move(message));
} catch (const std::exception& error) {
  tellLost(topic_, error);
}

void MeshSubscription::onObject(const TypedMesh& object) try {
  MeshMessage message;
  message.number = ++*came_;
  on_number_(message.number);
  heard(object.type->datatype);
  message.datatype = object.type->datatype;
  message.sender = object.sender;
  message.object = object;
  callback_(std::move(message));
} catch (const std::exception& error) {
  tellLost(topic_, error);
}

bool MeshSubscription::wantsRenewal() {
  ros::Subscriber subscriber;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    subscriber = subscriber_;
  }
  const std::uint32_t publishers = subscriber ? subscriber.getNumPublishers() : 0;
  bool lost = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    has_type_ = has_type_ || publishers > 0;
    lost = has_type_ && publishers == 0;
  }
  publishers_ = publishers;
  if (objects_of_) return false;  // it takes on no other publisher's type
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
