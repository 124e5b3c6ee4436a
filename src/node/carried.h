// What is placed by tf besides frames of streams.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "dccd/mesh_store.h"

namespace dccd {

/// What tf carries.
struct Rigid {
  static constexpr StampNs NEVER = std::numeric_limits<StampNs>::max();
  MeshFrame mesh;       // as its file has it, but for
  Positions reference;  // its positions
  std::string name, frame;
  Eigen::Isometry3d frame_from_mesh = Eigen::Isometry3d::Identity();
  bool may_be_lost = false;               // others go on without it
  bool lost = false;                      // it had no transform at the last frame
  std::optional<Eigen::Isometry3d> pose;  // the last one
  StampNs let_go_ns = NEVER;              // from then on it stays where the frame had it
  std::string doubt;                      // why it may be elsewhere at all times, in words; empty: nothing says so
  bool isNone() const { return reference.empty(); }
};

/// By what the newest cloud of a depth camera was placed in a fixed frame that is named.
struct SeenFrom {
  std::string frame;
  StampNs stamp_ns = 0;
  std::uint64_t epoch = 0;  // FrameTracks::epoch()
  std::string doubt;        // why it may have been elsewhere, in words; once there is one it stays
};

}  // namespace dccd
