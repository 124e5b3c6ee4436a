// One message of a body on its way from a topic or a bag to the decoder.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "input/message_type.h"

namespace dccd {

/// As it came: serialised by another process or read from a bag, or the object itself from a publisher in this process.
struct MeshMessage {
  std::string datatype;             ///< as in the connection's header, package/Name
  std::vector<std::uint8_t> bytes;  ///< empty where there is an object
  StampNs receipt_ns = 0;           ///< stands in for the stamp of messages without one
  std::int64_t arrival_ns = 0;      ///< on a clock that is never late
  std::string md5 = "*";            ///< of the type as the publisher knows it
  std::string definition = {};      ///< of a type with another md5 than the one that is known here
  TypedMesh object = {};
  std::size_t too_large = 0;   ///< bytes that it had; it was emptied, since no queue has room for it
  std::size_t no_memory = 0;   ///< bytes that it had; there was not the memory to take them over
  std::uint64_t number = 0;    ///< in the order in which the topic's came, with those that were lost; 0: after the last
  std::uint64_t thinned = 0;   ///< before it, that a queue left out by choice
  std::int64_t since_ns = -1;  ///< arrival on the clock that drives the pipeline; negative: arrival_ns
  std::string sender = {};     ///< the publisher's name; empty: it is not known

  std::size_t size() const { return object.type ? object.type->size(object.message.get()) : bytes.size(); }
};

}  // namespace dccd
