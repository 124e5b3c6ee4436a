// How fast what rigid bodies carry may come nearer to their partners, for controllers that choose their own motion.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "dccd/detect.h"
#include "dccd/export.h"
#include "dccd/monitor_extras.h"

namespace dccd {

/// Some of a body's features are in the box with these corners; all of a partner's that may be near lie beyond a plane.
struct ApproachLimit {
  std::uint16_t body = 0, partner = 0;  ///< a rigid one; the other one, or OBSTACLE_BODY
  std::array<Vec3, 8> corner;           ///< where the step ends [m]; each goes with the body
  Vec3 normal;                          ///< of the plane, a unit vector, towards the partner
  double speed_m_s = 0;  ///< no corner may be further along the normal than this times the time; below 0: it must leave
};

/// Theorem. Let a body of them go any way as a rigid one for horizon_s after the step's end. If, t seconds after it, no
/// corner of its limits is further along its normal than speed_m_s t from where it was, and no vertex further than
/// most_speed_m_s t in any direction, the body touches nothing of which the outcome speaks and `unknown` does not.
/// Proof. A rigid body's features stay in the hull of the corners that they are in, so none is further along the normal
/// than the corners are. Each pair of features is either behind and beyond the plane of some limit, d apart along its
/// normal, or at least max_m apart. With v the partner's bound, r what holds the two apart (radii and separation) and
/// speed_m_s <= (d - r) / h - v, what is between the two along the normal is at least d - (speed_m_s + v) t > r for t
/// up to h; of the others it is max_m - (most_speed_m_s + v) t. A body that is apart at all times is not inside either.
/// Corollary. The first holds if the body's origin o goes straight by u, while it turns evenly by w about it, and for
/// each corner c n.(u + w x (c - o)) + |w|^2 h |c - o| / 2 <= speed_m_s: a turn by |w| t takes a corner off the
/// straight way by no more than (|w| t)^2 |c - o| / 2. What is assumed is what SafeUntil assumes. What a body carries
/// (SpeedBound::carrier) is not spoken of against it, and nothing but rigid bodies is as what moves: a cloth in the
/// hand goes where it may.
struct ApproachLimits {
  std::vector<ApproachLimit> of;
  std::vector<std::uint16_t> bodies;  ///< that are spoken of
  double horizon_s = 0, most_speed_m_s = 0;
  std::vector<std::string> unknown;  ///< of which pairs nothing is known, and why, a clause each
};

class DCCD_EXPORT ApproachSearch {
 public:
  /// Of pairs within max_m, which is not beyond what distances are looked for (ClearanceOptions::max_m). Once the
  /// deadline is over, what was not looked at is unknown. Throws as safeUntil() does.
  ApproachLimits run(const Outcome& outcome, const Options& options, const std::vector<SpeedBound>& bounds,
                     double max_m, double horizon_s, Deadline deadline = {});

 private:
  struct Shapes;
  std::shared_ptr<Shapes> shapes_;  // what lasts from run to run, which saves time alone
};

}  // namespace dccd
