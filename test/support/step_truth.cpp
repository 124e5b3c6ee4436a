#include "support/step_truth.h"

#include <algorithm>
#include <map>
#include <set>

#include "oracle/exact_inside.h"

namespace dccd {
namespace test {
namespace {

bool isActive(const StepBody& body, const Index* feature, int arity) {
  for (int i = 0; i < arity; ++i) {
    const Index v = feature[i];
    if (!body.t0[v].allFinite() || !body.t1[v].allFinite()) return false;
    if (!body.vertex_active.empty() && !body.vertex_active[v]) return false;
  }
  return true;
}

// Comparing doubles is exact, so this is, too; it spares the oracle most of its work.
bool apartOnAnAxis(const PairMotion& pair, int first_count) {
  for (int k = 0; k < 3; ++k) {
    bool above = true, below = true;
    for (int t = 0; t < 2; ++t) {
      for (int i = 0; i < first_count; ++i) {
        for (int j = first_count; j < 4; ++j) {
          above &= pair.x[t][i][k] > pair.x[t][j][k];
          below &= pair.x[t][i][k] < pair.x[t][j][k];
        }
      }
    }
    if (above || below) return true;
  }
  return false;
}

bool shareVertex(const Index* a, int na, const Index* b, int nb) {
  for (int i = 0; i < na; ++i) {
    if (std::find(b, b + nb, a[i]) != b + nb) return true;
  }
  return false;
}

class TruthCollector {
 public:
  explicit TruthCollector(const TestStep& step) : step_(step) {}

  void add(PairKind kind, std::size_t body_a, const Index* a, int na, std::size_t body_b, const Index* b, int nb) {
    if (body_a == body_b && shareVertex(a, na, b, nb)) return;
    if (!isActive(step_.bodies[body_a], a, na) || !isActive(step_.bodies[body_b], b, nb)) return;
    Contact contact;
    contact.kind = kind;
    contact.body = {static_cast<std::uint16_t>(body_a), static_cast<std::uint16_t>(body_b)};
    std::copy_n(a, na, contact.vertex.begin());
    std::copy_n(b, nb, contact.vertex.begin() + na);
    const PairMotion pair = motionOf(step_, contact);
    if (apartOnAnAxis(pair, na)) return;
    if (auto toc = firstContact(kind, pair)) found_.push_back({contact, *toc});
  }

  void addPairs(std::size_t a, std::size_t b) {
    const Topology &ta = step_.bodies[a].topology, &tb = step_.bodies[b].topology;
    for (const Index v : ta.usedVertices()) {
      for (const Face& f : tb.faces()) add(PairKind::VERTEX_FACE, a, &v, 1, b, f.data(), 3);
    }
    if (a > b) return;
    for (const Edge& e : ta.edges()) {
      for (const Edge& g : tb.edges()) {
        if (a != b || e < g) add(PairKind::EDGE_EDGE, a, e.data(), 2, b, g.data(), 2);
      }
    }
  }

  std::vector<TrueContact> sorted() {
    std::sort(found_.begin(), found_.end(),
              [](const TrueContact& x, const TrueContact& y) { return canonicalLess(x.contact, y.contact); });
    return std::move(found_);
  }

