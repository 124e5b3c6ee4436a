// The motion that is nearest to a wanted one and keeps to ~limits of the monitor: its rule, without ROS.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <string>
#include <vector>

namespace guard {

using Twist = Eigen::Matrix<double, 6, 1>;  ///< linear, m/s, then angular, rad/s, in the fixed frame

/// Whose the body of ~limits is: the second one of the link `arm` is `arm/2`.
inline std::string linkOf(const std::string& body) {
  const std::size_t slash = body.find_last_not_of("0123456789");
  const bool is_numbered = slash != std::string::npos && slash + 1 < body.size() && body[slash] == '/';
  return is_numbered ? body.substr(0, slash) : body;
}

/// along . twist + turns |angular|^2 is at most `most`.
struct Row {
  Twist along;
  double turns, most;
};

inline bool obeys(const std::vector<Row>& rows, const Twist& twist) {
  return std::all_of(rows.begin(), rows.end(), [&](const Row& row) {
    return row.along.dot(twist) + row.turns * twist.tail<3>().squaredNorm() <= row.most;
  });
}

/// Changes least, a turn by 1 rad as much as a way of 0.2 m. With one row this is its closed form, with several it goes
/// from one to the next (Hildreth's rule). Zero where none is found: then `is_found` is false, unless zero obeys.
inline Twist nearest(const std::vector<Row>& rows, const Twist& wanted, bool& is_found) {
  constexpr int ROUNDS = 200;
  Twist weight;
  weight << 1, 1, 1, 25, 25, 25;  // of a change, inverted
  const double turns = wanted.tail<3>().squaredNorm();
  Twist twist = wanted;
  std::vector<double> held(rows.size(), 0);
  for (int round = 0; round < ROUNDS && !obeys(rows, twist); ++round) {
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const Twist across = weight.cwiseProduct(rows[k].along);
      const double size = across.dot(rows[k].along);
      if (!(size > 0)) continue;
      const double over = rows[k].along.dot(twist) - (rows[k].most - rows[k].turns * turns - 1e-9);
      const double step = std::max(-held[k], over / size);
      held[k] += step;
      twist -= step * across;
    }
  }
  double low = 0, high = 1;  // what was not reached is made up for by going slower
  if (obeys(rows, twist)) low = 1;
  for (int i = 0; low < 1 && i < 40; ++i) (obeys(rows, (low + high) / 2 * twist) ? low : high) = (low + high) / 2;
  twist *= low;
  is_found = obeys(rows, twist);
  return is_found ? twist : Twist(Twist::Zero());
}

/// Where the frame is, by the twists that it was given since: its origin goes straight, and it turns about it.
struct Moved {
  Eigen::Vector3d way = Eigen::Vector3d::Zero();
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  void go(const Twist& twist, double seconds) {
    way += twist.head<3>() * seconds;
    const double angle = twist.tail<3>().norm() * seconds;
    if (angle > 0) turn = Eigen::AngleAxisd(angle, twist.tail<3>().normalized()) * turn;
  }
};

/// The row of a half-space for one of eight corners, `since_s` after the stamp: what was gone until then has its share
/// of speed * horizon. `origin`: of the frame that is moved, at the stamp.
inline Row rowOf(const Eigen::Vector3d& corner, const Eigen::Vector3d& normal, double speed, double horizon_s,
                 double since_s, const Eigen::Vector3d& origin, const Moved& moved) {
  const Eigen::Vector3d arm = moved.turn * (corner - origin);
  const double left_s = horizon_s - since_s, gone_m = normal.dot(moved.way + arm - (corner - origin));
  Row row;
  row.along << normal, arm.cross(normal);
  row.turns = left_s * arm.norm() / 2;
  row.most = (speed * horizon_s - gone_m) / left_s;
  return row;
}

}  // namespace guard
