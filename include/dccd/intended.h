// Where bodies are meant to go after a step, and what follows: until when nothing touches, and how fast they may go, on
// that path. Without a path SafeUntil and SpeedScale let everything go anywhere (dccd/monitor_extras.h).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dccd/detect.h"
#include "dccd/export.h"
#include "dccd/monitor_extras.h"

namespace dccd {

/// Bodies go from pose to pose as rigid ones of a step do (interpolate(): they turn about their frame's origin, which
/// goes straight), within a tube about that.
struct IntendedPath {
  struct Of {
    std::uint16_t body = 0;
    std::vector<Eigen::Isometry3d> pose;  ///< fixed_from_body at each of the times, as Body::pose_t1
    /// If that is another body, rigid and on the path, the poses are the carrier's, and each vertex of this one leaves
    /// the place at which it would be carried at relative_m_s at the most.
    std::size_t carrier = SpeedBound::NO_CARRIER;
    double relative_m_s = 0;
    /// Whose frame the poses are of.
    std::size_t frameOf() const { return carrier == SpeedBound::NO_CARRIER ? body : carrier; }
  };
  std::vector<double> time_s;  ///< ascending, from 0
  std::vector<Of> bodies;
  /// Of each piece from time to time: how far any vertex of what is meant may be from the way from pose to pose [m].
  std::vector<double> bend_m;
  /// The bodies are within deviation_m + deviation_rate_m_s * (time ahead) of the path, each vertex.
  double deviation_m = 0, deviation_rate_m_s = 0;

  double endsAt() const { return time_s.empty() ? 0 : time_s.back(); }
  double tubeAt(double ahead_s) const { return deviation_m + deviation_rate_m_s * ahead_s; }
  const Of* find(std::size_t body) const;  ///< null: it is not on it
  std::size_t pieceAt(double at_s) const;  ///< that holds the time; the last one at the end
  double shareAt(std::size_t piece, double at_s) const;
};

/// Why nothing follows from the path for these bodies, a clause; empty: it may be used.
DCCD_EXPORT std::string problemOf(const IntendedPath& path, const std::vector<Body>& bodies);

/// Where the bodies of a path are at a time from its begin: a pose each, in their order.
using PosesAt = std::function<std::vector<Eigen::Isometry3d>(double)>;
/// Appends pieces up to until_s to a path with bodies; of one without times also the first. Along the way no vertex has
/// more than this acceleration, and none is further than reach_m from the origin of its body's frame: so many pieces
/// that none bends by more than bend_m, but at most so many. bend_m is what they bend by, if that is more.
DCCD_EXPORT void addPieces(const PosesAt& poses, double until_s, double acceleration_m_s2, double reach_m,
                           double bend_m, std::size_t most_pieces, IntendedPath& path);

/// Where on a path bodies are at a step's end.
struct PlaceOnPath {
  double time_s = 0;
  double off_m = SpeedBound::NONE;  ///< no vertex is further from where it would be then
  double last_s = 0;                ///< at no later time are all within within_m of where they would be
};
/// The place between these times that is nearest to where the step ends: of the first stretch on which all vertices are
/// within within_m [m] of it, if there is one. Its bodies need not be rigid.
DCCD_EXPORT PlaceOnPath placeOnPath(const IntendedPath& path, const Step& step, double from_s, double to_s,
                                    double within_m = 0);
/// The rest of a path from a time on, for lasts_s [s] at the most; time_s begins with 0 again. Who is at from_s may
/// already be as far as by_s: the way to there takes no time to speak of.
DCCD_EXPORT IntendedPath restOf(const IntendedPath& path, double from_s, double by_s, double lasts_s);

/// Where the vertices of a body that another one carries would be at the other step's end, if they were fixed to that.
DCCD_EXPORT Positions carriedTo(const Step& from, const Step& to, std::size_t body, std::size_t carrier);

/// The same way from where the step has the bodies.
DCCD_EXPORT IntendedPath beginningAt(const IntendedPath& path, const Step& step);

/// What is known of a pair of partners of which one is on the path.
enum class PathContact : std::uint8_t {
  FREE = 0,  ///< they are apart
  /// They touch, or nobody knows how far apart they are, and nothing shows that the path leads away.
  TOUCHES_AND_APPROACHES = 1,
  TOUCHES_AND_LEAVES = 2,  ///< they touch at the surface, and on the path they come no nearer
};

class PathDistances;

/// What follows from a path beside the bounds: never less than from these alone.
struct AlongPath {
  SafeUntil until;
  SpeedScale scale;                         ///< without a law 0
  double scale_by_bounds = 0;               ///< without the path
  PathContact contact = PathContact::FREE;  ///< of all pairs: the worst
  bool rests_on_path = false;               ///< `until` is later than without one
  std::string unused;                       ///< why the path says nothing; empty: it was used
  std::size_t searches = 0;                 ///< of a pair's distance over a stretch of the path
};

/// What is on a path touches nothing of which the outcome speaks before free_s [s], by the theorem below.
struct FirstTouch {
  double free_s = 0;
  std::optional<std::array<std::uint16_t, 2>> body;  ///< which two may touch then; none: all of the path is free
  Vec3 point = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());  ///< where the two are nearest then
  std::string unknown;  ///< why free_s is no more, where that is for want of knowledge
};

