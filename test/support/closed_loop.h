// An arm that carries a cloth past obstacles, and slows down as a law says: what holds such laws against each other.
#pragma once

#include <cstdint>
#include <functional>

#include "dccd/outcome.h"

namespace dccd {
namespace test {

/// The loop's constants, which a law may know.
struct ClosedLoop {
  static constexpr double FULL_SPEED_M_S = 0.5;
  static constexpr double CLOTH_SPEED_M_S = 0.8;  ///< no point of the cloth is faster, swinging included
  static constexpr double BRAKING_M_S2 = 2;       ///< nominal; an arm of a run has 0.8 to 1.2 of it
  static constexpr double PICKS_UP_M_S2 = 1;      ///< of the steady arm
  static constexpr double JERKS_M_S2 = 2;         ///< of the one that restarts
  static constexpr double FRAME_S = 1.0 / 30;     ///< from one frame to the next
  static constexpr double MOST_LATENCY_S = 0.07;  ///< from a frame's stamp until the arm takes its scale
  static constexpr double LOST_SHARE = 0.01;      ///< of the frames
  static constexpr double NEAR_WALL_M = 0.08;     ///< between gripper and wall when the run has arrived
  static constexpr double ON_S = 3;               ///< for which the arm then wants to go on
  static constexpr double LONGEST_S = 60;         ///< a run that has not arrived by then ends
  /// From a frame's stamp until the arm takes the next one's scale, one frame between them being lost.
  static constexpr double REACTION_S = 2 * FRAME_S + MOST_LATENCY_S;
};

/// What the arm wants by itself.
enum class ArmManner : std::uint8_t {
  STEADY,      ///< full speed, always
  RESTARTING,  ///< by turns full speed, to creep (up to a twentieth of it) and to rest, for 0.1 to 1.5 s each
};

/// What became of a run.
struct ClosedLoopRun {
  bool contact = false;       ///< the cloth touched the map, by exact detection of every piece of its way
  bool arrived = false;       ///< near the wall
  double mean_speed_m_s = 0;  ///< of the arm, over its way or until the run ended
  double oldest_s = 0;        ///< of a scale that the arm followed, from its frame's stamp on: the latency, as measured
  double fastest_m_s = 0;     ///< of the cloth's points, from frame to frame
  int restarts = 0;           ///< from rest, or from creeping, to full speed
};

/// A cloth of 8 x 6 points hangs from a gripper that wants to go along x: over a post, whose top the hem clears by 30
/// to 80 mm, and into a wall, of which the arm knows nothing. Post, wall, gusts, latency, lost frames and brakes follow
/// from the seed. `scale`: of full speed, 0 to 1, from the answer to each frame that is not lost, clearances included;
/// of the cloth alone (body 0) and the map. The arm is never faster than that, and stops where the frame of the
/// newest scale that has come to it is older than REACTION_S.
ClosedLoopRun runClosedLoop(std::uint64_t seed, ArmManner manner, const std::function<double(const Outcome&)>& scale);

/// The least distance of the cloth and the map at the answer's end [m], for laws that know no more.
double distanceToMap(const Outcome& outcome);

}  // namespace test
}  // namespace dccd
