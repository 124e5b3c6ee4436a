// One step as a file: all that its answer follows from, and the answer. Free of ROS, readable on any machine.
//
// Little-endian; no alignment. "DCCDSTEP", u32 version, then the fields of StepRecording in the order of visit() in
// step_recording.cpp. Counts are u64 (of texts u32), enumerations and flags u8; arrays of positions and faces are
// the bytes that they have in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "dccd/detect.h"
#include "dccd/export.h"

namespace dccd {

/// Counts up with every change of the fields or their order. A file of another version is refused.
constexpr std::uint32_t RECORDING_VERSION = 13;

/// A recording that cannot be read; the text names the input, the byte and the value.
struct DCCD_EXPORT RecordingError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct StepRecording {
  std::string note;  ///< why it was written, by what
  Step step;
  Options options;
  bool has_answer = false;  ///< false: the step has not been answered
  /// The file has contacts, start state, patches and what they are judged by. Not: times, the tables of what it cost,
  /// counts that follow from the contacts.
  Outcome answer;
};

/// Hands over the bytes of the recording's file, one after another.
using TakeBytes = std::function<void(const void* data, std::size_t size)>;
DCCD_EXPORT void serialise(const StepRecording& recording, const TakeBytes& take);

/// Writes into a file beside it first, so that a file of this name is whole. Throws std::runtime_error naming the file
/// and the system's reason (disk full, no permission); nothing is left behind then.
DCCD_EXPORT void writeRecording(const std::string& path, const StepRecording& recording);

/// The same into a file that was not there before: STEM.step, or STEM_2.step and so on. Returns its name.
DCCD_EXPORT std::string writeNewRecording(const std::string& stem, const StepRecording& recording);

/// What a file holds of them: those of two that are the same are the same.
std::vector<std::uint8_t> recordedBytes(const Contact& contact);
std::vector<std::uint8_t> recordedBytes(const Outcome& answer);

/// Lengths are held against the bytes that are there before anything is allocated. Throws RecordingError.
DCCD_EXPORT StepRecording readRecording(const void* data, std::size_t size, const std::string& name);
DCCD_EXPORT StepRecording readRecordingFile(const std::string& path);

}  // namespace dccd
