#include "step/pair_memory.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dccd/tolerances.h"
#include "simd/group_gaps.h"
#include "step/closest_points.h"

namespace dccd {
namespace {

constexpr double INFINITE = std::numeric_limits<double>::infinity();
constexpr double DOWN = 1 - tolerance::LENGTH;  // more than all roundings of a product
constexpr double STEPS_AHEAD = 2;               // that a certificate is to last, as far as they are like this one
constexpr double WORTH_A_CERTIFICATE = 1.5;     // residuals of this step that it must have
// Shares of the pairs that are known to be apart. Pairs are tested so fast that smaller shares do not pay; what it
// takes to begin is more than what it takes to go on.
constexpr double WORTH_TURNING_ON = 0.93, WORTH_STAYING_ON = 0.75;
constexpr std::size_t MOST_MEASURED = 6;   // distances for one certificate; one takes as long as a row of gaps
constexpr std::size_t PAIRS_PER_EDGE = 2;  // that may be kept: 144 bytes a triangle
constexpr std::size_t PAIRS_IN_ANY_CASE = 4096;

/// How far two convex hulls are apart along a direction, whatever it is: a lower bound of their distance but for
/// rounding, which the caller takes off. 0 where the direction is too short to measure along.
double gapAlong(const Vec3& direction, const Vec3* a, std::size_t n, const Vec3* b, std::size_t m) {
  const double length = direction.norm();
  if (!(length > tolerance::SHORTEST_DIRECTION)) return 0;
  double low = INFINITE, high = -INFINITE;
  for (std::size_t i = 0; i < n; ++i) low = std::min(low, direction.dot(a[i]));
  for (std::size_t i = 0; i < m; ++i) high = std::max(high, direction.dot(b[i]));
  const double gap = (low - high) / length;
  return gap > 0 ? gap : 0;  // 0 also for a gap that is no number
}

double gapOfEdges(const Vec3* a, const Vec3* b) {
  const Closest closest = closestOnSegments(a[0], a[1], b[0], b[1]);
  return gapAlong(closest.on_first - closest.on_second, a, 2, b, 2);
}

double gapOfVertexAndFace(const Vec3& v, const Vec3* f) {
  const Vec3 normal = (f[1] - f[0]).cross(f[2] - f[0]);
  double gap = std::max(gapAlong(normal, &v, 1, f, 3), gapAlong(-normal, &v, 1, f, 3));
  for (int i = 0; i < 3; ++i) {
    const Closest closest = closestOnSegments(v, v, f[i], f[(i + 1) % 3]);
    gap = std::max(gap, gapAlong(closest.on_first - closest.on_second, &v, 1, f, 3));
  }
  return gap;
}

std::uint64_t hashOf(const MemoryTrees& trees, std::uint32_t a, std::uint32_t b) {
  std::uint64_t h = (std::uint64_t{a} << 32 | b) * 0x9e3779b97f4a7c15u;
  h ^= (std::uint64_t{trees.body_a} << 17 | std::uint64_t{trees.body_b} << 1 | static_cast<std::uint64_t>(trees.kind)) *
       0xc2b2ae3d27d4eb4fu;
  return h ^ h >> 29;
}

bool sameGroup(const PairMemory::Group& x, const MemoryTrees& trees, std::uint32_t a, std::uint32_t b) {
  return x.a == a && x.b == b && x.trees.kind == trees.kind && x.trees.body_a == trees.body_a &&
         x.trees.body_b == trees.body_b;
}

const ClusterTree& treeA(const SceneArrays& scene, const MemoryTrees& t) {
  return scene.bodies()[t.body_a].tree(t.kindA());
}
const ClusterTree& treeB(const SceneArrays& scene, const MemoryTrees& t) {
  return scene.bodies()[t.body_b].tree(t.kindB());
}
std::uint32_t clusterA(const PairMemory::Group& group, const PairMemory::Pair& pair) {
  return group.a * simd::GROUP + (pair.lanes >> 4);
}
std::uint32_t clusterB(const PairMemory::Group& group, const PairMemory::Pair& pair) {
  return group.b * simd::GROUP + (pair.lanes & 15);
}

}  // namespace

void PairMemory::clear() {
  turnOff(0);
  next_rest_ = SHORTEST_REST;
  motion_.clear();
  marks_ = std::vector<Marks>();
}

void PairMemory::turnOff(std::uint32_t rest) {
  state_ = State::OFF;
  rest_ = rest;
  groups_ = std::vector<Group>();
  last_ = std::vector<Group>();
  table_ = std::vector<std::uint32_t>();
}

std::size_t PairMemory::bytes() const {
  std::size_t bytes = motion_.bytes() + (groups_.capacity() + last_.capacity()) * sizeof(Group) +
                      table_.capacity() * sizeof(std::uint32_t);
  for (const Group& group : groups_) bytes += group.pairs.capacity() * sizeof(Pair);
  for (const Marks& marks : marks_) bytes += marks.count[0] + marks.count[1] + marks.count[2];
  return bytes;
}

/// Units of the records, each as a share of the largest: what a gap is worth at least, in any direction.
void PairMemory::setWeights(const SceneArrays& scene) {
  double metres[8];
  unit_m_ = 0;
  for (int d = 0; d < 8; ++d) {
    metres[d] = scene.unit(d) / (d < 3 ? 1.0 : tolerance::SQRT2_UP);
    unit_m_ = std::max(unit_m_, metres[d]);
  }
  for (int d = 0; d < 8; ++d) {
    weights_[d] = static_cast<std::uint16_t>(unit_m_ > 0 ? std::floor(65535 * (metres[d] / unit_m_) * DOWN) : 0);
  }
}

void PairMemory::unmark(const SceneArrays& scene) {
  marks_.resize(scene.bodies().size());
  for (std::size_t b = 0; b < marks_.size(); ++b) {
    for (int kind = 0; kind < 3; ++kind) {
      const std::size_t n = scene.bodies()[b].trees[kind].level(0).groups;
      Marks& marks = marks_[b];
      if (marks.count[kind] != n) {
        marks.of[kind].reset(new std::atomic<std::uint8_t>[n]);
        marks.count[kind] = n;
      }
      for (std::size_t i = 0; i < n; ++i) marks.of[kind][i].store(0, std::memory_order_relaxed);
    }
  }
}

void PairMemory::beginGroups(const SceneArrays& scene) {
  std::swap(groups_, last_);
  groups_.clear();
  std::size_t size = 16;
  while (size < 2 * last_.size()) size *= 2;
  table_.assign(size, 0);
  for (std::size_t g = 0; g < last_.size(); ++g) {
    std::uint64_t at = hashOf(last_[g].trees, last_[g].a, last_[g].b) & (size - 1);
    while (table_[at]) at = (at + 1) & (size - 1);
    table_[at] = static_cast<std::uint32_t>(g + 1);
  }
  std::size_t edges = 0;
  for (const SceneBody& body : scene.bodies()) edges += body.tree(FeatureKind::EDGE).featureCount();
  most_pairs_ = std::max(PAIRS_IN_ANY_CASE, PAIRS_PER_EDGE * edges);
  pair_count_ = known_apart_ = 0;
  setWeights(scene);
  unmark(scene);
}

void PairMemory::addGroup(const MemoryTrees& trees, std::uint32_t a, std::uint32_t b) {
  Group group;
  group.a = a;
  group.b = b;
  group.trees = trees;
  const std::size_t size = table_.size();
  for (std::uint64_t at = hashOf(trees, a, b) & (size - 1); table_[at]; at = (at + 1) & (size - 1)) {
    Group& before = last_[table_[at] - 1];
    if (!sameGroup(before, trees, a, b)) continue;
    group.pairs = std::move(before.pairs);
    break;
  }
  groups_.push_back(std::move(group));
}

/// Takes from the certificate what the step consumes of it. A certificate that is no number holds nothing.
bool PairMemory::consume(const Group& group, Pair& pair, double contact_m) const {
  const ClusterPairMotion motion = motion_.between(group.trees.body_a, group.trees.kindA(), clusterA(group, pair),
                                                   group.trees.body_b, group.trees.kindB(), clusterB(group, pair));
  pair.residual_m = static_cast<float>(motion.residual_m);
  if (pair.distance_m == UNKNOWN) return false;
  const double before = pair.distance_m;
  pair.distance_m = UNKNOWN;
  if (!(before * motion.half_cosine - motion.residual_m > contact_m)) return false;
  pair.distance_m = motion.residual_m == 0 ? before : (before * DOWN - motion.residual_m) * DOWN;
  return pair.distance_m > 0;
}

bool PairMemory::consult(const SceneArrays& scene, std::size_t g, double contact_m) {
  Group& group = groups_[g];
  const ClusterTree &a = treeA(scene, group.trees), &b = treeB(scene, group.trees);
  constexpr std::size_t MOST = simd::GROUP * simd::GROUP;
  std::uint32_t clusters[2 * MOST];
  const std::uint32_t one[2] = {group.a, group.b};
  std::size_t consumed = 0;
  const std::size_t n = simd::testGroupPairs(a.level(1).view(), b.level(1).view(), one, 1, group.trees.isSelf(),
                                             simd::Diagonal::UPPER_WITH_DIAGONAL, false, clusters, MOST, &consumed);
  if (pair_count_.fetch_add(n, std::memory_order_relaxed) + n > most_pairs_) return false;
  const auto lanesOf = [&](std::size_t i) {
    return static_cast<std::uint16_t>((clusters[2 * i] & 15) << 4 | (clusters[2 * i + 1] & 15));
  };
  bool same = group.pairs.size() == n;
  for (std::size_t i = 0; same && i < n; ++i) same = group.pairs[i].lanes == lanesOf(i);
  if (!same) {
    std::uint16_t place[MOST] = {};
    for (std::size_t i = 0; i < group.pairs.size(); ++i) {
      place[group.pairs[i].lanes] = static_cast<std::uint16_t>(i + 1);
    }
    std::vector<Pair> pairs(n);
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint16_t lanes = lanesOf(i);
      if (place[lanes]) pairs[i] = group.pairs[place[lanes] - 1];
      pairs[i].lanes = lanes;
    }
    group.pairs.swap(pairs);
  }
  std::size_t apart = 0;
  for (Pair& pair : group.pairs) {
    pair.to_test = !consume(group, pair, contact_m);
    if (!pair.to_test) {
      ++apart;
      continue;
    }
    marks_[group.trees.body_a].of[static_cast<int>(group.trees.kindA())][clusterA(group, pair)].store(
        1, std::memory_order_relaxed);
    marks_[group.trees.body_b].of[static_cast<int>(group.trees.kindB())][clusterB(group, pair)].store(
        1, std::memory_order_relaxed);
  }
  known_apart_.fetch_add(apart, std::memory_order_relaxed);
  return true;
}

