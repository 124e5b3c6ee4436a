// The grammar of messages: each row of the tables in doc/messages.md is a test of its name here.
#include <geometry_msgs/PoseArray.h>
#include <gtest/gtest.h>
#include <pcl_msgs/PolygonMesh.h>
#include <sensor_msgs/PointCloud2.h>
#include <shape_msgs/Mesh.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <string>

#include "deformable_ccd/MeshStamped.h"
#include "input/mesh_decoder.h"
#include "ros/support/bytes_of.h"
#include "ros/support/meshes.h"
#include "support/said.h"

namespace dccd {
namespace {

const Positions SQUARE = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0.1}};
constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

using test::mentions;

/// A decoder, and what it makes of messages as bytes.
class MessageGrammar : public ::testing::Test {
 protected:
  MeshInputConfig config;

  /// From its bytes, and from the object, which must be the same.
  template <typename Message>
  DecodedMesh read(const Message& message) {
    const MeshType& type = *findMeshType(ros::message_traits::datatype(message));
    const std::vector<std::uint8_t> bytes = test::bytesOf(message);
    if (!decoder_) {
      decoder_.emplace(config);
      of_objects_.emplace(config);
    }
    const TypedMesh object{&type, boost::make_shared<Message>(message)};
    try {
      const DecodedMesh mesh = decoder_->decode(type.datatype, {bytes.data(), bytes.size()});
      const DecodedMesh same = of_objects_->decode(type.datatype, {}, object);
      EXPECT_EQ(0, std::memcmp(mesh.positions.data(), same.positions.data(), 24 * mesh.positions.size()));
      EXPECT_EQ(*mesh.topology, *same.topology);
      EXPECT_EQ(mesh.row_step_hint, same.row_step_hint);
      return mesh;
    } catch (const MeshError& error) {
      EXPECT_EQ(error.what(), test::said<MeshError>([&] { of_objects_->decode(type.datatype, {}, object); }));
      throw;
    }
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
  std::optional<MeshDecoder> decoder_, of_objects_;
};

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
  sensor_msgs::PointCloud2 backwards = cloud();
  backwards.fields[3].offset = 8;  // right after z, and x right after it
  anew();
  EXPECT_EQ(read(backwards).positions.size(), 4u);
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
  EXPECT_EQ(read(padded).row_step_hint, "");
  for (const std::uint32_t row_step : {0u, 79u, 101u, 200u}) {
    padded.row_step = row_step;
    EXPECT_TRUE(mentions(refusalOf(padded), "row_step " + std::to_string(row_step))) << "of data of 180 bytes";
  }
  sensor_msgs::PointCloud2 one = cloud();
  for (const std::uint32_t row_step : {0u, 4u, 1000u}) {
    one.row_step = row_step;
    EXPECT_EQ(read(one).positions, SQUARE) << "a single row needs none";
    EXPECT_EQ(read(one).row_step_hint, "");
  }
}

TEST_F(CloudGrammar, WrongRowSteps) {
  sensor_msgs::PointCloud2 rows = cloud();
  rows.height = rows.width = 2;
  for (const std::uint32_t row_step : {0u, 2u, 40u, 79u, 81u, 160u, 4294967295u}) {
    rows.row_step = row_step;
    const DecodedMesh mesh = read(rows);
    EXPECT_EQ(mesh.positions, SQUARE) << row_step;
    EXPECT_TRUE(mentions(mesh.row_step_hint, "row_step " + std::to_string(row_step) + " contradicts"));
    EXPECT_TRUE(mentions(mesh.row_step_hint, "publish row_step 80")) << mesh.row_step_hint;
  }
  rows.row_step = 80;
  EXPECT_EQ(read(rows).row_step_hint, "");
  rows.row_step = 160;
  for (const std::size_t bytes : {159u, 161u, 239u}) {
    rows.data.resize(bytes);
    EXPECT_TRUE(mentions(refusalOf(rows), "row_step 160 is not width x point_step 80")) << refusalOf(rows);
  }
}

TEST_F(CloudGrammar, LengthOfTheData) {
  sensor_msgs::PointCloud2 longer = cloud(), shorter = cloud();
  longer.data.resize(200);
  EXPECT_EQ(read(longer).positions, SQUARE);
  shorter.data.resize(159);
  EXPECT_TRUE(mentions(refusalOf(shorter), "do not fit into data of 159"));
}

