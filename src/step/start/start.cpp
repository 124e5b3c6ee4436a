#include "step/start/start.h"

#include <functional>

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

void findStartState(const Part& part, bool all_known, const std::vector<Unfolded>& unfolded, Carried& carried,
                    Findings& result) {
  // Edges alone have no inside, and do not cross but in a contact.
  if (!part.checksStartState() || !(part.scene.hasFaces() || part.prepared.map.surface)) {
    carried.start_state.clear();
    carried.inside.clear();
    return;
  }
  const Clock::time_point start = Clock::now();
  StepStats& stats = result.stats;
  // Contacts are still to be joined, counted and cut.
  const auto concluding = part.per_hit * static_cast<std::int64_t>(result.contacts.size());
  const Deadline deadline = part.shareFrom(start).movedBy(-concluding);
  std::vector<StartIntersection> met;
  result.start_state_complete =
      listStart(part, deadline, unfolded, carried, result, met) && result.start_state_complete;
  if (!met.empty()) {
    result.start_state = StartState::INTERSECTING;
  } else if (!result.start_state_complete && result.start_state == StartState::CLEAR) {
    result.start_state = StartState::NOT_CHECKED;
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
