#include "node/state_reporter.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <new>
#include <utility>

#include <ros/time.h>
#include <std_msgs/Bool.h>
#include <std_msgs/Float64.h>
#include <boost/make_shared.hpp>

#include "input/steady_clock.h"
#include "output/advice.h"

namespace dccd {
namespace {

constexpr std::chrono::milliseconds PERIOD{20};
// A /clock that stands is a pause; for longer, whoever sent it may be gone.
constexpr std::int64_t LONGEST_STAND_NS = 10'000'000'000;

}  // namespace

std::int64_t WatchClock::now() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::int64_t steady_ns = steadyNs(), ros_ns = static_cast<std::int64_t>(ros::Time::now().toNSec());
  // Before the first /clock the time is 0. There may never be one, and true time passes until then.
  const bool simulated = ros::Time::isSimTime() && ros_ns > 0;
  const std::int64_t now_ns = simulated ? ros_ns : steady_ns;
  const bool begins = simulated != std::exchange(simulated_, simulated) || last_ns_ == 0;
  if (begins || now_ns != last_ns_) {
    const std::int64_t true_ns = steady_ns - std::exchange(changed_ns_, steady_ns);
    const bool is_limited = no_faster_ || now_ns < last_ns_;
    const std::int64_t gone_ns = std::abs(now_ns - last_ns_);
    if (!begins) elapsed_ns_ += is_limited ? std::min(gone_ns, true_ns) : gone_ns;
    last_ns_ = now_ns;
  } else if (const std::int64_t beyond_ns = steady_ns - changed_ns_ - LONGEST_STAND_NS; beyond_ns > 0) {
    elapsed_ns_ += beyond_ns;
    changed_ns_ += beyond_ns;
  }
  return elapsed_ns_;
}

StateReporter::StateReporter(ros::NodeHandle& private_node, const LivenessLimits& limits,
                             const std::optional<SpeedLaw>& law)
    : state_(private_node.advertise<deformable_ccd::State>("state", TOPIC_QUEUE, true)),
      clear_(private_node.advertise<std_msgs::Bool>("clear", TOPIC_QUEUE, true)),
      law_(law),
      liveness_(limits) {
  if (law_) {
    speed_ = private_node.advertise<deformable_ccd::SpeedScale>("speed_scale", TOPIC_QUEUE, true);
    speed_value_ = private_node.advertise<std_msgs::Float64>("speed_scale/value", TOPIC_QUEUE, true);
  }
  forgotten("no frame has been answered yet");
  thread_ = std::thread([this] { watch(); });
}

StateReporter::~StateReporter() {
  stop();
  thread_.join();
}

void StateReporter::setLimits(const LivenessLimits& limits) {
  const std::lock_guard<std::mutex> lock(mutex_);
  liveness_.setLimits(limits);
}

void StateReporter::frameCame(std::int64_t arrival_ns) {
  const std::lock_guard<std::mutex> lock(mutex_);
  liveness_.frame(arrival_ns, clock_.now());
}

void StateReporter::mapCame(std::int64_t arrival_ns) {
  const std::lock_guard<std::mutex> lock(mutex_);
  liveness_.mapCame(arrival_ns, clock_.now());
}

void StateReporter::mapSettled(std::int64_t arrival_ns, std::int64_t placed_ns) {
  const std::lock_guard<std::mutex> lock(mutex_);
  liveness_.mapSettled(arrival_ns, placed_ns);
}

void StateReporter::staticCame(const std::string& body, std::uint64_t number) {
  const std::lock_guard<std::mutex> lock(mutex_);
  liveness_.staticCame(body, number, clock_.now());
  say(false);
}

void StateReporter::staticInUse(const std::string& body, std::uint64_t number) {
  const std::lock_guard<std::mutex> lock(mutex_);
  liveness_.staticInUse(body, number);
}

void StateReporter::setHint(const std::string& hint) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (std::exchange(hint_, hint) != hint) say(true);
}

