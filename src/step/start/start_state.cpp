#include "step/start/start_state.h"

#include <algorithm>
#include <limits>

#include "dccd/tolerances.h"
#include "obstacle/burst.h"
#include "obstacle/radix_sort.h"

namespace dccd {
namespace {

// More candidates than this many for a hundred edges, and the full test is no dearer (a candidate takes twice as long
// as an edge's share of that), unless they are few; but with a deadline it may not come to its end.
constexpr std::size_t CANDIDATES_PER_100_EDGES = 40, CANDIDATES_PER_100_EDGES_WITH_DEADLINE = 100;
constexpr std::size_t FEW_CANDIDATES = 4096;
constexpr std::size_t CANDIDATES_PER_CONTACT = 4;  // on a regular mesh, before those that are the same are one
constexpr std::size_t FAN_UNIT = 64;               // groups of vertices of a unit
constexpr std::size_t UNITS_A_THREAD = 4;          // between two looks at the clock
constexpr std::size_t LISTED_AHEAD = 16;           // pairs that are fetched before they are listed
constexpr std::size_t LISTED_PIECE = 4096;         // pairs that a thread lists at once
constexpr std::size_t NEAR_PIECE = 4096;           // vertices that a thread moves near at once
constexpr std::size_t VIEWED_PIECE = 256;          // groups of faces that a thread looks at once
constexpr std::size_t PIECE = 4;                   // units that a thread takes at once
constexpr std::size_t COPIED_PIECE = 64;           // units of which a thread copies at once what is found
constexpr std::size_t PAIRS_PER_LOOK_AT_THE_CLOCK = 1024, LARGEST_BLOCK = 1 << 18;
constexpr std::chrono::nanoseconds LISTING_AN_INTERSECTION(400);  // sorting and copying one of half a million

std::size_t edgeCount(const SceneArrays& scene) {
  std::size_t n = 0;
  for (const SceneBody& body : scene.bodies()) n += body.tree(FeatureKind::EDGE).featureCount();
  return n;
}

/// Of ranks that ascend from body to body, those of one body.
template <class Feature>
struct FeaturesOfBody {
  std::uint16_t body = 0;
  std::size_t begin = 0, count = 0;
  const Feature* features = nullptr;
  FeaturesOfBody() = default;
  FeaturesOfBody(std::uint16_t of_body, std::size_t first, const std::vector<Feature>& all)
      : body(of_body), begin(first), count(all.size()), features(all.data()) {}
  bool hold(std::size_t rank) const { return rank - begin < count; }
  const Feature& operator[](std::size_t rank) const { return features[rank - begin]; }
  void fetch(std::size_t rank) const {
    if (hold(rank)) __builtin_prefetch(&features[rank - begin]);
  }
};

/// Of faces, or of the edges of a and the faces of b.
TreePair treesOf(const SceneArrays& scene, std::uint32_t a, std::uint32_t b, bool by_faces) {
  const FeatureKind first = by_faces ? FeatureKind::FACE : FeatureKind::EDGE;
  TreePair trees;
  trees.a = &scene.bodies()[a].tree(first);
  trees.b = &scene.bodies()[b].tree(FeatureKind::FACE);
  trees.span.times = Times::T0;
  trees.adjacent = a == b;
  trees.self = by_faces && a == b;
  return trees;
}

/// List i goes to place[i] and on, up to place[i + 1].
void join(const std::vector<std::vector<EdgeFace>>& lists, const std::vector<std::size_t>& place,
          std::vector<EdgeFace>& out, const StartStateSearch::Parallel& parallel) {
  out.resize(place.back());
  parallel(place.size() - 1, COPIED_PIECE, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      std::copy(lists[i].begin(), lists[i].end(), out.begin() + static_cast<std::ptrdiff_t>(place[i]));
    }
  });
}

}  // namespace

