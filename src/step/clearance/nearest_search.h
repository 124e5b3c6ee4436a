// The smallest distance of two trees of features: branch and bound, always on with the pair of boxes that may be
// nearest, until none that is left can be nearer than what was found by more than the tolerance. Boxes leave much
// between them and what is in them. So a pair is also held against the direction in which the nearest two so far are
// apart: along it, things that bulge towards each other are no nearer beside these two. Where that is not the end soon,
// a plane is looked for between the two trees. Most often it shows at once that nothing is nearer. If not, boxes along
// it are tight for things that face each other, which boxes along x, y and z are not.
//
// Directions turn with the step, as the nearest two do. Any unit vectors will do for a proof, only its arithmetic must
// be bounded. With u = HALF_ULP and L the largest coordinate: n.p by its three operations 6 u L, once more for a mean;
// the difference of two 12 u L and its own rounding 4 u L; axes are across each other but for 10 u, so that they make a
// distance of at most 4 L longer by 80 u L. In all 100 u L. slack_m_ is CLEARANCE L, which is 256 u L.
//
// The answer depends on the two trees alone, not on what was found in the step before: the search goes to the nearest
// boxes first and so has a near pair after as many boxes as the trees are high.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "dccd/types.h"
#include "step/clearance/hull_pair.h"
#include "step/clearance/step_box.h"
#include "step/clearance/turned_box.h"

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
    const std::array<std::uint32_t, 2>* near = nullptr;   ///< the same, of other places of the two
    /// Once two are nearer than this, how near they are does not matter. 0: it does. Whether they are was known sooner
    /// without a plane in each of 24 scenes of an arm over a cloth.
    double gives_up_m = 0;
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
    // A map has no shape that a plane would part from others, and its corners are many.
    constexpr bool FINDS_PLANE = B::LEAF > 1 && !std::decay_t<Pairs>::ITSELF;
    begin(goal, known);
    slack_m_ = tolerance::CLEARANCE * std::max(a.box(a.root()).largest(), b.box(b.root()).largest());
    if (goal.first) {
      compare(a, b, {0, 0, (*goal.first)[0], (*goal.first)[1], true}, meet);
      if constexpr (FINDS_PLANE) {
        if (prunesAll(a, b)) return result();
      }
    } else if (!pairs.ITSELF) {
      if (goal.near)
        compare(a, b, {0, 0, (*goal.near)[0], (*goal.near)[1], true}, meet);
      else
        compareNearBoxes(a, b, meet);
    }
    push(a, a.root(), b, b.root(), pairs);
    for (std::uint32_t taken = 0; !touching_.empty() || !heap_.empty(); ++taken) {
      if constexpr (FINDS_PLANE) {
        if (taken == FEW && enough_m_ > 0 && goal_.gives_up_m == 0) {
          findPlane(a, b, meet);
          if (prunesAll(a, b)) return result();
        }
      }
      Pair pair = take();
      const bool is_done =
          prunes(pair.squared) || found_.upper_m < goal_.gives_up_m;  // nothing else is nearer, or asked
      if (is_done || (plane_ > 0 ? isOver() : isLate())) {            // boxes along a plane take long
        found_.cut = found_.cut || !is_done;
        settleSquared(pair.squared);
        break;
      }
      if (pair.number < checked_from_) {
        const double squared = pair.squared;
        if (prunesAnew(a, b, pair)) continue;
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

  static constexpr std::uint32_t MOST_KNOWN = 64;    // features of a node whose reach is that of its vertices
  static constexpr std::uint32_t MOST_TURNED = 256;  // … whose turned box is
  static constexpr std::uint32_t FEW = 64;           // pairs that are taken before a plane is looked for
  static constexpr std::size_t MOST_PLANES = 16;     // that are tried at either end of the step
  /// Of a node, along the direction of that number.
  struct KnownReach {
    std::uint64_t direction = 0;
    Reach reach{{0, 0, 0}};
  };
  /// The corner of a tree's items that reaches furthest, and its leaf.
  struct Furthest {
    double reach_m = -std::numeric_limits<double>::infinity();
    std::uint32_t leaf = 0;
    VertexMotion corner{};
  };
  struct KnownBox {
    std::uint64_t plane = 0;
    TurnedBox box;
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
    if (prunes(squared) || pairs.asked(in_a, in_b) == 0) return;
    if (prunesAnew(a, b, pair)) return;
    if (a.isLeaf(in_a) && b.isLeaf(in_b) && prunesBetween(a, a.box(in_a), b, b.box(in_b), pair)) return;
    add(pair);
  }

  template <class A, class B, class Pairs>
  void pushItems(const A& a, std::uint32_t in_a, const B& b, std::uint32_t in_b, Pairs& pairs) {
    const std::uint32_t asked = pairs.asked(in_a, in_b);
    std::array<StepBox, B::LEAF> others;
    std::array<TurnedBox, B::LEAF> turned_others;
    std::uint32_t left = 0;  // of the second leaf's items
    for (std::uint32_t j = 0; j < b.count(in_b); ++j) {
      if (prunesBeyond(b, b.first(in_b) + j, a, in_a)) continue;
      left |= 1u << j;
      others[j] = b.itemBox(b.first(in_b) + j);
      if (plane_ > 0) turned_others[j] = turnedItem(b, b.first(in_b) + j);
    }
    for (std::uint32_t i = 0; i < a.count(in_a) && left != 0; ++i) {
      if (prunesBeyond(a, a.first(in_a) + i, b, in_b)) continue;
      const StepBox box = a.itemBox(a.first(in_a) + i);
      TurnedBox turned_box;
      if (plane_ > 0) turned_box = turnedItem(a, a.first(in_a) + i);
      for (std::uint32_t j = 0; j < b.count(in_b); ++j) {
        if ((asked >> (A::LEAF * i + j) & 1) == 0 || (left >> j & 1) == 0) continue;
        const double squared = squaredGap(box, others[j], goal_.at_end ? 1 : 0);
        Pair pair{squared, number_, a.first(in_a) + i, b.first(in_b) + j, true};
        if (prunes(squared) || (plane_ > 0 && prunesTurned(turned_box, turned_others[j], pair))) continue;
        if (!prunesAlong(a, b, pair) && !prunesBetween(a, box, b, others[j], pair)) add(pair);
      }
    }
  }

  /// Of a tree's node or item, how far it reaches along the direction.
  template <class Tree>
  Reach reach(const Tree& tree, std::uint32_t in, bool items, std::size_t side) {
    const double sign = side == 0 ? -1 : 1;
    const Turning along{sign * direction_[0], sign * direction_[1]};
    if (items) return tree.itemReach(in, along);
    if constexpr (Tree::LEAF > 1) {
      if (tree.count(in) <= MOST_KNOWN) {
        std::vector<KnownReach>& known = reach_[side];
        if (known.size() < tree.nodeCount()) known.resize(tree.nodeCount());
        if (known[in].direction != directions_) {
          Reach all = Reach::none();
          if (tree.isLeaf(in)) {
            all = tree.leafReach(in, along);
          } else {
            tree.forChildren(in, [&](std::uint32_t child) { all.add(reach(tree, child, false, side)); });
          }
          known[in] = {directions_, all};
        }
        return known[in].reach;
      }
    }
    return tree.box(in).reach(along);
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
    if (!(enough_m_ > 0) || !has_direction_) return false;
    return prunesApart(apartBy(reach(a, pair.a, pair.items, 0), reach(b, pair.b, pair.items, 1), goal_.at_end), pair);
  }

  template <class Tree>
  TurnedBox turnedItem(const Tree& tree, std::uint32_t item) const {
    if constexpr (Tree::LEAF > 1) {
      TurnedBox box = TurnedBox::none();
      tree.forItemCorners(item, [&](const VertexMotion& corner) { box.add(corner, axes_); });
      return box;
    }
    return TurnedBox::of(tree.itemBox(item), axes_);
  }
  /// Of a tree's node, in the axes of the plane.
  template <class Tree>
  TurnedBox turned(const Tree& tree, std::uint32_t in, std::size_t side) {
    if constexpr (Tree::LEAF > 1) {
      if (tree.count(in) <= MOST_TURNED) {
        std::vector<KnownBox>& known = turned_[side];
        if (known.size() < tree.nodeCount()) known.resize(tree.nodeCount());
        if (known[in].plane != plane_) {
          TurnedBox all = TurnedBox::none();
          if (tree.isLeaf(in)) {
            tree.forCorners(in, [&](const VertexMotion& corner) { all.add(corner, axes_); });
          } else {
            tree.forChildren(in, [&](std::uint32_t child) { all.add(turned(tree, child, side)); });
          }
          known[in] = {plane_, all};
        }
        return known[in].box;
      }
    }
    return TurnedBox::of(tree.box(in), axes_);
  }
  /// Of a pair that was pushed before the plane or the direction was known.
  template <class A, class B>
  bool prunesAnew(const A& a, const B& b, Pair& pair) {
    if (plane_ == 0 || pair.items) return prunesAlong(a, b, pair);
    return prunesTurned(turned(a, pair.a, 0), turned(b, pair.b, 1), pair);
  }
  bool prunesTurned(const TurnedBox& a, const TurnedBox& b, Pair& pair) {
    const double squared = squaredGap(a, b, slack_m_, goal_.at_end);
    pair.squared = std::max(pair.squared, squared);
    return prunes(squared);
  }
  /// What two are apart at least in the direction from the one's box to the other's; negative: it is not told.
  template <class ReachA, class ReachB>
  double apartBetween(const StepBox& box_a, const ReachA& reach_a, const StepBox& box_b, const ReachB& reach_b) const {
    Turning from_a, from_b;
    for (int end = 0; end < 2; ++end) {
      const Vec3 between = box_a.middle(end) - box_b.middle(end);
      const double length = between.norm();
      if (!(length > tolerance::CLEARANCE_DIRECTION_M)) return -1;
      from_b[end] = between / length;
      from_a[end] = -from_b[end];
    }
    return apartBy(reach_a(from_a), reach_b(from_b), goal_.at_end);
  }
  /// The same of two leaves or items in that direction: what is hollow is nearly as near in many.
  template <class A, class B>
  bool prunesBetween(const A& a, const StepBox& box_a, const B& b, const StepBox& box_b, Pair& pair) {
    if (!(enough_m_ > 0)) return false;
    const auto reachOf = [&](const auto& tree, std::uint32_t in) {
      return [&tree, in, items = pair.items](const Turning& along) {
        return items ? tree.itemReach(in, along) : tree.leafReach(in, along);
      };
    };
    return prunesApart(apartBetween(box_a, reachOf(a, pair.a), box_b, reachOf(b, pair.b)), pair);
  }

  /// Whether a face's own plane shows that a leaf of the other tree needs no further look. Of things that face each
  /// other and bend, each face has another plane beyond which all lies that is near it.
  template <class Tree, class Other>
  bool prunesBeyond(const Tree& tree, std::uint32_t item, const Other& other, std::uint32_t leaf) {
    if constexpr (Tree::LEAF > 1 && Other::LEAF > 1) {
      Turning out = tree.itemNormal(item);
      if (!(enough_m_ > 0) || out[0] == Vec3::Zero() || out[1] == Vec3::Zero()) return false;
      const StepBox box = other.box(leaf), own = tree.itemBox(item);
      for (int end = 0; end < 2; ++end) {
        if (out[end].dot(box.middle(end) - own.middle(end)) < 0) out[end] = -out[end];
      }
      const Turning back{-out[0], -out[1]};
      Pair all{};
      return prunesApart(apartBy(tree.itemReach(item, out), other.leafReach(leaf, back), goal_.at_end), all);
    }
    return false;
  }

  /// Of all of a tree's corners, by one coefficient of their reach along a direction.
  template <class Tree>
  Furthest furthest(const Tree& tree, const Turning& along, std::size_t which) {
    Furthest found;
    open_.assign(1, {std::numeric_limits<double>::infinity(), tree.root()});
    while (!open_.empty()) {
      const auto [box_m, in] = open_.back();
      open_.pop_back();
      if (box_m <= found.reach_m) continue;
      if (tree.isLeaf(in)) {
        tree.forCorners(in, [&](const VertexMotion& corner) {
          const double reach_m = Reach::of(corner, along, which);
          if (reach_m > found.reach_m) found = {reach_m, in, corner};
        });
        continue;
      }
      tree.forChildren(in, [&](std::uint32_t child) {
        const double reach_m = tree.box(child).reach(along, which);
        if (reach_m <= found.reach_m) return;
        open_.emplace_back(reach_m, child);
        const std::size_t last = open_.size() - 1;  // the one that reaches furthest comes first
        if (last > 0 && open_[last - 1].first > reach_m) std::swap(open_[last - 1], open_[last]);
      });
    }
    return found;
  }

  /// Of a leaf's items the one that faces a direction most.
  template <class Tree>
  std::uint32_t facing(const Tree& tree, std::uint32_t leaf, const Vec3& n, int end) {
    std::uint32_t best = tree.first(leaf);
    double most_m = -std::numeric_limits<double>::infinity();
    for (std::uint32_t item = tree.first(leaf); item < tree.first(leaf) + tree.count(leaf); ++item) {
      const MovingHull hull = tree.itemHull(item);
      double reach_m = 0;
      for (std::size_t k = 0; k < hull.count; ++k) reach_m += n.dot((end == 0 ? hull.t0 : hull.t1)[k]);
      reach_m /= static_cast<double>(hull.count);
      if (reach_m > most_m) most_m = reach_m, best = item;
    }
    return best;
  }

  /// Of two trees: what of the other one may be nearer to an item of the first (or, second, the other way round) than
  /// what was found, the nearest boxes first. Ends where nothing is nearer than at_least_m.
  template <class A, class B, class Meet>
  void compareAround(const A& a, const B& b, std::uint32_t item, bool second, double at_least_m, const Meet& meet) {
    const auto look = [&](const auto& own, const auto& tree, const auto& compareWith) {
      const StepBox box = own.itemBox(item);
      const auto gapTo = [&](const StepBox& other) { return squaredGap(box, other, goal_.at_end ? 1 : 0); };
      open_.assign(1, {0.0, tree.root()});
      while (!open_.empty() && at_least_m < enough_m_ && !isLate()) {
        const auto [squared, in] = open_.back();
        open_.pop_back();
        if (squared >= enough_squared_) continue;
        if (has_direction_) {
          const Reach its = reach(own, item, true, second ? 1 : 0), others = reach(tree, in, false, second ? 0 : 1);
          if (apartBy(its, others, goal_.at_end) >= enough_m_) continue;
        }
        if (tree.isLeaf(in)) {
          const auto itsReach = [&](const Turning& along) { return own.itemReach(item, along); };
          const auto leafReach = [&tree, in = in](const Turning& along) { return tree.leafReach(in, along); };
          if (apartBetween(box, itsReach, tree.box(in), leafReach) >= enough_m_) continue;
          for (std::uint32_t other = tree.first(in); other < tree.first(in) + tree.count(in); ++other) {
            if (gapTo(tree.itemBox(other)) < enough_squared_) compareWith(other);
          }
          continue;
        }
        tree.forChildren(in, [&](std::uint32_t child) {
          open_.emplace_back(gapTo(tree.box(child)), child);
          const std::size_t last = open_.size() - 1;
          if (last > 0 && open_[last - 1].first < open_[last].first) std::swap(open_[last - 1], open_[last]);
        });
      }
    };
    if (second) {
      look(b, a, [&](std::uint32_t other) { compare(a, b, {0, 0, other, item, true}, meet); });
    } else {
      look(a, b, [&](std::uint32_t other) { compare(a, b, {0, 0, item, other, true}, meet); });
    }
  }

  /// Of things that face each other the nearest two tell a direction that is wrong for what is beside them. As far as
  /// one can be right for all, it is that in which their hulls are furthest apart, at either end of the step. A few
  /// corners tell it by their nearest points: those that reach furthest along the direction before.
  template <class A, class B, class Meet>
  void findPlane(const A& a, const B& b, const Meet& meet) {
    Turning plane{Vec3::Zero(), Vec3::Zero()};
    plane_ = 0;
    compareAround(a, b, found_.item[0], false, 0, meet);
    compareAround(a, b, found_.item[1], true, 0, meet);
    for (int end = 1; end >= (goal_.at_end ? 1 : 0); --end) {
      const std::size_t which = end == 0 ? Reach::START : Reach::END;
      pair_.set(a.itemHull(found_.item[0]), b.itemHull(found_.item[1]));
      Nearest nearest = pair_.at(end, goal_.tolerance_m / 4);
      std::array<MovingHull, 2> few;
      for (int side = 0; side < 2; ++side) {
        const Vec3 point = pair_.pointInMetres(nearest.point[side]);
        few[side].t0.fill(point);
        few[side].t1.fill(point);
        few[side].count = 8;
      }
      double& most_m = apart_m_[end];
      most_m = -std::numeric_limits<double>::infinity();
      for (std::size_t round = 0; round < MOST_PLANES; ++round) {
        const Vec3& n = nearest.direction;
        if (n == Vec3::Zero() || isOver()) return;
        const Furthest on_a = furthest(a, {-n, -n}, which), on_b = furthest(b, {n, n}, which);
        const double apart_m = -on_a.reach_m - on_b.reach_m;
        if (apart_m > most_m) most_m = apart_m, plane[end] = n;
        if (most_m - slack_m_ >= enough_m_) break;
        compareAround(a, b, facing(a, on_a.leaf, -n, end), false, most_m - slack_m_, meet);
        compareAround(a, b, facing(b, on_b.leaf, n, end), true, most_m - slack_m_, meet);
        if (!(enough_m_ > 0)) return;
        for (int side = 0; side < 2; ++side) {
          const VertexMotion& corner = (side == 0 ? on_a : on_b).corner;
          const double* p = end == 0 ? corner.t0 : corner.t1;
          few[side].t0[round % 8] = few[side].t1[round % 8] = Vec3(p[0], p[1], p[2]);
        }
        pair_.set(few[0], few[1]);
        nearest = pair_.at(1, goal_.tolerance_m / 4);
        if (pair_.upperInMetres(nearest.upper) - most_m < goal_.tolerance_m / 8) break;
      }
    }
    if (goal_.at_end) plane[0] = plane[1];
    if (!TurningAxes::areNear(plane)) return;
    axes_ = TurningAxes(plane);
    plane_ = ++planes_;
    checked_from_ = number_;
  }

  /// Whether the plane shows that nothing is nearer.
  template <class A, class B>
  bool prunesAll(const A& a, const B& b) {
    const Turning& n = axes_.axis[0];
    if (plane_ == 0 || !(enough_m_ > 0)) return false;
    double apart_m = goal_.at_end ? apart_m_[1] : std::min(apart_m_[0], apart_m_[1]);
    if (apart_m - slack_m_ < enough_m_) return false;
    if (!goal_.at_end) {
      if (isOver()) return false;
      const Turning against{-n[0], -n[1]};
      apart_m = std::min(apart_m, -furthest(a, against, Reach::MIDDLE).reach_m - furthest(b, n, Reach::MIDDLE).reach_m);
    }
    if (apart_m - slack_m_ < enough_m_) return false;
    settle(apart_m - slack_m_);
    return true;
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
    double lower = 0;
    if (enough_m_ > 0) {  // else nothing but whether they meet is open
      const double upper_m = found_.upper_m;
      const Nearest nearest = takeAt(1);
      lower = nearest.lower;
      if (found_.upper_m < upper_m) setDirection({nearest.direction, nearest.direction});
    }
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
  bool isOver() const { return found_.cut || goal_.deadline.isOver(); }  // for what takes longer than to look
  Nearest takeAt(double t);
  void setDirection(const Turning& direction);
  void takeMeeting();
  void refine();

  Goal goal_;
  FoundDistance found_;
  bool has_direction_ = false;
  Turning direction_;             // from the second to the first, of the nearest two so far
  std::uint64_t directions_ = 0;  // so many there were, in all searches
  std::array<std::vector<KnownReach>, 2> reach_;
  std::uint64_t plane_ = 0, planes_ = 0;  // its number, of so many in all searches; 0: none is known
  std::array<double, 2> apart_m_{};       // by it, at either end of the step
  TurningAxes axes_;                      // the first one is across it
  std::array<std::vector<KnownBox>, 2> turned_;
  std::uint32_t checked_from_ = 0;  // the number of the first pair after direction or plane was set; 0: neither is
  double slack_m_ = 0;              // of what is computed along them
  double enough_m_ = 0, enough_squared_ = 0;
  double settled_squared_ = 0;  // of all that was not looked into
  std::uint64_t looks_ = 0;
  std::uint32_t number_ = 0;
  std::vector<Pair> touching_, heap_;
  std::vector<std::pair<double, std::uint32_t>> open_;  // nodes, and how far they reach
  HullPair pair_;
  std::array<std::uint32_t, 2> item_{};
};

}  // namespace dccd
