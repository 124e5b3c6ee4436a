// The grammar of messages: each row of the tables in doc/messages.md is a test of its name here.
#include <gtest/gtest.h>
#include <pcl_msgs/PolygonMesh.h>
#include <sensor_msgs/PointCloud2.h>
#include <shape_msgs/Mesh.h>
#include <visualization_msgs/MarkerArray.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include "deformable_ccd/MeshStamped.h"
#include "input/mesh_decoder.h"

namespace dccd {
namespace {

const Positions SQUARE = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0.1}};
constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

bool mentions(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// A decoder, and what it makes of messages as bytes.
class MessageGrammar : public ::testing::Test {
 protected:
  MeshInputConfig config;

  template <typename Message>
  DecodedMesh read(const Message& message) {
    std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(message));
    ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
    ros::serialization::serialize(stream, message);
    if (!decoder_) decoder_.emplace(config);
    return decoder_->decode(ros::message_traits::datatype(message), bytes.data(), bytes.size());
  }
  template <typename Message>
  std::string refusalOf(const Message& message) {
    try {
      read(message);
    } catch (const MeshError& error) {
      return std::string(toString(error.status)) + ": " + error.what();
    }
    return "was read";
  }
  void anew() { decoder_.reset(); }

 private:
  std::optional<MeshDecoder> decoder_;
};

template <typename Point = geometry_msgs::Point>
std::vector<Point> pointsOf(const Positions& positions) {
  std::vector<Point> points(positions.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].x = positions[i].x(), points[i].y = positions[i].y(), points[i].z = positions[i].z();
  }
  return points;
}

// --- sensor_msgs/PointCloud2

struct CloudGrammar : MessageGrammar {
  CloudGrammar() { config.source = TopologySource::POLYLINE; }

  /// 4 points of 40 bytes: z, something else, x and y.
  static sensor_msgs::PointCloud2 cloud(std::uint8_t datatype = sensor_msgs::PointField::FLOAT64,
                                        const Positions& points = SQUARE) {
    sensor_msgs::PointCloud2 out;
    out.header.stamp = ros::Time(5);
    out.header.frame_id = "world";
    out.height = 1;
    out.width = 4;
    out.point_step = 40;
    out.row_step = 160;
    out.data.assign(160, 0xee);
    const std::size_t bytes = datatype == sensor_msgs::PointField::FLOAT32 ? 4 : 8;
    const char* const names[] = {"z", "intensity", "x", "y"};
    for (std::uint32_t f = 0; f < 4; ++f) {
      sensor_msgs::PointField field;
      field.name = names[f];
      field.offset = 8 * f;
      field.datatype = f == 1 ? static_cast<std::uint8_t>(sensor_msgs::PointField::UINT16) : datatype;
      field.count = 1;
      out.fields.push_back(field);
      for (std::size_t i = 0; f != 1 && i < 4; ++i) {
        const double value = points[i][names[f][0] - 'x'];
        const float rounded = static_cast<float>(value);
        std::memcpy(out.data.data() + 40 * i + 8 * f,
                    bytes == 4 ? static_cast<const void*>(&rounded) : static_cast<const void*>(&value), bytes);
      }
    }
    return out;
  }
};

TEST_F(CloudGrammar, Fields) {
  EXPECT_EQ(read(cloud()).positions, SQUARE);
  anew();
  EXPECT_EQ(read(cloud(sensor_msgs::PointField::FLOAT32)).positions[3].z(), static_cast<double>(0.1f));
}

TEST_F(CloudGrammar, OtherTypes) {
  for (std::uint8_t datatype = 0; datatype < 12; ++datatype) {
    if (datatype == sensor_msgs::PointField::FLOAT32 || datatype == sensor_msgs::PointField::FLOAT64) continue;
    EXPECT_TRUE(mentions(refusalOf(cloud(datatype)), "datatype " + std::to_string(datatype)));
  }
}

TEST_F(CloudGrammar, MissingFields) {
  for (const std::size_t f : {0u, 2u, 3u}) {
    sensor_msgs::PointCloud2 less = cloud();
    less.fields.erase(less.fields.begin() + static_cast<std::ptrdiff_t>(f));
    EXPECT_TRUE(mentions(refusalOf(less), "there is no field '" + cloud().fields[f].name + "'"));
  }
}

TEST_F(CloudGrammar, Rows) {
  sensor_msgs::PointCloud2 padded = cloud();
  padded.height = padded.width = 2;
  padded.row_step = 100;
  padded.data.insert(padded.data.begin() + 80, 20, 0x77);
  EXPECT_EQ(read(padded).positions, SQUARE) << "bytes between two rows";
  padded.row_step = 79;
  EXPECT_TRUE(mentions(refusalOf(padded), "row_step 79"));
  sensor_msgs::PointCloud2 one = cloud();
  one.row_step = 0;
  EXPECT_EQ(read(one).positions, SQUARE) << "a single row needs none";
}

