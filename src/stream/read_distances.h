// What of a step's distances is read where nobody listens to them: until when nothing touches, how fast one may go, and
// which two are nearest. Of each of the three one pair tells; the others need only be farther.
#pragma once

#include <optional>
#include <vector>

#include "dccd/monitor_extras.h"
#include "step/clearance/distance_readers.h"

namespace dccd {

class ReadDistances : public DistanceReaders {
 public:
  ReadDistances(const Step& step, const std::vector<SpeedBound>& bounds, const std::optional<SpeedLaw>& law);
  void take(std::uint16_t a, std::uint16_t b, double end_m, double step_m) override;
  double enoughFor(std::uint16_t a, std::uint16_t b) const override;

 private:
  const Step& step_;
  std::vector<SpeedBound> bounds_;
  const std::optional<SpeedLaw>& law_;
  // No more than these will be told: the time until two touch, the scale, the distance of the nearest two over the
  // step.
  double seconds_ = MOST_PROMISED_S, scale_ = 1, nearest_m_ = SpeedBound::NONE;
};

}  // namespace dccd
