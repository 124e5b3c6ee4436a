#include "stream/reach_search.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "dccd/tolerances.h"

namespace dccd {
namespace {

/// The point of a triangle that is closest to p (Ericson, Real-Time Collision Detection, 5.1.5), up to rounding: it is
/// a point of the triangle in any case.
Vec3 closestOn(const std::array<Vec3, 3>& t, const Vec3& p) {
  const Vec3 ab = t[1] - t[0], ac = t[2] - t[0], ap = p - t[0], bp = p - t[1], cp = p - t[2];
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp), d6 = ac.dot(cp);
  const auto along = [](const Vec3& from, const Vec3& way, double u) -> Vec3 {
    return from + (std::isfinite(u) ? std::clamp(u, 0.0, 1.0) : 0.0) * way;
  };
  if (d1 <= 0 && d2 <= 0) return t[0];
  if (d3 >= 0 && d4 <= d3) return t[1];
  if (d6 >= 0 && d5 <= d6) return t[2];
  const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return along(t[0], ab, d1 / (d1 - d3));
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return along(t[0], ac, d2 / (d2 - d6));
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return along(t[1], t[2] - t[1], (d4 - d3) / ((d4 - d3) + (d5 - d6)));
  const double v = vb / (va + vb + vc), w = vc / (va + vb + vc);
  if (!(v >= 0 && w >= 0 && v + w <= 1)) return t[0];
  return t[0] + v * ab + w * ac;
}

class ReachSearch {
 public:
  ReachSearch(std::vector<ReachedCube>& cubes, double resolution_m) : cubes_(cubes), resolution_m_(resolution_m) {
    for (const ReachedCube& cube : cubes) {
      for (int a = 0; a < 3; ++a) {
        lo_[a] = std::min(lo_[a], cube.box.lo[a]);
        hi_[a] = std::max(hi_[a], cube.box.hi[a]);
      }
    }
    sort();
  }

  void search(const TrackedBody& body, const std::vector<MeshStore::Stretch>& path,
              const Eigen::Isometry3d& map_from_fixed) {
    for (const MeshStore::Stretch& stretch : path) {
      if (left_ == 0) return;
      searchAlong(body, stretch, map_from_fixed);
    }
  }

 private:
  std::vector<ReachedCube>& cubes_;
  double resolution_m_;
  std::array<double, 3> lo_{1e300, 1e300, 1e300}, hi_{-1e300, -1e300, -1e300};
  double cell_m_ = 0;
  std::array<std::int64_t, 3> cells_{0, 0, 0};
  std::vector<std::uint32_t> first_, listed_;  // per cell its first place in the list; numbers of cubes
  std::size_t left_ = 0;
  Positions at_;

  std::int64_t cellOf(double x, int a) const {
    return static_cast<std::int64_t>(std::clamp((x - lo_[a]) / cell_m_, 0.0, static_cast<double>(cells_[a] - 1)));
  }
  template <class Visit>
  void visitCells(const double* lo, const double* hi, Visit visit) const {
    std::array<std::int64_t, 3> low, high;
    for (int a = 0; a < 3; ++a) {
      if (!(hi[a] >= lo_[a] && lo[a] <= hi_[a])) return;
      low[a] = cellOf(lo[a], a);
      high[a] = cellOf(hi[a], a);
    }
    for (std::int64_t z = low[2]; z <= high[2]; ++z) {
      for (std::int64_t y = low[1]; y <= high[1]; ++y) {
        for (std::int64_t x = low[0]; x <= high[0]; ++x) {
          visit(static_cast<std::size_t>((z * cells_[1] + y) * cells_[0] + x));
        }
      }
    }
  }

  void sort() {
    left_ = cubes_.size();
    if (cubes_.empty()) return;
    constexpr double MOST_CELLS = 1 << 20;
    for (cell_m_ = 4 * resolution_m_;; cell_m_ *= 2) {
      double count = 1;
      for (int a = 0; a < 3; ++a) count *= std::floor((hi_[a] - lo_[a]) / cell_m_) + 1;
      if (count <= MOST_CELLS) break;
    }
    for (int a = 0; a < 3; ++a) cells_[a] = static_cast<std::int64_t>((hi_[a] - lo_[a]) / cell_m_) + 1;
    first_.assign(static_cast<std::size_t>(cells_[0] * cells_[1] * cells_[2]) + 1, 0);
    for (const ReachedCube& cube : cubes_)
      visitCells(cube.box.lo, cube.box.hi, [&](std::size_t cell) { ++first_[cell + 1]; });
    for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
    listed_.resize(first_.back());
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    for (std::uint32_t i = 0; i < cubes_.size(); ++i) {
      visitCells(cubes_[i].box.lo, cubes_[i].box.hi, [&](std::size_t cell) { listed_[next[cell]++] = i; });
    }
  }

