#include "octomap/depth_picture.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace dccd {
namespace {

constexpr double SQRT2 = 1.4142135623730951, SQRT3 = 1.7320508075688772;
// Of a depth as a float, and of a pixel: more than what the numbers cannot tell.
constexpr double DEPTH_ROUNDING = 1e-6, ROUNDING_PX = 1e-3;
// Rays that nearly cross a voxel: if none of so many does, it stays. Beside the sensor all of them nearly do.
constexpr int MOST_TRIED = 64;

/// Of 0 or more.
std::int32_t upOf(double number) {
  const auto whole = static_cast<std::int32_t>(number);
  return whole + (whole < number);
}

}  // namespace

float* DepthPicture::depths(std::size_t width, std::size_t height) {
  Level& all = levels_[0];
  all.width = static_cast<std::int32_t>(width);
  all.height = static_cast<std::int32_t>(height);
  all.nearest.resize(width * height);
  return all.nearest.data();
}

std::size_t DepthPicture::memoryBytes() const {
  std::size_t bytes = 0;
  for (const Level& level : levels_) {
    bytes += (level.nearest.capacity() + level.farthest.capacity()) * sizeof(float) + level.hole.capacity();
  }
  return bytes;
}

void DepthPicture::build(const PictureGeometry& geometry) {
  geometry_ = geometry;
  Eigen::Matrix3d lens;
  lens << geometry.fx, 0, geometry.cx, 0, geometry.fy, geometry.cy, 0, 0, 1;
  const Eigen::Vector3d focal(geometry.fx, geometry.fy, 1);
  project_ = focal.asDiagonal() * geometry.camera_from_map * geometry.resolution_m;
  spread_ = project_.cwiseAbs().rowwise().sum();
  pixel_ways_ = geometry.camera_from_map.transpose() * lens.inverse() / geometry.resolution_m;
  square_px_ = std::min(geometry.fx, geometry.fy) * geometry.resolution_m / SQRT2;  // of the ball in it
  beyond_.fill(NO_CUBE);
  findHoles();
  level_count_ = 1;
  while (levels_[level_count_ - 1].width > 1 || levels_[level_count_ - 1].height > 1) {
    reduce(levels_[level_count_ - 1], levels_[level_count_], level_count_ == 1);
    ++level_count_;
  }
}

/// Of each pixel the side of the largest square of pixels that say nothing which begins there, down and to the right.
void DepthPicture::findHoles() {
  Level& all = levels_[0];
  has_holes_ = false;
  for (const float depth : all.nearest) has_holes_ = has_holes_ || std::isnan(depth);
  if (!has_holes_) return;
  all.hole.resize(all.nearest.size());
  for (std::int32_t v = all.height - 1; v >= 0; --v) {
    const std::size_t row = static_cast<std::size_t>(v) * all.width;
    const std::uint8_t* below = v + 1 < all.height ? &all.hole[row + all.width] : nullptr;
    std::uint8_t right = 0;
    for (std::int32_t u = all.width - 1; u >= 0; --u) {
      std::uint8_t side = 0;
      if (std::isnan(all.nearest[row + u])) {
        const std::uint8_t beside = below && u + 1 < all.width ? std::min(right, std::min(below[u], below[u + 1])) : 0;
        side = static_cast<std::uint8_t>(std::min(MOST_HOLE, beside + 1));
      }
      all.hole[row + u] = right = side;
    }
  }
}

