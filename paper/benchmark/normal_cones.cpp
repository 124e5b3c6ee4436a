#include "paper/benchmark/normal_cones.h"

#include <algorithm>

namespace dccd {
namespace benchmarks {
namespace {

/// Of vertices in any order; two faces of the same three vertices are one.
std::uint64_t keyOf(const Index* vertices, std::size_t count, Index first) {
  std::uint64_t v[3] = {};
  for (std::size_t i = 0; i < count; ++i) v[i] = vertices[i] - first + 1;
  std::sort(v, v + 3);
  return (v[0] << 42) | (v[1] << 21) | v[2];
}

Body bodyAt(Body body, const Step& step, Index first, Index last) {
  Positions t0, t1;
  for (Index i = first; i < last; ++i) {
    const VertexMotion& v = step.vertices[i];
    t0.emplace_back(v.t0[0], v.t0[1], v.t0[2]);
    t1.emplace_back(v.t1[0], v.t1[1], v.t1[2]);
  }
  body.t0 = share(std::move(t0));
  body.t1 = share(std::move(t1));
  return body;
}

}  // namespace

void NormalCones::setBodies(const SceneBodies& scene, const Step& guide) {
  surfaces_.clear();
  surface_of_.assign(scene.vertex_count, NO_INDEX);
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    if (!scene.bodies[b].self) continue;
    Surface& surface = surfaces_.emplace_back();
    surface.first = scene.bodies[b].vertex_offset;
    surface.last = surface.first + static_cast<Index>(scene.topologies[b].vertexCount());
    if (surface.last - surface.first >= (1u << 21) - 1)
      throw std::runtime_error("more vertices than keys have room for");
    surface.body.name = "surface";
    surface.body.topology = std::make_shared<const Topology>(scene.topologies[b]);
    surface.scene.setBodies({bodyAt(surface.body, guide, surface.first, surface.last)});
    const SceneBody& body = surface.scene.bodies()[0];
    surface.unfolded.emplace_back(body);
    for (const FeatureKind kind : {FeatureKind::VERTEX, FeatureKind::EDGE, FeatureKind::FACE}) {
      for (std::size_t slot = 0; slot < body.tree(kind).featureCount(); ++slot) {
        Index v[3];
        surface.scene.featureVertices(kind, 0, body.rank(kind)[slot], v);
        surface.clusters[static_cast<int>(kind)][keyOf(v, body.tree(kind).arity(), 0)] =
            static_cast<Index>(slot / simd::GROUP);
      }
    }
    std::fill(surface_of_.begin() + surface.first, surface_of_.begin() + surface.last,
              static_cast<Index>(surfaces_.size() - 1));
  }
}

void NormalCones::certify(const Step& step) {
  for (Surface& surface : surfaces_) {
    dccd::Step moved;
    moved.bodies.push_back(bodyAt(surface.body, step, surface.first, surface.last));
    StepStats stats;
    surface.scene.record(moved, stats);
    surface.unfolded[0].run(surface.scene.bodies()[0], surface.scene.vertices());
  }
}

std::size_t NormalCones::keep(PairKind kind, const Quad* pairs, std::size_t count, Quad* out) const {
  const std::size_t first_count = factsOf(kind).vertices[0], second_count = factsOf(kind).vertices[1];
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Quad& pair = pairs[i];
    const Index owner = surface_of_[pair[0]];
    bool left_out = false;
    if (owner != NO_INDEX && owner == surface_of_[pair[first_count]]) {
      const Surface& surface = surfaces_[owner];
      const PartsOfGroups* first = surface.unfolded[0].parts(firstKind(kind));
      if (first) {
        const auto clusterOf = [&](FeatureKind feature, const Index* vertices, std::size_t n) {
          return surface.clusters[static_cast<int>(feature)].at(keyOf(vertices, n, surface.first));
        };
        left_out = first->isLeftOut(0, *surface.unfolded[0].parts(secondKind(kind)),
                                    clusterOf(firstKind(kind), &pair[0], first_count),
                                    clusterOf(secondKind(kind), &pair[first_count], second_count));
      }
    }
    if (!left_out) out[kept++] = pair;
  }
  return kept;
}

}  // namespace benchmarks
}  // namespace dccd
