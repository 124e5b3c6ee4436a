// What the explanations of a pair of mesh features and of a feature and a voxel have in common.
#pragma once

#include <string>
#include <vector>

#include "record/explain.h"

namespace dccd {

/// The features that the question names, body-local: one for a voxel, two for a pair.
struct Feature {
  std::size_t body;
  std::vector<Index> vertex;  // ascending

  const char* name() const { return vertex.size() == 1 ? "vertex" : vertex.size() == 2 ? "edge" : "face"; }
};
/// Throws std::invalid_argument where the step has no such body, or the body no such feature.
Feature featureOf(const Step& step, std::size_t body, const Index* first, std::size_t count);

/// Is a vertex of it masked, or not at a finite place at both ends of the step?
bool isLeftOut(const Step& step, const Feature& feature);

/// The step with these features' vertices alone, on a mesh that has little else: every pair of it can be looked at.
Step alone(const Step& step, const std::vector<Feature>& features);

/// Takes away all that would hold features apart before they touch; `exact` holds no distance.
void removeDistances(Step& step);

/// The step as it is asked for, without what changes no answer but its time.
Options plain(Options options);

/// The lines of an explanation while they are written. `step` and `options` have to outlive it.
class Explanation {
 protected:
  using Says = TraceLine::Says;

  Explanation(const Step& step, const Options& options);

  /// A line of part_.
  void say(const std::string& stage, Says says, const std::string& text);
  /// The rung that the options ask for is marked by a star.
  void sayOfRung(Accuracy rung, Says says, const std::string& text);
  /// The distance that counts as contact, and how much of it the tracker's noise takes [m].
  void saySeparation(double total_m, double noise_m);

  const Step& step_;
  const Options& options_;
  const std::size_t parts_;  // of the step
  std::size_t part_ = 0;
  std::vector<TraceLine> lines_;
};

}  // namespace dccd
