#include "culling/unfolded.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "dccd/tolerances.h"

namespace dccd {
namespace {

constexpr std::size_t SAMPLES = 1024;     // faces that give the direction, and are looked at first
constexpr std::size_t SWEEP_FACTOR = 64;  // pairs of boundary edges, per edge, after which the test gives up
constexpr int SWEEP_DIRECTION = 3;        // along no side of a grid whose sides lie in the plane's axes

struct DirectedEdge {
  Index low, high;
  bool forward;
  bool operator<(const DirectedEdge& other) const { return low != other.low ? low < other.low : high < other.high; }
  bool sameAs(const DirectedEdge& other) const { return low == other.low && high == other.high; }
};

/// Successor of each boundary vertex; empty when the faces are no manifold with one orientation. Counts the edges.
std::unordered_map<Index, Index> boundaryOf(const ClusterTree& faces, std::size_t& edge_count) {
  std::vector<DirectedEdge> sides;
  sides.reserve(3 * faces.featureCount());
  for (std::size_t f = 0; f < faces.featureCount(); ++f) {
    const Index* v = faces.feature(f);
    for (int k = 0; k < 3; ++k) {
      const Index a = v[k], b = v[(k + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), a < b});
    }
  }
  std::sort(sides.begin(), sides.end());
  std::unordered_map<Index, Index> next;
  edge_count = 0;
  for (std::size_t i = 0, end = 0; i < sides.size(); i = end) {
    for (end = i + 1; end < sides.size() && sides[end].sameAs(sides[i]); ++end) {
    }
    ++edge_count;
    if (end - i > 2 || (end - i == 2 && sides[i].forward == sides[i + 1].forward)) return {};
    if (end - i == 2) continue;
    const DirectedEdge& s = sides[i];
    if (!next.emplace(s.forward ? s.low : s.high, s.forward ? s.high : s.low).second) return {};
  }
  return next;
}

Vec3 normalAt(const double (&a)[4], const double (&b)[4], const double (&c)[4]) {
  const Eigen::Map<const Vec3> p(a), q(b), r(c);
  return (q - p).cross(r - p);
}

}  // namespace

bool UnfoldedProof::Span::isApartFrom(const Span& other, double margin) const {
  for (int d = 0; d < DIRECTIONS; ++d) {
    if (low[0][d] > other.high[0][d] + margin && low[1][d] > other.high[1][d] + margin) return true;
    if (other.low[0][d] > high[0][d] + margin && other.low[1][d] > high[1][d] + margin) return true;
  }
  return false;
}

UnfoldedProof::UnfoldedProof(const SceneBody& body) {
  const ClusterTree& faces = body.tree(FeatureKind::FACE);
  if (faces.featureCount() == 0) return;
  std::size_t edge_count = 0;
  const std::unordered_map<Index, Index> next = boundaryOf(faces, edge_count);
  // A disk has the Euler characteristic 1 and one boundary. (Closed parts beside it could make up for other holes;
  // they have faces of either orientation in any direction.) Edges and vertices beside the faces are not certified.
  if (next.empty() || edge_count != body.tree(FeatureKind::EDGE).featureCount()) return;
  if (body.usedCount() + faces.featureCount() != edge_count + 1) return;
  std::vector<Index> loop;
  const Index first = std::min_element(next.begin(), next.end())->first;
  Index at = first;
  do {
    loop.push_back(at - body.internal_begin);
    const auto successor = next.find(at);
    if (successor == next.end()) return;
    at = successor->second;
  } while (at != first && loop.size() <= next.size());
  if (loop.size() == next.size()) loop_ = std::move(loop);
}

bool UnfoldedProof::run(const SceneBody& body, const VertexMotion* vertices) {
  if (!isDisk()) return false;
  const ClusterTree& faces = body.tree(FeatureKind::FACE);
  const std::size_t stride = std::max<std::size_t>(1, faces.featureCount() / SAMPLES);
  Vec3 sum = Vec3::Zero();
  const auto sampled = [&](std::size_t f, bool at_t1) {
    const Index* v = faces.feature(f);
    const VertexMotion &a = vertices[v[0]], &b = vertices[v[1]], &c = vertices[v[2]];
    return at_t1 ? normalAt(a.t1, b.t1, c.t1) : normalAt(a.t0, b.t0, c.t0);
  };
  for (std::size_t f = 0; f < faces.featureCount(); f += stride) sum += sampled(f, false) + sampled(f, true);
  const double length = sum.norm();
  if (!(length > tolerance::UNFOLDED_SMALLEST_NORMAL && length < tolerance::UNFOLDED_LARGEST_NORMAL)) return false;
  for (std::size_t f = 0; f < faces.featureCount(); f += stride) {
    if (!(sampled(f, false).dot(sum) > 0 && sampled(f, true).dot(sum) > 0)) return false;
  }

  const ViewPlane plane(sum);
  points_.resize(body.usedCount());
  double size = 0;  // largest |x| + |y| + |z|
  const double inf = std::numeric_limits<double>::infinity();
  double low[2] = {inf, inf}, high[2] = {-inf, -inf};
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const VertexMotion& v = vertices[body.internal_begin + i];
    const Eigen::Map<const Vec3> p(v.t0), q(v.t1);
    const auto [x0, y0] = plane.coordinates(v.t0);
    const auto [x1, y1] = plane.coordinates(v.t1);
    points_[i] = {x0, y0, x1, y1};
    size = std::max(size, std::max(p.lpNorm<1>(), q.lpNorm<1>()));
    low[0] = std::min(low[0], std::min(points_[i].x0, points_[i].x1));
    low[1] = std::min(low[1], std::min(points_[i].y0, points_[i].y1));
    high[0] = std::max(high[0], std::max(points_[i].x0, points_[i].x1));
    high[1] = std::max(high[1], std::max(points_[i].y0, points_[i].y1));
  }
  if (!(size > tolerance::UNFOLDED_SMALLEST_M && size < tolerance::UNFOLDED_LARGEST_M)) return false;
  error_ = ViewPlane::error(size);
  // Differences are at most L = extent, and off by 2 error + 2^-53 L <= 2.5 error; so a product of two by 5 L error and
  // 7 error^2, twice for two products, and their three roundings add less than 3 L error: below 20 error (L + error).
  const double extent = std::max(high[0] - low[0], high[1] - low[1]);
  product_error_ = tolerance::UNFOLDED_PRODUCT * error_ * (extent + error_);
  return facesKeepOrientation(body) && contourIsSimple();
}

