// From messages to outcomes: decoding, waiting for tf, the fixed frame, the map's pose, rigid bodies, and the monitor.
// The node drives it with a steady clock, analyze_bag with the bag's; there is no other difference between the two.
#pragma once

#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <deformable_ccd/AlongPath.h>
#include <deformable_ccd/Limits.h>
#include <deformable_ccd/SafeUntil.h>
#include <deformable_ccd/WouldTouch.h>

#include "config/monitor_config.h"
#include "dccd/approach_limits.h"
#include "dccd/known_space.h"
#include "dccd/monitor_extras.h"
#include "dccd/stream.h"
#include "input/mesh_decoder.h"
#include "input/transform_tracks.h"
#include "node/attach_request.h"
#include "node/carried.h"
#include "node/effects.h"
#include "node/frames_at_rest.h"
#include "node/heard.h"
#include "node/intended_motion.h"
#include "node/loaded_map.h"
#include "output/output_messages.h"

namespace dccd {

/// What a body's mesh is taken for: a topology on the same vertices, the same object for the same one.
using TopologyFilter =
    std::function<std::shared_ptr<const Topology>(std::size_t body, const std::shared_ptr<const Topology>& topology)>;

class MonitorPipeline {
 public:
  /// Loads topology and mesh files. Throws ParameterError or std::invalid_argument naming the parameter or file, or the
  /// effect that is asked for and that the scene cannot have. `map_source`: as EffectTracker's.
  MonitorPipeline(MonitorConfig config, TransformFeed& transforms, const std::string& map_source = {});

  /// Whether the body can take a message: none of its frames waits for tf, or one of a static body has waited in vain
  /// and gives way to the next. Each waits its own time: where tf lags behind a camera by more than the time between
  /// two clouds, one that gave way at once would never find its place.
  bool idle(std::size_t body) const { return !waiting_[body] || waiting_[body]->overdue; }
  /// Counts, decodes and keeps one message of an idle body. One that is refused is counted, too, and the clock body's
  /// yields an outcome.
  void take(std::size_t body, const MeshMessage& message);
  /// The number of the body's last message that was taken, whatever became of it.
  std::uint64_t lastTaken(std::size_t body) const { return came_[body]; }
  /// From the next message on. Null: meshes are taken as they come. Rigid bodies' files always are.
  void setTopologyFilter(TopologyFilter filter) { topology_filter_ = std::move(filter); }
  void setMap(LoadedMap map, std::int64_t now_ns);
  /// A message came that the map is made of. `frame_id`: of a cloud, which tells sensors apart; of a map empty.
  void hearMap(const std::string& topic, const std::string& frame_id, const std::string& sender);
  /// When the newest map that is in use or was refused came; one that was set and has no place yet is neither.
  std::int64_t settledMapNs() const {
    return monitor_->mapInUse().arrival_ns == monitor_->map().arrival_ns ? settled_map_ns_
                                                                         : monitor_->mapInUse().arrival_ns;
  }
  /// The same of the newest that has a place, or was refused.
  std::int64_t placedMapNs() const { return settled_map_ns_; }
  /// Why tf is not all that came of it, which ends proofs; empty: it is.
  void doubtTransforms(std::string why) { transforms_doubt_ = std::move(why); }
  /// Somebody is there who publishes maps: from now on a step without one lacks it.
  void expectMap() { effects_.expectMap(); }
  /// The next outcome; frames that wait for tf move on as far as they can. False: nothing more for now.
  bool nextOutcome(std::int64_t now_ns, Outcome& outcome);
  /// Something waits for tf or for other bodies, so that nextOutcome() is worth calling again without new input.
  bool waiting() const;
  /// While it rests no step is computed, and outcomes say nothing but that. Where bodies are, and which voxels are
  /// their own, is followed all the same: what maps show meanwhile could not be told from the bodies afterwards.
  void rest(bool resting) { resting_ = resting; }
  bool isResting() const { return resting_; }
  /// End of input: whatever still waits is given up at the next call of nextOutcome().
  void finish();
  /// Forgets all frames but those of static bodies, also where they wait. After RESET triangle soups are welded anew,
  /// and a fixed frame that was learnt is learnt anew: from the clock body's next message. `why`: what is said of the
  /// promise that is forgotten.
  void reset(StepStatus status, const std::string& why = {});
  /// Monitor::checkNow(), with the reason why a static body has no place yet. `now_ns`: on the clock of arrivals.
  Outcome checkNow(std::int64_t now_ns);

