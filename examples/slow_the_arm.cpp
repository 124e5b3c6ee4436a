// A client of the monitor in a page: slows an arm down instead of stopping it. It publishes ~scale (std_msgs/Float64, 0
// to 1 of full speed) fifty times a second; connect it to what scales your arm's speed, as MoveIt Servo's clients do,
// and let the arm stop, too, when ~scale itself falls silent.
//
// The monitor's ~speed_scale is taken as it is; it is 0 where nothing is proved. A scale is old when the frame that it
// follows from is the same for max_age_s: then it is 0 here. What rises does so evenly: a scale that jumps up would
// shake the cloth. What falls does so at once. This is no safety function; see doc/guarantees.md.
#include <algorithm>
#include <string>

#include <deformable_ccd/SpeedScale.h>
#include <ros/ros.h>
#include <std_msgs/Float64.h>

class SlowTheArm {
 public:
  SlowTheArm() : node_("~") {
    max_age_s_ = node_.param("max_age_s", 0.2);
    rise_per_s_ = node_.param("rise_per_s", 2.0);
    const std::string monitor = node_.param<std::string>("monitor", "/collision_monitor");
    scale_ = node_.advertise<std_msgs::Float64>("scale", 1, true);
    speed_ = node_.subscribe(monitor + "/speed_scale", 1, &SlowTheArm::onSpeed, this);
    timer_ = node_.createSteadyTimer(ros::WallDuration(PERIOD_S), [this](const ros::SteadyTimerEvent&) { decide(); });
  }

 private:
  static constexpr double PERIOD_S = 0.02;

  void onSpeed(const deformable_ccd::SpeedScale& message) {
    // What is latched may be as old as its frame; that it came just now says nothing.
    if (message.holds_until != said_.holds_until) newer_at_ = ros::SteadyTime::now();
    said_ = message;
  }

  void decide() {
    const bool old = newer_at_.isZero() || (ros::SteadyTime::now() - newer_at_).toSec() > max_age_s_;
    const double allowed = old ? 0 : std::clamp(said_.scale, 0.0, 1.0);
    now_ = std::min(allowed, now_ + rise_per_s_ * PERIOD_S);
    const std::string reason = old ? "no news from the monitor" : said_.reason;
    ROS_INFO_STREAM_THROTTLE(1, "scale " << now_ << (reason.empty() ? "" : ": ") << reason);
    std_msgs::Float64 scale;
    scale.data = now_;
    scale_.publish(scale);
  }

  ros::NodeHandle node_;
  double max_age_s_ = 0, rise_per_s_ = 0, now_ = 0;
  ros::Publisher scale_;
  ros::Subscriber speed_;
  ros::SteadyTimer timer_;
  deformable_ccd::SpeedScale said_;
  ros::SteadyTime newer_at_;  // the steady clock: no replay and no clock change can make old news fresh
};

int main(int argc, char** argv) {
  ros::init(argc, argv, "slow_the_arm");
  SlowTheArm client;
  ros::spin();
  return 0;
}
