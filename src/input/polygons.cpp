#include "input/polygons.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "obstacle/axis_predicates.h"

namespace dccd {
namespace {

using Point = std::array<double, 2>;

int turn(const Point& a, const Point& b, const Point& c) { return orientation2d(a[0], a[1], b[0], b[1], c[0], c[1]); }

/// c lies on the closed segment ab; the three are on one line.
bool isBetween(const Point& a, const Point& b, const Point& c) {
  return std::min(a, b) <= c && c <= std::max(a, b);  // in the order of x, then y
}

bool segmentsMeet(const Point& a, const Point& b, const Point& c, const Point& d) {
  const int abc = turn(a, b, c), abd = turn(a, b, d), cda = turn(c, d, a), cdb = turn(c, d, b);
  if (abc * abd < 0 && cda * cdb < 0) return true;
  return (abc == 0 && isBetween(a, b, c)) || (abd == 0 && isBetween(a, b, d)) || (cda == 0 && isBetween(c, d, a)) ||
         (cdb == 0 && isBetween(c, d, b));
}

/// The corners in the plane of two coordinates, such that the area is seen largest. Leaving a coordinate out keeps the
/// bits of the others.
std::vector<Point> projected(const std::vector<Index>& corners, const Positions& positions) {
  double largest = 0;
  for (const Index v : corners) largest = std::max(largest, positions[v].cwiseAbs().maxCoeff());
  const int shift = largest > 0 ? -std::ilogb(largest) - 1 : 0;  // below 1 no product overflows
  const auto scaled = [&](Index v) {
    const Vec3& p = positions[v];
    return Vec3(std::ldexp(p.x(), shift), std::ldexp(p.y(), shift), std::ldexp(p.z(), shift));
  };
  Vec3 normal = Vec3::Zero();
  const Vec3 first = scaled(corners[0]);
  for (std::size_t i = 2; i < corners.size(); ++i) {
    normal += (scaled(corners[i - 1]) - first).cross(scaled(corners[i]) - first);
  }
  int axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  std::vector<Point> points;
  points.reserve(corners.size());
  for (const Index v : corners) points.push_back({positions[v][(axis + 1) % 3], positions[v][(axis + 2) % 3]});
  return points;
}

/// One polygon of four corners or more, each of another vertex, seen in its plane.
class Outline {
 public:
  explicit Outline(std::vector<Point> points) : points_(std::move(points)) {
    for (std::size_t i = 0; i < points_.size(); ++i) {
      if (points_[i] != points_[(i + 1) % points_.size()]) ring_.push_back(i);
    }
  }

  /// All turns to one side, and once around.
  bool isConvex() const {
    int side = 0;
    std::size_t reversals = 0;  // of the way along the axes: two in one turn
    for (std::size_t k = 0; k < ring_.size(); ++k) {
      const Point &a = at(k), &b = at(k + 1), &c = at(k + 2);
      const int here = turn(a, b, c);
      if (here == 0 && !isBetween(a, c, b)) return false;
      if (here != 0 && here == -side) return false;
      if (here != 0) side = here;
      reversals += (a < b) != (b < c);
    }
    return side != 0 && reversals == 2;
  }

  /// No two edges have a point in common but neighbours their corner.
  bool isSimple() const {
    const std::size_t n = ring_.size();
    if (n < 3) return false;
    for (std::size_t i = 0; i < n; ++i) {
      if (turn(at(i), at(i + 1), at(i + 2)) == 0 && !isBetween(at(i), at(i + 2), at(i + 1))) return false;
      for (std::size_t j = i + 2; j < n && j - i < n - 1; ++j) {
        if (segmentsMeet(at(i), at(i + 1), at(j), at(j + 1))) return false;
      }
    }
    return true;
  }

  /// Of a simple outline: calls cut(i, j, k) for each triangle, by places of its corners.
  template <class Cut>
  void cutEars(const Cut& cut) {
    // The lowest corner is one of the convex hull: there the outline turns to the side to which it turns in all.
    const auto lower = [&](std::size_t i, std::size_t j) { return points_[i] < points_[j]; };
    const auto lowest = static_cast<std::size_t>(std::min_element(ring_.begin(), ring_.end(), lower) - ring_.begin());
    side_ = turn(at(lowest + ring_.size() - 1), at(lowest), at(lowest + 1));
    // First of all corners at one place of the plane: a triangle that is seen as a line takes each but the last off.
    ring_.resize(points_.size());
    std::iota(ring_.begin(), ring_.end(), std::size_t{0});
    for (std::size_t k = 0; k < ring_.size();) {
      if (at(k) == at(k + 1)) {
        cutOff(k, cut);
      } else {
        ++k;
      }
    }
    std::vector<bool> ear;
    for (std::size_t k = 0; k < ring_.size(); ++k) ear.push_back(isEar(k));
    while (ring_.size() > 3) {
      const auto k = static_cast<std::size_t>(std::find(ear.begin(), ear.end(), true) - ear.begin());
      cutOff(k, cut);
      ear.erase(ear.begin() + static_cast<std::ptrdiff_t>(k));
      // What keeps another corner from being an ear turns to the other side and is no ear itself: only these two
      // change.
      const std::size_t n = ring_.size();
      for (const std::size_t beside : {(k + n - 1) % n, k % n}) ear[beside] = isEar(beside);
    }
    cut(ring_[0], ring_[1], ring_[2]);
  }