  void searchAlong(const TrackedBody& body, const MeshStore::Stretch& stretch,
                   const Eigen::Isometry3d& map_from_fixed) {
    const MeshFrame &from = *stretch.from, &to = *stretch.to;
    double way_m = 0;
    for (std::size_t v = 0; v < to.positions.size(); ++v) {
      const double m = (to.positions[v] - from.positions[v]).norm();
      if (m > way_m) way_m = m;
    }
    way_m *= stretch.last - stretch.first;
    const int places =
        std::min<int>(tolerance::MOST_OWN_PLACES,
                      static_cast<int>(std::min(1e6, std::ceil(way_m / (tolerance::OWN_PLACES * resolution_m_)))));
    for (int i = 0; i <= places && left_ > 0; ++i) {
      const double u = places == 0 ? stretch.last : stretch.last + (stretch.first - stretch.last) * i / places;
      if (to.rigid) {
        const Eigen::Isometry3d moved = map_from_fixed * interpolate(from.pose, to.pose, u) * to.pose.inverse();
        at_.resize(to.positions.size());
        for (std::size_t v = 0; v < at_.size(); ++v) at_[v] = moved * to.positions[v];
      } else {
        at_.resize(to.positions.size());
        interpolate(from.positions, to.positions, u, at_);
        for (Vec3& p : at_) p = map_from_fixed * p;
      }
      const Topology& topology = *to.topology;
      for (const Face& f : topology.faces()) ask(body, {at_[f[0]], at_[f[1]], at_[f[2]]});
      if (to.rigid && topology.isClosed() && !body.shell) askInside(body, topology);
      if (topology.hasFaces()) continue;
      for (const Edge& e : topology.edges()) ask(body, {at_[e[0]], at_[e[1]], at_[e[1]]});
    }
  }

  void ask(const TrackedBody& body, const std::array<Vec3, 3>& t) {
    double lo[3], hi[3], largest_m = 0;
    for (int a = 0; a < 3; ++a) {
      const auto [least, most] = std::minmax({t[0][a], t[1][a], t[2][a]});
      if (!std::isfinite(t[0][a]) || !std::isfinite(t[1][a]) || !std::isfinite(t[2][a])) return;
      lo[a] = least - body.reach_m;
      hi[a] = most + body.reach_m;
      largest_m = std::max({largest_m, std::abs(lo[a]), std::abs(hi[a])});
    }
    const double near_m = body.reach_m - tolerance::OWN_REACH * (body.reach_m + largest_m);
    if (!(near_m > 0)) return;
    visitCells(lo, hi, [&](std::size_t cell) {
      for (std::uint32_t i = first_[cell]; i < first_[cell + 1]; ++i) {
        ReachedCube& cube = cubes_[listed_[i]];
        if (cube.body >= 0) continue;
        bool apart = false;
        for (int a = 0; a < 3; ++a) apart = apart || cube.box.lo[a] > hi[a] || cube.box.hi[a] < lo[a];
        if (apart || !reaches(t, cube.box, near_m)) continue;
        cube.body = body.body;
        --left_;
      }
    });
  }

  /// Cubes whose middle lies inside of a closed body: solid angles (Van Oosterom and Strackee 1983) add up to 0 outside
  /// and to a multiple of 4 pi inside. What comes up here is farther from the surface than rounding can matter.
  void askInside(const TrackedBody& body, const Topology& topology) {
    Eigen::AlignedBox3d bounds;
    for (const Index v : topology.usedVertices()) bounds.extend(at_[v]);
    if (!bounds.min().allFinite() || !bounds.max().allFinite()) return;
    visitCells(bounds.min().data(), bounds.max().data(), [&](std::size_t cell) {
      for (std::uint32_t i = first_[cell]; i < first_[cell + 1]; ++i) {
        ReachedCube& cube = cubes_[listed_[i]];
        const Eigen::Map<const Vec3> lo(cube.box.lo), hi(cube.box.hi);
        const Vec3 middle = 0.5 * (lo + hi);
        if (cube.body >= 0 || !bounds.contains(middle)) continue;
        double angle = 0;
        for (const Face& f : topology.faces()) {
          const Vec3 a = at_[f[0]] - middle, b = at_[f[1]] - middle, c = at_[f[2]] - middle;
          const double la = a.norm(), lb = b.norm(), lc = c.norm();
          angle += 2 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
        }
        if (!(std::abs(angle) >= 2 * M_PI)) continue;  // also where a vertex is not finite
        cube.body = body.body;
        --left_;
      }
    });
  }

  /// From one to the other and back: each pair of points that comes up is one of the triangle and one of the cube.
  static bool reaches(const std::array<Vec3, 3>& t, const LeafBox& box, double near_m) {
    constexpr int MOST_TURNS = 24;
    const Eigen::Map<const Vec3> lo(box.lo), hi(box.hi);
    Vec3 q = 0.5 * (lo + hi);
    double before = 1e300;
    for (int turn = 0; turn < MOST_TURNS; ++turn) {
      const Vec3 p = closestOn(t, q);
      q = p.cwiseMax(lo).cwiseMin(hi);
      const double squared = (p - q).squaredNorm();
      if (squared <= near_m * near_m) return true;
      if (!(squared < 0.999 * before) && turn > 2) return false;
      before = squared;
    }
    return false;
  }
};

}  // namespace

void searchReach(const std::vector<TrackedBody>& bodies, const std::vector<BodyWay>& ways,
                 const Eigen::Isometry3d& map_from_fixed, double resolution_m, std::vector<ReachedCube>& cubes) {
  ReachSearch search(cubes, resolution_m);
  for (std::size_t b = 0; b < bodies.size(); ++b) search.search(bodies[b], ways[b], map_from_fixed);
}

}  // namespace dccd
