#include "step/start/crossing_finder.h"

#include <algorithm>

#include "step/start/segment_triangle.h"

namespace dccd {
namespace {

constexpr std::size_t NEXT = simd::GROUP;  // vertex of a lane
// Pairs that stay in the first-level cache; with a deadline, also those between two looks at the clock.
constexpr std::size_t CHUNK = 512, CHUNK_WITH_DEADLINE = 64;
constexpr std::size_t FETCHED_AHEAD = 8;  // pairs of faces, or vertices
constexpr std::uint32_t after(std::uint32_t corner) { return corner == 2 ? 0 : corner + 1; }
// A unit that is begun may go on for this many tests, so that a search comes to its end in the end.
constexpr std::size_t TESTS_IN_ANY_CASE = 1024, FACE_PAIRS_A_TEST = 8;
constexpr unsigned EDGES = 0x3f;  // of a pair of faces

}  // namespace

void CrossingFinder::begin(const Search& search) {
  search_ = search;
  tested_ = 0;
  pairs_.clear();
  corners_.clear();
}

bool CrossingFinder::goesOn(const std::vector<EdgeFace>& found) {
  if (found.size() > search_.most_found) return false;
  return work_ < TESTS_IN_ANY_CASE || !search_.deadline.isOver();
}

void CrossingFinder::add(const SceneArrays& scene, const EdgeFace& pair) {
  const Index* e = scene.bodies()[pair.edge_body].tree(FeatureKind::EDGE).lane<2>(pair.edge);
  const Index* f = scene.bodies()[pair.face_body].tree(FeatureKind::FACE).lane<3>(pair.face);
  add(pair, {e[0], e[NEXT], f[0], f[NEXT], f[2 * NEXT]});
}

void CrossingFinder::test(const double* positions, std::size_t first, std::size_t last, std::vector<EdgeFace>& found) {
  meet_.resize(last - first);
  segmentsMeetTriangles(positions, corners_.data() + first, last - first, meet_.data());
  for (std::size_t i = 0; i < meet_.size(); ++i) {
    if (meet_[i]) found.push_back(pairs_[first + i]);
  }
}

std::size_t CrossingFinder::addMeeting(const SceneArrays& scene, const EdgeFace* pairs, std::size_t count,
                                       std::vector<EdgeFace>& found) {
  std::size_t tested = 0;
  for (const EdgeFace *end = pairs + count, *next = pairs; next != end;) {
    pairs_.clear();
    corners_.clear();
    for (; next != end && pairs_.size() < CHUNK; ++next) {
      // A body that is far from all others meets none of them, and where it is in this step was not recorded.
      if (scene.bodies()[next->edge_body].passed_by || scene.bodies()[next->face_body].passed_by) continue;
      const bool is_checked = scene.bodies()[next->edge_body].holds(FeatureKind::EDGE, next->edge) &&
                              scene.bodies()[next->face_body].holds(FeatureKind::FACE, next->face);
      if (is_checked) add(scene, *next);
    }
    test(scene.vertices()->t0, 0, pairs_.size(), found);
    tested += pairs_.size();
  }
  pairs_.clear();
  corners_.clear();
  return tested;
}

bool CrossingFinder::flush(std::vector<EdgeFace>& found) {
  const std::size_t piece = search_.deadline.canEnd() ? CHUNK_WITH_DEADLINE : CHUNK;
  bool goes_on = true;
  for (std::size_t first = 0, last = 0; first < pairs_.size() && goes_on; first = last) {
    last = std::min(first + piece, pairs_.size());
    test(search_.scene->vertices()->t0, first, last, found);
    work_ += last - first;
    goes_on = goesOn(found);
  }
  pairs_.clear();
  corners_.clear();
  return goes_on;
}

bool CrossingFinder::searchEdges(std::uint32_t edge_body, std::uint32_t face_body, const TreePair& trees,
                                 const std::uint32_t* group_pairs, std::size_t count, std::vector<EdgeFace>& found) {
  work_ = 0;
  return stream_.run(trees, group_pairs, count, [&](const std::uint32_t* slots, std::size_t n) {
    for (std::size_t i = 0; i < n; ++i) {
      add(*search_.scene, {edge_body, slots[2 * i], face_body, slots[2 * i + 1]});
    }
    tested_ += n;
    return flush(found);
  });
}

/// Of those edges of pairs of faces that are asked about: what certainly meets to found, what may to pairs_. asked:
/// such bits of each pair; null: of an edge's faces the one that stands for it is asked.
void CrossingFinder::addFacePairs(std::uint32_t a, std::uint32_t b, const std::uint32_t* slots, std::size_t n,
                                  const std::uint8_t* asked, std::vector<EdgeFace>& found) {
  const Neighbourhood &around_a = (*search_.neighbourhoods)[a], &around_b = (*search_.neighbourhoods)[b];
  const ClusterTree& faces_a = search_.scene->bodies()[a].tree(FeatureKind::FACE);
  const ClusterTree& faces_b = search_.scene->bodies()[b].tree(FeatureKind::FACE);
  face_pairs_.resize(CHUNK + simd::PAIRS_BEHIND);
  const auto [all_asked, left] =
      simd::facePairFilter(search_.vertices, {faces_a.leaves(false).vertices, around_a.owns.data()},
                           {faces_b.leaves(false).vertices, around_b.owns.data()}, slots, asked, n, face_pairs_.data());
  tested_ += all_asked;
  work_ += n / FACE_PAIRS_A_TEST;
  for (std::size_t c = 0; c < left; ++c) {
    const std::uint32_t soon = face_pairs_[std::min(c + FETCHED_AHEAD, left - 1)] >> simd::PLACE_SHIFT;
    __builtin_prefetch(&around_a.own_edges[slots[2 * soon]]);
    __builtin_prefetch(&around_b.own_edges[slots[2 * soon + 1]]);
    const std::uint32_t i = face_pairs_[c] >> simd::PLACE_SHIFT, face = slots[2 * i], other = slots[2 * i + 1];
    const unsigned meeting = face_pairs_[c] >> simd::MEETS_SHIFT & EDGES;
    for (unsigned edges = meeting; edges != 0; edges &= edges - 1) {
      const auto bit = static_cast<std::size_t>(__builtin_ctz(edges));
      found.push_back(bit < 3 ? EdgeFace{a, around_a.own_edges[face][bit], b, other}
                              : EdgeFace{b, around_b.own_edges[other][bit - 3], a, face});
    }
    const unsigned unsure = face_pairs_[c] & EDGES & ~meeting;
    if (unsure == 0) continue;
    const Index *f = faces_a.lane<3>(face), *g = faces_b.lane<3>(other);
    for (std::size_t k = 0; k < 3; ++k) {  // only their copies in float were read
      __builtin_prefetch(search_.scene->vertices()[f[k * NEXT]].t0);
      __builtin_prefetch(search_.scene->vertices()[g[k * NEXT]].t0);
    }
    for (unsigned edges = unsure; edges != 0; edges &= edges - 1) {
      const auto bit = static_cast<std::size_t>(__builtin_ctz(edges));
      const std::size_t k = bit % 3, next = k == 2 ? 0 : k + 1;
      if (bit < 3) {
        add({a, around_a.own_edges[face][k], b, other}, {f[k * NEXT], f[next * NEXT], g[0], g[NEXT], g[2 * NEXT]});
      } else {
        add({b, around_b.own_edges[other][k], a, face}, {g[k * NEXT], g[next * NEXT], f[0], f[NEXT], f[2 * NEXT]});
      }
    }
  }
}

bool CrossingFinder::searchFaces(std::uint32_t a, std::uint32_t b, const TreePair& trees,
                                 const std::uint32_t* group_pairs, std::size_t count, std::vector<EdgeFace>& found) {
  work_ = 0;
  const bool whole = stream_.run(trees, group_pairs, count, [&](const std::uint32_t* slots, std::size_t count) {
    for (const std::uint32_t* end = slots + 2 * count; slots != end;) {
      const std::size_t n = std::min(CHUNK, static_cast<std::size_t>(end - slots) / 2);
      addFacePairs(a, b, slots, n, nullptr, found);
      if (pairs_.size() >= CHUNK && !flush(found)) return false;
      slots += 2 * n;
    }
    return goesOn(found);
  });
  return flush(found) && whole;
}

/// Pairs of faces at the vertex that share no edge, of which the edges opposite the vertex are asked about.
void CrossingFinder::addFan(std::uint32_t body, const Neighbourhood& around, std::size_t vertex) {
  const ClusterTree& faces = search_.scene->bodies()[body].tree(FeatureKind::FACE);
  const std::uint32_t first = around.faces.begin[vertex], n = around.faces.begin[vertex + 1] - first;
  fan_.resize(n);
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t slot = around.faces.slots[first + i], k = after(around.corner[first + i]);
    const Index* face = faces.feature(slot);
    fan_[i] = {slot, around.owns[slot] & 1u << k, face[k], face[after(k)]};
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    if (fan_slots_.size() < 2 * (fan_pairs_ + n)) {  // the last one to grow, should memory end
      fan_asked_.resize(2 * (fan_pairs_ + n));
      fan_slots_.resize(2 * fan_asked_.size());
    }
    const FaceOfFan one = fan_[i], *const fan = fan_.data();
    // In registers: what a byte is written to might be these members.
    std::uint32_t* slots = fan_slots_.data() + 2 * fan_pairs_;
    std::uint8_t* asked = fan_asked_.data() + fan_pairs_;
    for (std::uint32_t j = i + 1; j < n; ++j) {  // without a branch on what nothing foretells
      const FaceOfFan& other = fan[j];
      const unsigned edges = one.edge | other.edge << simd::SECOND_EDGES_SHIFT;
      const std::size_t is_pair = (edges != 0) & (one.from != other.from) & (one.from != other.to) &
                                  (one.to != other.from) & (one.to != other.to);
      slots[0] = one.slot;
      slots[1] = other.slot;
      *asked = static_cast<std::uint8_t>(edges);
      slots += 2 * is_pair;
      asked += is_pair;
    }
    fan_pairs_ = static_cast<std::size_t>(asked - fan_asked_.data());
  }
}