void DepthPicture::reduce(const Level& from, Level& to, bool is_first) const {
  to.width = (from.width + 1) / 2;
  to.height = (from.height + 1) / 2;
  const std::size_t size = static_cast<std::size_t>(to.width) * to.height;
  to.nearest.resize(size);
  to.farthest.resize(size);
  to.hole.resize(has_holes_ ? size : 0);
  const std::vector<float>& farthest = is_first ? from.nearest : from.farthest;
  for (std::int32_t v = 0; v < to.height; ++v) {
    const std::size_t row = static_cast<std::size_t>(2 * v) * from.width, out = static_cast<std::size_t>(v) * to.width;
    const std::size_t below = 2 * v + 1 < from.height ? row + from.width : row;
    const auto square = [&](const auto* values, std::int32_t u, auto start, const auto& better) {
      const std::int32_t left = 2 * u, right = std::min(left + 1, from.width - 1);
      auto best = start;  // what is not a number is never better
      for (const auto value : {values[row + left], values[row + right], values[below + left], values[below + right]}) {
        best = better(value, best) ? value : best;
      }
      return best;
    };
    for (std::int32_t u = 0; u < to.width; ++u) {
      to.nearest[out + u] = square(from.nearest.data(), u, NOWHERE, [](float a, float b) { return a < b; });
      to.farthest[out + u] = square(farthest.data(), u, -NOWHERE, [](float a, float b) { return a > b; });
    }
    for (std::int32_t u = 0; has_holes_ && u < to.width; ++u) {
      to.hole[out + u] = square(from.hole.data(), u, std::uint8_t{0}, [](int a, int b) { return a > b; });
    }
  }
}

/// Of the pixels of the area, and of some beside them.
DepthPicture::Depths DepthPicture::depthsOf(const Area& area) const {
  // Below this one a side has more than three squares.
  int level = 30 - __builtin_clz(static_cast<unsigned>(std::max(area.u1 - area.u0, area.v1 - area.v0)) | 3u);
  while (((area.u1 >> level) - (area.u0 >> level)) > 2 || ((area.v1 >> level) - (area.v0 >> level)) > 2) ++level;
  const Level& squares = levels_[level];
  // Always three by three, some more than once: processors guess badly how many there are of each cube.
  const std::int32_t u0 = area.u0 >> level, u1 = area.u1 >> level, v0 = area.v0 >> level, v1 = area.v1 >> level;
  const std::size_t columns[3] = {std::size_t(u0), std::size_t(std::min(u0 + 1, u1)), std::size_t(u1)};
  const std::size_t width = squares.width, rows[3] = {v0 * width, std::min(v0 + 1, v1) * width, v1 * width};
  const auto best = [&](const auto* values, auto start, const auto& better) {
    for (const std::size_t row : rows) {
      for (const std::size_t column : columns) {
        const auto value = values[row + column];
        start = better(value, start) ? value : start;
      }
    }
    return start;
  };
  const float* const last = level == 0 ? squares.nearest.data() : squares.farthest.data();
  Depths depths;
  depths.nearest = best(squares.nearest.data(), NOWHERE, [](float a, float b) { return a < b; });
  depths.farthest = best(last, -NOWHERE, [](float a, float b) { return a > b; });
  if (has_holes_) depths.hole = best(squares.hole.data(), std::uint8_t{0}, [](int a, int b) { return a > b; });
  return depths;
}

