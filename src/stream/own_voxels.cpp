#include "stream/own_voxels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "dccd/tolerances.h"
#include "obstacle/leaf_sets.h"
#include "obstacle/voxel_surface_impl.h"

namespace dccd {
namespace {

std::uint64_t packed(const VoxelKey& key) {
  return std::uint64_t{key.x} << 32 | std::uint64_t{key.y} << 16 | std::uint64_t{key.z};
}

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

struct Cube {
  enum class Why : std::uint8_t { APPEARED, VANISHED, REMEMBERED, DOUBTED };
  OccupiedLeaf leaf;
  Why why;
  LeafBox box;
  int body = -1;  // that reaches it; -1: none so far
};

/// Which of some cubes bodies reach. A cube counts as reached only where a point of a body's surface at some time of
/// its path, and a point of the cube, are seen to be near enough: the answer may miss a reach at the very rim, and
/// invents none.
class ReachSearch {
 public:
  ReachSearch(std::vector<Cube>& cubes, double resolution_m) : cubes_(cubes), resolution_m_(resolution_m) {
    for (const Cube& cube : cubes) {
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
  std::vector<Cube>& cubes_;
  double resolution_m_;
  std::array<double, 3> lo_{1e300, 1e300, 1e300}, hi_{-1e300, -1e300, -1e300};
  double cell_m_ = 0;
  std::array<std::int64_t, 3> cells_{0, 0, 0};
  std::vector<std::uint32_t> first_, listed_;  // per cell its first place in the list; numbers of cubes
  std::size_t left_ = 0;
  Positions from_, to_, at_;

  std::int64_t cellOf(double x, int a) const {
    return std::clamp<std::int64_t>(static_cast<std::int64_t>(std::floor((x - lo_[a]) / cell_m_)), 0, cells_[a] - 1);
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
    for (const Cube& cube : cubes_) visitCells(cube.box.lo, cube.box.hi, [&](std::size_t cell) { ++first_[cell + 1]; });
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
      if (to.rigid && topology.isClosed()) askInside(body, topology);
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
        Cube& cube = cubes_[listed_[i]];
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
        Cube& cube = cubes_[listed_[i]];
        const Eigen::Map<const Vec3> lo(cube.box.lo), hi(cube.box.hi);
        const Vec3 middle = 0.5 * (lo + hi);
        if (cube.body >= 0 || !bounds.contains(middle)) continue;
        double angle = 0;
        for (const Face& f : topology.faces()) {
          const Vec3 a = at_[f[0]] - middle, b = at_[f[1]] - middle, c = at_[f[2]] - middle;
          const double la = a.norm(), lb = b.norm(), lc = c.norm();
          angle += 2 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
        }
        if (std::abs(angle) < 2 * M_PI) continue;
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

/// Whether the map tells that the cube is free.
bool isSeenFree(const KnownSpace* known, const LeafBox& box) {
  if (!known) return true;
  const Eigen::Map<const Vec3> lo(box.lo), hi(box.hi);
  return known->isKnown({0.75 * lo + 0.25 * hi, 0.25 * lo + 0.75 * hi});  // its own voxels, not those it touches
}

VoxelTree treeOf(const std::unordered_map<std::uint64_t, OwnVoxel>& voxels) {
  std::vector<OccupiedLeaf> leaves;
  leaves.reserve(voxels.size());
  for (const auto& one : voxels) leaves.push_back({one.second.key, 1});
  return VoxelTree(leaves);
}

/// Calls visit(voxel) for the finest voxels of a cube within the box.
template <class Visit>
void visitVoxels(const OccupiedLeaf& cube, const KeyBox& box, Visit& visit) {
  const std::array<std::int32_t, 3> lo{cube.min.x, cube.min.y, cube.min.z};
  for (int a = 0; a < 3; ++a) {
    if (lo[a] > box.hi[a] || lo[a] + static_cast<std::int32_t>(cube.size) <= box.lo[a]) return;
  }
  if (cube.size == 1) return visit(cube);
  for (const OccupiedLeaf& part : eighthsOf(cube)) visitVoxels(part, box, visit);
}

StampNs nanoseconds(double s) { return static_cast<StampNs>(std::llround(s * 1e9)); }

/// What the bodies' ways reach at most, in keys of the map; empty where no body is known.
KeyBox reachedKeys(const ObstacleMap& map, const std::vector<TrackedBody>& bodies,
                   const std::vector<std::vector<MeshStore::Stretch>>& paths) {
  Eigen::AlignedBox3d all;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    Eigen::AlignedBox3d reached;
    bool turns = false;
    for (const MeshStore::Stretch& stretch : paths[b]) {
      turns = turns || stretch.to->rigid;
      for (const MeshFrame* frame : {stretch.from.get(), stretch.to.get()}) {
        for (const Vec3& p : frame->positions) {
          if (const Vec3 q = map.map_from_fixed * p; q.allFinite()) reached.extend(q);
        }
      }
    }
    if (reached.isEmpty()) continue;
    // One that turns leaves the box of its ends by less than that one's diagonal.
    const double more_m = bodies[b].reach_m + (turns ? reached.diagonal().norm() : 0);
    all.extend(reached.min() - Vec3::Constant(more_m));
    all.extend(reached.max() + Vec3::Constant(more_m));
  }
  if (all.isEmpty()) return {};
  const Vec3 lo = all.min(), hi = all.max();
  return map.surface->impl().keysOf(lo.data(), hi.data());
}

std::string countOf(std::uint64_t count) { return std::to_string(count) + (count == 1 ? " voxel" : " voxels"); }

/// Both in words, by body.
void describe(const std::vector<TrackedBody>& bodies, bool trust_first, OwnVoxels& own) {
  for (const TrackedBody& body : bodies) {
    std::uint64_t its = 0, doubted = 0;
    for (const OwnVoxel& voxel : *own.voxels) {
      if (voxel.body == body.body) ++(voxel.doubted ? doubted : its);
    }
    own.own += its;
    own.doubted += doubted;
    if (its > 0) {
      own.excluded +=
          (own.excluded.empty() ? "" : ", ") + countOf(its) + " of the map as own of body '" + body.name + "'";
    }
    if (doubted > 0) {
      own.doubt += (own.doubt.empty() ? "" : ", ") + countOf(doubted) + " near body '" + body.name + "'";
    }
  }
  if (trust_first && !own.excluded.empty()) own.excluded += ", by own_voxels_doubt: trust the first map's, too";
  if (own.doubt.empty()) return;
  own.doubt = "the step touches one of " + own.doubt + (own.doubted == 1 ? " that was" : " that were");
  own.doubt +=
      " there in the first map, so that nobody can tell the body from an obstacle; give a map without the body as "
      "octomap_file, move it away once, or set own_voxels_doubt: trust";
}

}  // namespace

void OwnVoxelFinder::forget() {
  before_ = nullptr;
  own_.clear();
  remembered_.clear();
}

StampNs OwnVoxelFinder::pathNeededFrom(StampNs now_ns, double lag_s) const {
  const StampNs longest_ns = now_ns - nanoseconds(tolerance::OWN_PATH_S);
  return (before_ ? std::max(before_ns_, longest_ns) : now_ns) - nanoseconds(lag_s);
}

ObstacleMap OwnVoxelFinder::reduce(const ObstacleMap& map, const VoxelSurface* trusted, std::vector<TrackedBody> bodies,
                                   double lag_s, bool trust_first) {
  const double resolution_m = map.surface->resolution();
  for (TrackedBody& body : bodies) {
    if (body.reach_m == ONE_VOXEL) body.reach_m = resolution_m;
  }
  if (before_ && (before_->resolution() != resolution_m || frame_id_ != map.frame_id)) forget();
  const bool is_first = !before_;
  const VoxelTree nothing({});
  const VoxelTree &now = map.surface->impl().tree, &before = is_first ? nothing : before_->impl().tree,
                  &sure = trusted ? trusted->impl().tree : nothing;

  std::vector<std::vector<MeshStore::Stretch>> paths;
  for (const TrackedBody& body : bodies) {
    const MeshStore& frames = *body.frames;
    if (frames.empty()) {
      paths.emplace_back();
    } else if (body.holds_always) {
      paths.push_back({{frames.newestShared(), frames.newestShared(), 0, 0}});
    } else {
      const StampNs since_ns =
          is_first ? map.stamp_ns - nanoseconds(lag_s) : std::min(pathNeededFrom(map.stamp_ns, lag_s), map.stamp_ns);
      // What the first map shows is in doubt, not own: the first place that is known will do.
      paths.push_back(
          frames.pathWithin(since_ns, is_first ? std::max(map.stamp_ns, frames.oldest().stamp_ns) : map.stamp_ns));
    }
  }

  std::vector<Cube> cubes;
  const auto ask = [&](const OccupiedLeaf& leaf, Cube::Why why) {
    cubes.push_back({leaf, why, leafBox(leaf, resolution_m), -1});
  };
  const VoxelTree remembered(remembered_), own = treeOf(own_);
  const KeyBox region = reachedKeys(map, bodies, paths);
  OwnVoxels found;
  if (region.hi[0] >= region.lo[0]) {
    auto appeared = [&](const OccupiedLeaf& voxel) {
      if (cubes.size() < tolerance::MOST_OWN_ASKED) ask(voxel, Cube::Why::APPEARED);
    };
    now.visitLeaves(region, [&](std::uint32_t index) {
      visitUncovered(before, now.leaves()[index], [&](const OccupiedLeaf& fresh) {
        visitUncovered(sure, fresh, [&](const OccupiedLeaf& unsure) {
          visitUncovered(remembered, unsure, [&](const OccupiedLeaf& part) { visitVoxels(part, region, appeared); });
        });
      });
      return true;
    });
  }
  found.looked_at = cubes.size();
  for (const OccupiedLeaf& leaf : before.leaves()) {
    visitUncovered(now, leaf, [&](const OccupiedLeaf& gone) {
      visitUncovered(own, gone, [&](const OccupiedLeaf& part) { ask(part, Cube::Why::VANISHED); });
    });
  }
  for (const OccupiedLeaf& leaf : remembered_) {
    visitUncovered(now, leaf, [&](const OccupiedLeaf& part) { ask(part, Cube::Why::REMEMBERED); });
  }
  for (auto one = own_.begin(); one != own_.end();) {
    const OccupiedLeaf leaf{one->second.key, 1};
    if (coverage(now, leaf) != VoxelTree::Coverage::FULL) {
      one = own_.erase(one);
      continue;
    }
    if (one->second.doubted && trust_first) one->second.doubted = false;
    if (one->second.doubted) ask(leaf, Cube::Why::DOUBTED);
    ++one;
  }

  ReachSearch search(cubes, resolution_m);
  for (std::size_t b = 0; b < bodies.size(); ++b) search.search(bodies[b], paths[b], map.map_from_fixed);

  remembered_.clear();
  for (const Cube& cube : cubes) {
    const bool reached = cube.body >= 0;
    switch (cube.why) {
      case Cube::Why::APPEARED:
        if (reached) {
          own_[packed(cube.leaf.min)] = {cube.leaf.min, static_cast<std::uint16_t>(cube.body),
                                         is_first && !trust_first};
        }
        break;
      case Cube::Why::VANISHED:
      case Cube::Why::REMEMBERED:
        if (reached || !isSeenFree(map.known.get(), cube.box)) remembered_.push_back(cube.leaf);
        break;
      case Cube::Why::DOUBTED:
        if (!reached) own_.erase(packed(cube.leaf.min));
        break;
    }
  }
  before_ = map.surface;
  before_ns_ = map.stamp_ns;
  frame_id_ = map.frame_id;

  std::vector<OwnVoxel> voxels;
  voxels.reserve(own_.size());
  for (const auto& one : own_) voxels.push_back(one.second);
  std::sort(voxels.begin(), voxels.end(), [](const OwnVoxel& a, const OwnVoxel& b) { return a.key < b.key; });
  found.voxels = share(std::move(voxels));
  describe(bodies, trust_first, found);
  ObstacleMap reduced = map;
  if (!own_.empty() || trusted) {
    std::vector<OccupiedLeaf> leaves = leavesWithout(leavesWithout(now.leaves(), treeOf(own_)), sure);
    leaves.insert(leaves.end(), sure.leaves().begin(), sure.leaves().end());
    reduced.surface = VoxelSurface::build(resolution_m, std::move(leaves));
  }
  if (found.doubted > 0) {
    std::vector<OccupiedLeaf> leaves;
    for (const OwnVoxel& voxel : *found.voxels) {
      if (voxel.doubted) leaves.push_back({voxel.key, 1});
    }
    found.doubted_surface = VoxelSurface::build(resolution_m, std::move(leaves));
  }
  reduced.own = std::move(found);
  return reduced;
}

}  // namespace dccd
