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
#include "step/clearance/nearest_search.h"
#include "step/clearance/surface_neighbours.h"

namespace dccd {

/// `fixed` itself where the frames are the same, else `moved`, filled with the positions in the map's frame [m].
const Positions& inMapFrame(const Eigen::Isometry3d& map_from_fixed, const Positions& fixed, Positions& moved);

/// What one part of a step gives the finder.
struct ClearancePart {
  const Step& step;
  std::size_t index, count;
  const SceneArrays& scene;
  const VoxelSurface* map;  ///< null: there is none
  const Findings& found;    ///< contacts and crossings of the part
  Deadline deadline;

  /// Where in the step its time t is.
  double ofStep(double t) const;
};

class ClearanceFinder {
 public:
  /// The pairs of a step, and what the bodies make unknown. Before its parts.
  void begin(const Step& step, const Options& options);
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
    double self_m = 0;                           // of the neighbours
    std::shared_ptr<const Positions> first_t0;   // where the body was first, the reference frame where it has none
    bool known = false;                          // in this part: it has features, and all of them have bounds
    bool fitted = false, fitted_to_map = false;  // the tree's boxes are of this part
    double radius_m = 0;                         // the largest
    Positions map_t0, map_t1;                    // this part's, in the frame of the map
  };
  struct Row {
    Clearance answer;
    bool unknown = false;                     // something of the two was never looked at
    bool touches = false, undecided = false;  // the step has such a contact
    FoundDistance at_end, over_step;
    std::size_t parts = 0;  // that it was looked for in
  };

  Row* rowOf(std::size_t a, std::size_t b);
  void takeContacts(const ClearancePart& part);
  void touchAt(const ClearancePart& part, double t, std::array<std::uint16_t, 2> body,
               std::array<FeatureTree::Feature, 2> vertex, const OccupiedLeaf* leaf);
  void learnBodies(const ClearancePart& part);
  bool fit(std::size_t body, const ClearancePart& part, bool to_map);
  void search(Row& row, const ClearancePart& part);
  FoundDistance measure(const Row& row, const ClearancePart& part, const NearestSearch::Goal& goal,
                        const FoundDistance& known);
  void describe(const Row& row, const ClearancePart& part, const FoundDistance& found,
                ClearanceDistance& distance) const;
  void judge(const Row& row, const FoundDistance& found, ClearanceDistance& distance) const;
  double limitOf(const Row& row) const;
  double radiusOf(const Row& row) const;

  ClearanceOptions options_;
  bool exact_ = true;  // a contact is a touch, not a distance
  std::vector<BodyState> bodies_;
  std::vector<Row> rows_;
  std::vector<std::int32_t> row_of_;  // [a * (bodies + 1) + b], b = bodies: the map; -1: none
  NearestSearch search_;
};

}  // namespace dccd
