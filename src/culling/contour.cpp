#include "culling/contour.h"

#include <algorithm>
#include <cmath>

namespace dccd {
namespace {

constexpr std::size_t SWEEP_FACTOR = 64;  // pairs of edges, per edge, after which the test gives up

struct PlaneDirections {
  std::array<double, 8> c, s;
  PlaneDirections() {
    for (std::size_t d = 0; d < 8; ++d) {
      c[d] = std::cos(static_cast<double>(d) * M_PI / 8);
      s[d] = std::sin(static_cast<double>(d) * M_PI / 8);
    }
  }
};
const PlaneDirections PLANE;

/// Two edges with a common vertex meet in it alone, unless one folds back onto the other. margin: of a Bernstein
/// coefficient.
bool turns(const PlanarSpan::Point& before, const PlanarSpan::Point& at, const PlanarSpan::Point& after,
           double margin) {
  const double px0 = before.x0 - at.x0, py0 = before.y0 - at.y0, qx0 = after.x0 - at.x0, qy0 = after.y0 - at.y0;
  const double px1 = before.x1 - at.x1, py1 = before.y1 - at.y1, qx1 = after.x1 - at.x1, qy1 = after.y1 - at.y1;
  const double cross[3] = {px0 * qy0 - py0 * qx0, px1 * qy1 - py1 * qx1,
                           (px0 * qy1 - py0 * qx1) + (px1 * qy0 - py1 * qx0)};
  const double dot[3] = {px0 * qx0 + py0 * qy0, px1 * qx1 + py1 * qy1,
                         (px0 * qx1 + py0 * qy1) + (px1 * qx0 + py1 * qy0)};
  const auto all = [margin](const double(&c)[3], double sign) {
    return sign * c[0] > margin && sign * c[1] > margin && sign * c[2] > margin;
  };
  return all(dot, -1) || all(cross, 1) || all(cross, -1);
}

}  // namespace

ViewPlane::ViewPlane(const Vec3& line)
    : u(line.cross(line.x() == 0   ? Vec3::UnitX()
                   : line.y() == 0 ? Vec3::UnitY()
                                   : Vec3::UnitZ())),
      w(line.cross(u)) {  // u x w = |u|^2 line
  if (w.cwiseAbs().maxCoeff() > 1) w /= 2;
}

PlanarSpan::Point PlanarSpan::add(const ViewPlane& plane, const VertexMotion& vertex) {
  const auto [x0, y0] = plane.coordinates(vertex.t0);
  const auto [x1, y1] = plane.coordinates(vertex.t1);
  const Eigen::Map<const Vec3> p(vertex.t0), q(vertex.t1);
  size_ = std::max(size_, std::max(p.lpNorm<1>(), q.lpNorm<1>()));
  low_ = {std::min(low_[0], std::min(x0, x1)), std::min(low_[1], std::min(y0, y1))};
  high_ = {std::max(high_[0], std::max(x0, x1)), std::max(high_[1], std::max(y0, y1))};
  return {x0, y0, x1, y1};
}

double PlanarSpan::productError() const {
  const double extent = std::max(high_[0] - low_[0], high_[1] - low_[1]);
  return tolerance::UNFOLDED_PRODUCT * error() * (extent + error());
}

bool Contour::isSimple(const ViewPlane& plane, const VertexMotion* vertices) {
  PlanarSpan span;
  corners_.clear();
  for (const Index v : vertices_) {
    Corner& corner = corners_.emplace_back();
    const PlanarSpan::Point p = corner.point = span.add(plane, vertices[v]);
    for (std::size_t d = 0; d < DIRECTIONS; ++d) {
      corner.projections[d] = PLANE.c[d] * p.x0 + PLANE.s[d] * p.y0;
      corner.projections[d + DIRECTIONS] = PLANE.c[d] * p.x1 + PLANE.s[d] * p.y1;
    }
  }
  // A projection is off by sqrt(2) error for its point's coordinates and below 2 error for its own roundings; two meet.
  return span.isGuarded() && turnsEverywhere(3 * span.productError()) && staysApart(8 * span.error());
}

bool Contour::turnsEverywhere(double margin) const {
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    const std::size_t at = next(i);
    if (!turns(corners_[i].point, corners_[at].point, corners_[next(at)].point, margin)) return false;
  }
  return true;
}

/// Of the odd ones, which lie along no side of a grid whose sides lie in the plane's axes.
std::size_t Contour::widestDirection() const {
  std::size_t widest = 1;
  double most = -1;
  for (std::size_t d = 1; d < DIRECTIONS; d += 2) {
    const auto less = [d](const Corner& a, const Corner& b) { return a.projections[d] < b.projections[d]; };
    const auto [low, high] = std::minmax_element(corners_.begin(), corners_.end(), less);
    if (high->projections[d] - low->projections[d] <= most) continue;
    most = high->projections[d] - low->projections[d];
    widest = d;
  }
  return widest;
}

/// Along some direction, one is above the other at both times.
bool Contour::areApart(std::size_t a, std::size_t b, double margin) const {
  const auto isAbove = [margin](const Corner*(&above)[2], const Corner*(&below)[2], std::size_t d) {
    return std::min(above[0]->projections[d], above[1]->projections[d]) >
           std::max(below[0]->projections[d], below[1]->projections[d]) + margin;
  };
  const Corner *one[2] = {&corners_[a], &corners_[next(a)]}, *other[2] = {&corners_[b], &corners_[next(b)]};
  for (std::size_t d = 0; d < DIRECTIONS; ++d) {
    const std::size_t e = d + DIRECTIONS;
    if (isAbove(one, other, d) && isAbove(one, other, e)) return true;
    if (isAbove(other, one, d) && isAbove(other, one, e)) return true;
  }
  return false;
}

/// Edges without a common vertex; false also where there are too many to look at.
bool Contour::staysApart(double margin) {
  const std::size_t along = widestDirection(), across = (along + DIRECTIONS / 2) % DIRECTIONS;
  swept_.clear();
  for (std::size_t e = 0; e < corners_.size(); ++e) {
    const auto &a = corners_[e].projections, &b = corners_[next(e)].projections;
    const auto low = [&](std::size_t d) {
      return std::min(std::min(a[d], a[d + DIRECTIONS]), std::min(b[d], b[d + DIRECTIONS]));
    };
    const auto high = [&](std::size_t d) {
      return std::max(std::max(a[d], a[d + DIRECTIONS]), std::max(b[d], b[d + DIRECTIONS]));
    };
    swept_.push_back({low(along), high(along), low(across), high(across), e});
  }
  std::sort(swept_.begin(), swept_.end(),
            [](const Swept& a, const Swept& b) { return a.low != b.low ? a.low < b.low : a.edge < b.edge; });
  std::size_t budget = SWEEP_FACTOR * swept_.size();
  for (std::size_t i = 0; i < swept_.size(); ++i) {
    for (std::size_t j = i + 1; j < swept_.size() && swept_[j].low <= swept_[i].high + margin; ++j) {
      if (budget-- == 0) return false;
      // Most are, and side by side in memory.
      const bool beside = swept_[i].across_low > swept_[j].across_high + margin ||
                          swept_[j].across_low > swept_[i].across_high + margin;
      if (beside) continue;
      const std::size_t a = swept_[i].edge, b = swept_[j].edge;
      if (next(a) != b && next(b) != a && !areApart(a, b, margin)) return false;
    }
  }
  return true;
}

}  // namespace dccd