bool UnfoldedProof::facesKeepOrientation(const SceneBody& body) const {
  const ClusterTree& faces = body.tree(FeatureKind::FACE);
  for (std::size_t f = 0; f < faces.featureCount(); ++f) {
    const Index* v = faces.feature(f);
    const Planar &a = points_[v[0] - body.internal_begin], &b = points_[v[1] - body.internal_begin],
                 &c = points_[v[2] - body.internal_begin];
    const double px0 = b.x0 - a.x0, py0 = b.y0 - a.y0, qx0 = c.x0 - a.x0, qy0 = c.y0 - a.y0;
    const double px1 = b.x1 - a.x1, py1 = b.y1 - a.y1, qx1 = c.x1 - a.x1, qy1 = c.y1 - a.y1;
    // Bernstein coefficients of the area over the step, the middle one doubled.
    const double first = px0 * qy0 - py0 * qx0, last = px1 * qy1 - py1 * qx1;
    const double middle = (px0 * qy1 - py0 * qx1) + (px1 * qy0 - py1 * qx0);
    if (!(first > product_error_ && last > product_error_ && middle > 3 * product_error_)) return false;
  }
  return true;
}

/// Two successive edges of the boundary meet in their vertex alone, unless one folds back onto the other.
bool UnfoldedProof::turnsAt(const Planar& before, const Planar& at, const Planar& after) const {
  const double px0 = before.x0 - at.x0, py0 = before.y0 - at.y0, qx0 = after.x0 - at.x0, qy0 = after.y0 - at.y0;
  const double px1 = before.x1 - at.x1, py1 = before.y1 - at.y1, qx1 = after.x1 - at.x1, qy1 = after.y1 - at.y1;
  const double cross[3] = {px0 * qy0 - py0 * qx0, px1 * qy1 - py1 * qx1,
                           (px0 * qy1 - py0 * qx1) + (px1 * qy0 - py1 * qx0)};
  const double dot[3] = {px0 * qx0 + py0 * qy0, px1 * qx1 + py1 * qy1,
                         (px0 * qx1 + py0 * qy1) + (px1 * qx0 + py1 * qy0)};
  const double margin = 3 * product_error_;
  const auto all = [margin](const double(&c)[3], double sign) {
    return sign * c[0] > margin && sign * c[1] > margin && sign * c[2] > margin;
  };
  return all(dot, -1) || all(cross, 1) || all(cross, -1);
}

bool UnfoldedProof::contourIsSimple() {
  const std::size_t n = loop_.size();
  const auto point = [this](std::size_t i) -> const Planar& { return points_[loop_[i]]; };
  for (std::size_t i = 0; i < n; ++i) {
    if (!turnsAt(point((i + n - 1) % n), point(i), point((i + 1) % n))) return false;
  }
  spans_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Planar &a = point(i), &b = point((i + 1) % n);
    Span& span = spans_[i];
    for (int d = 0; d < DIRECTIONS; ++d) {
      const double c = std::cos(d * M_PI / DIRECTIONS), s = std::sin(d * M_PI / DIRECTIONS);
      const double a0 = c * a.x0 + s * a.y0, b0 = c * b.x0 + s * b.y0;
      const double a1 = c * a.x1 + s * a.y1, b1 = c * b.x1 + s * b.y1;
      span.low[0][d] = std::min(a0, b0);
      span.high[0][d] = std::max(a0, b0);
      span.low[1][d] = std::min(a1, b1);
      span.high[1][d] = std::max(a1, b1);
    }
    span.sweep_low = std::min(span.low[0][SWEEP_DIRECTION], span.low[1][SWEEP_DIRECTION]);
    span.sweep_high = std::max(span.high[0][SWEEP_DIRECTION], span.high[1][SWEEP_DIRECTION]);
    span.edge = i;
  }
  std::sort(spans_.begin(), spans_.end(), [](const Span& a, const Span& b) { return a.sweep_low < b.sweep_low; });
  // A projection is off by sqrt(2) error for its point's coordinates and below 2 error for its own roundings; two meet.
  const double margin = 8 * error_;
  std::size_t budget = SWEEP_FACTOR * n;
  for (std::size_t i = 0; i < n; ++i) {
    const Span& span = spans_[i];
    for (std::size_t j = i + 1; j < n && spans_[j].sweep_low <= span.sweep_high + margin; ++j) {
      if (budget-- == 0) return false;
      const std::size_t gap = (spans_[j].edge + n - span.edge) % n;
      if (gap != 1 && gap != n - 1 && !span.isApartFrom(spans_[j], margin)) return false;
    }
  }
  return true;
}

}  // namespace dccd
