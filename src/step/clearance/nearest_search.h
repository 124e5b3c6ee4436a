// The smallest distance of two trees of features: branch and bound, always on with the pair of boxes that may be
// nearest, until none that is left can be nearer than what was found by more than the tolerance. Boxes leave much
// between them and what is in them. So a pair is also held against the direction in which the nearest two so far are
// apart: along it, things that bulge towards each other are no nearer beside these two.
//
// The answer depends on the two trees alone, not on what was found in the step before: the search goes to the nearest
// boxes first and so has a near pair after as many boxes as the trees are high.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "dccd/types.h"
#include "step/clearance/hull_pair.h"
#include "step/clearance/step_box.h"

namespace dccd {

/// lower_m <= distance <= upper_m.
struct FoundDistance {
  double lower_m = std::numeric_limits<double>::infinity();
  double upper_m = std::numeric_limits<double>::infinity();
  double t = 1;
  std::array<Vec3, 2> point{Vec3::Zero(), Vec3::Zero()};
  std::array<std::uint32_t, 2> item{0, 0};  ///< of the trees, where upper_m was taken; only where it is finite
  bool cut = false;                         ///< the deadline ended it
};

class NearestSearch {
 public:
  struct Goal {
    double tolerance_m = 0, limit_m = 0;  ///< what is farther apart than the limit is not looked at
    bool at_end = false;                  ///< at t1 alone
    Deadline deadline;
    const std::array<std::uint32_t, 2>* first = nullptr;  ///< items to begin with, probably near; null: none
  };
  /// Of two different trees every pair of items is compared.
  struct AllPairs {
    static constexpr bool ITSELF = false;
    std::uint32_t asked(std::uint32_t, std::uint32_t) const { return ~0u; }
    bool leavesOut(std::uint32_t, std::uint32_t) const { return false; }
  };

  /// pairs: ITSELF: a and b are the same tree. asked(a, b): of two nodes, which pairs of items are to be compared (bit
  /// LEAF * i + j, where both are leaves), or none: 0. leavesOut(i, j): the two items are not to be compared. meet(i,
  /// j): they certainly meet at t1, asked where they may. known: of a distance that is not smaller, or nothing.
  template <class A, class B, class Pairs, class Meet>
  FoundDistance run(const A& a, const B& b, Pairs&& pairs, const Goal& goal, const FoundDistance& known,
                    const Meet& meet) {
    begin(goal, known);
    slack_m_ = tolerance::CLEARANCE * std::max(a.box(a.root()).largest(), b.box(b.root()).largest());
    if (goal.first) {
      compare(a, b, {0, 0, (*goal.first)[0], (*goal.first)[1], true}, meet);
    } else if (!pairs.ITSELF) {
      compareNearBoxes(a, b, meet);
    }
    push(a, a.root(), b, b.root(), pairs);
    while (!touching_.empty() || !heap_.empty()) {
      Pair pair = take();
      const bool is_done = prunes(pair.squared);  // nothing else is nearer
      if (is_done || isLate()) {
        found_.cut = found_.cut || !is_done;
        settleSquared(pair.squared);
        break;
      }
      if (pair.number < direction_from_) {
        const double squared = pair.squared;
        if (prunesAlong(a, b, pair)) continue;
        if (pair.squared > squared) {
          put(pair);
          continue;
        }
      }
      if (pair.items) {
        if (!pairs.leavesOut(pair.a, pair.b)) compare(a, b, pair, meet);
        continue;
      }
      const bool leaf_a = a.isLeaf(pair.a), leaf_b = b.isLeaf(pair.b);
      if (leaf_a && leaf_b) {
        pushItems(a, pair.a, b, pair.b, pairs);
      } else if (pairs.ITSELF && pair.a == pair.b) {
        std::array<std::uint32_t, 2> child;
        std::size_t count = 0;
        a.forChildren(pair.a, [&](std::uint32_t c) { child[count++] = c; });
        push(a, child[0], b, child[0], pairs);
        push(a, child[1], b, child[1], pairs);
        push(a, child[0], b, child[1], pairs);
      } else if (leaf_b || (!leaf_a && a.box(pair.a).length() >= b.box(pair.b).length())) {
        a.forChildren(pair.a, [&](std::uint32_t child) { push(a, child, b, pair.b, pairs); });
      } else {
        b.forChildren(pair.b, [&](std::uint32_t child) { push(a, pair.a, b, child, pairs); });
      }
    }
    return result();
  }

