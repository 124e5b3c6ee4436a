// Bags as they lie on the disk: opened or refused with what to do, several as one run, and their transforms, read ahead
// of the meshes.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rosbag/bag.h>
#include <rosbag/view.h>

#include "input/transforms.h"

namespace dccd {

/// Throws std::runtime_error naming the file and what to do.
void openBag(const std::string& path, rosbag::Bag& bag);

/// When the first and the last message of a bag came.
struct BagSpan {
  ros::Time begin = ros::TIME_MAX, end = ros::TIME_MIN;
  bool isEmpty() const { return end < begin; }  ///< no message came
};
/// The recorder's threads may write two messages in another order than that of their times, by this at the most [s].
constexpr double OUT_OF_ORDER_S = 0.1;
/// By the bag's index alone. None: it cannot be read.
std::optional<BagSpan> spanOf(const std::string& path);

/// A topic as bags name it.
std::string bagTopic(const std::string& topic);
StampNs receiptOf(const rosbag::MessageInstance& message);

/// The bags of one run, as if they were one: messages come in the order of their times.
class OpenBags {
 public:
  /// Throws what openBag() throws, and std::runtime_error where a bag is given twice.
  explicit OpenBags(const std::vector<std::string>& paths);
  /// In the order in which they begin; those without messages come last.
  const std::vector<std::string>& paths() const { return paths_; }
  const rosbag::Bag& bag(std::size_t i) const { return *bags_[i]; }
  struct View : rosbag::View {
    explicit View(const OpenBags& bags) {
      for (const auto& bag : bags.bags_) addQuery(*bag);
    }
    View(const OpenBags& bags, const std::vector<std::string>& topics) {
      for (const auto& bag : bags.bags_) addQuery(*bag, rosbag::TopicQuery(topics));
    }
  };

 private:
  std::vector<std::string> paths_;
  std::vector<std::unique_ptr<rosbag::Bag>> bags_;
};

/// What the bag's /tf_static says, of each frame once. Throws std::runtime_error where there is none, or where a frame
/// is at two places, of which nobody knows which one is meant.
tf2_msgs::TFMessage staticsOf(const std::string& path);

/// Feeds tf ahead of the meshes. Where tf's stamps go back, which forgets all before, it waits until those of the
/// meshes have gone back, too.
class TransformWindow {
 public:
  /// The first static transform of each frame is fed at once. One that comes in its place holds from then on. `lent`:
  /// of another bag, for frames that have none in these.
  TransformWindow(const OpenBags& bags, TransformFeed& feed, const tf2_msgs::TFMessage& lent);
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
  OpenBags::View view_, statics_;
  rosbag::View::iterator next_, next_static_;
  tf2_msgs::TFMessage::ConstPtr waiting_;  // the message at next_, where it was read already
  std::map<std::size_t, StampNs> newest_mesh_;
  std::optional<ros::Time> meshes_went_back_;
};

}  // namespace dccd
