// Contacts between meshes, gathered from the step's positions into lanes (simd/touch_geometry.h).
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <type_traits>

#include "dccd/outcome.h"
#include "simd/touch_geometry.h"

namespace dccd {

constexpr std::size_t CONTACTS_AHEAD = 16;  ///< whose vertices are fetched from memory

/// Of outcome.contacts from first to last, in their order: kernel(edge_edge, count, block) takes a block of lanes, then
/// use(contact, count, block) with the first of them; other(contact) those with the map and, where the step is cut into
/// parts, all. contact: its place in the list. PLACES: the kernel is simd::touchPlaces, which is spared the ends that
/// it does not use.
template <bool PLACES, class Kernel, class Use, class Other>
void inLanes(const Outcome& outcome, std::size_t first, std::size_t last, const Kernel& kernel, const Use& use,
             const Other& other) {
  const std::vector<Body>& bodies = outcome.step->bodies;
  simd::TouchBlock block;
  struct Ends {
    const Vec3 *t0, *t1;
  };
  std::array<Ends, 2> ends;  // of the bodies last seen
  std::array<std::uint16_t, 2> of{OBSTACLE_BODY, OBSTACLE_BODY};
  const auto take = [&](const Contact& contact, const Contact& ahead, std::size_t lane, auto edges) {
    if (contact.body[0] != of[0] || contact.body[1] != of[1]) {
      of = contact.body;
      for (int side = 0; side < 2; ++side) {
        ends[side] = {bodies[of[side]].t0->data(), bodies[of[side]].t1->data()};
      }
    }
    const bool fetched = ahead.body[0] == of[0] && ahead.body[1] == of[1];
    block.toc[lane] = contact.toc_lower;
#pragma GCC unroll 4
    for (std::size_t k = 0; k < 4; ++k) {
      const Ends& side = ends[k >= (edges ? 2 : 1)];
      const Index vertex = contact.vertex[k];
      if (fetched && k >= (edges ? 2 : 1)) {  // the first feature is that of the contacts before
        __builtin_prefetch(side.t0 + ahead.vertex[k]);
        __builtin_prefetch(side.t1 + ahead.vertex[k]);
      }
      std::memcpy(block.x[0][k][lane], side.t0 + vertex, sizeof(Vec3));
      if (!PLACES || edges || k == 0) std::memcpy(block.x[1][k][lane], side.t1 + vertex, sizeof(Vec3));
    }
  };
  for (std::size_t c = first; c < last;) {
    const Contact* const contacts = &outcome.contacts[c];
    if (contacts->body[1] == OBSTACLE_BODY || outcome.substeps > 1) {
      other(c++);
      continue;
    }
    const auto fill = [&](auto edges) {
      std::size_t count = 0;
      const std::size_t most = std::min(simd::TOUCHES, last - c);
      while (count < most && contacts[count].kind == contacts->kind) {
        __builtin_prefetch(contacts + std::min(count + 4 * CONTACTS_AHEAD, last - c));
        take(contacts[count], contacts[std::min(count + CONTACTS_AHEAD, last - c - 1)], count, edges);
        ++count;
      }
      kernel(edges, count, block);
      return count;
    };
    const std::size_t count = contacts->kind == PairKind::EDGE_EDGE ? fill(std::true_type()) : fill(std::false_type());
    use(c, count, block);
    c += count;
  }
}

/// What a kernel wrote of one lane.
inline Vec3 laneOf(const double (&x)[3][simd::TOUCHES], std::size_t lane) {
  return {x[0][lane], x[1][lane], x[2][lane]};
}

}  // namespace dccd
