#include "support/step_support.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <sstream>

#include "dccd/monitor_extras.h"

namespace dccd {
namespace test {
namespace {

constexpr double LARGEST = 1.7e308;

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