  /// Changes what can be changed while it runs. `change` is called twice, with a copy and, once all of it holds, with
  /// the options themselves, of which it writes nothing but what it changes. Throws std::invalid_argument naming the
  /// option; all then stays.
  void reconfigure(const std::function<void(MonitorOptions&, MarkerConfig&)>& change);

  /// The phase of the task that is on from the next step on. Throws ParameterError naming those that there are; all
  /// then stays.
  void setPhase(const std::string& phase);
  /// Whether what robot/holds names under `by` holds the body from the next step on; an empty name: each. Throws
  /// ParameterError naming what there is; all then stays.
  void setHold(const std::string& body, const std::string& by, bool closed);
  /// From the next step on the object is a body that moves with its link. Throws std::invalid_argument or
  /// ParameterError naming the object; all then stays. So do the next two.
  void attach(AttachedObject object);
  /// It stays where its link has it at the moment of the call, once tf has come so far.
  void detach(const std::string& name);
  void remove(const std::string& name);

  /// These parameters of the robot's description do not hold any more what they did at the start: as long as that is
  /// so, nothing is proved. Returns why, a sentence each.
  const std::vector<std::string>& robotChanged(const std::vector<std::string>& parameters);
  /// Which contacts are expected in the phase that is on, in words.
  std::string phaseInWords() const;

  /// The body's newest frame holds at all times. Safe to call from any thread.
  bool isStatic(std::size_t body) const { return config_.bodies[body].body.motion == BodyMotionKind::STATIC; }
  Monitor& monitor() { return *monitor_; }
  const Monitor& monitor() const { return *monitor_; }
  /// What is asked for: the one copy of the options, `monitor` and `markers` of which reconfigure() changes. What is in
  /// force in the monitor follows from it and from the effect plan.
  const MonitorConfig& config() const { return config_; }
  EffectTracker& effects() { return effects_; }
  const EffectTracker& effects() const { return effects_; }
  const std::string& fixedFrame() const { return fixed_frame_; }
  /// What the last outcome promises, and what became of the promise before; nothing where the configuration has no
  /// bounds.
  const PromiseWatch& promises() const { return promises_; }
  /// What calls change from now on, they change at this stamp: steps that began before prove nothing. 0: nobody knows
  /// it, and they change it at the newest one that had come.
  void callsComeAt(StampNs stamp_ns) { call_ns_ = stamp_ns; }
  /// Why what was said of the last outcome is void, since the last call: a call has changed what it rests on. Empty: it
  /// stands.
  std::string takeVoided() { return std::exchange(voided_, {}); }
  /// What a controller says that the robot is to do, from the next step on. Returns what is wrong with it, a clause;
  /// empty: it holds. Where nobody listens to it nothing happens.
  template <class Message>
  std::string intend(const Message& message) {
    intends_anew_ = motion_.has_value();
    return motion_ ? motion_->take(message, answered_ ? answered_->stamp_ns : 0) : std::string();
  }
  /// The same of a message of whatever type, as it came or a bag has it: read now, and told when it is called. Throws
  /// what reading it throws.
  template <class Any>
  std::function<std::string()> intention(const Any& message) {
    const std::string type = message.getDataType();
    const auto tells = [this](const auto& motion) -> std::function<std::string()> {
      if (!motion) return [] { return std::string("has another definition of its type"); };
      return [this, motion] { return intend(*motion); };
    };
    using Trajectory = trajectory_msgs::JointTrajectory;
    using Twist = geometry_msgs::TwistStamped;
    if (type == ros::message_traits::datatype<Trajectory>()) return tells(message.template instantiate<Trajectory>());
    if (type == ros::message_traits::datatype<Twist>()) return tells(message.template instantiate<Twist>());
    return [type] { return "has type " + type + "; it takes JointTrajectory and TwistStamped"; };
  }
  /// The newest answer, if something else is intended since it was last looked at: what follows is another promise and
  /// scale now, which are no less than by bounds alone. Null: all stands.
  const Outcome* reconsider();
  /// Whether the robot would touch something, if it went along the trajectory from where the newest answer has it.
  /// `unproved`: why nothing is proved besides; empty: it is. Only with `intent`.
  deformable_ccd::WouldTouch::Response wouldTouch(const trajectory_msgs::JointTrajectory& trajectory,
                                                  const std::string& unproved = {});
  static deformable_ccd::WouldTouch::Response notProved(const std::string& reason);
  /// What follows from it for the last outcome.
  struct Intended {
    IntendedPath path;
    AlongPath along;
  };
  const Intended& intended() const { return intended_; }
  /// Why what was intended does not hold any more, since the last call; for the log. Empty: it does.
  std::string takeIntendedProblem() { return motion_ ? motion_->takeProblem() : std::string(); }
  /// How fast what slows down may go after this outcome, the last one.
  SpeedScale speedScale(const Outcome& outcome) const;
  /// What is published of this outcome, the last one: ~safe_until, and only with `limits` ~limits, with `intent`
  /// ~along_path. `now`: when that is.
  deformable_ccd::SafeUntil safeUntilMessage(const Outcome& outcome, const ros::Time& now) const;
  deformable_ccd::Limits limitsMessage(const Outcome& outcome);
  deformable_ccd::AlongPath alongPathMessage(const Outcome& outcome) const;
  /// What may be said of the last outcome.
  const Statement& statement() const { return statement_; }
  /// How fast bodies are assumed to be, by body. A rigid one in the fixed frame stands still.
  std::vector<SpeedBound> speedBounds() const;
  /// What it has counted so far; the rest of the context is its owner's.
  StatsContext counters() const;
  /// A mesh that cannot be placed or a message that is refused, since the last call; for the log. Empty: none. Of a
  /// static body's frame that waits on it is said once.
  std::string takeProblem(std::size_t body);
  /// Of the body's topic: messages of markers that are none of the mesh.
  std::uint64_t passedOver(std::size_t body) const { return passed_over_[body].messages; }
  /// That nothing else came, and what did; empty: something else did, or nothing at all.
  std::string onlyPassedOver(std::size_t body) const;
  /// What was taken for granted to place the map, since the last call; for the log. Empty: nothing was.
  std::string takeMapHint() { return std::exchange(map_hint_, {}); }
  /// Why what is looked at may not be what it is taken for (advice.h), a sentence each.
  std::vector<std::string> doubts() const;
  /// What looks like a mistake in the body's messages or mesh file, though they are valid (advice.h), its doubt
  /// included; empty: nothing does.
  const std::string& hint(std::size_t body) const { return hints_[body]; }

