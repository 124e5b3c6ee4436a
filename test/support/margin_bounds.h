// Bounds on the time of the first contact and on the error of a projected coordinate: inputs that come as close to them
// as they can, and whether they are beyond.
#pragma once

#include "support/margin_checks.h"

namespace dccd {
namespace test {
namespace margins {

/// A range that comes within reach of another one: its end at both times, that one's, and the reach.
MarginInput meetingInput(RandomSource& random);
IsWrong judgeMeeting(const MarginInput& input);

/// Features that meet first in one point; the numbers: a pair and a separation.
MarginInput boundInput(RandomSource& random);
IsWrong judgeBound(const MarginInput& input);

/// What the plane lies across, and a point near where both coordinates are small, so that the terms cancel.
MarginInput viewInput(RandomSource& random);
/// Whether a projected coordinate is further off than its margin.
IsWrong judgeView(const MarginInput& input);

}  // namespace margins
}  // namespace test
}  // namespace dccd
