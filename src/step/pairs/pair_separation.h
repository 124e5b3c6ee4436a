// What a pair of features carries into the elementary test: the separation of its bodies and its vertices' uncertainty,
// unless it is left out of them. One rule, for the step and for the trace of a pair.
#pragma once

#include <algorithm>
#include <limits>

#include "culling/scene_arrays.h"
#include "dccd/tolerances.h"

namespace dccd {

struct PairSeparation {
  double total_m = 0;     ///< a contact from this distance on
  double noise_m = 0;     ///< of it, the uncertainty of the vertices
  bool left_out = false;  ///< a neighbour on the mesh: only a touch counts
  /// Farther apart in the reference frame than its bodies' separation: without uncertainty it would not be left out.
  bool for_noise = false;
};

/// The rule for the features of two bodies, or of one with itself.
struct SeparationRule {
  double bodies_m = 0;            ///< the separation of the two
  bool uncertain = false;         ///< some vertex of theirs has a radius
  bool wide_list = false;         ///< what may be left out was listed for radii, so farther than the separation
  double tolerance_m = 0;         ///< the elementary test may call features this far apart a contact
  const double* radii = nullptr;  ///< per internal vertex; only where some vertex is uncertain

  SeparationRule() = default;
  SeparationRule(const SceneArrays& scene, std::size_t body_a, std::size_t body_b, double tolerance)
      : bodies_m(scene.separation(body_a, body_b)),
        uncertain(scene.bodies()[body_a].uncertain || scene.bodies()[body_b].uncertain),
        wide_list(scene.bodies()[body_a].setup.reference && !scene.bodies()[body_a].setup.reference->radius_m.empty()),
        tolerance_m(tolerance),
        radii(scene.radii()) {}

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

  /// apart_m: the pair's distance in the reference frame where it is listed, else infinity.
  PairSeparation of(PairKind kind, const Quad& pair, double apart_m) const {
    PairSeparation s;
    s.noise_m = noise(kind, pair);
    // Rounded up, so that a contact at exactly the sum is none too far.
    s.total_m = s.noise_m > 0 ? (bodies_m + s.noise_m) * (1 + tolerance::SEPARATION_SUM) : bodies_m;
    // The list is made for the largest radii so far; what counts is what the vertices are known to now.
    const bool listed = apart_m < std::numeric_limits<double>::infinity();
    s.left_out = listed && (!wide_list || apart_m <= s.total_m + tolerance_m);
    s.for_noise = s.left_out && wide_list && s.noise_m > 0 && apart_m > bodies_m;
    if (s.left_out) s.total_m = s.noise_m = 0;
    return s;
  }
};

}  // namespace dccd
