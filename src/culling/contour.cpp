#include "culling/contour.h"

#include <algorithm>
#include <cmath>

namespace dccd {
namespace {

constexpr std::size_t SWEEP_FACTOR = 64;  // pairs of edges, per edge, after which the test gives up
constexpr std::uint32_t NONE = 0xffffffff;

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

Contour::Contour(Index first_vertex, std::size_t vertex_count)
    : first_vertex_(first_vertex), corner_of_(vertex_count, NONE) {}

/// Along some direction, one is above the other at both times.
bool Contour::areApart(const Ends& a, const Ends& b, double margin) const {
  const auto isAbove = [margin](const Corner*(&above)[2], const Corner*(&below)[2], std::size_t d) {
    return std::min(above[0]->projections[d], above[1]->projections[d]) >
           std::max(below[0]->projections[d], below[1]->projections[d]) + margin;
  };
  const Corner *one[2] = {&corners_[a.from], &corners_[a.to]}, *other[2] = {&corners_[b.from], &corners_[b.to]};
  for (std::size_t d = 0; d < DIRECTIONS; ++d) {
    const std::size_t e = d + DIRECTIONS;
    if (isAbove(one, other, d) && isAbove(one, other, e)) return true;
    if (isAbove(other, one, d) && isAbove(other, one, e)) return true;
  }
  return false;
}

bool Contour::isSimple(const std::vector<Side>& sides, const ViewPlane& plane, const VertexMotion* vertices) {
  PlanarSpan span;
  for (const Corner& corner : corners_) corner_of_[corner.vertex - first_vertex_] = NONE;
  corners_.clear();
  ends_.clear();
  for (const Side& side : sides) {
    const std::uint32_t from = cornerAt(side.from, plane, vertices, span),
                        to = cornerAt(side.to, plane, vertices, span);
    const auto number = static_cast<std::uint32_t>(ends_.size());
    ends_.push_back({from, to, corners_[from].first_out, corners_[to].first_in});
    corners_[from].first_out = corners_[to].first_in = number;
  }
  bad_.assign(sides.size(), 1);
  if (sides.empty() || !span.isGuarded())
    return false;  // no surface without a border is seen from its front everywhere
  error_ = span.error();
  product_error_ = span.productError();
  std::fill(bad_.begin(), bad_.end(), 0);
  testVertices();
  if (!testSweep()) {
    std::fill(bad_.begin(), bad_.end(), 1);
    return false;
  }
  if (std::find(bad_.begin(), bad_.end(), 1) == bad_.end()) {
    findCycles();
    testOrientation();
  }
  return std::find(bad_.begin(), bad_.end(), 1) == bad_.end();
}

std::uint32_t Contour::cornerAt(Index vertex, const ViewPlane& plane, const VertexMotion* vertices, PlanarSpan& span) {
  std::uint32_t& corner = corner_of_[vertex - first_vertex_];
  if (corner != NONE) return corner;
  corners_.push_back({span.add(plane, vertices[vertex]), vertex, NONE, NONE, NONE, NONE, {}});
  return corner = static_cast<std::uint32_t>(corners_.size() - 1);
}

/// Follows the sides, and takes a cycle out of the way as soon as it comes to a vertex again.
void Contour::findCycles() {
  cycles_.clear();
  cycle_begin_.assign(1, 0);
  path_.clear();
  for (Corner& corner : corners_) corner.next_out = corner.first_out;
  for (std::uint32_t start = 0; start < corners_.size(); ++start) {
    for (std::uint32_t at = start;;) {
      Corner& corner = corners_[at];
      if (corner.on_path != NONE) {
        for (std::size_t i = corner.on_path; i < path_.size(); ++i) {
          cycles_.push_back(path_[i]);
          if (i > corner.on_path) corners_[ends_[path_[i]].from].on_path = NONE;
        }
        path_.resize(corner.on_path);
        corner.on_path = NONE;
        cycle_begin_.push_back(static_cast<std::uint32_t>(cycles_.size()));
      }
      const std::uint32_t side = corner.next_out;
      if (side == NONE) break;  // with an empty path: it came back to where it began
      corner.next_out = ends_[side].next_out;
      corner.on_path = static_cast<std::uint32_t>(path_.size());
      path_.push_back(side);
      at = ends_[side].to;
    }
  }
}

/// Two edges with a common vertex meet in it alone, unless one folds back onto the other.
bool Contour::turnsAt(const PlanarSpan::Point& before, const PlanarSpan::Point& at,
                      const PlanarSpan::Point& after) const {
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

void Contour::testVertices() {
  std::vector<std::pair<std::uint32_t, const PlanarSpan::Point*>>
      others;  // sides, and where they are at their far ends
  for (const Corner& corner : corners_) {
    others.clear();
    for (std::uint32_t s = corner.first_out; s != NONE; s = ends_[s].next_out) {
      others.emplace_back(s, &corners_[ends_[s].to].point);
    }
    for (std::uint32_t s = corner.first_in; s != NONE; s = ends_[s].next_in) {
      others.emplace_back(s, &corners_[ends_[s].from].point);
    }
    for (std::size_t i = 0; i < others.size(); ++i) {
      for (std::size_t j = i + 1; j < others.size(); ++j) {
        if (turnsAt(*others[i].second, corner.point, *others[j].second)) continue;
        bad_[others[i].first] = bad_[others[j].first] = 1;
      }
    }
  }
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

/// False: it gave up.
bool Contour::testSweep() {
  for (Corner& corner : corners_) {
    const PlanarSpan::Point& p = corner.point;
    for (std::size_t d = 0; d < DIRECTIONS; ++d) {
      corner.projections[d] = PLANE.c[d] * p.x0 + PLANE.s[d] * p.y0;
      corner.projections[d + DIRECTIONS] = PLANE.c[d] * p.x1 + PLANE.s[d] * p.y1;
    }
  }
  const std::size_t along = widestDirection(), across = (along + DIRECTIONS / 2) % DIRECTIONS;
  swept_.clear();
  for (std::uint32_t s = 0; s < ends_.size(); ++s) {
    const auto &a = corners_[ends_[s].from].projections, &b = corners_[ends_[s].to].projections;
    const auto low = [&](std::size_t d) {
      return std::min(std::min(a[d], a[d + DIRECTIONS]), std::min(b[d], b[d + DIRECTIONS]));
    };
    const auto high = [&](std::size_t d) {
      return std::max(std::max(a[d], a[d + DIRECTIONS]), std::max(b[d], b[d + DIRECTIONS]));
    };
    swept_.push_back({low(along), high(along), low(across), high(across), s});
  }
  std::sort(swept_.begin(), swept_.end(),
            [](const Swept& a, const Swept& b) { return a.low != b.low ? a.low < b.low : a.side < b.side; });
  // A projection is off by sqrt(2) error for its point's coordinates and below 2 error for its own roundings; two meet.
  const double margin = 8 * error_;
  std::size_t budget = SWEEP_FACTOR * swept_.size();
  for (std::size_t i = 0; i < swept_.size(); ++i) {
    for (std::size_t j = i + 1; j < swept_.size() && swept_[j].low <= swept_[i].high + margin; ++j) {
      if (budget-- == 0) return false;
      // Most are, and side by side in memory.
      const bool beside = swept_[i].across_low > swept_[j].across_high + margin ||
                          swept_[j].across_low > swept_[i].across_high + margin;
      if (beside) continue;
      const Ends &a = ends_[swept_[i].side], &b = ends_[swept_[j].side];
      const bool share = (a.from == b.from) | (a.from == b.to) | (a.to == b.from) | (a.to == b.to);
      if (!share && !areApart(a, b, margin)) bad_[swept_[i].side] = bad_[swept_[j].side] = 1;
    }
  }
  return true;
}

/// Of the cycles that may be counter-clockwise the longest one is left.
void Contour::testOrientation() {
  std::size_t longest = 0, kept = 0;
  std::vector<std::size_t> positive;
  for (std::size_t c = 0; c + 1 < cycle_begin_.size(); ++c) {
    const std::size_t first = cycle_begin_[c], last = cycle_begin_[c + 1];
    const PlanarSpan::Point& origin = corners_[ends_[cycles_[first]].from].point;
    double area = 0;
    for (std::size_t i = first; i < last; ++i) {
      const PlanarSpan::Point &a = corners_[ends_[cycles_[i]].from].point, &b = corners_[ends_[cycles_[i]].to].point;
      area += (a.x0 - origin.x0) * (b.y0 - origin.y0) - (a.y0 - origin.y0) * (b.x0 - origin.x0);
    }
    const double count = static_cast<double>(last - first);
    // Each product is off by product_error, and the sum rounds: n sums, each of at most n products of extent^2.
    if (area < -count * (1 + count) * product_error_) continue;
    positive.push_back(c);
    if (last - first > longest) longest = last - first, kept = c;
  }
  for (const std::size_t c : positive) {
    for (std::size_t i = cycle_begin_[c]; c != kept && i < cycle_begin_[c + 1]; ++i) bad_[cycles_[i]] = 1;
  }
}

}  // namespace dccd
