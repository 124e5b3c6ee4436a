// One step of the monitor's bodies: splits it where a rigid body turns far, runs the detector, and turns its result
// into an outcome.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dccd/export.h"
#include "dccd/monitor.h"

namespace dccd {

/// All bodies at both ends of a step.
struct DCCD_EXPORT StepInput {
  std::vector<Positions> t0, t1;  ///< [m] fixed frame, one a body
  std::vector<std::shared_ptr<const Topology>> topologies;
  std::vector<std::uint8_t> rigid;  ///< one a body: moves from pose_t0 to pose_t1 along the rotation
  std::vector<Eigen::Isometry3d> pose_t0, pose_t1;
  /// The step goes from pose_t0 this many times as far as to pose_t1; t1 is where it ends. Two poses alone tell no turn
  /// of more than a half, which predictions may be.
  double pose_scale = 1;
  std::vector<std::vector<double>> radius_m;  ///< one a body: uncertainty per vertex over the step; empty: none
  std::vector<std::shared_ptr<const ReferenceFrame>> references;  ///< one a body; null: nothing is left out

  void resize(std::size_t bodies);
};

/// Parts that the step must be cut into so that each rigid body's straight vertex paths stay within the tolerance of
/// its arc [m]: 1 where nothing turns. Not limited.
DCCD_EXPORT std::size_t requiredSubsteps(const StepInput& input, double tolerance_m);

/// All bodies at the end of the first `part` of `parts` equal parts of the step; rigid ones along their rotation.
DCCD_EXPORT void placeAt(const StepInput& input, std::size_t part, std::size_t parts, std::vector<Positions>& out);

/// One vertex at the end of the first `part` of `parts` equal parts, as placeAt() has it.
DCCD_EXPORT Vec3 placeVertex(const StepInput& input, std::size_t body, Index vertex, std::size_t part,
                             std::size_t parts);

/// The bodies as the detector takes them. Throws std::invalid_argument when a vertex_mask does not fit its topology.
DCCD_EXPORT std::vector<BodySetup> bodySetups(const StepInput& input, const std::vector<MonitorBody>& bodies);

class StepRunner {
 public:
  explicit StepRunner(const DetectorOptions& options);

  void setOptions(const DetectorOptions& options);
  const std::vector<LeftOutPair>& leftOut() const { return detector_.leftOut(); }

  /// Fills the outcome's result from the step. `continues`: t0 is the t1 of the last run here, nothing else changed.
  /// predecessor: as in MotionStep; a step aside from all others, whose later parts need no start state. Throws
  /// std::invalid_argument when a body's vertex_mask does not fit its topology.
  void run(const StepInput& input, const std::vector<MonitorBody>& bodies, const MonitorOptions& options,
           const MonitorMap& map, bool continues, StepOutcome& outcome, StepRunner* predecessor = nullptr);

 private:
  Detector detector_;
  std::vector<std::shared_ptr<const Topology>> set_topologies_;
  std::vector<std::shared_ptr<const ReferenceFrame>> set_references_;
  StepInput part_;
  MotionStep step_;
  bool aside_ = false;
  bool reached_end_ = false;  ///< of the last run: no part was left out

  void setBodies(const StepInput& input, const std::vector<MonitorBody>& bodies);
  /// False when the budget left parts out.
  bool runParts(const StepInput& input, const MonitorMap& map, bool continues, std::size_t parts, StepOutcome& outcome);
  void runPart(const StepInput& at, bool continues, std::size_t part, std::size_t parts, StepOutcome& outcome);
  bool budgetIsSpent(const StepOutcome& outcome) const;
};

}  // namespace dccd
