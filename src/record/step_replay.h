// A recorded step once more, by the same call.
#pragma once

#include <string>
#include <vector>

#include "dccd/export.h"

#include "record/step_recording.h"

namespace dccd {

struct StepReplay {
  Outcome answer;
  /// What differs from the recorded answer, one sentence each; empty: the same bit for bit, or nothing to compare with.
  std::vector<std::string> differences;
};

/// Computes the step with the recorded options, but without a deadline and on `threads` workers: neither may change an
/// answer. A step that ran out of its budget, or was cut at what a step may find, was answered in part: then what it
/// reported as certain must be there again, as far as no such limit cuts the replay, nor its list of contacts. Throws
/// std::invalid_argument when the options or bodies of the recording are not possible.
DCCD_EXPORT StepReplay replayStep(const StepRecording& recording, int threads = 1);

/// Bits that differ between two answers to the same step, one sentence each, ten at most. With earliest_only each may
/// list another crossing.
DCCD_EXPORT std::vector<std::string> compareAnswers(const Options& options, const Outcome& recorded,
                                                    const Outcome& replayed);

/// "VF cloth 3 | table 0 1 2", with the voxel where there is one.
DCCD_EXPORT std::string describeContact(const Contact& contact, const std::vector<Body>& bodies);

}  // namespace dccd
