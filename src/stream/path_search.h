// What is known of the pairs of partners of which one is on an intended path (dccd/intended.h).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "dccd/intended.h"
#include "stream/pairs_ahead.h"
#include "stream/path_distances.h"

namespace dccd {

/// How far scales go on a path: s T_r + s^2 T_s / 2 of its time until all stands.
struct PathPace {
  SpeedLaw law;
  double timeOf(double scale) const { return scale * (law.reaction_time_s + scale * law.stopping_time_s / 2); }
  double scaleOf(double time_s) const;  ///< rounded down, 0 to 1
};

/// Two partners, and what they need along the path.
struct PathPair {
  std::array<std::uint16_t, 2> body{};
  std::size_t number = SafeUntil::NO_PAIR;  ///< its row in the outcome
  double separation_m = 0;
  double start_m = 0, most_m = 0;        ///< distanceOf() at the path's begin, at least and at most
  std::size_t on_path = 0;               ///< how many of the two
  double deviation_m = 0, rate_m_s = 0;  ///< of all that are on it together
  // Of what is not on it [m/s]: until the next frame, and at full speed of what slows down and of what does not.
  double closing_m_s = 0, slowed_m_s = 0, other_m_s = 0;
  double apart_s = 0;      ///< they are apart until then by bounds alone
  double allowed_s = 0;    ///< the time of the path that the scale takes which bounds alone allow
  bool may_scale = false;  ///< what is on the path slows down, and the other one has a bound
  bool may_stand = false;  ///< the standing rule is for it
  bool touches = false;    ///< when the path begins
  bool is_cut = false;     ///< the time that holds for it could be later: the search was at its end
  double leaves_s = 0;     ///< up to then it leaves what it touches
  PathDistances::Way way;
  struct Asked {
    PathDistances::Stretch of;
    double enough_m = 0, tolerance_m = 0;  ///< what was asked for
    double least_m = 0;                    ///< what is between the two, at least
  };
  std::vector<Asked> asked;
  double stands_s = 0;        ///< up to then it comes no nearer than it is at the begin,
  bool comes_nearer = false;  ///< and afterwards it does, or nobody knows

  /// g(t) of the theorem, rounded up.
  double untilNeeds(double ahead_s) const;
  /// What is needed to pass the path up to the time of that scale, rounded up.
  double scaleNeeds(double scale, const PathPace& pace) const;
};

/// Up to which time of the path, most_s at the most, the one of the two that is on it moves away from what it touches,
/// by planes (dccd/intended.h, the standing rule); 0: nothing shows it.
double leavesUntil(const Outcome& outcome, const PathPair& pair, const IntendedPath& path, double most_s,
                   const PathPace& pace);

}  // namespace dccd
