// The frames of one body: what a new frame is to the one before it, and where the body is between two of them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "dccd/export.h"
#include "dccd/outcome.h"
#include "dccd/tolerances.h"
#include "dccd/topology.h"
#include "dccd/types.h"

namespace dccd {

/// Where one frame of reference is in another one, at a stamp.
struct Knot {
  StampNs stamp_ns = 0;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::string why_unknown = {};  ///< in words; empty: it is known
  bool is_middle = false;        ///< between two others, where the way does not bend all at once
};

/// What is said of a frame of reference at stamps at which nobody says where it is.
enum class Silence : std::uint8_t {
  UNKNOWN = 0,
  STANDS = 1,  ///< it is where it was sent last
};

/// The frame of reference in which something came, by which it was placed in the fixed one.
struct Carrier {
  std::string frame;        ///< empty: the fixed frame itself
  std::uint64_t epoch = 0;  ///< FrameTracks::epoch() when it was placed
  Silence silence = Silence::UNKNOWN;
  bool takes_along = true;  ///< what is static in it goes where it does; false: it was seen from there, and stays
};

/// Where frames of reference go. An empty name is the fixed frame's.
class DCCD_EXPORT FrameTracks {
 public:
  virtual ~FrameTracks() = default;
  /// The track of target_from_source from one stamp to another, both included: a knot at either, one wherever it may
  /// bend all at once, and a middle between any two of these, ascending. A knot says so where nobody knows. None at
  /// all: both are the same frame.
  virtual std::vector<Knot> between(const std::string& target, const std::string& source, StampNs from_ns,
                                    StampNs to_ns, Silence silence) const = 0;
  /// Another one once what was said before of where frames were may not hold any more.
  virtual std::uint64_t epoch() const = 0;
};

/// One frame, already in the fixed frame.
struct MeshFrame {
  StampNs stamp_ns = 0;
  std::shared_ptr<const Topology> topology;
  Positions positions;  ///< [m]; non-finite ones are unchecked, not refused
  /// Rigid bodies: fixed_from_body at the stamp. Between two frames they then move along the rotation, not the chord.
  /// Others: fixed_from_carrier.
  bool rigid = false;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::vector<double> radius_m = {};  ///< uncertainty per vertex, finite and 0 or more; empty: none
  std::uint64_t dropped_faces = 0;    ///< that were sent and are in no part of the topology: unchecked
  std::int64_t arrival_ns = 0;        ///< of its message, by any clock: goes on to the outcome
  Carrier carrier = {};
  /// In the order in which its body's frames came, whatever became of them: between two without a gap none is missing.
  /// 0: it is the one after the last.
  std::uint64_t number = 0;
  std::uint64_t thinned = 0;  ///< frames before it that were left out by choice
  std::string doubt = {};     ///< why the body may have been elsewhere at the stamp, in words; empty: nothing says so
};

struct MeshStoreOptions {
  double max_step_s = tolerance::LONGEST_STEP_S;  ///< a longer pause is a gap; above 0, at most 1e9
  double max_vertex_step_m =
      tolerance::FARTHEST_VERTEX_STEP_M;  ///< a vertex that moves further is a teleport; 0: never
  std::size_t capacity = 1024;            ///< frames kept at most; at least 2
  std::size_t max_vertices = 1 << 21;     ///< in the frames kept (50 MB), where they are more than 64
};

/// Where a body is at a stamp.
enum class Lookup : std::uint8_t {
  READY = 0,
  NOT_YET = 1,  ///< later than the newest frame
  TOO_OLD = 2,  ///< before the oldest frame that is kept, or across a seam
};

/// Frames of one body, oldest first, in runs without a seam. Decides on stamps alone.
class DCCD_EXPORT MeshStore {
 public:
  /// Throws std::invalid_argument naming the option that is out of range.
  explicit MeshStore(const MeshStoreOptions& options);

  /// OK: continues the frame before. A seam: kept, and begins a new run. DUPLICATE, VERTEX_COUNT: not kept.
  StepStatus push(MeshFrame frame);
  /// This store, still empty, takes the place of another one: the next frame is late where it would be so there.
  void replace(const MeshStore& before, StampNs next_ns);
  /// Frames came that will not be pushed. Said of them, where they are missed.
  void passOver(std::uint64_t count, std::string why);

