#include "stream/pairs_ahead.h"

#include <sstream>
#include <stdexcept>

namespace dccd {

std::string nameOf(const Outcome& outcome, std::size_t body) {
  return body == OBSTACLE_BODY ? "octomap" : "'" + outcome.step->bodies[body].name + "'";
}

std::string pairOf(const Outcome& outcome, const Clearance& pair) {
  return nameOf(outcome, pair.body[0]) + " and " + (isItself(pair) ? "itself" : nameOf(outcome, pair.body[1]));
}

std::vector<SpeedBound> boundsOf(const Step& step, const std::vector<SpeedBound>& given) {
  std::vector<SpeedBound> bounds = given;
  bounds.resize(step.bodies.size());
  for (std::size_t b = 0; b < bounds.size(); ++b) {
    const auto require = [&](double value, const char* name) {
      if (value >= 0) return;
      std::ostringstream text;
      text << "the speed bound of body '" << step.bodies[b].name << "' has " << name << " " << value
           << "; it must be 0 or more";
      throw std::invalid_argument(text.str());
    };
    require(bounds[b].max_m_s, "max_m_s");
    require(bounds[b].relative_m_s, "relative_m_s");
    if (bounds[b].carrier >= bounds.size()) bounds[b].carrier = SpeedBound::NO_CARRIER;  // it is not there
    const Body& body = step.bodies[b];
    if (body.motion == BodyMotionKind::STATIC && body.turns) bounds[b] = {};  // its frame takes it along
  }
  return bounds;
}

std::string whyNone(const Outcome& outcome) {
  if (!outcome.answered) return std::string("no answer, ") + toString(outcome.status);
  // What a budget cut off are pairs, whose distances are bounded nonetheless; nothing else may be open.
  const bool only_cut = outcome.status == StepStatus::DEADLINE && outcome.claim.holdsButForTime();
  if (!outcome.claim.holds() && !only_cut) return "not proved: " + outcome.missing().front();
  return outcome.clearances.empty() ? "no distances were computed" : "";
}

bool counts(const Outcome& outcome, const Clearance& pair) {
  const bool mapless = pair.body[1] == OBSTACLE_BODY && !outcome.obstacle && outcome.status != StepStatus::NO_MAP;
  return !pair.expected && !mapless;
}

double separationOf(const Step& step, const Clearance& pair) {
  const std::vector<Body>& bodies = step.bodies;
  const auto [a, b] = pair.body;
  return b == OBSTACLE_BODY ? separationFromMap(bodies[a]) : separationBetween(bodies[a], a, bodies[b], b);
}

double distanceOf(const Outcome& outcome, const Insides& insides, const Clearance& pair) {
  const ClearanceStatus status = pair.at_end.status;
  if (status == ClearanceStatus::TOUCHING || status == ClearanceStatus::UNKNOWN) return 0;
  if (insides.hold(pair)) return 0;
  const double separation_m = separationOf(*outcome.step, pair), rest_m = pair.at_end.lower_m - separation_m;
  if (!(rest_m > 0) || !std::isfinite(rest_m)) return 0;
  return separation_m > 0 ? roundedDown(rest_m) : rest_m;
}

Speeds speedsOf(const Step& step, const Clearance& pair, const std::vector<SpeedBound>& bounds) {
  const auto isCarried = [&](std::uint16_t body) { return bounds[body].carrier != SpeedBound::NO_CARRIER; };
  const auto frameOf = [&](std::uint16_t body) { return isCarried(body) ? bounds[body].carrier : body; };
  const auto slows = [&](std::size_t body) { return bounds[body].slows_down && bounds[body].max_m_s > 0; };
  const auto sumOf = [&](const auto& boundOf) {
    Speeds speeds;
    for (const std::uint16_t body : pair.body) {
      if (body == OBSTACLE_BODY) {
        if (step.map.way.empty()) continue;  // it stays
        speeds.unbounded = "octomap";
        speeds.other = SpeedBound::NONE;
        continue;
      }
      const double bound = boundOf(body);
      double& sum = bounds[body].slows_down ? speeds.slowed : speeds.other;
      if (!std::isfinite(bound)) speeds.unbounded = step.bodies[body].name;
      sum = sum == 0 ? bound : roundedUp(sum + bound);
      speeds.slows = speeds.slows || slows(body) || slows(frameOf(body));  // what swings on goes with its carrier
    }
    return speeds;
  };
  const Speeds speeds = sumOf([&](std::uint16_t body) { return bounds[body].max_m_s; });
  const bool by_one =
      !isItself(pair) && pair.body[1] != OBSTACLE_BODY && frameOf(pair.body[0]) == frameOf(pair.body[1]);
  if (!by_one) return speeds;
  const Speeds relative = sumOf([&](std::uint16_t body) { return isCarried(body) ? bounds[body].relative_m_s : 0; });
  return relative.closing() <= speeds.closing() ? relative : speeds;
}

std::string unboundedReason(const std::string& body) { return "no speed bound is known of body '" + body + "'"; }

std::string zeroReason(const Outcome& outcome, const Insides& insides, const Clearance& pair) {
  const bool unknown = pair.at_end.status == ClearanceStatus::UNKNOWN;
  if (pair.at_end.status == ClearanceStatus::TOUCHING) return pairOf(outcome, pair) + " touch, and nobody expects it";
  if (pair.at_end.lower_m > 0 && !unknown && insides.hold(pair)) return insides.why(pair);
  return "the distance of " + pairOf(outcome, pair) + (unknown ? " is not known" : " may be 0");
}

double secondsTo(double distance_m, double closing_m_s) {
  return closing_m_s == 0 ? MOST_PROMISED_S : std::min(MOST_PROMISED_S, roundedDown(distance_m / closing_m_s));
}

StampNs nsIn(double seconds) {
  if (seconds == MOST_PROMISED_S) return static_cast<StampNs>(MOST_PROMISED_S * 1e9);
  return static_cast<StampNs>(std::floor(roundedDown(seconds * 1e9)));
}

}  // namespace dccd