void StateReporter::tell(const Outcome& outcome, const Statement& statement, const std::string& frame,
                         const SpeedScale& speed) {
  const std::lock_guard<std::mutex> lock(mutex_);
  answer_ = statement;
  if (law_) speed_told_ = toSpeedScale(outcome, speed, frame);
  const ros::Time before = told_.holds_until;
  told_ = toState(outcome, frame);
  // What was answered last stays to be seen; that it is no more proved is said.
  if (!outcome.answered) told_.holds_until = before;
  const bool used_map = outcome.answered && outcome.obstacle && !told_.map_stamp.isZero();
  const std::int64_t now_ns = clock_.now();
  liveness_.outcome(outcome.arrival_ns, used_map ? told_.map_age : -1, now_ns);
  if (outcome.answered) {
    stamp_age_s_ = secondsBetween(outcome.stamp_ns, static_cast<StampNs>(ros::Time::now().toNSec()));
    told_ns_ = now_ns;
  }
  say(true);
}

void StateReporter::tellSpeed(const Outcome& outcome, const SpeedScale& speed) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!law_) return;
  speed_told_ = toSpeedScale(outcome, speed, told_.header.frame_id);
  say(true);
}

std::string StateReporter::whyNotProved() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return unproved_;
}

void StateReporter::asked(const std::string& what) {
  const std::lock_guard<std::mutex> lock(mutex_);
  liveness_.ask(what);
  say(true);
}

void StateReporter::voidAnswer(const std::string& reason) {
  answer_ = Statement();
  answer_.assurance.missing.push_back(reason);
  speed_told_ = deformable_ccd::SpeedScale();
  told_ = toState(Outcome(), std::move(told_.header.frame_id));
}

void StateReporter::takeBack(const std::string& reason) {
  const std::lock_guard<std::mutex> lock(mutex_);
  voidAnswer(reason);
  say(true);
}

void StateReporter::forgotten(const std::string& reason) {
  const std::lock_guard<std::mutex> lock(mutex_);
  voidAnswer(reason);
  liveness_.forget();
  say(true);
}

void StateReporter::setEnabled(bool on) {
  const std::lock_guard<std::mutex> lock(mutex_);
  liveness_.disable(!on);
  say(false);
}

void StateReporter::stop() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (stopped_) return;
  liveness_.stop();
  say(true);
  stopped_ = true;
  ended_.notify_all();
}

void StateReporter::watch() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!ended_.wait_for(lock, PERIOD, [this] { return stopped_; })) {
    try {
      say(false);
    } catch (const std::bad_alloc&) {  // for want of memory: the next period has its turn
      hinders_.clear();
    }
  }
}

void StateReporter::say(bool always) {
  if (stopped_) return;
  std::vector<std::string> sentences;
  std::vector<Fault::Kind> kinds;
  for (Fault& fault : liveness_.faults(clock_.now())) {
    kinds.push_back(fault.kind);
    sentences.push_back(std::move(fault.sentence));
  }
  const std::string slowed = law_ ? whySlowed(clock_.now()) : "";
  const bool is_slowed = !slowed.empty(), as_slow = std::exchange(slowed_, is_slowed) == is_slowed;
  if (std::exchange(hinders_, kinds) == kinds && as_slow && !always) return;
  Statement statement = answer_;
  statement.assurance.hinder(sentences);
  unproved_ = statement.assurance.proved ? "" : statement.assurance.missing.front();
  if (!statement.is_doubts_fault) statement.hint = joined(statement.hint, hint_);
  // What is published as an object wakes roscpp's thread only where somebody listens: that thread takes locks, and
  // perhaps the core, from the worker, which has yet to publish the contacts.
  const auto message = boost::make_shared<deformable_ccd::State>(told_);
  fillState(statement, *message);
  message->header.stamp = ros::Time::now();
  const auto clear = boost::make_shared<std_msgs::Bool>();
  clear->data = message->clear;
  clear_.publish(clear);
  state_.publish(message);
  if (law_) saySpeed(statement.assurance, slowed);
}

std::string StateReporter::whySlowed(std::int64_t now_ns) const {
  return whyTooOld(stamp_age_s_ + secondsBetween(told_ns_, now_ns), liveness_.answerAge(now_ns), *law_);
}

void StateReporter::saySpeed(const Assurance& assurance, const std::string& slowed) {
  const auto message = boost::make_shared<deformable_ccd::SpeedScale>(speed_told_);
  if (!assurance.proved) {
    limitSpeed("not proved: " + assurance.missing.front(), *message);
  } else if (!slowed.empty()) {
    limitSpeed(slowed, *message);
  }
  message->header.stamp = ros::Time::now();
  message->header.frame_id = told_.header.frame_id;
  speed_.publish(message);
  const auto value = boost::make_shared<std_msgs::Float64>();
  value->data = message->scale;
  speed_value_.publish(value);
}

}  // namespace dccd