/// Until when, and how fast, on a path that begins where the step ends.
///
/// What is assumed: each body of the path is carried from where the step has it along the path, at 0 to 1 times its
/// pace, whichever, and each of its vertices is within tubeAt(t) of there t seconds after the step's end; of what a
/// body of it carries by relative_m_s t more, which is part of the tubes below. Bodies that are not on it keep to their
/// bounds, and all else is as for SafeUntil.
///
/// Theorem (until). Let D(x) be the least distance of two partners, less their minimum separation and what the pieces
/// bend by, while those on the path go from its begin to the time x and the others stay where the step has them, and
/// g(t) the sum of the tubes of those that are on it, and of bound * t of those that are not. If 0 < g(x) <= D(x), the
/// two do not touch before the step's end + x. Nor do they before d / v, as without a path: the later one counts.
/// Proof. Before x each vertex on the path is within its tube of a place that the path passes until x, each other one
/// within bound * t of where it was, and g does not fall. A point of a feature is a mean of its vertices, so it is off
/// by no more. Surfaces that are apart at all times carry nothing into each other.
///
/// Theorem (scale). At a scale s the bodies pass the path up to x = s T_r + s^2 T_s / 2 until they stand, W = T_r + s
/// T_s after the step's end. If D(x) is at least the tubes at W + v_h W + v_r x + C (v_r of what slows down and is not
/// on the path), the two do not touch before all stands, which leaves C. A pair may also be as fast as its bounds
/// alone allow, or, the standing rule, if all of it slows down,
/// - if it comes no nearer on the path than where it begins, but for the tolerance of distances and bend_m; or
/// - where it touches: if there is a plane that has all of the body in front of it, the body's least height over it at
///   no end of a piece up to x is less than at its begin, and what of the partner, which is not on the path, is not
///   behind the plane keeps the first condition.
/// Then nothing of the partner, however it moves, reaches the body sooner than it could reach one that stands still
/// within the same tube; a standing one is all that scale 0 gives. A body and its partner are not inside of each other:
/// of those that touch the box around neither holds the other one's where that is closed, or all of the partner is
/// behind the plane.
class DCCD_EXPORT PathSearch {
 public:
  /// Stretches of the path that are searched for one pair, at most; what is left out is not promised.
  static constexpr std::size_t MOST_SEARCHES = 96;

  /// `options`: those of the outcome. Once the deadline is over what was found until then holds. `first`: is filled
  /// where the path is used. Throws as safeUntil() and speedScale() do.
  AlongPath run(const Outcome& outcome, const Options& options, const std::vector<SpeedBound>& bounds,
                const std::optional<SpeedLaw>& law, const IntendedPath& path, Deadline deadline = {},
                FirstTouch* first = nullptr);

 private:
  std::shared_ptr<PathDistances> distances_;  // what lasts from run to run, which saves time alone
};

}  // namespace dccd