TEST_F(CloudGrammar, LengthOfTheData) {
  sensor_msgs::PointCloud2 longer = cloud(), shorter = cloud();
  longer.data.resize(200);
  EXPECT_EQ(read(longer).positions, SQUARE);
  shorter.data.resize(159);
  EXPECT_TRUE(mentions(refusalOf(shorter), "do not fit into data of 159"));
}

TEST_F(CloudGrammar, BigEndian) {
  sensor_msgs::PointCloud2 big = cloud();
  big.is_bigendian = true;
  EXPECT_TRUE(mentions(refusalOf(big), "is_bigendian"));
}

TEST_F(CloudGrammar, PointsThatAreNotFinite) {
  sensor_msgs::PointCloud2 lost = cloud();
  std::memcpy(lost.data.data() + 40 + 16, &NOT_A_NUMBER, 8);
  const DecodedMesh mesh = read(lost);
  EXPECT_FALSE(mesh.positions[1].allFinite()) << "unchecked, and counted by the step";
  EXPECT_EQ(mesh.positions[2], SQUARE[2]);
}

TEST_F(CloudGrammar, Topology) {
  config.source = TopologySource::AUTO;
  sensor_msgs::PointCloud2 organised = cloud();
  organised.height = organised.width = 2;
  organised.row_step = 80;
  EXPECT_EQ(read(organised).topology->faces().size(), 2u);
  anew();
  EXPECT_TRUE(mentions(refusalOf(cloud()), "set topology/rows and topology/cols"));
  anew();
  config.source = TopologySource::GRID;
  config.rows = 2;
  config.cols = 3;
  EXPECT_TRUE(mentions(refusalOf(cloud()), "VERTEX_COUNT: 4 points, but topology/rows x topology/cols is 2 x 3"));
}

// --- headers

struct HeaderGrammar : CloudGrammar {};

TEST_F(HeaderGrammar, Stamps) {
  sensor_msgs::PointCloud2 message = cloud();
  EXPECT_EQ(read(message).stamp_ns, 5000000000);
  message.header.stamp = ros::Time(0, 0);
  EXPECT_EQ(read(message).stamp_ns, 0) << "the pipeline puts the receipt time there, and counts it";
}

TEST_F(HeaderGrammar, Frames) {
  sensor_msgs::PointCloud2 message = cloud();
  message.header.frame_id = "/camera";
  EXPECT_EQ(read(message).frame_id, "camera");
  message.header.frame_id = "//camera";
  EXPECT_TRUE(mentions(refusalOf(message), "is no frame's name"));
  message.header.frame_id = "";
  EXPECT_TRUE(mentions(refusalOf(message), "set parameter frame_id"));
  anew();
  config.frame_id = "table";
  EXPECT_EQ(read(message).frame_id, "table");
}

// --- deformable_ccd/MeshStamped and shape_msgs/Mesh

struct IndexedGrammar : MessageGrammar {
  static deformable_ccd::MeshStamped mesh(const std::vector<std::array<std::uint32_t, 3>>& triangles,
                                          const Positions& positions = SQUARE) {
    deformable_ccd::MeshStamped out;
    out.header.stamp = ros::Time(5);
    out.header.frame_id = "world";
    out.vertices = pointsOf(positions);
    for (const auto& t : triangles) {
      shape_msgs::MeshTriangle triangle;
      std::copy(t.begin(), t.end(), triangle.vertex_indices.begin());
      out.triangles.push_back(triangle);
    }
    return out;
  }
};

TEST_F(IndexedGrammar, Triangles) {
  const DecodedMesh square = read(mesh({{0, 1, 2}, {0, 2, 3}}));
  EXPECT_EQ(square.positions, SQUARE);
  EXPECT_EQ(square.topology->faces(), (std::vector<Face>{{0, 1, 2}, {0, 2, 3}}));
  EXPECT_EQ(square.dropped_faces, 0u);
}

TEST_F(IndexedGrammar, VerticesThatAreNotThere) {
  EXPECT_TRUE(mentions(refusalOf(mesh({{0, 1, 2}, {0, 2, 4}})), "index 4, but there are 4 vertices"));
}

TEST_F(IndexedGrammar, RepeatedCorners) {
  EXPECT_EQ(read(mesh({{0, 1, 2}, {1, 2, 2}})).dropped_faces, 0u) << "the edge of a face";
  EXPECT_EQ(read(mesh({{0, 1, 2}, {2, 3, 3}})).dropped_faces, 1u);
  EXPECT_TRUE(mentions(refusalOf(mesh({{0, 1, 1}})), "nothing to check"));
}

TEST_F(IndexedGrammar, TrianglesSentOnce) {
  EXPECT_TRUE(mentions(refusalOf(mesh({})), "no triangles"));
  const DecodedMesh first = read(mesh({{0, 1, 2}, {0, 2, 3}}));
  EXPECT_EQ(read(mesh({})).topology, first.topology);
  EXPECT_TRUE(mentions(refusalOf(mesh({}, {SQUARE[0], SQUARE[1], SQUARE[2]})), "VERTEX_COUNT"));
}

