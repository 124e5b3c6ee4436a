#include "input/mesh_decoder.h"
#include "support/said.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace dccd {
namespace {

/// Serialises as ROS does, with lies where a test wants them.
struct Bytes {
  std::vector<std::uint8_t> data;
  template <typename T>
  Bytes& put(T value) {
    const auto* at = reinterpret_cast<const std::uint8_t*>(&value);
    data.insert(data.end(), at, at + sizeof(T));
    return *this;
  }
  Bytes& text(const std::string& s) {
    put<std::uint32_t>(static_cast<std::uint32_t>(s.size()));
    data.insert(data.end(), s.begin(), s.end());
    return *this;
  }
  Bytes& header(const std::string& frame = "world") {
    return put<std::uint32_t>(0).put<std::uint32_t>(5).put<std::uint32_t>(0).text(frame);
  }
  Bytes& points(const Positions& points) {
    put<std::uint32_t>(static_cast<std::uint32_t>(points.size()));
    for (const Vec3& p : points) put(p.x()).put(p.y()).put(p.z());
    return *this;
  }
};

Bytes mesh(const Positions& points, const std::vector<Face>& faces) {
  Bytes out;
  out.header().points(points).put<std::uint32_t>(static_cast<std::uint32_t>(faces.size()));
  for (const Face& f : faces) out.put(f);
  return out;
}

Bytes marker(const Positions& corners, double x = 0) {
  Bytes out;
  out.header().text("cloth").put<std::int32_t>(2).put(MARKER_TRIANGLE_LIST).put(MARKER_ADD).put(x);
  for (const double value : {0., 0., 0., 0., 0., 1., 1., 1., 1.})
    out.put(value);  // the rest of the pose, and the scale
  for (int i = 0; i < 4; ++i) out.put(1.0f);
  out.put<std::uint64_t>(0).put<std::uint8_t>(0).points(corners);
  return out.put<std::uint32_t>(0).text("").text("").put<std::uint8_t>(0);
}

Bytes cloud() {
  Bytes out;
  out.header().put<std::uint32_t>(1).put<std::uint32_t>(4).put<std::uint32_t>(3);
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    out.text(std::string(1, static_cast<char>('x' + axis))).put(4 * axis).put<std::uint8_t>(7).put<std::uint32_t>(1);
  }
  out.put<std::uint8_t>(0).put<std::uint32_t>(16).put<std::uint32_t>(64).put<std::uint32_t>(64);
  for (int i = 0; i < 16; ++i) out.put(static_cast<float>(i));
  return out.put<std::uint8_t>(1);
}

DecodedMesh decode(MeshDecoder& decoder, const char* type, const Bytes& bytes) {
  return decoder.decode(type, {bytes.data.data(), bytes.data.size()});
}
std::string errorOf(MeshInputConfig config, const char* type, const Bytes& bytes) {
  MeshDecoder decoder(config);
  try {
    decode(decoder, type, bytes);
  } catch (const MeshError& error) {
    return std::string(toString(error.status)) + ": " + error.what();
  }
  return "";
}
using test::mentions;

constexpr const char* MESH = "deformable_ccd/MeshStamped";
constexpr const char* CLOUD = "sensor_msgs/PointCloud2";
constexpr const char* MARKER = "visualization_msgs/Marker";
const Positions SQUARE = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
const std::vector<Face> HALVES = {{0, 1, 2}, {0, 2, 3}};

MeshInputConfig grid(std::size_t rows, std::size_t cols) {
  MeshInputConfig config;
  config.source = TopologySource::GRID;
  config.rows = rows;
  config.cols = cols;
  return config;
}

TEST(MeshDecoder, KeepsOneTopologyWhileItIsTheSame) {
  MeshDecoder decoder({});
  const DecodedMesh a = decode(decoder, MESH, mesh(SQUARE, HALVES));
  EXPECT_EQ(a.stamp_ns, 5000000000);
  EXPECT_EQ(a.frame_id, "world");
  EXPECT_EQ(a.topology->edges().size(), 5u);
  EXPECT_EQ(decode(decoder, MESH, mesh(SQUARE, HALVES)).topology, a.topology);
  EXPECT_EQ(decode(decoder, MESH, mesh(SQUARE, {})).topology, a.topology) << "triangles sent once hold on";
  EXPECT_NE(decode(decoder, MESH, mesh(SQUARE, {{0, 1, 2}})).topology, a.topology);
}

TEST(MeshDecoder, WhatTrianglesLackIsMissingAsLongAsTheyHold) {
  MeshDecoder decoder({});
  Positions five = SQUARE;
  five.push_back({2, 2, 0});
  const Bytes with_an_edge = mesh(five, {HALVES[0], HALVES[1], {2, 4, 4}});
  EXPECT_EQ(decode(decoder, MESH, with_an_edge).dropped_faces, 1u) << "the edge from 2 to 4 is in no face";
  for (int k = 0; k < 3; ++k) EXPECT_EQ(decode(decoder, MESH, mesh(five, {})).dropped_faces, 1u) << "vertices alone";
  EXPECT_EQ(decode(decoder, MESH, mesh(five, HALVES)).dropped_faces, 0u);
  EXPECT_EQ(decode(decoder, MESH, mesh(five, {})).dropped_faces, 0u);
}

