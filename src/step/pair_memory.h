// What is known of pairs of clusters from one step to the next: by how much they are apart, and which of their features
// share a vertex.
//
// A certificate says that at the end of the last step no two features of the pair, one of each cluster, that share no
// vertex are nearer to each other than distance_m. Each step takes off it by how much the clusters' motion departs from
// a rigid one (cluster_motion.h), and as long as more than what counts as a contact is left, the pair has no contact in
// the step and is not looked at. So what a step finds, and in which order, is what it would find without.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "culling/cluster_pairs.h"
#include "step/cluster_motion.h"

namespace dccd {

/// Trees of two bodies, and what counts as a contact between them.
struct MemoryTrees {
  PairKind kind = PairKind::VERTEX_FACE;
  std::uint16_t body_a = 0, body_b = 0;
  FeatureKind kindA() const { return firstKind(kind); }
  FeatureKind kindB() const { return secondKind(kind); }
  bool isSelf() const { return body_a == body_b && kind == PairKind::EDGE_EDGE; }
};

class PairMemory {
 public:
  /// A pair of clusters whose bounds overlap in this step.
  struct Pair {
    double distance_m = UNKNOWN;    ///< the certificate, at the end of the last step; UNKNOWN: none
    float residual_m = 0;           ///< of this step's motion
    std::uint16_t lanes = 0;        ///< the clusters' places in their groups, a's << 4 | b's
    std::uint8_t wait = 0;          ///< steps until a certificate is tried again
    std::uint8_t failed : 6;        ///< how often it was tried in vain, up to 2
    std::uint8_t to_test : 1;       ///< in this step
    std::uint8_t has_shared : 1;    ///< the lanes below are known
    std::uint16_t shared[16] = {};  ///< of the features: which share a vertex
    Pair() : failed(0), to_test(1), has_shared(0) {}
  };
  static constexpr double UNKNOWN = -1;
  static constexpr std::size_t TRIAL_SHARE = 16;  ///< one in so many groups is in a trial
  /// Those of a pair of groups, in the order of the trees.
  struct Group {
    std::uint32_t a = 0, b = 0;
    MemoryTrees trees;
    std::vector<Pair> pairs;
  };

  /// Off: nothing is kept. Trial: a sample of certificates waits for the next step. On: they are used.
  enum class State : std::uint8_t { OFF, TRIAL, ON };
  State state() const { return state_; }
  bool isOn() const { return state_ == State::ON; }

  /// Nothing is known, and memory is given back.
  void clear();
  bool isClear() const { return state_ == State::OFF && rest_ == 0; }
  std::size_t bytes() const;

  /// Before the pairs of a step that continues the last one, whose records and bounds the scene has. Of a trial this
  /// decides whether it is on from now on. pieces(n, f): calls f(first, last) over [0, n), in parallel or not.
  template <class Pieces>
  void beginStep(const SceneArrays& scene, const Pieces& pieces) {
    if (!motion_.isSet()) motion_.setBodies(scene);
    motion_.run(scene, pieces);
    if (state_ == State::TRIAL) judgeTrial();
  }

  /// The groups of this step take over what is known of those of the last one: addGroup() in their order.
  void beginGroups(const SceneArrays& scene);
  void addGroup(const MemoryTrees& trees, std::uint32_t a, std::uint32_t b);
  std::size_t groupCount() const { return groups_.size(); }
  Group& group(std::size_t g) { return groups_[g]; }

  /// Lists the group's pairs, and says which of them are to be tested; their clusters are marked. contact_m: what is as
  /// near as that may be a contact. Groups can be consulted at the same time. False: there are more pairs than may be
  /// kept, and the lists are not whole.
  bool consult(const SceneArrays& scene, std::size_t group, double contact_m);
  bool isMarked(std::size_t body, FeatureKind kind, std::size_t cluster) const {
    return marks_[body].of[static_cast<int>(kind)][cluster].load(std::memory_order_relaxed) != 0;
  }

  /// The features of a pair, without those that share a vertex: returns how many pairs of slots are written (room for
  /// 256). Where there is a certificate to be had for the end of the step, it is made. Needs the marked clusters'
  /// members. Pairs can be tested at the same time.
  std::size_t test(const SceneArrays& scene, const Group& group, Pair& pair, double contact_m, std::uint32_t* slots,
                   StepStats& stats);

  /// After a step in which it was on and every pair was tested: is it still worth it?
  void endStep();
  /// There is more to keep than may be kept: off, for long.
  void giveUp() { turnOff(LONGEST_REST); }
  /// Is it time for a trial? Asked once a step while it is off.
  bool wantsTrial() { return state_ == State::OFF && (rest_ == 0 || --rest_ == 0); }
  /// Certificates for the groups that were added, in a step that has all members: the next step shows if they hold.
  void beginTrial(const SceneArrays& scene);

 private:
  struct Marks {
    std::unique_ptr<std::atomic<std::uint8_t>[]> of[3];
    std::size_t count[3] = {0, 0, 0};
  };
  static constexpr std::uint32_t SHORTEST_REST = 16, LONGEST_REST = 256;  // steps
  static constexpr std::size_t MOST_LEFT = 24;  // pairs of features that bounds leave; of more no certificate is tried

  void judgeTrial();
  void turnOff(std::uint32_t rest);
  void unmark(const SceneArrays& scene);
  void setWeights(const SceneArrays& scene);
  void shareVertices(const SceneArrays& scene, const Group& group, Pair& pair) const;
  void certify(const SceneArrays& scene, const Group& group, Pair& pair, double contact_m) const;
  /// Takes off the certificate what this step consumes of it. False: the pair may have a contact in the step.
  bool consume(const Group& group, Pair& pair, double contact_m) const;

  State state_ = State::OFF;
  std::uint32_t steps_on_ = 0;  // in which it was on, since it was turned on
  std::uint32_t rest_ = 0, next_rest_ = SHORTEST_REST;
  ClusterMotion motion_;
  std::vector<Group> groups_, last_;
  std::vector<std::uint32_t> table_;  // of last_ by hash: place + 1
  std::vector<Marks> marks_;
  std::size_t most_pairs_ = 0;
  std::atomic<std::size_t> pair_count_{0}, known_apart_{0};
  std::uint16_t weights_[8] = {};
  double unit_m_ = 0;  // of the weights
};

}  // namespace dccd
