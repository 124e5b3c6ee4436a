// A depth camera's organised cloud to the surface that it saw.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "dccd/types.h"
#include "input/mesh_views.h"

namespace dccd {

/// A pixel that is not further from the origin is no measurement, but what means none.
constexpr double NO_DEPTH_M = 0.01;

struct DepthSurfaceOptions {
  double max_edge_m = 0.05;  ///< neighbours further apart lie on two surfaces; no triangle spans them
  std::size_t stride = 4;    ///< every stride-th pixel of every stride-th row becomes a vertex
  double max_range_m = 0;    ///< pixels deeper than this (z of the camera's optical frame) are left out; 0: none
  std::size_t median = 1;    ///< depth becomes the median over this many kept pixels squared; odd, 1: as it is
};

struct DepthSurfaceError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct DepthSurface {
  Positions positions;  ///< the cloud's frame; every one carries a face
  std::vector<Face> faces;
  std::vector<std::uint32_t> pixel;  ///< of each vertex, its number in the cloud
  std::size_t no_measurement = 0;    ///< kept pixels that are not further than NO_DEPTH_M
};

/// Kept pixels of a cloud of this size.
std::size_t keptPixels(const CloudView& cloud, std::size_t stride);

/// Pixels that are not finite or out of range leave holes. Throws DepthSurfaceError when no three neighbours make a
/// triangle: a camera that sees nothing says nothing about what is there.
DepthSurface depthSurface(const CloudView& cloud, const DepthSurfaceOptions& options);

}  // namespace dccd
