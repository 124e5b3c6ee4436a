#include "paper/benchmark/normal_cones.h"

namespace dccd {
namespace benchmarks {
namespace {

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
    surface.body.name = "surface";
    surface.body.topology = std::make_shared<const Topology>(scene.topologies[b]);
    surface.scene.setBodies({bodyAt(surface.body, guide, surface.first, surface.last)});
    surface.unfolded.emplace_back(surface.scene.bodies()[0]);
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
  const std::size_t second = factsOf(kind).vertices[0];
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Index owner = surface_of_[pairs[i][0]];
    const bool of_one = owner != NO_INDEX && owner == surface_of_[pairs[i][second]];
    if (!of_one || !surfaces_[owner].unfolded[0].isCertified()) out[kept++] = pairs[i];
  }
  return kept;
}

}  // namespace benchmarks
}  // namespace dccd
