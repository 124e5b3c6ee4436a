#include "step/start/start_state.h"

#include <algorithm>

#include "dccd/tolerances.h"
#include "obstacle/burst.h"
#include "step/radix_sort.h"

namespace dccd {
namespace {

// More candidates than this many an edge, and the full test is no dearer; but with a deadline it may not come to its
// end.
constexpr std::size_t CANDIDATES_PER_EDGE = 2, CANDIDATES_PER_EDGE_WITH_DEADLINE = 8;
constexpr std::size_t CANDIDATES_PER_CONTACT = 4;  // on a regular mesh, before those that are the same are one
// A group that is begun may go on for this many tests, so that a search comes to its end in the end.
constexpr std::uint64_t TESTS_PER_LOOK_AT_THE_CLOCK = 64, TESTS_IN_ANY_CASE = 1024;
constexpr std::size_t PAIRS_PER_LOOK_AT_THE_CLOCK = 1024, LARGEST_BLOCK = 1 << 18;
constexpr std::chrono::nanoseconds LISTING_AN_INTERSECTION(400);  // sorting and copying one of half a million

bool contains(const Index* face, Index v) { return (face[0] == v) | (face[1] == v) | (face[2] == v); }
bool shareVertex(const Index* edge, const Index* face) { return contains(face, edge[0]) | contains(face, edge[1]); }

std::size_t edgeCount(const SceneArrays& scene) {
  std::size_t n = 0;
  for (const SceneBody& body : scene.bodies()) n += body.tree(FeatureKind::EDGE).featureCount();
  return n;
}

}  // namespace

void StartStateSearch::SlotsAtVertex::build(const SceneBody& body, FeatureKind kind) {
  const ClusterTree& tree = body.tree(kind);
  begin.assign(body.usedCount() + 1, 0);
  slots.resize(tree.featureCount() * tree.arity());
  for (std::size_t i = 0; i < slots.size(); ++i) ++begin[tree.feature(0)[i] - body.internal_begin];
  std::uint32_t sum = 0;
  for (std::uint32_t& n : begin) n = sum += n;  // ends, moved down to begins below
  for (std::size_t i = slots.size(); i-- > 0;) {
    slots[--begin[tree.feature(0)[i] - body.internal_begin]] = static_cast<std::uint32_t>(i / tree.arity());
  }
}

const std::vector<StartIntersection>& StartStateSearch::run(const SceneArrays& scene, bool continues,
                                                            const Deadline& deadline, StepStats& stats,
                                                            std::size_t most_found) {
  releaseBurst(found_);
  releaseBurst(candidates_);
  releaseBurst(touched_);
  releaseBurst(intersections_);
  releaseBurst(groups_);
  releaseBurst(scratch_, groups_.size());
  releaseBurst(by_group_);
  releaseBurst(keys_);
  releaseBurst(other_keys_, keys_.size());
  tested_ = 0;
  cut_ = false;
  most_found_ = most_found;
  has_deadline_ = deadline.canEnd();
  if (!(continues && known_)) clear();
  testCandidates(scene, deadline);
  if (!searched_ && !hasEnough()) search(scene, deadline);
  cut_ = cut_ || hasEnough();
  if (hasEnough()) found_.resize(most_found_);
  whole_ = searched_ && !cut_ && candidates_.empty() && touched_.empty();
  known_ = false;  // until remember() has this step's contacts

  list(scene, found_, intersections_);
  stats[Stage::START_STATE].in += tested_;
  stats[Stage::START_STATE].out += intersections_.size();
  stats[Effect::START_STATE].in += tested_;
  stats[Effect::START_STATE].out += intersections_.size();
  return intersections_;
}

Deadline StartStateSearch::beforeListing(const std::vector<EdgeFace>& found, const Deadline& deadline) {
  return deadline.movedBy(-LISTING_AN_INTERSECTION * static_cast<std::int64_t>(found.size()));
}

void StartStateSearch::list(const SceneArrays& scene, const std::vector<EdgeFace>& pairs,
                            std::vector<StartIntersection>& out) {
  const std::vector<SceneBody>& bodies = scene.bodies();
  // Ranks ascend from body to body.
  const auto rank = [&](FeatureKind kind, std::uint32_t body, std::uint32_t slot) -> std::uint64_t {
    return bodies[body].rank(kind)[slot];
  };
  const auto bodyOf = [&](Index SceneBody::*begin, Index rank) {
    const auto next = std::upper_bound(bodies.begin(), bodies.end(), rank,
                                       [begin](Index r, const SceneBody& body) { return r < body.*begin; });
    return static_cast<std::uint16_t>(next - bodies.begin() - 1);
  };
  keys_.clear();
  for (const EdgeFace& pair : pairs) {
    keys_.push_back(rank(FeatureKind::EDGE, pair.edge_body, pair.edge) << 32 |
                    rank(FeatureKind::FACE, pair.face_body, pair.face));
  }
  radixSort(keys_, other_keys_);
  keys_.erase(std::unique(keys_.begin(), keys_.end()), keys_.end());  // a candidate that the search came to as well
  out.clear();
  for (const std::uint64_t key : keys_) {
    const Index edge = static_cast<Index>(key >> 32), face = static_cast<Index>(key);
    StartIntersection found;
    found.body = {bodyOf(&SceneBody::edge_begin, edge), bodyOf(&SceneBody::face_begin, face)};
    scene.featureVertices(FeatureKind::EDGE, found.body[0], edge, found.vertex.data());
    scene.featureVertices(FeatureKind::FACE, found.body[1], face, found.vertex.data() + 2);
    out.push_back(found);
  }
}

bool StartStateSearch::listEnd(const SceneArrays& scene, const Deadline& deadline,
                               std::vector<StartIntersection>& out) {
  std::vector<EdgeFace> pairs = candidates_, met;
  pairs.insert(pairs.end(), found_.begin(), found_.end());
  std::size_t expanded = 0;
  const bool whole = inBlocks(
      pairs, met, deadline, [&] { return expanded < touched_.size(); },
      [&] { addCandidates(scene, touched_[expanded++], pairs); },
      [&](const EdgeFace* first, std::size_t count) {
        addMeeting(scene, first, count, 1, met);
        return true;
      });
  list(scene, met, out);
  return whole;
}

bool StartStateSearch::isChecked(const SceneArrays& scene, const EdgeFace& pair) {
  return scene.bodies()[pair.edge_body].holds(FeatureKind::EDGE, pair.edge) &&
         scene.bodies()[pair.face_body].holds(FeatureKind::FACE, pair.face);
}

/// Takes the pairs from the back, a block at a time, and calls test(pairs, count) with it: sorted, many are the same
/// and those that follow each other lie together. expand() adds pairs as long as hasMore(). False: the deadline before
/// the listing of what is found, or a test that returned false, ended it.
template <class HasMore, class Expand, class Test>
bool StartStateSearch::inBlocks(std::vector<EdgeFace>& pairs, const std::vector<EdgeFace>& found,
                                const Deadline& deadline, const HasMore& hasMore, const Expand& expand,
                                const Test& test) {
  const std::size_t block = deadline.canEnd() ? PAIRS_PER_LOOK_AT_THE_CLOCK : LARGEST_BLOCK;
  for (;;) {
    if (pairs.empty() && !hasMore()) return true;
    if (beforeListing(found, deadline).isOver()) return false;
    while (pairs.size() < block && hasMore()) expand();
    const auto first = pairs.end() - static_cast<std::ptrdiff_t>(std::min(block, pairs.size()));
    std::sort(first, pairs.end());
    const auto last = std::unique(first, pairs.end());
    const bool goes_on = test(&*first, static_cast<std::size_t>(last - first));
    pairs.erase(first, pairs.end());
    if (!goes_on) return false;
  }
}

void StartStateSearch::testCandidates(const SceneArrays& scene, const Deadline& deadline) {
  candidates_.insert(candidates_.end(), found_.begin(), found_.end());
  found_.clear();
  inBlocks(
      candidates_, found_, deadline, [&] { return !touched_.empty(); },
      [&] {
        addCandidates(scene, touched_.back(), candidates_);
        touched_.pop_back();
      },
      [&](const EdgeFace* first, std::size_t count) {
        tested_ += addMeeting(scene, first, count, 0, found_);
        return !hasEnough();
      });
}

void StartStateSearch::search(const SceneArrays& scene, const Deadline& deadline) {
  const std::vector<SceneBody>& bodies = scene.bodies();
  body_pairs_.clear();
  for (std::uint32_t b = 0; b < bodies.size(); ++b) {
    if (meetsItself(bodies[b].setup)) body_pairs_.push_back({b, b});
  }
  overlapping_.clear();
  if (bodies.size() > 1) scene.overlappingBodies(true, overlapping_, scratch_);
  for (std::size_t p = 0; p < overlapping_.size(); p += 2) {
    const std::uint32_t a = overlapping_[p], b = overlapping_[p + 1];
    if (!dccd::meet(bodies[a].setup, a, bodies[b].setup, b)) continue;
    body_pairs_.push_back({a, b});
    body_pairs_.push_back({b, a});
  }
  searched_ = goOn(body_pairs_, next_bodies_, next_group_, [&] { return searchBodies(scene, deadline); });
}

/// Goes on at next_group_ of the edges' tree, by one group at the least; false: it was ended, and next_group_ says
/// where.
bool StartStateSearch::searchBodies(const SceneArrays& scene, const Deadline& deadline) {
  const std::uint32_t edge_body = next_bodies_[0], face_body = next_bodies_[1];
  const ClusterTree& edges = scene.bodies()[edge_body].tree(FeatureKind::EDGE);
  const ClusterTree& faces = scene.bodies()[face_body].tree(FeatureKind::FACE);
  if (edges.featureCount() == 0 || faces.featureCount() == 0) return true;
  if (beforeListing(deadline).isOver()) return false;
  TreePair trees;
  trees.a = &edges;
  trees.b = &faces;
  trees.span.times = Times::T0;
  trees.adjacent = edge_body == face_body;
  const std::size_t room = most_found_ == FoundLimit::NONE ? FoundLimit::NONE : tolerance::MAX_SUPERCLUSTER_PAIRS;
  cut_ = superclusterPairs(trees, groups_, scratch_, room).toc <= 1 || cut_;
  // By group of edges, so that all before the one that comes next are done.
  by_group_.clear();
  for (std::size_t p = 0; p < groups_.size(); p += 2) {
    if (groups_[p] >= next_group_) by_group_.push_back({groups_[p], groups_[p + 1]});
  }
  std::sort(by_group_.begin(), by_group_.end());
  stream_.clearCounters();
  for (std::size_t first = 0, last = 0; first < by_group_.size(); first = last) {
    next_group_ = by_group_[first][0];
    if (first > 0 && beforeListing(deadline).isOver()) return false;
    while (last < by_group_.size() && by_group_[last][0] == next_group_) ++last;
    const std::uint64_t tested_before = tested_;
    bool late = false;
    stream_.run(trees, by_group_[first].data(), last - first, [&](const std::uint32_t* slots, std::size_t count) {
      pairs_.clear();
      for (std::size_t i = 0; i < count; ++i) pairs_.push_back({edge_body, slots[2 * i], face_body, slots[2 * i + 1]});
      const std::size_t piece = has_deadline_ ? TESTS_PER_LOOK_AT_THE_CLOCK : count;
      for (std::size_t i = 0; i < count && !late; i += piece) {
        tested_ += addMeeting(scene, pairs_.data() + i, std::min(piece, count - i), 0, found_);
        late = tested_ - tested_before >= TESTS_IN_ANY_CASE && beforeListing(deadline).isOver();
      }
      return !late && !hasEnough();
    });
    if (late || hasEnough()) return false;
  }
  return true;
}

/// Returns how many were tested: those that are checked.
std::size_t StartStateSearch::addMeeting(const SceneArrays& scene, const EdgeFace* pairs, std::size_t count, int at,
                                         std::vector<EdgeFace>& found) {
  constexpr std::size_t NEXT = simd::GROUP, CHUNK = 1024;  // vertex of a lane; pairs that stay in the first-level cache
  const double* positions = at == 0 ? scene.vertices()->t0 : scene.vertices()->t1;
  std::size_t tested = 0;
  for (const EdgeFace *end = pairs + count, *first = pairs; first != end;) {
    corners_.clear();
    tested_pairs_.clear();
    for (; first != end && corners_.size() < CHUNK; ++first) {
      if (!isChecked(scene, *first)) continue;
      const Index* e = scene.bodies()[first->edge_body].tree(FeatureKind::EDGE).lane<2>(first->edge);
      const Index* f = scene.bodies()[first->face_body].tree(FeatureKind::FACE).lane<3>(first->face);
      corners_.push_back({e[0], e[NEXT], f[0], f[NEXT], f[2 * NEXT]});
      tested_pairs_.push_back(first);
    }
    meet_.resize(corners_.size());
    if (!corners_.empty()) segmentsMeetTriangles(positions, corners_.data(), corners_.size(), meet_.data());
    for (std::size_t i = 0; i < meet_.size(); ++i) {
      if (meet_[i]) found.push_back(*tested_pairs_[i]);
    }
    tested += corners_.size();
  }
  return tested;
}

void StartStateSearch::remember(const SceneArrays& scene, const std::vector<Contact>& contacts, bool complete) {
  known_ = false;
  if (!complete || cut_) return;
  const std::size_t limit =
      edgeCount(scene) * (has_deadline_ ? CANDIDATES_PER_EDGE_WITH_DEADLINE : CANDIDATES_PER_EDGE);
  for (const Contact& contact : contacts) {
    if (factsOf(contact.kind).isOnMap()) continue;
    touched_.push_back({contact.kind, contact.body[0], contact.body[1], contact.vertex});
    if (CANDIDATES_PER_CONTACT * touched_.size() + candidates_.size() > limit) return;
  }
  known_ = true;
}

void StartStateSearch::addCandidates(const SceneArrays& scene, const Touched& contact, std::vector<EdgeFace>& out) {
  learnNeighbourhoods(scene);
  const std::uint32_t a = contact.first_body, b = contact.second_body;
  Index v[4];  // internal numbers
  for (std::size_t i = 0; i < 4; ++i) {
    v[i] = neighbourhoods_[factsOf(contact.kind).sideOf(i) == 0 ? a : b].internal_of_local[contact.vertex[i]];
  }
  if (contact.kind == PairKind::EDGE_EDGE) {
    addFacesAtEdge(scene, a, v, b, v + 2, out);
    addFacesAtEdge(scene, b, v + 2, a, v, out);
    return;
  }
  const SceneBody &body = scene.bodies()[a], &face_body = scene.bodies()[b];
  const SlotsAtVertex &edges = neighbourhoods_[a].edges, &faces = neighbourhoods_[b].faces;
  const Index at = v[0] - body.internal_begin, corner = v[1] - face_body.internal_begin;
  const std::uint32_t* face = std::find_if(&faces.slots[faces.begin[corner]],
                                           faces.slots.data() + faces.begin[corner + 1], [&](std::uint32_t slot) {
                                             const Index* f = face_body.tree(FeatureKind::FACE).feature(slot);
                                             return contains(f, v[2]) && contains(f, v[3]);
                                           });
  for (std::uint32_t i = edges.begin[at]; i < edges.begin[at + 1]; ++i) {
    const Index* e = body.tree(FeatureKind::EDGE).feature(edges.slots[i]);
    if (!shareVertex(e, v + 1)) out.push_back({a, edges.slots[i], b, *face});
  }
}

void StartStateSearch::addFacesAtEdge(const SceneArrays& scene, std::uint32_t edge_body, const Index* edge,
                                      std::uint32_t face_body, const Index* other_edge, std::vector<EdgeFace>& out) {
  const SceneBody &a = scene.bodies()[edge_body], &b = scene.bodies()[face_body];
  const SlotsAtVertex &edges = neighbourhoods_[edge_body].edges, &faces = neighbourhoods_[face_body].faces;
  const Index at = edge[0] - a.internal_begin, other = other_edge[0] - b.internal_begin;
  const std::uint32_t* slot =
      std::find_if(&edges.slots[edges.begin[at]], edges.slots.data() + edges.begin[at + 1], [&](std::uint32_t s) {
        const Index* e = a.tree(FeatureKind::EDGE).feature(s);
        return (e[0] == edge[0] && e[1] == edge[1]) || (e[0] == edge[1] && e[1] == edge[0]);
      });
  for (std::uint32_t i = faces.begin[other]; i < faces.begin[other + 1]; ++i) {
    const Index* f = b.tree(FeatureKind::FACE).feature(faces.slots[i]);
    if (contains(f, other_edge[1]) && !shareVertex(edge, f)) {
      out.push_back({edge_body, *slot, face_body, faces.slots[i]});
    }
  }
}

void StartStateSearch::learnNeighbourhoods(const SceneArrays& scene) {
  if (!neighbourhoods_.empty()) return;
  neighbourhoods_.resize(scene.bodies().size());
  for (std::size_t b = 0; b < neighbourhoods_.size(); ++b) {
    const SceneBody& body = scene.bodies()[b];
    Neighbourhood& n = neighbourhoods_[b];
    n.internal_of_local.assign(body.setup.topology->vertexCount(), NO_INDEX);
    for (std::size_t i = 0; i < body.usedCount(); ++i) {
      n.internal_of_local[body.slot_vertex[i]] = body.internal_begin + static_cast<Index>(i);
    }
    n.edges.build(body, FeatureKind::EDGE);
    n.faces.build(body, FeatureKind::FACE);
  }
}

void StartStateSearch::clear() {
  known_ = false;
  searched_ = false;
  next_bodies_ = {};
  next_group_ = 0;
  found_.clear();
  candidates_.clear();
  touched_.clear();
}

}  // namespace dccd
