// What a robot takes into its hand and lets go of: requests and their mistakes, and what becomes of the body.
#include <fstream>

#include "node/attach_request.h"
#include "record/step_replay.h"
#include "robot_scene.h"
#include "robot_texts.h"
#include "support/folder_test.h"
#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

using Request = deformable_ccd::AttachObject::Request;

/// A hand of a palm with a plate 1 m x 1 m x 2 mm, and a frame without geometry.
RobotLoader hand() {
  return loads(robotOf(link("palm", collision("<box size='1 1 0.002'/>")) + link("tool", "") + joint("palm", "tool")));
}

/// 1 m x 1 m x 2 mm, 0.5 m above the frame of the tool.
Request plate(const std::string& name = "plate") {
  Request request;
  request.name = name;
  request.link = "tool";
  request.pose.position.z = 0.5;
  request.pose.orientation.w = 1;
  request.primitive.type = shape_msgs::SolidPrimitive::BOX;
  request.primitive.dimensions = {1, 1, 0.002};
  return request;
}

class Attached : public FolderTest {
 protected:
  void start(const XmlRpcValue& tree = robotScene()) { driven_ = std::make_unique<Driven>(tree, hand()); }
  void attach(const Request& request) { pipeline().attach(readAttach(request, pipeline().config())); }
  std::string refusal(const Request& request) {
    return test::said<std::exception>([&] { attach(request); });
  }
  /// The palm far below, the tool at this height; then a frame of the cloth.
  const Outcome& feed(double stamp_s, double tool_z, float cloth_z) {
    const ros::Time stamp(stamp_s);
    driven_->tell({above("palm", -9, stamp), above("tool", tool_z, stamp)});
    return driven_->feed(stamp_s, cloth_z);
  }
  Assurance said() const { return assuranceOf(driven_->outcome); }
  /// Voxels of 0.1 m: far away, at (0.05, 0.05, 0.25), and so many beside each other in the plane z = 0.35.
  void giveMap(double stamp_s, int count) {
    std::vector<OccupiedLeaf> leaves = voxelsOfBox({0, 0, 3}, {count, 1, 4});
    leaves.insert(leaves.end(), {voxelAt(100, 100, 100), voxelAt(0, 0, 2)});
    LoadedMap loaded;
    loaded.surface = VoxelSurface::build(0.1, std::move(leaves));
    loaded.stamp_ns = static_cast<StampNs>(stamp_s * 1e9);
    pipeline().setMap(std::move(loaded), 0);
  }
  double heightOf(std::size_t body) const { return driven_->outcome.step->bodies.at(body).t1->front().z(); }
  MonitorPipeline& pipeline() { return driven_->pipeline; }

  std::unique_ptr<Driven> driven_;
};

// Which bodies there are, and what carries them, is part of what a promise rests on.
TEST_F(Attached, APromiseIsVoidOnceSomethingIsTakenLetGoOrForgotten) {
  start(robotScene("", "effects: {octomap: 'off'}, max_speed_m_s: 5"));
  feed(1, 0, 0.8f);
  double stamp_s = 1;
  const auto expectVoid = [&](const std::string& why, const std::function<void()>& change) {
    feed(stamp_s += 0.1, 0, 0.8f);
    ASSERT_TRUE(pipeline().promises().promise().isPromise()) << pipeline().promises().promise().reason;
    const std::uint64_t broken = pipeline().promises().counts().broken;
    EXPECT_EQ(pipeline().takeVoided(), "");
    change();
    EXPECT_TRUE(pipeline().promises().isRevoked()) << why;
    EXPECT_EQ(pipeline().promises().promise().reason, why);
    EXPECT_EQ(pipeline().takeVoided(), why) << "what ~state says, too";
    feed(stamp_s += 0.1, 0, 0.8f);
    EXPECT_EQ(pipeline().promises().broken(), why);
    EXPECT_EQ(pipeline().promises().counts().broken, broken + 1);
  };
  expectVoid("object 'plate' was attached", [&] { attach(plate()); });
  expectVoid("object 'plate' was detached", [&] { pipeline().detach("plate"); });
  expectVoid("object 'plate' was removed", [&] { pipeline().remove("plate"); });
  expectVoid("parameter d is another one than at the start; restart the monitor, which watches the robot of then",
             [&] { pipeline().robotChanged({"d"}), pipeline().robotChanged({}); });
}