 private:
  struct Waiting {
    DecodedMesh mesh;
    std::int64_t since_ns = 0;
    bool overdue = false;  // past transform_timeout_s
    bool kept = false;     // that, or one before it was: a static body sends its only frame once, and steps do not wait
    bool told = false;     // the problem about it has been set
    std::string reason;    // why it has no place yet
  };
  struct Attached {
    AttachedObject object;
    bool held = true;
  };
  MonitorConfig config_;
  EffectTracker effects_;
  TransformFeed& transforms_;
  std::string transforms_doubt_;
  std::string fixed_frame_;
  TransformTracks tracks_{transforms_, fixed_frame_};
  std::unique_ptr<Monitor> monitor_;
  std::vector<MeshDecoder> decoders_;
  TopologyFilter topology_filter_;
  std::vector<std::optional<Waiting>> waiting_;
  PromiseWatch promises_;
  std::optional<IntendedMotion> motion_;
  PathSearch path_search_;
  ApproachSearch approach_search_;
  Intended intended_;
  std::optional<Outcome> answered_;  // the newest answer, where somebody listens to what is intended
  bool intends_anew_ = false;        // since then
  std::string voided_;
  StampNs call_ns_ = 0, changed_ns_ = 0;  // the latter of the last call that changed something,
  StampNs newest_ns_ = 0;                 // and the clock body's newest stamp then
  std::string changed_;                   // what it did
  Statement statement_;
  std::vector<StampNs> widened_ns_;                 // per body, its last frame that widen() has seen; 0: none
  std::vector<bool> placed_;                        // a static body of which the monitor has a frame
  std::vector<std::uint64_t> came_;                 // per body, the number of its last message
  std::vector<Source> sources_;                     // per body
  std::map<std::string, Senders> map_senders_;      // by topic and frame_id
  std::vector<std::optional<SeenFrom>> seen_from_;  // per body
  // By body; behind those of the configuration is what is attached, or a place for it, none with an empty mesh.
  std::vector<std::optional<Rigid>> rigid_;
  std::vector<std::optional<Attached>> attached_;
  std::vector<std::string> excluded_;  // by the configuration
  std::vector<std::string> robot_changed_;
  std::shared_ptr<const std::vector<OwnVoxel>> counted_voxels_;  // of a map: robots_voxels_ are the robot's
  std::size_t robots_voxels_ = 0;
  std::vector<std::string> problems_, hints_, file_hints_, doubts_;
  std::vector<std::optional<std::string>> map_doubts_;  // of the first step that met the map; empty: there is none
  std::vector<std::string> refused_;  // of a static body: why its newest frame is none; empty: it is one
  std::vector<std::shared_ptr<const Topology>> checked_;  // of the hint; it has all indices that are named
  struct UnplacedMap {
    LoadedMap map;
    std::int64_t since_ns = 0;
  };
  std::uint64_t map_number_ = 0;           // of the last one that came
  std::deque<UnplacedMap> unplaced_maps_;  // oldest first
  std::optional<LoadedMap> trusted_map_;   // beside live ones
  bool trusted_placed_ = false;
  std::int64_t settled_map_ns_ = 0, map_placed_ns_ = 0;  // arrival of the last one; when the last one got its place
  std::string map_hint_;                                 // to be told
  std::set<std::string> map_hints_;  // LoadedMap::hint, as far as they were told; there are a few for each source
  std::string map_slow_;             // LoadedMap::slow of the newest one
  StampLead map_lead_;
  StampNs map_stamp_ns_ = std::numeric_limits<StampNs>::min();  // the latest of the maps'
  std::int64_t doubted_map_ns_ = -1;  // arrival of the last one that may lie elsewhere, and why
  std::string map_doubt_;
  std::map<std::string, std::uint64_t> clouds_placed_by_;  // LoadedMap::placed_by
  StampNs first_cloud_ns_ = 0;                             // LoadedMap::first_ns
  std::vector<MissedClouds> missed_clouds_;                // LoadedMap::missed
  std::vector<std::uint64_t> missed_before_;               // of these the counts at the last ~reset
  FramesAtRest clouds_frames_;
  FramesAtRest::Word clouds_frame_;  // of the last look
  // Where the fixed frame is learnt: what is placed in it, as it came, to be placed in another one.
  std::vector<std::optional<DecodedMesh>> static_meshes_;
  std::optional<LoadedMap> placed_map_;
  bool frame_answered_ = false;  // a step was answered in it
  FramesAtRest learnt_frames_;   // in which something is held, in the roots of their trees
  std::uint64_t weld_changes_ = 0, wrong_row_steps_ = 0, points_no_measurement_ = 0;
  bool resting_ = false;
  std::vector<OtherMarkers> passed_over_;
  bool finishing_ = false;

