#include "support/structured_pairs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <random>
#include <set>

namespace dccd {
namespace test {
namespace {

using Point = std::array<double, 3>;
/// Where a sheet's grid point is at t = 0 and at t = 1; x and y are 0 to 1.
using Place = std::function<Point(double x, double y, int time)>;

struct Sheets {
  const char* family;
  Place first, second;
};

Place flat(double z0, double z1, double shift = 0) {
  return [=](double x, double y, int time) { return Point{x + shift, y + 0.7 * shift, time == 0 ? z0 : z1}; };
}

/// In a plane that is not one of the axes', at rest.
Point tilted(double x, double y) { return {x, 0.8 * y, 0.3 * x + 0.6 * y}; }

/// The same turned into a plane along no axis, in which only rounding does not let it stay.
Place askew(const Place& place) {
  return [place](double x, double y, int time) {
    const Point p = place(x, y, time);
    return Point{(2 * p[0] - p[1] + 2 * p[2]) / 3, (2 * p[0] + 2 * p[1] - p[2]) / 3, (2 * p[1] + 2 * p[2] - p[0]) / 3};
  };
}

/// In one plane, from `from` on by so many cells.
Place sliding(int cells, double from, double by) {
  return [=](double x, double y, int time) {
    return Point{x + (from + time * by) / cells, y + 0.6 * from / cells + 0.1 * time / cells, 0};
  };
}

std::vector<Sheets> families(int cells) {
  const double half = 0.5 / cells;
  return {
      {"at rest in one plane", flat(0.1, 0.1), flat(0.1, 0.1, 0.3 * half)},
      {"at rest, grids aligned", flat(0.1, 0.1), flat(0.1, 0.1)},
      {"at rest in a tilted plane", [](double x, double y, int) { return tilted(x, y); },
       [=](double x, double y, int) { return tilted(x + 0.3 * half, y + 0.3 * half); }},
      {"crossing at t = 1/2", flat(0, 0), flat(0.1, -0.1, 0.3 * half)},
      {"crossing at t = 1/3", flat(0, 0), flat(0.1, -0.2, 0.3 * half)},
      {"crossing at t = 1/4", flat(0, 0), flat(0.1, -0.3, 0.3 * half)},
      {"crossing at t = 1/2, grids aligned", flat(0, 0), flat(0.1, -0.1)},
      {"crossing at t = 1/3, mirrored", flat(0, 0),
       [](double x, double y, int time) {
         return Point{1 - x, y, time == 0 ? 0.1 : -0.2};
       }},
      {"touching at t = 0", flat(0, 0), flat(0, 0.05, 0.3 * half)},
      {"touching at t = 1", flat(0, 0), flat(0.05, 0, 0.3 * half)},
      {"sliding in one plane", flat(0, 0),
       [=](double x, double y, int time) {
         return Point{x + time * 2 * half, y + 0.3 * half, 0};
       }},
      {"sliding in a plane along no axis", askew(sliding(cells, 0, -0.4)), askew(sliding(cells, 0.3, 0.5))},
      {"sliding far in a plane along no axis", askew(sliding(cells, 0, -1.5)), askew(sliding(cells, 0.3, 2))},
      {"sliding in a plane at 45 degrees",
       [=](double x, double y, int time) {
         const Point p = sliding(cells, 0, -0.4)(x, y, time);
         return Point{p[0], p[1], p[0]};
       },
       [=](double x, double y, int time) {
         const Point p = sliding(cells, 0.3, 0.5)(x, y, time);
         return Point{p[0], p[1], p[0]};
       }},
      {"integer coordinates",
       [=](double x, double y, int) {
         return Point{std::round(x * cells), std::round(y * cells), 0};
       },
       [=](double x, double y, int time) {
         return Point{std::round(x * cells), std::round(y * cells), time == 0 ? 1.0 : -1.0};
       }},
      {"duplicated, moving together", flat(0, 0.1), flat(0, 0.1)},
      {"turning about an axis", flat(0, 0),
       [=](double x, double y, int time) {
         return Point{x + 0.3 * half, y, time == 0 ? 0.1 - 0.2 * x : 0.2 * x - 0.1};
       }},
  };
}

/// A sheet's triangles and edges; vertices from `base` on.
void addSheet(const Place& place, int cells, std::vector<VertexMotion>& vertices,
              std::vector<std::array<Index, 3>>& faces, std::vector<std::array<Index, 2>>& edges) {
  const auto base = static_cast<Index>(vertices.size()), row = static_cast<Index>(cells + 1);
  for (int j = 0; j <= cells; ++j) {
    for (int i = 0; i <= cells; ++i) {
      VertexMotion v{};
      const double x = static_cast<double>(i) / cells, y = static_cast<double>(j) / cells;
      const Point t0 = place(x, y, 0), t1 = place(x, y, 1);
      std::copy(t0.begin(), t0.end(), v.t0);
      std::copy(t1.begin(), t1.end(), v.t1);
      vertices.push_back(v);
    }
  }
  std::set<std::array<Index, 2>> unique;
  for (int j = 0; j < cells; ++j) {
    for (int i = 0; i < cells; ++i) {
      const Index a = base + static_cast<Index>(j) * row + static_cast<Index>(i), b = a + 1, c = a + row, d = c + 1;
      for (const std::array<Index, 3>& f : {std::array<Index, 3>{a, b, d}, std::array<Index, 3>{a, d, c}}) {
        faces.push_back(f);
        for (int k = 0; k < 3; ++k) unique.insert({std::min(f[k], f[(k + 1) % 3]), std::max(f[k], f[(k + 1) % 3])});
      }
    }
  }
  edges.assign(unique.begin(), unique.end());
}

/// Whether the boxes of two features' paths meet, as a broad phase would have it.
template <std::size_t N, std::size_t M>
bool boxesMeet(const std::vector<VertexMotion>& vertices, const std::array<Index, N>& a,
               const std::array<Index, M>& b) {
  for (int k = 0; k < 3; ++k) {
    double low[2] = {HUGE_VAL, HUGE_VAL}, high[2] = {-HUGE_VAL, -HUGE_VAL};
    const auto add = [&](int feature, Index v) {
      for (const double x : {vertices[v].t0[k], vertices[v].t1[k]}) {
        low[feature] = std::min(low[feature], x);
        high[feature] = std::max(high[feature], x);
      }
    };
    for (const Index v : a) add(0, v);
    for (const Index v : b) add(1, v);
    if (low[0] > high[1] || low[1] > high[0]) return false;
  }
  return true;
}

}  // namespace

std::vector<StructuredPairs> structuredPairs(int cells) {
  std::vector<StructuredPairs> all;
  for (const Sheets& sheets : families(cells)) {
    StructuredPairs set;
    set.family = sheets.family;
    std::vector<std::array<Index, 3>> faces[2];
    std::vector<std::array<Index, 2>> edges[2];
    addSheet(sheets.first, cells, set.vertices, faces[0], edges[0]);
    const auto per_sheet = static_cast<Index>(set.vertices.size());
    addSheet(sheets.second, cells, set.vertices, faces[1], edges[1]);
    for (Index v = 0; v < per_sheet; ++v) {
      for (const auto& f : faces[1]) {
        if (boxesMeet(set.vertices, std::array<Index, 1>{v}, f)) set.pairs.push_back({v, f[0], f[1], f[2]});
      }
    }
    all.push_back(set);
    set.kind = PairKind::EDGE_EDGE;
    set.pairs.clear();
    for (const auto& e : edges[0]) {
      for (const auto& f : edges[1]) {
        if (boxesMeet(set.vertices, e, f)) set.pairs.push_back({e[0], e[1], f[0], f[1]});
      }
    }
    all.push_back(set);
  }
  return all;
}

std::vector<StructuredPairs> structuredSheets(int cells) {
  std::vector<StructuredPairs> all;
  for (const Sheets& sheets : families(cells)) {
    StructuredPairs set;
    set.family = sheets.family;
    for (const Place& place : {sheets.first, sheets.second}) {
      std::vector<std::array<Index, 3>> faces;
      std::vector<std::array<Index, 2>> edges;
      addSheet(place, cells, set.vertices, faces, edges);
    }
    all.push_back(set);
  }
  return all;
}

StructuredPairs perturbed(const StructuredPairs& pairs, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  StructuredPairs result = pairs;
  const auto move = [&](double& x) {
    for (std::uint64_t n = random() % 3; n > 0 && x != 0; --n) x = std::nextafter(x, random() % 2 ? 10 * x : 0);
  };
  for (VertexMotion& v : result.vertices) {
    for (int k = 0; k < 3; ++k) {
      const bool rests = v.t0[k] == v.t1[k];
      move(v.t0[k]);
      if (rests) v.t1[k] = v.t0[k];
      if (!rests) move(v.t1[k]);
    }
  }
  return result;
}

StructuredPairs pairsOf(const std::string& family, PairKind kind, const std::vector<Query>& queries) {
  StructuredPairs set;
  set.family = family;
  set.kind = kind;
  for (const Query& query : queries) set.add(query.motion);
  return set;
}

StructuredPairs hardPairs(Hardness hardness, PairKind kind, std::size_t count) {
  RandomSource random(2017 + 2 * static_cast<std::uint64_t>(hardness) + static_cast<std::uint64_t>(kind));
  std::vector<Query> queries;
  for (std::size_t i = 0; i < count; ++i) queries.push_back(hardQuery(random, kind, hardness));
  return pairsOf(toString(hardness), kind, queries);
}

}  // namespace test
}  // namespace dccd