// A tray that nobody slows down carried a cup that was taken for as slow as the cloth.
TEST_F(Attached, WhatIsCarriedIsAsFastAsWhatCarriesIt) {
  const std::string file = (folder_ / "tray.obj").string();
  std::ofstream(file) << "v 0.2 0.2 0\nv 0.21 0.2 0.05\nv 0.2 0.21 0.05\nf 1 2 3\n";
  start(robotScene("",
                   "effects: {octomap: 'off'}, max_speed_m_s: 0.5, bodies: {cloth: {topic: cloth}, tray: {"
                   "max_speed_m_s: 2.0, slows_down: false, rigid: {frame: tool, mesh: " +
                       file + "}}}"));
  feed(1, 0, 0.8f);
  Request request = plate();
  request.link = "tray";
  attach(request);
  EXPECT_EQ(pipeline().speedBounds().back().max_m_s, 2);
  EXPECT_FALSE(pipeline().speedBounds().back().slows_down);
  feed(1.1, 0, 0.8f);
  pipeline().detach("plate");
  EXPECT_EQ(pipeline().speedBounds().back().max_m_s, 2) << "until it is let go in a step";
  feed(1.2, 0, 0.8f);
  EXPECT_EQ(pipeline().speedBounds().back().max_m_s, 0.5);
  EXPECT_TRUE(pipeline().speedBounds().back().slows_down);
}

