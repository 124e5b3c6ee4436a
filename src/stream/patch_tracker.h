// Which patch of a step is which of the step before (doc/algorithm.md, "Patches"). All that lasts of them is here.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <vector>

#include "dccd/outcome.h"
#include "dccd/step.h"
#include "step/patches/patches.h"

namespace dccd {

/// Keeps what touched within the last patch_gap_s. What belongs together by that is one living patch, so that one
/// which noise takes apart, or lets go of, for a moment stays one. Its memory is what touched in that time before the
/// last step in which anything did.
class PatchTracker {
 public:
  static constexpr std::size_t ALL = std::numeric_limits<std::size_t>::max();

  /// Frames begin anew, of one body or of all: what lives there ends, nobody knows when. Told with the next outcome.
  void seam(std::size_t body = ALL);
  /// What is expected in the steps that are followed from here on.
  void expect(const std::vector<Expectation>& expected);
  /// Of an answered step that comes after the last one: its patches get identities, and the outcome its events. found:
  /// what detect() found in it.
  void follow(const PatchMaker& found, double gap_s, Outcome& outcome);
  /// Identities for the patches of an outcome aside from the stream, 0 for those that would be new. Changes nothing.
  void recognise(const PatchMaker& found, Outcome& outcome);
  /// After an exception from follow(): nothing half done is left, and what lives ends, as at a seam. What the outcome
  /// already says has happened is told with the next one, as far as there is memory.
  void forget(Outcome& outcome) noexcept;
  /// What has happened since the last outcome goes into this one.
  void tell(Outcome& outcome);

 private:
  static constexpr std::int64_t NEVER = std::numeric_limits<std::int64_t>::min();
  struct Living {
    std::array<std::uint16_t, 2> body{0, 0};
    PatchBeginning beginning = PatchBeginning::NEW;
    StampNs began_from_ns = UNKNOWN_NS, began_to_ns = UNKNOWN_NS;
    StampNs touched_ns = UNKNOWN_NS;   // it was still there
    StampNs released_ns = UNKNOWN_NS;  // it no longer was; UNKNOWN_NS: it was not seen apart since
    // By the clock of its partner: when the last of its spots was touched, and the last of those not expected.
    std::int64_t last_ns = NEVER, last_unexpected_ns = NEVER;
    bool unexpected = false;  // something of it that lasts is not expected, or was when the last of it was forgotten
  };
  /// What is known of a spot (PatchSpot) of a living patch.
  struct Known {
    std::uint64_t id = 0;
    std::int64_t last_ns = NEVER;  // by the clock of its partner
  };
  /// Spots that touched; each pair of vertices is there once. Those at one vertex are a list, the newest first.
  struct Trace {
    std::vector<TouchGraph::Spot> spots;
    std::vector<Known> known;
    std::vector<std::uint32_t> before;   // per spot: the one before it at its vertex; NO_INDEX
    std::vector<std::uint32_t> last_at;  // per vertex; NO_INDEX
    std::vector<std::uint32_t> part_of;  // per spot
    std::size_t joined_parts = 0;        // to so many they are joined; 0: not since one came or went
    std::size_t size() const { return spots.size(); }
    /// The spot there; a new one if there is none.
    std::uint32_t at(Index vertex, Index across, const std::array<std::uint16_t, 2>& body);
    /// Forgets all others. isKept(spot, known).
    template <class F>
    void keep(const F& isKept);
    void clear();
    void numberVertices(std::size_t count);  // those of the spots have other numbers than before
  };
  /// Time that was seen whole: nothing ends in what was not.
  struct Clock {
    std::int64_t now_ns = 0;
    std::int64_t kept_from_ns = NEVER;  // what touched before is forgotten
    bool sees = false;                  // in this step
  };
  /// What touches and what did, between the same areas.
  struct Part {
    std::uint64_t id = 0;
    bool touches = false;  // in this step
    std::size_t size = 0;
    std::vector<std::uint64_t> before;  // identities of its touches, ascending, each once
    double toc_lower = 1, toc_upper = 1;
    bool initial = false, map_changed = false;
    bool unexpected_new = false, unexpected_initial = false;  // something not expected: came in this step, was there
    StampNs apart_ns = UNKNOWN_NS;  // of what is none of a living patch: all was looked at then, and it did not touch
    bool is_new = false;
    std::array<std::uint16_t, 2> body{0, 0};
    bool isUnexpected() const { return unexpected_new || unexpected_initial; }
  };

  void takeBodies(const std::vector<Body>& bodies);
  void merge(const std::vector<PatchSpot>& spots, const Outcome& outcome);
  void findParts(const PatchMaker& found, const Outcome& outcome);
  void findNewVoxels(const PatchMaker& found, const Outcome& outcome);
  bool isNewOnMap(const PatchLeaf& leaf, const Outcome& outcome) const;
  void findApart(const Outcome& outcome);
  void keepIdentities(Outcome& outcome);
  void name(Outcome& outcome) const;
  void begin(Outcome& outcome);
  bool expectsOtherwise() const { return expectations_ != followed_expectations_; }
  bool wasCutOffAsExpected(const Part& part) const;
  void findNews();
  void tellNews(Outcome& outcome) const;
  void goOn(const Outcome& outcome);
  void remember(double gap_s, const Outcome& outcome);
  void rememberLook(const Outcome& outcome);
  bool changesHands(const Part& part) const;
  void askAllSpots();
  const Clock& clockOf(const std::array<std::uint16_t, 2>& body) const {
    return body[1] == OBSTACLE_BODY ? map_clock_ : mesh_clock_;
  }
  bool lasts(const std::array<std::uint16_t, 2>& body, std::int64_t last_ns) const {
    return last_ns >= clockOf(body).kept_from_ns;
  }
  void endWhatIsGone(Outcome& outcome);
  PatchEvent eventOf(PatchEventKind kind, std::uint64_t id) const;

  std::map<std::uint64_t, Living> living_;
  Trace trace_;
  std::uint64_t next_id_ = 1;
  Clock mesh_clock_, map_clock_;  // of what touches the map, the second
  /// Of a body since its last seam.
  struct Look {
    StampNs bodies_ns = UNKNOWN_NS, map_ns = UNKNOWN_NS;  // until when all was looked at, of bodies, and of the map
    std::shared_ptr<const Positions> at_rest;             // where it stood still
  };
  std::vector<Look> looks_;
  std::vector<Expectation> expected_;
  std::uint64_t expectations_ = 0, followed_expectations_ = 0;  // how often they changed: now, in the last step
  /// Partners of which a patch was all expected until a seam cut it off, and how often expectations had changed then.
  /// Kept until it is seen what touches now.
  std::map<std::array<std::uint16_t, 2>, std::uint64_t> cut_off_expected_;
  std::vector<PatchEvent> waiting_;
  bool has_last_ = false;
  std::shared_ptr<const VoxelSurface> last_map_;
  Eigen::Isometry3d last_map_pose_ = Eigen::Isometry3d::Identity();

  // Buffers of a step.
  TouchGraph graph_;
  Trace all_;                      // the trace, then what is new in the step
  std::size_t old_ = 0;            // how much of it is the trace
  bool forgot_burst_ = false;      // the trace is not in all_
  std::vector<std::uint32_t> at_;  // per spot of the step, its place in all_
  std::vector<std::uint32_t> part_of_patch_;
  std::vector<Part> parts_;
};

}  // namespace dccd
