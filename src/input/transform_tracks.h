// Where tf has frames from one stamp to another.
#pragma once

#include <string>
#include <vector>

#include "dccd/mesh_store.h"
#include "input/transforms.h"

namespace dccd {

/// Tracks in a fixed frame of this name, which may change; both outlive this.
class TransformTracks : public FrameTracks {
 public:
  TransformTracks(const TransformFeed& transforms, const std::string& fixed_frame)
      : transforms_(transforms), fixed_frame_(fixed_frame) {}

  std::vector<Knot> between(const std::string& target, const std::string& source, StampNs from_ns, StampNs to_ns,
                            Silence silence) const override;
  std::uint64_t epoch() const override { return transforms_.timesForgotten(); }

  /// Why tf may be wrong about the frame's place at the stamp: next to it something of the way is missing. Empty:
  /// nothing is.
  std::string doubtAt(const std::string& target, const std::string& source, StampNs stamp_ns) const;

 private:
  const TransformFeed& transforms_;
  const std::string& fixed_frame_;

  void look(const std::string& target, const std::string& source, StampNs stamp_ns, Silence silence, bool is_middle,
            std::vector<Knot>& knots) const;
};

/// "no transform of its frame at … s".
std::string noTransformAt(StampNs stamp_ns);
std::string secondsOf(StampNs stamp_ns);

}  // namespace dccd