void PairMemory::shareVertices(const SceneArrays& scene, const Group& group, Pair& pair) const {
  if (pair.has_shared) return;
  pair.has_shared = true;
  if (group.trees.body_a != group.trees.body_b) return;
  const ClusterTree &a = treeA(scene, group.trees), &b = treeB(scene, group.trees);
  simd::sharedVertices(a.leaves(false), b.leaves(false), clusterA(group, pair), clusterB(group, pair), pair.shared);
}

std::size_t PairMemory::test(const SceneArrays& scene, const Group& group, Pair& pair, double contact_m,
                             std::uint32_t* slots, StepStats& stats) {
  shareVertices(scene, group, pair);
  const std::size_t left =
      simd::testLeafPair(treeA(scene, group.trees).level(0).view(), treeB(scene, group.trees).level(0).view(),
                         clusterA(group, pair), clusterB(group, pair), group.trees.isSelf(), pair.shared, slots);
  if (pair.wait > 0) {
    --pair.wait;
  } else if (left <= MOST_LEFT) {
    certify(scene, group, pair, contact_m);
    stats.pairs_shown_apart += pair.distance_m != UNKNOWN;
  }
  return left;
}

/// By the directions of the bounds, and where these say little, by the features' distance.
void PairMemory::certify(const SceneArrays& scene, const Group& group, Pair& pair, double contact_m) const {
  const ClusterTree &a = treeA(scene, group.trees), &b = treeB(scene, group.trees);
  // What is farther apart than this needs no closer look; as an int16 below EMPTY_LO.
  const double units = std::min((contact_m + STEPS_AHEAD * pair.residual_m) / unit_m_ + 1, 32000.0);
  const auto target = static_cast<std::int16_t>(units >= 1 ? units : 1);
  std::uint8_t near[MOST_MEASURED];
  std::size_t found = 0;
  const std::int16_t gap =
      simd::gapAtEnd(a.level(0).view(), b.level(0).view(), clusterA(group, pair), clusterB(group, pair),
                     group.trees.isSelf(), pair.shared, weights_, target, near, MOST_MEASURED, &found);
  const double slop = ClusterMotion::slop(scene);
  double distance = gap == simd::EMPTY_LO ? INFINITE : gap * unit_m_ * DOWN;
  if (found > MOST_MEASURED) distance = 0;
  const bool edges = group.trees.kind == PairKind::EDGE_EDGE;
  for (std::size_t i = 0; i < std::min(found, MOST_MEASURED) && distance > 0; ++i) {
    const Index* fa = a.feature(clusterA(group, pair) * simd::GROUP + (near[i] >> 4));
    const Index* fb = b.feature(clusterB(group, pair) * simd::GROUP + (near[i] & 15));
    Vec3 x[2], y[3];
    for (std::size_t k = 0; k < a.arity(); ++k) x[k] = Eigen::Map<const Vec3>(scene.vertices()[fa[k]].t1);
    for (std::size_t k = 0; k < b.arity(); ++k) y[k] = Eigen::Map<const Vec3>(scene.vertices()[fb[k]].t1);
    const double apart = edges ? gapOfEdges(x, y) : gapOfVertexAndFace(x[0], y);
    // DOWN covers the norm and the quotient, the slop the rounded sums along the direction: features that touch are
    // not apart by a last bit. A trial certifies in a step whose motion nobody has looked at.
    distance = std::min(distance, apart * DOWN - slop);
  }
  if (distance > contact_m + WORTH_A_CERTIFICATE * pair.residual_m) {
    pair.distance_m = distance;
    pair.failed = 0;
    return;
  }
  pair.distance_m = UNKNOWN;
  pair.failed = std::min(pair.failed + 1, 2);
  pair.wait = static_cast<std::uint8_t>((1 << pair.failed) - 1);
}

