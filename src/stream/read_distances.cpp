#include "stream/read_distances.h"

#include <algorithm>
#include <cmath>

#include "stream/pairs_ahead.h"

namespace dccd {
namespace {

// By more than all roundings: of two that tell the same the first one is named.
constexpr double CLEARLY = 1 + 1e-3;

Clearance pairOf(std::uint16_t a, std::uint16_t b) {
  Clearance pair;
  pair.body = {a, b};
  return pair;
}

}  // namespace

ReadDistances::ReadDistances(const Step& step, const std::vector<SpeedBound>& bounds,
                             const std::optional<SpeedLaw>& law)
    : step_(step), bounds_(boundsOf(step, bounds)), law_(law) {}

void ReadDistances::take(std::uint16_t a, std::uint16_t b, double end_m, double step_m) {
  nearest_m_ = std::min(nearest_m_, step_m);
  if (!std::isfinite(end_m)) return;
  const Speeds speeds = speedsOf(step_, pairOf(a, b), bounds_);
  if (!std::isfinite(speeds.closing())) return;
  seconds_ = std::min(seconds_, secondsTo(end_m, speeds.closing()));
  if (law_ && speeds.slows) scale_ = std::min(scale_, speedScale(end_m, speeds.slowed, speeds.other, *law_));
}

double ReadDistances::enoughFor(std::uint16_t a, std::uint16_t b) const {
  const Clearance pair = pairOf(a, b);
  const Speeds speeds = speedsOf(step_, pair, bounds_);
  // Of pairs that all are far the first one is named.
  if (!(seconds_ < MOST_PROMISED_S) || !std::isfinite(speeds.closing())) return SpeedBound::NONE;
  double enough_m = std::max(nearest_m_, speeds.closing() * seconds_);
  if (law_ && speeds.slows)
    enough_m = std::max(enough_m, separationDistance(scale_, speeds.slowed, speeds.other, *law_));
  return CLEARLY * (enough_m + separationOf(step_, pair));
}

}  // namespace dccd