 private:
  const Point& at(std::size_t k) const { return points_[ring_[k % ring_.size()]]; }

  template <class Cut>
  void cutOff(std::size_t k, const Cut& cut) {
    const std::size_t n = ring_.size();
    cut(ring_[(k + n - 1) % n], ring_[k], ring_[(k + 1) % n]);
    ring_.erase(ring_.begin() + static_cast<std::ptrdiff_t>(k));
  }

  /// It turns to the outline's side, and no other corner lies in the closed triangle.
  bool isEar(std::size_t k) const {
    const std::size_t n = ring_.size();
    const Point &a = at(k + n - 1), &b = at(k), &c = at(k + 1);
    if (turn(a, b, c) != side_) return false;
    for (std::size_t other = k + 2; other < k + n - 1; ++other) {
      const Point& p = at(other);
      if (turn(a, b, p) != -side_ && turn(b, c, p) != -side_ && turn(c, a, p) != -side_) return false;
    }
    return true;
  }

  std::vector<Point> points_;
  std::vector<std::size_t> ring_;  // places of corners, without those that the next one has the point of
  int side_ = 0;                   // to which the outline turns in all
};

/// Corners that repeat the one before, also around the end, once.
std::vector<Index> withoutRepeats(const Index* first, const Index* last) {
  std::vector<Index> corners(first, last);
  corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
  while (corners.size() > 1 && corners.back() == corners.front()) corners.pop_back();
  return corners;
}

bool namesOneTwice(std::vector<Index> corners) {
  std::sort(corners.begin(), corners.end());
  return std::adjacent_find(corners.begin(), corners.end()) != corners.end();
}

/// Of three corners or more, none named twice. False: it cannot be done, and nothing was added.
bool addFaces(const std::vector<Index>& corners, const Positions& positions, std::vector<Face>& faces) {
  const auto add = [&](std::size_t i, std::size_t j, std::size_t k) {
    faces.push_back({corners[i], corners[j], corners[k]});
  };
  if (corners.size() == 3) {
    add(0, 1, 2);
    return true;
  }
  Outline outline(projected(corners, positions));
  if (outline.isConvex()) {
    for (std::size_t k = 2; k < corners.size(); ++k) add(0, k - 1, k);
    return true;
  }
  if (corners.size() > MAX_CONCAVE_CORNERS || !outline.isSimple()) return false;
  outline.cutEars(add);
  return true;
}

Edge edgeOf(Index a, Index b) { return {std::min(a, b), std::max(a, b)}; }

/// Every edge once, ascending; of a vertex, the edge from it to itself.
std::vector<Edge> edgesAndVertices(const std::vector<Face>& faces) {
  std::vector<Edge> edges;
  for (const Face& f : faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      edges.push_back(edgeOf(f[k], f[(k + 1) % 3]));
      edges.push_back({f[k], f[k]});
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

}  // namespace

PolygonFaces facesOf(const Polygons& polygons, const Positions& positions, const PolygonFaces* before) {
  const auto contains = [](const std::vector<std::size_t>& sorted, std::size_t p) {
    return std::binary_search(sorted.begin(), sorted.end(), p);
  };
  const auto finite = [&](Index v) { return positions[v].allFinite(); };
  PolygonFaces out;
  out.ends.reserve(polygons.size());
  std::vector<std::size_t> slight;  // polygons that are no more than an edge or a vertex,
  std::vector<Edge> slight_edges;   // this one
  for (std::size_t p = 0; p < polygons.size(); ++p) {
    const Index* all = polygons.corners.data();
    const std::vector<Index> corners = withoutRepeats(all + polygons.begin(p), all + polygons.ends[p]);
    if (corners.empty()) {
      // nothing is missing
    } else if (corners.size() < 3) {
      slight.push_back(p);
      slight_edges.push_back(edgeOf(corners.front(), corners.back()));
    } else if (before && !contains(before->unseen, p)) {
      const auto face = [&](std::size_t end) { return before->faces.begin() + static_cast<std::ptrdiff_t>(end); };
      out.faces.insert(out.faces.end(), face(p == 0 ? 0 : before->ends[p - 1]), face(before->ends[p]));
      if (contains(before->unchecked, p)) out.unchecked.push_back(p);
    } else if (namesOneTwice(corners)) {
      out.unchecked.push_back(p);
    } else if (corners.size() > 3 && !std::all_of(corners.begin(), corners.end(), finite)) {
      out.unseen.push_back(p);
      out.unchecked.push_back(p);
    } else if (!addFaces(corners, positions, out.faces)) {
      out.unchecked.push_back(p);
    }
    out.ends.push_back(out.faces.size());
  }
  if (slight.empty()) return out;
  const std::vector<Edge> seen = edgesAndVertices(out.faces);
  for (std::size_t i = 0; i < slight.size(); ++i) {
    if (!std::binary_search(seen.begin(), seen.end(), slight_edges[i])) out.unchecked.push_back(slight[i]);
  }
  std::sort(out.unchecked.begin(), out.unchecked.end());
  return out;
}

}  // namespace dccd
