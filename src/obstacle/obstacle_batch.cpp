#include "obstacle/obstacle_batch.h"

#include <algorithm>

#include "obstacle/burst.h"

namespace dccd {
namespace {

Vec3 at(const VertexMotion& v, double t) {
  return (1 - t) * Eigen::Map<const Vec3>(v.t0) + t * Eigen::Map<const Vec3>(v.t1);
}

Vec3 velocity(const VertexMotion& v) { return Eigen::Map<const Vec3>(v.t1) - Eigen::Map<const Vec3>(v.t0); }

/// Velocity of the place on the mesh's edge (the first) that meets the static edge at time t.
Vec3 edgeVelocity(const VertexMotion* points, double t) {
  const Vec3 along = at(points[3], t) - at(points[2], t);
  const Vec3 e = at(points[1], t) - at(points[0], t), u = at(points[2], t) - at(points[0], t);
  const Vec3 normal = e.cross(along).cross(along);  // in the span of e, perpendicular to the static edge
  const double denominator = normal.dot(e);
  const double w = denominator != 0 ? std::min(1.0, std::max(0.0, normal.dot(u) / denominator)) : 0.5;
  return (1 - w) * velocity(points[0]) + w * velocity(points[1]);
}

/// Velocity of the place on the face (points 1 to 3) that meets the vertex, plus the vertex's own; the static ones of
/// them add nothing.
Vec3 faceVelocity(const VertexMotion* points, double t) {
  const Vec3 p = at(points[0], t), a = at(points[1], t), b = at(points[2], t), c = at(points[3], t);
  const Vec3 normal = (b - a).cross(c - a);
  const double area = normal.squaredNorm();
  Vec3 weights = Vec3::Constant(1.0 / 3);
  if (area > 0) {
    weights[0] = (b - p).cross(c - p).dot(normal) / area;
    weights[1] = (c - p).cross(a - p).dot(normal) / area;
    weights[2] = (a - p).cross(b - p).dot(normal) / area;
  }
  return velocity(points[0]) + weights[0] * velocity(points[1]) + weights[1] * velocity(points[2]) +
         weights[2] * velocity(points[3]);
}

/// Does the mesh move out of the leaf where it meets the leaf's feature? A label, no decision: plain double will do.
bool movesOutward(PairKind kind, const VertexMotion* points, const double* outward, double t) {
  const Vec3 v = kind == PairKind::EDGE_EDGE ? edgeVelocity(points, t) : faceVelocity(points, t);
  return v.dot(Eigen::Map<const Vec3>(outward)) > 0;
}

bool sameFeatureAndLeaf(const Contact& a, const Contact& b) {
  return a.kind == b.kind && a.body == b.body && a.vertex == b.vertex && a.voxel == b.voxel;
}

/// `into` and `other` are one contact.
void join(Contact& into, const Contact& other) {
  const bool into_certain = into.certainty == Certainty::CERTAIN, other_certain = other.certainty == Certainty::CERTAIN;
  if (other_certain && (!into_certain || other.toc_upper < into.toc_upper)) {
    into.toc_upper = other.toc_upper;
    into.certainty = Certainty::CERTAIN;
  }
  if (other.toc_lower < into.toc_lower) into.leaving = other.leaving;
  into.toc_lower = std::min(into.toc_lower, other.toc_lower);
  into.initial = into.initial || other.initial;
}

}  // namespace

ObstacleBatch::ObstacleBatch(PairKind kind, const Rung* test) : kind_(kind), test_(test) {
  quads_.resize(CHUNK);
  for (std::size_t i = 0; i < CHUNK; ++i) {
    for (std::size_t k = 0; k < 4; ++k) quads_[i][k] = static_cast<Index>(4 * i + k);
  }
  separations_.reserve(CHUNK);
  results_.resize(CHUNK);
  pairs_.reserve(CHUNK);
  toc_bounds_.reserve(CHUNK);
  points_.reserve(4 * CHUNK);
}

void ObstacleBatch::clear(const Deadline& deadline) {
  deadline_ = deadline;
  late_ = false;
  dropPairs();
  releaseBurst(contacts_);
  contacts_.clear();
}

void ObstacleBatch::dropPairs() {
  pairs_.clear();
  toc_bounds_.clear();
  points_.clear();
  separations_.clear();
  any_separation_ = false;
}

void ObstacleBatch::add(const ObstaclePair& pair, const VertexMotion* points, double toc_bound, double separation_m) {
  pairs_.push_back(pair);
  toc_bounds_.push_back(toc_bound);
  points_.insert(points_.end(), points, points + 4);
  separations_.push_back(separation_m);
  any_separation_ |= separation_m > 0;
  if (pairs_.size() == CHUNK) flush();
}

void ObstacleBatch::flush() {
  const std::size_t count = pairs_.size();
  if (count == 0) return;
  PairBatch batch;
  batch.kind = kind_;
  batch.vertices = points_.data();
  batch.pairs = quads_.data();
  batch.count = count;
  if (any_separation_) batch.minimum_separation_m = separations_.data();
  if (deadline_.canEnd()) batch.deadline = &deadline_;
  TierCounters uncounted;  // statistics tell of pairs of meshes alone
  test_->run(batch, results_.data(), uncounted);
  bool undecided = false;
  for (std::size_t i = 0; i < count; ++i) {
    if (results_[i].verdict == Verdict::NO_CONTACT) continue;
    append(i, results_[i]);
    undecided |= results_[i].verdict == Verdict::UNDECIDED;
  }
  late_ = late_ || (undecided && deadline_.isOver());
  dropPairs();
}

void ObstacleBatch::append(std::size_t index, const ElementaryResult& result) {
  const ObstaclePair& pair = pairs_[index];
  Contact contact = pair.contact;
  const bool certain = result.verdict == Verdict::CONTACT;
  contact.certainty = certain ? Certainty::CERTAIN : Certainty::UNDECIDED;
  contact.toc_lower = certain ? result.toc_lower : std::max(result.toc_lower, toc_bounds_[index]);
  contact.toc_upper = result.toc_upper;
  // With a separation, closer than it at t=0 is initial; without one that was settled before.
  contact.initial = certain && separations_[index] > 0 && result.toc_lower <= 0;
  contact.leaving = !contact.initial && pair.started_inside &&
                    movesOutward(kind_, &points_[4 * index], pair.outward, contact.toc_lower);
  contacts_.push_back(contact);
}

void sortAndJoin(std::vector<Contact>& contacts) {
  if (!std::is_sorted(contacts.begin(), contacts.end(), canonicalLess)) {
    std::sort(contacts.begin(), contacts.end(), canonicalLess);
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (kept > 0 && sameFeatureAndLeaf(contacts[kept - 1], contacts[i])) {
      join(contacts[kept - 1], contacts[i]);
    } else {
      contacts[kept++] = contacts[i];
    }
  }
  contacts.resize(kept);
}

}  // namespace dccd
