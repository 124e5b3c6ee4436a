#include "stream/reach_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "dccd/tolerances.h"

namespace dccd {
namespace {

constexpr double ROUNDING = 1e-12;  // of a coordinate on a straight way between two

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

/// What a face may reach.
struct FaceReach {
  double lo[3], hi[3], near_m;

  /// False: nothing.
  bool find(const std::array<Vec3, 3>& t, double reach_m) {
    double largest_m = 0;
    for (int a = 0; a < 3; ++a) {
      const auto [least, most] = std::minmax({t[0][a], t[1][a], t[2][a]});
      if (!std::isfinite(t[0][a]) || !std::isfinite(t[1][a]) || !std::isfinite(t[2][a])) return false;
      lo[a] = least - reach_m;
      hi[a] = most + reach_m;
      largest_m = std::max({largest_m, std::abs(lo[a]), std::abs(hi[a])});
    }
    near_m = nearOf(reach_m, largest_m);
    return near_m > 0;
  }
  /// What is within this is within reach, of coordinates up to the largest; 0 or less: nobody knows.
  static double nearOf(double reach_m, double largest_m) {
    return reach_m - tolerance::OWN_REACH * (reach_m + largest_m);
  }
};

class ReachSearch {
 public:
  ReachSearch(std::vector<ReachedCube>& cubes, double resolution_m, RigidShapes* shapes)
      : cubes_(cubes), resolution_m_(resolution_m), shapes_(shapes), left_(cubes.size()), asked_(cubes.size(), 0) {
    grid_.build(cubes.size(), 4 * resolution_m, [&](std::size_t i) -> const LeafBox& { return cubes[i].box; });
  }

  void search(const TrackedBody& body, const std::vector<MeshStore::Stretch>& path,
              const Eigen::Isometry3d& map_from_fixed) {
    double gone_m = std::numeric_limits<double>::infinity();  // since the last place at which it was asked
    for (std::size_t i = 0; i < path.size() && left_ > 0; ++i) {
      const MeshStore::Stretch* const older = i + 1 < path.size() ? &path[i + 1] : nullptr;
      const bool goes_on = older && older->to == path[i].from && older->last == 1 && path[i].first == 0;
      const double way_m = wayAlong(path[i]), step_m = tolerance::OWN_PLACES * resolution_m_;
      if (goes_on && gone_m + way_m <= step_m) {
        gone_m += way_m;
        continue;
      }
      const int places = std::min<int>(tolerance::MOST_OWN_PLACES,
                                       static_cast<int>(std::min(1e6, std::ceil(way_m / step_m))));
      // Where it goes on its beginning is the next one's end.
      searchAlong(body, path[i], places, goes_on && places > 0 ? places - 1 : places, map_from_fixed);
      gone_m = !goes_on ? std::numeric_limits<double>::infinity() : places > 0 ? way_m / places : 0;
    }
  }

 private:
  std::vector<ReachedCube>& cubes_;
  double resolution_m_;
  RigidShapes* shapes_;
  BoxGrid grid_;
  std::size_t left_;
  std::vector<std::uint64_t> asked_;  // per cube, the last place of a rigid body that came to it
  std::uint64_t place_ = 0;
  Positions at_, first_at_;
  std::vector<Face> near_;  // findNear()

  /// How far its points go.
  static double wayAlong(const MeshStore::Stretch& stretch) {
    const MeshFrame &from = *stretch.from, &to = *stretch.to;
    double squared = 0;
    for (std::size_t v = 0; v < to.positions.size(); ++v) {
      const double m = (to.positions[v] - from.positions[v]).squaredNorm();
      if (m > squared) squared = m;
    }
    return std::sqrt(squared) * (stretch.last - stretch.first);
  }

