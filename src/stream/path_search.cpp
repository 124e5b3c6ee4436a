// What follows from an intended path: each pair is asked for all of it at once, and piece by piece only where that is
// not enough; the first piece that may touch is halved.
#include "stream/path_search.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "dccd/mesh_store.h"
#include "step/parts.h"
#include "step/threads.h"
#include "stream/path_distances.h"

namespace dccd {
namespace {

constexpr double UP = 1 + 1e-12;              // [1] more than a few roundings take
constexpr int OPEN_PERCENT = 2, OPEN_MS = 1;  // of the time that is found, what may be missing: the larger one
constexpr double PLANE_PIECES = 32;           // of the time that is asked for, about

}  // namespace

const char* toString(PathContact contact) {
  static constexpr const char* NAMES[] = {"FREE", "TOUCHES_AND_APPROACHES", "TOUCHES_AND_LEAVES"};
  return NAMES[static_cast<std::size_t>(contact)];
}

double PathPace::scaleOf(double time_s) const {
  if (!(time_s > 0)) return 0;
  if (timeOf(1) <= time_s) return 1;
  double low = 0, high = 1;
  for (;;) {
    const double middle = low + (high - low) / 2;
    if (middle <= low || middle >= high) return low;
    (timeOf(middle) <= time_s ? low : high) = middle;
  }
}

double PathPair::untilNeeds(double ahead_s) const { return (deviation_m + (rate_m_s + closing_m_s) * ahead_s) * UP; }

double PathPair::scaleNeeds(double scale, const PathPace& pace) const {
  const double stands_s = pace.law.reaction_time_s + scale * pace.law.stopping_time_s;
  return (deviation_m + (rate_m_s + other_m_s) * stands_s + slowed_m_s * pace.timeOf(scale) + pace.law.uncertainty_m) *
         UP;
}

namespace {

enum class Goal : std::uint8_t { UNTIL, SCALE };

/// One outcome and one path.
class Search {
 public:
  Search(const Outcome& outcome, const Options& options, const std::vector<SpeedBound>& bounds,
         const std::optional<SpeedLaw>& law, const IntendedPath& path, Deadline deadline, PathDistances& distances)
      : outcome_(outcome),
        after_(boundsAfter(outcome, bounds)),
        full_(boundsOf(outcome, bounds)),
        law_(law),
        path_(beginningAt(path, *outcome.step)),
        deadline_(deadline),
        distances_(distances),
        tolerance_m_(options.clearance.tolerance_m) {
    distances_.begin(outcome_, path_, deadline_);
    addPairs();
  }

  /// `result`: what the bounds alone allow.
  void run(AlongPath& result) {
    findUntil(result);
    if (law_) findScale(result);
    result.searches = distances_.questions();
  }
  FirstTouch firstTouch() {
    FirstTouch first;
    first.free_s = farthest(Goal::UNTIL, path_.endsAt());
    if (!failing_) return first;
    const PathPair& pair = pairs_[*failing_];
    first.body = pair.body;
    first.point = distances_.nearest(pair.way, first.free_s);
    if (pair.start_m == 0 && !pair.touches) {
      first.unknown = "nobody knows how far they are apart";
    } else if (!std::isfinite(pair.untilNeeds(1))) {
      first.unknown = "nobody says how fast one of them is";
    } else if (pair.is_cut) {
      first.unknown = "there was no time to look further";
    }
    return first;
  }

 private:
  using Stretch = PathDistances::Stretch;

