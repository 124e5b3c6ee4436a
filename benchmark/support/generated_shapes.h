// Triangulated shapes for generated scenes: plain vertex and face lists, no randomness.
#pragma once

#include <functional>
#include <vector>

#include "dccd/types.h"

namespace dccd {
namespace test {

struct TriangleShape {
  Positions vertices;
  std::vector<Face> faces;
};

/// A flat square sheet in the plane z = 0 with `cells` x `cells` cells of two triangles, centred at the origin.
TriangleShape sheet(std::size_t cells, double side_m);

/// The unit sphere as a projected cube: 12 cells^2 triangles of nearly one size. cells >= 1.
TriangleShape cubeSphere(std::size_t cells);

/// A surface of revolution about the x axis from x = -half_length to half_length, closed where radius(x) is 0 at the
/// ends. rings >= 2 along the axis, segments >= 3 around it.
TriangleShape revolution(std::size_t rings, std::size_t segments, double half_length_m,
                         const std::function<double(double)>& radius_m);

}  // namespace test
}  // namespace dccd