  /// Asks at its end, and at places back to its beginning up to the last one.
  void searchAlong(const TrackedBody& body, const MeshStore::Stretch& stretch, int places, int last,
                   const Eigen::Isometry3d& map_from_fixed) {
    const MeshFrame &from = *stretch.from, &to = *stretch.to;
    RigidShape* const shape = to.rigid && shapes_ ? &(*shapes_)[body.body] : nullptr;
    const bool is_known = shape && to.topology->hasFaces() && shape->isOf(to, resolution_m_);
    if (!to.rigid) findNear(body, stretch, map_from_fixed);
    for (int i = 0; i <= last && left_ > 0; ++i) {
      const double u = places == 0 ? stretch.last : stretch.last + (stretch.first - stretch.last) * i / places;
      at_.resize(to.positions.size());
      if (!to.rigid) {
        if (near_.empty()) return;
        interpolate(from.positions, to.positions, u, at_);
        for (Vec3& p : at_) p = map_from_fixed * p;
        for (const Face& f : near_) ask(body, {at_[f[0]], at_[f[1]], at_[f[2]]});
        continue;
      }
      const Eigen::Isometry3d map_from_body = map_from_fixed * interpolate(from.pose, to.pose, u);
      const Eigen::Isometry3d moved = map_from_body * to.pose.inverse();
      if (is_known && askRigid(body, to, *shape, map_from_body, moved)) continue;
      for (std::size_t v = 0; v < at_.size(); ++v) at_[v] = moved * to.positions[v];
      const Topology& topology = *to.topology;
      visitElements(topology, [&](const Face& f) { ask(body, {at_[f[0]], at_[f[1]], at_[f[2]]}); });
      if (topology.isClosed() && !body.shell) askInside(body, topology);
    }
  }

  /// Its faces, or if it has none its edges, as faces of two corners.
  template <class Visit>
  static void visitElements(const Topology& topology, const Visit& visit) {
    for (const Face& f : topology.faces()) visit(f);
    if (topology.hasFaces()) return;
    for (const Edge& e : topology.edges()) visit(Face{e[0], e[1], e[1]});
  }

  /// Of a body whose points go straight: the faces that come to a cube on their way. Most of them do not.
  void findNear(const TrackedBody& body, const MeshStore::Stretch& stretch, const Eigen::Isometry3d& map_from_fixed) {
    const auto placed = [&](double u, Positions& at) {
      at.resize(stretch.to->positions.size());
      interpolate(stretch.from->positions, stretch.to->positions, u, at);
      for (Vec3& p : at) p = map_from_fixed * p;
    };
    placed(stretch.first, first_at_);
    placed(stretch.last, at_);
    near_.clear();
    visitElements(*stretch.to->topology, [&](const Face& f) {
      Vec3 lo = at_[f[0]], hi = lo;
      for (const Index v : f) {
        lo = lo.cwiseMin(at_[v]).cwiseMin(first_at_[v]);
        hi = hi.cwiseMax(at_[v]).cwiseMax(first_at_[v]);
      }
      const double more_m = body.reach_m + ROUNDING * (body.reach_m + lo.cwiseAbs().cwiseMax(hi.cwiseAbs()).maxCoeff());
      lo.array() -= more_m;
      hi.array() += more_m;
      bool is_near = !lo.allFinite() || !hi.allFinite();  // a lost vertex may be there at one end of the way
      grid_.visit(lo.data(), hi.data(), [&](std::uint32_t i) {
        const LeafBox& box = cubes_[i].box;
        is_near = is_near || (cubes_[i].body < 0 && box.lo[0] <= hi[0] && box.lo[1] <= hi[1] && box.lo[2] <= hi[2] &&
                              box.hi[0] >= lo[0] && box.hi[1] >= lo[1] && box.hi[2] >= lo[2]);
      });
      if (is_near) near_.push_back(f);
    });
  }

  void settle(ReachedCube& cube, const TrackedBody& body) {
    cube.body = body.body;
    --left_;
  }

  void ask(const TrackedBody& body, const std::array<Vec3, 3>& t) {
    FaceReach reach;
    if (!reach.find(t, body.reach_m)) return;
    grid_.visit(reach.lo, reach.hi, [&](std::uint32_t i) {
      if (cubes_[i].body < 0 && reaches(t, reach, cubes_[i].box)) settle(cubes_[i], body);
    });
  }

  /// Cubes whose middle lies inside of a closed body. What comes up here is farther from the surface than rounding can
  /// matter.
  void askInside(const TrackedBody& body, const Topology& topology) {
    Eigen::AlignedBox3d bounds;
    for (const Index v : topology.usedVertices()) bounds.extend(at_[v]);
    if (!bounds.min().allFinite() || !bounds.max().allFinite()) return;
    grid_.visit(bounds.min().data(), bounds.max().data(), [&](std::uint32_t i) {
      if (cubes_[i].body >= 0) return;
      const Vec3 middle = middleOf(cubes_[i].box);
      if (bounds.contains(middle) && isInside(at_, topology.faces(), middle)) settle(cubes_[i], body);
    });
  }

