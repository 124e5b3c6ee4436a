// Closed meshes for the start state: simple ones, and random ones of every kind that has an inside.
#pragma once

#include "support/step_support.h"

namespace dccd {
namespace test {

/// Without motion; the box has its faces' diagonals as chance has it in a file.
StepBody box(const Vec3& low, const Vec3& high);
StepBody tetrahedron(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d);
/// An octahedron, each face cut into four `depth` times, its vertices on the sphere.
StepBody ball(const Vec3& centre, double radius, int depth);
/// A sheet of rows x cols points, `spacing` apart, parallel to the xy plane.
StepBody sheet(std::size_t rows, std::size_t cols, const Vec3& corner, double spacing);

/// One body of two: their vertices and faces after one another.
StepBody together(const StepBody& a, const StepBody& b);

/// The same faces, each with corners of its own, as exporters write them; not tested against itself.
StepBody withOwnCorners(const StepBody& body);

/// Boxes, tetrahedra, octahedra with vertices anywhere, shells in one another and parts that share a vertex or an edge,
/// with coordinates of the style given; every edge lies on an even number of faces.
StepBody randomClosed(const Draw& draw, Coordinates coordinates);

}  // namespace test
}  // namespace dccd
