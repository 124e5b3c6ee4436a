// What the report says of all steps together: the headline, report.json, and the data of the page.
#include <cmath>
#include <iomanip>
#include <numeric>
#include <sstream>

#include "dccd/assurance.h"
#include "report/report.h"
#include "stream/quantile.h"

namespace dccd {
namespace {

// A name out of a message need not be UTF-8.
std::string toText(const nlohmann::json& json, int indent) {
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

const char* answeredSteps(std::size_t count) { return count == 1 ? " answered step" : " answered steps"; }

std::string ofFrames(std::size_t some, std::size_t all) {
  return std::to_string(some) + " of " + std::to_string(all) + (all == 1 ? " frame" : " frames");
}

nlohmann::json finiteOrNull(double x) { return std::isfinite(x) ? nlohmann::json(x) : nlohmann::json(); }

}  // namespace

void Report::addRow(const Outcome& o, const std::optional<SpeedScales>& scales) {
  const double time_s = secondsBetween(origin_ns_, o.stamp_ns);
  nlohmann::json row = {{"step", o.sequence},
                        {"t", time_s},
                        {"status", toString(o.status)},
                        {"reason", o.reason},
                        {"answered", o.answered},
                        {"start_state", toString(o.start_state)},
                        {"clear", assuranceOf(o).clear()},
                        {"contacts", o.total_contacts},
                        {"undecided", o.counts.undecided},
                        {"initial", o.counts.initial},
                        {"ms", o.stats.total_ms}};
  if (scales) row["scales"] = {scales->said, scales->by_bounds};
  if (!rows_.empty()) rows_ += ",\n";
  rows_ += toText(row, -1);
}

std::size_t Report::unprovedFrames() const {
  return std::accumulate(unproved_.begin(), unproved_.end(), std::size_t{0},
                         [](std::size_t sum, const auto& kind) { return sum + kind.second.second; });
}

std::string Report::unproved() const {
  std::string reasons;
  for (const auto& [kind, found] : unproved_) {
    reasons += (reasons.empty() ? "" : ", ") + found.first + " (" + std::to_string(found.second) + ")";
  }
  if (!reasons.empty()) reasons = ofFrames(unprovedFrames(), frames_) + ": " + reasons;
  if (reasons.empty() && answered_ == 0) reasons = frames_ > 0 ? "a first frame alone makes no step" : "no frame came";
  return reasons + (reasons.empty() || unanswered_end_.empty() ? "" : "; ") + unanswered_end_;
}

std::string Report::headline(bool reasons) const {
  std::ostringstream text;
  text << std::fixed << std::setprecision(4);
  const bool proved = unproved().empty();
  if (!first_contact_.empty()) {
    text << "First contact " << first_contact_s_ << " s after the start: " << first_contact_ << "; contacts in "
         << with_contact_ << " of " << answered_ << answeredSteps(answered_);
  } else if (!first_initial_.empty()) {
    text << "No new contact; since before it was looked at " << first_initial_ << "; contacts in " << with_contact_
         << " of " << answered_ << answeredSteps(answered_);
  } else if (answered_ == 0) {
    text << "No answer";
  } else {
    text << (with_expected_ > 0 ? "No unexpected contact " : "No contact ")
         << (proved && lasting_.empty() ? "in " : "found in ") << answered_ << answeredSteps(answered_);
  }
  if (with_expected_ > 0) text << "; expected contacts in " << with_expected_ << " of them";
  const char* separator = "; surfaces touched from the start of a step (";
  for (const auto& [what, steps] : lasting_) {
    text << separator << steps << (steps == 1 ? " step: " : " steps: ") << what;
    separator = ", ";
  }
  if (!lasting_.empty()) text << ')';
  if (proved) {
    text << "; all of it proved";
  } else {
    text << "; not proved: " << (reasons || unproved_.empty() ? unproved() : ofFrames(unprovedFrames(), frames_));
  }
  for (const std::string& sentence : doubts_) text << "; in doubt: " << sentence;
  for (const std::string& sentence : not_looked_at_) text << "; " << sentence;
  text << '.';
  return text.str();
}

nlohmann::json Report::heatJson() const {
  nlohmann::json bodies = nlohmann::json::array();
  for (const BodyHeat& h : heat_) {
    if (h.contacts.empty()) continue;
    nlohmann::json body = {{"name", h.name}, {"count", h.contacts}, {"first", nlohmann::json::array()}};
    for (double f : h.first_s) body["first"].push_back(finiteOrNull(f));
    bodies.push_back(std::move(body));
  }
  return bodies;
}

nlohmann::json Report::effectsJson() const {
  nlohmann::json effects = nlohmann::json::array();
  for (const EffectDecision& d : effects_) {
    nlohmann::json e = {{"name", d.name}, {"running", d.running}, {"reason", d.reason}};
    for (std::size_t i = 0; i < sum_.effects.size(); ++i) {
      if (d.name != toString(static_cast<Effect>(i))) continue;
      e["in"] = sum_.effects[i].in;
      e["out"] = sum_.effects[i].out;
      e["ms"] = sum_.effects[i].ms;
    }
    effects.push_back(std::move(e));
  }
  return effects;
}

nlohmann::json Report::lookAheadJson() const {
  if (!look_ahead_) return {};
  return {{"horizon_s", horizon_s_},
          {"came_true", look_ahead_->came_true},
          {"not_observed", look_ahead_->not_observed},
          {"not_predicted", look_ahead_->not_predicted}};
}

nlohmann::json Report::json() const {
  nlohmann::json j;
  j["headline"] = headline();
  j["proof"] = {{"steps", frames_ - first_frames_},
                {"proved", frames_ - first_frames_ - unprovedFrames()},
                {"unproved", unproved()},
                {"doubts", doubts_},
                {"not_looked_at", not_looked_at_}};
  j["facts"] = nlohmann::json::array();
  for (const auto& [name, value] : facts_) j["facts"].push_back(nlohmann::json::array({name, value}));
  j["counters"] = {{"received", counters_.received},
                   {"processed", counters_.processed()},
                   {"started", counters_.started()},
                   {"skipped", counters_.skipped()},
                   {"waiting", counters_.waiting()}};
  for (std::size_t s = 0; s < counters_.by_status.size(); ++s) {
    j["counters"]["by_status"][toString(static_cast<StepStatus>(s))] = counters_.by_status[s];
  }
  j["stages"] = nlohmann::json::array();
  for (std::size_t s = 0; s < stage_ms_.size(); ++s) {
    j["stages"].push_back({{"name", toString(static_cast<Stage>(s))},
                           {"in", sum_.stages[s].in},
                           {"out", sum_.stages[s].out},
                           {"median_ms", quantile(stage_ms_[s], 0.5)},
                           {"p95_ms", quantile(stage_ms_[s], 0.95)}});
  }
  j["total"] = {{"median_ms", quantile(total_ms_, 0.5)},
                {"p95_ms", quantile(total_ms_, 0.95)},
                {"p99_ms", quantile(total_ms_, 0.99)},
                {"max_ms", quantile(total_ms_, 1)}};
  j["effects"] = effectsJson();
  for (const StepCounter& counter : STEP_COUNTERS) j["step_counters"][counter.name] = sum_.*counter.value;
  j["look_ahead"] = lookAheadJson();
  j["study"] = study_;
  j["partners"] = lanes_.json();
  j["clearance"] = clearance_.json();
  j["promises"] = promises_;
  j["bodies"] = heatJson();
  return j;
}

std::string Report::dumped(const nlohmann::json& data, int indent) const {
  // The rows are text already. They come first, so that nothing has to be looked for among names out of messages.
  const std::string steps = (indent < 0 ? "\"steps\":[" : "\n \"steps\": [") + rows_ + "],";
  return toText(data, indent).insert(1, steps);
}

void Report::finish() {
  const nlohmann::json data = json();
  clearance_.close();
  std::ofstream json_file(folder_ + "/report.json"), page(folder_ + "/report.html");
  json_file << dumped(data, 1) << '\n';
  page << reportPage(dumped(data, -1), player_.json());
  for (std::ofstream* file : {&json_file, &page, &contacts_, &steps_, &patches_, &events_, &timing_}) {
    if (file->is_open()) file->close();
    if (!*file) throw std::runtime_error(folder_ + ": the report could not be written completely");
  }
}

}  // namespace dccd
