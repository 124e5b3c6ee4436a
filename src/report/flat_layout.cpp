#include "report/flat_layout.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

namespace dccd {

namespace {

using Flat = Eigen::Matrix3Xd;

/// Columns: the finite points along their directions, the largest first, right-handed; others at the origin.
Flat project(const Positions& positions) {
  Vec3 mean = Vec3::Zero();
  double count = 0;
  for (const Vec3& p : positions) {
    if (!p.allFinite()) continue;
    mean += p;
    ++count;
  }
  mean /= std::max(count, 1.0);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Vec3& p : positions) {
    if (p.allFinite()) covariance += (p - mean) * (p - mean).transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(covariance);  // ascending
  Eigen::Matrix3d to_flat = axes.eigenvectors().rowwise().reverse().transpose();
  to_flat.row(2) = to_flat.row(0).cross(to_flat.row(1));
  Flat flat = Flat::Zero(3, static_cast<Eigen::Index>(positions.size()));
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (!positions[i].allFinite()) continue;
    flat.col(static_cast<Eigen::Index>(i)) = to_flat * (positions[i] - mean);
  }
  return flat;
}

Eigen::Matrix3d turn(int degrees) { return Eigen::AngleAxisd(degrees * M_PI / 180, Vec3::UnitZ()).toRotationMatrix(); }

}  // namespace

std::vector<std::array<double, 3>> flatLayout(const Positions& positions) {
  std::vector<std::array<double, 3>> out(positions.size());
  if (positions.empty()) return out;
  const Flat flat = project(positions);
  // Of a square the directions of largest spread are arbitrary, and the picture would stand askew.
  int best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (int degrees = 0; degrees < 90; ++degrees) {
    const Flat turned = turn(degrees) * flat;
    const Vec3 extent = turned.rowwise().maxCoeff() - turned.rowwise().minCoeff();
    if (extent.x() * extent.y() < least * (1 - 1e-9)) least = extent.x() * extent.y(), best = degrees;
  }
  Flat turned = turn(best) * flat;
  const Vec3 extent = turned.rowwise().maxCoeff() - turned.rowwise().minCoeff();
  if (extent.y() > extent.x()) turned = turn(90) * turned;
  const auto rounded = [](double x) { return std::round(x * 1e6) / 1e6; };
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    out[i] = {rounded(turned(0, column)), rounded(turned(1, column)), rounded(turned(2, column))};
  }
  return out;
}

}  // namespace dccd
