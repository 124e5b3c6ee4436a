// The node's services: each asks the worker and waits for its reply.
#include "node/collision_monitor_impl.h"

#include <deformable_ccd/AttachObject.h>
#include <deformable_ccd/Named.h>
#include <deformable_ccd/SetHold.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include "input/short_text.h"
#include "input/steady_clock.h"

namespace dccd {
namespace {

constexpr double SERVICE_TIMEOUT_S = 10;

using WouldTouch = deformable_ccd::WouldTouch;

template <class Response>
void put(const Reply& reply, Response& response) {
  response.success = reply.success;
  response.message = reply.message;
}
void put(const WouldTouch::Response& answer, WouldTouch::Response& response) { response = answer; }

template <class Service, class Answer>
ros::ServiceServer advertise(ros::NodeHandle& node, const char* name, const Answer& answer) {
  using Request = typename Service::Request;
  using Response = typename Service::Response;
  return node.advertiseService<Request, Response>(name, [answer](Request& request, Response& response) {
    put(answer(request), response);
    return true;
  });
}

}  // namespace

/// What the call made void is so before its caller hears that it was done.
Reply CollisionMonitor::Impl::ask(const std::function<Reply()>& run) {
  const auto command = [this, run] {
    pipeline.callsComeAt(static_cast<StampNs>(ros::Time::now().toNSec()));
    const Reply reply = run();
    publishVoided();
    return reply;
  };
  return queue.call(command, SERVICE_TIMEOUT_S);
}

void CollisionMonitor::Impl::advertiseServices(ros::NodeHandle& service) {
  using std_srvs::SetBool;
  using std_srvs::Trigger;
  services.push_back(advertise<Trigger>(service, "check_now", [this](const Trigger::Request&) {
    return ask([this] {
      const Outcome outcome = pipeline.checkNow(steadyNs());
      return Reply{outcome.answered, describe(outcome)};
    });
  }));
  const auto would_touch = [this](const WouldTouch::Request& request) {
    const auto answer = std::make_shared<WouldTouch::Response>();
    const Reply reply = queue.call(
        [this, trajectory = request.trajectory, answer] {
          *answer = pipeline.wouldTouch(trajectory, state.whyNotProved());
          return Reply{true, ""};
        },
        SERVICE_TIMEOUT_S);
    return reply.success ? *answer : MonitorPipeline::notProved(reply.message);
  };
  if (config.intent) services.push_back(advertise<WouldTouch>(service, "would_touch", would_touch));
  services.push_back(advertise<Trigger>(service, "record_step", [this](const Trigger::Request&) {
    return ask([this] {
      Reply reply;
      reply.success = recorder.record(reply.message);
      return reply;
    });
  }));
  services.push_back(advertise<Trigger>(service, "reset", [this](const Trigger::Request&) {
    state.asked("a reset was asked for");
    return ask([this] {
      resetNow(StepStatus::RESET);
      return Reply{true, "frames forgotten; the next one is a first frame"};
    });
  }));
  services.push_back(advertise<SetBool>(service, "enable", [this](const SetBool::Request& request) {
    enabled = request.data;
    state.setEnabled(enabled);
    state.asked("~enable was called");
    return ask([this, on = request.data] {
      pipeline.rest(!on);
      resetNow(StepStatus::DISABLED);
      return Reply{true, on ? "enabled" : "disabled; frames are counted and dropped, but for static bodies'"};
    });
  }));
}

/// What is expected, by the phase of the task and by what hands hold.
void CollisionMonitor::Impl::advertiseExpectations(ros::NodeHandle& service) {
  using deformable_ccd::Named;
  using deformable_ccd::SetHold;
  const auto expect = [this](const std::function<void()>& set) {
    return ask([this, set] {
      try {
        set();
      } catch (const ParameterError& error) {
        return Reply{false, error.what() + std::string("; in force is ") + pipeline.phaseInWords()};
      }
      return Reply{true, "from the next step on: " + pipeline.phaseInWords()};
    });
  };
  services.push_back(advertise<Named>(service, "set_phase", [this, expect](const Named::Request& request) {
    return expect([this, phase = request.name] { pipeline.setPhase(phase); });
  }));
  services.push_back(advertise<SetHold>(service, "set_hold", [this, expect](const SetHold::Request& request) {
    return expect([this, request] { pipeline.setHold(request.body, request.by, request.holds); });
  }));
}

void CollisionMonitor::Impl::advertiseObjects(ros::NodeHandle& service) {
  using deformable_ccd::AttachObject;
  using deformable_ccd::Named;
  // What is refused is counted, be it on this thread, where meshes are read, or on the worker's.
  const auto object = [this](const std::string& done, const std::function<std::function<void()>()>& read) {
    Reply reply;
    try {
      const std::function<void()> change = read();
      reply = ask([change, done] { return change(), Reply{true, done}; });
    } catch (const std::exception& error) {
      reply.message = error.what();
    }
    requests_refused += !reply.success;
    reply.message = shortText(reply.message);
    return reply;
  };
  services.push_back(advertise<AttachObject>(service, "attach", [this, object](const AttachObject::Request& request) {
    return object("from the next step on '" + request.name + "' moves with " + request.link,
                  [&] { return [this, attached = readAttach(request, config)] { pipeline.attach(attached); }; });
  }));
  services.push_back(advertise<Named>(service, "detach", [this, object](const Named::Request& request) {
    return object("from the next step on '" + request.name + "' stays where it is",
                  [&] { return [this, name = request.name] { pipeline.detach(name); }; });
  }));
  services.push_back(advertise<Named>(service, "remove", [this, object](const Named::Request& request) {
    return object("'" + request.name + "' is forgotten",
                  [&] { return [this, name = request.name] { pipeline.remove(name); }; });
  }));
}

void CollisionMonitor::Impl::listenToChanges(const ros::NodeHandle& service) {
  Reconfigure::Events events;
  events.change = [this](const Reconfigure::Change& change) -> std::string {
    // Nobody knows what a worker will say that is busy for too long: then it is not to do it any more.
    const auto is_wanted = std::make_shared<std::atomic<bool>>(true);
    const auto run = [this, change, is_wanted] {
      if (!*is_wanted) return Reply{};
      pipeline.reconfigure(change);
      state.setLimits(livenessLimits(config));
      return Reply{true, ""};
    };
    const Reply reply = queue.call(run, SERVICE_TIMEOUT_S);
    *is_wanted = false;
    return reply.success ? "" : reply.message;
  };
  events.refused = [this](const std::string& why) {
    queue.command([this, why] { log.complain(config.monitor.clock_body, "live", why); });
  };
  reconfigure = std::make_unique<Reconfigure>(service, config, std::move(events));
}

}  // namespace dccd
