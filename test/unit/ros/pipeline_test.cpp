// The pipeline that the node and analyze_bag share, driven by messages as bytes: unknown space, tracker noise, and
// files.
#include "node/monitor_pipeline.h"

#include <geometry_msgs/TransformStamped.h>
#include <gtest/gtest.h>
#include <octomap/OcTree.h>
#include <octomap_msgs/Octomap.h>
#include <sensor_msgs/PointCloud2.h>
#include <visualization_msgs/Marker.h>

#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <sstream>
#include <thread>

#include "dccd/assurance.h"
#include "node/map_loader.h"

namespace dccd {
namespace {

using XmlRpc::XmlRpcValue;

template <typename Message>
std::vector<std::uint8_t> bytesOf(const Message& message) {
  std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(message));
  ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(stream, message);
  return bytes;
}

/// 2 x 2 points, 0.1 m apart, first corner at (0.15, 0.15, z), each point `tilt` above the one before; the field sigma
/// where wanted.
std::vector<std::uint8_t> cloud(double stamp_s, float z, const std::vector<float>& sigma = {},
                                const std::string& frame = "world", float tilt = 0) {
  sensor_msgs::PointCloud2 out;
  out.header.stamp = ros::Time(stamp_s);
  out.header.frame_id = frame;
  out.height = out.width = 2;
  for (const char* name : {"x", "y", "z", "sigma"}) {
    if (sigma.empty() && std::string(name) == "sigma") continue;
    sensor_msgs::PointField field;
    field.name = name;
    field.offset = static_cast<std::uint32_t>(4 * out.fields.size());
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    out.fields.push_back(field);
  }
  out.point_step = 16;
  out.row_step = 32;
  out.data.resize(64);
  for (std::size_t i = 0; i < 4; ++i) {
    const float p[4] = {0.15f + 0.1f * static_cast<float>(i % 2), 0.15f + 0.1f * static_cast<float>(i / 2),
                        z + tilt * static_cast<float>(i), sigma.empty() ? 0 : sigma[i]};
    std::memcpy(out.data.data() + 16 * i, p, 16);
  }
  return bytesOf(out);
}

/// Occupied below 0, free up to 0.2, unknown from there on; 0.1 m voxels over 0.5 m x 0.5 m.
std::vector<std::uint8_t> map(double stamp_s) {
  octomap_msgs::Octomap out;
  out.header.stamp = ros::Time(stamp_s);
  out.header.frame_id = "world";
  out.binary = true;
  out.id = "OcTree";
  out.resolution = 0.1;
  octomap::OcTree tree(0.1);
  for (int x = 0; x < 5; ++x) {
    for (int y = 0; y < 5; ++y) {
      for (int z = -2; z < 2; ++z) tree.updateNode(0.1 * x + 0.05, 0.1 * y + 0.05, 0.1 * z + 0.05, z < 0);
    }
  }
  std::ostringstream stream;
  tree.writeBinaryData(stream);
  const std::string bytes = stream.str();
  out.data.assign(bytes.begin(), bytes.end());
  return bytesOf(out);
}

struct Driven {
  tf2::BufferCore transforms;
  MonitorConfig config;
  MonitorPipeline pipeline;
  Outcome outcome;

  explicit Driven(const XmlRpcValue& tree) : config(readConfig(tree)), pipeline(config, transforms) {}

