// One body's step against a voxel surface. Features whose swept bounds reach no leaf cost one query of the tree for a
// few faces together; the others are tested exactly at t=0, then along the step against what the leaf exposes.
#include <cmath>
#include <stdexcept>
#include <string>

#include "obstacle/obstacle_check_impl.h"

#include "base/accuracy.h"
#include "obstacle/burst.h"

namespace dccd {

std::unique_ptr<Rung> elementaryTestFor(const ObstacleOptions& options) {
  if (!(options.minimum_separation_m >= 0 && std::isfinite(options.minimum_separation_m))) {
    throw std::invalid_argument("minimum_separation_m is " + std::to_string(options.minimum_separation_m) +
                                ", which is not a length from 0 up");
  }
  const Accuracy rung = options.accuracy.rung;
  if (options.minimum_separation_m > 0 && !holdsDistance(rung)) {
    throw std::invalid_argument(std::string("minimum_separation_m above 0 cannot be had with accuracy ") +
                                toString(rung) + "; use conservative");
  }
  return makeRung(options.accuracy);
}

/// A face reaches as far as its most uncertain vertex asks for, and is found by the keys of all its vertices: each
/// takes the reach of its features.
void ObstacleCheck::Impl::prepareReaches(const Run& run) {
  reaches.assign(run.query.vertex_radius_m ? std::max<std::size_t>(run.query.topology.vertexCount(), 1) : 1,
                 options.minimum_separation_m);
  if (!run.query.vertex_radius_m) return;
  for (const Edge& edge : run.query.topology.edges()) {
    const double reach = separationOf(run, edge);
    for (const Index v : edge) reaches[v] = std::max(reaches[v], reach);
  }
}

void ObstacleCheck::Impl::prepareVertices(const Run& run) {
  const Topology& topology = run.query.topology;
  const Positions &t0 = run.query.map_t0, &t1 = run.query.map_t1;
  const std::uint8_t* active = run.query.vertex_active;
  keys.resize(topology.vertexCount());
  start_keys.resize(topology.vertexCount());
  state.assign(topology.vertexCount(), 0);
  for (const Index v : topology.usedVertices()) {
    const Vec3 &p0 = t0[v], &p1 = t1[v];
    // x - x is 0 for finite x only.
    const double finite = (p0 - p0).sum() + (p1 - p1).sum();
    if ((active != nullptr && active[v] == 0) || !(finite == 0)) continue;
    start_keys[v] = pointKeys(p0, run.surface->inverse_resolution, 0);
    const double reach = reaches[run.query.vertex_radius_m ? v : 0];
    if (reach > 0) {
      keys[v] = pointKeys(p0, run.surface->inverse_resolution, reach);
    } else {
      keys[v] = start_keys[v];
    }
    state[v] = ACTIVE;
    // With a separation what rests may be too close; without one, what rests can only touch at t=0.
    if (reach > 0 || p0 != p1) state[v] |= MOVES;
    if (p0 != p1) keys[v].include(pointKeys(p1, run.surface->inverse_resolution, reach));
  }
}

std::uint8_t ObstacleCheck::Impl::nearBits(const Run& run, const KeyLanes& swept, const KeyLanes& start,
                                           bool& corner) const {
  const VoxelTree::Reached reached = run.surface->tree.reached(swept.box());
  corner = reached.corner;
  if (!reached.leaf) return 0;
  const bool at_start = start == swept || run.surface->tree.reachesLeaf(start.box());
  return NEAR | (reached.edge ? NEAR_EDGE : 0) | (at_start ? NEAR_START : 0);
}

/// The NEAR bits of faces that mostly lie side by side, where one look at all of them tells: they reach no leaf, or
/// leaves during the step alone and no edge or corner. That some of them reach none is seen by their vertices.
std::optional<std::uint8_t> ObstacleCheck::Impl::nearBitsOfAll(const Run& run, const Face* first,
                                                               const Face* last) const {
  std::uint8_t all_states = ACTIVE;
  KeyLanes swept = unite(keys, *first), start = unite(start_keys, *first);
  for (const Face* face = first; face != last; ++face) {
    for (const Index v : *face) {
      all_states &= state[v];
      swept.include(keys[v]);
      start.include(start_keys[v]);
    }
  }
  if (!all_states || !VoxelTree::isSmall(swept.box())) return std::nullopt;
  bool corner = false;
  const std::uint8_t bits = nearBits(run, swept, start, corner);
  return corner || (bits & ~NEAR) != 0 ? std::nullopt : std::optional(bits);
}

void ObstacleCheck::Impl::markNearFaces(const Run& run) {
  near_faces.clear();
  const std::vector<Face>& faces = run.query.topology.faces();
  for (std::size_t first = 0; first < faces.size() && !isLate(run); first += TOGETHER) {
    const std::size_t last = std::min(first + TOGETHER, faces.size());
    const std::optional<std::uint8_t> bits_of_all = nearBitsOfAll(run, &faces[first], &faces[0] + last);
    if (bits_of_all == 0) continue;
    for (std::size_t f = first; f < last; ++f) {
      const Face& face = faces[f];
      // The other features of a face with an inactive vertex are looked at themselves.
      std::uint8_t bits = bits_of_all.value_or(NEAR | NEAR_EDGE | NEAR_START);
      if (!bits_of_all && (state[face[0]] & state[face[1]] & state[face[2]] & ACTIVE)) {
        bool corner = false;
        bits = nearBits(run, unite(keys, face), unite(start_keys, face), corner);
        if (bits == 0) continue;
        const bool start = (bits & NEAR_START) != 0;
        if (corner || start) near_faces.push_back({static_cast<Index>(f), corner, start});
      }
      for (const Index v : face) state[v] |= bits;
    }
  }
}

void ObstacleCheck::Impl::markNearEdges(const Run& run) {
  near_faces.clear();
  for (const Edge& edge : run.query.topology.edges()) {
    if (isLate(run)) return;
    std::uint8_t bits = NEAR | NEAR_EDGE | NEAR_START;
    bool corner = false;
    if (state[edge[0]] & state[edge[1]] & ACTIVE) {
      bits = nearBits(run, unite(keys, edge), unite(start_keys, edge), corner);
    }
    for (const Index v : edge) state[v] |= bits;
  }
}

/// A feature and a leaf may meet in a dozen places, which are joined now and then. A contact that was settled and one
/// that was tested may still be the same: hence twice the number.
bool ObstacleCheck::Impl::foundTooMuch(const Run& run) {
  if (run.query.most_found == NO_LIMIT || foundCount() <= 2 * std::max(run.query.most_found, joined)) return false;
  for (auto* list : {&vertex_contacts, &edge_contacts, &face_contacts}) sortAndJoin(*list);
  for (ObstacleBatch* batch : {&vertex_batch, &edge_batch, &corner_batch}) sortAndJoin(batch->contacts());
  joined = foundCount();
  return joined > 2 * run.query.most_found;
}

std::size_t ObstacleCheck::Impl::foundCount() const {
  std::size_t sum = vertex_contacts.size() + edge_contacts.size() + face_contacts.size();
  for (const ObstacleBatch* batch : {&vertex_batch, &edge_batch, &corner_batch}) sum += batch->contacts().size();
  return sum;
}

void ObstacleCheck::Impl::collect(std::vector<Contact>& contacts, std::size_t first, std::size_t most_found) {
  const auto append = [&](std::vector<Contact>& settled, ObstacleBatch& batch) {
    batch.flush();
    late = late || batch.isLate();
    // Settled ones are mostly in order already, and the tested ones few.
    std::vector<Contact>& tested = batch.contacts();
    sortAndJoin(tested);
    sortAndJoin(settled);
    if (!tested.empty()) {
      const auto middle = static_cast<std::ptrdiff_t>(settled.size());
      settled.insert(settled.end(), tested.begin(), tested.end());
      std::inplace_merge(settled.begin(), settled.begin() + middle, settled.end(), canonicalLess);
      sortAndJoin(settled);
    }
    contacts.insert(contacts.end(), settled.begin(), settled.end());
  };
  append(vertex_contacts, vertex_batch);
  append(edge_contacts, edge_batch);
  append(face_contacts, corner_batch);
  if (contacts.size() - first > most_found) {
    full = late = true;
    contacts.resize(first + most_found);
  }
}

/// Forgets the last run, whose contacts would be counted as found.
void ObstacleCheck::Impl::begin(const Deadline& deadline) {
  late = full = false;
  looked_at = 0;
  joined = 0;
  for (ObstacleBatch* batch : {&vertex_batch, &edge_batch, &corner_batch}) batch->clear(deadline);
  for (auto* contacts : {&vertex_contacts, &edge_contacts, &face_contacts}) {
    releaseBurst(*contacts);
    contacts->clear();
  }
  releaseBurst(near_leaves);
}

ObstacleCheck::ObstacleCheck(const ObstacleOptions& options) : impl_(std::make_unique<Impl>(options)) {}
ObstacleCheck::~ObstacleCheck() = default;

bool ObstacleCheck::run(const ObstacleQuery& query, std::vector<Contact>& contacts, ObstacleStats& stats) {
  const Topology& topology = query.topology;
  if (query.map_t0.size() != topology.vertexCount() || query.map_t1.size() != topology.vertexCount()) {
    throw std::invalid_argument("positions of " + std::to_string(query.map_t0.size()) + " and " +
                                std::to_string(query.map_t1.size()) + " vertices, the topology has " +
                                std::to_string(topology.vertexCount()));
  }
  Impl& impl = *impl_;
  const Impl::Run run{query, &VoxelSurface::Impl::of(query.surface), &stats};
  impl.begin(query.deadline);
  impl.prepareReaches(run);
  if (query.surface.leafCount() > 0 && !impl.isLate(run)) {
    impl.prepareVertices(run);
    if (topology.hasFaces()) {
      impl.markNearFaces(run);
    } else {
      impl.markNearEdges(run);
    }
    impl.runVertices(run);
    impl.runEdges(run);
    impl.runFaces(run);
    impl.collect(contacts, contacts.size(), query.most_found);
  }
  return !impl.late;
}

bool ObstacleCheck::isFull() const { return impl_->full; }

}  // namespace dccd
