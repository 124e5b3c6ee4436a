#include "node/bag_reading.h"

#include <algorithm>
#include <fstream>
#include <set>
#include <stdexcept>
#include <vector>

#include "dccd/regular_file.h"
#include "input/short_text.h"

namespace dccd {
namespace {

// Transforms are fed this far ahead of the meshes and kept this long behind them; so a long bag needs no more memory.
const ros::Duration TF_AHEAD(10.0);
const ros::Duration TF_KEPT(60.0);
// Where stamps go back (a recorded loop), transforms and meshes are recorded this much apart at most.
const ros::Duration SEAM(1.0);

}  // namespace

void openBag(const std::string& path, rosbag::Bag& bag) {
  // rosbag reads a device for its first line until memory is gone.
  if (const std::string problem = regularFileProblem(path); !problem.empty()) {
    throw std::runtime_error(path + ": " + problem);
  }
  const std::string remedy = "; run: rosbag reindex " + path;
  try {
    bag.open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagUnindexedException&) {
    throw std::runtime_error(path + ": the bag has no index, as its recording was not ended" + remedy);
  } catch (const rosbag::BagException& error) {
    const std::string mark = "#ROSBAG V";
    std::string begin(mark.size(), '\0');
    std::ifstream file(path, std::ios::binary);
    file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
    if (file.gcount() == 0) throw std::runtime_error(path + ": the file is empty: nothing was recorded");
    if (begin != mark) throw std::runtime_error(path + ": the file is no bag: it does not begin with '" + mark + "'");
    throw std::runtime_error(path + ": the bag is cut or damaged (" + shortText(error.what()) + ")" + remedy);
  }
}

TransformWindow::TransformWindow(const rosbag::Bag& bag, TransformFeed& feed)
    : feed_(feed),
      view_(bag, rosbag::TopicQuery("/tf")),
      statics_(bag, rosbag::TopicQuery("/tf_static")),
      next_(view_.begin()),
      next_static_(statics_.begin()) {
  std::set<std::string> known;
  for (const rosbag::MessageInstance& m : statics_) {
    const auto tf = m.instantiate<tf2_msgs::TFMessage>();
    if (!tf) continue;
    tf2_msgs::TFMessage firsts;
    for (const auto& transform : tf->transforms) {
      if (known.insert(transform.child_frame_id).second) firsts.transforms.push_back(transform);
    }
    feed_.add(firsts, true);
  }
}

ros::Duration TransformWindow::length() { return TF_KEPT + TF_AHEAD; }

void TransformWindow::meshComes(std::size_t body, StampNs stamp_ns, const ros::Time& at) {
  if (stamp_ns == 0) return;
  const auto [newest, first] = newest_mesh_.try_emplace(body, stamp_ns);
  if (!first && stamp_ns < newest->second) {
    meshes_went_back_ = at;
    newest_mesh_.clear();
    newest_mesh_[body] = stamp_ns;
  } else {
    newest->second = std::max(newest->second, stamp_ns);
  }
}

void TransformWindow::feedUntil(const ros::Time& at) {
  for (; next_static_ != statics_.end() && next_static_->getTime() <= at; ++next_static_) {
    if (const auto tf = next_static_->instantiate<tf2_msgs::TFMessage>()) feed_.add(*tf, true);
  }
  for (; next_ != view_.end() && next_->getTime() <= at + TF_AHEAD; ++next_) {
    if (!waiting_) waiting_ = next_->instantiate<tf2_msgs::TFMessage>();
    // Where the meshes never go back, its turn comes all the same.
    const ros::Time recorded = next_->getTime();
    const bool due = recorded + SEAM <= at || (meshes_went_back_ && recorded <= *meshes_went_back_ + SEAM);
    if (waiting_ && feed_.clears(*waiting_, false) && !due) return;
    if (waiting_) feed_.add(*waiting_, false);
    waiting_.reset();
  }
}

}  // namespace dccd