  /// The same of a rigid body, the other way round: each cube asks for the faces near it, in the body's frame. There
  /// are many more faces than cubes. False: not here.
  bool askRigid(const TrackedBody& body, const MeshFrame& frame, RigidShape& shape,
                const Eigen::Isometry3d& map_from_body, const Eigen::Isometry3d& moved) {
    const Eigen::Isometry3d body_from_map = map_from_body.inverse();
    const Topology& topology = *frame.topology;
    const double slack_m = 2 * RigidShape::SLACK * resolution_m_;
    Eigen::AlignedBox3d bounds;
    for (int corner = 0; corner < 8; ++corner) {
      bounds.extend(map_from_body * shape.bounds().corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
    }
    const Vec3 lo = bounds.min().array() - (body.reach_m + slack_m),
               hi = bounds.max().array() + (body.reach_m + slack_m);
    // Where coordinates are that large no face says what it reaches, and a cube may be at the surface.
    const double sure_m = FaceReach::nearOf(body.reach_m, 2 * lo.cwiseAbs().cwiseMax(hi.cwiseAbs()).maxCoeff());
    if (!(sure_m > 0)) return false;
    const double within_m = std::max(0.0, sure_m - slack_m);  // of a cube's middle
    ++place_;
    grid_.visit(lo.data(), hi.data(), [&](std::uint32_t i) {
      ReachedCube& cube = cubes_[i];
      if (cube.body >= 0 || std::exchange(asked_[i], place_) == place_) return;
      const Vec3 middle = middleOf(cube.box), point = body_from_map * middle;
      const double half_m = 0.5 * (Eigen::Map<const Vec3>(cube.box.hi) - Eigen::Map<const Vec3>(cube.box.lo)).norm();
      const double near_m = half_m + body.reach_m + slack_m;
      if (shape.bounds().squaredExteriorDistance(point) > near_m * near_m) return;
      const bool is_reached = shape.anyNear(point, near_m, [&](std::uint32_t number) {
        const double away2 = (closestOn(shape.face(number), point) - point).squaredNorm();
        if (away2 > near_m * near_m) return false;
        if (away2 < within_m * within_m) return true;
        const Face& f = topology.faces()[number];
        const std::array<Vec3, 3> t{moved * frame.positions[f[0]], moved * frame.positions[f[1]],
                                    moved * frame.positions[f[2]]};
        FaceReach reach;
        return reach.find(t, body.reach_m) && reaches(t, reach, cube.box);
      });
      // A cube that no face reaches has its middle half a voxel from all of them at the least.
      if (is_reached || (topology.isClosed() && !body.shell && shape.holds(point))) settle(cube, body);
    });
    return true;
  }

  static Vec3 middleOf(const LeafBox& box) {
    return 0.5 * (Eigen::Map<const Vec3>(box.lo) + Eigen::Map<const Vec3>(box.hi));
  }

  /// From one to the other and back: each pair of points that comes up is one of the triangle and one of the cube.
  static bool reaches(const std::array<Vec3, 3>& t, const FaceReach& reach, const LeafBox& box) {
    for (int a = 0; a < 3; ++a) {
      if (box.lo[a] > reach.hi[a] || box.hi[a] < reach.lo[a]) return false;
    }
    constexpr int MOST_TURNS = 24;
    const Eigen::Map<const Vec3> lo(box.lo), hi(box.hi);
    Vec3 q = 0.5 * (lo + hi);
    double before = 1e300;
    for (int turn = 0; turn < MOST_TURNS; ++turn) {
      const Vec3 p = closestOn(t, q);
      q = p.cwiseMax(lo).cwiseMin(hi);
      const double squared = (p - q).squaredNorm();
      if (squared <= reach.near_m * reach.near_m) return true;
      if (!(squared < 0.999 * before) && turn > 2) return false;
      before = squared;
    }
    return false;
  }
};

}  // namespace

void searchReach(const std::vector<TrackedBody>& bodies, const std::vector<BodyWay>& ways,
                 const Eigen::Isometry3d& map_from_fixed, double resolution_m, std::vector<ReachedCube>& cubes,
                 RigidShapes* shapes) {
  ReachSearch search(cubes, resolution_m, shapes);
  for (std::size_t b = 0; b < bodies.size(); ++b) search.search(bodies[b], ways[b], map_from_fixed);
}

}  // namespace dccd
