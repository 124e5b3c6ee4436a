// Transforms: what arrives on /tf is kept; what is asked for comes out at exactly the stamp asked.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <iterator>
#include <limits>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <unordered_map>
#include <vector>

#include <tf2_msgs/TFMessage.h>

#include "dccd/mesh_store.h"
#include "dccd/tolerances.h"
#include "input/stamp_lead.h"

namespace dccd {

constexpr StampNs JUMP_BACK_NS = tolerance::TF_JUMP_BACK_NS;

/// Keeps what was sent and forgets what a publisher sent when its stamps jump back, as a looping replay makes them:
/// kept transforms of the end would otherwise be taken for ones of the beginning. Where they go back by less, a frame
/// that was elsewhere at a stamp before its newest tells it, as after a simulation's reset. Where the stamps of two
/// publishers of one frame are that far apart, what was sent of this frame is forgotten, each time, and nothing else. A
/// frame that is on /tf and, elsewhere, on /tf_static has no place: tf2 would have it at rest where it was sent last,
/// at all times. One that is sent elsewhere on /tf_static is there at all times from then on, and where it was before
/// is forgotten. Leaves out what tf2 would write a line to the console for, each time: repeated stamps above all. Any
/// thread may call it.
class TransformFeed {
 public:
  /// No name is forgotten; further frames are left out.
  static constexpr std::size_t MAX_FRAMES = 16384;
  /// Of all frames together, in each 10 s that are kept: 52,000 a second. Where more come all are forgotten.
  static constexpr std::size_t MAX_KEPT = std::size_t{1} << 19;
  /// Further publishers count as one.
  static constexpr std::size_t MAX_SENDERS = 64;

  /// Child frames with unusable transforms that are told of.
  static constexpr std::size_t MAX_TOLD = 16;

  /// How long what was sent is kept, by its stamps.
  explicit TransformFeed(double kept_s = 10);
  /// What these bytes of the topic are. Null where they do not hold what they say, which is counted as unusable.
  tf2_msgs::TFMessage::ConstPtr read(const std::string& topic, std::vector<std::uint8_t> bytes);
  /// A message of the topic could not be taken.
  void lose(bool is_static);
  /// Whether add() would forget what this publisher sent. `sender`: the caller's id of its connection.
  bool clears(const tf2_msgs::TFMessage& message, bool is_static, const std::string& sender = {}) const;
  /// Returns true when transforms were forgotten. arrival_ns: on the clock of stamps; 0: it is not known.
  bool add(const tf2_msgs::TFMessage& message, bool is_static, const std::string& sender = {}, StampNs arrival_ns = 0);

  /// target_from_source at the stamp. False, with the reason, when it is not known (yet). Equal frames need no
  /// transform. A transform of this very stamp is taken as it was sent; tf2 alone would interpolate from it to the next
  /// one once that is there, and give other last bits.
  bool lookup(const std::string& target, const std::string& source, StampNs stamp_ns, Eigen::Isometry3d& transform,
              std::string& reason) const;
  /// From the stamp on a frame had this parent. Before that it had another one, or, where that is null, what was sent
  /// is not kept any more. Where both are null, something came for a time before the stamp, and after the transform
  /// before it, that is not used. The names stay.
  struct NewParent {
    StampNs stamp_ns;
    const std::string *frame, *before, *now;
    StampNs last_ns = std::numeric_limits<StampNs>::min();  ///< of the last transform of before; or none
  };
  /// Ascending: between the two, neither included, each stamp of a transform that target_from_source is made of then.
  /// Added to `changes`, newest first: from when on, after from_ns and up to to_ns, it was made of other frames than
  /// before, or, where to_ns lies between two of other parents, is made from the second on. Where tf2 has it just
  /// before that nobody said.
  std::vector<StampNs> stampsBetween(const std::string& target, const std::string& source, StampNs from_ns,
                                     StampNs to_ns, std::vector<NewParent>& changes) const;
  /// From when on target_from_source is known, where tf has more than static transforms of it; else none.
  std::optional<StampNs> firstStamp(const std::string& target, const std::string& source) const;
  /// Until when, likewise.
  std::optional<StampNs> newestStamp(const std::string& target, const std::string& source) const;

