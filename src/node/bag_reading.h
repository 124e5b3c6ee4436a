// Bags as they lie on the disk: opened or refused with what to do, and their transforms, read ahead of the meshes.
#pragma once

#include <map>
#include <optional>
#include <string>

#include <rosbag/bag.h>
#include <rosbag/view.h>

#include "input/transforms.h"

namespace dccd {

/// Throws std::runtime_error naming the file and what to do.
void openBag(const std::string& path, rosbag::Bag& bag);

/// Feeds tf ahead of the meshes. Where tf's stamps go back, which forgets all before, it waits until those of the
/// meshes have gone back, too.
class TransformWindow {
 public:
  /// The first static transform of each frame is fed at once. One that comes in its place holds from then on.
  TransformWindow(const rosbag::Bag& bag, TransformFeed& feed);
  /// What a buffer must hold: ahead of the meshes, and behind them.
  static ros::Duration length();
  /// A mesh with this stamp (0: none) is the next message of the bag.
  void meshComes(std::size_t body, StampNs stamp_ns, const ros::Time& at);
  void feedUntil(const ros::Time& at);
  /// Of what came up to then some is not fed: it waits for the meshes.
  bool isBehind(const ros::Time& at) { return waiting_ && next_->getTime() <= at; }

 private:
  /// None of what is no TFMessage, and of one that is damaged, which the feed hears.
  tf2_msgs::TFMessage::ConstPtr read(const rosbag::MessageInstance& message);

  TransformFeed& feed_;
  rosbag::View view_, statics_;
  rosbag::View::iterator next_, next_static_;
  tf2_msgs::TFMessage::ConstPtr waiting_;  // the message at next_, where it was read already
  std::map<std::size_t, StampNs> newest_mesh_;
  std::optional<ros::Time> meshes_went_back_;
};

}  // namespace dccd