void PairMemory::endStep() {
  last_.clear();  // pairs of groups that this step did not have
  const std::size_t pairs = pair_count_;
  const bool worth =
      steps_on_ == 0 || static_cast<double>(known_apart_) >= WORTH_STAYING_ON * static_cast<double>(pairs);
  if (worth) {
    // To turn it on costs what some steps with it save: only one that lasts makes the next rest short again.
    if (++steps_on_ >= SHORTEST_REST) next_rest_ = SHORTEST_REST;
    return;
  }
  turnOff(next_rest_);
  next_rest_ = std::min(2 * next_rest_, LONGEST_REST);
}

void PairMemory::beginTrial(const SceneArrays& scene) {
  last_.clear();
  if (!motion_.isSet()) motion_.setBodies(scene);
  state_ = State::TRIAL;
  if (groups_.empty()) return turnOff(SHORTEST_REST);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    if (!consult(scene, g, 0)) return turnOff(LONGEST_REST);
    for (Pair& pair : groups_[g].pairs) {
      pair.residual_m = 0;
      pair.distance_m = UNKNOWN;
      shareVertices(scene, groups_[g], pair);
      certify(scene, groups_[g], pair, 0);
    }
  }
  // What all groups would take, by the sample.
  if (TRIAL_SHARE * pair_count_ > most_pairs_) turnOff(LONGEST_REST);
}

void PairMemory::judgeTrial() {
  std::size_t pairs = 0, apart = 0;
  for (Group& group : groups_) {
    for (Pair& pair : group.pairs) {
      ++pairs;
      const double distance = pair.distance_m;
      apart += consume(group, pair, 0);
      pair.distance_m = distance;  // the step itself consumes it
      pair.wait = pair.failed = 0;
    }
  }
  if (pairs > 0 && static_cast<double>(apart) < WORTH_TURNING_ON * static_cast<double>(pairs)) {
    turnOff(next_rest_);
    next_rest_ = std::min(2 * next_rest_, LONGEST_REST);
    return;
  }
  state_ = State::ON;
  steps_on_ = 0;
}

}  // namespace dccd
