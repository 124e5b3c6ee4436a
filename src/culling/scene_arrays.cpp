#include "culling/scene_arrays.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "culling/large_arrays.h"
#include "dccd/tolerances.h"

namespace dccd {
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

std::vector<Index> consecutive(std::size_t n, Index first) {
  std::vector<Index> v(n);
  std::iota(v.begin(), v.end(), first);
  return v;
}

/// Throws std::invalid_argument naming the body and what of it does not fit.
void check(const Body& body, std::size_t bodies) {
  const auto refuse = [&](const std::string& what) { throw std::invalid_argument("body '" + body.name + "' " + what); };
  if (!body.topology) refuse("has no topology");
  const std::size_t n = body.topology->vertexCount();
  if (!body.t0 || !body.t1 || body.t0->size() != n || body.t1->size() != n) {
    refuse("needs " + std::to_string(n) + " positions at t0 and t1, got " +
           std::to_string(body.t0 ? body.t0->size() : 0) + " and " + std::to_string(body.t1 ? body.t1->size() : 0));
  }
  for (const Index v : body.vertex_mask) {
    if (v < n) continue;
    throw std::invalid_argument("vertex_mask of body '" + body.name + "' names vertex " + std::to_string(v) +
                                ", but the mesh has " + std::to_string(n));
  }
  const auto check_separation = [&](double separation_m) {
    if (separation_m >= 0 && std::isfinite(separation_m)) return;
    refuse("has minimum_separation_m = " + std::to_string(separation_m) + "; it must be finite and not negative");
  };
  check_separation(body.minimum_separation_m);
  for (const SeparationFrom& from : body.separations) {
    check_separation(from.separation_m);
    if (from.body < bodies || from.body == OBSTACLE_BODY) continue;
    refuse("has a separation from body " + std::to_string(from.body) + "; there are " + std::to_string(bodies));
  }
  const auto& apart = body.not_against;
  const bool ascending = std::is_sorted(apart.begin(), apart.end());
  if (!ascending || (!apart.empty() && apart.back() >= bodies)) {
    refuse("lists bodies that it is not tested against; they must ascend, and there are " + std::to_string(bodies));
  }
  if (body.reference && body.reference->size() != n) {
    refuse("needs " + std::to_string(n) + " positions in its reference frame, got " +
           std::to_string(body.reference->size()));
  }
}

bool isSet(const SceneBody& set, const Body& body) { return sameBody(set.setup, body); }

}  // namespace

bool SceneArrays::holds(const std::vector<Body>& bodies) const {
  return std::equal(bodies_.begin(), bodies_.end(), bodies.begin(), bodies.end(), isSet);
}

std::size_t SceneArrays::setBodies(const std::vector<Body>& bodies) {
  if (bodies.size() >= OBSTACLE_BODY) {
    throw std::invalid_argument(std::to_string(bodies.size()) + " bodies; at most 65534 are possible");
  }
  for (const Body& body : bodies) check(body, bodies.size());
  const auto others = std::mismatch(bodies_.begin(), bodies_.end(), bodies.begin(), bodies.end(), isSet).first;
  const auto held = static_cast<std::size_t>(others - bodies_.begin());
  std::vector<SceneBody> made(bodies.size());  // resize() would ask old libraries' types to be copied
  std::move(bodies_.begin(), others, made.begin());
  bodies_.swap(made);
  vertex_count_ = 0;
  height_ = 2;
  Index vertex_begin = 0, edge_begin = 0, face_begin = 0;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    SceneBody& body = bodies_[b];
    const Topology& t = *bodies[b].topology;
    if (b >= held) {
      body.setup = bodies[b];
      body.setup.t0 = body.setup.t1 = nullptr;  // of this step alone
      body.setup.radius_m = nullptr;
      body.vertex_begin = vertex_begin;
      body.edge_begin = edge_begin;
      body.face_begin = face_begin;
      face_order_.resize(face_begin);
      buildTrees(body, *bodies[b].t0);
    }
    body.recorded = false;  // its vertices may be in another place, where there was no room
    for (const ClusterTree& tree : body.trees) height_ = std::max(height_, tree.height());
    vertex_count_ += body.usedCount();
    vertex_begin += static_cast<Index>(t.vertexCount());
    edge_begin += static_cast<Index>(t.edges().size());
    face_begin += static_cast<Index>(t.faces().size());
  }
  for (SceneBody& body : bodies_) {
    for (ClusterTree& tree : body.trees) tree.raise(height_);
  }
  range_padded_ = uncertain_ = bounds_valid_ = false;
  radii_.clear();
  setReaches();
  makeRoom();
  return held;
}