TEST_F(IndexedGrammar, WithoutAHeader) {
  shape_msgs::Mesh bare;
  bare.vertices = pointsOf(SQUARE);
  bare.triangles = mesh({{0, 1, 2}}).triangles;
  EXPECT_TRUE(mentions(refusalOf(bare), "set parameter frame_id"));
  anew();
  config.frame_id = "world";
  EXPECT_EQ(read(bare).stamp_ns, 0);
}

// --- pcl_msgs/PolygonMesh

struct PolygonMeshGrammar : MessageGrammar {
  static pcl_msgs::PolygonMesh mesh(const std::vector<std::vector<std::uint32_t>>& polygons) {
    pcl_msgs::PolygonMesh out;
    out.header.frame_id = "world";
    out.cloud = CloudGrammar::cloud();
    for (const auto& polygon : polygons) {
      out.polygons.emplace_back();
      out.polygons.back().vertices = polygon;
    }
    return out;
  }
};

TEST_F(PolygonMeshGrammar, Polygons) {
  EXPECT_EQ(read(mesh({{0, 1, 2, 3}})).topology->faces(), (std::vector<Face>{{0, 1, 2}, {0, 2, 3}}));
}

TEST_F(PolygonMeshGrammar, WhatIsNoPolygon) {
  Positions flat = SQUARE;
  flat[3].z() = 0;
  pcl_msgs::PolygonMesh bad = mesh({{0, 1, 2}, {0, 2, 1, 3}, {1, 3}, {3}, {}});
  bad.cloud = CloudGrammar::cloud(sensor_msgs::PointField::FLOAT64, flat);
  EXPECT_EQ(read(bad).dropped_faces, 3u) << "a bow tie, an edge and a vertex of no face; nothing is nothing";
  EXPECT_EQ(read(mesh({{0, 1, 2}, {1, 2}, {0}})).dropped_faces, 0u) << "of a face";
}

TEST_F(PolygonMeshGrammar, VerticesThatAreNotThere) {
  EXPECT_TRUE(mentions(refusalOf(mesh({{0, 1, 2}, {0, 1, 2, 7}})), "index 7"));
}

// --- visualization_msgs/Marker and MarkerArray

struct MarkerGrammar : MessageGrammar {
  static visualization_msgs::Marker marker(const Positions& corners = {SQUARE[0], SQUARE[1], SQUARE[2]}) {
    visualization_msgs::Marker out;
    out.header.frame_id = "world";
    out.ns = "cloth";
    out.id = 2;
    out.type = visualization_msgs::Marker::TRIANGLE_LIST;
    out.pose.orientation.w = 1;
    out.points = pointsOf(corners);
    return out;
  }
};

TEST_F(MarkerGrammar, Corners) {
  const Positions two = {SQUARE[0], SQUARE[1], SQUARE[2], SQUARE[0], SQUARE[2], SQUARE[3]};
  EXPECT_EQ(read(marker(two)).positions, SQUARE) << "equal corners are one vertex";
  EXPECT_TRUE(mentions(refusalOf(marker(SQUARE)), "4 points, which is not a multiple of 3"));
}

TEST_F(MarkerGrammar, Poses) {
  visualization_msgs::Marker moved = marker();
  moved.pose.position.z = 2;
  moved.pose.orientation.w = 0;
  moved.pose.orientation.z = 3;  // half a turn, three times too long
  EXPECT_LT((read(moved).positions[1] - Vec3(-1, 0, 2)).norm(), 1e-15);
  moved.pose.orientation.z = 0;
  EXPECT_EQ(read(moved).positions[1], Vec3(1, 0, 2)) << "a quaternion that was never set";
  moved.pose.orientation.x = NOT_A_NUMBER;
  EXPECT_TRUE(mentions(refusalOf(moved), "pose is not finite"));
}

TEST_F(MarkerGrammar, Scales) {
  visualization_msgs::Marker scaled = marker();
  EXPECT_EQ(read(scaled).positions[1], SQUARE[1]) << "all 0: not set";
  scaled.scale.x = scaled.scale.y = 2;
  EXPECT_TRUE(mentions(refusalOf(scaled), "scale is (2, 2, 0)"));
  scaled.scale.z = -1;
  EXPECT_EQ(read(scaled).positions[2], Vec3(2, 2, 0)) << "mirrored";
}

TEST_F(MarkerGrammar, OtherTypesAndActions) {
  visualization_msgs::Marker cubes = marker(), gone = marker();
  cubes.type = visualization_msgs::Marker::CUBE_LIST;
  EXPECT_TRUE(mentions(refusalOf(cubes), "no TRIANGLE_LIST marker"));
  gone.action = visualization_msgs::Marker::DELETE;
  EXPECT_TRUE(mentions(refusalOf(gone), "no TRIANGLE_LIST marker"));
}

TEST_F(MarkerGrammar, SeveralLists) {
  visualization_msgs::MarkerArray two;
  two.markers = {marker(), marker()};
  two.markers[1].id = 3;
  EXPECT_EQ(read(two).dropped_faces, 1u) << "the first is read";
  anew();
  config.marker_id = 3;
  EXPECT_EQ(read(two).dropped_faces, 0u) << "one that is asked for is alone";
}

}  // namespace
}  // namespace dccd
