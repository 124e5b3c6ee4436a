// Whether a point lies in what a closed surface encloses, in rational arithmetic: the judge of the start state.
#pragma once

#include <array>
#include <vector>

#include "dccd/types.h"

namespace dccd {
namespace test {

/// Is the point on a face, or do an odd number of faces lie on a ray from it? The faces' edges must each lie on an even
/// number of faces, so that any ray that meets no edge gives the same answer. All coordinates must be finite.
bool isInSolid(const Vec3& point, const std::vector<std::array<Vec3, 3>>& faces);

}  // namespace test
}  // namespace dccd
