#include "octomap/view_reading.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <sstream>

#include "obstacle/radix_sort.h"
#include "obstacle/voxel_bits.h"
#include "octomap/camera_fit.h"

namespace dccd {
namespace {

using Eigen::Vector3d;

constexpr float NO_RETURN = std::numeric_limits<float>::infinity(), NOTHING = std::numeric_limits<float>::quiet_NaN();
constexpr double DIAGONAL = 1.7320508075688772;  // of a voxel
constexpr int RECENT_BITS = 15;

enum class Kind : std::uint8_t { POINT, NO_RETURN, NOTHING };

bool isInSpan(const Vector3d& voxels) { return voxels.minCoeff() >= 0 && voxels.maxCoeff() < 65536; }

void checkSpan(const char* what, const Vector3d& voxels, const ViewLimits& limits) {
  if (isInSpan(voxels)) return;
  const Vector3d at = (voxels - Vector3d::Constant(32768)) * limits.resolution_m;
  std::ostringstream text;
  text << what << " (" << at.x() << ' ' << at.y() << ' ' << at.z() << ") m, beyond the 65536 voxels of "
       << limits.resolution_m << " m that a map can span";
  throw OctomapError(text.str());
}

}  // namespace

std::size_t ViewReader::memoryBytes() const {
  return (ends.capacity() + recent_.capacity() + other_.capacity()) * sizeof(std::uint64_t) + picture.memoryBytes() +
         rays.memoryBytes();
}

/// pointAt(i, u, v, place, depth): `place` is that of a point, relative to the sensor, along the map's axes, in voxels.
template <class PointAt>
void ViewReader::readPoints(const SensorView& view, const ViewLimits& limits, float* depths, const PointAt& pointAt,
                            SeenCounts& counts) {
  const Vector3d sensor = limits.voxels(view.map_from_sensor.translation());
  const double scale = limits.voxels_per_m, near2 = std::pow(limits.near_m * scale, 2);
  const double fill2 = std::pow(limits.fill_m * scale, 2), clear = limits.clear_m * scale;
  // What lies further away ends in no voxel that is cleared.
  const double keep2 = view.clears ? std::pow(clear + DIAGONAL, 2) : 0;
  const Eigen::Array3d lo = limits.lo.array().max(0.0), hi = limits.hi.array().min(65536.0);
  const float no_return = counts.no_return_cleared ? NO_RETURN : NOTHING;
  recent_.assign(std::size_t{1} << RECENT_BITS, ~std::uint64_t{0});
  const auto isNew = [&](std::uint64_t word) {
    std::uint64_t& last = recent_[word * 0x9e3779b97f4a7c15u >> (64 - RECENT_BITS)];
    const bool is_new = last != word;
    last = word;
    return is_new;
  };
  std::int32_t last[3] = {-1, -1, -1};
  std::uint64_t last_fills = 0;
  std::size_t i = 0;
  for (std::size_t v = 0; v < view.height; ++v) {
    for (std::size_t u = 0; u < view.width; ++u, ++i) {
      Vector3d place;
      float depth = NOTHING;
      const Kind kind = pointAt(i, u, v, place, depth);
      const double away2 = kind == Kind::POINT ? place.squaredNorm() : 0;
      if (away2 == 0 || away2 < near2) {
        ++(kind == Kind::POINT ? counts.near : kind == Kind::NO_RETURN ? counts.no_return : counts.nothing);
        if (depths) depths[i] = kind == Kind::NO_RETURN ? no_return : NOTHING;
        continue;
      }
      if (depths) depths[i] = depth;
      const Vector3d at = sensor + place;
      const bool is_far = away2 > fill2, is_in = (at.array() >= lo).all() && (at.array() < hi).all();
      if (!is_in && !is_far && (at.array() >= limits.lo.array()).all() && (at.array() < limits.hi.array()).all()) {
        checkSpan("a point lies at", at, limits);
      }
      ++(is_far ? counts.far : is_in ? counts.filled : counts.outside);
      if (!is_in || (is_far && away2 > keep2)) continue;
      const std::uint64_t fills = is_far ? 0 : 1;
      std::int32_t key[3];
      for (int axis = 0; axis < 3; ++axis) key[axis] = static_cast<std::int32_t>(at[axis]);
      if (((key[0] ^ last[0]) | (key[1] ^ last[1]) | (key[2] ^ last[2])) == 0 && fills == last_fills) continue;
      for (int axis = 0; axis < 3; ++axis) last[axis] = key[axis];
      last_fills = fills;
      const auto bits = [&](int axis) { return static_cast<std::uint32_t>(key[axis]); };
      const std::uint64_t word = endWord(mortonCode(bits(0), bits(1), bits(2)), fills != 0);
      if (isNew(~word)) ends.push_back(word);
    }
  }
}

static void setLens(const FittedCamera& camera, PictureGeometry& geometry) {
  geometry.fx = camera.lens.fx;
  geometry.fy = camera.lens.fy;
  geometry.cx = camera.lens.cx;
  geometry.cy = camera.lens.cy;
  geometry.off_px = camera.off_px;
}

SeenCounts ViewReader::read(const SensorView& view, const ViewLimits& limits, std::size_t most_bytes) {
  ends.clear();
  SeenCounts counts;
  PictureGeometry geometry;
  geometry.sensor = limits.voxels(view.map_from_sensor.translation());
  checkSpan("the sensor is at", geometry.sensor, limits);
  const Eigen::Matrix3d from_meters = view.map_from_sensor.linear() * limits.voxels_per_m;
  std::optional<FittedCamera> camera;
  if (view.depth_m) camera = FittedCamera{view.pinhole, Eigen::Matrix3d::Identity(), 0};
  if (view.xyz && view.clears) camera = fitCamera(view, limits.near_m);
  counts.is_picture = camera.has_value();
  counts.cleared = view.clears;
  counts.no_return_cleared = counts.is_picture && view.clears && limits.no_return_clears;
  float* const depths = camera && view.clears ? picture.depths(view.width, view.height) : nullptr;
  if (view.depth_m) {
    const Pinhole& lens = view.pinhole;
    const Vector3d first = from_meters * Vector3d(-lens.cx / lens.fx, -lens.cy / lens.fy, 1);
    const Vector3d right = from_meters.col(0) / lens.fx, down = from_meters.col(1) / lens.fy;
    readPoints(
        view, limits, depths,
        [&](std::size_t i, std::size_t u, std::size_t v, Vector3d& place, float& depth) {
          const float z = view.depth_m[i];
          if (z == NO_RETURN) return Kind::NO_RETURN;
          if (std::isnan(z) || z == -NO_RETURN) return Kind::NOTHING;
          depth = z;
          place = (first + right * double(u) + down * double(v)) * double(std::max(z, 0.0f));
          return Kind::POINT;
        },
        counts);
  } else {
    const Vector3d ahead = camera ? Vector3d(camera->camera_from_sensor.row(2)) : Vector3d(0, 0, 0);
    readPoints(
        view, limits, depths,
        [&](std::size_t i, std::size_t, std::size_t, Vector3d& place, float& depth) {
          const float *p = view.xyz + 3 * i, x = p[0], y = p[1], z = p[2];
          if (!(x * 0 + y * 0 + z * 0 == 0)) {
            return x == NO_RETURN || y == NO_RETURN || z == NO_RETURN ? Kind::NO_RETURN : Kind::NOTHING;
          }
          const Vector3d point(x, y, z);
          place = from_meters * point;
          depth = static_cast<float>(ahead.dot(point));
          return Kind::POINT;
        },
        counts);
  }
  radixSort(ends, other_);
  if (!view.clears) return counts;
  if (!camera) {
    rays.read(view, limits, most_bytes);
    return counts;
  }
  geometry.camera_from_map = camera->camera_from_sensor * view.map_from_sensor.linear().transpose();
  setLens(*camera, geometry);
  geometry.range = limits.clear_m * limits.voxels_per_m;
  geometry.resolution_m = limits.resolution_m;
  geometry.xyz = view.xyz;
  geometry.map_from_xyz = from_meters;
  picture.build(geometry);
  return counts;
}

}  // namespace dccd
