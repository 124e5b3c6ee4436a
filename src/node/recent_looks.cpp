#include "node/recent_looks.h"

#include "dccd/tolerances.h"

namespace dccd {

/// Octrees are begun in turn, so that each look is in one that is old enough, and none is kept for longer than a gap.
void RecentLooks::add(const SensorView& view, StampNs stamp_ns, std::size_t max_bytes) try {
  const auto isOlderThan = [&](double s) {
    return begun_.empty() || secondsBetween(begun_.back().since_ns, stamp_ns) >= s;
  };
  if (!isOlderThan(-tolerance::OWN_GAP_S)) begun_.clear();  // a clock that went back
  if (isOlderThan(tolerance::OWN_GAP_S / 2)) begun_.emplace_back(stamp_ns, options_);
  while (secondsBetween(begun_.front().since_ns, stamp_ns) > tolerance::OWN_GAP_S) begun_.pop_front();
  for (Begun& one : begun_) {
    if (one.since_ns <= stamp_ns) one.map.insert(view, max_bytes / MOST);
  }
} catch (const OctomapError&) {
  begun_.clear();
}

std::vector<OccupiedLeaf> RecentLooks::leaves() const {
  if (begun_.empty()) return {};
  OctomapLimits limits;
  limits.free_leaves = true;
  DecodedOctomap seen = begun_.front().map.leaves(limits);
  seen.occupied.insert(seen.occupied.end(), seen.free.begin(), seen.free.end());
  return std::move(seen.occupied);
}

}  // namespace dccd