std::vector<StartIntersection> StartStateSearch::run(const SceneArrays& scene, bool continues, const Deadline& deadline,
                                                     StepStats& stats, const CrossingsWanted& wanted,
                                                     std::size_t threads, const Parallel& parallel) {
  releaseBurst(found_);
  releaseBurst(candidates_);
  releaseBurst(touched_);
  releaseBurst(groups_);
  releaseBurst(scratch_, groups_.size());
  releaseBurst(by_group_);
  releaseBurst(keys_);
  releaseBurst(other_keys_, keys_.size());
  for (std::vector<EdgeFace>& unit : unit_found_) {
    releaseBurst(unit);
    unit.clear();
  }
  tested_ = 0;
  cut_ = false;
  unfolded_ = wanted.unfolded;
  most_found_ = wanted.one_is_enough ? 0 : wanted.most_found;
  most_group_pairs_ =
      wanted.most_found == FoundLimit::NONE ? FoundLimit::NONE : std::size_t{tolerance::MAX_SUPERCLUSTER_PAIRS};
  has_deadline_ = deadline.canEnd();
  if (!(continues && known_)) clear();
  unsearched_ = searched_ ? unsearched_ + 1 : 0;
  if (unsearched_ == RESTS && found_.empty() && candidates_.empty()) {
    // Of a stream that goes on little is asked, of what is around contacts, and that is soon learnt again.
    neighbourhoods_ = std::vector<Neighbourhood>();
    near_ = std::vector<float>();
    views_ = std::vector<std::uint32_t>();
  }
  testCandidates(scene, deadline);
  if (!searched_ && !hasEnough()) search(scene, deadline, threads, parallel);
  cut_ = cut_ || hasEnough();
  if (hasEnough()) found_.resize(wanted.one_is_enough ? 1 : most_found_);
  whole_ = searched_ && !cut_ && candidates_.empty() && touched_.empty();
  known_ = false;  // until remember() has this step's contacts

  std::vector<StartIntersection> intersections;
  list(scene, found_, intersections, parallel);
  stats[Stage::START_STATE].in += tested_;
  stats[Stage::START_STATE].out += intersections.size();
  stats[Effect::START_STATE].in += tested_;
  stats[Effect::START_STATE].out += intersections.size();
  return intersections;
}

Deadline StartStateSearch::beforeListing(const std::vector<EdgeFace>& found, const Deadline& deadline) {
  return deadline.movedBy(-LISTING_AN_INTERSECTION * static_cast<std::int64_t>(found.size()));
}

void StartStateSearch::list(const SceneArrays& scene, const std::vector<EdgeFace>& pairs,
                            std::vector<StartIntersection>& out, const Parallel& parallel) {
  const std::vector<SceneBody>& bodies = scene.bodies();
  // Ranks ascend from body to body. As few digits as there are ranks of faces: the fewer there are to sort.
  std::uint32_t shift = 0;
  while ((bodies.back().face_begin + bodies.back().rank(FeatureKind::FACE).size()) >> shift != 0) ++shift;
  const auto rank = [&](FeatureKind kind, std::uint32_t body, std::uint32_t slot) -> std::uint64_t {
    return bodies[body].rank(kind)[slot];
  };
  keys_.resize(pairs.size());
  parallel(pairs.size(), LISTED_PIECE, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      const EdgeFace& pair = pairs[i];
      keys_[i] = rank(FeatureKind::EDGE, pair.edge_body, pair.edge) << shift |
                 rank(FeatureKind::FACE, pair.face_body, pair.face);
    }
  });
  radixSort(keys_, other_keys_);
  keys_.erase(std::unique(keys_.begin(), keys_.end()), keys_.end());  // a candidate that the search came to as well
  out.resize(keys_.size());
  parallel(keys_.size(), LISTED_PIECE, [&](std::size_t first, std::size_t last) {
    const auto bodyOf = [&](Index SceneBody::*begin, std::size_t rank) {
      const auto next = std::upper_bound(bodies.begin(), bodies.end(), rank,
                                         [begin](std::size_t r, const SceneBody& body) { return r < body.*begin; });
      return static_cast<std::uint16_t>(next - bodies.begin() - 1);
    };
    FeaturesOfBody<Edge> edges;
    FeaturesOfBody<Face> faces;
    const std::uint64_t face_bits = (std::uint64_t{1} << shift) - 1;
    for (std::size_t i = first; i < last; ++i) {
      const std::size_t edge = keys_[i] >> shift, face = keys_[i] & face_bits;
      if (!edges.hold(edge)) {
        const std::uint16_t body = bodyOf(&SceneBody::edge_begin, edge);
        edges = {body, bodies[body].edge_begin, bodies[body].setup.topology->edges()};
      }
      if (!faces.hold(face)) {
        const std::uint16_t body = bodyOf(&SceneBody::face_begin, face);
        faces = {body, bodies[body].face_begin, neighbourhoods_[body].listed};
      }
      const std::uint64_t soon = keys_[std::min(i + LISTED_AHEAD, last - 1)];
      edges.fetch(soon >> shift);
      faces.fetch(soon & face_bits);
      const Edge& e = edges[edge];
      const Face& f = faces[face];
      out[i].body = {edges.body, faces.body};
      out[i].vertex = {e[0], e[1], f[0], f[1], f[2]};
    }
  });
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
    const bool goes_on = test(pairs.data() + (first - pairs.begin()), static_cast<std::size_t>(last - first));
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
        tested_ += finders_.local().addMeeting(scene, first, count, found_);
        return !hasEnough();
      });
}

