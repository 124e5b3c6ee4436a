#include "support/clearance_truth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <sstream>

#include "obstacle/voxel_surface_impl.h"
#include "oracle/exact_distance.h"

namespace dccd {
namespace test {
namespace {

constexpr int BOX_EDGES[12][2] = {{0, 1}, {2, 3}, {4, 5}, {6, 7}, {0, 2}, {1, 3},
                                  {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
constexpr int BOX_FACES[12][3] = {{0, 1, 3}, {0, 3, 2}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                  {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 3, 7}, {1, 7, 5}};

using Corner = std::array<Vec3, 2>;
using RationalPoint = std::array<Rational, 3>;

std::vector<std::array<Corner, 2>> edgesOf(const TrueHull& hull) {
  std::vector<std::array<Corner, 2>> edges;
  if (hull.size() == 8) {
    for (const auto& e : BOX_EDGES) edges.push_back({hull[e[0]], hull[e[1]]});
  } else {
    for (std::size_t i = 0; i < hull.size(); ++i) edges.push_back({hull[i], hull[(i + 1) % hull.size()]});
  }
  return edges;
}

/// Without area where it has none.
std::vector<std::array<Corner, 3>> facesOf(const TrueHull& hull) {
  std::vector<std::array<Corner, 3>> faces;
  if (hull.size() == 8) {
    for (const auto& f : BOX_FACES) faces.push_back({hull[f[0]], hull[f[1]], hull[f[2]]});
  } else {
    const std::size_t last = hull.size() - 1;
    faces.push_back({hull[0], hull[std::min<std::size_t>(1, last)], hull[last]});
  }
  return faces;
}

PairMotion pairOf(const std::array<Corner, 4>& corners) {
  PairMotion pair{};
  for (int end = 0; end < 2; ++end) {
    for (int i = 0; i < 4; ++i) std::copy_n(corners[i][end].data(), 3, pair.x[end][i]);
  }
  return pair;
}

/// Calls f(kind, pair) for all pairs of a corner and a face, and of two edges.
template <class F>
void forPairs(const TrueHull& a, const TrueHull& b, const F& f) {
  for (const auto& face : facesOf(b)) {
    for (const Corner& v : a) f(PairKind::VERTEX_FACE, pairOf({v, face[0], face[1], face[2]}));
  }
  for (const auto& face : facesOf(a)) {
    for (const Corner& v : b) f(PairKind::VERTEX_FACE, pairOf({v, face[0], face[1], face[2]}));
  }
  for (const auto& e : edgesOf(a)) {
    for (const auto& g : edgesOf(b)) f(PairKind::EDGE_EDGE, pairOf({e[0], e[1], g[0], g[1]}));
  }
}

RationalPoint at(const Corner& corner, double t) {
  RationalPoint p;
  for (int k = 0; k < 3; ++k)
    p[k] = Rational(corner[0][k]) + Rational(t) * (Rational(corner[1][k]) - Rational(corner[0][k]));
  return p;
}

/// The sign of the volume of a, b, c, d.
int side(const RationalPoint& a, const RationalPoint& b, const RationalPoint& c, const RationalPoint& d) {
  RationalPoint u, v, w;
  for (int k = 0; k < 3; ++k) u[k] = b[k] - a[k], v[k] = c[k] - a[k], w[k] = d[k] - a[k];
  const Rational volume =
      u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0]);
  return volume.sign();
}

/// The inside of an edge through a face, its border included, which may be the diagonal of a box's side. All else that
/// meets shows in corners and edges.
bool passes(const std::array<Corner, 2>& edge, const std::array<Corner, 3>& face, double t) {
  const RationalPoint p = at(edge[0], t), q = at(edge[1], t), a = at(face[0], t), b = at(face[1], t),
                      c = at(face[2], t);
  if (side(a, b, c, p) * side(a, b, c, q) >= 0) return false;
  const auto [least, most] = std::minmax({side(p, q, a, b), side(p, q, b, c), side(p, q, c, a)});
  return least >= 0 || most <= 0;
}

bool isInBox(const Corner& corner, const TrueHull& box, double t) {
  const RationalPoint p = at(corner, t);
  for (int k = 0; k < 3; ++k) {
    if (p[k] < Rational(box[0][0][k]) || p[k] > Rational(box[7][0][k])) return false;
  }
  return true;
}

}  // namespace

Rational trueSquaredDistance(const TrueHull& a, const TrueHull& b, double t) {
  for (const auto& [edges, faces] : {std::pair(&a, &b), std::pair(&b, &a)}) {
    if (faces->size() < 3) continue;
    for (const auto& e : edgesOf(*edges)) {
      for (const auto& f : facesOf(*faces)) {
        if (passes(e, f, t)) return 0;
      }
    }
  }
  for (const auto& [points, box] : {std::pair(&a, &b), std::pair(&b, &a)}) {
    if (box->size() == 8 && isInBox((*points)[0], *box, t)) return 0;
  }
  Rational least = -1;
  forPairs(a, b, [&](PairKind kind, const PairMotion& pair) {
    const Rational d = squaredDistanceAt(kind, pair, t);
    if (least < 0 || d < least) least = d;
  });
  return least;
}

double roughDistance(const TrueHull& a, const TrueHull& b, double t) {
  double least = std::numeric_limits<double>::infinity();
  forPairs(a, b, [&](PairKind kind, const PairMotion& pair) {
    least = std::min(least, approximateDistanceAt(kind, pair, t));
  });
  return least;
}

std::vector<std::pair<std::vector<Index>, TrueHull>> trueFeatures(const Step& step, std::uint16_t body) {
  std::vector<std::pair<std::vector<Index>, TrueHull>> features;
  if (body == OBSTACLE_BODY) {
    for (const OccupiedLeaf& leaf : step.map.surface->leaves()) {
      const LeafBox cube = leafBox(leaf, step.map.surface->resolution());
      TrueHull hull;
      for (int i = 0; i < 8; ++i) {
        const Vec3 corner((i & 1 ? cube.hi : cube.lo)[0], (i & 2 ? cube.hi : cube.lo)[1],
                          (i & 4 ? cube.hi : cube.lo)[2]);
        hull.push_back({corner, corner});
      }
      features.push_back({{}, hull});
    }
    return features;
  }
  const Body& b = step.bodies[body];
  const auto add = [&](std::vector<Index> vertices) {
    TrueHull hull;
    for (const Index v : vertices) {
      if (std::find(b.vertex_mask.begin(), b.vertex_mask.end(), v) != b.vertex_mask.end()) return false;
      hull.push_back({(*b.t0)[v], (*b.t1)[v]});
    }
    features.push_back({std::move(vertices), hull});
    return true;
  };
  std::set<std::vector<Index>> covered;
  const auto cover = [&](Index v, Index w) {
    covered.insert({std::min(v, w), std::max(v, w)});
    covered.insert({v});
    covered.insert({w});
  };
  for (const Face& f : b.topology->faces()) {
    if (!add({f[0], f[1], f[2]})) continue;
    for (int i = 0; i < 3; ++i) cover(f[i], f[(i + 1) % 3]);
  }
  for (const Edge& e : b.topology->edges()) {
    if (covered.count({e[0], e[1]}) == 0 && add({e[0], e[1]})) cover(e[0], e[1]);
  }
  for (const Index v : b.topology->usedVertices()) {
    if (covered.count({v}) == 0) add({v});
  }
  return features;
}

namespace {

/// The shortest ways along edges of all pairs of vertices, by Floyd and Warshall.
std::vector<std::vector<double>> waysOf(const Topology& topology, const Positions& reference) {
  const std::size_t n = topology.vertexCount();
  std::vector<std::vector<double>> way(n, std::vector<double>(n, std::numeric_limits<double>::infinity()));
  for (std::size_t i = 0; i < n; ++i) way[i][i] = 0;
  for (const Edge& e : topology.edges()) way[e[0]][e[1]] = way[e[1]][e[0]] = (reference[e[0]] - reference[e[1]]).norm();
  for (std::size_t k = 0; k < n; ++k) {
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) way[i][j] = std::min(way[i][j], way[i][k] + way[k][j]);
    }
  }
  return way;
}

/// The pairs of features of two partners that are asked for.
std::vector<std::array<TrueHull, 2>> askedPairs(const Step& step, const Options& options, const Clearance& row) {
  std::vector<std::array<TrueHull, 2>> pairs;
  const auto first = trueFeatures(step, row.body[0]), second = trueFeatures(step, row.body[1]);
  const bool itself = row.body[0] == row.body[1];
  std::vector<std::vector<double>> way;
  if (itself) {
    const Body& body = step.bodies[row.body[0]];
    way = waysOf(*body.topology, body.reference ? *body.reference : *body.t0);
  }
  for (std::size_t i = 0; i < first.size(); ++i) {
    for (std::size_t j = itself ? i + 1 : 0; j < second.size(); ++j) {
      bool near = false;
      for (const Index v : itself ? first[i].first : std::vector<Index>{}) {
        for (const Index w : second[j].first) near = near || way[v][w] < options.clearance.self_m;
      }
      if (!near) pairs.push_back({first[i].second, second[j].second});
    }
  }
  return pairs;
}

/// The smallest of the pairs' true distances, or a little more where two are nearly the same.
Rational leastAt(const std::vector<std::array<TrueHull, 2>>& pairs, double t) {
  double least = std::numeric_limits<double>::infinity();
  std::vector<double> rough;
  for (const auto& pair : pairs) {
    rough.push_back(roughDistance(pair[0], pair[1], t));
    least = std::min(least, rough.back());
  }
  Rational smallest = -1;
  int judged = 0;
  for (std::size_t i = 0; i < pairs.size() && judged < 40; ++i) {
    if (!(rough[i] <= least * (1 + 1e-9))) continue;
    ++judged;
    const Rational d = trueSquaredDistance(pairs[i][0], pairs[i][1], t);
    if (smallest < 0 || d < smallest) smallest = d;
    if (smallest == 0) break;
  }
  // An edge through a face is far from it by corners and edges.
  for (std::size_t i = 0; i < pairs.size() && smallest != 0; ++i) {
    if (pairs[i][0].size() < 3 && pairs[i][1].size() < 3) continue;
    if (rough[i] <= least * (1 + 1e-9)) continue;
    if (trueSquaredDistance(pairs[i][0], pairs[i][1], t) == 0) smallest = 0;
  }
  return smallest;
}

std::string judge(const ClearanceDistance& d, const Options& options, double limit_m, bool asked, const Rational& least,
                  const char* what) {
  std::ostringstream wrong;
  wrong.precision(17);
  const Rational lower(d.lower_m);
  if (d.status == ClearanceStatus::UNKNOWN) return d.lower_m == 0 ? "" : std::string(what) + ": UNKNOWN with a bound";
  if (asked && lower * lower > least) wrong << what << ": lower_m " << d.lower_m << " is above the truth; ";
  if (d.status == ClearanceStatus::FARTHER) {
    if (d.lower_m != limit_m || !std::isinf(d.upper_m)) wrong << what << ": FARTHER than " << d.lower_m << "; ";
    return wrong.str();
  }
  const Rational upper(d.upper_m);
  if (asked && upper * upper < least) wrong << what << ": upper_m " << d.upper_m << " is below the truth; ";
  const double wide_m = std::max(options.clearance.tolerance_m, 1e-9 * d.upper_m);
  if (d.status == ClearanceStatus::MEASURED && !(d.upper_m - d.lower_m <= wide_m)) wrong << what << ": too wide; ";
  if (d.status == ClearanceStatus::TOUCHING && (d.lower_m != 0 || d.upper_m != 0))
    wrong << what << ": touches at no 0; ";
  return wrong.str();
}

}  // namespace

