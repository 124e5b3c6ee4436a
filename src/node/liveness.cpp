#include "node/liveness.h"

#include <algorithm>
#include <iomanip>
#include <limits>
#include <sstream>

#include "dccd/types.h"

namespace dccd {
namespace {

// A worker that is that far behind is late whichever frame is looked at; the rest is not kept.
constexpr std::size_t MAX_OPEN = 4096;

std::string seconds(double value) {
  std::ostringstream text;
  text << std::setprecision(3) << value << " s";
  return text.str();
}

}  // namespace

std::string waitsTooLong(double answer_timeout_s) {
  return "a newer map came and has not been in use for more than " + seconds(answer_timeout_s);
}

std::string noFrameFor(double max_step_s) { return "no frame has come for more than " + seconds(max_step_s); }

void Liveness::frame(std::int64_t name, std::int64_t now_ns) {
  newest_ = {name, now_ns};
  if (open_.size() < MAX_OPEN) open_.push_back(newest_);
}

void Liveness::outcome(std::int64_t name, double map_age_s, std::int64_t now_ns) {
  // The reset forgot a frame that had just come, and its answer comes after the reset.
  if (newest_.came_ns == NEVER) newest_ = {name, now_ns};
  answered_ns_ = now_ns;
  while (!open_.empty() && open_.front().name <= name) {
    answered_ns_ = open_.front().came_ns;
    open_.pop_front();
  }
  answered_ = std::max(answered_, name);
  // MAX_OPEN frames had no answer, and the newest one was not kept: now it is the one that counts.
  if (open_.empty() && newest_.came_ns != NEVER && newest_.name > answered_) open_.push_back(newest_);
  map_age_s_ = map_age_s;
  lacked_map_ = false;
  while (!maps_.empty() && maps_.front().name <= maps_settled_) maps_.pop_front();
  for (auto& [body, frames] : statics_) frames.answered = frames.in_use;
}

void Liveness::mapCame(std::int64_t name, std::int64_t now_ns) {
  if (maps_.size() < MAX_OPEN) maps_.push_back({name, now_ns});
}

void Liveness::mapSettled(std::int64_t name, std::int64_t placed) {
  lacked_map_ = lacked_map_ || lacksMap();
  maps_placed_ = placed;
  maps_settled_ = name;
}

void Liveness::staticCame(const std::string& body, std::uint64_t number, std::int64_t now_ns) {
  Static& frames = statics_[body];
  if (number <= frames.came) return;
  if (!frames.isOpen()) frames.since_ns = now_ns, frames.is_alone = false;
  const bool follows = frames.last_ns != NEVER && secondsBetween(frames.last_ns, now_ns) <= limits_.max_step_s;
  frames.is_alone = frames.is_alone || !follows;
  frames.last_ns = now_ns;
  frames.came = number;
}

void Liveness::forget() {
  open_.clear();
  newest_ = {0, NEVER};
  answered_ = answered_ns_ = NEVER;
  map_age_s_ = -1;
  lacked_map_ = false;
  asked_.clear();
}

double Liveness::answerAge(std::int64_t now_ns) const {
  return answered_ns_ == NEVER ? std::numeric_limits<double>::infinity() : secondsBetween(answered_ns_, now_ns);
}

std::vector<Fault> Liveness::faults(std::int64_t now_ns) const {
  std::vector<Fault> faults;
  const auto add = [&](Fault::Kind kind, const std::string& sentence) { faults.push_back({kind, sentence}); };
  if (stopped_) add(Fault::Kind::STOPPED, "the monitor was stopped");
  if (disabled_) add(Fault::Kind::DISABLED, "the monitor is disabled");
  if (!asked_.empty()) add(Fault::Kind::ASKED, asked_);
  if (!open_.empty() && secondsBetween(open_.front().came_ns, now_ns) > limits_.answer_timeout_s) {
    add(Fault::Kind::NO_ANSWER, "a frame has had no answer for more than " + seconds(limits_.answer_timeout_s));
  }
  if (newest_.came_ns != NEVER && secondsBetween(newest_.came_ns, now_ns) > limits_.max_step_s) {
    add(Fault::Kind::SILENCE, noFrameFor(limits_.max_step_s));
  }
  if (lacked_map_ || lacksMap()) {
    add(Fault::Kind::NEWER_MAP,
        "a newer map came before the last frame that was answered, which was answered without it");
  } else if (!maps_.empty() && secondsBetween(maps_.front().came_ns, now_ns) > limits_.answer_timeout_s) {
    add(Fault::Kind::NEWER_MAP, waitsTooLong(limits_.answer_timeout_s));
  }
  if (limits_.octomap_timeout_s > 0 && map_age_s_ >= 0 && answered_ns_ != NEVER &&
      map_age_s_ + secondsBetween(answered_ns_, now_ns) > limits_.octomap_timeout_s) {
    add(Fault::Kind::OLD_MAP, "the map is older than " + seconds(limits_.octomap_timeout_s));
  }
  const auto isLate = [&](const Static& frames) {
    return frames.isOpen() && (frames.is_alone || secondsBetween(frames.since_ns, now_ns) > limits_.answer_timeout_s);
  };
  const auto late = std::find_if(statics_.begin(), statics_.end(), [&](const auto& one) { return isLate(one.second); });
  if (late != statics_.end())
    add(Fault::Kind::NEWER_BODY, "a newer frame of body '" + late->first + "' came, which no step has used yet");
  return faults;
}

}  // namespace dccd
