#include "support/closed_meshes.h"

#include <algorithm>
#include <map>

namespace dccd {
namespace test {
namespace {

const std::vector<Face> TETRAHEDRON{{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};
const std::vector<Face> OCTAHEDRON{{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                   {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
const std::vector<Face> BOX{{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                            {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};

StepBody atRest(const std::vector<Face>& faces, const Positions& at) {
  StepBody body;
  body.topology = Topology::fromTriangles(at.size(), faces);
  body.t0 = body.t1 = at;
  return body;
}

/// b's vertices from `shared` of a's last ones on: 1 or 2 join the parts in a vertex or along an edge.
StepBody joined(const StepBody& a, const StepBody& b, std::size_t shared) {
  const std::size_t first = a.t0.size() - shared;
  std::vector<Face> faces = a.topology.faces();
  for (Face f : b.topology.faces()) {
    for (Index& v : f) v += static_cast<Index>(first);
    faces.push_back(f);
  }
  Positions at = a.t0;
  at.insert(at.end(), b.t0.begin() + static_cast<std::ptrdiff_t>(shared), b.t0.end());
  return atRest(faces, at);
}

}  // namespace

StepBody box(const Vec3& low, const Vec3& high) {
  Positions at;
  for (int i = 0; i < 8; ++i) {
    at.push_back({i & 1 ? high[0] : low[0], i & 2 ? high[1] : low[1], i & 4 ? high[2] : low[2]});
  }
  return atRest(BOX, at);
}

StepBody tetrahedron(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  return atRest(TETRAHEDRON, {a, b, c, d});
}

StepBody ball(const Vec3& centre, double radius, int depth) {
  Positions at{Vec3(1, 0, 0), Vec3(-1, 0, 0), Vec3(0, 1, 0), Vec3(0, -1, 0), Vec3(0, 0, 1), Vec3(0, 0, -1)};
  std::vector<Face> faces = OCTAHEDRON;
  for (int i = 0; i < depth; ++i) {
    std::map<Edge, Index> middle;
    const auto between = [&](Index a, Index b) {
      const auto found = middle.emplace(Edge{std::min(a, b), std::max(a, b)}, static_cast<Index>(at.size()));
      if (found.second) at.push_back((at[a] + at[b]).normalized());
      return found.first->second;
    };
    std::vector<Face> finer;
    for (const Face& f : faces) {
      const Index ab = between(f[0], f[1]), bc = between(f[1], f[2]), ca = between(f[2], f[0]);
      for (const Face& g : {Face{f[0], ab, ca}, Face{ab, f[1], bc}, Face{ca, bc, f[2]}, Face{ab, bc, ca}}) {
        finer.push_back(g);
      }
    }
    faces = std::move(finer);
  }
  for (Vec3& x : at) x = centre + radius * x;
  return atRest(faces, at);
}

StepBody sheet(std::size_t rows, std::size_t cols, const Vec3& corner, double spacing) {
  Positions at;
  for (std::size_t i = 0; i < rows * cols; ++i) {
    at.push_back(corner + spacing * Vec3(static_cast<double>(i % cols), static_cast<double>(i / cols), 0));
  }
  StepBody body;
  body.topology = Topology::grid(rows, cols);
  body.t0 = body.t1 = at;
  return body;
}

StepBody together(const StepBody& a, const StepBody& b) { return joined(a, b, 0); }

StepBody withOwnCorners(const StepBody& body) {
  StepBody out;
  std::vector<Face> faces;
  for (const Face& f : body.topology.faces()) {
    const auto n = static_cast<Index>(out.t0.size());
    faces.push_back({n, n + 1, n + 2});
    for (const Index v : f) {
      out.t0.push_back(body.t0[v]);
      out.t1.push_back(body.t1[v]);
    }
  }
  out.topology = Topology::fromTriangles(out.t0.size(), faces);
  out.self_collision = false;  // its faces touch along their edges
  return out;
}

StepBody randomClosed(const Draw& draw, Coordinates coordinates) {
  const auto part = [&]() -> StepBody {
    switch (draw(0, 4)) {
      case 0: {
        const Positions ends = randomPositions(draw, 2, coordinates);
        return box(ends[0].cwiseMin(ends[1]), ends[0].cwiseMax(ends[1]));  // flat ones included
      }
      case 1:
        return atRest(OCTAHEDRON, randomPositions(draw, 6, coordinates));
      case 2:
        return atRest(BOX, randomPositions(draw, 8, coordinates));
      default:
        return atRest(TETRAHEDRON, randomPositions(draw, 4, coordinates));
    }
  };
  StepBody body = part();
  for (int more = draw(-1, 2); more > 0; --more) {
    body = joined(body, part(), static_cast<std::size_t>(std::max(0, draw(-2, 2))));
  }
  body.t1 = randomMotion(draw, body.t0, coordinates);
  return body;
}

}  // namespace test
}  // namespace dccd
