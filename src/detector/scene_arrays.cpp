#include "detector/scene_arrays.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace deformable_ccd {
namespace {

Vec3 centre(const Positions& x, const Index* v, std::size_t n) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < n; ++i) sum += x[v[i]];
  return sum / static_cast<double>(n);
}

// Features of one kind in spatial order; `local` holds n x arity body-local vertices.
void buildTree(SceneBody& body, FeatureKind kind, const std::vector<Index>& local, std::size_t arity,
               const std::vector<Index>& rank_of_feature, const std::vector<Index>& internal_of_local,
               const Positions& rest) {
  const std::size_t n = local.size() / arity;
  std::vector<Vec3> centres(n);
  for (std::size_t f = 0; f < n; ++f) centres[f] = centre(rest, local.data() + f * arity, arity);
  const std::vector<Index> order = spatialOrder(centres);
  std::vector<Index> features(n * arity), ranks(n);
  for (std::size_t slot = 0; slot < n; ++slot) {
    for (std::size_t k = 0; k < arity; ++k) {
      features[slot * arity + k] = internal_of_local[local[order[slot] * arity + k]];
    }
    ranks[slot] = rank_of_feature[order[slot]];
  }
  body.trees[static_cast<int>(kind)].build(std::move(features), arity);
  body.ranks[static_cast<int>(kind)] = std::move(ranks);
}

// a - b as an unevaluated sum without error (Knuth's two-sum); not finite when it overflows.
struct ExactDifference {
  double high, low;
  friend bool operator==(const ExactDifference& x, const ExactDifference& y) { return x.high == y.high && x.low == y.low; }
};
ExactDifference exactDifference(double a, double b) {
  const double high = a - b, virtual_b = a - high, virtual_a = high + virtual_b;
  return {high, (a - virtual_a) + (virtual_b - b)};
}

bool sameDisplacement(const VertexMotion* vertices, std::size_t n) {
  for (std::size_t i = 1; i < n; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      if (!(exactDifference(vertices[i].t1[axis], vertices[i].t0[axis]) ==
            exactDifference(vertices[0].t1[axis], vertices[0].t0[axis]))) {
        return false;
      }
    }
  }
  return n > 0;
}

std::vector<Index> consecutive(std::size_t n, Index first) {
  std::vector<Index> v(n);
  std::iota(v.begin(), v.end(), first);
  return v;
}

}  // namespace

