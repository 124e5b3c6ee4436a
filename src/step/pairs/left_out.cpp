#include "step/pairs/left_out.h"

#include <algorithm>
#include <sstream>

#include "base/accuracy.h"
#include "step/history.h"
#include "step/pairs/closest_points.h"

namespace dccd {
namespace {

double segmentDistance(const Vec3& a0, const Vec3& a1, const Vec3& b0, const Vec3& b1) {
  const Closest closest = closestOnSegments(a0, a1, b0, b1);
  return (closest.on_first - closest.on_second).norm();
}

bool needsReference(const SceneArrays& scene, std::size_t b) {
  const Body& setup = scene.bodies()[b].setup;
  if (!setup.reference || !meetsItself(setup)) return false;
  const auto& radius = setup.reference->radius_m;
  return scene.separation(b, b) > 0 || std::any_of(radius.begin(), radius.end(), [](double r) { return r > 0; });
}

}  // namespace

double restDistance(PairKind kind, const std::array<Vec3, 4>& x) {
  if (kind == PairKind::EDGE_EDGE) return segmentDistance(x[0], x[1], x[2], x[3]);
  double distance = std::min({segmentDistance(x[0], x[0], x[1], x[2]), segmentDistance(x[0], x[0], x[2], x[3]),
                              segmentDistance(x[0], x[0], x[3], x[1])});
  const Vec3 normal = (x[2] - x[1]).cross(x[3] - x[1]);
  const auto inside = [&](const Vec3& a, const Vec3& b) { return (b - a).cross(x[0] - a).dot(normal) >= 0; };
  if (normal.squaredNorm() > 0 && inside(x[1], x[2]) && inside(x[2], x[3]) && inside(x[3], x[1])) {
    distance = std::min(distance, std::abs((x[0] - x[1]).dot(normal)) / normal.norm());
  }
  return distance;
}

void LeftOutOfBody::set(PairKind kind, const std::vector<LeftOutKey>& keys, Index first_rank, std::size_t count) {
  Table& table = tables_[static_cast<int>(kind)];
  table.first_rank = first_rank;
  table.begin.assign(keys.empty() ? 0 : count + 1, 0);
  table.partners.clear();
  table.partners.reserve(keys.size());
  table.distances_m.clear();
  table.distances_m.reserve(keys.size());
  for (const LeftOutKey& one : keys) {
    ++table.begin[static_cast<std::size_t>(one.key >> 32) - first_rank + 1];
    table.partners.push_back(static_cast<Index>(one.key));
    table.distances_m.push_back(one.distance_m);
  }
  for (std::size_t i = 1; i < table.begin.size(); ++i) table.begin[i] += table.begin[i - 1];
}

void LeftOut::find(const Step& step, const Prepared& prepared, SceneArrays& scene, PairSearch& pairs) {
  const std::size_t n = scene.bodies().size();
  of_body.assign(n, {});
  list.clear();
  distances_m.clear();
  Step rest = step;
  std::vector<std::size_t> asked;
  for (std::size_t b = 0; b < n; ++b) {
    Body& body = rest.bodies[b];
    body.radius_m = nullptr;
    body.t1 = body.t0;
    if (!needsReference(scene, b)) continue;
    asked.push_back(b);
    body.t0 = body.t1 = std::shared_ptr<const Positions>(body.reference, &body.reference->positions);
    if (body.reference->radius_m.empty()) continue;
    body.radius_m = std::shared_ptr<const std::vector<double>>(body.reference, &body.reference->radius_m);
  }
  if (asked.empty()) return;
  Findings found;
  scene.record(rest, found.stats);
  scene.refit([](std::size_t count, const auto& f) { f(0, count); }, found.stats);
  AccuracyOptions accuracy = prepared.options->accuracy;
  accuracy.rung = Accuracy::CONSERVATIVE;
  const std::unique_ptr<Rung> test = makeRung(accuracy);
  StepContext context;
  context.scene = &scene;
  context.elementary = test.get();
  context.tolerance_m = accuracy.tolerance_m;
  pairs.begin();
  pairs.runSelf(prepared, asked, context, found);  // beyond the limit a pair is not listed and keeps its separation
  for (const std::size_t b : asked) {
    for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) add(b, kind, scene, pairs);
  }
}

void LeftOut::add(std::size_t b, PairKind kind, const SceneArrays& scene, const PairSearch& pairs) {
  std::vector<LeftOutKey> keys;
  for (const PairWorker& w : pairs.workers()) {
    for (const Hit& hit : w.hits(kind)) {
      if ((hit.bodies >> 16) == b) keys.push_back({hit.key, 0});
    }
  }
  std::sort(keys.begin(), keys.end());
  const SceneBody& body = scene.bodies()[b];
  const Topology& topology = *body.setup.topology;
  const Positions& at = body.setup.reference->positions;
  const bool vertices = kind == PairKind::VERTEX_FACE;
  for (LeftOutKey& one : keys) {
    LeftOutPair pair;
    pair.kind = kind;
    pair.body = static_cast<std::uint16_t>(b);
    scene.featureVertices(firstKind(kind), b, static_cast<Index>(one.key >> 32), pair.vertex.data());
    scene.featureVertices(secondKind(kind), b, static_cast<Index>(one.key),
                          pair.vertex.data() + factsOf(kind).vertices[0]);
    one.distance_m =
        restDistance(kind, {at[pair.vertex[0]], at[pair.vertex[1]], at[pair.vertex[2]], at[pair.vertex[3]]});
    list.push_back(pair);
    distances_m.push_back(one.distance_m);
  }
  of_body[b].set(kind, keys, vertices ? body.vertex_begin : body.edge_begin,
                 vertices ? topology.vertexCount() : topology.edges().size());
}

void LeftOut::sayForNoise(const Step& step, const Options& options, const SceneArrays& scene,
                          std::vector<std::string>& unproved) const {
  if (list.empty() || !scene.uncertain()) return;
  std::vector<std::size_t> counts(step.bodies.size(), 0);
  std::vector<SeparationRule> rules;
  for (std::size_t b = 0; b < step.bodies.size(); ++b) {
    rules.emplace_back(scene, b, b, holdsDistance(options.accuracy.rung) ? options.accuracy.tolerance_m : 0);
    if (step.bodies[b].radius_m) rules.back().radii = step.bodies[b].radius_m->data();  // the list names its vertices
  }
  for (std::size_t i = 0; i < list.size(); ++i) {
    const LeftOutPair& pair = list[i];
    counts[pair.body] += rules[pair.body].of(pair.kind, pair.vertex, distances_m[i]).for_noise;
  }
  for (std::size_t b = 0; b < counts.size(); ++b) {
    if (counts[b] == 0) continue;
    const Body& body = step.bodies[b];
    std::ostringstream text;
    text << "body '" << body.name << "': " << counts[b]
         << " pairs of its own features are closer in its reference frame than its uncertainty (radii of up to "
         << *std::max_element(body.radius_m->begin(), body.radius_m->end())
         << " m) reaches, and were only checked for touching";
    unproved.push_back(text.str());
  }
}

}  // namespace dccd