  void addPairs() {
    const Insides insides(outcome_);
    forPairs(outcome_, [&](const Clearance& row, std::size_t number) {
      if (!counts(outcome_, row)) return;
      const double distance_m = distanceOf(outcome_, insides, row);
      const Speeds by_bounds = speedsOf(outcome_, row, after_), at_full = speedsOf(outcome_, row, full_);
      const bool bounded = by_bounds.unbounded.empty() && distance_m > 0;
      const double apart_s = bounded ? secondsTo(distance_m, by_bounds.closing()) : 0;
      const bool is_limited = !isItself(row) && at_full.slowed > 0;
      const bool known = at_full.unbounded.empty() && distance_m > 0;
      const double allowed = !is_limited || !law_ ? 1
                             : known              ? dccd::speedScale(distance_m, at_full.slowed, at_full.other, *law_)
                                                  : 0;
      PathPair pair;
      pair.body = row.body;
      pair.number = number;
      for (const std::uint16_t body : row.body) pair.on_path += body != OBSTACLE_BODY && path_.has(body);
      if (isItself(row) || pair.on_path == 0) {
        (isItself(row) ? itself_s_ : off_path_s_) = std::min(isItself(row) ? itself_s_ : off_path_s_, apart_s);
        off_path_scale_ = std::min(off_path_scale_, allowed);
        return;
      }
      pair.separation_m = separationOf(outcome_, row);
      pair.touches = row.at_end.status == ClearanceStatus::TOUCHING;
      pair.start_m = distance_m;
      pair.most_m = std::max(distance_m, row.at_end.upper_m);
      pair.deviation_m = static_cast<double>(pair.on_path) * path_.deviation_m;
      pair.rate_m_s = static_cast<double>(pair.on_path) * path_.deviation_rate_m_s;
      for (const std::uint16_t body : row.body) {
        if (body == OBSTACLE_BODY || path_.has(body)) continue;
        (full_[body].slows_down ? pair.slowed_m_s : pair.other_m_s) = full_[body].max_m_s;
        pair.closing_m_s = after_[body].max_m_s;
      }
      bool slows = true;
      for (const std::uint16_t body : row.body)
        slows = slows && (body == OBSTACLE_BODY || !path_.has(body) || full_[body].slows_down);
      pair.apart_s = apart_s;
      pair.allowed_s = allowed >= 1 ? SpeedBound::NONE : law_ ? PathPace{*law_}.timeOf(allowed) : 0;
      pair.may_scale = slows && std::isfinite(pair.slowed_m_s) && std::isfinite(pair.other_m_s);
      pair.may_stand = pair.may_scale && pair.other_m_s == 0 && row.at_end.status != ClearanceStatus::UNKNOWN;
      pair.way = distances_.wayOf(pair.body);
      pairs_.push_back(std::move(pair));
    });
    // The first ones shorten what the others are asked for.
    std::stable_sort(pairs_.begin(), pairs_.end(),
                     [](const PathPair& a, const PathPair& b) { return a.start_m < b.start_m; });
  }

  Positions placed(std::size_t of, const Eigen::Isometry3d& pose) const {
    const Body& body = outcome_.step->bodies[path_.bodies[of].body];
    const Eigen::Isometry3d moved = pose * body.pose_t1.inverse();
    Positions places(body.t1->size());
    for (std::size_t v = 0; v < places.size(); ++v) places[v] = moved * (*body.t1)[v];
    return places;
  }

  double needs(Goal goal, const PathPair& pair, double time_s) const {
    return goal == Goal::UNTIL ? pair.untilNeeds(time_s)
                               : pair.scaleNeeds(PathPace{*law_}.scaleOf(time_s), PathPace{*law_});
  }

  bool mayGoOn(const PathPair& pair) const {
    return pair.asked.size() < PathSearch::MOST_SEARCHES && !deadline_.isOver();
  }

  /// What is between the two at least over the stretch, but for bends: by what was asked before, where that is enough,
  /// or asked now.
  double distanceOver(PathPair& pair, const Stretch& stretch, double enough_m, double tolerance_m) {
    double least_m = pair.start_m - distances_.goneBy(pair.way, {0, stretch.to_s});
    for (const PathPair::Asked& one : pair.asked) {
      if (one.of.from_s == stretch.from_s && one.of.to_s == stretch.to_s && one.enough_m >= enough_m &&
          one.tolerance_m <= tolerance_m)
        return one.least_m;
      if (one.of.from_s <= stretch.from_s && one.of.to_s >= stretch.to_s) {
        least_m = std::max(least_m, one.least_m);
      } else if (one.of.to_s <= stretch.from_s) {
        least_m = std::max(least_m, one.least_m - distances_.goneBy(pair.way, {one.of.to_s, stretch.to_s}));
      }
    }
    if (least_m >= enough_m || !mayGoOn(pair)) return std::max(0.0, least_m);
    const double asked_m = enough_m + pair.separation_m;
    const double found_m = (distances_.over(pair.way, stretch, asked_m, tolerance_m) - pair.separation_m) * (1 - 1e-12);
    pair.asked.push_back({stretch, enough_m, tolerance_m, std::max({0.0, least_m, found_m})});
    return pair.asked.back().least_m;
  }

