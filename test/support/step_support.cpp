#include "support/step_support.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <random>
#include <sstream>

#include "dccd/simd_target.h"
#include "oracle/exact_inside.h"

namespace dccd {
namespace test {
namespace {

constexpr double LARGEST = 1.7e308;

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

/// Straight from the definition: no edge has an odd number of faces, and every vertex of a face counts.
bool enclosesSpace(const StepBody& body) {
  std::map<Edge, int> faces_at;
  for (const Face& f : body.topology.faces()) {
    if (!isActive(body, f.data(), 3)) return false;
    for (int i = 0; i < 3; ++i) ++faces_at[{std::min(f[i], f[(i + 1) % 3]), std::max(f[i], f[(i + 1) % 3])}];
  }
  const auto odd = [](const auto& edge) { return edge.second % 2 != 0; };
  return !body.shell && !faces_at.empty() && std::none_of(faces_at.begin(), faces_at.end(), odd);
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

double coordinate(const Draw& draw, Coordinates coordinates, int exponent, double offset) {
  switch (coordinates) {
    case Coordinates::FEW_BITS:
    case Coordinates::COINCIDENT:
      return std::ldexp(draw(-32, 32), exponent);
    case Coordinates::REAL:
    case Coordinates::LITTLE_MOTION:
      return draw(-1000000, 1000000) / 777777.0;
    case Coordinates::SUBNORMAL:
      return draw(-4, 4) * 4.9406564584124654e-324;
    case Coordinates::EXTREME:
      return draw(0, 3) == 0 ? draw(-3, 3) : draw(-4, 4) / 4.0 * LARGEST;
    default:
      return draw(-3, 3) + offset;
  }
}

}  // namespace

Draw drawFrom(std::uint64_t seed) {
  return [random = std::mt19937_64(seed)](int low, int high) mutable {
    // Not std::uniform_int_distribution: the same numbers on every library.
    return low + static_cast<int>(random() % static_cast<std::uint64_t>(high - low + 1));
  };
}

Step TestStep::motion() const {
  Step step;
  for (const StepBody& from : bodies) {
    Body body;
    body.name = "body_" + std::to_string(step.bodies.size());
    body.topology = share(from.topology);
    body.self_collision = from.self_collision;
    body.against_bodies = from.against_bodies;
    body.shell = from.shell;
    for (Index v = 0; v < from.vertex_active.size(); ++v) {
      if (!from.vertex_active[v]) body.vertex_mask.push_back(v);
    }
    step.bodies.push_back(moving(body, from.t0, from.t1));
  }
  return step;
}

TestStep TestStep::continued(std::vector<Positions> t1) const {
  TestStep next = *this;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    next.bodies[b].t0 = bodies[b].t1;
    next.bodies[b].t1 = std::move(t1[b]);
  }
  return next;
}

Topology randomTopology(const Draw& draw, int triangles) {
  const int shape = draw(0, 7);
  if (shape == 0) return Topology::polyline(static_cast<std::size_t>(draw(2, triangles + 2)));
  std::vector<Face> faces;
  int vertices = 0;
  if (shape <= 2) {  // a grid
    const int cols = draw(2, std::max(2, triangles / 2 + 1)), rows = std::max(2, triangles / (2 * (cols - 1)) + 1);
    if (2 * (cols - 1) * (rows - 1) <= std::max(2, triangles)) {
      return Topology::grid(static_cast<std::size_t>(rows), static_cast<std::size_t>(cols));
    }
  }
  if (shape <= 4) {  // a strip
    vertices = triangles + 2;
    for (int i = 0; i < triangles; ++i) faces.push_back({Index(i), Index(i + 1), Index(i + 2)});
  } else if (shape == 5) {  // single triangles
    vertices = 3 * triangles;
    for (int i = 0; i < triangles; ++i) faces.push_back({Index(3 * i), Index(3 * i + 1), Index(3 * i + 2)});
  } else {  // anything
    vertices = draw(3, 3 * triangles);
    for (int i = 0; i < triangles; ++i) {
      const int a = draw(0, vertices - 1), b = draw(0, vertices - 1), c = draw(0, vertices - 1);
      if (a != b && b != c && c != a) faces.push_back({Index(a), Index(b), Index(c)});
    }
  }
  return Topology::fromTriangles(static_cast<std::size_t>(vertices), faces);
}

Positions randomPositions(const Draw& draw, std::size_t count, Coordinates coordinates) {
  const int exponent = draw(-40, 40);
  const double offset = coordinates == Coordinates::HUGE_OFFSET ? std::ldexp(draw(-3, 3), draw(10, 52)) : 0;
  Positions positions(count);
  for (std::size_t i = 0; i < count; ++i) {
    for (int k = 0; k < 3; ++k) positions[i][k] = coordinate(draw, coordinates, exponent, offset);
    if (coordinates == Coordinates::FLAT) positions[i][2] = positions[0][2];
    if (coordinates == Coordinates::COINCIDENT && i > 0 && draw(0, 1) == 0) {
      positions[i] = positions[static_cast<std::size_t>(draw(0, static_cast<int>(i) - 1))];
    }
  }
  return positions;
}

Positions randomMotion(const Draw& draw, const Positions& t0, Coordinates coordinates) {
  if (coordinates == Coordinates::AT_REST) return t0;
  Positions t1 = t0;
  if (coordinates == Coordinates::LITTLE_MOTION) {
    const int exponent = draw(-60, -1);
    for (Vec3& x : t1) {
      for (int k = 0; k < 3; ++k) x[k] += std::ldexp(draw(-8, 8), exponent);
    }
    return t1;
  }
  if (coordinates == Coordinates::HUGE_OFFSET) {
    for (Vec3& x : t1) x += Vec3(draw(-3, 3), draw(-3, 3), draw(-3, 3));
    return t1;
  }
  return randomPositions(draw, t0.size(), coordinates);
}

TestStep randomStep(const Draw& draw, int triangles, Coordinates coordinates) {
  TestStep step;
  const int bodies = draw(0, 2) == 0 ? draw(2, 3) : 1;
  for (int b = 0; b < bodies; ++b) {
    StepBody body;
    body.topology = randomTopology(draw, std::max(1, triangles / bodies));
    body.t0 = randomPositions(draw, body.topology.vertexCount(), coordinates);
    body.t1 = randomMotion(draw, body.t0, coordinates);
    body.self_collision = draw(0, 3) != 0;
    body.against_bodies = draw(0, 5) != 0;
    if (draw(0, 5) == 0) {
      for (std::size_t v = 0; v < body.t0.size(); ++v) body.vertex_active.push_back(draw(0, 4) != 0);
    }
    step.bodies.push_back(std::move(body));
  }
  return step;
}

TestStep randomStep(const Draw& draw, int triangles) {
  return randomStep(draw, triangles, static_cast<Coordinates>(draw(0, static_cast<int>(Coordinates::COUNT) - 1)));
}

PairMotion motionOf(const TestStep& step, const Contact& contact) {
  PairMotion pair;
  const int first_count = contact.kind == PairKind::VERTEX_FACE ? 1 : 2;
  for (int i = 0; i < 4; ++i) {
    const StepBody& body = step.bodies[contact.body[i < first_count ? 0 : 1]];
    for (int k = 0; k < 3; ++k) {
      pair.x[0][i][k] = body.t0[contact.vertex[i]][k];
      pair.x[1][i][k] = body.t1[contact.vertex[i]][k];
    }
  }
  return pair;
}

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
        if (a == b || !arePaired(step, a, b) || !enclosesSpace(step.bodies[b])) continue;
        std::vector<std::array<Vec3, 3>> faces;
        for (const Face& f : step.bodies[b].topology.faces()) {
          const Positions& x = step.bodies[b].t0;
          faces.push_back({x[f[0]], x[f[1]], x[f[2]]});
        }
        if (!isInSolid(step.bodies[a].t0[v], faces)) continue;
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

bool operator==(const StartIntersection& x, const StartIntersection& y) {
  return x.body == y.body && x.vertex == y.vertex;
}

Outcome runOnce(const TestStep& step, const Options& options) { return Detector(options).run(step.motion()); }

TestStep crumpled(std::uint64_t seed, int bodies, std::size_t size) {
  const Draw draw = drawFrom(seed);
  TestStep step;
  for (int b = 0; b < bodies; ++b) {
    StepBody body;
    body.topology = Topology::grid(size, size);
    for (std::size_t i = 0; i < size * size; ++i) {
      const double x = static_cast<double>(i % size), y = static_cast<double>(i / size);
      body.t0.push_back(Vec3(x + draw(-9, 9) / 30.0, y + 0.4 * b, 1.5 * std::sin(x + b) * std::cos(y) + 0.8 * b));
      body.t1.push_back(body.t0.back() + Vec3(draw(-9, 9), draw(-9, 9), draw(-9, 9)) / 12.0);
    }
    step.bodies.push_back(body);
  }
  return step;
}

TestStep crossing() {
  TestStep step;
  StepBody a, b;
  a.topology = b.topology = Topology::fromTriangles(3, {{0, 1, 2}});
  a.t0 = a.t1 = {Vec3(0, 0, 0), Vec3(4, 0, 0), Vec3(0, 4, 0)};
  b.t0 = {Vec3(1, 1, 1), Vec3(2, 1, 3), Vec3(1, 2, 3)};
  b.t1 = b.t0;
  for (Vec3& x : b.t1) x[2] -= 2;
  step.bodies = {a, b};
  return step;
}

void forEachSimdTarget(const std::function<void(const std::string& target)>& body) {
  struct Undo {
    ~Undo() { setSimdTarget("auto"); }
  } undo;
  for (const std::string& target : simdTargets()) {
    setSimdTarget(target);
    body(target);
  }
}

std::string describe(const Contact& c) {
  std::ostringstream out;
  out.precision(17);
  out << toString(c.kind) << " bodies " << c.body[0] << ' ' << c.body[1] << " vertices";
  for (const Index v : c.vertex) out << ' ' << static_cast<std::int64_t>(v);
  out << " toc [" << c.toc_lower << ", " << c.toc_upper << ']'
      << (c.certainty == Certainty::CERTAIN ? "" : " undecided");
  return out.str();
}

std::string difference(const std::vector<Contact>& x, const std::vector<Contact>& y) {
  const auto same = [](const Contact& a, const Contact& b) {
    return std::memcmp(&a.toc_lower, &b.toc_lower, sizeof(double)) == 0 &&
           std::memcmp(&a.toc_upper, &b.toc_upper, sizeof(double)) == 0 && a.vertex == b.vertex && a.body == b.body &&
           a.voxel == b.voxel && a.voxel_size == b.voxel_size && a.kind == b.kind && a.certainty == b.certainty &&
           a.initial == b.initial && a.leaving == b.leaving;
  };
  for (std::size_t i = 0; i < std::min(x.size(), y.size()); ++i) {
    if (!same(x[i], y[i])) return "contact " + std::to_string(i) + ": " + describe(x[i]) + " / " + describe(y[i]);
  }
  if (x.size() == y.size()) return "";
  const Contact& more = x.size() > y.size() ? x[y.size()] : y[x.size()];
  return std::to_string(x.size()) + " / " + std::to_string(y.size()) + " contacts; only one has " + describe(more);
}

}  // namespace test
}  // namespace dccd
