#include "scenes/physics/depth_camera.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "scenes/physics/shapes.h"

namespace dccd::scene {
namespace {

constexpr double NOTHING = std::numeric_limits<double>::infinity();
// Faces reach this share of themselves beyond their edges, so that no ray slips between two by rounding.
constexpr double FACE_OVERLAP = 1e-9;
// A ray that marches towards a round surface has met it at this distance.
constexpr double MET_M = 1e-7;
constexpr int MARCH_STEPS = 1000;

/// Where a ray from the origin meets a face, from either side.
double rangeOfFace(const Vec3& direction, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, across = direction.cross(ac);
  const double volume = ab.dot(across);
  if (volume == 0.0) return NOTHING;
  const Vec3 turned = ab.cross(a);
  const double u = -a.dot(across) / volume, v = direction.dot(turned) / volume, range = ac.dot(turned) / volume;
  const bool inside = u >= -FACE_OVERLAP && v >= -FACE_OVERLAP && u + v <= 1.0 + FACE_OVERLAP;
  return inside && range > 0.0 ? range : NOTHING;
}

/// Where a ray enters the box around the origin.
double rangeOfBox(const Vec3& from, const Vec3& direction, const Vec3& half_size) {
  double enter = 0.0, leave = NOTHING;
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0.0) {
      if (std::abs(from[axis]) > half_size[axis]) return NOTHING;
      continue;
    }
    const double one = (-half_size[axis] - from[axis]) / direction[axis];
    const double other = (half_size[axis] - from[axis]) / direction[axis];
    enter = std::max(enter, std::min(one, other));
    leave = std::min(leave, std::max(one, other));
  }
  return enter <= leave ? enter : NOTHING;
}

/// Goes as far as the distance allows, again and again. `end_m`: behind the surface.
template <class Distance>
double march(const Vec3& direction, double end_m, const Distance& distance) {
  double range = 0.0;
  for (int i = 0; i < MARCH_STEPS && range < end_m; ++i) {
    const double free_m = distance(range * direction);
    if (free_m < MET_M) return range;
    range += free_m;
  }
  return NOTHING;
}

double farthest(const Positions& points) {
  double range = 0.0;
  for (const Vec3& p : points) range = std::max(range, p.norm());
  return range;
}

Positions corners(const Vec3& min, const Vec3& max, const Eigen::Isometry3d& pose) {
  Positions result;
  for (int i = 0; i < 8; ++i) {
    result.push_back(pose * Vec3((i & 1 ? max : min)[0], (i & 2 ? max : min)[1], (i & 4 ? max : min)[2]));
  }
  return result;
}

}  // namespace

DepthCamera::DepthCamera(const SceneSpec& spec)
    : spec_(spec),
      camera_(*spec.camera),
      from_fixed_(spec.camera->pose.inverse()),
      focal_px_(0.5 * spec.camera->width / std::tan(0.5 * spec.camera->field_of_view_rad)),
      random_(static_cast<std::uint64_t>(spec.camera->seed)) {
  for (int y = 0; y < camera_.height; ++y) {
    for (int x = 0; x < camera_.width; ++x) {
      const Vec3 way(x + 0.5 - 0.5 * camera_.width, y + 0.5 - 0.5 * camera_.height, focal_px_);
      directions_.push_back(way.normalized());
    }
  }
  for (const Body& body : spec.bodies) faces_.push_back(shapeFaces(body.shape));
  background_.assign(directions_.size(), NOTHING);
  for (const Solid& solid : spec.obstacle->solids) drawSolid(background_, shrunk(solid, camera_.inset_m));
}

/// Asks for the range of each ray that may meet what lies in the hull of some points, given in the optical frame.
template <class Range>
void DepthCamera::draw(Ranges& ranges, const Positions& hull, const Range& range) const {
  Eigen::Array2d min = Eigen::Array2d::Constant(NOTHING), max = -min;
  for (const Vec3& p : hull) {
    if (p[2] <= 0.0) {  // beside or behind the camera: its image may be anywhere
      min.setConstant(-NOTHING);
      max.setConstant(NOTHING);
      break;
    }
    const Eigen::Array2d image = focal_px_ * p.head<2>().array() / p[2];
    min = min.min(image);
    max = max.max(image);
  }
  const auto first = [](double image, int size) {
    return static_cast<int>(std::clamp(std::floor(image + 0.5 * size - 0.5), 0.0, static_cast<double>(size)));
  };
  const auto last = [](double image, int size) {
    return static_cast<int>(std::clamp(std::ceil(image + 0.5 * size - 0.5), -1.0, size - 1.0));
  };
  for (int y = first(min[1], camera_.height); y <= last(max[1], camera_.height); ++y) {
    for (int x = first(min[0], camera_.width); x <= last(max[0], camera_.width); ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * camera_.width + x;
      ranges[pixel] = std::min(ranges[pixel], range(directions_[pixel]));
    }
  }
}

void DepthCamera::drawBox(Ranges& ranges, const Eigen::Isometry3d& pose, const Vec3& half_size_m) const {
  const Eigen::Isometry3d in_camera = from_fixed_ * pose, to_box = in_camera.inverse();
  const Vec3 from = to_box.translation();
  draw(ranges, corners(-half_size_m, half_size_m, in_camera),
       [&](const Vec3& direction) { return rangeOfBox(from, to_box.linear() * direction, half_size_m); });
}

