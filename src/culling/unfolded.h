// High-level culling of self-collision: normal cone and contour test over a whole surface and a whole step.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "culling/contour.h"
#include "culling/scene_arrays.h"

namespace dccd {

/// Certifies that a surface cannot touch itself during a step (Volino and Magnenat-Thalmann 1994, made continuous).
///
/// No more than two faces meet in an edge, in opposite directions, and the surface's border is one cycle of edges that
/// comes to each of its vertices once. Let there be a direction V with n(t) . V > 0 for the normal n of each face at
/// every t in [0,1], and let P project along V. Then P keeps the orientation of every face, and a point of the plane
/// away from the image of the border is the image of as many points of the surface as the border winds around it, since
/// each one counts +1. Let the edges of the border never meet at any t but in common vertices (contour.h). Then its
/// image is a simple polygon, which winds around a point once or not at all, and P is one to one: let two points of the
/// surface have one image. If one of them is no point of the border, its neighbourhood covers one of the image, and
/// that of the other one covers a sector, so that points nearby would have two preimages. Two points of the border
/// would be where two of its edges meet. So features without a common vertex never meet. doc/algorithm.md has the
/// rounding margins. What is not certified says nothing.
///
/// 24 fixed directions are tried, one in a step: the one that held last time, or else the next.
class Unfolded {
 public:
  using Parallel =
      std::function<void(std::size_t n, std::size_t piece, const std::function<void(std::size_t, std::size_t)>& f)>;
  static void oneByOne(std::size_t n, std::size_t, const std::function<void(std::size_t, std::size_t)>& f) { f(0, n); }

  explicit Unfolded(const SceneBody& body);

  /// The body must have no separation from itself and no inactive vertex.
  void run(const SceneBody& body, const VertexMotion* vertices, const Parallel& parallel = oneByOne);
  /// Forgets what was certified.
  void clear() { certified_ = false; }

  bool isCertified() const { return certified_; }

 private:
  std::uint32_t commonViews(const ClusterTree& faces, const VertexMotion* vertices, const Parallel& parallel);

  std::optional<Contour> border_;  // none: not a surface with one, or one that does not meet itself
  bool certified_ = false;
  std::size_t view_ = 0;         // that was tried last
  std::size_t first_piece_ = 0;  // of faces: the one in which the last search for a common view ended
};

}  // namespace dccd
