// Which patch of a step is which of the step before (doc/algorithm.md, "Patches"). All that lasts of them is here.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <vector>

#include "dccd/outcome.h"
#include "dccd/range_log.h"
#include "step/patches.h"

namespace dccd {

/// Keeps what touched within the last patch_gap_s. What is connected through that is one living patch, so that one
/// which noise takes apart, or lets go of, for a moment stays one. Its memory is what touched in that time.
class PatchTracker {
 public:
  static constexpr std::size_t ALL = std::numeric_limits<std::size_t>::max();

  /// Frames begin anew, of one body or of all: what lives there ends, nobody knows when. Told with the next outcome.
  void seam(std::size_t body = ALL);
  /// Of an answered step that comes after the last one: its patches get identities, and the outcome its events. found:
  /// what detect() found in it.
  void follow(const PatchMaker& found, double gap_s, Outcome& outcome);
  /// The same of what a range has logged.
  void follow(const std::vector<Touch>& touches, const std::vector<std::uint32_t>& patch_of,
              const std::vector<std::uint8_t>& on_new_voxel, double gap_s, Outcome& outcome);
  /// Identities for the patches of an outcome aside from the stream, 0 for those that would be new. Changes nothing.
  void recognise(const PatchMaker& found, Outcome& outcome);
  /// What has happened since the last outcome goes into this one.
  void tell(Outcome& outcome);
  /// From now on patches get no identities: what they follow from goes into the log.
  void leaveTo(RangeLog& log) { log_ = &log; }
  /// The map of the step before the first one that is followed.
  void knowMap(const Outcome& before);

  std::size_t livingCount() const { return living_.size(); }
  std::size_t traceSize() const { return trace_.size(); }

 private:
  struct Living {
    std::array<std::uint16_t, 2> body{0, 0};
    PatchBeginning beginning = PatchBeginning::NEW;
    StampNs began_from_ns = UNKNOWN_NS, began_to_ns = UNKNOWN_NS;
    StampNs touched_ns = UNKNOWN_NS;   // it was still there
    StampNs released_ns = UNKNOWN_NS;  // it no longer was; UNKNOWN_NS: it was not seen apart since
    bool unexpected = false;           // something of it that lasts is not expected
  };
  /// Something that touched, of a living patch.
  struct Trace {
    Touch touch;
    std::uint64_t id = 0;
    std::int64_t last_ns = 0;  // by the clock of its partner
  };
  /// A connected set of what touches and what did.
  struct Part {
    std::uint64_t id = 0;
    bool touches = false;  // in this step
    std::size_t size = 0;
    std::vector<std::uint64_t> before;  // identities of its touches, ascending, each once
    double toc_lower = 1, toc_upper = 1;
    bool initial = false, map_changed = false;
    bool unexpected_new = false, unexpected_initial = false;  // something not expected: came in this step, was there
    bool is_new = false;
    std::array<std::uint16_t, 2> body{0, 0};
  };

  void merge(const std::vector<Touch>& touches);
  void findParts(const std::vector<std::uint32_t>& patch_of, const std::vector<std::uint8_t>& on_new_voxel,
                 const Outcome& outcome);
  void findNewVoxels(const std::vector<Touch>& touches, const Outcome& outcome);
  bool isNewOnMap(const Touch& touch, const Outcome& outcome) const;
  void keepIdentities(Outcome& outcome);
  void name(const std::vector<std::uint32_t>& patch_of, Outcome& outcome) const;
  void begin(Outcome& outcome);
  void findNews();
  void tellNews(Outcome& outcome) const;
  void goOn(const Outcome& outcome);
  void remember(double gap_s, const Outcome& outcome);
  void endWhatIsGone(Outcome& outcome);
  PatchEvent eventOf(PatchEventKind kind, std::uint64_t id) const;

  std::map<std::uint64_t, Living> living_;
  std::vector<Trace> trace_;  // by key
  std::uint64_t next_id_ = 1;
  // Time that was seen whole, with the map and without: nothing ends in what was not.
  std::int64_t mesh_clock_ns_ = 0, map_clock_ns_ = 0;
  bool mesh_seen_ = false, map_seen_ = false;  // in this step
  std::vector<PatchEvent> waiting_;
  bool has_last_ = false;
  std::shared_ptr<const VoxelSurface> last_map_;
  Eigen::Isometry3d last_map_pose_ = Eigen::Isometry3d::Identity();
  RangeLog* log_ = nullptr;

  // Buffers of a step.
  TouchGraph graph_;
  std::vector<Touch> touches_;          // trace and step together, by key
  std::vector<Trace> all_;              // the same with what is known of each
  std::vector<std::uint32_t> current_;  // per one of these its touch of the step; NO_PATCH: none
  std::vector<Part> parts_;
  std::vector<std::uint8_t> on_new_voxel_;  // per touch; empty: none is
};

}  // namespace dccd
