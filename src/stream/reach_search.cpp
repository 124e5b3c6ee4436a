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
  ReachSearch(std::vector<ReachedCube>& cubes, double resolution_m, RigidShapes* shapes, bool whole_way)
      : cubes_(cubes),
        resolution_m_(resolution_m),
        shapes_(shapes),
        whole_way_(whole_way),
        open_(cubes.size()),
        places_of_(cubes.size()),
        asked_(cubes.size()) {
    grid_.build(cubes.size(), 4 * resolution_m, [&](std::size_t i) -> const LeafBox& { return cubes[i].box; });
  }

  void search(const TrackedBody& body, const std::vector<MeshStore::Stretch>& path,
              const Eigen::Isometry3d& map_from_fixed) {
    begin(body);
    double gone_m = std::numeric_limits<double>::infinity();  // since the last place at which it was asked
    for (std::size_t i = 0; i < path.size() && left_ > 0; ++i) {
      const MeshStore::Stretch* const older = i + 1 < path.size() ? &path[i + 1] : nullptr;
      const bool goes_on = older && older->to == path[i].from && older->last == 1 && path[i].first == 0;
      const double way_m = wayAlong(path[i]), step_m = tolerance::OWN_PLACES * resolution_m_;
      if (goes_on && gone_m + way_m <= step_m) {
        gone_m += way_m;
        continue;
      }
      const int places =
          std::min<int>(tolerance::MOST_OWN_PLACES, static_cast<int>(std::min(1e6, std::ceil(way_m / step_m))));
      // Where it goes on its beginning is the next one's end.
      searchAlong(body, path[i], places, goes_on && places > 0 ? places - 1 : places, map_from_fixed);
      gone_m = !goes_on ? std::numeric_limits<double>::infinity() : places > 0 ? way_m / places : 0;
    }
    for (std::size_t i = 0; whole_way_ && i < cubes_.size(); ++i) {
      if (places_of_[i].count > 0 && places_of_[i].count == place_ - first_place_) cubes_[i].always.add(body.body);
    }
  }

 private:
  /// The last place at which a body reached the cube, and how many there were.
  struct Places {
    std::uint64_t last = 0, count = 0;
  };
  std::vector<ReachedCube>& cubes_;
  double resolution_m_;
  RigidShapes* shapes_;
  bool whole_way_;
  BoxGrid grid_;
  std::size_t left_ = 0;
  std::vector<std::uint8_t> open_;    // per cube, whether it matters that this body reaches it; so many are left_
  std::vector<Places> places_of_;     // of this body, where the whole way is asked for
  std::vector<std::uint64_t> asked_;  // per cube, the last place that came to it
  std::uint64_t place_ = 0, first_place_ = 0, question_ = 0;
  Positions at_;
  /// A face at the place that is asked for, and the last cube that came to it.
  struct PlacedFace {
    std::array<Vec3, 3> corners;
    FaceReach reach;
    std::uint64_t asked;
  };
  std::vector<PlacedFace> placed_;
  BoxGrid placed_grid_;

  void begin(const TrackedBody& body) {
    left_ = 0;
    first_place_ = place_;
    for (std::size_t i = 0; i < cubes_.size(); ++i) {
      const ReachedCube& cube = cubes_[i];
      const bool needs_all = whole_way_ || cube.why == ReachedCube::Why::APPEARED || !cube.asked.empty();
      const bool is_told = !needs_all && !cube.near.empty();
      open_[i] = !is_told && (cube.asked.empty() || cube.asked.has(body.group()) || cube.asked.has(body.body));
      left_ += open_[i];
      if (whole_way_) places_of_[i] = {};
    }
  }

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
    for (int i = 0; i <= last && left_ > 0; ++i) {
      ++place_;
      at_.resize(to.positions.size());
      const double u = places == 0 ? stretch.last : stretch.last + (stretch.first - stretch.last) * i / places;
      if (!to.rigid) {
        interpolate(from.positions, to.positions, u, at_);
        for (Vec3& p : at_) p = map_from_fixed * p;
        askPlaced(body, *to.topology);
        continue;
      }
      const Eigen::Isometry3d map_from_body = map_from_fixed * interpolate(from.pose, to.pose, u);
      const Eigen::Isometry3d moved = map_from_body * to.pose.inverse();
      if (is_known && askRigid(body, to, *shape, map_from_body, moved)) continue;
      for (std::size_t v = 0; v < at_.size(); ++v) at_[v] = moved * to.positions[v];
      askPlaced(body, *to.topology);
      if (to.topology->isClosed() && !body.shell) askInside(body, *to.topology);
    }
  }

  /// Its faces, or if it has none its edges, as faces of two corners.
  template <class Visit>
  static void visitElements(const Topology& topology, const Visit& visit) {
    for (const Face& f : topology.faces()) visit(f);
    if (topology.hasFaces()) return;
    for (const Edge& e : topology.edges()) visit(Face{e[0], e[1], e[1]});
  }

  void settle(std::uint32_t i, const TrackedBody& body) {
    cubes_[i].near.add(body.body);
    if (whole_way_) {
      Places& places = places_of_[i];
      places.count += std::exchange(places.last, place_) != place_;
      return;
    }
    open_[i] = 0;
    --left_;
  }

  /// Of a body at at_: each cube asks for the faces near it, until one reaches it. Most cubes are reached by the first.
  void askPlaced(const TrackedBody& body, const Topology& topology) {
    placed_.clear();
    Eigen::AlignedBox3d bounds;
    visitElements(topology, [&](const Face& f) {
      PlacedFace face{{at_[f[0]], at_[f[1]], at_[f[2]]}, {}, 0};
      FaceReach& reach = face.reach;
      if (!reach.find(face.corners, body.reach_m) || !grid_.meets(reach.lo, reach.hi)) return;
      bounds.extend(Eigen::Map<const Vec3>(reach.lo)).extend(Eigen::Map<const Vec3>(reach.hi));
      placed_.push_back(face);
    });
    if (placed_.empty()) return;
    placed_grid_.build(placed_.size(), 2 * resolution_m_,
                       [&](std::size_t f) -> const FaceReach& { return placed_[f].reach; });
    grid_.visit(bounds.min().data(), bounds.max().data(), [&](std::uint32_t i) {
      if (!open_[i] || std::exchange(asked_[i], place_) == place_) return;
      const LeafBox& box = cubes_[i].box;
      ++question_;
      const auto isReachedBy = [&](std::uint32_t f) {
        PlacedFace& face = placed_[f];
        return std::exchange(face.asked, question_) != question_ && reaches(face.corners, face.reach, box);
      };
      const Vec3 middle = middleOf(box);
      // Those around its middle come first.
      const bool is_reached =
          placed_grid_.any(middle.data(), middle.data(), isReachedBy) || placed_grid_.any(box.lo, box.hi, isReachedBy);
      if (is_reached) settle(i, body);
    });
  }

  /// Cubes whose middle lies inside of a closed body. What comes up here is farther from the surface than rounding can
  /// matter.
  void askInside(const TrackedBody& body, const Topology& topology) {
    Eigen::AlignedBox3d bounds;
    for (const Index v : topology.usedVertices()) {
      if (!at_[v].allFinite()) return;
      bounds.extend(at_[v]);
    }
    grid_.visit(bounds.min().data(), bounds.max().data(), [&](std::uint32_t i) {
      if (!open_[i]) return;
      const Vec3 middle = middleOf(cubes_[i].box);
      if (bounds.contains(middle) && isInside(at_, topology.faces(), middle)) settle(i, body);
    });
  }

  /// The same of a rigid body, in its frame, where its faces are listed once. False: not here.
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
    grid_.visit(lo.data(), hi.data(), [&](std::uint32_t i) {
      const ReachedCube& cube = cubes_[i];
      if (!open_[i] || std::exchange(asked_[i], place_) == place_) return;
      const Vec3 middle = middleOf(cube.box), point = body_from_map * middle;
      const double near_m = halfOf(cube.box) + body.reach_m + slack_m;
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
      if (is_reached || (topology.isClosed() && !body.shell && shape.holds(point))) settle(i, body);
    });
    return true;
  }

  static Vec3 middleOf(const LeafBox& box) {
    return 0.5 * (Eigen::Map<const Vec3>(box.lo) + Eigen::Map<const Vec3>(box.hi));
  }
  /// How far its corners are from its middle.
  static double halfOf(const LeafBox& box) {
    return 0.5 * (Eigen::Map<const Vec3>(box.hi) - Eigen::Map<const Vec3>(box.lo)).norm();
  }

  /// From one to the other and back: each pair of points that comes up is one of the triangle and one of the cube.
  static bool reaches(const std::array<Vec3, 3>& t, const FaceReach& reach, const LeafBox& box) {
    for (int a = 0; a < 3; ++a) {
      if (box.lo[a] > reach.hi[a] || box.hi[a] < reach.lo[a]) return false;
    }
    constexpr int MOST_TURNS = 24;
    const Eigen::Map<const Vec3> lo(box.lo), hi(box.hi);
    Vec3 q = middleOf(box);
    const double most_m = reach.near_m + halfOf(box);  // from its middle, of what is within reach
    if ((closestOn(t, q) - q).squaredNorm() > (1 + ROUNDING) * most_m * most_m) return false;
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
                 RigidShapes* shapes, bool whole_way) {
  ReachSearch search(cubes, resolution_m, shapes, whole_way);
  for (std::size_t b = 0; b < bodies.size(); ++b) search.search(bodies[b], ways[b], map_from_fixed);
}

}  // namespace dccd
