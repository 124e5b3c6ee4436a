#include "support/box_oracle.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "oracle/exact_distance.h"
#include "step/start/start_state.h"

namespace dccd {
namespace test {
namespace {

/// A leaf's closed box as features.
struct BoxFeatures {
  Vec3 corner[8];
  std::vector<std::array<int, 2>> edges;
  std::vector<std::array<int, 3>> triangles;
};

BoxFeatures featuresOf(const OccupiedLeaf& leaf, double resolution_m) {
  BoxFeatures box;
  for (int i = 0; i < 8; ++i) {
    box.corner[i] = {voxelPlane(leaf.min.x + (i & 1 ? leaf.size : 0), resolution_m),
                     voxelPlane(leaf.min.y + (i & 2 ? leaf.size : 0), resolution_m),
                     voxelPlane(leaf.min.z + (i & 4 ? leaf.size : 0), resolution_m)};
    for (const int axis : {1, 2, 4}) {
      if (!(i & axis)) box.edges.push_back({i, i | axis});
    }
  }
  for (const int axis : {1, 2, 4}) {
    const int u = axis == 1 ? 2 : 1, v = axis == 4 ? 2 : 4;
    for (const int base : {0, axis}) {
      box.triangles.push_back({base, base | u, base | u | v});
      box.triangles.push_back({base, base | u | v, base | v});
    }
  }
  return box;
}

bool contains(const BoxFeatures& box, const Vec3& p) {
  return (p.array() >= box.corner[0].array()).all() && (p.array() <= box.corner[7].array()).all();
}

/// Does the feature (two or three points) meet the closed, solid box at rest?
bool meetsAtStart(const BoxFeatures& box, const std::vector<Vec3>& points) {
  for (const Vec3& p : points) {
    if (contains(box, p)) return true;
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t k = i + 1; k < points.size(); ++k) {
      for (const auto& triangle : box.triangles) {
        if (segmentMeetsTriangle(points[i].data(), points[k].data(), box.corner[triangle[0]].data(),
                                 box.corner[triangle[1]].data(), box.corner[triangle[2]].data())) {
          return true;
        }
      }
    }
  }
  if (points.size() < 3) return false;
  return std::any_of(box.edges.begin(), box.edges.end(), [&](const std::array<int, 2>& edge) {
    return segmentMeetsTriangle(box.corner[edge[0]].data(), box.corner[edge[1]].data(), points[0].data(),
                                points[1].data(), points[2].data());
  });
}

using MovingPoint = std::array<Vec3, 2>;

class Earliest {
 public:
  explicit Earliest(int toc_bits) {
    AccuracyOptions options;
    options.toc_bits = toc_bits;
    test_ = makeRung(options);
  }
  void add(PairKind kind, const std::array<MovingPoint, 4>& points) {
    PairMotion pair;
    for (int t = 0; t < 2; ++t) {
      for (int i = 0; i < 4; ++i) std::memcpy(pair.x[t][i], points[i][t].data(), sizeof pair.x[t][i]);
    }
    if (boundsApart(kind, pair)) return;
    const ElementaryResult result = testPair(*test_, kind, pair);
    if (result.verdict == Verdict::CONTACT && (!toc_ || result.toc_lower < *toc_)) toc_ = result.toc_lower;
  }
  const std::optional<double>& toc() const { return toc_; }

