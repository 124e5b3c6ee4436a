#include "step/start/inside.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "obstacle/axis_predicates.h"
#include "step/start/start_state.h"

namespace dccd {
namespace {

constexpr std::size_t QUESTIONS_PER_LOOK_AT_THE_CLOCK = 16;

/// On which side of the line pq the point is, seen along z, moved by (e, e^2): what the movement adds to the cross
/// product decides where that is 0, e before e^2. 0 where the line is seen as a point, and so its face as a line.
int sideOf(const double* p, const double* q, const double* point) {
  const int side = orientation2d(p[0], p[1], q[0], q[1], point[0], point[1]);
  if (side != 0) return side;
  if (p[1] != q[1]) return q[1] < p[1] ? 1 : -1;
  return (q[0] > p[0]) - (q[0] < p[0]);
}

/// Calls visit(slot) for the features whose bounds at t=0 the half-line from the record along +z meets. Bounds hold
/// their features, and records keep the order of coordinates, so no feature that the half-line meets is missed.
template <class Visit>
void visitAbove(const ClusterTree& tree, const std::uint16_t* record, std::size_t level, std::size_t group,
                const Visit& visit) {
  if (level == 0) tree.needLeaves(group);
  const std::uint16_t* low = tree.level(level).soa.data() + group * simd::SOA_SIZE;
  const std::uint16_t* high = low + simd::SOA_SIZE / 2;
  for (std::size_t lane = 0; lane < simd::GROUP; ++lane) {
    const auto lowest = [&](std::size_t axis) { return low[simd::soaIndex(axis, lane)]; };
    const auto highest = [&](std::size_t axis) { return simd::turned(high[simd::soaIndex(axis, lane)]); };
    if (lowest(0) > record[0] || highest(0) < record[0] || lowest(1) > record[1] || highest(1) < record[1]) continue;
    if (highest(2) < record[2]) continue;
    const std::size_t node = group * simd::GROUP + lane;
    if (level > 0) {
      if (node < tree.level(level - 1).groups) visitAbove(tree, record, level - 1, node, visit);
    } else if (node < tree.featureCount()) {
      visit(node);
    }
  }
}

}  // namespace

Sight sightOf(const double* point, const double* a, const double* b, const double* c) {
  for (int k = 0; k < 2; ++k) {
    if (point[k] < std::min({a[k], b[k], c[k]}) || point[k] > std::max({a[k], b[k], c[k]})) return Sight::PAST;
  }
  if (point[2] > std::max({a[2], b[2], c[2]})) return Sight::PAST;
  const bool level = point[2] >= std::min({a[2], b[2], c[2]});  // else all of it is higher
  if (level && segmentMeetsTriangle(point, point, a, b, c)) return Sight::TOUCHED;
  const int side = sideOf(a, b, point);
  if (side == 0 || sideOf(b, c, point) != side || sideOf(c, a, point) != side) return Sight::PAST;
  // In the face's plane it would be on the face, for it is seen on it.
  return !level || side * orientation3d(a, b, c, point) < 0 ? Sight::ABOVE : Sight::PAST;
}

bool InsideSearch::isInside(const SceneArrays& scene, const Question& question) {
  // A far body is inside of nothing, and where it is in this step was perhaps not recorded.
  if (scene.bodies()[question.body].far || scene.bodies()[question.closed].far) return false;
  const auto x = [&](Index v) { return scene.vertices()[v].t0; };
  const ClusterTree& faces = scene.bodies()[question.closed].tree(FeatureKind::FACE);
  const double* point = x(question.internal);
  bool touched = false, enclosed = false;
  visitAbove(faces, scene.record(question.internal), faces.height() - 1, 0, [&](std::size_t slot) {
    if (touched || scene.bodies()[question.closed].enclosesNothing(slot)) return;
    const Index* f = faces.feature(slot);
    const Sight sight = sightOf(point, x(f[0]), x(f[1]), x(f[2]));
    touched = sight == Sight::TOUCHED;
    enclosed = enclosed != (sight == Sight::ABOVE);
  });
  return touched || enclosed;
}

const std::vector<StartIntersection>& InsideSearch::run(const SceneArrays& scene, bool continues,
                                                        const Deadline& deadline, StepStats& stats) {
  asked_ = 0;
  // With vertices left out the pieces are others: such a step is asked anew, and so is the next.
  const bool all_finite = stats.unchecked_vertices == 0;
  if (!(all_finite && pieces_of_all_)) keepBodies(0);
  pieces_of_all_ = all_finite;
  const bool same_surfaces = takeSurfaces(scene);
  if (!(continues && known_ && all_finite && same_surfaces)) clear();
  askOpen(scene, deadline);
  if (!searched_) search(scene, deadline);
  whole_ = searched_ && open_.empty();
  known_ = false;  // until remember() has this step's contacts
  std::sort(inside_.begin(), inside_.end());
  inside_.erase(std::unique(inside_.begin(), inside_.end()), inside_.end());  // asked again, and by the search as well
  list(inside_, intersections_);
  for (StageStats* of : {&stats[Stage::START_STATE], &stats[Effect::START_STATE]}) {
    of->in += asked_;
    of->out += inside_.size();
  }
  return intersections_;
}

/// False: some surface is not what it was in the step before.
bool InsideSearch::takeSurfaces(const SceneArrays& scene) {
  const auto surfaceOf = [](const SceneBody& body) {
    return static_cast<std::uint8_t>((body.hasInside() ? 2 : 0) + (body.sewn ? 1 : 0));
  };
  bool same = surfaces_.size() == scene.bodies().size();
  surfaces_.resize(scene.bodies().size());
  for (std::size_t b = 0; b < surfaces_.size(); ++b) {
    const std::uint8_t before = std::exchange(surfaces_[b], surfaceOf(scene.bodies()[b]));
    same = same && before == surfaces_[b];
  }
  return same;
}

void InsideSearch::list(const std::vector<Question>& inside, std::vector<StartIntersection>& out) {
  out.clear();
  for (const Question& q : inside) {
    StartIntersection found;
    found.body = {static_cast<std::uint16_t>(q.body), static_cast<std::uint16_t>(q.closed)};
    found.vertex[0] = q.vertex;
    out.push_back(found);
  }
}

void InsideSearch::ask(const SceneArrays& scene, const Question& question) {
  ++asked_;
  if (isInside(scene, question)) inside_.push_back(question);
}

void InsideSearch::askOpen(const SceneArrays& scene, const Deadline& deadline) {
  inside_.erase(std::remove_if(inside_.begin(), inside_.end(),
                               [&](const Question& q) { return std::binary_search(open_.begin(), open_.end(), q); }),
                inside_.end());
  for (; !open_.empty(); open_.pop_back()) {
    if (open_.size() % QUESTIONS_PER_LOOK_AT_THE_CLOCK == 0 && deadline.isOver()) return;
    ask(scene, open_.back());
  }
}

void InsideSearch::search(const SceneArrays& scene, const Deadline& deadline) {
  const std::vector<SceneBody>& bodies = scene.bodies();
  body_pairs_.clear();
  overlapping_.clear();
  const auto has_inside = [](const SceneBody& body) { return body.hasInside(); };
  if (bodies.size() > 1 && std::any_of(bodies.begin(), bodies.end(), has_inside)) {
    scene.overlappingBodies(true, overlapping_, scratch_);
  }
  for (std::size_t p = 0; p < overlapping_.size(); p += 2) {
    const std::uint32_t a = overlapping_[p], b = overlapping_[p + 1];
    if (!meet(bodies[a].setup, a, bodies[b].setup, b)) continue;
    if (bodies[b].hasInside()) body_pairs_.push_back({a, b});
    if (bodies[a].hasInside()) body_pairs_.push_back({b, a});
  }
  searched_ = goOn(body_pairs_, next_pair_, next_piece_, [&] { return searchBodies(scene, deadline); });
}

/// Goes on at next_piece_; false: it was ended there.
bool InsideSearch::searchBodies(const SceneArrays& scene, const Deadline& deadline) {
  const std::vector<Piece>& pieces = piecesOf(scene, next_pair_[0]);
  for (; next_piece_ < pieces.size(); ++next_piece_) {
    if (next_piece_ % QUESTIONS_PER_LOOK_AT_THE_CLOCK == 0 && deadline.isOver()) return false;
    const Piece& piece = pieces[next_piece_];
    ask(scene, {next_pair_[0], piece.vertex, next_pair_[1], piece.internal});
  }
  return true;
}

void InsideSearch::remember(const SceneArrays& scene, const std::vector<Contact>& contacts, bool complete) {
  known_ = complete;
  if (!complete || scene.bodies().size() == 1) return;
  for (const Contact& contact : contacts) {
    const std::uint16_t body = contact.body[0], closed = contact.body[1];
    if (contact.kind != PairKind::VERTEX_FACE || body == closed || !scene.bodies()[closed].hasInside()) continue;
    const std::vector<Piece>& pieces = piecesOf(scene, body);
    const auto piece = std::lower_bound(pieces.begin(), pieces.end(), contact.vertex[0],
                                        [](const Piece& p, Index vertex) { return p.vertex < vertex; });
    if (piece == pieces.end() || piece->vertex != contact.vertex[0]) continue;
    open_.push_back({body, piece->vertex, closed, piece->internal});
  }
  std::sort(open_.begin(), open_.end());
  open_.erase(std::unique(open_.begin(), open_.end()), open_.end());
}

/// By joining sets; the one with the smallest number of a set stands for it.
const std::vector<InsideSearch::Piece>& InsideSearch::piecesOf(const SceneArrays& scene, std::size_t b) {
  pieces_.resize(scene.bodies().size());
  const SceneBody& body = scene.bodies()[b];
  if (!pieces_[b].empty() || body.usedCount() == 0) return pieces_[b];
  std::vector<Piece> pieces;
  std::vector<Index> first(body.usedCount());  // by internal number: one that is joined with it, itself at the end
  std::iota(first.begin(), first.end(), Index{0});
  const auto find = [&](Index i) {
    while (first[i] != i) i = first[i] = first[first[i]];
    return i;
  };
  const ClusterTree& edges = body.tree(FeatureKind::EDGE);
  for (std::size_t e = 0; e < edges.featureCount(); ++e) {
    if (!body.holds(FeatureKind::EDGE, e)) continue;
    Index i = find(edges.feature(e)[0] - body.internal_begin), j = find(edges.feature(e)[1] - body.internal_begin);
    if (body.slot_vertex[j] < body.slot_vertex[i]) std::swap(i, j);
    first[j] = i;
  }
  for (Index i = 0; i < first.size(); ++i) {
    if (first[i] == i && body.active[i]) pieces.push_back({body.slot_vertex[i], body.internal_begin + i});
  }
  std::sort(pieces.begin(), pieces.end(), [](const Piece& x, const Piece& y) { return x.vertex < y.vertex; });
  return pieces_[b] = std::move(pieces);
}

void InsideSearch::clear() {
  known_ = false;
  searched_ = false;
  next_pair_ = {};
  next_piece_ = 0;
  inside_.clear();
  open_.clear();
}

}  // namespace dccd
