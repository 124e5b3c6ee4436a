// Triangles of a marker that share corners: what came apart stays apart until a reset welds anew.
#include <deformable_ccd/MeshStamped.h>
#include <gtest/gtest.h>
#include <visualization_msgs/Marker.h>

#include "dccd/assurance.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

/// Two triangles that share an edge, in this order; the second one's corner on it `apart` above the first one's.
std::vector<std::uint8_t> soup(double stamp_s, double apart, const std::vector<std::size_t>& triangles = {0, 1}) {
  visualization_msgs::Marker out;
  out.header.stamp = ros::Time(stamp_s);
  out.header.frame_id = "world";
  out.type = visualization_msgs::Marker::TRIANGLE_LIST;
  out.scale.x = out.scale.y = out.scale.z = out.pose.orientation.w = 1;
  const double corners[6][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 1, apart}, {1, 0, apart}, {1, 1, 0}};
  for (std::size_t i = 0; i < 3 * triangles.size(); ++i) {
    const auto& corner = corners[3 * triangles[i / 3] + i % 3];
    geometry_msgs::Point point;
    point.x = corner[0];
    point.y = corner[1];
    point.z = corner[2];
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

/// The first so many of two triangles' six vertices, by number.
std::vector<std::uint8_t> indexed(double stamp_s, std::size_t vertices) {
  deformable_ccd::MeshStamped out;
  out.header.stamp = ros::Time(stamp_s);
  out.header.frame_id = "world";
  out.vertices.resize(vertices);
  out.triangles.resize(vertices / 3);
  for (std::size_t v = 0; v < vertices; ++v) {
    out.vertices[v].x = static_cast<double>(v);
    out.vertices[v].y = static_cast<double>(v % 3 == 1);
    out.triangles[v / 3].vertex_indices[v % 3] = static_cast<std::uint32_t>(v);
  }
  return bytesOf(out);
}

TEST(Weld, NumbersOfAnotherMeshProveNothing) {
  const auto sent = [](const char* type, std::size_t what, double stamp_s) {
    if (type == std::string("deformable_ccd/MeshStamped")) return indexed(stamp_s, what == 0 ? 6 : 3);
    // Another order, of as many vertices.
    return what == 0 ? soup(stamp_s, 0) : soup(stamp_s, 0, {1, 0, 1});
  };
  for (const char* type : {"visualization_msgs/Marker", "deformable_ccd/MeshStamped"}) {
    for (const auto& [names, is_masked] : {std::pair("", false), {"vertex_mask: [2]", true}}) {
      Driven body(scene(names));
      double stamp_s = 1;
      const auto isProved = [&](std::size_t what) {
        for (int frame = 0; frame < 2; ++frame) {
          body.pipeline.take(0, {type, sent(type, what, stamp_s += 0.1), 0, 0});
          EXPECT_TRUE(body.pipeline.nextOutcome(0, body.outcome));
        }
        EXPECT_TRUE(body.outcome.answered) << type << " " << body.outcome.reason;
        return assuranceOf(body.outcome).proved;
      };
      EXPECT_TRUE(isProved(0)) << type << describe(assuranceOf(body.outcome));
      EXPECT_EQ(isProved(1), !is_masked) << type << describe(assuranceOf(body.outcome));
      EXPECT_EQ(isProved(0), !is_masked) << "whom they named meanwhile nobody knows";
      body.pipeline.reset(StepStatus::RESET);
      EXPECT_TRUE(isProved(1)) << "numbered as they are now";
    }
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
