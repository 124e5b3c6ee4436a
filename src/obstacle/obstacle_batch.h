// Pairs of a mesh feature and a feature of one leaf on their way through the elementary test, a chunk at a time.
#pragma once

#include <vector>

#include "dccd/contact.h"
#include "dccd/voxel_surface.h"
#include "obstacle/voxel_surface_impl.h"

namespace dccd {

/// What a pair becomes when it is in contact: the parts of the contact that do not depend on the test.
struct ObstaclePair {
  Contact contact;      ///< all but times and certainty
  double outward[3];    ///< direction out of the leaf at its feature, any length
  bool started_inside;  ///< the mesh feature touched the obstacle at t=0
};

/// Collects pairs of one elementary kind and appends what the rung finds to a vector of contacts. Reuses its memory.
class ObstacleBatch {
 public:
  /// kind: VERTEX_FACE or EDGE_EDGE. test: the rung.
  ObstacleBatch(PairKind kind, const Rung* test);

  /// Drops whatever an earlier run left behind. What the tests of the next run have not ended by the deadline is
  /// undecided.
  void clear(const Deadline& deadline);
  /// points: as the elementary kind wants them. toc_bound: not after a contact, if any, by cheaper means.
  void add(const ObstaclePair& pair, const VertexMotion* points, double toc_bound, double separation_m);
  /// Tests what is left. Contacts are found in the order of add().
  void flush();
  /// The deadline left a pair undecided since clear().
  bool isLate() const { return late_; }

  std::vector<Contact>& contacts() { return contacts_; }
  const std::vector<Contact>& contacts() const { return contacts_; }

 private:
  void dropPairs();
  void append(std::size_t index, const ElementaryResult& result);

  static constexpr std::size_t CHUNK = 512;
  PairKind kind_;
  const Rung* test_;
  Deadline deadline_;
  bool late_ = false;
  bool any_separation_ = false;  // of the pairs that wait
  std::vector<ObstaclePair> pairs_;
  std::vector<double> toc_bounds_;
  std::vector<VertexMotion> points_;
  std::vector<Quad> quads_;
  std::vector<double> separations_;
  std::vector<ElementaryResult> results_;
  std::vector<Contact> contacts_;
};

/// Sorts contacts canonically and joins those of one mesh feature and one leaf into one: the earliest time counts, and
/// it is certain when any of them is.
void sortAndJoin(std::vector<Contact>& contacts);

}  // namespace dccd
