// Triangles of a marker that share corners: what came apart stays apart until a reset welds anew.
#include <gtest/gtest.h>
#include <visualization_msgs/Marker.h>

#include "dccd/assurance.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

/// Two triangles that share an edge, or but one of them; the second one's corner on it `apart` above the first one's.
std::vector<std::uint8_t> soup(double stamp_s, double apart, std::size_t first = 0) {
  visualization_msgs::Marker out;
  out.header.stamp = ros::Time(stamp_s);
  out.header.frame_id = "world";
  out.type = visualization_msgs::Marker::TRIANGLE_LIST;
  out.scale.x = out.scale.y = out.scale.z = out.pose.orientation.w = 1;
  const double corners[6][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 1, apart}, {1, 0, apart}, {1, 1, 0}};
  for (std::size_t i = 3 * first; i < 6; ++i) {
    geometry_msgs::Point point;
    point.x = corners[i][0];
    point.y = corners[i][1];
    point.z = corners[i][2];
    out.points.push_back(point);
  }
  return bytesOf(out);
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
  EXPECT_EQ(welded.pipeline.counters().weld_changes, 0u);
  EXPECT_EQ(vertices(0.5), 6u);
  EXPECT_EQ(welded.pipeline.counters().weld_changes, 2u) << "vertices that came apart, not frames";
  EXPECT_EQ(vertices(0), 6u) << "what touches again is contact, not mesh";
  welded.pipeline.reset(StepStatus::DISABLED);
  EXPECT_EQ(vertices(0), 6u) << "references stay, too";
  welded.pipeline.reset(StepStatus::RESET);
  EXPECT_EQ(vertices(0), 4u) << "the first frame after a reset is a first frame";
  EXPECT_EQ(welded.pipeline.counters().weld_changes, 2u);
}

// A number that stood for one vertex stands for another one once corners came apart.
TEST(Weld, NumbersOfVerticesThatCameApartProveNothing) {
  for (const auto& [names, is_masked] : {std::pair("", false), {"vertex_mask: [3]", true}}) {
    Driven welded(scene(names));
    double stamp_s = 1;
    const auto said = [&](double apart) {
      for (int frame = 0; frame < 2; ++frame) {
        welded.pipeline.take(0, {"visualization_msgs/Marker", soup(stamp_s += 0.1, apart), 0, 0});
        EXPECT_TRUE(welded.pipeline.nextOutcome(0, welded.outcome));
      }
      EXPECT_TRUE(welded.outcome.answered) << welded.outcome.reason;
      return assuranceOf(welded.outcome);
    };
    EXPECT_TRUE(said(0).proved);
    EXPECT_EQ(said(0.5).proved, !is_masked) << describe(assuranceOf(welded.outcome));
    welded.pipeline.reset(StepStatus::RESET);
    EXPECT_TRUE(said(0.5).proved) << "numbered as they are now";
  }
}

TEST(Weld, NumbersOfOtherTrianglesProveNothing) {
  for (const auto& [names, is_masked] : {std::pair("", false), {"vertex_mask: [2]", true}}) {
    Driven welded(scene(names));
    double stamp_s = 1;
    const auto said = [&](std::size_t first) {
      for (int frame = 0; frame < 2; ++frame) {
        welded.pipeline.take(0, {"visualization_msgs/Marker", soup(stamp_s += 0.1, 0, first), 0, 0});
        EXPECT_TRUE(welded.pipeline.nextOutcome(0, welded.outcome));
      }
      EXPECT_TRUE(welded.outcome.answered) << welded.outcome.reason;
      return assuranceOf(welded.outcome);
    };
    EXPECT_TRUE(said(0).proved);
    EXPECT_EQ(said(1).proved, !is_masked) << describe(assuranceOf(welded.outcome));
    EXPECT_EQ(said(0).proved, !is_masked) << "who counted meanwhile nobody knows";
    welded.pipeline.reset(StepStatus::RESET);
    EXPECT_TRUE(said(1).proved) << "numbered as they are now";
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
