// Random faults in a world of level plates, where all that there is to know is which one is above which. A model of
// what was sent, which knows nothing of the code, judges each step that is called clear: no plate may have changed
// sides with the cloth within it, nor between it and the clear step before, and nothing newer may have been left out.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <random>
#include <utility>

#include "dccd/assurance.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

constexpr StampNs MS = 1000000, START = 1700000000000 * MS, TICK = 50 * MS;
constexpr double NEAR_M = 3e-3;  // what is that close, and rigid_tolerance_m, is not judged

/// Where a plate was said to be, by stamp.
struct Track {
  std::map<StampNs, double> z;
  /// What is sent with a stamp that goes back voids all after it.
  void say(StampNs stamp_ns, double at) {
    z.erase(z.lower_bound(stamp_ns), z.end());
    z[stamp_ns] = at;
  }
  bool knows(StampNs t) const { return !z.empty() && z.begin()->first <= t && t <= z.rbegin()->first; }
  double at(StampNs t) const {
    const auto after = z.lower_bound(t);
    if (after->first == t) return after->second;
    const auto before = std::prev(after);
    const double u = static_cast<double>(t - before->first) / static_cast<double>(after->first - before->first);
    return before->second + u * (after->second - before->second);
  }
};

/// -1, 1: on which side of the cloth; 0: too near to say.
int sideOf(double cloth, double plate) { return std::abs(plate - cloth) < NEAR_M ? 0 : plate > cloth ? 1 : -1; }

XmlRpcValue plates() {
  const std::string file = ::testing::TempDir() + "plate.obj";
  std::ofstream(file) << "v 0.1 0.1 0\nv 0.4 0.1 0\nv 0.1 0.4 0\nf 1 2 3\n";
  XmlRpcValue tree = scene();
  tree["octomap_topic"] = "/map";
  for (const char* name : {"cloth", "other", "table"}) tree["bodies"][name]["topic"] = name;
  tree["bodies"]["table"]["motion"] = "static";
  tree["bodies"]["finger"]["rigid"]["mesh"] = file;
  tree["bodies"]["finger"]["rigid"]["frame"] = "finger";
  tree["clock_body"] = "cloth";
  for (int phase = 0; phase < 2; ++phase) {  // what is expected is no less a contact
    tree["expected_contacts"][phase]["between"][0] = "cloth";
    tree["expected_contacts"][phase]["between"][1] = phase == 0 ? "other" : "finger";
    tree["expected_contacts"][phase]["phase"] = phase == 0 ? "carry" : "lay";
  }
  return tree;
}

class World {
 public:
  explicit World(std::uint64_t seed) : random_(seed), tf_off_ns_(seed % 10 * MS), driven_(plates()) {
    for (std::size_t b = 0; b < driven_.config.bodies.size(); ++b) body_[driven_.config.bodies[b].body.name] = b;
  }

  void run(int ticks) {
    say("table", START, level());
    giveMap(START);
    for (int k = 0; k < ticks; ++k) tick(START + k * TICK);
    driven_.pipeline.finish();
    judgeAll();
  }

  std::size_t clear = 0, outcomes = 0;
  std::map<StepStatus, std::size_t> seen;

 private:
  std::mt19937_64 random_;
  const StampNs tf_off_ns_;  // from the frames' stamps
  Driven driven_;
  std::map<std::string, std::size_t> body_;
  std::map<std::string, Track> tracks_;
  std::map<std::string, int> sides_;  // at the end of the last clear step
  StampNs clear_until_ = 0;
  bool table_refused_ = false, map_refused_ = false, anew_ = false;
  double cloth_ = 0, other_ = 0.5, finger_ = 0.7, arm_ = 0.2, odom_ = -1, held_odom_ = -1;
  // Of the finger: where it was last sent, in the frame of the arm or of the world; whether in the last 10 ms, and to
  // stay.
  double in_parent_ = 0;
  bool on_arm_ = false, sent_ = true, at_rest_ = true;

  bool chance(int one_in) { return random_() % static_cast<std::uint64_t>(one_in) == 0; }
  double level() { return (random_() % 2 ? 1 : -1) * (0.2 + 0.1 * static_cast<double>(random_() % 8)); }

