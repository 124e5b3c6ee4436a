// When what touched first over a whole run, so that two runs of one recording can be held against each other: each
// vertex and each patch (doc/accuracy.md, "What accuracy costs a user").
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "dccd/outcome.h"

namespace dccd {

/// It was between these [ns], on the recording's clock.
struct TimeSpan {
  StampNs from_ns = 0, to_ns = 0;
};

/// A patch from its first contact on, with what came off it later.
struct PatchLife {
  std::array<std::uint16_t, 2> body{0, 0};
  TimeSpan began;
  /// A step in which it touched, and where its points of contact were [m].
  struct Seen {
    TimeSpan step;
    Box box;
  };
  std::vector<Seen> seen;
};

/// What one run of a recording found and cost. Times on the clock of the machine are in `ms` alone.
struct RunRecord {
  struct BodyRecord {
    std::map<Index, TimeSpan> first;  ///< of each vertex that touched: the first time that a feature on it did
    std::vector<Index> vertices;      ///< that carry a feature, ascending
    double edge_m = 0;                ///< mean length of an edge in the first answered step
    bool comparable = true;           ///< one mesh for the whole run: a vertex's number means one vertex
  };
  std::vector<BodyRecord> bodies;
  std::vector<PatchLife> patches;
  double voxel_m = 0;  ///< edge of the smallest leaf of the first map; 0: none
  StampNs end_ns = 0;  ///< of the last answered step
  std::size_t steps = 0;
  double ms = 0, duration_s = 0;  ///< of the answered steps
  std::uint64_t pairs = 0;        ///< that came to the elementary test, with bodies or the map

  double msPerSecond() const { return duration_s > 0 ? ms / duration_s : 0; }
};

/// Makes a RunRecord of a run's outcomes, which come in order and with patches.
class RunRecorder {
 public:
  void add(const Outcome& outcome);
  RunRecord take();

 private:
  void addMeshes(const Outcome& outcome);
  void addPatches(const Outcome& outcome);

  RunRecord record_;
  std::vector<std::shared_ptr<const Topology>> topologies_;
  std::map<std::uint64_t, std::uint64_t> came_off_;  // a patch that came off another: the one that it came off
  std::map<std::uint64_t, std::size_t> place_of_;    // in record_.patches
};

/// Of the things that are common to both runs, and touched in the reference or in the other run before both end.
struct FirstErrors {
  std::size_t touched = 0;   ///< in the reference
  std::size_t missed = 0;    ///< of these, that the other run has not
  std::size_t invented = 0;  ///< that only the other run has
  /// Of those that both have: the other run's first time minus the reference's, of either end of the interval the one
  /// that is further off [ms]. median and p95 are of its size; early is the least (not above 0), late the largest.
  double median_ms = 0, p95_ms = 0, early_ms = 0, late_ms = 0;
};
struct RunErrors {
  FirstErrors vertices, patches;
  std::size_t joined = 0;  ///< patches of the reference that are part of another's counterpart
  std::size_t parted = 0;  ///< patches of the other run that are part of another one of the reference
  double pairs_share = 0;  ///< pairs that were tested, of the reference's
};
RunErrors errorsOf(const RunRecord& run, const RunRecord& reference);

}  // namespace dccd
