// Ropes as markers and poses, and clouds with a wrong row_step, through the whole pipeline.
#include <geometry_msgs/PoseArray.h>
#include <visualization_msgs/MarkerArray.h>

#include <fstream>

#include "dccd/assurance.h"

#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

template <typename Message>
void feed(Driven& driven, const Message& message) {
  driven.pipeline.take(0, {ros::message_traits::datatype(message), bytesOf(message), 0, 0});
  ASSERT_TRUE(driven.pipeline.nextOutcome(0, driven.outcome));
}

visualization_msgs::Marker rope(double stamp_s, std::int32_t id, std::int32_t type, const Positions& points) {
  visualization_msgs::Marker out;
  out.header.stamp = ros::Time(stamp_s);
  out.header.frame_id = "world";
  out.id = id;
  out.type = type;
  out.scale.x = 0.01;
  for (const Vec3& p : points) {
    geometry_msgs::Point point;
    point.x = p.x(), point.y = p.y(), point.z = p.z();
    out.points.push_back(point);
  }
  return out;
}

/// A rope along x at rest, and one across it that falls from `z`.
visualization_msgs::MarkerArray crossing(double stamp_s, double z, std::int32_t type) {
  using Marker = visualization_msgs::Marker;
  const Vec3 left(0, 0, 0), middle(0.5, 0, 0), right(1, 0, 0);
  visualization_msgs::MarkerArray out;
  out.markers.resize(1);
  out.markers[0].action = Marker::DELETEALL;
  out.markers.push_back(rope(stamp_s, 5, Marker::LINE_STRIP, {{0.3, -0.2, z}, {0.3, 0.2, z}}));
  out.markers.push_back(
      rope(stamp_s, 2, type,
           type == Marker::LINE_LIST ? Positions{left, middle, middle, right} : Positions{left, middle, right}));
  return out;
}

void expectOneContactAtHalf(const Outcome& outcome, const std::vector<Index>& vertices) {
  EXPECT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  ASSERT_EQ(outcome.contacts.size(), 1u);
  const Contact& contact = outcome.contacts[0];
  EXPECT_EQ(contact.kind, PairKind::EDGE_EDGE);
  EXPECT_TRUE(std::equal(vertices.begin(), vertices.end(), contact.vertex.begin()));
  EXPECT_EQ(contact.certainty, Certainty::CERTAIN);
  EXPECT_LE(contact.toc_lower, 0.5);
  EXPECT_LT(0.5, contact.toc_upper);
}

TEST(RopeMessages, TwoRopesThatCross) {
  for (const std::int32_t type : {MARKER_LINE_STRIP, MARKER_LINE_LIST}) {
    Driven ropes(scene());
    feed(ropes, crossing(1, 0.4, type));
    feed(ropes, crossing(1.1, -0.4, type));
    expectOneContactAtHalf(ropes.outcome, {0, 1, 3, 4});
    feed(ropes, crossing(1.2, -0.5, type));
    EXPECT_EQ(ropes.outcome.total_contacts, 0u);
    EXPECT_TRUE(assuranceOf(ropes.outcome).clear());
  }
}

/// Two ropes by their ids, of which the first has so many points of five; `above` the others of before.
visualization_msgs::MarkerArray twoRopes(double stamp_s, std::int32_t id, std::size_t points, double above) {
  visualization_msgs::MarkerArray out;
  out.markers.resize(1);
  out.markers[0].action = visualization_msgs::Marker::DELETEALL;
  for (const auto& [first, count, z] : {std::tuple(id, points, above), {id + 1, 5 - points, above + 0.1}}) {
    Positions places;
    for (std::size_t i = 0; i < count; ++i) places.emplace_back(0.1 * static_cast<double>(i), 0, z);
    out.markers.push_back(rope(stamp_s, first, MARKER_LINE_STRIP, places));
  }
  return out;
}

TEST(RopeMessages, NumbersOfOtherRopesProveNothing) {
  Driven ropes(scene("vertex_mask: [0]"));
  feed(ropes, twoRopes(1, 1, 2, 0));
  feed(ropes, twoRopes(1.1, 1, 2, 0));
  EXPECT_TRUE(assuranceOf(ropes.outcome).proved) << describe(assuranceOf(ropes.outcome));
  // The second one is now the first, with the numbers of that; there are as many vertices, edges and ends as before.
  feed(ropes, twoRopes(1.2, 2, 3, 0.1));
  feed(ropes, twoRopes(1.3, 2, 3, 0.1));
  EXPECT_TRUE(ropes.outcome.answered) << ropes.outcome.reason;
  EXPECT_FALSE(assuranceOf(ropes.outcome).proved);
  EXPECT_NE(describe(assuranceOf(ropes.outcome)).find("have other numbers than in its first frame"), std::string::npos);
}

