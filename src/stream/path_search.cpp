// What follows from an intended path: pieces of it go through the clearance's engine, the first that may touch is
// halved.
#include "stream/path_search.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <utility>

#include "dccd/mesh_store.h"
#include "step/parts.h"

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

/// Of a pair in a piece of the path [m].
struct InPiece {
  double least_m = 0, end_m = 0;  // less the separation, and what the piece bends by
  double slack_m = 0;  // of least_m: what the bends and the tolerance of distances make of a constant distance
};

enum class Goal : std::uint8_t { UNTIL, SCALE };

/// One outcome and one path.
class Search {
 public:
  Search(const Outcome& outcome, const Options& options, const std::vector<SpeedBound>& bounds,
         const std::optional<SpeedLaw>& law, const IntendedPath& path, Deadline deadline, History& history)
      : outcome_(outcome),
        options_(options),
        after_(boundsAfter(outcome, bounds)),
        full_(boundsOf(outcome, bounds)),
        law_(law),
        path_(path),
        deadline_(deadline),
        history_(history) {
    options_.clearance.wanted = true;
    options_.clearance.self_m = 0;
    options_.clearance.tolerance_m /= 2;  // so that what stays as it is is told from what comes nearer
    options_.patches = options_.earliest_only = false;
    const std::vector<Body>& bodies = outcome.step->bodies;
    step_ = *outcome.step;
    step_.off_path.clear();
    step_.pose_scale = 1;
    step_.start_ns = outcome.stamp_ns;
    // Between those that are not on the path nothing is searched.
    std::vector<std::uint16_t> others;
    for (std::uint16_t b = 0; b < bodies.size(); ++b)
      if (!path.has(b)) others.push_back(b);
    for (std::uint16_t b = 0; b < bodies.size(); ++b) {
      Body& body = step_.bodies[b];
      body.waypoints.clear();
      body.turns = false;
      body.t0 = body.t1;
      body.self_collision = false;
      if (path.has(b)) continue;
      body.against_obstacle = false;
      std::vector<std::uint16_t> all;
      std::set_union(body.not_against.begin(), body.not_against.end(), others.begin(), others.end(),
                     std::back_inserter(all));
      all.erase(std::remove(all.begin(), all.end(), b), all.end());
      body.not_against = std::move(all);
    }
    // From where the bodies are.
    for (IntendedPath::Of& of : beginningAt(path, *outcome.step).bodies) poses_.push_back(std::move(of.pose));
    whole_.resize(path.bend_m.size());
    addPairs();
    limitDistances();
  }

  /// `result`: what the bounds alone allow.
  void run(AlongPath& result) {
    findUntil(result);
    if (law_) findScale(result);
    result.searches = searches_;
  }

