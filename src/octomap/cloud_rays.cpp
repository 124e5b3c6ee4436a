#include "octomap/cloud_rays.h"

#include <algorithm>
#include <cmath>

#include "octomap/view_reading.h"

namespace dccd {
namespace {

using Eigen::Vector3d;

constexpr double INFINITE = std::numeric_limits<double>::infinity();
// Along a side, where voxels are the smallest: of one picture, where 2 leave too few rays of points in no order, and of
// six around the sensor, where more cells take longer and clear no more.
constexpr double CELLS_A_VOXEL = 2.5, CELLS_ALL_AROUND = 1.5;
constexpr double CELLS_A_POINT = 2;    // at most
constexpr double MOST_TANGENT = 2;     // of a face that is the only one
constexpr double MOST_PIXELS = 32000;  // along a side
constexpr std::size_t CELL_BYTES = 24, SAMPLES = 512;
constexpr int RECENT_BITS = 15;
constexpr double SQRT6 = 2.449489742783178;

bool isMeasured(const float* p, double near2) {
  const double x = p[0], y = p[1], z = p[2], square = x * x + y * y + z * z;
  return square > 0 && square >= near2 && square < INFINITE;
}
Vector3d pointAt(const float* p) { return Vector3d(p[0], p[1], p[2]); }

/// A word of its own for each cell of a grid, as far as a map reaches.
std::uint64_t cellWord(const Vector3d& at) {
  const auto coordinate = [&](int axis) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(at[axis]))) & 0x1fffff;
  };
  return coordinate(0) | coordinate(1) << 21 | coordinate(2) << 42;
}

/// A frame that looks where the points are, on the whole.
Eigen::Matrix3d frameOf(const SensorView& view, double near2) {
  const std::size_t count = view.width * view.height, step = std::max<std::size_t>(1, count / SAMPLES);
  Vector3d ahead = Vector3d::Zero();
  for (std::size_t i = 0; i < count; i += step) {
    if (isMeasured(view.xyz + 3 * i, near2)) ahead += pointAt(view.xyz + 3 * i).normalized();
  }
  ahead.normalize();
  Eigen::Index least = 0;
  ahead.cwiseAbs().minCoeff(&least);
  const Vector3d right = (Vector3d::Unit(least) - ahead[least] * ahead).normalized();
  Eigen::Matrix3d frame;
  frame << right.transpose(), ahead.cross(right).transpose(), ahead.transpose();
  return frame;
}

/// Along the axis's two directions.
Eigen::Matrix3d frameOf(std::size_t face) {
  const Eigen::Index axis = static_cast<Eigen::Index>(face / 2);
  Eigen::Matrix3d frame = Eigen::Matrix3d::Zero();
  frame(0, (axis + 1) % 3) = frame(1, (axis + 2) % 3) = 1;
  frame(2, axis) = face % 2 == 0 ? 1 : -1;
  return frame;
}

}  // namespace

std::size_t CloudRays::memoryBytes() const {
  std::size_t bytes = followed_.memoryBytes() + recent_.capacity() * sizeof(std::uint64_t);
  for (const Face& face : faces_) bytes += face.picture.memoryBytes() + 5 * face.points.capacity() * sizeof(float);
  return bytes;
}

std::size_t CloudRays::faceOf(const Vector3d& point) const {
  if (face_count_ == 1) return 0;
  Eigen::Index axis = 0;
  point.cwiseAbs().maxCoeff(&axis);
  return 2 * static_cast<std::size_t>(axis) + (point[axis] < 0 ? 1 : 0);
}