  void send(const std::string& name, StampNs stamp_ns, double z, bool cut = false) {
    auto bytes = cloudAt(ros::Time().fromNSec(static_cast<std::uint64_t>(stamp_ns)), static_cast<float>(z));
    if (cut) bytes.resize(60);
    driven_.pipeline.take(body_.at(name), {"sensor_msgs/PointCloud2", bytes, 0, 0});
    judgeAll();  // the pipeline takes the next frame of a body when this one has its place
  }
  void say(const std::string& name, StampNs stamp_ns, double z) {
    tracks_[name].say(stamp_ns, static_cast<double>(static_cast<float>(z)));
    send(name, stamp_ns, z);
  }
  /// What is there, but comes as nothing that can be used.
  void sayInVain(const std::string& name, StampNs stamp_ns, double z) {
    tracks_[name].say(stamp_ns, z);
    send(name, stamp_ns, z, true);
  }
  void tell(const std::string& frame, StampNs stamp_ns, double z, const std::string& parent, double rotation_w = 1) {
    geometry_msgs::TransformStamped transform;
    transform.header.stamp.fromNSec(static_cast<std::uint64_t>(stamp_ns));
    transform.header.frame_id = parent;
    transform.child_frame_id = frame;
    transform.transform.translation.z = z;
    transform.transform.rotation.w = rotation_w;
    tf2_msgs::TFMessage message;
    message.transforms.push_back(transform);
    driven_.feed_tf.add(message, false);
  }
  void transformTo(const std::string& frame, StampNs stamp_ns, double z, const std::string& parent = "world") {
    tell(frame, stamp_ns, z, parent);
    tracks_[frame].say(stamp_ns, z);
  }
  /// An arm takes the finger and lays it down again. It is not sent each time, but goes where its parent does.
  void moveFinger(StampNs t, bool is_last) {
    const double arm = chance(40) ? level() : arm_;
    transformTo("arm", t, arm);
    const bool was_sent = std::exchange(sent_, is_last || !at_rest_ || !chance(3));
    if (sent_) {
      if (chance(30)) on_arm_ = !on_arm_;
      if (was_sent && chance(60)) finger_ = level();
      at_rest_ = !was_sent || is_last || !chance(60);
      in_parent_ = (at_rest_ ? finger_ : level()) - (on_arm_ ? arm_ : 0);
      transformTo("finger", t, in_parent_, on_arm_ ? "arm" : "world");
    }
    const std::string parent = on_arm_ ? "arm" : "world";
    if (chance(100)) {  // it goes away and comes back in a transform that is none
      tracks_["finger"].say(t - 5 * MS, level());
      tell("finger", t - 5 * MS, level(), parent, 1.2);
    }
    tracks_["finger"].say(t, in_parent_ + (on_arm_ ? arm : 0));
    if (sent_ && chance(100)) {  // another publisher has it elsewhere
      tell("finger", t, in_parent_ + 0.4, parent);
      tracks_["finger"].say(t + 1, in_parent_ + 0.4 + (on_arm_ ? arm : 0));
      tracks_["finger"].say(t + 2, in_parent_ + (on_arm_ ? arm : 0));
    }
  }
  void giveMap(StampNs stamp_ns, const std::string& frame = "odom") {
    LoadedMap loaded = decodeMapMessage(map(1), driven_.config);
    loaded.frame_id = frame;
    loaded.stamp_ns = stamp_ns;
    driven_.pipeline.setMap(std::move(loaded), 0);
    held_odom_ = odom_;
    map_refused_ = false;
    anew_ = true;
  }

  /// All that comes up to the cloth's frame of this time, and that frame.
  void tick(StampNs now) {
    for (StampNs t = now - TICK + 10 * MS + tf_off_ns_; t <= now + tf_off_ns_; t += 10 * MS) {
      // Between two frames of the cloth things may go through it and back.
      const bool shifts = chance(200);
      if (shifts) odom_ = odom_ < 0 ? -1.5 : -1;
      moveFinger(t, t == now + tf_off_ns_);
      transformTo("odom", t, chance(25) ? 0.5 : odom_);  // also at a frame's stamp
    }
    if (chance(8)) {  // the stamps go back, and where it is now nobody saw it go
      other_ = level();
      say("other", now - TICK - static_cast<StampNs>(random_() % 3) * 10 * MS - 1, other_);
    }
    if (chance(6)) say("other", now - 20 * MS, chance(3) ? level() : other_);
    if (chance(15)) sayInVain("other", now - 5 * MS, level());
    if (!chance(20)) say("other", now, other_);
    if (chance(12)) {
      table_refused_ = chance(2);
      if (table_refused_) {
        send("table", now, 0, true);
      } else {
        say("table", now, level());
        anew_ = true;
      }
    }
    if (chance(15)) {
      LoadedMap refused;
      refused.problem = "a test";
      driven_.pipeline.setMap(std::move(refused), 0);
      map_refused_ = true;
    } else if (chance(40)) {  // it waits for a place that it never gets
      giveMap(now, "nowhere");
      map_refused_ = true;
    } else if (chance(10)) {
      giveMap(now);
    }
    if (chance(10)) driven_.pipeline.setPhase(driven_.config.phases().at(random_() % 2));
    if (chance(8)) {
      const StampNs back = now - TICK - static_cast<StampNs>(random_() % 5) * 10 * MS;
      say("other", back, other_);
      say("cloth", back, cloth_);
      say("other", now, other_);
    }
    if (chance(25)) cloth_ = level() / 4;
    if (chance(25)) {
      sayInVain("cloth", now, level() / 4);
    } else {
      say("cloth", now, cloth_);
    }
  }