  void giveMap(double stamp_s) {
    LoadedMap loaded = decodeMapMessage(map(stamp_s), config);
    EXPECT_EQ(loaded.problem, "");
    pipeline.setMap(std::move(loaded), 0);
  }
  /// The frame `child`, at all times `z` above the world.
  void raise(const std::string& child, double z) {
    geometry_msgs::TransformStamped transform;
    transform.header.frame_id = "world";
    transform.child_frame_id = child;
    transform.transform.translation.z = z;
    transform.transform.rotation.w = 1;
    transforms.setTransform(transform, "test", true);
  }
  const Outcome& feed(double stamp_s, float z, const std::vector<float>& sigma = {}, const std::string& frame = "world",
                      float tilt = 0) {
    pipeline.take(0, {"sensor_msgs/PointCloud2", cloud(stamp_s, z, sigma, frame, tilt), 0, 0});
    EXPECT_TRUE(pipeline.nextOutcome(0, outcome));
    return outcome;
  }
};

XmlRpcValue scene() {
  XmlRpcValue tree;
  tree["fixed_frame"] = "world";
  tree["max_vertex_step_m"] = 0.0;
  return tree;
}

TEST(UnknownSpace, FreeIsWhatNobodyAskedAbout) {
  Driven free(scene());
  EXPECT_EQ(decodeMapMessage(map(1), free.config).known, nullptr) << "nothing is built of it";
  free.giveMap(1);
  free.feed(1, 0.35f);
  const Outcome& outcome = free.feed(1.1, 0.15f);
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  EXPECT_TRUE(assuranceOf(outcome).clear()) << "the unknown is no obstacle";
  EXPECT_EQ(outcome.unknown_fraction, 0);
  EXPECT_EQ(outcome.stats[Effect::UNKNOWN_SPACE].in, 0u);
  EXPECT_FALSE(free.pipeline.effects().plan().running(Effect::UNKNOWN_SPACE));
}

TEST(UnknownSpace, ReportGivesItsShareOfWhatIsSwept) {
  XmlRpcValue tree = scene();
  tree["unknown_space"] = "report";
  Driven report(tree);
  report.giveMap(1);
  report.feed(1, 0.35f);
  // Swept: 2 x 2 columns of voxels, z from 0.1 to 0.4; the upper two of three are unknown.
  const Outcome& outcome = report.feed(1.1, 0.15f);
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  EXPECT_TRUE(assuranceOf(outcome).clear()) << "reported, and no obstacle";
  EXPECT_EQ(outcome.stats[Effect::UNKNOWN_SPACE].in, 12u);
  EXPECT_EQ(outcome.stats[Effect::UNKNOWN_SPACE].out, 8u);
  EXPECT_NEAR(outcome.unknown_fraction, 2.0 / 3, 1e-12);
  EXPECT_EQ(report.feed(1.2, 0.12f).unknown_fraction, 0) << "within what is known";
  EXPECT_TRUE(report.pipeline.effects().plan().running(Effect::UNKNOWN_SPACE));
}

TEST(UnknownSpace, AShareOfAPartIsNotGivenOut) {
  XmlRpcValue tree = scene();
  tree["unknown_space"] = "report";
  tree["max_step_s"] = 10.0;
  Driven report(tree);
  report.giveMap(1);
  const auto spread = [&](double stamp_s, float reach) {
    auto bytes = cloud(stamp_s, 0.35f);
    const float far[3] = {reach, reach, reach};
    std::memcpy(bytes.data() + bytes.size() - 1 - 16, far, sizeof far);  // the last point; is_dense follows
    report.pipeline.take(0, {"sensor_msgs/PointCloud2", bytes, 0, 0});
    EXPECT_TRUE(report.pipeline.nextOutcome(0, report.outcome));
  };
  spread(1, 0.5f);
  spread(1.1, 2000);  // across 5000 blocks of voxels an axis
  ASSERT_TRUE(report.outcome.answered) << report.outcome.reason;
  EXPECT_TRUE(std::isnan(report.outcome.unknown_fraction)) << report.outcome.unknown_fraction;
  spread(1.2, 2000);
  spread(1.3, 0.5f);
  spread(1.4, 0.5f);
  EXPECT_GT(report.outcome.unknown_fraction, 0) << "and is there again as soon as all is counted";
}

TEST(UnknownSpace, MaskedVerticesSweepNothing) {
  XmlRpcValue tree = scene();
  tree["unknown_space"] = "report";
  tree["vertex_mask"][0] = 0;  // of the two triangles of the grid one is left, or none
  Driven masked(tree);
  masked.giveMap(1);
  masked.feed(1, 0.35f);
  const std::uint64_t some = masked.feed(1.1, 0.15f).stats[Effect::UNKNOWN_SPACE].in;
  EXPECT_LE(some, 12u);
  for (int v = 0; v < 4; ++v) tree["vertex_mask"][v] = v;
  Driven all(tree);
  all.giveMap(1);
  all.feed(1, 0.35f);
  EXPECT_EQ(all.feed(1.1, 0.15f).stats[Effect::UNKNOWN_SPACE].in, 0u);
  EXPECT_EQ(all.outcome.unknown_fraction, 0);
}

TEST(UnknownSpace, OccupiedIsAnObstacleWithinItsBox) {
  XmlRpcValue tree = scene();
  tree["unknown_space"] = "occupied";
  const double box[6] = {0, 0, 0, 0.5, 0.5, 0.6};
  for (int i = 0; i < 6; ++i) tree["unknown_box"][i] = box[i];
  Driven occupied(tree);
  occupied.giveMap(1);
  occupied.feed(1, 0.12f);
  const Outcome& outcome = occupied.feed(1.1, 0.28f);
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  ASSERT_FALSE(outcome.contacts.empty()) << "from the known into the unknown";
  EXPECT_NEAR(outcome.earliest_toc, 0.5, 1e-4);
}

TEST(UnknownSpace, AnOldMapIsNoMap) {
  XmlRpcValue tree = scene();
  tree["octomap_timeout_s"] = 1.0;
  tree["unknown_space"] = "report";
  Driven old(tree);
  old.giveMap(1);
  old.feed(1.8, 0.12f);
  EXPECT_EQ(old.feed(1.9, 0.13f).status, StepStatus::OK);
  const Outcome& late = old.feed(2.1, 0.14f);
  EXPECT_EQ(late.status, StepStatus::NO_MAP);
  EXPECT_NE(late.reason.find("octomap_timeout_s"), std::string::npos) << late.reason;
  EXPECT_EQ(late.unknown_fraction, 0) << "of no map nothing is unknown";
}

TEST(Map, OneThatIsNamedIsMissedFromTheFirstStepOn) {
  XmlRpcValue tree = scene();
  tree["octomap_topic"] = "/table";
  Driven named(tree);
  named.feed(1, 0.35f);
  EXPECT_EQ(named.feed(1.1, 0.34f).status, StepStatus::NO_MAP);
  EXPECT_FALSE(assuranceOf(named.outcome).proved);
  named.giveMap(1);
  EXPECT_EQ(named.feed(1.2, 0.33f).status, StepStatus::OK) << named.outcome.reason;
  Driven unnamed(scene());
  unnamed.feed(1, 0.35f);
  EXPECT_TRUE(assuranceOf(unnamed.feed(1.1, 0.34f)).clear()) << "nobody called for one";
}

TEST(Map, ARefusedMessageMakesTheMapInUseVoid) {
  XmlRpcValue tree = scene();
  tree["max_map_mb"] = 1;
  Driven driven(tree);
  MapLoader loader(driven.config, [] {});
  const auto take = [&] {
    LoadedMap loaded;
    while (!loader.take(loaded)) std::this_thread::yield();
    driven.pipeline.setMap(std::move(loaded), 0);
  };
  double stamp_s = 1;
  driven.feed(stamp_s, 0.35f);
  const std::pair<std::string, std::size_t> refusals[] = {{"std_msgs/Bool", 1},
                                                          {"octomap_msgs/Octomap", std::size_t{2} << 20}};
  for (const auto& [datatype, size] : refusals) {
    loader.submit(map(1), 0);
    take();
    EXPECT_EQ(driven.feed(stamp_s += 0.1, 0.35f).status, StepStatus::OK) << driven.outcome.reason;
    const std::string problem = mapMessageProblem(datatype, "*", size, driven.config);
    ASSERT_FALSE(problem.empty()) << datatype;
    loader.refuse(problem);
    take();
    EXPECT_EQ(driven.feed(stamp_s += 0.1, 0.35f).status, StepStatus::NO_MAP) << datatype << ", " << size << " bytes";
    EXPECT_NE(driven.outcome.reason.find(problem), std::string::npos) << driven.outcome.reason;
  }
  EXPECT_EQ(loader.received(), 4u);
  EXPECT_EQ(loader.refused(), 2u);
  EXPECT_EQ(mapMessageProblem("octomap_msgs/Octomap", "*", std::size_t{1} << 17, driven.config), "");
}

TEST(Map, OneFromTheFutureIsNoMap) {
  XmlRpcValue tree = scene();
  tree["octomap_timeout_s"] = 1.0;
  Driven early(tree);
  early.giveMap(2.25);
  early.feed(1, 0.35f);
  EXPECT_EQ(early.feed(1.2, 0.35f).status, StepStatus::NO_MAP);
  EXPECT_NE(early.outcome.reason.find("1.05 s after the end of the step, more than octomap_timeout_s"),
            std::string::npos)
      << early.outcome.reason;
  EXPECT_EQ(early.feed(1.3, 0.35f).status, StepStatus::OK) << early.outcome.reason;
}

TEST(TrackerNoise, ComesFromThePointField) {
  XmlRpcValue tree = scene();
  tree["uncertainty"]["field"] = "sigma";
  tree["uncertainty"]["scale"] = 3.0;
  Driven noisy(tree);
  noisy.giveMap(1);
  EXPECT_TRUE(noisy.pipeline.effects().plan().running(Effect::TRACKER_NOISE));
  noisy.feed(1, 0.17f, {0, 0, 0, 0});
  EXPECT_TRUE(assuranceOf(noisy.feed(1.1, 0.15f, {0, 0, 0, 0})).clear()) << "15 cm above the map";
  // One vertex known to 3 x 0.04 m: down to 0.1 m above the map it may touch; the features at it too, no others.
  const Outcome& outcome = noisy.feed(1.2, 0.10f, {0, 0, 0.04f, 0});
  ASSERT_FALSE(outcome.contacts.empty());
  for (const Contact& c : outcome.contacts) {
    EXPECT_TRUE(std::count(c.vertex.begin(), c.vertex.end(), 2u)) << "feature without the uncertain vertex";
  }
  EXPECT_LE(outcome.earliest_toc, 0.6 + 1e-6);
  EXPECT_NEAR(outcome.earliest_toc, 0.6, 1e-3);
  EXPECT_GT(outcome.stats[Effect::TRACKER_NOISE].out, 0u);
  for (const Contact& c : outcome.contacts) {
    EXPECT_EQ(c.body[1], OBSTACLE_BODY) << "neighbours on the mesh are no contacts, however uncertain";
  }
  EXPECT_GT(noisy.pipeline.monitor().leftOut().size(), 0u);
  EXPECT_TRUE(noisy.feed(1.3, 0.13f, {0, 0, 0, 0}).answered);
  EXPECT_TRUE(assuranceOf(noisy.feed(1.4, 0.13f, {0, 0, 0, 0})).clear()) << "as soon as the tracker is sure again";
}

TEST(TrackerNoise, BadFieldsAreRefusedByNameAndValue) {
  XmlRpcValue tree = scene();
  tree["uncertainty"]["field"] = "sigma";
  Driven noisy(tree);
  EXPECT_EQ(noisy.feed(1, 0.2f).status, StepStatus::BAD_MESSAGE);
  EXPECT_NE(noisy.outcome.reason.find("'sigma'"), std::string::npos) << noisy.outcome.reason;
  EXPECT_EQ(noisy.feed(1.1, 0.2f, {0, -1, 0, 0}).status, StepStatus::BAD_MESSAGE);
  EXPECT_NE(noisy.outcome.reason.find("of point 1 is -1"), std::string::npos) << noisy.outcome.reason;
  EXPECT_EQ(noisy.feed(1.2, 0.2f, {0, 0, NAN, 0}).status, StepStatus::BAD_MESSAGE);
  EXPECT_EQ(noisy.feed(1.3, 0.2f, {0, 0, 0, 0}).status, StepStatus::FIRST_FRAME) << "and nothing is lost";
}

TEST(TrackerNoise, ANumberHoldsForAllVertices) {
  XmlRpcValue tree = scene();
  tree["uncertainty"]["radius_m"] = 0.12;
  Driven noisy(tree);
  noisy.giveMap(1);
  noisy.feed(1, 0.17f);
  EXPECT_NEAR(noisy.feed(1.1, 0.07f).earliest_toc, 0.5, 1e-3);
}

TEST(FixedFrame, OneThatWasLearntIsLearntAnewAfterAReset) {
  XmlRpcValue tree;
  tree["max_vertex_step_m"] = 0.0;
  Driven learnt(tree);
  learnt.raise("camera", 0.1);
  learnt.giveMap(1);
  learnt.feed(1, 0.25f, {}, "camera");
  learnt.pipeline.reset(StepStatus::RESET);
  learnt.feed(2, 0.35f);
  const Outcome& outcome = learnt.feed(2.1, -0.05f);
  EXPECT_EQ(learnt.pipeline.fixedFrame(), "world");
  EXPECT_NEAR(outcome.earliest_toc, 0.875, 1e-4) << "the map is where it was, 0.35 m below the mesh";
}

TEST(FixedFrame, OneInWhichNothingWasAnsweredGivesWay) {
  XmlRpcValue tree;
  tree["max_vertex_step_m"] = 0.0;
  tree["transform_timeout_s"] = 0.0;
  Driven learnt(tree);
  learnt.giveMap(1);
  learnt.feed(1, 0.25f, {}, "nowhere");
  EXPECT_EQ(learnt.pipeline.fixedFrame(), "nowhere");
  EXPECT_EQ(learnt.feed(1.1, 0.35f).status, StepStatus::NO_TRANSFORM);
  EXPECT_NE(learnt.outcome.reason.find("from 'world' to 'nowhere'"), std::string::npos) << learnt.outcome.reason;
  EXPECT_EQ(learnt.feed(1.2, 0.35f).status, StepStatus::FIRST_FRAME);
  const Outcome& outcome = learnt.feed(1.3, -0.05f);
  EXPECT_NEAR(outcome.earliest_toc, 0.875, 1e-4) << "the map has its place in the new one";
  // From the first answer on it stays.
  EXPECT_EQ(learnt.feed(1.4, 0.25f, {}, "nowhere").status, StepStatus::NO_TRANSFORM);
  EXPECT_EQ(learnt.feed(1.5, 0.25f, {}, "nowhere").status, StepStatus::NO_TRANSFORM);
  EXPECT_EQ(learnt.pipeline.fixedFrame(), "world");
  EXPECT_EQ(learnt.pipeline.monitor().total().waiting(), 0u);
}

TEST(FrameNames, OnesThatTf2DoesNotTakeAreRefusedInFewWords) {
  Driven driven(scene());
  driven.giveMap(1);
  driven.feed(1, 0.35f);
  for (const std::string& name : {std::string("//cam"), std::string("/"), std::string(10000000, 'x')}) {
    EXPECT_EQ(driven.feed(1.1, 0.35f, {}, name).status, StepStatus::BAD_MESSAGE);
    EXPECT_LT(driven.outcome.reason.size(), 400u);
  }
  EXPECT_EQ(driven.feed(1.2, -0.05f, {}, "/world").status, StepStatus::OK) << "one slash was tf's own way";
}

TEST(VertexMask, BeyondTheMeshIsNoStepAtAll) {
  XmlRpcValue tree = scene();
  tree["vertex_mask"][0] = 4;
  Driven masked(tree);
  EXPECT_EQ(masked.feed(1, 0.35f).status, StepStatus::VERTEX_COUNT);
  EXPECT_EQ(masked.outcome.reason, "parameter vertex_mask of body 'mesh' names vertex 4, but the mesh has 4");
}

XmlRpcValue expecting(const std::string& phase = "") {
  XmlRpcValue tree = scene();
  XmlRpcValue entry;
  entry["between"][0] = "mesh";
  entry["between"][1] = "octomap";
  if (!phase.empty()) entry["phase"] = phase;
  tree["expected_contacts"][0] = entry;
  return tree;
}

std::string refusalOf(const XmlRpcValue& tree) {
  try {
    Driven refused(tree);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "nothing was refused";
}

TEST(ExpectedContacts, BeyondTheMeshAreNoStepAtAll) {
  XmlRpcValue tree = expecting("carry");  // also where the phase is another one
  tree["topology"]["sets"]["hem"][0] = 9;
  tree["expected_contacts"][0]["vertices"]["mesh"] = "hem";
  Driven driven(tree);
  EXPECT_EQ(driven.feed(1, 0.35f).status, StepStatus::VERTEX_COUNT);
  EXPECT_EQ(driven.outcome.reason,
            "parameter expected_contacts[0]/vertices (set 'hem') of body 'mesh' names vertex 9, but the mesh has 4");
  EXPECT_EQ(driven.feed(1.1, 0.35f).status, StepStatus::VERTEX_COUNT) << "and again";
  EXPECT_EQ(driven.pipeline.monitor().total().of(StepStatus::VERTEX_COUNT), 2u) << "counted";
}

TEST(ExpectedContacts, OfAFileAreCheckedAtTheStart) {
  const std::string file = ::testing::TempDir() + "expected.obj";
  std::ofstream(file) << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\ng hem seam\nf 2 4 3\ng empty\n";
  XmlRpcValue tree = expecting();
  tree["topology"]["file"] = file;
  tree["expected_contacts"][0]["vertices"]["mesh"] = "hem";
  Driven driven(tree);
  EXPECT_EQ(driven.pipeline.monitor().options().detector.expected.at(0).partners[0].vertices,
            (std::vector<Index>{1, 2, 3}));
  tree["expected_contacts"][0]["vertices"]["mesh"] = "ham";
  EXPECT_EQ(refusalOf(tree),
            "parameter expected_contacts[0]/vertices names 'ham', which is no set of body 'mesh'; it has 'empty', "
            "'hem', 'seam'");
  tree["expected_contacts"][0]["vertices"]["mesh"] = "empty";
  EXPECT_NE(refusalOf(tree).find("a group without faces"), std::string::npos) << refusalOf(tree);
  tree["topology"]["sets"]["hem"][0] = 1;
  EXPECT_NE(refusalOf(tree).find("topology/sets/hem"), std::string::npos) << refusalOf(tree);
  XmlRpcValue beyond = expecting();
  beyond["topology"]["file"] = file;
  beyond["expected_contacts"][0]["vertices"]["mesh"][0] = 4;
  EXPECT_EQ(refusalOf(beyond),
            "parameter expected_contacts[0]/vertices of body 'mesh' names vertex 4, but the mesh has 4");
  std::remove(file.c_str());
}

TEST(ExpectedContacts, APhaseIsOnFromTheNextStepAndStaysOverAReset) {
  Driven driven(expecting("carry"));
  driven.giveMap(1);
  driven.feed(1, 0.35f);
  EXPECT_EQ(driven.feed(1.1, -0.05f).touching, Touching::NEW);
  EXPECT_EQ(driven.pipeline.phaseInWords(), "no phase, no contact is expected");
  try {
    driven.pipeline.setPhase("fold");
    ADD_FAILURE() << "unknown";
  } catch (const ParameterError& error) {
    EXPECT_EQ(std::string(error.what()), "phase 'fold' is unknown; known phases are 'carry', and '' for none");
  }
  driven.pipeline.setPhase("carry");
  EXPECT_EQ(driven.pipeline.phaseInWords(), "phase 'carry', expected: mesh with the map in phase 'carry'");
  EXPECT_EQ(driven.feed(1.2, -0.15f).touching, Touching::EXPECTED);
  EXPECT_EQ(driven.outcome.expected, std::vector<std::string>{"mesh with the map in phase 'carry'"});
  driven.pipeline.reconfigure([](MonitorOptions& options, MarkerConfig&) { options.detector.max_contacts = 1; });
  driven.pipeline.reset(StepStatus::RESET);
  driven.feed(2, 0.35f);
  EXPECT_EQ(driven.feed(2.1, -0.05f).touching, Touching::EXPECTED);
  driven.pipeline.setPhase("");
  EXPECT_EQ(driven.feed(2.2, -0.15f).touching, Touching::LASTING);
}

TEST(EarliestOnly, TheFirstContactsAloneAndNoPatches) {
  XmlRpcValue tree = scene();
  Driven all(tree);
  tree["earliest_only"] = true;
  Driven first(tree);
  for (Driven* driven : {&all, &first}) {
    driven->giveMap(1);
    driven->feed(1, 0.35f, {}, "world", 0.03f);  // one corner after another arrives
    driven->feed(1.1, -0.25f, {}, "world", 0.03f);
    ASSERT_EQ(driven->outcome.status, StepStatus::OK);
  }
  EXPECT_EQ(all.pipeline.effects().plan().running(Effect::PATCHES), true);
  EXPECT_FALSE(all.outcome.patches.empty());
  EXPECT_FALSE(first.pipeline.effects().plan().running(Effect::PATCHES));
  EXPECT_TRUE(first.outcome.patches.empty());
  EXPECT_EQ(first.outcome.earliest_toc, all.outcome.earliest_toc);
  EXPECT_GT(first.outcome.contacts.size(), 0u);
  EXPECT_LT(first.outcome.contacts.size(), all.outcome.contacts.size());
  EXPECT_EQ(first.outcome.touching, Touching::NEW);
  EXPECT_FALSE(assuranceOf(first.outcome).clear());
  tree["effects"]["patches"] = "on";
  EXPECT_EQ(refusalOf(tree),
            "effects/patches is on, but earliest_only is true, and patches are made of all contacts; or "
            "write effects/patches: auto");
  XmlRpcValue both = expecting();
  both["earliest_only"] = true;
  EXPECT_EQ(refusalOf(both),
            "parameter ~earliest_only is true beside expected_contacts: the first contact may be an "
            "expected one, which would hide all others; remove one of both");
}

TEST(Options, WhatIsReconfiguredIsInForceBesideWhatThePlanDecides) {
  Driven driven(scene());
  driven.giveMap(1);
  driven.feed(1, 0.35f);
  EXPECT_TRUE(driven.pipeline.monitor().options().detector.obstacle_expected) << "a map came";
  driven.pipeline.reconfigure([](MonitorOptions& options, MarkerConfig& markers) {
    options.detector.max_contacts = 1;
    markers.obstacle_m = 2;
  });
  EXPECT_EQ(driven.pipeline.monitor().options().detector.max_contacts, 1u);
  EXPECT_TRUE(driven.pipeline.monitor().options().detector.obstacle_expected) << "the plan's, whatever is reconfigured";
  EXPECT_EQ(driven.pipeline.config().monitor.detector.max_contacts, 1u);
  EXPECT_EQ(driven.pipeline.config().markers.obstacle_m, 2);
  EXPECT_EQ(driven.feed(1.1, -0.05f).status, StepStatus::TRUNCATED);
  const auto another_clock = [](MonitorOptions& options, MarkerConfig& markers) {
    options.detector.max_contacts = 7;
    options.clock_body = 9;
    markers.obstacle_m = 3;
  };
  EXPECT_THROW(driven.pipeline.reconfigure(another_clock), std::invalid_argument);
  EXPECT_EQ(driven.pipeline.config().markers.obstacle_m, 2);
  EXPECT_EQ(driven.pipeline.config().monitor.detector.max_contacts, 1u) << "what is refused changes nothing";
  EXPECT_EQ(driven.pipeline.monitor().options().detector.max_contacts, 1u);
}

constexpr std::int64_t SECOND_NS = 1000000000;

/// A cloth in the world over a static table in a frame of its own, whose transform is not there.
struct Tabled : Driven {
  Tabled() : Driven(bodies()) {}
  static XmlRpcValue bodies() {
    XmlRpcValue tree;
    tree["max_vertex_step_m"] = 0.0;
    tree["effects"]["octomap"] = "off";
    tree["bodies"]["cloth"]["topic"] = "cloth";
    tree["bodies"]["table"]["topic"] = "table";
    tree["bodies"]["table"]["motion"] = "static";
    return tree;
  }
  void take(std::size_t body, double stamp_s, float z, std::int64_t now_ns) {
    pipeline.take(body,
                  {"sensor_msgs/PointCloud2", cloud(stamp_s, z, {}, body == TABLE ? "table" : "world"), 0, now_ns});
  }
  const FrameCounters& tables() const { return pipeline.monitor().counters(TABLE); }
  static constexpr std::size_t CLOTH = 0, TABLE = 1;
};

TEST(StaticBodies, TheOnlyFrameWaitsForItsTransform) {
  Tabled scene;
  scene.take(Tabled::TABLE, 1, 0, 0);
  EXPECT_FALSE(scene.pipeline.nextOutcome(0, scene.outcome));
  EXPECT_FALSE(scene.pipeline.idle(Tabled::TABLE)) << "a newer one waits its turn at first";
  EXPECT_FALSE(scene.pipeline.nextOutcome(SECOND_NS, scene.outcome)) << "nobody knows the fixed frame yet";
  EXPECT_EQ(scene.pipeline.takeComplaint(Tabled::TABLE), "") << "which is no mistake";

  scene.take(Tabled::CLOTH, 2, 0.3f, 2 * SECOND_NS);
  ASSERT_TRUE(scene.pipeline.nextOutcome(2 * SECOND_NS, scene.outcome));
  const std::string complaint = scene.pipeline.takeComplaint(Tabled::TABLE);
  EXPECT_EQ(complaint.rfind("waits: no transform from 'table' to 'world'", 0), 0u) << complaint;
  scene.take(Tabled::CLOTH, 2.1, 0.3f, 3 * SECOND_NS);
  scene.pipeline.nextOutcome(3 * SECOND_NS, scene.outcome);
  ASSERT_TRUE(scene.pipeline.nextOutcome(4 * SECOND_NS, scene.outcome));
  EXPECT_EQ(scene.outcome.status, StepStatus::NO_BODY);
  EXPECT_EQ(scene.outcome.reason.rfind("no transform from 'table' to 'world'", 0), 0u) << scene.outcome.reason;
  EXPECT_EQ(scene.pipeline.takeComplaint(Tabled::TABLE), "") << "said once";
  EXPECT_EQ(scene.pipeline.checkNow().reason, scene.outcome.reason);
  EXPECT_EQ(scene.tables().waiting(), 1u);

  ASSERT_TRUE(scene.pipeline.idle(Tabled::TABLE));
  scene.take(Tabled::TABLE, 1.5, 0, 5 * SECOND_NS);
  EXPECT_EQ(scene.tables().of(StepStatus::NO_TRANSFORM), 1u) << "the newer one takes its place";
  EXPECT_EQ(scene.tables().waiting(), 1u);
  scene.pipeline.reset(StepStatus::RESET);
  EXPECT_EQ(scene.tables().waiting(), 1u) << "static bodies stay over a reset";

  scene.raise("table", 0.1);
  scene.take(Tabled::CLOTH, 3, 0.3f, 6 * SECOND_NS);
  ASSERT_TRUE(scene.pipeline.nextOutcome(6 * SECOND_NS, scene.outcome));
  scene.take(Tabled::CLOTH, 3.1, -0.1f, 7 * SECOND_NS);
  ASSERT_TRUE(scene.pipeline.nextOutcome(7 * SECOND_NS, scene.outcome));
  ASSERT_EQ(scene.outcome.status, StepStatus::OK) << scene.outcome.reason;
  EXPECT_NEAR(scene.outcome.earliest_toc, 0.5, 1e-6);
  EXPECT_EQ(scene.tables().processed(), 1u);
  EXPECT_EQ(scene.pipeline.monitor().total().waiting(), 0u);
}

TEST(StaticBodies, AreWhereTheyWereWhenTheFixedFrameIsLearntAnew) {
  Tabled scene;
  scene.raise("table", 0.1);
  scene.take(Tabled::TABLE, 1, 0, 0);
  for (const double stamp_s : {2.0, 3.0}) {
    scene.take(Tabled::CLOTH, stamp_s, 0.3f, 0);
    ASSERT_TRUE(scene.pipeline.nextOutcome(0, scene.outcome));
    EXPECT_EQ(scene.outcome.status, StepStatus::FIRST_FRAME);
    scene.take(Tabled::CLOTH, stamp_s + 0.1, -0.1f, 0);
    ASSERT_TRUE(scene.pipeline.nextOutcome(0, scene.outcome));
    ASSERT_EQ(scene.outcome.status, StepStatus::OK) << scene.outcome.reason;
    EXPECT_NEAR(scene.outcome.earliest_toc, 0.5, 1e-6);
    EXPECT_EQ(scene.tables().received, 1u);
    EXPECT_EQ(scene.tables().processed(), 1u);
    scene.pipeline.reset(StepStatus::RESET);
    EXPECT_EQ(scene.pipeline.fixedFrame(), "");
    EXPECT_EQ(scene.tables().waiting(), 1u);
  }
}

TEST(StaticBodies, AnOldPlaceIsNoAnswerWhileTheNewOneHasNoTransform) {
  Tabled scene;
  scene.raise("table", 0.1);
  scene.take(Tabled::TABLE, 1, 0, 0);
  double stamp_s = 1;
  const auto feed = [&](float z, std::int64_t now_ns) {
    scene.take(Tabled::CLOTH, stamp_s += 0.1, z, now_ns);
    return scene.pipeline.nextOutcome(now_ns, scene.outcome);
  };
  ASSERT_TRUE(feed(0.3f, 0));
  ASSERT_TRUE(feed(0.3f, 0));
  ASSERT_EQ(scene.outcome.status, StepStatus::OK) << scene.outcome.reason;

  const auto moved = cloud(2, 0, {}, "lorry");
  scene.pipeline.take(Tabled::TABLE, {"sensor_msgs/PointCloud2", moved, 0, SECOND_NS});
  EXPECT_FALSE(feed(0.3f, SECOND_NS)) << "waits with the table's frame, as long as that may wait";
  ASSERT_TRUE(scene.pipeline.nextOutcome(2 * SECOND_NS, scene.outcome));
  EXPECT_EQ(scene.outcome.status, StepStatus::NO_BODY);
  EXPECT_FALSE(scene.outcome.answered);
  EXPECT_EQ(scene.outcome.reason.rfind("no transform from 'lorry' to 'world'", 0), 0u) << scene.outcome.reason;
  EXPECT_NE(scene.outcome.reason.find("body 'table'"), std::string::npos) << scene.outcome.reason;
  const Outcome now = scene.pipeline.checkNow();
  EXPECT_FALSE(now.answered);
  EXPECT_EQ(now.status, StepStatus::NO_BODY);
  EXPECT_EQ(now.reason, scene.outcome.reason);
  scene.pipeline.take(Tabled::TABLE, {"sensor_msgs/PointCloud2", moved, 0, 3 * SECOND_NS});
  ASSERT_TRUE(feed(0.3f, 3 * SECOND_NS)) << "what comes in a frame that is known to be missing holds nothing up again";
  EXPECT_EQ(scene.outcome.status, StepStatus::NO_BODY);

  scene.raise("lorry", 0.1);
  ASSERT_TRUE(feed(0.3f, 4 * SECOND_NS));
  ASSERT_TRUE(feed(-0.1f, 4 * SECOND_NS));
  ASSERT_EQ(scene.outcome.status, StepStatus::OK) << scene.outcome.reason;
  EXPECT_NEAR(scene.outcome.earliest_toc, 0.5, 1e-6);
  const FrameCounters total = scene.pipeline.monitor().total();
  EXPECT_EQ(total.of(StepStatus::NO_BODY), 2u);
  EXPECT_EQ(total.of(StepStatus::NO_TRANSFORM), 1u) << "the table's second frame gave way to the third";
  EXPECT_EQ(total.waiting(), 0u);
}

TEST(StaticBodies, CloudsThatComeFasterThanTfFindTheirPlace) {
  Tabled scene;
  scene.take(Tabled::CLOTH, 1, 0.3f, 0);
  ASSERT_TRUE(scene.pipeline.nextOutcome(0, scene.outcome));
  scene.take(Tabled::TABLE, 1, 0, 0);
  scene.pipeline.nextOutcome(SECOND_NS, scene.outcome);  // has waited in vain
  ASSERT_TRUE(scene.pipeline.idle(Tabled::TABLE));
  scene.take(Tabled::TABLE, 2, 0, SECOND_NS);
  scene.pipeline.nextOutcome(SECOND_NS, scene.outcome);
  EXPECT_FALSE(scene.pipeline.idle(Tabled::TABLE)) << "its transform may come in a moment";
  scene.raise("table", 0.1);
  scene.pipeline.nextOutcome(SECOND_NS + 1, scene.outcome);
  EXPECT_EQ(scene.tables().processed(), 1u);
  EXPECT_EQ(scene.tables().of(StepStatus::NO_TRANSFORM), 1u);
}

TEST(StaticBodies, WhatStillWaitsAtTheEndIsCounted) {
  Tabled scene;
  scene.take(Tabled::TABLE, 1, 0, 0);
  scene.pipeline.nextOutcome(SECOND_NS, scene.outcome);
  scene.pipeline.finish();
  EXPECT_FALSE(scene.pipeline.nextOutcome(SECOND_NS, scene.outcome));
  EXPECT_EQ(scene.tables().of(StepStatus::NO_TRANSFORM), 1u);
  EXPECT_EQ(scene.tables().waiting(), 0u);
}

/// Two triangles that share an edge; the second one's corner on it `apart` above the first one's.
std::vector<std::uint8_t> soup(double stamp_s, double apart) {
  visualization_msgs::Marker out;
  out.header.stamp = ros::Time(stamp_s);
  out.header.frame_id = "world";
  out.type = visualization_msgs::Marker::TRIANGLE_LIST;
  out.scale.x = out.scale.y = out.scale.z = out.pose.orientation.w = 1;
  const double corners[6][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 1, apart}, {1, 0, apart}, {1, 1, 0}};
  for (const auto& corner : corners) {
    geometry_msgs::Point point;
    point.x = corner[0];
    point.y = corner[1];
    point.z = corner[2];
    out.points.push_back(point);
  }
  return bytesOf(out);
}

/// A cloth over what a depth camera sees: 8 x 8 pixels 0.1 m apart, the camera's frame that of the world.
struct Seen : Driven {
  Seen() : Driven(bodies()) {}
  static XmlRpcValue bodies() {
    XmlRpcValue tree;
    tree["max_vertex_step_m"] = 0.0;
    tree["effects"]["octomap"] = "off";
    tree["bodies"]["cloth"]["topic"] = "cloth";
    tree["bodies"]["seen"]["topic"] = "points";
    tree["bodies"]["seen"]["motion"] = "static";
    tree["bodies"]["seen"]["topology"]["source"] = "depth_image";
    tree["bodies"]["seen"]["topology"]["stride"] = 1;
    tree["bodies"]["seen"]["topology"]["max_edge_m"] = 0.2;
    return tree;
  }
  /// Heights by column, NaN for a lost pixel; the first pixel at the origin.
  void see(double stamp_s, const std::array<float, 8>& z) {
    sensor_msgs::PointCloud2 out;
    out.header.stamp = ros::Time(stamp_s);
    out.header.frame_id = "world";
    out.height = out.width = 8;
    for (const char* name : {"x", "y", "z", "rgb"}) {
      sensor_msgs::PointField field;
      field.name = name;
      field.offset = static_cast<std::uint32_t>(4 * out.fields.size());
      field.datatype = sensor_msgs::PointField::FLOAT32;
      field.count = 1;
      out.fields.push_back(field);
    }
    out.point_step = 16;
    out.row_step = 128;
    out.data.resize(1024);
    for (std::size_t i = 0; i < 64; ++i) {
      const float p[4] = {0.1f * static_cast<float>(i % 8), 0.1f * static_cast<float>(i / 8), z[i % 8], 0};
      std::memcpy(out.data.data() + 16 * i, p, 16);
    }
    pipeline.take(1, {"sensor_msgs/PointCloud2", bytesOf(out), 0, 0});
    pipeline.nextOutcome(0, outcome);
  }
};
constexpr float LOST = std::numeric_limits<float>::quiet_NaN();

TEST(DepthImage, TheNewestCloudHoldsWhateverItsTriangles) {
  Seen scene;
  scene.see(1, {0, 0, 0, 0, 0, 0, 0, 0});
  scene.feed(1, 0.3f);
  // The cloth, x from 0.15 to 0.25, goes from 0.3 to -0.1 and meets the plane z = 0 at 3/4 of the step.
  EXPECT_NEAR(scene.feed(1.1, -0.1f).earliest_toc, 0.75, 1e-6);
  EXPECT_EQ(scene.outcome.status, StepStatus::OK) << scene.outcome.reason;
  EXPECT_EQ(scene.outcome.start_state, StartState::CLEAR);
  // Another cloud with other triangles: the plane is 0.15 m higher, half of it.
  scene.feed(1.2, 0.3f);
  scene.see(1.25, {0.15f, 0.15f, 0.15f, 0.15f, LOST, LOST, LOST, LOST});
  const Outcome& higher = scene.feed(1.3, 0.1f);
  EXPECT_EQ(higher.status, StepStatus::OK) << higher.reason;
  EXPECT_NEAR(higher.earliest_toc, 0.75, 1e-6) << "0.3 to 0.1 meets 0.15";
  // The cloth now hangs over a hole in what is seen.
  scene.see(1.35, {0, LOST, LOST, LOST, LOST, 0, 0, 0});
  scene.feed(1.4, 0.3f);
  const Outcome& hole = scene.feed(1.5, -0.1f);
  EXPECT_EQ(hole.status, StepStatus::OK) << hole.reason;
  EXPECT_TRUE(hole.contacts.empty());
  EXPECT_EQ(scene.pipeline.monitor().counters(1).processed(), 3u);
  EXPECT_EQ(scene.pipeline.monitor().counters(1).of(StepStatus::TOPOLOGY_CHANGED), 0u);
}

TEST(DepthImage, ACameraThatSeesNothingLeavesTheSurfaceBefore) {
  Seen scene;
  scene.see(1, {0, 0, 0, 0, 0, 0, 0, 0});
  scene.see(1.05, {LOST, LOST, LOST, LOST, LOST, LOST, LOST, LOST});
  EXPECT_EQ(scene.pipeline.monitor().counters(1).of(StepStatus::BAD_MESSAGE), 1u);
  const std::string complaint = scene.pipeline.takeComplaint(1);
  EXPECT_NE(complaint.find("no three of the 64 kept pixels"), std::string::npos) << complaint;
  scene.feed(1.1, 0.3f);
  EXPECT_NEAR(scene.feed(1.2, -0.1f).earliest_toc, 0.75, 1e-6);
}

TEST(Weld, AResetWeldsAnew) {
  Driven welded(scene());
  double stamp_s = 1;
  const auto vertices = [&](double apart) {
    for (int frame = 0; frame < 2; ++frame) {
      const auto bytes = soup(stamp_s += 0.1, apart);
      welded.pipeline.take(0, {"visualization_msgs/Marker", bytes, 0, 0});
      EXPECT_TRUE(welded.pipeline.nextOutcome(0, welded.outcome));
    }
    return welded.outcome.answered ? welded.outcome.step->bodies[0].topology->vertexCount() : 0;
  };
  EXPECT_EQ(vertices(0), 4u);
  EXPECT_EQ(welded.pipeline.weldChanges(), 0u);
  EXPECT_EQ(vertices(0.5), 6u);
  EXPECT_EQ(welded.pipeline.weldChanges(), 2u) << "vertices that came apart, not frames";
  EXPECT_EQ(vertices(0), 6u) << "what touches again is contact, not mesh";
  welded.pipeline.reset(StepStatus::DISABLED);
  EXPECT_EQ(vertices(0), 6u) << "references stay, too";
  welded.pipeline.reset(StepStatus::RESET);
  EXPECT_EQ(vertices(0), 4u) << "the first frame after a reset is a first frame";
  EXPECT_EQ(welded.pipeline.weldChanges(), 2u);
}

/// A closed box of an STL, 20 x 20 x 40 units, around the origin of the frame `finger` of a rigid body; with a cloth.
XmlRpcValue clothAndFinger() {
  const std::string file = ::testing::TempDir() + "finger.stl";
  std::ofstream stl(file);
  const int faces[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                            {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  stl << "solid finger\n";
  for (const auto& face : faces) {
    stl << "facet normal 0 0 0\nouter loop\n";
    for (const int v : face) {
      stl << "vertex " << (v & 1 ? 10 : -10) << ' ' << (v & 2 ? 10 : -10) << ' ' << (v & 4 ? 40 : 0) << '\n';
    }
    stl << "endloop\nendfacet\n";
  }
  stl << "endsolid\n";
  XmlRpcValue tree = scene();
  tree["effects"]["octomap"] = "off";
  tree["bodies"]["cloth"]["topic"] = "cloth";
  tree["bodies"]["finger"]["rigid"]["mesh"] = file;
  tree["bodies"]["finger"]["rigid"]["frame"] = "finger";
  return tree;
}

// A file in millimetres makes a finger of 40 m, and no edge of the cloth in it is near a face.
TEST(Inside, AClothInARigidBodyOfAnStlIsNoClearStart) {
  Driven wrong(clothAndFinger());
  wrong.raise("finger", -20);
  wrong.feed(1, 0.3f);
  const Outcome& inside = wrong.feed(1.1, 0.2f);
  ASSERT_EQ(inside.status, StepStatus::OK) << inside.reason;
  EXPECT_EQ(inside.start_state, StartState::INTERSECTING);
  ASSERT_EQ(inside.intersections.size(), 1u);
  EXPECT_EQ(inside.intersections[0].body, (std::array<std::uint16_t, 2>{0, 1}));
  EXPECT_EQ(inside.intersections[0].vertex, (std::array<Index, 5>{0, NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX}));
  EXPECT_FALSE(assuranceOf(inside).clear());

  XmlRpcValue tree = clothAndFinger();
  tree["bodies"]["finger"]["rigid"]["scale"] = 0.001;
  Driven right(tree);
  right.raise("finger", -20);
  right.feed(1, 0.3f);
  EXPECT_TRUE(assuranceOf(right.feed(1.1, 0.2f)).clear());

  tree = clothAndFinger();
  tree["bodies"]["finger"]["shell"] = true;
  Driven container(tree);
  container.raise("finger", -20);
  container.feed(1, 0.3f);
  EXPECT_TRUE(assuranceOf(container.feed(1.1, 0.2f)).clear()) << "a container is meant to hold others";
}

TEST(Inside, AMeshFileInMillimetresIsHintedAt) {
  XmlRpcValue tree = clothAndFinger();
  EXPECT_EQ(Driven(tree).pipeline.hint(1), "") << "40 m are no millimetres for sure";
  tree["bodies"]["finger"]["rigid"]["scale"] = 2.0;
  const std::string hint = Driven(tree).pipeline.hint(1);
  EXPECT_NE(hint.find("finger.stl is 80 m across"), std::string::npos) << hint;
  EXPECT_NE(hint.find("are these millimetres? Then set rigid/scale: 0.002"), std::string::npos) << hint;
}

std::string errorOf(const XmlRpcValue& tree) {
  tf2::BufferCore transforms;
  try {
    MonitorPipeline pipeline(readConfig(tree), transforms);
  } catch (const ParameterError& error) {
    return error.what();
  }
  return "";
}

TEST(Files, WhatIsMissingOrNoMeshIsRefusedAtStart) {
  const std::string text_file = ::testing::TempDir() + "no_mesh.stl", ply = ::testing::TempDir() + "square.ply";
  std::ofstream(text_file) << "this is no mesh\n";
  std::ofstream(ply)
      << "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
         "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
         "0 0 0\n1 0 0\n0 1 0\n1 1 0\n3 0 1 2\n3 1 3 2\n";
  const auto rigid = [](const std::string& file) {
    XmlRpcValue tree;
    tree["bodies"]["cloth"]["topic"] = "cloth";
    tree["bodies"]["finger"]["rigid"]["mesh"] = file;
    tree["bodies"]["finger"]["rigid"]["frame"] = "finger";
    return tree;
  };
  const auto names = [](const std::string& error, const std::string& part) {
    EXPECT_NE(error.find(part), std::string::npos) << part << ": " << error;
  };
  for (const std::string& file :
       {std::string("missing.stl"), std::string("package://no_such_package/a.obj"), text_file}) {
    const std::string error = errorOf(rigid(file));
    names(error, "rigid/mesh of body 'finger'");
    names(error, file);
    names(error, "write the path of an STL, OBJ, PLY or DAE mesh");
  }
  EXPECT_EQ(errorOf(rigid(ply)), "");
  XmlRpcValue topology;
  topology["topology"]["file"] = "missing.ply";
  names(errorOf(topology), "topology/file of body 'mesh': missing.ply");
  topology["topology"]["file"] = ply;
  EXPECT_EQ(errorOf(topology), "");
  topology["topology"]["rows"] = 2;
  topology["topology"]["cols"] = 3;
  names(errorOf(topology), "topology/rows of body 'mesh': 2 x 3 = 6, but " + ply + " has 4 points");
}

}  // namespace
}  // namespace dccd
