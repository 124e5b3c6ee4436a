#include "octomap/view_reading.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <sstream>

#include "obstacle/radix_sort.h"
#include "obstacle/voxel_bits.h"
#include "octomap/camera_fit.h"
#include "simd/point_places.h"

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

/// takeInto(first, places): finds the places of `places.count` points or pixels from the first one on. kindOf(i): of
/// one without a place.
template <class TakeInto, class KindOf>
void ViewReader::readPoints(const SensorView& view, const ViewLimits& limits, float* depths, const TakeInto& takeInto,
                            const KindOf& kindOf, SeenCounts& counts) {
  const Vector3d sensor = limits.voxels(view.map_from_sensor.translation());
  const double scale = limits.voxels_per_m, near2 = std::pow(limits.near_m * scale, 2);
  const double fill2 = std::pow(limits.fill_m * scale, 2), clear = limits.clear_m * scale;
  // What lies further away ends in no voxel that is cleared.
  const double keep2 = view.clears ? std::pow(clear + DIAGONAL, 2) : 0;
  simd::PlaceLimits grid;
  for (int axis = 0; axis < 3; ++axis) {
    grid.sensor[axis] = sensor[axis];
    grid.lo[axis] = std::max(limits.lo[axis], 0.0);
    grid.hi[axis] = std::min(limits.hi[axis], 65536.0);
  }
  grid.nearest2 = near2;
  grid.farthest2 = fill2;
  const float no_return = counts.no_return_cleared ? NO_RETURN : NOTHING;
  recent_.assign(std::size_t{1} << RECENT_BITS, ~std::uint64_t{0});
  const auto isNew = [&](std::uint64_t word) {
    std::uint64_t& last = recent_[word * 0x9e3779b97f4a7c15u >> (64 - RECENT_BITS)];
    const bool is_new = last != word;
    last = word;
    return is_new;
  };
  std::int32_t last[3] = {-1, -1, -1};
  bool last_fills = false;
  simd::PointPlaces places;
  const std::size_t all = view.width * view.height;
  for (std::size_t first = 0; first < all; first += places.count) {
    places.count = std::min(simd::PointPlaces::MOST, view.width - first % view.width);  // of one row
    takeInto(first, grid, places);
    if (depths) std::copy(places.depth, places.depth + places.count, depths + first);
    counts.filled += places.count - places.fresh_count;
    for (std::size_t f = 0; f < places.fresh_count; ++f) {
      const auto i = static_cast<std::size_t>(places.fresh[f]);
      const double away2 = places.away2[i];
      if (away2 == 0 || away2 < near2) {
        const Kind kind = away2 == 0 ? kindOf(first + i) : Kind::POINT;
        ++(kind == Kind::POINT ? counts.near : kind == Kind::NO_RETURN ? counts.no_return : counts.nothing);
        if (depths) depths[first + i] = kind == Kind::NO_RETURN ? no_return : NOTHING;
        continue;
      }
      const bool is_far = away2 > fill2, is_in = places.is_in[i] != 0;
      if (!is_in && !is_far) {
        const Vector3d at = sensor + Vector3d(places.x[i], places.y[i], places.z[i]);
        const bool is_wanted = (at.array() >= limits.lo.array()).all() && (at.array() < limits.hi.array()).all();
        if (is_wanted) checkSpan("a point lies at", at, limits);
      }
      ++(is_far ? counts.far : is_in ? counts.filled : counts.outside);
      if (!is_in || (is_far && away2 > keep2)) continue;
      const std::int32_t x = places.key[0][i], y = places.key[1][i], z = places.key[2][i];
      if (((x ^ last[0]) | (y ^ last[1]) | (z ^ last[2])) == 0 && is_far != last_fills) continue;
      last[0] = x, last[1] = y, last[2] = z;
      last_fills = !is_far;
      const auto bits = [](std::int32_t key) { return static_cast<std::uint32_t>(key); };
      const std::uint64_t packed = bits(x) | std::uint64_t{bits(y)} << 16 | std::uint64_t{bits(z)} << 32;
      if (!isNew(packed << 1 | (is_far ? 1u : 0u))) continue;
      ends.push_back(endWord(mortonCode(bits(x), bits(y), bits(z)), !is_far));
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
    const Vector3d corner = from_meters * Vector3d(-lens.cx / lens.fx, -lens.cy / lens.fy, 1);
    const Vector3d right = from_meters.col(0) / lens.fx, down = from_meters.col(1) / lens.fy;
    const auto take = [&](std::size_t first, const simd::PlaceLimits& grid, simd::PointPlaces& places) {
      const auto v = static_cast<double>(first / view.width), u = static_cast<double>(first % view.width);
      const Vector3d left = corner + down * v + right * u;
      simd::placeDepths(view.depth_m + first, left.data(), right.data(), grid, places);
    };
    const auto kindOf = [&](std::size_t i) {
      const float z = view.depth_m[i];
      return z == NO_RETURN ? Kind::NO_RETURN : std::isnan(z) || z == -NO_RETURN ? Kind::NOTHING : Kind::POINT;
    };
    readPoints(view, limits, depths, take, kindOf, counts);
  } else {
    const Vector3d ahead = camera ? Vector3d(camera->camera_from_sensor.row(2)) : Vector3d(0, 0, 0);
    const auto take = [&](std::size_t first, const simd::PlaceLimits& grid, simd::PointPlaces& places) {
      simd::placePoints(view.xyz + 3 * first, from_meters.data(), ahead.data(), grid, places);
    };
    const auto kindOf = [&](std::size_t i) {
      const float *p = view.xyz + 3 * i, x = p[0], y = p[1], z = p[2];
      if (x * 0 + y * 0 + z * 0 == 0) return Kind::POINT;
      return x == NO_RETURN || y == NO_RETURN || z == NO_RETURN ? Kind::NO_RETURN : Kind::NOTHING;
    };
    readPoints(view, limits, depths, take, kindOf, counts);
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
