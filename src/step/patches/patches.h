// The patches of a step, from all that it found (doc/algorithm.md, "Patches").
#pragma once

#include <vector>

#include "dccd/outcome.h"
#include "dccd/patch.h"
#include "step/patches/touch_graph.h"

namespace dccd {

/// A vertex that carries a feature of a patch's touches, once a patch: what the tracker keeps from step to step.
struct PatchSpot {
  Index vertex = 0;
  Index across = NO_INDEX;  ///< a vertex of the other side that it touches; NO_INDEX with the map
  std::uint32_t patch = 0;
  std::uint8_t side = 0;  ///< 0: of Patch::body[0]
  bool expected = false;  ///< all of the patch's touches there are
};

/// Has a patch touches that are not expected, and came in this step, or were there when it began?
struct PatchUnexpected {
  bool is_new = false, is_initial = false;
};

/// A leaf of the map that a patch touches, once a patch.
struct PatchLeaf {
  std::uint32_t patch = 0;
  std::uint8_t level = 0;  ///< its edge is 2^level finest voxels
  VoxelKey voxel;
  bool initial = false;  ///< the patch touches it when the step begins
};

/// Buffers are kept from step to step.
class PatchMaker {
 public:
  /// outcome: contacts in canonical order, none left out yet; intersections, step and obstacle are set. Its patches are
  /// made, and to which of them each contact belongs; parallel(n, piece, f) calls f(first, last) over [0, n).
  template <class Parallel>
  void run(const Parallel& parallel, Outcome& outcome) {
    begin(std::cref(parallel), outcome);
    const std::size_t touches = touchCount(), pieces = (touches + PIECE - 1) / PIECE;
    if (touches == 0) return;
    // The first piece of work is of another kind, and as long as several of the others. Few are not worth a thread.
    parallel(pieces + 1, pieces == 1 ? 2 : 1, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) i == 0 ? findAreas(outcome) : measure(outcome, i - 1);
    });
    make(outcome);
  }

  // As long as the next run() has not begun.
  std::size_t touchCount() const { return graph_.touchCount(); }
  const std::vector<PatchSpot>& spots() const { return spots_; }
  const std::vector<PatchUnexpected>& unexpected() const { return unexpected_; }
  const std::vector<PatchLeaf>& leaves() const { return leaves_; }  ///< by patch

 private:
  static constexpr std::uint32_t PIECE = 4096;
  /// Where features touch, and the normal of the touch: towards the first feature, as the step begins.
  struct Place {
    Vec3 point, normal;
  };
  /// What a piece of the touches gives to a patch.
  struct Part {
    std::uint32_t patch, piece;
    std::uint32_t contacts = 0, certain = 0, initial = 0, crossings = 0, expected = 0;
    std::uint32_t earliest = 0;  // a contact
    double toc_lower = 1, toc_upper = 1;
    Vec3 points = Vec3::Zero(), normals = Vec3::Zero();  // sums
    Vec3 first_normal;                                   // of a body with itself: of the patch's first contact
    Box box;
    PatchUnexpected unexpected;
    Part(std::uint32_t of, std::uint32_t in) : patch(of), piece(in) {}
  };
  /// Touches of one part that come one after the other.
  struct Stretch {
    const TouchGroup* group;
    std::uint32_t first, last, patch, part;
  };

  void begin(const TouchGraph::Parallel& parallel, Outcome& outcome);
  Place placeOf(const Outcome& outcome, const Contact& contact) const;
  Place placeOnMap(const Outcome& outcome, const Contact& contact) const;
  void measure(const Outcome& outcome, std::size_t piece);
  template <class PlaceOf>
  void addContacts(const Outcome& outcome, std::size_t first, std::size_t last, const PlaceOf& placeOf,
                   Part& part) const;
  void addCrossings(const Outcome& outcome, const StartIntersection* first, const StartIntersection* last,
                    Part& part) const;
  void findAreas(const Outcome& outcome);
  void findSpots();
  void addSpots(const Stretch& stretch, const Index* vertices, bool expected);
  void findVertexAreas(const Step& step);
  void findLeaves(const Outcome& outcome);
  void make(Outcome& outcome);

  TouchGraph graph_;  // of the contacts, then of the crossings
  std::size_t contacts_ = 0;
  std::vector<std::uint32_t> first_of_, newest_part_;  // per patch: its first touch
  std::vector<Part> parts_;
  std::vector<Stretch> stretches_, by_patch_;
  std::vector<PatchUnexpected> unexpected_;
  std::vector<double> vertex_area_;  // per vertex of all bodies: a third of the faces around it [m^2]
  std::vector<PatchSpot> spots_;     // patch by patch
  // Per vertex: the last patch that had it, and its spot there.
  std::vector<std::uint32_t> seen_patch_, seen_spot_;
  std::vector<PatchLeaf> leaves_;
  std::vector<double> areas_;  // two sides a patch
};

}  // namespace dccd