  void followIntended();
  AlongPath searchAlong(const IntendedPath& path, FirstTouch* first = nullptr);
  IntendedMotion::Lookup places();
  std::vector<CarriedBody> carriedBodies(const Step& step) const;
  void loadFiles();
  /// Whether the map was occupied along a body when they first met, of each once: a camera's may hold the body itself.
  void doubtMap(const Outcome& outcome);
  void keepHint(std::size_t body, const DecodedMesh& mesh, bool is_new);
  void voidWhatWasSaid(const std::string& why);
  void setRigid(std::size_t body, const MeshResource& mesh);
  static Rigid rigidOf(const MeshResource& mesh);
  /// The parameter that one of the expectations is from.
  std::string expectedEntry(std::size_t expectation) const;
  /// Of the body, by expected_contacts.
  std::set<std::string> setsNamed(std::size_t body) const;
  /// The vertices of the sets that expected_contacts names. Throws ParameterError.
  void findSets();
  void skip(std::size_t body, StepStatus status, StampNs stamp_ns, std::int64_t arrival_ns, const std::string& reason);
  /// What of the body's vertex_mask and of its expected contacts the mesh has not; empty: it has all.
  std::string indexProblem(std::size_t body, const Topology& topology) const;
  /// A fixed frame that was learnt is forgotten, and with it where things were in it; frames of streams are counted
  /// under the status.
  void learnAnew(StepStatus status);
  /// A static body's frame waits on.
  void keep(std::size_t body);
  /// The end has come for what still waits.
  void giveUp();
  /// A static body whose place in the monitor is out of date: its newer frame waits or was refused. None: the number of
  /// bodies.
  std::size_t misplaced() const;
  /// There is no use in waiting for such a body's place: its frame was refused or has waited in vain itself.
  bool isHopeless(std::size_t body) const { return !refused_[body].empty() || waiting_[body]->kept; }
  /// Why the body, whose frame waits or was refused, has no place.
  std::string missing(std::size_t body) const;
  /// Answers what is asked of a cell (Claim), also of an outcome that nobody but a service asked for. What came up to
  /// `came_ns`, its frame's arrival, had to be used. How long a map waits is told where `now_ns` is of the clock of
  /// arrivals; in the node Liveness tells it of ~state.
  void answerForCell(std::int64_t came_ns, std::int64_t now_ns, Outcome& outcome);
  std::vector<std::string> robotsProblems(const Step& step);
  /// Where stamps are of the clocks of two computers that differ.
  void answerForClocks(const Step& step, Claim& claim) const;
  /// Where the fixed frame was learnt, why what is held in it may be elsewhere.
  std::vector<std::string> learntFramesProblems(const Step& step);
  /// Frames that were learnt in which the map, a static body or what was let go is held.
  std::set<std::string> learntFramesInUse(const Step& step) const;
  bool hasLetGo() const;
  /// Says of an outcome with a map of clouds which of them are not in it.
  void nameMissedClouds(Outcome& outcome) const;
  std::string newerMapProblem(std::int64_t came_ns, std::int64_t now_ns, const ObstacleMap& map) const;
  /// When the last call changed something, by the clock of stamps such as this one.
  StampNs changedAt(StampNs stamp_ns) const;
  std::string sendersProblem(std::size_t body) const;
  std::vector<std::string> transformsProblems();
  std::string numberingProblem(std::size_t body) const;
  /// Says of an outcome without a body whether it waits for its transform.
  void nameMissing(Outcome& outcome) const;
  /// Puts the room beside straight paths into the frame's radii, by max_acceleration_m_s2.
  void widen(std::size_t body, MeshFrame& frame);
  std::size_t robotsVoxels(const Step& step);
  /// False: still waits.
  bool placeFrame(std::size_t body, std::int64_t now_ns);
  /// What the clock body's frame needs besides its own transform: rigid bodies, and no misplaced one. Once it is
  /// overdue, links of a robot that have no transform stand in nobody's way any longer.
  bool placeOthers(std::uint64_t epoch, std::int64_t now_ns, bool overdue, StepStatus& problem, std::string& reason);
  /// Where it is at the stamp. False: nobody knows. epoch: of tracks_, as it was before.
  bool placeOne(Rigid& rigid, StampNs stamp_ns, std::uint64_t epoch, MeshFrame& frame, std::string& reason) const;
  Carrier carrierOf(const std::string& frame, std::uint64_t epoch) const;
  void pushRigid(std::size_t body, MeshFrame frame, const std::string& lost, std::int64_t now_ns);
  /// A body is another one from the next step on.
  void setBody(std::size_t body, const Body& what, Rigid rigid);
  std::size_t attachedNumber(const std::string& name) const;
  void expectNow(const std::string& phase);
  bool findPlace(const LoadedMap& loaded, ObstacleMap& map, std::string& reason);
  bool placeTrusted(std::int64_t now_ns);
  /// What the monitor is to have of it: the map in its place, or why there is none. False: no place yet.
  bool settleMap(const LoadedMap& loaded, bool may_place, ObstacleMap& map, std::string& reason);
  void placeMaps(std::int64_t now_ns);
  void limitUnplacedMaps();
  /// From the first cloud on, or from_ns, where nobody has looked at the frame.
  StampNs lookFrom(const FramesAtRest& frames, const std::string& frame, StampNs from_ns) const;
  /// Whether the named frame in which the map of clouds is kept is at rest.
  void lookAtCloudsFrame(const std::string& frame, StampNs from_ns, StampNs to_ns);
  std::string mapPlaceProblem(const Step& step);
  std::string doubtOf(const LoadedMap& loaded, const std::string& frame) const;
  /// Tf has the frames at the stamp to which maps and static bodies are held.
  bool knowsHeld(StampNs stamp_ns) const;
  /// A map came before a frame of that arrival and has no place yet, but may find one soon.
  bool mapMayCome(std::int64_t arrival_ns, std::int64_t now_ns) const;
};

}  // namespace dccd