/// Which directions each face sees, and how far it is to the farthest point. False: these faces are too few.
bool CloudRays::measure(const SensorView& view, double near2) {
  for (Face& face : faces_) {
    face.is_seen = false;
    face.lo.setConstant(INFINITE);
    face.hi = -face.lo;
  }
  double farthest2 = 0;
  for (std::size_t i = 0; i < view.width * view.height; ++i) {
    if (!isMeasured(view.xyz + 3 * i, near2)) continue;
    const Vector3d point = pointAt(view.xyz + 3 * i);
    Face& face = faces_[faceOf(point)];
    const Vector3d at = face.from_sensor * point;
    const Eigen::Array2d tangents = at.head<2>().array() / at[2];
    face.lo = face.lo.min(tangents);
    face.hi = face.hi.max(tangents);
    face.is_seen = true;
    if (!(at[2] > 0 && tangents.abs().maxCoeff() <= MOST_TANGENT)) return false;
    farthest2 = std::max(farthest2, point.squaredNorm());
  }
  farthest_m_ = std::sqrt(farthest2);
  return true;
}

/// Of each cell the farthest of its points.
void CloudRays::fill(const SensorView& view, double near2, double focal) {
  for (Face& face : faces_) {
    if (!face.is_seen) continue;
    const Eigen::Array2d last = ((face.hi - face.lo) * focal).round();
    face.width = static_cast<std::int32_t>(last[0]) + 1;
    face.height = static_cast<std::int32_t>(last[1]) + 1;
    const std::size_t size = static_cast<std::size_t>(face.width) * static_cast<std::size_t>(face.height);
    face.depths = face.picture.depths(static_cast<std::size_t>(face.width), static_cast<std::size_t>(face.height));
    std::fill_n(face.depths, size, std::numeric_limits<float>::quiet_NaN());
    face.points.resize(size);
  }
  for (std::size_t i = 0; i < view.width * view.height; ++i) {
    const float* const p = view.xyz + 3 * i;
    if (!isMeasured(p, near2)) continue;
    const Vector3d point = pointAt(p);
    Face& face = faces_[faceOf(point)];
    const Vector3d at = face.from_sensor * point;
    const double scale = focal / at[2];
    const auto pixel = [&](int axis, std::int32_t count) {
      return std::clamp(static_cast<std::int32_t>(at[axis] * scale - face.lo[axis] * focal + 0.5), 0, count - 1);
    };
    const std::size_t cell =
        static_cast<std::size_t>(pixel(1, face.height)) * face.width + static_cast<std::size_t>(pixel(0, face.width));
    const float depth = static_cast<float>(at[2]);
    if (face.depths[cell] >= depth) continue;
    face.depths[cell] = depth;
    face.points[cell] = static_cast<std::uint32_t>(i);
  }
}

void CloudRays::setWays(const SensorView& view, const Eigen::Matrix3d& from_meters, Face& face) {
  for (std::vector<float>& ways : face.ways) ways.resize(face.points.size());
  for (std::size_t cell = 0; cell < face.points.size(); ++cell) {
    if (!(face.depths[cell] > 0)) continue;
    const Vector3d point = pointAt(view.xyz + 3 * std::size_t{face.points[cell]});
    const Vector3d way = from_meters * point / face.from_sensor.row(2).dot(point);
    for (int axis = 0; axis < 3; ++axis) face.ways[axis][cell] = static_cast<float>(way[axis]);
  }
}

/// From there on; lengths in voxels.
void CloudRays::follow(const SensorView& view, double near2, const Vector3d& sensor, const Eigen::Matrix3d& from_meters,
                       double from, double to) {
  recent_.assign(std::size_t{1} << RECENT_BITS, ~std::uint64_t{0});
  for (std::size_t i = 0; i < view.width * view.height; ++i) {
    if (!isMeasured(view.xyz + 3 * i, near2)) continue;
    const Vector3d way = from_meters * pointAt(view.xyz + 3 * i);
    const double away = way.norm();
    if (away <= from) continue;
    const Vector3d start = sensor + way * (from / away), end = sensor + way * std::min(1.0, to / away);
    if (!(start.minCoeff() >= 0 && start.maxCoeff() < 65536)) continue;  // and so it goes on
    const std::uint64_t word = cellWord(end) << 1 | (away > to ? 1u : 0u);
    std::uint64_t& last = recent_[word * 0x9e3779b97f4a7c15u >> (64 - RECENT_BITS)];
    if (last != word) followed_.add(start, end);
    last = word;
  }
  followed_.sort();
}