 private:
  /// Of nodes, or of items.
  struct Pair {
    double squared;        // of what they are apart at least
    std::uint32_t number;  // the later one comes first where they are equally far: it is nearer to the items
    std::uint32_t a, b;
    bool items;
    friend bool operator<(const Pair& x, const Pair& y) {
      return x.squared != y.squared ? x.squared > y.squared : x.number < y.number;
    }
  };

  static constexpr std::uint32_t MOST_KNOWN = 64;  // features of a node whose reach is that of its vertices
  /// Of a node, along the direction of that number.
  struct Reach {
    std::uint64_t direction = 0;
    double reach_m = 0;
  };

  /// What touches comes before all else, in whatever order, but items before nodes.
  void add(const Pair& pair) {
    ++number_;
    put(pair);
  }
  void put(const Pair& pair) {
    if (pair.squared == 0) {
      touching_.push_back(pair);
    } else {
      heap_.push_back(pair);
      std::push_heap(heap_.begin(), heap_.end());
    }
  }

  /// The one that may be nearest.
  Pair take() {
    std::vector<Pair>& from = touching_.empty() ? heap_ : touching_;
    if (touching_.empty()) std::pop_heap(heap_.begin(), heap_.end());
    const Pair pair = from.back();
    from.pop_back();
    return pair;
  }

  template <class A, class B, class Pairs>
  void push(const A& a, std::uint32_t in_a, const B& b, std::uint32_t in_b, Pairs& pairs) {
    const double squared = squaredGap(a.box(in_a), b.box(in_b), goal_.at_end ? 1 : 0);
    Pair pair{squared, number_, in_a, in_b, false};
    if (prunes(squared) || pairs.asked(in_a, in_b) == 0 || prunesAlong(a, b, pair)) return;
    if (a.isLeaf(in_a) && b.isLeaf(in_b) && prunesBetween(a, a.box(in_a), b, b.box(in_b), pair)) return;
    add(pair);
  }

  template <class A, class B, class Pairs>
  void pushItems(const A& a, std::uint32_t in_a, const B& b, std::uint32_t in_b, Pairs& pairs) {
    const std::uint32_t asked = pairs.asked(in_a, in_b);
    for (std::uint32_t i = 0; i < a.count(in_a); ++i) {
      const StepBox box = a.itemBox(a.first(in_a) + i);
      for (std::uint32_t j = 0; j < b.count(in_b); ++j) {
        if ((asked >> (A::LEAF * i + j) & 1) == 0) continue;
        const StepBox other = b.itemBox(b.first(in_b) + j);
        const double squared = squaredGap(box, other, goal_.at_end ? 1 : 0);
        Pair pair{squared, number_, a.first(in_a) + i, b.first(in_b) + j, true};
        if (!prunes(squared) && !prunesAlong(a, b, pair) && !prunesBetween(a, box, b, other, pair)) add(pair);
      }
    }
  }

  /// Of a tree's node or item, how far it reaches along the direction, from the start (of the end alone: from the end)
  /// to the end of the step.
  template <class Tree>
  double reach(const Tree& tree, std::uint32_t in, bool items, double sign, std::vector<Reach>& known) {
    const Vec3 direction = sign * direction_;
    if (items) return tree.itemReach(in, direction, goal_.at_end);
    if constexpr (Tree::LEAF > 1) {
      if (tree.count(in) <= MOST_KNOWN) {
        if (known.size() < tree.nodeCount()) known.resize(tree.nodeCount());
        if (known[in].direction != directions_) {
          double reach_m = -std::numeric_limits<double>::infinity();
          if (tree.isLeaf(in)) {
            reach_m = tree.leafReach(in, direction, goal_.at_end);
          } else {
            tree.forChildren(
                in, [&](std::uint32_t child) { reach_m = std::max(reach_m, reach(tree, child, false, sign, known)); });
          }
          known[in] = {directions_, reach_m};
        }
        return known[in].reach_m;
      }
    }
    return tree.box(in).reach(direction, goal_.at_end);
  }