void SceneArrays::buildTrees(SceneBody& body, const Positions& rest) {
  const Topology& t = *body.setup.topology;
  if (!body.setup.vertex_mask.empty()) body.asked.assign(t.vertexCount(), 1);
  for (const Index v : body.setup.vertex_mask) body.asked[v] = 0;
  body.internal_begin = static_cast<Index>(vertex_count_);
  const std::vector<Index>& used = t.usedVertices();
  std::vector<Vec3> centres(used.size());
  for (std::size_t i = 0; i < used.size(); ++i) centres[i] = rest[used[i]];
  const std::vector<Index> order = spatialOrder(centres);
  body.slot_vertex.resize(used.size());
  std::vector<Index> internal_of_local(t.vertexCount(), NO_INDEX), vertex_ranks(used.size());
  for (std::size_t i = 0; i < used.size(); ++i) {
    body.slot_vertex[i] = used[order[i]];
    internal_of_local[used[order[i]]] = static_cast<Index>(vertex_count_ + i);
    vertex_ranks[i] = body.vertex_begin + used[order[i]];
  }
  body.active.assign(used.size(), 1);
  body.trees[static_cast<int>(FeatureKind::VERTEX)].build(consecutive(used.size(), body.internal_begin), 1);
  body.ranks[static_cast<int>(FeatureKind::VERTEX)] = std::move(vertex_ranks);

  std::vector<Index> flat(2 * t.edges().size());
  for (std::size_t e = 0; e < t.edges().size(); ++e) std::copy(t.edges()[e].begin(), t.edges()[e].end(), &flat[2 * e]);
  buildTree(body, FeatureKind::EDGE, flat, 2, consecutive(t.edges().size(), body.edge_begin), internal_of_local, rest);

  // Faces keep the input's vertex order; their rank is that of the index triple.
  std::vector<Index> by_triple = consecutive(t.faces().size(), 0);
  std::sort(by_triple.begin(), by_triple.end(), [&](Index x, Index y) { return t.faces()[x] < t.faces()[y]; });
  std::vector<Index> face_ranks(t.faces().size());
  for (std::size_t r = 0; r < by_triple.size(); ++r) {
    face_ranks[by_triple[r]] = static_cast<Index>(body.face_begin + r);
  }
  face_order_.insert(face_order_.end(), by_triple.begin(), by_triple.end());
  flat.resize(3 * t.faces().size());
  for (std::size_t f = 0; f < t.faces().size(); ++f) std::copy(t.faces()[f].begin(), t.faces()[f].end(), &flat[3 * f]);
  buildTree(body, FeatureKind::FACE, flat, 3, face_ranks, internal_of_local, rest);
}

