// Stream: frames with stamps in, an outcome for each frame of the clock body out (dccd/stream.h).
#include <cmath>
#include <mutex>

#include "module.h"

namespace dccd {
namespace python {

namespace {

const char* const PUSH_DOC = R"(push(self, positions, stamp_s, body=0, *, mesh=None, pose=None, radius_m=None)
--

A frame of a body.

Parameters
----------
positions : (n, 3) float64 [m]
    Copied. A position that is NaN or infinite leaves its vertex unchecked.
stamp_s : float
    When it was so [s], less than 9e9; kept to the nanosecond.
body : int or str
    The body's place in the list, or its name.
mesh : Mesh
    From this frame on; the one before if it is left out.
pose : (4, 4) float64
    fixed_from_body of a rigid body: between two frames it then moves along the rotation.
radius_m : (n,) float64 [m]
    How far off each position may be.

Returns
-------
str
    What the frame is to the one before it: OK; FIRST_FRAME, GAP, TIME_JUMP, TELEPORT, TOPOLOGY_CHANGED (a new pair of
    frames begins); VERTEX_COUNT, DUPLICATE (it is not used).)";

/// A monitor, one thread at a time. Its clock is the newest stamp, so that the same frames give the same answers.
class Stream {
 public:
  Stream(py::handle bodies, const py::kwargs& options) : templates_(bodiesOf(bodies)) {
    MonitorOptions wanted;
    for (const auto& [key, value] : options) set(py::str(key), value, wanted);
    for (const Body& body : templates_) meshes_.push_back(body.topology);
    last_.resize(templates_.size());
    monitor_ = std::make_unique<Monitor>(wanted, templates_);
  }

  std::string push(py::handle positions, double stamp_s, py::handle body, std::shared_ptr<const Topology> mesh,
                   py::handle pose, py::handle radius_m) {
    const std::uint16_t b = bodyOf(body, templates_);
    if (b == OBSTACLE_BODY) throw py::value_error("voxels are no body; set_voxels() takes them");
    MeshFrame frame;
    frame.topology = mesh ? mesh : meshes_[b];
    frame.positions = *positionsOf(positions, "positions");
    frame.stamp_ns = stampOf(stamp_s);
    if (!pose.is_none()) frame.pose = poseOf(pose, "pose");
    frame.rigid = templates_[b].rigid && !pose.is_none();
    if (frame.rigid && !mesh && last_[b].positions.size() == frame.positions.size()) {
      requireMoved(last_[b].positions, frame.pose * last_[b].pose.inverse(), frame.positions, "positions");
    }
    if (frame.rigid) last_[b] = frame;
    if (!radius_m.is_none()) frame.radius_m = *radiiOf(radius_m, "radius_m");
    std::string status;
    locked([&] {
      meshes_[b] = frame.topology;
      now_ns_ = std::max(now_ns_, frame.stamp_ns);
      monitor_->countReceived(b);
      status = toString(monitor_->push(b, std::move(frame), now_ns_));
    });
    return status;
  }

  py::object next() {
    Outcome outcome;
    bool found = false;
    asked([&] { found = monitor_->next(now_ns_, outcome); });
    return found ? py::cast(Answer(std::move(outcome))) : py::object(py::none());
  }

  Answer predict() {
    Outcome outcome;
    asked([&] { outcome = monitor_->predict(); });
    return Answer(std::move(outcome));
  }

  Answer checkNow() {
    Outcome outcome;
    asked([&] { outcome = monitor_->checkNow(); });
    return Answer(std::move(outcome));
  }

  void setVoxels(py::handle voxels, double stamp_s) {
    ObstacleMap map = mapOf(voxels);
    map.stamp_ns = stampOf(stamp_s);
    has_map_ = map.surface != nullptr;
    locked([&] { monitor_->setMap(std::move(map)); });
  }

  void finish() {
    locked([&] { monitor_->finish(); });
  }
  void reset() {
    locked([&] { monitor_->reset(); });
  }

 private:
  std::vector<Body> templates_;
  std::vector<std::shared_ptr<const Topology>> meshes_;  // of the newest frames
  std::vector<MeshFrame> last_;                          // that came with a pose
  std::unique_ptr<Monitor> monitor_;
  std::mutex mutex_;
  std::atomic<bool> interrupted_{false};
  std::atomic<bool> has_map_{false};
  std::int64_t now_ns_ = 0;  // the newest stamp

  static StampNs stampOf(double stamp_s) {
    if (std::abs(stamp_s) < 9e9) return static_cast<StampNs>(std::llround(stamp_s * 1e9));
    throw py::value_error("stamp_s is " + std::to_string(stamp_s) + "; expected seconds, less than 9e9");
  }