void DepthCamera::drawSolid(Ranges& ranges, const Solid& solid) const {
  if (solid.kind == Solid::Kind::BOX) {
    const Eigen::Isometry3d pose(Eigen::Translation3d(0.5 * (solid.box.min + solid.box.max)));
    drawBox(ranges, pose, 0.5 * (solid.box.max - solid.box.min));
    return;
  }
  const Box around = bounds(solid);
  const Positions hull = corners(around.min, around.max, from_fixed_);
  const double end_m = farthest(hull);
  draw(ranges, hull, [&](const Vec3& direction) {
    return march(direction, end_m, [&](const Vec3& point) { return distanceToRing(solid, camera_.pose * point); });
  });
}

void DepthCamera::drawFaces(Ranges& ranges, const Positions& vertices, const std::vector<Face>& faces) const {
  for (const Face& face : faces) {
    const Positions hull{vertices[face[0]], vertices[face[1]], vertices[face[2]]};
    draw(ranges, hull, [&](const Vec3& direction) { return rangeOfFace(direction, hull[0], hull[1], hull[2]); });
  }
}

void DepthCamera::drawRope(Ranges& ranges, const Positions& points, double radius_m) const {
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const Vec3 a = points[i], ab = points[i + 1] - a;
    const Vec3 min = a.cwiseMin(points[i + 1]).array() - radius_m, max = a.cwiseMax(points[i + 1]).array() + radius_m;
    const Positions hull = corners(min, max, Eigen::Isometry3d::Identity());
    const double end_m = farthest(hull), square = std::max(ab.squaredNorm(), std::numeric_limits<double>::min());
    draw(ranges, hull, [&](const Vec3& direction) {
      return march(direction, end_m, [&](const Vec3& point) {
        const double along = std::clamp((point - a).dot(ab) / square, 0.0, 1.0);
        return (point - a - along * ab).norm() - radius_m;
      });
    });
  }
}

// The standard's distributions differ between libraries; bags must not.
double DepthCamera::uniform() { return static_cast<double>(random_() >> 11) * (1.0 / 9007199254740992.0); }

double DepthCamera::gaussian() {  // Box and Muller
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
  return radius * std::cos(2.0 * M_PI * uniform());
}

/// Pixels beside an edge of its row get a range between the two of the edge.
void DepthCamera::makeFly(Ranges& ranges) {
  constexpr double EDGE_M = 0.05;
  std::vector<std::size_t> edges;
  for (std::size_t pixel = 0; pixel < ranges.size(); ++pixel) {
    const bool has_left = pixel % static_cast<std::size_t>(camera_.width) != 0;
    if (has_left && ranges[pixel] < NOTHING && std::abs(ranges[pixel] - ranges[pixel - 1]) > EDGE_M &&
        ranges[pixel - 1] < NOTHING)
      edges.push_back(pixel);
  }
  if (edges.empty()) return;
  const Ranges clean = ranges;
  const double count = std::floor(camera_.flying_share * static_cast<double>(ranges.size()) + uniform());
  for (double n = 0; n < count; ++n) {
    const std::size_t pixel = edges[static_cast<std::size_t>(uniform() * static_cast<double>(edges.size()))];
    ranges[pixel] = clean[pixel] + uniform() * (clean[pixel - 1] - clean[pixel]);
  }
}

std::vector<Eigen::Vector3f> DepthCamera::look(const SceneState& state) {
  Ranges ranges = background_;
  for (std::size_t b = 0; b < state.bodies.size(); ++b) {
    Positions in_camera;
    for (const Vec3& p : state.bodies[b]) in_camera.push_back(from_fixed_ * p);
    if (faces_[b].empty()) {
      drawRope(ranges, in_camera, spec_.bodies[b].thickness_m);
    } else {
      drawFaces(ranges, in_camera, faces_[b]);
    }
  }
  for (std::size_t r = 0; r < state.rigid_bodies.size(); ++r) {
    drawBox(ranges, state.rigid_bodies[r], 0.5 * spec_.rigid_bodies[r].size_m);
  }
  for (std::size_t l = 0; l < state.links.size(); ++l) {
    for (const Surface& surface : spec_.robot->links[l].surfaces) {
      Positions in_camera;
      for (const Vec3& p : surface.vertices) in_camera.push_back(from_fixed_ * (state.links[l] * p));
      drawFaces(ranges, in_camera, surface.faces);
    }
  }
  if (camera_.flying_share > 0) makeFly(ranges);
  std::vector<Eigen::Vector3f> cloud;
  cloud.reserve(ranges.size());
  for (std::size_t pixel = 0; pixel < ranges.size(); ++pixel) {
    // Each pixel draws the same numbers whatever it sees.
    const double range = ranges[pixel] + camera_.noise_m * gaussian();
    const bool lost = uniform() < camera_.lost_share;
    const bool seen = !lost && range > 0.0 && range < NOTHING;
    cloud.push_back(seen ? Eigen::Vector3f((range * directions_[pixel]).cast<float>())
                         : Eigen::Vector3f(Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN())));
  }
  return cloud;
}

}  // namespace dccd::scene
