// A message of any type, of which a subscription hands over the bytes themselves: large ones are copied once.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <ros/message_traits.h>
#include <ros/serialization.h>

namespace dccd {

struct RawMessage {
  std::string datatype, md5;
  std::vector<std::uint8_t> bytes;
};

}  // namespace dccd

namespace ros {

namespace message_traits {
template <>
struct IsMessage<dccd::RawMessage> : TrueType {};
template <>
struct IsMessage<const dccd::RawMessage> : TrueType {};
template <>
struct MD5Sum<dccd::RawMessage> {
  static const char* value(const dccd::RawMessage& message) { return message.md5.c_str(); }
  static const char* value() { return "*"; }  // of any type
};
template <>
struct DataType<dccd::RawMessage> {
  static const char* value(const dccd::RawMessage& message) { return message.datatype.c_str(); }
  static const char* value() { return "*"; }
};
template <>
struct Definition<dccd::RawMessage> {
  static const char* value(const dccd::RawMessage&) { return ""; }
};
}  // namespace message_traits

namespace serialization {
template <>
struct Serializer<dccd::RawMessage> {
  template <class Stream>
  static void read(Stream& stream, dccd::RawMessage& message) {
    message.bytes.assign(stream.getData(), stream.getData() + stream.getLength());
  }
};
template <>
struct PreDeserialize<dccd::RawMessage> {
  static void notify(const PreDeserializeParams<dccd::RawMessage>& params) {
    params.message->datatype = (*params.connection_header)["type"];
    params.message->md5 = (*params.connection_header)["md5sum"];
  }
};
}  // namespace serialization

}  // namespace ros
