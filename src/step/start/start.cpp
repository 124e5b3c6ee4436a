#include "step/start/start.h"

#include <functional>

#include "proof/looked.h"
#include "step/history.h"

namespace dccd {
namespace {

using Clock = Deadline::Clock;

/// What meets or is inside at t=0; with earliest_only one that meets is enough. False: the deadline ended it. The
/// vertices come first, for they are few.
bool listStart(const Part& part, const Deadline& deadline, const std::vector<Unfolded>& unfolded, Carried& carried,
               Findings& result, std::vector<StartIntersection>& met) {
  const Options& options = part.options();
  const Threads& threads = part.prepared.threads;
  const std::vector<StartIntersection> inside =
      carried.inside.run(part.scene, part.continues, carried.start_state.beforeListing(deadline), result.stats);
  met = carried.start_state.run(part.scene, part.continues, deadline, result.stats,
                                {foundLimit(options, part.scene.bodies()), options.earliest_only, &unfolded},
                                threads.count(), std::cref(threads));
  const bool is_enough = options.earliest_only && !met.empty();
  if (carried.start_state.isCut() && !is_enough) result.cut = true;
  met.insert(met.end(), inside.begin(), inside.end());
  return is_enough || (carried.inside.isWhole() && carried.start_state.isWhole());
}

}  // namespace

bool searchesStart(const Part& part, const Carried& carried) {
  return part.checksStartState() && carried.start_state.needsTrees(part.continues);
}

void findStartState(const Part& part, bool all_known, bool map_is_whole, const std::vector<Unfolded>& unfolded,
                    Carried& carried, Looked& looked, Findings& result) {
  // Edges alone have no inside, and do not cross but in a contact.
  const bool may_cross = part.scene.hasFaces() || part.prepared.map.surface;
  if (!part.checksStartState() || !may_cross) {
    carried.start_state.clear();
    carried.inside.clear();
    result.start_state_complete = true;
    if (!part.checksStartState()) return;
    looked.atStart();
    result.start_state = StartState::CLEAR;
    return;
  }
  const Clock::time_point start = Clock::now();
  StepStats& stats = result.stats;
  // Contacts are still to be joined, counted and cut.
  const auto concluding = part.per_hit * static_cast<std::int64_t>(result.contacts.size());
  const Deadline deadline = part.shareFrom(start).movedBy(-concluding);
  std::vector<StartIntersection> met;
  const bool is_whole = listStart(part, deadline, unfolded, carried, result, met);
  if (is_whole) looked.atStart();
  result.start_state_complete = is_whole && map_is_whole;
  if (!met.empty()) {
    result.start_state = StartState::INTERSECTING;
  } else if (result.start_state_complete && result.start_state != StartState::INTERSECTING) {
    result.start_state = StartState::CLEAR;
  }
  if (result.intersections.empty()) {
    result.intersections = std::move(met);
  } else {
    result.intersections.insert(result.intersections.begin(), met.begin(), met.end());
  }
  const bool complete = all_known && stats.unchecked_vertices == 0;
  carried.start_state.remember(part.scene, result.contacts, complete);
  carried.inside.remember(part.scene, result.contacts, complete);
  stats[Stage::START_STATE].ms += msSince(start);
  stats[Effect::START_STATE].ms = stats[Stage::START_STATE].ms;
}

}  // namespace dccd
