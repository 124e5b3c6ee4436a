// What sensors looked at in the last half second: where the unknown is an obstacle, what was free before ends being so.
#pragma once

#include <cstddef>
#include <deque>
#include <vector>

#include "base/cloud_map.h"
#include "dccd/types.h"

namespace dccd {

/// Not thread-safe.
class RecentLooks {
 public:
  explicit RecentLooks(const CloudMapOptions& options) : options_(options) {}
  /// max_bytes: of all that it keeps. Where that is too little, nothing was looked at.
  void add(const SensorView& view, StampNs stamp_ns, std::size_t max_bytes);
  /// Voxels that rays crossed or ended in within half a second up to the last look, if not only in the first half of
  /// it.
  std::vector<OccupiedLeaf> leaves() const;

 private:
  struct Begun {
    Begun(StampNs now_ns, const CloudMapOptions& options) : since_ns(now_ns), map(options) {}
    StampNs since_ns;
    CloudMap map;
  };
  static constexpr std::size_t MOST = 3;
  const CloudMapOptions options_;
  std::deque<Begun> begun_;  // the first one holds the most
};

}  // namespace dccd
