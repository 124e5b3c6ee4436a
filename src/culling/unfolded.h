// High-level culling of self-collision: normal cone and contour test over a surface, or parts of it, and a whole step.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "culling/scene_arrays.h"

namespace dccd {

/// Which parts of a surface the groups of a cluster tree lie in, at every level: a bit for each part.
class PartsOfGroups {
 public:
  /// Two groups lie in one part, so that no features of theirs are to be looked at.
  bool isLeftOut(std::size_t level, const PartsOfGroups& other, std::uint32_t a, std::uint32_t b) const {
    return (levels_[level][a] & other.levels_[level][b]) != 0;
  }

 private:
  friend class Unfolded;
  std::vector<std::vector<std::uint64_t>> levels_;
};

/// Takes out of `count` flattened pairs of groups those that need not be looked at; returns how many are left.
std::size_t leaveOutPairs(const PartsOfGroups& a, const PartsOfGroups& b, std::size_t level, std::uint32_t* pairs,
                          std::size_t count);

/// Certifies that parts of a surface, at best all of it, cannot touch themselves during a step (Volino and
/// Magnenat-Thalmann 1994, made continuous).
///
/// A part S is a set of faces. No more than two of them meet in an edge, in opposite directions; nothing else is asked
/// of it, so that it may have holes. Let there be a direction V with n(t) . V > 0 for the normal n of each of its faces
/// at every t in [0,1], and let P project along V. Then P keeps the orientation of every face, and a point of the plane
/// away from the image of S's border is the image of as many points of S as the border winds around it, since each one
/// counts +1. Let the edges of the border never meet at any t but in common vertices, and let the border wind around
/// no point more than once (contour.h). Then P is one to one, but that S may come to a vertex of its border from
/// several sides: let two other points of S have one image. If one of them is no point of the border, its neighbourhood
/// covers one of the image, and that of the other one covers a sector, so that points nearby would have two preimages.
/// Two points of the border would be where two of its edges meet. So features of S without a common vertex never meet.
/// doc/algorithm.md has the rounding margins. What is not certified says nothing.
///
/// Parts are sets of cells, seen along 24 fixed directions, one after another, as long as that pays: first all that are
/// seen from their front along the direction for which they are most, which may be the whole surface; then those that
/// lie beside each other in no part yet, and those around them. A part whose border meets itself is tried again without
/// the cells at such places, in the next runs, too. Directions that held a part in the last run come first. Two
/// clusters of features are left out where one part holds both.
class Unfolded {
 public:
  using Parallel =
      std::function<void(std::size_t n, std::size_t piece, const std::function<void(std::size_t, std::size_t)>& f)>;
  static void oneByOne(std::size_t n, std::size_t, const std::function<void(std::size_t, std::size_t)>& f) { f(0, n); }

  explicit Unfolded(const SceneBody& body);
  ~Unfolded();
  Unfolded(Unfolded&& other) noexcept;

  /// The body must have no separation from itself and no inactive vertex. After a run that certified next to nothing
  /// some runs are left out, so that a surface that is folded everywhere pays for one in a hundred.
  void run(const SceneBody& body, const VertexMotion* vertices, const Parallel& parallel = oneByOne);
  /// Forgets what was certified.
  void clear() { part_count_ = 0; }

  /// The whole body is one part.
  bool isWhole() const { return part_count_ > 0 && whole_; }
  std::size_t partCount() const { return part_count_; }
  /// Most of it is in parts.
  bool holdsMost() const { return part_count_ > 0 && holds_most_; }
  /// Of the body's tree; null: nothing is left out.
  const PartsOfGroups* parts(FeatureKind kind) const {
    return part_count_ > 0 ? &parts_[static_cast<int>(kind)] : nullptr;
  }

 private:
  class Search;
  std::unique_ptr<Search> search_;  // null: no surface, or not one that meets itself
  std::size_t part_count_ = 0;
  bool whole_ = false, holds_most_ = false;
  PartsOfGroups parts_[3];  // by FeatureKind
};

}  // namespace dccd