  void judgeAll() {
    Outcome outcome;
    // The clock has gone on so far that nothing is waited for any more.
    while (driven_.pipeline.nextOutcome(std::int64_t{1} << 40, outcome)) judge(outcome);
  }

  void judge(const Outcome& outcome) {
    ++outcomes;
    ++seen[outcome.status];
    if (!assuranceOf(outcome).clear()) return;
    ++clear;
    EXPECT_FALSE(table_refused_) << "the table's newest frame was refused";
    EXPECT_FALSE(map_refused_) << "the newest map was refused, or has no place";
    std::map<std::string, int> sides;
    for (const char* name : {"other", "finger", "odom", "table"}) {
      const int end = judge(name, outcome.start_ns, outcome.stamp_ns);
      // The table and the map may be elsewhere than before, for good.
      const bool replaced = anew_ && (name == std::string("table") || name == std::string("odom"));
      const auto before = sides_.find(name);
      const bool follows = clear_until_ == outcome.start_ns && before != sides_.end() && !replaced;
      const int begin = sideAt(name, outcome.start_ns);
      if (follows && begin != 0 && before->second != 0) {
        EXPECT_EQ(begin, before->second) << name << " changed sides between two clear steps";
      }
      sides[name] = end;
    }
    anew_ = false;
    sides_ = sides;
    clear_until_ = outcome.stamp_ns;
  }

  int sideAt(const std::string& name, StampNs t) const {
    const Track& track = tracks_.at(name);
    if (name == "table") return sideOf(tracks_.at("cloth").at(t), track.z.rbegin()->second);
    return track.knows(t) ? sideOf(tracks_.at("cloth").at(t), track.at(t)) : 0;
  }

  /// The side at the end of the step, on which it must have been all the time.
  int judge(const std::string& name, StampNs from, StampNs to) const {
    int side = 0;
    std::vector<StampNs> times{from, to};
    for (const std::string& moved : {name, std::string("cloth")}) {
      for (const auto& [stamp_ns, z] : tracks_.at(moved).z) {
        if (stamp_ns > from && stamp_ns < to) times.push_back(stamp_ns);
      }
    }
    for (const StampNs t : times) {
      const int now = sideAt(name, t);
      if (now == 0) continue;
      EXPECT_TRUE(side == 0 || side == now)
          << name << " changed sides in a clear step, " << (t - from) << " ns into it";
      side = now;
      // The cloth is above the map, or in it.
      if (name == std::string("odom")) {
        EXPECT_EQ(now, -1) << "the cloth is in the map";
      }
    }
    return sideAt(name, to);
  }
};

TEST(ClearProperty, HoldsAgainstRandomFaults) {
  const std::uint64_t worlds = std::getenv("DEFORMABLE_CCD_LONG") ? 20000 : 400;
  std::size_t clear = 0, outcomes = 0;
  std::map<StepStatus, std::size_t> seen;
  for (std::uint64_t seed = 0; seed < worlds && !::testing::Test::HasFailure(); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    World world(seed);
    world.run(60);
    clear += world.clear;
    outcomes += world.outcomes;
    for (const auto& [status, count] : world.seen) seen[status] += count;
  }
  if (::testing::Test::HasFailure()) return;
  EXPECT_GT(clear, outcomes / 20) << "else this shows nothing";
  for (const StepStatus status : {StepStatus::OK, StepStatus::PARTIAL, StepStatus::NO_BODY, StepStatus::NO_MAP,
                                  StepStatus::TIME_JUMP, StepStatus::BAD_MESSAGE}) {
    EXPECT_GT(seen[status], worlds / 10) << toString(status);
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