  void set(const std::string& name, py::handle value, MonitorOptions& options) const {
    const std::map<std::string, double*> numbers{{"max_step_s", &options.store.max_step_s},
                                                 {"max_vertex_step_m", &options.store.max_vertex_step_m},
                                                 {"sync_timeout_s", &options.sync_timeout_s},
                                                 {"look_ahead_s", &options.look_ahead_s},
                                                 {"patch_gap_s", &options.patch_gap_s}};
    if (const auto number = numbers.find(name); number != numbers.end()) {
      *number->second = numberOf(value, name);
    } else if (name == "clock_body") {
      options.clock_body = bodyOf(value, templates_);
    } else if (!setOption(name, value, templates_, options.detector)) {
      refuseOption(name);
    }
  }

  void locked(const std::function<void()>& work) {
    runUnlocked([&] {
      const std::lock_guard<std::mutex> lock(mutex_);
      work();
    });
  }

  /// The same of what may take long: Ctrl-C ends it, and with it the stream.
  void asked(const std::function<void()>& work) {
    if (interrupted_) throw std::runtime_error("this stream was interrupted; make a new one");
    const auto cancel = [this] {
      interrupted_ = true;
      monitor_->cancel();
    };
    const auto alone = [&] {
      const std::lock_guard<std::mutex> lock(mutex_);
      work();
    };
    runUnlocked(alone, isLong(templates_, has_map_) ? std::function<void()>(cancel) : std::function<void()>());
  }
};

const char* const STREAM_DOC =
    R"(Frames with stamps in, an outcome for each frame of one of the bodies out, as the ROS node does it.

Stream(bodies, *, clock_body=0, max_step_s=0.5, max_vertex_step_m=0.5, sync_timeout_s=0.1, look_ahead_s=0,
       patch_gap_s=0.25, **options)

Parameters
----------
bodies : Body or list of Body
    What they are; where they are is told by push(). A Body(mesh=...) needs no positions.
clock_body : int or str
    A step ends at each frame of this body; the others are interpolated there.
max_step_s : float
    A longer pause between two frames [s] is a gap.
max_vertex_step_m : float
    A vertex that moves further between two frames [m] is a teleport; 0: never.
sync_timeout_s : float
    How long a step waits for the other bodies' frames, in seconds of the stamps.
look_ahead_s : float
    Horizon of predict() [s].
patch_gap_s : float
    With the option patches: what comes back within this [s] is the same patch.
**options
    As of dccd.detect(). max_contacts is 10000 here, if it is not given.

Raises
------
TypeError
    There is no such option, or it has another type.
ValueError
    A number is out of range; the sentence names it.

Examples
--------
>>> stream = dccd.Stream(dccd.Body(mesh=dccd.Mesh.grid(20, 30), name='cloth'))
>>> for stamp_s, positions in frames:
...     stream.push(positions, stamp_s)
...     for outcome in stream:
...         print(outcome.stamp_ns, outcome))";

}  // namespace

void bindStream(py::module_& m) {
  using namespace py::literals;
  bindClass<Stream>(m, "Stream", STREAM_DOC)
      .def(py::init<py::object, py::kwargs>(), "bodies"_a,
           "__init__(self, bodies, **options)\n--\n\nSee help(dccd.Stream).")
      .def("push", &Stream::push, "positions"_a, "stamp_s"_a, "body"_a = 0, py::kw_only(), "mesh"_a = py::none(),
           "pose"_a = py::none(), "radius_m"_a = py::none(), PUSH_DOC)
      .def("next", &Stream::next,
           "next(self)\n--\n\nThe next Outcome, in the order of the clock body's frames; None: there is none, or it "
           "waits for other bodies.\n\nRaises\n------\nRuntimeError\n    Ctrl-C has ended a step of this stream.")
      .def(
          "__iter__",
          [](py::object self) { return py::module_::import("builtins").attr("iter")(self.attr("next"), py::none()); },
          "Outcomes until next() gives None.")
      .def("predict", &Stream::predict,
           "predict(self)\n--\n\nFrom the newest frames to their extrapolation over look_ahead_s; toc is a fraction of "
           "that. Status NO_BODY where no step was answered yet.")
      .def("check_now", &Stream::checkNow,
           "check_now(self)\n--\n\nThe newest frames as a step without motion: is anything in contact now?")
      .def("set_voxels", &Stream::setVoxels, "voxels"_a, "stamp_s"_a = 0.0,
           "set_voxels(self, voxels, stamp_s=0.0)\n--\n\nThe Voxels from the next step on; None: none.")
      .def("finish", &Stream::finish,
           "finish(self)\n--\n\nThere are no more frames: steps are not waiting for other bodies any longer.")
      .def("reset", &Stream::reset, "reset(self)\n--\n\nForgets all frames.");
}

}  // namespace python
}  // namespace dccd
