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
#include "dccd/intended.h"
#include "obstacle/leaf_sets.h"
#include "obstacle/voxel_surface_impl.h"
#include "step/parts.h"
#include "stream/pairs_ahead.h"

namespace dccd {
namespace {

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

/// Of a body that another one carries: why it is certainly farther from where it would be than its bound allows, or
/// nobody knows; empty: it is not.
std::string leftCarrier(const Step& before, const Step& now, std::size_t b, const SpeedBound& bound, StampNs time_ns) {
  if (bound.carrier >= std::min(before.bodies.size(), now.bodies.size())) return "";  // then there are other bodies
  const std::string& name = now.bodies[b].name;
  const Positions carried = carriedTo(before, now, b, bound.carrier);
  std::ostringstream text;
  for (std::size_t v = 0; v < carried.size(); ++v) {
    const Vec3& to = (*now.bodies[b].t1)[v];
    const double rounding_m = tolerance::CLEARANCE * std::max(carried[v].norm(), to.norm());
    const double off_m = (carried[v] - to).norm();
    const bool is_known = std::isfinite(off_m) || !to.allFinite() || !(*before.bodies[b].t1)[v].allFinite();
    if (is_known && !(off_m > bound.relative_m_s * secondsBetween(0, time_ns) + rounding_m)) continue;
    text << "body '" << name << "' left '" << now.bodies[bound.carrier].name << "' by more than " << bound.relative_m_s
         << " m/s: vertex " << v << " by " << off_m << " m in " << secondsBetween(0, time_ns) << " s";
    break;
  }
  return text.str();
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
  const std::vector<SpeedBound> bounds = boundsOf(outcome, given);
  result.reason = whyNone(outcome);
  if (!result.reason.empty()) return result;
  const Insides insides(outcome);
  double least_s = MOST_PROMISED_S, others_s = MOST_PROMISED_S;
  bool others = false;
  bool first = true;
  forPairs(outcome, [&](const Clearance& pair, std::size_t number) {
    if (!counts(outcome, pair)) return;
    const Speeds speeds = speedsOf(*outcome.step, pair, bounds);
    const double distance_m = distanceOf(outcome, insides, pair);
    const double closing_m_s = speeds.closing();
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
  const StampNs promise_ends_ns = promise_.others_until_ns;
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
      if (const std::string left = leftCarrier(*step_, *outcome.step, b, assumed_[b], time_ns); !left.empty())
        say(left);
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
                       step_->map.fromFixedAt(1).matrix() != outcome.step->map.fromFixedAt(1).matrix();
    const bool grew = outcome.obstacle && outcome.measured != obstacle_ &&
                      (obstacle_ ? hasNewVoxels(*outcome.obstacle, *obstacle_) : outcome.obstacle->leafCount() > 0);
    const std::string why = why_void_ && outcome.stamp_ns <= promise_ends_ns ? why_void_(outcome) : "";
    if (!why.empty()) say(why);
    if (moved) say("the map is elsewhere");
    if (grew) say("the map has new voxels");
    ++(broken_.empty() ? counts_.kept : counts_.broken);
  }
  step_ = nullptr;
  why_void_ = nullptr;
  if (promise_.isPromise()) keep(outcome);
  return promise_;
}

void PromiseWatch::keep(const Outcome& outcome) {
  ++counts_.made;
  step_ = outcome.step;
  obstacle_ = outcome.measured;  // what was seen too seldom, it counts already
  assumed_ = boundsOf(outcome, bounds_);
}

void PromiseWatch::extend(const Outcome& outcome, const SafeUntil& later,
                          std::function<std::string(const Outcome&)> why_void) {
  const bool is_less = later.until_ns < promise_.until_ns || later.others_until_ns < promise_.others_until_ns;
  if (why_void_ && (is_less || !promise_.isPromise())) broken_ = "something else is intended now";
  promise_ = later;
  why_void_ = std::move(why_void);
  if (!step_ && promise_.isPromise()) keep(outcome);
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
  why_void_ = nullptr;
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
  const auto is_short = [&](double scale) { return separationDistance(scale, v_r_m_s, v_h_m_s, law) <= distance_m; };
  return halved(0, 1, is_short).first;
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
  const std::vector<SpeedBound> bounds = boundsOf(outcome, given);
  result.reason = whyNone(outcome);
  if (!result.reason.empty()) return result;
  result.scale = 1;
  const Insides insides(outcome);
  forPairs(outcome, [&](const Clearance& pair, std::size_t number) {
    if (!counts(outcome, pair) || isItself(pair)) return;
    const Speeds speeds = speedsOf(*outcome.step, pair, bounds);
    if (!speeds.slows) return;
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
    const bool is_bound = pair.at_end.status == ClearanceStatus::FARTHER;
    text << pairOf(outcome, pair) << " are " << (is_bound ? "at least " : "") << distance_m << " m apart"
         << (is_bound ? " (farther is not measured: clearance/max_m)" : "") << ", and " << result.needed_m
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
