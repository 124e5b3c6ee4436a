// The last steps of a monitor, kept so that they can be written when somebody asks, or when an answer contradicts what
// was promised.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "dccd/export.h"

#include "dccd/stream.h"
#include "record/step_recording.h"

namespace dccd {

/// What of an outcome contradicts the promises of its options; empty: nothing. The step failed, `exact` left a pair
/// undecided though no deadline expired, or a time lies outside of the step.
DCCD_EXPORT std::string surpriseIn(const Outcome& outcome, const Options& options);

/// Memory: `steps` times the positions and contacts of a step; buffers are kept. Not thread-safe: one thread, the
/// monitor's.
class DCCD_EXPORT FlightRecorder : public StepListener {
 public:
  static constexpr std::size_t MAX_SURPRISES = 16;  ///< files of surprises per recorder, so that no disk is filled

  /// steps >= 1. The folder is created when a file is written. `owner`: a part of each file's name, for a folder that
  /// several share. max_map_bytes: steps are forgotten whose maps, other than the newest step's, take more than this
  /// together.
  FlightRecorder(std::size_t steps, std::string folder, std::string owner = {},
                 std::size_t max_map_bytes = std::numeric_limits<std::size_t>::max());

  void onStep(const Step& step, const Options& options) override;
  void onOutcome(const Outcome& outcome) override;

  /// Steps that are kept.
  std::size_t size() const { return count_; }
  /// Writes all steps that are kept, the newest first, into files that were not there before; returns them. Throws
  /// std::runtime_error naming the file, why it cannot be written, and what was written before it.
  std::vector<std::string> writeAll(const std::string& note);
  /// Of all recorders of the process, for one that is to end: files that are being written. From any thread.
  static int filesUnderWay();
  /// One sentence about a surprise since the last call, with the file that it is in; empty: none.
  std::string takeSurprise();

 private:
  StepRecording& newest() { return kept(0); }
  /// The step that was kept `age` steps before the newest.
  StepRecording& kept(std::size_t age) { return ring_[(next_ + 2 * ring_.size() - 1 - age) % ring_.size()]; }
  void forgetOldMaps();
  std::string write(StepRecording& recording, const std::string& kind, const std::string& note);

  std::vector<StepRecording> ring_;
  std::size_t next_ = 0, count_ = 0, surprises_ = 0;
  const std::size_t max_map_bytes_;
  std::string folder_, owner_, surprise_;
};

}  // namespace dccd
