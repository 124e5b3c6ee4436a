// The patches of a step, from all that it found (doc/algorithm.md, "Patches").
#pragma once

#include <vector>

#include "dccd/outcome.h"
#include "dccd/patch.h"
#include "step/touch_graph.h"

namespace dccd {

/// Buffers are kept from step to step.
class PatchMaker {
 public:
  /// outcome: contacts in canonical order, none left out yet; intersections, step and obstacle are set. Its patches are
  /// made; parallel(n, piece, f) calls f(first, last) over [0, n).
  template <class Parallel>
  void run(const Parallel& parallel, Outcome& outcome) {
    begin(outcome);
    parallel(contacts_, PIECE, [&](std::size_t first, std::size_t last) {
      for (std::size_t c = first; c < last; ++c) touches_[c] = graph_.touchOf(outcome.contacts[c]);
    });
    connect(outcome);
    parallel(touches_.size(), PIECE, [&](std::size_t first, std::size_t last) {
      for (std::size_t t = first; t < last; ++t) places_[t] = placeOf(outcome, t);
    });
    make(outcome);
  }
  /// Of the contacts that are listed in the end, which are some of those before: to which patch each belongs.
  void list(Outcome& outcome) const;

  /// All that touched, in the order of their keys, and the patch of each, as long as the next run() has not begun.
  const std::vector<Touch>& touches() const { return touches_; }
  const std::vector<std::uint32_t>& patchOf() const { return *patch_of_; }

 private:
  static constexpr std::size_t PIECE = 4096;
  /// Where features touch, and the normal of the touch: towards the first feature, as the step begins.
  struct Place {
    Vec3 point, normal;
  };

  void begin(const Outcome& outcome);
  void connect(const Outcome& outcome);
  Place placeOf(const Outcome& outcome, std::size_t touch) const;
  Place placeOnMap(const Outcome& outcome, const Contact& contact) const;
  void make(Outcome& outcome);
  void addAreas(const Outcome& outcome, std::vector<Patch>& patches);
  void findVertexAreas(const Step& step);

  TouchGraph graph_;
  std::vector<Touch> touches_;
  const std::vector<std::uint32_t>* patch_of_ = nullptr;
  std::vector<Place> places_;
  std::vector<double> vertex_area_;  // per vertex of all bodies: a third of the faces around it [m^2]
  std::vector<double> areas_;        // two sides a patch
  std::vector<std::uint32_t> last_point_;
  std::size_t contacts_ = 0;
};

}  // namespace dccd
