// What a phase expects, and what the robot's hand holds: bodies whose contacts with it are expected, and objects that
// come and go as bodies.
#include <algorithm>
#include <optional>
#include <type_traits>
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
  attached_.resize(std::max(count, number + 1));
  attached_[number] = Attached{std::move(object), true};
  try {
    setBody(first + number, body, std::move(rigid), "object '" + body.name + "' was attached");
  } catch (...) {
    attached_[number].reset();
    throw;
  }
}

/// What may fail comes first.
void MonitorPipeline::setBody(std::size_t body, const Body& what, Rigid rigid, const std::string& why) {
  static_assert(std::is_nothrow_move_assignable_v<EffectTracker>);
  std::vector<Body> bodies = monitor_->bodies();
  bodies.resize(std::max(bodies.size(), body + 1));
  bodies[body] = what;
  Expected tried = expectedOf(config_.phase, bodies), kept = tried;
  MonitorOptions options = monitor_->options();
  tried.swapInto(options);
  EffectTracker effects = effects_;
  effects.setBody(body, what);
  rigid_.resize(std::max(rigid_.size(), bodies.size()));
  monitor_->setBody(body, what, options);
  effects_ = std::move(effects);
  rigid_[body] = std::move(rigid);
  kept.swapInto(config_.monitor);
  voidWhatWasSaid(why);
  placeToCome(body);
}

void MonitorPipeline::detach(const std::string& name) {
  const std::size_t number = attachedNumber(name);
  const bool is_held = number < attached_.size() && attached_[number]->held;
  if (!is_held) throw ParameterError("object '" + name + "' is not attached");
  if (!checked_[config_.monitor.clock_body]) {
    throw ParameterError("object '" + name + "' stays attached: no frame of the clock body has come yet");
  }
  const std::string why = "object '" + name + "' was detached";
  attached_[number]->held = false;
  try {
    expectNow(config_.phase, why);
  } catch (...) {
    attached_[number]->held = true;
    throw;
  }
  rigid_[config_.bodies.size() + number]->let_go_ns = stampOf(call_);
  voidWhatWasSaid(why);
}

void MonitorPipeline::remove(const std::string& name) {
  const std::size_t number = attachedNumber(name);
  if (number == attached_.size()) throw ParameterError("object '" + name + "' is not there");
  static const auto NOTHING = share(Topology::fromTriangles(0, {}));
  Body nobody;  // in its place
  nobody.self_collision = nobody.against_bodies = nobody.against_obstacle = false;
  Rigid none;
  none.mesh.topology = NOTHING;
  std::optional<Attached> gone = std::exchange(attached_[number], std::nullopt);
  try {
    setBody(config_.bodies.size() + number, nobody, std::move(none), "object '" + gone->object.name + "' was removed");
  } catch (...) {
    attached_[number] = std::move(gone);
    throw;
  }
}

void MonitorPipeline::setHold(const std::string& body, const std::string& by, bool closed) {
  std::vector<Hold> before = config_.holds;
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
    config_.holds = std::move(before);
    throw;
  }
}

void MonitorPipeline::setPhase(const std::string& phase) {
  const std::vector<std::string> known = config_.phases();
  if (!phase.empty() && std::find(known.begin(), known.end(), phase) == known.end()) {
    throw ParameterError("phase '" + phase + "' is unknown; " + config_.phasesInWords());
  }
  std::string next = phase;
  expectNow(next);
  config_.phase = std::move(next);
}

std::string MonitorPipeline::phaseInWords() const {
  std::string text = config_.phase.empty() ? "no phase" : "phase '" + config_.phase + "'";
  const std::vector<std::string> expected = describe(config_.monitor.detector.expected, monitor_->bodies());
  if (expected.empty()) return text + ", no contact is expected";
  for (std::size_t i = 0; i < expected.size(); ++i) text += (i == 0 ? ", expected: " : "; ") + expected[i];
  return text;
}

void MonitorPipeline::Expected::swapInto(MonitorOptions& options) noexcept {
  options.detector.expected.swap(expected);
  options.held.swap(held);
  options.detector.excluded.swap(excluded);
}

MonitorPipeline::Expected MonitorPipeline::expectedOf(const std::string& phase, const std::vector<Body>& bodies) const {
  Expected now{config_.expectedIn(phase), config_.held(), excluded_};
  bool any = false;
  for (std::size_t i = 0; i < attached_.size(); ++i) {
    if (!attached_[i]) continue;
    any = true;
    const std::size_t body = config_.bodies.size() + i;
    for (const std::uint16_t other : attached_[i]->object.expected) {
      if (!attached_[i]->held || !meet(bodies[body], body, bodies[other], other)) continue;
      Expectation& one = now.expected.emplace_back();
      one.partners[0].body = static_cast<std::uint16_t>(body);
      one.partners[1].body = other;
    }
  }
  if (any && !config_.robot_asked.against_links)
    now.excluded.push_back("what is attached against links and against each other");
  return now;
}

void MonitorPipeline::expectNow(const std::string& phase, const std::string& why) {
  Expected tried = expectedOf(phase, monitor_->bodies()), kept = tried;
  bool is_tried = false;
  const auto change = [&](MonitorOptions& options, MarkerConfig&) {
    (std::exchange(is_tried, true) ? kept : tried).swapInto(options);
  };
  reconfigure(change, why);
}

}  // namespace dccd
