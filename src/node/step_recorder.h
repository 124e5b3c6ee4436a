// The node's flight recorder: parameter record_steps, the service ~record_step, and what the log
// says.
#pragma once

#include <memory>
#include <string>

#include "config/monitor_config.h"
#include "record/flight_recorder.h"

namespace dccd {

class StepRecorder {
 public:
  /// Listens to the monitor unless record_steps is 0. The monitor must not run any more when this ends.
  /// `node`: its name, a part of each file's.
  StepRecorder(const MonitorConfig& config, Monitor& monitor, const std::string& node);

  /// Writes the steps that are kept. True with the files' names in the message, false with the reason why there are
  /// none.
  bool record(std::string& message);
  /// One sentence for the log about an answer that contradicts its own promises; empty: none.
  std::string takeSurprise();

 private:
  std::string folder_, owner_;
  std::unique_ptr<FlightRecorder> recorder_;
};

}  // namespace dccd