  /// Why source may have been elsewhere in target at the stamp than lookup() says, as far as what was sent next to it
  /// tells: at the stamp it was sent elsewhere, too, between two transforms its parent changed, or these are of two
  /// publishers. Empty: nothing tells it.
  std::string doubtNextTo(const std::string& target, const std::string& source, StampNs stamp_ns) const;
  /// Grows once a static frame, of those that target_from_source is made of now, is sent elsewhere.
  std::uint64_t staticSince(const std::string& target, const std::string& source) const;
  /// The frame at the top of the tree that the frame is in now; empty: it has no parent.
  std::string rootOf(const std::string& frame) const;

  /// Of the frames that target_from_source is made of now, that of which the stamps run ahead of their arrival by the
  /// most [s]; none: nobody knows.
  struct Ahead {
    std::string frame;
    double seconds;
  };
  std::optional<Ahead> mostAhead(const std::string& target, const std::string& source) const;

  /// Time begins anew at this stamp. What was sent of frames for times well after it is forgotten, unless it was sent
  /// since their stamps went back, too.
  void beginAnew(StampNs stamp_ns);
  /// How often where frames were before was forgotten.
  std::uint64_t timesForgotten() const { return times_forgotten_; }
  /// How many transforms could not be used.
  std::uint64_t unusable() const { return unusable_; }
  /// After a lookup() that failed: "no transform from 'a' to …: why", and which frames have had but unusable ones.
  /// `to`: in words, a name in quotation marks.
  std::string noTransform(const std::string& from, const std::string& to, const std::string& why) const;
  /// Which frames have had no others, and why, in words; empty: none.
  std::string onlyUnusable() const;
  /// A line for each child frame that has had an unusable one, once.
  std::vector<std::string> takeProblems();

 private:
  struct Pose {
    Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  ///< in `sent` as it came, else of length 1
    Vec3 translation = Vec3::Zero();
  };
  struct Frame;
  struct Sent {
    const Frame* parent = nullptr;
    Pose pose;                            ///< parent_from_frame
    const std::string* sender = nullptr;  ///< its place in senders_
    bool gap = false;  ///< something came for a time between the one before and this, and is not used
  };
  using Samples = std::deque<std::pair<StampNs, Sent>>;  ///< ascending
  /// One that tf has named.
  struct Frame {
    std::string name;
    std::optional<bool> is_static;  ///< as tf2 takes it, for good, from what came first; none: it is a parent alone
    Samples sent;                   ///< of one that moves
    Sent fixed;                     ///< of one that is static
    std::uint64_t fixed_since = 0;  ///< change_ when that was sent elsewhere; 0: it was not
    std::map<std::string, StampNs> newest;  ///< of each publisher; 0: it went back
    bool is_cut = false;                    ///< older ones were sent
    bool is_apart = false;                  ///< some were forgotten, of this frame alone
    bool passed_over = false;               ///< something came for a time after the newest, and is not used
    std::uint64_t lost = 0;                 ///< lost_ when the newest came
    bool is_disputed = false;               ///< it is on both topics, and not at one place
    std::uint64_t times_forgotten = 0;      ///< what was sent of it,
    std::uint64_t forgotten_before = 0;     ///< and how often when time began anew
    StampNs forgotten_ns = 0;               ///< the newest of what was forgotten the last time
    StampLead lead;                         ///< of one that moves
    // What was asked for last is asked for again by every frame below this one.
    mutable std::uint64_t asked_change = 0;
    mutable StampNs asked_ns = 0;
    mutable Sent asked;
    mutable std::tuple<std::uint64_t, StampNs, StampNs> none_between{};  ///< change_, and the stamps
  };
  /// From a frame up to an ancestor, the frame first and the ancestor last.
  using Chain = std::vector<const Frame*>;