  /// Whether what two are certainly apart shows that they need no further look. If not, they may be farther than their
  /// boxes.
  bool prunesApart(double apart_m, Pair& pair) {
    const double lower_m = apart_m - slack_m_;
    if (lower_m >= enough_m_) {
      settle(lower_m);
      return true;
    }
    if (lower_m > 0) pair.squared = std::max(pair.squared, lower_m * lower_m * (1 - tolerance::CLEARANCE_BOX));
    return false;
  }
  template <class A, class B>
  bool prunesAlong(const A& a, const B& b, Pair& pair) {
    if (!(enough_m_ > 0) || direction_from_ == 0) return false;
    const double reach_m = reach(a, pair.a, pair.items, -1, reach_[0]) + reach(b, pair.b, pair.items, 1, reach_[1]);
    return prunesApart(-reach_m, pair);
  }
  /// The same of two leaves or items in the direction from one to the other: what is hollow is nearly as near in many.
  template <class A, class B>
  bool prunesBetween(const A& a, const StepBox& box_a, const B& b, const StepBox& box_b, Pair& pair) {
    if (!(enough_m_ > 0)) return false;
    const Vec3 between = box_a.middle(goal_.at_end) - box_b.middle(goal_.at_end);
    const double length = between.norm();
    if (!(length > tolerance::CLEARANCE_DIRECTION_M)) return false;
    const Vec3 direction = between / length;
    const auto reachOf = [&](const auto& tree, std::uint32_t in, const Vec3& along) {
      return pair.items ? tree.itemReach(in, along, goal_.at_end) : tree.leafReach(in, along, goal_.at_end);
    };
    return prunesApart(-reachOf(a, pair.a, -direction) - reachOf(b, pair.b, direction), pair);
  }

  /// Two items that are probably near: from each node to the child whose box is nearest.
  template <class A, class B, class Meet>
  void compareNearBoxes(const A& a, const B& b, const Meet& meet) {
    const int first = goal_.at_end ? 1 : 0;
    const auto nearer = [&](const auto& tree, std::uint32_t& in, const StepBox& box) {
      double least = std::numeric_limits<double>::infinity();
      const std::uint32_t parent = in;
      tree.forChildren(parent, [&](std::uint32_t child) {
        const double squared = squaredGap(tree.box(child), box, first);
        if (squared < least) least = squared, in = child;
      });
    };
    std::uint32_t in_a = a.root(), in_b = b.root();
    while (!a.isLeaf(in_a) || !b.isLeaf(in_b)) {
      if (!a.isLeaf(in_a) && (b.isLeaf(in_b) || a.box(in_a).length() >= b.box(in_b).length())) {
        nearer(a, in_a, b.box(in_b));
      } else {
        nearer(b, in_b, a.box(in_a));
      }
    }
    compare(a, b, {0, 0, a.first(in_a), b.first(in_b), true}, meet);
  }

  template <class A, class B, class Meet>
  void compare(const A& a, const B& b, const Pair& pair, const Meet& meet) {
    pair_.set(a.itemHull(pair.a), b.itemHull(pair.b));
    item_ = {pair.a, pair.b};
    if (!goal_.at_end) return refine();
    const double lower = enough_m_ > 0 ? takeAt(1).lower : 0;  // else nothing but whether they meet is open
    if (lower > 0 || !meet(pair.a, pair.b)) {
      settle(pair_.lowerInMetres(lower));
    } else {
      takeMeeting();
    }
  }

  void begin(const Goal& goal, const FoundDistance& known);
  FoundDistance result() const;
  void setEnough();
  /// Nothing that far apart needs a further look. Whether they meet at the end is asked exactly of all that may,
  /// whatever was found to be nearly as near before.
  bool prunes(double squared) {
    if (squared < enough_squared_ || (squared == 0 && goal_.at_end && found_.upper_m > 0)) return false;
    settleSquared(squared);
    return true;
  }
  void settleSquared(double squared) { settled_squared_ = std::min(settled_squared_, squared); }
  void settle(double lower_m) { found_.lower_m = std::min(found_.lower_m, lower_m); }
  bool isLate();
  Nearest takeAt(double t);
  void takeMeeting();
  void refine();

  Goal goal_;
  FoundDistance found_;
  Vec3 direction_ = Vec3::Zero();     // from the second to the first, of the nearest two so far
  std::uint32_t direction_from_ = 0;  // the number of the first pair after it was set; 0: none is
  std::uint64_t directions_ = 0;      // so many there were, in all searches
  double slack_m_ = 0;                // of what is computed along it
  std::array<std::vector<Reach>, 2> reach_;
  double enough_m_ = 0, enough_squared_ = 0;
  double settled_squared_ = 0;  // of all that was not looked into
  std::uint64_t looks_ = 0;
  std::uint32_t number_ = 0;
  std::vector<Pair> touching_, heap_;
  HullPair pair_;
  std::array<std::uint32_t, 2> item_{};
};

}  // namespace dccd
