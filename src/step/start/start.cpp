// What meets, or is inside of something, where a step begins: when it is looked for, for how long, and what is kept of
// it.
#include "step/history.h"

namespace dccd {

using Clock = Deadline::Clock;

void History::Impl::runStartState(const Part& part, Clock::time_point begin, bool all_known) {
  const auto forget = [&] {
    carried.start_state.clear();
    carried.inside.clear();
  };
  // Edges alone have no inside, and do not cross but in a contact.
  if (!checksStartState(part) || !(scene.hasFaces() || map_reduced)) return forget();
  const Clock::time_point start = Clock::now();
  StepStats& stats = result.stats;
  Deadline deadline = part.deadline;
  if (!deadline.isNever()) {
    // Later parts need as much time for their pairs; what is over that is shared.
    const auto later = static_cast<Clock::rep>(part.count - part.index - 1);
    const Clock::duration slack = deadline.at() - start - later * (start - begin);
    // Contacts are still to be joined, counted and cut.
    const auto concluding = per_hit * static_cast<std::int64_t>(result.contacts.size());
    deadline = deadline.movedTo(start + slack / (later + 1) - concluding);
  }
  std::vector<StartIntersection> met;
  result.start_state_complete = listStart(part, deadline, met) && result.start_state_complete;
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
  if (isStartKnown()) {
    forget();
  } else {
    const bool complete = all_known && stats.unchecked_vertices == 0;
    carried.start_state.remember(scene, result.contacts, complete);
    carried.inside.remember(scene, result.contacts, complete);
  }
  stats[Stage::START_STATE].ms += msSince(start);
  stats[Effect::START_STATE].ms = stats[Stage::START_STATE].ms;
}

/// What meets or is inside at t=0; with earliest_only one that meets is enough. False: the deadline ended it. The
/// vertices come first, for they are few.
bool History::Impl::listStart(const Part& part, const Deadline& deadline, std::vector<StartIntersection>& met) {
  std::vector<StartIntersection> inside;
  bool whole = false;
  if (isStartKnown()) {
    const SceneArrays& before = begins_at->scene;
    whole = begins_at->carried.inside.listEnd(before, deadline, inside);
    whole = begins_at->carried.start_state.listEnd(before, deadline, met) && whole;
  } else {
    inside = carried.inside.run(scene, part.continues, carried.start_state.beforeListing(deadline), result.stats);
    met = carried.start_state.run(scene, part.continues, deadline, result.stats,
                                  {foundLimit(), options->earliest_only, &unfolded},
                                  static_cast<std::size_t>(options->num_threads),
                                  [&](std::size_t n, std::size_t piece, const auto& f) { parallel(n, piece, f); });
    const bool is_enough = options->earliest_only && !met.empty();
    if (carried.start_state.isCut() && !is_enough) result.cut = true;
    whole = is_enough || (carried.inside.isWhole() && carried.start_state.isWhole());
  }
  met.insert(met.end(), inside.begin(), inside.end());
  return whole;
}

/// Of a step aside from all others only the first part is asked about: nothing is carried over from it.
bool History::Impl::checksStartState(const Part& part) const {
  return options->check_start_state && (part.index == 0 || !aside);
}

/// By the step that this one begins at.
bool History::Impl::isStartKnown() const {
  return begins_at && !begins_at->carried.end.empty() && begins_at->carried.start_state.knowsEnd() &&
         begins_at->carried.inside.knowsEnd();
}

}  // namespace dccd
