// How a surface is seen during a step, along directions to which some of the records' directions are orthogonal
// (culling/unfolded.h).
#pragma once

#include <cstddef>
#include <cstdint>

namespace dccd {
namespace simd {

constexpr std::size_t VIEW_LINES = 12;
/// View 2 k is along line k, view 2 k + 1 against it.
constexpr std::size_t VIEWS = 2 * VIEW_LINES;
constexpr int VIEW_LINE[VIEW_LINES][3] = {{1, 0, 0},  {0, 1, 0},  {0, 0, 1}, {0, 1, 1},  {0, 1, -1}, {1, 1, 0},
                                          {1, -1, 0}, {1, 0, -1}, {1, 1, 1}, {1, 1, -1}, {1, -1, 1}, {1, -1, -1}};

/// views: of each face a bit for each view, set where the face's normal certainly points along it during the whole
/// step. vertices: as for fusedFilter(), faces: in groups as in GroupsView::vertices (simd/group_pairs.h), count of
/// them; all bits are set of an empty lane, of which the first one is none.
///
/// The normal's component along the view is quadratic in t; its Bernstein coefficients are the components of
/// A = p0 x q0, of (p0 x q1 + p1 x q0) / 2 and of C = p1 x q1, p and q two sides of the face. fused_filter.h has the
/// rounding of such numbers: with M the largest |difference| the sum of three components is off by at most 80u M^2.
void facedViews(const double* vertices, const std::uint32_t* groups, std::size_t count, std::uint32_t* views);

}  // namespace simd
}  // namespace dccd
