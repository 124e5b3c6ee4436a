#include "report/look_ahead_score.h"

#include <algorithm>
#include <iterator>

namespace dccd {

namespace {

std::uint64_t keyOf(std::uint16_t body, std::uint16_t against, Index vertex) {
  return std::uint64_t{body} << 48 | std::uint64_t{against} << 32 | vertex;
}

}  // namespace

StageStats lookAheadStats(const Outcome& prediction) {
  const StepStats& stats = prediction.stats;
  StageStats sum;
  for (const Effect effect : {Effect::SELF_COLLISION, Effect::BODY_BODY, Effect::OCTOMAP, Effect::MINIMUM_SEPARATION,
                              Effect::TRACKER_NOISE}) {
    sum += stats[effect];
  }
  sum.ms = stats.total_ms;
  return sum;
}

void LookAheadScore::vertexContacts(const Outcome& outcome, std::set<Key>& first, std::set<Key>& touching) {
  for (const Contact& contact : outcome.contacts) {
    for (std::size_t i = 0; i < contact.vertex.size() && contact.vertex[i] != NO_INDEX; ++i) {
      const std::size_t side = factsOf(contact.kind).sideOf(i);
      const Key key = keyOf(contact.body[side], contact.body[1 - side], contact.vertex[i]);
      touching.insert(key);
      if (!contact.initial && contact.certainty == Certainty::CERTAIN) first.insert(key);
    }
  }
}

/// Drops predictions whose horizon is over.
void LookAheadScore::expire(StampNs now_ns) {
  for (auto at = pending_.begin(); at != pending_.end();) {
    std::vector<StampNs>& made_ns = at->second;
    const auto over = std::remove_if(made_ns.begin(), made_ns.end(),
                                     [&](StampNs made) { return secondsBetween(made, now_ns) > horizon_s_; });
    summary_.not_observed += static_cast<std::size_t>(made_ns.end() - over);
    made_ns.erase(over, made_ns.end());
    at = made_ns.empty() ? pending_.erase(at) : std::next(at);
  }
}

void LookAheadScore::observe(const Outcome& outcome) {
  if (!outcome.answered) {
    if (isSeam(outcome.status)) {
      pending_.clear();
      touching_.clear();
    }
    return;
  }
  const bool had_predictions = any_;
  any_ = true;
  std::set<Key> first, touching;
  vertexContacts(outcome, first, touching);
  for (const Key key : first) {
    if (touching_.count(key)) continue;
    const auto waiting = pending_.find(key);
    if (waiting == pending_.end()) {
      summary_.not_predicted += had_predictions;
      continue;
    }
    summary_.came_true += waiting->second.size();
    pending_.erase(waiting);
  }
  touching_ = std::move(touching);
  expire(outcome.stamp_ns);
}

void LookAheadScore::predict(const Outcome& prediction) {
  if (!prediction.answered || !any_) return;
  std::set<Key> first, touching;
  vertexContacts(prediction, first, touching);
  for (const Key key : first) {
    if (!touching_.count(key)) pending_[key].push_back(prediction.start_ns);
  }
}

}  // namespace dccd
