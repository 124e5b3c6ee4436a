// A client of the monitor in a page: says when an arm must stop. It publishes ~stop (std_msgs/Bool) twenty times a
// second; connect it to whatever stops your arm, and let that stop, too, when ~stop itself falls silent.
//
// Stop when a new contact is predicted nearer in time than the arm needs to stand still, when one has begun, when
// ~state is not proved, and when either is old: what is not known is not clear. What is expected to touch, and what
// lasts, is no reason to stop; after a new contact the arm stays for hold_s. This is no safety function; see
// doc/guarantees.md.
#include <algorithm>
#include <string>

#include <deformable_ccd/FirstContact.h>
#include <deformable_ccd/State.h>
#include <ros/ros.h>
#include <std_msgs/Bool.h>

class StopTheArm {
 public:
  StopTheArm() : node_("~") {
    // From the moment at which the tracker's camera looked to the arm standing still: latency of all that lies between,
    // and braking. The monitor's look_ahead_s must be longer.
    stopping_time_s_ = node_.param("stopping_time_s", 0.3);
    max_age_s_ = node_.param("max_age_s", 0.2);
    hold_s_ = node_.param("hold_s", 0.5);
    const std::string monitor = node_.param<std::string>("monitor", "/collision_monitor");
    stop_ = node_.advertise<std_msgs::Bool>("stop", 1, true);
    state_ = node_.subscribe(monitor + "/state", 1, &StopTheArm::onState, this);
    prediction_ = node_.subscribe(monitor + "/time_to_contact", 1, &StopTheArm::onPrediction, this);
    timer_ = node_.createSteadyTimer(ros::WallDuration(0.05), [this](const ros::SteadyTimerEvent&) { decide(); });
  }

 private:
  void onState(const deformable_ccd::State& message) {
    proved_ = message.proved;
    if (message.touching == deformable_ccd::State::NEW) hold("something touches anew");
    // What is latched may be as old as the frame that it ends with; that it came just now says nothing.
    const bool newer = message.holds_until != holds_until_;
    holds_until_ = message.holds_until;
    if (newer) state_at_ = ros::SteadyTime::now();
  }

  void onPrediction(const deformable_ccd::FirstContact& message) {
    answered_ = message.answered;
    // Beyond the horizon nothing is known: it counts as the time of a contact.
    contact_in_s_ = message.contact ? std::min(message.seconds, message.horizon) : message.horizon;
    predicted_at_ = ros::SteadyTime::now();
  }

  void hold(const std::string& reason) {
    held_at_ = ros::SteadyTime::now();
    held_for_ = reason;
  }

  /// Empty: the arm may move.
  std::string reasonToStop() {
    const ros::SteadyTime now = ros::SteadyTime::now();
    const double state_age_s = (now - state_at_).toSec(), prediction_age_s = (now - predicted_at_).toSec();
    if (state_at_.isZero() || state_age_s > max_age_s_) return "no news from the monitor";
    if (!proved_) return "nothing is proved";
    if (predicted_at_.isZero() || prediction_age_s > max_age_s_) return "no prediction; is look_ahead_s set?";
    if (!answered_) return "a prediction without an answer";
    if (contact_in_s_ - prediction_age_s <= stopping_time_s_) hold("a new contact within the stopping time");
    return !held_at_.isZero() && (now - held_at_).toSec() <= hold_s_ ? held_for_ : "";
  }

  void decide() {
    const std::string reason = reasonToStop();
    if (reason != told_) ROS_INFO_STREAM((reason.empty() ? "go" : "stop: ") << reason);
    told_ = reason;
    std_msgs::Bool stop;
    stop.data = !reason.empty();
    stop_.publish(stop);
  }

  ros::NodeHandle node_;
  double stopping_time_s_ = 0, max_age_s_ = 0, hold_s_ = 0;
  ros::Publisher stop_;
  ros::Subscriber state_, prediction_;
  ros::SteadyTimer timer_;
  bool proved_ = false, answered_ = false;
  double contact_in_s_ = 0;
  ros::Time holds_until_;
  // The steady clock: no replay and no clock change can make old news fresh.
  ros::SteadyTime state_at_, predicted_at_, held_at_;
  std::string held_for_;
  std::string told_ = "?";
};

int main(int argc, char** argv) {
  ros::init(argc, argv, "stop_the_arm");
  StopTheArm client;
  ros::spin();
  return 0;
}