/// pcl_msgs/PolygonMesh with vertices of double precision.
Bytes polygonMesh(const Positions& points, const std::vector<std::vector<Index>>& polygons) {
  const auto count = static_cast<std::uint32_t>(points.size());
  Bytes out;
  out.header().header().put<std::uint32_t>(1).put(count).put<std::uint32_t>(3);
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    out.text(std::string(1, static_cast<char>('x' + axis))).put(8 * axis).put<std::uint8_t>(8).put<std::uint32_t>(1);
  }
  out.put<std::uint8_t>(0).put<std::uint32_t>(24).put(24 * count).put(24 * count);
  for (const Vec3& p : points) out.put(p.x()).put(p.y()).put(p.z());
  out.put<std::uint8_t>(1).put(static_cast<std::uint32_t>(polygons.size()));
  for (const std::vector<Index>& polygon : polygons) {
    out.put(static_cast<std::uint32_t>(polygon.size()));
    for (const Index v : polygon) out.put(v);
  }
  return out;
}
constexpr const char* POLYGONS = "pcl_msgs/PolygonMesh";
const Positions DART = {{0, 0, 0}, {2, 1, 0}, {0, 2, 0}, {1.5, 1, 0}};
const std::vector<Face> DART_FACES = {{3, 0, 1}, {1, 2, 3}};

