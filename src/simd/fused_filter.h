// Planar and non-penetration filter in one, many pairs at a time over raw arrays.
//
// Take one of the four points as origin (VF: the vertex p; EE: eb1 = d) and the other three as a, b, c: moving
// points again. Their cross products bc = b x c, ca = c x a, ab = a x b are quadratic in t, T = bc + ca + ab.
//
// Planar filter (paper, Section 5; the branch-free form). In the plane with normal n the 2D cross product of the
// projections is n.(b x c), whatever the basis of the plane, so one set of 3D cross products serves every plane.
// Let the features touch at time t, after projection:
//   VF: l a + m b + v c = 0, l, m, v >= 0, l + m + v = 1.  EE: (1-s) a + s b - u c = 0, s, u in [0, 1].
// If the 2 x 3 matrix of the projections has rank 2, its kernel is spanned by (n.bc, n.ca, n.ab), so with some K
//   VF: (n.bc, n.ca,  n.ab, n.T) = K (l, m, v, 1)      EE: (n.bc, n.ca, -n.ab, n.T) = K (1-s, s, u, 1-u),
// and with a smaller rank all are 0. So at the time of contact no two of the four have strictly opposite signs. A pair
// is rejected when one of the four is strictly positive during the whole step and another strictly negative: the three
// Bernstein coefficients of each are beyond the rounding margin on their side.
// Planes: any normal n will do, so each pair gets one of its own. Orthogonal to the motion of one feature relative to
// the other they hardly move, so that what passes by at any speed stays apart: this plane alone takes the survivors of
// n-body from 665,000 to 51,000, of which 50,490 meet. The three coordinate planes need no products more. A plane in
// which the features are seen undistorted, orthogonal to their mean normal, takes longer than the elementary test of
// what it rejects: a hundredth of the pairs of cloth-ball, none of n-body's. Last come the other five of the paper's
// eight.
//
// Non-penetration filter (Tang et al. 2010): a.(b x c) is the cubic of coplanarity; no contact when its four Bernstein
// coefficients have one strict sign.
//
// Rounding margins, u = 2^-24, M = largest |coordinate difference| of the pair (float). Differences are formed in
// double and rounded to float: relative error at most u (1 + 2^-28). To first order in u:
//   coefficient A or C of a cross product, two products: 2 (3u M^2) + 2u M^2 = 8u M^2, size <= 2 M^2;
//   coefficient B, four products: 4 (3u M^2) + 8u M^2 = 20u M^2, size <= 4 M^2;
//   n.B for a float vector n taken as exact, N = |n|_1: (20u + 3 * 4u) N M^2 = 32u N M^2, size <= 4 N M^2;
//   n.T: three of these and two sums: (3 * 32u + 8u + 12u) N M^2 = 116u N M^2;
//   a.(b x c): a0.bcA 46u M^3, a1.bcA + a0.bcB 168u M^3.
// The margins below are 128u M^2 (coordinate planes and the paper's other planes, N <= 3, use 128u N M^2), 128u N M^2
// and 192u M^3: the rest covers the terms in u^2 and the rounding of the margin itself. Underflow adds at most 2^-100
// as long as M <= 2^30 (each of fewer than 100 operations loses at most 2^-149 times a factor of at most 2^30 * N);
// pairs with a larger M are kept.
#pragma once

#include <cstddef>
#include <cstdint>

namespace dccd {
namespace simd {

/// Which certificates to try: ADAPTIVE in a step; the others measure what each buys.
enum class FusedPlanes : std::uint8_t {
  COORDINATE = 0,  ///< non-penetration and the coordinate planes
  ADAPTIVE = 1,    ///< and the pair's own plane
  ALL = 2          ///< and the paper's other five
};

/// Tests `count` pairs; vertices: 8 doubles each (x0 y0 z0 0 x1 y1 z1 0), aligned to 64 bytes; quads: VF v f0 f1 f2, EE
/// ea0 ea1 eb0 eb1. Writes the positions of the pairs that are kept, ascending, to kept (room for count); returns their
/// number.
std::size_t fusedFilter(const double* vertices, const std::uint32_t* quads, std::size_t count, bool edge_edge,
                        FusedPlanes planes, std::uint32_t* kept);

}  // namespace simd
}  // namespace dccd