void SceneArrays::setBodies(std::vector<BodySetup> setups, const std::vector<const Positions*>& rest_positions) {
  if (setups.size() != rest_positions.size()) {
    throw std::invalid_argument("setBodies: " + std::to_string(setups.size()) + " bodies but " +
                                std::to_string(rest_positions.size()) + " rest positions");
  }
  if (setups.size() >= OBSTACLE_BODY) {
    throw std::invalid_argument("setBodies: " + std::to_string(setups.size()) + " bodies; at most 65534 are possible");
  }
  for (std::size_t b = 0; b < setups.size(); ++b) {
    const BodySetup& s = setups[b];
    if (!s.topology) throw std::invalid_argument("setBodies: body '" + s.name + "' has no topology");
    const std::size_t n = s.topology->vertexCount();
    if (!rest_positions[b] || rest_positions[b]->size() != n) {
      throw std::invalid_argument("setBodies: body '" + s.name + "' needs " + std::to_string(n) + " rest positions");
    }
    if (!s.vertex_active.empty() && s.vertex_active.size() != n) {
      throw std::invalid_argument("setBodies: body '" + s.name + "' has " + std::to_string(s.vertex_active.size()) +
                                  " activity flags for " + std::to_string(n) + " vertices");
    }
    if (!(s.minimum_separation_m >= 0) || !std::isfinite(s.minimum_separation_m)) {
      throw std::invalid_argument("setBodies: body '" + s.name + "' has minimum_separation_m = " +
                                  std::to_string(s.minimum_separation_m) + "; it must be finite and not negative");
    }
  }
  bodies_.clear();
  bodies_.resize(setups.size());
  face_order_.clear();
  vertex_count_ = 0;
  height_ = 2;
  largest_separation_ = 0;
  Index vertex_begin = 0, edge_begin = 0, face_begin = 0;
  for (std::size_t b = 0; b < setups.size(); ++b) {
    SceneBody& body = bodies_[b];
    body.setup = std::move(setups[b]);
    const Topology& t = *body.setup.topology;
    const Positions& rest = *rest_positions[b];
    body.vertex_begin = vertex_begin;
    body.edge_begin = edge_begin;
    body.face_begin = face_begin;
    body.internal_begin = static_cast<Index>(vertex_count_);
    largest_separation_ = std::max(largest_separation_, body.setup.minimum_separation_m);

    const std::vector<Index>& used = t.usedVertices();
    std::vector<Vec3> centres(used.size());
    for (std::size_t i = 0; i < used.size(); ++i) centres[i] = rest[used[i]];
    const std::vector<Index> order = spatialOrder(centres);
    body.slot_vertex.resize(used.size());
    std::vector<Index> internal_of_local(t.vertexCount(), NO_INDEX), vertex_ranks(used.size());
    for (std::size_t i = 0; i < used.size(); ++i) {
      body.slot_vertex[i] = used[order[i]];
      internal_of_local[used[order[i]]] = static_cast<Index>(vertex_count_ + i);
      vertex_ranks[i] = vertex_begin + used[order[i]];
    }
    body.active.assign(used.size(), 1);
    body.trees[static_cast<int>(FeatureKind::VERTEX)].build(consecutive(used.size(), body.internal_begin), 1);
    body.ranks[static_cast<int>(FeatureKind::VERTEX)] = std::move(vertex_ranks);

    std::vector<Index> flat(2 * t.edges().size());
    for (std::size_t e = 0; e < t.edges().size(); ++e) std::copy(t.edges()[e].begin(), t.edges()[e].end(), &flat[2 * e]);
    buildTree(body, FeatureKind::EDGE, flat, 2, consecutive(t.edges().size(), edge_begin), internal_of_local, rest);

    // Faces keep the input's vertex order; their rank is that of the index triple.
    std::vector<Index> by_triple = consecutive(t.faces().size(), 0);
    std::sort(by_triple.begin(), by_triple.end(), [&](Index x, Index y) { return t.faces()[x] < t.faces()[y]; });
    std::vector<Index> face_ranks(t.faces().size());
    for (std::size_t r = 0; r < by_triple.size(); ++r) face_ranks[by_triple[r]] = static_cast<Index>(face_begin + r);
    face_order_.insert(face_order_.end(), by_triple.begin(), by_triple.end());
    flat.resize(3 * t.faces().size());
    for (std::size_t f = 0; f < t.faces().size(); ++f) std::copy(t.faces()[f].begin(), t.faces()[f].end(), &flat[3 * f]);
    buildTree(body, FeatureKind::FACE, flat, 3, face_ranks, internal_of_local, rest);

    for (const ClusterTree& tree : body.trees) height_ = std::max(height_, tree.height());
    vertex_count_ += used.size();
    vertex_begin += static_cast<Index>(t.vertexCount());
    edge_begin += static_cast<Index>(t.edges().size());
    face_begin += static_cast<Index>(t.faces().size());
  }
  for (SceneBody& body : bodies_) {
    for (ClusterTree& tree : body.trees) tree.raise(height_);
  }
  if (vertex_count_ > vertex_capacity_) {
    vertices_ = hwy::AllocateAligned<VertexMotion>(vertex_count_);
    if (!vertices_) throw std::bad_alloc();
    vertex_capacity_ = vertex_count_;
  }
  records_.resize(std::max<std::size_t>(vertex_count_, 1) * simd::RECORD);
  body_levels_.clear();
  body_bounds_.resize(std::max<std::size_t>(bodies_.size(), 1) * simd::AOS_SIZE);
  std::size_t groups = bodies_.size();
  do {
    groups = (groups + simd::GROUP - 1) / simd::GROUP;
    groups = std::max<std::size_t>(groups, 1);
    ClusterTree::Level level;
    level.groups = groups;
    level.soa.resize(groups * simd::SOA_SIZE);
    level.aos.resize(groups * simd::AOS_SIZE);
    body_levels_.push_back(std::move(level));
  } while (groups > 1);
}