void StartStateSearch::search(const SceneArrays& scene, const Deadline& deadline, std::size_t threads,
                              const Parallel& parallel) {
  const std::vector<SceneBody>& bodies = scene.bodies();
  std::vector<std::uint8_t> by_faces;
  for (const SceneBody& body : bodies)
    by_faces.push_back(body.tree(FeatureKind::FACE).featureCount() > 0 && !body.masked);
  if (by_faces != by_faces_) next_bodies_ = {}, next_unit_ = 0;  // what a unit is has changed
  by_faces_ = std::move(by_faces);
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
    if (!by_faces_[a] || !by_faces_[b]) body_pairs_.push_back({b, a});  // else {a, b} is both
  }
  moveNear(scene, parallel);
  searched_ =
      goOn(body_pairs_, next_bodies_, next_unit_, [&] { return searchBodies(scene, deadline, threads, parallel); });
}

/// Of bodies that are searched by faces, from the middle of all of them.
void StartStateSearch::moveNear(const SceneArrays& scene, const Parallel& parallel) {
  std::vector<std::uint8_t> wanted(by_faces_.size(), 0);
  for (const BodyPair& pair : body_pairs_) {
    if (by_faces_[pair[0]] && by_faces_[pair[1]]) wanted[pair[0]] = wanted[pair[1]] = 1;
  }
  double low[3], high[3], middle[4] = {}, largest = 0;
  for (int k = 0; k < 3; ++k) {
    low[k] = std::numeric_limits<double>::infinity();
    high[k] = -low[k];
    for (std::size_t b = 0; b < wanted.size(); ++b) {
      if (!wanted[b]) continue;
      low[k] = std::min(low[k], scene.bodies()[b].bounds_min[k]);
      high[k] = std::max(high[k], scene.bodies()[b].bounds_max[k]);
    }
    if (low[k] > high[k]) return;
    middle[k] = low[k] / 2 + high[k] / 2;
    largest = std::max({largest, high[k] - middle[k], middle[k] - low[k]});
  }
  largest_near_ = simd::largestNear(largest);
  near_.resize(4 * scene.vertexCount());
  for (std::size_t b = 0; b < wanted.size(); ++b) {
    if (!wanted[b]) continue;
    parallel(scene.bodies()[b].usedCount(), NEAR_PIECE, [&](std::size_t first, std::size_t last) {
      first += scene.bodies()[b].internal_begin, last += scene.bodies()[b].internal_begin;
      simd::moveNear(scene.vertices()[first].t0, last - first, middle, near_.data() + 4 * first);
    });
  }
}

