#include "culling/seams.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <utility>

namespace dccd {
namespace {

std::array<Edge, 3> edgesOf(const Face& face) {
  const auto edge = [](Index a, Index b) { return a < b ? Edge{a, b} : Edge{b, a}; };
  return {edge(face[0], face[1]), edge(face[1], face[2]), edge(face[0], face[2])};
}

/// Equal for equal edges; others look like chance (the finalizer of splitmix64).
std::uint64_t mixed(const Edge& edge) {
  std::uint64_t x = std::uint64_t{edge[0]} << 32 | edge[1];
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

/// Positions at both ends of a step.
struct Places {
  const Positions &t0, &t1;
  bool same(Index v, Index w) const { return v == w || (t0[v] == t0[w] && t1[v] == t1[w]); }
};

/// Whether another vertex is where one end of the edge is: else no seam goes along it. Most meshes end here.
bool isDoubled(const Edge& edge, const Topology& topology, const Places& places) {
  const double a = places.t0[edge[0]].x(), b = places.t0[edge[1]].x();
  for (const Index v : topology.usedVertices()) {
    const double x = places.t0[v].x();
    if ((x == a && v != edge[0] && places.same(v, edge[0])) || (x == b && v != edge[1] && places.same(v, edge[1]))) {
      return true;
    }
  }
  return false;
}

/// Whether the edge, where it is, lies on an odd number of faces, each counted once.
bool isBorder(const Edge& edge, const Topology& topology, const Places& places) {
  if (places.same(edge[0], edge[1])) return false;
  std::vector<Index> third;  // corners of the faces at it
  for (const Face& f : topology.faces()) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = f[k], b = f[(k + 1) % 3], c = f[(k + 2) % 3];
      const bool along = places.same(a, edge[0]) && places.same(b, edge[1]);
      if (!along && !(places.same(a, edge[1]) && places.same(b, edge[0]))) continue;
      const auto known = [&](Index v) { return places.same(v, c); };
      if (!places.same(c, a) && !places.same(c, b) && std::none_of(third.begin(), third.end(), known))
        third.push_back(c);
    }
  }
  return third.size() % 2 != 0;
}

/// Per vertex, the first one at its place.
std::vector<Index> firstAtPlace(const Topology& topology, const Positions& t0, const Positions& t1) {
  std::vector<Index> order = topology.usedVertices(), first(topology.vertexCount());
  std::iota(first.begin(), first.end(), Index{0});
  const auto place = [&](Index v) {
    const Vec3 &p = t0[v], &q = t1[v];
    return std::array<double, 6>{p.x(), p.y(), p.z(), q.x(), q.y(), q.z()};
  };
  std::sort(order.begin(), order.end(),
            [&](Index v, Index w) { return std::make_pair(place(v), v) < std::make_pair(place(w), w); });
  for (std::size_t i = 1; i < order.size(); ++i) {
    if (place(order[i]) == place(order[i - 1])) first[order[i]] = first[order[i - 1]];
  }
  return first;
}

/// The first edge of these, sorted, that is there an odd number of times, or the end.
std::vector<Edge>::const_iterator firstOdd(std::vector<Edge>::const_iterator first,
                                           const std::vector<Edge>::const_iterator end) {
  while (first != end) {
    const auto last = std::find_if(first, end, [&](const Edge& edge) { return edge != *first; });
    if ((last - first) % 2 != 0) break;
    first = last;
  }
  return first;
}

}  // namespace

Seams seamsOf(const Topology& topology, const Positions& t0, const Positions& t1, const Seams& before) {
  const Places places{t0, t1};
  if (!topology.hasFaces() || topology.isClosed() || !isDoubled(topology.borderEdge(), topology, places)) return {};
  if (before.border[0] != before.border[1] && isBorder(before.border, topology, places)) return {{}, {}, before.border};
  const std::vector<Index> first = firstAtPlace(topology, t0, t1);
  std::vector<std::pair<Face, Index>> merged;  // and their numbers
  for (const Face& face : topology.faces()) {
    Face f{first[face[0]], first[face[1]], first[face[2]]};
    std::sort(f.begin(), f.end());
    merged.emplace_back(f, static_cast<Index>(merged.size()));
  }
  std::sort(merged.begin(), merged.end());
  Seams seams;
  seams.repeated.assign(merged.size(), 1);
  std::vector<Edge> edges;
  for (std::size_t i = 0; i < merged.size(); ++i) {
    const Face& f = merged[i].first;
    if (f[0] == f[1] || f[1] == f[2] || (i > 0 && f == merged[i - 1].first)) continue;
    seams.repeated[merged[i].second] = 0;
    const auto of_face = edgesOf(f);
    edges.insert(edges.end(), of_face.begin(), of_face.end());
  }
  std::sort(edges.begin(), edges.end());
  if (edges.empty()) return {};
  if (const auto odd = firstOdd(edges.begin(), edges.end()); odd != edges.end()) return {{}, {}, *odd};
  for (const Index v : topology.usedVertices()) {
    if (first[v] != v) seams.vertices.push_back({first[v], v});
  }
  return seams;
}

std::vector<std::uint8_t> openFaces(const Topology& topology) {
  const std::vector<Face>& faces = topology.faces();
  std::vector<Index> first(topology.vertexCount());  // a vertex that it is joined with, itself at the end
  std::iota(first.begin(), first.end(), Index{0});
  const auto partOf = [&](Index v) {
    while (first[v] != v) v = first[v] = first[first[v]];
    return v;
  };
  for (const Face& f : faces) {
    first[partOf(f[1])] = partOf(f[0]);
    first[partOf(f[2])] = partOf(f[0]);
  }
  // An even number of equal terms is no sum: a part that has one is open. Of the others each edge is counted.
  std::vector<std::uint64_t> sum(topology.vertexCount(), 0);
  for (const Face& f : faces) {
    for (const Edge& edge : edgesOf(f)) sum[partOf(f[0])] ^= mixed(edge);
  }
  std::vector<Edge> edges;
  for (const Face& f : faces) {
    if (sum[partOf(f[0])] != 0) continue;
    const auto of_face = edgesOf(f);
    edges.insert(edges.end(), of_face.begin(), of_face.end());
  }
  std::sort(edges.begin(), edges.end());
  for (auto odd = firstOdd(edges.begin(), edges.end()); odd != edges.end(); odd = firstOdd(odd + 1, edges.end()))
    sum[partOf((*odd)[0])] = 1;
  std::vector<std::uint8_t> open;
  for (const Face& f : faces) open.push_back(sum[partOf(f[0])] != 0);
  if (std::count(open.begin(), open.end(), 0) == 0) open.clear();
  return open;
}

bool hold(const Seams& seams, const Positions& t0, const Positions& t1) {
  return std::all_of(seams.vertices.begin(), seams.vertices.end(),
                     [&](const std::array<Index, 2>& v) { return t0[v[0]] == t0[v[1]] && t1[v[0]] == t1[v[1]]; });
}

}  // namespace dccd