void SceneArrays::record(const MotionStep& step, core::StepStats& stats) {
  if (step.bodies.size() != bodies_.size()) {
    throw std::invalid_argument("the step has " + std::to_string(step.bodies.size()) + " bodies, the detector " +
                                std::to_string(bodies_.size()));
  }
  const double inf = std::numeric_limits<double>::infinity();
  double low[8], high[8];
  std::fill_n(low, 8, inf);
  std::fill_n(high, 8, -inf);
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    SceneBody& body = bodies_[b];
    const BodyMotion& motion = step.bodies[b];
    const std::size_t n = body.setup.topology->vertexCount();
    if (!motion.t0 || !motion.t1 || motion.t0->size() != n || motion.t1->size() != n) {
      throw std::invalid_argument("body '" + body.setup.name + "' needs " + std::to_string(n) +
                                  " positions at t0 and t1, got " + std::to_string(motion.t0 ? motion.t0->size() : 0) +
                                  " and " + std::to_string(motion.t1 ? motion.t1->size() : 0));
    }
    const Vec3* x0 = motion.t0->data();
    const Vec3* x1 = motion.t1->data();
    bool changed = false, masked = false;
    std::uint64_t unchecked = 0;
    VertexMotion* out = vertices_.get() + body.internal_begin;
    std::size_t first_active = body.usedCount();
    for (std::size_t i = 0; i < body.usedCount(); ++i) {
      const Index v = body.slot_vertex[i];
      const Vec3 &p = x0[v], &q = x1[v];
      out[i] = {{p[0], p[1], p[2], 0}, {q[0], q[1], q[2], 0}};
      // A sum of finite terms times zero is zero; anything else is not (and is looked at more closely).
      const double probe = (p[0] * 0 + p[1] * 0 + p[2] * 0) + (q[0] * 0 + q[1] * 0 + q[2] * 0);
      const bool finite = probe == 0;
      unchecked += !finite;
      const bool active = finite && (body.setup.vertex_active.empty() || body.setup.vertex_active[v]);
      changed |= body.active[i] != static_cast<std::uint8_t>(active);
      body.active[i] = active;
      masked |= !active;
      if (active && first_active == body.usedCount()) first_active = i;
    }
    if (masked) {
      // What is left out must not widen the range of the records: it takes an active vertex's place.
      for (std::size_t i = 0; i < body.usedCount(); ++i) {
        if (!body.active[i]) out[i] = first_active < body.usedCount() ? out[first_active] : VertexMotion{};
      }
    }
    body.translates = !masked && sameDisplacement(out, body.usedCount());
    stats.unchecked_vertices += unchecked;
    if (changed || masked != body.masked) {
      // The mask is indexed by internal vertex number.
      const std::uint8_t* flags = masked ? body.active.data() - body.internal_begin : nullptr;
      for (ClusterTree& tree : body.trees) tree.mask(flags);
      body.masked = masked;
    }
    if (unchecked) {
      for (const Face& f : body.setup.topology->faces()) {
        const auto bad = [&](Index v) { return !x0[v].allFinite() || !x1[v].allFinite(); };
        stats.unchecked_faces += bad(f[0]) || bad(f[1]) || bad(f[2]);
      }
    }
    if (first_active < body.usedCount()) simd::projectionBounds(out->t0, body.usedCount(), low, high);
  }
  for (int d = 0; d < 8; ++d) {
    // Half ranges: a difference of finite doubles can overflow. Scale and unit only have to be positive and finite.
    const double range = high[d] / 2 - low[d] / 2;
    const bool usable = range > 0 && std::isfinite(low[d]) && std::isfinite(high[d]) && std::isfinite(2 * range);
    low_[d] = usable ? low[d] : 0;
    scale_[d] = usable ? std::min(simd::RECORD_RANGE / 2 / range, 1e300) : 0;
    unit_[d] = usable ? 2 * range / simd::RECORD_RANGE : inf;
  }
  if (largest_separation_ > 0) {
    for (int k = 0; k < 16; ++k) {
      const int d = k % 8;
      const double length = d < 3 ? 1.0 : 1.4142135623730952;  // rounded up
      // Half of the separation on either side, a unit for the truncation of both values, and the rounding of both sums.
      const double rounding = std::ldexp(std::max(std::abs(low[d]), std::abs(high[d])), -52) * scale_[d];
      const double units = std::ceil(0.5000001 * largest_separation_ * length * scale_[d] + rounding) + 1;
      margin_[k] = static_cast<std::int16_t>(scale_[d] > 0 ? std::min(units, 32766.0) : 0);
    }
  }
}

