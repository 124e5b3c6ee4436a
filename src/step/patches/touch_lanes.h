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

/// Of outcome.contacts from first to last, which are in canonical order: use(contact, count, block) gets touchPlaces()
/// of a block of lanes, other(contact) those with the map and, where the step is cut into parts, all. contact: its
/// place in the list.
template <class Use, class Other>
void inLanes(const Outcome& outcome, std::size_t first, std::size_t last, const Use& use, const Other& other) {
  simd::TouchBlock block;
  const Contact* const contacts = outcome.contacts.data();
  // Of one kind, and of the same two bodies.
  const auto takeAlike = [&](std::size_t end, auto edges) {
    std::array<const Vec3*, 4> t0, t1;
    for (std::size_t k = 0; k < 4; ++k) {
      const Body& body = outcome.step->bodies[contacts[first].bodyOf(k)];
      t0[k] = body.t0->data(), t1[k] = body.t1->data();
    }
    for (std::size_t count; first < end; first += count) {
      count = std::min(simd::TOUCHES, end - first);
      for (std::size_t lane = 0; lane < count; ++lane) {
        const Contact& contact = contacts[first + lane];
        __builtin_prefetch(&contact + 4 * CONTACTS_AHEAD);
        const Contact& ahead = contacts[std::min(first + lane + CONTACTS_AHEAD, end - 1)];
        block.toc[lane] = contact.toc_lower;
#pragma GCC unroll 4
        for (std::size_t k = 0; k < 4; ++k) {
          if (k >= (edges ? 2 : 1)) {  // the first feature is that of the contacts before
            __builtin_prefetch(t0[k] + ahead.vertex[k]);
            __builtin_prefetch(t1[k] + ahead.vertex[k]);
          }
          std::memcpy(block.x[0][k][lane], t0[k] + contact.vertex[k], sizeof(Vec3));
          if (edges || k == 0) std::memcpy(block.x[1][k][lane], t1[k] + contact.vertex[k], sizeof(Vec3));
        }
      }
      simd::touchPlaces(edges, count, block);
      use(first, count, block);
    }
  };
  while (first < last) {
    const Contact& one = contacts[first];
    if (one.body[1] == OBSTACLE_BODY || outcome.substeps > 1) {
      other(first++);
      continue;
    }
    const auto is_alike = [&](const Contact& contact) { return contact.kind == one.kind && contact.body == one.body; };
    const std::size_t end = std::partition_point(&one, contacts + last, is_alike) - contacts;
    one.kind == PairKind::EDGE_EDGE ? takeAlike(end, std::true_type()) : takeAlike(end, std::false_type());
  }
}

/// What a kernel wrote of one lane.
inline Vec3 laneOf(const double (&x)[3][simd::TOUCHES], std::size_t lane) {
  return {x[0][lane], x[1][lane], x[2][lane]};
}

}  // namespace dccd
