// What a pair of features carries into the elementary test: the separation of its bodies and its vertices' uncertainty,
// unless it is left out of them: neighbours on the mesh would otherwise be contacts in every step. One rule, for the
// step and for the trace of a pair.
#pragma once

#include <algorithm>
#include <array>

#include "culling/scene_arrays.h"
#include "dccd/tolerances.h"

namespace dccd {

struct PairSeparation {
  double total_m = 0;     ///< a contact from this distance on
  double noise_m = 0;     ///< of it, the uncertainty of the vertices
  bool left_out = false;  ///< closer than the bodies' separation in the reference frame: only a touch counts
  /// Above 0: farther apart there than the separation, but not than this, which it would carry for its uncertainty. A
  /// pair that comes as near may touch or not; it carries the separation alone.
  double unsure_m = 0;
};

/// Distance of two features at rest [m], or a little more: that of two points on them. Points as in Contact: VF vertex,
/// face; EE edge, edge.
double restDistance(PairKind kind, const std::array<Vec3, 4>& points);

/// The rule for the features of two bodies, or of one with itself.
struct SeparationRule {
  double bodies_m = 0;             ///< the separation of the two
  bool uncertain = false;          ///< some vertex of theirs has a radius
  double tolerance_m = 0;          ///< the elementary test may call features this far apart a contact
  const double* radii = nullptr;   ///< per internal vertex; only where some vertex is uncertain
  const SceneBody* own = nullptr;  ///< whose features both are, if it has a reference frame

  SeparationRule() = default;
  SeparationRule(const SceneArrays& scene, std::size_t body_a, std::size_t body_b, double tolerance)
      : bodies_m(scene.separation(body_a, body_b)),
        uncertain(scene.bodies()[body_a].uncertain || scene.bodies()[body_b].uncertain),
        tolerance_m(tolerance),
        radii(scene.radii()),
        own(body_a == body_b && scene.bodies()[body_a].setup.reference ? &scene.bodies()[body_a] : nullptr) {}

  /// Pairs carry a distance, be it 0: what proves "never touch" alone has no say.
  bool applies() const { return bodies_m > 0 || uncertain; }

  /// By how much the vertices' uncertainty widens the pair: a point of a feature is a convex combination of its
  /// vertices, so that it is off by the largest of their radii at most.
  double noise(PairKind kind, const Quad& pair) const {
    if (!uncertain) return 0;
    const double* r = radii;
    if (kind == PairKind::EDGE_EDGE) return std::max(r[pair[0]], r[pair[1]]) + std::max(r[pair[2]], r[pair[3]]);
    return r[pair[0]] + std::max({r[pair[1]], r[pair[2]], r[pair[3]]});
  }

  PairSeparation of(PairKind kind, const Quad& pair) const {
    PairSeparation s;
    s.noise_m = noise(kind, pair);
    // Rounded up, so that a contact at exactly the sum is none too far.
    s.total_m = s.noise_m > 0 ? (bodies_m + s.noise_m) * (1 + tolerance::SEPARATION_SUM) : bodies_m;
    if (own && s.total_m > 0) leaveOut(kind, pair, s);
    return s;
  }

 private:
  void leaveOut(PairKind kind, const Quad& pair, PairSeparation& s) const;
};

}  // namespace dccd
