#include "step/start/crossing_finder.h"

#include <algorithm>

#include "obstacle/burst.h"
#include "step/start/segment_triangle.h"

namespace dccd {
namespace {

constexpr std::size_t NEXT = simd::GROUP;  // vertex of a lane
// Pairs that stay in the first-level cache; with a deadline, also those between two looks at the clock.
constexpr std::size_t CHUNK = 512, CHUNK_WITH_DEADLINE = 64;
constexpr std::size_t GROUPS_VIEWED = 4;  // at once, of neighbouring faces
// A unit that is begun may go on for this many tests, so that a search comes to its end in the end.
constexpr std::size_t TESTS_IN_ANY_CASE = 1024, FACE_PAIRS_A_TEST = 8;

}  // namespace

void CrossingFinder::begin(const Search& search) {
  search_ = search;
  tested_ = 0;
  pairs_.clear();
  viewed_.clear();
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

std::size_t CrossingFinder::addMeeting(const SceneArrays& scene, const EdgeFace* pairs, std::size_t count, int at,
                                       std::vector<EdgeFace>& found) {
  const double* positions = at == 0 ? scene.vertices()->t0 : scene.vertices()->t1;
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
    test(positions, 0, pairs_.size(), found);
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

bool CrossingFinder::searchFaces(std::uint32_t a, std::uint32_t b, const TreePair& trees,
                                 const std::uint32_t* group_pairs, std::size_t count, std::vector<EdgeFace>& found) {
  work_ = 0;
  edges_.resize(CHUNK);
  crossing_.resize(CHUNK);
  const Neighbourhood &around_a = (*search_.neighbourhoods)[a], &around_b = (*search_.neighbourhoods)[b];
  const simd::FacesView faces_a{trees.a->leaves(false).vertices, around_a.owns.data()};
  const simd::FacesView faces_b{trees.b->leaves(false).vertices, around_b.owns.data()};
  const bool whole = stream_.run(trees, group_pairs, count, [&](const std::uint32_t* slots, std::size_t count) {
    for (const std::uint32_t* end = slots + 2 * count; slots != end;) {
      const std::size_t n = std::min(CHUNK, static_cast<std::size_t>(end - slots) / 2);
      tested_ += simd::facePairFilter(search_.vertices, faces_a, faces_b, slots, n, edges_.data());
      work_ += n / FACE_PAIRS_A_TEST;
      // First which, without a branch on what nothing foretells.
      std::size_t crossing = 0;
      for (std::size_t i = 0; i < n; ++i) {
        crossing_[crossing] = static_cast<std::uint32_t>(i);
        crossing += edges_[i] != 0;
      }
      for (std::size_t c = 0; c < crossing; ++c) {
        const std::size_t i = crossing_[c];
        const std::uint32_t face = slots[2 * i], other = slots[2 * i + 1];
        const Index *f = trees.a->lane<3>(face), *g = trees.b->lane<3>(other);
        for (std::size_t k = 0; k < 3; ++k) {  // only their copies in float were read
          __builtin_prefetch(search_.scene->vertices()[f[k * NEXT]].t0);
          __builtin_prefetch(search_.scene->vertices()[g[k * NEXT]].t0);
        }
        for (unsigned edges = edges_[i]; edges != 0; edges &= edges - 1) {
          const auto bit = static_cast<std::size_t>(__builtin_ctz(edges));
          const std::size_t k = bit % 3, next = k == 2 ? 0 : k + 1;
          if (bit < 3) {
            add({a, around_a.own_edges[face][k], b, other}, {f[k * NEXT], f[next * NEXT], g[0], g[NEXT], g[2 * NEXT]});
          } else {
            add({b, around_b.own_edges[other][k], a, face}, {g[k * NEXT], g[next * NEXT], f[0], f[NEXT], f[2 * NEXT]});
          }
        }
      }
      if (pairs_.size() >= CHUNK && !flush(found)) return false;
      slots += 2 * n;
    }
    return goesOn(found);
  });
  return flush(found) && whole;
}

/// What is seen of a face along the axes, of the body that is searched.
std::uint16_t CrossingFinder::viewOf(std::uint32_t body, std::uint32_t face) {
  const std::size_t run = face / simd::GROUP / GROUPS_VIEWED;
  if (!viewed_[run]) {
    const ClusterTree& faces = search_.scene->bodies()[body].tree(FeatureKind::FACE);
    const std::size_t first = run * GROUPS_VIEWED, count = std::min(GROUPS_VIEWED, faces.level(0).groups - first);
    simd::faceViews(search_.vertices, faces.leaves(false).vertices + first * 3 * simd::GROUP, count,
                    views_.data() + first * simd::GROUP);
    viewed_[run] = 1;
  }
  return views_[face];
}

/// Seen along some axis, the faces at the vertex lie around it once: no two of them meet but in what they share.
bool CrossingFinder::isOneTurn(std::uint32_t body, const Neighbourhood& around, std::size_t vertex) {
  static constexpr std::uint32_t SPREAD[8] = {0x000000, 0x000001, 0x000100, 0x000101,
                                              0x010000, 0x010001, 0x010100, 0x010101};  // a bit into a byte
  constexpr std::uint32_t MOST_FACES = 255;                                             // that a byte counts
  const std::uint32_t first = around.faces.begin[vertex], last = around.faces.begin[vertex + 1];
  if (!around.closed[vertex] || last - first > MOST_FACES) return false;
  unsigned turns = simd::RISES - 1;
  std::uint32_t rises = 0;  // a byte for each axis
  for (std::uint32_t i = first; i < last; ++i) {
    const unsigned view = viewOf(body, around.faces.slots[i]);
    turns &= view;
    rises += SPREAD[view / simd::RISES >> (3 * around.corner[i]) & 7];
  }
  turns |= turns / simd::TURNS_RIGHT;
  for (int k = 0; k < 3; ++k) {
    if ((turns >> k & 1) != 0 && (rises >> (8 * k) & 0xff) == 1) return true;
  }
  return false;
}

/// The edges opposite the vertex, of the faces at it, against those faces at it that share no edge with theirs.
void CrossingFinder::addFan(std::uint32_t body, const Neighbourhood& around, std::size_t vertex) {
  const ClusterTree& faces = search_.scene->bodies()[body].tree(FeatureKind::FACE);
  const std::uint32_t first = around.faces.begin[vertex], last = around.faces.begin[vertex + 1];
  const auto opposite = [&](std::uint32_t i) {
    const Index* face = faces.feature(around.faces.slots[i]);
    return std::array<Index, 2>{face[(around.corner[i] + 1u) % 3], face[(around.corner[i] + 2u) % 3]};
  };
  fan_.resize(last - first);
  for (std::uint32_t i = first; i < last; ++i) fan_[i - first] = opposite(i);
  const Index at = search_.scene->bodies()[body].internal_begin + static_cast<Index>(vertex);
  for (std::uint32_t i = first; i < last; ++i) {
    const std::uint32_t edge = around.own_edges[around.faces.slots[i]][(around.corner[i] + 1u) % 3];
    if (edge == NO_INDEX) continue;
    const auto [from, to] = fan_[i - first];
    for (std::uint32_t j = first; j < last; ++j) {
      const auto [x, y] = fan_[j - first];
      if ((from == x) | (from == y) | (to == x) | (to == y)) continue;
      ++tested_;
      add({body, edge, body, around.faces.slots[j]}, {from, to, at, x, y});
    }
  }
}

bool CrossingFinder::searchFans(std::uint32_t body, std::size_t first, std::size_t last, std::vector<EdgeFace>& found) {
  work_ = 0;
  const std::size_t groups = search_.scene->bodies()[body].tree(FeatureKind::FACE).level(0).groups;
  const std::size_t runs = (groups + GROUPS_VIEWED - 1) / GROUPS_VIEWED;
  if (viewed_.size() != runs || viewed_body_ != body) {
    viewed_.assign(runs, 0);
    views_.resize(groups * simd::GROUP);
    viewed_body_ = body;
  }
  const Neighbourhood& around = (*search_.neighbourhoods)[body];
  for (std::size_t vertex = first; vertex < last; ++vertex) {
    if (!isOneTurn(body, around, vertex)) addFan(body, around, vertex);
    if (pairs_.size() >= CHUNK && !flush(found)) return false;
  }
  return flush(found);
}

}  // namespace dccd