 private:
  const TestStep& step_;
  std::vector<TrueContact> found_;
};

bool arePaired(const TestStep& step, std::size_t a, std::size_t b) {
  if (a == b) return step.bodies[a].self_collision;
  return step.bodies[a].against_bodies && step.bodies[b].against_bodies;
}

/// Straight from the definition: no edge has an odd number of faces.
bool isClosed(const std::vector<Face>& faces) {
  std::map<Edge, int> faces_at;
  for (const Face& f : faces) {
    for (int i = 0; i < 3; ++i) ++faces_at[{std::min(f[i], f[(i + 1) % 3]), std::max(f[i], f[(i + 1) % 3])}];
  }
  const auto odd = [](const auto& edge) { return edge.second % 2 != 0; };
  return !faces_at.empty() && std::none_of(faces_at.begin(), faces_at.end(), odd);
}

/// The faces with one vertex for all that are at one place at both ends of the step; each of them once, none without
/// three corners.
std::vector<Face> mergedFaces(const StepBody& body) {
  std::map<std::vector<double>, Index> vertex_at;
  std::map<std::set<Index>, Face> faces;
  for (Face f : body.topology.faces()) {
    for (Index& v : f) {
      const Vec3 &p = body.t0[v], &q = body.t1[v];
      v = vertex_at.try_emplace({p[0], p[1], p[2], q[0], q[1], q[2]}, v).first->second;
    }
    const std::set<Index> corners(f.begin(), f.end());
    if (corners.size() == 3) faces.try_emplace(corners, f);
  }
  std::vector<Face> merged;
  for (const auto& one : faces) merged.push_back(one.second);
  return merged;
}

/// The faces of those parts, joined by vertices, that are closed: by walking from face to face.
std::vector<Face> closedParts(std::vector<Face> left) {
  std::vector<Face> found;
  while (!left.empty()) {
    std::vector<Face> part{left.back()}, others;
    left.pop_back();
    for (std::size_t i = 0; i < part.size(); ++i) {
      others.clear();
      for (const Face& f : left) {
        const bool meets = std::any_of(
            f.begin(), f.end(), [&, at = part[i]](Index v) { return std::find(at.begin(), at.end(), v) != at.end(); });
        (meets ? part : others).push_back(f);
      }
      left = others;
    }
    if (isClosed(part)) found.insert(found.end(), part.begin(), part.end());
  }
  return found;
}

/// The faces that enclose space: all, also where vertices are merged, or else those of the parts that are closed; none
/// where a vertex does not count.
std::vector<Face> enclosingFaces(const StepBody& body) {
  for (const Face& f : body.topology.faces()) {
    if (!isActive(body, f.data(), 3)) return {};
  }
  if (body.shell) return {};
  if (isClosed(body.topology.faces())) return body.topology.faces();
  const std::vector<Face> merged = mergedFaces(body);
  return isClosed(merged) ? merged : closedParts(body.topology.faces());
}

/// Of the vertices that edges join the one with the smallest number, for each piece; ascending.
std::vector<Index> firstOfPieces(const StepBody& body) {
  std::vector<Index> first(body.t0.size());
  for (Index v = 0; v < first.size(); ++v) first[v] = v;
  for (bool changed = true; changed;) {
    changed = false;
    for (const Edge& e : body.topology.edges()) {
      if (!isActive(body, e.data(), 2) || first[e[0]] == first[e[1]]) continue;
      first[e[0]] = first[e[1]] = std::min(first[e[0]], first[e[1]]);
      changed = true;
    }
  }
  std::vector<Index> pieces;
  for (const Index v : body.topology.usedVertices()) {
    if (first[v] == v && isActive(body, &v, 1)) pieces.push_back(v);
  }
  return pieces;
}

}  // namespace

std::vector<TrueContact> trueContacts(const TestStep& step) {
  TruthCollector collector(step);
  for (std::size_t a = 0; a < step.bodies.size(); ++a) {
    for (std::size_t b = 0; b < step.bodies.size(); ++b) {
      if (arePaired(step, a, b)) collector.addPairs(a, b);
    }
  }
  return collector.sorted();
}

bool trulyMeet(const Vec3& p, const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c) {
  PairMotion pair;
  const Vec3* points[2][4] = {{&p, &a, &b, &c}, {&q, &a, &b, &c}};
  for (int t = 0; t < 2; ++t) {
    for (int i = 0; i < 4; ++i) std::copy_n(points[t][i]->data(), 3, pair.x[t][i]);
  }
  return !apartOnAnAxis(pair, 1) && firstContact(PairKind::VERTEX_FACE, pair).has_value();
}

std::vector<StartIntersection> trueIntersections(const TestStep& step) {
  std::vector<StartIntersection> found;
  for (std::size_t a = 0; a < step.bodies.size(); ++a) {
    const StepBody& edge_body = step.bodies[a];
    for (const Edge& e : edge_body.topology.edges()) {
      if (!isActive(edge_body, e.data(), 2)) continue;
      for (std::size_t b = 0; b < step.bodies.size(); ++b) {
        if (!arePaired(step, a, b)) continue;
        const StepBody& face_body = step.bodies[b];
        std::vector<Face> faces = face_body.topology.faces();
        std::sort(faces.begin(), faces.end());
        for (const Face& f : faces) {
          if (!isActive(face_body, f.data(), 3) || (a == b && shareVertex(e.data(), 2, f.data(), 3))) continue;
          if (!trulyMeet(edge_body.t0[e[0]], edge_body.t0[e[1]], face_body.t0[f[0]], face_body.t0[f[1]],
                         face_body.t0[f[2]])) {
            continue;
          }
          found.push_back(
              {{static_cast<std::uint16_t>(a), static_cast<std::uint16_t>(b)}, {e[0], e[1], f[0], f[1], f[2]}});
        }
      }
    }
  }
  return found;
}

std::vector<StartIntersection> trueInsides(const TestStep& step) {
  std::vector<StartIntersection> found;
  for (std::size_t a = 0; a < step.bodies.size(); ++a) {
    for (const Index v : firstOfPieces(step.bodies[a])) {
      for (std::size_t b = 0; b < step.bodies.size(); ++b) {
        if (a == b || !arePaired(step, a, b)) continue;
        std::vector<std::array<Vec3, 3>> faces;
        for (const Face& f : enclosingFaces(step.bodies[b])) {
          const Positions& x = step.bodies[b].t0;
          faces.push_back({x[f[0]], x[f[1]], x[f[2]]});
        }
        if (faces.empty() || !isInSolid(step.bodies[a].t0[v], faces)) continue;
        found.push_back({{static_cast<std::uint16_t>(a), static_cast<std::uint16_t>(b)},
                         {v, NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX}});
      }
    }
  }
  return found;
}

std::vector<StartIntersection> trueStart(const TestStep& step) {
  std::vector<StartIntersection> found = trueIntersections(step);
  for (const StartIntersection& one : trueInsides(step)) found.push_back(one);
  return found;
}

}  // namespace test
}  // namespace dccd