/// As flush() does.
bool CrossingFinder::flushFans(std::uint32_t body, std::vector<EdgeFace>& found) {
  for (std::size_t first = 0; first < fan_pairs_; first += CHUNK) {
    const std::size_t n = std::min(CHUNK, fan_pairs_ - first);
    addFacePairs(body, body, fan_slots_.data() + 2 * first, n, fan_asked_.data() + first, found);
    if (!flush(found)) return false;
  }
  fan_pairs_ = 0;
  return goesOn(found);
}

bool CrossingFinder::searchFans(std::uint32_t body, std::size_t first, std::size_t last, std::vector<EdgeFace>& found) {
  work_ = 0;
  fan_pairs_ = 0;
  const Neighbourhood& around = (*search_.neighbourhoods)[body];
  const std::size_t vertices = around.faces.begin.size() - 1;
  one_turn_.resize(last - first);
  simd::fansOfOneTurn(search_.views, around.fans.view(), first, last - first, one_turn_.data());
  other_turns_.clear();
  for (std::size_t group = first; group < last; ++group) {
    for (std::uint32_t left = ~std::uint32_t{one_turn_[group - first]} & 0xffff; left != 0; left &= left - 1) {
      other_turns_.push_back(group * simd::GROUP + static_cast<std::size_t>(__builtin_ctz(left)));
    }
  }
  while (!other_turns_.empty() && other_turns_.back() >= vertices) other_turns_.pop_back();
  const ClusterTree& faces = search_.scene->bodies()[body].tree(FeatureKind::FACE);
  for (std::size_t i = 0; i < other_turns_.size(); ++i) {
    const std::size_t soon = other_turns_[std::min(i + FETCHED_AHEAD, other_turns_.size() - 1)];
    const std::size_t later = other_turns_[std::min(i + 2 * FETCHED_AHEAD, other_turns_.size() - 1)];
    __builtin_prefetch(around.faces.slots.data() + around.faces.begin[later]);
    for (std::uint32_t f = around.faces.begin[soon]; f < around.faces.begin[soon + 1]; ++f) {
      __builtin_prefetch(faces.feature(around.faces.slots[f]));
    }
    addFan(body, around, other_turns_[i]);
    if (fan_pairs_ >= CHUNK && !flushFans(body, found)) return false;
  }
  return flushFans(body, found);
}

}  // namespace dccd