  /// Whether it is known that nothing of the pair comes nearer up to this time than it is at the begin.
  bool stands(PathPair& pair, double to_s) {
    const double least_m = pair.start_m - 2 * tolerance_m_ - tolerance::CLEARANCE_RELATIVE * pair.start_m;
    // What stays as it is is told from what comes nearer.
    std::vector<double> ends{to_s};
    while (pair.stands_s < to_s && !pair.comes_nearer) {
      // What arcs take off is given back: their ends are on the straight ways, which come no nearer.
      const Stretch stretch{pair.stands_s, ends.back()};
      const double held_m = least_m - distances_.arcOf(pair.way, stretch);
      if (held_m > 0 && distanceOver(pair, stretch, held_m, tolerance_m_) >= held_m) {
        pair.stands_s = stretch.to_s;
        ends.pop_back();
      } else if (distances_.pieceEnd(stretch.from_s) < stretch.to_s && mayGoOn(pair)) {
        ends.push_back(distances_.cutOf(stretch));
      } else {
        pair.comes_nearer = true;
      }
    }
    return pair.stands_s >= to_s;
  }

  /// D is never more than at the begin: for which time up to `to_s` that is enough.
  double lastOf(Goal goal, const PathPair& pair, double to_s) const {
    if (needs(goal, pair, to_s) <= pair.most_m) return to_s;
    double low_s = 0;
    for (int i = 0; i < 30; ++i) {
      const double middle_s = low_s + (to_s - low_s) / 2;
      (needs(goal, pair, middle_s) <= pair.most_m ? low_s : to_s) = middle_s;
    }
    return to_s;
  }

  /// The largest time of the path, up to `to_s`, for which the pair holds.
  double farthest(Goal goal, PathPair& pair, double to_s) {
    const bool scales = goal == Goal::SCALE;
    double holds_s = scales ? std::max(pair.allowed_s, pair.leaves_s) : pair.apart_s;
    if (holds_s >= to_s || pair.start_m == 0 || (scales && !pair.may_scale)) return std::min(holds_s, to_s);
    const double last_s = lastOf(goal, pair, to_s);
    if (last_s < to_s && scales && pair.may_stand && stands(pair, to_s)) return to_s;
    const double enough_m = needs(goal, pair, last_s);
    if (!std::isfinite(enough_m)) return std::min(holds_s, to_s);
    const double tolerance_m = std::max(tolerance_m_ / 2, enough_m / 100);
    const auto lowest = [&](const Stretch& stretch) {
      const double bend_m = distances_.bendOf(pair.way, stretch);
      return distanceOver(pair, stretch, enough_m + bend_m, tolerance_m) - bend_m;
    };
    double known_s = 0, least_m = SpeedBound::NONE;  // of D
    std::vector<double> ends{last_s};
    while (!ends.empty()) {
      const double end_s = ends.back();
      const double here_m = std::min(least_m, lowest({known_s, end_s}));
      if (here_m > 0 && needs(goal, pair, end_s) <= here_m) {
        least_m = here_m;
        known_s = end_s;
        ends.pop_back();
        continue;
      }
      if (known_s == 0 && end_s == to_s && scales && pair.may_stand && stands(pair, to_s)) return to_s;
      if (mayGoOn(pair) && end_s - known_s > std::max(OPEN_MS / 1e3, OPEN_PERCENT * known_s / 100)) {
        ends.push_back(distances_.cutOf({known_s, end_s}));
        continue;
      }
      pair.is_cut = !mayGoOn(pair);
      // What is needed grows with the time: of what was asked the beginning may hold.
      double high_s = end_s;
      for (int i = 0; i < 20 && here_m > 0; ++i) {
        const double middle_s = known_s + (high_s - known_s) / 2;
        (needs(goal, pair, middle_s) <= here_m ? known_s : high_s) = middle_s;
      }
      break;
    }
    holds_s = std::max(holds_s, known_s);
    if (holds_s >= to_s || !scales || !pair.may_stand) return std::min(holds_s, to_s);
    holds_s = std::max(holds_s, pair.stands_s);
    if (holds_s < to_s) holds_s = std::max(holds_s, leavesUntil(pair, to_s));
    return std::min(holds_s, to_s);
  }

