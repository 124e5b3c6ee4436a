// The distances of a step (dccd/clearance.h): which pairs of partners are asked for, the search of each, and what the
// step's contacts say of them.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "culling/scene_arrays.h"
#include "dccd/detect.h"
#include "step/clearance/distance_readers.h"
#include "step/clearance/feature_tree.h"
#include "step/clearance/map_boxes.h"
#include "step/clearance/nearest_search.h"
#include "step/clearance/surface_neighbours.h"

namespace dccd {

/// What one part of a step gives the finder. Where bodies turn, distances may need more parts than contacts do: what is
/// searched at a time is a stretch, a part or an equal share of one, with the same findings.
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
  /// `readers`: of a pair that is farther than these need it is told that it is FARTHER than that. Null: all is read.
  void begin(const Step& step, const SceneArrays& scene, const Options& options, DistanceReaders* readers);
  /// In order.
  void addPart(const ClearancePart& part);
  /// Once no more parts come: of a step of `parts` those that did not come leave all unknown that they could change.
  void finish(std::size_t parts, Outcome& outcome);
  /// The bodies change: what was learnt of their meshes is forgotten.
  void forgetBodies() { bodies_.clear(); }

 private:
  struct BodyState {
    const VertexMotion* motion = nullptr;  // of the stretch, by slots
    StepBox box;                           // of that
    std::vector<VertexMotion> placed;      // the same, where the stretch is less than a part
    // How far its straight paths do at most, and those on a map that moves.
    double leaves_way_m = 0, leaves_on_map_m = 0;
    FeatureTree tree;
    SurfaceNeighbours neighbours;
    double self_m = 0;  // of the neighbours; 0: they are not known
    Positions far_at;   // by slots, where it was when it was known to be far_m from itself
    double far_m = 0;
    bool known = false;                          // in this part: it has features, and all of them have bounds
    bool fitted = false, fitted_to_map = false;  // the tree's boxes are of this stretch
    double radius_m = 0;                         // the largest
    Positions map_t0, map_t1;                    // this part's, in the frame of the map
    std::vector<VertexMotion> on_map;            // the same, by slots
  };
  struct Row {
    Clearance answer;
    bool unknown = false;                     // something of the two was never looked at
    bool touches = false, undecided = false;  // the step has such a contact
    FoundDistance at_end, over_step;
    std::size_t stretches = 0;                                  // that it was looked for in
    double enough_m = std::numeric_limits<double>::infinity();  // what is farther is FARTHER, below limitOf()
  };

  /// In row_of_, beside the numbers of rows.
  enum : std::int32_t { NOT_ASKED = -1, ROWLESS = -2 };

  // clearance_rows.cpp
  std::int32_t& placeOf(std::size_t a, std::size_t b);
  Row* rowOf(std::size_t a, std::size_t b);
  Row newRow(std::size_t a, std::size_t b) const;
  Row& addRow(std::size_t a, std::size_t b);
  void addRowsOfNear(const ClearancePart& part);
  double limitOf(const Row& row) const;
  double radiusOf(const Row& row) const;
  double leavesArcsBy(const Row& row) const;
  double limitOverStep(const Row& row) const;
  void conclude(Row& row, std::size_t stretches) const;
  void judge(const Row& row, const FoundDistance& found, double wider_m, ClearanceDistance& distance) const;

  // clearance_finder.cpp
  void learn(const Body& body, const SceneBody& scene_body, BodyState& state) const;
  void takeContacts(const ClearancePart& part);
  void touchAt(const ClearancePart& part, double t, std::array<std::uint16_t, 2> body,
               std::array<FeatureTree::Feature, 2> vertex, const OccupiedLeaf* leaf);
  void learnBodies(const ClearancePart& part);
  void place(const ClearancePart& stretch);
  bool fit(std::size_t body, const ClearancePart& stretch, bool to_map);
  bool needsNoSearch(Row& row, const ClearancePart& stretch, double limit_m);
  void searchRows(const ClearancePart& stretch);
  void searchWhatIsRead(const ClearancePart& step);
  double& before(const Row& row);
  bool isBeyondEnough(Row& row, const ClearancePart& stretch, double limit_m);
  void search(Row& row, const ClearancePart& stretch);
  bool takeOverStep(Row& row, const ClearancePart& stretch, const FoundDistance& found);
  bool isStillFar(std::size_t body, const ClearancePart& part, double limit_m) const;
  void keepFar(std::size_t body, const ClearancePart& part, const FoundDistance& found);
  FoundDistance measure(const Row& row, const ClearancePart& part, const NearestSearch::Goal& goal,
                        const FoundDistance& known);
  void describe(const Row& row, const ClearancePart& part, const FoundDistance& found,
                ClearanceDistance& distance) const;

  const Step* step_ = nullptr;  // all of it, while it is computed
  ClearanceOptions options_;
  DistanceReaders* readers_ = nullptr;
  std::vector<double> before_m_;  // as row_of_: no farther in the step before; infinite: nobody knows
  double rigid_tolerance_m_ = 0;
  std::size_t needed_ = 1;     // stretches of the step in which what turns goes straight enough
  std::size_t stretches_ = 1;  // of each part
  bool exact_ = true;          // a contact is a touch, not a distance
  std::vector<Expectation> expected_;
  std::vector<BodyState> bodies_;
  std::vector<Row> rows_;
  std::vector<std::int32_t> row_of_;  // [a * (bodies + 1) + b], b = bodies: the map
  std::size_t pairs_ = 0, came_ = 0;  // pairs that are asked for; stretches that came
  MapBoxes map_;
  NearestSearch search_;
};

}  // namespace dccd
