// One step as a file: all that its answer follows from, and the answer. Free of ROS, readable on any machine.
//
// Little-endian; no alignment. "DCCDSTEP", u32 version, then the fields of StepRecording in the order of visit() in
// step_recording.cpp. Counts are u64 (of texts u32), enumerations and flags u8; arrays of positions and faces are
// the bytes that they have in memory, so that a crash handler can write them from where they lie.
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "dccd/export.h"
#include "dccd/monitor.h"

namespace dccd {

constexpr std::uint32_t RECORDING_VERSION = 2;  ///< 1, without distances beyond the bodies' own, can be read, too

/// A recording that cannot be read; the text names the input, the byte and the value.
struct DCCD_EXPORT RecordingError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct RecordedBody {
  MonitorBody setup;
  Positions t0, t1;  ///< [m] fixed frame
  std::shared_ptr<const Topology> topology;
  bool rigid = false;
  Eigen::Isometry3d pose_t0 = Eigen::Isometry3d::Identity(), pose_t1 = Eigen::Isometry3d::Identity();
  std::vector<double> radius_m;                     ///< uncertainty per vertex; empty: none
  std::shared_ptr<const ReferenceFrame> reference;  ///< null: nothing is left out of the separation
};

/// The parts of StepOutcome that do not depend on the machine.
struct RecordedAnswer {
  bool present = false;  ///< false: the program ended in the step
  StepStatus status = StepStatus::INTERNAL_ERROR;
  std::string reason;
  bool answered = false, complete = true, clear = false;
  StartState start_state = StartState::NOT_CHECKED;
  std::uint64_t total_contacts = 0, suppressed = 0, excluded_voxels = 0, substeps = 0;
  double unchecked_toc_lower = 0, earliest_toc = 0;
  std::vector<Contact> contacts;
  std::vector<StartIntersection> intersections;
};

struct StepRecording {
  std::string note;  ///< why it was written, by what
  std::uint64_t sequence = 0;
  StampNs start_ns = 0, stamp_ns = 0;
  MonitorOptions options;
  std::vector<RecordedBody> bodies;
  MonitorMap map;
  RecordedAnswer answer;
};

/// Copies; buffers of `recording` are used again. setAnswer copies what is in the outcome, setSource drops the answer.
DCCD_EXPORT void setSource(const StepSource& source, StepRecording& recording);
DCCD_EXPORT void setAnswer(const StepOutcome& outcome, StepRecording& recording);

/// A recording as the pieces of memory that its file consists of; large arrays stay where they are in the recording.
class DCCD_EXPORT RecordingImage {
 public:
  /// Valid until the recording changes.
  void build(const StepRecording& recording);
  /// Async-signal-safe. False with errno when the descriptor does not take all of it.
  bool write(int descriptor) const noexcept;
  std::size_t bytes() const;

 private:
  friend class RecordingWriter;
  friend class RecordingReader;
  struct Piece {
    const void* data = nullptr;  // null: `offset` into heads_
    std::size_t offset = 0, size = 0;
  };
  /// A leaf without the gap that its structure has in memory.
  struct PackedLeaf {
    std::uint16_t x, y, z, zero;
    std::uint32_t size;
  };
  std::vector<std::uint8_t> heads_;
  std::vector<Piece> pieces_;
  std::shared_ptr<const VoxelSurface> surface_;  // packed once for all steps with this map
  std::vector<PackedLeaf> leaves_;
};

/// Writes into a file beside it first, so that a file of this name is whole. Throws std::runtime_error naming the file
/// and the system's reason (disk full, no permission); nothing is left behind then.
DCCD_EXPORT void writeRecording(const std::string& path, const StepRecording& recording);

/// Lengths are held against the bytes that are there before anything is allocated. Throws RecordingError.
DCCD_EXPORT StepRecording readRecording(const void* data, std::size_t size, const std::string& name);
DCCD_EXPORT StepRecording readRecordingFile(const std::string& path);

}  // namespace dccd
