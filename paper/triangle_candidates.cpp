#include "paper/triangle_candidates.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "paper/simd/paper_tree.h"

namespace dccd {
namespace {

constexpr std::size_t LEAF_PAIRS = 4096;  // per call of the descent: 32 KiB, half of a first-level cache
constexpr std::size_t MAX_PAIRS_PER_PRIMITIVES = 6 + 9;
// Wider than any stored value: a lane that is widened by it separates nothing.
constexpr float UNBOUNDED = 4.0f;

/// Per lane, what stored values must be widened by on both sides so that features within separation_m stay candidates.
std::array<float, PAPER_DIRECTIONS> widening(const PaperRecords& records, double separation_m, SweptBounds bounds) {
  std::array<float, PAPER_DIRECTIONS> widen{};
  for (std::size_t k = 0; k < PAPER_DIRECTIONS; ++k) {
    if (bounds == SweptBounds::BOX && std::count(PAPER_AXIS_LANE.begin(), PAPER_AXIS_LANE.end(), k) == 0) {
      widen[k] = UNBOUNDED;
    } else if (separation_m > 0) {
      // Points within s differ by at most s |n| <= 1.4143 s along n; each side gives half of it. A stored value errs by
      // at most error(), adding the widening by at most 2^-23 of their sum (below 8, else UNBOUNDED).
      const double half = 0.70715 * separation_m * records.scale() + records.error() + 0x1p-20;
      widen[k] = half < UNBOUNDED ? std::nextafter(static_cast<float>(half), UNBOUNDED) : UNBOUNDED;
    }
  }
  return widen;
}

bool sharesVertex(const Primitive& a, const Primitive& b) {
  bool shared = false;
  for (Index v : a.vertex) shared |= v == b.vertex[0] || v == b.vertex[1] || v == b.vertex[2];
  return shared;
}

}  // namespace

void TriangleCandidates::setBodies(const std::vector<Body>& bodies, const VertexMotion* vertices) {
  bodies_ = bodies;
  std::vector<Primitive> unordered;
  std::vector<Index> body_of, part;
  part_self_.clear();
  all_wanted_ = true;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    all_wanted_ = all_wanted_ && bodies[b].self && bodies[b].against;
    const std::vector<Primitive> own = ownedPrimitives(*bodies[b].topology, bodies[b].vertex_offset);
    const std::vector<Index> own_part = connectedParts(own);
    const Index first_part = static_cast<Index>(part_self_.size());
    for (Index p : own_part) {
      part.push_back(first_part + p);
      if (first_part + p == part_self_.size()) part_self_.push_back(bodies[b].self ? 1 : 0);
    }
    unordered.insert(unordered.end(), own.begin(), own.end());
    body_of.resize(unordered.size(), static_cast<Index>(b));
    bodies_[b].topology = nullptr;
  }
  std::vector<std::array<float, 3>> centroids;
  centroids.reserve(unordered.size());
  for (const Primitive& p : unordered) {
    std::array<double, 3> c{};
    for (Index v : p.vertex) {
      for (std::size_t k = 0; k < 3; ++k) c[k] += vertices[v].t0[k];
    }
    // A centroid that is not finite would break the order of the split; where it is put costs time only.
    std::array<float, 3> f{};
    for (std::size_t k = 0; k < 3; ++k) f[k] = std::isfinite(c[k]) ? static_cast<float>(c[k]) : 0.0f;
    centroids.push_back(f);
  }
  const std::vector<Index> order = hierarchy_.build(centroids, part);
  primitives_.clear();
  body_of_.clear();
  all_features_.clear();
  leaf_vertices_.clear();
  for (Index i : order) {
    primitives_.push_back(unordered[i]);
    body_of_.push_back(body_of[i]);
    all_features_.push_back(unordered[i].features);
    leaf_vertices_.insert(leaf_vertices_.end(), unordered[i].vertex.begin(), unordered[i].vertex.end());
  }
  found_.resize(2 * std::max(LEAF_PAIRS, primitives_.size() / 2 + 1));
  vf_.pairs.resize(CHUNK);
  ee_.pairs.resize(CHUNK);
}

void TriangleCandidates::deactivate(const std::uint8_t* active) {
  for (std::size_t i = 0; i < primitives_.size(); ++i) {
    Primitive& p = primitives_[i];
    p.features = all_features_[i];
    std::uint32_t* leaf = leaf_vertices_.data() + 3 * i;
    std::copy(p.vertex.begin(), p.vertex.end(), leaf);
    if (!active) continue;
    Index some = NO_INDEX;
    for (int k = 0; k < 3; ++k) {
      if (active[p.vertex[k]]) {
        some = p.vertex[k];
        continue;
      }
      p.features &= static_cast<std::uint8_t>(~((Primitive::VERTEX_BIT << k) | Primitive::FACE_BIT |
                                                (Primitive::EDGE_BIT << k) | (Primitive::EDGE_BIT << ((k + 2) % 3))));
    }
    // Features without the inactive vertex stay; their bounds are those of the active vertices.
    for (int k = 0; k < 3; ++k) {
      if (!active[p.vertex[k]] && some != NO_INDEX) leaf[k] = some;
    }
  }
}