  mutable std::mutex mutex_;
  std::unordered_map<std::string, Frame> frames_;  // places stay
  std::uint64_t change_ = 1;                       // counts what was added
  mutable Chain from_target_, from_source_;        // buffers of a question
  StampNs kept_ns_;
  std::size_t kept_count_ = 0, max_kept_;
  std::uint64_t lost_ = 0;  // messages of /tf of which nobody knows what was in them
  std::set<std::string> senders_;
  bool has_disputed_ = false, has_apart_ = false;
  std::atomic<std::uint64_t> unusable_{0}, times_forgotten_{0};
  std::map<std::string, std::string> only_unusable_;  // per child frame that has had no usable one: what was wrong
  std::set<std::string> told_;
  std::vector<std::string> problems_;

  const Frame* frameOf(const std::string& name) const;
  Frame* roomFor(const std::string& name);
  const std::string* senderOf(const std::string& name);
  enum class Jump : std::uint8_t { NONE, LOOP, TWO_SENDERS };
  /// now: what is sent. frame: of which; null: of one that is not known.
  Jump jumpOf(const Frame* frame, StampNs stamp_ns, const Sent& now, const std::string& sender) const;
  static void emptied(Frame& frame);
  void forget(Frame& frame);
  void forgetAllOf(const std::string& sender);
  static bool isSame(const Sent& a, const Sent& b, double tolerance);
  static bool isThere(const Frame& frame, const Sent& sent);
  void passOver(const geometry_msgs::TransformStamped& transform);
  void dispute(const geometry_msgs::TransformStamped& transform, Frame& frame);
  const Frame* disputedOnWay() const;
  const Frame* firstApart() const;
  static Sent between(const Frame& frame, StampNs stamp_ns);
  static const Frame* newestParentOf(const Frame& frame);
  template <class Sequence>
  static auto after(Sequence& sent, StampNs stamp_ns);
  template <class Sequence>
  static auto find(Sequence& sent, StampNs stamp_ns);
  static const Frame* parentAt(const Frame& frame, StampNs stamp_ns);
  bool isRepeated(const geometry_msgs::TransformStamped& transform, const Sent& sent, Frame& frame);
  void clear();
  void leaveOut(const geometry_msgs::TransformStamped& transform, const std::string& problem);
  const Sent& sentAt(const Frame& frame, StampNs stamp_ns) const;
  StampNs newestOnWay() const;
  std::string whyNoWay(const std::string& target, const std::string& source, StampNs stamp_ns) const;
  template <class ParentOf>
  bool findWay(const std::string& target, const std::string& source, ParentOf parentOf) const;
  static Pose poseOf(const geometry_msgs::Transform& transform);
  static Pose poseAlong(const Chain& chain);
  template <class Take>
  void forEachKeptOnWay(Take take) const;
};

/// The first one after the stamp. Most of the time that is none, or one of the newest.
template <class Sequence>
auto TransformFeed::after(Sequence& sent, StampNs stamp_ns) {
  auto found = sent.end();
  for (int newest = 0; newest < 4 && found != sent.begin(); ++newest, --found) {
    if (std::prev(found)->first <= stamp_ns) return found;
  }
  const auto isBefore = [](StampNs stamp_ns, const auto& sample) { return stamp_ns < sample.first; };
  return std::upper_bound(sent.begin(), found, stamp_ns, isBefore);
}

/// The one of this stamp, or the end.
template <class Sequence>
auto TransformFeed::find(Sequence& sent, StampNs stamp_ns) {
  const auto next = after(sent, stamp_ns);
  return next != sent.begin() && std::prev(next)->first == stamp_ns ? std::prev(next) : sent.end();
}

void transform(const Eigen::Isometry3d& target_from_source, Positions& positions);
Positions transformed(const Eigen::Isometry3d& target_from_source, const Positions& positions);

}  // namespace dccd
