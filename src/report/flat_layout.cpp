#include "report/flat_layout.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

namespace dccd {

namespace {

using Flat = Eigen::Matrix2Xd;

/// Columns: the finite points in the plane of their two largest directions; others at the origin.
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
  Flat flat = Flat::Zero(2, static_cast<Eigen::Index>(positions.size()));
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (!positions[i].allFinite()) continue;
    const Vec3 q = positions[i] - mean;
    flat.col(static_cast<Eigen::Index>(i)) << axes.eigenvectors().col(2).dot(q), axes.eigenvectors().col(1).dot(q);
  }
  return flat;
}

Eigen::Matrix2d turn(int degrees) { return Eigen::Rotation2Dd(degrees * M_PI / 180).toRotationMatrix(); }

}  // namespace

std::vector<std::array<double, 2>> flatLayout(const Positions& positions) {
  std::vector<std::array<double, 2>> out(positions.size());
  if (positions.empty()) return out;
  const Flat flat = project(positions);
  // Of a square the directions of largest spread are arbitrary, and the picture would stand askew.
  int best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (int degrees = 0; degrees < 90; ++degrees) {
    const Flat turned = turn(degrees) * flat;
    const Eigen::Vector2d extent = turned.rowwise().maxCoeff() - turned.rowwise().minCoeff();
    if (extent.prod() < least * (1 - 1e-9)) least = extent.prod(), best = degrees;
  }
  Flat turned = turn(best) * flat;
  const Eigen::Vector2d extent = turned.rowwise().maxCoeff() - turned.rowwise().minCoeff();
  if (extent.y() > extent.x()) turned = turn(90) * turned;
  const auto rounded = [](double x) { return std::round(x * 1e6) / 1e6; };
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    out[i] = {rounded(turned(0, column)), rounded(turned(1, column))};
  }
  return out;
}

}  // namespace dccd
