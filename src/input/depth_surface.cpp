// Compiled here, not taken from PCL's library, which would bring VTK into every program.
#define PCL_NO_PRECOMPILE
#include "input/depth_surface.h"

#include <pcl/filters/median_filter.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/surface/organized_fast_mesh.h>

#include <limits>

namespace dccd {

namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

constexpr std::size_t MAX_PIXELS = std::size_t{1} << 26;  // PCL counts twice as many triangles in 32 bits

std::size_t keptOf(std::size_t pixels, std::size_t stride) { return (pixels + stride - 1) / stride; }

/// A grid of filters would lose the rows and columns that make neighbours; this keeps them.
Cloud::Ptr thinned(const CloudView& cloud, const DepthSurfaceOptions& options, std::size_t& no_measurement) {
  constexpr float LOST = std::numeric_limits<float>::quiet_NaN();
  constexpr double FAR_M = 1e9;
  Cloud::Ptr out(new Cloud(static_cast<std::uint32_t>(keptOf(cloud.width, options.stride)),
                           static_cast<std::uint32_t>(keptOf(cloud.height, options.stride)),
                           pcl::PointXYZ(LOST, LOST, LOST)));
  std::size_t kept = 0;
  for (std::size_t row = 0; row < cloud.height; row += options.stride) {
    for (std::size_t col = 0; col < cloud.width; col += options.stride, ++kept) {
      const Vec3 p = cloud.point(row * cloud.width + col);
      // PCL works in float; what is past that is no point of a camera, either.
      if (!(p.cwiseAbs().maxCoeff() <= FAR_M) || (options.max_range_m > 0 && p.z() > options.max_range_m)) continue;
      if (!(p.norm() > NO_DEPTH_M)) {
        ++no_measurement;
        continue;
      }
      (*out)[kept] = pcl::PointXYZ(static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()));
    }
  }
  out->is_dense = false;
  return out;
}

Cloud::Ptr smoothed(const Cloud::Ptr& cloud, std::size_t median) {
  if (median <= 1) return cloud;
  pcl::MedianFilter<pcl::PointXYZ> filter;
  filter.setWindowSize(static_cast<int>(median));
  filter.setInputCloud(cloud);
  Cloud::Ptr out(new Cloud);
  filter.filter(*out);
  return out;
}

std::vector<pcl::Vertices> triangles(const Cloud::Ptr& cloud, double max_edge_m) {
  pcl::OrganizedFastMesh<pcl::PointXYZ> mesher;
  mesher.setTriangulationType(pcl::OrganizedFastMesh<pcl::PointXYZ>::TRIANGLE_ADAPTIVE_CUT);
  mesher.setMaxEdgeLength(static_cast<float>(max_edge_m));
  mesher.setInputCloud(cloud);
  std::vector<pcl::Vertices> polygons;
  mesher.reconstruct(polygons);
  return polygons;
}

}  // namespace

std::size_t keptPixels(const CloudView& cloud, std::size_t stride) {
  return keptOf(cloud.height, stride) * keptOf(cloud.width, stride);
}

DepthSurface depthSurface(const CloudView& cloud, const DepthSurfaceOptions& options) {
  if (keptPixels(cloud, options.stride) > MAX_PIXELS) {
    throw DepthSurfaceError("more than " + std::to_string(MAX_PIXELS) + " pixels are kept; raise topology/stride");
  }
  DepthSurface surface;
  const Cloud::Ptr seen = smoothed(thinned(cloud, options, surface.no_measurement), options.median);
  constexpr Index UNUSED = std::numeric_limits<Index>::max();
  std::vector<Index> vertex(seen->size(), UNUSED);
  const auto vertexOf = [&](std::size_t kept) {
    if (vertex[kept] == UNUSED) {
      const pcl::PointXYZ& p = (*seen)[kept];
      vertex[kept] = static_cast<Index>(surface.positions.size());
      surface.positions.emplace_back(p.x, p.y, p.z);
      const std::size_t row = kept / seen->width * options.stride, col = kept % seen->width * options.stride;
      surface.pixel.push_back(static_cast<std::uint32_t>(row * cloud.width + col));
    }
    return vertex[kept];
  };
  if (seen->width >= 2 && seen->height >= 2) {
    for (const pcl::Vertices& polygon : triangles(seen, options.max_edge_m)) {
      const auto& corners = polygon.vertices;
      surface.faces.push_back({vertexOf(static_cast<std::size_t>(corners[0])),
                               vertexOf(static_cast<std::size_t>(corners[1])),
                               vertexOf(static_cast<std::size_t>(corners[2]))});
    }
  }
  if (surface.faces.empty()) {
    throw DepthSurfaceError("no three of the " + std::to_string(seen->size()) +
                            " kept pixels are neighbours within topology/max_edge_m and topology/max_range_m");
  }
  return surface;
}

}  // namespace dccd