// The topology that is given stays the same: that the points are others it cannot tell.
TEST(RopeMessages, OtherMarkersOfAGivenTopologyAreRefused) {
  const std::string file = ::testing::TempDir() + "five_points.obj";
  std::ofstream(file) << "v 0 0 0\nv 0 0 0\nv 0 0 0\nv 0 0 0\nv 0 0 0\nl 1 2\nl 3 4 5\n";
  Driven ropes(scene("topology: {file: " + file + "}"));
  feed(ropes, twoRopes(1, 1, 2, 0));
  feed(ropes, twoRopes(1.1, 1, 2, 0));
  EXPECT_TRUE(assuranceOf(ropes.outcome).proved) << describe(assuranceOf(ropes.outcome));
  feed(ropes, twoRopes(1.2, 2, 3, 0.1));
  EXPECT_EQ(ropes.outcome.status, StepStatus::BAD_MESSAGE) << ropes.outcome.reason;
  feed(ropes, twoRopes(1.3, 1, 2, 0));
  EXPECT_TRUE(ropes.outcome.answered) << ropes.outcome.reason;
  EXPECT_FALSE(assuranceOf(ropes.outcome).proved) << "one between came and was not used";
}

TEST(RopeMessages, AnotherRopeIsASeam) {
  Driven ropes(scene());
  feed(ropes, crossing(1, 0.4, visualization_msgs::Marker::LINE_STRIP));
  feed(ropes, crossing(1.1, -0.4, visualization_msgs::Marker::LINE_LIST));
  EXPECT_TRUE(ropes.outcome.answered) << "the same ropes, drawn in another way";
  visualization_msgs::MarkerArray longer = crossing(1.2, 0.4, visualization_msgs::Marker::LINE_LIST);
  for (std::uint32_t more = 0; more < 2; ++more) longer.markers[2].points.push_back(longer.markers[2].points[3 * more]);
  feed(ropes, longer);
  EXPECT_EQ(ropes.outcome.status, StepStatus::TOPOLOGY_CHANGED);
  visualization_msgs::MarkerArray renamed = crossing(1.3, 0.4, visualization_msgs::Marker::LINE_STRIP);
  feed(ropes, renamed);
  renamed = crossing(1.4, 0.4, visualization_msgs::Marker::LINE_STRIP);
  renamed.markers[1].id = 6;
  feed(ropes, renamed);
  EXPECT_EQ(ropes.outcome.status, StepStatus::BAD_MESSAGE);
  EXPECT_NE(ropes.outcome.reason.find("('', 6) stands where ('', 5) was"), std::string::npos) << ropes.outcome.reason;
  ropes.pipeline.reset(StepStatus::RESET);
  feed(ropes, renamed);
  EXPECT_EQ(ropes.outcome.status, StepStatus::FIRST_FRAME);
}

// One array with a cloth's triangles and a rope, and a cube in a message of its own: nobody looks at either.
TEST(RopeMessages, WhatNobodyLooksAtIsSaid) {
  using Marker = visualization_msgs::Marker;
  Driven cloth(scene());
  const Positions corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const auto clothAnd = [&](double stamp_s, const Positions& line) {
    visualization_msgs::MarkerArray out;
    out.markers = {rope(stamp_s, 1, Marker::TRIANGLE_LIST, corners), rope(stamp_s, 2, Marker::LINE_STRIP, line)};
    out.markers[0].scale.x = 0;
    return out;
  };
  feed(cloth, clothAnd(1, corners));
  feed(cloth, clothAnd(1.1, corners));
  EXPECT_TRUE(assuranceOf(cloth.outcome).clear()) << "its outline: " << cloth.outcome.reason;
  EXPECT_TRUE(cloth.outcome.excluded.empty());
  visualization_msgs::MarkerArray cube;
  cube.markers = {rope(1.15, 7, Marker::CUBE, {})};
  cube.markers[0].ns = "table";
  cloth.pipeline.take(0, {ros::message_traits::datatype(cube), bytesOf(cube), 0, 0});
  EXPECT_FALSE(cloth.pipeline.nextOutcome(0, cloth.outcome)) << "no frame";
  feed(cloth, clothAnd(1.2, corners));
  EXPECT_TRUE(assuranceOf(cloth.outcome).clear()) << cloth.outcome.reason;
  EXPECT_EQ(cloth.outcome.excluded, std::vector<std::string>{"other markers on the topic of body 'mesh'"});
  feed(cloth, clothAnd(1.3, {{0.2, 0.2, 0.5}, {0.2, 0.2, -0.5}}));
  EXPECT_EQ(cloth.outcome.status, StepStatus::PARTIAL) << "a rope through it";
  EXPECT_FALSE(assuranceOf(cloth.outcome).proved);
  EXPECT_NE(cloth.pipeline.hint(0).find("1 marker beside the mesh, the first of which is ('', 2), type 4"),
            std::string::npos)
      << cloth.pipeline.hint(0);
}