Seen DepthPicture::look(const OctreeCube& cube) {
  const Level& all = levels_[0];
  const double half = 0.5 * cube.size();
  const Eigen::Vector3d center = Eigen::Vector3d(cube.x + half, cube.y + half, cube.z + half) - geometry_.sensor;
  const Eigen::Vector3d at = project_ * center, reach = half * spread_;
  const double margin = DEPTH_ROUNDING * (std::abs(at[2]) + reach[2]);
  const double nearest = at[2] - reach[2] - margin, farthest = at[2] + reach[2] + margin;
  const double away2 = center.squaredNorm(), radius = SQRT3 * half;
  const double out = geometry_.range + radius, in = std::max(0.0, geometry_.range - radius);
  if (farthest <= 0 || away2 > out * out) return Seen::NONE;
  const double of_far = 1 / farthest;
  const double off = geometry_.off_px + ROUNDING_PX;
  const double side = square_px_ * of_far - 2 * off;
  const bool is_in_range = away2 <= in * in;
  if (cube.size() == 1 && nearest > 0 && is_in_range) {
    // The square that the voxel covers is around its middle: of most voxels the pixel there says enough.
    const double of_depth = 1 / at[2], u = geometry_.cx + at[0] * of_depth, v = geometry_.cy + at[1] * of_depth;
    if (u >= 0 && v >= 0 && u < all.width - 1 && v < all.height - 1) {
      const auto pixel_u = static_cast<std::int32_t>(u + 0.5), pixel_v = static_cast<std::int32_t>(v + 0.5);
      const float depth = all.nearest[static_cast<std::size_t>(pixel_v) * all.width + pixel_u];
      if (std::max(std::abs(u - pixel_u), std::abs(v - pixel_v)) <= 0.5 * side &&
          static_cast<double>(depth) > farthest) {
        return Seen::ALL;
      }
    }
  }
  const double of_near = nearest > 0 ? 1 / nearest : std::numeric_limits<double>::infinity();
  const auto pixels = [&](int axis, double middle, std::int32_t count, std::int32_t& first, std::int32_t& last) {
    const double lo = at[axis] - reach[axis], hi = at[axis] + reach[axis];
    const double from = middle + lo * (lo >= 0 ? of_far : of_near) - off;
    const double to = middle + hi * (hi >= 0 ? of_near : of_far) + off;
    first = from > 0 ? upOf(std::min<double>(from, count)) : 0;
    last = to < count - 1 ? (to < 0 ? -1 : static_cast<std::int32_t>(to)) : count - 1;
    return from >= 0 && to <= count - 1;
  };
  const bool is_inside =
      pixels(0, geometry_.cx, all.width, area_.u0, area_.u1) & pixels(1, geometry_.cy, all.height, area_.v0, area_.v1);
  if (area_.u0 > area_.u1 || area_.v0 > area_.v1) return Seen::NONE;
  // What all pixels of the cube above end beyond, those of this one do.
  const int depth = cube.depth;
  const bool is_beyond = depth > 0 && beyond_[depth - 1] == cube.code >> 3 * (CUBE_DEPTHS - depth);
  const Depths depths = is_beyond ? Depths() : depthsOf(area_);
  if (static_cast<double>(depths.farthest) < nearest) return Seen::NONE;
  const bool all_beyond = static_cast<double>(depths.nearest) > farthest;
  beyond_[depth] = all_beyond && depths.hole == 0 ? cube.code >> 3 * (CUBE_DEPTHS - 1 - depth) : NO_CUBE;
  nearest_m_ = nearest;
  farthest_m_ = farthest;
  const bool all_pass = is_inside && nearest > 0 && all_beyond && side >= 1 &&
                        depths.hole < static_cast<int>(std::min<double>(side, MOST_HOLE)) && is_in_range;
  if (all_pass) return Seen::ALL;
  const auto inside = [&](int axis, double middle, std::int32_t lo, std::int32_t hi) {
    const double to = at[2] > 0 ? middle + at[axis] / at[2] : 0.5 * (lo + hi);
    return static_cast<std::int32_t>(std::lrint(std::clamp<double>(to, lo, hi)));
  };
  if (cube.size() == 1) {
    center_u_ = inside(0, geometry_.cx, area_.u0, area_.u1);
    center_v_ = inside(1, geometry_.cy, area_.v0, area_.v1);
  }
  return Seen::SOME;
}

