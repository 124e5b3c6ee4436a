// What a crash of the node leaves behind: the step that it was computing, as a recording.
#pragma once

#include <string>

#include "record/flight_recorder.h"

namespace dccd {

/// What the handler writes. For one FlightRecorder of the process.
FlightRecorder::NewestImage& crashImage();

/// From now on a crash (SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT) of this process writes the step that the recorder of
/// crashImage() had last into FOLDER/crash_OWNER_PID.step (with a number behind it where that is there already), then
/// goes on to what the signal did before. For programs that own their process. Nothing but async-signal-safe calls on
/// memory that was made ready before. A path of more than 4000 bytes is refused by std::invalid_argument.
void installCrashHandler(const std::string& folder, const std::string& owner = {});

}  // namespace dccd
