#include "support/steps.h"

#include <stdexcept>

#include "paper/feature_ownership.h"
#include "support/data.h"
#include "support/scene_data.h"

namespace dccd {
namespace benchmarks {
namespace {

bool isReal(const std::string& name) { return name == "cloth-ball" || name == "n-body"; }

void addBody(SceneBodies& scene, Topology topology, Index offset, bool self) {
  scene.triangle_count += topology.faces().size();
  scene.topologies.push_back(std::move(topology));
  scene.bodies.push_back({nullptr, offset, self, true});
}

void finish(SceneBodies& scene) {
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) scene.bodies[i].topology = &scene.topologies[i];
}

/// One body, or one body for each connected part.
SceneBodies realBodies(const test::SceneData& data, bool self) {
  SceneBodies scene;
  scene.vertex_count = data.vertices.size();
  const Topology whole = Topology::fromTriangles(data.vertices.size(), data.faces);
  if (self) {
    addBody(scene, whole, 0, true);
  } else {
    const std::vector<Index> part = connectedParts(ownedPrimitives(whole));
    std::vector<std::vector<Face>> faces;
    for (std::size_t f = 0; f < whole.faces().size(); ++f) {
      if (part[f] >= faces.size()) faces.resize(part[f] + 1);
      faces[part[f]].push_back(whole.faces()[f]);
    }
    for (const std::vector<Face>& own : faces) {
      addBody(scene, Topology::fromTriangles(data.vertices.size(), own), 0, false);
    }
  }
  finish(scene);
  return scene;
}

void forRealStep(const SceneRequest& request, const std::function<void(const SceneBodies&, const Step&)>& set_up,
                 const std::function<void(const Step&)>& visit) {
  if (test::dataDir().empty()) throw std::runtime_error("no data with truth: " + test::dataDirHint());
  const test::SceneData data = test::readScene(request.name);
  const SceneBodies scene = realBodies(data, request.self);
  Step step;
  step.vertices = data.vertices;
  step.has_truth = true;
  std::vector<Index> body_of(scene.vertex_count, 0);
  for (std::size_t b = 0; b < scene.topologies.size(); ++b) {
    for (Index v : scene.topologies[b].usedVertices()) body_of[v] = static_cast<Index>(b);
  }
  const auto add = [&](const std::vector<test::TruthPair>& pairs, std::size_t first_count, std::vector<Quad>& out) {
    for (const test::TruthPair& t : pairs) {
      const bool same_body = body_of[t.pair[0]] == body_of[t.pair[first_count]];
      if (t.contact && (request.self || !same_body)) out.push_back(t.pair);
    }
  };
  add(data.vertex_face, 1, step.true_contacts[0]);
  add(data.edge_edge, 2, step.true_contacts[1]);
  set_up(scene, step);
  visit(step);
}

void forGeneratedSteps(const SceneRequest& request, const std::function<void(const SceneBodies&, const Step&)>& set_up,
                       const std::function<void(const Step&)>& visit) {
  const auto sequence = test::generateSequence(test::generatedKindFromString(request.name), request.options);
  SceneBodies bodies;
  for (const test::GeneratedBody& b : sequence->bodies()) {
    addBody(bodies, b.topology, b.vertex_offset, request.self && b.deforms);
  }
  finish(bodies);
  bodies.vertex_count = sequence->positions().size();
  const std::size_t last = sequence->frameCount() - 1;
  const std::size_t first = std::min(request.first_frame, last - 1);
  const std::size_t count = request.steps == 0 ? last - first : std::min(request.steps, last - first);
  for (std::size_t i = 0; i < count; ++i) {
    sequence->advanceTo(first + i * (last - first) / count);
    const Positions t0 = sequence->positions();
    Step step;
    step.frame = sequence->frame();
    sequence->advance();
    step.vertices = vertexMotions(t0, sequence->positions());
    if (i == 0) set_up(bodies, step);
    visit(step);
  }
}

}  // namespace

std::vector<VertexMotion> vertexMotions(const Positions& t0, const Positions& t1) {
  std::vector<VertexMotion> vertices(t0.size(), VertexMotion{});
  for (std::size_t i = 0; i < t0.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      vertices[i].t0[k] = t0[i][k];
      vertices[i].t1[k] = t1[i][k];
    }
  }
  return vertices;
}

void forEachStep(const SceneRequest& request, const std::function<void(const SceneBodies&, const Step&)>& set_up,
                 const std::function<void(const Step&)>& visit) {
  (isReal(request.name) ? forRealStep : forGeneratedSteps)(request, set_up, visit);
}

Step subStep(const Step& step, std::size_t k, std::size_t n) {
  if (n == 1) return step;
  Step part;
  part.frame = step.frame;
  part.vertices = step.vertices;
  const auto at = [n](double x0, double x1, std::size_t i) {
    return i == 0 ? x0 : i == n ? x1 : x0 + (x1 - x0) * (static_cast<double>(i) / static_cast<double>(n));
  };
  for (std::size_t v = 0; v < part.vertices.size(); ++v) {
    for (int c = 0; c < 3; ++c) {
      part.vertices[v].t0[c] = at(step.vertices[v].t0[c], step.vertices[v].t1[c], k);
      part.vertices[v].t1[c] = at(step.vertices[v].t0[c], step.vertices[v].t1[c], k + 1);
    }
  }
  return part;
}

}  // namespace benchmarks
}  // namespace dccd