 private:
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
      pair.start_m = distance_m;
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
      number_of_[pair.body] = pairs_.size();
      pairs_.push_back(pair);
    });
  }

  /// What is farther apart than anything is needed is not measured. In powers of 2: other options make much anew.
  void limitDistances() {
    const double bend_m = *std::max_element(path_.bend_m.begin(), path_.bend_m.end());
    double most_m = options_.clearance.tolerance_m;
    for (const PathPair& pair : pairs_) {
      double needed_m = pair.untilNeeds(std::min(path_.endsAt(), MOST_PROMISED_S));
      if (law_) needed_m = std::max(needed_m, pair.scaleNeeds(1, PathPace{*law_}));
      if (!std::isfinite(needed_m)) continue;
      most_m = std::max(most_m, (needed_m + 2 * bend_m) * UP + pair.separation_m + 2 * options_.clearance.tolerance_m);
    }
    options_.clearance.max_m = std::min(options_.clearance.max_m, std::exp2(std::ceil(std::log2(most_m))));
  }

  bool holds(Goal goal, const PathPair& pair, const InPiece& in, double time_s) const {
    const double least_m = std::min(pair.least_m, in.least_m);
    const bool is_apart = pair.start_m > 0 && least_m > 0;
    if (goal == Goal::UNTIL) return time_s <= pair.apart_s || (is_apart && pair.untilNeeds(time_s) <= least_m);
    if (time_s <= pair.allowed_s || time_s <= pair.leaves_s) return true;
    if (!pair.may_scale) return false;
    if (is_apart && pair.scaleNeeds(PathPace{*law_}.scaleOf(time_s), PathPace{*law_}) <= least_m) return true;
    return pair.may_stand && !pair.came_nearer && !comesNearer(pair, in);
  }

  bool comesNearer(const PathPair& pair, const InPiece& in) const {
    const double tolerance_m = 2 * options_.clearance.tolerance_m + tolerance::CLEARANCE_RELATIVE * pair.start_m;
    const double held_m = pair.start_m - tolerance_m - in.slack_m;
    return !(held_m > 0 && in.least_m >= held_m && in.end_m >= pair.start_m - tolerance_m);
  }

  bool allHold(Goal goal, const std::vector<InPiece>& in, double time_s) {
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      if (holds(goal, pairs_[p], in[p], time_s)) continue;
      failing_ = p;
      return false;
    }
    return true;
  }

  void keep(const std::vector<InPiece>& in) {
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      pairs_[p].came_nearer = pairs_[p].came_nearer || comesNearer(pairs_[p], in[p]);
      pairs_[p].least_m = std::min(pairs_[p].least_m, in[p].least_m);
    }
  }

  Positions placed(std::size_t of, const Eigen::Isometry3d& pose) const {
    const Body& body = outcome_.step->bodies[path_.bodies[of].body];
    const Eigen::Isometry3d moved = pose * body.pose_t1.inverse();
    Positions places(body.t1->size());
    for (std::size_t v = 0; v < places.size(); ++v) places[v] = moved * (*body.t1)[v];
    return places;
  }

  /// The distances of all pairs in the part of a piece from one share of it to another one.
  std::vector<InPiece> measure(std::size_t piece, double from, double to) {
    std::vector<InPiece> in(pairs_.size());
    ++searches_;
    std::vector<double> slack_m(step_.bodies.size(), 0);
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      Body& body = step_.bodies[path_.bodies[i].body];
      const auto at = [&](double share) { return interpolate(poses_[i][piece], poses_[i][piece + 1], share); };
      const Eigen::Isometry3d begin = from == 0 ? poses_[i][piece] : at(from),
                              end = to == 1 ? poses_[i][piece + 1] : at(to);
      body.turns = true;
      body.pose_t0 = begin;
      body.pose_t1 = end;
      body.t0 = share(placed(i, begin));
      body.t1 = share(placed(i, end));
      slack_m[path_.bodies[i].body] = path_.bend_m[piece] + leavesWayBy(body, 1, 1);
    }
    step_.stamp_ns = step_.start_ns + 1 + nsIn(path_.time_s[piece + 1] - path_.time_s[piece]);
    const Outcome found = detect(step_, options_, history_, deadline_);
    forPairs(found, [&](const Clearance& row, std::size_t) {
      const auto pair = number_of_.find(row.body);
      if (pair == number_of_.end()) return;
      const PathPair& of = pairs_[pair->second];
      InPiece& one = in[pair->second];
      const double bend_m = static_cast<double>(of.on_path) * path_.bend_m[piece];
      const auto less = [&](double distance_m, double by_m) {
        const double rest_m = (distance_m - by_m - of.separation_m) - 1e-12 * distance_m;
        return std::isfinite(distance_m) && rest_m > 0 ? rest_m : 0;
      };
      const auto isKnown = [](const ClearanceDistance& distance) {
        return distance.status != ClearanceStatus::UNKNOWN && distance.status != ClearanceStatus::TOUCHING;
      };
      if (isKnown(row.over_step)) one.least_m = less(row.over_step.lower_m, bend_m);
      if (isKnown(row.at_end)) one.end_m = less(row.at_end.lower_m, 0);
      for (const std::uint16_t body : row.body)
        if (body != OBSTACLE_BODY) one.slack_m += slack_m[body];
    });
    return in;
  }

  bool mayGoOn() const { return searches_ < PathSearch::MOST_SEARCHES && !deadline_.isOver(); }

  const std::vector<InPiece>& wholePiece(std::size_t piece) {
    std::vector<InPiece>& in = whole_[piece];
    if (in.empty()) in = measure(piece, 0, 1);
    return in;
  }

  /// The largest time of the path, up to `most_s`, for which all pairs hold. failing_: which one does not, after it.
  double farthest(Goal goal, double most_s) {
    for (PathPair& pair : pairs_) {
      pair.least_m = SpeedBound::NONE;
      pair.came_nearer = false;
    }
    failing_.reset();
    for (std::size_t k = 0; k < path_.bend_m.size(); ++k) {
      const double begins_s = path_.time_s[k], ends_s = path_.time_s[k + 1], lasts_s = ends_s - begins_s;
      if (begins_s >= most_s) return most_s;
      if (whole_[k].empty() && !mayGoOn()) return begins_s;
      if (allHold(goal, wholePiece(k), std::min(ends_s, most_s))) {
        keep(whole_[k]);
        continue;
      }
      double low_s = begins_s, high_s = std::min(ends_s, most_s);
      std::vector<InPiece> in = whole_[k];  // of what is open, or more
      while (mayGoOn() && high_s - low_s > std::max(OPEN_MS / 1e3, OPEN_PERCENT * low_s / 100)) {
        const double middle_s = low_s + (high_s - low_s) / 2;
        const auto half = measure(k, (low_s - begins_s) / lasts_s, (middle_s - begins_s) / lasts_s);
        if (allHold(goal, half, middle_s)) {
          keep(half);
          low_s = middle_s;
        } else {
          high_s = middle_s;
          in = half;
        }
      }
      // What is needed grows with the time: of what was searched the beginning may hold.
      for (int i = 0; i < 20; ++i) {
        const double middle_s = low_s + (high_s - low_s) / 2;
        (allHold(goal, in, middle_s) ? low_s : high_s) = middle_s;
      }
      allHold(goal, in, high_s);  // says which one does not
      return low_s;
    }
    return std::min(most_s, path_.endsAt());
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
      if (pair.allowed_s >= most_s) continue;
      const bool touches = pair.start_m == 0;
      if (pair.may_stand && pair.on_path == 1) pair.leaves_s = leavesUntil(pair, pace, most_s);
      if (!touches) continue;
      const PathContact contact =
          pair.leaves_s > 0 ? PathContact::TOUCHES_AND_LEAVES : PathContact::TOUCHES_AND_APPROACHES;
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
  double leavesUntil(const PathPair& pair, const PathPace& pace, double most_s) const {
    std::size_t of = 0;
    while (path_.bodies[of].body != pair.body[0] && path_.bodies[of].body != pair.body[1]) ++of;
    std::vector<Positions> ends{placed(of, poses_[of][0])};
    std::vector<double> leaves_m, time_s{0};
    Body part = step_.bodies[path_.bodies[of].body];
    part.turns = true;
    part.pose_t1 = poses_[of][0];
    for (std::size_t k = 0; k < path_.bend_m.size() && time_s.back() < most_s; ++k) {
      const double begins_s = path_.time_s[k], lasts_s = std::min(path_.time_s[k + 1], most_s) - begins_s;
      const double count = std::ceil(PLANE_PIECES * lasts_s / most_s);
      for (double i = 1; i <= count; ++i) {
        time_s.push_back(begins_s + i / count * lasts_s);
        const double u = (time_s.back() - begins_s) / (path_.time_s[k + 1] - begins_s);
        part.pose_t0 = part.pose_t1;
        part.pose_t1 = interpolate(poses_[of][k], poses_[of][k + 1], std::min(u, 1.0));
        part.t0 = share(ends.back());
        ends.push_back(placed(of, part.pose_t1));
        part.t1 = share(ends.back());
        leaves_m.push_back(path_.bend_m[k] + leavesWayBy(part, 1, 1));
      }
    }
    return LeavingPlanes(outcome_, pair, path_.bodies[of].body, std::move(ends), std::move(leaves_m), std::move(time_s),
                         pace)
        .until();
  }

  const Outcome& outcome_;
  Options options_;
  std::vector<SpeedBound> after_, full_;
  std::optional<SpeedLaw> law_;
  const IntendedPath& path_;
  Deadline deadline_;
  History& history_;
  Step step_;
  std::vector<std::vector<Eigen::Isometry3d>> poses_;  // as path_.bodies, from where these are
  std::vector<PathPair> pairs_;
  std::map<std::array<std::uint16_t, 2>, std::size_t> number_of_;
  std::vector<std::vector<InPiece>> whole_;  // by piece; empty: not searched
  std::optional<std::size_t> failing_;
  std::size_t searches_ = 0;
  double off_path_s_ = MOST_PROMISED_S, itself_s_ = MOST_PROMISED_S, off_path_scale_ = 1;
};

}  // namespace