void SceneArrays::makeRoom() {
  if (vertex_count_ > vertex_capacity_) {
    vertices_ = makeLarge<VertexMotion>(vertex_count_);
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

void SceneArrays::setReaches() {
  double between_meshes = 0;
  for (const SceneBody& body : bodies_) {
    between_meshes = std::max(between_meshes, body.setup.minimum_separation_m);
    for (const SeparationFrom& from : body.setup.separations) {
      if (from.body != OBSTACLE_BODY) between_meshes = std::max(between_meshes, from.separation_m);
    }
  }
  for (SceneBody& body : bodies_) body.reach_m = 0.5 * between_meshes;
}

double SceneArrays::separation(std::size_t a, std::size_t b) const {
  if (b == OBSTACLE_BODY) return separationFromMap(bodies_[a].setup);
  return separationBetween(bodies_[a].setup, a, bodies_[b].setup, b);
}

/// Of a direction in which the scene is small beside its coordinates, a record's roundings are no small part of a unit:
/// those of a sum, a difference and a product, each below 2^-53 of twice the size in that direction, of two numbers.
/// Together they are below 2^-49 of it, against a unit of at least 2^-17 of the range.
std::int32_t SceneArrays::endOf(double until) const {
  for (int d = 0; d < 8; ++d) {
    const double range = range_max_[d] - range_min_[d];
    const double size = std::max(std::abs(range_min_[d]), std::abs(range_max_[d]));
    if (scale_[d] > 0 && !(range > tolerance::RECORD_SMALLEST_RANGE * size)) return simd::WHOLE_STEP;
  }
  const bool widened =
      std::any_of(bodies_.begin(), bodies_.end(), [](const SceneBody& body) { return body.reach_m > 0; });
  if (widened || uncertain_ || !(until < 1)) return simd::WHOLE_STEP;
  return std::max(static_cast<std::int32_t>(std::ceil(until * simd::WHOLE_STEP)), 1);
}

bool SceneArrays::isStill(const SceneBody& body) const {
  if (body.usedCount() == 0) return true;
  const VertexMotion& first = vertices_[body.internal_begin];
  return body.translates && std::equal(first.t0, first.t0 + 3, first.t1);
}

/// By coordinates, which are projections without rounding.
bool SceneArrays::isFar(std::size_t b) const {
  const SceneBody& body = bodies_[b];
  if (uncertain_ || !keep_bounds_ || (body.kept && !body.stale)) return false;            // what is kept costs nothing
  const double reach_m = 2 * body.reach_m, up = std::numeric_limits<double>::infinity();  // of both bodies, all alike
  const auto below = [&](const SceneBody& one, const SceneBody& other) {
    for (int axis = 0; axis < 3; ++axis) {
      if (std::nextafter(one.bounds_max[axis] + reach_m, up) < other.bounds_min[axis]) return true;
    }
    return false;
  };
  for (std::size_t other = 0; other < bodies_.size(); ++other) {
    if (other == b || below(body, bodies_[other]) || below(bodies_[other], body)) continue;
    if (meet(body.setup, b, bodies_[other].setup, other)) return false;
  }
  return true;
}

void SceneArrays::refitBodies() {
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    // All three trees: a feature is widened by the largest radius of its vertices, which may lie in another group of
    // vertices than the feature's outermost one. An empty tree's bounds are neutral.
    std::uint16_t* bounds = body_bounds_.data() + b * simd::AOS_SIZE;
    std::fill_n(bounds, simd::AOS_SIZE, simd::EMPTY);
    if (bodies_[b].far) continue;
    for (const ClusterTree& tree : bodies_[b].trees) {
      const std::uint16_t* top = tree.level(height_ - 1).aos.data();
      for (std::size_t k = 0; k < simd::AOS_SIZE; ++k) bounds[k] = std::min(bounds[k], top[k]);
    }
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
      const std::size_t step = std::min<std::size_t>(4096, simd::GROUP * simd::GROUP * (pairs.size() / 2 - done));
      const std::size_t used = scratch.size();
      scratch.resize(used + 2 * step);
      std::size_t consumed = 0;
      const std::size_t found =
          simd::testGroupPairs(view, view, pairs.data() + 2 * done, pairs.size() / 2 - done, true,
                               l > 0 ? simd::Diagonal::UPPER_WITH_DIAGONAL : simd::Diagonal::STRICT_UPPER, t0_only,
                               scratch.data() + used, step, &consumed);
      scratch.resize(used + 2 * found);
      done += consumed;
    }
    std::swap(pairs, scratch);
  }
  for (std::size_t p = 0; p < pairs.size(); p += 2) {
    if (pairs[p] > pairs[p + 1]) std::swap(pairs[p], pairs[p + 1]);
  }
}

}  // namespace dccd