TEST_F(CloudGrammar, BigEndian) {
  config.noise_field = "sigma";
  constexpr std::uint8_t FLOAT32 = sensor_msgs::PointField::FLOAT32, FLOAT64 = sensor_msgs::PointField::FLOAT64;
  for (const std::uint8_t datatype : {FLOAT32, FLOAT64}) {
    const std::ptrdiff_t bytes = datatype == sensor_msgs::PointField::FLOAT32 ? 4 : 8;
    sensor_msgs::PointCloud2 message = cloud(datatype);
    sensor_msgs::PointField sigma = message.fields[0];
    sigma.name = "sigma";
    message.fields.push_back(sigma);  // the bytes of z
    anew();
    const DecodedMesh little = read(message);
    message.is_bigendian = true;
    for (std::ptrdiff_t at = 0; at < 160; at += 8) {
      std::reverse(message.data.begin() + at, message.data.begin() + at + bytes);
    }
    anew();
    const DecodedMesh big = read(message);
    EXPECT_EQ(big.positions, little.positions);
    EXPECT_EQ(big.radius_m, little.radius_m);
    EXPECT_EQ(big.radius_m[3], bytes == 4 ? static_cast<double>(0.1f) : 0.1);
  }
}

TEST_F(CloudGrammar, FieldsThatContradict) {
  sensor_msgs::PointCloud2 twice = cloud();
  twice.fields.push_back(twice.fields[3]);
  EXPECT_TRUE(mentions(refusalOf(twice), "two fields 'y'"));
  sensor_msgs::PointCloud2 overlapping = cloud();
  for (auto& field : overlapping.fields) field.offset = 0;
  EXPECT_TRUE(mentions(refusalOf(overlapping), "fields 'x' and 'y' have offsets 0 and 0"));
  overlapping = cloud();
  overlapping.fields[0].offset = 23;
  EXPECT_TRUE(mentions(refusalOf(overlapping), "fields 'y' and 'z' have offsets 24 and 23")) << refusalOf(overlapping);
  overlapping.fields[0].offset = 33;
  EXPECT_TRUE(mentions(refusalOf(overlapping), "reaches past point_step 40"));
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

TEST_F(CloudGrammar, Ropes) {
  EXPECT_EQ(read(cloud()).topology->edges(), (std::vector<Edge>{{0, 1}, {1, 2}, {2, 3}}));
  sensor_msgs::PointCloud2 rows = cloud();
  rows.height = rows.width = 2;
  rows.row_step = 80;
  EXPECT_EQ(read(rows).topology->edges(), (std::vector<Edge>{{0, 1}, {2, 3}})) << "each row is one";
  rows.height = 4;
  rows.width = 1;
  rows.row_step = 40;
  EXPECT_EQ(read(rows).topology->edges().size(), 3u) << "a column is one";
  rows.height = 1;
  EXPECT_TRUE(mentions(refusalOf(rows), "VERTEX_COUNT: 1 points, but a polyline needs 2"));
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
  static deformable_ccd::MeshStamped mesh(const std::vector<Face>& triangles, const Positions& positions = SQUARE) {
    return test::meshStamped({positions, triangles}, 5);
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
  EXPECT_TRUE(mentions(refusalOf(mesh({})), "or set topology/rows and topology/cols for a grid, or"));
  const DecodedMesh first = read(mesh({{0, 1, 2}, {0, 2, 3}}));
  EXPECT_EQ(read(mesh({})).topology, first.topology);
  EXPECT_EQ(read(mesh({{0, 1, 2}, {0, 2, 3}})).topology, first.topology);
  EXPECT_NE(read(mesh({{0, 1, 2}})).topology, first.topology);
  EXPECT_TRUE(mentions(refusalOf(mesh({}, {SQUARE[0], SQUARE[1], SQUARE[2]})), "VERTEX_COUNT"));
}

TEST_F(IndexedGrammar, WithoutAHeader) {
  const shape_msgs::Mesh bare = test::shapeMesh({SQUARE, {{0, 1, 2}}});
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
  bad.polygons = mesh({{0, 2, 1, 3}}).polygons;
  anew();
  EXPECT_TRUE(mentions(refusalOf(bad), "nothing to check"));
  EXPECT_EQ(read(mesh({{0, 1, 2}, {1, 2}, {0}})).dropped_faces, 0u) << "of a face";
}

TEST_F(PolygonMeshGrammar, VerticesThatAreNotThere) {
  EXPECT_TRUE(mentions(refusalOf(mesh({{0, 1, 2}, {0, 1, 2, 7}})), "index 7"));
}

TEST_F(PolygonMeshGrammar, TwoFrames) {
  pcl_msgs::PolygonMesh two = mesh({{0, 1, 2}});
  two.header.frame_id = "world";
  two.cloud.header.frame_id = "camera";
  EXPECT_TRUE(
      mentions(refusalOf(two), "header.frame_id is 'world', and cloud.header.frame_id 'camera': name one frame"));
  two.cloud.header.frame_id.clear();
  EXPECT_EQ(read(two).frame_id, "world");
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
    out.points = test::pointsOf(corners);
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
  scaled.scale.y = -0.0;
  EXPECT_EQ(read(scaled).positions[1], SQUARE[1]) << "all 0: not set";
  scaled.scale.x = 2;
  EXPECT_TRUE(mentions(refusalOf(scaled), "scale is (2, -0, 0)"));
  scaled.scale.y = 2;
  EXPECT_TRUE(mentions(refusalOf(scaled), "scale is (2, 2, 0)"));
  scaled.scale.z = -1;
  EXPECT_EQ(read(scaled).positions[2], Vec3(2, 2, 0)) << "mirrored";
}

TEST_F(MarkerGrammar, OtherTypesAndActions) {
  visualization_msgs::Marker cubes = marker(), gone = marker();
  cubes.type = visualization_msgs::Marker::CUBE_LIST;
  EXPECT_TRUE(mentions(refusalOf(cubes), "no TRIANGLE_LIST marker and no LINE_STRIP"));
  for (const int action : {2, 3}) {  // DELETE, DELETEALL
    gone.action = action;
    EXPECT_TRUE(mentions(refusalOf(gone), "no TRIANGLE_LIST marker"));
    visualization_msgs::MarkerArray both;
    both.markers = {gone, marker()};
    EXPECT_EQ(read(both).positions.size(), 3u) << "what was there before goes, and what follows is the mesh";
    EXPECT_EQ(read(both).dropped_faces, 0u);
  }
}

// RViz shows what came before until it is deleted: it may be a thing, and the newest message does not bring it.
TEST_F(MarkerGrammar, WhatCameBeforeAndIsShownStill) {
  const auto numbered = [](int id, double stamp_s = 1, double lifetime_s = 0) {
    visualization_msgs::Marker one = marker();
    one.id = id;
    one.header.stamp = ros::Time(stamp_s);
    one.lifetime = ros::Duration(lifetime_s);
    return one;
  };
  const auto all = [](std::vector<visualization_msgs::Marker> markers) {
    visualization_msgs::MarkerArray message;
    message.markers = std::move(markers);
    return message;
  };
  for (int id = 7; id < 100; ++id) {
    EXPECT_EQ(read(numbered(id)).dropped_faces > 0, id == 8) << "a stream that is numbered anew each time: " << id;
  }
  const DecodedMesh stays = read(numbered(99));
  EXPECT_EQ(stays.unread_markers, 92u) << "it is none: the others are things";
  EXPECT_EQ(stays.unread_marker, "('cloth', 7), which came before and was not deleted");
  EXPECT_GT(stays.dropped_faces, 0u);

  anew();
  read(numbered(7, 1, 0.5));
  read(numbered(8, 1.1));
  EXPECT_EQ(read(numbered(8, 1.4)).unread_markers, 1u);
  EXPECT_EQ(read(numbered(8, 1.6)).unread_markers, 0u) << "its lifetime is over";

  for (int k = 0; k < 6; ++k) {
    if (k == 0) anew();
    EXPECT_EQ(read(all({numbered(k % 2)})).unread_markers, k == 0 ? 0u : 1u) << "two things in turn";
  }

  anew();
  read(numbered(7));
  visualization_msgs::Marker gone = numbered(7);
  gone.action = visualization_msgs::Marker::DELETE;
  EXPECT_FALSE(refusalOf(gone).empty());
  EXPECT_EQ(read(numbered(8)).unread_markers, 0u);
  EXPECT_EQ(read(numbered(8)).unread_markers, 0u);

  for (const int action : {2, 3}) {
    anew();
    visualization_msgs::Marker beside = numbered(1);
    beside.type = visualization_msgs::Marker::CUBE;
    read(all({numbered(7), beside}));
    EXPECT_EQ(read(all({numbered(7)})).unread_markers, 1u) << "what is beside the mesh was sent once";
    gone = numbered(1);
    gone.action = action;
    EXPECT_EQ(read(all({gone, numbered(7)})).unread_markers, 0u);
  }

  config.is_static = true;
  anew();
  EXPECT_EQ(read(numbered(0)).unread_markers, 0u);
  EXPECT_EQ(read(numbered(1)).unread_markers, 1u) << "boards of a shelf, each sent once";
  EXPECT_EQ(read(numbered(2)).unread_markers, 2u);
  config.marker_id = 1;
  anew();
  read(numbered(1));
  EXPECT_EQ(read(numbered(1)).unread_markers, 0u);
}

// What may be a thing beside the mesh is not passed over in silence.
TEST_F(MarkerGrammar, ThingsBesideTheMesh) {
  // ARROW, CUBE, SPHERE, CYLINDER, CUBE_LIST, TEXT, MESH_RESOURCE, and those that nobody knows
  for (const int type : {0, 1, 2, 3, 6, 9, 10, 12, 99, -1}) {
    anew();
    visualization_msgs::MarkerArray both;
    both.markers = {marker(), marker()};
    both.markers[1].type = type;
    both.markers[1].ns = "table";
    const bool is_drawing = type == 0 || type == 9;
    const DecodedMesh mesh = read(both);
    EXPECT_EQ(mesh.unread_markers, is_drawing ? 0u : 1u) << type;
    EXPECT_EQ(mesh.dropped_faces > 0, !is_drawing) << type;
    if (!is_drawing) EXPECT_EQ(mesh.unread_marker, "('table', 2), type " + std::to_string(type));
    config.marker_namespace = "cloth";
    anew();
    EXPECT_EQ(read(both).dropped_faces, 0u) << "others are left out by choice";
    config.marker_namespace.reset();
  }
}

TEST_F(MarkerGrammar, LifetimeAndFrameLocked) {
  visualization_msgs::Marker kept = marker();
  kept.lifetime = ros::Duration(0.1);
  kept.frame_locked = true;
  kept.color.a = 0;
  EXPECT_EQ(read(kept).positions, read(marker()).positions) << "what RViz makes of it is no matter of the mesh";
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

TEST_F(MarkerGrammar, NamespacesInTurn) {
  visualization_msgs::Marker other = marker();
  other.ns = "guide";
  read(marker());
  const std::string said = refusalOf(other);
  EXPECT_TRUE(mentions(said, "('cloth', 2) and with ('guide', 2) come in turn")) << said;
  EXPECT_TRUE(mentions(said, "name it by marker/namespace")) << said;
  EXPECT_EQ(refusalOf(marker()), said) << "which of the two is the mesh is not known from then on";
  anew();
  visualization_msgs::MarkerArray one, two;
  one.markers = {marker()};
  two.markers = {other};
  read(one);
  EXPECT_TRUE(mentions(refusalOf(two), "come in turn")) << "arrays, too";
  anew();
  one.markers = {marker(), other};
  EXPECT_EQ(read(one).dropped_faces, 1u) << "one array is one frame";
  EXPECT_EQ(read(one).dropped_faces, 1u);
  for (const std::int32_t type : {MARKER_LINE_STRIP, MARKER_LINE_LIST, MARKER_POINTS}) {
    anew();
    config.source = type == MARKER_POINTS ? TopologySource::POLYLINE : TopologySource::AUTO;
    visualization_msgs::Marker rope = marker(SQUARE);
    rope.type = type;
    EXPECT_EQ(read(rope).positions.size(), 4u);
    rope.ns = "guide";
    EXPECT_TRUE(mentions(refusalOf(rope), "('cloth', 2) and with ('guide', 2) come in turn")) << type;
  }
}

TEST_F(MarkerGrammar, IdsInTurn) {
  visualization_msgs::Marker other = marker();
  other.id = 7;
  const DecodedMesh first = read(marker());
  EXPECT_EQ(read(other).topology, first.topology) << "numbered anew";
  const std::string said = refusalOf(marker());
  EXPECT_TRUE(mentions(said, "('cloth', 7) and with ('cloth', 2) come in turn")) << said;
  EXPECT_TRUE(mentions(said, "name it by marker/id")) << said;
  EXPECT_EQ(refusalOf(other), said);
}

TEST_F(MarkerGrammar, WhatIsPassedOver) {
  bool things = false;
  const auto isPassedOver = [&](const auto& message) {
    try {
      read(message);
    } catch (const PassedOver& others) {
      things = others.may_be_things;
      return true;
    } catch (const MeshError&) {
    }
    return false;
  };
  visualization_msgs::Marker other = marker(), gone = marker(), arrow = marker();
  other.ns = "guide";
  gone.action = visualization_msgs::Marker::DELETEALL;
  arrow.type = visualization_msgs::Marker::ARROW;
  arrow.id = 3;
  EXPECT_FALSE(isPassedOver(arrow)) << "nothing of this topic is a mesh yet";
  read(marker());
  EXPECT_TRUE(isPassedOver(arrow)) << "drawn besides";
  EXPECT_FALSE(things);
  visualization_msgs::Marker cube = arrow;
  cube.type = visualization_msgs::Marker::CUBE;
  EXPECT_TRUE(isPassedOver(cube));
  EXPECT_TRUE(things);
  arrow.id = marker().id;
  EXPECT_FALSE(isPassedOver(arrow)) << "in the place of the mesh";
  EXPECT_TRUE(isPassedOver(gone));
  EXPECT_FALSE(things);
  EXPECT_FALSE(isPassedOver(other)) << "two meshes, or is it one?";
  anew();
  config.marker_namespace = "cloth";
  visualization_msgs::MarkerArray none, others;
  others.markers = {other, other};
  EXPECT_TRUE(isPassedOver(other));
  EXPECT_TRUE(things) << "by choice, but things";
  EXPECT_TRUE(isPassedOver(others));
  EXPECT_FALSE(isPassedOver(none)) << "a tracker that sees nothing";
  EXPECT_EQ(read(marker()).positions.size(), 3u);
  EXPECT_TRUE(isPassedOver(other));
  EXPECT_EQ(read(marker()).positions.size(), 3u) << "what others say contradicts nothing";
  anew();
  config.marker_id = 2;
  other.ns = "cloth";
  other.id = 7;
  EXPECT_EQ(read(marker()).positions.size(), 3u);
  EXPECT_TRUE(isPassedOver(other));
  EXPECT_EQ(read(marker()).positions.size(), 3u);
}

// --- ropes as markers

struct RopeGrammar : MarkerGrammar {
  using Edges = std::vector<Edge>;
  static visualization_msgs::Marker rope(std::int32_t type, const Positions& points, std::int32_t id = 0) {
    visualization_msgs::Marker out = marker(points);
    out.ns = "rope";
    out.id = id;
    out.type = type;
    out.scale.x = 0.01;
    return out;
  }
  static visualization_msgs::Marker strip(const Positions& points, std::int32_t id = 0) {
    return rope(visualization_msgs::Marker::LINE_STRIP, points, id);
  }
  static visualization_msgs::Marker segments(const Positions& points, std::int32_t id = 0) {
    return rope(visualization_msgs::Marker::LINE_LIST, points, id);
  }
  static visualization_msgs::MarkerArray all(const std::vector<visualization_msgs::Marker>& markers) {
    visualization_msgs::MarkerArray out;
    out.markers = markers;
    return out;
  }
  const Vec3 a{0, 0, 0}, b{1, 0, 0}, c{2, 0, 0}, d{2, 1, 0}, e{2, 2, 0};
};

TEST_F(RopeGrammar, Strips) {
  visualization_msgs::Marker moved = strip({a, b, c, d});
  moved.pose.position.z = 2;
  const DecodedMesh mesh = read(moved);
  EXPECT_EQ(mesh.topology->edges(), (Edges{{0, 1}, {1, 2}, {2, 3}}));
  EXPECT_EQ(mesh.positions[3], Vec3(2, 1, 2)) << "the pose moves it, the scale is how thick it is drawn";
  EXPECT_FALSE(mesh.topology->hasFaces());
  EXPECT_EQ(read(strip({e, b, c, d})).topology, mesh.topology) << "the same rope in motion";
  EXPECT_TRUE(mentions(refusalOf(strip({a})), "has 1 point, and a rope needs 2"));
  EXPECT_TRUE(mentions(refusalOf(strip({})), "('rope', 0, type 4 without points)"));
}

TEST_F(RopeGrammar, PointsThatRepeat) {
  const Edges by_one = {{0, 1}, {1, 4}, {4, 5}};
  const DecodedMesh mesh = read(strip({a, b, b, b, c, d}));
  EXPECT_EQ(mesh.topology->edges(), by_one) << "equal ones are one; else those before and after touch there";
  EXPECT_EQ(mesh.positions.size(), 6u) << "each point of the message is a vertex";
  EXPECT_EQ(read(strip({a, c, c, c, d, e})).topology, mesh.topology) << "in motion";
  EXPECT_EQ(read(strip({a, b, c, d, d, e})).topology->edges(), (Edges{{0, 1}, {1, 2}, {2, 3}, {3, 5}})) << "two";
  EXPECT_EQ(read(strip({a, b, c, e, e, e, e})).topology->edges(), (Edges{{0, 1}, {1, 2}, {2, 3}})) << "at the end";
  EXPECT_EQ(read(strip({a, a, a, b, c, a, a, a})).topology->edges(), (Edges{{0, 3}, {0, 4}, {3, 4}})) << "a loop";
  anew();
  config.source = TopologySource::POLYLINE;
  EXPECT_EQ(read(rope(MARKER_POINTS, {a, b, b, b, c, d})).topology->edges(), by_one);
  EXPECT_TRUE(mentions(refusalOf(rope(MARKER_POINTS, {a, a, a})), "the lines have no length"));
}

TEST_F(RopeGrammar, ClosedStrips) {
  const DecodedMesh loop = read(strip({a, b, c, d, a}));
  EXPECT_EQ(loop.positions, (Positions{a, b, c, d}));
  EXPECT_EQ(loop.topology->edges(), (Edges{{0, 1}, {0, 3}, {1, 2}, {2, 3}}));
  EXPECT_TRUE(mentions(refusalOf(strip({a, a})), "the lines have no length"));
}

TEST_F(RopeGrammar, Segments) {
  const DecodedMesh chain = read(segments({a, b, b, c, c, d}));
  EXPECT_EQ(chain.positions, (Positions{a, b, c, d}));
  EXPECT_EQ(chain.topology->edges(), (Edges{{0, 1}, {1, 2}, {2, 3}}));
  const DecodedMesh fork = read(segments({a, b, d, b, b, c}));
  EXPECT_EQ(fork.positions, (Positions{a, b, d, c}));
  EXPECT_EQ(fork.topology->edges(), (Edges{{0, 1}, {1, 2}, {1, 3}}));
  EXPECT_TRUE(mentions(refusalOf(segments({a, b, c})), "has 3 points, and a LINE_LIST two for each segment"));
  anew();
  config.weld = false;
  EXPECT_EQ(read(segments({a, b, b, c})).positions.size(), 4u);
}

TEST_F(RopeGrammar, SegmentsWithoutALength) {
  EXPECT_EQ(read(segments({a, b, b, b, b, c})).topology->edges(), (Edges{{0, 1}, {1, 2}}));
  EXPECT_TRUE(mentions(refusalOf(segments({a, a})), "the lines have no length"));
}

TEST_F(RopeGrammar, WhatComesApartOrTogether) {
  const DecodedMesh two = read(segments({a, b, c, d}));
  EXPECT_EQ(two.positions.size(), 4u);
  EXPECT_EQ(read(segments({a, b, b, d})).topology, two.topology) << "what touches later is contact, no joint";
  anew();
  const DecodedMesh chain = read(segments({a, b, b, c, c, d}));
  EXPECT_EQ(read(segments({a, c, c, d, d, e})).topology, chain.topology);
  const DecodedMesh cut = read(segments({a, b, c, d, d, e}));
  EXPECT_NE(cut.topology, chain.topology) << "a seam";
  EXPECT_EQ(cut.topology->edges(), (Edges{{0, 1}, {2, 3}, {3, 4}}));
  EXPECT_EQ(cut.weld_changes, 1u);
  EXPECT_EQ(read(segments({b, c, d, e, c, d})).topology->edges(), (Edges{{0, 1}, {1, 2}, {2, 3}})) << "joined anew";
  EXPECT_NE(*read(segments({a, b, b, c})).topology, *chain.topology) << "another number of points";
}

TEST_F(RopeGrammar, Points) {
  EXPECT_TRUE(mentions(refusalOf(rope(visualization_msgs::Marker::POINTS, SQUARE)), "set topology/source to polyline"));
  anew();
  config.source = TopologySource::POLYLINE;
  for (const std::int32_t type : {MARKER_POINTS, MARKER_SPHERE_LIST}) {
    const DecodedMesh mesh = read(rope(type, {a, b, c, a}));
    EXPECT_EQ(mesh.topology->edges(), (Edges{{0, 1}, {1, 2}, {2, 3}})) << "no end is joined";
    EXPECT_EQ(read(all({rope(type, {a, b}, 1), rope(type, {c, d}, 2)})).topology->edges(), (Edges{{0, 1}, {2, 3}}));
  }
  EXPECT_TRUE(mentions(refusalOf(marker()), "no LINE_STRIP, LINE_LIST or POINTS")) << "a triangle list";
  anew();
  config.source = TopologySource::AUTO;
  config.rows = config.cols = 2;
  EXPECT_EQ(read(rope(visualization_msgs::Marker::POINTS, SQUARE)).topology->faces().size(), 2u);
}

TEST_F(RopeGrammar, SeveralRopes) {
  const DecodedMesh two = read(all({strip({c, d, e}, 7), strip({a, b}, 3)}));
  EXPECT_EQ(two.positions, (Positions{a, b, c, d, e})) << "by namespace and id, in whatever order they come";
  EXPECT_EQ(two.topology->edges(), (Edges{{0, 1}, {2, 3}, {3, 4}}));
  EXPECT_EQ(read(all({strip({a, b}, 3), strip({c, d, e}, 7)})).topology, two.topology);
  const std::string other = refusalOf(all({strip({a, b}, 3), strip({c, d, e}, 8)}));
  EXPECT_TRUE(mentions(other, "('rope', 8) stands where ('rope', 7) was")) << other;
  EXPECT_EQ(read(all({strip({a, b}, 3), strip({c, d, e}, 7)})).topology, two.topology) << "what was known stays";
  EXPECT_EQ(read(all({strip({a, b}, 3), strip({c, d}, 8)})).topology->edges().size(), 2u) << "another topology";
  const DecodedMesh pair = read(all({strip({a, b}, 1), strip({d, e}, 2)}));
  EXPECT_EQ(read(all({strip({a, b}, 3), strip({d, e}, 4)})).topology, pair.topology) << "all are numbered anew";
  EXPECT_TRUE(mentions(refusalOf(all({strip({a, b}, 4), strip({d, e}, 5)})), "('rope', 4) stands where"));
  EXPECT_EQ(read(strip({a, b, c}, 1)).topology, read(strip({a, b, c}, 2)).topology) << "one alone has any id";
  EXPECT_EQ(read(all({strip({a, b}, 1), strip({b, c}, 2)})).topology->edges(), (Edges{{0, 1}, {1, 2}})) << "one rope";
  visualization_msgs::Marker far = strip({c, d}, 2);
  far.header.frame_id = "camera";
  const std::string frames = refusalOf(all({strip({a, b}, 1), far}));
  EXPECT_TRUE(mentions(frames, "('rope', 2) is in frame 'camera', and ('rope', 1) in frame 'world'")) << frames;
}

TEST_F(RopeGrammar, StampsOfSeveralRopes) {
  const auto stamped = [&](std::int32_t id, const Positions& points, double stamp_s) {
    visualization_msgs::Marker one = strip(points, id);
    one.header.stamp = ros::Time(stamp_s);
    return one;
  };
  const auto pair = [&](double one_s, double other_s) {
    return all({stamped(1, {a, b}, one_s), stamped(2, {d, e}, other_s)});
  };
  EXPECT_EQ(read(pair(5.0005, 5)).stamp_ns, 5'000'000'000) << "the earliest, wherever it stands";
  EXPECT_EQ(read(pair(6, 6.001)).stamp_ns, 6'000'000'000);
  const std::string late = refusalOf(pair(7, 7.0011));
  EXPECT_TRUE(mentions(late, "('rope', 2) is stamped 0.001100 s after ('rope', 1)")) << late;
  const std::string early = refusalOf(pair(8, 7));
  EXPECT_TRUE(mentions(early, "('rope', 1) is stamped 1.000000 s after ('rope', 2)")) << early;
}

TEST_F(RopeGrammar, WhatIsDrawnBesides) {
  const visualization_msgs::Marker dots = rope(visualization_msgs::Marker::SPHERE_LIST, {a, b, c}, 1);
  EXPECT_EQ(read(all({dots, strip({a, b, c}, 2)})).positions.size(), 3u) << "points of a rope's lines";
  anew();
  anew();
  const Positions corners = read(marker()).positions;
  for (const auto& [points, unread] : {std::pair(corners, 0u), {Positions{corners[0], {0, 0, 7}}, 1u}}) {
    const DecodedMesh mesh = read(all({strip(points, 2), marker()}));
    EXPECT_TRUE(mesh.topology->hasFaces()) << "lines on a mesh";
    EXPECT_EQ(mesh.unread_markers, unread) << "lines that leave it may be a rope of their own";
    EXPECT_EQ(mesh.dropped_faces, unread == 0 ? 0u : points.size());
  }
  anew();
  const DecodedMesh rope_alone = read(all({dots, strip({{5, 5, 5}, b, c}, 2)}));
  EXPECT_EQ(rope_alone.dropped_faces, 3u) << "one of the points is none of the line's";
  config.marker_namespace = "rope";
  anew();
  EXPECT_FALSE(read(all({strip({a, b, c}, 2), marker()})).topology->hasFaces()) << "lines that are asked for";
}

TEST_F(RopeGrammar, ATopologyThatIsGiven) {
  config.source = TopologySource::FILE;
  config.file_topology =
      std::make_shared<const Topology>(Topology::fromTriangles(4, std::vector<Face>{{0, 1, 2}, {0, 2, 3}}));
  EXPECT_EQ(read(strip(SQUARE)).topology, config.file_topology);
  EXPECT_TRUE(mentions(refusalOf(strip({a, b, c})), "VERTEX_COUNT: 3 points, but the topology file has 4"));
}

// --- geometry_msgs/PoseArray

struct PoseArrayGrammar : RopeGrammar {
  static geometry_msgs::PoseArray poses(const Positions& points) {
    geometry_msgs::PoseArray out;
    out.header.frame_id = "world";
    out.poses.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      out.poses[i].position = test::pointsOf(points)[i];
      out.poses[i].orientation.x = NOT_A_NUMBER;  // of no matter
    }
    return out;
  }
};

TEST_F(PoseArrayGrammar, Positions) {
  const DecodedMesh mesh = read(poses(SQUARE));
  EXPECT_EQ(mesh.positions, SQUARE);
  EXPECT_EQ(mesh.topology->edges(), (Edges{{0, 1}, {1, 2}, {2, 3}}));
  EXPECT_NE(read(poses({a, b, c})).topology, mesh.topology) << "another number is another topology";
  EXPECT_FALSE(read(poses({a, {NOT_A_NUMBER, 0, 0}, c})).positions[1].allFinite()) << "unchecked";
  EXPECT_EQ(read(poses({a, b, b, b, c})).topology->edges(), (Edges{{0, 1}, {1, 4}}));
  EXPECT_TRUE(mentions(refusalOf(poses({a, a, a})), "all points of a line are one"));
  EXPECT_TRUE(mentions(refusalOf(poses({a})), "VERTEX_COUNT: 1 points, but a polyline needs 2"));
  EXPECT_TRUE(mentions(refusalOf(poses({})), "there are no vertices"));
  anew();
  config.noise_field = "sigma";
  EXPECT_TRUE(mentions(refusalOf(poses(SQUARE)), "this type has no point fields"));
}

TEST_F(PoseArrayGrammar, ATopologyThatIsGiven) {
  config.rows = config.cols = 2;
  EXPECT_EQ(read(poses(SQUARE)).topology->faces().size(), 2u);
  EXPECT_TRUE(mentions(refusalOf(poses({a, b})), "topology/rows x topology/cols is 2 x 2"));
}

}  // namespace
}  // namespace dccd
