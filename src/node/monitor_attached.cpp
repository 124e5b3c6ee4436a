// What a phase expects, and what the robot's hand holds: bodies whose contacts with it are expected, and objects that
// come and go as bodies.
#include <algorithm>
#include <optional>
#include <utility>

#include "node/monitor_pipeline.h"

namespace dccd {
namespace {

// More than a hand holds and leaves about: each costs a little in every step.
constexpr std::size_t MOST_ATTACHED = 64;

bool isOff(const MonitorConfig& config, Effect effect) {
  return settingOf(config.effects, effect) == EffectSetting::OFF;
}

}  // namespace

std::size_t MonitorPipeline::attachedNumber(const std::string& name) const {
  const auto has_name = [&](const std::optional<Attached>& one) { return one && one->object.name == name; };
  return static_cast<std::size_t>(std::find_if(attached_.begin(), attached_.end(), has_name) - attached_.begin());
}

void MonitorPipeline::attach(AttachedObject object) {
  const std::size_t first = config_.bodies.size(), count = attached_.size();
  if (attachedNumber(object.name) < count) {
    throw ParameterError("object '" + object.name + "' is there already; call ~remove before, or give it another name");
  }
  const auto free = std::find(attached_.begin(), attached_.end(), std::nullopt);
  const auto number = static_cast<std::size_t>(free - attached_.begin());
  if (number == MOST_ATTACHED) {
    throw ParameterError("object '" + object.name + "': there are " + std::to_string(MOST_ATTACHED) +
                         " already, which is the most; call ~remove for some");
  }
  const RobotConfig& robot = config_.robot_asked;
  Body body;
  body.name = object.name;
  body.rigid = true;
  body.self_collision = false;
  body.against_bodies = !isOff(config_, Effect::BODY_BODY);
  body.against_obstacle = robot.against_map && !isOff(config_, Effect::OCTOMAP);
  body.minimum_separation_m = object.padding_m;
  // Where nobody had own voxels at the start, maps do not tell what is needed for it.
  if (config_.ownsVoxels()) body.own_voxels_m = config_.robot.named ? robot.own_voxels_m : config_.own_voxels_m;
  for (std::size_t b = 0; b < first + count && !robot.against_links; ++b) {
    if (b >= first ? b != first + number : !config_.bodies[b].body.link.empty()) {
      body.not_against.push_back(static_cast<std::uint16_t>(b));
    }
  }
  Rigid rigid = rigidOf(*object.mesh);
  rigid.name = object.name;
  rigid.frame = object.frame;
  rigid.may_be_lost = true;
  setBody(first + number, body, std::move(rigid));
  attached_.resize(std::max(count, number + 1));
  attached_[number] = Attached{std::move(object), true};
  voidWhatWasSaid("object '" + body.name + "' was attached");
  try {
    expectNow(config_.phase);
  } catch (...) {
    remove(body.name);
    throw;
  }
}

void MonitorPipeline::detach(const std::string& name) {
  const std::size_t number = attachedNumber(name);
  const bool is_held = number < attached_.size() && attached_[number]->held;
  if (!is_held) throw ParameterError("object '" + name + "' is not attached");
  if (!checked_[config_.monitor.clock_body]) {
    throw ParameterError("object '" + name + "' stays attached: no frame of the clock body has come yet");
  }
  voidWhatWasSaid("object '" + name + "' was detached");
  attached_[number]->held = false;
  rigid_[config_.bodies.size() + number]->let_go_ns = changedAt(newest_ns_);
  expectNow(config_.phase);
}

void MonitorPipeline::remove(const std::string& name) {
  const std::size_t number = attachedNumber(name);
  if (number == attached_.size()) throw ParameterError("object '" + name + "' is not there");
  static const auto NOTHING = share(Topology::fromTriangles(0, {}));
  voidWhatWasSaid("object '" + name + "' was removed");
  attached_[number].reset();
  expectNow(config_.phase);  // before the body that is expected is gone
  Body nobody;               // in its place
  nobody.self_collision = nobody.against_bodies = nobody.against_obstacle = false;
  Rigid none;
  none.mesh.topology = NOTHING;
  setBody(config_.bodies.size() + number, nobody, std::move(none));
}

void MonitorPipeline::setHold(const std::string& body, const std::string& by, bool closed) {
  const std::vector<Hold> before = config_.holds;
  std::string known;
  bool any = false;
  for (Hold& hold : config_.holds) {
    known += (known.empty() ? "'" : ", '") + hold.body + "' by '" + hold.by + "'";
    if ((!body.empty() && hold.body != body) || (!by.empty() && hold.by != by)) continue;
    hold.closed = closed;
    any = true;
  }
  if (!any) {
    const std::string asked = "'" + body + "'" + (by.empty() ? "" : " by '" + by + "'");
    throw ParameterError(known.empty() ? "nothing is held; name what holds a body in robot/holds"
                                       : asked + " is not in robot/holds, which has " + known);
  }
  try {
    expectNow(config_.phase);
  } catch (...) {
    config_.holds = before;
    throw;
  }
}

void MonitorPipeline::setPhase(const std::string& phase) {
  const std::vector<std::string> known = config_.phases();
  if (!phase.empty() && std::find(known.begin(), known.end(), phase) == known.end()) {
    throw ParameterError("phase '" + phase + "' is unknown; " + config_.phasesInWords());
  }
  expectNow(phase);
  config_.phase = phase;
}

std::string MonitorPipeline::phaseInWords() const {
  std::string text = config_.phase.empty() ? "no phase" : "phase '" + config_.phase + "'";
  const std::vector<std::string> expected = describe(config_.monitor.detector.expected, monitor_->bodies());
  if (expected.empty()) return text + ", no contact is expected";
  for (std::size_t i = 0; i < expected.size(); ++i) text += (i == 0 ? ", expected: " : "; ") + expected[i];
  return text;
}

/// What is expected in the phase, of what hands hold, and of what is attached; and what of that is not looked at.
void MonitorPipeline::expectNow(const std::string& phase) {
  std::vector<Expectation> expected = config_.expectedIn(phase);
  std::vector<std::string> excluded = excluded_;
  bool any = false;
  for (std::size_t i = 0; i < attached_.size(); ++i) {
    if (!attached_[i]) continue;
    any = true;
    const std::size_t body = config_.bodies.size() + i;
    for (const std::uint16_t other : attached_[i]->object.expected) {
      if (!attached_[i]->held || !meet(monitor_->bodies()[body], body, monitor_->bodies()[other], other)) continue;
      Expectation& one = expected.emplace_back();
      one.partners[0].body = static_cast<std::uint16_t>(body);
      one.partners[1].body = other;
    }
  }
  if (any && !config_.robot_asked.against_links)
    excluded.push_back("what is attached against links and against each other");
  reconfigure([&](MonitorOptions& options, MarkerConfig&) {
    options.detector.expected = expected;
    options.held = config_.held();
    options.detector.excluded = excluded;
  });
}

}  // namespace dccd
