// The way of one pair through the stages of a step: why was it rejected, or who found it? For people; not a fast path.
#pragma once

#include <string>
#include <vector>

#include "dccd/export.h"

#include "step/step_runner.h"

namespace dccd {

/// A vertex and a face, or two edges; in any order of the face's and the edges' vertices.
struct PairQuestion {
  PairKind kind = PairKind::VERTEX_FACE;
  std::array<std::uint16_t, 2> body{0, 0};  ///< of the vertex and the face; of the two edges
  Quad vertex{};                            ///< body-local
};

/// What one stage says of the pair. A stage that rejects has a proof that the features stay apart; all others are asked
/// all the same.
struct TraceLine {
  enum class Says : std::uint8_t { KEPT, REJECTED, CONTACT, UNDECIDED };
  std::size_t part = 0;  ///< of the step, where it was split
  std::string stage;
  Says says = Says::KEPT;
  std::string text;
};
DCCD_EXPORT const char* toString(TraceLine::Says says);

/// Throws std::invalid_argument when the bodies, vertices or features that the question names do not exist.
DCCD_EXPORT std::vector<TraceLine> tracePair(const StepInput& input, const std::vector<MonitorBody>& bodies,
                                             const MonitorOptions& options, const PairQuestion& question);

}  // namespace dccd
