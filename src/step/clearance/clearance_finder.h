// The distances of a step (dccd/clearance.h): which pairs of partners are asked for, the search of each, and what the
// step's contacts say of them.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "culling/scene_arrays.h"
#include "dccd/detect.h"
#include "step/clearance/feature_tree.h"
#include "step/clearance/map_boxes.h"
#include "step/clearance/nearest_search.h"
#include "step/clearance/surface_neighbours.h"

namespace dccd {

/// What one part of a step gives the finder.
struct ClearancePart {
  const Step& step;
  std::size_t index, count;
  const SceneArrays& scene;
  const std::shared_ptr<const VoxelSurface>& map;  ///< null: there is none
  const Findings& found;                           ///< contacts and crossings of the part
  Deadline deadline;

  /// Where in the step its time t is.
  double ofStep(double t) const;
};

class DCCD_HIDDEN ClearanceFinder {
 public:
  /// Of more pairs than this, what is FARTHER and not expected has no row but for the first, which says how far. A body
  /// and itself always has one.
  static constexpr std::size_t MOST_ROWS = 1000;

  /// The pairs of a step, what the bodies make unknown, and what is made once for many steps. Before its parts.
  void begin(const Step& step, const SceneArrays& scene, const Options& options);
  /// In order.
  void addPart(const ClearancePart& part);
  /// Once no more parts come: of a step of `parts` those that did not come leave all unknown that they could change.
  void finish(std::size_t parts, Outcome& outcome);
  /// The bodies change: what was learnt of their meshes is forgotten.
  void forgetBodies() { bodies_.clear(); }

 private:
  struct BodyState {
    FeatureTree tree;
    SurfaceNeighbours neighbours;
    double self_m = 0;                          // of the neighbours; 0: they are not known
    std::shared_ptr<const Positions> first_t0;  // where the body was first, the reference frame where it has none
    Positions far_at;                           // by slots, where it was when it was known to be far_m from itself
    double far_m = 0;
    bool known = false;                          // in this part: it has features, and all of them have bounds
    bool fitted = false, fitted_to_map = false;  // the tree's boxes are of this part
    double radius_m = 0;                         // the largest
    Positions map_t0, map_t1;                    // this part's, in the frame of the map
    std::vector<VertexMotion> on_map;            // the same, by slots
  };
  struct Row {
    Clearance answer;
    bool unknown = false;                     // something of the two was never looked at
    bool touches = false, undecided = false;  // the step has such a contact
    FoundDistance at_end, over_step;
    std::size_t parts = 0;  // that it was looked for in
  };

  /// In row_of_, beside the numbers of rows.
  enum : std::int32_t { NOT_ASKED = -1, ROWLESS = -2 };

  /// Of the whole part. Empty bodies: nothing is in it.
  static StepBox boxOf(const SceneBody& body) { return StepBox::still(body.bounds_min, body.bounds_max); }

  // clearance_rows.cpp
  std::int32_t& placeOf(std::size_t a, std::size_t b);
  Row* rowOf(std::size_t a, std::size_t b);
  Row newRow(std::size_t a, std::size_t b) const;
  Row& addRow(std::size_t a, std::size_t b);
  void addRowsOfNear(const ClearancePart& part);
  double limitOf(const Row& row) const;
  double radiusOf(const Row& row) const;
  void conclude(Row& row, std::size_t parts) const;
  void judge(const Row& row, const FoundDistance& found, ClearanceDistance& distance) const;

  // clearance_finder.cpp
  void learn(const Body& body, const SceneBody& scene_body, BodyState& state) const;
  void takeContacts(const ClearancePart& part);
  void touchAt(const ClearancePart& part, double t, std::array<std::uint16_t, 2> body,
               std::array<FeatureTree::Feature, 2> vertex, const OccupiedLeaf* leaf);
  void learnBodies(const ClearancePart& part);
  bool fit(std::size_t body, const ClearancePart& part, bool to_map);
  bool needsNoSearch(Row& row, const ClearancePart& part, double limit_m);
  void search(Row& row, const ClearancePart& part);
  bool isStillFar(std::size_t body, const ClearancePart& part, double limit_m) const;
  void keepFar(std::size_t body, const ClearancePart& part, const FoundDistance& found);
  FoundDistance measure(const Row& row, const ClearancePart& part, const NearestSearch::Goal& goal,
                        const FoundDistance& known);
  void describe(const Row& row, const ClearancePart& part, const FoundDistance& found,
                ClearanceDistance& distance) const;

  ClearanceOptions options_;
  bool exact_ = true;  // a contact is a touch, not a distance
  std::vector<Expectation> expected_;
  std::vector<BodyState> bodies_;
  std::vector<Row> rows_;
  std::vector<std::int32_t> row_of_;   // [a * (bodies + 1) + b], b = bodies: the map
  std::size_t pairs_ = 0, parts_ = 0;  // that are asked for; that came
  MapBoxes map_;
  NearestSearch search_;
};

}  // namespace dccd