void SceneArrays::quantize(std::size_t first, std::size_t last) {
  simd::quantize(vertices_[first].t0, last - first, low_, scale_, records_.data() + first * simd::RECORD);
}

void SceneArrays::refitBodies() {
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    // The vertices' tree bounds the whole body; with a separation it is widened like the others.
    const ClusterTree& tree = bodies_[b].tree(FeatureKind::VERTEX);
    std::copy_n(tree.level(height_ - 1).aos.data(), simd::AOS_SIZE, body_bounds_.data() + b * simd::AOS_SIZE);
  }
  simd::buildUpper(body_bounds_.data(), bodies_.size(), body_levels_[0].soa.data(), body_levels_[0].aos.data());
  for (std::size_t l = 1; l < body_levels_.size(); ++l) {
    simd::buildUpper(body_levels_[l - 1].aos.data(), body_levels_[l - 1].groups, body_levels_[l].soa.data(),
                     body_levels_[l].aos.data());
  }
}

void SceneArrays::overlappingBodies(bool t0_only, std::vector<std::uint32_t>& pairs,
                                    std::vector<std::uint32_t>& scratch) const {
  pairs.assign({0, 0});
  for (std::size_t l = body_levels_.size(); l-- > 0;) {
    const simd::GroupsView view = body_levels_[l].view();
    scratch.clear();
    std::size_t done = 0;
    while (done < pairs.size() / 2) {
      constexpr std::size_t STEP = 4096;
      const std::size_t used = scratch.size();
      scratch.resize(used + 2 * STEP);
      std::size_t consumed = 0;
      const std::size_t found = simd::testGroupPairs(
          view, view, pairs.data() + 2 * done, pairs.size() / 2 - done, true,
          l > 0 ? simd::Diagonal::UPPER_WITH_DIAGONAL : simd::Diagonal::STRICT_UPPER, t0_only, scratch.data() + used, STEP,
          &consumed);
      scratch.resize(used + 2 * found);
      done += consumed;
    }
    std::swap(pairs, scratch);
  }
  for (std::size_t p = 0; p < pairs.size(); p += 2) {
    if (pairs[p] > pairs[p + 1]) std::swap(pairs[p], pairs[p + 1]);
  }
}

void SceneArrays::featureVertices(FeatureKind kind, std::size_t body_index, Index rank, Index* out) const {
  const SceneBody& body = bodies_[body_index];
  if (kind == FeatureKind::VERTEX) {
    *out = rank - body.vertex_begin;
  } else if (kind == FeatureKind::EDGE) {
    const Edge& e = body.setup.topology->edges()[rank - body.edge_begin];
    std::copy(e.begin(), e.end(), out);
  } else {
    const Face& face = body.setup.topology->faces()[face_order_[rank]];
    std::copy(face.begin(), face.end(), out);
  }
}

std::size_t SceneArrays::memoryBytes() const {
  std::size_t bytes = vertex_capacity_ * sizeof(VertexMotion) + records_.capacityBytes() + face_order_.capacity() * sizeof(Index);
  for (const SceneBody& b : bodies_) {
    for (const ClusterTree& t : b.trees) bytes += t.memoryBytes();
    for (const auto& r : b.ranks) bytes += r.capacity() * sizeof(Index);
    bytes += b.slot_vertex.capacity() * sizeof(Index) + b.active.capacity();
  }
  return bytes;
}

}  // namespace deformable_ccd
