// The smallest distance of two trees of features: branch and bound, from the nearest boxes to features, until no pair
// that is left can be nearer than what was found by more than the tolerance.
//
// The answer depends on the two trees alone, not on what was found in the step before: the search goes to the nearest
// boxes first and so has a near pair after as many boxes as the trees are high.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "dccd/deadline.h"
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
  };

  /// leavesOut(i, j): the items are not to be compared. meet(i, j): they certainly meet at t1, asked where they may.
  /// known: of a distance that is not smaller, or nothing.
  template <class A, class B, class LeavesOut, class Meet>
  FoundDistance run(const A& a, const B& b, bool same, const Goal& goal, const FoundDistance& known,
                    const LeavesOut& leavesOut, const Meet& meet) {
    goal_ = goal;
    found_ = known;
    found_.lower_m = std::numeric_limits<double>::infinity();
    found_.cut = false;
    looks_ = 0;
    stack_.clear();
    push(a, a.root(), b, b.root());
    while (!stack_.empty()) {
      const Pair pair = stack_.back();
      stack_.pop_back();
      if (prunes(pair.lower_m)) continue;
      if (isLate()) {
        cutAt(pair.lower_m);
        for (const Pair& left : stack_) cutAt(left.lower_m);
        break;
      }
      const std::size_t begin = stack_.size();
      const bool leaf_a = a.isLeaf(pair.a), leaf_b = b.isLeaf(pair.b);
      if (leaf_a && leaf_b) {
        a.forItems(pair.a, [&](std::uint32_t i) {
          b.forItems(pair.b, [&](std::uint32_t j) {
            if (!same || pair.a != pair.b || i < j) compare(a, i, b, j, leavesOut, meet);
          });
        });
        continue;
      }
      if (same && pair.a == pair.b) {
        std::array<std::uint32_t, 2> child;
        std::size_t count = 0;
        a.forChildren(pair.a, [&](std::uint32_t c) { child[count++] = c; });
        push(a, child[0], b, child[1]);
        push(a, child[0], b, child[0]);
        push(a, child[1], b, child[1]);
      } else if (leaf_b || (!leaf_a && a.box(pair.a).length() >= b.box(pair.b).length())) {
        a.forChildren(pair.a, [&](std::uint32_t child) { push(a, child, b, pair.b); });
      } else {
        b.forChildren(pair.b, [&](std::uint32_t child) { push(a, pair.a, b, child); });
      }
      // The nearest one is taken first; of equal ones the first that came.
      std::stable_sort(stack_.begin() + static_cast<std::ptrdiff_t>(begin), stack_.end(),
                       [](const Pair& x, const Pair& y) { return x.lower_m > y.lower_m; });
    }
    found_.lower_m = std::min(found_.lower_m, found_.upper_m);
    return found_;
  }

 private:
  struct Pair {
    double lower_m;
    std::uint32_t a, b;
  };

  template <class A, class B>
  void push(const A& a, std::uint32_t in_a, const B& b, std::uint32_t in_b) {
    const double lower_m = apart(a.box(in_a), b.box(in_b), goal_.at_end ? 1 : 0);
    if (!prunes(lower_m)) stack_.push_back({lower_m, in_a, in_b});
  }

  template <class A, class B, class LeavesOut, class Meet>
  void compare(const A& a, std::uint32_t i, const B& b, std::uint32_t j, const LeavesOut& leavesOut, const Meet& meet) {
    if (prunes(apart(a.itemBox(i), b.itemBox(j), goal_.at_end ? 1 : 0)) || leavesOut(i, j)) return;
    pair_.set(a.itemHull(i), b.itemHull(j));
    item_ = {i, j};
    if (!goal_.at_end) return refine();
    const double lower_m = takeAt(1).lower;
    if (lower_m > 0 || !meet(i, j)) {
      settle(pair_.lowerInMetres(lower_m));
    } else {
      found_.upper_m = 0;
      settle(0);
    }
  }

  bool prunes(double lower_m);
  void settle(double lower_m) { found_.lower_m = std::min(found_.lower_m, lower_m); }
  void cutAt(double lower_m) {
    settle(lower_m);
    found_.cut = true;
  }
  bool isLate();
  Nearest takeAt(double t);
  void refine();

  Goal goal_;
  FoundDistance found_;
  std::uint64_t looks_ = 0;
  std::vector<Pair> stack_;
  HullPair pair_;
  std::array<std::uint32_t, 2> item_{};
};

}  // namespace dccd
