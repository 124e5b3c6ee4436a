// What the pairs of partners at a step's end say of what comes after it: how far the two are apart, for certain, and
// how fast they may be. Of ~safe_until and ~speed_scale, with and without an intended path.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "dccd/monitor_extras.h"

namespace dccd {

inline double roundedDown(double value) { return std::nextafter(value, 0.0); }  // of what is 0 or more
inline double roundedUp(double value) { return std::nextafter(value, SpeedBound::NONE); }

/// Between a value of which `holds` holds and one of which it does not: two that are next to each other, or what is
/// left of these after so many halvings. Where it holds of a value it does of all that are less.
template <class Holds>
std::pair<double, double> halved(double low, double high, const Holds& holds, int times = 5000) {
  for (; times > 0; --times) {
    const double middle = low + (high - low) / 2;
    if (middle <= low || middle >= high) break;
    (holds(middle) ? low : high) = middle;
  }
  return {low, high};
}

std::string nameOf(const Outcome& outcome, std::size_t body);
std::string pairOf(const Outcome& outcome, const Clearance& pair);
inline bool isItself(const Clearance& pair) { return pair.body[0] == pair.body[1]; }

/// By body of the step. Throws std::invalid_argument naming the body whose bound is NaN or below 0.
std::vector<SpeedBound> boundsOf(const Step& step, const std::vector<SpeedBound>& given);
inline std::vector<SpeedBound> boundsOf(const Outcome& outcome, const std::vector<SpeedBound>& given) {
  return outcome.step ? boundsOf(*outcome.step, given) : std::vector<SpeedBound>();
}

/// Why the outcome allows no promise whatever its distances are; empty: it does.
std::string whyNone(const Outcome& outcome);

/// A pair that says something: not one that is expected to touch, nor one with a map that is not there and that nobody
/// misses.
bool counts(const Outcome& outcome, const Clearance& pair);

/// Of which two bodies one may be inside of the other at a step's end, where that is not expected: how far their
/// surfaces are says nothing of them. Surfaces that do not meet in all of the step carry nothing into each other, so
/// that what is inside at its end was so when it began.
class Insides {
 public:
  explicit Insides(const Outcome& outcome) : outcome_(outcome) {
    for (const StartIntersection& start : outcome.intersections) {
      if (!start.expected && start.body[1] != OBSTACLE_BODY) known_.push_back(start.body);
    }
    std::sort(known_.begin(), known_.end());
    known_.erase(std::unique(known_.begin(), known_.end()), known_.end());
    if (outcome.start_state_complete) return;
    for (const Body& body : outcome.step->bodies) {
      Eigen::AlignedBox3d& box = boxes_.emplace_back();
      for (const Vec3& position : *body.t0) box.extend(position);
    }
  }

  /// Why the two may be; empty: they are not. The map is solid: it has distances inside, too.
  std::string why(const Clearance& pair) const {
    const auto [a, b] = pair.body;
    if (a == b || b == OBSTACLE_BODY) return "";
    if (isKnown(a, b) || isKnown(b, a)) {
      const std::uint16_t inner = isKnown(a, b) ? a : b, outer = inner == a ? b : a;
      return nameOf(outcome_, inner) + " is inside of " + nameOf(outcome_, outer) + ", or crosses it";
    }
    if (!(pair.over_step.lower_m > 0)) return pairOf(outcome_, pair) + " may have met in this step";
    if (boxes_.empty() || !boxes_[a].intersects(boxes_[b])) return "";
    return "it is not known whether one of " + pairOf(outcome_, pair) + " is inside of the other";
  }
  bool hold(const Clearance& pair) const { return !why(pair).empty(); }

 private:
  bool isKnown(std::uint16_t inner, std::uint16_t outer) const {
    return std::binary_search(known_.begin(), known_.end(), std::array<std::uint16_t, 2>{inner, outer});
  }
  const Outcome& outcome_;
  std::vector<std::array<std::uint16_t, 2>> known_;  // ascending
  std::vector<Eigen::AlignedBox3d> boxes_;           // when the step began; empty: all that was inside then is known
};

/// What the two are held apart (minimum separation) [m].
double separationOf(const Step& step, const Clearance& pair);
/// What is certainly between the two at the step's end until they touch [m]; 0: nothing, or nobody knows.
double distanceOf(const Outcome& outcome, const Insides& insides, const Clearance& pair);

/// Of both partners [m/s], or of both in the frame of what carries the two, whichever is less; the map stands still.
struct Speeds {
  double slowed = 0, other = 0;  // of what slows down, and of what does not
  bool slows = false;            // something of the two, or what carries it, slows down
  std::string unbounded;         // a body of which nobody says how fast it is
  /// Of both together, rounded up.
  double closing() const { return slowed > 0 && other > 0 ? roundedUp(slowed + other) : slowed + other; }
};
Speeds speedsOf(const Step& step, const Clearance& pair, const std::vector<SpeedBound>& bounds);

std::string unboundedReason(const std::string& body);
/// Why the distance of the two is taken for 0.
std::string zeroReason(const Outcome& outcome, const Insides& insides, const Clearance& pair);

/// Calls f(row, its number) for each pair of partners. Those without a row are as far apart as the one that stands for
/// them says (distance()); their number is NO_PAIR.
template <class F>
void forPairs(const Outcome& outcome, F&& f) {
  const std::vector<Clearance>& rows = outcome.clearances;
  for (std::size_t p = 0; p < rows.size(); ++p) f(rows[p], p);
  if (rows.size() >= outcome.stats[Effect::CLEARANCE].in) return;
  const auto stands = std::find_if(rows.begin(), rows.end(), [](const Clearance& row) {
    return row.over_step.status == ClearanceStatus::FARTHER && !isItself(row) && !row.expected;
  });
  Clearance without = stands == rows.end() ? Clearance() : *stands;
  const std::vector<Body>& bodies = outcome.step->bodies;
  auto row = rows.begin();
  for (std::size_t a = 0; a < bodies.size(); ++a) {
    for (std::size_t b = a; b <= bodies.size(); ++b) {
      without.body = {static_cast<std::uint16_t>(a),
                      b == bodies.size() ? OBSTACLE_BODY : static_cast<std::uint16_t>(b)};
      if (row != rows.end() && row->body == without.body) {
        ++row;
      } else if (b == bodies.size() ? meetsMap(bodies[a]) && outcome.obstacle
                                    : b > a && meet(bodies[a], a, bodies[b], b)) {
        f(without, SafeUntil::NO_PAIR);
      }
    }
  }
}

/// Rounded down: seconds in which a distance above 0 is closed.
double secondsTo(double distance_m, double closing_m_s);
/// Rounded down.
StampNs nsIn(double seconds);

}  // namespace dccd