// What the names leave out of a message with the mesh is named as well as a message of its own.
TEST(OtherMarkers, OfTheMeshsOwnMessageStandInExcluded) {
  for (const auto& [type, is_thing] : {std::pair(1, true), {9, false}}) {
    Driven cloth(scene("marker: {namespace: ''}"));
    for (const double stamp_s : {1.0, 1.1}) {
      visualization_msgs::MarkerArray both;
      both.markers = {rope(stamp_s, 1, visualization_msgs::Marker::LINE_STRIP, {{0, 0, 0}, {1, 0, 0}}),
                      rope(stamp_s, 2, type, {})};
      both.markers[1].ns = "table";
      feed(cloth, both);
    }
    EXPECT_TRUE(assuranceOf(cloth.outcome).proved) << describe(assuranceOf(cloth.outcome));
    EXPECT_EQ(cloth.outcome.excluded.size(), is_thing ? 1u : 0u) << type;
  }
}

// Two ropes at rest, each in messages of its own, one of them above the other: without a name nobody knows which is
// the rope. With one the other is no frame, and nothing is missing between two frames of the first.
TEST(RopeMessages, OfTwoInTurnTheNamedOneIsProvedAndWithoutANameNone) {
  for (const bool is_named : {false, true}) {
    Driven ropes(scene(is_named ? "marker: {namespace: a}" : ""));
    int clear = 0, refused = 0;
    for (int k = 0; k < 12; ++k) {
      const double z = k % 2 == 0 ? 0 : 0.3;
      visualization_msgs::Marker one = rope(1 + 0.1 * k, 0, MARKER_LINE_STRIP, {{0, 0, z}, {0.5, 0, z}, {1, 0, z}});
      one.ns = k % 2 == 0 ? "a" : "b";
      ropes.pipeline.take(0, {ros::message_traits::datatype(one), bytesOf(one), 0, 0});
      while (ropes.pipeline.nextOutcome(0, ropes.outcome)) {
        clear += assuranceOf(ropes.outcome).clear();
        refused += ropes.outcome.status == StepStatus::BAD_MESSAGE;
      }
    }
    EXPECT_EQ(clear, is_named ? 5 : 0) << ropes.outcome.reason;
    EXPECT_EQ(refused, is_named ? 0 : 11);
    EXPECT_EQ(ropes.pipeline.counters().markers_passed_over, is_named ? 6u : 0u);
  }
}

TEST(RopeMessages, PosesOfARopeThatCrossesItself) {
  const auto poses = [](double stamp_s, double z) {
    geometry_msgs::PoseArray out;
    out.header.stamp = ros::Time(stamp_s);
    out.header.frame_id = "world";
    for (const Vec3& p : Positions{{0, 0, 0}, {1, 0, 0}, {1, 1, z}, {0.5, -1, z}}) {
      geometry_msgs::Pose pose;
      pose.position.x = p.x(), pose.position.y = p.y(), pose.position.z = p.z();
      out.poses.push_back(pose);
    }
    return out;
  };
  Driven rope(scene());
  feed(rope, poses(1, 0.25));
  feed(rope, poses(1.1, -0.25));
  expectOneContactAtHalf(rope.outcome, {0, 1, 2, 3});
}

TEST(RowStep, WrongOnesAreCountedAndSaidOnce) {
  Driven cloth(scene());
  cloth.feed(1, 0.1f);
  EXPECT_EQ(cloth.pipeline.hint(0), "");
  const std::uint32_t wrong = 64;  // of the whole cloud
  for (const double stamp_s : {1.1, 1.2}) {
    std::vector<std::uint8_t> bytes = cloud(stamp_s, 0.1f);
    std::memcpy(&bytes[bytes.size() - 1 - 64 - 4 - 4], &wrong, sizeof wrong);
    cloth.take(0, bytes);
    ASSERT_TRUE(cloth.pipeline.nextOutcome(0, cloth.outcome));
    EXPECT_EQ(cloth.outcome.status, StepStatus::OK) << "the step goes on: " << cloth.outcome.reason;
  }
  EXPECT_EQ(cloth.pipeline.counters().wrong_row_steps, 2u);
  EXPECT_NE(cloth.pipeline.hint(0).find("row_step 64 contradicts the data"), std::string::npos);
}

}  // namespace
}  // namespace test
}  // namespace dccd