std::string judgeClearances(const Step& step, const Options& options, const Outcome& outcome, int times) {
  std::string wrong;
  std::map<std::pair<int, int>, bool> touch;
  for (const Contact& c : outcome.contacts) touch[std::minmax<int>(c.body[0], c.body[1])] = true;
  for (const StartIntersection& s : outcome.intersections) {
    if (s.vertex[2] != NO_INDEX) touch[std::minmax<int>(s.body[0], s.body[1])] = true;
  }
  for (const Clearance& row : outcome.clearances) {
    const std::string name = std::to_string(row.body[0]) + " and " + std::to_string(row.body[1]) + ", ";
    const auto say = [&](const std::string& text) {
      if (!text.empty()) wrong += name + text + "\n";
    };
    // At the end they may also cross without a contact: what shares a vertex is not tested, and may have led there.
    const bool touches = touch[{row.body[0], row.body[1]}] || row.at_end.status == ClearanceStatus::TOUCHING;
    if (touches != (row.over_step.status == ClearanceStatus::TOUCHING)) {
      say(std::string(touches ? "touch, and are " : "are apart, and are ") + toString(row.over_step.status));
    }
    const auto pairs = askedPairs(step, options, row);
    const double limit_m = row.body[0] == row.body[1] ? std::min(options.clearance.max_m, options.clearance.self_m / 4)
                                                      : options.clearance.max_m;
    if (pairs.empty()) {
      for (const ClearanceDistance* d : {&row.at_end, &row.over_step}) {
        if (d->status == ClearanceStatus::MEASURED) say("nothing is asked for, and a distance is MEASURED");
      }
      continue;
    }
    const Rational at_end = leastAt(pairs, 1);
    say(judge(row.at_end, options, limit_m, true, at_end, "at the end"));
    if (at_end == 0 && row.at_end.status == ClearanceStatus::MEASURED) say("meet at the end, and are MEASURED");
    std::vector<double> at{0, 1};
    for (int k = 1; k <= times; ++k) at.push_back(k / (times + 1.0));
    for (const double t : at) {
      if (Rational(row.over_step.lower_m) * Rational(row.over_step.lower_m) > leastAt(pairs, t)) {
        say("over the step lower_m " + std::to_string(row.over_step.lower_m) + " is above the truth at " +
            std::to_string(t));
      }
    }
    if (!touches) say(judge(row.over_step, options, limit_m, true, leastAt(pairs, row.over_step.t), "over the step"));
  }
  return wrong;
}

}  // namespace test
}  // namespace dccd
