// Where tf says that things are: at exactly the stamp asked for, whatever else has come by then.
#include "input/transforms.h"

#include <gtest/gtest.h>
#include <tf2/buffer_core.h>

#include <cmath>
#include <cstring>
#include <random>

namespace dccd {
namespace test {
namespace {

constexpr StampNs MS = 1000000, START = 1700000000000 * MS;

geometry_msgs::TransformStamped sent(const std::string& parent, const std::string& child, StampNs stamp_ns,
                                     const Eigen::Quaterniond& q, const Vec3& p) {
  geometry_msgs::TransformStamped out;
  out.header.stamp.fromNSec(static_cast<std::uint64_t>(stamp_ns));
  out.header.frame_id = parent;
  out.child_frame_id = child;
  out.transform.translation.x = p.x(), out.transform.translation.y = p.y(), out.transform.translation.z = p.z();
  out.transform.rotation.w = q.w(), out.transform.rotation.x = q.x();
  out.transform.rotation.y = q.y(), out.transform.rotation.z = q.z();
  return out;
}

class Transforms : public ::testing::Test {
 protected:
  tf2::BufferCore buffer;
  TransformFeed feed;
  std::mt19937_64 random{7};
  std::string reason;

  void add(const geometry_msgs::TransformStamped& transform, bool is_static = false) {
    tf2_msgs::TFMessage message;
    message.transforms.push_back(transform);
    feed.add(message, is_static);
    buffer.setTransform(transform, "test", is_static);
  }
  Vec3 place() {
    std::normal_distribution<double> normal;
    return {normal(random), normal(random), normal(random)};
  }
  Eigen::Quaterniond turn() {
    std::normal_distribution<double> normal;
    return Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random)).normalized();
  }
  /// The stamps, where no frame changes its parent.
  std::vector<StampNs> between(const std::string& target, const std::string& source, StampNs from_ns, StampNs to_ns) {
    std::vector<TransformFeed::NewParent> changes;
    const std::vector<StampNs> stamps = feed.stampsBetween(target, source, from_ns, to_ns, changes);
    EXPECT_TRUE(changes.empty());
    return stamps;
  }
  Eigen::Isometry3d pose(const std::string& target, const std::string& source, StampNs stamp_ns) {
    Eigen::Isometry3d found;
    EXPECT_TRUE(feed.lookup(target, source, stamp_ns, found, reason)) << reason;
    return found;
  }
};

// world <- base <- hand <- tool, base static, the others moving; and world <- camera.
TEST_F(Transforms, OfAStampThatWasSentKeepItsBitsWhateverComesLater) {
  int by_tf2_alone = 0;
  for (int i = 0; i < 200; ++i) {
    const StampNs stamp_ns = START + 10 * i * MS;
    add(sent("world", "/base", 0, turn(), place()), true);
    add(sent("base", "hand", stamp_ns, turn(), place()));
    add(sent("/hand", "tool", stamp_ns, turn(), place()));
    add(sent("world", "camera", stamp_ns, turn(), place()));
    const ros::Time time = ros::Time().fromNSec(static_cast<std::uint64_t>(stamp_ns));
    const auto before_tf2 = buffer.lookupTransform("camera", "tool", time).transform.rotation;
    const Eigen::Isometry3d before = pose("camera", "tool", stamp_ns);
    for (const char* names : {"base hand", "hand tool", "world camera"}) {
      const std::string both(names), parent = both.substr(0, both.find(' '));
      add(sent(parent, both.substr(parent.size() + 1), stamp_ns + 3 * MS, turn(), place()));
      EXPECT_EQ(pose("camera", "tool", stamp_ns).matrix(), before.matrix()) << i << " after " << names;
    }
    const auto after_tf2 = buffer.lookupTransform("camera", "tool", time).transform.rotation;
    by_tf2_alone += before_tf2.w != after_tf2.w || before_tf2.x != after_tf2.x || before_tf2.y != after_tf2.y ||
                    before_tf2.z != after_tf2.z;
    EXPECT_NEAR((before.linear() * before.linear().transpose() - Eigen::Matrix3d::Identity()).norm(), 0, 1e-14);
  }
  EXPECT_GT(by_tf2_alone, 20) << "else this test shows nothing";
}

TEST_F(Transforms, BetweenTwoStampsAreWhatTf2Says) {
  for (int i = 0; i < 50; ++i) {
    Eigen::Quaterniond rounded = turn();
    rounded.coeffs() *= 1 + 1e-15;
    add(sent("world", "hand", START + 10 * i * MS, rounded, place()));
    add(sent("hand", "tool", START + 10 * i * MS + 5 * MS, turn(), place()));
  }
  for (StampNs stamp_ns = START + 5 * MS; stamp_ns < START + 480 * MS; stamp_ns += 7 * MS + 13) {
    const ros::Time time = ros::Time().fromNSec(static_cast<std::uint64_t>(stamp_ns));
    const auto link = buffer.lookupTransform("world", "hand", time).transform;
    const Eigen::Quaterniond link_q(link.rotation.w, link.rotation.x, link.rotation.y, link.rotation.z);
    const Eigen::Isometry3d hand = pose("world", "hand", stamp_ns);
    EXPECT_EQ(hand.linear(), link_q.normalized().normalized().toRotationMatrix()) << "bit for bit";
    EXPECT_EQ(hand.translation(), Vec3(link.translation.x, link.translation.y, link.translation.z));
    const auto found = buffer.lookupTransform("world", "tool", time);
    const Eigen::Isometry3d ours = pose("world", "tool", stamp_ns), back = pose("tool", "world", stamp_ns);
    const auto& p = found.transform.translation;
    const auto& q = found.transform.rotation;
    EXPECT_LT((ours.translation() - Vec3(p.x, p.y, p.z)).norm(), 1e-14);
    EXPECT_LT((ours.linear() - Eigen::Quaterniond(q.w, q.x, q.y, q.z).toRotationMatrix()).norm(), 1e-14);
    EXPECT_LT((ours * back).matrix().isIdentity(1e-14) ? 0 : 1, 1);
  }
  Eigen::Isometry3d none;
  EXPECT_FALSE(feed.lookup("world", "tool", START + 491 * MS, none, reason)) << "nothing is extrapolated";
  EXPECT_NE(reason, "");
  EXPECT_FALSE(feed.lookup("world", "nobody", START, none, reason));
}

TEST_F(Transforms, StampsAndTheFirstOneAreThoseOfTheWayBetweenTheTwoFrames) {
  add(sent("world", "base", 0, turn(), place()), true);
  for (int i = 0; i < 5; ++i) {
    add(sent("base", "hand", START + 10 * i * MS, turn(), place()));
    add(sent("hand", "tool", START + 20 * i * MS + 4 * MS, turn(), place()));
    add(sent("world", "camera", START + i * MS, turn(), place()));
  }
  const auto after = [](std::vector<int> ms) {
    std::vector<StampNs> stamps;
    for (const int one : ms) stamps.push_back(START + one * MS);
    return stamps;
  };
  EXPECT_EQ(between("base", "tool", START, START + 30 * MS), after({4, 10, 20, 24}));
  EXPECT_EQ(between("tool", "world", START, START + 20 * MS), after({4, 10}));
  EXPECT_EQ(between("world", "base", START, START + 30 * MS), after({})) << "static";
  EXPECT_EQ(between("world", "camera", START + 30 * MS, START), after({})) << "the wrong way round";
  for (int again = 0; again < 2; ++again) EXPECT_EQ(between("base", "hand", START, START + 5 * MS), after({}));
  EXPECT_EQ(between("base", "tool", START, START + 5 * MS), after({4}));
  add(sent("base", "hand", START + 3 * MS, turn(), place()));
  EXPECT_EQ(between("base", "hand", START, START + 5 * MS), after({3})) << "it came late";
  EXPECT_EQ(feed.firstStamp("world", "tool"), START + 4 * MS);
  EXPECT_FALSE(feed.firstStamp("world", "base").has_value());
  EXPECT_FALSE(feed.firstStamp("world", "nobody").has_value());
}

TEST_F(Transforms, PositionsAreMovedAsASinglePointIs) {
  Eigen::Isometry3d pose(turn());
  pose.translation() = place();
  const Positions here{place(), place(), {-0.0, NAN, 1}};
  const Positions there = transformed(pose, here);
  Positions in_place = here;
  transform(pose, in_place);
  for (std::size_t v = 0; v < here.size(); ++v) {
    const Vec3 one = pose * here[v];
    EXPECT_EQ(std::memcmp(&there[v], &one, sizeof one), 0);
    EXPECT_EQ(std::memcmp(&in_place[v], &one, sizeof one), 0);
  }
  const Positions unmoved = transformed(Eigen::Isometry3d::Identity(), here);
  EXPECT_EQ(std::memcmp(unmoved.data(), here.data(), here.size() * sizeof(Vec3)), 0) << "to the sign of a zero";
}

}  // namespace
}  // namespace test
}  // namespace dccd
