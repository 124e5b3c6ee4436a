#include "input/mesh_decoder.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "ros/support/bytes_of.h"
#include "ros/support/meshes.h"
#include "support/said.h"

namespace dccd {
namespace {

using test::mentions;

const Positions SQUARE = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
const std::vector<Face> HALVES = {{0, 1, 2}, {0, 2, 3}};

deformable_ccd::MeshStamped mesh(const Positions& points, const std::vector<Face>& faces) {
  return test::meshStamped({points, faces}, 5);
}

visualization_msgs::Marker marker(const Positions& corners) {
  std::vector<Face> faces;
  for (Index i = 0; i < corners.size(); i += 3) faces.push_back({i, i + 1, i + 2});
  return test::soup({corners, faces}, 5).markers[0];
}

pcl_msgs::PolygonMesh polygonMesh(const Positions& points, const std::vector<std::vector<Index>>& polygons) {
  pcl_msgs::PolygonMesh out = test::polygonMesh({points, {}}, 5);
  out.polygons.resize(polygons.size());
  for (std::size_t i = 0; i < polygons.size(); ++i) out.polygons[i].vertices = polygons[i];
  return out;
}

// As a bag may have them, whose writer took one message type for another.
TEST(MessageBytes, ThatAreLeftOverAreOfAnotherMessage) {
  std::vector<std::uint8_t> bytes = test::bytesOf(mesh(SQUARE, HALVES));
  const auto read = [&] { MeshDecoder({}).decode("deformable_ccd/MeshStamped", {bytes.data(), bytes.size()}); };
  EXPECT_NO_THROW(read());
  bytes.push_back(0);
  EXPECT_TRUE(
      mentions(test::said<MeshError>(read), "1 bytes stand after a message of type deformable_ccd/MeshStamped"));
}

template <typename Message>
DecodedMesh decode(MeshDecoder& decoder, const Message& message) {
  const MeshType& type = *findMeshType(ros::message_traits::datatype(message));
  const std::vector<std::uint8_t> bytes = test::bytesOf(message);
  return decoder.decode(type.datatype, {bytes.data(), bytes.size()});
}
template <typename Message>
std::string errorOf(const MeshInputConfig& config, const Message& message) {
  MeshDecoder decoder(config);
  return test::said<MeshError>([&] { decode(decoder, message); });
}

MeshInputConfig grid(std::size_t rows, std::size_t cols) {
  MeshInputConfig config;
  config.source = TopologySource::GRID;
  config.rows = rows;
  config.cols = cols;
  return config;
}

TEST(MeshDecoder, WhatTrianglesLackIsMissingAsLongAsTheyHold) {
  MeshDecoder decoder({});
  Positions five = SQUARE;
  five.push_back({2, 2, 0});
  const auto with_an_edge = mesh(five, {HALVES[0], HALVES[1], {2, 4, 4}});
  EXPECT_EQ(decode(decoder, with_an_edge).dropped_faces, 1u) << "the edge from 2 to 4 is in no face";
  for (int k = 0; k < 3; ++k) EXPECT_EQ(decode(decoder, mesh(five, {})).dropped_faces, 1u) << "vertices alone";
  EXPECT_EQ(decode(decoder, mesh(five, HALVES)).dropped_faces, 0u);
  EXPECT_EQ(decode(decoder, mesh(five, {})).dropped_faces, 0u);
}

const Positions DART = {{0, 0, 0}, {2, 1, 0}, {0, 2, 0}, {1.5, 1, 0}};
const std::vector<Face> DART_FACES = {{3, 0, 1}, {1, 2, 3}};

TEST(MeshDecoder, AConcavePolygonStaysInItsOutlineAndItsTrianglesHold) {
  MeshDecoder decoder({});
  const DecodedMesh dart = decode(decoder, polygonMesh(DART, {{0, 1, 2, 3}}));
  EXPECT_EQ(dart.topology->faces(), DART_FACES) << "none lies over the notch";
  EXPECT_EQ(dart.dropped_faces, 0u);
  // As a convex one it would be cut by its other diagonal, and this one is at first not there.
  Positions later = DART;
  later[3] = {-1, 1, 0};
  EXPECT_EQ(decode(decoder, polygonMesh(later, {{0, 1, 2, 3}})).topology, dart.topology);
  EXPECT_EQ(decode(decoder, polygonMesh(later, {})).topology, dart.topology);
  MeshDecoder other({});
  EXPECT_EQ(decode(other, polygonMesh(later, {{0, 1, 2, 3}})).topology->faces(),
            (std::vector<Face>{{0, 1, 2}, {0, 2, 3}}));
}

TEST(MeshDecoder, APolygonIsChosenWhenAllOfItIsSeenAndUntilThenUnchecked) {
  Positions points = DART;
  points.push_back({5, 5, 5});
  Positions gap = points;
  gap[2].y() = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::vector<Index>> polygons = {{0, 1, 4}, {0, 1, 2, 3}};
  for (const bool polygons_again : {true, false}) {
    MeshDecoder decoder({});
    const DecodedMesh first = decode(decoder, polygonMesh(gap, polygons));
    EXPECT_EQ(first.topology->faces(), (std::vector<Face>{{0, 1, 4}}));
    EXPECT_EQ(first.dropped_faces, 1u);
    const auto next = [&](const Positions& p) {
      return decode(decoder, polygons_again ? polygonMesh(p, polygons) : polygonMesh(p, {}));
    };
    EXPECT_EQ(next(gap).topology, first.topology);
    EXPECT_EQ(next(gap).dropped_faces, 1u);
    const DecodedMesh whole = next(points);
    EXPECT_EQ(whole.topology->faces(), (std::vector<Face>{{0, 1, 4}, DART_FACES[0], DART_FACES[1]}));
    EXPECT_EQ(whole.dropped_faces, 0u);
    EXPECT_EQ(next(gap).topology, whole.topology) << "what it is, is known now";
    EXPECT_EQ(next(gap).dropped_faces, 0u);
  }
}

TEST(MeshDecoder, FacesOfAFileThatCannotBeUsedAreMissingInEachFrameThatUsesIt) {
  MeshInputConfig config;
  config.source = TopologySource::FILE;
  config.file_topology = std::make_shared<const Topology>(Topology::fromTriangles(4, HALVES));
  config.file_dropped_faces = 7;
  MeshDecoder decoder(config);
  for (int k = 0; k < 2; ++k) {
    EXPECT_EQ(decode(decoder, test::cloud(SQUARE, 5)).dropped_faces, 7u);
    EXPECT_EQ(decode(decoder, mesh(SQUARE, {})).dropped_faces, 7u);
    EXPECT_EQ(decode(decoder, polygonMesh(SQUARE, {})).dropped_faces, 7u);
  }
}

TEST(MeshDecoder, WhatIsRefusedLeavesItAsItWas) {
  MeshDecoder decoder({});
  const auto topology = decode(decoder, mesh(SQUARE, HALVES)).topology;
  EXPECT_THROW(decode(decoder, mesh(SQUARE, {{1, 1, 2}, {3, 0, 0}})), MeshError) << "no triangle at all";
  EXPECT_THROW(decode(decoder, mesh(SQUARE, {{0, 1, 9}})), MeshError);
  EXPECT_EQ(decode(decoder, mesh(SQUARE, {})).topology, topology);
  // A soup of which every triangle is a point says nothing about the next one, whose triangles share an edge.
  MeshDecoder soups({});
  EXPECT_THROW(decode(soups, marker({SQUARE[0], SQUARE[0], SQUARE[0], SQUARE[1], SQUARE[1], SQUARE[1]})), MeshError);
  const Positions halves = {SQUARE[0], SQUARE[1], SQUARE[2], SQUARE[0], SQUARE[2], SQUARE[3]};
  EXPECT_EQ(decode(soups, marker(halves)).positions.size(), 4u);
}

TEST(MeshDecoder, OneTriangleIsNotTheGridBeforeIt) {
  Positions points;
  for (int k = 0; k < 16; ++k) points.push_back({k / 8 * 1.0, k % 8 * 1.0, 0});
  MeshInputConfig config;
  config.rows = 2;
  config.cols = 8;
  MeshDecoder decoder(config);
  EXPECT_EQ(decode(decoder, mesh(points, {})).topology->faces().size(), 14u);
  // Its indices are rows and columns.
  EXPECT_EQ(decode(decoder, mesh(points, {{2, 8, 0}})).topology->faces().size(), 1u);
}

// Its triangles would join points that are far apart.
TEST(MeshDecoder, ACloudInRowsIsNoGridOfAnotherShape) {
  Positions points;
  for (int k = 0; k < 12; ++k) points.push_back({k / 4 * 1.0, k % 4 * 1.0, 0});
  sensor_msgs::PointCloud2 cloud = test::cloud(points, 5);
  EXPECT_EQ(errorOf(grid(4, 3), cloud), "") << "in one row it may have any";
  cloud.height = 3;
  cloud.width = 4;
  cloud.row_step = cloud.width * cloud.point_step;
  EXPECT_EQ(errorOf(grid(3, 4), cloud), "");
  EXPECT_EQ(errorOf(grid(4, 3), cloud), "12 points, but in 3 rows of 4, and topology/rows x topology/cols is 4 x 3");
}

TEST(MeshDecoder, RefusesOtherTypesAndWhatIsTooMuch) {
  EXPECT_TRUE(
      mentions(test::said<MeshError>([] { MeshDecoder({}).decode("std_msgs/String", {}); }), "std_msgs/String"));
  MeshInputConfig small;
  small.max_vertices = 3;
  EXPECT_TRUE(mentions(errorOf(small, mesh(SQUARE, HALVES)), "4 vertices are more than a mesh may have, 3"));
  small.max_vertices = 4;
  EXPECT_EQ(errorOf(small, mesh(SQUARE, HALVES)), "") << "so many may be";
  // Whatever makes the triangles: the message, its shape, or corners by three.
  small = grid(2, 2);
  small.max_faces = 1;
  EXPECT_TRUE(mentions(errorOf(small, test::cloud(SQUARE, 5)), "2 triangles are more than the 1"));
  small.source = TopologySource::AUTO;
  small.rows = small.cols = 0;
  EXPECT_TRUE(mentions(errorOf(small, mesh(SQUARE, HALVES)), "2 triangles are more than the 1"));
  small.max_faces = 0;
  EXPECT_TRUE(mentions(errorOf(small, marker({SQUARE[0], SQUARE[1], SQUARE[2]})), "1 triangles are more"));
}

/// Every truncation is refused, and random bytes do no more than fail.
template <typename Message>
void expectOnlyWholeOnesAreRead(const MeshInputConfig& config, const Message& message) {
  const MeshType& type = *findMeshType(ros::message_traits::datatype(message));
  const std::vector<std::uint8_t> whole = test::bytesOf(message);
  const auto statusOf = [&](const std::vector<std::uint8_t>& bytes, std::size_t size) {
    try {
      const DecodedMesh mesh = MeshDecoder(config).decode(type.datatype, {bytes.data(), size});
      EXPECT_EQ(mesh.positions.size(), mesh.topology->vertexCount());
    } catch (const MeshError& error) {
      return error.status;
    }
    return StepStatus::OK;
  };
  EXPECT_EQ(statusOf(whole, whole.size()), StepStatus::OK);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_EQ(statusOf(whole, size), StepStatus::BAD_MESSAGE) << type.datatype << " cut to " << size;
  }
  std::mt19937 random(7);
  for (int i = 0; i < 7000; ++i) {
    std::vector<std::uint8_t> bytes = whole;
    for (int k = 0; k < 4; ++k) bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
    statusOf(bytes, bytes.size());
  }
}

TEST(MeshDecoder, PartsAndRandomBytesDoNoMoreThanFail) {
  expectOnlyWholeOnesAreRead({}, mesh(SQUARE, HALVES));
  expectOnlyWholeOnesAreRead(grid(2, 2), test::cloud(SQUARE, 5));
  expectOnlyWholeOnesAreRead({}, marker({SQUARE[0], SQUARE[1], SQUARE[2]}));
}

TEST(MeshDecoder, WeldsTheFirstFrameAndComesApartForGood) {
  const Vec3 a(0, 0, 0), b(1, 0, 0), c(0, 1, 0), d(1, 1, 0);
  MeshDecoder decoder({});
  const DecodedMesh first = decode(decoder, marker({a, b, c, c, b, d}));
  EXPECT_EQ(first.topology->vertexCount(), 4u);
  EXPECT_EQ(first.topology->edges().size(), 5u);
  const Vec3 away(0, 1, 0.5);
  const DecodedMesh apart = decode(decoder, marker({a, b, c, away, b, d}));
  EXPECT_EQ(apart.weld_changes, 1u);
  EXPECT_EQ(apart.topology->vertexCount(), 5u);
  const DecodedMesh again = decode(decoder, marker({a, b, c, c, b, d}));
  EXPECT_EQ(again.weld_changes, 0u);
  EXPECT_EQ(again.topology, apart.topology) << "what touches again is contact, not mesh";
  MeshInputConfig off;
  off.weld = false;
  MeshDecoder loose(off);
  EXPECT_EQ(decode(loose, marker({a, b, c, c, b, d})).topology->vertexCount(), 6u);
}

}  // namespace
}  // namespace dccd
