// Vertices, edges and faces of a mesh against the leaves that their keys reach: exact at t=0, then along the step.
#include <algorithm>
#include <cmath>

#include "dccd/tolerances.h"
#include "obstacle/obstacle_check_impl.h"
#include "obstacle/start_contact.h"
#include "obstacle/static_filters.h"
#include "obstacle/vertex_path.h"

namespace dccd {

/// The smallest box around moving points at t=0 and t=1, and over the step (swept), the last inflated by the reach.
struct MovingBounds {
  double min[2][3], max[2][3];
  double swept_min[3], swept_max[3];

  bool reaches(int axis, double lo, double hi) const { return swept_min[axis] <= hi && swept_max[axis] >= lo; }
};

namespace {

MovingBounds boundsOf(const VertexMotion* points, int count, double reach_m) {
  MovingBounds bounds;
  for (int axis = 0; axis < 3; ++axis) {
    double lo0 = points[0].t0[axis], hi0 = lo0, lo1 = points[0].t1[axis], hi1 = lo1;
    for (int i = 1; i < count; ++i) {
      lo0 = std::min(lo0, points[i].t0[axis]);
      hi0 = std::max(hi0, points[i].t0[axis]);
      lo1 = std::min(lo1, points[i].t1[axis]);
      hi1 = std::max(hi1, points[i].t1[axis]);
    }
    bounds.min[0][axis] = lo0;
    bounds.max[0][axis] = hi0;
    bounds.min[1][axis] = lo1;
    bounds.max[1][axis] = hi1;
    bounds.swept_min[axis] = std::min(lo0, lo1) - reach_m;
    bounds.swept_max[axis] = std::max(hi0, hi1) + reach_m;
  }
  return bounds;
}

/// Not after the time at which the points first come within reach of a box; above 1 when they never do.
double tocBound(const MovingBounds& moving, const LeafBox& box, double reach_m) {
  double bound = 0;
  for (int axis = 0; axis < 3; ++axis) {
    bound = std::max(bound,
                     firstMeeting(&moving.min[0][axis], &moving.max[0][axis], 3, box.lo[axis], box.hi[axis], reach_m));
  }
  return bound;
}

VertexMotion fixedPoint(double x, double y, double z) { return {{x, y, z, 0}, {x, y, z, 0}}; }

double planeOf(const LeafBox& box, int axis, int side) { return side ? box.hi[axis] : box.lo[axis]; }

bool endInside(const VertexMotion* points, const LeafBox& box) {
  return pointInBox(points[0].t0, box) || pointInBox(points[1].t0, box);
}

/// The axis along which all points move alike from the same height while their other coordinates rest; -1 if none.
int fallAxis(const VertexMotion* points, std::size_t count) {
  int axis = -1;
  for (int a = 0; a < 3; ++a) {
    if (points[0].t0[a] == points[0].t1[a]) continue;
    if (axis >= 0) return -1;
    axis = a;
  }
  if (axis < 0) return -1;
  for (std::size_t i = 1; i < count; ++i) {
    for (int a = 0; a < 3; ++a) {
      const bool alike = a == axis ? points[i].t0[a] == points[0].t0[a] && points[i].t1[a] == points[0].t1[a]
                                   : points[i].t0[a] == points[i].t1[a];
      if (!alike) return -1;
    }
  }
  return axis;
}

}  // namespace

Contact ObstacleCheck::Impl::contactOf(const Run& run, PairKind kind, std::uint32_t leaf) const {
  const OccupiedLeaf& occupied = run.surface->tree.leaves()[leaf];
  Contact contact;
  contact.kind = kind;
  contact.body = {run.query.body, OBSTACLE_BODY};
  contact.voxel = occupied.min;
  contact.voxel_size = occupied.size;
  return contact;
}

void ObstacleCheck::Impl::setInitial(Contact& contact) {
  contact.initial = true;
  contact.toc_lower = 0;
  contact.toc_upper = options.accuracy.rung == Accuracy::EXACT ? std::ldexp(1.0, -options.accuracy.toc_bits) : 0.0;
}

void ObstacleCheck::Impl::setTime(Contact& contact, const CrossingTime& time) {
  if (compareToOne(time) == 0) {
    contact.toc_lower = contact.toc_upper = 1;
  } else if (options.accuracy.rung == Accuracy::EXACT) {
    const double cell = std::ldexp(1.0, -options.accuracy.toc_bits);
    const double k = static_cast<double>(timeCell(time, options.accuracy.toc_bits));
    contact.toc_lower = k * cell;
    contact.toc_upper = (k + 1) * cell;
  } else if (time.certain) {
    contact.toc_lower = time.approximate * (1 - tolerance::CROSSING_TIME);
    contact.toc_upper = std::min(1.0, time.approximate * (1 + tolerance::CROSSING_TIME));
  } else {
    const double k = static_cast<double>(timeCell(time, 52));
    contact.toc_lower = k * tolerance::TIME_GRID;
    contact.toc_upper = (k + 1) * tolerance::TIME_GRID;
  }
}

void ObstacleCheck::Impl::findLeaves(const Run& run, const KeyBox& box) {
  near_leaves.clear();
  run.surface->tree.visitLeaves(box, [&](std::uint32_t leaf) { return addNear(run, leaf); });
  if (!late) sortLeaves(*run.surface, near_leaves);
}

void ObstacleCheck::Impl::sortLeaves(const VoxelSurface::Impl& surface, std::vector<std::uint32_t>& list) {
  if (list.size() < 2) return;
  const auto key = [&](std::uint32_t leaf) {  // as one number: to compare three takes branches
    const VoxelKey& min = surface.tree.leaves()[leaf].min;
    return std::uint64_t{min.x} << 32 | std::uint64_t{min.y} << 16 | min.z;
  };
  std::sort(list.begin(), list.end(), [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
}

/// A feature that lies in an axis plane and moves along that axis alone (level cloth that is let fall, a level plate
/// that is lowered): it meets the target, a leaf's edge or corner as a flat box, where it meets the target's shadow, at
/// the first time at which it is at the target's height. Settled exactly here, since such scenes are full of contacts
/// on borders, which are slow to decide in general. False where the feature moves otherwise.
bool ObstacleCheck::Impl::settleFall(const ObstaclePair& pair, const VertexMotion* points, std::size_t count,
                                     const LeafBox& target, std::vector<Contact>& contacts) {
  const int axis = fallAxis(points, count);
  if (axis < 0) return false;
  const double from = points[0].t0[axis], to = points[0].t1[axis];
  if (std::max(from, to) < target.lo[axis] || std::min(from, to) > target.hi[axis]) return true;
  if (from >= target.lo[axis] && from <= target.hi[axis]) return false;  // beside the target at the start
  const double plane = from < target.lo[axis] ? target.lo[axis] : target.hi[axis];
  LeafBox shadow = target;
  shadow.lo[axis] = shadow.hi[axis] = from;
  const bool meets = count == 2
                         ? segmentMeetsBox(points[0].t0, points[1].t0, shadow)
                         : triangleMeetsBox(points[0].t0, points[1].t0, points[2].t0, shadow) != TriangleStart::APART;
  if (!meets) return true;
  Contact contact = pair.contact;
  contact.leaving = pair.started_inside && (to - from) * pair.outward[axis] > 0;
  setTime(contact, CrossingTime(plane, from, to));
  contacts.push_back(contact);
  return true;
}

void ObstacleCheck::Impl::runVertices(const Run& run) {
  const double resolution = run.surface->resolution_m;
  for (const Index v : run.query.topology.usedVertices()) {
    if ((state[v] & (ACTIVE | NEAR)) != (ACTIVE | NEAR)) continue;
    if (isLate(run)) return;
    near_leaves.clear();
    run.surface->tree.visitLeaves(keys[v].box(), [&](std::uint32_t leaf) { return addNear(run, leaf); });
    if (near_leaves.empty()) continue;
    const bool separate = separationOf(run, std::array<Index, 1>{v}) > 0;
    if (separate && !late) sortLeaves(*run.surface, near_leaves);
    run.stats->pairs_in += near_leaves.size();
    const Vec3 &p0 = run.query.map_t0[v], &p1 = run.query.map_t1[v];
    const bool moves = p0 != p1;
    const std::size_t first_contact = vertex_contacts.size();
    std::size_t apart = 0;
    for (const std::uint32_t leaf : near_leaves) {
      if (isLate(run)) break;
      const LeafBox box = leafBox(run.surface->tree.leaves()[leaf], resolution);
      if (pointInBox(p0.data(), box)) {
        state[v] |= INSIDE;
        addInitial(run, PairKind::VERTEX_VOXEL_FACE, std::array<Index, 1>{v}, leaf, vertex_contacts);
      } else if (!(run.surface->features[leaf] & FACE_MASK)) {
        continue;
      } else if (separate) {
        near_leaves[apart++] = leaf;
      } else if (moves) {
        vertexPath(run, v, leaf, box);
      }
    }
    const bool inside = (state[v] & INSIDE) != 0;
    // Vertices are ascending: where isLate() has sorted what was found, this one's are still the last.
    const auto found = vertex_contacts.begin() + static_cast<std::ptrdiff_t>(first_contact);
    if (!inside) std::for_each(found, vertex_contacts.end(), [](Contact& contact) { contact.leaving = false; });
    if (!separate) std::sort(found, vertex_contacts.end(), canonicalLess);  // fewer than the leaves
    for (std::size_t i = 0; i < apart; ++i) {
      if (isLate(run)) return;
      vertexSeparation(run, v, near_leaves[i], inside);
    }
  }
}

/// leaving: of a vertex that started inside of something.
void ObstacleCheck::Impl::vertexPath(const Run& run, Index vertex, std::uint32_t leaf, const LeafBox& box) {
  const FaceHit hit = firstFaceHit(run.query.map_t0[vertex].data(), run.query.map_t1[vertex].data(), box,
                                   run.surface->features[leaf] & FACE_MASK);
  if (!hit.hit) return;
  Contact contact = contactOf(run, PairKind::VERTEX_VOXEL_FACE, leaf);
  contact.vertex[0] = vertex;
  contact.leaving = hit.outward;
  setTime(contact, hit.time);
  vertex_contacts.push_back(contact);
}

void ObstacleCheck::Impl::vertexSeparation(const Run& run, Index vertex, std::uint32_t leaf, bool inside) {
  const LeafBox box = leafBox(run.surface->tree.leaves()[leaf], run.surface->resolution_m);
  VertexMotion points[4] = {motionOf(run, vertex), {}, {}, {}};
  const double separation_m = separationOf(run, std::array<Index, 1>{vertex});
  const double toc_bound = tocBound(boundsOf(points, 1, separation_m), box, separation_m);
  if (toc_bound > 1) return;
  for (int direction = 0; direction < FACE_DIRECTIONS; ++direction) {
    if (!(run.surface->features[leaf] >> direction & 1)) continue;
    const int axis = direction >> 1, side = direction & 1, b = (axis + 1) % 3, c = (axis + 2) % 3;
    ObstaclePair pair{contactOf(run, PairKind::VERTEX_VOXEL_FACE, leaf), {0, 0, 0}, inside};
    pair.contact.vertex[0] = vertex;
    pair.outward[axis] = side ? 1 : -1;
    for (int half = 0; half < 2; ++half) {  // the square as two triangles; joined again afterwards
      for (int k = 0; k < 3; ++k) {
        const int corner = half == 0 ? (k == 0 ? 0 : k == 1 ? 1 : 3) : (k == 0 ? 0 : k == 1 ? 3 : 2);
        double x[3];
        x[axis] = planeOf(box, axis, side);
        x[b] = planeOf(box, b, corner & 1);
        x[c] = planeOf(box, c, corner >> 1);
        points[k + 1] = fixedPoint(x[0], x[1], x[2]);
      }
      vertex_batch.add(pair, points, toc_bound, separation_m);
    }
  }
}

void ObstacleCheck::Impl::runEdges(const Run& run) {
  for (const Edge& edge : run.query.topology.edges()) {
    const std::uint8_t both = state[edge[0]] & state[edge[1]], either = state[edge[0]] | state[edge[1]];
    if ((both & (ACTIVE | NEAR)) != (ACTIVE | NEAR)) continue;
    if (isLate(run)) return;
    bool inside = (either & INSIDE) != 0;
    // What starts inside at an end is known by that end.
    if (!inside && (both & NEAR_START)) inside = edgeStartsInside(run, edge);
    if (!(both & NEAR_EDGE) || !(either & MOVES)) continue;
    near_leaves.clear();
    run.surface->tree.visitLeavesWithEdges(unite(keys, edge).box(),
                                           [&](std::uint32_t leaf) { return addNear(run, leaf); });
    if (near_leaves.empty()) continue;
    run.stats->pairs_in += near_leaves.size();
    const VertexMotion points[2] = {motionOf(run, edge[0]), motionOf(run, edge[1])};
    const double separation_m = separationOf(run, edge);
    const MovingBounds moving = boundsOf(points, 2, separation_m);
    for (const std::uint32_t leaf : near_leaves) {
      if (isLate(run)) return;
      edgePairs(run, edge, points, moving, separation_m, leaf, inside);
    }
  }
}

bool ObstacleCheck::Impl::edgeStartsInside(const Run& run, const Edge& edge) {
  findLeaves(run, unite(start_keys, edge).box());
  bool inside = false;
  for (const std::uint32_t leaf : near_leaves) {
    if (isLate(run)) break;
    const LeafBox box = leafBox(run.surface->tree.leaves()[leaf], run.surface->resolution_m);
    if (!segmentMeetsBox(run.query.map_t0[edge[0]].data(), run.query.map_t0[edge[1]].data(), box)) continue;
    inside = true;
    addInitial(run, PairKind::EDGE_VOXEL_EDGE, edge, leaf, edge_contacts);
  }
  return inside;
}

void ObstacleCheck::Impl::edgePairs(const Run& run, const Edge& edge, const VertexMotion* points,
                                    const MovingBounds& moving, double separation_m, std::uint32_t leaf, bool inside) {
  const LeafBox box = leafBox(run.surface->tree.leaves()[leaf], run.surface->resolution_m);
  bool near[3][2];
  for (int axis = 0; axis < 3; ++axis) {
    if (!moving.reaches(axis, box.lo[axis], box.hi[axis])) return;
    near[axis][0] = moving.reaches(axis, box.lo[axis], box.lo[axis]);
    near[axis][1] = moving.reaches(axis, box.hi[axis], box.hi[axis]);
  }
  const FeatureMask features = run.surface->features[leaf];
  for (int axis = 0; axis < 3; ++axis) {
    const int b = (axis + 1) % 3, c = (axis + 2) % 3;
    for (int sides = 0; sides < 4; ++sides) {
      const int side_b = sides & 1, side_c = sides >> 1;
      if (!near[b][side_b] || !near[c][side_c] || !(features >> edgeBit(axis, side_b, side_c) & 1)) continue;
      double low[3], high[3];
      low[axis] = box.lo[axis];
      high[axis] = box.hi[axis];
      low[b] = high[b] = planeOf(box, b, side_b);
      low[c] = high[c] = planeOf(box, c, side_c);
      if (separation_m == 0 && edgeMissesLine(points[0], points[1], low, axis)) continue;
      if (segmentMeetsBox(points[0].t0, points[1].t0, box)) {
        // What touches at an end is the vertex's contact. Pairs that edgeStartsInside() found are joined with it later.
        if (!endInside(points, box)) addInitial(run, PairKind::EDGE_VOXEL_EDGE, edge, leaf, edge_contacts);
        return;
      }
      ObstaclePair pair{contactOf(run, PairKind::EDGE_VOXEL_EDGE, leaf), {0, 0, 0}, inside};
      pair.contact.vertex[0] = edge[0];
      pair.contact.vertex[1] = edge[1];
      pair.outward[b] = side_b ? 1 : -1;
      pair.outward[c] = side_c ? 1 : -1;
      const LeafBox target{{low[0], low[1], low[2]}, {high[0], high[1], high[2]}};
      if (separation_m == 0 && settleFall(pair, points, 2, target, edge_contacts)) continue;
      const VertexMotion quad[4] = {points[0], points[1], fixedPoint(low[0], low[1], low[2]),
                                    fixedPoint(high[0], high[1], high[2])};
      edge_batch.add(pair, quad, tocBound(moving, target, separation_m), separation_m);
    }
  }
}

void ObstacleCheck::Impl::runFaces(const Run& run) {
  for (const NearFace& near : near_faces) {
    if (isLate(run)) return;
    const Face& face = run.query.topology.faces()[near.face];
    const std::uint8_t any = state[face[0]] | state[face[1]] | state[face[2]];
    bool inside = (any & INSIDE) != 0;
    if (!inside && near.start) inside = faceStartsInside(run, face);
    if (!near.corner || !(any & MOVES)) continue;
    near_leaves.clear();
    run.surface->tree.visitLeavesWithCorners(unite(keys, face).box(),
                                             [&](std::uint32_t leaf) { return addNear(run, leaf); });
    run.stats->pairs_in += near_leaves.size();
    if (near_leaves.empty()) continue;
    const VertexMotion points[3] = {motionOf(run, face[0]), motionOf(run, face[1]), motionOf(run, face[2])};
    const double separation_m = separationOf(run, face);
    const MovingBounds moving = boundsOf(points, 3, separation_m);
    for (const std::uint32_t leaf : near_leaves) {
      if (isLate(run)) return;
      cornerPairs(run, face, points, moving, separation_m, leaf, inside);
    }
  }
}

bool ObstacleCheck::Impl::faceStartsInside(const Run& run, const Face& face) {
  findLeaves(run, unite(start_keys, face).box());
  const double *p0 = run.query.map_t0[face[0]].data(), *p1 = run.query.map_t0[face[1]].data(),
               *p2 = run.query.map_t0[face[2]].data();
  std::size_t pierced = 0;
  for (const std::uint32_t leaf : near_leaves) {
    if (isLate(run)) return true;
    const TriangleStart start =
        triangleMeetsBox(p0, p1, p2, leafBox(run.surface->tree.leaves()[leaf], run.surface->resolution_m));
    if (start == TriangleStart::BOUNDARY) return true;  // known by an edge of the face
    if (start == TriangleStart::INTERIOR) near_leaves[pierced++] = leaf;
  }
  for (std::size_t i = 0; i < pierced; ++i) {
    addInitial(run, PairKind::FACE_VOXEL_CORNER, face, near_leaves[i], face_contacts);
  }
  return pierced > 0;
}

void ObstacleCheck::Impl::cornerPairs(const Run& run, const Face& face, const VertexMotion* points,
                                      const MovingBounds& moving, double separation_m, std::uint32_t leaf,
                                      bool inside) {
  const LeafBox box = leafBox(run.surface->tree.leaves()[leaf], run.surface->resolution_m);
  bool near[3][2];
  for (int axis = 0; axis < 3; ++axis) {
    near[axis][0] = moving.reaches(axis, box.lo[axis], box.lo[axis]);
    near[axis][1] = moving.reaches(axis, box.hi[axis], box.hi[axis]);
  }
  const FeatureMask features = run.surface->features[leaf];
  for (int sides = 0; sides < 8; ++sides) {
    const int x = sides & 1, y = sides >> 1 & 1, z = sides >> 2;
    if (!near[0][x] || !near[1][y] || !near[2][z] || !(features >> cornerBit(x, y, z) & 1)) continue;
    const double corner[3] = {planeOf(box, 0, x), planeOf(box, 1, y), planeOf(box, 2, z)};
    if (separation_m == 0 && triangleMissesPoint(points[0], points[1], points[2], corner)) continue;
    if (inside) {
      const TriangleStart start = triangleMeetsBox(points[0].t0, points[1].t0, points[2].t0, box);
      if (start == TriangleStart::INTERIOR) addInitial(run, PairKind::FACE_VOXEL_CORNER, face, leaf, face_contacts);
      if (start != TriangleStart::APART) return;
    }
    ObstaclePair pair{
        contactOf(run, PairKind::FACE_VOXEL_CORNER, leaf), {x ? 1.0 : -1.0, y ? 1.0 : -1.0, z ? 1.0 : -1.0}, inside};
    std::copy(face.begin(), face.end(), pair.contact.vertex.begin());
    const LeafBox target{{corner[0], corner[1], corner[2]}, {corner[0], corner[1], corner[2]}};
    if (separation_m == 0 && settleFall(pair, points, 3, target, face_contacts)) continue;
    const VertexMotion quad[4] = {fixedPoint(corner[0], corner[1], corner[2]), points[0], points[1], points[2]};
    corner_batch.add(pair, quad, tocBound(moving, target, separation_m), separation_m);
  }
}

}  // namespace dccd
