// A thread that does something again and again.
#pragma once

#include <atomic>
#include <functional>
#include <thread>
#include <utility>

#include <ros/rate.h>

namespace dccd {
namespace test {

/// Calls `tick` at that rate until it ends.
class Rate {
 public:
  Rate(double hz, std::function<void()> tick)
      : thread_([this, hz, tick = std::move(tick)] {
          for (ros::WallRate rate(hz); !ended_; rate.sleep()) tick();
        }) {}
  ~Rate() {
    ended_ = true;
    thread_.join();
  }

 private:
  std::atomic<bool> ended_{false};
  std::thread thread_;
};

}  // namespace test
}  // namespace dccd
