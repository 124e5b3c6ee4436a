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

/// Buffers are kept from step to step.
class PatchMaker {
 public:
  /// outcome: contacts in canonical order, none left out yet; intersections, step and obstacle are set. Its patches are
  /// made; parallel(n, piece, f) calls f(first, last) over [0, n).
  template <class Parallel>
  void run(const Parallel& parallel, Outcome& outcome) {
    begin(outcome);
    parallel(touches_.size(), PIECE, [&](std::size_t first, std::size_t last) { findTouches(outcome, first, last); });
    // The first piece of work is of another kind, and as long as several of the others. Few are not worth a thread.
    const std::size_t grain = touches_.size() < PIECE ? 2 : 1;
    parallel(piecesOf(contacts_) + 1, grain, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) i == 0 ? connect() : findPlaces(outcome, i - 1);
    });
    if (touches_.empty()) return;
    parallel(pieces() + 1, grain, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) i == 0 ? findAreas(outcome) : measure(outcome, i - 1);
    });
    make(outcome);
  }
  /// Of the contacts that are listed in the end, which are some of those before: to which patch each belongs.
  void list(Outcome& outcome) const;

  /// All that touched, in the order of their keys, and the patch of each, as long as the next run() has not begun.
  const std::vector<Touch>& touches() const { return touches_; }
  const std::vector<std::uint32_t>& patchOf() const { return *patch_of_; }

  const std::vector<PatchSpot>& spots() const { return spots_; }
  const std::vector<PatchUnexpected>& unexpected() const { return unexpected_; }

 private:
  static constexpr std::size_t PIECE = 4096;
  /// Where features touch, and the normal of the touch: towards the first feature, as the step begins.
  struct Place {
    Vec3 point, normal;
  };
  struct Part : Patch {
    PatchUnexpected unexpected;
  };

  void begin(const Outcome& outcome);
  void findTouches(const Outcome& outcome, std::size_t first, std::size_t last);
  void connect();
  static std::size_t piecesOf(std::size_t count) { return (count + PIECE - 1) / PIECE; }
  std::size_t pieces() const { return piecesOf(touches_.size()); }
  void findPlaces(const Outcome& outcome, std::size_t piece);
  Place placeOf(const Outcome& outcome, const Contact& contact) const;
  Vec3 pointOfCrossing(const Outcome& outcome, const Touch& touch) const;
  Place placeOnMap(const Outcome& outcome, const Contact& contact) const;
  void measure(const Outcome& outcome, std::size_t piece);
  static void addContact(const Contact& contact, const Place& at, const Vec3& first_normal, Part& part);
  void addCrossing(const Outcome& outcome, const Touch& touch, bool alone, Part& part) const;
  void findAreas(const Outcome& outcome);
  void findSpots();
  void findVertexAreas(const Step& step);
  double leafArea(std::uint32_t patch, double resolution_m);
  void make(Outcome& outcome);

  TouchGraph graph_;
  std::vector<Touch> touches_;  // of the contacts, then of the crossings
  std::vector<Place> places_;   // of the contacts
  const std::vector<std::uint32_t>* patch_of_ = nullptr;
  std::vector<std::uint32_t> order_;  // the touches, patch by patch, each patch's ascending
  std::vector<std::uint32_t> begin_;  // per patch, in order_
  /// What a piece of order_ gives to a patch: that of piece i to patch p is at i + p, since in order_ with each of them
  /// either i or p goes on.
  std::vector<Part> parts_;
  std::vector<PatchUnexpected> unexpected_;
  std::vector<double> vertex_area_;  // per vertex of all bodies: a third of the faces around it [m^2]
  std::vector<PatchSpot> spots_;     // patch by patch
  /// Per vertex: the last patch that had it, and its spot there.
  struct Seen {
    std::uint32_t patch, spot;
  };
  std::vector<Seen> seen_;
  std::vector<std::uint64_t> leaves_;  // of a patch
  std::vector<double> areas_;          // two sides a patch
  std::size_t contacts_ = 0;
};

}  // namespace dccd
