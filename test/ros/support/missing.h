// A monitor of which a test waits for what ~state says.
#pragma once

#include <string>

#include <deformable_ccd/State.h>

#include "ros/support/monitor_fixture.h"

namespace dccd {
namespace test {

struct StateTest : MonitorTest {
  explicit StateTest(const std::string& name) : MonitorTest(name) {}
  Probe<deformable_ccd::State> state{node, name_ + "/state"};

  bool becomesProved() {
    return waitUntil([&] { return state.count() > 0 && state.last().proved && state.last().clear; }, 15);
  }
  /// `missing` has the words, and neither is the state proved nor ~clear true.
  bool misses(const std::string& words) {
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
};

}  // namespace test
}  // namespace dccd
