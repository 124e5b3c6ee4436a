// What encloses space of a surface with a border. One whose corners are doubled, as exporters write it, has a border
// only by its numbers: where the corners lie at one place it is as closed as the same surface with shared ones. And one
// loose face beside a closed shell does not open it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "dccd/topology.h"

namespace dccd {

/// What closes a mesh with a border, as long as the two vertices of each pair are at one place.
struct Seams {
  std::vector<std::array<Index, 2>> vertices;  ///< empty: nothing closes it
  std::vector<std::uint8_t> repeated;          ///< per face; 1: no face, or an earlier one once more
  Edge border{};                               ///< where nothing closes it, if that was looked for
};

/// Merges the vertices with equal coordinates at both ends of a step: all of them move straight, so they are at one
/// place throughout it. Then, as for any mesh, faces that repeat a vertex or another face do not count, and each edge
/// must lie on an even number of the rest. Nothing for a mesh that is closed by its numbers. before: of an earlier
/// step.
Seams seamsOf(const Topology& topology, const Positions& t0, const Positions& t1, const Seams& before = {});

/// Of a mesh with a border by its numbers, the faces that enclose nothing: a part of the surface, faces joined by
/// vertices, is open where some edge lies on an odd number of its faces. Per face; 1: of an open part. Empty: all are.
std::vector<std::uint8_t> openFaces(const Topology& topology);

/// Whether the vertices of all pairs are at one place throughout the step.
bool hold(const Seams& seams, const Positions& t0, const Positions& t1);

}  // namespace dccd
