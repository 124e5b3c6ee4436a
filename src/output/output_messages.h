// An outcome as messages. Used by the node and by analyze_bag, so that both write the same.
#pragma once

#include <algorithm>
#include <array>

#include <deformable_ccd/Contact.h>
#include <deformable_ccd/ContactArray.h>
#include <deformable_ccd/FirstContact.h>
#include <deformable_ccd/State.h>
#include <deformable_ccd/StepStats.h>
#include <std_msgs/Header.h>

#include "dccd/monitor_extras.h"
#include "dccd/stream.h"
#include "output/statement.h"
#include "report/words.h"

namespace dccd {

/// Messages of a topic that wait for a subscriber; where more come, the oldest go. Deep enough for one that stalls for
/// a second at camera rate: a slower one loses messages, not the node time.
constexpr std::uint32_t TOPIC_QUEUE = 32;

/// The nearest that a message can hold: 0 to 2^32 s.
ros::Time toRosTime(StampNs stamp_ns);

/// A value into a message's field, by the types of both.
template <class From, class To>
void put(const From& from, To& to) {
  to = static_cast<To>(from);
}
template <class T, std::size_t N>
void put(const std::array<T, N>& from, boost::array<T, N>& to) {
  std::copy(from.begin(), from.end(), to.begin());
}
inline void put(const VoxelKey& from, deformable_ccd::Contact::_voxel_key_type& to) { to = {from.x, from.y, from.z}; }
template <class Point>  // or Vector3
void put(const Vec3& from, Point& to) {
  to.x = from.x();
  to.y = from.y();
  to.z = from.z();
}
/// What is not there is NaN: plots leave it out, while an infinity takes their axes away.
double plottable(double value);
/// Of two partners.
template <class Names>
void putNames(const std::array<std::uint16_t, 2>& body, const std::vector<Body>& bodies, Names& out) {
  for (std::size_t side = 0; side < 2; ++side) out[side] = bodyName(body[side], bodies);
}
std_msgs::Header headerOf(StampNs stamp_ns, const std::string& frame);
/// With its geometry; `patch`: identity of its patch, 0 for none.
deformable_ccd::Contact toContact(const Outcome& outcome, const Contact& contact, std::uint64_t patch);

/// What the statistics say beyond the outcome itself.
struct StatsContext {
  FrameCounters frames;  ///< of all bodies
  std::uint64_t weld_changes = 0;
  double latency_s = 0;
  std::uint64_t maps_received = 0, maps_refused = 0, maps_dropped = 0;
  std::uint64_t clouds_only_filled = 0, points_no_measurement = 0;
  std::uint64_t steps_unpublished = 0;  ///< of which not everything was published
  std::uint64_t transforms_unusable = 0;
  std::uint64_t requests_refused = 0;     ///< of ~attach, ~detach and ~remove
  std::uint64_t wrong_row_steps = 0;      ///< clouds of which the data say it
  std::uint64_t markers_passed_over = 0;  ///< messages of markers that are none of the mesh
  std::uint64_t frames_handed_over = 0;   ///< by publishers in the same process, never serialised
  std::uint64_t parameter_hash = 0;
  PromiseCounts promises;  ///< of ~safe_until, since the start
};

deformable_ccd::ContactArray toContactArray(const Outcome& outcome, const std::vector<Body>& bodies,
                                            const std::string& frame);
/// Fills the same into a message, which may have been another one before: its memory is used again. Returns it.
const deformable_ccd::ContactArray& fillContactArray(const Outcome& outcome, const std::vector<Body>& bodies,
                                                     const std::string& frame, deformable_ccd::ContactArray& message);
deformable_ccd::FirstContact toFirstContact(const Outcome& outcome, const std::vector<Body>& bodies,
                                            const std::string& frame);
/// What was checked and when; what may be said of it comes by fillState().
deformable_ccd::State toState(const Outcome& outcome, const std::string& frame);
void fillState(const Statement& statement, deformable_ccd::State& message);
/// Of the map in use, at the step's end [s]; 0 where it carries no stamp, as one of a file.
double mapAge(const Outcome& outcome);
/// The message of the package, not StepStats.
deformable_ccd::StepStats toStepStats(const Outcome& outcome, const StatsContext& context, const std::string& frame);
/// From a prediction (Monitor::predict) over horizon_s.
deformable_ccd::FirstContact toTimeToContact(const Outcome& prediction, double horizon_s,
                                             const std::vector<Body>& bodies, const std::string& frame);

}  // namespace dccd