 private:
  /// Only to save time: features whose swept boxes are apart never meet.
  static bool boundsApart(PairKind kind, const PairMotion& pair) {
    const int split = kind == PairKind::VERTEX_FACE ? 1 : 2;
    for (int axis = 0; axis < 3; ++axis) {
      double lo[2] = {1e308, 1e308}, hi[2] = {-1e308, -1e308};
      for (int i = 0; i < 4; ++i) {
        for (int t = 0; t < 2; ++t) {
          lo[i >= split] = std::min(lo[i >= split], pair.x[t][i][axis]);
          hi[i >= split] = std::max(hi[i >= split], pair.x[t][i][axis]);
        }
      }
      if (hi[0] < lo[1] || hi[1] < lo[0]) return true;
    }
    return false;
  }
  std::unique_ptr<Rung> test_;
  std::optional<double> toc_;
};

}  // namespace

std::optional<double> earliestAgainstBoxes(const ObstacleScene& scene, const std::vector<Index>& feature,
                                           int toc_bits) {
  Earliest earliest(toc_bits);
  std::vector<MovingPoint> points;
  std::vector<Vec3> start;
  for (const Index v : feature) {
    points.push_back({scene.t0[v], scene.t1[v]});
    start.push_back(scene.t0[v]);
  }
  for (const OccupiedLeaf& leaf : scene.leaves) {
    const BoxFeatures box = featuresOf(leaf, scene.resolution_m);
    if (meetsAtStart(box, start)) return 0.0;
    const auto fixed = [&box](int corner) { return MovingPoint{box.corner[corner], box.corner[corner]}; };
    for (std::size_t i = 0; i < points.size(); ++i) {
      for (const auto& t : box.triangles) {
        earliest.add(PairKind::VERTEX_FACE, {points[i], fixed(t[0]), fixed(t[1]), fixed(t[2])});
      }
      for (std::size_t k = i + 1; k < points.size(); ++k) {
        for (const auto& e : box.edges) {
          earliest.add(PairKind::EDGE_EDGE, {points[i], points[k], fixed(e[0]), fixed(e[1])});
        }
      }
    }
    for (int corner = 0; points.size() == 3 && corner < 8; ++corner) {
      earliest.add(PairKind::VERTEX_FACE, {fixed(corner), points[0], points[1], points[2]});
    }
  }
  return earliest.toc();
}

std::optional<double> earliestOfContacts(const std::vector<Contact>& contacts, const std::vector<Index>& feature) {
  std::optional<double> earliest;
  for (const Contact& contact : contacts) {
    bool part = true;
    for (const Index v : contact.vertex) {
      part = part && (v == NO_INDEX || std::find(feature.begin(), feature.end(), v) != feature.end());
    }
    if (part && (!earliest || contact.toc_lower < *earliest)) earliest = contact.toc_lower;
  }
  return earliest;
}

double distanceToBoxes(const ObstacleScene& scene, double t) {
  double distance = 1e308;
  const auto at = [&](Index v) { return Vec3((1 - t) * scene.t0[v] + t * scene.t1[v]); };
  const auto measure = [&](PairKind kind, const std::array<Vec3, 4>& points) {
    PairMotion pair;
    for (int time = 0; time < 2; ++time) {
      for (int i = 0; i < 4; ++i) std::memcpy(pair.x[time][i], points[i].data(), sizeof pair.x[time][i]);
    }
    distance = std::min(distance, approximateDistanceAt(kind, pair, 0));
  };
  for (const OccupiedLeaf& leaf : scene.leaves) {
    const BoxFeatures box = featuresOf(leaf, scene.resolution_m);
    for (const Edge& edge : scene.topology.edges()) {
      if (meetsAtStart(box, {at(edge[0]), at(edge[1])})) return 0;
      for (const auto& e : box.edges) {
        measure(PairKind::EDGE_EDGE, {at(edge[0]), at(edge[1]), box.corner[e[0]], box.corner[e[1]]});
      }
      for (const Index v : edge) {
        for (const auto& f : box.triangles) {
          measure(PairKind::VERTEX_FACE, {at(v), box.corner[f[0]], box.corner[f[1]], box.corner[f[2]]});
        }
      }
    }
    for (const Face& face : scene.topology.faces()) {
      if (meetsAtStart(box, {at(face[0]), at(face[1]), at(face[2])})) return 0;
      for (const Vec3& corner : box.corner) {
        measure(PairKind::VERTEX_FACE, {corner, at(face[0]), at(face[1]), at(face[2])});
      }
    }
  }
  return distance;
}

std::string describe(const ObstacleScene& scene) {
  char line[256];
  std::snprintf(line, sizeof line, "resolution %.17g\n", scene.resolution_m);
  std::string text = line;
  for (const OccupiedLeaf& leaf : scene.leaves) {
    std::snprintf(line, sizeof line, "leaf %d %d %d size %u\n", leaf.min.x, leaf.min.y, leaf.min.z, leaf.size);
    text += line;
  }
  for (std::size_t i = 0; i < scene.t0.size(); ++i) {
    std::snprintf(line, sizeof line, "vertex %zu %a %a %a -> %a %a %a\n", i, scene.t0[i][0], scene.t0[i][1],
                  scene.t0[i][2], scene.t1[i][0], scene.t1[i][1], scene.t1[i][2]);
    text += line;
  }
  for (const Face& face : scene.topology.faces()) {
    std::snprintf(line, sizeof line, "face %u %u %u\n", face[0], face[1], face[2]);
    text += line;
  }
  return text;
}

}  // namespace test
}  // namespace dccd
