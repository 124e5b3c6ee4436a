// How far the stamps of one source run ahead of their arrival.
#pragma once

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "dccd/types.h"

namespace dccd {

/// On the clock of stamps, of which the arrival is read here. A message that is late on its way says nothing, so that
/// the most of the last 8 to 16 counts: what has come before its stamp is of another computer, whose clock is ahead.
class StampLead {
 public:
  /// arrival_ns: 0, it is not known.
  void add(StampNs stamp_ns, StampNs arrival_ns) {
    if (arrival_ns == 0) return;
    newer_ns_ = std::max(newer_ns_, stamp_ns - arrival_ns);
    if (++count_ % MESSAGES == 0) older_ns_ = std::exchange(newer_ns_, NONE);
  }
  /// None: nothing has come.
  std::optional<double> seconds() const {
    const StampNs most_ns = std::max(older_ns_, newer_ns_);
    return most_ns == NONE ? std::nullopt : std::optional(secondsBetween(0, most_ns));
  }

 private:
  static constexpr StampNs NONE = std::numeric_limits<StampNs>::min();
  static constexpr unsigned MESSAGES = 8;
  StampNs older_ns_ = NONE, newer_ns_ = NONE;
  unsigned count_ = 0;
};

}  // namespace dccd