TEST(MeshDecoder, AConcavePolygonStaysInItsOutlineAndItsTrianglesHold) {
  MeshDecoder decoder({});
  const DecodedMesh dart = decode(decoder, POLYGONS, polygonMesh(DART, {{0, 1, 2, 3}}));
  EXPECT_EQ(dart.topology->faces(), DART_FACES) << "none lies over the notch";
  EXPECT_EQ(dart.dropped_faces, 0u);
  // As a convex one it would be cut by its other diagonal, and this one is at first not there.
  Positions later = DART;
  later[3] = {-1, 1, 0};
  EXPECT_EQ(decode(decoder, POLYGONS, polygonMesh(later, {{0, 1, 2, 3}})).topology, dart.topology);
  EXPECT_EQ(decode(decoder, POLYGONS, polygonMesh(later, {})).topology, dart.topology);
  MeshDecoder other({});
  EXPECT_EQ(decode(other, POLYGONS, polygonMesh(later, {{0, 1, 2, 3}})).topology->faces(),
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
    const DecodedMesh first = decode(decoder, POLYGONS, polygonMesh(gap, polygons));
    EXPECT_EQ(first.topology->faces(), (std::vector<Face>{{0, 1, 4}}));
    EXPECT_EQ(first.dropped_faces, 1u);
    const auto next = [&](const Positions& p) {
      return decode(decoder, POLYGONS, polygons_again ? polygonMesh(p, polygons) : polygonMesh(p, {}));
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
    EXPECT_EQ(decode(decoder, CLOUD, cloud()).dropped_faces, 7u);
    EXPECT_EQ(decode(decoder, MESH, mesh(SQUARE, {})).dropped_faces, 7u);
    EXPECT_EQ(decode(decoder, POLYGONS, polygonMesh(SQUARE, {})).dropped_faces, 7u);
  }
}

TEST(MeshDecoder, WhatIsRefusedLeavesItAsItWas) {
  MeshDecoder decoder({});
  const auto topology = decode(decoder, MESH, mesh(SQUARE, HALVES)).topology;
  EXPECT_THROW(decode(decoder, MESH, mesh(SQUARE, {{1, 1, 2}, {3, 0, 0}})), MeshError) << "no triangle at all";
  EXPECT_THROW(decode(decoder, MESH, mesh(SQUARE, {{0, 1, 9}})), MeshError);
  EXPECT_EQ(decode(decoder, MESH, mesh(SQUARE, {})).topology, topology);
  // A soup of which every triangle is a point says nothing about the next one, whose triangles share an edge.
  MeshDecoder soups({});
  EXPECT_THROW(decode(soups, MARKER, marker({SQUARE[0], SQUARE[0], SQUARE[0], SQUARE[1], SQUARE[1], SQUARE[1]})),
               MeshError);
  const Positions halves = {SQUARE[0], SQUARE[1], SQUARE[2], SQUARE[0], SQUARE[2], SQUARE[3]};
  EXPECT_EQ(decode(soups, MARKER, marker(halves)).positions.size(), 4u);
}

TEST(MeshDecoder, OneTriangleIsNotTheGridBeforeIt) {
  Positions points;
  for (int k = 0; k < 16; ++k) points.push_back({k / 8 * 1.0, k % 8 * 1.0, 0});
  MeshInputConfig config;
  config.rows = 2;
  config.cols = 8;
  MeshDecoder decoder(config);
  EXPECT_EQ(decode(decoder, MESH, mesh(points, {})).topology->faces().size(), 14u);
  // Its indices are rows and columns.
  EXPECT_EQ(decode(decoder, MESH, mesh(points, {{2, 8, 0}})).topology->faces().size(), 1u);
}

TEST(MeshDecoder, RefusesOtherTypesAndWhatIsTooMuch) {
  EXPECT_TRUE(mentions(errorOf({}, "std_msgs/String", Bytes()), "std_msgs/String"));
  MeshInputConfig small;
  small.max_vertices = 3;
  EXPECT_TRUE(mentions(errorOf(small, MESH, mesh(SQUARE, HALVES)), "max_vertices"));
  small.max_vertices = 4;
  EXPECT_EQ(errorOf(small, MESH, mesh(SQUARE, HALVES)), "") << "so many may be";
  // Whatever makes the triangles: the message, its shape, or corners by three.
  small = grid(2, 2);
  small.max_faces = 1;
  EXPECT_TRUE(mentions(errorOf(small, CLOUD, cloud()), "2 triangles are more than the 1"));
  small.source = TopologySource::AUTO;
  small.rows = small.cols = 0;
  EXPECT_TRUE(mentions(errorOf(small, MESH, mesh(SQUARE, HALVES)), "2 triangles are more than the 1"));
  small.max_faces = 0;
  EXPECT_TRUE(mentions(errorOf(small, MARKER, marker({SQUARE[0], SQUARE[1], SQUARE[2]})), "1 triangles are more"));
}

TEST(MeshDecoder, EveryTruncationIsRefused) {
  struct Case {
    const char* type;
    Bytes bytes;
    MeshInputConfig config;
  };
  const Case cases[] = {{MESH, mesh(SQUARE, HALVES), {}},
                        {CLOUD, cloud(), grid(2, 2)},
                        {MARKER, marker({SQUARE[0], SQUARE[1], SQUARE[2]}), {}}};
  for (const Case& one : cases) {
    EXPECT_EQ(errorOf(one.config, one.type, one.bytes), "");
    for (std::size_t size = 0; size < one.bytes.data.size(); ++size) {
      Bytes cut = one.bytes;
      cut.data.resize(size);
      EXPECT_TRUE(mentions(errorOf(one.config, one.type, cut), "BAD_MESSAGE")) << one.type << " cut to " << size;
    }
  }
}

TEST(MeshDecoder, RandomBytesNeverDoMoreThanFail) {
  std::mt19937 random(7);
  const Bytes honest[] = {mesh(SQUARE, HALVES), cloud(), marker({SQUARE[0], SQUARE[1], SQUARE[2]})};
  const char* types[] = {
      MESH, CLOUD, MARKER, "visualization_msgs/MarkerArray", "pcl_msgs/PolygonMesh", "shape_msgs/Mesh"};
  std::size_t refused = 0;
  for (int i = 0; i < 20000; ++i) {
    Bytes bytes = honest[random() % 3];
    for (int k = 0; k < 4; ++k) bytes.data[random() % bytes.data.size()] = static_cast<std::uint8_t>(random());
    const char* type = types[random() % 6];
    MeshDecoder decoder(grid(2, 2));
    try {
      const DecodedMesh out = decode(decoder, type, bytes);
      EXPECT_EQ(out.positions.size(), out.topology->vertexCount());
    } catch (const MeshError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 1000u);
}

TEST(MeshDecoder, WeldsTheFirstFrameAndComesApartForGood) {
  const Vec3 a(0, 0, 0), b(1, 0, 0), c(0, 1, 0), d(1, 1, 0);
  MeshDecoder decoder({});
  const DecodedMesh first = decode(decoder, MARKER, marker({a, b, c, c, b, d}, 10));
  EXPECT_EQ(first.topology->vertexCount(), 4u);
  EXPECT_EQ(first.topology->edges().size(), 5u);
  EXPECT_EQ(first.positions[0], Vec3(10, 0, 0)) << "the marker's pose holds";
  const Vec3 away(0, 1, 0.5);
  const DecodedMesh apart = decode(decoder, MARKER, marker({a, b, c, away, b, d}));
  EXPECT_EQ(apart.weld_changes, 1u);
  EXPECT_EQ(apart.topology->vertexCount(), 5u);
  const DecodedMesh again = decode(decoder, MARKER, marker({a, b, c, c, b, d}));
  EXPECT_EQ(again.weld_changes, 0u);
  EXPECT_EQ(again.topology, apart.topology) << "what touches again is contact, not mesh";
  MeshInputConfig off;
  off.weld = false;
  MeshDecoder loose(off);
  EXPECT_EQ(decode(loose, MARKER, marker({a, b, c, c, b, d})).topology->vertexCount(), 6u);
}

}  // namespace
}  // namespace dccd
