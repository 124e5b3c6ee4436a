// Whether the newest answer is still the newest word: frames go on to come, are answered in time, the map stays fresh.
// Free of ROS and of any clock: times are those of a watch that only goes forward.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

namespace dccd {

struct LivenessLimits {
  double answer_timeout_s = 0.5;  ///< a frame has its outcome by then; > 0
  double max_step_s = 0.5;        ///< frames come more often than this; > 0
  double octomap_timeout_s = 0;   ///< a map in use is not older; 0: it may be
  bool map_streams = false;       ///< maps come all the time: a newer one has answer_timeout_s until it is in use
};

/// What stands in the way of a proof apart from the step itself. One of a kind at a time.
struct Fault {
  enum class Kind : std::uint8_t { ASKED, DISABLED, STOPPED, NO_ANSWER, SILENCE, NEWER_MAP, OLD_MAP, NEWER_BODY };
  Kind kind = Kind::ASKED;
  std::string sentence;
};

std::string noFrameFor(double max_step_s);
/// Of a newer map that has had that long to be in use [s].
std::string waitsTooLong(double answer_timeout_s);

/// Not thread-safe. `now_ns`: of the watch.
class Liveness {
 public:
  explicit Liveness(const LivenessLimits& limits) : limits_(limits) {}
  void setLimits(const LivenessLimits& limits) { limits_ = limits; }

  /// A frame of the clock body came; `name` is any number that grows from frame to frame.
  void frame(std::int64_t name, std::int64_t now_ns);
  /// It has its outcome, whatever that says, and so do those before it. `map_age_s`: of the map in use at the frame's
  /// stamp; negative: none was used.
  void outcome(std::int64_t name, double map_age_s, std::int64_t now_ns);
  /// A map came, under a name as frames have. It has answer_timeout_s until an answer has used it.
  void mapCame(std::int64_t name, std::int64_t now_ns);
  /// The next answer uses the map `name`; those before it gave way to it or were refused. Those up to `placed` have a
  /// place, and are in use from the first frame on that is not before their stamp. An answer that was given without one
  /// of them stays no proof.
  void mapSettled(std::int64_t name, std::int64_t placed);

  /// Frames of a static body came, up to this number: what was said is void until a step that used the last one is
  /// answered. One that follows the one before within max_step_s, as a depth camera's do all the time, has
  /// answer_timeout_s for that.
  void staticCame(const std::string& body, std::uint64_t number, std::int64_t now_ns);
  /// The one of this number is in use from the next step on, or was refused.
  void staticInUse(const std::string& body, std::uint64_t number) { statics_[body].in_use = number; }

  /// Something is asked for that makes what was said void, until forget().
  void ask(const std::string& what) { asked_ = what; }
  /// All frames are forgotten; what was asked for is done.
  void forget();
  void disable(bool on) { disabled_ = on; }
  /// For good.
  void stop() { stopped_ = true; }

  std::vector<Fault> faults(std::int64_t now_ns) const;
  /// How long ago the newest frame came that has an outcome [s]; infinity: none has.
  double answerAge(std::int64_t now_ns) const;

 private:
  static constexpr std::int64_t NEVER = -1;
  struct Frame {
    std::int64_t name, came_ns;
  };
  /// The last answer was given without a map that had come before its frame.
  bool lacksMap() const {
    return !maps_.empty() && !limits_.map_streams && maps_.front().name < answered_ &&
           maps_.front().name > maps_placed_;
  }
  LivenessLimits limits_;
  std::deque<Frame> open_;  // without an outcome; at most a few thousand, of which the oldest counts
  Frame newest_{0, NEVER};
  std::deque<Frame> maps_;  // in no answer; at most as many
  std::int64_t maps_placed_ = NEVER, maps_settled_ = NEVER;
  bool lacked_map_ = false;                              // lacksMap() held until that map got its place
  std::int64_t answered_ns_ = NEVER, answered_ = NEVER;  // the last one's arrival and name
  double map_age_s_ = -1;
  /// Numbers of a static body's frames.
  struct Static {
    std::uint64_t came = 0, in_use = 0, answered = 0;
    std::int64_t last_ns = NEVER, since_ns = NEVER;  // when the last one came, and the first that is in no answer
    bool is_alone = false;                           // one of these follows none
    bool isOpen() const { return answered != came; }
  };
  std::map<std::string, Static> statics_;
  std::string asked_;
  bool disabled_ = false, stopped_ = false;
};

}  // namespace dccd