namespace {

/// A path that breaks a bound says that one of the two is wrong. Empty: it breaks none.
std::string whyTooFast(const Outcome& outcome, const std::vector<SpeedBound>& bounds, const IntendedPath& path) {
  for (const IntendedPath::Of& of : path.bodies) {
    const Body& body = outcome.step->bodies[of.body];
    if (!std::isfinite(bounds[of.body].max_m_s)) continue;
    Eigen::AlignedBox3d box;
    const Eigen::Isometry3d to_body = body.pose_t1.inverse();
    for (const Vec3& p : *body.t1) box.extend(to_body * p);
    for (std::size_t k = 0; k < path.bend_m.size(); ++k) {
      const double most_m = bounds[of.body].max_m_s * (path.time_s[k + 1] - path.time_s[k]) * (1 + 1e-9) + 1e-12;
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

struct PathSearch::Impl {
  History history;
};

PathSearch::PathSearch() : impl_(std::make_unique<Impl>()) {}
PathSearch::~PathSearch() = default;
PathSearch::PathSearch(PathSearch&& other) noexcept = default;
PathSearch& PathSearch::operator=(PathSearch&& other) noexcept = default;

AlongPath PathSearch::run(const Outcome& outcome, const Options& options, const std::vector<SpeedBound>& bounds,
                          const std::optional<SpeedLaw>& law, const IntendedPath& path, Deadline deadline) {
  AlongPath result;
  result.until = safeUntil(outcome, bounds);
  if (law) result.scale = speedScale(outcome, bounds, *law);
  result.unused = whyNone(outcome);
  if (result.unused.empty()) result.unused = problemOf(path, outcome.step->bodies);
  if (!result.unused.empty()) return result;
  result.unused = whyTooFast(outcome, boundsOf(outcome, bounds), path);
  if (result.unused.empty()) Search(outcome, options, bounds, law, path, deadline, impl_->history).run(result);
  return result;
}

}  // namespace dccd