// Frames that were on their way when it was let go show it held.
TEST_F(Attached, StepsThatBeganBeforeTheCallProveNothing) {
  start();
  feed(1, 0, 0.8f);
  attach(plate());
  feed(1.1, 0, 0.8f);
  ASSERT_TRUE((feed(1.2, 0, 0.8f), said().clear())) << describe(said());
  pipeline().callsComeAt(1'450'000'000);
  pipeline().detach("plate");
  for (const double stamp_s : {1.3, 1.4, 1.5, 1.6, 1.7}) {
    feed(stamp_s, 0, 0.8f);
    EXPECT_EQ(said().clear(), stamp_s > 1.55) << stamp_s << " " << describe(said());
    if (!said().clear()) EXPECT_TRUE(says(said().missing, "after this step began object 'plate' was detached"));
  }
}

// The time of the call is not known before /clock, nor are stamps of its time: a frame that waits then is of before.
TEST_F(Attached, StepsThatWaitAtACallOfAnUnknownTimeProveNothing) {
  start();
  feed(100, 0, 0.8f);
  attach(plate());
  feed(100.1, 0, 0.8f);
  ASSERT_TRUE((feed(100.2, 0, 0.8f), said().clear())) << describe(said());
  const ros::Time stamp(100.3);
  driven_->tell({above("palm", -9, stamp), above("tool", 0, stamp)});
  driven_->take(0, cloud(100.3, 0.8f));
  pipeline().remove("plate");
  ASSERT_TRUE(pipeline().nextOutcome(0, driven_->outcome));
  EXPECT_TRUE(says(said().missing, "after this step began object 'plate' was removed")) << describe(said());
  EXPECT_TRUE((feed(100.4, 0, 0.8f), said().clear())) << describe(said());
}

// The hand rises at 1 m/s, and tf is late: its newest transform at the call is not where it opens.
TEST_F(Attached, WhatIsLetGoStaysWhereItsLinkWasAtTheCall) {
  start();
  feed(1, 0, 0.8f);
  attach(plate());
  feed(1.1, 0, 0.8f);
  pipeline().callsComeAt(1'250'000'000);
  pipeline().detach("plate");
  feed(1.2, 0.1, 0.8f);
  EXPECT_NEAR(heightOf(2), 0.6, 2e-3) << "still held";
  driven_->feed(1.3, 0.8f);
  EXPECT_FALSE(said().proved) << "tf has not come so far";
  for (const auto& [at, tool_z] : {std::pair(1.4, 0.3), std::pair(1.5, 0.4)}) {
    feed(at, tool_z, 0.8f);
    EXPECT_NEAR(heightOf(2), 0.65, 2e-3) << at;
  }
  EXPECT_TRUE(said().clear()) << describe(said());
}

// The cloth hangs through the palm all the while.
TEST_F(Attached, OtherBodiesLoseNoStepAndNoPatchByIt) {
  start();
  double stamp_s = 1;
  const auto feedNext = [&](float cloth_z) {
    const ros::Time stamp(stamp_s += 0.1);
    driven_->tell({above("palm", 0, stamp), above("tool", 1, stamp)});
    driven_->feed(stamp_s, cloth_z, {}, "world", 0.01f);
  };
  feedNext(0.1f);
  feedNext(-0.01f);
  const Outcome before = driven_->outcome;
  ASSERT_EQ(before.patches.size(), 1u) << describe(said());
  std::uint64_t sequence = before.sequence;
  const auto expectGoesOn = [&](const std::string& call, const std::function<void()>& change) {
    pipeline().callsComeAt(static_cast<StampNs>((stamp_s + 0.05) * 1e9));
    change();
    for (const bool is_seam : {true, false}) {
      feedNext(-0.01f);
      const Outcome& after = driven_->outcome;
      EXPECT_TRUE(after.answered && after.sequence == ++sequence) << call << ": " << after.reason;
      EXPECT_TRUE(after.claim.isCovered()) << call << ": all pairs were looked at";
      EXPECT_EQ(said().proved, !is_seam) << call << ": " << describe(said());
      EXPECT_EQ(said().touching, Touching::LASTING) << call;
      for (const std::string& why : said().missing) EXPECT_TRUE(mentions(why, "'plate'")) << why;
      ASSERT_EQ(after.patches.size(), 1u) << call;
      EXPECT_EQ(after.patches[0].id, before.patches[0].id) << call;
      EXPECT_EQ(after.patches[0].began_from_ns, before.patches[0].began_from_ns) << call;
      EXPECT_TRUE(after.patch_events.empty()) << call;
    }
  };
  expectGoesOn("attach", [&] { attach(plate()); });
  expectGoesOn("detach", [&] { pipeline().detach("plate"); });
  expectGoesOn("remove", [&] { pipeline().remove("plate"); });
}

TEST_F(Attached, ItMovesWithItsLinkAndStaysWhereItIsLetGo) {
  start(robotScene("", "effects: {octomap: 'off', patches: 'off'}"));  // each touch is news
  feed(1, 0, 0.8f);
  ASSERT_TRUE((feed(1.1, 0, 0.8f), said().clear())) << said().missing.front();
  attach(plate());
  feed(1.2, 0.1, 0.8f);
  EXPECT_TRUE(said().clear()) << "answered with it: from 0.5 to 0.6";
  EXPECT_NEAR(heightOf(2), 0.6, 2e-3);
  EXPECT_NEAR(driven_->outcome.step->bodies[2].t0->front().z(), 0.5, 2e-3) << "where the step begins, too";
  EXPECT_EQ(driven_->outcome.step->bodies[2].name, "plate");
  feed(1.3, 0.35, 0.8f);
  EXPECT_EQ(said().touching, Touching::NEW) << "through the cloth";
  feed(1.4, 0.2, 0.9f);
  pipeline().detach("plate");
  feed(1.5, -0.3, 0.9f);
  EXPECT_NEAR(heightOf(2), 0.7, 2e-3) << "where the tool had it when it was let go";
  feed(1.6, -0.3, 0.65f);
  EXPECT_EQ(said().touching, Touching::NEW) << "an obstacle";
  pipeline().remove("plate");
  feed(1.7, -0.3, 0.9f);
  EXPECT_TRUE(said().clear());
  EXPECT_EQ(joinedText(driven_->outcome.excluded).find("''"), std::string::npos)
      << joinedText(driven_->outcome.excluded);
  attach(plate("another"));
  feed(1.8, 0, 0.9f);
  ASSERT_EQ(driven_->outcome.step->bodies.size(), 3u) << "in the place of the first one";
  EXPECT_EQ(driven_->outcome.step->bodies[2].name, "another");
  EXPECT_TRUE(said().proved);
  const FrameCounters total = pipeline().monitor().total();
  EXPECT_EQ(total.waiting(), 0u) << "every frame is accounted for";
}

// Where the hand was when it opened nobody knows, and nobody will: it was proved as soon as tf was back.
TEST_F(Attached, WhatIsLetGoInTheSilenceOfItsLinkHasNoPlace) {
  for (const int silent : {4, 8}) {
    start();
    feed(1, 0, 0.8f);
    attach(plate());
    feed(1.1, 0, 0.8f);
    double stamp_s = 1.1;
    for (int i = 0; i < silent; ++i) driven_->feed(stamp_s += 0.3, 0.8f);
    pipeline().detach("plate");
    for (int i = 0; i < 5; ++i) feed(stamp_s += 0.1, 0.3, 0.8f);
    EXPECT_EQ(said().proved, silent == 4) << joinedText(said().missing);
    if (said().proved) continue;
    EXPECT_TRUE(says(said().missing,
                     "where body 'plate' was is not known for all of this step (a transform of frame "
                     "'tool' came that cannot be used, or that has it elsewhere at a stamp that it had "
                     "already, or none came for more than 2 s)"))
        << joinedText(said().missing);
    pipeline().remove("plate");
    for (int i = 0; i < 2; ++i) feed(stamp_s += 0.1, 0.3, 0.8f);
    EXPECT_TRUE(said().proved) << joinedText(said().missing);
  }
}

// It rode along with the tracker's camera, from which the fixed frame was learnt, through the cloth.
TEST_F(Attached, WhatIsLetGoInAFixedFrameThatWasLearntAndMovesProvesNothing) {
  start(robotScene("", "effects: {octomap: 'off'}", ""));
  const auto feedAt = [&](double stamp_s, double head_z) {
    const ros::Time stamp(stamp_s);
    driven_->tell({above("palm", -9, stamp), above("tool", 0, stamp), above("head", head_z, stamp)});
    driven_->feed(stamp_s, 0.8f, {}, "head");
  };
  feedAt(1, 0);
  attach(plate());
  feedAt(1.1, 0);
  feedAt(1.2, 0.05);
  EXPECT_TRUE(said().clear()) << "nothing is held in it: " << joinedText(driven_->outcome.missing());
  pipeline().detach("plate");
  feedAt(1.3, 0.05);
  EXPECT_TRUE(says(driven_->outcome.missing(), "the fixed frame 'head' was learnt and moves in 'world'"));
  pipeline().reset(StepStatus::RESET);
  feedAt(1.4, 0.05);
  feedAt(1.5, 0.05);
  EXPECT_FALSE(said().proved) << "where it was let go is not forgotten";
  pipeline().remove("plate");
  feedAt(1.6, 0.05);
  EXPECT_TRUE(said().clear()) << joinedText(driven_->outcome.missing());
}

// The step is one of the bodies that it was answered with, in a recording, too.
TEST_F(Attached, ARecordedStepHasTheBodiesOfThatStep) {
  start();
  feed(1, 0, 0.8f);
  attach(plate());
  for (const auto& [at, tool_z] : {std::pair(1.1, 0.1), std::pair(1.2, 0.35)}) feed(at, tool_z, 0.8f);
  const Outcome with = driven_->outcome;
  ASSERT_FALSE(with.contacts.empty());
  pipeline().remove("plate");
  feed(1.3, 0.1, 0.8f);
  for (const Outcome& outcome : {with, driven_->outcome}) {
    const std::string path = (folder_ / "a.step").string();
    writeRecording(path, {"", *outcome.step, pipeline().monitor().options().detector, true, outcome});
    const StepRecording read = readRecordingFile(path);
    EXPECT_EQ(joinedText(replayStep(read).differences), "");
    EXPECT_EQ(read.step.bodies.size(), 3u);
  }
}

TEST_F(Attached, ContactWithItsLinkIsExpectedWhereLinksMeet) {
  start(robotScene("against_links: true"));
  Request request = plate();
  request.link = "palm";
  request.pose.position.z = 0.3;
  feed(1, 0, 0.8f);
  attach(request);
  feed(1.1, 0, 0.8f);
  EXPECT_TRUE(says(driven_->outcome.expected, "plate with palm")) << joinedText(driven_->outcome.expected);
  pipeline().detach("plate");
  feed(1.2, 0, 0.8f);
  EXPECT_TRUE(driven_->outcome.expected.empty()) << "let go, it is an obstacle";
  request.name = "other";
  request.link = "tool";
  request.touches = {"palm"};
  attach(request);
  feed(1.3, 0, 0.8f);
  EXPECT_TRUE(says(driven_->outcome.expected, "other with palm"));
  start();
  feed(1, 0, 0.8f);
  attach(plate());
  feed(1.1, 0, 0.8f);
  EXPECT_TRUE(driven_->outcome.expected.empty());
  EXPECT_TRUE(says(driven_->outcome.excluded, "what is attached against links and against each other"));
}

TEST_F(Attached, PaddingHoldsForItToo) {
  start(robotScene("padding_m: 0.05"));
  feed(1, 0, 0.8f);
  attach(plate());
  feed(1.1, 0, 0.552f);
  EXPECT_TRUE(said().clear()) << "0.051 m above it";
  feed(1.2, 0, 0.549f);
  EXPECT_EQ(said().touching, Touching::NEW);
  start();
  Request padded = plate();
  padded.padding_m = 0.1;
  EXPECT_NE(refusal(padded).find("needs accuracy = conservative"), std::string::npos) << refusal(padded);
  feed(1, 0, 0.8f);
  feed(1.1, 0, 0.8f);
  EXPECT_TRUE(said().clear()) << "nothing has changed";
}

TEST_F(Attached, WithoutATransformTheStateIsUnprovedAndNamesIt) {
  start();
  feed(1, 0, 0.8f);
  Request request = plate();
  request.link = "palm";
  attach(request);
  driven_->feed(1.1, 0.8f);
  EXPECT_FALSE(said().proved);
  EXPECT_TRUE(says(said().missing, "body 'plate'")) << joinedText(said().missing);
  feed(1.2, 0, 0.8f);
  EXPECT_FALSE(said().proved) << "it was lost when the step began";
  feed(1.3, 0, 0.8f);
  EXPECT_TRUE(said().proved) << joinedText(said().missing);
}

// What a map first shows where it is, is its own; what was an obstacle before stays one.
TEST_F(Attached, ItsVoxelsAreItsOwnUntilItIsRemoved) {
  start(robotScene("", "effects: {octomap: auto}"));
  giveMap(0.9, 0);
  feed(1, -0.15, 0.8f);
  feed(1.1, -0.15, 0.8f);
  attach(plate());
  for (const double at : {1.2, 1.3, 1.4}) feed(at, -0.15, 0.8f);  // at 0.35
  giveMap(1.4, 1);
  feed(1.5, -0.15, 0.8f);
  EXPECT_TRUE(says(driven_->outcome.excluded, "1 voxel of the map as own of body 'plate'"))
      << joinedText(driven_->outcome.excluded);
  EXPECT_TRUE(said().clear()) << joinedText(said().missing);
  const Vec3 voxel(0.05, 0.05, 0.35);
  EXPECT_EQ(driven_->outcome.obstacle->leafAt(voxel), nullptr);
  pipeline().remove("plate");
  giveMap(1.5, 1);
  feed(1.6, -0.15, 0.8f);
  EXPECT_FALSE(says(driven_->outcome.excluded, "own of")) << joinedText(driven_->outcome.excluded);
  EXPECT_NE(driven_->outcome.obstacle->leafAt(voxel), nullptr) << "nobody accounts for it any more";
}

// A mesh in millimetres, or a frame that is elsewhere, could cut anything out of the map.
TEST_F(Attached, WhereMoreVoxelsAreOwnThanMayBeNothingIsProved) {
  start(robotScene("max_own_voxels: 2", "effects: {octomap: auto}"));
  giveMap(0.9, 0);
  attach(plate());
  for (const double at : {1.0, 1.1, 1.2}) feed(at, -0.15, 0.8f);
  giveMap(1.2, 2);
  feed(1.3, -0.15, 0.8f);
  EXPECT_TRUE(said().clear()) << joinedText(said().missing);
  giveMap(1.3, 3);
  feed(1.4, -0.15, 0.8f);
  const char sentence[] = "3 voxels of the map are own of the robot and what it holds, and robot/max_own_voxels is 2;";
  EXPECT_TRUE(says(said().missing, sentence)) << joinedText(said().missing);
  EXPECT_TRUE(says(pipeline().checkNow(0).missing(), sentence));
  EXPECT_EQ(said().touching, Touching::NONE) << "and no alarm";
  giveMap(1.4, 2);
  feed(1.5, -0.15, 0.8f);
  EXPECT_TRUE(said().clear()) << joinedText(said().missing);
}

TEST_F(Attached, ItSurvivesAResetAndComesBeforeTheFirstFrame) {
  start();
  attach(plate());
  EXPECT_THROW(pipeline().detach("plate"), ParameterError) << "nobody knows the fixed frame's transforms";
  feed(1, 0, 0.8f);
  feed(1.1, 0, 0.8f);
  EXPECT_TRUE(said().clear()) << joinedText(said().missing);
  pipeline().reset(StepStatus::RESET);
  attach(plate("more"));
  feed(1.2, 0, 0.8f);
  feed(1.3, 0.35, 0.8f);
  EXPECT_EQ(said().touching, Touching::NEW);
  EXPECT_EQ(driven_->outcome.step->bodies.size(), 4u);
}

TEST_F(Attached, SurfacesOfEachKindAreWhereTheyShouldBe) {
  std::ofstream(folder_ / "wedge.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  start();
  Request file = plate();
  file.primitive = {};
  file.mesh = (folder_ / "wedge.obj").string();
  file.scale.x = 2;
  file.scale.y = -1;  // mirrored
  file.scale.z = 0.5;
  file.pose.orientation.w = file.pose.orientation.z = std::sqrt(0.5);  // a quarter turn to the left
  Request message = file;
  message.mesh.clear();
  message.triangles.vertices.resize(4);
  message.triangles.vertices[1].x = message.triangles.vertices[2].y = message.triangles.vertices[3].z = 1;
  for (const auto& face : {std::array<std::uint32_t, 3>{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}) {
    std::copy(face.begin(), face.end(), message.triangles.triangles.emplace_back().vertex_indices.begin());
  }
  for (const Request& request : {file, message}) {
    const Positions x = readAttach(request, pipeline().config()).mesh->positions;
    ASSERT_EQ(x.size(), 4u);
    EXPECT_LT((x[0] - Vec3(0, 0, 0.5)).norm(), 1e-12);
    EXPECT_LT((x[1] - Vec3(0, 2, 0.5)).norm(), 1e-12);
    EXPECT_LT((x[2] - Vec3(1, 0, 0.5)).norm(), 1e-12);
    EXPECT_LT((x[3] - Vec3(0, 0, 1)).norm(), 1e-12);
  }
  Request round = plate();
  round.primitive.type = shape_msgs::SolidPrimitive::CYLINDER;
  round.primitive.dimensions = {0.4, 0.1};  // height, radius
  double lowest = 9, widest = 0;
  const AttachedObject cylinder = readAttach(round, pipeline().config());
  for (const Vec3& p : cylinder.mesh->positions) {
    lowest = std::min(lowest, p.z());
    widest = std::max(widest, p.head<2>().norm());
  }
  EXPECT_NEAR(lowest, 0.3, 1e-9);
  EXPECT_GE(widest, 0.1);
  EXPECT_LE(widest, 0.1 + 1.001e-3);
}

TEST_F(Attached, MistakesAreNamedAndAllStays) {
  start();
  feed(1, 0, 0.8f);
  attach(plate("taken"));
  std::ofstream(folder_ / "empty.stl") << "solid\nendsolid\n";
  std::ofstream(folder_ / "huge.stl");
  std::filesystem::resize_file(folder_ / "huge.stl", std::uintmax_t{1} << 30);  // takes no place
  const double nan = std::nan("");
  const auto meshed = [](Request& r, const std::string& mesh) {
    r.primitive = {};
    r.mesh = mesh;
    r.scale.x = r.scale.y = r.scale.z = 1;
  };
  const std::pair<std::function<void(Request&)>, std::string> cases[] = {
      {[](Request& r) { r.name = ""; }, "object '': name is no name: it is empty"},
      {[](Request& r) { r.name = "taken"; }, "object 'taken' is there already; call ~remove before"},
      {[](Request& r) { r.name = "palm"; }, "object 'palm': name is that of a body or link"},
      {[](Request& r) { r.name = "mesh"; }, "name is that of a body or link"},
      {[](Request& r) { r.name = "octomap"; }, "name is that of a body or link"},
      {[](Request& r) { r.link = "tol"; },
       "link is 'tol', which is no link of a robot and no rigid body; nearest is 'tool'"},
      {[](Request& r) { r.link = "mesh"; }, "link is 'mesh', which is no link"},
      {[](Request& r) { r.touches = {"plam"}; }, "touches names 'plam', which is no link, group or body"},
      {[&](Request& r) { r.pose.position.y = nan; }, "pose/position is   0 nan 0.5; it must be finite"},
      {[&](Request& r) { r.pose.orientation.w = 0; }, "the length of pose/orientation is 0; it must be 1"},
      {[&](Request& r) { r.pose.orientation.x = nan; }, "the length of pose/orientation is nan"},
      {[&](Request& r) { r.padding_m = -1; }, "padding_m is -1; it must be 0 or more"},
      {[&](Request& r) { r.padding_m = nan; }, "padding_m is nan"},
      {[](Request& r) { r.primitive = {}; }, "it has no surface; give one of mesh, triangles and primitive"},
      {[](Request& r) { r.mesh = "a.stl"; }, "it has several surfaces"},
      {[](Request& r) { r.primitive.type = shape_msgs::SolidPrimitive::CONE; }, "primitive/type is 4; known are BOX"},
      {[](Request& r) {
         r.primitive.dimensions = {1, 1};
       },
       "primitive/dimensions has 2 numbers; write the sides"},
      {[](Request& r) { r.primitive.dimensions[1] = 0; }, "a number of primitive/dimensions is 0; write the sides"},
      {[&](Request& r) { r.primitive.dimensions[1] = nan; }, "a number of primitive/dimensions is nan"},
      {[&](Request& r) { meshed(r, "/no/such.stl"); }, "mesh /no/such.stl"},
      {[&](Request& r) { meshed(r, "package://no_such/a.stl"); }, "there is no package 'no_such'"},
      {[&](Request& r) { meshed(r, (folder_ / "empty.stl").string()); }, "empty.stl"},
      {[&](Request& r) { meshed(r, (folder_ / "huge.stl").string()); }, "huge.stl has 1024 MiB; simplify it to 32"},
      {[&](Request& r) { (meshed(r, "a.stl"), r.scale.y = 0); }, "scale is 1 0 1; it must be finite and not 0"},
      {[&](Request& r) { (meshed(r, "a.stl"), r.scale.y = nan); }, "scale is   1 nan   1"},
      {[&](Request& r) { (meshed(r, ""), r.triangles.triangles.resize(1)); }, "triangles names vertex 0 of 0"},
      {[&](Request& r) { (meshed(r, ""), r.triangles.vertices.resize(1)); }, "triangles has no triangle"},
  };
  for (const auto& [spoil, expected] : cases) {
    Request request = plate();
    spoil(request);
    const std::string said = refusal(request);
    EXPECT_TRUE(mentions(said, expected)) << said;
    EXPECT_EQ(said.find('\n'), std::string::npos) << said;
  }
  for (const char* name : {"plate", ""}) {
    EXPECT_THROW(pipeline().detach(name), ParameterError);
    EXPECT_THROW(pipeline().remove(name), ParameterError);
  }
  pipeline().detach("taken");
  EXPECT_THROW(pipeline().detach("taken"), ParameterError) << "twice";
  for (int i = 0; i < 63; ++i) attach(plate("plate " + std::to_string(i)));
  EXPECT_TRUE(mentions(refusal(plate()), "there are 64 already, which is the most"));
  feed(1.1, 0, 0.8f);
  EXPECT_FALSE(said().proved) << "when it was let go nobody says";
  feed(1.2, 0, 0.8f);
  EXPECT_TRUE(said().clear()) << joinedText(said().missing);
}

}  // namespace
}  // namespace test
}  // namespace dccd