void CloudRays::read(const SensorView& view, const ViewLimits& limits, std::size_t most_bytes) {
  const double near2 = limits.near_m * limits.near_m;
  const Vector3d sensor = limits.voxels(view.map_from_sensor.translation());
  face_count_ = 1;
  faces_[0].from_sensor = frameOf(view, near2);
  if (!measure(view, near2)) {
    face_count_ = faces_.size();
    for (std::size_t i = 0; i < face_count_; ++i) faces_[i].from_sensor = frameOf(i);
    measure(view, near2);
  }
  const double of_box = (limits.lo - sensor).cwiseAbs().cwiseMax((limits.hi - sensor).cwiseAbs()).norm();
  const double clear = std::min(limits.clear_m * limits.voxels_per_m, of_box);
  // As many cells as the voxels need where they are the smallest, or as there may be.
  double area = 0, longest = 0;
  for (const Face& face : faces_) {
    if (!face.is_seen) continue;
    area += (face.hi - face.lo).prod();
    longest = std::max(longest, (face.hi - face.lo).maxCoeff());
  }
  const double most_cells = std::min(CELLS_A_POINT * double(view.width * view.height), double(most_bytes / CELL_BYTES));
  const double cells_a_voxel = face_count_ == 1 ? CELLS_A_VOXEL : CELLS_ALL_AROUND;
  const double needed = cells_a_voxel * std::min(clear, farthest_m_ * limits.voxels_per_m);
  const double focal = std::min(needed, std::min(std::sqrt(most_cells / area), MOST_PIXELS / longest));
  const double pictured = focal < needed ? focal / cells_a_voxel : clear;
  const Eigen::Matrix3d from_meters = view.map_from_sensor.linear() * limits.voxels_per_m;

  followed_.clear(most_bytes);
  fill(view, near2, focal);
  if (pictured < clear) follow(view, near2, sensor, from_meters, pictured, clear);
  PictureGeometry geometry;
  geometry.sensor = sensor;
  geometry.fx = geometry.fy = focal;
  geometry.off_px = 0.5;
  geometry.range = pictured;
  geometry.resolution_m = limits.resolution_m;
  sensor_ = sensor;
  sensor_from_map_ = view.map_from_sensor.linear().transpose();
  for (Face& face : faces_) {
    if (!face.is_seen) continue;
    geometry.camera_from_map = face.from_sensor * view.map_from_sensor.linear().transpose();
    geometry.cx = -face.lo[0] * focal;
    geometry.cy = -face.lo[1] * focal;
    setWays(view, from_meters, face);
    for (int axis = 0; axis < 3; ++axis) geometry.ways[axis] = face.ways[axis].data();
    face.picture.build(geometry);
  }
}

Seen CloudRays::look(const OctreeCube& cube) {
  Seen seen = followed_.look(cube);
  if (seen == Seen::ALL) return seen;
  asked_ = 0;
  const auto ask = [&](std::size_t i) {
    if (seen == Seen::ALL || !faces_[i].is_seen) return;
    const Seen there = faces_[i].picture.look(cube);
    if (there == Seen::SOME) asked_ |= 1u << i;
    seen = std::max(seen, there);
  };
  if (face_count_ == 1) {
    ask(0);
    return seen;
  }
  // A ball around the cube meets what a face sees if its middle lies no further beside of that than this.
  const double half = 0.5 * cube.size(), around = SQRT6 * half;
  const Vector3d at = sensor_from_map_ * (Vector3d(cube.x + half, cube.y + half, cube.z + half) - sensor_);
  const Vector3d away = at.cwiseAbs();
  const double most = away.maxCoeff();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (away[axis] + around < most) continue;
    const std::size_t ahead = 2 * axis + (at[axis] < 0 ? 1 : 0);
    ask(ahead);
    if (most + away[axis] <= 2 * around) ask(ahead ^ 1u);
  }
  return seen;
}

bool CloudRays::crosses(const OctreeCube& cube) const {
  for (std::size_t i = 0; i < face_count_; ++i) {
    if ((asked_ >> i & 1u) != 0 && faces_[i].picture.crosses(cube)) return true;
  }
  return false;
}

}  // namespace dccd