  /// Of all pairs. failing_: which one does not hold after it.
  double farthest(Goal goal, double most_s) {
    failing_.reset();
    double holds_s = std::min(most_s, path_.endsAt());
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      const PathPair& pair = pairs_[p];
      if (goal == Goal::SCALE && pair.may_stand) continue;
      const double allowed_s =
          std::max(goal == Goal::UNTIL ? pair.apart_s : pair.allowed_s, lastOf(goal, pair, holds_s));
      if (allowed_s >= holds_s) continue;
      holds_s = allowed_s;
      failing_ = p;
    }
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      const double to_s = holds_s;
      holds_s = farthest(goal, pairs_[p], to_s);
      if (holds_s < to_s) failing_ = p;
    }
    return holds_s;
  }

  void findUntil(AlongPath& result) {
    const bool unbounded = std::any_of(pairs_.begin(), pairs_.end(), [](const PathPair& pair) {
      return pair.apart_s == 0 && (pair.start_m == 0 || !std::isfinite(pair.untilNeeds(1)));
    });
    if (unbounded) return;
    const double on_path_s = farthest(Goal::UNTIL, std::min(path_.endsAt(), MOST_PROMISED_S));
    SafeUntil& until = result.until;
    const double others_s = std::min(on_path_s, off_path_s_), all_s = std::min(others_s, itself_s_);
    const StampNs all_ns = outcome_.stamp_ns + nsIn(all_s), others_ns = outcome_.stamp_ns + nsIn(others_s);
    if (others_ns > until.others_until_ns) {
      result.rests_on_path = true;
      until.others_until_ns = others_ns;
    }
    if (all_ns <= until.until_ns) return;
    result.rests_on_path = true;
    until.until_ns = all_ns;
    until.reason.clear();
    if (all_s < on_path_s) return;  // the pair that limits by its bounds alone is the one that is said already
    until.limiting = SafeUntil::NO_PAIR;
    until.distance_m = until.closing_m_s = std::numeric_limits<double>::quiet_NaN();
    if (!failing_) return;
    const PathPair& pair = pairs_[*failing_];
    until.limiting = pair.number;
    until.distance_m = pair.start_m;
  }

  void findScale(AlongPath& result) {
    const PathPace pace{*law_};
    const double most_s = std::min(path_.endsAt(), pace.timeOf(1));
    for (PathPair& pair : pairs_) {
      if (pair.allowed_s >= most_s || pair.start_m > 0) continue;
      const bool leaves = leavesUntil(pair, most_s) > 0;
      const PathContact contact = leaves ? PathContact::TOUCHES_AND_LEAVES : PathContact::TOUCHES_AND_APPROACHES;
      if (result.contact != PathContact::TOUCHES_AND_APPROACHES) result.contact = contact;
    }
    const double on_path_s = farthest(Goal::SCALE, most_s);
    const double scale = std::min(on_path_s >= pace.timeOf(1) ? 1 : pace.scaleOf(on_path_s), off_path_scale_);
    if (!(scale > result.scale.scale) || assuranceOf(outcome_).touching == Touching::NEW) return;
    SpeedScale& said = result.scale;
    const bool by_path = scale < off_path_scale_;
    said.scale = scale;
    if (scale == 1) {
      said = SpeedScale();
      said.scale = 1;
      return;
    }
    if (!by_path) return;  // what it said is of a pair that is not on the path
    std::ostringstream text;
    said.limiting = SafeUntil::NO_PAIR;
    said.distance_m = said.needed_m = std::numeric_limits<double>::quiet_NaN();
    if (failing_) {
      const PathPair& pair = pairs_[*failing_];
      Clearance names;
      names.body = pair.body;
      said.limiting = pair.number;
      said.distance_m = pair.start_m;
      said.needed_m = pair.scaleNeeds(1, pace);
      text << "on the intended path " << pairOf(outcome_, names) << " come too near after " << on_path_s << " s";
    } else {
      text << "the intended path is known for " << on_path_s << " s";
    }
    said.reason = text.str();
  }

