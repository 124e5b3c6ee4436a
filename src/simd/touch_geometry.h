// Where many pairs of mesh features touch, a pair in each lane (doc/algorithm.md, "Patches"): for display and control,
// nothing is decided with them. Every lane takes the same steps of IEEE arithmetic as closest_points.h does, so the
// numbers are its own to the bit on every target.
#pragma once

#include <cstddef>

namespace dccd {
namespace simd {

constexpr std::size_t TOUCHES = 32;  ///< lanes of a block

/// Pairs of one kind.
struct TouchBlock {
  double x[2][4][TOUCHES][3] = {};  ///< [m] at t0 and t1: of each vertex of the pair, in the order of Contact::vertex
  double toc[TOUCHES] = {};         ///< [0,1] of the step
  double point[3][TOUCHES] = {}, normal[3][TOUCHES] = {};
};

/// Point of contact, and the normal as the step begins, towards the first feature; 0 where there is none. Reads x at
/// t0, x at t1 of the vertices that move the point (of a vertex and a face: the vertex alone), and toc. count: at most
/// TOUCHES.
void touchPlaces(bool edge_edge, std::size_t count, TouchBlock& block);

}  // namespace simd
}  // namespace dccd