void StartStateSearch::viewFaces(const ClusterTree& faces, const Parallel& parallel) {
  const std::size_t groups = faces.level(0).groups, slots = groups * simd::GROUP;
  views_.resize(slots + 2);
  views_[slots] = simd::TURNS;
  views_[slots + 1] = 0;
  parallel(groups, VIEWED_PIECE, [&](std::size_t first, std::size_t last) {
    simd::faceViews({near_.data(), largest_near_}, faces.leaves(false).vertices + first * 3 * simd::GROUP, last - first,
                    views_.data() + first * simd::GROUP);
  });
}

/// From next_unit_ on.
void StartStateSearch::setUnits(std::size_t fans) {
  fans_ = static_cast<std::uint32_t>(fans);
  keys_.clear();
  for (std::size_t p = 0; p < groups_.size(); p += 2) {
    if (fans_ + groups_[p] >= next_unit_) keys_.push_back(std::uint64_t{groups_[p]} << 32 | groups_[p + 1]);
  }
  radixSort(keys_, other_keys_);
  by_group_.clear();
  for (const std::uint64_t key : keys_) {
    by_group_.push_back({static_cast<std::uint32_t>(key >> 32), static_cast<std::uint32_t>(key)});
  }
  unit_number_.clear();
  unit_begin_.clear();
  for (std::uint32_t fan = next_unit_; fan < fans_; ++fan) {
    unit_number_.push_back(fan);
    unit_begin_.push_back(0);
  }
  for (std::size_t p = 0; p < by_group_.size(); ++p) {
    if (p > 0 && by_group_[p][0] == by_group_[p - 1][0]) continue;
    unit_number_.push_back(fans_ + by_group_[p][0]);
    unit_begin_.push_back(p);
  }
  unit_begin_.push_back(by_group_.size());
}

bool StartStateSearch::searchUnit(CrossingFinder& finder, const TreePair& trees, std::size_t unit,
                                  std::vector<EdgeFace>& found) const {
  const std::uint32_t a = next_bodies_[0], b = next_bodies_[1], number = unit_number_[unit];
  if (number < fans_) {
    const std::size_t first = number * FAN_UNIT, end = neighbourhoods_[a].fans.begin.size() - 1;
    return finder.searchFans(a, first, std::min(first + FAN_UNIT, end), found);
  }
  const std::uint32_t* groups = by_group_[unit_begin_[unit]].data();
  const std::size_t count = unit_begin_[unit + 1] - unit_begin_[unit];
  return by_faces_[a] && by_faces_[b] ? finder.searchFaces(a, b, trees, groups, count, found)
                                      : finder.searchEdges(a, b, trees, groups, count, found);
}

