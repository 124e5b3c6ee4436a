// The steps that are measured: the two real ones, which have exact truth, and those of the generated sequences.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "dccd/elementary.h"
#include "paper/triangle_candidates.h"
#include "support/generated_scene.h"

namespace dccd {
namespace benchmarks {

/// Bodies of a scene, whose topologies are kept here.
struct SceneBodies {
  std::vector<Topology> topologies;
  std::vector<TriangleCandidates::Body> bodies;
  std::size_t vertex_count = 0;
  std::size_t triangle_count = 0;
};

/// One step, with the true contacts where they are known.
struct Step {
  std::size_t frame = 0;
  std::vector<VertexMotion> vertices;
  bool has_truth = false;
  std::vector<Quad> true_contacts[2];  ///< vertex-face, edge-edge
};

struct SceneRequest {
  std::string name;             ///< cloth-ball or n-body (real), or the name of a generated kind
  bool self = true;             ///< pairs within a body, too; where false, the parts of a real scene are bodies
  std::size_t steps = 16;       ///< of a generated sequence, spread over it evenly; 0 means all
  std::size_t first_frame = 0;  ///< of a generated sequence
  test::GeneratedOptions options;
};

/// Calls setUp once with the bodies and a step that guides them, then visit for each step.
void forEachStep(const SceneRequest& request, const std::function<void(const SceneBodies&, const Step&)>& set_up,
                 const std::function<void(const Step&)>& visit);

/// Part k of n of a step: the motion from k/n to (k+1)/n. Truth is that of the whole step and does not carry over.
Step subStep(const Step& step, std::size_t k, std::size_t n);

/// From two frames of positions.
std::vector<VertexMotion> vertexMotions(const Positions& t0, const Positions& t1);

}  // namespace benchmarks
}  // namespace dccd
