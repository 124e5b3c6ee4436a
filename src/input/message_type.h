// The message types that carry a mesh, one row each. All that the package knows about a type stands in one file of
// message_types/, which registers the row; every other place asks this table.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <ros/message_traits.h>
#include <ros/serialization.h>
#include <ros/subscription_callback_helper.h>
#include <boost/make_shared.hpp>

#include "input/mesh_views.h"

namespace dccd {

struct MeshType;

/// A message as an object: one that a publisher in this process hands over was not serialised and is not copied. The
/// publisher must not write to what it has published, as for every message of roscpp.
struct TypedMesh {
  const MeshType* type = nullptr;  ///< null: there is no object
  boost::shared_ptr<const void> message;
  std::string sender = {};  ///< the publisher's name; this process's: it was handed over

  /// Null where the message is of another type.
  template <typename Message>
  const Message* as() const;
};

/// Of a topic: those that were handed on, or lost.
using MessageCount = std::shared_ptr<std::atomic<std::uint64_t>>;

struct MeshType {
  const char* name;      ///< in the parameter `type`
  const char* datatype;  ///< in ROS, package/Name
  const char* md5;
  const char* definition;  ///< its text, with those of the types of its fields
  /// What a serialised message says, as views into its bytes. `extra_field`: the point field that must be there, where
  /// the type has point fields. Throws WireError.
  MeshView (*read)(WireReader& wire, const std::string& extra_field);
  /// The header of a serialised message, unread otherwise; empty where there is none. Throws WireError.
  HeaderView (*readHeader)(WireReader& wire);
  /// The same views of an object of this type, with the same checks. It must outlive them.
  MeshView (*view)(const void* message, const std::string& extra_field);
  std::size_t (*size)(const void* message);  ///< bytes, serialised
  /// What roscpp needs to hand such messages over as objects. One of another process is made an object only once its
  /// lengths have been checked; else it is added to `lost`, and roscpp logs why.
  ros::SubscriptionCallbackHelperPtr (*receiver)(const MeshType& type, const MessageCount& lost,
                                                 const std::function<void(const TypedMesh&)>& callback);
};

/// In the order of their ROS names. `auto` is not among them.
const std::vector<MeshType>& meshTypes();
/// Null: no accepted type has this ROS name.
const MeshType* findMeshType(const std::string& datatype);
/// Of its name in the parameter `type`; null: it is `auto`.
const MeshType* findMeshTypeNamed(const std::string& name);

/// Empty when messages of this type can be read; else one sentence. md5 "*" stands for any. One with another md5 and
/// the same layout can: older definitions lack constants. `definition`: as its publisher has it; empty: not known.
std::string meshTypeProblem(const std::string& datatype, const std::string& md5, const std::string& definition = {});
/// The part of it that is about the md5, for a type with a `known` one.
std::string md5Problem(const std::string& datatype, const std::string& md5, const std::string& known);

/// The stamp of a serialised message; 0: it has none, or it cannot be read.
StampNs stampOf(const std::string& datatype, const std::vector<std::uint8_t>& bytes);

template <typename Message>
const Message* TypedMesh::as() const {
  const bool is = type && std::string(type->datatype) == ros::message_traits::datatype<Message>();
  return is ? static_cast<const Message*>(message.get()) : nullptr;
}

/// Registers rows before main() begins.
struct MeshTypeRegistration {
  explicit MeshTypeRegistration(const MeshType& row);
};

template <typename Message>
class ObjectReceiver : public ros::SubscriptionCallbackHelperT<const ros::MessageEvent<const Message>&> {
  using Event = ros::MessageEvent<const Message>;
  using Base = ros::SubscriptionCallbackHelperT<const Event&>;

 public:
  ObjectReceiver(const MeshType& type, MessageCount lost, const std::function<void(const TypedMesh&)>& callback)
      : Base([&type, callback](const Event& event) {
          callback({&type, event.getConstMessage(), event.getPublisherName()});
        }),
        type_(type),
        lost_(std::move(lost)) {}
  /// Of another subscriber's thread, too: they share what roscpp has read.
  ros::VoidConstPtr deserialize(const ros::SubscriptionCallbackHelperDeserializeParams& params) override try {
    WireReader wire(params.buffer, params.length);
    type_.read(wire, {});
    return Base::deserialize(params);
  } catch (const std::exception&) {
    ++*lost_;
    throw;
  }

 private:
  const MeshType& type_;
  MessageCount lost_;
};

/// The row of a ROS message. `READ` and `VIEW` are the type's own functions from bytes and from the object to a
/// MeshView; READ_HEADER only where the header stands elsewhere than first.
template <typename Message, auto READ, auto VIEW, HeaderView (*READ_HEADER)(WireReader&) = nullptr>
MeshType meshType(const char* name) {
  namespace traits = ros::message_traits;
  MeshType row{};
  row.name = name;
  row.datatype = traits::datatype<Message>();
  row.md5 = traits::md5sum<Message>();
  row.definition = traits::definition<Message>();
  row.read = [](WireReader& wire, const std::string& extra_field) -> MeshView { return READ(wire, extra_field); };
  row.readHeader = [](WireReader& wire) {
    if constexpr (READ_HEADER != nullptr) return READ_HEADER(wire);
    return traits::hasHeader<Message>() ? readHeader(wire) : HeaderView{};
  };
  row.view = [](const void* message, const std::string& extra_field) -> MeshView {
    return VIEW(*static_cast<const Message*>(message), extra_field);
  };
  row.size = [](const void* message) -> std::size_t {
    return ros::serialization::serializationLength(*static_cast<const Message*>(message));
  };
  row.receiver = [](const MeshType& type, const MessageCount& lost,
                    const std::function<void(const TypedMesh&)>& callback) {
    return ros::SubscriptionCallbackHelperPtr(boost::make_shared<ObjectReceiver<Message>>(type, lost, callback));
  };
  return row;
}

}  // namespace dccd
