// What is kept of the messages of a topic besides their contents: who sent them, by whose clock, and what was passed
// over.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <set>
#include <string>

#include "dccd/types.h"
#include "input/mesh_decoder.h"
#include "input/mesh_message.h"
#include "input/stamp_lead.h"

namespace dccd {

/// Who sent the messages of a topic: one that comes after another one, and did before, is one of two.
struct Senders {
  std::string last, before;
  std::set<std::string> gone;  // all before the last
  bool in_turn = false;
  void hear(const std::string& sender);
  std::string problem(const std::string& what) const;
};

struct Source {
  StampLead lead;
  Senders senders;
  std::size_t vertices = 0;                                // of the last frame
  bool is_renumbered = false;                              // its vertices, since the first frame
  StampNs stamp_ns = std::numeric_limits<StampNs>::min();  // of the last frame
  std::string frame;                                       // of the last message
  /// Of a frame; returns by how much its stamp is before that of the one before [s].
  double hear(const DecodedMesh& mesh, const MeshMessage& message);
};

/// Messages of markers that are none of the mesh.
struct OtherMarkers {
  std::uint64_t messages = 0;
  std::string newest;
  bool may_be_things = false;
  std::size_t unread = 0;  // beside the last mesh
  void add(const PassedOver& message);
};

}  // namespace dccd
