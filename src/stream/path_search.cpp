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

}  // namespace

double PathPace::scaleOf(double time_s) const {
  if (!(time_s > 0)) return 0;
  return timeOf(1) <= time_s ? 1 : halved(0, 1, [&](double scale) { return timeOf(scale) <= time_s; }).first;
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
        bounds_(boundsOf(outcome, bounds)),
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
    PathPair& pair = pairs_[*failing_];
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
      PathPair pair;
      pair.body = row.body;
      pair.number = number;
      pair.start_m = distanceOf(outcome_, insides, row);
      const Speeds speeds = speedsOf(*outcome_.step, row, bounds_);
      const bool is_known = speeds.unbounded.empty() && pair.start_m > 0;
      if (is_known) pair.apart_s = secondsTo(pair.start_m, speeds.closing());
      double allowed = 1;
      if (law_ && !isItself(row) && speeds.slows)
        allowed = is_known ? dccd::speedScale(pair.start_m, speeds.slowed, speeds.other, *law_) : 0;
      bool slows = true, swings_on = false;  // what is on the path; what it carries, when all stands
      for (const std::uint16_t body : row.body) {
        if (body == OBSTACLE_BODY) {
          if (!outcome_.step->map.way.empty()) pair.other_m_s = pair.closing_m_s = SpeedBound::NONE;
          continue;
        }
        if (const IntendedPath::Of* const of = path_.find(body)) {
          ++pair.on_path;
          pair.rate_m_s += of->relative_m_s;
          slows = slows && bounds_[of->frameOf()].slows_down;
          swings_on = swings_on || !bounds_[body].slows_down;
        } else {
          pair.closing_m_s = bounds_[body].max_m_s;
          (bounds_[body].slows_down ? pair.slowed_m_s : pair.other_m_s) = pair.closing_m_s;
        }
      }
      if (isItself(row) || pair.on_path == 0) {
        double& until_s = isItself(row) ? itself_s_ : off_path_s_;
        until_s = std::min(until_s, pair.apart_s);
        off_path_scale_ = std::min(off_path_scale_, allowed);
        return;
      }
      pair.separation_m = separationOf(*outcome_.step, row);
      pair.touches = row.at_end.status == ClearanceStatus::TOUCHING;
      pair.most_m = std::max(pair.start_m, row.at_end.upper_m);
      pair.deviation_m = static_cast<double>(pair.on_path) * path_.deviation_m;
      pair.rate_m_s += static_cast<double>(pair.on_path) * path_.deviation_rate_m_s;
      pair.allowed_s = allowed >= 1 ? SpeedBound::NONE : law_ ? PathPace{*law_}.timeOf(allowed) : 0;
      pair.may_scale = slows && std::isfinite(pair.slowed_m_s) && std::isfinite(pair.other_m_s);
      pair.may_stand =
          pair.may_scale && pair.other_m_s == 0 && !swings_on && row.at_end.status != ClearanceStatus::UNKNOWN;
      pair.way = distances_.wayOf(pair.body);
      pairs_.push_back(std::move(pair));
    });
    // The first ones shorten what the others are asked for.
    std::stable_sort(pairs_.begin(), pairs_.end(),
                     [](const PathPair& a, const PathPair& b) { return a.start_m < b.start_m; });
  }

  double needs(Goal goal, const PathPair& pair, double time_s) const {
    return goal == Goal::UNTIL ? pair.untilNeeds(time_s)
                               : pair.scaleNeeds(PathPace{*law_}.scaleOf(time_s), PathPace{*law_});
  }

  bool mayGoOn(const PathPair& pair) const {
    return pair.asked.size() < PathSearch::MOST_SEARCHES && !deadline_.isOver();
  }

  /// What is between the two at least over the stretch, but for bends: by what was asked before, where that is enough,
  /// or asked now: of less than that any bound, if only that matters.
  double distanceOver(PathPair& pair, const Stretch& stretch, double enough_m, double tolerance_m,
                      bool only_whether = false) {
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
    const double found_m =
        (distances_.over(pair.way, stretch, asked_m, tolerance_m, only_whether) - pair.separation_m) * (1 - 1e-12);
    const double of_m = only_whether && found_m < enough_m ? 0 : enough_m;  // another time it may matter
    pair.asked.push_back({stretch, of_m, tolerance_m, std::max({0.0, least_m, found_m})});
    return pair.asked.back().least_m;
  }

  /// Up to which time from from_s on `holds` holds, stretch after stretch; one for which it does not is halved where
  /// `may_halve` allows that.
  template <class Holds, class MayHalve>
  double upTo(double from_s, double to_s, const Holds& holds, const MayHalve& may_halve) {
    for (std::vector<double> ends{to_s}; !ends.empty();) {
      const Stretch stretch{from_s, ends.back()};
      if (holds(stretch)) {
        from_s = stretch.to_s;
        ends.pop_back();
      } else if (may_halve(stretch)) {
        ends.push_back(distances_.cutOf(stretch));
      } else {
        break;
      }
    }
    return from_s;
  }

  /// Whether it is known that nothing of the pair comes nearer up to this time than it is at the begin: what stays as
  /// it is is told from what comes nearer.
  bool stands(PathPair& pair, double to_s) {
    const double least_m = pair.start_m - 2 * tolerance_m_ - tolerance::CLEARANCE_RELATIVE * pair.start_m;
    const auto holds = [&](const Stretch& stretch) {
      // What arcs take off is given back: their ends are on the straight ways, which come no nearer.
      const double held_m = least_m - distances_.arcOf(pair.way, stretch);
      return held_m > 0 && distanceOver(pair, stretch, held_m, tolerance_m_, true) >= held_m;
    };
    const auto may_halve = [&](const Stretch& stretch) {
      return distances_.pieceEnd(stretch.from_s) < stretch.to_s && mayGoOn(pair);
    };
    if (pair.stands_s < to_s && !pair.comes_nearer) {
      pair.stands_s = upTo(pair.stands_s, to_s, holds, may_halve);
      pair.comes_nearer = pair.stands_s < to_s;
    }
    return pair.stands_s >= to_s;
  }

  /// D is never more than at the begin: for which time up to `to_s` that is enough.
  double lastOf(Goal goal, const PathPair& pair, double to_s) const {
    const auto is_enough = [&](double time_s) { return needs(goal, pair, time_s) <= pair.most_m; };
    return is_enough(to_s) ? to_s : halved(0, to_s, is_enough, 30).second;
  }

  /// The largest time of the path, up to `to_s`, for which the pair holds.
  double farthest(Goal goal, PathPair& pair, double to_s) {
    const bool scales = goal == Goal::SCALE, may_stand = scales && pair.may_stand;
    double holds_s = scales ? std::max(pair.allowed_s, pair.leaves_s) : pair.apart_s;
    // Where nothing is needed, some is asked for all the same: what may touch is no less than 0 apart.
    const double last_s = lastOf(goal, pair, to_s), enough_m = std::max(needs(goal, pair, last_s), tolerance_m_);
    const bool may_more = pair.start_m > 0 && (!scales || pair.may_scale) && std::isfinite(enough_m);
    if (holds_s >= to_s || !may_more) return std::min(holds_s, to_s);
    const double tolerance_m = std::max(tolerance_m_ / 2, enough_m / 100);
    double least_m = SpeedBound::NONE, here_m = 0;  // of D; with the last stretch that was asked for
    const auto holds = [&](const Stretch& stretch) {
      const double bend_m = distances_.bendOf(pair.way, stretch);
      here_m = std::min(least_m, distanceOver(pair, stretch, enough_m + bend_m, tolerance_m) - bend_m);
      const bool does = here_m > 0 && needs(goal, pair, stretch.to_s) <= here_m;
      if (does) least_m = here_m;
      return does;
    };
    double open_s = last_s;
    const auto may_halve = [&](const Stretch& stretch) {
      open_s = stretch.to_s;
      pair.is_cut = !mayGoOn(pair);
      return !pair.is_cut && open_s - stretch.from_s > std::max(OPEN_MS / 1e3, OPEN_PERCENT * stretch.from_s / 100);
    };
    const bool is_whole = last_s == to_s && holds({0, to_s});
    if (!is_whole && may_stand && stands(pair, to_s)) return to_s;
    double known_s = is_whole ? to_s : upTo(0, last_s, holds, may_halve);
    // What is needed grows with the time: of what was asked last the beginning may hold.
    const auto is_enough = [&](double time_s) { return needs(goal, pair, time_s) <= here_m; };
    if (known_s < last_s && here_m > 0) known_s = halved(known_s, open_s, is_enough, 20).first;
    holds_s = std::max(holds_s, known_s);
    if (may_stand) holds_s = std::max(holds_s, pair.stands_s);
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
    const double on_path_s = farthest(Goal::UNTIL, std::min(path_.endsAt(), MOST_PROMISED_S));
    SafeUntil& until = result.until;
    const double others_s = std::min(on_path_s, off_path_s_), all_s = std::min(others_s, itself_s_);
    const StampNs all_ns = outcome_.stamp_ns + nsIn(all_s), others_ns = outcome_.stamp_ns + nsIn(others_s);
    result.rests_on_path = others_ns > until.others_until_ns || all_ns > until.until_ns;
    until.others_until_ns = std::max(until.others_until_ns, others_ns);
    if (all_ns <= until.until_ns) return;
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
      const PathContact contact =
          leaves(pair, most_s) > 0 ? PathContact::TOUCHES_AND_LEAVES : PathContact::TOUCHES_AND_APPROACHES;
      if (result.contact != PathContact::TOUCHES_AND_APPROACHES) result.contact = contact;
    }
    const double on_path_s = farthest(Goal::SCALE, most_s);
    const double scale = std::min(on_path_s >= pace.timeOf(1) ? 1 : pace.scaleOf(on_path_s), off_path_scale_);
    if (!(scale > result.scale.scale) || assuranceOf(outcome_).touching == Touching::NEW) return;
    SpeedScale& said = result.scale;
    const bool by_path = scale < off_path_scale_;
    if (by_path || scale == 1) said = SpeedScale();
    said.scale = scale;
    if (!by_path || scale == 1) return;  // else what it said is of a pair that is not on the path
    std::ostringstream text;
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

  double leaves(PathPair& pair, double most_s) const {
    if (pair.may_stand && pair.on_path == 1 && pair.leaves_s == 0)
      pair.leaves_s = leavesUntil(outcome_, pair, path_, most_s, PathPace{*law_});
    return pair.leaves_s;
  }

  const Outcome& outcome_;
  const std::vector<SpeedBound> bounds_;
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
    Positions local;
    Eigen::AlignedBox3d box;
    for (const Vec3& p : *body.t1) {
      local.push_back(outcome.step->bodies[of.frameOf()].pose_t1.inverse() * p);
      box.extend(local.back());
    }
    const std::array<Vec3, 8> corners = cornersOf(box);
    for (std::size_t k = 0; k < path.bend_m.size(); ++k) {
      constexpr double NO_PACE_S = 2e-9;
      const double lasts_s = path.time_s[k + 1] - path.time_s[k];
      if (lasts_s < NO_PACE_S) continue;
      const double most_m = (bounds[of.body].max_m_s + of.relative_m_s) * lasts_s * (1 + 1e-9) + 1e-12;
      const auto isTooFar = [&](const Vec3& p) { return (of.pose[k + 1] * p - of.pose[k] * p).norm() > most_m; };
      if (std::none_of(corners.begin(), corners.end(), isTooFar) || std::none_of(local.begin(), local.end(), isTooFar))
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
  result.scale_by_bounds = result.scale.scale;
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
