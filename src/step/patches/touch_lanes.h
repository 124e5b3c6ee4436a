// Contacts between meshes, gathered from the step's positions into lanes (simd/touch_geometry.h).
#pragma once

#include <algorithm>
#include <array>

#include "dccd/outcome.h"
#include "simd/touch_geometry.h"

namespace dccd {

/// Of outcome.contacts from first to last: kernel(edge_edge, count, block) takes a block of lanes, then
/// use(contact, block, lane) each of them, in any order; other(contact) those with the map and, where the step is cut
/// into parts, all. contact: its place in the list. PLACES: the kernel is simd::touchPlaces, which is spared the ends
/// that it does not use.
template <bool PLACES, class Kernel, class Use, class Other>
void inLanes(const Outcome& outcome, std::size_t first, std::size_t last, const Kernel& kernel, const Use& use,
             const Other& other) {
  const std::vector<Body>& bodies = outcome.step->bodies;
  std::array<simd::TouchBlock, 2> blocks;  // vertex-face, edge-edge
  std::array<std::array<std::size_t, simd::TOUCHES>, 2> contact_of;
  std::array<std::size_t, 2> used{0, 0};
  struct Ends {
    const Vec3 *t0, *t1;
  };
  std::array<Ends, 2> ends;  // of the bodies last seen
  std::array<std::uint16_t, 2> of{OBSTACLE_BODY, OBSTACLE_BODY};
  const auto flush = [&](bool edges) {
    kernel(edges, used[edges], blocks[edges]);
    for (std::size_t lane = 0; lane < used[edges]; ++lane) use(contact_of[edges][lane], blocks[edges], lane);
    used[edges] = 0;
  };
  for (std::size_t c = first; c < last; ++c) {
    const Contact& contact = outcome.contacts[c];
    if (contact.body[1] == OBSTACLE_BODY || outcome.substeps > 1) {
      other(c);
      continue;
    }
    const bool edges = contact.kind == PairKind::EDGE_EDGE;
    simd::TouchBlock& block = blocks[edges];
    const std::size_t lane = used[edges]++;
    contact_of[edges][lane] = c;
    block.toc[lane] = contact.toc_lower;
    if (contact.body[0] != of[0] || contact.body[1] != of[1]) {
      of = contact.body;
      for (int side = 0; side < 2; ++side) ends[side] = {bodies[of[side]].t0->data(), bodies[of[side]].t1->data()};
    }
    for (std::size_t k = 0; k < 4; ++k) {
      const Ends& side = ends[k >= (edges ? 2 : 1)];
      const Index vertex = contact.vertex[k];
      for (int axis = 0; axis < 3; ++axis) block.x[0][k][axis][lane] = side.t0[vertex][axis];
      if (PLACES && !edges && k > 0) continue;
      for (int axis = 0; axis < 3; ++axis) block.x[1][k][axis][lane] = side.t1[vertex][axis];
    }
    if (used[edges] == simd::TOUCHES) flush(edges);
  }
  for (const bool edges : {false, true}) flush(edges);
}

/// What a kernel wrote of one lane.
inline Vec3 laneOf(const double (&x)[3][simd::TOUCHES], std::size_t lane) {
  return {x[0][lane], x[1][lane], x[2][lane]};
}

}  // namespace dccd
