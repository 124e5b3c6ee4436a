// What ~state says is missing.
#pragma once

#include <string>

#include <deformable_ccd/State.h>
#include <std_msgs/Bool.h>

#include "ros/support/probe.h"

namespace dccd {
namespace test {

/// Within 15 s: `missing` has the words, and neither is the state proved nor ~clear true.
inline bool becomesMissing(Probe<deformable_ccd::State>& state, Probe<std_msgs::Bool>& clear,
                           const std::string& words) {
  return waitUntil(
      [&] {
        const deformable_ccd::State last = state.last();
        for (const std::string& missing : last.missing) {
          if (missing.find(words) != std::string::npos) return !last.proved && !clear.last().data;
        }
        return false;
      },
      15);
}

}  // namespace test
}  // namespace dccd
