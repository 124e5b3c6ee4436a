// A client of the monitor in a page: takes a wanted twist, changes it least so that it keeps to ~limits, and passes it
// on. ~wanted and ~twist (geometry_msgs/TwistStamped) are of the frame ~link, about its origin, in the axes of the
// monitor's fixed frame; all links of ~links (default: all that the monitor speaks of) go with it. What is old, or
// unknown, is no reason to go: then ~twist is 0. This is no safety function; see doc/guarantees.md.
#include <cmath>
#include <deque>
#include <set>
#include <string>

#include <deformable_ccd/Limits.h>
#include <geometry_msgs/TwistStamped.h>
#include <ros/ros.h>

#include "guard_twist.h"

class GuardTwist {
 public:
  GuardTwist() : node_("~") {
    node_.getParam("link", link_);
    std::vector<std::string> links;
    if (node_.getParam("links", links)) links_.insert(links.begin(), links.end());
    if (!links_.empty()) links_.insert(link_);
    stopping_time_s_ = node_.param("stopping_time_s", 0.1);
    max_age_s_ = node_.param("max_age_s", 0.2);
    twist_ = node_.advertise<geometry_msgs::TwistStamped>("twist", 1);
    const std::string monitor = node_.param<std::string>("monitor", "/collision_monitor");
    limits_ = node_.subscribe<deformable_ccd::Limits>(monitor + "/limits", 1, [this](const auto& m) { said_ = m; });
    wanted_ = node_.subscribe<geometry_msgs::TwistStamped>("wanted", 1, [this](const auto& m) { asked_ = m; });
    timer_ = node_.createTimer(ros::Duration(PERIOD_S), [this](const ros::TimerEvent&) { decide(); });
  }

 private:
  static constexpr double PERIOD_S = 0.02;
  using Vector = Eigen::Vector3d;
  template <class Message>
  static Vector vectorOf(const Message& m) {
    return Vector(m.x, m.y, m.z);
  }

  /// Empty: the twist may be passed on.
  std::string change(double now_s, guard::Twist& twist) const {
    if (!said_) return "no news from the monitor";
    const deformable_ccd::Limits& said = *said_;
    if (!said.unknown.empty()) return said.unknown[0];
    const double since_s = now_s - said.header.stamp.toSec(), left_s = said.horizon - since_s - stopping_time_s_;
    if (!(since_s >= 0 && left_s > PERIOD_S)) return "the limits are " + std::to_string(since_s) + " s old";
    std::set<std::string> moving;  // bodies
    for (const std::string& body : said.links)
      if (links_.empty() || links_.count(body) || links_.count(guard::linkOf(body))) moving.insert(body);
    const auto moves = [&](const std::string& body) { return moving.count(body) > 0; };
    for (const std::string& link : links_)
      if (std::none_of(moving.begin(), moving.end(), [&](auto& m) { return m == link || guard::linkOf(m) == link; }))
        return "the limits do not speak of '" + link + "'";
    std::size_t own = 0;
    while (own < said.links.size() && said.links[own] != link_) ++own;
    if (own == said.links.size()) return "the limits do not speak of '" + link_ + "'";
    const Vector origin = vectorOf(said.origins[own]);
    guard::Moved moved;
    for (std::size_t i = 0; i < sent_.size(); ++i) {
      const double to_s = i + 1 < sent_.size() ? sent_[i + 1].first : now_s;
      const double from_s = std::max(sent_[i].first, said.header.stamp.toSec());
      if (to_s > from_s) moved.go(sent_[i].second, to_s - from_s);
    }
    std::vector<guard::Row> rows;
    for (std::size_t k = 0; k < said.speeds.size(); ++k) {
      if (!moves(said.links[said.link[k]]) || moves(said.partners[k])) continue;
      for (std::size_t i = 8 * k; i < 8 * k + 8; ++i)
        rows.push_back(guard::rowOf(vectorOf(said.corners[i]), vectorOf(said.normals[k]), said.speeds[k], said.horizon,
                                    since_s, origin, moved));
    }
    double reach_m = 0;
    for (std::size_t l = 0; l < said.links.size(); ++l)
      if (moves(said.links[l]))
        reach_m = std::max(reach_m, (vectorOf(said.origins[l]) - origin).norm() + said.reaches[l]);
    bool is_found = false;
    twist = guard::nearest(rows, twist, is_found);
    const double fastest = twist.head<3>().norm() + twist.tail<3>().norm() * reach_m;
    if (is_found && fastest > said.most_speed) twist *= said.most_speed / fastest;
    return is_found && guard::obeys(rows, twist) ? "" : "no motion that it knows keeps to the limits";
  }

  void decide() {
    const ros::Time now = ros::Time::now();
    guard::Twist twist = guard::Twist::Zero();
    std::string why = "nothing is wanted";
    if (asked_ && std::abs((now - asked_->header.stamp).toSec()) <= max_age_s_) {
      twist << vectorOf(asked_->twist.linear), vectorOf(asked_->twist.angular);
      why = twist.allFinite() ? change(now.toSec(), twist) : "what is wanted is not finite";
    }
    if (!why.empty()) twist.setZero();
    sent_.emplace_back(now.toSec(), twist);
    while (sent_.size() > 2 && sent_[1].first < now.toSec() - 10) sent_.pop_front();
    geometry_msgs::TwistStamped out;
    out.header.stamp = now;
    if (said_) out.header.frame_id = said_->header.frame_id;
    out.twist.linear.x = twist[0], out.twist.linear.y = twist[1], out.twist.linear.z = twist[2];
    out.twist.angular.x = twist[3], out.twist.angular.y = twist[4], out.twist.angular.z = twist[5];
    twist_.publish(out);
    if (!why.empty()) ROS_INFO_STREAM_THROTTLE(1, "stands: " << why);
  }

  ros::NodeHandle node_;
  std::string link_;
  std::set<std::string> links_;
  double stopping_time_s_ = 0, max_age_s_ = 0;
  ros::Publisher twist_;
  ros::Subscriber limits_, wanted_;
  ros::Timer timer_;
  deformable_ccd::Limits::ConstPtr said_;
  geometry_msgs::TwistStamped::ConstPtr asked_;
  std::deque<std::pair<double, guard::Twist>> sent_;  // since when
};

int main(int argc, char** argv) {
  ros::init(argc, argv, "guard_twist");
  GuardTwist client;
  ros::spin();
  return 0;
}