bool DepthPicture::crosses(const OctreeCube& cube) const {
  if (passes(center_u_, center_v_, cube)) return true;
  // In floats, of a voxel that is a little larger: which pixels may have rays that reach it. At which depth they enter
  // and leave it follows from the ways that pixels look, without their points.
  const bool has_ways = geometry_.ways[0] != nullptr;
  const double off_px = has_ways ? 0 : geometry_.off_px + ROUNDING_PX;
  const double margin = 1e-3 + 2 * off_px * farthest_m_ / square_px_;
  float lo[3], hi[3], right[3];
  for (int axis = 0; axis < 3; ++axis) {
    const std::uint32_t key = axis == 0 ? cube.x : axis == 1 ? cube.y : cube.z;
    lo[axis] = static_cast<float>(key - geometry_.sensor[axis] - margin);
    hi[axis] = static_cast<float>(key - geometry_.sensor[axis] + 1 + margin);
    right[axis] = static_cast<float>(pixel_ways_(axis, 0));
  }
  const float nearest = static_cast<float>(nearest_m_);
  int tried = 0;
  for (std::int32_t v = area_.v0; v <= area_.v1; ++v) {
    const std::size_t row = static_cast<std::size_t>(v) * levels_[0].width + area_.u0;
    const float* const depths = &levels_[0].nearest[row];
    std::array<const float*, 3> ways{};
    for (int axis = 0; has_ways && axis < 3; ++axis) ways[axis] = geometry_.ways[axis] + row;
    const Eigen::Vector3f first = (pixel_ways_ * Eigen::Vector3d(area_.u0, v, 1)).cast<float>();
    const float first_x = first[0], first_y = first[1], first_z = first[2];
    const auto reaches = [&](std::int32_t i) {
      const float u = static_cast<float>(i);
      const float x = 1 / (has_ways ? ways[0][i] : first_x + u * right[0]);
      const float y = 1 / (has_ways ? ways[1][i] : first_y + u * right[1]);
      const float z = 1 / (has_ways ? ways[2][i] : first_z + u * right[2]);
      const float x0 = lo[0] * x, x1 = hi[0] * x, y0 = lo[1] * y, y1 = hi[1] * y, z0 = lo[2] * z, z1 = hi[2] * z;
      const float enters = std::max(std::max(std::min(x0, x1), std::min(y0, y1)), std::min(z0, z1));
      const float leaves = std::min(std::min(std::max(x0, x1), std::max(y0, y1)), std::max(z0, z1));
      return enters <= leaves && depths[i] >= enters;
    };
    for (std::int32_t i = 0; i <= area_.u1 - area_.u0; ++i) {
      if (!(depths[i] > nearest) || !reaches(i)) continue;
      if (passes(area_.u0 + i, v, cube)) return true;
      if (++tried == MOST_TRIED) return false;
    }
  }
  return false;
}

/// Whether the ray of the pixel goes through the voxel, in which it does not end.
bool DepthPicture::passes(std::int32_t u, std::int32_t v, const OctreeCube& cube) const {
  const Level& all = levels_[0];
  const std::size_t pixel = static_cast<std::size_t>(v) * all.width + u;
  const float depth = all.nearest[pixel];
  if (!(static_cast<double>(depth) > nearest_m_)) return false;
  Eigen::Vector3d end;
  if (geometry_.ways[0]) {  // what floats cannot tell is far below the margins
    for (int axis = 0; axis < 3; ++axis) end[axis] = double(geometry_.ways[axis][pixel]) * double(depth);
  } else if (geometry_.xyz && depth < NOWHERE) {
    const float* p = geometry_.xyz + 3 * pixel;
    end = geometry_.map_from_xyz * Eigen::Vector3d(p[0], p[1], p[2]);
  } else {
    end =
        pixel_ways_ * Eigen::Vector3d(u, v, 1) * std::min<double>(depth, 2 * geometry_.range * geometry_.resolution_m);
  }
  const double lo[3] = {cube.x - geometry_.sensor.x(), cube.y - geometry_.sensor.y(), cube.z - geometry_.sensor.z()};
  double from = 0, to = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double margin = DEPTH_ROUNDING * (1 + std::abs(lo[axis]));
    const double inverse = 1 / end[axis];  // infinite: then both are beyond, or on both sides
    double enters = (lo[axis] + margin) * inverse, leaves = (lo[axis] + 1 - margin) * inverse;
    if (enters > leaves) std::swap(enters, leaves);
    from = std::max(from, enters);
    to = std::min(to, leaves);
  }
  return from < to && from * from * end.squaredNorm() <= geometry_.range * geometry_.range;
}

}  // namespace dccd