/// Goes on at next_unit_, by one unit at the least; false: it was ended, and next_unit_ says where. A unit is some of a
/// body's fans, or a group of the first one's features with all groups of the other's that it may meet.
bool StartStateSearch::searchBodies(const SceneArrays& scene, const Deadline& deadline, std::size_t threads,
                                    const Parallel& parallel) {
  const std::uint32_t a = next_bodies_[0], b = next_bodies_[1];
  const bool by_faces = by_faces_[a] && by_faces_[b];
  TreePair trees = treesOf(scene, a, b, by_faces);
  if (trees.a->featureCount() == 0 || trees.b->featureCount() == 0) return true;
  if (beforeListing(deadline).isOver()) return false;
  // What does not meet during the step does not at t=0.
  if (a == b && unfolded_ && (*unfolded_)[a].isCertified()) return true;
  for (const std::uint32_t body : next_bodies_) {
    learn(scene, body);
    if (by_faces) neighbourhoods_[body].learnFaces(scene.bodies()[body]);
  }
  const simd::KnownPairs sharing = neighbourhoods_[a].sharing.view();
  if (trees.self) trees.sharing = &sharing;
  cut_ = superclusterPairs(trees, groups_, scratch_, most_group_pairs_).toc <= 1 || cut_;
  const std::size_t fan_groups = trees.self ? neighbourhoods_[a].fans.begin.size() - 1 : 0;
  setUnits((fan_groups + FAN_UNIT - 1) / FAN_UNIT);
  if (next_unit_ < fans_) viewFaces(*trees.a, parallel);
  const bool limited = deadline.canEnd() || most_found_ != FoundLimit::NONE;
  const std::size_t count = unit_number_.size(), block = !limited ? count : threads == 1 ? 1 : UNITS_A_THREAD * threads;
  const bool alone = threads == 1;  // what is found goes to its place at once
  for (std::size_t first = 0; first < count; first += block) {
    next_unit_ = unit_number_[first];
    // The first group goes with the last fans: of a small body both are one unit.
    if (first > 0 && next_unit_ != fans_ && beforeListing(deadline).isOver()) return false;
    const std::size_t n = std::min(block, count - first);
    if (unit_found_.size() < n) unit_found_.resize(n);
    unit_whole_.assign(n, 0);
    unit_tested_.assign(n, 0);
    parallel(n, limited ? 1 : PIECE, [&](std::size_t from, std::size_t to) {
      CrossingFinder& finder = finders_.local();
      finder.begin({&scene,
                    &neighbourhoods_,
                    {near_.data(), largest_near_},
                    views_.data(),
                    beforeListing(deadline),
                    alone ? most_found_ : most_found_ - found_.size()});
      for (std::size_t i = from; i < to; ++i) {
        unit_found_[i].clear();
        const std::uint64_t before = finder.tested();
        unit_whole_[i] = searchUnit(finder, trees, first + i, alone ? found_ : unit_found_[i]);
        unit_tested_[i] = finder.tested() - before;
      }
    });
    std::vector<std::size_t> place{found_.size()};  // of what is found in the units up to the one that ends the search
    bool goes_on = true;
    for (std::size_t i = 0; i < n && goes_on; ++i) {
      tested_ += unit_tested_[i];
      place.push_back(place.back() + unit_found_[i].size());
      goes_on = unit_whole_[i] && place.back() <= most_found_;
      if (!goes_on) next_unit_ = unit_number_[first + i];
    }
    join(unit_found_, place, found_, parallel);
    if (!goes_on) return false;
  }
  return true;
}

void StartStateSearch::remember(const SceneArrays& scene, const std::vector<Contact>& contacts, bool complete) {
  known_ = false;
  if (!complete || cut_) return;
  const std::size_t limit = std::max(
      FEW_CANDIDATES,
      edgeCount(scene) * (has_deadline_ ? CANDIDATES_PER_100_EDGES_WITH_DEADLINE : CANDIDATES_PER_100_EDGES) / 100);
  const std::size_t most = limit / CANDIDATES_PER_CONTACT;  // those with the map come last
  if (contacts.size() > most && !factsOf(contacts[most].kind).isOnMap()) return;
  for (const Contact& contact : contacts) {
    if (factsOf(contact.kind).isOnMap()) continue;
    touched_.push_back({contact.kind, contact.body[0], contact.body[1], contact.vertex});
    if (CANDIDATES_PER_CONTACT * touched_.size() + candidates_.size() > limit) return;
  }
  known_ = true;
}

void StartStateSearch::addCandidates(const SceneArrays& scene, const Touched& contact, std::vector<EdgeFace>& out) {
  const std::uint32_t a = contact.first_body, b = contact.second_body;
  learn(scene, a), learn(scene, b);
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

void StartStateSearch::learn(const SceneArrays& scene, std::size_t body) {
  if (neighbourhoods_.size() < scene.bodies().size()) neighbourhoods_.resize(scene.bodies().size());
  if (!neighbourhoods_[body].internal_of_local.empty()) return;
  Neighbourhood learnt;
  learnt.learn(scene, body);
  neighbourhoods_[body] = std::move(learnt);
}

void StartStateSearch::clear() {
  known_ = false;
  searched_ = false;
  next_bodies_ = {};
  next_unit_ = 0;
  found_.clear();
  candidates_.clear();
  touched_.clear();
}

}  // namespace dccd