void TriangleCandidates::refitDifference(const VertexMotion* vertices, double separation_m) {
  difference_lo_.resize(primitives_.size());
  difference_hi_.resize(primitives_.size());
  const double widen = 0.70715 * separation_m;
  for (std::size_t i = 0; i < primitives_.size(); ++i) {
    double lo = std::numeric_limits<double>::infinity(), hi = -lo;
    for (int k = 0; k < 3; ++k) {
      const VertexMotion& v = vertices[leaf_vertices_[3 * i + k]];
      for (double d : {v.t0[0] - v.t0[2], v.t1[0] - v.t1[2]}) {
        lo = std::min(lo, d);
        hi = std::max(hi, d);
      }
    }
    // One rounded difference is monotone and needs no margin; with a separation, 2^-50 of it covers its roundings.
    const double margin = widen > 0 ? widen + 0x1p-50 * (std::abs(lo) + std::abs(hi) + widen) : 0;
    difference_lo_[i] = lo - margin;
    difference_hi_[i] = hi + margin;
  }
}

void TriangleCandidates::refit(const VertexMotion* vertices, const PaperRecords& records, const std::uint8_t* active,
                               double separation_m, SweptBounds bounds) {
  if (primitives_.empty()) return;
  deactivate(active);
  const auto widen = widening(records, separation_m, bounds);
  simd::dopRefitLeaves(records.data()->t0, leaf_vertices_.data(), primitives_.size(), widen.data(),
                       hierarchy_.leaves()->lo);
  for (std::size_t i = 0; i < primitives_.size(); ++i) {
    if (primitives_[i].features != 0 || all_features_[i] == 0) continue;
    Dop16& empty = hierarchy_.leaves()[i];  // no active feature: overlaps nothing
    std::fill(empty.lo, empty.lo + PAPER_DIRECTIONS, 2 * UNBOUNDED);
    std::fill(empty.hi, empty.hi + PAPER_DIRECTIONS, -2 * UNBOUNDED);
  }
  use_difference_ = bounds == SweptBounds::DOP18;
  if (use_difference_) refitDifference(vertices, separation_m);
  hierarchy_.update();
}

bool TriangleCandidates::wanted(std::uint32_t a, std::uint32_t b) const {
  if (!all_wanted_) {
    const Body &body_a = bodies_[body_of_[a]], &body_b = bodies_[body_of_[b]];
    if (body_of_[a] == body_of_[b] ? !body_a.self : !(body_a.against && body_b.against)) return false;
  }
  return !use_difference_ || (difference_lo_[a] <= difference_hi_[b] && difference_lo_[b] <= difference_hi_[a]);
}

void TriangleCandidates::expandVertexFace(const Primitive& owner, const Primitive& face) {
  if (!face.isFace()) return;
  for (int i = 0; i < 3; ++i) {
    const Index v = owner.vertex[i];
    if (!owner.ownsVertex(i) || v == face.vertex[0] || v == face.vertex[1] || v == face.vertex[2]) continue;
    vf_.pairs[vf_.count++] = {v, face.vertex[0], face.vertex[1], face.vertex[2]};
  }
}

void TriangleCandidates::expandEdgeEdge(const Primitive& a, const Primitive& b) {
  const bool adjacent = sharesVertex(a, b);
  for (int i = 0; i < 3; ++i) {
    if (!a.ownsEdge(i)) continue;
    const Index a0 = std::min(a.vertex[i], a.vertex[(i + 1) % 3]), a1 = std::max(a.vertex[i], a.vertex[(i + 1) % 3]);
    for (int j = 0; j < 3; ++j) {
      if (!b.ownsEdge(j)) continue;
      const Index b0 = std::min(b.vertex[j], b.vertex[(j + 1) % 3]), b1 = std::max(b.vertex[j], b.vertex[(j + 1) % 3]);
      if (adjacent && (a0 == b0 || a0 == b1 || a1 == b0 || a1 == b1)) continue;
      ee_.pairs[ee_.count++] = a0 < b0 || (a0 == b0 && a1 < b1) ? Quad{a0, a1, b0, b1} : Quad{b0, b1, a0, a1};
    }
  }
}

void TriangleCandidates::flush(Chunk& chunk, PairKind kind, PairSink& sink) {
  if (chunk.count > 0) sink.take(kind, chunk.pairs.data(), chunk.count);
  chunk.count = 0;
}

void TriangleCandidates::expand(std::uint32_t a, std::uint32_t b, PairSink& sink) {
  if (!wanted(a, b)) return;
  ++primitive_pairs_;
  if (vf_.count + MAX_PAIRS_PER_PRIMITIVES > CHUNK) flush(vf_, PairKind::VERTEX_FACE, sink);
  if (ee_.count + MAX_PAIRS_PER_PRIMITIVES > CHUNK) flush(ee_, PairKind::EDGE_EDGE, sink);
  expandVertexFace(primitives_[a], primitives_[b]);
  expandVertexFace(primitives_[b], primitives_[a]);
  expandEdgeEdge(primitives_[a], primitives_[b]);
}

void TriangleCandidates::enumerate(TrianglePairs method, PairSink& sink) {
  primitive_pairs_ = 0;
  const std::size_t n = primitives_.size();
  if (n == 0) return;
  if (method == TrianglePairs::HIERARCHY) {
    hierarchy_.begin(part_self_.data());
    while (const std::size_t count = hierarchy_.next(found_.data(), found_.size() / 2)) {
      for (std::size_t i = 0; i < count; ++i) expand(found_[2 * i], found_[2 * i + 1], sink);
    }
  } else {
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t count = hierarchy_.overlapping(i, i + 1, n, found_.data());
      for (std::size_t j = 0; j < count; ++j) expand(static_cast<std::uint32_t>(i), found_[j], sink);
    }
  }
  flush(vf_, PairKind::VERTEX_FACE, sink);
  flush(ee_, PairKind::EDGE_EDGE, sink);
}

}  // namespace dccd
