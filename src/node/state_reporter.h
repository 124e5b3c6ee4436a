// ~state, ~clear and ~speed_scale: the one place where the node says what it can vouch for. Each step's assurance comes
// from the worker; what ends it between steps is watched on a thread of its own, so that no step and no callback delays
// it.
#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <deformable_ccd/State.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>

#include "dccd/monitor_extras.h"
#include "node/liveness.h"
#include "output/output_messages.h"
#include "output/safe_until_messages.h"

namespace dccd {

/// Safe to call from any thread. Runs with the steady clock; with /use_sim_time, from the first /clock on, with that,
/// at its rate, and stands while that stands, for ten seconds. While /clock goes back true time passes, as much as it
/// goes back at the most: a clock that runs backwards hides no silence, and one that jumps back, as of a bag in a loop,
/// takes nothing away.
class WatchClock {
 public:
  /// no_faster: than true time, for what waits for other computers' messages.
  explicit WatchClock(bool no_faster = false) : no_faster_(no_faster) {}
  std::int64_t now();

 private:
  const bool no_faster_;
  std::mutex mutex_;
  bool simulated_ = false;
  std::int64_t last_ns_ = 0, changed_ns_ = 0, elapsed_ns_ = 0;  // changed: on the steady clock
};

/// Safe to call from any thread.
class StateReporter {
 public:
  /// `law`: of ~speed_scale, which is not there without one.
  StateReporter(ros::NodeHandle& private_node, const LivenessLimits& limits,
                const std::optional<SpeedLaw>& law = std::nullopt);
  ~StateReporter();
  StateReporter(const StateReporter&) = delete;
  StateReporter& operator=(const StateReporter&) = delete;

  void setLimits(const LivenessLimits& limits);

  /// A frame of the clock body came, whose outcome will bring the same `arrival_ns`.
  void frameCame(std::int64_t arrival_ns);
  /// A map came; the node uses or has refused those that came up to then.
  void mapCame(std::int64_t arrival_ns);
  void mapSettled(std::int64_t arrival_ns, std::int64_t placed_ns);
  /// Frames of a static body came, up to this number.
  void staticCame(const std::string& body, std::uint64_t number);
  /// The one of this number is in use from the next step on.
  void staticInUse(const std::string& body, std::uint64_t number);
  /// A step's answer, or why there is none, and what it allows.
  void tell(const Outcome& outcome, const Statement& statement, const std::string& frame, const SpeedScale& speed);
  /// Of the step that was told last: what it allows now.
  void tellSpeed(const Outcome& outcome, const SpeedScale& speed);
  /// Why ~state says that nothing is proved; empty: it says that it is.
  std::string whyNotProved();
  /// What looks like a mistake, with what to do; it stands in the reason as long as nothing is proved. Empty: nothing.
  void setHint(const std::string& hint);
  /// From now on nothing is proved, until forgotten() says that it is done: what is asked for waits for the worker.
  void asked(const std::string& what);
  /// What was told last is void.
  void takeBack(const std::string& reason);
  /// The same, and all frames are forgotten; what was asked for is done.
  void forgotten(const std::string& reason);
  void setEnabled(bool on);
  /// The last word: the monitor ends.
  void stop();

 private:
  void watch();
  void voidAnswer(const std::string& reason);
  /// The mutex is held. Publishes what holds now; `always`: also if it is what was said last.
  void say(bool always);
  /// Why what slows down would react too late to what the newest answer did not see; empty: it would not.
  std::string whySlowed(std::int64_t now_ns) const;
  void saySpeed(const Assurance& assurance, const std::string& slowed);

  std::mutex mutex_;
  std::condition_variable ended_;
  ros::Publisher state_, clear_, speed_, speed_value_;  // the last two where there is a law
  const std::optional<SpeedLaw> law_;
  WatchClock clock_;
  Liveness liveness_;
  Statement answer_;                       // of the last step or what came instead, without what is wrong besides
  deformable_ccd::State told_;             // its other fields
  deformable_ccd::SpeedScale speed_told_;  // of the last step
  double stamp_age_s_ = 0;                 // of its frame, when it was told
  std::int64_t told_ns_ = 0;               // when that was, on the watch's clock
  bool slowed_ = false;                    // by its age, as it was said last
  std::string hint_, unproved_;
  std::vector<Fault::Kind> hinders_;  // what was said to stand in its way
  bool stopped_ = false;
  std::thread thread_;
};

}  // namespace dccd