  void clear();
  void setOptions(const MeshStoreOptions& options);
  const MeshStoreOptions& options() const { return options_; }

  bool empty() const { return frames_.empty(); }
  std::size_t size() const { return frames_.size(); }
  const MeshFrame& oldest() const { return *frames_.front().frame; }
  const MeshFrame& newest() const { return *frames_.back().frame; }
  std::shared_ptr<const MeshFrame> newestShared() const { return frames_.back().frame; }
  /// The frame before the newest in the same run, or null.
  std::shared_ptr<const MeshFrame> previous() const;

  /// Whether the body is known at the stamp; the run it is in counts up with every seam.
  Lookup lookup(StampNs stamp_ns, std::uint64_t* run = nullptr) const;

  /// Why the run that the newest frame is in began (FIRST_FRAME, GAP, ...).
  StepStatus runReason() const { return run_reason_; }

  /// Where the body is at a stamp for which lookup is READY: the frame itself, or one between two, with what either of
  /// them lacks and the larger of their radii. The rounded doubles are the truth from there on (doc/algorithm.md, "The
  /// question").
  std::shared_ptr<const MeshFrame> frameAt(StampNs stamp_ns) const;
  /// The frames between two stamps, neither included.
  std::vector<std::shared_ptr<const MeshFrame>> framesWithin(StampNs from_ns, StampNs to_ns) const;

  /// A part of the path between two frames without a seam between them, or one that no other joins, alone.
  struct Stretch {
    std::shared_ptr<const MeshFrame> from, to;
    double first = 0, last = 0;  ///< [1] where it begins and ends between the two
  };
  /// The path from one stamp to another, both included, newest stretch first.
  std::vector<Stretch> pathWithin(StampNs from_ns, StampNs to_ns) const;

  /// Why it is not known, in words, where the body was between two frames of a run that have some of this time between
  /// them: one came in between and is not here, or one of them is in doubt. Beyond the newest frame: what came after
  /// it. Empty: it is known.
  std::string unknownWithin(StampNs from_ns, StampNs to_ns) const;
  /// How many were left out by choice between the same frames.
  std::uint64_t thinnedWithin(StampNs from_ns, StampNs to_ns) const;

  /// Forgets what is not needed for stamps at or after this one.
  void forgetBefore(StampNs stamp_ns);

 private:
  struct Kept {
    std::shared_ptr<const MeshFrame> frame;
    std::uint64_t run = 0;
    std::uint64_t number = 0;  // up to this one each frame was this, the same once more, or is missed
    std::string unknown;       // why the way from the frame before, of the same run, is not known; empty: it is
  };
  MeshStoreOptions options_;
  static constexpr StampNs NEVER_NS = std::numeric_limits<StampNs>::min();
  std::deque<Kept> frames_;
  std::uint64_t run_ = 0;
  StepStatus run_reason_ = StepStatus::FIRST_FRAME;
  std::size_t vertices_ = 0;          ///< in all frames kept
  std::uint64_t came_ = 0;            ///< number of the last frame that came
  std::string why_;                   ///< why it is not here; empty: it is, or nobody said so
  StampNs seen_until_ns_ = NEVER_NS;  ///< frames came up to then that are here no more, for stamps went back a little

  StepStatus classify(const MeshFrame& frame) const;
  StampNs lateAfter(StampNs stamp_ns) const;
  void forgetOldest();
  std::size_t firstAtOrAfter(StampNs stamp_ns) const;
  void comesAgain(const MeshFrame& frame);
  std::string unknownAfterNewest(std::uint64_t accounted) const;
};

/// Positions between two arrays of equal size, u in [0,1]; the ends are reproduced bit for bit.
DCCD_EXPORT void interpolate(const Positions& a, const Positions& b, double u, Positions& out);
/// Pose between two: translation along the line, rotation along the shorter arc. u outside [0,1] extrapolates.
DCCD_EXPORT Eigen::Isometry3d interpolate(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double u);

}  // namespace dccd
