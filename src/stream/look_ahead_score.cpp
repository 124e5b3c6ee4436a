#include "dccd/look_ahead_score.h"

#include <algorithm>
#include <cmath>

#include "stream/quantile.h"

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

LookAheadScore::LookAheadScore(double horizon_s, std::size_t max_samples)
    : horizon_s_(horizon_s), max_samples_(max_samples) {}

void LookAheadScore::vertexTimes(const Outcome& outcome, Times& first, std::set<Key>* touching) {
  for (const Contact& contact : outcome.contacts) {
    for (std::size_t i = 0; i < contact.vertex.size() && contact.vertex[i] != NO_INDEX; ++i) {
      const std::size_t side = factsOf(contact.kind).sideOf(i);
      const Key key = keyOf(contact.body[side], contact.body[1 - side], contact.vertex[i]);
      if (touching) touching->insert(key);
      if (contact.initial || contact.certainty != Certainty::CERTAIN) continue;
      const auto [at, fresh] = first.try_emplace(key, contact.toc_lower);
      if (!fresh) at->second = std::min(at->second, contact.toc_lower);
    }
  }
}

void LookAheadScore::addSample(double error_s) {
  if (max_samples_ == 0 || errors_s_.size() < max_samples_) {
    errors_s_.push_back(error_s);
  } else {
    errors_s_[next_sample_++ % max_samples_] = error_s;
  }
}

/// Drops predictions whose horizon is over.
void LookAheadScore::expire(StampNs now_ns) {
  for (auto at = pending_.begin(); at != pending_.end();) {
    auto& list = at->second;
    const auto over = std::remove_if(
        list.begin(), list.end(), [&](const Prediction& p) { return secondsBetween(p.made_ns, now_ns) > horizon_s_; });
    not_observed_ += static_cast<std::size_t>(list.end() - over);
    list.erase(over, list.end());
    at = list.empty() ? pending_.erase(at) : std::next(at);
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
  Times first;
  std::set<Key> touching;
  vertexTimes(outcome, first, &touching);
  for (const auto& [key, toc] : first) {
    if (touching_.count(key)) continue;
    const double observed_ns = toc * static_cast<double>(outcome.stamp_ns - outcome.start_ns);
    const auto waiting = pending_.find(key);
    if (waiting == pending_.end()) {
      not_predicted_ += had_predictions;
      continue;
    }
    for (const Prediction& p : waiting->second) {
      addSample((static_cast<double>(p.made_ns - outcome.start_ns) + p.after_ns - observed_ns) * 1e-9);
    }
    pending_.erase(waiting);
  }
  touching_ = std::move(touching);
  expire(outcome.stamp_ns);
}

void LookAheadScore::predict(const Outcome& prediction) {
  if (!prediction.answered || !any_) return;
  Times first;
  vertexTimes(prediction, first, nullptr);
  for (const auto& [key, toc] : first) {
    if (touching_.count(key)) continue;
    pending_[key].push_back(
        {prediction.start_ns, toc * static_cast<double>(prediction.stamp_ns - prediction.start_ns)});
  }
}

LookAheadSummary LookAheadScore::summary() const {
  LookAheadSummary out;
  out.compared = errors_s_.size();
  out.not_observed = not_observed_;
  out.not_predicted = not_predicted_;
  std::vector<double> errors_s = errors_s_;
  out.median_signed_error_s = quantile(errors_s, 0.5);
  for (double& error : errors_s) error = std::abs(error);
  out.median_error_s = quantile(errors_s, 0.5);
  out.p95_error_s = quantile(errors_s, 0.95);
  return out;
}

}  // namespace dccd
