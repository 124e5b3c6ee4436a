#include "octomap/camera_fit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "simd/point_places.h"

namespace dccd {
namespace {

constexpr double MOST_OFF_PX = 0.5;
constexpr std::size_t SAMPLES = 32, FEWEST = 24;  // along a side; in all

bool counts(const float* p, double nearest2) {
  const double x = p[0], y = p[1], z = p[2], square = x * x + y * y + z * z;
  return square > 0 && square >= nearest2 && square < std::numeric_limits<double>::infinity();
}

}  // namespace

std::optional<FittedCamera> fitCamera(const SensorView& view, double nearest_m) {
  if (view.width < 2 || view.height < 2) return std::nullopt;
  const double nearest2 = nearest_m * nearest_m;
  const auto pointAt = [&](std::size_t u, std::size_t v) { return view.xyz + 3 * (v * view.width + u); };
  // Pixels are linear in the points up to a point's scale: u w = a.p, v w = b.p, w = c.p. Pixels from -1 to 1.
  const Eigen::Vector2d middle(0.5 * double(view.width - 1), 0.5 * double(view.height - 1));
  Eigen::Matrix<double, 9, 9> squares = Eigen::Matrix<double, 9, 9>::Zero();
  Eigen::Vector3d ahead = Eigen::Vector3d::Zero();
  std::size_t count = 0;
  const std::size_t step_u = std::max<std::size_t>(1, view.width / SAMPLES);
  const std::size_t step_v = std::max<std::size_t>(1, view.height / SAMPLES);
  for (std::size_t v = step_v / 2; v < view.height; v += step_v) {
    for (std::size_t u = step_u / 2; u < view.width; u += step_u) {
      const float* p = pointAt(u, v);
      if (!counts(p, nearest2)) continue;
      const Eigen::Vector3d way = Eigen::Vector3d(p[0], p[1], p[2]).normalized();
      for (int axis = 0; axis < 2; ++axis) {
        Eigen::Matrix<double, 9, 1> row = Eigen::Matrix<double, 9, 1>::Zero();
        row.segment<3>(3 * axis) = way;
        row.segment<3>(6) = -way * ((double(axis == 0 ? u : v) - middle[axis]) / middle[axis]);
        squares.noalias() += row * row.transpose();
      }
      ahead += way;
      ++count;
    }
  }
  if (count < FEWEST) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> solver(squares);
  const Eigen::Matrix<double, 9, 1> least = solver.eigenvectors().col(0);
  const Eigen::Vector3d c =
      least.segment<3>(6) / (least.segment<3>(6).norm() * (least.segment<3>(6).dot(ahead) < 0 ? -1 : 1));
  const double scale = least.segment<3>(6).dot(c);
  FittedCamera camera;
  const auto axisOf = [&](int axis, double& focal, double& center) {
    const Eigen::Vector3d all = middle[axis] * (least.segment<3>(3 * axis) / scale + c);
    center = all.dot(c);
    const Eigen::Vector3d across = all - center * c;
    focal = across.norm();
    return Eigen::Vector3d(across / focal);
  };
  const Eigen::Vector3d a = axisOf(0, camera.lens.fx, camera.lens.cx), b = axisOf(1, camera.lens.fy, camera.lens.cy);
  const Eigen::Vector3d down = c.cross(a) * (c.cross(a).dot(b) < 0 ? -1 : 1);  // rows may run the other way
  camera.camera_from_sensor << a.transpose(), down.transpose(), c.transpose();
  if (!(camera.lens.fx > 0 && camera.lens.fy > 0) || !camera.camera_from_sensor.allFinite()) return std::nullopt;

  const Eigen::Vector3d to_u = camera.lens.fx * a + camera.lens.cx * c,
                        to_v = camera.lens.fy * down + camera.lens.cy * c;
  for (std::size_t v = 0; v < view.height; ++v) {
    const simd::PixelRow row{pointAt(0, v), view.width, double(v), nearest2};
    camera.off_px = std::max(camera.off_px, simd::mostOffPx(row, to_u.data(), to_v.data(), c.data()));
    if (!(camera.off_px <= MOST_OFF_PX)) return std::nullopt;
  }
  return camera;
}

}  // namespace dccd