  /// By pieces of their own: the box around one that is long and straight is near to much.
  double leavesUntil(PathPair& pair, double most_s) const {
    if (!pair.may_stand || pair.on_path != 1 || pair.leaves_s > 0) return pair.leaves_s;
    std::size_t of = 0;
    while (path_.bodies[of].body != pair.body[0] && path_.bodies[of].body != pair.body[1]) ++of;
    std::vector<Positions> ends{placed(of, path_.bodies[of].pose[0])};
    std::vector<double> leaves_m, time_s{0};
    Body part = outcome_.step->bodies[path_.bodies[of].body];
    part.waypoints.clear();
    part.turns = true;
    part.pose_t1 = path_.bodies[of].pose[0];
    for (std::size_t k = 0; k < path_.bend_m.size() && time_s.back() < most_s; ++k) {
      const double begins_s = path_.time_s[k], lasts_s = std::min(path_.time_s[k + 1], most_s) - begins_s;
      const double count = std::ceil(PLANE_PIECES * lasts_s / most_s);
      for (double i = 1; i <= count; ++i) {
        time_s.push_back(begins_s + i / count * lasts_s);
        const double u = (time_s.back() - begins_s) / (path_.time_s[k + 1] - begins_s);
        part.pose_t0 = part.pose_t1;
        part.pose_t1 = interpolate(path_.bodies[of].pose[k], path_.bodies[of].pose[k + 1], std::min(u, 1.0));
        part.t0 = share(ends.back());
        ends.push_back(placed(of, part.pose_t1));
        part.t1 = share(ends.back());
        leaves_m.push_back(path_.bend_m[k] + leavesWayBy(part, 1, 1));
      }
    }
    pair.leaves_s = LeavingPlanes(outcome_, pair, path_.bodies[of].body, std::move(ends), std::move(leaves_m),
                                  std::move(time_s), PathPace{*law_})
                        .until();
    return pair.leaves_s;
  }

  const Outcome& outcome_;
  const std::vector<SpeedBound> after_, full_;
  const std::optional<SpeedLaw> law_;
  const IntendedPath path_;  // from where the bodies are
  const Deadline deadline_;
  PathDistances& distances_;
  const double tolerance_m_;  // of distances that the step has
  std::vector<PathPair> pairs_;
  std::optional<std::size_t> failing_;
  double off_path_s_ = MOST_PROMISED_S, itself_s_ = MOST_PROMISED_S, off_path_scale_ = 1;
};

/// A path that breaks a bound says that one of the two is wrong. Empty: it breaks none. What takes no longer than
/// stamps tell apart has no pace: there nobody knows how far on the path the bodies are (restOf()).
std::string whyTooFast(const Outcome& outcome, const std::vector<SpeedBound>& bounds, const IntendedPath& path) {
  for (const IntendedPath::Of& of : path.bodies) {
    const Body& body = outcome.step->bodies[of.body];
    if (!std::isfinite(bounds[of.body].max_m_s)) continue;
    Eigen::AlignedBox3d box;
    const Eigen::Isometry3d to_body = body.pose_t1.inverse();
    for (const Vec3& p : *body.t1) box.extend(to_body * p);
    for (std::size_t k = 0; k < path.bend_m.size(); ++k) {
      constexpr double NO_PACE_S = 2e-9;
      const double lasts_s = path.time_s[k + 1] - path.time_s[k];
      if (lasts_s < NO_PACE_S) continue;
      const double most_m = bounds[of.body].max_m_s * lasts_s * (1 + 1e-9) + 1e-12;
      const auto isTooFar = [&](const Vec3& p) { return (of.pose[k + 1] * p - of.pose[k] * p).norm() > most_m; };
      bool may_be = false;
      for (int i = 0; i < 8; ++i)
        may_be = may_be || isTooFar(box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(i)));
      if (!may_be ||
          std::none_of(body.t1->begin(), body.t1->end(), [&](const Vec3& p) { return isTooFar(to_body * p); }))
        continue;
      std::ostringstream text;
      text << "on it '" << body.name << "' is faster than " << bounds[of.body].max_m_s << " m/s";
      return text.str();
    }
  }
  return "";
}

}  // namespace

AlongPath PathSearch::run(const Outcome& outcome, const Options& options, const std::vector<SpeedBound>& bounds,
                          const std::optional<SpeedLaw>& law, const IntendedPath& path, Deadline deadline,
                          FirstTouch* first) {
  const ScopedFloatMode mode;
  AlongPath result;
  result.until = safeUntil(outcome, bounds);
  if (law) result.scale = speedScale(outcome, bounds, *law);
  result.unused = whyNone(outcome);
  if (result.unused.empty()) result.unused = problemOf(path, outcome.step->bodies);
  if (!result.unused.empty()) return result;
  result.unused = whyTooFast(outcome, boundsOf(outcome, bounds), path);
  if (!result.unused.empty()) return result;
  if (!distances_) distances_ = std::make_shared<PathDistances>();
  Search search(outcome, options, bounds, law, path, deadline, *distances_);
  if (first) *first = search.firstTouch();
  search.run(result);
  return result;
}

}  // namespace dccd
