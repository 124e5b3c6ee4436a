// Whether frames of reference in which things are held are at rest, as far as tf tells.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "dccd/mesh_store.h"

namespace dccd {

class FramesAtRest {
 public:
  /// Where a frame was in others, up to the last look.
  struct Word {
    std::string reference;  ///< in which it moved the most
    double moved_m = 0;     ///< since the first look
    std::string unknown;    ///< why nobody knows where it was since the look before; empty: it is known
  };
  /// From the last look on, or from_ns, whatever is earlier. Where it is in the `reference` is looked at from now on;
  /// empty: in no other one than before. Of points that far from the frame's origin. What tf has not sent yet is no
  /// objection.
  Word look(const FrameTracks& tracks, const std::string& frame, const std::string& reference, StampNs from_ns,
            StampNs to_ns, double reach_m);
  bool hasLookedAt(const std::string& frame) const { return rests_.count(frame) > 0; }
  void forget() { rests_.clear(); }

 private:
  struct Rest {
    std::optional<Eigen::Isometry3d> first;
    StampNs until_ns = 0;
    double moved_m = 0;
  };
  std::map<std::string, std::map<std::string, Rest>> rests_;  // by frame and reference
};

}  // namespace dccd
