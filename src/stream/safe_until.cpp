#include "dccd/monitor_extras.h"

#include <gmpxx.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "dccd/assurance.h"
#include "obstacle/leaf_sets.h"
#include "obstacle/voxel_surface_impl.h"
#include "step/parts.h"

namespace dccd {
namespace {

constexpr double NONE = SpeedBound::NONE;

double roundedDown(double value) { return std::nextafter(value, 0.0); }  // of what is 0 or more
double roundedUp(double value) { return std::nextafter(value, NONE); }

/// |to - from| > max_m_s * time, by rational arithmetic, to which doubles convert exactly.
bool isFasterExactly(const Vec3& from, const Vec3& to, double max_m_s, StampNs time_ns) {
  mpq_class way_sq = 0;  // [m^2]
  for (int axis = 0; axis < 3; ++axis) {
    const mpq_class along = mpq_class(to[axis]) - mpq_class(from[axis]);
    way_sq += along * along;
  }
  // [m ns / s]; below 2^53 ns, 104 days: exact.
  const mpq_class limit = mpq_class(max_m_s) * mpq_class(static_cast<double>(time_ns)), nanoseconds = 1e9;
  return way_sq * nanoseconds * nanoseconds > limit * limit;
}

/// The first vertex that is certainly farther from where it was than its bound allows. One that is not finite says
/// nothing.
std::optional<std::size_t> faster(const Positions& from, const Positions& to, double max_m_s, StampNs time_ns) {
  // Each of the rounded squares is wrong by less than eight units in its last place; what they leave open, and what is
  // near to overflow or to underflow, rational arithmetic decides.
  constexpr double SLACK = 0x1p-48, SMALL = 1e-200, BIG = 1e200;
  const double limit = max_m_s * (static_cast<double>(time_ns) * 1e-9), limit_sq = limit * limit;
  for (std::size_t v = 0; v < from.size(); ++v) {
    if (!from[v].allFinite() || !to[v].allFinite() || from[v] == to[v]) continue;
    const double way_sq = (to[v] - from[v]).squaredNorm();
    const bool sure = limit_sq > SMALL && limit_sq < BIG && way_sq < BIG;
    if (sure && way_sq < (1 - SLACK) * limit_sq) continue;
    if ((sure && way_sq > (1 + SLACK) * limit_sq) || isFasterExactly(from[v], to[v], max_m_s, time_ns)) return v;
  }
  return std::nullopt;
}

/// The fastest of the body's vertices from any of its waypoints to the next [m/s].
double fastestOf(const Body& body, double seconds) {
  double fastest = 0;
  forEachLeg(body, [&](const Positions& from, const Positions& to, double share) {
    double way_sq = 0;
    for (std::size_t v = 0; v < from.size(); ++v) {
      const double one_sq = (to[v] - from[v]).squaredNorm();
      if (std::isfinite(one_sq)) way_sq = std::max(way_sq, one_sq);
    }
    fastest = std::max(fastest, std::sqrt(way_sq) / (share * seconds));
  });
  return seconds > 0 ? fastest : NONE;
}

std::string nameOf(const Outcome& outcome, std::size_t body) {
  return body == OBSTACLE_BODY ? "octomap" : "'" + outcome.step->bodies[body].name + "'";
}

bool isItself(const Clearance& pair) { return pair.body[0] == pair.body[1]; }

std::string pairOf(const Outcome& outcome, const Clearance& pair) {
  return nameOf(outcome, pair.body[0]) + " and " + (isItself(pair) ? "itself" : nameOf(outcome, pair.body[1]));
}

/// By body of the step.
std::vector<SpeedBound> boundsOf(const Outcome& outcome, const std::vector<SpeedBound>& given) {
  std::vector<SpeedBound> bounds = given;
  bounds.resize(outcome.step ? outcome.step->bodies.size() : 0);
  for (std::size_t b = 0; b < bounds.size(); ++b) {
    const auto require = [&](double value, const char* name) {
      if (value >= 0) return;
      std::ostringstream text;
      text << "the speed bound of body '" << outcome.step->bodies[b].name << "' has " << name << " " << value
           << "; it must be 0 or more";
      throw std::invalid_argument(text.str());
    };
    require(bounds[b].max_m_s, "max_m_s");
    require(bounds[b].last_step_factor, "last_step_factor");
  }
  return bounds;
}

/// The same until the next frame: with what the last step says put in.
std::vector<SpeedBound> boundsAfter(const Outcome& outcome, const std::vector<SpeedBound>& given) {
  std::vector<SpeedBound> bounds = boundsOf(outcome, given);
  for (std::size_t b = 0; b < bounds.size(); ++b) {
    SpeedBound& bound = bounds[b];
    if (!(bound.last_step_factor > 0)) continue;
    bound.max_m_s =
        std::min(bound.max_m_s, bound.last_step_factor * fastestOf(outcome.step->bodies[b], outcome.duration_s()));
  }
  return bounds;
}

/// Why the outcome allows no promise whatever its distances are; empty: it does.
std::string whyNone(const Outcome& outcome) {
  if (!outcome.answered) return std::string("no answer, ") + toString(outcome.status);
  // What a budget cut off are pairs, whose distances are bounded nonetheless; nothing else may be open.
  const bool only_cut = outcome.status == StepStatus::DEADLINE && outcome.unproved.size() == 1;
  if (!outcome.unproved.empty() && !only_cut) return "not proved: " + outcome.unproved.front();
  return outcome.clearances.empty() ? "no distances were computed" : "";
}

/// A pair that says something: not one that is expected to touch, nor one with a map that is not there and that nobody
/// misses.
bool counts(const Outcome& outcome, const Clearance& pair) {
  const bool mapless = pair.body[1] == OBSTACLE_BODY && !outcome.obstacle && outcome.status != StepStatus::NO_MAP;
  return !pair.expected && !mapless;
}

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

/// What is certainly between the two at the step's end until they touch [m]; 0: nothing, or nobody knows.
double distanceOf(const Outcome& outcome, const Insides& insides, const Clearance& pair) {
  const ClearanceStatus status = pair.at_end.status;
  if (status == ClearanceStatus::TOUCHING || status == ClearanceStatus::UNKNOWN) return 0;
  if (insides.hold(pair)) return 0;
  const std::vector<Body>& bodies = outcome.step->bodies;
  const double separation_m = pair.body[1] == OBSTACLE_BODY ? separationFromMap(bodies[pair.body[0]])
                                                            : separationBetween(bodies[pair.body[0]], pair.body[0],
                                                                                bodies[pair.body[1]], pair.body[1]);
  const double rest_m = pair.at_end.lower_m - separation_m;
  if (!(rest_m > 0) || !std::isfinite(rest_m)) return 0;
  return separation_m > 0 ? roundedDown(rest_m) : rest_m;
}

/// Of both partners [m/s]; the map stands still.
struct Speeds {
  double slowed = 0, other = 0;  // slowed 0: nothing of the two slows down
  std::string unbounded;         // a body of which nobody says how fast it is
};
Speeds speedsOf(const Outcome& outcome, const Clearance& pair, const std::vector<SpeedBound>& bounds) {
  Speeds speeds;
  for (const std::uint16_t body : pair.body) {
    if (body == OBSTACLE_BODY) continue;
    double& sum = bounds[body].slows_down ? speeds.slowed : speeds.other;
    if (!std::isfinite(bounds[body].max_m_s)) speeds.unbounded = outcome.step->bodies[body].name;
    sum = sum == 0 ? bounds[body].max_m_s : roundedUp(sum + bounds[body].max_m_s);
  }
  return speeds;
}

std::string unboundedReason(const std::string& body) { return "no speed bound is known of body '" + body + "'"; }

std::string zeroReason(const Outcome& outcome, const Insides& insides, const Clearance& pair) {
  const bool unknown = pair.at_end.status == ClearanceStatus::UNKNOWN;
  if (pair.at_end.lower_m > 0 && !unknown && insides.hold(pair)) return insides.why(pair);
  return "the distance of " + pairOf(outcome, pair) + (unknown ? " is not known" : " may be 0");
}

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
double secondsTo(double distance_m, double closing_m_s) {
  return closing_m_s == 0 ? MOST_PROMISED_S : std::min(MOST_PROMISED_S, roundedDown(distance_m / closing_m_s));
}

StampNs nsIn(double seconds) {
  if (seconds == MOST_PROMISED_S) return static_cast<StampNs>(MOST_PROMISED_S * 1e9);
  return static_cast<StampNs>(std::floor(roundedDown(seconds * 1e9)));
}

/// Whether something is occupied that was not before.
bool hasNewVoxels(const VoxelSurface& now, const VoxelSurface& before) {
  bool found = now.resolution() != before.resolution();
  if (!found)
    visitDifference(VoxelSurface::Impl::of(now).tree, VoxelSurface::Impl::of(before).tree,
                    [&](const OccupiedLeaf&) { found = true; });
  return found;
}

}  // namespace

SafeUntil safeUntil(const Outcome& outcome, const std::vector<SpeedBound>& given) {
  SafeUntil result;
  result.stamp_ns = result.until_ns = result.others_until_ns = outcome.stamp_ns;
  const std::vector<SpeedBound> bounds = boundsAfter(outcome, given);
  result.reason = whyNone(outcome);
  if (!result.reason.empty()) return result;
  const Insides insides(outcome);
  double least_s = MOST_PROMISED_S, others_s = MOST_PROMISED_S;
  bool others = false;
  bool first = true;
  forPairs(outcome, [&](const Clearance& pair, std::size_t number) {
    if (!counts(outcome, pair)) return;
    const Speeds speeds = speedsOf(outcome, pair, bounds);
    const double distance_m = distanceOf(outcome, insides, pair);
    double closing_m_s = speeds.slowed + speeds.other;
    if (speeds.slowed > 0 && speeds.other > 0) closing_m_s = roundedUp(closing_m_s);
    const bool nothing = distance_m == 0 || !std::isfinite(closing_m_s);
    const double seconds = nothing ? 0 : secondsTo(distance_m, closing_m_s);
    if (!isItself(pair)) {
      others = true;
      others_s = std::min(others_s, seconds);
    }
    if (!std::exchange(first, false) && seconds >= least_s) return;
    least_s = seconds;
    result.limiting = number;
    result.distance_m = distance_m;
    result.closing_m_s = std::isfinite(closing_m_s) ? closing_m_s : std::numeric_limits<double>::quiet_NaN();
    result.reason = !nothing                   ? ""
                    : speeds.unbounded.empty() ? zeroReason(outcome, insides, pair)
                                               : unboundedReason(speeds.unbounded);
  });
  result.until_ns += nsIn(least_s);
  result.others_until_ns = others ? outcome.stamp_ns + nsIn(others_s) : result.until_ns;
  if (result.until_ns == result.stamp_ns && result.reason.empty()) result.reason = "the time is less than a nanosecond";
  return result;
}

const SafeUntil& PromiseWatch::follow(const Outcome& outcome) {
  broken_.clear();
  promise_ = safeUntil(outcome, bounds_);
  if (!outcome.answered) return promise_;
  broken_ = std::exchange(revoked_, {});
  const StampNs time_ns = step_ ? outcome.stamp_ns - step_->stamp_ns : 0;
  if (time_ns > 0) {
    const auto say = [&](const std::string& what) { broken_ += (broken_.empty() ? "" : "; ") + what; };
    const std::size_t bodies = std::min(step_->bodies.size(), outcome.step->bodies.size());
    for (std::size_t b = 0; b < bodies; ++b) {
      const Body &before = step_->bodies[b], &now = outcome.step->bodies[b];
      if (before.name != now.name || before.t1->size() != now.t1->size()) {
        say("body '" + before.name + "' has another mesh");
        continue;
      }
      if (!std::isfinite(assumed_[b].max_m_s)) continue;
      bool was_faster = false;
      const auto look = [&](const Positions& from, const Positions& to, StampNs ns) {
        if (was_faster) return;
        const std::optional<std::size_t> v = faster(from, to, assumed_[b].max_m_s, ns);
        if (!v) return;
        was_faster = true;
        std::ostringstream text;
        text << "body '" << now.name << "' was faster than " << assumed_[b].max_m_s << " m/s: vertex " << *v << " came "
             << (to[*v] - from[*v]).norm() << " m in " << secondsBetween(0, ns) << " s";
        say(text.str());
      };
      look(*before.t1, *now.t1, time_ns);
      if (now.waypoints.empty()) continue;
      forEachLeg(now, [&](const Positions& from, const Positions& to, double share) {
        look(from, to,
             static_cast<StampNs>(
                 std::ceil(share * static_cast<double>(outcome.step->stamp_ns - outcome.step->start_ns))));
      });
    }
    if (step_->bodies.size() != outcome.step->bodies.size()) say("there are other bodies");
    const bool moved = obstacle_ && outcome.obstacle &&
                       step_->map.map_from_fixed.matrix() != outcome.step->map.map_from_fixed.matrix();
    const bool grew = outcome.obstacle && outcome.obstacle != obstacle_ &&
                      (obstacle_ ? hasNewVoxels(*outcome.obstacle, *obstacle_) : outcome.obstacle->leafCount() > 0);
    if (moved) say("the map is elsewhere");
    if (grew) say("the map has new voxels");
    ++(broken_.empty() ? counts_.kept : counts_.broken);
  }
  step_ = nullptr;
  if (!promise_.isPromise()) return promise_;
  ++counts_.made;
  step_ = outcome.step;
  obstacle_ = outcome.obstacle;
  assumed_ = boundsAfter(outcome, bounds_);
  return promise_;
}

void PromiseWatch::revoke(const std::string& why) {
  if (!step_) return;
  promise_.stamp_ns = step_->stamp_ns;
  forget(why);
  broken_ = revoked_ = why;
  ++counts_.broken;
}

void PromiseWatch::forget(const std::string& why) {
  step_ = nullptr;
  obstacle_ = nullptr;
  const StampNs stamp_ns = promise_.stamp_ns;
  promise_ = {};
  promise_.stamp_ns = promise_.until_ns = promise_.others_until_ns = stamp_ns;
  promise_.reason = why;
  broken_.clear();
  revoked_.clear();
}

double separationDistance(double scale, double v_r_m_s, double v_h_m_s, const SpeedLaw& law) {
  const double stopping_time_s = scale * law.stopping_time_s;
  return v_h_m_s * (law.reaction_time_s + stopping_time_s) + scale * v_r_m_s * law.reaction_time_s +
         scale * v_r_m_s * stopping_time_s / 2 + law.uncertainty_m;
}

double speedScale(double distance_m, double v_r_m_s, double v_h_m_s, const SpeedLaw& law) {
  if (!(separationDistance(0, v_r_m_s, v_h_m_s, law) <= distance_m) || !std::isfinite(distance_m)) return 0;
  if (separationDistance(1, v_r_m_s, v_h_m_s, law) <= distance_m) return 1;
  // S_p grows with the scale. Halving finds the largest double that is short of the distance as it is rounded.
  double low = 0, high = 1;
  for (;;) {
    const double middle = low + (high - low) / 2;
    if (middle <= low || middle >= high) return low;
    (separationDistance(middle, v_r_m_s, v_h_m_s, law) <= distance_m ? low : high) = middle;
  }
}

SpeedScale speedScale(const Outcome& outcome, const std::vector<SpeedBound>& given, const SpeedLaw& law) {
  const auto require = [](double value, const char* name) {
    if (value >= 0 && std::isfinite(value)) return;
    std::ostringstream text;
    text << name << " of the speed law is " << value << "; it must be finite and 0 or more";
    throw std::invalid_argument(text.str());
  };
  require(law.reaction_time_s, "reaction_time_s");
  require(law.stopping_time_s, "stopping_time_s");
  require(law.uncertainty_m, "uncertainty_m");
  SpeedScale result;
  // Scale 1 is full speed, whatever was done of late: a factor of the last motion says nothing of what an arm may do.
  const std::vector<SpeedBound> bounds = boundsOf(outcome, given);
  result.reason = whyNone(outcome);
  if (!result.reason.empty()) return result;
  result.scale = 1;
  const Insides insides(outcome);
  forPairs(outcome, [&](const Clearance& pair, std::size_t number) {
    if (!counts(outcome, pair) || isItself(pair)) return;
    const Speeds speeds = speedsOf(outcome, pair, bounds);
    if (speeds.slowed == 0) return;
    const double distance_m = distanceOf(outcome, insides, pair);
    const bool bounded = speeds.unbounded.empty();
    const double scale = bounded && distance_m > 0 ? speedScale(distance_m, speeds.slowed, speeds.other, law) : 0;
    if (scale >= result.scale) return;
    result.scale = scale;
    result.limiting = number;
    result.distance_m = distance_m;
    result.needed_m =
        bounded ? separationDistance(1, speeds.slowed, speeds.other, law) : std::numeric_limits<double>::quiet_NaN();
    std::ostringstream text;
    text << pairOf(outcome, pair) << " are " << distance_m << " m apart, and " << result.needed_m
         << " m are needed at full speed";
    result.reason = !bounded         ? unboundedReason(speeds.unbounded)
                    : distance_m > 0 ? text.str()
                                     : zeroReason(outcome, insides, pair);
  });
  if (assuranceOf(outcome).touching == Touching::NEW) {
    result.scale = 0;
    result.reason = "something touches anew";
  }
  return result;
}

}  // namespace dccd
